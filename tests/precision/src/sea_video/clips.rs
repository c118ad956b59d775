//! The clips on which the estimator is judged.

use std::f64::consts::{PI, TAU};

use bowwave_core::geometry::Lens;
use hw_sim::ocean::{random::keyed_uniform, systems::WaveSystem};

use super::{light::SeaSky, video::SeaClip};

/// A usual clip; change what differs.
pub fn usual(seed: u64, height_m: f64, peak_s: f64, from_rad: f64, eye_m: f64, sky: SeaSky) -> SeaClip {
    // The wind that belongs to the height in a fully arisen sea roughens the water, but no less than a breath.
    let wind_m_s = (height_m / 0.0246).sqrt().clamp(1.0, 12.0);
    SeaClip {
        class: "usual",
        systems: vec![WaveSystem { height_m, peak_s, gamma: 3.3, from_rad, spread: None }],
        wind_m_s,
        sky,
        upwelling: 0.03,
        eye_m,
        look: (0.0, -0.12),
        lens: Lens::pinhole(1280, 720, PI / 3.0),
        motion: 1.0,
        pose_error_rad: 1e-3,
        visibility_m: 2e4,
        white: 1.15,
        noise: 0.01,
        seed,
    }
}

fn log_between(u: f64, low: f64, high: f64) -> f64 {
    low * (high / low).powf(u)
}

/// One of the main series: heights 0.1-4 m, periods 2.5-10 s, all directions, eyes 3-20 m, five skies.
pub fn main_clip(i: u64) -> SeaClip {
    let draw = |j: u64| keyed_uniform(i.wrapping_mul(1009).wrapping_add(j * 77_777 + 5));
    // Periods and eyes by shuffled strata, so that few clips cover them evenly.
    let peak_s = log_between(((i * 17 % 40) as f64 + draw(0)) / 40.0, 2.5, 10.0);
    let eye_m = log_between(((i * 23 % 40) as f64 + draw(1)) / 40.0, 3.0, 20.0);
    let wavelength = 9.81 * peak_s * peak_s / TAU;
    let height_m = (wavelength * log_between(draw(2), 0.008, 0.042)).clamp(0.1, 4.0_f64.min(0.45 * eye_m));
    let from = ((i * 7 % 40) as f64 + draw(3)) / 40.0 * TAU;
    let sky = [SeaSky::Clear, SeaSky::Overcast, SeaSky::Broken, SeaSky::Dusk, SeaSky::SunAhead(0.6)]
        [(i % 5) as usize];
    let mut clip = usual(i + 1, height_m, peak_s, from, eye_m, sky);
    clip.class = ["clear", "overcast", "broken cloud", "dusk", "sun ahead"][(i % 5) as usize];
    clip.look.1 = -0.08 - 0.1 * draw(4);
    clip.upwelling = 0.01 + 0.05 * draw(5);
    if let Some(system) = clip.systems.first_mut() {
        system.gamma = log_between(draw(6), 1.0, 5.0);
    }
    clip
}

/// The series of hard cases.
pub fn hard_clip(i: u64) -> SeaClip {
    let draw = |j: u64| keyed_uniform(i.wrapping_mul(2003).wrapping_add(j * 55_555 + 9));
    let from = draw(0) * TAU;
    let seed = 1000 + i;
    match i % 6 {
        0 => {
            // Swell with a wind sea across it.
            let mut clip = usual(seed, 0.8, 9.0, from, 10.0, SeaSky::Clear);
            clip.systems[0].spread = Some(25.0);
            clip.systems.push(WaveSystem {
                height_m: 0.5,
                peak_s: 3.5,
                gamma: 3.3,
                from_rad: from + 1.5,
                spread: None,
            });
            SeaClip { class: "swell and wind sea", wind_m_s: 5.0, ..clip }
        }
        1 => SeaClip {
            class: "fog",
            visibility_m: 250.0,
            ..usual(seed, 0.6, 4.0, from, 8.0, SeaSky::Overcast)
        },
        2 => SeaClip {
            class: "night",
            white: 60.0,
            noise: 0.02,
            ..usual(seed, 1.0, 5.0, from, 8.0, SeaSky::Clear)
        },
        3 => SeaClip { class: "4 m under a 3 m eye", ..usual(seed, 4.0, 8.5, from, 3.0, SeaSky::Clear) },
        4 => SeaClip { class: "no waves", wind_m_s: 0.5, ..usual(seed, 0.0, 3.0, from, 8.0, SeaSky::Clear) },
        _ => {
            let lens = Lens::pinhole(1280, 720, 0.25);
            SeaClip {
                class: "long lens",
                lens,
                motion: 0.3,
                ..usual(seed, 0.7, 4.5, from, 12.0, SeaSky::Clear)
            }
        }
    }
}
