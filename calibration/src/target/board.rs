//! How the camera is turned against the board, in one picture.

use bowwave_core::{
    event::{Picture, PixelFormat},
    geometry::Lens,
};
use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::{Matrix2x3, Matrix2x6, Matrix3, Matrix6, Vector2, Vector6};

use super::{Grey, Target, detect, view};
use crate::{
    capture::{BoardSeen, FindBoard},
    lens::{BoardPose, BoardView, Corner, pose_from},
    solve::so3::{exp, matrix, vector},
};

/// Corners that are off by more than this in the mean are those of a wrong lens or board, pixels.
pub(crate) const OFF_MOST_PX: f64 = 3.0;
/// The same where the picture may be read row by row while the camera turns.
pub(crate) const SHEARED_MOST_PX: f64 = 20.0;

/// Looks for a board in pictures; keeps its memory from picture to picture.
#[derive(Clone, Debug)]
pub struct BoardFinder {
    target: Target,
    grey: Vec<u8>,
}

impl BoardFinder {
    /// A finder of that board.
    pub const fn new(target: Target) -> Self {
        Self { target, grey: Vec::new() }
    }
}

impl FindBoard for BoardFinder {
    fn find(&mut self, picture: &Picture, lens: &Lens) -> Option<BoardSeen> {
        seen(lens, look_for(&self.target, picture, &mut self.grey)?.corners)
    }
}

/// The board whose corners were found in a picture; `None` where they are too few or fit no pose.
pub fn seen(lens: &Lens, corners: Vec<Corner>) -> Option<BoardSeen> {
    let Oriented { pose, sigma, .. } = orient(lens, &corners, SHEARED_MOST_PX)?;
    let pixel = corners.iter().map(|c| c.pixel).sum::<DVec2>() / corners.len() as f64;
    Some(BoardSeen { board_from_camera: pose.camera_from_board.inverse(), sigma, pixel, corners })
}

/// The board's corners in a picture; `None` where the picture is too large. `grey` is memory that is used again.
pub fn look_for(target: &Target, picture: &Picture, grey: &mut Vec<u8>) -> Option<BoardView> {
    to_grey(picture, grey);
    let grey = Grey::new(picture.width() as usize, picture.height() as usize, grey)?;
    Some(view(target, &detect(target, &grey)))
}

/// Middle of a tag of the board in a picture, where its diagonals cross, pixels; `None` where it is not to be seen.
pub fn find_tag(target: &Target, tag: usize, picture: &Picture) -> Option<DVec2> {
    let mut grey = Vec::new();
    to_grey(picture, &mut grey);
    let grey = Grey::new(picture.width() as usize, picture.height() as usize, &grey)?;
    let found = detect(target, &grey).into_iter().find(|t| t.id == tag)?;
    let [a, b, c, d] = found.corners;
    let (one, other) = (c - a, d - b);
    let share = (b - a).perp_dot(other) / one.perp_dot(other);
    Some(a + one * share).filter(|at| at.is_finite())
}

/// Brightness of every pixel.
fn to_grey(picture: &Picture, grey: &mut Vec<u8>) {
    grey.clear();
    for row in (0..picture.height() as usize).map(|y| picture.row(y)) {
        let pixels = row.chunks_exact(picture.format().pixel_bytes());
        match picture.format() {
            PixelFormat::Yuyv | PixelFormat::Nv12 => grey.extend(pixels.map(|p| p[0])),
            PixelFormat::Rgb => grey.extend(pixels.map(|p| {
                let [r, g, b] = [p[0], p[1], p[2]].map(u32::from);
                ((77 * r + 150 * g + 29 * b) >> 8) as u8
            })),
        }
    }
}

/// Where a corner falls and how that changes with its place in the camera's space; `None` where it is not seen.
fn project(lens: &Lens, at: DVec3) -> Option<(DVec2, Matrix2x3<f64>)> {
    let step = 1e-5 * at.length();
    let column = |axis: DVec3| {
        let (after, before) = (lens.project(at + axis * step)?, lens.project(at - axis * step)?);
        let slope = (after - before) / (2.0 * step);
        Some(Vector2::new(slope.x, slope.y))
    };
    Some((
        lens.project(at)?,
        Matrix2x3::from_columns(&[column(DVec3::X)?, column(DVec3::Y)?, column(DVec3::Z)?]),
    ))
}

/// Normal equations of the corners about a pose, and the sum of squares: turn (camera's axes), then place.
fn normal(lens: &Lens, corners: &[Corner], pose: &BoardPose) -> Option<(Matrix6<f64>, Vector6<f64>, f64)> {
    let (mut n, mut g, mut cost) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
    for corner in corners {
        let turned = pose.camera_from_board * corner.board.extend(0.0);
        let (pixel, slope) = project(lens, turned + pose.place)?;
        let r = Vector2::new(pixel.x - corner.pixel.x, pixel.y - corner.pixel.y);
        // exp(d) turned = turned + d x turned.
        let across = DMat3::from_cols(DVec3::X.cross(turned), DVec3::Y.cross(turned), DVec3::Z.cross(turned));
        let mut j = Matrix2x6::zeros();
        j.fixed_columns_mut::<3>(0).copy_from(&(slope * matrix(across)));
        j.fixed_columns_mut::<3>(3).copy_from(&slope);
        n += j.transpose() * j;
        g += j.transpose() * r;
        cost += r.norm_squared();
    }
    Some((n, g, cost))
}

