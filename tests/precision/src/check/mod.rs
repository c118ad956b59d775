//! `calibrate check` on many recordings with one thing wrong, and on as many with none.

mod made;

use std::collections::BTreeMap;

use anyhow::Result;
use bowwave_calibration::{
    alignment::{Deviation, Judgement, Parameter},
    report::{CalibrationReport, CalibrationVerdict},
    simulated::Random,
};
use bowwave_core::{calibration::Calibration, geometry::Distortion};
use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;

use crate::{parts::rms, table::TextTable};
pub use made::{MadeRecording, Pattern};

/// Recordings with one number of the calibration wrong by 1 to 100 standard deviations, and as many with a sound calibration, judged by what the command
/// judges by.
#[derive(Debug, clap::Args)]
pub struct CheckStudy {
    /// Recordings with one thing wrong, and as many with none
    #[arg(long, visible_alias = "seeds", default_value_t = 200)]
    runs: u64,
    /// First seed
    #[arg(long, default_value_t = 1)]
    first: u64,
    /// Tell of each recording that was judged wrongly
    #[arg(long)]
    each: bool,
}

/// A recording with its calibration, and what was said of it.
#[derive(Clone, Debug)]
pub struct CheckedRecording {
    /// Seed of the recording.
    pub seed: u64,
    /// What it shows.
    pub pattern: Pattern,
    /// What is wrong, and by how many standard deviations.
    pub wrong: Option<(Parameter, f64)>,
    /// The true error of that number (recording minus calibration), in its unit.
    pub off: f64,
    /// Its effect, radians.
    pub effect: f64,
    /// The same, pixels.
    pub pixels: f64,
    /// What the command would tell.
    pub report: CalibrationReport,
}

/// Adds `much` of a parameter's unit to what a calibration says of it. (Of the gyro's scale the truth is changed, as no calibration holds it.)
fn add(c: &mut Calibration, scale: &mut DVec3, parameter: Parameter, much: f64) {
    let turn = |axis: DVec3, q: DQuat| (DQuat::from_scaled_axis(axis * much) * q).normalize();
    match parameter {
        Parameter::Elevation => c.camera_from_imu = turn(DVec3::X, c.camera_from_imu),
        Parameter::Traverse => c.camera_from_imu = turn(DVec3::Y, c.camera_from_imu),
        Parameter::Roll => c.camera_from_imu = turn(DVec3::Z, c.camera_from_imu),
        Parameter::Offset => c.time_offset_ns += (much * 1e9) as i64,
        Parameter::Bias(axis) => c.gyro_bias[axis] += much,
        Parameter::Readout => c.readout_ns += (much * 1e9) as i64,
        Parameter::Scale(axis) => scale[axis] *= 1.0 + much,
        Parameter::Focal => c.lens.focal *= 1.0 + much,
        Parameter::CentreRight => c.lens.centre.x += much * c.lens.focal.x,
        Parameter::CentreDown => c.lens.centre.y += much * c.lens.focal.y,
        Parameter::Distortion => {
            if let Distortion::RadialTangential(d) = c.lens.distortion {
                let radial = d.radial() + DVec2::new(much, 0.0);
                c.lens.distortion = Distortion::radial_tangential(radial, d.tangential());
            }
        }
    }
}

/// Standard deviation of a parameter as the file states it; of what no file states, what its makers do.
fn stated(parameter: Parameter, c: &Calibration) -> f64 {
    let focal = c.focal_sigma_px / c.lens.focal.x;
    match parameter {
        Parameter::Elevation | Parameter::Traverse | Parameter::Roll => c.camera_from_imu_sigma.x,
        Parameter::Offset => c.time_offset_sigma_ns as f64 * 1e-9,
        Parameter::Bias(_) => c.gyro_bias_sigma.x,
        Parameter::Readout => 0.3e-3,
        Parameter::Scale(_) => 1e-3,
        Parameter::Focal | Parameter::CentreRight | Parameter::CentreDown => focal,
        // As many pixels at the picture's edge as the focal length.
        Parameter::Distortion => focal / (640.0 / c.lens.focal.x).powi(2),
    }
}

