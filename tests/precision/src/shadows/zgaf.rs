//! Z-GaF shadow maps (Kolivand and Sunar 2014, equations 10 to 14, table 1): the depth of view in parts from the first object on, a map of its own
//! resolution for each, and the depths about a texel taken for Gaussian ones.
//!
//! The text leaves open how the Gaussian is compared. It names it an upper bound beside Chebyshev's of variance maps, and says that it leaks no light: so it is
//! here the share of a Gaussian of the blurred mean and variance that lies behind the surface, doubled so that a surface at the mean is lit. Its fog belongs
//! to the picture's colours and not to shadows.

use glam::Vec3;

use super::{
    ShadowFrame, ShadowMethod,
    depth_map::{DepthMap, MapFaces, SunAxes, SunBox},
    gaussian::MomentTexels,
    seen::{SeenPoint, SeenPoints},
    slices,
};

const PARTS: usize = 3;
/// Share of the logarithmic split: equation 10.
const LOGARITHMIC: f32 = 0.5;

/// What a part's map holds, and where it is looked up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layers {
    /// All of its part of the view, whatever is in it, without what the nearer part's map holds: equation 14 as printed. A place is looked up in the
    /// nearest part's map that holds it.
    Apart,
    /// All that stands in the light of the objects in its part. A place is looked up in the map of its own depth.
    Fitted,
}

/// Maps of the parts.
pub struct ZGaf {
    /// Texels along the side of the nearest part's map; each farther one has half as many.
    side: usize,
    layers: Layers,
    ends: Vec<f32>,
    maps: Vec<(DepthMap, MomentTexels<2>)>,
    /// Axes of the maps, and the box that each of them holds; nothing where it is empty.
    axes: SunAxes,
    boxes: [Option<SunBox>; PARTS],
}

impl ZGaf {
    /// Maps of `side`, `side` / 2 and `side` / 4 texels each way.
    pub fn new(side: usize, layers: Layers) -> Self {
        let map = |i: usize| (DepthMap::with_room(side >> i, side >> i), MomentTexels::default());
        Self {
            side,
            layers,
            ends: vec![0.0; PARTS + 1],
            maps: (0..PARTS).map(map).collect(),
            axes: SunAxes::new(Vec3::Z, Vec3::X, Vec3::Y),
            boxes: [None; PARTS],
        }
    }
}

impl ZGaf {
    /// The part whose map a point is looked up in.
    fn part(&self, point: &SeenPoint) -> Option<usize> {
        if self.layers == Layers::Apart {
            let p = self.axes.of(point.place).truncate();
            let holds = |b: &SunBox| b.low.truncate().cmple(p).all() && p.cmple(b.high.truncate()).all();
            return self.boxes.iter().position(|b| b.as_ref().is_some_and(holds));
        }
        let part = (1..PARTS).find(|i| point.depth < self.ends[*i]).unwrap_or(PARTS) - 1;
        self.boxes[part].map(|_| part)
    }
}

impl ShadowMethod for ZGaf {
    fn prepare(&mut self, frame: &ShadowFrame<'_>, _: &SeenPoints) {
        let axes = slices::axes(frame);
        self.axes = axes;
        let [near, far] = slices::depths(frame);
        self.ends = slices::split(near, far, PARTS, LOGARITHMIC);
        let mut nearer = None;
        for (i, (map, moments)) in self.maps.iter_mut().enumerate() {
            let depths = [self.ends[i], self.ends[i + 1]];
            let needed = match self.layers {
                Layers::Apart => Some(slices::whole(frame, &axes, depths)),
                Layers::Fitted => slices::needed(frame, &axes, depths),
            };
            self.boxes[i] = needed;
            let Some(needed) = needed else { continue };
            map.fit(axes, &needed, [self.side >> i; 2]);
            let casters = frame.meshes.iter().filter(|mesh| needed.is_shaded_by(&axes.around(mesh.corners)));
            casters.for_each(|mesh| map.draw(mesh, MapFaces::All));
            if let (Layers::Apart, Some(nearer)) = (self.layers, nearer) {
                map.forget(&nearer);
            }
            moments.take(map, &needed);
            nearer = Some(needed);
        }
    }

    fn share(&self, point: &SeenPoint) -> f32 {
        let Some(part) = self.part(point) else { return 1.0 };
        let (map, moments) = &self.maps[part];
        // No bias: they need none, they say.
        let at = map.at(point.place);
        let ([mean, square], depth) = (moments.at(at), moments.depth(at.z));
        let deviation = (square - mean * mean).max(1e-9).sqrt();
        behind((depth - mean) / deviation)
    }

    fn bytes(&self) -> usize {
        self.maps.iter().map(|(map, moments)| map.bytes() + moments.bytes()).sum()
    }
}

/// Upper bound of the share of a Gaussian beyond so many deviations from its mean: 1 before it.
fn behind(deviations: f32) -> f32 {
    if deviations <= 0.0 { 1.0 } else { libm::erfcf(deviations * std::f32::consts::FRAC_1_SQRT_2) }
}
