//! Ways of finding how much of the sun a place on a boat sees, behind one interface, as a small rasteriser on the processor: so that a map
//! of each boat's own is held against its rivals by error and by time alike. Nothing here is shared with the renderer.

mod cascades;
mod depth_map;
mod gaussian;
pub mod mesh;
mod moments;
pub mod seen;
mod slices;
mod tight;
mod volumes;
mod whole;
mod zgaf;

use glam::Vec3;

use mesh::CasterMesh;
use seen::{SeenPoint, SeenPoints};

pub use volumes::{FIVE_STAGES, FOUR_STAGES, Stage};

/// One frame: the sun, what stands in its light, and the eye. Metres; all places are about one origin.
pub struct ShadowFrame<'a> {
    /// Unit vector towards the sun.
    pub sun: Vec3,
    /// What throws shadows.
    pub meshes: &'a [CasterMesh],
    /// The eye.
    pub eye: ShadowEye,
}

/// The eye of a frame.
#[derive(Clone, Copy, Debug)]
pub struct ShadowEye {
    /// Its place, metres.
    pub position: Vec3,
    /// Unit vectors to the right, downwards and ahead.
    pub axes: [Vec3; 3],
    /// Tangents of half the view, across and down.
    pub reach: [f32; 2],
    /// Metres that a pixel spans at a distance of a metre.
    pub pixel: f32,
}

impl ShadowEye {
    /// Distance ahead, metres.
    pub fn depth(&self, place: Vec3) -> f32 {
        (place - self.position).dot(self.axes[2])
    }
}

/// One way of finding shadows.
pub trait ShadowMethod {
    /// Takes in a frame: draws its maps, or counts its volumes before what is seen.
    fn prepare(&mut self, frame: &ShadowFrame<'_>, seen: &SeenPoints);
    /// Share of the sun, 0 to 1, at a point that was seen when the frame was prepared.
    fn share(&self, point: &SeenPoint) -> f32;
    /// Bytes that it holds between frames.
    fn bytes(&self) -> usize;
}

/// A method of the comparison, by its name and setting.
#[derive(Clone, Copy)]
pub struct NamedMethod {
    /// The method.
    pub method: &'static str,
    /// Its setting.
    pub setting: &'static str,
    /// Whether it needs up to four points of each pixel and not one.
    pub four_points: bool,
    /// Whether the short form of the report leaves it out: it takes its time.
    pub is_dear: bool,
    /// Makes it.
    pub make: fn() -> Box<dyn ShadowMethod>,
}

impl NamedMethod {
    const fn new(method: &'static str, setting: &'static str, make: fn() -> Box<dyn ShadowMethod>) -> Self {
        Self { method, setting, four_points: false, is_dear: false, make }
    }

    const fn dear(self) -> Self {
        Self { is_dear: true, ..self }
    }

