//! The turn that most sights agree on, and the wind that they show.

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
use nalgebra::{SMatrix, SVector};

use super::wind::{NEARNESS_SIGMA, SPREAD, SPREAD_MOST, Wind, carried, nearness};
use crate::{geometry::rotation_vector, statistics::BIWEIGHT_END};

/// A point of the sky that was found.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SkyTrack {
    /// Which point.
    pub point: usize,
    /// Unit vector towards it as it was seen, in the believed world.
    pub seen: DVec3,
    /// Unit vector towards it as the anchor has it, when it was taken.
    pub held: DVec3,
    /// How long ago that was, seconds.
    pub age_s: f64,
    /// How much it counts until it has been seen for a while.
    pub trust: f64,
    /// How much it looked like itself (correlation coefficient).
    pub likeness: f64,
    /// How much coarser it is seen than the finest ones.
    pub unit: f64,
    /// Whether it goes as what lies at the sky line, and not with the clouds.
    pub stands: bool,
    /// Angle between where it is seen after the turn and where it should have gone, radians.
    pub off: f64,
    /// Tukey's weight, and by how finely it is seen; nothing for an outlier.
    pub weight: f64,
}

impl SkyTrack {
    /// Whether it may be coast: what is higher is cloud.
    fn may_stand(&self) -> bool {
        self.held.z < STANDS_BELOW
    }

    /// Where it should be seen by now, once as a cloud and once as what lies at the sky line.
    fn expected(&self, wind: DVec2, rate: f64) -> [DVec3; 2] {
        [
            carried(self.held, wind * self.age_s),
            (self.held + rate * self.age_s * DVec3::Z.cross(self.held)).normalize(),
        ]
    }

    /// How far wind has carried it, radians.
    fn gone(&self, wind: DVec2) -> f64 {
        if self.stands { 0.0 } else { wind.length() * nearness(self.held) * self.age_s }
    }
}

/// A turn from the believed world to the anchor's.
#[derive(Clone, Copy, Debug)]
pub(super) struct SkylineFit {
    pub turn: DQuat,
    /// Covariance of its error, rad^2.
    pub covariance: DMat3,
    /// Sights that count.
    pub inliers: usize,
    /// Standard deviation of a fine sight about it on an axis, radians.
    pub scatter: f64,
    /// What the sights tell of the wind.
    pub told: Wind,
    /// What was known of the wind beforehand, and that.
    pub wind: Wind,
    /// By how much the turn may grow with what is seen by itself, standard deviation, rad/s about the vertical.
    pub rate_sigma: f64,
}

/// Prior knowledge.
#[derive(Clone, Copy, Debug)]
pub(super) struct SkylinePrior {
    /// The turn of the picture before.
    pub turn: DQuat,
    /// How far inclination may have changed since, radians.
    pub tilt_sigma: f64,
    /// Angle of a pixel, radians.
    pub pixel: f64,
    /// The wind.
    pub wind: Wind,
    /// By how much what lies at the sky line may turn as the ship passes it, rad/s.
    pub rate_sigma: f64,
}

/// Sights within so many pixels of a turn by one of them speak for it.
const AGREE_PX: f64 = 2.0;
/// Rounds of weighing.
const ROUNDS: usize = 6;
/// Variance of the whole over that of sights that err each by itself: patches overlap on coarse levels. It makes squared errors over
/// variances about one on drawn skies.
const SHARED: f64 = 4.0;
/// A sight scatters no less than this, pixels: what interpolation errs by.
const SCATTER_LEAST_PX: f64 = 0.05;
/// Coast is not seen higher than this (sine of the elevation).
const STANDS_BELOW: f64 = 0.05;
/// No rate is told over less than this, seconds.
const AGE_LEAST_S: f64 = 0.05;

/// Turn (3), wind (2), and the rate of what lies at the sky line.
const UNKNOWNS: usize = 6;
const WIND: usize = 3;
const RATE: usize = 5;
type NormalMatrix = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
type NormalVector = SVector<f64, UNKNOWNS>;

/// Normal equations of all tracks.
#[derive(Default)]
struct NormalSums {
    normal: NormalMatrix,
    pull: NormalVector,
    /// What all clouds that are nearer than they are taken for would pull by.
    nearer: NormalVector,
    weight: f64,
    aged: f64,
}

