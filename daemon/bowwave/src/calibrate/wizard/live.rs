//! The wizard in its own time: on the devices, or on a recording at that one's pace.

use std::{
    path::{Path, PathBuf},
    thread,
};

use anyhow::{Context, Result};
use bowwave_calibration::{
    CalibrationFile,
    wizard::{Ask, Detection, Detector, DetectorMode, Input, Key, Solved, Task, WizardStep, Work},
};
use bowwave_core::{
    event::{CameraFrame, Event, Tick},
    fault::{Change, FaultChange},
    guide::Guide,
    time::Time,
};
use bowwave_trainer::{
    Companion, TickClock, Trainer, TrainerOptions,
    presenter::{OutputOptions, PresenterOptions},
    source::{Devices, EventFeed, Source},
    storage::Recorder,
    summary::SummaryOptions,
    supervisor::Mode,
};
use crossbeam_channel::{Receiver, Sender, bounded, unbounded};

use super::{
    Guided,
    player::RecordingPlayer,
    terminal::{StdinClosed, TerminalUi},
};
use crate::{
    calibrate::input::begun,
    cli::CalibrateWizard,
    config::ScreenOutput,
    outcome::Outcome,
    run::{
        DATA, catch_signals,
        devices::device_settings,
        recording_in,
        settings::{Reader, Settings},
    },
    today::today,
};

/// Pictures that wait to be looked at: as many as come in a slow round, so that a pull finds the one nearest to it.
const PICTURES: usize = 4;

/// On the configured devices, and on the LCD.
pub fn run(arguments: &CalibrateWizard) -> Result<Outcome> {
    let reader = Reader::new(arguments.config.clone(), None);
    let mut settings = reader.read()?;
    let path = arguments.files.named_or(settings.config.files.calibration.as_deref(), &arguments.config)?;
    let file = if path.exists() {
        CalibrationFile::read(&path)?
    } else {
        let lens = settings.setup.calibration.lens;
        begun((lens.width, lens.height), today()?)
    };
    settings.setup.calibration = file.calibration.clone();
    settings.calibration_toml = bowwave_calibration::to_toml(&file);
    if arguments.window {
        settings.config.output = ScreenOutput::Window;
    }
    for fault in &settings.faults {
        if let Change::Raised { cause } = &fault.change {
            log::warn!("{cause}");
        }
    }
    let data = arguments.data.clone().or_else(|| settings.config.files.data.clone()).unwrap_or_else(|| {
        let usual = Path::new(DATA);
        if usual.is_dir() { usual } else { Path::new(".") }.to_owned()
    });
    std::fs::create_dir_all(&data)
        .with_context(|| format!("cannot make the folder {}; name another with --data", data.display()))?;
    let height = arguments.eye_height.unwrap_or(settings.setup.scenario.eye_height_m);
    settings.setup.scenario.eye_height_m = height;
    let out = arguments.files.out.clone().or(Some(path));
    let guided = Guided::new(arguments, file, out, height)?;
    let mut faults = Vec::new();
    let devices = Devices::start(device_settings(&settings, Mode::Training, &mut faults), &mut faults)?;
    let presenter = (settings.config.output != ScreenOutput::None).then(|| OutputOptions {
        reporter: Some(devices.output_reporter()),
        lcd: devices.lcd(),
        window: arguments.window,
        ..OutputOptions::default()
    });
    let screen = settings.config.size.or_else(|| devices.await_lcd_size());
    let options = options(&settings, screen, presenter, faults);
    let trainer = Trainer::start(
        options,
        Source::Devices(Box::new(devices)),
        TickClock::paced(),
        None,
        catch_signals()?,
    )?;
    Dialogue::new(guided, Some((settings, data)), arguments)?.hold(trainer)
}

