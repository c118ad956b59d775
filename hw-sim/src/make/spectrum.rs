//! The directional wave spectrum: a wind sea with a JONSWAP peak, whose short waves make up the slopes that Cox and Munk
//! measured, and a swell.

use std::f64::consts::{LN_2, PI, TAU};

use bowwave_core::sea::BeaufortForce;

use super::motion::GRAVITY;

/// Wavenumber of the slowest capillary-gravity wave, rad/m (Elfouhaily et al. 1997, eq. 24).
const K_CAPILLARY: f64 = 370.0;
/// Speed of that wave, m/s.
const C_CAPILLARY: f64 = 0.23;
/// Where the slope integral is cut off, rad/m: waves of 6 mm, below which Cox and Munk's glitter is not resolved either.
const K_CUTOFF: f64 = 1000.0;
/// Inverse wave age of a fully developed sea (Elfouhaily et al. 1997).
const INVERSE_WAVE_AGE: f64 = 0.84;

/// Mean wind speed of a Beaufort force at 10 m, m/s (WMO-No. 306: v = 0.836 B^1.5), not below a breath of 0.5 m/s.
pub fn wind_speed(force: BeaufortForce) -> f64 {
    (0.836 * f64::from(force.get()).powf(1.5)).max(0.5)
}

/// Mean square slopes (upwind, crosswind) of a clean sea under a wind of `speed` m/s (Cox and Munk 1954; their 12.5 m mast
/// is taken for 10 m, 2 % of wind).
pub fn cox_munk(speed: f64) -> [f64; 2] {
    [3.16e-3 * speed, 3e-3 + 1.92e-3 * speed]
}

/// Angular frequency of a free wave in deep water, rad/s, surface tension included.
pub fn angular_frequency(k: f64) -> f64 {
    (GRAVITY * k * (1.0 + (k / K_CAPILLARY).powi(2))).sqrt()
}

/// A swell from a far-off storm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swell {
    /// Significant height, metres.
    pub height_m: f64,
    /// Peak period, seconds.
    pub period_s: f64,
    /// Where it comes from, radians clockwise from north.
    pub from: f64,
}

/// The wind sea's spectrum for one wind speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WindSea {
    wind: f64,
    peak: f64,
    tail_power: f64,
}

impl WindSea {
    /// The fully developed sea under a wind of `wind` m/s.
    ///
    /// The short waves, above ten times the peak or half a metre, are tilted by a power of the wavenumber such that the whole mean square
    /// slope is Cox and Munk's; Elfouhaily's own high-frequency level is undefined for light winds.
    pub fn new(wind: f64) -> Self {
        let peak = GRAVITY / (wind * wind) * INVERSE_WAVE_AGE.powi(2);
        let mut sea = Self { wind, peak, tail_power: 0.0 };
        let target: f64 = cox_munk(wind).iter().sum();
        let (mut low, mut high) = (-4.0, 2.0);
        for _ in 0..50 {
            sea.tail_power = 0.5 * (low + high);
            if sea.slope_variance(K_CUTOFF) < target {
                low = sea.tail_power;
            } else {
                high = sea.tail_power;
            }
        }
        sea
    }

    /// Wavenumber of the peak, rad/m.
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// Elevation spectrum over all directions, m^3: its integral over k is the variance of the height
    /// (Elfouhaily et al. 1997, eq. 2-3 and 30-32, with the peak of JONSWAP as function of k).
    pub fn omnidirectional(&self, k: f64) -> f64 {
        if k <= 0.0 {
            return 0.0;
        }
        let ratio = (k / self.peak).sqrt();
        let moskowitz = (-1.25 * (self.peak / k).powi(2)).exp();
        let sigma = 0.08 * (1.0 + 4.0 / INVERSE_WAVE_AGE.powi(3));
        let enhancement = 1.7f64.powf((-(ratio - 1.0).powi(2) / (2.0 * sigma * sigma)).exp());
        let cut = (-INVERSE_WAVE_AGE / 10f64.sqrt() * (ratio - 1.0)).exp();
        let alpha = 6e-3 * INVERSE_WAVE_AGE.sqrt();
        let curvature = 0.5 * alpha * phase_speed(self.peak) / phase_speed(k) * moskowitz * enhancement * cut;
        curvature * self.tail(k) / k.powi(3)
    }

    fn tail(&self, k: f64) -> f64 {
        let from = (10.0 * self.peak).min(12.0).max(self.peak);
        let x = (k / from).max(1.0);
        x.powf(self.tail_power)
    }

