//! From spectral lines to height, period, direction and their errors.

use std::f64::consts::{PI, TAU};

use super::{MeasuredValue, SeaEstimate, Unknown, analysis::AnalysisResult, shell::ShellLine};
use crate::{
    physics::GRAVITY_M_S2,
    sea::{BeaufortForce, WmoSeaState},
    time::Time,
};

/// Waves must explain this share of the power of a line for it to count.
const LEAST_SHARE: f64 = 0.25;
/// Lines that must count.
const LEAST_LINES: usize = 3;
/// Density of the error of the pose's pitch, rad^2/Hz: a milliradian within a tenth of a hertz. It moves the whole picture over
/// its own fall of brightness, which looks like a very long wave.
const POSE_DENSITY: f64 = 1.5e-5;
/// Significant height below which a sea without a pattern is called flat, metres.
const FLAT_M: f64 = 0.1;

/// Height, period and direction from what was found.
pub(super) fn summarise(found: &AnalysisResult, eye_m: f64, time: Time) -> Result<SeaEstimate, Unknown> {
    /// Mean of the fourth power's frequency over that of the peak, for spectra between Pierson-Moskowitz (1.04) and JONSWAP (1.01).
    const FOURTH_OVER_PEAK: f64 = 1.02;
    /// Waves above this share of the eye's height are not measured: the plane z = 0 is no longer near the water.
    const HIGHEST_SHARE: f64 = 0.5;
    if found.lines.iter().filter(|l| counts(l)).count() < LEAST_LINES {
        return flat(found, time);
    }
    let density = |l: &ShellLine| {
        if counts(l) { (l.slope - found.noise - POSE_DENSITY).max(0.0) / l.unit.max(1e-12) } else { 0.0 }
    };
    let moments = moments(&found.lines, density);
    if !(moments.variance > 0.0 && moments.peak_hz > 0.0) {
        return flat(found, time);
    }
    // The window smears slope, which falls less steeply than height: to second order in its width.
    let smear = found.window_hz2 / moments.peak_hz.powi(2);
    let peak_hz = moments.peak_hz * (1.0 + 4.0 * smear) / FOURTH_OVER_PEAK;
    let height_m = 4.0 * (moments.variance / (1.0 + 10.0 * smear)).sqrt();
    if height_m > HIGHEST_SHARE * eye_m {
        return Err(Unknown::TooLow { height_m, eye_m });
    }
    Ok(judged(found, &moments, (height_m, 1.0 / peak_hz), eye_m, time))
}

/// Whether a line shows waves.
fn counts(line: &ShellLine) -> bool {
    /// A line must rise this far above what the pose can feign.
    const ABOVE_POSE: f64 = 6.0;
    line.share > LEAST_SHARE && line.slope > ABOVE_POSE * POSE_DENSITY
}

/// Sums over the spectrum of height.
struct Moments {
    variance: f64,
    /// By the fourth power of the density (Young 1995, Ocean Eng. 22, 669).
    peak_hz: f64,
    /// Effective number of lines under the peak.
    width_hz: f64,
    /// Sum of directions about the peak by energy; its length is 1 where all agree.
    towards: glam::DVec2,
    share: f64,
    /// Mean response against that of waves along the view.
    leverage: f64,
}

fn moments(lines: &[ShellLine], density: impl Fn(&ShellLine) -> f64) -> Moments {
    let step = |i: usize| {
        let low = if i > 0 { lines[i - 1].hz } else { lines[i].hz };
        let high = lines.get(i + 1).map_or(lines[i].hz, |l| l.hz);
        0.5 * (high - low)
    };
    let (mut variance, mut squares, mut fourth, mut fourth_hz) = (0.0, 0.0, 0.0, 0.0);
    for (i, line) in lines.iter().enumerate() {
        let e = density(line);
        variance += e * step(i);
        squares += e * e * step(i);
        fourth += e.powi(4) * step(i);
        fourth_hz += e.powi(4) * step(i) * line.hz;
    }
    let peak_hz = fourth_hz / f64::max(fourth, 1e-300);
    // Beyond the highest line the spectrum falls as f^-5.
    if let Some(last) = lines.iter().rev().find(|l| counts(l)) {
        variance += density(last) * last.hz / 4.0;
    }
    let (mut towards, mut energy, mut share, mut leverage) = (glam::DVec2::ZERO, 0.0, 0.0, 0.0);
    for (i, line) in lines.iter().enumerate().filter(|(_, l)| (0.65..1.8).contains(&(l.hz / peak_hz))) {
        let e = density(line) * step(i);
        towards += glam::DVec2::new(line.towards.sin(), line.towards.cos()) * e;
        energy += e;
        share += e * line.share;
        leverage += e * line.unit / line.unit_best.max(1e-30);
    }
    let energy = f64::max(energy, 1e-300);
    Moments {
        variance,
        peak_hz,
        width_hz: variance * variance / f64::max(squares, 1e-300),
        towards: towards / energy,
        share: share / energy,
        leverage: leverage / energy,
    }
}

