//! Bundle adjustment of one camera and a plane board: intrinsics and every pose together (Zhang 2000, sec. 3.3).

use bowwave_core::{
    geometry::Lens,
    levenberg::{Damping, Improvement, levenberg_marquardt},
};
use glam::DVec3;
use nalgebra::{SMatrix, SVector, Vector2, Vector3};

use super::{
    BoardView,
    model::{INTRINSICS, Intrinsics, LensModel, project},
    start::BoardPose,
};
use crate::solve::so3::{dvec, exp, matrix};

type IntrinsicsMatrix = SMatrix<f64, INTRINSICS, INTRINSICS>;
type CrossMatrix = SMatrix<f64, INTRINSICS, 6>;
type PoseMatrix = SMatrix<f64, 6, 6>;

/// Squares beyond which one in a thousand sound corners lies (chi-squared, two degrees of freedom).
const OUTLIER: f64 = 13.8;
/// Cost of a corner that the model cannot project, pixels squared.
const UNSEEN: f64 = 1e6;

/// Where the adjustment stands.
#[derive(Clone, Debug)]
pub(super) struct AdjustState {
    pub intrinsics: Intrinsics,
    pub poses: Vec<BoardPose>,
}

/// Result of the adjustment.
#[derive(Clone, Debug)]
pub(super) struct Adjusted {
    pub state: AdjustState,
    /// Standard deviation of a corner's coordinate, pixels, by the median.
    pub sigma_px: f64,
    /// Covariance of the intrinsics; `None` where they are not told or were held.
    pub covariance: Option<IntrinsicsMatrix>,
    /// Covariance of each pose's rotation with the intrinsics held, camera's axes, rad^2.
    pub rotations: Vec<Option<SMatrix<f64, 3, 3>>>,
}

/// One view's part of the normal equations.
struct ViewBlock {
    own: IntrinsicsMatrix,
    mixed: CrossMatrix,
    pose: PoseMatrix,
    by_own: SVector<f64, INTRINSICS>,
    by_pose: SVector<f64, 6>,
    cost: f64,
}

/// Residuals (pixels) of one view; `None` for corners that the model cannot show.
pub(super) fn residuals<'a>(
    lens: &'a Lens,
    pose: &'a BoardPose,
    view: &'a BoardView,
) -> impl Iterator<Item = Option<Vector2<f64>>> + 'a {
    view.corners.iter().map(move |c| {
        let point = pose.camera_from_board * c.board.extend(0.0) + pose.place;
        let off = lens.project(point)? - c.pixel;
        off.is_finite().then(|| Vector2::new(off.x, off.y))
    })
}

fn weight(square: f64, sigma: f64) -> f64 {
    let normalised = square / (sigma * sigma);
    if normalised > OUTLIER { OUTLIER / normalised } else { 1.0 }
}

fn robust(square: f64, sigma: f64) -> f64 {
    // The cost that belongs to the weight: quadratic, then logarithmic.
    let limit = OUTLIER * sigma * sigma;
    if square > limit { limit * (1.0 + (square / limit).ln()) } else { square }
}

fn block(lens: &Lens, pose: &BoardPose, view: &BoardView, sigma: f64) -> ViewBlock {
    let mut b = ViewBlock {
        own: IntrinsicsMatrix::zeros(),
        mixed: CrossMatrix::zeros(),
        pose: PoseMatrix::zeros(),
        by_own: SVector::zeros(),
        by_pose: SVector::zeros(),
        cost: 0.0,
    };
    for c in &view.corners {
        let turned = pose.camera_from_board * c.board.extend(0.0);
        let Some((pixel, by_point, by_own)) = project(lens, turned + pose.place) else {
            b.cost += UNSEEN;
            continue;
        };
        let off = pixel - Vector2::new(c.pixel.x, c.pixel.y);
        let w = weight(off.norm_squared(), sigma);
        // Turning by a small vector adds its cross product with the turned point.
        let cross = matrix(glam::DMat3::from_cols(
            DVec3::X.cross(turned),
            DVec3::Y.cross(turned),
            DVec3::Z.cross(turned),
        ));
        let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
        by_pose.fixed_columns_mut::<3>(0).copy_from(&(by_point * cross));
        by_pose.fixed_columns_mut::<3>(3).copy_from(&by_point);
        b.own += by_own.transpose() * by_own * w;
        b.mixed += by_own.transpose() * by_pose * w;
        b.pose += by_pose.transpose() * by_pose * w;
        b.by_own += by_own.transpose() * off * w;
        b.by_pose += by_pose.transpose() * off * w;
        b.cost += robust(off.norm_squared(), sigma);
    }
    b
}

fn cost(model: LensModel, state: &AdjustState, views: &[BoardView], sigma: f64) -> f64 {
    let lens = model.trial(&state.intrinsics);
    let all = state.poses.iter().zip(views);
    all.flat_map(|(pose, view)| residuals(&lens, pose, view))
        .map(|r| r.map_or(UNSEEN, |r| robust(r.norm_squared(), sigma)))
        .sum()
}

/// Standard deviation of a coordinate by the median of the squared distances, which is 1.386 of its square for two of them.
fn spread(model: LensModel, state: &AdjustState, views: &[BoardView]) -> f64 {
    let lens = model.trial(&state.intrinsics);
    let all = state.poses.iter().zip(views);
    let mut squares: Vec<f64> = all
        .flat_map(|(pose, view)| residuals(&lens, pose, view))
        .map(|r| r.map_or(UNSEEN, |r| r.norm_squared()))
        .collect();
    squares.sort_by(f64::total_cmp);
    squares.get(squares.len() / 2).map_or(1.0, |m| (m / 1.386).sqrt()).max(1e-4)
}

