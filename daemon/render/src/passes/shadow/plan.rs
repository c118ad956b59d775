//! Boats as the sun sees them, decided before anything is recorded: each boat that may be shaded has a place of its own in the shadow map, fitted
//! to it, with a texel for a pixel of the screen. Into it is drawn the boat itself, and each other that stands between it and the sun.
//! So the map's resolution is where it is seen, at any angle between sun and view.

use ash::vk;
use bowwave_core::{
    frame::scene::{BoatView, PixelRect, Scene},
    geometry::RigidPose,
    model::{Model, ModelId, ModelKind},
};
use glam::{DMat3, DQuat, DVec3};
use shaders_spirv::interface::ShadowBlock;

use crate::{
    passes::atlas::{self, Placed},
    rects::rect,
    view::{self, Shade},
};

/// Texels of the shadow map.
pub(super) const MAP: (u32, u32) = (1024, 1024);
/// Texels of a place for a pixel of the screen, each way.
const TEXELS_A_PIXEL: f64 = 1.0;
/// Texels of a place along its longer side: those of a near boat are larger than a pixel, those of a far one smaller. A boat of a few pixels
/// costs by its triangles and not by its texels.
const PLACE_MIN: f64 = 96.0;
const PLACE_MAX: f64 = 256.0;
/// Most nearness to the sun, metres above the lowest place of a boat: what is further up its light shades nothing.
const DEPTH_M: f64 = 4096.0;
/// A surface is looked up so far off itself, texels. Closed hulls need nothing, since the map holds their far sides; both sides of an open
/// shell lie in the same place. Farther off, what a gunwale shades would stand out of its shadow.
const OFF_TEXELS: f64 = 0.2;
/// Boats are drawn simplified by no more than this, texels: a gunwale's shadow is about one wide.
const DETAIL_TEXELS: f64 = 0.5;
/// Boats that are drawn for one that may be shaded, itself included, on the average over all.
const CASTERS_MAX: usize = 4;

/// One boat drawn onto the place of one that it may shade.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadowDraw {
    pub(super) model: ModelId,
    /// By how much it may be simplified, metres.
    pub(super) detail_m: f64,
    pub(super) place: PixelRect,
    pub(super) block: ShadowBlock,
}

/// A boat as the sun sees it: axes to the right, upwards and towards the sun, in which a box holds it.
#[derive(Clone, Copy, Debug)]
struct SunView {
    /// To these axes from the world's, about the boat's origin.
    from_world: DMat3,
    origin: DVec3,
    low: DVec3,
    size: DVec3,
}

impl SunView {
    fn of(sun: DVec3, pose: &RigidPose, model: &Model) -> Self {
        // Along the boat, so that the box is tight.
        let ahead = pose.world_from_body * DVec3::X;
        let across = pose.world_from_body * DVec3::Y;
        let right = ahead.reject_from_normalized(sun).try_normalize();
        let right = right.unwrap_or_else(|| across.reject_from_normalized(sun).normalize_or_zero());
        let from_world = DMat3::from_cols(right, sun.cross(right), sun).transpose();
        let mut view = Self { from_world, origin: pose.position, low: DVec3::ZERO, size: DVec3::ZERO };
        let (middle, half) = view.around(pose, model);
        (view.low, view.size) = (middle - half, (2.0 * half).max(DVec3::splat(1e-3)));
        view
    }

    /// Matrix and shift to these axes from a boat's own.
    fn of_boat(&self, pose: &RigidPose) -> (DMat3, DVec3) {
        let turn = self.from_world * DMat3::from_quat(pose.world_from_body);
        (turn, self.from_world * (pose.position - self.origin))
    }

    /// Middle and half the size of a box that holds a boat.
    fn around(&self, pose: &RigidPose, model: &Model) -> (DVec3, DVec3) {
        let (low, high) = (model.min.as_dvec3(), model.max.as_dvec3());
        let (turn, shift) = self.of_boat(pose);
        let reach = |row: usize| turn.row(row).abs().dot(0.5 * (high - low));
        (turn * (0.5 * (low + high)) + shift, DVec3::new(reach(0), reach(1), reach(2)))
    }

