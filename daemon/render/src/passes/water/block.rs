//! The numbers that put one boat onto the sea in one frame: what is the same for all methods, and each method's own.

use bowwave_core::{
    estimate::light::Light,
    frame::scene::{BoatView, Scene},
    sea::fresnel,
    water::{ReflectionMethod, ShadowLevel},
};
use bytemuck::Pod;
use glam::{DVec2, Vec3};
use shaders_spirv::{
    glsl::{METHODS, number},
    interface::{LOBE_COLUMNS, MethodBytes, WaterBlock, method_bytes},
};

use super::{baked::contact::contact_block, full, line::HullLine, mirror, physics};
use crate::passes::atlas::{Placed, SCALE_MAX};

/// Highest wind force at which a reflection is seen.
pub(super) const FORCE_MAX: usize = 4;

/// As published: the sine moves the mirror coordinate by up to this, pixels.
const PUBLISHED_SHIFT_PX: [f64; FORCE_MAX + 1] = [4.0, 7.0, 10.0, 13.0, 16.0];
/// As published: share of the largest shift beyond which the reflection is discarded.
const PUBLISHED_LIMIT: f64 = 0.7;
/// As published: i and k (pixels) of eq. 7 for levels 1 and 2.
const PUBLISHED_SHADOW: [(f64, f64); 2] = [(0.5, 120.0), (0.9, 25.0)];

/// k of eq. 6 in heights of the boat on the screen, by wind force.
pub(super) const FADE_HEIGHTS: [f64; FORCE_MAX + 1] = [2.4, 1.6, 1.15, 0.8, 0.55];
/// Largest shift in heights of the boat.
const SHIFT_HEIGHTS: [f64; FORCE_MAX + 1] = [0.08, 0.20, 0.26, 0.29, 0.30];
/// Share of the largest shift at which it stops.
const LIMIT: f64 = 0.5;
/// How far sideways a wave moves the reflection, in parts of how far down; as `water.frag` has it.
const SIDEWAYS: f64 = 0.35;
/// Width of the box blur in heights of the boat.
const BLUR_HEIGHTS: [f64; FORCE_MAX + 1] = [0.018, 0.035, 0.06, 0.09, 0.12];
/// Brightness over which the video begins to pass through, and over which it passes whole; dark, then bright.
const PASSES: [f32; 4] = [0.02, 0.08, 0.80, 0.95];
/// i and k (heights of the boat) of eq. 7 for levels 1 and 2.
const SHADOW: [(f64, f64); 2] = [(0.35, 0.55), (0.7, 0.16)];
/// Spread of the nine gradients, in codes 0 to 1, that a camera's noise alone makes.
const NOISE_SPREAD: f64 = 0.03;
/// Pixels between the nine gradients' places, in heights of the boat, and at most.
const STEP_HEIGHTS: f64 = 0.012;
const STEP_MAX_PX: f64 = 8.0;

/// Wind speed in the middle of each force, m/s (WMO-No. 306, code table 1100).
const WIND_M_S: [f64; FORCE_MAX + 1] = [0.1, 0.9, 2.5, 4.4, 6.7];

/// A method's part of one boat in one frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MethodPlan {
    own: MethodBytes,
    len: usize,
    /// Pixels below the hull-water line at which nothing is mirrored any more.
    pub(crate) fade_px: f64,
    /// Pixels right or left and up or down by which light can be seen off its mirror picture.
    pub(crate) reach_px: DVec2,
}

impl MethodPlan {
    /// A plan with a block of the method's own.
    pub(crate) fn new<T: Pod>(block: &T, fade_px: f64, reach_px: DVec2) -> Self {
        let (own, len) = method_bytes(block);
        Self { own, len, fade_px, reach_px }
    }

    /// The method's own block.
    pub(crate) fn own(&self) -> &[f32] {
        &self.own[..self.len]
    }
}

/// Texels of the mirror layer for each pixel that a boat needs: softened, three for each step of the blur.
pub(crate) fn mirror_scale(scene: &Scene, line: &HullLine) -> f64 {
    match scene.water.method {
        ReflectionMethod::Full => SCALE_MAX / blur_px(scene, line).max(1.0),
        // Its bands have so many columns; twice as many texels keep what is thin.
        ReflectionMethod::Baked => {
            let (left, right) = line.ends();
            (2.0 * f64::from(LOBE_COLUMNS) / (right - left).max(1.0)).min(1.0)
        }
        _ => 1.0,
    }
}

pub(super) fn force(scene: &Scene) -> usize {
    usize::from(scene.water.force.get()).min(FORCE_MAX)
}

fn blur_px(scene: &Scene, line: &HullLine) -> f64 {
    BLUR_HEIGHTS[force(scene)] * line.height
}

/// Largest shift, and the shift at which it stops, pixels.
pub(super) fn largest_shift_px(scene: &Scene, line: &HullLine) -> (f64, f64) {
    let shift = SHIFT_HEIGHTS[force(scene)] * line.height.max(1.0);
    (shift, shift * LIMIT)
}

/// The same as published.
pub(super) fn published_shift_px(scene: &Scene) -> (f64, f64) {
    let shift = PUBLISHED_SHIFT_PX[force(scene)];
    (shift, shift * PUBLISHED_LIMIT)
}

