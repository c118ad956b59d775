//! What a calibration came to, in units that maintainers know: printed on the terminal or shown as a page ([`crate::page`]).

mod lens;

use std::fmt;

use bowwave_core::calibration::Calibration;
use glam::{DMat3, DVec2, DVec3};

use crate::{
    CalibrationFile, Date, Provenance,
    alignment::{Alignment, AlignmentError, Comparison, Grade, LeftOut, Movement, NoiseFound, Residual},
    boresight::{Boresight, BoresightError},
    capture::{Capture, Counts},
    statistics::quantile,
    trigger::{Latency, TriggerError},
};

/// Range at which errors are said in metres.
pub const RANGE_M: f64 = 500.0;
/// Chi-squared with four degrees of freedom that one in a thousand sound recordings exceeds.
const SURPRISE_MAX: f64 = 18.47;
/// Residuals of which the median is larger fit nothing, radians.
const LEFT_MOST: f64 = 0.01;
/// A calibration older than this is said to be, days.
const OLD_DAYS: i64 = 183;
/// What the camera's axes mean to who turns a gun.
pub(crate) const AXES: [&str; 3] = ["elevation", "traverse", "roll"];

/// What it comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// A new calibration is good enough to train with.
    Pass,
    /// It is not, or there is none.
    Fail,
    /// An old calibration still holds.
    Good,
    /// It does not any more.
    Stale,
    /// The recording does not tell.
    CannotTell,
}

impl Verdict {
    /// Whether nothing need be done.
    pub const fn is_well(self) -> bool {
        matches!(self, Self::Pass | Self::Good)
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pass => "PASS",
            Self::Fail => "FAIL",
            Self::Good => "GOOD",
            Self::Stale => "STALE",
            Self::CannotTell => "CANNOT TELL",
        })
    }
}

/// A residual with its place in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Seconds after the first.
    pub seconds: f64,
    /// What is left.
    pub residual: Residual,
    /// Where it was seen, pixels.
    pub pixel: DVec2,
}

/// The result of one calibration or check.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// What was done to what.
    pub title: String,
    /// What it comes to.
    pub verdict: Verdict,
    /// That in a sentence.
    pub says: String,
    /// Quantities and their values.
    pub rows: Vec<(String, String)>,
    /// What to look into, and what to do.
    pub notes: Vec<String>,
    /// Covariance of the rotation, camera's axes, rad^2.
    pub covariance: Option<DMat3>,
    /// What is left of each observation, in order of time.
    pub residuals: Vec<Placed>,
    /// Size and focal length of the picture, pixels.
    pub picture: (DVec2, DVec2),
}

impl fmt::Display for Sheet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {}", self.verdict, self.says)?;
        let width = self.rows.iter().map(|(what, _)| what.chars().count()).max().unwrap_or(0);
        for (what, value) in &self.rows {
            writeln!(f, "  {what:width$}  {value}")?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "* {note}"))
    }
}

/// An angle in milliradians and what it is in metres at [`RANGE_M`].
pub fn at_range(radians: f64) -> String {
    format!("{:.2} mrad ({:.2} m at {RANGE_M:.0} m)", radians * 1e3, radians * RANGE_M)
}

fn ms(seconds: f64, sigma: f64) -> String {
    format!("{:.2} +- {:.2} ms", seconds * 1e3, sigma * 1e3)
}

fn deg_per_s(rate: DVec3) -> String {
    let [x, y, z] = rate.to_array().map(f64::to_degrees);
    format!("{x:.4}, {y:.4}, {z:.4} deg/s")
}

impl Sheet {
    fn bare(title: &str, verdict: Verdict, says: String) -> Self {
        Self {
            title: title.to_owned(),
            verdict,
            says,
            rows: Vec::new(),
            notes: Vec::new(),
            covariance: None,
            residuals: Vec::new(),
            picture: (DVec2::ONE, DVec2::ONE),
        }
    }

    fn new(title: &str, verdict: Verdict, says: String, capture: &Capture) -> Self {
        let lens = capture.lens();
        let picture = (DVec2::new(lens.width.into(), lens.height.into()), lens.focal);
        Self { rows: seen(capture), picture, ..Self::bare(title, verdict, says) }
    }

