//! Tracers, splashes, strikes, smoke and flames on the screen: each an axis in pixels with a width.

use bowwave_core::frame::{
    fires::SOOT_ALBEDO,
    lamps::body_at,
    scene::{PixelRect, RoundView, Scene},
    view::NEAR_M,
};
use glam::{DVec2, DVec3, Vec3};
use shaders_spirv::interface::{
    ROUND_FLAME, ROUND_SMOKE, ROUND_SPLASH, ROUND_STRIKE, ROUND_TRACER, RoundBlock,
};

/// Radius of a tracer's burning base as the camera sees it bloom, metres.
const TRACER_RADIUS_M: f64 = 0.06;
/// A tracer is never drawn thinner, pixels: it is far brighter than what surrounds it.
const TRACER_HALF_WIDTH_MIN_PX: f64 = 1.3;
/// Glow beyond the half width, in half widths.
const GLOW: f64 = 2.6;
/// Light of sparks, paper white at the video's exposure being 1.
const SPARKS: Vec3 = Vec3::new(3.0, 2.1, 0.9);
/// Optical depth below which smoke is not seen, and the radii at which it ends at the latest.
const SMOKE_LEAST: f32 = 0.01;
const SMOKE_ENDS: f64 = 1.6;
/// Diffuse reflectance of torn water.
const FOAM: f32 = 0.8;

/// The block of one round and the pixels that it can cover; `None` where it is behind the camera or off the screen.
pub(crate) fn round_block(scene: &Scene, round: &RoundView, seed: f32) -> Option<(RoundBlock, PixelRect)> {
    let shape = match *round {
        RoundView::Tracer { from, to, radiance } => Shape {
            ends: [from, to],
            half_width_m: [TRACER_RADIUS_M; 2],
            half_width_min_px: TRACER_HALF_WIDTH_MIN_PX,
            reach: GLOW,
            colour: radiance.extend(1.0).to_array(),
            kind: ROUND_TRACER,
            nearer: 1.0,
            thick_m: 0.0,
        },
        RoundView::Splash { at, height_m, radius_m, opacity } => {
            let light = &scene.light;
            let lamps = body_at(&scene.lamps, at);
            let lit = (light.sun * 0.5 + light.sky * 0.8 + light.sea * 0.2 + lamps) * FOAM;
            Shape {
                ends: [at, at + DVec3::Z * f64::from(height_m.max(0.0))],
                half_width_m: [f64::from(radius_m), f64::from(radius_m) * 0.55],
                half_width_min_px: 1.0,
                reach: 1.0,
                colour: lit.extend(opacity.clamp(0.0, 1.0)).to_array(),
                kind: ROUND_SPLASH,
                nearer: 1.0,
                thick_m: 0.0,
            }
        }
        RoundView::Smoke { at, radius_m, depth, glow, haze, .. } => {
            // Farther out it hides less than a hundredth; the shader lets it end there.
            let reach = f64::from((depth.max(0.0) / SMOKE_LEAST).max(1.2)).ln().sqrt().min(SMOKE_ENDS);
            let light = &scene.light;
            // Flames light their own smoke from below: the puff knows.
            let flares = body_at(scene.lamps.iter().filter(|lamp| lamp.is_high), at);
            let around = light.sun * 0.25 + light.sky * 0.7 + light.sea * 0.3 + flares;
            let lit = around * SOOT_ALBEDO as f32 + glow;
            Shape {
                ends: [at, at],
                half_width_m: [f64::from(radius_m), 0.0],
                half_width_min_px: 1.0,
                reach,
                colour: lit.lerp(light.horizon, haze).extend(depth.max(0.0)).to_array(),
                kind: ROUND_SMOKE,
                nearer: 1.0,
                thick_m: f64::from(radius_m),
            }
        }
        RoundView::Flame { at, radius_m, light, .. } => Shape {
            ends: [at, at],
            half_width_m: [f64::from(radius_m); 2],
            half_width_min_px: 1.0,
            reach: 2.0,
            colour: light.extend(1.0).to_array(),
            kind: ROUND_FLAME,
            nearer: 1.0,
            thick_m: f64::from(radius_m),
        },
        RoundView::Strike { at, radius_m, opacity } => Shape {
            ends: [at, at],
            half_width_m: [f64::from(radius_m); 2],
            half_width_min_px: 2.0,
            reach: 1.0,
            colour: SPARKS.extend(opacity.clamp(0.0, 1.0)).to_array(),
            kind: ROUND_STRIKE,
            // It happens on the hull: the hull must not hide it.
            nearer: 1.02,
            thick_m: 0.0,
        },
    };
    let seed = match *round {
        RoundView::Smoke { seed, .. } | RoundView::Flame { seed, .. } => seed,
        _ => seed,
    };
    shape.project(scene, seed)
}

