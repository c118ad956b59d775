//! Bakes what waves do to a boat's reflection into `data/reflection.bin`: rays of sight are followed over patches of sea of every wind
//! force, and counted by where and how high they pass a hull that floats at some distance.
//!
//!     cargo run --release -p bowwave-core --example bake-reflection -- daemon/core/data/reflection.bin

mod fit;
mod path;
mod sea;

use std::{f64::consts::FRAC_PI_2, process::ExitCode};

use bowwave_core::{
    reflection::grid::{
        DISTANCES, ELEVATIONS, FORCES, RISE_NODES, RISES, STATES, STORED, TONES, WINDS, distance_m,
        elevation, rise_sine, sky_shape, state_weights, tone_weights,
    },
    sea::BeaufortForce,
};
use rand::RngExt;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use fit::Fit;
use path::{Segment, follow};
use sea::{Sea, SeaSpec};

/// Angle that a pixel of the camera spans, radians, and the camera's height over the sea, metres.
const PIXEL: f64 = 1e-3;
const EYE_M: f64 = 8.0;
/// Patches of sea for each force and wind; pixels of each at each elevation; rays of each pixel.
const PATCHES: u64 = 12;
const PIXELS: usize = 100;
const RAYS: usize = 64;

/// Places along the line of sight at which the level of a boat is looked up lie so far apart, metres.
const LEVEL_STEP_M: f64 = 0.4;
/// From the plane of the hull to the boat's middle, metres.
const HALF_BEAM_M: f64 = 1.3;
/// A pixel that sees the same distance over a long stretch of levels counts at most so many times.
const WEIGHT_MAX: f64 = 4.0;

const CELLS: usize = DISTANCES * RISES;

/// One hull behind a pixel.
struct Hull {
    distance: usize,
    /// Where it stands: y of its plane, metres; and level (metres) and tilt (tangent) of the boat.
    y: f64,
    afloat: [f64; 2],
    /// How much water sees it so.
    weight: f64,
    /// By halves of the pixel's rays and by rise, what is thrown back and taken away.
    cells: [[[f32; 2]; RISES]; 2],
    /// Share of the rays that meet water before the hull: the others meet the hull, and show no water.
    before: [f32; 2],
}

/// One pixel: its brightness by halves of its rays, and the hulls behind it. A half's brightness is held against the other's cells, so that
/// the chance of the draw in one does not look like a law.
struct Pixel {
    light: [f64; 2],
    hulls: Vec<Hull>,
}

/// By distance and rise: weight of light, and sums of how far aside it goes over the distance and of the same without its sign.
type Aside = Vec<[f64; 3]>;

/// The hulls that stand at a node's distance from where the line of sight through (x, y) on the mean water meets the level of their own
/// water. Boats are as likely everywhere: a place counts by how fast the distance grows with it.
fn hulls(sea: &Sea, x: f64, y: f64, elevation: f64) -> Vec<Hull> {
    let cot = 1.0 / elevation.tan();
    let reach = if sea.spread[0] > 0.0 { 4.0 * sea.spread[0] * cot } else { 0.0 };
    let farthest = distance_m(DISTANCES - 1);
    let place = |i: usize| y - reach - LEVEL_STEP_M + i as f64 * LEVEL_STEP_M;
    let count = ((farthest + 2.0 * reach) / LEVEL_STEP_M) as usize + 4;
    let distance = |hull: f64| hull + sea.level(x, hull + HALF_BEAM_M) * cot - y;
    let mut out = Vec::new();
    let mut before = distance(place(0));
    for i in 1..count {
        let after = distance(place(i));
        for d in 0..DISTANCES {
            let node = distance_m(d);
            if (before < node) == (after < node) {
                continue;
            }
            let slope = (after - before) / LEVEL_STEP_M;
            let hull = place(i - 1) + LEVEL_STEP_M * (node - before) / (after - before);
            out.push(Hull {
                distance: d,
                y: hull,
                afloat: sea.afloat(x, hull + HALF_BEAM_M),
                weight: slope.abs().recip().min(WEIGHT_MAX),
                cells: [[[0.0; 2]; RISES]; 2],
                before: [0.0; 2],
            });
        }
        before = after;
    }
    out
}

