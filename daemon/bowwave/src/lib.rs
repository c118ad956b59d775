//! The trainer's program: command line, configuration, main loops. A library only so that tests can reach what reads files.

mod cache;
mod cli;
pub mod config;
mod doctor;
mod drawing;
mod hits;
mod import;
mod outcome;
mod plan;
mod simulate;
mod stats;

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
    env_logger::Builder::from_env(
        env_logger::Env::default().default_filter_or(format!("{level},mp4parse=error")),
    )
    .format_target(false)
    .init();
    match run(&cli.command, program_start) {
        Ok(outcome) => outcome.into(),
        Err(e) => {
            eprintln!("bowwave: {e:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: &Command, program_start: bowwave_core::time::Time) -> Result<Outcome> {
    match command {
        Command::Simulate(arguments) => simulate::run(arguments, program_start),
        Command::Import(arguments) => import::run(arguments),
        Command::Plan(arguments) => plan::run(arguments).map(|()| Outcome::Done),
        Command::Doctor(arguments) => {
            doctor::run(arguments).map(|well| if well { Outcome::Done } else { Outcome::Failed })
        }
        Command::Hits(arguments) => hits::run(arguments).map(|()| Outcome::Done),
    }
}
