//! The light of a fire on what is around it, by fewer lights than it has particles.

use anyhow::Result;
use bowwave_core::frame::fires::Burning;
use glam::{DVec2, DVec3};

use super::{About, even, rms};
use crate::bench::{PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "fires",
    what: "Lights hulls, sea and gun by a fire.",
    truth: "the irradiance of 400 particles of a fire of that heat, each a point light, summed one by one at places of a deck, a hull and the water; 24 moments",
    rivals: "a point light for each of 1 to 16 groups of particles by remaining life, at the plain mean of their places as Hughes, Konttinen and Pattanaik (2004) have it, or at \
             the mean weighted by strength",
    why: "each lamp costs as much again: at each corner of each hull, at each ring of the sea, in the air's table. So there is one a fire. The lower part of flames is the brighter one, so that \
          one at a third of their height errs less than the product's at half of it",
};

/// Particles of a fire.
const PARTICLES: u64 = 400;
/// Seconds that one lives.
const LIFE_S: f64 = 0.7;
/// Diameter of the fire, metres.
const DIAMETER_M: f64 = 0.8;

/// A glowing particle, or a light that stands for some.
#[derive(Clone, Copy, Debug)]
struct Glow {
    at: DVec3,
    strength: f64,
}

/// A particle with the share of its life that is over.
struct Particle {
    glow: Glow,
    age: f64,
}

fn burning() -> Burning {
    Burning {
        boat: 0,
        since_s: 0.0,
        wind: DVec2::new(3.0, -1.0),
        eye: DVec3::Z,
        visibility_m: 1e5,
        white_cd_m2: 1.0,
    }
}

/// Particles at a moment, all of them together of strength 1: they rise through the flames, lean with the wind, and fade.
fn particles(moment: u64) -> Vec<Particle> {
    let height_m = burning().flame_height_m(60.0);
    let lean = (burning().wind * (height_m / 4.0 * 0.6)).clamp_length_max(height_m);
    let time_s = moment as f64 * 0.137;
    let made = |i: u64| {
        let born = even(7 * i);
        let age = (time_s / LIFE_S + born).fract();
        // Each is reborn somewhere else.
        let life = (time_s / LIFE_S + born).floor() as u64;
        let chance = |k: u64| 2.0 * even((i * 64 + life) * 5 + k) - 1.0;
        let stray =
            DVec3::new(chance(1), chance(2), 0.2 * chance(3)) * (0.5 * DIAMETER_M * (1.0 - 0.6 * age));
        let at = stray + (lean * age).extend(height_m * age);
        Particle { glow: Glow { at, strength: (1.0 - age) * (1.0 + 0.5 * chance(4)) }, age }
    };
    let mut all: Vec<Particle> = (0..PARTICLES).map(made).collect();
    let sum: f64 = all.iter().map(|p| p.glow.strength).sum();
    all.iter_mut().for_each(|p| p.glow.strength /= sum);
    all
}

/// Lights of groups by remaining life; their places are the plain mean as printed, or weighted by strength.
fn groups(particles: &[Particle], count: usize, is_weighted: bool) -> Vec<Glow> {
    let mut sums = vec![(DVec3::ZERO, 0.0, 0.0); count];
    for p in particles {
        let weight = if is_weighted { p.glow.strength } else { 1.0 };
        let sum = &mut sums[((p.age * count as f64) as usize).min(count - 1)];
        sum.0 += p.glow.at * weight;
        sum.1 += weight;
        sum.2 += p.glow.strength;
    }
    let filled = sums.into_iter().filter(|(_, weight, _)| *weight > 0.0);
    filled.map(|(place, weight, strength)| Glow { at: place / weight, strength }).collect()
}

/// One lamp at that share of the flames' height; the product's is at half.
fn lamp(share: f64) -> Vec<Glow> {
    vec![Glow { at: DVec3::Z * (share * burning().flame_height_m(60.0)), strength: 1.0 }]
}

/// Irradiance at a place of that normal.
fn irradiance(lights: &[Glow], (place, normal): (DVec3, DVec3)) -> f64 {
    let one = |light: &Glow| {
        let to = light.at - place;
        light.strength * to.dot(normal).max(0.0) / to.length().powi(3).max(1e-6)
    };
    lights.iter().map(one).sum()
}

