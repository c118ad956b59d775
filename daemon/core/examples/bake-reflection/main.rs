//! Bakes what waves do to a boat's reflection into `data/reflection.bin`: rays of sight are followed over patches of sea of every wind
//! force, and counted by where and how high they pass a hull at some distance.
//!
//!     cargo run --release -p bowwave-core --example bake-reflection -- daemon/core/data/reflection.bin

mod path;
mod sea;

use std::{f64::consts::FRAC_PI_2, process::ExitCode};

use bowwave_core::{
    reflection::grid::{
        DISTANCES, ELEVATIONS, FORCES, RECORD, RISE_NODES, RISES, TONE_FIRST, TONE_STEP, TONES, WINDS,
        distance_m, elevation, rise_sine, sky_shape,
    },
    sea::BeaufortForce,
};
use rand::RngExt;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use path::{Segment, follow};
use sea::{Sea, SeaSpec};

/// Angle that a pixel of the camera spans, radians, and the camera's height over the sea, metres.
const PIXEL: f64 = 1e-3;
const EYE_M: f64 = 8.0;
/// Patches of sea for each force and wind; pixels of each at each elevation; rays of each pixel.
const PATCHES: u64 = 8;
const PIXELS: usize = 100;
const RAYS: usize = 128;

const CELLS: usize = DISTANCES * RISES;

/// One pixel, by halves of its rays: its brightness, and by distance and rise what is thrown back and taken away. A half's brightness is
/// held against the other's cells, so that the chance of the draw in one does not look like a law.
struct Pixel {
    light: [f64; 2],
    cells: [Vec<[f32; 2]>; 2],
    /// Share of the rays that meet water before the hull, by distance: beyond it they meet the hull, and show no water.
    before: [[f32; DISTANCES]; 2],
}

/// By distance and rise: weight of light, and sums of how far aside it goes over the distance and of the same without its sign.
type Aside = Vec<[f64; 3]>;

fn pixel(sea: &Sea, elevation: f64, rng: &mut Pcg64, aside: &mut Aside) -> Pixel {
    let mut out = Pixel {
        light: [0.0; 2],
        cells: [0, 1].map(|_| vec![[0.0; 2]; CELLS]),
        before: [[0.0; DISTANCES]; 2],
    };
    let part = 2.0 / RAYS as f64;
    let mut path: Vec<Segment> = Vec::new();
    let (x0, y0) = (rng.random::<f64>() * 1000.0, rng.random::<f64>() * 1000.0);
    let range = EYE_M / elevation.sin();
    let width = PIXEL * range;
    for ray in 0..RAYS {
        let half = ray % 2;
        let dx = (rng.random::<f64>() - 0.5) * width;
        let dy = (rng.random::<f64>() - 0.5) * width / elevation.sin();
        follow(sea, [x0 + dx, y0 + dy], elevation.sin(), rng, &mut path);
        let Some(last) = path.last() else { continue };
        let open = last.end.is_infinite();
        let light = if open { last.share * sky_shape(last.dir[2]) } else { 0.0 };
        out.light[half] += light * part;
        for d in 0..DISTANCES {
            // A pixel's rays spread over more than the least distances: each has its own place.
            let hull = y0 + dy + distance_m(d);
            if path.first().is_some_and(|s| s.from[1] >= hull) {
                continue;
            }
            out.before[half][d] += part as f32;
            for s in path.iter().filter(|s| s.dir[1] > 1e-6 && s.from[1] < hull) {
                let t = (hull - s.from[1]) / s.dir[1];
                if t > s.end {
                    continue;
                }
                let rise = (s.from[2] + t * s.dir[2]) / distance_m(d);
                let r = RISE_NODES.iter().position(|n| rise < *n);
                let Some(r) = r else { break };
                let sky = sky_shape(rise_sine(r));
                let cell = &mut out.cells[half][d * RISES + r];
                cell[0] += (s.share * part) as f32;
                cell[1] += (light / sky * part) as f32;
                let off = (s.from[0] + t * s.dir[0] - x0 - dx) / distance_m(d);
                let sums = &mut aside[d * RISES + r];
                // A few rays that run along the hull would count for all others.
                let off = off.clamp(-1.5, 1.5);
                for (sum, v) in sums.iter_mut().zip([1.0, off, off.abs()]) {
                    *sum += s.share * v;
                }
                break;
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
    let tone = |light: f64| light.max(0.0).powf(1.0 / 2.2);
    let tones = || pixels.iter().flat_map(|p| p.light.map(tone));
    let count = 2.0 * pixels.len() as f64;
    let mean = tones().sum::<f64>() / count;
    let spread = (tones().map(|t| (t - mean).powi(2)).sum::<f64>() / count).sqrt().max(1e-9);
    let mut sums = vec![[[0.0_f64; 2]; TONES]; CELLS];
    let mut weights = [[0.0; TONES]; DISTANCES];
    let halves = pixels.iter().flat_map(|p| [0, 1].map(|h| (p.light[h], &p.cells[1 - h], &p.before[1 - h])));
    for (light, cells, before) in halves {
        let at = (((tone(light) - mean) / spread - TONE_FIRST) / TONE_STEP).clamp(0.0, TONES as f64 - 1.0);
        let first = (at as usize).min(TONES - 2);
        for (t, w) in [(first, 1.0 - (at - first as f64)), (first + 1, at - first as f64)] {
            for (weight, before) in weights.iter_mut().zip(before) {
                weight[t] += w * f64::from(*before);
            }
            for (sum, cell) in sums.iter_mut().zip(cells) {
                sum[t][0] += w * f64::from(cell[0]);
                sum[t][1] += w * f64::from(cell[1]);
            }
        }
    }
    let mut out = Vec::with_capacity(CELLS * RECORD);
    for (cell, (sum, a)) in sums.iter().zip(&aside).enumerate() {
        for (s, w) in sum.iter().zip(weights[cell / RISES]) {
            out.extend(s.map(|v| (v / w.max(1e-9)) as f32));
        }
        let mean = a[1] / a[0].max(1e-12);
        // Of a normal distribution about 0 the mean magnitude is sqrt(2 / pi) of the standard deviation.
        let variance = (FRAC_PI_2 * (a[2] / a[0].max(1e-12)).powi(2) - mean * mean).max(0.0);
        out.extend([mean as f32, variance.sqrt() as f32]);
    }
    out
}

fn all() -> Vec<f32> {
    let mut out = Vec::new();
    for force in 0..FORCES {
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
            eprintln!("force {force}, wind {wind}: {:.1} s", started.elapsed().as_secs_f64());
        }
    }
    out
}

fn main() -> ExitCode {
    let Some(file) = std::env::args().nth(1) else {
        eprintln!("bake-reflection: name the file to write");
        return ExitCode::FAILURE;
    };
    let bytes = bowwave_core::reflection::encode(&all());
    match std::fs::write(&file, bytes) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("bake-reflection: cannot write {file}: {error}");
            ExitCode::FAILURE
        }
    }
}
