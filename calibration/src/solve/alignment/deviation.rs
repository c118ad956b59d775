//! Each number of a calibration judged by what a recording tells of it.
//!
//! A calibration states each of its numbers with a standard deviation. That is as good as a measurement of it, and whether one of these
//! "measurements" is a blunder is an old question of geodesy: data snooping (Baarda 1968, "A testing procedure for use in geodetic
//! networks"). For each number its own statement is left out, the others keep theirs, and what the recording then tells of it is held against
//! what was stated, by the deviations of both. The number by which the misfit falls most is named, freed, and the rest is judged anew.
//! Where two numbers explain it nearly as well (Foerstner 1983, separability), both are named.
//!
//! Whitened residuals that still err alike count for fewer than they are: the variance of a sum of scores is that of Newey & West (1987,
//! eq. 5), never less than of independent ones.

use bowwave_core::calibration::Calibration;
use nalgebra::DMatrix;

use super::filter::{NormalMatrix, UnknownsStep, place};

/// A number of a calibration that a recording may tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Parameter {
    /// Turn of the unit's mounting about the picture's horizontal.
    Elevation,
    /// About the picture's vertical.
    Traverse,
    /// About the optical axis.
    Roll,
    /// Time offset.
    Offset,
    /// Gyro bias about that axis of the unit (0, 1, 2).
    Bias(usize),
    /// Read-out time of the picture.
    Readout,
    /// The gyro's scale about that axis, which no file holds: the trainer takes it for right.
    Scale(usize),
    /// Focal length.
    Focal,
    /// Principal point, right.
    CentreRight,
    /// Principal point, down.
    CentreDown,
    /// First coefficient of the lens's distortion.
    Distortion,
}

/// How fast a gun is swung, rad/s: 40 deg/s. Errors of time are judged by it.
const SWING: f64 = 0.7;
/// So long nothing but the gyro may tell how the camera turns, seconds.
const ALONE_S: f64 = 10.0;
/// The gyro's scale is judged by a turn of 90 degrees, radians.
const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

impl Parameter {
    /// All of them.
    pub const ALL: [Self; 15] = [
        Self::Elevation,
        Self::Traverse,
        Self::Roll,
        Self::Offset,
        Self::Bias(0),
        Self::Bias(1),
        Self::Bias(2),
        Self::Readout,
        Self::Scale(0),
        Self::Scale(1),
        Self::Scale(2),
        Self::Focal,
        Self::CentreRight,
        Self::CentreDown,
        Self::Distortion,
    ];

    fn place(self) -> usize {
        match self {
            Self::Elevation => place::ROTATION,
            Self::Traverse => place::ROTATION + 1,
            Self::Roll => place::ROTATION + 2,
            Self::Offset => place::OFFSET,
            Self::Bias(axis) => place::BIAS + axis,
            Self::Readout => place::READOUT,
            Self::Scale(axis) => place::SCALE + axis,
            Self::Focal => place::LENS,
            Self::CentreRight => place::LENS + 1,
            Self::CentreDown => place::LENS + 2,
            Self::Distortion => place::LENS + 3,
        }
    }

    /// What an error of one unit does, radians: at the middle of the picture or, where it does nothing there, at the left or right edge; of the
    /// time while the gun is swung, of the bias after ten seconds, of the scale after a quarter turn.
    pub fn effect(self, calibration: &Calibration) -> f64 {
        let lens = &calibration.lens;
        let edge = 0.5 * f64::from(lens.width) / lens.focal.x;
        match self {
            Self::Elevation | Self::Traverse | Self::CentreRight | Self::CentreDown => 1.0,
            Self::Roll | Self::Focal => edge,
            Self::Offset => SWING,
            Self::Readout => 0.5 * SWING,
            Self::Bias(_) => ALONE_S,
            Self::Scale(_) => QUARTER,
            Self::Distortion => edge.powi(3),
        }
    }

