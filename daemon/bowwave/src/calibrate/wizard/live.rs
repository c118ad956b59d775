//! The wizard in its own time: on the devices, or on a recording at that one's pace.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, atomic::Ordering},
    thread,
    time::Duration,
};

use anyhow::{Context, Result};
use bowwave_calibration::{
    CalibrationFile,
    wizard::{Ask, Detection, Detector, DetectorMode, Input, Key, Solved, Task, WizardStep, Work},
};
use bowwave_core::{
    event::{CameraFrame, Event, Tick},
    fault::{Change, FaultChange},
    time::Time,
};
use bowwave_devices::clock::now;
use bowwave_trainer::{Signals, source::Devices, storage::Recorder, supervisor::Mode};
use crossbeam_channel::{Receiver, Sender, TryRecvError, bounded, unbounded};

use super::{
    Guided,
    player::RecordingPlayer,
    screen::Screen,
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

/// Time between looks at devices and keys: that of the display.
const TICK: Duration = Duration::from_millis(33);

/// Pictures that wait to be looked at: as many as come in a slow round, so that a pull finds the one nearest to it.
const PICTURES: usize = 4;

/// Where events come from.
enum Source {
    Devices { devices: Box<Devices>, settings: Box<Settings>, data: PathBuf },
    Recording(RecordingPlayer),
}

/// On the configured devices, and on the LCD.
pub fn run(arguments: &CalibrateWizard) -> Result<Outcome> {
    let reader = Reader { config: arguments.config.clone(), last_good: None };
    let mut settings = reader.read()?;
    let named = arguments.files.calibration.clone().or_else(|| settings.config.calibration.clone());
    let path = named
        .context("nothing says where the calibration lies: set files.calibration in the configuration, or say --calibration")?;
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
    let data = arguments.data.clone().or_else(|| settings.config.data.clone()).unwrap_or_else(|| {
        let usual = Path::new(DATA);
        if usual.is_dir() { usual } else { Path::new(".") }.to_owned()
    });
    std::fs::create_dir_all(&data)
        .with_context(|| format!("cannot make the folder {}; name another with --data", data.display()))?;
    let height = arguments.eye_height.unwrap_or(settings.setup.scenario.eye_height_m);
    settings.setup.scenario.eye_height_m = height;
    let out = arguments.files.out.clone().or(Some(path));
    let guided = Guided::new(arguments, file, out, height)?;
    let signals = catch_signals()?;
    let mut faults = Vec::new();
    let devices = device_settings(&settings, Mode::Training, &mut faults);
    let devices = Devices::start(devices, &mut faults)?;
    let screen = (settings.config.output != ScreenOutput::None)
        .then(|| Screen::open(&mut settings, Some(&devices), arguments.window))
        .transpose()?;
    let source = Source::Devices { devices: Box::new(devices), settings: Box::new(settings), data };
    Loop::new(guided, source, screen, signals, arguments)?.run(faults)
}

/// On a recording, at its own pace.
pub fn paced(guided: Guided, player: RecordingPlayer, arguments: &CalibrateWizard) -> Result<Outcome> {
    let signals = catch_signals()?;
    let screen = arguments
        .window
        .then(|| {
            let reader = Reader { config: arguments.config.clone(), last_good: None };
            let mut settings = reader.read()?;
            settings.setup.calibration = guided.wizard.calibration().clone();
            Screen::open(&mut settings, None, true)
        })
        .transpose()?;
    Loop::new(guided, Source::Recording(player), screen, signals, arguments)?.run(Vec::new())
}

/// Pictures on their way to the eyes, and what these found.
type Watched = (Sender<(DetectorMode, CameraFrame)>, Receiver<(Time, Detection)>);

/// The wizard with everything around it.
struct Loop<'a> {
    guided: Guided,
    source: Source,
    screen: Option<Screen>,
    signals: Arc<Signals>,
    arguments: &'a CalibrateWizard,
    teller: TerminalUi,
    /// Pictures that are looked at beside.
    pictures: Sender<(DetectorMode, CameraFrame)>,
    findings: Receiver<(Time, Detection)>,
    solved: (Sender<Solved>, Receiver<Solved>),
    recorder: Option<Recorder>,
    /// No recording could be begun.
    cannot_record: bool,
    /// Recordings made so far.
    recordings: Vec<(PathBuf, Task)>,
}

