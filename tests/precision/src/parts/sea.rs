//! How many waves a sea needs.

use std::f64::consts::{PI, TAU};

use anyhow::{Context, Result};
use bowwave_core::{
    physics::GRAVITY_M_S2,
    world::waves::{Spectrum, Wave, WaveField, WaveSpec},
};
use glam::DVec2;

use super::{About, even, rms, table, worst};
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "sea",
    what: "Makes a sea of a spectrum: a sum of so many long-crested waves, whose height is asked for at boats and strikes.",
    truth: "the spectrum's moments in closed form and by quadrature made elsewhere (daemon/core/data/wave_spectra_moments.csv), a \
            Gaussian sea's tail in closed form against the exact distribution of a sum of sines of random phase (product of Bessel \
            functions, quadrature here), slopes of Cox and Munk (data/cox_munk.csv)",
    rivals: "fewer and more waves of equal energy at their shares' root mean square frequency, as the product takes them; at random \
             within their shares; and in equal steps of frequency, which is the textbook's way",
    why: "32 waves of equal energy: errors fall with the number while time grows with it. 32 keep the heights within a per cent \
          and, at the root mean square frequency of each share, the period within two, which nobody sees. Equal steps repeat \
          themselves after one over the step",
};

const MOMENTS: &str = include_str!("../../../../daemon/core/data/wave_spectra_moments.csv");
const COX_MUNK: &str = include_str!("../../data/cox_munk.csv");
const COUNTS: [usize; 6] = [8, 16, 32, 64, 128, 512];
const DEFAULT: usize = 32;
const SEEDS: u64 = 8;

/// One way to make a sea of a number of waves.
type Make = fn(&WaveSpec, u64, usize) -> WaveField;

const METHODS: [(&str, Make); 3] = [
    ("equal energy, rms frequency", WaveField::with_components),
    ("equal energy, at random", at_random),
    ("equal steps of frequency", equal_steps),
];

/// Equal shares of the energy of a Pierson-Moskowitz sea, 0.4 to 6 peaks, each at a frequency drawn from within it.
fn at_random(spec: &WaveSpec, seed: u64, count: usize) -> WaveField {
    // The energy below x peaks is exp(-1.25 / x^4), and this its inverse.
    let below = |x: f64| (-1.25 / x.powi(4)).exp();
    let inverse = |share: f64| {
        let energy = below(0.4) + share * (below(6.0) - below(0.4));
        (1.25 / -energy.ln()).powf(0.25)
    };
    let hz = (0..count).map(|i| {
        let within = even(seed * 20_011 + 7 * i as u64 + 3);
        inverse((i as f64 + within) / count as f64) / spec.spectrum.peak_period_s()
    });
    let amplitude_m = spec.spectrum.significant_height_m() / 4.0 * (2.0 / count as f64).sqrt();
    long_crested(spec, seed, hz.map(|hz| (hz, amplitude_m)))
}

/// Waves of these frequencies and amplitudes along the wind, with random phases.
fn long_crested(spec: &WaveSpec, seed: u64, waves: impl Iterator<Item = (f64, f64)>) -> WaveField {
    let towards = -DVec2::new(spec.wind_from.sin(), spec.wind_from.cos());
    let wave = |(i, (hz, amplitude_m)): (usize, (f64, f64))| Wave {
        amplitude_m,
        cycles_per_m: towards * (TAU * hz * hz / GRAVITY_M_S2),
        hz,
        phase: even(seed * 10_007 + i as u64),
    };
    WaveField::of(waves.enumerate().map(wave).collect())
}

/// The textbook's sea: equal steps of frequency over the product's band (0.4 to 6 peaks), random phases, all along the wind.
fn equal_steps(spec: &WaveSpec, seed: u64, count: usize) -> WaveField {
    let peak = 1.0 / spec.spectrum.peak_period_s();
    let step = 5.6 / count as f64;
    let density: Vec<f64> = (0..count).map(|i| shape(0.4 + (i as f64 + 0.5) * step)).collect();
    let total: f64 = density.iter().sum();
    let variance = spec.spectrum.significant_height_m().powi(2) / 16.0;
    let waves = density
        .iter()
        .enumerate()
        .map(|(i, s)| ((0.4 + (i as f64 + 0.5) * step) * peak, (2.0 * variance * s / total).sqrt()));
    long_crested(spec, seed, waves)
}

/// Shape of the Pierson-Moskowitz spectrum over frequency in peaks, not normalised.
fn shape(x: f64) -> f64 {
    x.powi(-5) * (-1.25 / x.powi(4)).exp()
}

fn moment(waves: &[Wave], n: i32) -> f64 {
    waves.iter().map(|w| 0.5 * w.amplitude_m.powi(2) * (TAU * w.hz).powi(n)).sum()
}

