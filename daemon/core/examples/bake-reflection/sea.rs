//! A patch of sea that repeats in both directions: resolved waves as a height field, the finest ones as a variance of slopes.

use std::f64::consts::{PI, TAU};

use bowwave_core::{sea::BeaufortForce, world::waves::Spectrum};
use rand::RngExt;
use rand_pcg::Pcg64;
use rustfft::{FftPlanner, num_complex::Complex};

/// Grid points along a side.
const SIDE: usize = 1024;
/// A small boat's level is the water's, weighted by a normal distribution of this standard deviation about its middle, metres: the mean over
/// some 8 by 2.6 m.
const FOOT_M: f64 = 1.3;
/// Standard gravity, m/s^2.
const G: f64 = 9.806_65;

/// Mean square slopes of a clean sea along and across the wind (Cox and Munk 1954), for a wind in m/s. Their two fits cross at
/// 2.4 m/s; below, the axes are taken as equal.
pub fn cox_munk(wind_m_s: f64) -> (f64, f64) {
    let total = 0.003 + 0.005_12 * wind_m_s;
    let up = (0.003_16 * wind_m_s).max(0.5 * total);
    (up, total - up)
}

/// What a sea is made from.
#[derive(Clone, Copy, Debug)]
pub struct SeaSpec {
    /// Wind force 0 to 4.
    pub force: BeaufortForce,
    /// Angle between the direction in which the waves run and the line of sight, radians.
    pub wind_to_view: f64,
    /// Random numbers.
    pub seed: u64,
}

/// A sea in the space of the view: x to the right, y away from the eye, z up, metres.
pub struct BakedSea {
    pitch_m: f64,
    /// Height, and slopes to x and y, at each grid point.
    points: Vec<[f32; 3]>,
    /// Level that a small boat has there.
    levels: Vec<f32>,
    /// Standard deviations of that, metres, and of how it tilts away from the eye, tangent.
    pub spread: [f64; 2],
    /// No water is higher or lower than this, metres.
    pub reach_m: f64,
    /// No resolved slope is steeper.
    steepest: f64,
    /// Variance of the unresolved slopes to x and y, and their covariance.
    pub fine: [f64; 3],
}

