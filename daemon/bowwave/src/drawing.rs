//! The renderer's configuration of a scene's plan.

use bowwave_core::frame::plan::ScenePlan;
use bowwave_render::RenderConfig;

/// [`RenderConfig::of_plan`].
pub fn config(plan: &ScenePlan, gpu: Option<String>, validation: bool) -> RenderConfig {
    RenderConfig::of_plan(plan, gpu, validation)
}
