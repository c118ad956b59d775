//! Waves of one sea: a sum of long-crested waves on deep water.

use std::f64::consts::TAU;

use glam::DVec2;
use rand::RngExt;
use rand_pcg::Pcg64;

use super::{WaveSpec, spectrum::spread_quantile};
use crate::gunnery::GRAVITY_M_S2;

/// Waves that a sea is made of. Each carries the same energy.
const COMPONENTS: usize = 32;
/// Stream of the random numbers, so that other users of the same seed draw others.
const STREAM: u128 = 0x5ea;
/// Conjugate golden ratio: its multiples modulo 1 fill the unit interval evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// A sea surface, the same for the same specification and seed. The surface is linear (no sharpened crests).
#[derive(Clone, Debug, PartialEq)]
pub struct WaveField {
    waves: Vec<Wave>,
}

/// One long-crested wave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// Half its height, metres.
    pub amplitude_m: f64,
    /// Where it runs (world x, y), waves a metre.
    pub cycles_per_m: DVec2,
    /// Waves a second.
    pub hz: f64,
    /// Phase at the origin and time 0, in cycles; 0 is a crest.
    pub phase: f64,
}

impl Wave {
    /// Phase at a place and time, radians between 0 and 2 pi (rounding apart).
    ///
    /// Whole cycles are taken off each product before they meet, so that a place kilometres away and a time of days lose no
    /// more digits than the product itself.
    pub fn phase(&self, position: DVec2, time_s: f64) -> f64 {
        let cycles = fraction(self.cycles_per_m.x * position.x) + fraction(self.cycles_per_m.y * position.y)
            - fraction(self.hz * time_s)
            + self.phase;
        TAU * fraction(cycles)
    }
}

fn fraction(cycles: f64) -> f64 {
    cycles - cycles.floor()
}

/// The plane that fits the water under a hull best.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WaterPlane {
    /// Mean height of the water over the hull's rectangle, metres.
    pub height_m: f64,
    /// Rise per metre towards the bow.
    pub forward_slope: f64,
    /// Rise per metre towards port.
    pub port_slope: f64,
}

impl WaveField {
    /// No waves.
    pub const FLAT: Self = Self { waves: Vec::new() };

    /// The sea of `spec`. Its mean square height is exactly that of the specification.
    pub fn new(spec: &WaveSpec, seed: u64) -> Self {
        Self::with_components(spec, seed, COMPONENTS)
    }

    /// The sea of `spec` as a sum of so many waves: the more, the closer its statistics are to those of the specification.
    pub fn with_components(spec: &WaveSpec, seed: u64, components: usize) -> Self {
        let spectrum = &spec.spectrum;
        if spectrum.significant_height_m() <= 0.0 || !spec.wind_from.is_finite() {
            return Self::FLAT;
        }
        let mut rng = Pcg64::new(u128::from(seed), STREAM);
        let n = components as f64;
        let shares: Vec<f64> = (0..components).map(|i| (i as f64 + rng.random::<f64>()) / n).collect();
        let variance = spectrum.significant_height_m().powi(2) / 16.0;
        let amplitude_m = (2.0 * variance / n).sqrt();
        let spread_start: f64 = rng.random();
        let waves = spectrum.quantiles_rad_s(&shares).into_iter().enumerate().map(|(i, omega)| {
            let side = fraction(spread_start + GOLDEN * i as f64);
            let from = spec.wind_from + spread_quantile(omega / spectrum.peak_rad_s(), side);
            let towards = -DVec2::new(from.sin(), from.cos());
            // Deep water: omega^2 = g k.
            let wavenumber = omega * omega / GRAVITY_M_S2;
            Wave {
                amplitude_m,
                cycles_per_m: towards * (wavenumber / TAU),
                hz: omega / TAU,
                phase: rng.random(),
            }
        });
        Self { waves: waves.collect() }
    }

    /// A sea of just these waves.
    pub fn of(waves: Vec<Wave>) -> Self {
        Self { waves }
    }

    /// The waves that it is made of.
    pub fn waves(&self) -> &[Wave] {
        &self.waves
    }

    /// Whether there are no waves at all.
    pub fn is_flat(&self) -> bool {
        self.waves.is_empty()
    }

    /// No water is ever higher than this above mean sea level, metres (nor lower than its negative).
    pub fn crest_max_m(&self) -> f64 {
        self.waves.iter().map(|w| w.amplitude_m).sum()
    }

    /// Height of the water above mean sea level at a place (world x, y) and time, metres.
    pub fn height(&self, position: DVec2, time_s: f64) -> f64 {
        self.waves.iter().map(|w| w.amplitude_m * w.phase(position, time_s).cos()).sum()
    }

    /// Rise of the water per metre east (x) and north (y).
    pub fn slope(&self, position: DVec2, time_s: f64) -> DVec2 {
        let slope = |w: &Wave| w.cycles_per_m * (-TAU * w.amplitude_m * w.phase(position, time_s).sin());
        self.waves.iter().map(slope).sum()
    }

    /// The plane that fits the water best (least squares) over the rectangle `length_m` by `beam_m` about `centre`, whose long
    /// side points `heading` (radians clockwise from north).
    ///
    /// The fit to a sine over a rectangle has a closed form, so waves shorter than the hull cancel without any sampling.
    pub fn plane_under(
        &self,
        centre: DVec2,
        heading: f64,
        length_m: f64,
        beam_m: f64,
        time_s: f64,
    ) -> WaterPlane {
        let forward = DVec2::new(heading.sin(), heading.cos());
        let port = forward.perp();
        let mut plane = WaterPlane::default();
        for wave in &self.waves {
            let (sin, cos) = wave.phase(centre, time_s).sin_cos();
            let k = wave.cycles_per_m * TAU;
            let (k_forward, k_port) = (k.dot(forward), k.dot(port));
            let (along, across) = (k_forward * length_m / 2.0, k_port * beam_m / 2.0);
            let (mean_along, mean_across) = (mean_filter(along), mean_filter(across));
            plane.height_m += wave.amplitude_m * cos * mean_along * mean_across;
            plane.forward_slope -= wave.amplitude_m * sin * k_forward * slope_filter(along) * mean_across;
            plane.port_slope -= wave.amplitude_m * sin * k_port * slope_filter(across) * mean_along;
        }
        plane
    }
}

/// Mean of cos over -a to a.
fn mean_filter(a: f64) -> f64 {
    if a.abs() < 1e-4 { 1.0 - a * a / 6.0 } else { a.sin() / a }
}

/// Slope of the line that fits sin best over -a to a: 3 (sin a - a cos a) / a^3.
fn slope_filter(a: f64) -> f64 {
    // The difference cancels for small a; the series is then exact to rounding.
    if a.abs() < 1e-2 {
        1.0 - a * a / 10.0 + a.powi(4) / 280.0
    } else {
        3.0 * (a.sin() - a * a.cos()) / a.powi(3)
    }
}

#[cfg(test)]
#[path = "waves_tests.rs"]
mod tests;
