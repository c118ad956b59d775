//! `bowwave run`: the trainer on the gun computer's own devices, as the service runs it.

mod faults;
pub(crate) mod hardware;
mod health;
pub(crate) mod keeping;
mod notify;
mod pulse;
pub mod settings;
pub(crate) mod stage;
pub(crate) mod starts;
mod summary;
mod trainer;

use std::{
    env,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
};

use anyhow::{Context, Result};
use bowwave_core::time::Time;
use bowwave_devices::clock::now;
use signal_hook::{
    consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1},
    iterator::Signals as Incoming,
};

use crate::{cli::Run, outcome::Outcome};
use notify::Notifier;
use pulse::Pulse;
use settings::Reader;
use starts::Starts;
pub(crate) use trainer::Signals;
use trainer::{Ended, Surroundings, Trainer};

/// Where data go when nobody says: the folder that the package makes.
pub const DATA: &str = "/var/lib/bowwave";

/// Runs until a signal ends it.
pub fn run(arguments: &Run, program_start: Time) -> Result<Outcome> {
    let signals = catch_signals()?;
    let starts = Arc::new(Starts::begin(env::var_os("RUNTIME_DIRECTORY").map(PathBuf::from), now()));
    let pulse = Pulse::start(Arc::clone(&signals), Arc::clone(&starts))?;
    let mut pulsing = pulse.during_start();
    let mut lcd_size = None;
    let mut notifier = Notifier::from_environment();
    // The folder of the last good settings cannot be configured by settings that may be bad.
    let state = env::var_os("STATE_DIRECTORY").map(PathBuf::from);
    let last_good = arguments.data.clone().or(state.clone()).map(|d| d.join("last-good"));
    let reader = Reader { config: arguments.config.clone(), last_good };
    loop {
        let settings = reader.read()?;
        let data = arguments
            .data
            .clone()
            .or_else(|| settings.config.data.clone())
            .or_else(|| state.clone())
            .unwrap_or_else(|| Path::new(DATA).into());
        if let Err(e) = std::fs::create_dir_all(&data) {
            // Hits are kept in memory then, and the LCD says so.
            log::error!("cannot make the data folder {}: {e}; name another in files.data", data.display());
        }
        let surroundings = Surroundings {
            data: data.clone(),
            mode: starts.mode(),
            // The service hides /proc/sys; systemd tells it.
            boot_id: env::var("BOWWAVE_BOOT_ID").ok().or_else(bowwave_record::boot_id),
            frame_hashes: arguments.frame_hashes.clone(),
            print_commits: arguments.print_commits,
            program_start,
            lcd_size,
        };
        let trainer = Trainer::start(settings, surroundings, Arc::clone(&signals))?;
        drop(pulsing);
        let (ended, summary) = trainer.run(&mut notifier, &pulse)?;
        pulsing = pulse.during();
        if let Err(e) = summary.write(&data.join("summary.json")) {
            log::warn!("{e:#}");
        }
        match ended {
            Ended::Stopped => {
                starts.ended_well();
                return Ok(Outcome::Done);
            }
            Ended::Reload { lcd } => {
                lcd_size = lcd;
                notifier.reloading();
            }
        }
    }
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
