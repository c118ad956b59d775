//! Waves of one frequency: direction, energy and what is none, from the phases over the patches.
//!
//! Over deep water a frequency has one wavelength (omega^2 = g k). Brightness of all patches at that frequency is compared with
//! what plane waves of that length would cause, one beam per direction; what fits none of them is noise.

use std::f64::consts::TAU;

use glam::DVec2;
use rustfft::num_complex::Complex32;

use super::grid::SeaPatch;
use crate::physics::GRAVITY_M_S2;

/// Directions of beams.
pub(super) const BEAMS: usize = 24;

/// Result at one frequency.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ShellLine {
    /// Frequency, Hz.
    pub hz: f64,
    /// Direction the waves run to, radians clockwise from north.
    pub towards: f64,
    /// Share of the power of all patches that waves explain, 0 to 1.
    pub share: f64,
    /// One-sided density of the slope towards the eye in the near patches, noise included, 1/Hz.
    pub slope: f64,
    /// The same that waves of a density of height of 1 m^2/Hz would cause.
    pub unit: f64,
    /// That of such waves if they ran along the view.
    pub unit_best: f64,
}

/// Spectra of all patches at one frequency, in slope: `values[taper][cell]`.
pub(super) struct Observed<'a> {
    pub hz: f64,
    pub cells: &'a [SeaPatch],
    /// Weight of each patch: 0 leaves it out.
    pub weights: &'a [f32],
    /// Patches that are near enough to tell heights.
    pub near: &'a [bool],
    /// Scaled so that the mean square is a one-sided density.
    pub values: &'a [Vec<Complex32>],
}

/// Mean power of the near patches.
pub(super) fn noise(observed: &Observed<'_>) -> f64 {
    let near: Vec<usize> = (0..observed.cells.len()).filter(|&i| observed.near[i]).collect();
    power(observed, &near)
}

/// Mean power of some patches, weighted.
fn power(observed: &Observed<'_>, some: &[usize]) -> f64 {
    let square = |i: usize| observed.values.iter().map(|v| f64::from(v[i].norm_sqr())).sum::<f64>();
    let weight = |i: usize| f64::from(observed.weights[i]).powi(2);
    let sum: f64 = some.iter().map(|&i| square(i) * weight(i)).sum();
    let weights: f64 = some.iter().map(|&i| weight(i)).sum();
    sum / (weights * observed.values.len() as f64).max(1e-30)
}

/// Fits waves and noise to one frequency; `None` where too few patches resolve such waves.
pub(super) fn fit(observed: &Observed<'_>) -> Option<ShellLine> {
    /// A patch that averages a wave to less than this is not used for it.
    const LEAST_RESPONSE: f64 = 0.35;
    /// Patches that must resolve a wave.
    const LEAST_CELLS: usize = 24;
    let k = (TAU * observed.hz).powi(2) / GRAVITY_M_S2;
    let used: Vec<usize> = (0..observed.cells.len())
        .filter(|&i| observed.weights[i] > 0.0 && sinc(k * observed.cells[i].size.x / 2.0) > LEAST_RESPONSE)
        .collect();
    let near: Vec<usize> = used.iter().copied().filter(|&i| observed.near[i]).collect();
    if used.len() < LEAST_CELLS || near.len() < LEAST_CELLS / 2 {
        return None;
    }
    let steering: Vec<Vec<Complex32>> = (0..BEAMS).map(|j| steer(observed, &used, k, j)).collect();
    let norms: Vec<f64> = steering.iter().map(|v| v.iter().map(|z| f64::from(z.norm_sqr())).sum()).collect();
    let powers = beam_powers(observed, &used, &steering, &norms);
    // Rows: what a wave of direction j and density 1 gives in each beam, and in the mean power of a patch.
    let mut table = vec![vec![0.0; BEAMS]; BEAMS + 1];
    for j in 0..BEAMS {
        for i in 0..=j {
            let overlap = f64::from(dot(&steering[i], &steering[j]).norm_sqr());
            table[i][j] = overlap / norms[i].max(1e-30);
            table[j][i] = overlap / norms[j].max(1e-30);
        }
        table[BEAMS][j] = norms[j] / used.len() as f64;
    }
    let best = search(&table, &powers)?;
    let shares = spread_shares(best.mean, best.spread);
    let explained = table[BEAMS].iter().zip(&shares).map(|(t, s)| t * s).sum::<f64>() * best.density;
    let units: Vec<f64> = (0..BEAMS).map(|j| unit(observed, &near, k, j)).collect();
    let line = ShellLine {
        hz: observed.hz,
        towards: best.mean,
        share: explained / (explained + best.noise).max(1e-30),
        slope: power(observed, &near),
        unit: units.iter().zip(&shares).map(|(u, s)| u * s).sum(),
        unit_best: units.iter().copied().fold(0.0, f64::max),
    };
    [line.share, line.slope, line.unit].iter().all(|v| v.is_finite()).then_some(line)
}

