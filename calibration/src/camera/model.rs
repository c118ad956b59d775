//! The two lens models, from a direction to a pixel and back, with derivatives.

use glam::{DVec2, DVec3};
use nalgebra::{SMatrix, SVector, Vector2, Vector3};

/// Parameters of either model: focal lengths, principal point, four of distortion.
pub(super) const INTRINSICS: usize = 8;
pub(super) type Intrinsics = SVector<f64, INTRINSICS>;

/// Which lens model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// Pinhole with radial k1, k2 and tangential p1, p2 (Brown 1971; Conrady 1919).
    RadialTangential,
    /// Equidistant fisheye with k1 to k4 (Kannala & Brandt 2006, eq. 6; OpenCV's fisheye).
    Fisheye,
}

/// Pixel, by the point (2 x 3), by the intrinsics (2 x 8).
pub(super) type Projected = (Vector2<f64>, SMatrix<f64, 2, 3>, SMatrix<f64, 2, INTRINSICS>);

impl Model {
    /// Pixel of a point of the camera's space with derivatives; `None` behind the camera or where the distortion folds back.
    pub(super) fn project(self, intrinsics: &Intrinsics, point: &Vector3<f64>) -> Option<Projected> {
        let (n, by_point, by_distortion) = match self {
            Self::RadialTangential => radial_tangential(intrinsics, point)?,
            Self::Fisheye => fisheye(intrinsics, point)?,
        };
        let (fx, fy) = (intrinsics[0], intrinsics[1]);
        let pixel = Vector2::new(n.x * fx + intrinsics[2], n.y * fy + intrinsics[3]);
        let mut by_intrinsics = SMatrix::<f64, 2, INTRINSICS>::zeros();
        by_intrinsics[(0, 0)] = n.x;
        by_intrinsics[(1, 1)] = n.y;
        by_intrinsics[(0, 2)] = 1.0;
        by_intrinsics[(1, 3)] = 1.0;
        let focal = SMatrix::<f64, 2, 2>::new(fx, 0.0, 0.0, fy);
        by_intrinsics.fixed_view_mut::<2, 4>(0, 4).copy_from(&(focal * by_distortion));
        let finite = pixel.iter().all(|v| v.is_finite());
        finite.then(|| (pixel, focal * by_point, by_intrinsics))
    }

    /// Direction of a pixel by Newton's method on [`Model::project`]'s own formula; `None` where no direction falls on it.
    pub(super) fn unproject(self, intrinsics: &Intrinsics, pixel: DVec2) -> Option<DVec3> {
        let d = Vector2::new(
            (pixel.x - intrinsics[2]) / intrinsics[0],
            (pixel.y - intrinsics[3]) / intrinsics[1],
        );
        // Points on the plane z = 1 for the pinhole; on the sphere, by their angle from the axis, for the fisheye.
        let mut at = d;
        for _ in 0..40 {
            let point = self.lift(&at);
            let (seen, by_point, _) = self.project(intrinsics, &point)?;
            let off = Vector2::new(pixel.x - seen.x, pixel.y - seen.y);
            let jacobian = by_point * self.lift_derivative(&at);
            let step = jacobian.try_inverse()? * off;
            at += step * (0.5 / step.norm()).min(1.0);
            if step.norm() < 1e-12 {
                return Some(crate::so3::dvec(&self.lift(&at)).normalize());
            }
        }
        None
    }

    fn lift(self, at: &Vector2<f64>) -> Vector3<f64> {
        match self {
            Self::RadialTangential => Vector3::new(at.x, at.y, 1.0),
            Self::Fisheye => {
                let angle = at.norm();
                let s = if angle < 1e-9 { 1.0 } else { angle.sin() / angle };
                Vector3::new(at.x * s, at.y * s, angle.cos())
            }
        }
    }

    fn lift_derivative(self, at: &Vector2<f64>) -> SMatrix<f64, 3, 2> {
        const H: f64 = 1e-6;
        let by = |d: Vector2<f64>| (self.lift(&(at + d)) - self.lift(&(at - d))) / (2.0 * H);
        SMatrix::<f64, 3, 2>::from_columns(&[by(Vector2::new(H, 0.0)), by(Vector2::new(0.0, H))])
    }
}

/// Distorted normalised coordinates, by the point, by the distortion.
type Distorted = (Vector2<f64>, SMatrix<f64, 2, 3>, SMatrix<f64, 2, 4>);

fn radial_tangential(intrinsics: &Intrinsics, point: &Vector3<f64>) -> Option<Distorted> {
    if point.z <= 1e-9 {
        return None;
    }
    let (x, y) = (point.x / point.z, point.y / point.z);
    let [k1, k2, p1, p2] = [4, 5, 6, 7].map(|i| intrinsics[i]);
    let r2 = x * x + y * y;
    if 1.0 + 3.0 * k1 * r2 + 5.0 * k2 * r2 * r2 <= 0.0 {
        return None;
    }
    let radial = 1.0 + r2 * (k1 + r2 * k2);
    let slope = 2.0 * (k1 + 2.0 * k2 * r2);
    let n = Vector2::new(
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    );
    let cross = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
    let by_xy = SMatrix::<f64, 2, 2>::new(
        radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
        cross,
        cross,
        radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
    );
    let flat = SMatrix::<f64, 2, 3>::new(1.0, 0.0, -x, 0.0, 1.0, -y) / point.z;
    let by_distortion = SMatrix::<f64, 2, 4>::new(
        x * r2,
        x * r2 * r2,
        2.0 * x * y,
        r2 + 2.0 * x * x,
        y * r2,
        y * r2 * r2,
        r2 + 2.0 * y * y,
        2.0 * x * y,
    );
    Some((n, by_xy * flat, by_distortion))
}

