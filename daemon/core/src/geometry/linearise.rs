//! How the pixel of a point changes with the point and with the lens: the derivatives that calibration solves by.

use glam::{DVec2, DVec3};

use super::{Distortion, Fisheye, Lens, RadialTangential, distortion::radius};

/// Intrinsics of a lens: both focal lengths, the principal point, four coefficients of distortion.
pub const INTRINSICS: usize = 8;

/// The pixel of a point with its derivatives, a row each for right and down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearisedPixel {
    /// Where the point falls, pixels.
    pub pixel: DVec2,
    /// By the point, pixels per unit of its coordinates.
    pub by_point: [DVec3; 2],
    /// By the intrinsics: fx, fy, cx, cy, then k1, k2, p1, p2 or the fisheye's k1 to k4.
    pub by_intrinsics: [[f64; INTRINSICS]; 2],
}

/// Normalised coordinates of a point behind the distortion, by the point and by the coefficients.
struct Distorted {
    place: DVec2,
    by_point: [DVec3; 2],
    by_coefficients: [[f64; 4]; 2],
}

impl Lens {
    /// The pixel of a point with its derivatives, all rows exposed at once; `None` where [`Lens::project`] has no pixel. A lens without
    /// distortion has the derivatives of a radial and tangential one whose coefficients are zero.
    pub fn linearise(&self, camera: DVec3) -> Option<LinearisedPixel> {
        let place = self.distortion.project(camera)?;
        let distorted = match self.distortion {
            Distortion::Fisheye(d) => d.linearise(camera, place),
            Distortion::RadialTangential(d) => d.linearise(camera, place),
            Distortion::None => RadialTangential::new(DVec2::ZERO, DVec2::ZERO).linearise(camera, place),
        };
        let pixel = distorted.place * self.focal + self.centre;
        let row = |i: usize, by: [f64; 4]| {
            let focal = self.focal[i];
            let mut row = [0.0; INTRINSICS];
            (row[i], row[2 + i]) = (distorted.place[i], 1.0);
            row[4..].copy_from_slice(&by.map(|b| focal * b));
            row
        };
        let [across, down] = distorted.by_coefficients;
        let [x, y] = distorted.by_point;
        pixel.is_finite().then_some(LinearisedPixel {
            pixel,
            by_point: [x * self.focal.x, y * self.focal.y],
            by_intrinsics: [row(0, across), row(1, down)],
        })
    }
}

impl RadialTangential {
    fn linearise(&self, camera: DVec3, place: DVec2) -> Distorted {
        let n = camera.truncate() / camera.z;
        let (x, y, r2) = (n.x, n.y, n.length_squared());
        let slope = self.slope(n);
        // A point's undistorted coordinates by the point.
        let flat = [DVec3::new(1.0, 0.0, -x) / camera.z, DVec3::new(0.0, 1.0, -y) / camera.z];
        Distorted {
            place,
            by_point: [0, 1].map(|i| flat[0] * slope.x_axis[i] + flat[1] * slope.y_axis[i]),
            by_coefficients: [
                [x * r2, x * r2 * r2, 2.0 * x * y, r2 + 2.0 * x * x],
                [y * r2, y * r2 * r2, r2 + 2.0 * y * y, 2.0 * x * y],
            ],
        }
    }
}

impl Fisheye {
    fn linearise(&self, camera: DVec3, place: DVec2) -> Distorted {
        let across = camera.truncate().length();
        if across < 1e-9 * camera.z {
            let n = camera.truncate() / camera.z;
            let flat = [DVec3::new(1.0, 0.0, -n.x) / camera.z, DVec3::new(0.0, 1.0, -n.y) / camera.z];
            return Distorted { place, by_point: flat, by_coefficients: [[0.0; 4]; 2] };
        }
        let angle = across.atan2(camera.z);
        let (far, slope) = radius(&self.k(), angle);
        let u = camera.truncate() / across;
        // The angle by the point, then the direction across by the point.
        let turn = DVec3::new(u.x * camera.z, u.y * camera.z, -across) / camera.length_squared();
        let ratio = far / across;
        let aside = [DVec3::new(u.y * u.y, -u.x * u.y, 0.0), DVec3::new(-u.x * u.y, u.x * u.x, 0.0)];
        let powers = [3, 5, 7, 9].map(|n| angle.powi(n));
        Distorted {
            place,
            by_point: [0, 1].map(|i| turn * (slope * u[i]) + aside[i] * ratio),
            by_coefficients: [powers.map(|p| p * u.x), powers.map(|p| p * u.y)],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LENSES: [(bool, [f64; INTRINSICS]); 3] = [
        (false, [900.0, 905.0, 640.0, 360.0, -0.2, 0.05, 1e-3, -2e-3]),
        (false, [900.0, 905.0, 640.0, 360.0, 0.0, 0.0, 0.0, 0.0]),
        (true, [400.0, 402.0, 640.0, 360.0, -0.02, 0.01, -0.004, 0.001]),
    ];

    fn lens(fisheye: bool, [fx, fy, cx, cy, a, b, c, d]: [f64; INTRINSICS]) -> Lens {
        let bent = if fisheye {
            Distortion::fisheye([a, b, c, d])
        } else {
            Distortion::radial_tangential(DVec2::new(a, b), DVec2::new(c, d))
        };
        let (focal, centre) = (DVec2::new(fx, fy), DVec2::new(cx, cy));
        Lens { focal, centre, distortion: bent, ..Lens::pinhole(1280, 720, 1.0) }
    }

    proptest! {
        #[test]
        fn derivatives_are_those_of_differences(x in -0.6..0.6f64, y in -0.6..0.6f64, z in 0.7..3.0f64) {
            for (fisheye, numbers) in LENSES {
                let point = DVec3::new(x * z, y * z, z);
                let told = lens(fisheye, numbers).linearise(point).unwrap();
                prop_assert_eq!(Some(told.pixel), lens(fisheye, numbers).project(point));
                for axis in 0..3 {
                    let mut d = DVec3::ZERO;
                    d[axis] = 1e-6;
                    let at = |p| lens(fisheye, numbers).project(p).unwrap();
                    let numeric = (at(point + d) - at(point - d)) / 2e-6;
                    let by = DVec2::new(told.by_point[0][axis], told.by_point[1][axis]);
                    prop_assert!(numeric.distance(by) < 1e-4, "{fisheye} {numeric} {by}");
                }
                for i in 0..INTRINSICS {
                    let at = |by: f64| {
                        let mut moved = numbers;
                        moved[i] += by;
                        lens(fisheye, moved).project(point).unwrap()
                    };
                    let numeric = (at(1e-6) - at(-1e-6)) / 2e-6;
                    let by = DVec2::new(told.by_intrinsics[0][i], told.by_intrinsics[1][i]);
                    prop_assert!(numeric.distance(by) < 1e-4, "{fisheye} {i} {numeric} {by}");
                }
            }
        }
    }

    #[test]
    fn the_axis_is_no_singularity() {
        for (fisheye, numbers) in LENSES {
            let at = |x: f64| lens(fisheye, numbers).linearise(DVec3::new(x, 0.0, 1.0)).unwrap();
            let (on, beside) = (at(0.0), at(1e-7));
            for i in 0..2 {
                assert!(on.by_point[i].distance(beside.by_point[i]) < 1e-3, "{fisheye}");
            }
            assert_eq!(lens(fisheye, numbers).linearise(DVec3::NEG_Z), None);
        }
    }
}
