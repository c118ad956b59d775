//! Bakes what waves do to a boat's reflection into `reflection.bin`: rays of sight are followed over patches of sea of every wind
//! force, and counted by where and how high they pass a hull that floats at some distance. And into `hiding.bin` how much of a hull
//! the waves before it hide.
//!
//!     cargo run --release -p bowwave-core --example bake-reflection -- daemon/core/data

mod fit;
mod hide;
mod path;
mod sea;

use std::{f64::consts::FRAC_PI_2, path::PathBuf, process::ExitCode};

use bowwave_core::{
    frame::reflection::{
        encode, encode_hiding,
        grid::{
            DISTANCES, ELEVATIONS, FORCES, RISE_NODES, RISES, STATES, STORED, TONES, WINDS, distance_m,
            elevation, sky_shape, state_weights, tone_weights,
        },
    },
    sea::BeaufortForce,
};
use rand::RngExt;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use fit::NormalEquations;
use path::{PathSegment, follow};
use sea::{BakedSea, SeaSpec};

/// Angle that a pixel of the camera spans, radians, and the camera's height over the sea, metres.
const PIXEL: f64 = 1e-3;
const EYE_M: f64 = 8.0;
/// Patches of sea for each force and wind; pixels of each at each elevation; rays of each pixel.
const PATCHES: u64 = 12;
const PIXELS: usize = 100;
const RAYS: usize = 256;

/// Hulls stand at places so far apart along the line of sight, metres.
const PLACE_STEP_M: f64 = 0.1;
/// A node stands for distances from its own divided by this to its own times this: the root of the ratio from one to the next.
const BIN: f64 = 1.36;
/// From the plane of the hull to the boat's middle, metres.
const HALF_BEAM_M: f64 = 1.3;
const CELLS: usize = DISTANCES * RISES;
/// Numbers of one pixel that are fitted: by rise, what is thrown back and what is taken away.
const VALUES: usize = 2 * RISES;

/// What a pixel's rays see of hulls at a node's distance, by halves of the rays. A ray has a hull of its own, any that ends at that
/// distance from it, and counts for as many places as such hulls could have.
#[derive(Clone, Copy, Default)]
struct CountedHull {
    /// By rise, what is thrown back and what is taken away.
    cells: [[f32; VALUES]; 2],
    /// Weight of the rays, of which those that meet water before the hull: the others meet the hull, and show no water.
    before: [f64; 2],
    /// Sum over these of the states that their hulls are in.
    states: [[f64; STATES]; 2],
}

/// One pixel: its brightness by halves of its rays, and what they see. A half's brightness is held against the other's cells, so that
/// the chance of the draw in one does not look like a law.
struct Pixel {
    light: [f64; 2],
    seen: [CountedHull; DISTANCES],
}

/// Where light comes from, by distance and rise.
#[derive(Clone, Copy, Default)]
struct From {
    /// Weight of what passes the hull's plane, and sums of how far aside it goes over the distance and of the same without its sign.
    aside: [f64; 3],
    /// Weight of what comes from the sky, and sum of the sine of its elevation.
    sky: [f64; 2],
}

/// The places where hulls can stand along a line of sight, from near to far.
struct Places {
    /// Where the first stands, metres; the others follow in steps of [`PLACE_STEP_M`].
    first_y: f64,
    /// Where the line of sight that passes over all waves before the hull meets the mean water, metres; and its height at the hull.
    ends: Vec<[f64; 2]>,
}

impl Places {
    /// Along x, for pixels whose lines of sight meet the mean water about y. A hull is seen to end where waves before it hide its foot.
    fn along(sea: &BakedSea, x: f64, y: f64, elevation: f64) -> Self {
        let (tangent, cot) = (elevation.tan(), 1.0 / elevation.tan());
        let reach = sea.reach_m * cot;
        let half = 0.5 * PIXEL * EYE_M / elevation.sin().powi(2);
        let from = y - half - reach - PLACE_STEP_M;
        let count =
            ((2.0 * half + 2.0 * reach + BIN * distance_m(DISTANCES - 1)) / PLACE_STEP_M) as usize + 2;
        // Waves farther before the first place hide nothing of what stands there.
        let warm = (2.0 * reach / PLACE_STEP_M) as usize + 1;
        let mut highest = f64::NEG_INFINITY;
        let mut ends = Vec::with_capacity(count);
        for i in 0..warm + count {
            let place = from + (i as f64 - warm as f64) * PLACE_STEP_M;
            highest = sea.at(x, place)[0].max(highest - PLACE_STEP_M * tangent);
            if i >= warm {
                ends.push([place + highest * cot, highest]);
            }
        }
        Self { first_y: from, ends }
    }