    /// Of a trigger's latency that was found, or why there is none.
    pub fn of_trigger(title: &str, found: &Result<Latency, TriggerError>) -> Self {
        let found = match found {
            Ok(found) => found,
            Err(why) => return Self::bare(title, Verdict::Fail, why.to_string()),
        };
        let says = format!("rounds leave {} after the line's edge", ms(found.latency_s, found.sigma_s));
        let mut sheet = Self::bare(title, Verdict::Pass, says);
        let all: Vec<String> = found.jolts.iter().map(|(_, late)| format!("{:.1}", late * 1e3)).collect();
        sheet.row("jolts after, ms", all.join(", "));
        sheet.row("spread of one press", format!("{:.2} ms", found.spread_s * 1e3));
        sheet.row("presses without a jolt", found.without.to_string());
        sheet
    }

    /// Of a boresight that was found, or why there is none. `known` is the calibration before.
    pub fn of_boresight(title: &str, found: &Result<Boresight, BoresightError>, known: &Calibration) -> Self {
        let found = match found {
            Ok(found) => found,
            Err(why) => return Self::bare(title, Verdict::Fail, why.to_string()),
        };
        let sigma = found.sigma();
        let verdict = if sigma <= Grade::ROTATION[1] { Verdict::Pass } else { Verdict::Fail };
        let says =
            format!("where the barrel points is known within {} (one standard deviation)", at_range(sigma));
        let mut sheet = Self::bare(title, verdict, says);
        let degrees = |a: DVec2| format!("{:.3} right, {:.3} down, deg", a.x.to_degrees(), a.y.to_degrees());
        sheet.row("barrel off the optical axis", degrees(found.angles));
        sheet.row("before", degrees(known.boresight));
        sheet.row("scatter of one pull", at_range(found.scatter));
        let [right, down, ahead] = known.muzzle_in_camera.to_array();
        sheet.row("muzzle from the camera", format!("{right:.2} right, {down:.2} down, {ahead:.2} ahead, m"));
        let mrad = |r: &DVec2| format!("{:+.2} {:+.2}", r.x * 1e3, r.y * 1e3);
        let each: Vec<String> = found.residuals.iter().map(mrad).collect();
        sheet.row("pulls off the mean, mrad", each.join(", "));
        if verdict == Verdict::Fail {
            sheet.notes.push("hold the gun on the mark for each pull, and pull more often".to_owned());
        }
        sheet
    }

    /// Of an alignment that was found, or why there is none.
    pub fn of_alignment(title: &str, capture: &Capture, found: &Result<Alignment, AlignmentError>) -> Self {
        let a = match found {
            Ok(a) => a,
            Err(why) => return Self::refused(title, Verdict::Fail, why, capture),
        };
        let verdict = if a.grade >= Grade::Usable { Verdict::Pass } else { Verdict::Fail };
        let across = a.rotation_sigma().truncate().length();
        let says = format!(
            "{}; boats lie within {} (one standard deviation), in time within {:.2} ms",
            a.grade,
            at_range(across),
            a.offset_sigma_s * 1e3
        );
        let mut sheet = Self::new(title, verdict, says, capture);
        let [x, y, z] = (a.rotation_sigma() * 1e3).to_array();
        let q = a.camera_from_imu;
        sheet.row(
            "rotation camera from unit",
            format!("{:.6}, {:.6}, {:.6}, {:.6} (wxyz)", q.w, q.x, q.y, q.z),
        );
        sheet.row("uncertain by", format!("elevation {x:.2}, traverse {y:.2}, roll {z:.2} mrad"));
        sheet.row("time offset", ms(a.offset_s, a.offset_sigma_s));
        sheet.row("gyro bias", deg_per_s(a.gyro_bias));
        sheet.row("uncertain by", deg_per_s(a.gyro_bias_sigma));
        if let Some((readout, sigma)) = a.readout_s {
            sheet.row("read-out of the picture", ms(readout, sigma));
        }
        sheet.row("evenness of the movement", format!("{:.2} (1: all axes alike)", a.information_ratio));
        sheet.residual_rows(&a.noise, &a.residuals, &a.left_out);
        sheet.notes.extend(a.findings().iter().map(ToString::to_string));
        sheet.notes.extend(Wanting::of(a, capture.shared_sigma()).map(|w| w.to_string()));
        sheet.covariance = Some(a.rotation_covariance);
        sheet.place(capture, &a.residuals);
        sheet
    }

