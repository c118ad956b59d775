//! Renders the truth that reflections are held against.

use std::{path::PathBuf, process::ExitCode};

use anyhow::{Context, Result};
use clap::{Args, Parser, Subcommand};
use precision::truth::{files, grid};

/// A ray-traced sea with a boat on it.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Renders one cell
    Cell(Cell),
    /// Renders all cells of the grid that the folder does not yet hold
    Grid {
        /// Only 8 m eye height, two lights, one heading
        #[arg(long)]
        quick: bool,
        /// Folder of the cells
        #[arg(long, value_name = "DIR", default_value = "target/truth")]
        out: PathBuf,
    },
}

#[derive(Debug, Args)]
struct Cell {
    /// Distance to the boat, metres
    #[arg(long, default_value_t = 60.0)]
    range: f64,
    /// Beaufort force
    #[arg(long, default_value_t = 2)]
    state: u8,
    /// Height of the eye, metres
    #[arg(long, default_value_t = 8.0)]
    eye: f64,
    /// Name of the light
    #[arg(long, default_value = "overcast")]
    light: String,
    /// Heading of the bow, degrees clockwise from the direction of view
    #[arg(long, default_value_t = 80.0)]
    heading: f64,
    /// Time of the waves, seconds
    #[arg(long, default_value_t = 0.0)]
    time: f64,
    /// Paths a pixel
    #[arg(long)]
    samples: Option<u32>,
    /// Boat: box8, one of the trainer's, or a glTF file
    #[arg(long)]
    boat: Option<String>,
    /// Folder to put the cell's own folder into
    #[arg(long, value_name = "DIR", default_value = "target/truth")]
    out: PathBuf,
}

fn one(a: &Cell) -> Result<()> {
    let mut spec = grid::cell(a.range, a.state, a.eye, &a.light, a.heading)
        .with_context(|| format!("no sea state {} or light '{}'", a.state, a.light))?;
    spec.time_s = a.time;
    spec.samples = a.samples.unwrap_or(spec.samples);
    spec.boat = a.boat.clone().unwrap_or(spec.boat);
    let folder = a.out.join(grid::name(&spec));
    files::make(&spec, &folder)?;
    println!("{}", folder.display());
    Ok(())
}

fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.what {
        What::Cell(cell) => one(cell),
        What::Grid { quick, out } => grid::make(&grid::cells(*quick), out),
    }
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("truth: {e:#}");
            ExitCode::FAILURE
        }
    }
}