impl NormalSums {
    fn add(&mut self, sight: &SkyTrack, turn: DQuat, wind: DVec2, expected: DVec3) {
        let (seen, age_s) = (turn * sight.seen, sight.age_s);
        let mut columns = SMatrix::<f64, 3, UNKNOWNS>::zeros();
        let mut set = |at: usize, by: DVec3| columns.set_column(at, &SVector::from(by.to_array()));
        for (at, axis) in DVec3::AXES.into_iter().enumerate() {
            set(at, axis.cross(seen));
        }
        let across = |by: DVec3| by - expected * expected.dot(by);
        let gone = age_s * nearness(sight.held);
        let mut nearer = DVec3::ZERO;
        if sight.stands {
            set(RATE, -age_s * DVec3::Z.cross(expected));
        } else {
            set(WIND, -gone * across(DVec3::X));
            set(WIND + 1, -gone * across(DVec3::Y));
            nearer = age_s * across(wind.extend(0.0));
        }
        let rows = columns.transpose() * sight.weight;
        self.normal += rows * columns;
        self.pull += rows * SVector::from((expected - seen).to_array());
        self.nearer += rows * SVector::from(nearer.to_array());
        self.weight += sight.weight;
        self.aged += sight.weight * age_s;
    }
}

/// The turn that most of `sights` agree on: one sight proposes (Fischler & Bolles 1981; all are tried), Tukey's weights refine. Weights and
/// distances of the sights are set. `None` where fewer than `least` or less than half of them agree.
pub(super) fn fit(
    sights: &mut [SkyTrack],
    expected: &SkylinePrior,
    least: usize,
    scratch: &mut Vec<f64>,
) -> Option<SkylineFit> {
    let mut turn = consensus(sights, expected)?;
    let floor = SCATTER_LEAST_PX * expected.pixel;
    let mut scatter = Scatter { px: AGREE_PX * expected.pixel / 2.0, share: SPREAD };
    let tilt = expected.tilt_sigma.max(1e-6).powi(-2);
    let (mut wind, mut rate) = (expected.wind.mean(), 0.0);
    let mut last = None;
    for round in 0..ROUNDS {
        let sums = weigh(sights, turn, (wind, rate), scatter);
        // What inclination, wind and coast were found before is still about right.
        let unit = 1.0 / (SHARED * scatter.px * scatter.px);
        let known = of_wind(expected.wind.information)
            + NormalMatrix::from_diagonal(&NormalVector::from([
                tilt,
                tilt,
                0.0,
                0.0,
                0.0,
                expected.rate_sigma.powi(-2),
            ]));
        let tilted = rotation_vector(turn * expected.turn.inverse());
        let blown = expected.wind.pull - expected.wind.information * wind;
        let held = NormalVector::from([
            -tilted.x * tilt,
            -tilted.y * tilt,
            0.0,
            blown.x,
            blown.y,
            -rate * expected.rate_sigma.powi(-2),
        ]);
        let covariance = (sums.normal * unit + known).try_inverse()?;
        let step = covariance * (sums.pull * unit + held);
        let turned = DVec3::new(step[0], step[1], step[2]);
        turn = (DQuat::from_scaled_axis(turned) * turn).normalize();
        wind += DVec2::new(step[WIND], step[WIND + 1]);
        rate += step[RATE];
        if !(turn.is_finite() && wind.is_finite() && rate.is_finite()) {
            return None;
        }
        scatter = Scatter::of(sights, wind, floor, scratch)?;
        last = Some((sums, covariance, unit));
        if turned.length() < 0.01 * floor && round > 1 {
            break;
        }
    }
    let (sums, covariance, unit) = last?;
    let inliers = sights.iter().filter(|s| s.weight > 0.0).count();
    if inliers < least || 2 * inliers < sights.len() {
        return None;
    }
    // Clouds that are all higher or lower than they are taken for are an error that nothing here tells of.
    let nearer = covariance * sums.nearer * (unit * NEARNESS_SIGMA);
    let whole = covariance + nearer * nearer.transpose();
    let alone = block(&(sums.normal * unit)) + DMat3::from_diagonal(DVec3::new(tilt, tilt, 0.0));
    let of_drift = (whole[(2, 2)] - alone.inverse().z_axis.z).max(0.0);
    let age_s = (sums.aged / sums.weight).max(AGE_LEAST_S);
    let told = told(&covariance, &expected.wind, wind)?;
    Some(SkylineFit {
        turn,
        covariance: block(&whole),
        inliers,
        scatter: scatter.px,
        told,
        wind: expected.wind.and(&told),
        rate_sigma: of_drift.sqrt() / age_s,
    })
}

/// Sets how much each sight counts, and adds them up.
fn weigh(sights: &mut [SkyTrack], turn: DQuat, (wind, rate): (DVec2, f64), scatter: Scatter) -> NormalSums {
    let mut sums = NormalSums::default();
    for sight in sights {
        let seen = turn * sight.seen;
        let [cloud, coast] = sight.expected(wind, rate);
        let [as_cloud, as_coast] = [cloud, coast].map(|e| seen.distance(e));
        sight.stands = sight.may_stand() && as_coast < as_cloud;
        let (expected, off) = if sight.stands { (coast, as_coast) } else { (cloud, as_cloud) };
        sight.off = off;
        let unit2 = sight.unit * sight.unit + (scatter.share * sight.gone(wind) / scatter.px).powi(2);
        let share = (1.0 - (off / (BIWEIGHT_END * scatter.px)).powi(2) / unit2).max(0.0);
        sight.weight = sight.trust * share * share / unit2;
        if sight.weight > 0.0 {
            sums.add(sight, turn, wind, expected);
        }
    }
    sums
}