    /// Of a calibration held against a recording. `known` is the calibration that was held.
    pub fn of_check(
        title: &str,
        capture: &Capture,
        known: &Calibration,
        found: &Result<Comparison, AlignmentError>,
    ) -> Self {
        let c = match found {
            Ok(c) => c,
            Err(why @ AlignmentError::Mirrored { .. }) => {
                return Self::refused(title, Verdict::Stale, why, capture);
            }
            Err(why) => return Self::refused(title, Verdict::CannotTell, why, capture),
        };
        let told = c.turn_sigma();
        let offset_sigma = (known.time_offset_sigma_ns as f64 * 1e-9).hypot(c.offset_sigma_s);
        let is_told = |axis: usize| told[axis] <= Grade::ROTATION[1];
        let offset_told = c.offset_sigma_s <= Grade::OFFSET_S[1];
        let moved = (0..3).any(|axis| is_told(axis) && c.turn[axis].abs() > Grade::ROTATION[0])
            || offset_told && c.offset_s.abs() > Grade::OFFSET_S[0];
        let blind: Vec<&str> = (0..3).filter(|axis| !is_told(*axis)).map(|axis| AXES[axis]).collect();
        let left = quantile(c.residuals.iter().map(|r| r.turn.length()), 0.5);
        let (verdict, says) = if c.surprise > SURPRISE_MAX && moved {
            let seen = DVec3::from_array([0, 1, 2].map(|i| if is_told(i) { c.turn[i] } else { 0.0 }));
            let says = format!(
                "boats lie off by {} and {:.2} ms; calibrate again",
                at_range(seen.truncate().length()),
                c.offset_s.abs() * 1e3
            );
            (Verdict::Stale, says)
        } else if left > LEFT_MOST {
            let says = format!(
                "what is seen is {} off where it is expected, and no rotation or time offset that the recording tells explains it; look \
                 for mirrored axes of the unit and for a loose mount",
                at_range(left)
            );
            (Verdict::Stale, says)
        } else if !blind.is_empty() || !offset_told {
            let mut what: Vec<&str> = blind;
            what.extend((!offset_told).then_some("time offset"));
            let says = format!(
                "the recording does not tell {}; what it tells agrees. Record with more {}",
                what.join(", "),
                c.missing
            );
            (Verdict::CannotTell, says)
        } else {
            let says = format!(
                "rotation and time offset are what they were, as far as {} and {:.2} ms can be told",
                at_range(told.truncate().length()),
                c.offset_sigma_s * 1e3
            );
            (Verdict::Good, says)
        };
        let mut sheet = Self::new(title, verdict, says, capture);
        for axis in 0..3 {
            let sigma = known.camera_from_imu_sigma[axis].hypot(told[axis]);
            let value = if is_told(axis) {
                format!("{:+.2} +- {:.2} mrad", c.turn[axis] * 1e3, sigma * 1e3)
            } else {
                format!("not told (uncertain by {:.0} mrad)", told[axis] * 1e3)
            };
            sheet.row(&format!("{} off by", AXES[axis]), value);
        }
        let offset = if offset_told {
            format!("{:+.2} +- {:.2} ms", c.offset_s * 1e3, offset_sigma * 1e3)
        } else {
            format!("not told (uncertain by {:.0} ms)", c.offset_sigma_s * 1e3)
        };
        sheet.row("time offset off by", offset);
        sheet.row("gyro bias off by", deg_per_s(c.gyro_bias));
        sheet.row("surprise", format!("{:.1} (above {SURPRISE_MAX} one in a thousand)", c.surprise));
        sheet.residual_rows(&c.noise, &c.residuals, &c.left_out);
        sheet.covariance = Some(c.turn_covariance);
        sheet.place(capture, &c.residuals);
        sheet
    }

