//! The output thread: waits for finished frames and takes them to the hash, the video, the pictures and the window.

use std::{
    path::PathBuf,
    thread::{self, JoinHandle},
    time::Duration,
};

use anyhow::{Context, Result, anyhow};
use bowwave_core::{event::TriggerEdge, scene::Pass, time::Time};
use bowwave_devices::clock::now;
use bowwave_render::{Completions, Finished};
use crossbeam_channel::{Receiver, Sender, unbounded};
use sha2::{Digest, Sha256};

use super::{
    pictures::{ContactSheet, copy_frame, write_still},
    video::VideoWriter,
    window::{Pressed, Screen},
};
use crate::stats::Samples;

/// How long the thread waits for a frame before it looks whether there will be another.
const WAIT: Duration = Duration::from_millis(200);

/// What is to be made of the frames.
#[derive(Debug)]
pub struct OutputOptions {
    /// Folder for files.
    pub folder: PathBuf,
    /// Screen size in pixels.
    pub size: (u32, u32),
    /// Frames that the run is expected to have.
    pub frames: u64,
    /// Whether to make a video.
    pub video: bool,
    /// Whether to make a contact sheet.
    pub sheet: bool,
    /// Frames to keep as PNG.
    pub stills: Vec<u64>,
    /// Whether to show a window.
    pub window: bool,
}

/// A frame on its way, told to the output thread when it is submitted.
#[derive(Clone, Copy, Debug)]
pub struct Ticket {
    /// The scene's frame number.
    pub frame: u64,
    /// When it was due or, without a clock, begun.
    pub begun: Time,
    /// When it was handed to the GPU.
    pub submitted: Time,
    /// When it must be complete.
    pub deadline: Option<Time>,
    /// Drawn so that the driver is warm, not to be shown or counted.
    pub rehearsal: bool,
}

/// What the user did at the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UserEvent {
    /// The space bar.
    Trigger(TriggerEdge),
    /// Escape, or the window was closed.
    Quit,
}

/// What the thread measured.
#[derive(Debug, Default)]
pub struct OutputReport {
    /// Frames taken.
    pub frames: u64,
    /// Frames that were complete after their deadline.
    pub late: u64,
    /// From begun to complete, ms.
    pub frame_ms: Samples,
    /// From submitted to complete, ms.
    pub gpu_ms: Samples,
    /// GPU time stamps by pass, ms.
    pub passes_ms: [Samples; Pass::COUNT],
    /// When the first frame was complete.
    pub first: Option<Time>,
    /// Over the SHA-256 of each frame.
    pub frames_sha256: [u8; 32],
}

/// The running thread.
#[derive(Debug)]
pub struct Output {
    tickets: Option<Sender<Ticket>>,
    user: Receiver<UserEvent>,
    rehearsed: Receiver<()>,
    thread: Option<JoinHandle<Result<OutputReport>>>,
}

impl Output {
    /// Starts the thread. Files are opened here, so that what cannot work says so before the run.
    pub fn start(completions: Completions, options: OutputOptions) -> Result<Self> {
        let video = if options.video {
            Some(VideoWriter::create(&options.folder.join("video.mp4"), options.size)?)
        } else {
            None
        };
        let (tickets, incoming) = unbounded();
        let (user_sender, user) = unbounded();
        let (rehearsed_sender, rehearsed) = unbounded();
        let told = Told { user: user_sender, rehearsed: rehearsed_sender };
        let thread = thread::Builder::new()
            .name("output".to_owned())
            .spawn(move || Worker::new(completions, incoming, told, options, video).run())
            .context("cannot start the output thread; are too many processes running?")?;
        Ok(Self { tickets: Some(tickets), user, rehearsed, thread: Some(thread) })
    }

    /// Tells the thread of a submitted frame; `false` once the thread has ended.
    pub fn announce(&self, ticket: Ticket) -> bool {
        self.tickets.as_ref().is_some_and(|t| t.send(ticket).is_ok())
    }

    /// Waits until a rehearsal is complete, or the thread has ended, but no longer than `timeout`.
    pub fn await_rehearsal(&self, timeout: Duration) {
        if self.rehearsed.recv_timeout(timeout).is_err() {
            log::warn!(
                "the rehearsal was not complete after {} s; the first frames may be late",
                timeout.as_secs()
            );
        }
    }