/// A board's pose and how well it is known.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Oriented {
    pub pose: BoardPose,
    /// Standard deviation of its rotation about an axis, radians.
    pub sigma: f64,
    /// Sum of squares of what is left, pixels, and how many numbers are left for it.
    pub squares: f64,
    pub freedom: f64,
}

/// The board's pose by least squares of the corners' pixels; `None` where these are off by more than `most_px` in the mean.
pub(crate) fn orient(lens: &Lens, corners: &[Corner], most_px: f64) -> Option<Oriented> {
    /// Fewest corners of a pose: two tags.
    const CORNERS_LEAST: usize = 8;
    /// Corners are never better than this, pixels.
    const SIGMA_LEAST_PX: f64 = 0.05;
    if corners.len() < CORNERS_LEAST {
        return None;
    }
    let pairs: Vec<(DVec2, DVec2)> = corners
        .iter()
        .map(|c| (c.board, lens.unproject(c.pixel)))
        .filter(|(_, ray)| ray.z > 0.17)
        .map(|(board, ray)| (board, ray.truncate() / ray.z))
        .collect();
    let mut pose = pose_from(&pairs)?;
    let mut last = normal(lens, corners, &pose)?;
    for _ in 0..10 {
        let step = -last.0.cholesky()?.solve(&last.1);
        let three = |i: usize| DVec3::new(step[i], step[i + 1], step[i + 2]);
        let turned: DQuat = (exp(three(0)) * pose.camera_from_board).normalize();
        let next = BoardPose { camera_from_board: turned, place: pose.place + three(3) };
        let told = normal(lens, corners, &next)?;
        if told.2 > last.2 {
            break;
        }
        let gained = last.2 - told.2;
        (pose, last) = (next, told);
        if gained < 1e-9 * last.2 {
            break;
        }
    }
    let (information, _, squares) = last;
    let freedom = 2.0 * corners.len() as f64 - 6.0;
    let sigma_px = (squares / freedom).sqrt().max(SIGMA_LEAST_PX);
    let covariance: Matrix3<f64> =
        information.try_inverse()?.fixed_view::<3, 3>(0, 0) * (sigma_px * sigma_px);
    let sigma = (covariance.trace() / 3.0).sqrt();
    let sound = sigma_px < most_px && sigma.is_finite() && vector(pose.place).norm() < 1e4;
    sound.then_some(Oriented { pose, sigma, squares, freedom })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{simulated::Random, solve::so3::log};
    use bowwave_core::geometry::Distortion;

    #[test]
    fn the_pose_is_found_within_its_own_deviation() {
        let (target, mut random) = (Target::A4, Random::new(3));
        let mut lens = Lens::pinhole(1280, 720, 1.0);
        lens.distortion = Distortion::radial_tangential(DVec2::new(-0.12, 0.03), DVec2::ZERO);
        let (mut squares, mut count) = (0.0, 0.0);
        for _ in 0..200 {
            let camera_from_board =
                exp(random.vector() * 0.25) * DQuat::from_rotation_x(std::f64::consts::PI);
            let middle = camera_from_board * (target.size_m() / 2.0).extend(0.0);
            let place = DVec3::new(0.0, 0.0, 0.45) - middle + random.vector() * 0.02;
            let corners: Vec<Corner> = (0..target.tags())
                .flat_map(|id| target.corners(id))
                .filter_map(|board| {
                    let pixel = lens.project(camera_from_board * board.extend(0.0) + place)?;
                    let noise = DVec2::new(random.gauss(), random.gauss()) * 0.2;
                    Some(Corner { board, pixel: pixel + noise })
                })
                .collect();
            let Oriented { pose, sigma, .. } = orient(&lens, &corners, OFF_MOST_PX).unwrap();
            let off = log(camera_from_board * pose.camera_from_board.inverse());
            squares += off.length_squared() / (3.0 * sigma * sigma);
            count += 1.0;
            assert!(sigma < 2e-3, "{sigma}");
        }
        let mean: f64 = squares / count;
        assert!((0.8..1.25).contains(&mean), "{mean}");
    }

    #[test]
    fn too_few_corners_and_another_lens_are_no_pose() {
        let lens = Lens::pinhole(1280, 720, 1.0);
        let corner = |x: f64, y: f64| Corner { board: DVec2::new(x, y), pixel: DVec2::new(x, y) * 1e4 };
        assert!(orient(&lens, &[corner(0.0, 0.0), corner(0.01, 0.0)], OFF_MOST_PX).is_none());
        let mut random = Random::new(9);
        let wild: Vec<Corner> = (0..40)
            .map(|_| Corner {
                board: DVec2::new(random.unit(), random.unit()),
                pixel: DVec2::new(random.unit() * 1280.0, random.unit() * 720.0),
            })
            .collect();
        assert!(orient(&lens, &wild, OFF_MOST_PX).is_none());
    }

    #[test]
    fn brightness_is_that_of_every_format() {
        for format in [PixelFormat::Rgb, PixelFormat::Yuyv, PixelFormat::Nv12] {
            let mut grey = vec![1];
            to_grey(&Picture::black(format, 6, 4).unwrap(), &mut grey);
            assert_eq!(grey.len(), 24, "{format:?}");
            assert!(grey.iter().all(|v| *v <= 16), "{format:?}");
        }
    }
}
