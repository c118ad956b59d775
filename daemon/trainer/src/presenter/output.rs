//! The output thread: waits for finished frames and takes them to the LCD, the window, the hash, the video and the pictures.

use std::{
    path::PathBuf,
    sync::Arc,
    thread::{self, JoinHandle},
    time::Duration,
};

use anyhow::{Context, Result, anyhow};
use bowwave_core::{
    act::{Act, TraineeAct},
    event::TriggerEdge,
    frame::scene::Pass,
    time::Time,
};
use bowwave_devices::{clock::now, lcd::LcdPort, report::Reporter};
use bowwave_render::{Completions, FinishedFrame};
use crossbeam_channel::{Receiver, Sender, bounded, unbounded};
use sha2::{Digest, Sha256};

use super::{
    gamepad::Gamepad,
    hashes::HashLog,
    lateness::Lateness,
    pictures::{ContactSheet, copy_frame, write_still},
    video::{VideoTimes, VideoWriter},
    window::{Pressed, Screen},
};
use crate::{instructor::PictureTap, summary::stats::Samples};

/// How long the thread waits for a frame before it looks whether there will be another.
const WAIT: Duration = Duration::from_millis(80);

/// Completed frames that wait to be asked for.
const DONE: usize = 64;

/// Uses of the finished frames.
#[derive(Clone, Debug, Default)]
pub struct OutputOptions {
    /// Where the thread reports that it lives, if anybody looks.
    pub reporter: Option<Reporter>,
    /// The LCD.
    pub lcd: Option<Arc<LcdPort>>,
    /// The instructor's live picture.
    pub tap: Option<Arc<PictureTap>>,
    /// File that gets the SHA-256 of each frame's red, green and blue bytes, newest last, the last few hundred.
    pub frame_hashes: Option<PathBuf>,
    /// Whether to hash all frames into one number for the report.
    pub hash: bool,
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
    /// What whoever sits there may do.
    pub seat: Seat,
}

/// What whoever sits before the window may do. Escape ends the run from any seat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Seat {
    /// To watch.
    Watcher,
    /// To watch, and to drive a boat.
    Driver,
    /// To fire and to act: the gun moves as it was recorded.
    #[default]
    Trainee,
    /// To turn the gun as well.
    Gunner,
}

/// What a frame carries through the renderer.
#[derive(Clone, Copy, Debug)]
pub struct Ticket {
    /// The scene's frame number.
    pub frame: u64,
    /// When it was due or, without a clock, begun.
    pub begun: Time,
    /// When it was handed to the GPU.
    pub submitted: Time,
    /// The time that it shows: the mid-exposure of its picture.
    pub shows: Time,
    /// When it must be complete.
    pub deadline: Option<Time>,
    /// Drawn so that the driver is warm, not to be shown or counted.
    pub warm_up: bool,
}

/// What the user did at the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UserEvent {
    /// The space bar.
    Trigger(TriggerEdge),
    /// Mouse and arrow keys: a simulated gun is to turn to the right and upwards, in widths of the picture.
    Turn([f64; 2]),
    /// Z: the gun stands at its stow.
    Rezero,
    /// A letter: an act of the trainee.
    Act(TraineeAct),
    /// Escape, or the window was closed.
    Quit,
}

/// A frame that is complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompletedFrame {
    /// The scene's frame number.
    pub frame: u64,
    /// When it was begun.
    pub begun: Time,
    /// When its pixels were complete.
    pub complete: Time,
    /// It was complete after its deadline.
    pub is_late: bool,
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
    /// Over the SHA-256 of each frame; `None` where nobody asked for it.
    pub frames_sha256: Option<[u8; 32]>,
    /// Times of the video's frames; `None` without one.
    pub video: Option<VideoTimes>,
}

impl OutputReport {
    /// Adds what a later thread of the same run measured.
    pub fn add(&mut self, later: Self) {
        self.frames += later.frames;
        self.late += later.late;
        self.frame_ms.add(&later.frame_ms);
        self.gpu_ms.add(&later.gpu_ms);
        self.passes_ms.iter_mut().zip(&later.passes_ms).for_each(|(all, more)| all.add(more));
        self.first = self.first.or(later.first);
        self.frames_sha256 = later.frames_sha256;
        // It has begun its file from the start.
        self.video = later.video;
    }
}

