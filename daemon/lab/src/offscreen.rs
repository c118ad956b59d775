//! Off-screen rendering of single scenes by the trainer's own renderer.

use std::time::Duration;

use anyhow::{Context, Result};
use bowwave_core::{
    event::Picture,
    frame::{plan::ScenePlan, scene::Scene},
};
use bowwave_models::BoatModels;
use bowwave_render::{Completions, DrawRequest, RenderConfig, Renderer, TimeOuts};
use image::RgbImage;

use crate::{
    photo::Photo,
    still::{Composed, Still},
};

/// Longest wait for one picture. A large one with many boats takes seconds on a processor.
const WAIT: Duration = Duration::from_secs(120);

/// A renderer without a display. It is kept as long as the scenes need the same of it, and made anew otherwise.
pub struct OffscreenRenderer {
    models: BoatModels,
    gpu: Option<String>,
    validation: bool,
    ready: Option<(ScenePlan, Renderer, Completions)>,
    messages: Vec<String>,
}

/// A picture with boats in it.
#[derive(Debug)]
pub struct Drawn {
    /// Its pixels, sRGB.
    pub picture: RgbImage,
    /// How many boats or reflections of boats lie within the picture.
    pub boats_seen: usize,
}

impl OffscreenRenderer {
    /// A renderer for boats of these models, on the device that `gpu` names (the first GPU where it names none).
    pub fn new(models: BoatModels, gpu: Option<String>, validation: bool) -> Self {
        Self { models, gpu, validation, ready: None, messages: Vec::new() }
    }

    /// Composes boats into picture number `index` of a series (0 for a single one).
    pub fn compose(&mut self, still: &Still, photo: &Photo, index: u32) -> Result<Drawn> {
        let models = (self.models.list.as_slice(), self.models.of_boats.as_slice());
        let composed = still.compose(&photo.picture, index, models, photo.focal_px)?;
        let boats_seen = composed.scene.boats.len();
        Ok(Drawn { picture: self.draw(&composed, &photo.picture)?, boats_seen })
    }

    /// Draws a scene over a picture of the same size.
    pub fn draw(&mut self, Composed { scene, plan }: &Composed, picture: &Picture) -> Result<RgbImage> {
        if self.ready.as_ref().is_none_or(|(made_for, ..)| made_for != plan) {
            self.put_away();
            let mut config = RenderConfig::of_plan(plan, self.gpu.clone(), self.validation);
            // Nobody waits at 30 Hz: a busy processor that draws slowly is no hung GPU.
            config.time_outs = TimeOuts { frame: WAIT, warm_up: WAIT };
            let (renderer, completions) = Renderer::new(&config, &self.models.list)?;
            self.ready = Some((plan.clone(), renderer, completions));
        }
        let (_, renderer, completions) = self.ready.as_mut().context("no renderer")?;
        draw_one(renderer, completions, scene, picture)
    }

    /// Messages of the validation layer since the last call.
    pub fn validation_messages(&mut self) -> Vec<String> {
        self.put_away();
        std::mem::take(&mut self.messages)
    }

    fn put_away(&mut self) {
        if let Some((_, renderer, _)) = self.ready.take() {
            self.messages.extend(renderer.validation_messages());
        }
    }
}

fn draw_one(
    renderer: &mut Renderer,
    completions: &mut Completions,
    scene: &Scene,
    picture: &Picture,
) -> Result<RgbImage> {
    renderer.submit(DrawRequest::new(scene, picture, true))?;
    let frame = completions.wait_next(WAIT)?.context("the GPU did not finish the picture in two minutes")?;
    let (width, height) = (picture.width(), picture.height());
    let rgb = frame.rgba().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    RgbImage::from_raw(width, height, rgb).context("the renderer gave a picture of another size")
}
