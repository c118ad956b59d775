//! A vessel before an eye: how many times the contrast that it has is of what the eye needs.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, DVec3};

use super::{
    ambient::Ambient,
    threshold::{self, FIELD, SEEN},
};
use crate::{
    geometry::{curvature_drop, horizon_dip, horizon_distance},
    physics::extinction_per_m,
};

/// Share of the box about a vessel that its outline fills.
const FILLS: f64 = 0.5;
/// Share of the sky's light on a level surface that an upright one gets: half of the sky, and what the sea throws back.
const UPRIGHT: f64 = 0.55;
/// Least share of a hull that is lit while any is.
const LEAST_SHARE: f64 = 1e-6;
/// Nothing is looked at from nearer, metres.
const NEAREST_M: f64 = 1.0;

/// A vessel, as far as it matters whether it is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Width across the line of sight, metres.
    pub breadth_m: f64,
    /// Height over the water, metres.
    pub height_m: f64,
    /// Share of light that it throws back, 0 to 1.
    pub reflectance: f64,
    /// Illuminance by a searchlight beside the eye, lux.
    pub lamp_lux: f64,
    /// Intensity of its own lights towards the eye, candela.
    pub candela: f64,
}

/// A light in an eye.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Glare {
    /// Illuminance at the eye, lux.
    pub lux: f64,
    /// Angle between it and what is looked at, radians.
    pub off: f64,
}

/// Light and air of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seeing {
    /// The light.
    pub ambient: Ambient,
    /// Meteorological visibility, metres.
    pub visibility_m: f64,
}

impl Seeing {
    /// A clear day, where no scenario says otherwise.
    pub fn clear_day() -> Self {
        Self { ambient: Ambient::new(DVec3::Z, 1.0, None, 5.0), visibility_m: 20_000.0 }
    }

    /// Its contrast, or its light, over what half of the glimpses of an alert watcher at `eye` need who looks at it; `at` is its
    /// waterline. World, metres. 0 for what the horizon or haze hides altogether.
    pub fn times_threshold(&self, eye: DVec3, at: DVec3, target: &Target, glare: Glare) -> f64 {
        let flat = (at - eye).truncate();
        let range_m = flat.length().max(NEAREST_M);
        let through = (-extinction_per_m(self.visibility_m.max(1e-3)) * range_m).exp();
        let Some(shown) = Shown::of(eye.z, range_m, target.height_m) else { return 0.0 };
        let direction = flat.extend(0.0).normalize_or(DVec3::Y);
        let Ambient { sky_cd_m2, sea_cd_m2, .. } = self.ambient;
        let (before_sky, before_sea) = (shown.above_horizon, 1.0 - shown.above_horizon);
        // Air makes the sea as bright as the sky at the horizon, and takes of all differences (Koschmieder 1924).
        let sea_there = sea_cd_m2 * through + sky_cd_m2 * (1.0 - through);
        let behind = before_sky * sky_cd_m2 + before_sea * sea_there + self.veil_cd_m2(direction, glare);
        let solid_angle_sr = FILLS * target.breadth_m.max(0.0) * shown.height_m / (range_m * range_m);
        let by_part = self.faces(target, direction).map(|Face { share, cd_m2 }| {
            let off = before_sky * (cd_m2 - sky_cd_m2).abs() + before_sea * (cd_m2 - sea_cd_m2).abs();
            off * through / behind / (FIELD * threshold::contrast(behind, solid_angle_sr * share))
        });
        let by_hull = by_part.into_iter().fold(0.0, f64::max);
        let lux = target.candela.max(0.0) * through / (range_m * range_m);
        by_hull.max(lux / (FIELD * threshold::illuminance(behind)))
    }