/// The running thread.
#[derive(Debug)]
pub struct OutputThread {
    user: Receiver<UserEvent>,
    warm: Receiver<()>,
    done: Receiver<CompletedFrame>,
    thread: Option<JoinHandle<Result<OutputReport>>>,
}

impl OutputThread {
    /// Starts the thread. Files are opened here, so that what cannot work says so before the run.
    pub fn start(completions: Completions<Ticket>, options: OutputOptions) -> Result<Self> {
        let video = if options.video {
            Some(VideoWriter::create(&options.folder.join("video.mp4"), options.size)?)
        } else {
            None
        };
        let (user_sender, user) = unbounded();
        let (warm_sender, warm) = unbounded();
        let (done_sender, done) = bounded(DONE);
        let told = LoopQueues { user: user_sender, warm: warm_sender, done: done_sender };
        let hashes = options.frame_hashes.as_deref().map(HashLog::create).transpose()?;
        let thread = thread::Builder::new()
            .name("output".to_owned())
            .spawn(move || OutputWorker::new(completions, told, options, (video, hashes)).run())
            .context("cannot start the output thread; are too many processes running?")?;
        Ok(Self { user, warm, done, thread: Some(thread) })
    }

    /// Waits until the warm-up is complete, or the thread has ended, but no longer than `timeout`; whether it is complete.
    pub fn await_warm_up(&self, timeout: Duration) -> bool {
        self.warm.recv_timeout(timeout).is_ok()
    }

    /// Frames completed since the last call. Where nobody asks, none are kept.
    pub fn done(&self) -> impl Iterator<Item = CompletedFrame> + '_ {
        self.done.try_iter()
    }

    /// Whether the thread still runs. One that has ended says why in [`Self::finish`].
    pub fn runs(&self) -> bool {
        self.thread.as_ref().is_some_and(|t| !t.is_finished())
    }

    /// What the user did since the last call.
    pub fn user_events(&self) -> impl Iterator<Item = UserEvent> + '_ {
        self.user.try_iter()
    }

    /// Waits until every frame is taken and all files are written. The renderer must be gone by now.
    pub fn finish(mut self) -> Result<OutputReport> {
        let thread = self.thread.take().context("the output thread has already ended")?;
        thread.join().map_err(|_| anyhow!("the output thread broke down; report it with the log"))?
    }
}

/// Ends of the queues to the main loop.
struct LoopQueues {
    user: Sender<UserEvent>,
    warm: Sender<()>,
    done: Sender<CompletedFrame>,
}

struct OutputWorker {
    completions: Completions<Ticket>,
    told: LoopQueues,
    options: OutputOptions,
    video: Option<VideoWriter>,
    hashes: Option<HashLog>,
    sheet: Option<ContactSheet>,
    screen: Option<Screen>,
    gamepad: Option<Gamepad>,
    hash: Sha256,
    lateness: Lateness,
    report: OutputReport,
}

impl OutputWorker {
    fn new(
        completions: Completions<Ticket>,
        told: LoopQueues,
        options: OutputOptions,
        (video, hashes): (Option<VideoWriter>, Option<HashLog>),
    ) -> Self {
        let sheet = options.sheet.then(|| ContactSheet::new(options.frames, options.size));
        Self {
            completions,
            told,
            options,
            video,
            hashes,
            sheet,
            screen: None,
            gamepad: None,
            hash: Sha256::new(),
            lateness: Lateness::default(),
            report: OutputReport::default(),
        }
    }

    fn run(mut self) -> Result<OutputReport> {
        if self.options.window {
            self.screen = Some(Screen::open(self.options.size, self.options.seat == Seat::Gunner)?);
            self.gamepad = (self.options.seat != Seat::Watcher).then(Gamepad::find).flatten();
        }
        while !self.completions.is_over() {
            if let Some(reporter) = &self.options.reporter {
                reporter.beat();
            }
            if let Some(frame) = self.completions.wait_next(WAIT)? {
                let complete = now();
                self.take(&frame, complete)?;
            }
        }
        if let Some(video) = self.video.take() {
            self.report.video = Some(video.finish()?);
        }
        if let Some(sheet) = &self.sheet {
            sheet.write(&self.options.folder.join("contact-sheet.png"))?;
        }
        self.report.frames_sha256 = self.options.hash.then(|| self.hash.finalize().into());
        Ok(self.report)
    }