/// Whether each view fits as the others do: the median of its squares is no more than so many times theirs.
pub(super) fn sound(model: LensModel, fit: &Adjusted, views: &[BoardView]) -> Vec<bool> {
    const TIMES: f64 = 5.0;
    let own = |(pose, view): (&BoardPose, &BoardView)| {
        let one = AdjustState { intrinsics: fit.state.intrinsics, poses: vec![*pose] };
        spread(model, &one, std::slice::from_ref(view)) <= TIMES * fit.sigma_px
    };
    fit.state.poses.iter().zip(views).map(own).collect()
}

/// The normal equations with the poses eliminated (Schur's complement), damped by Marquardt's diagonal.
fn step(blocks: &[ViewBlock], damping: f64, held: bool) -> Option<(Intrinsics, Vec<SVector<f64, 6>>)> {
    let mut own: IntrinsicsMatrix = blocks.iter().map(|b| b.own).sum();
    let mut right: SVector<f64, INTRINSICS> = blocks.iter().map(|b| b.by_own).sum();
    for i in 0..INTRINSICS {
        own[(i, i)] *= 1.0 + damping;
    }
    let mut inverses = Vec::with_capacity(blocks.len());
    for b in blocks {
        let mut pose = b.pose;
        for i in 0..6 {
            pose[(i, i)] *= 1.0 + damping;
        }
        let inverse = pose.cholesky()?.inverse();
        own -= b.mixed * inverse * b.mixed.transpose();
        right -= b.mixed * inverse * b.by_pose;
        inverses.push(inverse);
    }
    let d = if held { Intrinsics::zeros() } else { -scaled_inverse(&own)? * right };
    let poses =
        blocks.iter().zip(inverses).map(|(b, i)| -(i * (b.by_pose + b.mixed.transpose() * d))).collect();
    Some((d, poses))
}

/// Inverse of the intrinsics' information, scaled by its diagonal because pixels and coefficients differ by powers of ten.
fn scaled_inverse(m: &IntrinsicsMatrix) -> Option<IntrinsicsMatrix> {
    let scale = m.diagonal().map(f64::sqrt);
    if scale.iter().any(|s| !s.is_finite() || *s <= 0.0) {
        return None;
    }
    let even = IntrinsicsMatrix::from_fn(|r, c| m[(r, c)] / (scale[r] * scale[c]));
    let inverse = even.cholesky()?.inverse();
    Some(IntrinsicsMatrix::from_fn(|r, c| inverse[(r, c)] / (scale[r] * scale[c])))
}

fn moved(state: &AdjustState, own: &Intrinsics, poses: &[SVector<f64, 6>]) -> AdjustState {
    let turn = |(p, d): (&BoardPose, &SVector<f64, 6>)| BoardPose {
        camera_from_board: (exp(DVec3::new(d[0], d[1], d[2])) * p.camera_from_board).normalize(),
        place: p.place + dvec(&Vector3::new(d[3], d[4], d[5])),
    };
    AdjustState {
        intrinsics: state.intrinsics + own,
        poses: state.poses.iter().zip(poses).map(turn).collect(),
    }
}

/// The normal equations' part of each view.
fn blocks(model: LensModel, state: &AdjustState, views: &[BoardView], sigma: f64) -> Vec<ViewBlock> {
    let lens = model.trial(&state.intrinsics);
    let own = |(pose, view)| block(&lens, pose, view, sigma);
    state.poses.iter().zip(views).map(own).collect()
}

/// Damping of the steps; more of them only before the weights have settled.
const DAMPING: Damping =
    Damping { first: 1e-3, rise: 10.0, rise_least: 1e-9, fall: 0.1, fall_least: 0.0, steps: 15, tries: 8 };
const STEPS_FIRST: usize = 40;

/// Adjusts lens and poses together; `held` leaves the intrinsics as they are.
pub(super) fn adjust(model: LensModel, mut state: AdjustState, views: &[BoardView], held: bool) -> Adjusted {
    let mut sigma = spread(model, &state, views).max(0.05);
    for round in 0..4 {
        let begin = cost(model, &state, views, sigma);
        let settings = if round == 0 { Damping { steps: STEPS_FIRST, ..DAMPING } } else { DAMPING };
        (state, _) = levenberg_marquardt(
            (state, begin),
            settings,
            |(at, _)| Some(blocks(model, at, views, sigma)),
            |(at, now), blocks, damping| {
                let (own, poses) = step(blocks, damping, held)?;
                let next = moved(at, &own, &poses);
                let then = cost(model, &next, views, sigma);
                let is_last = now - then <= 1e-10 * now;
                (then <= *now).then_some(Improvement { state: (next, then), is_last })
            },
        );
        sigma = spread(model, &state, views);
    }
    finish(model, state, views, sigma, held)
}

fn finish(model: LensModel, state: AdjustState, views: &[BoardView], sigma: f64, held: bool) -> Adjusted {
    let blocks = blocks(model, &state, views, sigma);
    let variance = sigma * sigma;
    let inverse = |b: &ViewBlock| b.pose.cholesky().map(|c| c.inverse());
    let rotations = blocks
        .iter()
        .map(|b| inverse(b).map(|i| i.fixed_view::<3, 3>(0, 0).into_owned() * variance))
        .collect();
    let information = blocks.iter().try_fold(IntrinsicsMatrix::zeros(), |sum, b| {
        Some(sum + b.own - b.mixed * inverse(b)? * b.mixed.transpose())
    });
    let covariance = information.filter(|_| !held).and_then(|i| scaled_inverse(&i)).map(|i| i * variance);
    Adjusted { state, sigma_px: sigma, covariance, rotations }
}
