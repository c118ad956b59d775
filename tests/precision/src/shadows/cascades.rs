//! Cascaded maps (Zhang, Sun, Xu and Lun 2006, parallel-split shadow maps): the depth of view in four parts, a map of equal size for each, fitted to
//! what the part shows.

use super::{
    ShadowFrame, ShadowMethod,
    depth_map::{DepthMap, MapFaces},
    seen::{SeenPoint, SeenPoints},
    slices,
};

const PARTS: usize = 4;
/// Share of the logarithmic split.
const LOGARITHMIC: f32 = 0.5;
/// A surface is looked up so far off itself, texels.
const OFF_TEXELS: f32 = 0.5;

/// Maps of the parts.
pub struct Cascades {
    side: usize,
    /// Depth at which each part ends, metres.
    ends: Vec<f32>,
    maps: Vec<DepthMap>,
    is_drawn: [bool; PARTS],
}

impl Cascades {
    /// Maps of `side` by `side` texels.
    pub fn new(side: usize) -> Self {
        let maps = (0..PARTS).map(|_| DepthMap::with_room(side, side)).collect();
        Self { side, ends: vec![0.0; PARTS + 1], maps, is_drawn: [false; PARTS] }
    }
}

impl ShadowMethod for Cascades {
    fn prepare(&mut self, frame: &ShadowFrame<'_>, _: &SeenPoints) {
        let axes = slices::axes(frame);
        let [near, far] = slices::depths(frame);
        self.ends = slices::split(near, far, PARTS, LOGARITHMIC);
        for (i, map) in self.maps.iter_mut().enumerate() {
            let needed = slices::needed(frame, &axes, [self.ends[i], self.ends[i + 1]]);
            self.is_drawn[i] = needed.is_some();
            let Some(needed) = needed else { continue };
            map.fit(axes, &needed, [self.side; 2]);
            let casters = frame.meshes.iter().filter(|mesh| needed.is_shaded_by(&axes.around(mesh.corners)));
            casters.for_each(|mesh| map.draw(mesh, MapFaces::FarSides));
        }
    }

    fn share(&self, point: &SeenPoint) -> f32 {
        let part = (1..PARTS).find(|i| point.depth < self.ends[*i]).unwrap_or(PARTS) - 1;
        if !self.is_drawn[part] {
            return 1.0;
        }
        let map = &self.maps[part];
        map.compared_2x2(map.at(point.place + point.normal * (OFF_TEXELS * map.texel_m())))
    }

    fn bytes(&self) -> usize {
        self.maps.iter().map(DepthMap::bytes).sum()
    }
}