/// Mean square slope, from the wave numbers.
fn slope_variance(waves: &[Wave]) -> f64 {
    waves.iter().map(|w| 0.5 * w.amplitude_m.powi(2) * (TAU * w.cycles_per_m.length()).powi(2)).sum()
}

/// Bessel's J0 by its integral; the midpoint rule is exact to rounding for arguments below 10, and none is greater.
fn bessel_j0(x: f64) -> f64 {
    (0..24).map(|i| (x * ((f64::from(i) + 0.5) * PI / 24.0).sin()).cos()).sum::<f64>() / 24.0
}

/// Share of the water higher than two standard deviations, for random phases: Gil-Pelaez's inversion of the product of the
/// waves' characteristic functions.
fn share_beyond_two(waves: &[Wave]) -> f64 {
    let sigma = moment(waves, 0).sqrt();
    let step = 0.05 / sigma;
    let mut sum = 0.0;
    for i in 0..160 {
        let t = (f64::from(i) + 0.5) * step;
        let cf: f64 = waves.iter().map(|w| bessel_j0(w.amplitude_m * t)).product();
        sum += (2.0 * sigma * t).sin() / t * cf * step;
    }
    0.5 - sum / PI
}

/// The same of a Gaussian sea: 1 - Phi(2).
const GAUSSIAN_BEYOND_TWO: f64 = 0.022_750_131_948_179_2;

/// Root mean square correlation of the water's height with itself 20 to 300 peak periods later, where a sea has forgotten.
fn memory(waves: &[Wave], peak_period_s: f64) -> f64 {
    let m0 = moment(waves, 0);
    rms((0..1400).map(|i| {
        let lag = (20.0 + 0.2 * f64::from(i)) * peak_period_s;
        waves.iter().map(|w| 0.5 * w.amplitude_m.powi(2) * (TAU * w.hz * lag).cos()).sum::<f64>() / m0
    }))
}

fn spec(height_m: f64, period_s: f64, gamma: f64) -> Result<WaveSpec> {
    let spectrum = Spectrum::jonswap(height_m, period_s, gamma).context("a sea out of range")?;
    Ok(WaveSpec { spectrum, wind_from: 0.7 })
}

/// Error of a way to make a sea, over the seeds.
type SeaError<'a> = &'a dyn Fn(&dyn Fn(u64) -> WaveField) -> f64;

fn scene(
    bench: &mut PartBench,
    name: &str,
    unit: &'static str,
    sea: &WaveSpec,
    excuse: &str,
    judge: SeaError<'_>,
) {
    // Many places, so that no processor learns them by heart.
    let places: Vec<DVec2> = (0..256).map(|i| DVec2::new(even(2 * i), even(2 * i + 1)) * 2000.0).collect();
    let places = &places;
    let mut ways = Vec::new();
    for (method, make) in METHODS {
        for count in COUNTS {
            let error = judge(&|seed| make(sea, seed, count));
            let field = make(sea, 1, count);
            let bytes = count * size_of::<Wave>();
            let work = move || places.iter().map(|p| field.height(*p, 12.0)).sum::<f64>();
            let default = count == DEFAULT && method == METHODS[0].0;
            let way = Way::new(method, &count.to_string(), error, places.len(), work).holds(bytes);
            ways.push(if default { way.default_although(excuse) } else { way });
        }
    }
    bench.scene(name, unit, 0.0, ways);
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let sea = spec(1.44, 6.0, 1.0)?;
    scene(bench, "share of water beyond two standard deviations", "relative", &sea, "", &|make| {
        rms((0..SEEDS).map(|seed| share_beyond_two(make(seed).waves()) / GAUSSIAN_BEYOND_TWO - 1.0))
    });
    let excuse = "frequencies drawn at random forget a hundredth better, but the period is then wrong by 4 %";
    scene(
        bench,
        "correlation after 20 to 300 periods, where a sea has forgotten",
        "1",
        &sea,
        excuse,
        &|make| rms((0..SEEDS).map(|seed| memory(make(seed).waves(), 6.0))),
    );
    let rows: Vec<Vec<f64>> = table(MOMENTS).into_iter().filter(|r| r[1] == 1.0).collect();
    let excuse = "what is left is the energy beyond six peaks; equal steps come nearer by their edges but repeat themselves";
    scene(bench, "mean zero-crossing period, Pierson-Moskowitz", "relative", &sea, excuse, &|make| {
        // All periods of the table scale alike: each stands for the others.
        rms((0..SEEDS).flat_map(|seed| {
            let waves = make(seed);
            let period = TAU * (moment(waves.waves(), 0) / moment(waves.waves(), 2)).sqrt();
            rows.iter().map(move |row| (period / 6.0) / (row[5] / row[0]) - 1.0)
        }))
    });
    peaked(bench)?;
    slopes(bench)
}