    fn refused(title: &str, verdict: Verdict, why: &AlignmentError, capture: &Capture) -> Self {
        let mut sheet = Self::new(title, verdict, why.to_string(), capture);
        let counts = capture.counts();
        if let AlignmentError::NotObservable { missing, .. } = why {
            sheet.notes.push(format!("the movement that was missing: {missing}"));
        }
        if counts.pictures > 0 && counts.horizons + counts.boards == 0 {
            sheet.notes.push(
                "no picture has a horizon that is sharp, straight and clear of land: look at open sea, or at a board"
                    .to_owned(),
            );
        }
        sheet
    }

    fn row(&mut self, what: &str, value: String) {
        self.rows.push((what.to_owned(), value));
    }

    /// Warns where what was measured is old. `today` is the day on which it is judged.
    pub fn warn_of_age(&mut self, file: &CalibrationFile, today: Date) {
        let parts: [(&str, &Provenance); 4] = [
            ("the lens", &file.lens),
            ("the rotation", &file.camera_from_imu),
            ("the time offset", &file.time_offset),
            ("the boresight", &file.boresight),
        ];
        let days = |p: &Provenance| today.days_since(p.measured);
        let mut warn = |is_odd: &dyn Fn(i64) -> bool, says: &str| {
            let odd = parts.iter().filter(|(_, p)| is_odd(days(p)));
            let odd: Vec<String> = odd.map(|(what, p)| format!("{what} on {}", p.measured)).collect();
            if !odd.is_empty() {
                self.notes.push(format!("{says}: {}", odd.join(", ")));
            }
        };
        warn(&|days| days > OLD_DAYS, "measured long ago, to be measured again when there is time");
        warn(&|days| days < 0, "measured on a day yet to come (is the clock set?)");
    }

    /// Warns where camera or unit of the recording are not those of the calibration.
    pub fn warn_of_others(&mut self, file: &CalibrationFile, recorded: &CalibrationFile) {
        for (what, ours, theirs) in [
            ("camera", &file.camera_serial, &recorded.camera_serial),
            ("inertial unit", &file.imu_serial, &recorded.imu_serial),
        ] {
            if !ours.is_empty() && !theirs.is_empty() && ours != theirs {
                self.notes
                    .push(format!("the calibration is of the {what} {ours}, the recording of {theirs}"));
            }
        }
    }

    fn residual_rows(&mut self, noise: &NoiseFound, residuals: &[Residual], left: &LeftOut) {
        let at = |share: f64| quantile(residuals.iter().map(|r| r.turn.length()), share);
        self.row("left over, median, p95", format!("{:.2}, {:.2} mrad", at(0.5) * 1e3, at(0.95) * 1e3));
        self.row("jitter of the camera's stamps", format!("{:.2} ms", noise.jitter_s * 1e3));
        self.row("gyro's random walk", format!("{:.3} deg/sqrt(h)", noise.gyro_walk.to_degrees() * 60.0));
        self.row(
            "left out",
            format!(
                "{} no numbers, {} out of order, {} clipped, {} without gyro",
                left.not_finite, left.out_of_order, left.clipped, left.without_gyro
            ),
        );
    }

    fn place(&mut self, capture: &Capture, residuals: &[Residual]) {
        let Some(first) = residuals.first().map(|r| r.stamp) else { return };
        let middle = self.picture.0 / 2.0;
        let mut sightings: Vec<_> = capture.sightings().iter().collect();
        sightings.sort_by_key(|s| s.stamp);
        self.residuals = residuals
            .iter()
            .map(|r| Placed {
                seconds: r.stamp.secs_since(first),
                residual: *r,
                pixel: sightings
                    .binary_search_by_key(&r.stamp, |s| s.stamp)
                    .map_or(middle, |i| sightings[i].pixel),
            })
            .collect();
    }
}

