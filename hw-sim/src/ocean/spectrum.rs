//! How the energy and the slopes of the sea are spread over wave number and direction.
//!
//! Elfouhaily, Chapron, Katsaros & Vandemark 1997 (J. Geophys. Res. 102, C7), equation numbers below; Hasselmann et al. 1973
//! (JONSWAP); Cox & Munk 1954. Wave numbers in rad/m, winds 10 m above the sea in m/s.
//!
//! [`Spectrum`] is the sea that rays are traced in: its short waves are Elfouhaily's, damped where they hold more slope than was ever
//! observed. [`WindSea`] is the fully developed sea of made recordings: its short waves are tilted to the slopes of Cox and Munk.

use std::f64::consts::{LN_2, PI, TAU};

/// Standard gravity, m/s^2.
pub const GRAVITY: f64 = 9.806_65;
/// Wave number of the slowest gravity-capillary wave, rad/m (eq. 24: sqrt(rho g / surface tension)).
const K_SLOWEST: f64 = 370.0;
/// Speed of the slowest gravity-capillary wave, m/s (eq. 41).
const C_SLOWEST: f64 = 0.23;
/// Wave number beyond which there are no waves, rad/m.
pub const SHORTEST_K: f64 = 1e4;
/// Phillips' constant of JONSWAP and Pierson-Moskowitz.
pub const PHILLIPS: f64 = 0.0081;

/// Where the slopes of a [`WindSea`] end, rad/m: waves of 6 mm, below which Cox and Munk's glitter is not resolved either.
const CUTOFF_K: f64 = 1000.0;
/// Inverse wave age of a fully developed sea (Elfouhaily et al. 1997).
const INVERSE_WAVE_AGE: f64 = 0.84;

/// Origin of the long waves.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum LongWaves {
    /// No waves at all that have a shape: a calm.
    Flat,
    /// The long-wave part of Elfouhaily's spectrum for an inverse wave age (0.84 fully developed, up to 5 young).
    Elfouhaily {
        /// Wind over phase speed of the peak.
        inverse_wave_age: f64,
    },
    /// JONSWAP of a given height and period, with Elfouhaily's short waves.
    Jonswap {
        /// Significant wave height, metres.
        height_m: f64,
        /// Peak period, seconds.
        period_s: f64,
        /// Peak enhancement.
        gamma: f64,
    },
}

/// A sea in statistical terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectrum {
    /// Wind 10 m above the sea, m/s.
    pub wind_m_s: f64,
    /// Where the wind comes from, radians clockwise from north.
    pub wind_from: f64,
    /// Long waves.
    pub long: LongWaves,
    /// Factor on a JONSWAP spectrum that gives it its height.
    jonswap_scale: f64,
    /// Waves shorter than this die of viscosity, rad/m (infinite: none do).
    damped_above: f64,
}

/// Phase speed of a wave of `k` rad/m on deep water with surface tension, m/s (eq. 24).
pub fn phase_speed(k: f64) -> f64 {
    (GRAVITY / k * (1.0 + (k / K_SLOWEST).powi(2))).sqrt()
}

/// Angular frequency of a wave of `k` rad/m, rad/s.
pub fn frequency(k: f64) -> f64 {
    k * phase_speed(k)
}

/// Friction velocity of a wind, m/s: drag coefficient of Wu 1980, (0.8 + 0.065 U) 1e-3.
pub fn friction_velocity(wind_m_s: f64) -> f64 {
    wind_m_s * ((0.8 + 0.065 * wind_m_s) * 1e-3).sqrt()
}

/// Mean wind speed of a Beaufort force at 10 m, m/s (WMO-No. 306: v = 0.836 B^1.5), not below a breath of 0.5 m/s.
pub fn wind_of_beaufort(force: u8) -> f64 {
    (0.836 * f64::from(force).powf(1.5)).max(0.5)
}

/// Mean square slopes (upwind, crosswind) of a clean sea by the two fits of Cox & Munk 1954, for the wind at their mast, 12.5 m up.
pub fn cox_munk_fits(mast_wind_m_s: f64) -> [f64; 2] {
    [3.16e-3 * mast_wind_m_s, 3e-3 + 1.92e-3 * mast_wind_m_s]
}

