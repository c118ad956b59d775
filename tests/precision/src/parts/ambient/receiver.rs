//! Places that get light, and what is around them.

use std::f64::consts::PI;

use bowwave_core::{
    colour::LUMINANCE,
    sky::{LOBES, SkyLobes},
};
use glam::{DVec3, Vec3};
use hw_sim::ocean::mesh::BoatMesh;

use super::{ABOVE, BELOW, STORED, Stored, TRUE, harmonics, spiral};

/// Light from all around, as luminance.
pub struct Surroundings<'a> {
    light: Box<dyn Fn(DVec3) -> Vec3 + Sync + 'a>,
    /// Luminance by the truth's directions.
    seen: Vec<f64>,
    /// Irradiance on a level face in the open.
    pub level: f64,
}

impl<'a> Surroundings<'a> {
    /// Of that radiance by direction.
    pub fn new(light: impl Fn(DVec3) -> Vec3 + Sync + 'a) -> Self {
        let seen: Vec<f64> = spiral(TRUE).map(|d| f64::from(light(d).dot(LUMINANCE))).collect();
        let level =
            spiral(TRUE).zip(&seen).map(|(d, l)| d.z.max(0.0) * l).sum::<f64>() * 4.0 * PI / f64::from(TRUE);
        Self { light: Box::new(light), seen, level }
    }

    /// Radiance from a unit direction.
    pub fn radiance(&self, d: DVec3) -> Vec3 {
        (self.light)(d)
    }

    fn luminance(&self, d: DVec3) -> f64 {
        f64::from(self.radiance(d).dot(LUMINANCE))
    }

    /// What a frame makes of the light for that way of storing.
    pub fn coefficients(&self, stored: Stored) -> Vec<f64> {
        match stored {
            Stored::Harmonics(order, is_windowed) => {
                let mut sums = vec![0.0; harmonics::count(order)];
                let share = 4.0 * PI / f64::from(STORED);
                for (d, values) in spiral(STORED).zip(harmonics::table()) {
                    let light = self.luminance(d) * share;
                    sums.iter_mut().zip(values).for_each(|(sum, y)| *sum += light * y);
                }
                if is_windowed {
                    sums.iter_mut().zip(harmonics::window(order)).for_each(|(sum, w)| *sum *= w);
                }
                sums
            }
            Stored::Open => self.coefficients(Stored::Harmonics(3, false)),
            Stored::Patches(count) => spiral(count).map(|d| self.luminance(d)).collect(),
            Stored::Lobes => {
                let lobes = SkyLobes::of(|d| Vec3::splat(self.luminance(d) as f32));
                let below = spiral(STORED).filter(|d| d.z < 0.0);
                let sea: f64 = below.map(|d| self.luminance(d)).sum::<f64>() * 2.0 / f64::from(STORED);
                lobes.terms.iter().map(|t| f64::from(t.y)).chain([sea]).collect()
            }
        }
    }
}

/// A place with its normal, with or without the boat around it.
#[derive(Clone, Copy)]
pub struct Receiver<'a> {
    /// The boat.
    pub boat: Option<&'a BoatMesh>,
    /// Place and unit normal.
    pub at: (DVec3, DVec3),
}

impl Receiver<'_> {
    fn sees(&self, d: DVec3) -> bool {
        !self.boat.is_some_and(|boat| boat.blocks(self.at.0, d))
    }

    /// Irradiance in each of the surroundings, by rays.
    pub fn truth(&self, all: &[Surroundings<'_>]) -> Vec<f64> {
        let (_, normal) = self.at;
        let mut sums = vec![0.0; all.len()];
        for (i, d) in spiral(TRUE).enumerate() {
            let cosine = d.dot(normal);
            if cosine > 0.0 && self.sees(d) {
                let share = cosine * 4.0 * PI / f64::from(TRUE);
                sums.iter_mut().zip(all).for_each(|(sum, s)| *sum += share * s.seen[i]);
            }
        }
        sums
    }

    /// What is stored here for a way.
    pub fn stored(&self, stored: Stored) -> Vec<f64> {
        let (_, normal) = self.at;
        match stored {
            Stored::Harmonics(order, _) => {
                let mut sums = vec![0.0; harmonics::count(order)];
                let share = 4.0 * PI / f64::from(STORED);
                for (d, values) in spiral(STORED).zip(harmonics::table()) {
                    let cosine = d.dot(normal);
                    if cosine > 0.0 && self.sees(d) {
                        sums.iter_mut().zip(values).for_each(|(sum, y)| *sum += share * cosine * y);
                    }
                }
                sums
            }
            Stored::Open => Receiver { boat: None, ..*self }.stored(Stored::Harmonics(3, false)),
            Stored::Patches(count) => {
                let share = 4.0 * PI / f64::from(count);
                let seen =
                    |d: DVec3| if d.dot(normal) > 0.0 && self.sees(d) { share * d.dot(normal) } else { 0.0 };
                spiral(count).map(seen).collect()
            }
            Stored::Lobes => self.lobes(),
        }
    }

    /// The product's transfer: so many directions above and below.
    fn lobes(&self) -> Vec<f64> {
        let (_, normal) = self.at;
        let mut sums = vec![0.0; LOBES + 1];
        for (is_above, count) in [(true, ABOVE), (false, BELOW)] {
            let share = 2.0 * PI / f64::from(count);
            for i in 0..count {
                let z = (f64::from(i) + 0.5) / f64::from(count) * if is_above { 1.0 } else { -1.0 };
                let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
                let level = (1.0 - z * z).sqrt();
                let d = DVec3::new(level * cos, level * sin, z);
                let cosine = d.dot(normal);
                if cosine <= 0.0 || !self.sees(d) {
                    continue;
                }
                if is_above {
                    let basis = SkyLobes::basis(d);
                    sums.iter_mut().zip(basis).for_each(|(sum, value)| *sum += share * cosine * value);
                } else {
                    sums[LOBES] += share * cosine;
                }
            }
        }
        sums
    }
}