/// Places around the fire between two distances, on a level deck a metre below it and on upright faces towards it.
fn places(near_m: f64, far_m: f64) -> Vec<(DVec3, DVec3)> {
    let place = |i: u64| {
        let away = DVec2::from_angle(even(4 * i) * std::f64::consts::TAU);
        let distance = near_m + (far_m - near_m) * even(4 * i + 1);
        if i.is_multiple_of(2) {
            ((away * distance).extend(-0.8), DVec3::Z)
        } else {
            ((away * distance).extend(2.0 * even(4 * i + 2) - 0.8), -away.extend(0.0))
        }
    };
    (0..64).map(place).collect()
}

/// Ways by name, setting, and how they make lights.
type Gather = (&'static str, String, Box<dyn Fn(&[Particle]) -> Vec<Glow>>);

fn ways() -> Vec<Gather> {
    let mut ways: Vec<Gather> = vec![
        ("one lamp", "half way up the flames".into(), Box::new(|_| lamp(0.5))),
        ("one lamp", "a third of the way up".into(), Box::new(|_| lamp(1.0 / 3.0))),
    ];
    for count in [1, 2, 4, 8, 16] {
        ways.push((
            "groups by life",
            format!("{count}, plain mean, as printed"),
            Box::new(move |p| groups(p, count, false)),
        ));
        ways.push((
            "groups by life",
            format!("{count}, weighted mean"),
            Box::new(move |p| groups(p, count, true)),
        ));
    }
    ways.push(("all particles", String::new(), Box::new(|p| p.iter().map(|p| p.glow).collect())));
    ways
}

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let moments: Vec<Vec<Particle>> = (0..24).map(particles).collect();
    for (name, near_m, far_m) in
        [("1 to 3 m from the fire", 1.0, 3.0), ("4 to 20 m from the fire", 4.0, 20.0)]
    {
        let places = places(near_m, far_m);
        let truth = |particles: &[Particle]| {
            let all: Vec<Glow> = particles.iter().map(|p| p.glow).collect();
            places.iter().map(|place| irradiance(&all, *place)).collect::<Vec<f64>>()
        };
        let truths: Vec<Vec<f64>> = moments.iter().map(|moment| truth(moment)).collect();
        let measured = ways().into_iter().enumerate().map(|(i, (method, setting, gather))| {
            let off = moments.iter().zip(&truths).flat_map(|(moment, truth)| {
                let lights = gather(moment);
                let off = |(place, truth): (&(DVec3, DVec3), &f64)| {
                    irradiance(&lights, *place) / truth.max(1e-9) - 1.0
                };
                places.iter().zip(truth).map(off).collect::<Vec<f64>>()
            });
            let error = 100.0 * rms(off);
            let (moment, places) = (&moments[5], &places);
            let work = move || {
                let lights = gather(moment);
                places.iter().map(|place| irradiance(&lights, *place)).sum::<f64>()
            };
            let way = Way::new(method, &setting, error, places.len(), work);
            if i == 0 {
                way.default_although("a lower lamp errs less here; tried in a boat that burns inside, it stood below the deck and left it dark")
            } else {
                way
            }
        });
        bench.scene(name, "% of the irradiance", 0.01, measured.collect());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_groups_are_nearer_to_all_particles_and_far_away_one_lamp_does() {
        let moment = particles(3);
        let all: Vec<Glow> = moment.iter().map(|p| p.glow).collect();
        let off = |lights: &[Glow], near_m, far_m| {
            rms(places(near_m, far_m)
                .into_iter()
                .map(|p| irradiance(lights, p) / irradiance(&all, p).max(1e-9) - 1.0))
        };
        assert!(off(&groups(&moment, 16, true), 1.0, 3.0) < 0.7 * off(&groups(&moment, 1, true), 1.0, 3.0));
        assert!(off(&lamp(0.5), 15.0, 20.0) < off(&lamp(0.5), 1.0, 3.0));
        let sum: f64 = groups(&moment, 4, false).iter().map(|g| g.strength).sum();
        assert!((sum - 1.0).abs() < 1e-9);
    }
}
