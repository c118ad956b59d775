//! Waves of one frequency: direction, energy and what is none, from the phases over the patches.
//!
//! Over deep water a frequency has one wavelength (omega^2 = g k). Brightness of all patches at that frequency is compared with
//! what plane waves of that length would cause, one beam per direction; what fits none of them is noise.

use std::f64::consts::TAU;

use rustfft::num_complex::Complex32;

use super::grid::Cell;
use crate::gunnery::GRAVITY_M_S2;

/// Directions of beams.
pub(super) const BEAMS: usize = 24;
/// Directions tried as the mean one.
const MEANS: usize = 48;
/// Exponents tried of the spread cos^2s(angle / 2).
const SPREADS: [f64; 5] = [1.0, 3.0, 8.0, 20.0, 50.0];
/// A patch that averages a wave to less than this is not used for it.
const LEAST_RESPONSE: f64 = 0.35;
/// Weight of the total power against one beam, where waves and noise are told apart.
const TOTAL_WEIGHT: f64 = 6.0;

/// What was found at one frequency.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Line {
    /// Frequency, Hz.
    pub hz: f64,
    /// One-sided spectral density of the height, m^2/Hz.
    pub density: f64,
    /// Direction the waves run to, radians clockwise from north.
    pub towards: f64,
    /// Exponent of the spread.
    pub spread: f64,
    /// Share of the power that waves explain, 0 to 1.
    pub share: f64,
    /// Independent samples the density rests on, roughly.
    pub freedom: f64,
    /// Mean response of the patches to such waves against their steepness (0 when they run across the view).
    pub leverage: f64,
}

/// Spectra of all patches at one frequency, in slope: `values[taper][cell]`.
pub(super) struct Observed<'a> {
    pub hz: f64,
    pub cells: &'a [Cell],
    /// Weight of each patch: 0 leaves it out.
    pub weights: &'a [f32],
    /// Scaled so that the mean square is a one-sided density.
    pub values: &'a [Vec<Complex32>],
}

/// Fits waves and noise to one frequency.
pub(super) fn fit(observed: &Observed<'_>) -> Option<Line> {
    let k = (TAU * observed.hz).powi(2) / GRAVITY_M_S2;
    let used: Vec<usize> = (0..observed.cells.len())
        .filter(|&i| observed.weights[i] > 0.0 && response(&observed.cells[i], k) > LEAST_RESPONSE)
        .collect();
    if used.len() < 24 {
        return None;
    }
    let steering: Vec<Vec<Complex32>> = (0..BEAMS).map(|j| steer(observed, &used, k, j)).collect();
    let norms: Vec<f64> = steering.iter().map(|v| v.iter().map(|z| f64::from(z.norm_sqr())).sum()).collect();
    let tapers = observed.values.len() as f64;
    let mut powers = vec![0.0; BEAMS + 1];
    for values in observed.values {
        let y: Vec<Complex32> = used.iter().map(|&i| values[i] * observed.weights[i]).collect();
        for (j, v) in steering.iter().enumerate() {
            powers[j] += f64::from(dot(v, &y).norm_sqr()) / norms[j].max(1e-30) / tapers;
        }
        powers[BEAMS] += y.iter().map(|z| f64::from(z.norm_sqr())).sum::<f64>() / (used.len() as f64 * tapers);
    }
    // Rows: what a wave of direction j and density 1 gives in each beam, and in the mean power of a patch.
    let mut table = vec![vec![0.0; BEAMS]; BEAMS + 1];
    for j in 0..BEAMS {
        for i in 0..BEAMS {
            table[i][j] = f64::from(dot(&steering[i], &steering[j]).norm_sqr()) / norms[i].max(1e-30);
        }
        table[BEAMS][j] = norms[j] / used.len() as f64;
    }
    let (score, mean, spread, density, noise) = search(&table, &powers)?;
    if !score.is_finite() || !density.is_finite() {
        return None;
    }
    let shares = spread_shares(mean, spread);
    let explained: f64 = table[BEAMS].iter().zip(&shares).map(|(t, s)| t * s).sum::<f64>() * density;
    let even: f64 = norms.iter().fold(0.0, |a: f64, b| a.max(*b)) / used.len() as f64;
    Some(Line {
        hz: observed.hz,
        density,
        towards: mean,
        spread,
        share: explained / (explained + noise).max(1e-30),
        freedom: tapers,
        leverage: explained / (density * even).max(1e-30),
    })
}

