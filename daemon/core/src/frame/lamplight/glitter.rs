//! Glitter: a lamp mirrored by waves that no picture resolves, on average.

use std::f64::consts::{FRAC_1_PI, PI};

use glam::DVec3;

use crate::sea::fresnel;

/// A lamp of intensity 1 over the sea.
#[derive(Clone, Copy, Debug)]
pub(super) struct Glitter {
    /// Its place, camera's axes, metres.
    pub lamp: DVec3,
    /// Upwards, camera's axes, unit vector.
    pub up: DVec3,
    /// Height of the camera over the sea, metres.
    pub eye_height_m: f64,
    /// Share of light that air takes in a metre.
    pub extinction_per_m: f64,
    /// Variance of the waves' slope along each axis.
    pub slope_variance: f64,
}

impl Glitter {
    /// Light that the sea sends to the camera along `ray` (unit vector), whose sine below the horizontal is `slope`, above 0: what waves mirror
    /// (Cox and Munk 1954, by facets that hide each other: Walter et al. 2007, eq. 20 with 23 and 27), and what a sea that throws back
    /// all would. 1/m^2.
    pub(super) fn sea(&self, ray: DVec3, slope: f64) -> (f64, f64) {
        let range_m = self.eye_height_m / slope;
        let towards = self.lamp - ray * range_m;
        let distance_m = towards.length().max(1.0);
        let towards = towards / distance_m;
        let falls = towards.dot(self.up);
        if falls <= 0.0 {
            return (0.0, 0.0);
        }
        let air = (-self.extinction_per_m * (distance_m + range_m)).exp();
        let lux = air / (distance_m * distance_m);
        let half = (towards - ray).normalize_or(self.up);
        let (cosine, incidence) = (half.dot(self.up).max(1e-6), half.dot(-ray));
        let tangent2 = 1.0 / (cosine * cosine) - 1.0;
        let normals =
            (-0.5 * tangent2 / self.slope_variance).exp() / (2.0 * PI * self.slope_variance * cosine.powi(4));
        let seen = 1.0 / (1.0 + self.hiding(slope) + self.hiding(falls));
        (lux * fresnel(incidence) * normals * seen / (4.0 * slope), FRAC_1_PI * lux * falls)
    }

    /// Smith's function of a direction with that sine over the horizontal, by Walter's fraction.
    fn hiding(&self, sine: f64) -> f64 {
        let a = sine / (1.0 - sine * sine).max(1e-12).sqrt() / (2.0 * self.slope_variance).sqrt();
        if a < 1.6 { (1.0 - 1.259 * a + 0.396 * a * a) / (3.535 * a + 2.181 * a * a) } else { 0.0 }
    }
}