/// What was recorded.
fn seen(capture: &Capture) -> Vec<(String, String)> {
    let Counts { readings, pictures, other_size, horizons, blurred, boards, restarts } = capture.counts();
    let mut what = format!("{horizons} of {pictures} pictures with a horizon");
    if blurred > 0 {
        what += &format!(", {blurred} blurred");
    }
    if boards > 0 {
        what += &format!(", {boards} with a board");
    }
    if other_size > 0 {
        what += &format!("; {other_size} of another size");
    }
    let mut rows = vec![
        ("recorded".to_owned(), format!("{:.1} s, {readings} readings", capture.seconds())),
        ("seen".to_owned(), what),
    ];
    if restarts > 0 {
        rows.push(("restarts of the unit".to_owned(), restarts.to_string()));
    }
    rows
}

/// What keeps an alignment from being good.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wanting {
    /// The time offset.
    Faster,
    /// Elevation, of which no horizon tells more than this, radians.
    Board(f64),
    /// The angle about that axis of the camera, which that movement tells better.
    Moving(usize, Movement),
}

impl Wanting {
    /// What it is; `shared` is the error that all horizons share, where nothing else was seen.
    pub(crate) fn of(a: &Alignment, shared: Option<f64>) -> Option<Self> {
        if a.grade == Grade::Good {
            return None;
        }
        let sigma = a.rotation_sigma();
        let worst = (0..3).max_by(|i, j| sigma[*i].total_cmp(&sigma[*j]))?;
        if sigma[worst] <= Grade::ROTATION[0] {
            return (a.offset_sigma_s > Grade::OFFSET_S[0]).then_some(Self::Faster);
        }
        Some(match shared {
            Some(limit) if worst == 0 && sigma.x < 1.2 * limit => Self::Board(limit),
            _ => Self::Moving(worst, a.missing),
        })
    }
}