    const fn at_four_points(self) -> Self {
        Self { four_points: true, ..self }
    }
}

const TIGHT: &str = "a map a boat";
const PLAIN: &str = "one map of the scene";
const PCF: &str = "one map, PCF";
const CASCADES: &str = "cascaded maps";
const ZGAF: &str = "Z-GaF maps";

const PLAIN_1024: NamedMethod =
    NamedMethod::new(PLAIN, "1024 x 1024", || Box::new(whole::WholeMap::new(1024, 1)));
const PLAIN_2048: NamedMethod =
    NamedMethod::new(PLAIN, "2048 x 2048", || Box::new(whole::WholeMap::new(2048, 1)));
const PCF_1024: NamedMethod =
    NamedMethod::new(PCF, "1024 x 1024, 3 x 3 texels", || Box::new(whole::WholeMap::new(1024, 3)));
const PCF_2048: NamedMethod =
    NamedMethod::new(PCF, "2048 x 2048, 3 x 3 texels", || Box::new(whole::WholeMap::new(2048, 3)));
const CASCADES_1024: NamedMethod =
    NamedMethod::new(CASCADES, "four of 1024 x 1024", || Box::new(cascades::Cascades::new(1024)));
const CASCADES_2048: NamedMethod =
    NamedMethod::new(CASCADES, "four of 2048 x 2048", || Box::new(cascades::Cascades::new(2048)));
const ZGAF_1024: NamedMethod =
    NamedMethod::new(ZGAF, "1024 x 1024", || Box::new(zgaf::ZGaf::new(1024, zgaf::Layers::Fitted)));
const ZGAF_2048: NamedMethod =
    NamedMethod::new(ZGAF, "2048 x 2048", || Box::new(zgaf::ZGaf::new(2048, zgaf::Layers::Fitted)));

/// All methods; the first is the product's.
pub const METHODS: &[NamedMethod] = &[
    NamedMethod::new(TIGHT, "1024 x 1024, 2 x 2 texels", || Box::new(tight::TightMaps::new(1024, 1.0))),
    NamedMethod::new(TIGHT, "2048 x 2048, two texels a pixel", || Box::new(tight::TightMaps::new(2048, 2.0))),
    NamedMethod::new(TIGHT, "1024 x 1024, four points a pixel", || {
        Box::new(tight::TightMaps::new(1024, 1.0))
    })
    .at_four_points(),
    NamedMethod::new(TIGHT, "2048 x 2048, two texels and four points a pixel", || {
        Box::new(tight::TightMaps::new(2048, 2.0))
    })
    .at_four_points(),
    NamedMethod::new("no shadow", "", || Box::new(NoShadow)),
    PLAIN_1024,
    PLAIN_2048.dear(),
    PCF_1024,
    PCF_2048.dear(),
    NamedMethod::new(CASCADES, "four of 512 x 512", || Box::new(cascades::Cascades::new(512))),
    CASCADES_1024.dear(),
    NamedMethod::new(ZGAF, "1024 x 1024, as printed", || {
        Box::new(zgaf::ZGaf::new(1024, zgaf::Layers::Apart))
    }),
    ZGAF_1024,
    ZGAF_2048.dear(),
    NamedMethod::new("variance map", "1024 x 1024", || Box::new(moments::MomentMap::<2>::new(1024))),
    NamedMethod::new("moment map", "1024 x 1024", || Box::new(moments::MomentMap::<4>::new(1024))),
    NamedMethod::new("moment map", "2048 x 2048", || Box::new(moments::MomentMap::<4>::new(2048))).dear(),
    NamedMethod::new("moment map a boat", "1024 x 1024", || Box::new(moments::MomentMaps::new(1024))),
    NamedMethod::new("shadow volumes", "depth-fail, to infinity", || {
        Box::new(volumes::ShadowVolumes::new(volumes::Counting::DepthFail))
    }),
    NamedMethod::new("shadow volumes", "depth-fail, to infinity, four points a pixel", || {
        Box::new(volumes::ShadowVolumes::new(volumes::Counting::DepthFail))
    })
    .at_four_points(),
    NamedMethod::new("shadow volumes", "depth-pass, 1000 m, as printed", || {
        Box::new(volumes::ShadowVolumes::new(volumes::Counting::DepthPass { length_m: 1000.0 }))
    }),
];

/// Methods of Kolivand and Sunar's Table 1 in its order, and frames a second as printed, at its two resolutions; each cascade has as many texels as the one
/// map.
pub const TABLE_1: [(usize, [(NamedMethod, f64); 4]); 2] = [
    (1024, [(PLAIN_1024, 122.0), (PCF_1024, 75.0), (CASCADES_1024, 84.0), (ZGAF_1024, 96.0)]),
    (2048, [(PLAIN_2048, 116.0), (PCF_2048, 63.0), (CASCADES_2048, 79.0), (ZGAF_2048, 90.0)]),
];

/// Nothing stands in the sun's light.
struct NoShadow;

impl ShadowMethod for NoShadow {
    fn prepare(&mut self, _: &ShadowFrame<'_>, _: &SeenPoints) {}

    fn share(&self, _: &SeenPoint) -> f32 {
        1.0
    }

    fn bytes(&self) -> usize {
        0
    }
}