/// On a recording, at its own pace.
pub fn paced(guided: Guided, player: RecordingPlayer, arguments: &CalibrateWizard) -> Result<Outcome> {
    let reader = Reader::new(arguments.config.clone(), None);
    let mut settings = reader.read()?;
    settings.setup.calibration = guided.wizard.calibration().clone();
    let presenter = arguments.window.then(|| OutputOptions { window: true, ..OutputOptions::default() });
    let options = options(&settings, settings.config.size, presenter, Vec::new());
    let source = Source::Feed(EventFeed::new(player.events.clone()));
    let trainer = Trainer::start(options, source, TickClock::paced(), None, catch_signals()?)?;
    let outcome = Dialogue::new(guided, None, arguments)?.hold(trainer);
    // A recording that cannot be played further says so here.
    player.finish()?;
    outcome
}

/// A trainer without boats and storage.
fn options(
    settings: &Settings,
    screen: Option<(u32, u32)>,
    output: Option<OutputOptions>,
    faults: Vec<FaultChange>,
) -> TrainerOptions {
    let mut setup = settings.setup.clone();
    setup.scenario.boats.clear();
    setup.boat_models.clear();
    setup.models = Vec::new().into();
    setup.screen = screen.unwrap_or(setup.screen);
    TrainerOptions {
        setup,
        presenter: output.map(|output| PresenterOptions { gpu: settings.config.gpu.clone(), output }),
        frames: None,
        plays_to_the_end: false,
        follow_lcd: false,
        boot_id: None,
        summary: SummaryOptions::default(),
        faults,
        waits: false,
    }
}

/// Pictures on their way to the eyes, and what these found.
type Watched = (Sender<(DetectorMode, CameraFrame)>, Receiver<(Time, Detection)>);

/// The wizard with its terminal, detector, solver and recordings.
struct Dialogue<'a> {
    guided: Guided,
    /// Of the gun, with the folder of recordings; `None` where a recording is played.
    gun: Option<(Settings, PathBuf)>,
    arguments: &'a CalibrateWizard,
    terminal: TerminalUi,
    /// Pictures on their way to the detector's thread.
    pictures: Sender<(DetectorMode, CameraFrame)>,
    findings: Receiver<(Time, Detection)>,
    solved: (Sender<Solved>, Receiver<Solved>),
    recorder: Option<Recorder>,
    /// No recording could be begun.
    cannot_record: bool,
    /// Recordings made so far.
    recordings: Vec<(PathBuf, Task)>,
}

impl Companion for Dialogue<'_> {
    fn waits(&self) -> bool {
        self.guided.wizard.waits()
    }

    fn frame(&mut self, events: &[Event], tick: Tick) -> Result<Option<Guide>> {
        if self.guided.wizard.step() == WizardStep::Over {
            return Ok(None);
        }
        self.keys();
        if self.gun.is_some() {
            self.guided.wizard.take(Input::Time(tick.time));
        }
        self.record(events, tick)?;
        for event in events {
            match event {
                // Where looking takes longer than pictures come, some are left out.
                Event::Frame(frame) => {
                    let _ = self.pictures.try_send((self.guided.wizard.look(), frame.clone()));
                }
                event => self.guided.event(event.clone()),
            }
        }
        for (arrival, finding) in self.findings.try_iter() {
            self.guided.wizard.take(Input::Seen(arrival, finding));
        }
        for solved in self.solved.1.try_iter() {
            let report = solved.report.clone();
            self.guided.wizard.take(Input::Solved(Box::new(solved)));
            self.guided.report(&report);
        }
        self.serve()?;
        self.show().map(Some)
    }

    fn source_ended(&mut self) {
        self.guided.wizard.take(Input::Ended);
    }

    fn quit(&mut self) {
        self.guided.wizard.take(Input::Key(Key::Quit));
    }
}

impl<'a> Dialogue<'a> {
    fn new(guided: Guided, gun: Option<(Settings, PathBuf)>, arguments: &'a CalibrateWizard) -> Result<Self> {
        let (pictures, findings) = watch(guided.eyes(arguments))?;
        Ok(Self {
            guided,
            gun,
            arguments,
            terminal: TerminalUi::new(),
            pictures,
            findings,
            solved: unbounded(),
            recorder: None,
            cannot_record: false,
            recordings: Vec::new(),
        })
    }

