//! Writes the report of error against run time: `precision.csv` and one HTML page.

use std::{path::PathBuf, process::ExitCode};

use anyhow::{Context, Result, bail};
use clap::Parser;
use precision::{
    bench::{Bench, Effort},
    front, page,
    parts::{About, PARTS, Part},
    row,
};

/// Measures the numerical parts against truths that share no code with them.
#[derive(Debug, Parser)]
struct Arguments {
    /// Only these parts
    part: Vec<String>,
    /// Fewer turns
    #[arg(long)]
    quick: bool,
    /// Folder for precision.csv and index.html
    #[arg(long, value_name = "DIR", default_value = "target/precision")]
    out: PathBuf,
}

fn chosen(names: &[String]) -> Result<Vec<&'static Part>> {
    if let Some(unknown) = names.iter().find(|n| !PARTS.iter().any(|p| p.about.part == **n)) {
        let known: Vec<&str> = PARTS.iter().map(|p| p.about.part).collect();
        bail!("no part '{unknown}'; there are: {}", known.join(", "));
    }
    Ok(PARTS.iter().filter(|p| names.is_empty() || names.iter().any(|n| n == p.about.part)).collect())
}

fn run(arguments: &Arguments) -> Result<()> {
    let parts = chosen(&arguments.part)?;
    let mut bench = Bench::new(if arguments.quick { Effort::QUICK } else { Effort::FULL });
    for part in &parts {
        eprintln!("precision: {}", part.about.part);
        bench.begin(part.about.part);
        (part.measure)(&mut bench).with_context(|| format!("part {}", part.about.part))?;
    }
    let rows = bench.finish();
    std::fs::create_dir_all(&arguments.out)
        .with_context(|| format!("cannot make the folder {}", arguments.out.display()))?;
    row::write_csv(&arguments.out.join("precision.csv"), &rows)?;
    let abouts: Vec<About> = parts.iter().map(|p| p.about).collect();
    page::write(&arguments.out.join("index.html"), &abouts, &rows)?;
    println!("{} rows: {}", rows.len(), arguments.out.join("index.html").display());
    let complaints = front::complaints(&rows);
    if !complaints.is_empty() {
        bail!("{} complaints:\n{}", complaints.len(), complaints.join("\n"));
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
