//! Navigation lights on the screen and in the layer of mirrored boats.

use std::f64::consts::PI;

use bowwave_core::frame::{
    scene::{LightView, PixelRect, Scene},
    view::{NEAR_M, clip_to_screen},
};
use glam::{DVec2, DVec3, Vec3};
use shaders_spirv::interface::LightBlock;

use crate::{passes::atlas::Placed, rects::corners};

/// Standard deviation of the core, pixels: lens and pixel together.
const CORE_PX: f64 = 0.65;
/// Share of the light that a lens scatters about it (veiling glare; ISO 9358 finds 2 to 6 % of ordinary lenses), ...
const GLOW_SHARE: f64 = 0.04;
/// ...and the radius within which half of that falls, in heights of the picture.
const GLOW_RADIUS: f64 = 0.006;
/// Linear light below which nothing is drawn: a third of a code in the dark.
const LEAST: f64 = 1e-4;
/// A glow ends here at the latest, heights of the picture.
const GLOW_MOST: f64 = 0.25;
/// A light is before what it stands on, metres.
const NEARER_M: f64 = 0.4;
/// Texels of a mirrored light's core: what collapses the layer takes samples of it.
const MIRRORED_TEXELS: f64 = 1.5;
/// A core ends after so many standard deviations.
const CORE_ENDS: f64 = 4.0;

/// The block of a light and the pixels that it reaches; `None` where it is behind the camera, off the screen, or too faint.
pub(crate) fn light_block(scene: &Scene, view: &LightView) -> Option<(LightBlock, PixelRect)> {
    let p = scene.camera.to_camera(view.at);
    let (flux, at) = flux_px(scene, view, p)?;
    let radius = GLOW_RADIUS * f64::from(scene.lens.height);
    let (core, glow) =
        ((1.0 - GLOW_SHARE) / (2.0 * PI * CORE_PX * CORE_PX), GLOW_SHARE / (PI * radius * radius));
    let most = f64::from(flux.max_element());
    if most * core < LEAST {
        return None;
    }
    let glow_ends = radius * ((most * glow / LEAST).sqrt() - 1.0).max(0.0).sqrt();
    let reach = (CORE_ENDS * CORE_PX).max(glow_ends).min(GLOW_MOST * f64::from(scene.lens.height));
    let rect = clip_to_screen(at - reach, at + reach, scene.lens.width, scene.lens.height)?;
    let block = LightBlock {
        rect: corners(rect),
        at: at.as_vec2().to_array(),
        depth: depth(p),
        sharp: (1.0 / (2.0 * CORE_PX * CORE_PX)) as f32,
        core: (flux * core as f32).extend(0.0).to_array(),
        glow: (flux * glow as f32).extend((1.0 / (radius * radius)) as f32).to_array(),
    };
    Some((block, rect))
}

/// A boat's place in the layer of mirrored boats.
pub(crate) struct Mirror<'a> {
    /// Height of the water that mirrors it, world.
    pub(crate) water_level: f64,
    /// Height of the boat's top over that, metres: the layer holds nothing above it, so that a light on a pole is mirrored from there.
    pub(crate) top_m: f64,
    pub(crate) placed: &'a Placed,
}

/// The same of its mirror image, on the boat's place in the layer.
pub(crate) fn mirrored_block(scene: &Scene, view: &LightView, mirror: &Mirror<'_>) -> Option<LightBlock> {
    let &Mirror { water_level, top_m, placed } = mirror;
    let mirrored = view.at.with_z(water_level - (view.at.z - water_level).min(top_m));
    let p = scene.camera.to_camera(mirrored);
    let (flux, at) = flux_px(scene, view, p)?;
    let sigma = (CORE_PX * placed.scale).max(MIRRORED_TEXELS);
    let peak = flux * (placed.scale * placed.scale / (2.0 * PI * sigma * sigma)) as f32;
    let reach = CORE_ENDS * sigma / placed.scale;
    let (low, high) = (at - reach, at + reach);
    Some(LightBlock {
        rect: [low.x, low.y, high.x, high.y].map(|v| v as f32),
        at: (at * placed.scale + placed.offset).as_vec2().to_array(),
        depth: depth(p),
        sharp: (1.0 / (2.0 * sigma * sigma)) as f32,
        core: peak.extend(0.0).to_array(),
        glow: [0.0; 4],
    })
}

/// Depth of a light at `p`, camera's space.
fn depth(p: DVec3) -> f32 {
    (NEAR_M / (p.z - NEARER_M)) as f32
}

/// What a light at `p`, camera's space, adds to all pixels together, and its pixel.
fn flux_px(scene: &Scene, view: &LightView, p: DVec3) -> Option<(Vec3, DVec2)> {
    let lens = &scene.lens;
    if !p.is_finite() || p.z < 2.0 * NEARER_M || !view.light.is_finite() {
        return None;
    }
    Some((view.light * (lens.focal.x * lens.focal.y) as f32, lens.project(p)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    fn view(at: DVec3, light: f32) -> LightView {
        LightView { boat: Some(0), at, light: Vec3::splat(light) }
    }

    /// What a block adds to all pixels, from its own formula.
    fn sum(block: &LightBlock) -> f64 {
        let (sharp, glow) = (f64::from(block.sharp), f64::from(block.glow[3]));
        let core = f64::from(block.core[0]) * PI / sharp;
        core + if glow > 0.0 { f64::from(block.glow[0]) * PI / glow } else { 0.0 }
    }

    #[test]
    fn all_of_a_lights_light_comes_onto_the_screen_and_into_the_mirror() {
        let scene = testing::empty_scene(1280, 720);
        let seen = view(DVec3::new(3.0, 400.0, 2.0), 1e-6);
        let flux = 1e-6 * scene.lens.focal.x * scene.lens.focal.y;
        let (block, rect) = light_block(&scene, &seen).unwrap();
        assert!((sum(&block) / flux - 1.0).abs() < 1e-3, "{} {flux}", sum(&block));
        assert!(rect.width >= 5 && rect.width < 200);
        for scale in [0.5, 1.0, 3.0] {
            let placed = Placed { scale, ..Placed::default() };
            let mirror = Mirror { water_level: 0.0, top_m: 5.0, placed: &placed };
            let mirrored = mirrored_block(&scene, &seen, &mirror).unwrap();
            assert!((sum(&mirrored) / (flux * scale * scale) - 1.0).abs() < 1e-3, "{scale}");
            assert!(mirrored.at[1] / scale as f32 > block.at[1], "below the light itself");
        }
    }

    #[test]
    fn what_cannot_be_seen_has_no_block_and_what_dazzles_stays_on_the_screen() {
        let scene = testing::empty_scene(320, 180);
        let ahead = DVec3::new(0.0, 200.0, 3.0);
        assert!(light_block(&scene, &view(-ahead, 1e-3)).is_none(), "behind the camera");
        assert!(light_block(&scene, &view(ahead, 1e-12)).is_none(), "too faint");
        assert!(light_block(&scene, &view(ahead, f32::NAN)).is_none());
        assert!(light_block(&scene, &view(ahead * f64::NAN, 1e-3)).is_none());
        let (block, rect) = light_block(&scene, &view(ahead, 1e3)).unwrap();
        assert!(rect.x + rect.width <= 320 && rect.y + rect.height <= 180);
        assert!(block.core.iter().chain(&block.glow).all(|v| v.is_finite()));
    }
}