fn response(cell: &Cell, k: f64) -> f64 {
    let sinc = |x: f64| if x.abs() < 1e-6 { 1.0 } else { x.sin() / x };
    sinc((k * cell.size.x / 2.0).min(3.1))
}

/// What a wave of unit height running to beam `j` makes of the slope in each patch.
fn steer(observed: &Observed<'_>, used: &[usize], k: f64, j: usize) -> Vec<Complex32> {
    let angle = TAU * j as f64 / BEAMS as f64;
    let run = glam::DVec2::new(angle.sin(), angle.cos());
    let sinc = |x: f64| if x.abs() < 1e-6 { 1.0 } else { x.sin() / x };
    let one = |&i: &usize| {
        let cell = &observed.cells[i];
        let (along, across) = (k * run.dot(cell.view), k * run.dot(cell.view.perp()));
        let averaged = sinc(along * cell.size.x / 2.0) * sinc(across * cell.size.y / 2.0);
        let size = along * averaged * f64::from(observed.weights[i]);
        let phase = (k * run.dot(cell.at)) % TAU;
        Complex32::from_polar(size as f32, (phase + TAU / 4.0) as f32)
    };
    used.iter().map(one).collect()
}

fn dot(a: &[Complex32], b: &[Complex32]) -> Complex32 {
    a.iter().zip(b).map(|(a, b)| a.conj() * b).sum()
}

/// Shares of the energy by beam for a mean direction and spread.
fn spread_shares(mean: f64, s: f64) -> [f64; BEAMS] {
    let mut shares: [f64; BEAMS] = std::array::from_fn(|j| {
        let angle = TAU * j as f64 / BEAMS as f64 - mean;
        (0.5 + 0.5 * angle.cos()).powf(s)
    });
    let sum: f64 = shares.iter().sum();
    shares.iter_mut().for_each(|v| *v /= sum);
    shares
}

/// Most likely mean direction, spread, density and noise: (score, mean, spread, density, noise).
fn search(table: &[Vec<f64>], powers: &[f64]) -> Option<(f64, f64, f64, f64, f64)> {
    let mut best: Option<(f64, f64, f64, f64, f64)> = None;
    for m in 0..MEANS {
        let mean = TAU * m as f64 / MEANS as f64;
        for spread in SPREADS {
            let shares = spread_shares(mean, spread);
            let waves: Vec<f64> =
                table.iter().map(|row| row.iter().zip(&shares).map(|(t, s)| t * s).sum()).collect();
            let (density, noise) = split(&waves, powers);
            let score: f64 = waves
                .iter()
                .zip(powers)
                .enumerate()
                .map(|(i, (w, p))| {
                    let q = (w * density + noise).max(1e-30);
                    weight(i) * (p / q + q.ln())
                })
                .sum();
            if best.is_none_or(|b| score < b.0) {
                best = Some((score, mean, spread, density, noise));
            }
        }
    }
    best
}

fn weight(row: usize) -> f64 {
    if row == BEAMS { TOTAL_WEIGHT } else { 1.0 }
}

/// Density of waves and of noise, neither negative, that fit powers of exponential distribution best (multiplicative
/// updates for the divergence of Itakura and Saito; Fevotte, Bertin and Durrieu 2009, eq. 3.9).
fn split(waves: &[f64], powers: &[f64]) -> (f64, f64) {
    let total = powers.last().copied().unwrap_or_default().max(1e-30);
    let unit = waves.last().copied().unwrap_or_default().max(1e-30);
    let (mut density, mut noise) = (0.5 * total / unit, 0.5 * total);
    for _ in 0..25 {
        let (mut up, mut down, mut noise_up, mut noise_down) = (0.0, 0.0, 0.0, 0.0);
        for (i, (w, p)) in waves.iter().zip(powers).enumerate() {
            let q = (w * density + noise).max(1e-30);
            let (a, b) = (weight(i) * p / (q * q), weight(i) / q);
            up += w * a;
            down += w * b;
            noise_up += a;
            noise_down += b;
        }
        density *= (up / down.max(1e-30)).sqrt();
        noise *= (noise_up / noise_down.max(1e-30)).sqrt();
    }
    (density, noise)
}
