//! The spectrum of a minute of the water itself: the limit for any estimator that sees that water no longer.
//!
//! Buoys that weigh nothing are laid out in the view and write down height and slopes exactly. Peak and direction are taken from them
//! by the definitions of the estimator (`sea::estimate`): the fourth power's mean frequency (Young 1995) of sine-tapered spectra, and the
//! mean direction by energy about it from the quadrature of height and slope (Longuet-Higgins, Cartwright and Smith 1963).

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rustfft::{FftPlanner, num_complex::Complex64};

/// Buoys across the view and along it.
const BUOYS: (usize, usize) = (5, 6);
/// Frequencies that count, Hz.
const BAND_HZ: (f64, f64) = (0.045, 0.9);
/// Frequency of the fourth power's mean over that of the peak, as the estimator has it.
const FOURTH_OVER_PEAK: f64 = 1.02;
/// Tapers.
const TAPERS: usize = 2;

/// Heights and slopes by buoy, one after the other in time.
#[derive(Clone, Debug)]
pub struct Gauges {
    /// Where they float, metres east and north of the eye's foot.
    places: Vec<DVec2>,
    records: Vec<Vec<DVec3>>,
    times: Vec<f64>,
}

/// Peak and direction by the buoys.
#[derive(Clone, Copy, Debug)]
pub struct Gauged {
    /// Peak period, seconds.
    pub period_s: f64,
    /// Where the waves come from, radians.
    pub from_rad: f64,
}

impl Gauges {
    /// Buoys over the water that an eye so high sees towards an azimuth.
    pub fn lay(eye_m: f64, azimuth: f64) -> Self {
        let share = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
        let places: Vec<DVec2> = (0..BUOYS.0 * BUOYS.1)
            .map(|i| {
                let side = azimuth + 0.7 * (share(i % BUOYS.0, BUOYS.0) - 0.5);
                DVec2::new(side.sin(), side.cos()) * eye_m * 2.0 * 6f64.powf(share(i / BUOYS.0, BUOYS.1))
            })
            .collect();
        Self { records: vec![Vec::new(); places.len()], places, times: Vec::new() }
    }

    /// Takes down height and slopes at a time; times come at even steps.
    pub fn write(&mut self, time_s: f64, water: impl Fn(DVec2) -> DVec3) {
        self.times.push(time_s);
        for (record, place) in self.records.iter_mut().zip(&self.places) {
            record.push(water(*place));
        }
    }

    /// Peak and direction; `None` of a flat or hardly watched sea.
    pub fn read(&self) -> Option<Gauged> {
        let n = self.times.len();
        let step_s = (self.times.last()? - self.times.first()?) / (n.max(2) - 1) as f64;
        let lines = self.lines(n, step_s);
        let hz = |i: usize| i as f64 / (2.0 * n as f64 * step_s);
        let used = |i: &usize| (BAND_HZ.0..BAND_HZ.1).contains(&hz(*i));
        let fourth = |i: usize| lines[i].0.powi(4);
        let sum: f64 = (0..n).filter(used).map(fourth).sum();
        let peak = (0..n).filter(used).map(|i| fourth(i) * hz(i)).sum::<f64>() / sum;
        if peak.is_nan() || peak <= 0.0 {
            return None;
        }
        let about = (0..n).filter(|i| (0.65..1.8).contains(&(hz(*i) / peak)));
        let towards: DVec2 = about.map(|i| lines[i].1.normalize_or_zero() * lines[i].0).sum();
        let from_rad = (-towards.x).atan2(-towards.y);
        Some(Gauged { period_s: FOURTH_OVER_PEAK / peak, from_rad })
    }

    /// Power of the height, and the direction in which it runs weighted by power, by bin of a transform padded to twice the length.
    fn lines(&self, n: usize, step_s: f64) -> Vec<(f64, DVec2)> {
        let fft = FftPlanner::new().plan_fft_forward(2 * n);
        let mut lines = vec![(0.0, DVec2::ZERO); n];
        for record in &self.records {
            for taper in 1..=TAPERS {
                let transform = |of: fn(&DVec3) -> f64| {
                    let mut data: Vec<Complex64> = (1..=n)
                        .map(|i| {
                            (TAU / 2.0 * (taper * i) as f64 / (n as f64 + 1.0)).sin() * of(&record[i - 1])
                        })
                        .map(|v| Complex64::new(v, 0.0))
                        .collect();
                    data.resize(2 * n, Complex64::default());
                    fft.process(&mut data);
                    data
                };
                let [height, east, north] = [transform(|v| v.x), transform(|v| v.y), transform(|v| v.z)];
                for (i, line) in lines.iter_mut().enumerate() {
                    line.0 += height[i].norm_sqr() * step_s;
                    // A slope follows its height by a quarter of a period where the wave runs that way.
                    let behind = |slope: Complex64| (height[i] * slope.conj()).im;
                    line.1 += DVec2::new(behind(east[i]), behind(north[i]));
                }
            }
        }
        lines
    }
}