    /// Tests whether a boat may stand in the light of this one.
    fn is_shaded_by(&self, pose: &RigidPose, model: &Model) -> bool {
        let (middle, half) = self.around(pose, model);
        let apart = (middle - (self.low + 0.5 * self.size)).abs() - half - 0.5 * self.size;
        apart.x < 0.0 && apart.y < 0.0 && middle.z + half.z > self.low.z
    }

    /// Texels that are wanted: one for `pixel_m`, within the bounds of a place.
    fn texels(&self, pixel_m: f64) -> PixelRect {
        let long = self.size.x.max(self.size.y);
        let texel_m = (pixel_m / TEXELS_A_PIXEL).min(long / PLACE_MIN).max(long / PLACE_MAX).max(1e-4);
        let count = |m: f64| (m / texel_m).ceil().max(1.0) as u32;
        PixelRect { x: 0, y: 0, width: count(self.size.x), height: count(self.size.y) }
    }

    /// Metres that a texel spans where this many are placed so.
    fn texel_m(&self, wanted: &PixelRect, placed: &Placed) -> f64 {
        let across = self.size.x / (f64::from(wanted.width) * placed.scale);
        across.max(self.size.y / (f64::from(wanted.height) * placed.scale))
    }

    /// Rows of the matrix from a boat's space to texels of the map and nearness to the sun.
    fn rows(&self, pose: &RigidPose, wanted: &PixelRect, placed: &Placed) -> [[f64; 4]; 3] {
        let (turn, shift) = self.of_boat(pose);
        let row = |axis: usize, scale: f64, offset: f64| {
            let along = turn.row(axis) * scale;
            [along.x, along.y, along.z, (shift[axis] - self.low[axis]) * scale + offset]
        };
        let x = f64::from(wanted.width) * placed.scale / self.size.x;
        let y = f64::from(wanted.height) * placed.scale / self.size.y;
        // A metre below the boat is as far as anything is from the sun.
        [row(0, x, placed.offset.x), row(1, y, placed.offset.y), row(2, 1.0 / DEPTH_M, 1.0 / DEPTH_M)]
    }
}

/// What a boat hides from the sun of all that lies behind it, by its place in the map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ThrownShadow {
    /// Rows of the matrix from the world to texels and nearness to the sun.
    pub(crate) from_world: [[f64; 4]; 3],
    /// Lowest and highest place, texels, at which the boat is looked up.
    pub(crate) texels: [f32; 4],
}

/// One frame's shadow map.
#[derive(Default)]
pub(crate) struct ShadowPlan {
    /// Each boat of the scene in its place; none where the sun does not shine, or where no hull of it is in view.
    shades: Vec<Shade>,
    pub(crate) draws: Vec<ShadowDraw>,
    pub(super) clears: Vec<vk::ClearRect>,
    views: Vec<Option<SunView>>,
    wanted: Vec<(PixelRect, f64)>,
    places: Vec<Placed>,
}

impl ShadowPlan {
    pub(crate) fn with_capacity(boats: usize) -> Self {
        Self {
            shades: Vec::with_capacity(boats),
            draws: Vec::with_capacity(boats * CASTERS_MAX),
            clears: Vec::with_capacity(boats),
            views: Vec::with_capacity(boats),
            wanted: Vec::with_capacity(boats),
            places: Vec::with_capacity(boats),
        }
    }

    /// The shade of a boat of the scene, by its number there.
    pub(crate) fn shade(&self, boat: usize) -> &Shade {
        self.shades.get(boat).unwrap_or(&Shade::NONE)
    }