    /// An error beyond this is none of this number: no unit reads a fifth too little, no lens is twice as long as it was.
    fn most(self) -> f64 {
        match self {
            Self::Scale(_) => 0.2,
            Self::Focal => 0.5,
            Self::CentreRight | Self::CentreDown => 0.3,
            Self::Distortion => 1.0,
            Self::Readout => 0.1,
            Self::Elevation | Self::Traverse | Self::Roll | Self::Offset | Self::Bias(_) => f64::INFINITY,
        }
    }

    /// Standard deviation that the calibration states, in the parameter's unit: radians, seconds, rad/s, shares, focal lengths.
    fn stated(self, calibration: &Calibration) -> f64 {
        /// Of a camera whose file has no read-out, seconds.
        const GLOBAL_S: f64 = 0.3e-3;
        /// Data sheets of units of the class state a thousandth of scale error.
        const SCALE: f64 = 1e-3;
        let c = calibration;
        let focal = c.focal_sigma_px / c.lens.focal.x;
        match self {
            Self::Elevation => c.camera_from_imu_sigma.x,
            Self::Traverse => c.camera_from_imu_sigma.y,
            Self::Roll => c.camera_from_imu_sigma.z,
            Self::Offset => c.time_offset_sigma_ns as f64 * 1e-9,
            Self::Bias(axis) => c.gyro_bias_sigma.to_array().get(axis).copied().unwrap_or(f64::INFINITY),
            Self::Readout => (c.readout_sigma_ns as f64 * 1e-9).max(GLOBAL_S),
            Self::Scale(_) => SCALE,
            // One fit of the lens tells all of these: the others move the picture's edge by as much as the focal length does, or its middle.
            Self::Focal | Self::CentreRight | Self::CentreDown => focal,
            Self::Distortion => focal / (self.effect(c) / Self::Focal.effect(c)),
        }
    }
}

/// A parameter's verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// It is what was stated, or off by too little to be seen.
    Agrees,
    /// It is not.
    Wrong,
    /// The recording does not tell.
    NotTold,
}

/// What a recording tells of one number of a calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Deviation {
    /// The number.
    pub parameter: Parameter,
    /// What the recording tells less what was stated: radians, seconds, rad/s; a share of the focal length or of the rate; focal lengths for the
    /// principal point.
    pub off: f64,
    /// Standard deviation of what the recording tells.
    pub sigma: f64,
    /// Standard deviation that was stated.
    pub stated: f64,
    /// The effect of `off`, radians, see [`Parameter::effect`].
    pub effect: f64,
    /// So many standard deviations would be surprising.
    pub surprising: f64,
    /// Whether it is wrong.
    pub judgement: Judgement,
    /// What else would explain it nearly as well.
    pub or: Vec<Parameter>,
}

impl Deviation {
    /// The difference by the deviations of both sides: 1 is usual.
    pub fn normalised(&self) -> f64 {
        self.off / self.sigma.hypot(self.stated)
    }

    /// An effect below which a wrong number might not have been found (in 5 of 100 recordings), radians.
    pub fn unseen_below(&self) -> f64 {
        let by_unit = if self.off == 0.0 { 0.0 } else { self.effect / self.off.abs() };
        (self.surprising + POWER) * self.sigma.hypot(self.stated) * by_unit
    }
}

/// Standard deviations that a number must be off by, were these known: of a hundred recordings with a sound calibration one exceeds it in any
/// of the parameters (normal distribution, 0.01 / 15 on both sides together).
const SURPRISING: f64 = 3.40;
/// Errors are alike for so long at most, seconds, and for so large a share of the recording.
const ALIKE_S: f64 = 4.0;
const ALIKE_SHARE: f64 = 1.0 / 15.0;
/// A wrong number is found with 95 % where it is off by so many standard deviations more.
const POWER: f64 = 1.64;
/// What has less effect than this is never called wrong: half of a pixel or half of a milliradian, radians and pixels.
const SEEN_RAD: f64 = 0.5e-3;
const SEEN_PX: f64 = 0.5;
/// The recording tells a number if it would have found an error of this effect, radians: 5 m at 500 m. So large an error is wrong also where the file
/// states that it is to be expected.
const TOLD_MOST: f64 = 10e-3;
/// Parameters whose chi-squared is less by this are as likely (one degree of freedom, one in a hundred).
const ALIKE: f64 = 6.63;