/// Mean power of every beam, and last that of a patch.
fn beam_powers(
    observed: &Observed<'_>,
    used: &[usize],
    steering: &[Vec<Complex32>],
    norms: &[f64],
) -> Vec<f64> {
    let tapers = observed.values.len() as f64;
    let mut powers = vec![0.0; BEAMS + 1];
    for values in observed.values {
        let y: Vec<Complex32> = used.iter().map(|&i| values[i] * observed.weights[i]).collect();
        for (power, (v, norm)) in powers.iter_mut().zip(steering.iter().zip(norms)) {
            *power += f64::from(dot(v, &y).norm_sqr()) / norm.max(1e-30) / tapers;
        }
        powers[BEAMS] +=
            y.iter().map(|z| f64::from(z.norm_sqr())).sum::<f64>() / (used.len() as f64 * tapers);
    }
    powers
}

fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-6 { 1.0 } else { (x.sin() / x).max(if x > 3.1 { 0.0 } else { -1.0 }) }
}

/// Direction in which beam `j` runs, unit vector east and north.
fn run_of(j: usize) -> DVec2 {
    let angle = TAU * j as f64 / BEAMS as f64;
    DVec2::new(angle.sin(), angle.cos())
}

/// Slope towards the eye, averaged over a patch, of waves of `k` radians a metre and unit height that run along `run`.
fn slope_response(cell: &SeaPatch, k: f64, run: DVec2) -> f64 {
    let (along, across) = (k * run.dot(cell.view), k * run.dot(cell.view.perp()));
    along * sinc((along * cell.size.x / 2.0).abs()) * sinc((across * cell.size.y / 2.0).abs())
}

/// Mean square of the response of some patches to beam `j`, weighted as [`power`].
fn unit(observed: &Observed<'_>, some: &[usize], k: f64, j: usize) -> f64 {
    let weight = |i: usize| f64::from(observed.weights[i]).powi(2);
    let sum: f64 =
        some.iter().map(|&i| slope_response(&observed.cells[i], k, run_of(j)).powi(2) * weight(i)).sum();
    sum / some.iter().map(|&i| weight(i)).sum::<f64>().max(1e-30)
}

/// What a wave of unit height running to beam `j` makes of the weighted slope in each patch.
fn steer(observed: &Observed<'_>, used: &[usize], k: f64, j: usize) -> Vec<Complex32> {
    let run = run_of(j);
    let one = |&i: &usize| {
        let cell = &observed.cells[i];
        let size = slope_response(cell, k, run) * f64::from(observed.weights[i]);
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

/// Waves and noise of one frequency.
#[derive(Clone, Copy, Debug)]
struct ShellFit {
    score: f64,
    mean: f64,
    spread: f64,
    density: f64,
    noise: f64,
}

/// Most likely mean direction, spread, density and noise.
fn search(table: &[Vec<f64>], powers: &[f64]) -> Option<ShellFit> {
    /// Directions tried as the mean one.
    const MEANS: usize = 48;
    /// Exponents tried of the spread cos^2s(angle / 2).
    const SPREADS: [f64; 5] = [1.0, 3.0, 8.0, 20.0, 50.0];
    let mut best: Option<ShellFit> = None;
    for m in 0..MEANS {
        let mean = TAU * m as f64 / MEANS as f64;
        for spread in SPREADS {
            let shares = spread_shares(mean, spread);
            let waves: Vec<f64> =
                table.iter().map(|row| row.iter().zip(&shares).map(|(t, s)| t * s).sum()).collect();
            let (density, noise) = split(&waves, powers);
            let misfit = |(i, (w, p)): (usize, (&f64, &f64))| {
                let q = (w * density + noise).max(1e-30);
                weight(i) * (p / q + q.ln())
            };
            let score: f64 = waves.iter().zip(powers).enumerate().map(misfit).sum();
            if score.is_finite() && best.is_none_or(|b| score < b.score) {
                best = Some(ShellFit { score, mean, spread, density, noise });
            }
        }
    }
    best
}

fn weight(row: usize) -> f64 {
    /// Weight of the total power against one beam, where waves and noise are told apart.
    const TOTAL_WEIGHT: f64 = 6.0;
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