/// What the sights alone tell of the wind, whatever the turn: what was known beforehand is taken off what is known now.
fn told(covariance: &NormalMatrix, before: &Wind, wind: DVec2) -> Option<Wind> {
    let c = |row: usize, column: usize| covariance[(WIND + row, WIND + column)];
    let known = DMat2::from_cols_array(&[c(0, 0), c(1, 0), c(0, 1), c(1, 1)]).inverse();
    let told = Wind { information: known - before.information, pull: known * wind - before.pull };
    (told.information.is_finite() && told.pull.is_finite()).then_some(told)
}

fn of_wind(information: DMat2) -> NormalMatrix {
    let mut out = NormalMatrix::zeros();
    for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        out[(WIND + row, WIND + column)] = information.col(column)[row];
    }
    out
}

/// The part that is the turn's.
fn block(of: &NormalMatrix) -> DMat3 {
    DMat3::from_cols_array_2d(&[0, 1, 2].map(|c| [0, 1, 2].map(|r| of[(r, c)])))
}

/// The smallest turn that puts one sight right and most of the others about right.
fn consensus(sights: &[SkyTrack], expected: &SkylinePrior) -> Option<DQuat> {
    let agree = AGREE_PX * expected.pixel;
    let wind = expected.wind.mean();
    let covariance = expected.wind.covariance();
    let unknown = (covariance.x_axis.x + covariance.y_axis.y).max(0.0).sqrt();
    // What each sight would turn by, as a cloud and as coast, and how far a cloud may have gone beyond what is known.
    let shifts: Vec<([DVec3; 2], f64)> = sights
        .iter()
        .map(|s| {
            let seen = expected.turn * s.seen;
            let by = s.expected(wind, 0.0).map(|e| seen.cross(e));
            let gone = SPREAD * s.gone(wind) + unknown * nearness(s.held) * s.age_s;
            (if s.may_stand() { by } else { [by[0]; 2] }, gone)
        })
        .collect();
    let mut best: Option<(usize, f64, DVec3)> = None;
    for (candidate, (proposed, gone)) in sights.iter().zip(&shifts) {
        for by in proposed {
            let (mut count, mut sum) = (0, 0.0);
            for (other, (shift, other_gone)) in sights.iter().zip(&shifts) {
                // A turn about the line of sight itself is not seen.
                let across = *by - other.held * other.held.dot(*by);
                let off = shift[0].distance(across).min(shift[1].distance(across));
                // Roll is not in the proposal; it moves what lies far off the most.
                let slack = expected.tilt_sigma * candidate.held.distance(other.held) + gone.max(*other_gone);
                if off < agree * candidate.unit.max(other.unit) + 2.0 * slack {
                    count += 1;
                    sum += off;
                }
            }
            if best.is_none_or(|(most, least, _)| count > most || (count == most && sum < least)) {
                best = Some((count, sum, *by));
            }
        }
    }
    let (_, _, by) = best?;
    let turn = (DQuat::from_scaled_axis(by) * expected.turn).normalize();
    turn.is_finite().then_some(turn)
}

/// How far sights lie from where they should, standard deviation on an axis.
#[derive(Clone, Copy, Debug)]
struct Scatter {
    /// Of a fine one, radians.
    px: f64,
    /// And what clouds differ by in how far they have gone, as a share of it.
    share: f64,
}

impl Scatter {
    /// That of the sights that count: the first by the half that wind has carried the least far, the second by the other.
    fn of(sights: &[SkyTrack], wind: DVec2, floor: f64, scratch: &mut Vec<f64>) -> Option<Self> {
        let counting = || sights.iter().filter(|s| s.weight > 0.0);
        let far = median(counting().map(|s| s.gone(wind)), scratch)?;
        // The median of the length of a two-dimensional normal one is 1.1774 of its deviation.
        let near = counting().filter(|s| s.gone(wind) <= far).map(|s| s.off / s.unit);
        let px = (median(near, scratch)? / 1.1774).max(floor);
        let rest = |s: &SkyTrack| {
            ((s.off / 1.1774).powi(2) - (s.unit * px).powi(2)) / s.gone(wind).max(floor).powi(2)
        };
        let share = median(counting().filter(|s| s.gone(wind) >= far).map(rest), scratch)?;
        Some(Self { px, share: share.max(0.0).sqrt().min(SPREAD_MOST) })
    }
}

fn median(of: impl Iterator<Item = f64>, scratch: &mut Vec<f64>) -> Option<f64> {
    scratch.clear();
    scratch.extend(of);
    if scratch.is_empty() {
        return None;
    }
    let middle = scratch.len() / 2;
    let (_, median, _) = scratch.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median)
}
