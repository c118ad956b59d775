//! Slopes below the resolved waves: what of them is seen, how light goes on from there, and the sun's glitter.
//!
//! The unresolved surface is a Gaussian random surface on top of the resolved one, with the masking of Smith 1967 in the form of
//! Heitz 2014 (J. Comput. Graph. Tech. 3, 2), and light that strikes it several times after Heitz, Hanika, d'Eon & Dachsbacher 2016
//! (ACM Trans. Graph. 35, 4). Heights add and slopes with them, so a tilted facet is a shear of the horizontal case.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use glam::{DVec2, DVec3};

use super::{
    fresnel::{SEA_WATER_INDEX, fresnel},
    noise::normal_quantile,
    random::LightPath,
    waves::Unresolved,
};

fn density(x: f64) -> f64 {
    (-0.5 * x * x).exp() * 0.398_942_280_401_432_7
}

/// Normal probability of more than `x`.
fn upper(x: f64) -> f64 {
    0.5 * libm::erfc(x * FRAC_1_SQRT_2)
}

/// The unresolved surface at one place, and directions in it.
#[derive(Clone, Copy)]
pub struct Micro {
    along: DVec2,
    sigma: DVec2,
    slope: DVec2,
}

/// Direction as the surface sees it.
#[derive(Clone, Copy)]
struct SeenSlope {
    /// Sine of the elevation over the mean facet, sheared.
    up: f64,
    /// Standard deviation of the slope along the direction times its horizontal length.
    spread: f64,
}

impl SeenSlope {
    fn t(self) -> f64 {
        self.up / self.spread.max(1e-9)
    }

    /// Smith's ratio of hidden to seen area; below -1 for directions that point into the surface.
    fn hidden(self) -> f64 {
        let t = self.t().abs();
        let outward = if t > 8.0 { 0.0 } else { density(t) / t.max(1e-9) - upper(t) };
        if self.up >= 0.0 { outward } else { -1.0 - outward }
    }

    /// Area seen from the direction, of a unit of horizontal area, front facets counted without masking.
    fn front_area(self) -> f64 {
        let t = self.t();
        if t > 8.0 { self.up } else { self.spread * (t * upper(-t) + density(t)) }
    }
}

impl Micro {
    /// The surface about a resolved slope.
    pub fn new(unresolved: &Unresolved, slope: DVec2) -> Self {
        Self { along: unresolved.along, sigma: unresolved.sigma, slope }
    }

    /// Whether it is a mirror.
    pub fn is_mirror(&self) -> bool {
        self.sigma.max_element() < 1e-6
    }

    fn wind_axes(&self, v: DVec2) -> DVec2 {
        DVec2::new(v.dot(self.along), self.along.perp_dot(v))
    }

    fn seen(&self, d: DVec3) -> SeenSlope {
        let flat = d.truncate();
        SeenSlope { up: d.z - flat.dot(self.slope), spread: (self.wind_axes(flat) * self.sigma).length() }
    }

    /// A facet's normal, as often as its area is seen from `to_eye`.
    pub fn visible_normal(&self, to_eye: DVec3, path: &mut LightPath) -> DVec3 {
        let (first, second) = (path.unit(), path.unit());
        if self.is_mirror() {
            return (-self.slope).extend(1.0).normalize();
        }
        let stretched = self.wind_axes(to_eye.truncate()) * self.sigma;
        let axis = if stretched.length_squared() > 1e-18 { stretched.normalize() } else { DVec2::X };
        let across = normal_quantile(second);
        let p = axis * -visible_slope(self.seen(to_eye).t(), first) + axis.perp() * across;
        let local = p * self.sigma;
        let slope = self.slope + self.along * local.x + self.along.perp() * local.y;
        (-slope).extend(1.0).normalize()
    }

    /// Radiance that the facets at height `cumulative` (share of heights below) send towards `to_eye` of a distant small light
    /// in direction `to_light`, for a unit of irradiance on a plane that faces it, Fresnel factor included.
    pub fn glint(&self, to_eye: DVec3, to_light: DVec3, cumulative: f64) -> f64 {
        let half = (to_eye + to_light).normalize_or_zero();
        let light = self.seen(to_light);
        if half.z < 1e-3 || light.up <= 0.0 || self.sigma.min_element() <= 0.0 {
            return 0.0;
        }
        let off = self.wind_axes(-half.truncate() / half.z - self.slope) / self.sigma;
        let exponent = off.length_squared() / 2.0;
        let area = self.seen(to_eye).front_area();
        if exponent > 30.0 || area < 1e-12 {
            return 0.0;
        }
        let slopes = (-exponent).exp() / (2.0 * PI * self.sigma.x * self.sigma.y);
        let unshadowed = cumulative.powf(light.hidden());
        fresnel(to_eye.dot(half), SEA_WATER_INDEX) * slopes / (4.0 * half.z.powi(4) * area) * unshadowed
    }

    /// Share of heights below the place where a ray in `direction`, which set out at share `from`, strikes the surface; `None` when it
    /// leaves it.
    pub fn strike(&self, direction: DVec3, from: f64, path: &mut LightPath) -> Option<f64> {
        let u = path.unit();
        let seen = self.seen(direction);
        if self.is_mirror() {
            return (seen.up < 0.0).then_some(1.0);
        }
        let hidden = seen.hidden();
        if seen.up >= 0.0 && (hidden <= 0.0 || u > 1.0 - from.powf(hidden)) {
            return None;
        }
        Some((from / (1.0 - u).powf(1.0 / hidden)).clamp(1e-9, 1.0))
    }
}

/// Quantile of the density (t + u)+ phi(u): minus the slope towards the eye of a facet, in standard deviations, as often as seen under
/// the elevation t.
fn visible_slope(t: f64, quantile: f64) -> f64 {
    let (mut low, mut high) = (-t, (-t).max(0.0) + 8.0);
    if t > 8.0 {
        low = -8.0;
    }
    // Area above u, from the far end, where nothing cancels.
    let above = |u: f64| t * upper(u) + density(u);
    let total = if t > 8.0 { t } else { above(-t) };
    let wanted = (1.0 - quantile) * total;
    let mut u = if t < -2.0 { low + 1.0 / (1.0 - t) } else { normal_quantile(quantile).max(low + 0.1) };
    for _ in 0..24 {
        let miss = above(u) - wanted;
        if miss > 0.0 {
            low = u;
        } else {
            high = u;
        }
        let slope = (t + u) * density(u);
        let next = u + miss / slope.max(1e-300);
        let next = if next > low && next < high { next } else { (low + high) / 2.0 };
        if (next - u).abs() < 1e-7 {
            return next;
        }
        u = next;
    }
    u
}