impl<'a> Loop<'a> {
    fn new(
        guided: Guided,
        source: Source,
        screen: Option<Screen>,
        signals: Arc<Signals>,
        arguments: &'a CalibrateWizard,
    ) -> Result<Self> {
        let (pictures, findings) = watch(guided.eyes(arguments))?;
        Ok(Self {
            guided,
            source,
            screen,
            signals,
            arguments,
            teller: TerminalUi::new(),
            pictures,
            findings,
            solved: unbounded(),
            recorder: None,
            cannot_record: false,
            recordings: Vec::new(),
        })
    }

    fn run(mut self, mut faults: Vec<FaultChange>) -> Result<Outcome> {
        let ended = self.rounds(&mut faults);
        if let Some(recorder) = self.recorder.take()
            && let Err(e) = recorder.finish()
        {
            log::error!("{e:#}");
        }
        self.teller.finish(&self.guided.wizard.guide())?;
        for (path, task) in &self.recordings {
            eprintln!("what was gathered is kept: bowwave calibrate {} {}", task.command(), path.display());
        }
        if let Some(screen) = self.screen {
            screen.close();
        }
        match self.source {
            Source::Devices { devices, .. } => devices.stop(),
            // A recording that cannot be played further says so here.
            Source::Recording(player) => drop(player.finish()?),
        }
        ended?;
        Ok(self.guided.outcome())
    }

    fn rounds(&mut self, faults: &mut Vec<FaultChange>) -> Result<()> {
        let mut events = Vec::new();
        while self.guided.wizard.step() != WizardStep::Over {
            self.keys();
            self.collect(&mut events, faults);
            self.record(&events)?;
            for event in events.drain(..) {
                self.event(event);
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
            self.show()?;
            thread::sleep(TICK);
        }
        Ok(())
    }

    fn show(&mut self) -> Result<()> {
        let mut guide = self.guided.wizard.guide();
        if let Some(screen) = &mut self.screen
            && let Err(e) = screen.show(guide.clone())
        {
            log::error!("the display is lost, the rest goes on: {e:#}");
            self.screen = None;
        }
        if let Some((path, _)) = self.recordings.last().filter(|_| self.recorder.is_some()) {
            guide.lines.push(format!("recorded in {}", path.display()));
        }
        self.teller.show(&guide)
    }

    fn keys(&mut self) {
        let is_deaf = loop {
            match self.teller.key() {
                Ok(Some(key)) => self.guided.wizard.take(Input::Key(key)),
                Ok(None) => break false,
                Err(StdinClosed) => break true,
            }
        };
        // At the gun the trigger goes on; a recording has nobody who could.
        if is_deaf && matches!(self.source, Source::Recording(_)) && self.guided.wizard.waits() {
            self.guided.wizard.take(Input::Key(Key::Quit));
        }
        if self.signals.stop.load(Ordering::Relaxed) || self.screen.as_ref().is_some_and(Screen::is_closed) {
            self.guided.wizard.take(Input::Key(Key::Quit));
        }
    }

    fn collect(&mut self, events: &mut Vec<Event>, faults: &mut Vec<FaultChange>) {
        match &mut self.source {
            Source::Devices { devices, .. } => {
                devices.collect(events, faults);
                events.extend(faults.drain(..).map(Event::Fault));
                self.guided.wizard.take(Input::Time(now()));
            }
            // A recording stands still while a key is waited for.
            Source::Recording(_) if self.guided.wizard.waits() => {}
            Source::Recording(player) => loop {
                match player.events.try_recv() {
                    Ok(event) => events.push(event),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => {
                        self.guided.wizard.take(Input::Ended);
                        break;
                    }
                }
            },
        }
    }

    fn event(&mut self, event: Event) {
        let Event::Frame(frame) = event else { return self.guided.event(event) };
        if let Some(screen) = &mut self.screen {
            screen.picture(&frame.picture);
        }
        // Where looking takes longer than pictures come, some are left out.
        let _ = self.pictures.try_send((self.guided.wizard.look(), frame));
    }

    /// Records the devices' events, so that they can be solved again.
    fn record(&mut self, events: &[Event]) -> Result<()> {
        let Source::Devices { settings, data, .. } = &self.source else { return Ok(()) };
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
            let tick = Tick::at(now());
            events.iter().for_each(|event| recorder.event(event, tick));
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
                    if let Source::Devices { settings, .. } = &mut self.source {
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
