//! Waves of one sea: a sum of long-crested waves on deep water.

use std::f64::consts::TAU;

use glam::DVec2;
use rand::RngExt;
use rand_pcg::Pcg64;

use super::{WaveSpec, spectrum::spread_quantile};
use crate::physics::GRAVITY_M_S2;

/// Waves that a sea is made of. Each carries the same energy, at the root mean square frequency of its share of the spectrum.
const COMPONENTS: usize = 32;
/// Stream of the random numbers, so that other users of the same seed draw others.
const STREAM: u128 = 0x5ea;
/// Conjugate golden ratio: its multiples modulo 1 fill the unit interval evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// Time in which a sea goes over into another, seconds.
pub const CHANGE_S: f64 = 15.0;

/// A sea surface, the same for the same specification and seed. The surface is linear (no sharpened crests).
#[derive(Clone, Debug, PartialEq)]
pub struct WaveField {
    waves: Vec<Wave>,
    before: Option<Before>,
}

/// The sea that went before.
#[derive(Clone, Debug, PartialEq)]
struct Before {
    waves: Vec<Wave>,
    /// When it begins to fade.
    until_s: f64,
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
    pub const FLAT: Self = Self { waves: Vec::new(), before: None };

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
        let variance = spectrum.significant_height_m().powi(2) / 16.0;
        let amplitude_m = (2.0 * variance / n).sqrt();
        let spread_start: f64 = rng.random();
        let waves = spectrum.shares_rad_s(components).into_iter().enumerate().map(|(i, omega)| {
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
        Self::of(waves.collect())
    }

    /// A sea of just these waves.
    pub fn of(waves: Vec<Wave>) -> Self {
        Self { waves, before: None }
    }

    /// This sea up to `from_s`, which then goes over into the waves of `next` within [`CHANGE_S`]. Meanwhile both are there, their
    /// energies in shares that make one: a sea that grows or turns while its waves run on. What was left of a sea before this one is
    /// gone, so let one change end before the next.
    #[must_use]
    pub fn changing_to(self, next: Self, from_s: f64) -> Self {
        Self { waves: next.waves, before: Some(Before { waves: self.waves, until_s: from_s }) }
    }

    /// The waves that it is made of; of a sea that changes, those to which it changes.
    pub fn waves(&self) -> &[Wave] {
        &self.waves
    }

    /// The waves that are there at a time, each with the factor of its amplitude.
    pub fn waves_at(&self, time_s: f64) -> impl Iterator<Item = (f64, &Wave)> {
        let share = self.before.as_ref().map_or(1.0, |b| ((time_s - b.until_s) / CHANGE_S).clamp(0.0, 1.0));
        // Squares that sum to one, and no kink at either end.
        let turn = share * share * (3.0 - 2.0 * share) * std::f64::consts::FRAC_PI_2;
        let fading = self.before.iter().filter(move |_| share < 1.0).flat_map(|b| &b.waves);
        let rising = self.waves.iter().filter(move |_| share > 0.0);
        let (new, old) = if self.before.is_none() || share >= 1.0 { (1.0, 0.0) } else { turn.sin_cos() };
        fading.map(move |w| (old, w)).chain(rising.map(move |w| (new, w)))
    }

    /// Whether there are no waves at all, now or before.
    pub fn is_flat(&self) -> bool {
        self.waves.is_empty() && self.before.as_ref().is_none_or(|b| b.waves.is_empty())
    }

    /// No water is ever higher than this above mean sea level, metres (nor lower than its negative).
    pub fn crest_max_m(&self) -> f64 {
        let before = self.before.iter().flat_map(|b| &b.waves);
        self.waves.iter().chain(before).map(|w| w.amplitude_m).sum()
    }

    /// Height of the water above mean sea level at a place (world x, y) and time, metres.
    pub fn height(&self, position: DVec2, time_s: f64) -> f64 {
        self.waves_at(time_s).map(|(f, w)| f * w.amplitude_m * w.phase(position, time_s).cos()).sum()
    }

    /// Rise of the water per metre east (x) and north (y).
    pub fn slope(&self, position: DVec2, time_s: f64) -> DVec2 {
        let slope = |(f, w): (f64, &Wave)| {
            w.cycles_per_m * (-TAU * f * w.amplitude_m * w.phase(position, time_s).sin())
        };
        self.waves_at(time_s).map(slope).sum()
    }

    /// The mean height of the water over places at a time, for a rectangle `length_m` by `beam_m` whose long side points to the north: what
    /// [`Self::plane_under`] has as height, to a ten-billionth of the waves' height. All that does not depend on the place is worked out once.
    pub fn level_over(&self, length_m: f64, beam_m: f64, time_s: f64) -> WaterLevel {
        let mut level = WaterLevel::default();
        for (i, (factor, wave)) in self.waves_at(time_s).enumerate() {
            let k = wave.cycles_per_m * TAU;
            let [along, across] = [k.dot(DVec2::Y) * length_m / 2.0, k.dot(DVec2::Y.perp()) * beam_m / 2.0]
                .map(|a| filters(a)[0]);
            if i % WAVE_LANES == 0 {
                level.waves.push(WaveLanes::default());
            }
            if let Some(lanes) = level.waves.last_mut() {
                let lane = i % WAVE_LANES;
                lanes.amplitude_m[lane] = factor * wave.amplitude_m * along * across;
                [lanes.east[lane], lanes.north[lane]] = wave.cycles_per_m.to_array();
                lanes.phase[lane] = wave.phase - fraction(wave.hz * time_s);
            }
        }
        level
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
        for (factor, wave) in self.waves_at(time_s) {
            let amplitude_m = factor * wave.amplitude_m;
            let (sin, cos) = wave.phase(centre, time_s).sin_cos();
            let k = wave.cycles_per_m * TAU;
            let (k_forward, k_port) = (k.dot(forward), k.dot(port));
            let (along, across) = (k_forward * length_m / 2.0, k_port * beam_m / 2.0);
            let ([mean_along, slope_along], [mean_across, slope_across]) = (filters(along), filters(across));
            plane.height_m += amplitude_m * cos * mean_along * mean_across;
            plane.forward_slope -= amplitude_m * sin * k_forward * slope_along * mean_across;
            plane.port_slope -= amplitude_m * sin * k_port * slope_across * mean_along;
        }
        plane
    }
}

/// Waves that are summed side by side.
const WAVE_LANES: usize = 4;

/// Some waves at one time.
#[derive(Clone, Copy, Debug, Default)]
struct WaveLanes {
    amplitude_m: [f64; WAVE_LANES],
    /// Waves a metre.
    east: [f64; WAVE_LANES],
    north: [f64; WAVE_LANES],
    /// At the origin, in cycles.
    phase: [f64; WAVE_LANES],
}

/// The level of the water at one time, for many places.
#[derive(Clone, Debug, Default)]
pub struct WaterLevel {
    waves: Vec<WaveLanes>,
}

impl WaterLevel {
    /// At a place (world x, y), metres above mean sea level.
    pub fn at(&self, place: DVec2) -> f64 {
        let mut sum = [0.0; WAVE_LANES];
        for waves in &self.waves {
            for (i, sum) in sum.iter_mut().enumerate() {
                let cycles = waves.east[i] * place.x + waves.north[i] * place.y + waves.phase[i];
                *sum += waves.amplitude_m[i] * cosine_of_cycles(cycles);
            }
        }
        sum.iter().sum()
    }
}

/// The cosine of an angle in whole turns, of which there are less than 2^51, to 1e-10: Taylor's series over half a turn to each side. Without a
/// branch or a call, so that several are worked out at once.
#[inline(always)]
fn cosine_of_cycles(cycles: f64) -> f64 {
    /// Numbers of this size have no digits behind the point: adding it rounds.
    const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;
    /// (-1)^k (2 pi)^2k / (2k)!, from the last to the first.
    const TERMS: [f64; 11] = {
        let mut terms = [1.0; 11];
        let mut k = 1;
        while k < 11 {
            let n = 2.0 * k as f64;
            terms[10 - k] = -terms[11 - k] * TAU * TAU / (n * (n - 1.0));
            k += 1;
        }
        terms
    };
    let part = cycles - ((cycles + WHOLE) - WHOLE);
    let square = part * part;
    TERMS.iter().fold(0.0, |sum, term| sum * square + term)
}

/// Mean of cos over -a to a, and the slope of the line that fits sin best there: 3 (sin a - a cos a) / a^3.
fn filters(a: f64) -> [f64; 2] {
    let (sin, cos) = a.sin_cos();
    let mean = if a.abs() < 1e-4 { 1.0 - a * a / 6.0 } else { sin / a };
    // The difference cancels for small a; the series is then exact to rounding.
    let slope = if a.abs() < 1e-2 {
        1.0 - a * a / 10.0 + a.powi(4) / 280.0
    } else {
        3.0 * (sin - a * cos) / a.powi(3)
    };
    [mean, slope]
}

#[cfg(test)]
#[path = "field_tests.rs"]
mod tests;
