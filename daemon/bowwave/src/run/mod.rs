//! `bowwave run`: the trainer on the gun computer's own devices, as the service runs it.

pub(crate) mod devices;
mod recording;
pub mod settings;

use std::{
    env,
    path::{Path, PathBuf},
    sync::{Arc, atomic::AtomicBool, atomic::Ordering},
    thread,
    time::Duration,
};

use anyhow::{Context, Result};
use bowwave_core::{
    event::PixelFormat,
    fault::{Fault, FaultChange},
    time::Time,
    world::scenario::{self, Scenario},
};
use bowwave_devices::clock::now;
use bowwave_record::{JournalOptions, Run as JournalRun, RunDetails};
use bowwave_trainer::{
    Ended, ReloadCause, Signals, TickClock, Trainer, TrainerOptions,
    instructor::{AskedScenario, InstructorPort, PictureTap},
    presenter::{GpuSettings, OutputOptions, PresenterOptions},
    source::{Devices, Source},
    storage::{JOURNAL, Storage, StorageOptions},
    summary::SummaryOptions,
    supervisor::{CrashLoopGuard, Mode, Notifier, Pulse},
};
use signal_hook::{
    consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1},
    iterator::Signals as Incoming,
};

use crate::{
    cli::RunArgs,
    config::{InstructorSettings, ScreenOutput},
    instructed,
    outcome::Outcome,
};
pub(crate) use recording::recording_in;
use settings::{Reader, Settings};

/// Where data go when nobody says: the folder that the package makes.
pub const DATA: &str = "/var/lib/bowwave";

/// Runs until a signal ends it.
pub fn run(arguments: &RunArgs, program_start: Time) -> Result<Outcome> {
    let signals = catch_signals()?;
    let starts = Arc::new(CrashLoopGuard::begin(env::var_os("RUNTIME_DIRECTORY").map(PathBuf::from), now()));
    let pulse = Pulse::start(Arc::clone(&signals), Arc::clone(&starts))?;
    let mut pulsing = pulse.during_start();
    let mut lcd_size = None;
    let mut notifier = Notifier::from_environment();
    // The folder of the last good settings cannot be configured by settings that may be bad.
    let state = env::var_os("STATE_DIRECTORY").map(PathBuf::from);
    let last_good = arguments.data.clone().or(state.clone()).map(|d| d.join("last-good"));
    let mut reader = Reader::new(arguments.config.clone(), last_good);
    (reader.data, reader.state) = (arguments.data.clone(), state);
    let mut instructor = None;
    loop {
        let mut settings = reader.read()?;
        let data = reader.data(&settings.config);
        if let Err(e) = std::fs::create_dir_all(&data) {
            // Hits are kept in memory then, and the LCD says so.
            log::error!("cannot make the data folder {}: {e}; name another in files.data", data.display());
        }
        let mode = starts.mode();
        if mode == Mode::Training {
            join_instructor(&mut instructor, &mut settings, &data);
        }
        let asked = reader.asked.as_ref();
        let tap = instructor.as_ref().map(|joined: &Joined| joined.port.tap());
        let gun = Gun { arguments, data: &data, mode, program_start, lcd_size, asked, tap };
        let trainer = gun.start(settings, Arc::clone(&signals))?;
        drop(pulsing);
        let finished = match &mut instructor {
            Some(Joined { port, .. }) => {
                port.begin_session(Some(&data.join(JOURNAL)), asked.is_some_and(|asked| asked.is_stand_by));
                trainer.run_instructed(&mut notifier, Some(&pulse), port)?
            }
            None => trainer.run(&mut notifier, Some(&pulse))?,
        };
        pulsing = pulse.during();
        if let Err(e) = finished.summary.write(&data.join("summary.json")) {
            log::warn!("{e:#}");
        }
        log::info!("ran for {:.1} s", now().secs_since(program_start));
        match finished.ended {
            Ended::Stopped => {
                starts.ended_well();
                return Ok(Outcome::Done);
            }
            Ended::Reload { lcd, cause } => {
                lcd_size = lcd;
                if let Some(Joined { port, .. }) = &instructor {
                    port.prepare("ANOTHER RUN BEGINS");
                }
                match cause {
                    ReloadCause::Asked(asked) => reader.asked = Some(asked),
                    // Whoever has the settings read again wants what is configured.
                    ReloadCause::Settings => reader.asked = None,
                    ReloadCause::Screen => {}
                }
                notifier.reloading();
                // All of the former run is written, and a request to stop need not wait for files.
                drop(pulsing);
                pulsing = pulse.during_start();
            }
        }
    }
}

/// An instructor's socket, with the settings that it was made by.
struct Joined {
    settings: InstructorSettings,
    port: InstructorPort,
}

/// Listens on the configured socket, unless that is done already. A training goes on without an instructor.
fn join_instructor(joined: &mut Option<Joined>, settings: &mut Settings, data: &Path) {
    let wanted = &settings.config.instructor;
    if joined.as_ref().is_some_and(|joined| joined.settings == *wanted) {
        return;
    }
    // The path may be the same one.
    *joined = None;
    let Some(socket) = &wanted.socket else { return };
    match instructed::listen(socket, instructed::scenarios(&settings.config, data), |_| Ok(())) {
        Ok(port) => {
            port.prepare("THE TRAINER STARTS");
            *joined = Some(Joined { settings: wanted.clone(), port });
        }
        Err(e) => {
            let why = format!("{e:#}; no instructor can join");
            settings.faults.push(FaultChange::raised(now(), Fault::Config, why));
        }
    }
}

