//! Renderer and output thread: what is made anew together when the GPU is lost or pictures come in another layout.

use std::{path::PathBuf, sync::Arc, time::Duration};

use anyhow::{Context, Result};
use bowwave_core::{
    event::Picture,
    model::Model,
    session::{Session, View},
    time::Time,
};
use bowwave_devices::{clock::now, lcd::LcdPort, report::Reporter};
use bowwave_render::{RenderError, Renderer, TimeOuts};

use crate::{
    drawing,
    output::{Done, Output, OutputOptions, Ticket, UserEvent},
};

/// A driver that compiles for longer than this is not waited for, seconds.
const REHEARSAL_S: f64 = 120.0;
/// How often it is looked whether it still runs.
const PATIENCE: Duration = Duration::from_millis(500);

/// How frames are drawn and where they go.
#[derive(Clone, Debug)]
pub struct StageOptions {
    /// Vulkan device.
    pub gpu: Option<String>,
    /// Whether to run with the validation layer.
    pub validation: bool,
    /// How long the GPU may take over a frame before it counts as hung.
    pub hang: Option<Duration>,
    /// The LCD.
    pub lcd: Option<Arc<LcdPort>>,
    /// Whether to show a window.
    pub window: bool,
    /// File for the hashes of frames.
    pub frame_hashes: Option<PathBuf>,
    /// The output thread's reports.
    pub reporter: Reporter,
}

/// What a frame is drawn by and shown by.
pub struct Stage {
    renderer: Renderer,
    output: Option<Output>,
}

impl Stage {
    /// Opens the GPU, makes what `session` needs and draws it once to nobody, so that the first frames do not wait for the
    /// driver's compiler.
    pub fn open(session: &Session, models: &[Model], options: &StageOptions) -> Result<Self> {
        let mut config = drawing::config(session.plan(), options.gpu.clone(), options.validation);
        if let Some(frame) = options.hang {
            // A computer that draws so much slower compiles so much slower.
            config.time_outs = TimeOuts { frame, rehearsal: config.time_outs.rehearsal.max(frame * 120) };
        }
        let (renderer, completions) = Renderer::new(&config, models)?;
        let output = Output::start(
            completions,
            OutputOptions {
                reporter: Some(options.reporter.clone()),
                lcd: options.lcd.clone(),
                frame_hashes: options.frame_hashes.clone(),
                size: session.plan().size,
                window: options.window,
                ..OutputOptions::default()
            },
        )?;
        let mut stage = Self { renderer, output: Some(output) };
        stage.rehearse(session)?;
        Ok(stage)
    }

    fn rehearse(&mut self, session: &Session) -> Result<()> {
        let scene = session.rehearsal();
        let plan = session.plan();
        let (width, height) = plan.picture;
        let picture = Picture::black(plan.video, width, height).context("no picture of this size")?;
        let begun = now();
        self.renderer.submit(&scene, &picture, true)?;
        if let Some(output) = &self.output {
            output.announce(Ticket { frame: 0, begun, submitted: begun, deadline: None, rehearsal: true });
            let begun = now();
            // A software driver on a slow computer compiles for a long time at its first start; the renderer's own time-out
            // ends one that hangs.
            while !output.await_rehearsal(PATIENCE) && output.runs() {
                if now().secs_since(begun) > REHEARSAL_S {
                    log::warn!(
                        "the rehearsal was not complete after {REHEARSAL_S} s; the first frames may be late"
                    );
                    break;
                }
            }
        }
        Ok(())
    }

    /// Hands a frame over. `false` where the output thread has ended: [`Self::take_error`] says why.
    pub fn show(&mut self, view: &View<'_>, begun: Time, deadline: Time) -> Result<bool, RenderError> {
        let ticket = Ticket {
            frame: view.scene.frame,
            begun,
            submitted: now(),
            deadline: Some(deadline),
            rehearsal: false,
        };
        self.renderer.submit(view.scene, view.picture, view.picture_is_new)?;
        Ok(self.output.as_ref().is_some_and(|o| o.runs() && o.announce(ticket)))
    }

    /// Frames completed since the last call.
    pub fn done(&self) -> impl Iterator<Item = Done> + '_ {
        self.output.iter().flat_map(Output::done)
    }

    /// What the user did at the window.
    pub fn user_events(&self) -> impl Iterator<Item = UserEvent> + '_ {
        self.output.iter().flat_map(Output::user_events)
    }

    /// Why the output thread has ended, where it has.
    pub fn take_error(&mut self) -> Option<anyhow::Error> {
        if self.output.as_ref().is_some_and(Output::runs) {
            return None;
        }
        self.output.take()?.finish().err()
    }

    /// Device and driver.
    pub fn device(&self) -> String {
        format!("{} ({})", self.renderer.device().name, self.renderer.device().driver)
    }

    /// How pictures reach the GPU: copied or imported, with how many of each.
    pub fn picture_path(&self) -> String {
        format!("{:?} {:?}", self.renderer.picture_path(), self.renderer.picture_counts()).to_lowercase()
    }

    /// What Vulkan's validation layer has said.
    pub fn validation_messages(&self) -> Vec<String> {
        self.renderer.validation_messages()
    }

    /// Takes the last frames out and ends the thread.
    pub fn close(self) -> Result<()> {
        drop(self.renderer);
        self.output.map_or(Ok(()), |output| output.finish().map(drop))
    }
}