    /// What the user did since the last call.
    pub fn user_events(&self) -> impl Iterator<Item = UserEvent> + '_ {
        self.user.try_iter()
    }

    /// Waits until every frame is taken and all files are written. The renderer must be gone by now.
    pub fn finish(mut self) -> Result<OutputReport> {
        drop(self.tickets.take());
        let thread = self.thread.take().context("the output thread has already ended")?;
        thread.join().map_err(|_| anyhow!("the output thread broke down; report it with the log"))?
    }
}

/// What the thread tells the main loop.
struct Told {
    user: Sender<UserEvent>,
    rehearsed: Sender<()>,
}

struct Worker {
    completions: Completions,
    tickets: Receiver<Ticket>,
    told: Told,
    options: OutputOptions,
    video: Option<VideoWriter>,
    sheet: Option<ContactSheet>,
    screen: Option<Screen>,
    hash: Sha256,
    report: OutputReport,
}

impl Worker {
    fn new(
        completions: Completions,
        tickets: Receiver<Ticket>,
        told: Told,
        options: OutputOptions,
        video: Option<VideoWriter>,
    ) -> Self {
        let sheet = options.sheet.then(|| ContactSheet::new(options.frames, options.size));
        let capacity = usize::try_from(options.frames).unwrap_or(0).min(1 << 20);
        let report = OutputReport {
            frame_ms: Samples::with_capacity(capacity),
            gpu_ms: Samples::with_capacity(capacity),
            ..OutputReport::default()
        };
        Self { completions, tickets, told, options, video, sheet, screen: None, hash: Sha256::new(), report }
    }

    fn run(mut self) -> Result<OutputReport> {
        if self.options.window {
            self.screen = Some(Screen::open(self.options.size)?);
        }
        while !self.completions.is_over() {
            if let Some(frame) = self.completions.wait_next(WAIT)? {
                let complete = now();
                self.take(&frame, complete)?;
            }
        }
        if let Some(video) = self.video.take() {
            video.finish()?;
        }
        if let Some(sheet) = &self.sheet {
            sheet.write(&self.options.folder.join("contact-sheet.png"))?;
        }
        self.report.frames_sha256 = self.hash.finalize().into();
        Ok(self.report)
    }

    fn take(&mut self, frame: &Finished, complete: Time) -> Result<()> {
        let ticket = self.tickets.recv().context("a frame came out that was not put in")?;
        if ticket.rehearsal {
            if self.told.rehearsed.send(()).is_err() {
                log::debug!("the run ended before its rehearsal");
            }
            return Ok(());
        }
        let ms = |from: Time| complete.secs_since(from) * 1e3;
        self.report.frames += 1;
        if let Some(deadline) = ticket.deadline.filter(|d| complete > *d) {
            self.report.late += 1;
            log::info!(
                "frame {} was complete {:.1} ms late",
                ticket.frame,
                complete.secs_since(deadline) * 1e3
            );
        }
        self.report.frame_ms.push(ms(ticket.begun));
        self.report.gpu_ms.push(ms(ticket.submitted));
        self.report.first.get_or_insert(complete);
        for (samples, pass) in self.report.passes_ms.iter_mut().zip(frame.passes_ms) {
            if let Some(pass) = pass {
                samples.push(pass);
            }
        }
        if let Some(screen) = &mut self.screen {
            for pressed in screen.show(frame.rgba())? {
                let event = match pressed {
                    Pressed::Fire(pressed) => UserEvent::Trigger(TriggerEdge { time: now(), pressed }),
                    Pressed::Quit => UserEvent::Quit,
                };
                // The main loop may have ended already; then nobody wants to know.
                if self.told.user.send(event).is_err() {
                    log::debug!("a key came after the end of the run");
                }
            }
        }
        self.hash.update(Sha256::digest(frame.rgba()));
        if let Some(video) = &mut self.video {
            video.frame(frame.rgba())?;
        }
        self.pictures(frame, ticket.frame)
    }

    fn pictures(&mut self, frame: &Finished, index: u64) -> Result<()> {
        let on_sheet = self.sheet.as_ref().is_some_and(|s| s.wants(index));
        let still = self.options.stills.contains(&index);
        if !on_sheet && !still {
            return Ok(());
        }
        let picture =
            copy_frame(frame.rgba(), self.options.size).context("a frame has not the size of the screen")?;
        if let Some(sheet) = &mut self.sheet {
            sheet.frame(index, &picture);
        }
        if still {
            write_still(&self.options.folder.join(format!("frame-{index:05}.png")), picture)?;
        }
        Ok(())
    }
}