/// Mean square slope of a clean sea over all directions by the third fit of Cox & Munk 1954, for the wind at their mast.
pub fn cox_munk_total(mast_wind_m_s: f64) -> f64 {
    0.003 + 0.005_12 * mast_wind_m_s
}

/// Mean square slopes of a clean sea, (upwind axis, crosswind axis), for the wind at 10 m. The two axes of Cox & Munk are separate fits
/// that cross below 2.4 m/s; there the axes are taken equal, since no sea is rougher across the wind than along it.
pub fn cox_munk(wind_m_s: f64) -> (f64, f64) {
    // Logarithmic profile over the drag above.
    let mast_wind = wind_m_s + friction_velocity(wind_m_s) / 0.4 * (12.5f64 / 10.0).ln();
    let total = cox_munk_total(mast_wind);
    let up = cox_munk_fits(mast_wind)[0].max(total / 2.0);
    (up, total - up)
}

/// Shape of a JONSWAP spectrum over `x`, the frequency over the peak's: Pierson and Moskowitz's with the peak enhanced by `gamma`
/// (Hasselmann 1973).
pub fn jonswap_shape(x: f64, gamma: f64) -> f64 {
    let width = if x <= 1.0 { 0.07 } else { 0.09 };
    x.powi(-5) * (-1.25 * x.powi(-4)).exp() * gamma.powf((-((x - 1.0) / width).powi(2) / 2.0).exp())
}

/// JONSWAP energy by frequency, m^2 s, with Phillips' constant, for a peak at `peak` rad/s.
pub fn jonswap(omega: f64, peak: f64, gamma: f64) -> f64 {
    PHILLIPS * GRAVITY * GRAVITY * peak.powi(-5) * jonswap_shape(omega / peak, gamma)
}

/// Long-wave part of Elfouhaily's curvature spectrum, and its cut at the peak by which short waves end too (eq. 2, 3 and 30 to 32), for
/// a peak at `peak` rad/m and an inverse wave age.
fn elfouhaily_long(k: f64, peak: f64, age: f64) -> (f64, f64) {
    let root = (k / peak).sqrt();
    let gamma = if age <= 1.0 { 1.7 } else { 1.7 + 6.0 * age.log10() };
    let sigma = 0.08 * (1.0 + 4.0 * age.powi(-3));
    let shape = (-1.25 * (peak / k).powi(2)).exp()
        * gamma.powf((-(root - 1.0).powi(2) / (2.0 * sigma * sigma)).exp());
    let tail = (-age / 10f64.sqrt() * (root - 1.0)).exp();
    (0.5 * 6e-3 * age.sqrt() * phase_speed(peak) / phase_speed(k) * shape * tail, shape)
}

/// Elfouhaily's contrast between up and across the wind (eq. 57) of waves of `k` rad/m, for a peak at `peak` rad/m.
fn contrast(k: f64, peak: f64, wind_m_s: f64) -> f64 {
    let (c, cp) = (phase_speed(k), phase_speed(peak));
    let short = 0.13 * friction_velocity(wind_m_s) / C_SLOWEST;
    (LN_2 / 4.0 + 4.0 * (c / cp).powf(2.5) + short * (C_SLOWEST / c).powf(2.5)).tanh()
}

impl Spectrum {
    /// A sea under `wind_m_s` from `wind_from`.
    pub fn new(wind_m_s: f64, wind_from: f64, long: LongWaves) -> Self {
        let jonswap_scale = match long {
            LongWaves::Jonswap { height_m, period_s, gamma } => {
                let peak = TAU / period_s;
                let step = 1e-3 * peak;
                let m0: f64 =
                    (1..20_000).map(|i| jonswap(f64::from(i) * step + 0.2 * peak, peak, gamma) * step).sum();
                height_m * height_m / 16.0 / m0
            }
            _ => 1.0,
        };
        let mut spectrum = Self { wind_m_s, wind_from, long, jonswap_scale, damped_above: f64::INFINITY };
        spectrum.damp();
        spectrum
    }