fn pixel(sea: &Sea, elevation: f64, rng: &mut Pcg64, aside: &mut Aside) -> Pixel {
    let part = 2.0 / RAYS as f64;
    let mut path: Vec<Segment> = Vec::new();
    let (x0, y0) = (rng.random::<f64>() * 1000.0, rng.random::<f64>() * 1000.0);
    let mut out = Pixel { light: [0.0; 2], hulls: hulls(sea, x0, y0, elevation) };
    let width = PIXEL * EYE_M / elevation.sin();
    for ray in 0..RAYS {
        let half = ray % 2;
        let dx = (rng.random::<f64>() - 0.5) * width;
        let dy = (rng.random::<f64>() - 0.5) * width / elevation.sin();
        follow(sea, [x0 + dx, y0 + dy], elevation.sin(), rng, &mut path);
        let Some(last) = path.last() else { continue };
        let open = last.end.is_infinite();
        let light = if open { last.share * sky_shape(last.dir[2]) } else { 0.0 };
        out.light[half] += light * part;
        for hull in &mut out.hulls {
            // A pixel's rays spread over more than the least distances: each has its own hull.
            let y = hull.y + dy;
            if path.first().is_some_and(|s| s.from[1] >= y) {
                continue;
            }
            hull.before[half] += part as f32;
            let passing = path.iter().find_map(|s| {
                let t = (y - s.from[1]) / s.dir[1];
                (s.dir[1] > 1e-6 && s.from[1] < y && t <= s.end).then_some((s, t))
            });
            // What never gets there comes from behind the eye, and no boat is high enough to hide it.
            let (r, share) = match passing {
                None => (RISES - 1, if open { last.share } else { 0.0 }),
                Some((s, t)) => {
                    let rise = (s.from[2] + t * s.dir[2] - hull.afloat[0]) / distance_m(hull.distance);
                    let r = RISE_NODES.iter().position(|n| rise < *n).unwrap_or(RISES - 1);
                    let off = (s.from[0] + t * s.dir[0] - x0 - dx) / distance_m(hull.distance);
                    // A few rays that run along the hull would count for all others.
                    let off = off.clamp(-1.5, 1.5);
                    if let Some(sums) = aside.get_mut(hull.distance * RISES + r) {
                        for (sum, v) in sums.iter_mut().zip([1.0, off, off.abs()]) {
                            *sum += hull.weight * s.share * v;
                        }
                    }
                    (r, s.share)
                }
            };
            let cell = &mut hull.cells[half][r];
            cell[0] += (share * part) as f32;
            cell[1] += (light / sky_shape(rise_sine(r)) * part) as f32;
        }
    }
    out
}

/// What is thrown back and taken away, fitted to all pixels: by distance and tone.
fn fits(pixels: &[Pixel], spread: [f64; 2]) -> Vec<Fit> {
    let tone = |light: f64| light.max(0.0).powf(1.0 / 2.2);
    let tones = || pixels.iter().flat_map(|p| p.light.map(tone));
    let count = 2.0 * pixels.len() as f64;
    let mean = tones().sum::<f64>() / count;
    let deviation = (tones().map(|t| (t - mean).powi(2)).sum::<f64>() / count).sqrt().max(1e-9);
    let mut out = vec![Fit::new(); DISTANCES * TONES];
    for (pixel, half) in pixels.iter().flat_map(|p| [(p, 0), (p, 1)]) {
        let weights = tone_weights((tone(pixel.light[half]) - mean) / deviation);
        for hull in &pixel.hulls {
            let [level, tilt] = [0, 1].map(|i| hull.afloat[i] / spread[i].max(1e-9));
            let states = state_weights(level, tilt);
            let fits = out.iter_mut().skip(hull.distance * TONES);
            for (fit, weight) in fits.zip(weights).filter(|(_, w)| *w > 0.0) {
                let before = f64::from(hull.before[1 - half]);
                fit.add(hull.weight * weight, &states, before, &hull.cells[1 - half]);
            }
        }
    }
    out
}