/// Makes a recording and checks it with a calibration that is right within its own deviations but for one number, if any.
pub fn checked(seed: u64, is_wrong: bool) -> CheckedRecording {
    let mut random = Random::new(seed ^ 0xc4ec_0003);
    let mut recording = MadeRecording::draw(seed);
    let truth = recording.truth.clone();
    let mut c = truth.clone();
    let has_readout = truth.readout_ns != 0;
    let mut scale = DVec3::ONE;
    for parameter in Parameter::ALL {
        // A camera that exposes all rows at once does so without an error.
        if parameter != Parameter::Readout || has_readout {
            add(&mut c, &mut scale, parameter, stated(parameter, &truth) * random.gauss());
        }
    }
    let wrong = is_wrong.then(|| {
        let parameter =
            Parameter::ALL[(random.unit() * Parameter::ALL.len() as f64) as usize % Parameter::ALL.len()];
        let sigmas = 100f64.powf(random.unit()) * if random.unit() < 0.5 { -1.0 } else { 1.0 };
        (parameter, sigmas)
    });
    let mut off = 0.0;
    if let Some((parameter, sigmas)) = wrong {
        off = sigmas * stated(parameter, &truth);
        add(&mut c, &mut scale, parameter, off);
    }
    recording.scale = scale;
    let effect = wrong.map_or(0.0, |(p, _)| (off * p.effect(&truth)).abs());
    let mut capture = recording.play(c.lens);
    if c.readout_ns != 0 {
        capture = capture.with_readout(c.readout_ns as f64 * 1e-9);
    }
    let found = capture.compare(&c);
    let report = CalibrationReport::of_check("", &capture, &c, &found);
    let pixels = effect * truth.lens.focal.x;
    CheckedRecording { seed, pattern: recording.pattern, wrong, off, effect, pixels, report }
}

/// What became of a recording with one thing wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fate {
    /// It is named first.
    Named,
    /// It is named as one of two or more that the recording does not tell apart, or behind another.
    NamedBeside,
    /// Something else is named.
    OtherName,
    /// The recording is said not to tell it.
    NotTold,
    /// It is off by less than the line says it can tell.
    BelowTold,
    /// It is said to agree.
    Missed,
}

impl Fate {
    const ALL: [(Self, &'static str); 6] = [
        (Self::Named, "named"),
        (Self::NamedBeside, "beside"),
        (Self::OtherName, "other"),
        (Self::NotTold, "not told"),
        (Self::BelowTold, "below"),
        (Self::Missed, "MISSED"),
    ];
}

impl CheckedRecording {
    fn wrong_ones(&self) -> impl Iterator<Item = &Deviation> {
        self.report.deviations.iter().filter(|d| d.judgement == Judgement::Wrong)
    }

    /// Whether it is beyond a pixel or a milliradian.
    fn counts(&self) -> bool {
        self.pixels > 1.0 || self.effect > 1e-3
    }

    fn fate(&self) -> Option<Fate> {
        let (parameter, _) = self.wrong?;
        let mut named = self.wrong_ones();
        let first = named.next();
        Some(match first {
            Some(d) if d.parameter == parameter && d.or.is_empty() => Fate::Named,
            Some(d) if d.parameter == parameter || d.or.contains(&parameter) => Fate::NamedBeside,
            Some(_) if named.any(|d| d.parameter == parameter || d.or.contains(&parameter)) => {
                Fate::NamedBeside
            }
            Some(_) => Fate::OtherName,
            None => {
                let own = self.report.deviations.iter().find(|d| d.parameter == parameter);
                match own {
                    Some(d) if d.judgement == Judgement::Agrees && self.effect < d.unseen_below() => {
                        Fate::BelowTold
                    }
                    Some(d) if d.judgement == Judgement::Agrees => Fate::Missed,
                    _ if self.report.verdict == CalibrationVerdict::Stale => Fate::OtherName,
                    _ => Fate::NotTold,
                }
            }
        })
    }
}

impl CheckStudy {
    /// Prints the tables.
    pub fn run(&self) -> Result<()> {
        let of = |is_wrong: bool| -> Vec<CheckedRecording> {
            (self.first..self.first + self.runs).into_par_iter().map(|seed| checked(seed, is_wrong)).collect()
        };
        let (wrong, right) = (of(true), of(false));
        print!("{}", Self::found(&wrong));
        print!("{}", Self::honest(&right));
        if self.each {
            self.tell(&wrong, &right);
        }
        Ok(())
    }

