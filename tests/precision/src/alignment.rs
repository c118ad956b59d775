//! Many simulated recordings solved, errors held against what the solver says of them.

use std::collections::BTreeMap;

use anyhow::Result;
use bowwave_calibration::{
    alignment::{Alignment, AlignmentError, Options, solve},
    simulated::{Motion, Recipe},
};
use glam::DVec3;
use rayon::prelude::*;

use crate::{check::CheckStudy, front::quantile, parts::rms, table::TextTable};

/// One simulated recording and what became of it.
#[derive(Clone, Debug)]
pub struct SolvedRecording {
    /// The truth.
    pub recipe: Recipe,
    /// The solution, or the reason that there is none.
    pub found: std::result::Result<Alignment, AlignmentError>,
}

impl SolvedRecording {
    /// Simulates and solves.
    pub fn of(recipe: Recipe) -> Self {
        let recording = recipe.record();
        Self { recipe, found: solve(&recording.readings, &recording.orientations, &Options::default()) }
    }

    /// Error of the rotation, a rotation vector in the camera's axes, radians.
    pub fn turn(&self) -> Option<DVec3> {
        let found = self.found.as_ref().ok()?;
        let q = self.recipe.camera_from_imu * found.camera_from_imu.inverse();
        let q = if q.w < 0.0 { -q } else { q };
        // Twice the vector part: exact to the third power of small angles.
        Some(DVec3::new(q.x, q.y, q.z) * 2.0)
    }

    /// Length of the rotation's error, milliradians; NaN where there is no result.
    pub fn mrad(&self) -> f64 {
        self.turn().map_or(f64::NAN, |t| t.length() * 1e3)
    }

    /// Error of the offset, milliseconds; NaN where there is no result.
    pub fn ms(&self) -> f64 {
        self.found.as_ref().map_or(f64::NAN, |a| (a.offset_s - self.recipe.offset_s).abs() * 1e3)
    }

    /// Length of the bias's error, degrees a second; NaN where there is no result.
    pub fn bias_deg_per_s(&self) -> f64 {
        let off = |a: &Alignment| (a.gyro_bias - self.recipe.gyro_bias).length().to_degrees();
        self.found.as_ref().map_or(f64::NAN, off)
    }

    /// Whether rotation, offset and bias lie within three stated standard deviations: the rotation by the ellipsoid that holds
    /// 99.73 % too, the bias about each axis.
    pub fn within(&self) -> Option<[bool; 3]> {
        // Chi-squared with three degrees of freedom.
        const THREE_SIGMA: f64 = 14.16;
        let (found, turn) = (self.found.as_ref().ok()?, self.turn()?);
        let bias = (found.gyro_bias - self.recipe.gyro_bias) / found.gyro_bias_sigma;
        Some([
            turn.dot(found.rotation_covariance.inverse() * turn) <= THREE_SIGMA,
            (found.offset_s - self.recipe.offset_s).abs() <= 3.0 * found.offset_sigma_s,
            bias.abs().max_element() <= 3.0,
        ])
    }
}

/// Motions and noises (degrees of orientation, seconds of stamp jitter) that the goals are stated for.
pub const SERIES: [(&str, Motion, f64, f64); 8] = [
    ("by hand, 0.02 deg", Motion::ByHand, 0.02, 0.0),
    ("by hand, 0.1 deg, 2 ms", Motion::ByHand, 0.1, 2e-3),
    ("traverse and elevation, 0.02 deg", Motion::TraverseAndElevation, 0.02, 0.0),
    ("traverse and elevation, 0.1 deg, 2 ms", Motion::TraverseAndElevation, 0.1, 2e-3),
    ("slow on the mount, 0.1 deg, 2 ms", Motion::SlowMount, 0.1, 2e-3),
    ("traverse at sea, 0.1 deg, 2 ms", Motion::AtSea, 0.1, 2e-3),
    ("traverse only, 0.1 deg, 2 ms", Motion::TraverseOnly, 0.1, 2e-3),
    ("at rest, 0.1 deg, 2 ms", Motion::Rest, 0.1, 2e-3),
];

/// Solves seeds `first..first + runs` of one of the series, on all processors.
pub fn series(motion: Motion, degrees: f64, jitter_s: f64, first: u64, runs: u64) -> Vec<SolvedRecording> {
    let recipe = |seed| Recipe::minute(motion, degrees.to_radians(), jitter_s, seed);
    (first..first + runs).into_par_iter().map(|seed| SolvedRecording::of(recipe(seed))).collect()
}

/// A value below which that share of all numbers lies; NaN of none.
pub fn percentile(values: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    let known: Vec<f64> = values.into_iter().filter(|v| !v.is_nan()).collect();
    quantile(&known, share)
}

/// Solves simulated recordings and compares errors with the stated uncertainty.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct CalibrationStudy {
    #[command(subcommand)]
    other: Option<OtherStudy>,
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

#[derive(Debug, clap::Subcommand)]
enum OtherStudy {
    /// Calibrations with one thing wrong, and sound ones, judged by `calibrate check`
    Check(CheckStudy),
}

impl CalibrationStudy {
    /// Prints the table of every series.
    pub fn run(&self) -> Result<()> {
        if let Some(OtherStudy::Check(study)) = &self.other {
            return study.run();
        }
        for (name, motion, degrees, jitter_s) in SERIES {
            if name.contains(&self.only) {
                print!("{}", summary(name, &series(motion, degrees, jitter_s, self.first, self.runs)));
            }
        }
        Ok(())
    }
}

/// A quantity of the table.
struct Quantity {
    name: &'static str,
    error: fn(&SolvedRecording) -> f64,
    stated: fn(&Alignment) -> f64,
    /// Place among the answers of [`SolvedRecording::within`].
    within: usize,
}

const QUANTITIES: [Quantity; 3] = [
    Quantity {
        name: "rotation, mrad",
        error: SolvedRecording::mrad,
        stated: |a| a.rotation_sigma().length() * 1e3,
        within: 0,
    },
    Quantity {
        name: "offset, ms",
        error: SolvedRecording::ms,
        stated: |a| a.offset_sigma_s * 1e3,
        within: 1,
    },
    Quantity {
        name: "bias, deg/s",
        error: SolvedRecording::bias_deg_per_s,
        stated: |a| a.gyro_bias_sigma.length().to_degrees(),
        within: 2,
    },
];

fn summary(name: &str, runs: &[SolvedRecording]) -> String {
    let solved = runs.iter().filter(|r| r.found.is_ok()).count();
    let mut table = TextTable::new(
        1,
        [(format!("{name}: {solved} of {} solved", runs.len()), 48)].into_iter().chain(
            // The stated sigma is that of all three axes together.
            ["rms", "median", "95 %", "99 %", "stated", "in 3 sigma"].map(|t| (t.to_owned(), 9)),
        ),
    );
    for q in QUANTITIES.iter().filter(|_| solved > 0) {
        let at = |share| percentile(runs.iter().map(q.error), share);
        let rms = rms(runs.iter().map(q.error).filter(|e| !e.is_nan()));
        let inside = runs.iter().filter_map(SolvedRecording::within).filter(|w| w[q.within]).count();
        let stated = percentile(runs.iter().filter_map(|r| r.found.as_ref().ok()).map(q.stated), 0.5);
        let errors = [rms, at(0.5), at(0.95), at(0.99), stated].map(|v| format!("{v:.4}"));
        let share = format!("{:.1} %", 100.0 * inside as f64 / solved as f64);
        table.row([format!("    {}", q.name)].into_iter().chain(errors).chain([share]));
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
        table.row([format!("    {count} {reason}")]);
    }
    table.take()
}
