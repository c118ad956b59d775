//! The laboratory: what a gun does not need.
//!
//! Recordings made from pictures and videos (`import`), boats composed into photographs ([`still`], [`compose`]), and the user study
//! of reflections (`study`). `bowwave compose`, `bowwave study` and `bowwave import` hand their arguments to this crate's program,
//! `bowwave-lab`, which the gun's package leaves out.

#![forbid(unsafe_code)]

mod cli;
pub mod compose;
mod import;
mod offscreen;
mod photo;
pub mod still;
mod study;

use std::process::ExitCode;

use anyhow::Result;
use bowwave::{outcome::Outcome, program};
use clap::Parser;

use cli::{LabCli, LabCommand};

pub use offscreen::{Drawn, OffscreenRenderer};
pub use photo::Photo;

/// Parses the command line, runs its command, and gives the exit code.
pub fn main() -> ExitCode {
    let cli = LabCli::parse();
    program::start_log(cli.verbose);
    program::exit_code(dispatch(&cli.command))
}

fn dispatch(command: &LabCommand) -> Result<Outcome> {
    match command {
        LabCommand::Import(arguments) => import::run(arguments),
        LabCommand::Compose(arguments) => compose::run(arguments),
        LabCommand::Study(arguments) => study::run(arguments),
    }
}
