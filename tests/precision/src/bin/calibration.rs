//! Calibration from simulated recordings: percentiles of the errors, and how often the stated uncertainty holds.

use std::{collections::BTreeMap, process::ExitCode};

use bowwave_calibration::alignment::Alignment;
use clap::Parser;
use precision::{
    alignment::{Run, SERIES, percentile, series},
    parts::rms,
};

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

/// What is told of one quantity.
struct Quantity {
    name: &'static str,
    error: fn(&Run) -> f64,
    stated: fn(&Alignment) -> f64,
    /// Place among the answers of [`Run::within`].
    within: usize,
}

const QUANTITIES: [Quantity; 3] = [
    Quantity {
        name: "rotation, mrad",
        error: Run::mrad,
        stated: |a| a.rotation_sigma().length() * 1e3,
        within: 0,
    },
    Quantity { name: "offset, ms", error: Run::ms, stated: |a| a.offset_sigma_s * 1e3, within: 1 },
    Quantity {
        name: "bias, deg/s",
        error: Run::bias_deg_per_s,
        stated: |a| a.gyro_bias_sigma.length().to_degrees(),
        within: 2,
    },
];

fn told(name: &str, runs: &[Run]) -> String {
    let solved = runs.iter().filter(|r| r.found.is_ok()).count();
    let mut out = format!("{name}: {solved} of {} solved\n", runs.len());
    for q in QUANTITIES.iter().filter(|_| solved > 0) {
        let at = |share| percentile(runs.iter().map(q.error), share);
        let rms = rms(runs.iter().map(q.error).filter(|e| !e.is_nan()));
        let inside = runs.iter().filter_map(Run::within).filter(|w| w[q.within]).count();
        out += &format!(
            "    {:16} {rms:9.4} {:9.4} {:9.4} {:9.4} {:9.4} {:9.1} %\n",
            q.name,
            at(0.5),
            at(0.95),
            at(0.99),
            percentile(runs.iter().filter_map(|r| r.found.as_ref().ok()).map(q.stated), 0.5),
            100.0 * inside as f64 / solved as f64
        );
    }
    let mut apart: BTreeMap<String, usize> = BTreeMap::new();
    for run in runs {
        let reason = match &run.found {
            // What differs from run to run comes after the first colon.
            Err(e) => format!("refused: {}", e.to_string().split(':').next().unwrap_or_default()),
            Ok(a) if !a.findings().is_empty() => format!("graded {} for what was found", a.grade),
            Ok(_) => continue,
        };
        *apart.entry(reason).or_default() += 1;
    }
    for (reason, count) in apart {
        out += &format!("    {count} {reason}\n");
    }
    out
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    println!(
        "errors of a quantity: rms, median, 95 %, 99 %; median of the stated sigma (of all three axes together); share within 3 sigma"
    );
    for (name, motion, degrees, jitter_s) in SERIES {
        if name.contains(&arguments.only) {
            print!("{}", told(name, &series(motion, degrees, jitter_s, arguments.first, arguments.runs)));
        }
    }
    ExitCode::SUCCESS
}
