//! The horizon in real frames and drawn pictures: errors frame by frame, false ones, what a picture costs.

use std::{path::PathBuf, process::ExitCode};

use anyhow::Result;
use clap::Parser;
use precision::horizon::report;

/// Shows pictures to the horizon finder and lists what it makes of them.
#[derive(Debug, Parser)]
struct Arguments {
    /// Folder for the marked frames, and those taken wrongly, with what was found drawn over them
    #[arg(long, value_name = "DIR")]
    overlays: Option<PathBuf>,
    /// Drawn pictures with a horizon, and as many without
    #[arg(long, default_value_t = 400)]
    drawn: u64,
    /// Draw those pictures that served to set the finder's constants
    #[arg(long)]
    set: bool,
}

fn run(arguments: &Arguments) -> Result<()> {
    report::cost()?;
    report::marked(arguments.overlays.as_deref())?;
    report::jitter()?;
    report::without(arguments.overlays.as_deref())?;
    report::drawn(arguments.drawn, arguments.set)
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("horizon: {e:#}");
            ExitCode::FAILURE
        }
    }
}