    fn take(&mut self, frame: &FinishedFrame<Ticket>, complete: Time) -> Result<()> {
        let ticket = frame.ticket;
        if ticket.warm_up {
            if self.told.warm.send(()).is_err() {
                log::debug!("the run ended before its warm-up");
            }
            return Ok(());
        }
        let ms = |from: Time| complete.secs_since(from) * 1e3;
        self.report.frames += 1;
        if let Some(deadline) = ticket.deadline.filter(|d| complete > *d) {
            self.report.late += 1;
            let late_s = complete.secs_since(deadline);
            if let Some(line) = self.lateness.take(ticket.frame, complete, late_s) {
                log::info!("{line}");
            }
        }
        if let Some(lcd) = &self.options.lcd {
            // Without a display, frames go nowhere; the port has reported that.
            let _ = lcd.show(frame.rgba(), self.options.size, ticket.frame);
        }
        // A caller that does not ask gets the first ones only.
        let _ = self.told.done.try_send(CompletedFrame {
            frame: ticket.frame,
            begun: ticket.begun,
            complete: now(),
            is_late: ticket.deadline.is_some_and(|d| complete > d),
        });
        if let Some(tap) = &self.options.tap {
            tap.offer(ticket.frame, complete, frame.rgba(), self.options.size);
        }
        self.report.frame_ms.push(ms(ticket.begun));
        self.report.gpu_ms.push(ms(ticket.submitted));
        self.report.first.get_or_insert(complete);
        for (samples, pass) in self.report.passes_ms.iter_mut().zip(frame.passes_ms) {
            if let Some(pass) = pass {
                samples.push(pass);
            }
        }
        self.hear(frame)?;
        if self.options.hash {
            self.hash.update(Sha256::digest(frame.rgba()));
        }
        if let Some(hashes) = &mut self.hashes {
            hashes.frame(ticket.frame, frame.rgba())?;
        }
        if let Some(video) = &mut self.video {
            video.frame(frame.rgba(), ticket.shows)?;
        }
        self.pictures(frame, ticket.frame)
    }

    /// Shows the frame in the window, and hands on what the user did.
    fn hear(&mut self, frame: &FinishedFrame<Ticket>) -> Result<()> {
        let Some(screen) = &mut self.screen else { return Ok(()) };
        let mut done: Vec<Pressed> = screen.show(frame.rgba())?.collect();
        if let Some(gamepad) = &mut self.gamepad {
            match gamepad.poll() {
                Some(pressed) => done.extend(pressed),
                None => self.gamepad = None,
            }
        }
        let seat = self.options.seat;
        let may = |pressed: &Pressed| match pressed {
            Pressed::Quit => true,
            Pressed::Turn(_) => seat == Seat::Gunner,
            // Whoever watches a simulated gunner may drive a boat against it.
            Pressed::Act(Act::Drive(_)) => seat != Seat::Watcher,
            Pressed::Fire(_) | Pressed::Rezero | Pressed::Act(_) => {
                matches!(seat, Seat::Trainee | Seat::Gunner)
            }
        };
        for pressed in done.into_iter().filter(may) {
            let event = match pressed {
                Pressed::Fire(pressed) => UserEvent::Trigger(TriggerEdge { time: now(), pressed }),
                Pressed::Turn(turn) => UserEvent::Turn(turn),
                Pressed::Rezero => UserEvent::Rezero,
                Pressed::Act(act) => UserEvent::Act(TraineeAct { time: now(), act }),
                Pressed::Quit => UserEvent::Quit,
            };
            // The main loop may have ended already; then nobody wants to know.
            if self.told.user.send(event).is_err() {
                log::debug!("a key came after the end of the run");
            }
        }
        Ok(())
    }

    fn pictures(&mut self, frame: &FinishedFrame<Ticket>, index: u64) -> Result<()> {
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