/// The trainer on the gun's devices, before it is started.
struct Gun<'a> {
    arguments: &'a RunArgs,
    data: &'a Path,
    mode: Mode,
    program_start: Time,
    /// Size of the LCD before the settings were read anew.
    lcd_size: Option<(u32, u32)>,
    /// The scenario that the instructor asked for.
    asked: Option<&'a AskedScenario>,
    /// The instructor's live picture.
    tap: Option<Arc<PictureTap>>,
}

impl Gun<'_> {
    /// Starts devices, journal and GPU.
    fn start(&self, mut settings: Settings, signals: Arc<Signals>) -> Result<Trainer> {
        let mut faults = std::mem::take(&mut settings.faults);
        if self.mode == Mode::Safe {
            make_safe(&mut settings)?;
            let cause = "the program was started too often within a minute: video and this message only until it is stopped; \
                         the log has the reason (journalctl -u bowwave)";
            faults.push(FaultChange::raised(now(), Fault::CrashLoop, cause));
        }
        let devices =
            Devices::start(devices::device_settings(&settings, self.mode, &mut faults), &mut faults)?;
        let lcd_size = || devices.await_lcd_size().or(self.lcd_size);
        if let Some(size) = settings.config.size.or_else(lcd_size) {
            settings.setup.screen = size;
        }
        // The service hides /proc/sys; systemd tells it.
        let boot_id = env::var("BOWWAVE_BOOT_ID").ok().or_else(bowwave_record::boot_id);
        let storage = match self.mode {
            Mode::Safe => None,
            // There is nothing to keep.
            Mode::Training if self.asked.is_some_and(|asked| asked.is_stand_by) => None,
            Mode::Training => Some(Storage::open(self.storage(&settings, boot_id.clone()), &mut faults)?),
        };
        let config = &settings.config;
        let presenter = PresenterOptions {
            gpu: gpu(&config.gpu, self.mode),
            output: OutputOptions {
                reporter: Some(devices.output_reporter()),
                lcd: devices.lcd(),
                tap: self.tap.clone(),
                frame_hashes: self.arguments.frame_hashes.clone(),
                window: config.output == ScreenOutput::Window,
                ..OutputOptions::default()
            },
        };
        let options = TrainerOptions {
            follow_lcd: config.size.is_none(),
            setup: settings.setup,
            presenter: Some(presenter),
            frames: None,
            plays_to_the_end: false,
            boot_id,
            summary: SummaryOptions { program_start: self.program_start, ..SummaryOptions::default() },
            faults,
            waits: self.asked.is_some(),
        };
        Trainer::start(options, Source::Devices(Box::new(devices)), TickClock::paced(), storage, signals)
    }

    fn storage(&self, settings: &Settings, boot_id: Option<String>) -> StorageOptions {
        StorageOptions {
            folder: self.data.to_owned(),
            run: JournalRun {
                // Filled in once the clock is known to be set.
                started_wall_ns: None,
                scenario: settings.setup.scenario.name.clone(),
                recording: String::new(),
                seed: settings.setup.scenario.seed,
                version: env!("CARGO_PKG_VERSION").to_owned(),
                boot_id,
                started: Some(now()),
                details: Some(RunDetails::of(&settings.setup, &settings.models_base).to_json()),
            },
            journal: JournalOptions {
                reserve_bytes: JournalOptions::RESERVE_BYTES,
                own: true,
                // The service is killed after two seconds.
                end_within: Duration::from_millis(700),
                ..JournalOptions::default()
            },
            recording: settings.config.files.record.then(|| recording_in(self.data, "recording", settings)),
            strict: false,
            print_commits: self.arguments.print_commits,
        }
    }
}

/// Video and message only.
fn make_safe(settings: &mut Settings) -> Result<()> {
    let empty =
        scenario::BUILT_IN.iter().find(|(name, _)| *name == "empty").context("no built-in empty scenario")?;
    settings.setup.scenario = Scenario::parse(empty.1, "built-in empty scenario")?;
    settings.setup.models = Vec::new().into();
    settings.setup.boat_models = Vec::new();
    settings.setup.video = PixelFormat::Yuyv;
    settings.config.files.record = false;
    Ok(())
}

/// The configured device; in SAFE MODE software where there is one, for it may be the GPU's driver that crashes.
fn gpu(configured: &GpuSettings, mode: Mode) -> GpuSettings {
    let software = || {
        let devices = bowwave_render::devices().ok()?;
        devices.iter().find(|d| d.software).map(|d| d.index.to_string())
    };
    let device = match mode {
        Mode::Training => None,
        Mode::Safe => software(),
    };
    GpuSettings { device: device.or_else(|| configured.device.clone()), ..configured.clone() }
}

/// SIGTERM and SIGINT end the run, SIGHUP has the settings read anew, SIGUSR1 says that the gun stands at its stow.
pub(crate) fn catch_signals() -> Result<Arc<Signals>> {
    let signals = Arc::new(Signals::default());
    let mut incoming = Incoming::new([SIGTERM, SIGINT, SIGHUP, SIGUSR1]).context("cannot catch signals")?;
    let told = Arc::clone(&signals);
    thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            for signal in incoming.forever() {
                let flag: &AtomicBool = match signal {
                    SIGHUP => &told.reload,
                    SIGUSR1 => &told.rezero,
                    _ => &told.stop,
                };
                flag.store(true, Ordering::Relaxed);
            }
        })
        .context("cannot start the thread that waits for signals; are too many processes running?")?;
    Ok(signals)
}