/// All records of one force, wind and elevation.
fn bake(seas: &[Sea], elevation: f64, seed: u128) -> Vec<f32> {
    let mut rng = Pcg64::new(seed, 0x7ab1e);
    let mut aside: Aside = vec![[0.0; 3]; CELLS];
    let mut pixels = Vec::new();
    for sea in seas {
        pixels.extend((0..PIXELS).map(|_| pixel(sea, elevation, &mut rng, &mut aside)));
    }
    // By distance and tone: by state and rise what is thrown back and taken away.
    let fitted: Vec<_> = fits(&pixels, spread(seas)).iter().map(Fit::solve).collect();
    let mut out = Vec::with_capacity(CELLS * STORED);
    for (cell, a) in aside.iter().enumerate() {
        let (distance, rise) = (cell / RISES, cell % RISES);
        for state in 0..STATES {
            for by_state in &fitted[distance * TONES..(distance + 1) * TONES] {
                let values = &by_state[state];
                out.extend([values[2 * rise], values[2 * rise + 1]].map(|v| v.max(0.0) as f32));
            }
        }
        let mean = a[1] / a[0].max(1e-12);
        // Of a normal distribution about 0 the mean magnitude is sqrt(2 / pi) of the standard deviation.
        let variance = (FRAC_PI_2 * (a[2] / a[0].max(1e-12)).powi(2) - mean * mean).max(0.0);
        out.extend([mean as f32, variance.sqrt() as f32]);
    }
    out
}

/// Standard deviations of a small boat's level (metres) and tilt (tangent) over all patches.
fn spread(seas: &[Sea]) -> [f64; 2] {
    let mean = |i: usize| seas.iter().map(|s| s.spread[i].powi(2)).sum::<f64>() / seas.len().max(1) as f64;
    [mean(0).sqrt(), mean(1).sqrt()]
}

/// The records of all forces and winds, and each force's spreads of level and tilt.
fn all() -> (Vec<f32>, Vec<[f64; 2]>) {
    let (mut out, mut spreads) = (Vec::new(), Vec::new());
    for force in 0..FORCES {
        let mut sum = [0.0; 2];
        for wind in 0..WINDS {
            let started = std::time::Instant::now();
            let seas: Vec<Sea> = (0..PATCHES)
                .map(|n| {
                    Sea::new(&SeaSpec {
                        force: BeaufortForce::new(force as u8).unwrap_or_else(|| unreachable!()),
                        wind_to_view: std::f64::consts::FRAC_PI_4 * wind as f64,
                        seed: n + 100 * (force * WINDS + wind) as u64,
                    })
                })
                .collect();
            let parts: Vec<Vec<f32>> = (0..ELEVATIONS)
                .into_par_iter()
                .map(|e| bake(&seas, elevation(e), (force * WINDS + wind) as u128 * 100 + e as u128))
                .collect();
            out.extend(parts.into_iter().flatten());
            let part = spread(&seas).map(|s| s / WINDS as f64);
            sum = [sum[0] + part[0], sum[1] + part[1]];
            eprintln!("force {force}, wind {wind}: {:.1} s", started.elapsed().as_secs_f64());
        }
        spreads.push(sum);
    }
    (out, spreads)
}

fn main() -> ExitCode {
    let Some(file) = std::env::args().nth(1) else {
        eprintln!("bake-reflection: name the file to write");
        return ExitCode::FAILURE;
    };
    let (values, spreads) = all();
    let bytes = bowwave_core::reflection::encode(&values, &spreads);
    match std::fs::write(&file, bytes) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("bake-reflection: cannot write {file}: {error}");
            ExitCode::FAILURE
        }
    }
}