/// Peaked spectra: the product's number of waves, and others.
fn peaked(bench: &mut PartBench) -> Result<()> {
    for gamma in [3.3, 7.0] {
        let rows: Vec<Vec<f64>> = table(MOMENTS).into_iter().filter(|r| r[1] == gamma).collect();
        let mut tried = Vec::new();
        for count in COUNTS {
            let mut errors = Vec::new();
            for row in &rows {
                let sea = spec(row[3], row[0], gamma)?;
                for seed in 0..SEEDS {
                    let field = WaveField::with_components(&sea, seed, count);
                    let period = TAU * (moment(field.waves(), 0) / moment(field.waves(), 2)).sqrt();
                    errors.push((period / row[5] - 1.0).abs());
                }
            }
            let error = worst(errors);
            let t = ExtremeResult::rival(METHODS[0].0, &count.to_string(), error);
            tried.push(ExtremeResult { default: count == DEFAULT, ..t });
        }
        bench.extreme(&format!("zero-crossing period of a JONSWAP sea, gamma {gamma}"), "relative", tried);
    }
    Ok(())
}

/// Exponential integral E1 for small arguments, by its series.
fn e1(x: f64) -> f64 {
    let (mut sum, mut term) = (-0.577_215_664_901_532_9 - x.ln(), -1.0);
    for n in 1..40 {
        term *= -x / f64::from(n);
        sum += term / f64::from(n);
    }
    sum
}

/// Mean square slopes: of the product's waves against their band in closed form, and of both against the sea's.
fn slopes(bench: &mut PartBench) -> Result<()> {
    // Pierson-Moskowitz up to six peaks: alpha / 4 E1(1.25 / 6^4), whatever the wind.
    let band = 0.0081 / 4.0 * e1(1.25 / 6f64.powi(4));
    let mean = |wind: f64, count: usize| -> Result<f64> {
        let spectrum = Spectrum::fully_developed(wind).context("a wind out of range")?;
        let waves = |seed| WaveField::with_components(&WaveSpec { spectrum, wind_from: 0.0 }, seed, count);
        Ok((0..SEEDS).map(|seed| slope_variance(waves(seed).waves())).sum::<f64>() / SEEDS as f64)
    };
    let mut tried = Vec::new();
    for count in COUNTS {
        let t =
            ExtremeResult::rival(METHODS[0].0, &count.to_string(), (mean(10.0, count)? / band - 1.0).abs());
        tried.push(ExtremeResult { default: count == DEFAULT, ..t });
    }
    bench.extreme("mean square slope up to six peaks against its closed form", "relative", tried);
    for row in table(COX_MUNK).iter().filter(|r| [2.0, 6.0, 10.0, 14.0].contains(&r[0])) {
        let held = mean(row[0], DEFAULT)?;
        let note = format!("{held:.4} of {:.4}: what is shorter is left to the shading of the water", row[1]);
        bench.extreme(
            &format!("mean square slope at {} m/s against Cox and Munk", row[0]),
            "relative",
            vec![
                ExtremeResult::product(METHODS[0].0, "32", (held / row[1] - 1.0).abs()).note(note),
                ExtremeResult::rival("spectrum up to six peaks", "closed form", (band / row[1] - 1.0).abs()),
                ExtremeResult::rival(
                    "spectrum up to 1 cm waves",
                    "closed form",
                    (slope_to_centimetre(row[0]) / row[1] - 1.0).abs(),
                ),
            ],
        );
    }
    Ok(())
}

/// Mean square slope of a Pierson-Moskowitz sea of waves longer than a centimetre.
fn slope_to_centimetre(wind_m_s: f64) -> f64 {
    let peak = 0.877 * GRAVITY_M_S2 / (1.026 * wind_m_s);
    let last = (GRAVITY_M_S2 * TAU / 0.01).sqrt();
    0.0081 / 4.0 * e1(1.25 * (peak / last).powi(4))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_of_one_sine_and_of_many_is_known() {
        let wave = |a: f64| Wave { amplitude_m: a, cycles_per_m: DVec2::X, hz: 1.0, phase: 0.0 };
        // A sum of many small sines is Gaussian; of two equal ones, nothing is beyond 2 sigma = 2 a.
        let many = share_beyond_two(&vec![wave(0.1); 4000]);
        assert!((many / GAUSSIAN_BEYOND_TWO - 1.0).abs() < 1e-3, "{many}");
        assert!((bessel_j0(2.404_825_557_695_773)).abs() < 1e-14 && (bessel_j0(0.0) - 1.0).abs() < 1e-15);
        // Abramowitz and Stegun, table 5.1.
        assert!((e1(0.5) - 0.559_773_595).abs() < 1e-9, "{}", e1(0.5));
    }
}
