//! Configuration of a renderer, and how it follows from a scene's plan: one that can draw just that.

use bowwave_core::{
    frame::{lamps::LAMPS_MAX, plan::ScenePlan, scene::Pass},
    geometry::Optics,
    own_ship::Phantoms,
    session::{LIGHTS_A_BOAT, ROUNDS_SEEN_MAX},
    water::{ReflectionMethod, ShadowLevel},
};
use shaders_spirv::interface::WATERS_MAX;

use crate::{passes::video::pictures::PictureShape, ring::TimeOuts};

/// Everything that can ever be asked of a renderer. The rest is neither compiled nor allocated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Needs {
    /// Most boats in one frame.
    pub boats_max: usize,
    /// Most tracers, splashes and strikes in one frame.
    pub rounds_max: usize,
    /// Most navigation lights in one frame.
    pub lights_max: usize,
    /// The camera's noise may have to be drawn on boats.
    pub noise: bool,
    /// A searchlight, flares or fires may be asked for.
    pub lamps: bool,
    /// Most boats in one frame that leave a wake.
    pub wakes_max: usize,
    /// How the sea may have to mirror.
    pub waters: Vec<(ReflectionMethod, ShadowLevel)>,
    /// What lens and shutter of the camera do.
    pub optics: Optics,
    /// The own gun and ship, pixels of the screen.
    pub phantoms: Phantoms,
}

impl Needs {
    /// Boats whose light waves throw back.
    pub(crate) fn lobes(&self) -> usize {
        let any = self.waters.iter().any(|(method, _)| *method == ReflectionMethod::Baked);
        if any { self.boats_max.min(WATERS_MAX) } else { 0 }
    }
}

/// Configuration of a renderer.
#[derive(Clone, Debug)]
pub struct RenderConfig {
    /// Screen width in pixels.
    pub width: u32,
    /// Screen height in pixels.
    pub height: u32,
    /// Index of the device, a part of its name, or [`SOFTWARE`](crate::SOFTWARE); `None`: the first GPU, or the first device of
    /// any kind.
    pub device: Option<String>,
    /// Whether Vulkan's validation layer watches. Slow; for tests.
    pub validation: bool,
    /// Frames that may be with the GPU or the reader at once, 1 to 8; 3 keeps both busy.
    pub frames_in_flight: usize,
    /// What can ever be asked.
    pub needs: Needs,
    /// The pictures that will come, so that the first frame need not prepare for them.
    pub picture: Option<PictureShape>,
    /// How long the GPU may take before it counts as hung.
    pub time_outs: TimeOuts,
}

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
                lights_max: only(Pass::Lights, LIGHTS_A_BOAT * plan.boats + LAMPS_MAX),
                noise: plan.has(Pass::Noise),
                lamps: plan.has(Pass::Lamplight),
                rounds_max: only(Pass::Rounds, ROUNDS_SEEN_MAX),
                waters,
                optics: plan.optics,
                phantoms: if plan.has(Pass::Phantoms) { plan.phantoms.clone() } else { Phantoms::default() },
            },
            picture: Some(PictureShape { format: plan.video, width: plan.picture.0, height: plan.picture.1 }),
            time_outs: TimeOuts::default(),
        }
    }
}