/// Puts errors to the values.
fn judged(
    found: &AnalysisResult,
    m: &Moments,
    (height_m, period_s): (f64, f64),
    eye_m: f64,
    time: Time,
) -> SeaEstimate {
    /// Least relative error of the calibration of brightness to slope, one sigma: what the spread of its fits does not show.
    const GAIN_SIGMA: f64 = 0.1;
    // Independent samples of the energy: the band's width times the record's length, and some over the water's area.
    let freedom = (2.0 * m.width_hz * found.seconds).max(2.0);
    let low_eye = height_m / eye_m;
    let height_share = (1.0 / freedom
        + GAIN_SIGMA.powi(2)
        + found.gain_sigma.powi(2)
        + low_eye.powi(2)
        + (0.05 / m.leverage.max(0.02)).powi(2))
    .sqrt();
    let period_share =
        (0.03_f64.powi(2) + (0.4 * period_s / found.seconds).powi(2) + (0.5 * low_eye).powi(2)).sqrt();
    let together = m.towards.length().clamp(1e-6, 1.0);
    let spread = (-2.0 * together.ln()).sqrt();
    let direction_sigma = (0.07_f64.powi(2)
        + spread * spread / freedom
        + (1.5 * low_eye).powi(2)
        + (0.1 / m.leverage.max(0.05)).powi(2))
    .sqrt();
    let height = MeasuredValue { value: height_m, sigma: height_m * height_share };
    let period = MeasuredValue { value: period_s, sigma: period_s * period_share };
    let state = WmoSeaState::of_wave_height(height_m);
    let wind = wind(height, period);
    SeaEstimate {
        time,
        seconds: found.seconds,
        significant_height_m: height,
        peak_period_s: period,
        direction_from_rad: MeasuredValue {
            value: (m.towards.x.atan2(m.towards.y) + PI).rem_euclid(TAU),
            sigma: direction_sigma.min(PI),
        },
        state,
        state_probability: probability(height, state),
        wind_m_s: wind,
        force: BeaufortForce::of_wind(wind.value),
        rough_slope: found.rough,
        wave_share: m.share,
    }
}

/// No waves found: a flat sea where short waves of [`FLAT_M`] would have shown, else no answer.
fn flat(found: &AnalysisResult, time: Time) -> Result<SeaEstimate, Unknown> {
    /// Lowest frequency of the waves that a flat sea could hide, Hz: longer ones are swell from elsewhere.
    const FLAT_FROM_HZ: f64 = 0.25;
    let mut hidden = 0.0;
    for pair in found.lines.windows(2).filter(|p| p[0].hz > FLAT_FROM_HZ) {
        // A wave that explained this share of the power would have counted.
        hidden += LEAST_SHARE * pair[0].slope / pair[0].unit_best.max(1e-12) * (pair[1].hz - pair[0].hz);
    }
    let limit_m = 4.0 * hidden.sqrt();
    if !(found.lines.len() >= LEAST_LINES && limit_m < FLAT_M) {
        return Err(Unknown::NoPattern { limit_m });
    }
    let height = MeasuredValue { value: 0.0, sigma: 0.5 * limit_m };
    Ok(SeaEstimate {
        time,
        seconds: found.seconds,
        significant_height_m: height,
        peak_period_s: MeasuredValue { value: 1.0 / FLAT_FROM_HZ, sigma: 1.0 / FLAT_FROM_HZ },
        direction_from_rad: MeasuredValue { value: 0.0, sigma: PI },
        state: WmoSeaState::of_wave_height(0.0),
        state_probability: 0.5,
        wind_m_s: MeasuredValue { value: 0.0, sigma: 1.5 },
        force: BeaufortForce::of_wind(0.0),
        rough_slope: found.rough,
        wave_share: 0.0,
    })
}

/// Probability that a normal variable lies in a state.
fn probability(height: MeasuredValue, state: WmoSeaState) -> f64 {
    let (low, high) = state.wave_height_range_m();
    let below =
        |x: f64| if x.is_finite() { logistic((x - height.value) / height.sigma.max(1e-9)) } else { 1.0 };
    (below(high) - below(low)).clamp(0.0, 1.0)
}

/// Normal distribution by the logistic that differs from it by less than 0.01 (Bowling et al. 2009).
fn logistic(z: f64) -> f64 {
    1.0 / (1.0 + (-1.702 * z).exp())
}

/// Wind of a growing sea: H = 0.062 sqrt(g u*) T^1.5 with T = peak period / 1.05 (Toba 1972), and the drag of Wu 1982; m/s.
pub(super) fn wind_m_s(height_m: f64, period_s: f64) -> f64 {
    let root = height_m / (0.062 * GRAVITY_M_S2.sqrt() * (period_s / 1.05).powf(1.5)).max(1e-9);
    let friction = root * root;
    let mut wind = 28.0 * friction;
    for _ in 0..20 {
        wind = friction / ((0.8 + 0.065 * wind) * 1e-3).sqrt();
    }
    wind.clamp(0.0, 60.0)
}

fn wind(height: MeasuredValue, period: MeasuredValue) -> MeasuredValue {
    let wind = wind_m_s(height.value, period.value);
    let (h, t) = (height.sigma / height.value.max(1e-9), period.sigma / period.value.max(1e-9));
    MeasuredValue { value: wind, sigma: wind * ((1.6 * h).powi(2) + (2.4 * t).powi(2) + 0.0625).sqrt() + 0.5 }
}
