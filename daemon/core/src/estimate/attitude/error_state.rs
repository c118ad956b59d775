//! Error state that every estimate of the orientation has: its covariance, and its updates by cameras and ships.
//!
//! The error is a small turn of the world: `true = exp(error) estimate` (Sola, "Quaternion kinematics for the error-state Kalman filter",
//! 2017, section 7, global error). A turn of the world hardly changes from one sample to the next, so that a measurement made some
//! frames ago corrects the present.

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
use nalgebra::{SMatrix, SVector};

/// Where the states lie that all have: turn of the world (3), ...
pub(super) const TURN: usize = 0;
/// ...of which the heading is the last, ...
pub(super) const HEADING: usize = 2;
/// ...turn of the camera against the unit in the camera's axes (3), ...
const MOUNTING: usize = 3;
/// ...how much higher the horizon stands than geometry has it, ...
const REFRACTION: usize = 6;
/// ...turn about the vertical of the anchor and its rate, ...
const ANCHOR: usize = 7;
const ANCHOR_RATE: usize = 8;
/// ...turn of the gun on its mount.
const MOUNT: usize = 9;
/// How many these are.
pub(super) const COMMON: usize = 10;

/// Refraction moves the true horizon by as much from day to day and hour to hour (design figures: 0.08 to 0.12 deg in daytime), radians.
pub const REFRACTION_SIGMA: f64 = 0.1f64.to_radians();
/// It forgets itself in this time, seconds.
const REFRACTION_TAU_S: f64 = 3600.0;

/// How a measured number changes with the states.
pub(super) type MeasurementRow<const N: usize> = SVector<f64, N>;

/// By what a measurement differs from what was expected, and whether it was believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpdateOutcome {
    /// Normalised innovation squared: the square of the difference over its expected variance, chi squared with as many degrees of
    /// freedom as the measurement has.
    pub nis: f64,
    /// Whether it was taken in.
    pub taken: bool,
}

/// Correction by a measurement: the world is to be turned by this.
pub(super) type Correction = DQuat;

/// The reference of a heading.
#[derive(Clone, Copy, Debug)]
pub(super) enum Against {
    /// North itself.
    North,
    /// The anchor.
    Anchor,
    /// The ship, by the gun's bearing on its mount.
    Mount,
}

/// `N` states: estimates and the covariance of their errors. What of the estimates is a turn of the world is put into the orientation at
/// once and kept there.
#[derive(Clone, Debug)]
pub(super) struct ErrorState<const N: usize> {
    covariance: SMatrix<f64, N, N>,
    estimate: SVector<f64, N>,
}

/// A direction of up that a camera saw.
#[derive(Clone, Copy, Debug)]
pub(super) struct VerticalUpdate {
    /// Rotation from the camera's axes to the world's, as believed.
    pub world_from_camera: DQuat,
    /// Up in the camera's axes, a unit vector.
    pub up_camera: DVec3,
    /// Covariance of its part across up, rad^2, in the world's horizontal axes.
    pub covariance: DMat2,
}

/// A heading that was seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeadingUpdate {
    /// Reference that it was seen against.
    pub against: Against,
    /// The turn of the world about the vertical that it asks for, rad.
    pub off: f64,
    /// Variance of that, rad^2.
    pub variance: f64,
}

/// Updates of the error state by cameras and ships, whatever else the states are.
pub(super) trait AidingUpdate {
    /// Covariance of the turn of the world, rad^2.
    fn turn_covariance(&self) -> DMat3;

    /// Turn of the camera against its calibrated place on the unit, radians, about the camera's axes.
    fn mounting(&self) -> DVec3;

    /// By how much the horizon stands higher than geometry has it, radians.
    fn refraction(&self) -> f64;

    /// Takes in the direction of up that the camera saw; `gate` is the chi-square gate: the NIS beyond which it is not believed.
    fn update_vertical(&mut self, vertical: &VerticalUpdate, gate: f64) -> (Correction, UpdateOutcome);

    /// Takes in a heading.
    fn update_heading(&mut self, heading: HeadingUpdate, gate: f64) -> (Correction, UpdateOutcome);

    /// The gun's bearing on its mount is what heading and the ship's heading now make it, which errs by `variance` beyond the heading.
    fn anchor_mount(&mut self, variance: f64);

    /// The bearing, or what the ship says of its own heading, may have changed by `variance`.
    fn walk_mount(&mut self, variance: f64);

    /// From now on what is seen of the anchor tells of changes since now; what is anchored in turns by `drift` rad/s itself.
    fn anchor(&mut self, drift: f64);

