//! One depth map of the whole scene (Williams 1978), compared at one texel or, as percentage closer filtering, at several (Reeves, Salesin and Cook
//! 1987).

use super::{
    ShadowFrame, ShadowMethod,
    depth_map::{DepthMap, MapFaces},
    seen::{SeenPoint, SeenPoints},
    slices,
};

/// A surface is looked up so far off itself, texels.
const OFF_TEXELS: f32 = 0.5;

/// One map, fitted to all meshes.
pub struct WholeMap {
    side: usize,
    /// Texels across the filter; 1 for the one texel.
    filter: u32,
    map: DepthMap,
}

impl WholeMap {
    /// A map of `side` by `side` texels.
    pub fn new(side: usize, filter: u32) -> Self {
        Self { side, filter, map: DepthMap::with_room(side, side) }
    }
}

impl ShadowMethod for WholeMap {
    fn prepare(&mut self, frame: &ShadowFrame<'_>, _: &SeenPoints) {
        let axes = slices::axes(frame);
        let around = axes.around(frame.meshes.iter().flat_map(|mesh| mesh.corners));
        self.map.fit(axes, &around, [self.side; 2]);
        frame.meshes.iter().for_each(|mesh| self.map.draw(mesh, MapFaces::FarSides));
    }

    fn share(&self, point: &SeenPoint) -> f32 {
        let at = self.map.at(point.place + point.normal * (OFF_TEXELS * self.map.texel_m()));
        if self.filter > 1 { self.map.filtered(at, self.filter) } else { self.map.compared(at) }
    }

    fn bytes(&self) -> usize {
        self.map.bytes()
    }
}