impl fmt::Display for Wanting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Faster => f.write_str("faster movements to and fro tell the time offset better"),
            Self::Board(limit) => write!(
                f,
                "of elevation the horizon tells no more than {:.1} mrad (refraction, and where its edge is found); a board tells it better",
                limit * 1e3
            ),
            Self::Moving(axis, missing) => {
                let what = AXES.get(*axis).copied().unwrap_or("rotation");
                write!(f, "{what} is what is known least; more {missing} tells it better")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bowwave_core::geometry::Lens;

    use super::*;
    use crate::{
        alignment::{Known, Options, compare, solve},
        parse,
        simulated::{Motion, Recipe},
        so3::exp,
    };

    const NOISE: f64 = 2e-3;

    fn capture() -> Capture {
        Capture::new(Lens::pinhole(1280, 720, 1.0), 10.0)
    }

    fn calibration(recipe: &Recipe, turn: DVec3, late_s: f64) -> CalibrationFile {
        let mut file = parse(include_str!("../examples/mount.toml"), "mount.toml").unwrap();
        file.calibration.camera_from_imu = exp(turn) * recipe.camera_from_imu;
        file.calibration.time_offset_ns = bowwave_core::time::secs_to_ns(recipe.offset_s + late_s);
        file.calibration.gyro_bias = recipe.gyro_bias;
        file
    }

    fn checked(recipe: &Recipe, turn: DVec3, late_s: f64) -> Sheet {
        let recording = recipe.record();
        let c = calibration(recipe, turn, late_s).calibration;
        let known = Known {
            camera_from_imu: c.camera_from_imu,
            rotation_sigma: c.camera_from_imu_sigma,
            offset_s: c.time_offset_ns as f64 * 1e-9,
            offset_sigma_s: c.time_offset_sigma_ns as f64 * 1e-9,
            gyro_bias: c.gyro_bias,
        };
        let told = compare(&recording.readings, &recording.orientations, &known, &Options::default());
        Sheet::of_check("a check", &capture(), &c, &told)
    }

    #[test]
    fn a_new_alignment_passes_in_mrad_and_metres_or_says_what_is_missing() {
        let of = |motion| {
            let recording = Recipe::minute(motion, NOISE, 1e-3, 1).record();
            let found = solve(&recording.readings, &recording.orientations, &Options::default());
            (Sheet::of_alignment("an alignment", &capture(), &found), found)
        };
        let (good, found) = of(Motion::ByHand);
        assert_eq!(good.verdict, Verdict::Pass);
        let text = good.to_string();
        assert!(text.starts_with("PASS: good; boats lie within 0.") && text.contains("m at 500 m"), "{text}");
        let found = found.unwrap();
        assert_eq!(good.residuals.len(), found.residuals.len());
        // What is written into the file is what was found.
        let mut file = calibration(&Recipe::minute(Motion::ByHand, NOISE, 1e-3, 2), DVec3::X, 0.1);
        let (lens, day) = (file.lens.clone(), Date::new(2026, 11, 23).unwrap());
        file.set_alignment(&found, day, "by hand");
        assert_eq!((file.calibration.camera_from_imu, &file.lens), (found.camera_from_imu, &lens));
        assert_eq!((file.made, file.time_offset.measured), (day, day));
        assert_eq!(parse(&crate::to_toml(&file), "again").unwrap().gyro_bias.how, "by hand");
        let (poor, _) = of(Motion::SlowMount);
        assert_eq!(poor.verdict, Verdict::Fail);
        assert!(poor.to_string().contains("more "), "{poor}");
        let (refused, _) = of(Motion::TraverseOnly);
        assert_eq!(refused.verdict, Verdict::Fail);
        assert!(refused.to_string().contains("missing: elevation (up and down)"), "{refused}");
    }

    #[test]
    fn a_check_says_good_stale_or_that_it_cannot_tell() {
        for (seed, motion, turn, late_s, verdict) in [
            (1, Motion::ByHand, DVec3::ZERO, 0.0, Verdict::Good),
            (2, Motion::ByHand, DVec3::new(0.0, 8e-3, 0.0), 0.0, Verdict::Stale),
            (3, Motion::ByHand, DVec3::ZERO, 4e-3, Verdict::Stale),
            (4, Motion::TraverseOnly, DVec3::ZERO, 0.0, Verdict::CannotTell),
            (5, Motion::TraverseOnly, DVec3::Z * 0.03, 0.0, Verdict::Stale),
            (6, Motion::Rest, DVec3::Z * 0.03, 0.0, Verdict::CannotTell),
        ] {
            let sheet = checked(&Recipe::minute(motion, NOISE, 1e-3, seed), turn, late_s);
            assert_eq!(sheet.verdict, verdict, "{motion:?} {turn} {late_s}\n{sheet}");
        }
        // What is stale is said by how much.
        let sheet = checked(&Recipe::minute(Motion::ByHand, NOISE, 1e-3, 7), DVec3::new(0.0, 8e-3, 0.0), 0.0);
        assert!(sheet.says.contains("mrad (4.") || sheet.says.contains("mrad (3."), "{sheet}");
    }

    #[test]
    fn age_and_other_devices_are_warned_of() {
        let recipe = Recipe::minute(Motion::ByHand, NOISE, 1e-3, 1);
        let file = calibration(&recipe, DVec3::ZERO, 0.0);
        let mut sheet = checked(&recipe, DVec3::ZERO, 0.0);
        sheet.warn_of_age(&file, Date::new(2026, 11, 25).unwrap());
        sheet.warn_of_others(&file, &file);
        assert!(sheet.notes.is_empty(), "{sheet}");
        sheet.warn_of_age(&file, Date::new(2027, 6, 1).unwrap());
        assert!(sheet.notes.len() == 1 && sheet.notes[0].contains("long ago"), "{sheet}");
        assert_eq!(sheet.notes[0].matches(" on 2026-11-").count(), 4, "{sheet}");
        sheet.notes.clear();
        sheet.warn_of_age(&file, Date::new(2026, 11, 19).unwrap());
        assert!(sheet.notes.len() == 1 && sheet.notes[0].contains("yet to come"), "{sheet}");
        assert!(!sheet.notes[0].contains("the lens"), "{sheet}");
        sheet.notes.clear();
        let mut other = file.clone();
        other.camera_serial = "C-9999".to_owned();
        other.imu_serial.clear();
        sheet.warn_of_others(&file, &other);
        assert_eq!(sheet.notes.len(), 1);
        assert!(sheet.notes[0].contains("C-0117") && sheet.notes[0].contains("C-9999"), "{sheet}");
    }
}
