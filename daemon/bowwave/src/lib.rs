//! The trainer's program: command line, configuration, main loops. A library so that the laboratory's program ends, logs and answers
//! alike, and so that tests can reach what reads files.

mod cache;
mod calibrate;
mod cli;
pub mod config;
mod doctor;
mod hits;
mod laboratory;
pub mod loading;
pub mod outcome;
mod plan;
pub mod program;
mod replay;
mod run;
mod simulate;
pub mod stdout;
pub mod today;

use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;

use cli::{Cli, Command};
use outcome::Outcome;

/// Parses the command line, runs its command, and gives the exit code.
pub fn main() -> ExitCode {
    let program_start = bowwave_devices::clock::now();
    let cli = Cli::parse();
    program::start_log(cli.verbose);
    program::exit_code(dispatch(&cli, program_start))
}

fn dispatch(Cli { command, verbose }: &Cli, program_start: bowwave_core::time::Time) -> Result<Outcome> {
    match command {
        Command::Run(arguments) => run::run(arguments, program_start),
        Command::Replay(arguments) => replay::run(arguments),
        Command::Simulate(arguments) => simulate::run(arguments, program_start),
        Command::Import(lab) => laboratory::run("import", *verbose, &lab.arguments),
        Command::Compose(lab) => laboratory::run("compose", *verbose, &lab.arguments),
        Command::Study(lab) => laboratory::run("study", *verbose, &lab.arguments),
        Command::Plan(arguments) => plan::run(arguments).map(|()| Outcome::Done),
        Command::Doctor(arguments) => {
            doctor::run(arguments).map(|well| if well { Outcome::Done } else { Outcome::Failed })
        }
        Command::Hits(arguments) => hits::run(arguments).map(|()| Outcome::Done),
        Command::Calibrate(arguments) => calibrate::run(arguments.task.as_ref()),
    }
}
