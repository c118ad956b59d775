//! Error against run time of every numerical part: `precision.csv` and one HTML page.

mod page;
mod parts;
mod table;
mod timing;

use std::{path::PathBuf, process::ExitCode};

use anyhow::{Context, Result, bail};
use clap::Parser;

use page::About;
use table::Row;

/// Measures the numerical parts against truths that share no code with them.
#[derive(Debug, Parser)]
struct Arguments {
    /// Only these parts
    part: Vec<String>,
    /// Fewer repeats; fails when a default is beaten by more than the noise
    #[arg(long)]
    quick: bool,
    /// Folder for precision.csv and index.html
    #[arg(long, value_name = "DIR", default_value = "target/precision")]
    out: PathBuf,
}

/// One numerical part: what is said of it, and its rows for a number of timing repeats.
struct Part {
    about: About,
    rows: fn(usize) -> Vec<Row>,
}

const PARTS: &[Part] = &[
    Part { about: parts::flight::ABOUT, rows: parts::flight::rows },
    Part { about: parts::clock::ABOUT, rows: parts::clock::rows },
    Part { about: parts::attitude::ABOUT, rows: parts::attitude::rows },
    Part { about: parts::lens::ABOUT, rows: parts::lens::rows },
    Part { about: parts::pacing::ABOUT, rows: parts::pacing::rows },
];

fn run(arguments: &Arguments) -> Result<()> {
    if let Some(unknown) = arguments.part.iter().find(|n| !PARTS.iter().any(|p| p.about.part == **n)) {
        let names: Vec<&str> = PARTS.iter().map(|p| p.about.part).collect();
        bail!("no part '{unknown}'; there are: {}", names.join(", "));
    }
    let chosen: Vec<&Part> = PARTS
        .iter()
        .filter(|p| arguments.part.is_empty() || arguments.part.iter().any(|n| n == p.about.part))
        .collect();
    let repeats = if arguments.quick { 5 } else { 41 };
    let mut rows: Vec<Row> = chosen.iter().flat_map(|p| (p.rows)(repeats)).collect();
    table::mark_pareto(&mut rows);
    std::fs::create_dir_all(&arguments.out)
        .with_context(|| format!("cannot make the folder {}", arguments.out.display()))?;
    table::write_csv(&arguments.out.join("precision.csv"), &rows)?;
    let abouts: Vec<About> = chosen.iter().map(|p| p.about).collect();
    page::write(&arguments.out.join("index.html"), &abouts, &rows)?;
    println!("{} rows: {}", rows.len(), arguments.out.join("index.html").display());
    if let Some(bad) = rows.iter().find(|r| !r.error.is_finite()) {
        bail!("{}, {} ({}) on {}: the error is no number", bad.part, bad.method, bad.setting, bad.scene);
    }
    let beaten = table::beaten_defaults(&rows);
    if !beaten.is_empty() {
        bail!("defaults off the Pareto front:\n{}", beaten.join("\n"));
    }
    Ok(())
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("precision: {e:#}");
            ExitCode::FAILURE
        }
    }
}
