//! Small rotations between glam, which the interfaces speak, and nalgebra, which solves.

use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, Vector3};

/// The same vector for nalgebra.
pub(crate) fn vector(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

/// The same vector for glam.
pub(crate) fn dvec(v: &Vector3<f64>) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

/// The same matrix for nalgebra.
pub(crate) fn matrix(m: DMat3) -> Matrix3<f64> {
    Matrix3::from_columns(&[vector(m.x_axis), vector(m.y_axis), vector(m.z_axis)])
}

/// The same matrix for glam.
pub(crate) fn dmat(m: &Matrix3<f64>) -> DMat3 {
    DMat3::from_cols(dvec(&m.column(0).into()), dvec(&m.column(1).into()), dvec(&m.column(2).into()))
}

/// Rotation vector of the shorter way, radians. Exact near zero, where glam's own goes through an arc cosine.
pub(crate) fn log(q: DQuat) -> DVec3 {
    let v = DVec3::new(q.x, q.y, q.z);
    let (sin, cos) = (v.length(), q.w);
    if sin < 1e-300 {
        return DVec3::ZERO;
    }
    let half = sin.atan2(cos.abs());
    let sign = if cos < 0.0 { -1.0 } else { 1.0 };
    v * (sign * 2.0 * half / sin)
}

/// Rotation by a rotation vector, radians. Exact near zero.
pub(crate) fn exp(v: DVec3) -> DQuat {
    let angle = v.length();
    let half = 0.5 * angle;
    let scale = if angle < 1e-8 { 0.5 } else { half.sin() / angle };
    let s = v * scale;
    DQuat::from_xyzw(s.x, s.y, s.z, half.cos()).normalize()
}

/// The proper rotation that takes `from` nearest to `to` where `m` is the sum of `to from^T`, the singular values, largest first,
/// and whether a mirrored one would come nearer (Kabsch 1976; Umeyama 1991, eq. 39-43). `None` where the matrix is no number.
pub(crate) fn nearest_rotation(m: &Matrix3<f64>) -> Option<(DQuat, [f64; 3], bool)> {
    if !m.iter().all(|v| v.is_finite()) {
        return None;
    }
    let svd = m.try_svd(true, true, 1e-15, 200)?;
    let (u, vt) = (svd.u?, svd.v_t?);
    let mirrored = (u * vt).determinant() < 0.0;
    let mut order = [0, 1, 2];
    order.sort_by(|a: &usize, b| svd.singular_values[*b].total_cmp(&svd.singular_values[*a]));
    let mut signs = Matrix3::identity();
    if mirrored {
        signs[(order[2], order[2])] = -1.0;
    }
    let q = DQuat::from_mat3(&dmat(&(u * signs * vt))).normalize();
    q.is_finite().then(|| (q, order.map(|i| svd.singular_values[i]), mirrored))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn log_undoes_exp(x in -1.7..1.7f64, y in -1.7..1.7f64, z in -1.7..1.7f64, small in -12..0i32) {
            let v = DVec3::new(x, y, z) * 10f64.powi(small);
            prop_assert!((log(exp(v)) - v).length() <= 1e-14 * v.length().max(1e-3));
            prop_assert!((log(-exp(v)) - v).length() <= 1e-14 * v.length().max(1e-3));
        }

        #[test]
        fn kabsch_finds_any_rotation(x in -1.7..1.7f64, y in -1.7..1.7f64, z in -1.7..1.7f64) {
            let q = exp(DVec3::new(x, y, z));
            let m = [DVec3::X, DVec3::Y * 2.0, DVec3::new(0.3, 0.1, -1.0)]
                .into_iter()
                .fold(Matrix3::zeros(), |m, v| m + vector(q * v) * vector(v).transpose());
            let (found, _, mirrored) = nearest_rotation(&m).unwrap();
            prop_assert!(log(found * q.inverse()).length() < 1e-7 && !mirrored);
            prop_assert!(nearest_rotation(&(-m)).unwrap().2);
        }
    }
}
