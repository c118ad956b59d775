//! The gun's searchlight as the camera sees it: the light that the air in its beam throws back, and what it lights of the sea.
//!
//! The sea's picture is real and the beam is not: what it would add to the picture's light is all that can be drawn.

use std::f64::consts::FRAC_1_PI;

use glam::{DVec3, Vec3};

use crate::{physics::extinction_per_m, world::searchlight::SearchlightSpec};

/// The lamp's place beside the camera, camera's axes, metres: on the ship's side, to the right of the gun and a little lower. On the gun itself,
/// the air before it would blind the camera: what lies between beam and line of sight is what a searchlight sees by.
const LAMP_IN_CAMERA: DVec3 = DVec3::new(4.0, 2.0, 0.0);
/// It follows the gun so that the beam's axis meets the barrel's this far off, metres.
const MEETS_M: f64 = 300.0;

/// Share of what air takes of a beam that it throws straight back, 1/sr: marine aerosol has an extinction-to-backscatter ratio of 23 sr
/// (Mueller et al. 2007, "Aerosol-type-dependent lidar ratios observed with Raman lidar", table 1). All that is seen of the beam is nearly
/// straight back, so that no more of the phase function is needed.
pub(super) const BACKSCATTER_PER_SR: f64 = 1.0 / 23.0;

/// Share of the light within the sea that comes out of it again, by colour: coastal water of little chlorophyll (Mobley 1994, "Light and
/// Water", figure 3.27). Waves seen from the lamp throw nothing straight back: their slopes are too small.
pub const SEA_ALBEDO: Vec3 = Vec3::new(0.015, 0.03, 0.028);

/// The searchlight in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchlightView {
    /// The lamp, camera's axes, metres.
    pub lamp: DVec3,
    /// The beam's axis, camera's axes, unit vector.
    pub axis: DVec3,
    /// Its intensity falls with `exp(-sharpness off^2)` off the axis, 1/rad^2.
    pub sharpness: f64,
    /// Intensity on the axis over the luminance that the camera shows as white, m^2.
    pub strength: f64,
    /// Share of light that air takes in a metre.
    pub extinction_per_m: f64,
}

impl SearchlightView {
    /// A searchlight along `bore` (camera's axes), seen by a camera that shows so many cd/m^2 as white, in air of that visibility.
    pub fn new(spec: &SearchlightSpec, bore: DVec3, white_cd_m2: f64, visibility_m: f64) -> Self {
        Self {
            lamp: LAMP_IN_CAMERA,
            axis: (bore * MEETS_M - LAMP_IN_CAMERA).normalize(),
            sharpness: spec.sharpness(),
            strength: spec.candela / white_cd_m2,
            extinction_per_m: extinction_per_m(visibility_m),
        }
    }

    /// Light that air within the beam sends to the camera from along `ray` (camera's axes, unit vector) up to `end_m` metres, for a
    /// [`Self::strength`] of 1: the integral of single scattering over the ray, in equal steps of the angle at the lamp (Kulla & Fajardo
    /// 2012, "Importance sampling techniques for path tracing in participating media", section 4), over the angles that the beam has.
    pub fn haze(&self, ray: DVec3, end_m: f64) -> f64 {
        /// Steps of the angle, and deviations of the beam that they reach over on both sides.
        const STEPS: u32 = 16;
        const REACH: f64 = 3.3;
        let along = self.lamp.dot(ray);
        let off = self.lamp - ray * along;
        let off_m = off.length().max(1e-3);
        let aside = off / off_m;
        // Towards the ray's point at that angle the lamp looks along sin(angle) ray - cos(angle) aside.
        let (forward, sideways) = (ray.dot(self.axis), aside.dot(self.axis));
        let nearest = forward.atan2(-sideways);
        let in_plane = forward.hypot(sideways).min(1.0);
        let deviation = (0.5 / self.sharpness).sqrt();
        let low = (nearest - REACH * deviation).max((-along / off_m).atan());
        let high = (nearest + REACH * deviation).min(((end_m - along) / off_m).atan());
        if high <= low || forward <= 0.0 {
            return 0.0;
        }
        let step = (high - low) / f64::from(STEPS);
        let of_step = |i: u32| {
            let angle = low + step * (f64::from(i) + 0.5);
            let from_lamp_m = off_m / angle.cos();
            let from_eye_m = along + off_m * angle.tan();
            // The squared angle of a cosine: 2 x + x^2 / 3 + ... with x = 1 - cos.
            let x = 1.0 - in_plane * (angle - nearest).cos();
            let off2 = x * (2.0 + x * (1.0 / 3.0 + x * (4.0 / 45.0)));
            (-self.sharpness * off2 - self.extinction_per_m * (from_lamp_m + from_eye_m)).exp()
        };
        let sum: f64 = (0..STEPS).map(of_step).sum();
        self.scattered_per_m() * sum * step / off_m
    }

    /// Share of a beam that a metre of air throws straight back, 1/(m sr).
    pub fn scattered_per_m(&self) -> f64 {
        self.extinction_per_m * BACKSCATTER_PER_SR
    }