    /// Elfouhaily's spectrum holds more slope than was ever observed under winds below 4 m/s, which do not raise short waves. There it is
    /// damped by exp(-k / k_d) with the k_d that leaves the total of Cox & Munk.
    fn damp(&mut self) {
        let (up, across) = cox_munk(self.wind_m_s);
        let total = |s: &Self| {
            let (along, across) = s.slope_variances(s.peak() / 30.0, SHORTEST_K);
            along + across
        };
        if total(self) <= up + across {
            return;
        }
        let (mut low, mut high) = (self.peak().ln(), SHORTEST_K.ln() + 3.0);
        for _ in 0..40 {
            let middle = (low + high) / 2.0;
            self.damped_above = middle.exp();
            if total(self) > up + across { high = middle } else { low = middle }
        }
        self.damped_above = low.exp();
    }

    /// Wave number of the highest waves, rad/m; infinite where there are none.
    pub fn peak(&self) -> f64 {
        match self.long {
            LongWaves::Flat => f64::INFINITY,
            LongWaves::Elfouhaily { inverse_wave_age } => {
                GRAVITY * (inverse_wave_age / self.wind_m_s.max(1e-3)).powi(2)
            }
            LongWaves::Jonswap { period_s, .. } => (TAU / period_s).powi(2) / GRAVITY,
        }
    }

    /// Curvature spectrum k^3 S(k) of all directions together (eq. 30).
    fn curvature(&self, k: f64) -> f64 {
        let kp = self.peak();
        if !kp.is_finite() {
            return 0.0;
        }
        let (long, shape) = match self.long {
            LongWaves::Flat => return 0.0,
            LongWaves::Elfouhaily { inverse_wave_age } => elfouhaily_long(k, kp, inverse_wave_age),
            LongWaves::Jonswap { period_s, gamma, .. } => {
                let omega = (GRAVITY * k).sqrt();
                let s = self.jonswap_scale * jonswap(omega, TAU / period_s, gamma) * GRAVITY / (2.0 * omega);
                let root = (k / kp).sqrt();
                // The tail of JONSWAP was never measured beyond three times the peak's frequency; from there Elfouhaily's decay.
                let tail = if root > 3.0 { (-0.27 * (root - 3.0)).exp() } else { 1.0 };
                (s * k.powi(3) * tail, (-1.25 * (kp / k).powi(2)).exp())
            }
        };
        // eq. 40 with 44: short waves.
        let friction = friction_velocity(self.wind_m_s) / C_SLOWEST;
        let rate = if friction < 1.0 { 1.0 } else { 3.0 };
        let alpha = 1e-2 * (1.0 + rate * friction.max(1e-9).ln()).max(0.0);
        let short =
            0.5 * alpha * C_SLOWEST / phase_speed(k) * (-0.25 * (k / K_SLOWEST - 1.0).powi(2)).exp() * shape;
        (long + short) * (-k / self.damped_above).exp()
    }

    /// Height spectrum over wave number, all directions, m^3: its integral is the variance of the height.
    pub fn omnidirectional(&self, k: f64) -> f64 {
        self.curvature(k) / k.powi(3)
    }

    /// Upwind-crosswind contrast of the spreading (eq. 57).
    pub fn contrast(&self, k: f64) -> f64 {
        contrast(k, self.peak(), self.wind_m_s)
    }

    /// Height spectrum over the plane of wave numbers, m^4, for waves that run `angle` radians off the wind (eq. 67, folded onto
    /// the half plane into which the wind blows, since wind waves run with the wind).
    pub fn directional(&self, k: f64, angle: f64) -> f64 {
        if k <= 0.0 || angle.cos() <= 0.0 || !self.peak().is_finite() {
            return 0.0;
        }
        self.omnidirectional(k) / k * (1.0 + self.contrast(k) * (2.0 * angle).cos()) / PI
    }

    /// Unit vector (east, north) into which the wind blows.
    pub fn downwind(&self) -> glam::DVec2 {
        -glam::DVec2::new(self.wind_from.sin(), self.wind_from.cos())
    }

    /// Variance of the height between two wave numbers, m^2.
    pub fn height_variance(&self, from: f64, to: f64) -> f64 {
        integrate_log(from, to, 4000, |k| self.omnidirectional(k))
    }

