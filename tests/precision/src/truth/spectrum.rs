//! How the energy and the slopes of the sea are spread over wave number and direction.
//!
//! Elfouhaily, Chapron, Katsaros & Vandemark 1997 (J. Geophys. Res. 102, C7), equation numbers below; Hasselmann et al. 1973
//! (JONSWAP); Cox & Munk 1954. Wave numbers in rad/m, winds 10 m above the sea in m/s.

use std::f64::consts::{PI, TAU};

/// Standard gravity, m/s^2.
pub const GRAVITY: f64 = 9.806_65;
/// Wave number of the slowest gravity-capillary wave, rad/m (eq. 24: sqrt(rho g / surface tension)).
const K_SLOWEST: f64 = 370.0;
/// Speed of the slowest gravity-capillary wave, m/s (eq. 41).
const C_SLOWEST: f64 = 0.23;
/// Beyond this wave number, rad/m, there are no waves.
pub const SHORTEST_K: f64 = 1e4;
/// Phillips' constant of JONSWAP and Pierson-Moskowitz.
pub const PHILLIPS: f64 = 0.0081;

/// What raised the long waves.
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

/// Mean square slopes of a clean sea, (upwind axis, crosswind axis), for the wind at 10 m. Cox & Munk 1954: total 0.003 + 0.00512 W,
/// crosswind 0.003 + 0.00192 W with W at 12.5 m. Their two axes are separate fits that cross below 2.4 m/s; there the axes are taken
/// equal, since no sea is rougher across the wind than along it.
pub fn cox_munk(wind_m_s: f64) -> (f64, f64) {
    // Logarithmic profile over the drag above.
    let w = wind_m_s + friction_velocity(wind_m_s) / 0.4 * (12.5f64 / 10.0).ln();
    let total = 0.003 + 0.005_12 * w;
    let up = (0.003_16 * w).max(total / 2.0);
    (up, total - up)
}

/// JONSWAP energy by frequency, m^2 s, with Phillips' constant, for a peak at `peak` rad/s (Hasselmann 1973).
pub fn jonswap(omega: f64, peak: f64, gamma: f64) -> f64 {
    let x = omega / peak;
    let sigma = if x <= 1.0 { 0.07 } else { 0.09 };
    let enhanced = gamma.powf((-((x - 1.0) / sigma).powi(2) / 2.0).exp());
    PHILLIPS * GRAVITY * GRAVITY * omega.powi(-5) * (-1.25 * x.powi(-4)).exp() * enhanced
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
            LongWaves::Elfouhaily { inverse_wave_age: age } => {
                let root = (k / kp).sqrt();
                let gamma = if age <= 1.0 { 1.7 } else { 1.7 + 6.0 * age.log10() };
                let sigma = 0.08 * (1.0 + 4.0 * age.powi(-3));
                // eq. 2 and 3: Pierson-Moskowitz cut and peak; eq. 32: long waves die out above the peak.
                let shape = (-1.25 * (kp / k).powi(2)).exp()
                    * gamma.powf((-(root - 1.0).powi(2) / (2.0 * sigma * sigma)).exp());
                let tail = (-age / 10f64.sqrt() * (root - 1.0)).exp();
                let long = 0.5 * 6e-3 * age.sqrt() * phase_speed(kp) / phase_speed(k) * shape * tail;
                (long, shape)
            }
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
        let (c, cp) = (phase_speed(k), phase_speed(self.peak()));
        let short = 0.13 * friction_velocity(self.wind_m_s) / C_SLOWEST;
        (2f64.ln() / 4.0 + 4.0 * (c / cp).powf(2.5) + short * (C_SLOWEST / c).powf(2.5)).tanh()
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
        integrate_log(from, to, |k| self.omnidirectional(k))
    }

    /// Mean square slopes between two wave numbers, (along the wind, across it).
    pub fn slope_variances(&self, from: f64, to: f64) -> (f64, f64) {
        if !self.peak().is_finite() {
            return (0.0, 0.0);
        }
        let total = integrate_log(from, to, |k| self.omnidirectional(k) * k * k);
        let lean = integrate_log(from, to, |k| self.omnidirectional(k) * k * k * self.contrast(k) / 2.0);
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

/// Integral of `f` from `from` to `to`, midpoints of equal steps of the logarithm.
fn integrate_log(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
    const STEPS: u32 = 4000;
    if !(from > 0.0 && to > from) {
        return 0.0;
    }
    let step = (to / from).ln() / f64::from(STEPS);
    (0..STEPS)
        .map(|i| {
            let k = from * ((f64::from(i) + 0.5) * step).exp();
            f(k) * k * step
        })
        .sum()
}