    /// Holds the dialogue in the trainer's loop.
    fn hold(mut self, trainer: Trainer) -> Result<Outcome> {
        let ended = trainer.accompany(&mut self);
        if let Some(recorder) = self.recorder.take()
            && let Err(e) = recorder.finish()
        {
            log::error!("{e:#}");
        }
        self.terminal.finish(&self.guided.wizard.guide())?;
        for (path, task) in &self.recordings {
            eprintln!("what was gathered is kept: bowwave calibrate {} {}", task.command(), path.display());
        }
        ended?;
        Ok(self.guided.outcome())
    }

    /// The page: on the terminal with the name of the recording.
    fn show(&mut self) -> Result<Guide> {
        let page = self.guided.wizard.guide();
        let mut on_terminal = page.clone();
        if let Some((path, _)) = self.recordings.last().filter(|_| self.recorder.is_some()) {
            on_terminal.lines.push(format!("recorded in {}", path.display()));
        }
        self.terminal.show(&on_terminal)?;
        Ok(page)
    }

    fn keys(&mut self) {
        let is_deaf = loop {
            match self.terminal.key() {
                Ok(Some(key)) => self.guided.wizard.take(Input::Key(key)),
                Ok(None) => break false,
                Err(StdinClosed) => break true,
            }
        };
        // At the gun the trigger goes on; a recording has nobody who could.
        if is_deaf && self.gun.is_none() && self.guided.wizard.waits() {
            self.guided.wizard.take(Input::Key(Key::Quit));
        }
    }

    /// Records the devices' events, so that they can be solved again.
    fn record(&mut self, events: &[Event], tick: Tick) -> Result<()> {
        let Some((settings, data)) = &self.gun else { return Ok(()) };
        let step = self.guided.wizard.step();
        if step == WizardStep::Gather && self.recorder.is_none() && !self.cannot_record {
            let task = self.guided.wizard.task();
            let options = recording_in(data, &format!("calibrate-{}", task.command()), settings);
            match Recorder::start(&options) {
                Ok(recorder) => {
                    self.recordings.push((options.path, task));
                    self.recorder = Some(recorder);
                }
                // The calibration does not need it.
                Err(e) => {
                    log::warn!("what is gathered is not kept: {e:#}; name another folder with --data");
                    self.cannot_record = true;
                }
            }
        } else if matches!(step, WizardStep::Choose | WizardStep::Saved | WizardStep::Over)
            && let Some(recorder) = self.recorder.take()
        {
            let lost = recorder.lost();
            recorder.finish()?;
            if lost > 0 {
                log::warn!("{lost} pictures or readings are not in the recording: the disk is too slow");
            }
        }
        if let Some(recorder) = &mut self.recorder {
            recorder.inputs(events, tick, None);
        }
        Ok(())
    }

    fn serve(&mut self) -> Result<()> {
        while let Some(ask) = self.guided.wizard.ask() {
            match ask {
                Ask::Solve(work) => solve(*work, self.solved.0.clone())?,
                Ask::Save(found) => {
                    self.guided.save(&found);
                    (self.pictures, self.findings) = watch(self.guided.eyes(self.arguments))?;
                    if let Some((settings, _)) = &mut self.gun {
                        settings.calibration_toml = bowwave_calibration::to_toml(&self.guided.file);
                    }
                }
                Ask::End => {}
            }
        }
        Ok(())
    }
}

/// Looks at pictures in a thread of its own, which ends when no more can come.
fn watch(mut eyes: Detector) -> Result<Watched> {
    let (pictures, incoming) = bounded::<(DetectorMode, CameraFrame)>(PICTURES);
    let (told, findings) = unbounded();
    thread::Builder::new()
        .name("eyes".to_owned())
        .spawn(move || {
            for (look, frame) in incoming {
                if told.send((frame.arrival, eyes.look(look, &frame))).is_err() {
                    return;
                }
            }
        })
        .context("cannot start the thread that looks at pictures; are too many processes running?")?;
    Ok((pictures, findings))
}

/// Solves in a thread of its own.
fn solve(work: Work, told: Sender<Solved>) -> Result<()> {
    thread::Builder::new()
        .name("solver".to_owned())
        .spawn(move || {
            // Nobody waits for it any more where this fails.
            let _ = told.send(work.run());
        })
        .context("cannot start the solver's thread; are too many processes running?")?;
    Ok(())
}
