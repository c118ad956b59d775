//! The plain mirror picture, faded by eq. 6.

use bowwave_core::frame::scene::{BoatView, Scene};
use glam::DVec2;
use shaders_spirv::interface::MirrorBlock;

use super::{
    block::{FADE_HEIGHTS, MethodPlan, force, mirrored_share},
    line::HullLine,
};

/// Its block.
pub(crate) fn plan(scene: &Scene, boat: &BoatView, line: &HullLine) -> MethodPlan {
    let alpha = mirrored_share(scene, boat);
    let fade_px = FADE_HEIGHTS[force(scene)] * line.height.max(1.0);
    let block =
        MirrorBlock { alpha: alpha as f32, alpha_fall: (alpha / fade_px) as f32, ..MirrorBlock::default() };
    MethodPlan::new(&block, fade_px, DVec2::ZERO)
}
