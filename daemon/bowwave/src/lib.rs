//! The trainer's program: command line, configuration, main loops. A library so that the laboratory's program ends, logs and answers
//! alike, and so that tests can reach what reads files.

#![forbid(unsafe_code)]

mod cache;
mod calibrate;
mod cli;
mod completions;
pub mod config;
mod desk;
mod doctor;
pub mod ending;
mod hits;
mod instructed;
mod instructor;
mod laboratory;
pub mod licences;
pub mod loading;
mod new_file;
pub mod outcome;
mod plan;
mod play;
pub mod program;
mod replay;
mod review;
mod run;
mod scenario;
mod score;
mod simulate;
pub mod stdout;
pub mod today;

use std::process::ExitCode;

use anyhow::Result;
use clap::{CommandFactory, Parser};

use cli::{CommandLine, ProgramCommand};
use outcome::Outcome;

/// Parses the command line, runs its command, and gives the exit code.
pub fn main() -> ExitCode {
    let program_start = bowwave_devices::clock::now();
    let cli = CommandLine::parse();
    program::start_log(cli.verbose);
    program::exit_code(dispatch(&cli, program_start))
}

/// The definition of the command line, for manual pages and completions.
pub fn command_line() -> clap::Command {
    CommandLine::command()
}

fn dispatch(
    CommandLine { command, verbose }: &CommandLine,
    program_start: bowwave_core::time::Time,
) -> Result<Outcome> {
    match command {
        ProgramCommand::Run(arguments) => run::run(arguments, program_start),
        ProgramCommand::Replay(arguments) => replay::run(arguments),
        ProgramCommand::Simulate(arguments) => simulate::run(arguments, program_start),
        ProgramCommand::Play(arguments) => play::run(arguments, program_start),
        ProgramCommand::Import(lab) => laboratory::run("import", *verbose, &lab.arguments),
        ProgramCommand::Compose(lab) => laboratory::run("compose", *verbose, &lab.arguments),
        ProgramCommand::Study(lab) => laboratory::run("study", *verbose, &lab.arguments),
        ProgramCommand::Scenario(arguments) => scenario::run(&arguments.command),
        ProgramCommand::Plan(arguments) => plan::run(arguments).map(|()| Outcome::Done),
        ProgramCommand::Doctor(arguments) => {
            doctor::run(arguments).map(|well| if well { Outcome::Done } else { Outcome::Failed })
        }
        ProgramCommand::Hits(arguments) => hits::run(arguments).map(|()| Outcome::Done),
        ProgramCommand::Score(arguments) => score::run(arguments).map(|()| Outcome::Done),
        ProgramCommand::Review(arguments) => review::run(arguments),
        ProgramCommand::Instructor(arguments) => instructor::run(arguments),
        ProgramCommand::Calibrate(arguments) => calibrate::run(arguments.task.as_ref()),
        ProgramCommand::Completions(arguments) => completions::run(arguments.shell),
        ProgramCommand::Licences => licences::run(),
    }
}