    /// Any of the places whose hulls end at about a node's distance from where a line of sight meets the mean water: where it stands, the
    /// height of its end and the distance, and how many there are.
    fn draw(&self, y: f64, node: usize, rng: &mut Pcg64) -> Option<([f64; 3], usize)> {
        let below = |distance: f64| self.ends.partition_point(|[end, _]| end - y < distance);
        let nearest = if node == 0 { 0.2 * distance_m(0) } else { distance_m(node) / BIN };
        let (from, to) = (below(nearest), below(distance_m(node) * BIN));
        if from >= to {
            return None;
        }
        let i = rng.random_range(from..to);
        let [end, height] = self.ends[i];
        Some(([self.first_y + i as f64 * PLACE_STEP_M, height, end - y], to - from))
    }
}

fn pixel(sea: &BakedSea, elevation: f64, spread: [f64; 2], rng: &mut Pcg64, from: &mut [From]) -> Pixel {
    let part = 2.0 / RAYS as f64;
    let mut path: Vec<PathSegment> = Vec::new();
    let (x0, y0) = (rng.random::<f64>() * 1000.0, rng.random::<f64>() * 1000.0);
    let places = Places::along(sea, x0, y0, elevation);
    let mut out = Pixel { light: [0.0; 2], seen: Default::default() };
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
        for (node, seen) in out.seen.iter_mut().enumerate() {
            let Some(([y, foot, distance], count)) = places.draw(y0 + dy, node, rng) else { continue };
            if path.first().is_some_and(|s| s.from[1] >= y) {
                continue;
            }
            let weight = part * count as f64;
            let afloat = sea.afloat(x0, y + HALF_BEAM_M);
            let [level, tilt] = [0, 1].map(|i| afloat[i] / spread[i].max(1e-9));
            seen.before[half] += weight;
            for (sum, state) in seen.states[half].iter_mut().zip(state_weights(level, tilt)) {
                *sum += weight * state;
            }
            let passing = path.iter().find_map(|s| {
                let t = (y - s.from[1]) / s.dir[1];
                (s.dir[1] > 1e-6 && s.from[1] < y && t <= s.end).then_some((s, t))
            });
            // What never gets there comes from behind the eye, and no boat is high enough to hide it.
            let (r, share) = match passing {
                None => (RISES - 1, if open { last.share } else { 0.0 }),
                Some((s, t)) => {
                    let rise = (s.from[2] + t * s.dir[2] - foot) / distance;
                    let r = RISE_NODES.iter().position(|n| rise < *n).unwrap_or(RISES - 1);
                    let off = (s.from[0] + t * s.dir[0] - x0 - dx) / distance;
                    // A few rays that run along the hull would count for all others.
                    let off = off.clamp(-1.5, 1.5);
                    for (sum, v) in from[node * RISES + r].aside.iter_mut().zip([1.0, off, off.abs()]) {
                        *sum += weight * s.share * v;
                    }
                    (r, s.share)
                }
            };
            let cells = &mut seen.cells[half];
            cells[2 * r] += (share * weight) as f32;
            if open {
                cells[2 * r + 1] += (last.share * weight) as f32;
                for (sum, v) in from[node * RISES + r].sky.iter_mut().zip([1.0, last.dir[2]]) {
                    *sum += weight * last.share * v;
                }
            }
        }
    }
    out
}