    /// Mean square slopes between two wave numbers, (along the wind, across it).
    pub fn slope_variances(&self, from: f64, to: f64) -> (f64, f64) {
        if !self.peak().is_finite() {
            return (0.0, 0.0);
        }
        let total = integrate_log(from, to, 4000, |k| self.omnidirectional(k) * k * k);
        let lean =
            integrate_log(from, to, 4000, |k| self.omnidirectional(k) * k * k * self.contrast(k) / 2.0);
        ((total + lean) / 2.0, (total - lean) / 2.0)
    }

    /// Significant wave height: four standard deviations of the height, metres.
    pub fn significant_height_m(&self) -> f64 {
        if !self.peak().is_finite() {
            return 0.0;
        }
        4.0 * self.height_variance(self.peak() / 30.0, SHORTEST_K).sqrt()
    }
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
pub struct WindSea {
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
        let target: f64 = cox_munk_fits(wind).iter().sum();
        let (mut low, mut high) = (-4.0, 2.0);
        for _ in 0..50 {
            sea.tail_power = 0.5 * (low + high);
            if sea.slope_variance(CUTOFF_K) < target {
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
    /// (Elfouhaily's long waves).
    pub fn omnidirectional(&self, k: f64) -> f64 {
        if k <= 0.0 {
            return 0.0;
        }
        let (curvature, _) = elfouhaily_long(k, self.peak, INVERSE_WAVE_AGE);
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
        let delta = contrast(k, self.peak, self.wind);
        (1.0 + delta * (2.0 * angle).cos()) * (1.0 + 0.9 * angle.cos()) / TAU
    }

    /// Mean square slope of all waves up to wavenumber `k_max`.
    pub fn slope_variance(&self, k_max: f64) -> f64 {
        self.moment(k_max, 2)
    }

    /// Significant wave height, metres: four standard deviations.
    pub fn significant_height(&self) -> f64 {
        4.0 * self.moment(CUTOFF_K, 0).sqrt()
    }

    fn moment(&self, k_max: f64, power: i32) -> f64 {
        integrate_log(self.peak / 20.0, k_max, 800, |k| self.omnidirectional(k) * k.powi(power))
    }
}

impl Swell {
    /// Wavenumber of the peak, rad/m.
    pub fn peak(&self) -> f64 {
        (TAU / self.period_s).powi(2) / GRAVITY
    }

    /// Relative weight of a wave (`east`, `north` rad/m) on a lattice with spacing `lattice` rad/m: narrow in wavenumber
    /// and direction, but not so narrow that it falls between the lattice's points.
    pub fn weight(&self, east: f64, north: f64, lattice: f64) -> f64 {
        let peak = self.peak();
        let towards = self.from + PI;
        let (ce, cn) = (peak * towards.sin(), peak * towards.cos());
        let along = ((east - ce) * ce + (north - cn) * cn) / peak;
        let across = ((east - ce) * cn - (north - cn) * ce) / peak;
        let (sa, sc) = ((0.12 * peak).max(0.6 * lattice), (0.2 * peak).max(0.6 * lattice));
        (-0.5 * ((along / sa).powi(2) + (across / sc).powi(2))).exp()
    }
}

/// Integral of `f` from `from` to `to`, by the midpoints of `steps` equal steps of the logarithm.
fn integrate_log(from: f64, to: f64, steps: u32, f: impl Fn(f64) -> f64) -> f64 {
    if !(from > 0.0 && to > from) {
        return 0.0;
    }
    let step = (to / from).ln() / f64::from(steps);
    (0..steps)
        .map(|i| {
            let k = from * ((f64::from(i) + 0.5) * step).exp();
            f(k) * k * step
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ocean::table;

    #[test]
    fn slopes_are_those_of_cox_and_munk() {
        let text = include_str!("../../data/cox_munk.csv");
        let mut rows = 0;
        for c in table::rows(text) {
            if c[0] < 1.0 {
                continue; // no wind, no spectrum
            }
            let [up, cross] = cox_munk_fits(c[0]);
            assert!((up - c[3]).abs() < 1e-9 && (cross - c[2]).abs() < 1e-9);
            let got = WindSea::new(c[0]).slope_variance(CUTOFF_K);
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
