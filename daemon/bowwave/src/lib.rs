//! The trainer's program: command line, configuration, main loops. A library only so that tests can reach what reads files.

mod cache;
mod calibrate;
mod cli;
mod commits;
pub mod compose;
pub mod config;
mod doctor;
mod drawing;
mod headings;
mod hits;
mod import;
pub mod loading;
mod notes;
mod outcome;
mod output;
mod plan;
mod recorder;
mod resident;
mod run;
mod sea;
mod simulate;
mod stats;
mod stdout;
mod study;
mod unit_clock;

use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;

use cli::{Cli, Command};
use outcome::Outcome;

/// Parses the command line, does what it says, and gives the exit code.
pub fn main() -> ExitCode {
    let program_start = bowwave_devices::clock::now();
    let cli = Cli::parse();
    let level = match cli.verbose {
        0 => "warn",
        1 => "info",
        _ => "debug",
    };
    if log_to_journal(cli.verbose) {
        return exit_code(dispatch(&cli.command, program_start));
    }
    env_logger::Builder::from_env(
        env_logger::Env::default().default_filter_or(format!("{level},mp4parse=error")),
    )
    .format_target(false)
    .init();
    exit_code(dispatch(&cli.command, program_start))
}

fn exit_code(outcome: Result<Outcome>) -> ExitCode {
    match outcome {
        Ok(outcome) => outcome.into(),
        Err(e) => {
            eprintln!("bowwave: {e:#}");
            ExitCode::FAILURE
        }
    }
}

/// Where standard error leads to systemd's journal, lines go there with their fields (fault code, state, duration) instead.
fn log_to_journal(verbose: u8) -> bool {
    if !systemd_journal_logger::connected_to_journal() {
        return false;
    }
    let logger = systemd_journal_logger::JournalLog::new()
        .map(|log| log.with_syslog_identifier("bowwave".to_owned()))
        .and_then(|log| log.install().map_err(std::io::Error::other));
    // Ordinary running is told in full: the journal is what is left after a day at sea.
    log::set_max_level(if verbose > 0 { log::LevelFilter::Debug } else { log::LevelFilter::Info });
    logger.is_ok()
}

fn dispatch(command: &Command, program_start: bowwave_core::time::Time) -> Result<Outcome> {
    match command {
        Command::Run(arguments) => run::run(arguments, program_start),
        Command::Simulate(arguments) => simulate::run(arguments, program_start),
        Command::Import(arguments) => import::run(arguments),
        Command::Compose(arguments) => compose::run(arguments),
        Command::Study(arguments) => study::run(arguments),
        Command::Plan(arguments) => plan::run(arguments).map(|()| Outcome::Done),
        Command::Doctor(arguments) => {
            doctor::run(arguments).map(|well| if well { Outcome::Done } else { Outcome::Failed })
        }
        Command::Hits(arguments) => hits::run(arguments).map(|()| Outcome::Done),
        Command::Calibrate(arguments) => calibrate::run(arguments.task.as_ref()),
    }
}
