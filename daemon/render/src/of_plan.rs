//! From a scene's plan to the configuration of a renderer that can draw just that.

use bowwave_core::{
    frame::{plan::ScenePlan, scene::Pass},
    session::ROUNDS_SEEN_MAX,
};

use crate::{Needs, PictureShape, RenderConfig, TimeOuts};

/// Frames in flight: one being drawn, one being read, one being filled.
const FRAMES_IN_FLIGHT: usize = 3;

impl RenderConfig {
    /// Configuration of the renderer for `plan`, on the device that `device` names (the first GPU where it names none).
    pub fn of_plan(plan: &ScenePlan, device: Option<String>, validation: bool) -> Self {
        let only = |pass: Pass, n: usize| if plan.has(pass) { n } else { 0 };
        let waters =
            if plan.has(Pass::Water) { vec![(plan.water.method, plan.water.shadow)] } else { Vec::new() };
        Self {
            width: plan.size.0,
            height: plan.size.1,
            device,
            validation,
            frames_in_flight: FRAMES_IN_FLIGHT,
            needs: Needs {
                boats_max: only(Pass::Boats, plan.boats),
                wakes_max: only(Pass::Wake, plan.moving),
                rounds_max: only(Pass::Rounds, ROUNDS_SEEN_MAX),
                waters,
                optics: plan.optics,
            },
            picture: Some(PictureShape { format: plan.video, width: plan.picture.0, height: plan.picture.1 }),
            time_outs: TimeOuts::default(),
        }
    }
}
