//! Real photographs: each method's reflection against the real one. `photograph [--data DIR] [--out DIR] [--quick]`.

use std::{path::PathBuf, process::ExitCode};

use anyhow::Result;
use bowwave_core::water::ReflectionMethod;
use clap::Parser;
use precision::photograph::{self, CONTROL, Row, mean_of, spec::Assumed};

/// Draws the reflections of photographed boats anew and holds them against the real ones.
#[derive(Debug, Parser)]
struct Arguments {
    /// Folder with davis_boat_1080p and wasr_stills
    #[arg(long, value_name = "DIR", default_value = "../shared/data/sea")]
    data: PathBuf,
    /// Folder for photographs.csv and the pictures side by side
    #[arg(long, value_name = "DIR", default_value = "target/precision/photographs")]
    out: PathBuf,
    /// One picture of each view, and no errors of the estimated cameras
    #[arg(long)]
    quick: bool,
}

fn run(arguments: &Arguments) -> Result<()> {
    if !arguments.data.is_dir() {
        println!("skipped: no folder {} with photographs; name one with --data", arguments.data.display());
        return Ok(());
    }
    let rows = photograph::run(&arguments.data, &arguments.out, arguments.quick)?;
    println!("{:<26} {:<16} {:>6} {:>9}", "picture", "method", "FLIP", "spectrum");
    for Row { picture, method, difference, .. } in
        rows.iter().filter(|r| r.setting == Assumed::ESTIMATE || r.method == CONTROL)
    {
        println!("{picture:<26} {method:<16} {:>6.3} {:>9.2}", difference.flip, difference.spectrum);
    }
    for method in ReflectionMethod::ALL {
        if let Some(mean) = mean_of(&rows, method.name()) {
            println!("{:<26} {:<16} {:>6.3} {:>9.2}", "mean", method.name(), mean.flip, mean.spectrum);
        }
    }
    println!("{}", arguments.out.join("photographs.csv").display());
    Ok(())
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("photograph: {e:#}");
            ExitCode::FAILURE
        }
    }
}