/// What a recording tells of all parameters about a calibration: a quadratic form, and the scores that it is the sum of.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Evidence {
    /// Information: of the deviations from the calibration.
    pub information: NormalMatrix,
    /// Information times the most likely deviations.
    pub right: UnknownsStep,
    /// Parts of the gradient, in order of time.
    pub scores: Vec<UnknownsStep>,
    /// From the first to the last of them, seconds.
    pub seconds: f64,
    /// Parameters that are solved for.
    pub active: Vec<usize>,
    /// Standard deviation of the dip's error.
    pub dip_sigma: f64,
}

/// An estimate with its standard deviation.
#[derive(Clone, Copy, Debug)]
struct Estimate {
    off: f64,
    sigma: f64,
}

impl Evidence {
    /// Leaves out all that was told of a parameter.
    pub(super) fn forget(&mut self, parameter: usize) {
        self.information.fill_row(parameter, 0.0);
        self.information.fill_column(parameter, 0.0);
        self.right[parameter] = 0.0;
        self.scores.iter_mut().for_each(|s| s[parameter] = 0.0);
    }

    /// What is told of `wanted` where the parameters in `free` may be anything, and the others are known as `stated` says.
    fn estimate(&self, wanted: usize, stated: &UnknownsStep, free: &[usize]) -> Option<Estimate> {
        /// Nothing at all, so that the matrix can be inverted: a number as uncertain as that is told by nobody.
        const NOTHING: f64 = 1e-6;
        let n = self.active.len();
        let at = self.active.iter().position(|i| *i == wanted)?;
        // In units of what was stated.
        let unit = |i: usize| stated[self.active[i]];
        let known = |i: usize| {
            let is_free = self.active[i] == wanted || free.contains(&self.active[i]);
            if is_free || self.active[i] == place::UP || self.active[i] == place::UP + 1 {
                NOTHING
            } else {
                1.0
            }
        };
        let told = DMatrix::from_fn(n, n, |r, c| {
            self.information[(self.active[r], self.active[c])] * unit(r) * unit(c)
        });
        let mut all = told.clone();
        (0..n).for_each(|i| all[(i, i)] += known(i));
        let mut one = nalgebra::DVector::zeros(n);
        one[at] = 1.0;
        let row = all.cholesky()?.solve(&one);
        let off = (0..n).map(|i| row[i] * self.right[self.active[i]] * unit(i)).sum::<f64>();
        let by_told = row.dot(&(&told * &row)) * self.alike(&row, unit);
        let by_stated = (0..n).map(|i| row[i] * row[i] * known(i)).sum::<f64>();
        let sigma = (by_told + by_stated).max(0.0).sqrt();
        (off.is_finite() && sigma.is_finite())
            .then(|| Estimate { off: off * unit(at), sigma: sigma * unit(at) })
    }

    fn alike_s(&self) -> f64 {
        (self.seconds * ALIKE_SHARE).min(ALIKE_S)
    }

    /// Standard deviations that are surprising: these are estimated themselves, as if by the squares of 1.5 numbers for each time that errors may
    /// be alike (Priestley 1981, sec. 6.2, Bartlett's window), so that the limit is Student's (Cornish & Fisher's expansion).
    fn surprising(&self) -> f64 {
        let freedom = (1.5 * self.seconds / self.alike_s().max(1e-3)).max(4.0);
        let z = SURPRISING;
        z + (z.powi(3) + z) / (4.0 * freedom)
            + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * freedom * freedom)
    }

    /// By what factor the variance of a weighed sum of scores is larger because those that follow each other err alike.
    fn alike(&self, row: &nalgebra::DVector<f64>, unit: impl Fn(usize) -> f64) -> f64 {
        let one =
            |s: &UnknownsStep| (0..row.len()).map(|i| row[i] * unit(i) * s[self.active[i]]).sum::<f64>();
        let all: Vec<f64> = self.scores.iter().map(one).collect();
        let by_second = all.len() as f64 / self.seconds.max(1e-3);
        let lags = (self.alike_s() * by_second) as usize;
        let square: f64 = all.iter().map(|u| u * u).sum();
        let together = |lag: usize| all.iter().zip(all.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
        let weighed = |lag: usize| (1.0 - lag as f64 / (lags + 1) as f64) * together(lag);
        let sum = square + 2.0 * (1..=lags).map(weighed).sum::<f64>();
        // What the parameters took of the slowest errors is missing.
        let factor = sum / square.max(1e-300) / (1.0 - ALIKE_SHARE);
        if factor.is_finite() { factor.max(1.0) } else { 1.0 }
    }
}