    /// The shadow that a boat of the scene, by its number there, throws behind itself; none where it has no place in the map.
    pub(crate) fn thrown(&self, boat: usize) -> Option<ThrownShadow> {
        let view = self.views.get(boat)?.as_ref()?;
        let world = RigidPose { world_from_body: DQuat::IDENTITY, position: DVec3::ZERO };
        let ((wanted, _), placed) = self.wanted.get(boat).zip(self.places.get(boat))?;
        Some(ThrownShadow { from_world: view.rows(&world, wanted, placed), texels: texels(placed) })
    }

    pub(crate) fn clear(&mut self) {
        self.shades.clear();
        self.draws.clear();
        self.clears.clear();
        self.views.clear();
        self.wanted.clear();
        self.places.clear();
    }

    /// Finds the places of `scene`'s boats, and what is drawn into each.
    pub(crate) fn make<'a>(&mut self, scene: &Scene, model: impl Fn(ModelId) -> Option<&'a Model>) {
        let sun = scene.light.sun_direction;
        let mesh = |boat: &BoatView| model(boat.model).filter(|m| m.kind == ModelKind::Mesh);
        for boat in &scene.boats {
            // In the sea's mirror nothing is shaded.
            let drawn = mesh(boat).filter(|_| boat.hull.is_some());
            let view = drawn.map(|model| SunView::of(sun, &boat.pose, model));
            let texels = view.map(|v| v.texels(view::pixel_m(scene, boat)));
            self.views.push(view);
            let nothing = PixelRect { x: 0, y: 0, width: 1, height: 1 };
            self.wanted.push((texels.unwrap_or(nothing), 1.0));
        }
        atlas::place(MAP, &self.wanted, &mut self.places);
        let draws_max = scene.boats.len() * CASTERS_MAX;
        let views = self.views.iter().zip(&self.wanted).zip(&self.places);
        for ((i, boat), ((view, (wanted, _)), placed)) in scene.boats.iter().enumerate().zip(views) {
            let Some(view) = view else {
                self.shades.push(Shade::NONE);
                continue;
            };
            let texel_m = view.texel_m(wanted, placed);
            let from_boat = view.rows(&boat.pose, wanted, placed).map(|row| row.map(|v| v as f32));
            let off_m = (OFF_TEXELS * texel_m) as f32;
            self.shades.push(Shade { from_boat, texels: texels(placed), off_m });
            self.clears.push(vk::ClearRect { rect: rect(placed.place), base_array_layer: 0, layer_count: 1 });
            // Each boat that is still to come has room for itself.
            let room = draws_max - (scene.boats.len() - i);
            for (n, other) in scene.boats.iter().enumerate() {
                let Some(caster) = mesh(other) else { continue };
                let shades = n == i || (self.draws.len() < room && view.is_shaded_by(&other.pose, caster));
                if !shades {
                    continue;
                }
                self.draws.push(ShadowDraw {
                    model: other.model,
                    detail_m: DETAIL_TEXELS * texel_m,
                    place: placed.place,
                    block: ShadowBlock { clip_from_boat: clip(view.rows(&other.pose, wanted, placed)) },
                });
            }
        }
    }
}

/// Lowest and highest place at which a boat's texels are looked up. A look-up takes four texels: nearer to the edge some of them are another's.
fn texels(placed: &Placed) -> [f32; 4] {
    const EDGE: u32 = 1;
    let PixelRect { x, y, width, height } = placed.place;
    [x + EDGE, y + EDGE, x + width - EDGE, y + height - EDGE].map(|texel| texel as f32)
}

/// Rows of [`SunView::rows`], to clip space.
fn clip(rows: [[f64; 4]; 3]) -> [[f32; 4]; 3] {
    let spans = [f64::from(MAP.0), f64::from(MAP.1)];
    let mut clip = rows;
    for (row, span) in clip.iter_mut().zip(spans) {
        *row = row.map(|v| 2.0 * v / span);
        row[3] -= 1.0;
    }
    clip.map(|row| row.map(|v| v as f32))
}
