//! One tight map a boat, as the product has it: fitted to the box that holds the boat, with a texel for a pixel of the screen.

use glam::{Vec2, Vec3};

use super::{
    ShadowFrame, ShadowMethod,
    depth_map::{DepthMap, MapFaces, SunAxes, SunBox},
    mesh::CasterMesh,
    seen::{SeenPoint, SeenPoints},
};

/// A surface is looked up so far off itself, texels.
const OFF_TEXELS: f32 = 0.5;

/// A map for each mesh.
pub struct TightMaps {
    /// Texels along each side that all maps together may fill.
    side: usize,
    /// Texels of a pixel of the screen, each way.
    fineness: f32,
    maps: Vec<DepthMap>,
}

impl TightMaps {
    /// Maps that fill no more than `side` by `side` texels together, `fineness` texels for a pixel each way.
    pub fn new(side: usize, fineness: f32) -> Self {
        Self { side, fineness, maps: Vec::new() }
    }
}

/// Texels that one boat's map may fill each way: a sixteenth of all of them, so that sixteen fit side by side.
pub fn most_of(side: usize) -> f32 {
    (side / 4) as f32
}

/// Fits a map to a boat, with `fineness` texels for a pixel of the screen but no more than `most` each way; the box that it holds, and the casters that may shade it.
pub fn fit<'a>(
    map: &mut DepthMap,
    frame: &ShadowFrame<'a>,
    mesh: &CasterMesh,
    [fineness, most]: [f32; 2],
) -> (SunBox, impl Iterator<Item = &'a CasterMesh> + use<'a>) {
    let axes = SunAxes::new(frame.sun, mesh.ahead, mesh.across);
    let around = axes.around(mesh.corners);
    let span = (around.high - around.low).truncate();
    let middle = 0.125 * mesh.corners.iter().sum::<Vec3>();
    let pixel_m = frame.eye.pixel * (middle - frame.eye.position).length();
    let texel_m = (pixel_m / fineness).max(span.max_element() / most).max(1e-4);
    let size = (span / texel_m).ceil().max(Vec2::ONE);
    map.fit(axes, &around, [size.x as usize, size.y as usize]);
    (around, frame.meshes.iter().filter(move |other| around.is_shaded_by(&axes.around(other.corners))))
}

impl ShadowMethod for TightMaps {
    fn prepare(&mut self, frame: &ShadowFrame<'_>, _: &SeenPoints) {
        self.maps.resize_with(frame.meshes.len(), || DepthMap::with_room(0, 0));
        for (mesh, map) in frame.meshes.iter().zip(&mut self.maps) {
            let (_, casters) = fit(map, frame, mesh, [self.fineness, most_of(self.side)]);
            casters.for_each(|other| map.draw(other, MapFaces::FarSides));
        }
    }

    fn share(&self, point: &SeenPoint) -> f32 {
        // What is no boat has no map.
        let Some(map) = self.maps.get(point.mesh as usize) else { return 1.0 };
        map.compared_2x2(map.at(point.place + point.normal * (OFF_TEXELS * map.texel_m())))
    }

    fn bytes(&self) -> usize {
        self.maps.iter().map(DepthMap::bytes).sum()
    }
}