/// What is thrown back and taken away, fitted to all pixels: by distance and tone.
fn fits(pixels: &[Pixel]) -> Vec<NormalEquations<VALUES>> {
    let tone = |light: f64| light.max(0.0).powf(1.0 / 2.2);
    let tones = || pixels.iter().flat_map(|p| p.light.map(tone));
    let count = 2.0 * pixels.len() as f64;
    let mean = tones().sum::<f64>() / count;
    let deviation = (tones().map(|t| (t - mean).powi(2)).sum::<f64>() / count).sqrt().max(1e-9);
    let mut out = vec![NormalEquations::new(); DISTANCES * TONES];
    for (pixel, half) in pixels.iter().flat_map(|p| [(p, 0), (p, 1)]) {
        let weights = tone_weights((tone(pixel.light[half]) - mean) / deviation);
        for (node, seen) in pixel.seen.iter().enumerate() {
            let (before, cells) = (seen.before[1 - half], &seen.cells[1 - half]);
            let states = seen.states[1 - half].map(|s| s / before.max(1e-12));
            let fits = out.iter_mut().skip(node * TONES);
            for (fit, weight) in fits.zip(weights).filter(|(_, w)| *w > 0.0 && before > 0.0) {
                fit.add(weight, &states, before, cells);
            }
        }
    }
    out
}

/// All records of one force, wind and elevation.
fn bake(seas: &[BakedSea], elevation: f64, seed: u128) -> Vec<f32> {
    let mut rng = Pcg64::new(seed, 0x7ab1e);
    let mut from = vec![From::default(); CELLS];
    let mut pixels = Vec::new();
    let spread = spread(seas);
    for sea in seas {
        pixels.extend((0..PIXELS).map(|_| pixel(sea, elevation, spread, &mut rng, &mut from)));
    }
    // By distance and tone: by state and rise what is thrown back and taken away.
    let fitted: Vec<_> = fits(&pixels).iter().map(NormalEquations::solve).collect();
    let mut out = Vec::with_capacity(CELLS * STORED);
    for (cell, From { aside: a, sky }) in from.iter().enumerate() {
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
        out.extend([mean, variance.sqrt(), sky[1] / sky[0].max(1e-12)].map(|v| v as f32));
    }
    out
}

/// Standard deviations of a small boat's level (metres) and tilt (tangent) over all patches.
fn spread(seas: &[BakedSea]) -> [f64; 2] {
    let mean = |i: usize| seas.iter().map(|s| s.spread[i].powi(2)).sum::<f64>() / seas.len().max(1) as f64;
    [mean(0).sqrt(), mean(1).sqrt()]
}

/// Of all forces and winds.
#[derive(Default)]
struct Baked {
    /// See [`bake`].
    records: Vec<f32>,
    /// See [`hide::hidden`].
    hidden_m: Vec<f64>,
    /// Each force's spreads of level and tilt.
    spreads: Vec<[f64; 2]>,
}

fn all() -> Baked {
    let mut out = Baked::default();
    for force in 0..FORCES {
        let mut sum = [0.0; 2];
        for wind in 0..WINDS {
            let started = std::time::Instant::now();
            let seas: Vec<BakedSea> = (0..PATCHES)
                .map(|n| {
                    BakedSea::new(&SeaSpec {
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
            out.records.extend(parts.into_iter().flatten());
            out.hidden_m.extend(hide::hidden(&seas, spread(&seas)));
            let part = spread(&seas).map(|s| s / WINDS as f64);
            sum = [sum[0] + part[0], sum[1] + part[1]];
            eprintln!("force {force}, wind {wind}: {:.1} s", started.elapsed().as_secs_f64());
        }
        out.spreads.push(sum);
    }
    out
}

fn main() -> ExitCode {
    let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("bake-reflection: name the folder to write to");
        return ExitCode::FAILURE;
    };
    let baked = all();
    let files = [
        ("reflection.bin", encode(&baked.records, &baked.spreads)),
        ("hiding.bin", encode_hiding(&baked.hidden_m, &baked.spreads)),
    ];
    for (name, bytes) in files {
        let file = folder.join(name);
        if let Err(error) = std::fs::write(&file, bytes) {
            eprintln!("bake-reflection: cannot write {}: {error}", file.display());
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}