    /// Share of a wavenumber's energy that travels at `angle` to the wind, per radian: Elfouhaily's symmetric spread
    /// (eq. 57-60), leaning forward so that 19 times as much runs with the wind as against it.
    pub fn spread(&self, k: f64, angle: f64) -> f64 {
        let friction = self.wind * (1e-3 * (0.8 + 0.065 * self.wind)).sqrt();
        let (c, peak_c) = (phase_speed(k), phase_speed(self.peak));
        let delta = (LN_2 / 4.0
            + 4.0 * (c / peak_c).powf(2.5)
            + 0.13 * friction / C_CAPILLARY * (C_CAPILLARY / c).powf(2.5))
        .tanh();
        (1.0 + delta * (2.0 * angle).cos()) * (1.0 + 0.9 * angle.cos()) / TAU
    }

    /// Mean square slope of all waves up to wavenumber `k_max`.
    pub fn slope_variance(&self, k_max: f64) -> f64 {
        self.moment(k_max, 2)
    }

    /// Significant wave height, metres: four standard deviations.
    pub fn significant_height(&self) -> f64 {
        4.0 * self.moment(K_CUTOFF, 0).sqrt()
    }

    fn moment(&self, k_max: f64, power: i32) -> f64 {
        let (start, steps) = (self.peak / 20.0, 800);
        let step = (k_max / start).ln() / f64::from(steps);
        (0..steps)
            .map(|i| {
                let k = start * ((f64::from(i) + 0.5) * step).exp();
                self.omnidirectional(k) * k.powi(power) * k * step
            })
            .sum()
    }
}

fn phase_speed(k: f64) -> f64 {
    angular_frequency(k) / k
}

impl Swell {
    /// Wavenumber of the peak, rad/m.
    pub(super) fn peak(&self) -> f64 {
        (TAU / self.period_s).powi(2) / GRAVITY
    }

    /// Relative weight of a wave (`east`, `north` rad/m) on a lattice with spacing `lattice` rad/m: narrow in wavenumber
    /// and direction, but not so narrow that it falls between the lattice's points.
    pub(super) fn weight(&self, east: f64, north: f64, lattice: f64) -> f64 {
        let peak = self.peak();
        let towards = self.from + PI;
        let (ce, cn) = (peak * towards.sin(), peak * towards.cos());
        let along = ((east - ce) * ce + (north - cn) * cn) / peak;
        let across = ((east - ce) * cn - (north - cn) * ce) / peak;
        let (sa, sc) = ((0.12 * peak).max(0.6 * lattice), (0.2 * peak).max(0.6 * lattice));
        (-0.5 * ((along / sa).powi(2) + (across / sc).powi(2))).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_cox_and_munk() {
        let table = include_str!("../../data/cox_munk.csv");
        let mut rows = 0;
        for line in table.lines().skip(2) {
            let c: Vec<f64> = line.split(',').map(|c| c.trim().parse().unwrap()).collect();
            if c[0] < 1.0 {
                continue; // no wind, no spectrum
            }
            let [up, cross] = cox_munk(c[0]);
            assert!((up - c[3]).abs() < 1e-9 && (cross - c[2]).abs() < 1e-9);
            let got = WindSea::new(c[0]).slope_variance(K_CUTOFF);
            assert!((got / c[1] - 1.0).abs() < 0.01, "{} m/s: {got}, measured {}", c[0], c[1]);
            rows += 1;
        }
        assert!(rows >= 7);
    }

    #[test]
    fn height_of_a_developed_sea_grows_with_the_square_of_the_wind() {
        // Pierson and Moskowitz 1964: Hs = 0.0246 U^2 at 10 m (0.22 U^2 / g).
        for wind in [4.0, 7.0, 10.0, 15.0] {
            let ratio = WindSea::new(wind).significant_height() / (0.0246 * wind * wind);
            assert!((0.85..1.25).contains(&ratio), "{wind} m/s: {ratio} times Pierson-Moskowitz");
        }
    }

    #[test]
    fn spread_sums_to_one_and_leans_with_the_wind() {
        let sea = WindSea::new(5.0);
        for k in [sea.peak(), 5.0, 100.0] {
            let sum: f64 = (0..720).map(|i| sea.spread(k, f64::from(i) * PI / 360.0) * PI / 360.0).sum();
            assert!((sum - 1.0).abs() < 1e-9, "{k}: {sum}");
            assert!(sea.spread(k, 0.0) > 10.0 * sea.spread(k, PI));
        }
    }
}
