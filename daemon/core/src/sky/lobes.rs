//! The light of a half of the sky as a polynomial of direction, which turns with a boat at no cost.

use glam::{DMat3, DQuat, DVec3, Vec3};

/// Coefficients of the nine: 1, x, y, z, xy, xz, yz, x^2 - y^2, 3 z^2 - 1.
pub const LOBES: usize = 9;

/// Radiance over the upper half of the directions as nine polynomials of the direction: the spherical harmonics to the second order, fitted
/// where there is sky and left free below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyLobes {
    /// Of each of the nine.
    pub terms: [Vec3; LOBES],
}

impl Default for SkyLobes {
    fn default() -> Self {
        Self { terms: [Vec3::ZERO; LOBES] }
    }
}

impl SkyLobes {
    /// The nine polynomials of a unit direction.
    pub fn basis(d: DVec3) -> [f64; LOBES] {
        [1.0, d.x, d.y, d.z, d.x * d.y, d.x * d.z, d.y * d.z, d.x * d.x - d.y * d.y, 3.0 * d.z * d.z - 1.0]
    }

    /// The sky whose radiance is so.
    pub fn of(radiance: impl Fn(DVec3) -> Vec3) -> Self {
        let mut terms = [Vec3::ZERO; LOBES];
        for (direction, shares) in projection() {
            let light = radiance(*direction);
            for (term, share) in terms.iter_mut().zip(shares) {
                *term += light * *share as f32;
            }
        }
        Self { terms }
    }

    /// The same radiance from everywhere.
    pub fn even(radiance: Vec3) -> Self {
        let mut lobes = Self::default();
        lobes.terms[0] = radiance;
        lobes
    }

    /// Radiance from unit `direction`.
    pub fn at(&self, direction: DVec3) -> Vec3 {
        self.terms.iter().zip(Self::basis(direction)).map(|(term, value)| *term * value as f32).sum()
    }

    /// Irradiance of that light on a level surface.
    pub fn on_level(&self) -> Vec3 {
        // Over the upper half, the cosine's integral with 1 is pi, with z 2 pi / 3, with 3 z^2 - 1 pi / 2; with the others nothing.
        let pi = std::f32::consts::PI;
        self.terms[0] * pi + self.terms[3] * (2.0 * pi / 3.0) + self.terms[8] * (0.5 * pi)
    }

    /// The same light by the directions of a body.
    #[must_use]
    pub fn turned(&self, world_from_body: DQuat) -> Self {
        let turn = DMat3::from_quat(world_from_body);
        let mut terms = [Vec3::ZERO; LOBES];
        for channel in 0..3 {
            let t: [f64; LOBES] = std::array::from_fn(|i| f64::from(self.terms[i][channel]));
            let line = turn.transpose() * DVec3::new(t[1], t[2], t[3]);
            // The terms of the second order as a symmetric matrix of no trace.
            let square = DMat3::from_cols(
                DVec3::new(t[7] - t[8], 0.5 * t[4], 0.5 * t[5]),
                DVec3::new(0.5 * t[4], -t[7] - t[8], 0.5 * t[6]),
                DVec3::new(0.5 * t[5], 0.5 * t[6], 2.0 * t[8]),
            );
            let s = turn.transpose() * square * turn;
            let (xx, yy) = (s.x_axis.x, s.y_axis.y);
            let of_body = [
                t[0],
                line.x,
                line.y,
                line.z,
                2.0 * s.x_axis.y,
                2.0 * s.x_axis.z,
                2.0 * s.y_axis.z,
                0.5 * (xx - yy),
                0.5 * s.z_axis.z,
            ];
            for (term, value) in terms.iter_mut().zip(of_body) {
                term[channel] = value as f32;
            }
        }
        Self { terms }
    }

    /// Moves a share of the way to `other`.
    #[must_use]
    pub fn towards(&self, other: &Self, share: f32) -> Self {
        Self { terms: std::array::from_fn(|i| self.terms[i].lerp(other.terms[i], share)) }
    }

    /// Adds so much of another.
    pub fn add(&mut self, other: &Self, times: Vec3) {
        self.terms.iter_mut().zip(other.terms).for_each(|(term, other)| *term += other * times);
    }
}

/// Directions over the upper half and by how much the radiance from each goes into each of the nine: least squares by solid angle.
fn projection() -> &'static [(DVec3, [f64; LOBES])] {
    use std::sync::OnceLock;
    static PROJECTION: OnceLock<Vec<(DVec3, [f64; LOBES])>> = OnceLock::new();
    /// Rings of even solid angle, and directions in each.
    const UP: u32 = 12;
    const AROUND: u32 = 24;
    /// Damping of the second order: with it no clear sky's polynomial is negative anywhere, whose aureole would have it so.
    const DAMPED: f64 = 0.15;
    PROJECTION.get_or_init(|| {
        let directions: Vec<DVec3> = (0..UP * AROUND)
            .map(|i| {
                let sine = (f64::from(i / AROUND) + 0.5) / f64::from(UP);
                let azimuth = (f64::from(i % AROUND) + 0.5) / f64::from(AROUND) * std::f64::consts::TAU;
                let (sin, cos) = azimuth.sin_cos();
                let level = (1.0 - sine * sine).sqrt();
                DVec3::new(level * cos, level * sin, sine)
            })
            .collect();
        let count = directions.len() as f64;
        let mut normal = nalgebra::SMatrix::<f64, LOBES, LOBES>::zeros();
        for direction in &directions {
            let row = nalgebra::SVector::from(SkyLobes::basis(*direction));
            normal += row * row.transpose() / count;
        }
        for i in 4..LOBES {
            normal[(i, i)] *= 1.0 + DAMPED;
        }
        let inverse = normal.try_inverse().unwrap_or_else(nalgebra::SMatrix::zeros);
        directions
            .into_iter()
            .map(|d| (d, (inverse * nalgebra::SVector::from(SkyLobes::basis(d)) / count).into()))
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_turned_sends_the_same_light() {
        let lobes =
            SkyLobes::of(|d| Vec3::new(1.0 + d.x as f32, 2.0 + (d.x * d.y) as f32, (d.z * d.z) as f32));
        let turn = DQuat::from_euler(glam::EulerRot::ZYX, 0.7, 0.2, -0.3);
        let turned = lobes.turned(turn);
        for d in [DVec3::X, DVec3::Z, DVec3::new(0.6, -0.8, 0.0), DVec3::new(0.48, 0.6, 0.64)] {
            assert!((turned.at(d) - lobes.at(turn * d)).abs().max_element() < 1e-5, "{d}");
        }
    }
}