struct Shape {
    ends: [DVec3; 2],
    half_width_m: [f64; 2],
    half_width_min_px: f64,
    /// How far the profile reaches beyond the axis, in half widths.
    reach: f64,
    colour: [f32; 4],
    kind: u32,
    /// Factor on its depth.
    nearer: f64,
    /// How far before and behind that depth it reaches, metres; 0 of what is thin.
    thick_m: f64,
}

impl Shape {
    fn project(&self, scene: &Scene, seed: f32) -> Option<(RoundBlock, PixelRect)> {
        let lens = &scene.lens;
        let [from, to] = clip(self.ends.map(|p| scene.camera.to_camera(p)))?;
        let (a, b) = (lens.project(from)?, lens.project(to)?);
        let focal = lens.focal.max_element();
        let width = |metres: f64, p: DVec3| (metres * focal / p.z).clamp(self.half_width_min_px, 4000.0);
        let widths = [width(self.half_width_m[0], from), width(self.half_width_m[1], to)];
        let margin = widths[0].max(widths[1]) * self.reach + 1.0;
        let screen = DVec2::new(f64::from(lens.width), f64::from(lens.height));
        let low = (a.min(b) - margin).floor().clamp(DVec2::ZERO, screen);
        let high = (a.max(b) + margin).ceil().clamp(DVec2::ZERO, screen);
        if !(low.x < high.x && low.y < high.y) {
            return None;
        }
        let rect = PixelRect {
            x: low.x as u32,
            y: low.y as u32,
            width: (high.x - low.x) as u32,
            height: (high.y - low.y) as u32,
        };
        let thick = self.thick_m as f32;
        let end = |p: DVec2, c: DVec3| [p.x as f32, p.y as f32, (NEAR_M / c.z * self.nearer) as f32, thick];
        let block = RoundBlock {
            from: end(a, from),
            to: end(b, to),
            colour: self.colour,
            half_width: if self.kind == ROUND_SMOKE {
                [widths[0], self.reach].map(|w| w as f32)
            } else {
                widths.map(|w| w as f32)
            },
            kind: self.kind,
            seed,
        };
        Some((block, rect))
    }
}

/// Cuts off what lies less than half a metre before the camera or behind it.
fn clip([mut from, mut to]: [DVec3; 2]) -> Option<[DVec3; 2]> {
    const LEAST_M: f64 = 0.5;
    if !(from.is_finite() && to.is_finite()) || from.z.max(to.z) < LEAST_M {
        return None;
    }
    let cut =
        |inner: DVec3, outer: DVec3| outer + (inner - outer) * ((LEAST_M - outer.z) / (inner.z - outer.z));
    if from.z < LEAST_M {
        from = cut(to, from);
    } else if to.z < LEAST_M {
        to = cut(from, to);
    }
    Some([from, to])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn a_tracer_that_begins_behind_the_camera_is_cut_and_stays_on_the_screen() {
        let scene = testing::empty_scene(320, 180);
        let radiance = Vec3::new(4.0, 1.0, 0.5);
        let tracer =
            |from: DVec3, to: DVec3| round_block(&scene, &RoundView::Tracer { from, to, radiance }, 0.0);
        let eye = scene.camera.position;
        let (block, rect) = tracer(eye - DVec3::Y * 3.0, eye + DVec3::new(0.5, 200.0, -4.0)).unwrap();
        assert!(rect.x + rect.width <= 320 && rect.y + rect.height <= 180);
        assert!(block.from[2] > block.to[2], "the near end is nearer");
        assert!(block.half_width.iter().all(|w| *w >= 1.3));
        assert!(tracer(eye - DVec3::Y * 3.0, eye - DVec3::Y * 9.0).is_none());
        assert!(tracer(eye + DVec3::Y * f64::NAN, eye).is_none());
        assert!(tracer(eye + DVec3::new(500.0, 10.0, 0.0), eye + DVec3::new(500.0, 20.0, 0.0)).is_none());
    }
}