    /// What became of the wrong ones, by parameter, by size and by pattern.
    fn found(all: &[CheckedRecording]) -> String {
        let columns = Fate::ALL.iter().map(|f| f.1).chain(["all"]).map(|t| (t.to_owned(), 9));
        let title = format!("{} with one thing wrong; beyond 1 px or 1 mrad", all.len());
        let mut table = TextTable::new(1, [(title, 48)].into_iter().chain(columns));
        let name = |parameter: Parameter| match parameter {
            Parameter::Bias(_) => "gyro bias".to_owned(),
            Parameter::Scale(_) => "gyro scale".to_owned(),
            other => other.to_string(),
        };
        let mut groups: BTreeMap<(u8, String), Vec<Fate>> = BTreeMap::new();
        for one in all.iter().filter(|one| one.counts()) {
            let (Some((parameter, sigmas)), Some(fate)) = (one.wrong, one.fate()) else { continue };
            let size = match sigmas.abs() {
                s if s < 3.0 => "1 to 3 sigma",
                s if s < 10.0 => "3 to 10 sigma",
                s if s < 30.0 => "10 to 30 sigma",
                _ => "30 to 100 sigma",
            };
            for key in [
                (0, "all".to_owned()),
                (1, name(parameter)),
                (2, size.to_owned()),
                (3, format!("{:?}", one.pattern)),
            ] {
                groups.entry(key).or_default().push(fate);
            }
        }
        for ((_, group), fates) in &groups {
            let count = |fate: Fate| fates.iter().filter(|f| **f == fate).count();
            let cells = Fate::ALL.iter().map(|f| count(f.0).to_string());
            table.row([format!("    {group}")].into_iter().chain(cells).chain([fates.len().to_string()]));
        }
        let fates: Vec<Fate> = groups.get(&(0, "all".to_owned())).cloned().unwrap_or_default();
        let count = |wanted: &[Fate]| fates.iter().filter(|f| wanted.contains(f)).count();
        let named = count(&[Fate::Named, Fate::NamedBeside]);
        let told = fates.len() - count(&[Fate::NotTold, Fate::BelowTold]);
        let share = |of: usize, all: usize| 100.0 * of as f64 / all.max(1) as f64;
        let good =
            all.iter().filter(|one| one.counts() && one.report.verdict == CalibrationVerdict::Good).count();
        table.row([format!(
            "    of those that the recording tells: {named} of {told} found with their name ({:.1} %), alone and first {} ({:.1} %); said to be GOOD {good}",
            share(named, told),
            count(&[Fate::Named]),
            share(count(&[Fate::Named]), told)
        )]);
        table.row([format!("    of all: {:.1} %", share(named, fates.len()))]);
        table.take()
    }

    /// Of the right ones: false alarms, verdicts, and whether deviations hold.
    fn honest(all: &[CheckedRecording]) -> String {
        let alarms: Vec<u64> = all
            .iter()
            .filter(|one| one.report.verdict == CalibrationVerdict::Stale)
            .map(|one| one.seed)
            .collect();
        let columns = ["rms", "beyond 2", "beyond 3", "told"].map(|t| (t.to_owned(), 9));
        let title = format!("{} right: error by deviation", all.len());
        let mut table = TextTable::new(1, [(title, 48)].into_iter().chain(columns));
        let mut groups: BTreeMap<(u8, String), Vec<f64>> = BTreeMap::new();
        for one in all {
            for d in one.report.deviations.iter().filter(|d| d.judgement != Judgement::NotTold) {
                for key in
                    [(0, "all".to_owned()), (1, d.parameter.to_string()), (2, format!("{:?}", one.pattern))]
                {
                    groups.entry(key).or_default().push(d.normalised());
                }
            }
        }
        for ((_, group), values) in &groups {
            let beyond = |limit: f64| {
                100.0 * values.iter().filter(|v| v.abs() > limit).count() as f64 / values.len() as f64
            };
            table.row([
                format!("    {group}"),
                format!("{:.2}", rms(values.iter().copied())),
                format!("{:.1} %", beyond(2.0)),
                format!("{:.1} %", beyond(3.0)),
                values.len().to_string(),
            ]);
        }
        let verdict = |wanted| all.iter().filter(|one| one.report.verdict == wanted).count();
        table.row([format!(
            "    false alarms {} of {} ({:.1} %), seeds {alarms:?}; GOOD {}, CANNOT TELL {}",
            alarms.len(),
            all.len(),
            100.0 * alarms.len() as f64 / all.len().max(1) as f64,
            verdict(CalibrationVerdict::Good),
            verdict(CalibrationVerdict::CannotTell)
        )]);
        table.take()
    }

    fn tell(&self, wrong: &[CheckedRecording], right: &[CheckedRecording]) {
        let odd = |one: &&CheckedRecording| {
            one.counts() && matches!(one.fate(), Some(Fate::OtherName | Fate::Missed | Fate::NamedBeside))
        };
        for one in wrong.iter().filter(odd) {
            let (parameter, sigmas) = one.wrong.unwrap_or((Parameter::Offset, 0.0));
            println!(
                "\nseed {} {:?}: {parameter} off by {sigmas:.1} sigma, {:.1} px: {:?}\n{}",
                one.seed,
                one.pattern,
                one.pixels,
                one.fate(),
                one.report
            );
        }
        for one in right.iter().filter(|one| one.report.verdict == CalibrationVerdict::Stale) {
            println!("\nseed {} {:?}: nothing is wrong\n{}", one.seed, one.pattern, one.report);
        }
    }
}