    /// Takes in that what is anchored in does not turn itself, to that variance, (rad/s)^2.
    fn update_anchor_still(&mut self, variance: f64) -> Correction;
}

impl<const N: usize> ErrorState<N> {
    /// Nothing learnt yet of a camera that is mounted on the unit to within `mounting`, rad.
    pub fn new(mounting: DVec3) -> Self {
        let mut error_state = Self { covariance: SMatrix::zeros(), estimate: SVector::zeros() };
        for axis in 0..3 {
            error_state.forget(MOUNTING + axis, mounting[axis]);
        }
        error_state.forget(REFRACTION, REFRACTION_SIGMA);
        error_state
    }

    /// The estimate of a state.
    pub fn at(&self, state: usize) -> f64 {
        self.estimate[state]
    }

    /// Of two of them.
    pub fn two(&self, state: usize) -> DVec2 {
        DVec2::new(self.estimate[state], self.estimate[state + 1])
    }

    /// Of three of them.
    pub fn three(&self, state: usize) -> DVec3 {
        self.two(state).extend(self.estimate[state + 2])
    }

    /// A state is known otherwise from now on; its error stays as it is.
    pub fn set(&mut self, state: usize, estimate: f64) {
        self.estimate[state] = estimate;
    }

    /// Variance of a state's error.
    pub fn variance(&self, state: usize) -> f64 {
        self.covariance[(state, state)]
    }

    /// Covariance of three states' errors.
    pub fn covariance(&self, state: usize) -> DMat3 {
        let p = &self.covariance;
        DMat3::from_cols_array_2d(&[0, 1, 2].map(|c| [0, 1, 2].map(|r| p[(state + r, state + c)])))
    }

    /// Prediction over `dt_s` seconds of the states that all have, but for the turn.
    pub fn pass_time(&mut self, dt_s: f64) {
        self.fade(REFRACTION, (-dt_s / REFRACTION_TAU_S).exp(), REFRACTION_SIGMA * REFRACTION_SIGMA);
        self.carry(ANCHOR, ANCHOR_RATE, dt_s);
    }

    /// Chance adds that variance to a state.
    pub fn walk(&mut self, state: usize, variance: f64) {
        self.covariance[(state, state)] += variance;
    }

    /// Error of the state `to` grows by `share` of that of the state `from`: states that nothing happens to are left out, which makes this
    /// ten times as fast as the product of matrices.
    pub fn add(&mut self, to: usize, from: usize, share: f64) {
        let p = &mut self.covariance;
        for other in 0..N {
            p[(to, other)] += share * p[(from, other)];
        }
        for other in 0..N {
            p[(other, to)] += share * p[(other, from)];
        }
    }

    /// Chance adds that covariance to three states.
    pub fn walk_three(&mut self, state: usize, added: DMat3) {
        for column in 0..3 {
            for row in 0..3 {
                let both = added.col(column)[row] + added.col(row)[column];
                self.covariance[(state + row, state + column)] += 0.5 * both;
            }
        }
    }

    /// Error of the state `to` grows by those shares of the errors of other states: `P + e d' + d e' + e e' (s' d)` with `d = P s`.
    pub fn add_all(&mut self, to: usize, shares: impl Iterator<Item = (usize, f64)> + Clone) {
        let mut change = SVector::<f64, N>::zeros();
        for (from, share) in shares.clone() {
            change.axpy(share, &self.covariance.column(from), 1.0);
        }
        let own: f64 = shares.map(|(from, share)| share * change[from]).sum();
        let mut column = self.covariance.column(to) + change;
        column[to] += change[to] + own;
        self.covariance.set_column(to, &column);
        self.covariance.set_row(to, &column.transpose());
    }

    /// The same for what is known of it, too.
    pub fn carry(&mut self, to: usize, from: usize, share: f64) {
        self.estimate[to] += share * self.estimate[from];
        self.add(to, from, share);
    }

    /// Two states become `change` of what they were, and chance adds `added` to their covariance.
    pub fn mix(&mut self, at: [usize; 2], change: DMat2, added: DMat2) {
        let rows = [change.row(0), change.row(1)];
        let now = change * DVec2::new(self.estimate[at[0]], self.estimate[at[1]]);
        (self.estimate[at[0]], self.estimate[at[1]]) = (now.x, now.y);
        let p = &mut self.covariance;
        for other in 0..N {
            let both = DVec2::new(p[(at[0], other)], p[(at[1], other)]);
            (p[(at[0], other)], p[(at[1], other)]) = (rows[0].dot(both), rows[1].dot(both));
        }
        for other in 0..N {
            let both = DVec2::new(p[(other, at[0])], p[(other, at[1])]);
            (p[(other, at[0])], p[(other, at[1])]) = (rows[0].dot(both), rows[1].dot(both));
        }
        for (row, of_row) in at.into_iter().enumerate() {
            for (column, of_column) in at.into_iter().enumerate() {
                p[(of_row, of_column)] += added.col(column)[row];
            }
        }
        // Rounding alone makes these two differ.
        p[(at[1], at[0])] = p[(at[0], at[1])];
    }

