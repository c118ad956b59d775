//! Calibration from simulated recordings: percentiles of the errors, and how often the stated uncertainty holds.

use std::{collections::BTreeMap, process::ExitCode};

use clap::Parser;
use precision::alignment::{Run, SERIES, percentile, series};

/// Solves simulated recordings and compares errors with what is stated of them.
#[derive(Debug, Parser)]
struct Arguments {
    /// Recordings of each motion and noise
    #[arg(long, default_value_t = 100)]
    runs: u64,
    /// First seed
    #[arg(long, default_value_t = 1000)]
    first: u64,
    /// Only series whose name has this in it
    #[arg(long, default_value = "")]
    only: String,
}

fn line(name: &str, runs: &[Run]) -> String {
    let solved = runs.iter().filter(|r| r.found.is_ok()).count();
    let mut refused: BTreeMap<String, usize> = BTreeMap::new();
    for run in runs {
        if let Err(e) = &run.found {
            // What differs from run to run comes after the first colon.
            let reason = e.to_string().split(':').next().unwrap_or_default().to_owned();
            *refused.entry(reason).or_default() += 1;
        }
    }
    let mut out = format!("{name:38} {solved:5} solved");
    if solved > 0 {
        let at = |f: fn(&Run) -> f64, share| percentile(runs.iter().map(f), share);
        let within = |i: usize| {
            let inside = runs.iter().filter_map(Run::within).filter(|w| w[i]).count();
            100.0 * inside as f64 / solved as f64
        };
        let stated = |f: fn(&Run) -> f64| percentile(runs.iter().map(f), 0.5);
        out += &format!(
            " | mrad {:7.3} {:7.3} {:7.3} (stated {:7.3}) | ms {:7.4} {:7.4} {:7.4} (stated {:7.4}) | in 3 sigma {:5.1} {:5.1} {:5.1} %",
            at(Run::mrad, 0.5),
            at(Run::mrad, 0.95),
            at(Run::mrad, 0.99),
            stated(|r| r.found.as_ref().map_or(f64::NAN, |a| a.rotation_sigma().length() * 1e3)),
            at(Run::ms, 0.5),
            at(Run::ms, 0.95),
            at(Run::ms, 0.99),
            stated(|r| r.found.as_ref().map_or(f64::NAN, |a| a.offset_sigma_s * 1e3)),
            within(0),
            within(1),
            within(2)
        );
    }
    for (reason, count) in refused {
        out += &format!("\n    {count} refused: {reason}");
    }
    out
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    println!(
        "errors: median, 95th and 99th percentile; stated: median of one sigma; shares: rotation, offset, bias"
    );
    for (name, motion, degrees, jitter_s) in SERIES {
        if name.contains(&arguments.only) {
            println!("{}", line(name, &series(motion, degrees, jitter_s, arguments.first, arguments.runs)));
        }
    }
    ExitCode::SUCCESS
}