fn fisheye(intrinsics: &Intrinsics, point: &Vector3<f64>) -> Option<Distorted> {
    let r2 = point.x * point.x + point.y * point.y;
    let r = r2.sqrt();
    let length2 = r2 + point.z * point.z;
    if length2 < 1e-18 || (r < 1e-12 && point.z <= 0.0) {
        return None;
    }
    let angle = r.atan2(point.z);
    let a2 = angle * angle;
    let k = [4, 5, 6, 7].map(|i| intrinsics[i]);
    let (mut distorted, mut slope, mut power) = (1.0, 1.0, 1.0);
    let mut powers = [0.0; 4];
    for (i, k) in k.iter().enumerate() {
        power *= a2;
        powers[i] = power * angle;
        distorted += k * power;
        slope += (2 * i + 3) as f64 * k * power;
    }
    if slope <= 0.0 {
        return None;
    }
    let distorted = distorted * angle;
    if r < 1e-9 * point.z {
        let n = Vector2::new(point.x, point.y) / point.z;
        let by_point = SMatrix::<f64, 2, 3>::new(1.0, 0.0, -n.x, 0.0, 1.0, -n.y) / point.z;
        return Some((n, by_point, SMatrix::zeros()));
    }
    let (ux, uy) = (point.x / r, point.y / r);
    // The angle by the point, then the direction across by the point.
    let by = Vector3::new(ux * point.z, uy * point.z, -r) / length2;
    let ratio = distorted / r;
    let mut by_point = SMatrix::<f64, 2, 3>::zeros();
    for c in 0..3 {
        by_point[(0, c)] = slope * ux * by[c];
        by_point[(1, c)] = slope * uy * by[c];
    }
    by_point[(0, 0)] += ratio * uy * uy;
    by_point[(0, 1)] -= ratio * ux * uy;
    by_point[(1, 0)] -= ratio * ux * uy;
    by_point[(1, 1)] += ratio * ux * ux;
    let by_distortion = SMatrix::<f64, 2, 4>::from_fn(|row, i| powers[i] * if row == 0 { ux } else { uy });
    Some((Vector2::new(ux, uy) * distorted, by_point, by_distortion))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LENSES: [(Model, [f64; 8]); 2] = [
        (Model::RadialTangential, [900.0, 905.0, 640.0, 360.0, -0.2, 0.05, 1e-3, -2e-3]),
        (Model::Fisheye, [400.0, 402.0, 640.0, 360.0, -0.02, 0.01, -0.004, 0.001]),
    ];

    proptest! {
        #[test]
        fn derivatives_are_those_of_differences(x in -0.6..0.6f64, y in -0.6..0.6f64, z in 0.7..3.0f64) {
            for (model, numbers) in LENSES {
                let intrinsics = Intrinsics::from(numbers);
                let point = Vector3::new(x * z, y * z, z);
                let (_, by_point, by_intrinsics) = model.project(&intrinsics, &point).unwrap();
                for c in 0..3 {
                    let mut d = Vector3::zeros();
                    d[c] = 1e-6;
                    let at = |p: &Vector3<f64>| model.project(&intrinsics, p).unwrap().0;
                    let numeric = (at(&(point + d)) - at(&(point - d))) / 2e-6;
                    prop_assert!((numeric - by_point.column(c)).norm() < 1e-4, "{model:?} {numeric} {by_point}");
                }
                for c in 0..INTRINSICS {
                    let mut d = Intrinsics::zeros();
                    d[c] = 1e-6;
                    let at = |i: &Intrinsics| model.project(i, &point).unwrap().0;
                    let numeric = (at(&(intrinsics + d)) - at(&(intrinsics - d))) / 2e-6;
                    prop_assert!((numeric - by_intrinsics.column(c)).norm() < 1e-4, "{model:?} {c}");
                }
            }
        }

        #[test]
        fn unproject_inverts_project(u in 0.0..1280.0f64, v in 0.0..720.0f64) {
            for (model, numbers) in LENSES {
                let intrinsics = Intrinsics::from(numbers);
                let pixel = DVec2::new(u, v);
                let direction = model.unproject(&intrinsics, pixel).unwrap();
                let (back, ..) = model.project(&intrinsics, &crate::so3::vector(direction)).unwrap();
                prop_assert!(DVec2::new(back.x, back.y).distance(pixel) < 1e-8);
            }
        }
    }

    #[test]
    fn the_axis_is_no_singularity() {
        for (model, numbers) in LENSES {
            let at = |x: f64| model.project(&Intrinsics::from(numbers), &Vector3::new(x, 0.0, 1.0)).unwrap();
            assert!((at(0.0).1 - at(1e-7).1).norm() < 1e-3, "{model:?}");
            assert!(model.project(&Intrinsics::from(numbers), &Vector3::new(0.0, 0.0, -1.0)).is_none());
        }
    }
}