impl BakedSea {
    /// Waves that the wind raises in time (Pierson and Moskowitz), spread by cos^2; the tail beyond three times the peak's wave number is
    /// scaled so that resolved waves have at most 60 % of Cox and Munk's mean square slope, and what is missing from it is unresolved.
    pub fn new(spec: &SeaSpec) -> Self {
        let wind = spec.force.wind_mean_m_s();
        let spectrum = Spectrum::fully_developed(wind).unwrap_or(Spectrum::FLAT);
        let pitch_m = match spec.force.get() {
            0 | 1 => 0.02,
            2 => 0.05,
            _ => 0.1,
        };
        let (up, cross) = cox_munk(wind);
        let (sin, cos) = spec.wind_to_view.sin_cos();
        // Wind along (sin, cos): slopes to x and y.
        let total = [
            up * sin * sin + cross * cos * cos,
            up * cos * cos + cross * sin * sin,
            (up - cross) * sin * cos,
        ];
        let height = spectrum.significant_height_m();
        if height <= 0.0 {
            return Self {
                pitch_m,
                points: Vec::new(),
                levels: Vec::new(),
                spread: [0.0; 2],
                reach_m: 0.0,
                steepest: 0.0,
                fine: total,
            };
        }
        let omega_p = TAU / spectrum.peak_period_s();
        let peak = omega_p * omega_p / G;
        let dk = TAU / (SIDE as f64 * pitch_m);
        let tail = tail_factor(height, peak, dk * (SIDE / 2) as f64, 0.6 * (up + cross));
        let mut rng = Pcg64::new(u128::from(spec.seed), 0xba4e);
        let mut gauss = move || {
            let (a, b): (f64, f64) = (rng.random(), rng.random());
            let r = (-2.0 * (1.0 - a).ln()).sqrt();
            Complex::new(r * (TAU * b).cos(), r * (TAU * b).sin())
        };
        let mut field = vec![Complex::new(0.0, 0.0); SIDE * SIDE];
        let mut afloat = field.clone();
        for j in 0..SIDE {
            for i in 0..SIDE {
                let at = |n: usize| if n < SIDE / 2 { n as f64 } else { n as f64 - SIDE as f64 } * dk;
                let (kx, ky) = (at(i), at(j));
                let k = kx.hypot(ky);
                let noise = gauss();
                if k == 0.0 || k > dk * (SIDE / 2 - 1) as f64 {
                    continue;
                }
                let along = (kx * sin + ky * cos) / k;
                // cos^2 about the wind over half the circle: 2/pi cos^2.
                let spread = if along > 0.0 { 2.0 / PI * along * along } else { 0.0 };
                let factor = if k > 3.0 * peak { tail } else { 1.0 };
                let power = omnidirectional(height, peak, k) * factor / k * spread * dk * dk;
                field[j * SIDE + i] = noise * power.sqrt();
                afloat[j * SIDE + i] = noise * power.sqrt() * (-0.5 * (k * FOOT_M).powi(2)).exp();
            }
        }
        let heights = real_field(field);
        let levels: Vec<f32> = real_field(afloat).iter().map(|h| *h as f32).collect();
        let points: Vec<[f32; 3]> = (0..SIDE * SIDE)
            .map(|n| {
                let (i, j) = (n % SIDE, n / SIDE);
                let h = |i: usize, j: usize| heights[(j % SIDE) * SIDE + i % SIDE];
                let dx = (h(i + 1, j) - h(i + SIDE - 1, j)) / (2.0 * pitch_m);
                let dy = (h(i, j + 1) - h(i, j + SIDE - 1)) / (2.0 * pitch_m);
                [h(i, j) as f32, dx as f32, dy as f32]
            })
            .collect();
        // Central differences lose what the grid hardly resolves: what is left of the slopes is what the points have.
        let mean = |f: fn(&[f32; 3]) -> f64| points.iter().map(f).sum::<f64>() / points.len() as f64;
        let has = [
            mean(|p| f64::from(p[1] * p[1])),
            mean(|p| f64::from(p[2] * p[2])),
            mean(|p| f64::from(p[1] * p[2])),
        ];
        let fine = [
            (total[0] - has[0]).max(0.1 * total[0]),
            (total[1] - has[1]).max(0.1 * total[1]),
            total[2] - has[2],
        ];
        let limit = 0.9 * (fine[0] * fine[1]).sqrt();
        let fine = [fine[0], fine[1], fine[2].clamp(-limit, limit)];
        let reach_m = points.iter().fold(0.0_f64, |m, p| m.max(f64::from(p[0].abs())));
        let steepest = points.iter().fold(0.0_f64, |m, p| m.max(f64::from(p[1].hypot(p[2]))));
        let mut sea = Self { pitch_m, points, levels, spread: [0.0; 2], reach_m, steepest, fine };
        let side = SIDE as f64 * pitch_m;
        let places = (0..10_000).map(|i| (side * 0.618 * f64::from(i), side * f64::from(i) / 1e4));
        for (x, y) in places {
            let afloat = sea.afloat(x, y);
            for (sum, v) in sea.spread.iter_mut().zip(afloat) {
                *sum += v * v / 1e4;
            }
        }
        sea.spread = sea.spread.map(f64::sqrt);
        sea
    }

    /// Height and slopes at a place, metres.
    pub fn at(&self, x: f64, y: f64) -> [f64; 3] {
        if self.points.is_empty() {
            return [0.0; 3];
        }
        let (x, y) = (x / self.pitch_m, y / self.pitch_m);
        let (fx, fy) = (x.floor(), y.floor());
        let (u, v) = ((x - fx) as f32, (y - fy) as f32);
        let wrap = |n: f64| (n as i64).rem_euclid(SIDE as i64) as usize;
        let (i, j) = (wrap(fx), wrap(fy));
        let (i1, j1) = ((i + 1) % SIDE, (j + 1) % SIDE);
        let (a, b) = (&self.points[j * SIDE + i], &self.points[j * SIDE + i1]);
        let (c, d) = (&self.points[j1 * SIDE + i], &self.points[j1 * SIDE + i1]);
        std::array::from_fn(|n| {
            let near = a[n] + (b[n] - a[n]) * u;
            let far = c[n] + (d[n] - c[n]) * u;
            f64::from(near + (far - near) * v)
        })
    }