    /// Range within which a watcher at `eye_m` over the sea who looks there sees a vessel that lies in unit `direction`, metres; no more than `most_m`.
    pub fn farthest_m(&self, eye_m: f64, direction: DVec3, target: &Target, most_m: f64) -> f64 {
        let seen = |range_m: f64| {
            let at = (direction * range_m).with_z(0.0);
            threshold::chance(self.times_threshold(DVec3::Z * eye_m, at, target, Glare::default())) >= SEEN
        };
        let (mut low, mut high) = (0.0, most_m);
        if seen(high) {
            return high;
        }
        while high - low > 1.0 {
            let middle = 0.5 * (low + high);
            if seen(middle) { low = middle } else { high = middle }
        }
        low
    }

    /// All of a hull that is seen in unit `direction`, what of it the body lights that shines, and what lies in its shadow: a hull as bright
    /// in the mean as the sea is still seen by its sides.
    fn faces(&self, target: &Target, direction: DVec3) -> [Face; 3] {
        let Ambient { towards, direct_lux, sky_lux, .. } = self.ambient;
        let level = towards.truncate();
        let aside = (-direction).truncate().angle_to(level).abs();
        let aside = if level != DVec2::ZERO && aside.is_finite() { aside } else { FRAC_PI_2 };
        let lit = 0.5 * (1.0 + aside.cos());
        let shade_lux = UPRIGHT * sky_lux + target.lamp_lux.max(0.0) * upright_share(0.0);
        let by_body = direct_lux * level.length() * upright_share(aside);
        let face =
            |share: f64, lux: f64| Face { share, cd_m2: target.reflectance.clamp(0.0, 1.0) * lux / PI };
        [
            face(1.0, shade_lux + by_body),
            face(lit, shade_lux + by_body / lit.max(LEAST_SHARE)),
            face(1.0 - lit, shade_lux),
        ]
    }

    /// Luminance that sun or moon, and another light, spread in an eye that looks in unit `direction`, cd/m^2.
    fn veil_cd_m2(&self, direction: DVec3, glare: Glare) -> f64 {
        let Ambient { towards, direct_lux, .. } = self.ambient;
        let off = direction.angle_between(towards);
        let into_eye = direct_lux * off.cos().max(0.0);
        threshold::veil_cd_m2(into_eye, off) + threshold::veil_cd_m2(glare.lux, glare.off)
    }
}

/// Mean illuminance over what is seen of an upright drum, as a share of that of a surface that faces the light, which comes level and `aside`
/// radians from behind the eye: a vessel has faces to all sides.
fn upright_share(aside: f64) -> f64 {
    let aside = aside.clamp(0.0, PI);
    (((PI - aside) * aside.cos() + aside.sin()) / 4.0).max(0.0)
}

/// Part of a hull.
#[derive(Clone, Copy, Debug)]
struct Face {
    /// Share of what is seen of the hull.
    share: f64,
    /// Its luminance.
    cd_m2: f64,
}

/// Part of a vessel that the Earth leaves.
#[derive(Clone, Copy, Debug)]
struct Shown {
    /// Its height, metres.
    height_m: f64,
    /// Share of it that stands before the sky.
    above_horizon: f64,
}

impl Shown {
    /// The part that an eye `eye_m` over the sea has of a vessel `height_m` high; `None` where that is nothing.
    fn of(eye_m: f64, range_m: f64, height_m: f64) -> Option<Self> {
        let eye_m = eye_m.max(0.0);
        let beyond_m = range_m - horizon_distance(eye_m);
        let hidden_m = if beyond_m > 0.0 { curvature_drop(beyond_m) } else { 0.0 };
        let shown_m = height_m - hidden_m;
        if shown_m.is_nan() || shown_m <= 0.0 {
            return None;
        }
        // Height at which the line from eye to horizon passes the vessel.
        let line_m = eye_m + curvature_drop(range_m) - horizon_dip(eye_m) * range_m;
        let line_m = if beyond_m > 0.0 { hidden_m } else { line_m };
        Some(Self { height_m: shown_m, above_horizon: ((height_m - line_m) / shown_m).clamp(0.0, 1.0) })
    }
}

#[cfg(test)]
#[path = "sight_tests.rs"]
mod tests;