/// How far waves move a reflection across and down that stops at `limit_px`.
pub(super) fn shift_reach(line: &HullLine, limit_px: f64) -> DVec2 {
    let down = line.down.abs();
    (down + SIDEWAYS * DVec2::new(down.y, down.x)) * limit_px
}

/// The block of one boat whose mirror image lies at `placed`, and the method's part.
pub(crate) fn water_block(
    scene: &Scene,
    boat: &BoatView,
    line: &HullLine,
    placed: &Placed,
) -> (WaterBlock, MethodPlan) {
    let height = line.height.max(1.0);
    let published = matches!(
        scene.water.method,
        ReflectionMethod::FullAsPublished | ReflectionMethod::PhysicsAsPublished
    );
    let (shadow, shadow_px) = match (scene.water.shadow, published) {
        (ShadowLevel::None, _) => (0.0, 1.0),
        (level, false) => (SHADOW[level as usize - 1].0, SHADOW[level as usize - 1].1 * height),
        (level, true) => PUBLISHED_SHADOW[level as usize - 1],
    };
    let texels = DVec2::new(f64::from(placed.atlas.0), f64::from(placed.atlas.1));
    let pair = |v: DVec2| v.as_vec2().to_array();
    let mut block = WaterBlock {
        anchor: pair(line.anchor),
        down: pair(line.down),
        columns: [line.first as f32, (1.0 / line.pitch) as f32],
        mirror_scale: pair(DVec2::splat(placed.scale) / texels),
        mirror_offset: pair(placed.offset / texels),
        pad: [0.0; 2],
        mirror_bounds: placed.bounds(),
        passes: PASSES,
        shadow: shadow as f32,
        shadow_fall: (1.0 / shadow_px) as f32 * if published { 1.0 } else { shadow as f32 },
        step: (STEP_HEIGHTS * height).clamp(1.0, STEP_MAX_PX) as f32,
        flat_spread: NOISE_SPREAD as f32,
        hull_line: line.below.map(|b| b as f32),
    };
    let plan = match scene.water.method {
        ReflectionMethod::Off => MethodPlan::new(&[0.0_f32; 4], 0.0, DVec2::ZERO),
        ReflectionMethod::Mirror => mirror::plan(scene, boat, line),
        ReflectionMethod::FullAsPublished => full::as_published(scene, &block),
        ReflectionMethod::Full => full::corrected(scene, boat, line),
        ReflectionMethod::PhysicsAsPublished => physics::as_published(scene, boat, line),
        ReflectionMethod::Physics => physics::corrected(scene, boat, line),
        ReflectionMethod::Baked if scene.water.shadow == ShadowLevel::None => {
            MethodPlan::new(&[0.0_f32; 8], 0.0, DVec2::ZERO)
        }
        ReflectionMethod::Baked => {
            MethodPlan::new(&contact_block(scene, boat, line, &mut block), 0.0, DVec2::ZERO)
        }
    };
    (block, plan)
}

/// Light of the sky that an untilted sea mirrors under a tangent below the horizontal.
pub(crate) fn mirrored_sky(light: &Light, down: f64, rough: f64) -> Vec3 {
    let up = 0.5 * (down + (down * down + rough * rough).sqrt());
    let t = (up / 0.6).clamp(0.0, 1.0) as f32;
    fresnel(up) as f32 * light.horizon.lerp(light.sky, t * t * (3.0 - 2.0 * t))
}

/// Share of a boat's light that the sea throws back at the boat's range: Fresnel's formula for unpolarised light, at the
/// grazing angle of the view plus half the waves' typical slope, since it is the slopes that face the eye that are seen.
pub(super) fn mirrored_share(scene: &Scene, boat: &BoatView) -> f64 {
    let eye = (scene.camera.position.z - boat.water_level).max(0.0);
    let grazing = eye.atan2(boat.range_m.max(1.0));
    // Cox and Munk 1954, upwind.
    let slope = (0.00316 * WIND_M_S[force(scene)]).sqrt();
    fresnel((grazing + 0.5 * slope).min(std::f64::consts::FRAC_PI_2).sin()).sqrt()
}

/// The shader's number of a method.
pub(super) const fn method_constant(method: ReflectionMethod) -> u32 {
    const fn of(name: &str) -> u32 {
        number(METHODS, name)
    }
    match method {
        ReflectionMethod::Off => const { of("METHOD_OFF") },
        ReflectionMethod::Mirror => const { of("METHOD_MIRROR") },
        ReflectionMethod::FullAsPublished => const { of("METHOD_FULL_AS_PUBLISHED") },
        ReflectionMethod::Full => const { of("METHOD_FULL") },
        ReflectionMethod::PhysicsAsPublished => const { of("METHOD_PHYSICS_AS_PUBLISHED") },
        ReflectionMethod::Physics => const { of("METHOD_PHYSICS") },
        ReflectionMethod::Baked => const { of("METHOD_BAKED") },
    }
}

/// The shader's number of a shadow level.
pub(super) const fn shadow_constant(shadow: ShadowLevel) -> u32 {
    match shadow {
        ShadowLevel::None => const { number(METHODS, "SHADOW_NONE") },
        ShadowLevel::Gradual => const { number(METHODS, "SHADOW_GRADUAL") },
        ShadowLevel::Strong => const { number(METHODS, "SHADOW_STRONG") },
    }
}
