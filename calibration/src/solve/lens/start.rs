//! A first estimate: homographies of the board, the focal length from their columns, poses.

use bowwave_core::geometry::Lens;
use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::{BoardView, Corner, model::direction};
use crate::solve::so3::{dvec, nearest_rotation, vector};

/// The board in the camera's space: `camera = rotation board + place`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardPose {
    /// Rotation from the board's axes (x and y along it) to the camera's.
    pub camera_from_board: DQuat,
    /// The board's origin in the camera's space, metres.
    pub place: DVec3,
}

impl BoardPose {
    /// Angle between the board's normal and the line of sight to its origin's depth axis, radians.
    pub fn tilt(&self) -> f64 {
        (self.camera_from_board * DVec3::Z).z.abs().clamp(0.0, 1.0).acos()
    }
}

/// Shift and scale that bring points to zero mean and a mean distance of the square root of two (Hartley 1997).
fn even(points: impl Iterator<Item = DVec2> + Clone) -> Option<(DVec2, f64)> {
    let n = points.clone().count() as f64;
    let mean = points.clone().sum::<DVec2>() / n;
    let spread = points.map(|p| p.distance(mean)).sum::<f64>() / n;
    (mean.is_finite() && spread > 1e-12).then(|| (mean, 2f64.sqrt() / spread))
}

/// Homography from the board to `seen` by the direct linear transform (Hartley & Zisserman 2004, alg. 4.2).
pub(crate) fn homography(pairs: &[(DVec2, DVec2)]) -> Option<Matrix3<f64>> {
    conditioned(pairs).map(|(h, _)| h)
}

/// The same with the larger of two condition numbers, both between even points. That of its equations is the ratio of the largest of their
/// singular values to the least but one, the least being that of the homography itself: it is large where the points do not tell one. That of
/// the homography is large where it hardly leads back: a plane that is seen edge-on.
pub(crate) fn conditioned(pairs: &[(DVec2, DVec2)]) -> Option<(Matrix3<f64>, f64)> {
    if pairs.len() < 4 {
        return None;
    }
    let (board, board_scale) = even(pairs.iter().map(|p| p.0))?;
    let (seen, seen_scale) = even(pairs.iter().map(|p| p.1))?;
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for (a, b) in pairs {
        let (a, b) = ((*a - board) * board_scale, (*b - seen) * seen_scale);
        let rows = [
            [a.x, a.y, 1.0, 0.0, 0.0, 0.0, -b.x * a.x, -b.x * a.y, -b.x],
            [0.0, 0.0, 0.0, a.x, a.y, 1.0, -b.y * a.x, -b.y * a.y, -b.y],
        ];
        for row in rows {
            let row = SVector::<f64, 9>::from(row);
            normal += row * row.transpose();
        }
    }
    let eigen = normal.symmetric_eigen();
    let h = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let middle = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8]);
    let t = |shift: DVec2, s: f64| Matrix3::new(s, 0.0, -s * shift.x, 0.0, s, -s * shift.y, 0.0, 0.0, 1.0);
    let h = t(seen, seen_scale).try_inverse()? * middle * t(board, board_scale);
    let mut squares = eigen.eigenvalues.as_slice().to_vec();
    squares.sort_by(f64::total_cmp);
    let equations = (squares[8] / squares[1].max(0.0)).sqrt();
    let sizes = middle.singular_values();
    let condition = equations.max(sizes.max() / sizes.min());
    h.iter().all(|v| v.is_finite()).then_some((h, condition))
}

/// Focal length in pixels from the homographies of all views, the principal point held in the picture's middle (Zhang 2000, eq. 3
/// and 4, with no skew and square pixels).
pub(super) fn focal(views: &[BoardView], middle: DVec2) -> Option<f64> {
    let (mut top, mut bottom) = (0.0, 0.0);
    for view in views {
        let pairs: Vec<_> = view.corners.iter().map(|c| (c.board, c.pixel - middle)).collect();
        let Some(h) = homography(&pairs) else { continue };
        let scale = 1.0 / h.norm();
        let (a, b): (Vector3<f64>, Vector3<f64>) = (h.column(0) * scale, h.column(1) * scale);
        // (a x, a y) (b x, b y) / f^2 + a z b z = 0, and the difference of squares likewise.
        let equations = [
            (a.x * b.x + a.y * b.y, -a.z * b.z),
            (a.x * a.x + a.y * a.y - b.x * b.x - b.y * b.y, b.z * b.z - a.z * a.z),
        ];
        for (by, right) in equations {
            top += by * by;
            bottom += by * right;
        }
    }
    let f = (top / bottom).sqrt();
    f.is_finite().then_some(f)
}

/// Pose of one board seen through a lens, from its homography to undistorted coordinates.
pub(super) fn pose(lens: &Lens, corners: &[Corner]) -> Option<BoardPose> {
    let pairs: Vec<(DVec2, DVec2)> = corners
        .iter()
        .filter_map(|c| {
            let d = direction(lens, c.pixel)?;
            // Beyond 80 degrees off the axis the plane z = 1 is too far off.
            (d.z > 0.17).then(|| (c.board, d.truncate() / d.z))
        })
        .collect();
    pose_from(&pairs)
}

/// Pose of a board whose points are seen at undistorted coordinates (x/z, y/z).
pub(crate) fn pose_from(pairs: &[(DVec2, DVec2)]) -> Option<BoardPose> {
    let h = homography(pairs)?;
    let scale = 2.0 / (h.column(0).norm() + h.column(1).norm());
    let scale = if h[(2, 2)] < 0.0 { -scale } else { scale };
    let (x, y): (Vector3<f64>, Vector3<f64>) = (h.column(0) * scale, h.column(1) * scale);
    let place = dvec(&(h.column(2) * scale));
    let m = Matrix3::from_columns(&[x, y, vector(dvec(&x).cross(dvec(&y)))]);
    let (camera_from_board, ..) = nearest_rotation(&m)?;
    let sound = place.is_finite() && DMat3::from_quat(camera_from_board).is_finite();
    sound.then_some(BoardPose { camera_from_board, place })
}
