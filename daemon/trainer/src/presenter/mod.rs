//! Renderer and output thread. Both are made anew together when the GPU is lost or pictures come in another layout.

mod gamepad;
mod hashes;
mod lateness;
mod output;
mod pictures;
mod video;
mod window;

use std::time::Duration;

use anyhow::{Context, Result};
use bowwave_core::{
    event::Picture,
    frame::scene::Scene,
    model::Model,
    session::{Session, View},
    time::Time,
};
use bowwave_devices::clock::now;
use bowwave_render::{DrawRequest, RenderConfig, RenderError, Renderer, TimeOuts};

use output::{OutputThread, Ticket};

pub use video::VideoTimes;

pub use output::{CompletedFrame, OutputOptions, OutputReport, Seat, UserEvent};

/// A driver that compiles for longer than this is not waited for, seconds.
const WARM_UP_S: f64 = 120.0;
/// How often it is looked whether it still runs.
const PATIENCE: Duration = Duration::from_millis(500);

/// Vulkan device, validation and time-out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GpuSettings {
    /// Vulkan device by number or part of its name; absent: the first.
    pub device: Option<String>,
    /// Whether to run with the validation layer.
    pub validation: bool,
    /// How long it may take over a frame before it counts as hung; absent: what is usual.
    pub timeout: Option<Duration>,
}

/// Settings of a presenter.
#[derive(Clone, Debug, Default)]
pub struct PresenterOptions {
    /// The GPU.
    pub gpu: GpuSettings,
    /// Uses of the finished frames; the size is the plan's.
    pub output: OutputOptions,
}

/// Draws scenes and takes the frames to where they are seen.
pub struct Presenter {
    renderer: Renderer<Ticket>,
    output: Option<OutputThread>,
    before: OutputReport,
}

impl Presenter {
    /// Opens the GPU, makes what `session` needs and draws it once to nobody, so that the first frames do not wait for the
    /// driver's compiler.
    pub fn open(session: &Session, models: &[Model], options: &PresenterOptions) -> Result<Self> {
        let mut config =
            RenderConfig::of_plan(session.plan(), options.gpu.device.clone(), options.gpu.validation);
        if let Some(frame) = options.gpu.timeout {
            // A computer that draws so much slower compiles so much slower.
            config.time_outs = TimeOuts { frame, warm_up: config.time_outs.warm_up.max(frame * 120) };
        }
        let (renderer, completions) = Renderer::with_tickets(&config, models)?;
        let output = OutputOptions { size: session.plan().size, ..options.output.clone() };
        let output = OutputThread::start(completions, output)?;
        let mut presenter = Self { renderer, output: Some(output), before: OutputReport::default() };
        presenter.warm_up(session)?;
        Ok(presenter)
    }

    /// Opens everything anew for what `session` needs now. The old output's report is kept.
    pub fn reopen(&mut self, session: &Session, models: &[Model], options: &PresenterOptions) -> Result<()> {
        let new = Self::open(session, models, options)?;
        let old = std::mem::replace(self, new);
        match old.close() {
            Ok(report) => self.before = report,
            Err(e) => log::debug!("the former renderer ended with: {e:#}"),
        }
        Ok(())
    }

    /// Draws everything that the session can show, to nobody: drivers compile shaders when they are first used, and the system puts
    /// memory where it is first written, so that each slot of the ring is drawn into once.
    fn warm_up(&mut self, session: &Session) -> Result<()> {
        let scene = session.rehearsal();
        let plan = session.plan();
        let (width, height) = plan.picture;
        let picture = Picture::black(plan.video, width, height).context("no picture of this size")?;
        let begun = now();
        for _ in 0..self.renderer.frames_in_flight() {
            if !self.warm_up_slot(&scene, &picture, begun)? {
                break;
            }
        }
        Ok(())
    }

    /// Draws `scene` into the ring's next slot, and waits until that is complete or the warm-up, which was begun at `warm_up_begun`, has
    /// lasted too long. Gives `true` where it is complete.
    fn warm_up_slot(&mut self, scene: &Scene, picture: &Picture, warm_up_begun: Time) -> Result<bool> {
        let begun = now();
        let ticket =
            Ticket { frame: 0, begun, submitted: begun, shows: begun, deadline: None, warm_up: true };
        self.renderer.submit(DrawRequest { scene, picture, picture_is_new: true, ticket })?;
        if let Some(output) = &self.output {
            // A software driver on a slow computer compiles for a long time at its first start; the renderer's own time-out
            // ends one that hangs.
            while !output.await_warm_up(PATIENCE) && output.runs() {
                if now().secs_since(warm_up_begun) > WARM_UP_S {
                    log::warn!(
                        "the warm-up was not complete after {WARM_UP_S} s; the first frames may be late"
                    );
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Hands a frame over that was begun at `begun` and must be complete at `deadline`.
    pub fn show(
        &mut self,
        view: &View<'_>,
        begun: Time,
        deadline: Option<Time>,
    ) -> Result<Handed, RenderError> {
        let (frame, shows) = (view.scene.frame, view.mid_exposure);
        let ticket = Ticket { frame, begun, submitted: now(), shows, deadline, warm_up: false };
        let View { scene, picture, picture_is_new, .. } = *view;
        let waited = self.renderer.submit(DrawRequest { scene, picture, picture_is_new, ticket })?;
        let taken = self.output.as_ref().is_some_and(OutputThread::runs);
        Ok(if taken { Handed::Taken { waited } } else { Handed::OutputEnded })
    }

    /// Frames completed since the last call.
    pub fn done(&self) -> impl Iterator<Item = CompletedFrame> + '_ {
        self.output.iter().flat_map(OutputThread::done)
    }

    /// What the user did at the window.
    pub fn user_events(&self) -> impl Iterator<Item = UserEvent> + '_ {
        self.output.iter().flat_map(OutputThread::user_events)
    }

    /// Why the output thread has ended, where it has.
    pub fn take_error(&mut self) -> Option<anyhow::Error> {
        if self.output.as_ref().is_some_and(OutputThread::runs) {
            return None;
        }
        self.output.take()?.finish().err()
    }

    /// Takes the last frames out and ends the thread. What went wrong is added to `wrong`.
    pub fn end(self, wrong: &mut Vec<String>) -> Presented {
        let (device, counts) = (self.renderer.device(), self.renderer.picture_counts());
        let device = format!("{} ({})", device.name, device.driver);
        let video = format!("{} copied, {} read where the camera put them", counts.copied, counts.imported);
        let validation = self.renderer.validation_messages();
        for message in &validation {
            log::error!("Vulkan's validation layer reports: {message}");
        }
        let output = self.close().unwrap_or_else(|e| {
            wrong.push(format!("{e:#}"));
            OutputReport::default()
        });
        Presented { device, video, validation, output }
    }

    fn close(self) -> Result<OutputReport> {
        let Self { renderer, output, before: mut report } = self;
        drop(renderer);
        if let Some(output) = output {
            report.add(output.finish()?);
        }
        Ok(report)
    }
}

/// Report of a presenter that has ended.
#[derive(Debug, Default)]
pub struct Presented {
    /// Vulkan device and driver.
    pub device: String,
    /// How pictures reached the GPU.
    pub video: String,
    /// Messages of Vulkan's validation layer.
    pub validation: Vec<String>,
    /// Measurements of the output thread.
    pub output: OutputReport,
}

/// Outcome of handing a frame over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handed {
    /// The output thread will take it.
    Taken {
        /// Whether it had to wait for a slot of the renderer's ring.
        waited: bool,
    },
    /// The output thread has ended: [`Presenter::take_error`] says why.
    OutputEnded,
}