    /// The state keeps that share of itself, and chance makes up what its variance loses.
    pub fn fade(&mut self, state: usize, kept: f64, variance: f64) {
        self.estimate[state] *= kept;
        for other in 0..N {
            self.covariance[(state, other)] *= kept;
            self.covariance[(other, state)] *= kept;
        }
        self.covariance[(state, state)] += variance * (1.0 - kept * kept);
    }

    /// Nothing is known of the state any longer but its deviation.
    pub fn forget(&mut self, state: usize, deviation: f64) {
        self.estimate[state] = 0.0;
        self.covariance.row_mut(state).fill(0.0);
        self.covariance.column_mut(state).fill(0.0);
        self.covariance[(state, state)] = deviation * deviation;
    }

    /// Error of the state `to` is from now on that of the state `from`.
    pub fn copy(&mut self, to: usize, from: usize) {
        let mut row = self.covariance.row(from).into_owned();
        row[to] = row[from];
        self.covariance.set_row(to, &row);
        self.covariance.set_column(to, &row.transpose());
    }

    /// The heading is set from outside and known to that deviation: what was known of it before holds no longer. The world is turned by
    /// `off` about the vertical, and with it what lies along its axes: the turn's own tilt, and the states that come in pairs at `pairs`.
    pub fn set_heading(&mut self, off: f64, deviation: f64, pairs: &[usize]) {
        self.forget(HEADING, deviation);
        self.forget(ANCHOR, std::f64::consts::PI);
        self.forget(MOUNT, std::f64::consts::PI);
        let turned = DMat2::from_angle(off);
        for at in std::iter::once(TURN).chain(pairs.iter().copied()) {
            self.mix([at, at + 1], turned, DMat2::ZERO);
        }
    }

    /// Takes in a number that differs by `differ` from what was expected.
    pub fn update_one(
        &mut self,
        row: &MeasurementRow<N>,
        differ: f64,
        variance: f64,
        gate: f64,
    ) -> (Correction, UpdateOutcome) {
        let across = self.across(row);
        let expected = row.dot(&across) + variance;
        let nis = differ * differ / expected;
        if nis.is_nan() || nis > gate {
            return (DQuat::IDENTITY, UpdateOutcome { nis, taken: false });
        }
        let gain = across / expected;
        self.take_off([&(across - gain * (0.5 * expected))], [&gain]);
        (self.put_in(&(gain * differ)), UpdateOutcome { nis, taken: true })
    }

    /// Takes in two numbers.
    pub fn update(
        &mut self,
        rows: &[MeasurementRow<N>; 2],
        differ: DVec2,
        noise: DMat2,
        gate: f64,
    ) -> (Correction, UpdateOutcome) {
        let across = [self.across(&rows[0]), self.across(&rows[1])];
        let shared = rows[0].dot(&across[1]);
        let own = DVec2::new(rows[0].dot(&across[0]), rows[1].dot(&across[1]));
        let expected = DMat2::from_cols(DVec2::new(own.x, shared), DVec2::new(shared, own.y)) + noise;
        let inverse = expected.inverse();
        let nis = differ.dot(inverse * differ);
        // The inverse of a singular matrix is infinite or NaN.
        if !nis.is_finite() || nis > gate {
            return (DQuat::IDENTITY, UpdateOutcome { nis, taken: false });
        }
        let sum_of = |of: &[MeasurementRow<N>; 2], shares: DVec2| of[0] * shares.x + of[1] * shares.y;
        let gain = [0, 1].map(|number| sum_of(&across, inverse.col(number)));
        // Joseph's form, (I - K H) P (I - K H)' + K R K' = P - A K' - K A' + K S K' with A = P H', S = H P H' + R: as the sum of a matrix and its
        // transpose, which is symmetric to the last bit.
        let half = [0, 1].map(|number| across[number] - sum_of(&gain, expected.col(number) * 0.5));
        let [half, gains] = [&half, &gain].map(|both| [&both[0], &both[1]]);
        self.take_off(half, gains);
        (self.put_in(&sum_of(&gain, differ)), UpdateOutcome { nis, taken: true })
    }