    /// Level of a small boat afloat at a place, metres.
    pub fn level(&self, x: f64, y: f64) -> f64 {
        if self.levels.is_empty() {
            return 0.0;
        }
        let wrap = |v: f64| ((v / self.pitch_m).round() as i64).rem_euclid(SIDE as i64) as usize;
        self.levels.get(wrap(y) * SIDE + wrap(x)).map_or(0.0, |l| f64::from(*l))
    }

    /// Level of such a boat, and how steeply the water under it rises away from the eye.
    pub fn afloat(&self, x: f64, y: f64) -> [f64; 2] {
        [self.level(x, y), (self.level(x, y + FOOT_M) - self.level(x, y - FOOT_M)) / (2.0 * FOOT_M)]
    }

    /// How far along the ray the water is hit; `None` where it is not. The step is as far as the water can at most rise.
    pub fn hit(&self, from: [f64; 3], dir: [f64; 3], skip: f64) -> Option<f64> {
        if self.points.is_empty() {
            return (dir[2] < 0.0 && from[2] > 1e-6).then(|| from[2] / -dir[2]);
        }
        let flat = dir[0].hypot(dir[1]);
        // Most slopes are far below the steepest: a bound of 60 % and the check behind it lose nothing that is seen.
        let closing = (0.6 * self.steepest * flat - dir[2]).max(0.02);
        let mut t = skip;
        // How far above the water the last place was, and how far before.
        let (mut above, mut back) = (0.0, 0.0);
        for _ in 0..4000 {
            let z = from[2] + t * dir[2];
            if z > self.reach_m && dir[2] >= 0.0 {
                return None;
            }
            let gap = z - self.at(from[0] + t * dir[0], from[1] + t * dir[1])[0];
            if gap <= 0.0 {
                // Back to where the chord crosses.
                return Some((t + back * gap / (above - gap).max(1e-12)).max(0.0));
            }
            let step = (gap / closing).max(0.3 * self.pitch_m);
            (above, back) = (gap, step);
            t += step;
        }
        None
    }
}

/// Variance of height per wave number, m^3: Pierson-Moskowitz of a significant height and peak wave number.
fn omnidirectional(height_m: f64, peak: f64, k: f64) -> f64 {
    // E(omega) = 5/16 H^2 w_p^4 w^-5 exp(-5/4 (w_p/w)^4), d omega / dk = sqrt(g / k) / 2.
    let ratio = (peak / k).sqrt();
    let omega = (G * k).sqrt();
    5.0 / 16.0 * height_m * height_m * ratio.powi(4) / omega
        * (-1.25 * ratio.powi(4)).exp()
        * 0.5
        * (G / k).sqrt()
}

/// Factor of the spectrum beyond three times the peak that keeps the mean square slope up to `k_max` within `slopes`.
fn tail_factor(height_m: f64, peak: f64, k_max: f64, slopes: f64) -> f64 {
    let sum = |from: f64, to: f64| -> f64 {
        let n = 2000;
        let step = (to / from).ln() / f64::from(n);
        (0..n)
            .map(|i| from * ((f64::from(i) + 0.5) * step).exp())
            .map(|k| k.powi(3) * omnidirectional(height_m, peak, k) * step)
            .sum()
    };
    let (head, tail) = (sum(0.2 * peak, 3.0 * peak), sum(3.0 * peak, k_max));
    ((slopes - head) / tail).clamp(0.05, 1.0)
}

/// Real part of the inverse transform.
fn real_field(mut field: Vec<Complex<f64>>) -> Vec<f64> {
    let fft = FftPlanner::new().plan_fft_inverse(SIDE);
    fft.process(&mut field);
    let mut turned = vec![Complex::new(0.0, 0.0); SIDE * SIDE];
    for j in 0..SIDE {
        for i in 0..SIDE {
            turned[i * SIDE + j] = field[j * SIDE + i];
        }
    }
    fft.process(&mut turned);
    let mut heights = vec![0.0; SIDE * SIDE];
    for j in 0..SIDE {
        for i in 0..SIDE {
            heights[j * SIDE + i] = turned[i * SIDE + j].re;
        }
    }
    heights
}
