//! The turn that most sights agree on.

use glam::{DMat3, DQuat, DVec3};

use crate::geometry::rotation_vector;

/// A point of the sky that was found.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sight {
    /// Which point.
    pub point: usize,
    /// Unit vector towards it as it was seen, in the believed world.
    pub seen: DVec3,
    /// Unit vector towards it as the anchor has it.
    pub held: DVec3,
    /// How much it looked like itself (correlation coefficient).
    pub likeness: f64,
    /// How much coarser it is seen than the finest ones.
    pub unit: f64,
    /// Angle between them after the turn, radians, over `unit`.
    pub off: f64,
    /// Tukey's weight, and by how finely it is seen; nothing for an outlier.
    pub weight: f64,
}

/// A turn from the believed world to the anchor's.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    pub turn: DQuat,
    /// Covariance of its error, rad^2.
    pub covariance: DMat3,
    /// Sights that count.
    pub inliers: usize,
    /// Standard deviation of a fine sight about it on an axis, radians.
    pub scatter: f64,
}

/// What is known beforehand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected {
    /// The turn of the picture before.
    pub turn: DQuat,
    /// How far inclination may have changed since, radians.
    pub tilt_sigma: f64,
    /// Angle of a pixel, radians.
    pixel: f64,
}

impl Expected {
    pub fn new(turn: DQuat, tilt_sigma: f64, pixel: f64) -> Self {
        Self { turn, tilt_sigma, pixel }
    }
}

/// Sights within so many pixels of a turn by one of them speak for it.
const AGREE_PX: f64 = 2.0;
/// Rounds of weighing.
const ROUNDS: usize = 6;
/// Tukey's biweight: 95 % efficient at this many deviations (Holland & Welsch 1977).
const TUKEY: f64 = 4.685;
/// Variance of the whole over that of sights that err each by itself: patches overlap on coarse levels. It makes squared errors over
/// variances about one on drawn skies.
const SHARED: f64 = 4.0;
/// A sight scatters no less than this, pixels: what interpolation errs by.
const SCATTER_LEAST_PX: f64 = 0.05;

/// The turn that most of `sights` agree on: one sight proposes (Fischler & Bolles 1981; all are tried), Tukey's weights refine. Weights and
/// distances of the sights are set. `None` where fewer than `least` or less than half of them agree.
pub(super) fn fit(
    sights: &mut [Sight],
    expected: &Expected,
    least: usize,
    scratch: &mut Vec<f64>,
) -> Option<Fit> {
    let mut turn = consensus(sights, expected)?;
    let floor = SCATTER_LEAST_PX * expected.pixel;
    let mut scatter = AGREE_PX * expected.pixel / 2.0;
    let tilt_weight = expected.tilt_sigma.max(1e-6).powi(-2);
    let mut covariance = DMat3::ZERO;
    for round in 0..ROUNDS {
        let reach = TUKEY * scatter;
        let (mut normal, mut pull) = (DMat3::ZERO, DVec3::ZERO);
        for sight in sights.iter_mut() {
            let seen = turn * sight.seen;
            sight.off = seen.distance(sight.held) / sight.unit;
            let share = (1.0 - (sight.off / reach).powi(2)).max(0.0);
            sight.weight = share * share / (sight.unit * sight.unit);
            let outer = DMat3::from_cols(seen * seen.x, seen * seen.y, seen * seen.z);
            normal += (DMat3::IDENTITY - outer) * sight.weight;
            pull += seen.cross(sight.held) * sight.weight;
        }
        // What inclination was found before is still about right.
        let variance = scatter * scatter;
        let tilted = rotation_vector(turn * expected.turn.inverse());
        let hold = DVec3::new(1.0, 1.0, 0.0) * (variance * tilt_weight);
        let inverse = (normal + DMat3::from_diagonal(hold)).inverse();
        let step = inverse * (pull - tilted * hold);
        if !step.is_finite() {
            return None;
        }
        turn = (DQuat::from_scaled_axis(step) * turn).normalize();
        covariance = inverse * (SHARED * variance);
        scatter = spread(sights, scratch)?.max(floor);
        if step.length() < 0.01 * floor && round > 1 {
            break;
        }
    }
    let inliers = sights.iter().filter(|s| s.weight > 0.0).count();
    (inliers >= least && 2 * inliers >= sights.len()).then_some(Fit { turn, covariance, inliers, scatter })
}

/// The smallest turn that puts one sight right and most of the others about right.
fn consensus(sights: &[Sight], expected: &Expected) -> Option<DQuat> {
    let agree = AGREE_PX * expected.pixel;
    let shift = |s: &Sight| (expected.turn * s.seen).cross(s.held);
    let mut best: Option<(usize, f64, DVec3)> = None;
    for candidate in sights {
        let by = shift(candidate);
        let (mut count, mut sum) = (0, 0.0);
        for other in sights {
            // A turn about the line of sight itself is not seen.
            let across = by - other.held * other.held.dot(by);
            let off = shift(other).distance(across);
            // Roll is not in the proposal; it moves what lies far off the most.
            let slack = expected.tilt_sigma * candidate.held.distance(other.held);
            if off < agree * candidate.unit.max(other.unit) + 2.0 * slack {
                count += 1;
                sum += off;
            }
        }
        if best.is_none_or(|(most, least, _)| count > most || (count == most && sum < least)) {
            best = Some((count, sum, by));
        }
    }
    let (_, _, by) = best?;
    let turn = (DQuat::from_scaled_axis(by) * expected.turn).normalize();
    turn.is_finite().then_some(turn)
}

/// Standard deviation on an axis of the sights that count, by their median: that of a two-dimensional normal one is 1.1774 of it.
fn spread(sights: &[Sight], scratch: &mut Vec<f64>) -> Option<f64> {
    scratch.clear();
    scratch.extend(sights.iter().filter(|s| s.weight > 0.0).map(|s| s.off));
    if scratch.is_empty() {
        return None;
    }
    let middle = scratch.len() / 2;
    let (_, median, _) = scratch.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median / 1.1774)
}