    /// Covariance of the errors with that of a measured number: rows have few entries that are not nothing.
    fn across(&self, row: &MeasurementRow<N>) -> SVector<f64, N> {
        let mut across = SVector::<f64, N>::zeros();
        for (state, share) in row.iter().enumerate().filter(|(_, share)| **share != 0.0) {
            across.axpy(*share, &self.covariance.column(state), 1.0);
        }
        across
    }

    /// Takes `half gain' + gain half'` off the covariance, for each of them.
    fn take_off<const M: usize>(&mut self, half: [&SVector<f64, N>; M], gain: [&SVector<f64, N>; M]) {
        let of = |vector: &SVector<f64, N>| vector.data.0[0];
        let (half, gain) = (half.map(of), gain.map(of));
        for (number, column) in self.covariance.data.0.iter_mut().enumerate() {
            for (half, gain) in half.iter().zip(&gain) {
                let (by_half, by_gain) = (half[number], gain[number]);
                for ((value, half), gain) in column.iter_mut().zip(half).zip(gain) {
                    *value -= half * by_gain + gain * by_half;
                }
            }
        }
    }

    /// Adds the estimated error to what is known; what is left is the turn of the world.
    fn put_in(&mut self, error: &SVector<f64, N>) -> Correction {
        self.estimate += error;
        let turn = self.three(TURN);
        self.estimate.fixed_rows_mut::<3>(TURN).fill(0.0);
        DQuat::from_scaled_axis(turn)
    }
}

impl<const N: usize> AidingUpdate for ErrorState<N> {
    fn turn_covariance(&self) -> DMat3 {
        self.covariance(TURN)
    }

    fn mounting(&self) -> DVec3 {
        self.three(MOUNTING)
    }

    fn refraction(&self) -> f64 {
        self.at(REFRACTION)
    }

    fn update_vertical(&mut self, vertical: &VerticalUpdate, gate: f64) -> (Correction, UpdateOutcome) {
        let &VerticalUpdate { world_from_camera, up_camera, covariance } = vertical;
        let up = world_from_camera * up_camera;
        let mut rows = up_rows();
        let axes = DMat3::from_quat(world_from_camera);
        // A horizon that stands higher tilts up away from where the camera looks.
        let ahead = axes.z_axis.truncate().normalize_or_zero();
        for column in 0..3 {
            let turned = axes.col(column);
            rows[0][MOUNTING + column] = turned.y;
            rows[1][MOUNTING + column] = -turned.x;
        }
        rows[0][REFRACTION] = -ahead.x;
        rows[1][REFRACTION] = -ahead.y;
        let differ = up.truncate() + ahead * self.refraction();
        self.update(&rows, differ, covariance, gate)
    }

    fn update_heading(&mut self, heading: HeadingUpdate, gate: f64) -> (Correction, UpdateOutcome) {
        let HeadingUpdate { against, off, variance } = heading;
        let mut row = MeasurementRow::zeros();
        row[HEADING] = 1.0;
        let reference = match against {
            Against::North => None,
            Against::Anchor => Some(ANCHOR),
            Against::Mount => Some(MOUNT),
        };
        let mut turned = 0.0;
        if let Some(state) = reference {
            row[state] = -1.0;
            turned = self.at(state);
        }
        self.update_one(&row, off + turned, variance, gate)
    }

    fn anchor_mount(&mut self, variance: f64) {
        self.copy(MOUNT, HEADING);
        self.walk(MOUNT, variance);
        self.set(MOUNT, 0.0);
    }

    fn walk_mount(&mut self, variance: f64) {
        self.walk(MOUNT, variance);
    }

    fn anchor(&mut self, drift: f64) {
        self.copy(ANCHOR, HEADING);
        self.set(ANCHOR, 0.0);
        // Another sky may drift otherwise, by no less than what is said of it.
        self.walk(ANCHOR_RATE, (drift * drift - self.variance(ANCHOR_RATE)).max(0.0));
    }

    fn update_anchor_still(&mut self, variance: f64) -> Correction {
        let mut row = MeasurementRow::zeros();
        row[ANCHOR_RATE] = 1.0;
        self.update_one(&row, -self.at(ANCHOR_RATE), variance, f64::INFINITY).0
    }
}

/// How the horizontal parts of where up is found change with the turn of the world: `up + up x turn`.
fn up_rows<const N: usize>() -> [MeasurementRow<N>; 2] {
    let mut rows = [MeasurementRow::zeros(); 2];
    rows[0][TURN + 1] = -1.0;
    rows[1][TURN] = 1.0;
    rows
}
