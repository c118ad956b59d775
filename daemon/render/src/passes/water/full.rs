//! Nelson 2009's Full Reflection shader, eq. 4-6: as published, and with its singular cases corrected and its distances tied to the
//! boat's size on the screen. The thesis gives the formulas but not their constants; those here were chosen by eye against photographs,
//! for each wind force 0 to 4.

use bowwave_core::frame::scene::{BoatView, Scene};
use glam::DVec2;
use shaders_spirv::interface::{FullBlock, FullPublishedBlock, WaterBlock};

use super::{
    block::{
        FADE_HEIGHTS, FORCE_MAX, MethodPlan, force, largest_shift_px, mirrored_share, published_shift_px,
        shift_reach,
    },
    line::HullLine,
};

/// As published: k of eq. 6, pixels over which the reflection fades, by wind force.
const PUBLISHED_FADE_PX: [f64; FORCE_MAX + 1] = [500.0, 320.0, 200.0, 120.0, 70.0];
/// As published: brightness below and above which the video passes through.
const PUBLISHED_BRIGHT: [f32; 2] = [0.10, 0.85];

/// Share of the largest shift at the hull, and over how many heights of the boat it grows to the whole: a wave's slope moves what
/// stands high above the water more.
const SHIFT_NEAR: f64 = 0.15;
const SHIFT_GROWN_HEIGHTS: f64 = 0.8;

/// As published.
pub(crate) fn as_published(scene: &Scene, common: &WaterBlock) -> MethodPlan {
    let ((shift, limit), fade_px) = (published_shift_px(scene), PUBLISHED_FADE_PX[force(scene)]);
    let block = FullPublishedBlock {
        alpha: 1.0,
        alpha_fall: (1.0 / fade_px) as f32,
        shift: shift as f32,
        shift_limit: limit as f32,
        blur: common.mirror_scale,
        bright: PUBLISHED_BRIGHT,
    };
    // Both coordinates shift by as much; the blur takes a neighbour.
    MethodPlan::new(&block, fade_px, DVec2::splat(limit + 1.0))
}

/// Corrected. The layer is softened before.
pub(crate) fn corrected(scene: &Scene, boat: &BoatView, line: &HullLine) -> MethodPlan {
    let (shift, limit) = largest_shift_px(scene, line);
    let (height, alpha) = (line.height.max(1.0), mirrored_share(scene, boat));
    let fade_px = FADE_HEIGHTS[force(scene)] * height;
    let block = FullBlock {
        alpha: alpha as f32,
        alpha_fall: (alpha / fade_px) as f32,
        shift: shift as f32,
        shift_limit: limit as f32,
        shift_near: SHIFT_NEAR as f32,
        shift_grow: ((1.0 - SHIFT_NEAR) / (SHIFT_GROWN_HEIGHTS * height)) as f32,
        ..FullBlock::default()
    };
    MethodPlan::new(&block, fade_px, shift_reach(line, limit))
}

#[cfg(test)]
mod tests {
    use bowwave_core::water::ReflectionMethod;

    use super::*;
    use crate::{
        passes::{atlas::Placed, water::block::water_block, water::line::hull_line},
        testing,
    };

    #[test]
    fn corrected_distances_follow_the_boats_size_and_published_ones_do_not() {
        let models = [testing::box_model("b", [8.0, 2.4, 1.5], [0.5; 3])];
        let plan = |range: f64, method| {
            let mut scene = testing::empty_scene(640, 480);
            scene.water.method = method;
            testing::add_boat(&mut scene, &models, 0, range, 0.0, 0.7);
            let boat = &scene.boats[0];
            let line = hull_line(&scene, boat, &boat.pose, &models[0]).unwrap();
            let placed = Placed { atlas: (640, 240), ..Placed::default() };
            (line.height, water_block(&scene, boat, &line, &placed).1)
        };
        let block = |plan: &MethodPlan| *bytemuck::from_bytes::<FullBlock>(bytemuck::cast_slice(plan.own()));
        let (h1, near) = plan(40.0, ReflectionMethod::Full);
        let (h2, far) = plan(80.0, ReflectionMethod::Full);
        assert!((h1 / h2 - 2.0).abs() < 0.1);
        let (one, other) = (block(&near), block(&far));
        assert!((f64::from(one.shift / other.shift) - h1 / h2).abs() < 0.01);
        assert!(other.alpha > one.alpha, "the sea mirrors more at a grazing angle");
        assert!((near.fade_px / far.fade_px - h1 / h2).abs() < 0.01);
        let (_, near) = plan(40.0, ReflectionMethod::FullAsPublished);
        let (_, far) = plan(80.0, ReflectionMethod::FullAsPublished);
        assert_eq!((near.own()[2], near.fade_px), (far.own()[2], far.fade_px));
    }
}