/// Judges each number of `calibration`.
pub(super) fn judge(evidence: &Evidence, calibration: &Calibration) -> Vec<Deviation> {
    /// More wrong numbers than this are not told apart.
    const WRONG_MOST: usize = 4;
    let mut stated = UnknownsStep::repeat(1.0);
    for parameter in Parameter::ALL {
        stated[parameter.place()] = parameter.stated(calibration).max(1e-12);
    }
    stated[place::DIP] = evidence.dip_sigma.max(1e-9);
    let mut wrong: Vec<Parameter> = Vec::new();
    let mut alike: Vec<(Parameter, Vec<Parameter>)> = Vec::new();
    let mut all = deviations(evidence, calibration, &stated, &wrong);
    while wrong.len() < WRONG_MOST {
        let found = all.iter().filter(|d| d.judgement == Judgement::Wrong && !wrong.contains(&d.parameter));
        let square = |d: &Deviation| d.normalised().powi(2);
        let Some(worst) = found.clone().max_by(|a, b| square(a).total_cmp(&square(b))) else { break };
        let or = found.filter(|d| d.parameter != worst.parameter && square(d) > square(worst) - ALIKE);
        alike.push((worst.parameter, or.map(|d| d.parameter).collect()));
        wrong.push(worst.parameter);
        all = deviations(evidence, calibration, &stated, &wrong);
        // What was named first may be explained by what was named since.
        wrong.retain(|p| all.iter().any(|d| d.parameter == *p && d.judgement == Judgement::Wrong));
    }
    for deviation in &mut all {
        if deviation.judgement == Judgement::Wrong {
            let or = alike.iter().find(|(p, _)| *p == deviation.parameter).map(|(_, or)| or.clone());
            deviation.or = or.unwrap_or_default();
        }
    }
    all.sort_by(|a, b| b.is_wrong().cmp(&a.is_wrong()).then(a.parameter.cmp(&b.parameter)));
    all
}

impl Deviation {
    fn is_wrong(&self) -> bool {
        self.judgement == Judgement::Wrong
    }
}

fn deviations(
    evidence: &Evidence,
    calibration: &Calibration,
    stated: &UnknownsStep,
    wrong: &[Parameter],
) -> Vec<Deviation> {
    let free: Vec<usize> = wrong.iter().map(|p| p.place()).collect();
    let (pixel, surprising) = (1.0 / calibration.lens.focal.x, evidence.surprising());
    let one = |parameter: Parameter| {
        let told = evidence.estimate(parameter.place(), stated, &free);
        let Estimate { off, sigma } = told.unwrap_or(Estimate { off: 0.0, sigma: f64::INFINITY });
        let by_unit = parameter.effect(calibration);
        let mut deviation = Deviation {
            parameter,
            off,
            sigma,
            stated: stated[parameter.place()],
            effect: off.abs() * by_unit,
            surprising,
            judgement: Judgement::Agrees,
            or: Vec::new(),
        };
        let is_surprising = deviation.normalised().abs() > surprising;
        let is_too_much = off.abs() > surprising * sigma && deviation.effect > TOLD_MOST;
        if off.abs() > parameter.most() {
            deviation.judgement = Judgement::NotTold;
        } else if is_surprising && deviation.effect > SEEN_RAD.min(SEEN_PX * pixel) || is_too_much {
            deviation.judgement = Judgement::Wrong;
        } else if (surprising + POWER) * sigma * by_unit > TOLD_MOST {
            deviation.judgement = Judgement::NotTold;
        }
        deviation
    };
    Parameter::ALL.into_iter().map(one).collect()
}