    /// Light that the sea sends to the camera from where `ray` (camera's axes, unit vector) meets it, for a [`Self::strength`] of 1 and a sea
    /// that throws back all; `down` points to the sea's middle level (camera's axes, unit vector), `eye_height_m` below the camera.
    pub fn sea(&self, ray: DVec3, down: DVec3, eye_height_m: f64) -> f64 {
        let slope = ray.dot(down);
        if slope <= 0.0 {
            return 0.0;
        }
        let range_m = eye_height_m / slope;
        let from_lamp = ray * range_m - self.lamp;
        let squared = from_lamp.length_squared().max(1.0);
        let off = from_lamp.cross(self.axis).length_squared() / squared;
        let facing = from_lamp.dot(down) / squared.sqrt();
        if from_lamp.dot(self.axis) <= 0.0 || facing <= 0.0 {
            return 0.0;
        }
        let air_m = squared.sqrt() + range_m;
        FRAC_1_PI * (-self.sharpness * off - self.extinction_per_m * air_m).exp() * facing / squared
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::searchlight::SearchlightSpec;

    fn view(beam_deg: f64, visibility_m: f64) -> SearchlightView {
        let spec = SearchlightSpec { candela: 1.0, beam: beam_deg.to_radians(), is_on: true };
        SearchlightView::new(&spec, DVec3::Z, 1.0, visibility_m)
    }

    /// The same integral step by step along the ray, with the true angle at the lamp: by a rule and in a variable of its own.
    fn stepped(view: &SearchlightView, ray: DVec3, end_m: f64) -> f64 {
        let steps = 400_000;
        // Equal steps of the logarithm of the distance.
        let (low, high) = (1e-3f64.ln(), end_m.ln());
        let step = (high - low) / f64::from(steps);
        let of_step = |i: i32| {
            let s = (low + step * (f64::from(i) + 0.5)).exp();
            let from_lamp = ray * s - view.lamp;
            let r = from_lamp.length();
            let off = from_lamp.angle_between(view.axis);
            let light = (-view.sharpness * off * off - view.extinction_per_m * (s + r)).exp() / (r * r);
            light * s * step
        };
        view.extinction_per_m * BACKSCATTER_PER_SR * (0..steps).map(of_step).sum::<f64>()
    }

    #[test]
    fn the_airs_light_is_the_integral_along_the_ray() {
        for (beam_deg, visibility_m) in [(8.0, 2e4), (8.0, 300.0), (2.0, 4000.0), (25.0, 1e5)] {
            let view = view(beam_deg, visibility_m);
            let peak = stepped(&view, DVec3::Z, 2e4);
            for (x, y) in [(0.0, 0.0), (0.02, 0.01), (-0.05, 0.04), (0.2, 0.25), (0.3, 0.1), (0.0, -0.1)] {
                let ray = DVec3::new(x, y, 1.0).normalize();
                let (truth, found) = (stepped(&view, ray, 2e4), view.haze(ray, 2e4));
                assert!(
                    (found - truth).abs() < 0.02 * truth + 1e-3 * peak,
                    "{beam_deg} {visibility_m} {x} {y}: {found} {truth}"
                );
            }
            // Nearer than the beam's own light nothing of it is before it.
            assert!(view.haze(DVec3::Z, 30.0) < view.haze(DVec3::Z, 2e4));
        }
    }

    #[test]
    fn extremes_are_finite_and_behind_the_lamp_is_no_light() {
        for visibility_m in [50.0, 2e5] {
            for beam_deg in [0.5, 60.0] {
                let view = view(beam_deg, visibility_m);
                for ray in [DVec3::Z, -DVec3::Z, DVec3::X, view.lamp.normalize(), DVec3::Y] {
                    for light in [
                        view.haze(ray, 1e4),
                        view.haze(ray, 0.0),
                        view.sea(ray, DVec3::new(0.0, 0.954, 0.3), 8.0),
                        view.sea(ray, DVec3::Y, 8.0),
                    ] {
                        assert!(light.is_finite() && light >= 0.0, "{ray} {light}");
                    }
                }
                assert_eq!(view.haze(-DVec3::Z, 1e4), 0.0);
                assert_eq!(view.sea(-DVec3::Z, DVec3::new(0.0, 0.866, -0.5), 8.0), 0.0);
            }
        }
    }

    #[test]
    fn the_sea_is_lit_by_the_law_of_distance_and_slant() {
        let at_eye = SearchlightView { lamp: DVec3::ZERO, axis: DVec3::Z, ..view(60.0, 1e9) };
        let slope = 0.1f64;
        let down = DVec3::new(0.0, (1.0 - slope * slope).sqrt(), slope);
        let law = FRAC_1_PI * slope / 6400.0;
        assert!((at_eye.sea(DVec3::Z, down, 8.0) / law - 1.0).abs() < 1e-5);
        assert_eq!(at_eye.sea(DVec3::Z, -down, 8.0), 0.0, "the sky");
        // From three metres higher it falls on the sea that much less flatly.
        let above = SearchlightView { lamp: -down * 3.0, ..at_eye };
        let more = above.sea(DVec3::Z, down, 8.0) / law;
        assert!((more - 11.0 / 8.0).abs() < 0.05, "{more}");
    }
}
