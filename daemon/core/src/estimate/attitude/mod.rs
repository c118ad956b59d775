//! From the inertial unit's samples, and from what else tells which way it looks, to its orientation over time.

mod carriage;
mod consistency;
mod error_state;
mod external_ahrs;
mod filter;
mod inclination;
mod rest;
mod running;
#[cfg(test)]
mod tests;

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};

use self::{
    error_state::{Against, AidingUpdate},
    external_ahrs::ExternalAhrs,
    running::RunningFilter,
};
pub use self::{
    error_state::{REFRACTION_SIGMA, UpdateOutcome},
    filter::Noise,
    inclination::TAU_WAVES_S,
};
use crate::{
    calibration::Calibration,
    estimate::pose::{NoPose, OrientationAt, OrientationSample, PoseHistory},
    event::ImuSample,
    geometry::{rotation_vector, wrapped},
    physics::GRAVITY_M_S2,
    time::Time,
};

/// A gap longer than this is not bridged by integrating: the unit is levelled anew.
const GAP_NS: i64 = 1_000_000_000;

/// Whose estimate of the orientation is used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// The unit's own where it gives one, else [`Source::Fused`].
    #[default]
    Auto,
    /// Rate and specific force are fused here, whatever the unit thinks.
    Fused,
}

/// Kind of a unit's rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RateKind {
    /// The rate at the sample's time.
    #[default]
    Instant,
    /// The mean rate since the sample before, as of a unit that integrates by itself.
    Mean,
}

/// How orientation is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeSettings {
    /// Whose estimate is used.
    pub source: Source,
    /// Kind of the unit's rate.
    pub rate: RateKind,
    /// How the unit errs.
    pub noise: Noise,
    /// By how much the deviation of the heading of a unit's own orientation grows, rad/s.
    pub own_growth: f64,
}

/// What units that find their orientation by themselves are good for without a compass (5 deg/h), rad/s.
pub const OWN_GROWTH: f64 = 5.0 * std::f64::consts::PI / 180.0 / 3600.0;

impl AttitudeSettings {
    /// For that unit on that camera, of the usual class (a VN-100's: 0.0035 deg/s per square root of a hertz).
    pub fn new(source: Source, calibration: &Calibration) -> Self {
        Self {
            source,
            rate: RateKind::Instant,
            own_growth: OWN_GROWTH,
            noise: Noise {
                bias: calibration.gyro_bias_sigma,
                mounting: calibration.camera_from_imu_sigma,
                ..Noise::USUAL
            },
        }
    }
}

/// Which way is up, as a camera saw it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpSeen {
    /// Middle of the exposure on the inertial unit's clock.
    pub time: Time,
    /// Unit vector, camera's axes.
    pub up_camera: DVec3,
    /// Covariance of its error, rad^2, in the camera's axes.
    pub covariance: DMat3,
}

/// Where something of known direction was seen against where the believed heading has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingSeen {
    /// When it was seen, on the inertial unit's clock.
    pub time: Time,
    /// By what the believed world is to be turned about the vertical (counter-clockwise from above), radians; whole turns do not count.
    pub off: f64,
    /// Variance of that, rad^2.
    pub variance: f64,
}

/// Orientation by the unit's own estimate, with what is wrong with that estimated from what else is seen; or integrated from its rates, with
/// what is wrong with that estimated from specific force, too. Its heading then starts at the unit's own, or else at the camera's
/// "north", and drifts with what is left of the gyro's bias about the vertical.
#[derive(Debug)]
pub struct Attitude {
    gyro_bias: DVec3,
    camera_from_imu: DQuat,
    settings: AttitudeSettings,
    state: FilterState,
    history: PoseHistory,
    corrected: f64,
    /// Up by the unit's own orientation, its axes.
    own_up: DVec3,
}

#[derive(Debug)]
enum FilterState {
    /// Gathering specific force: since when, the sum, that of the squares and how many.
    Levelling { since: Option<Time>, sum: DVec3, squares: f64, count: u32 },
    /// Integrating.
    Running(Box<RunningFilter>),
    /// The unit's own orientation is taken; when it last told one.
    External(Box<ExternalAhrs>, Time),
}

impl FilterState {
    const START: Self = Self::Levelling { since: None, sum: DVec3::ZERO, squares: 0.0, count: 0 };
}

impl Attitude {
    /// An estimator for a unit with that bias (rad/s, its own axes) and that place on the camera.
    pub fn new(settings: AttitudeSettings, gyro_bias: DVec3, camera_from_imu: DQuat) -> Self {
        Self {
            gyro_bias,
            camera_from_imu,
            settings,
            state: FilterState::START,
            history: PoseHistory::new(),
            corrected: 0.0,
            own_up: DVec3::NEG_Z,
        }
    }

    /// Takes in a finite sample whose measurement was made at `time`; the orientation then, `None` while levelling.
    pub fn observe(&mut self, time: Time, sample: &ImuSample) -> Option<OrientationSample> {
        let found = self.find(time, sample)?;
        self.history.push(found);
        Some(found)
    }

    /// The orientation at `time`.
    pub fn at(&self, time: Time) -> Result<OrientationAt, NoPose> {
        self.history.at(time)
    }

    /// How the camera turns in the `span_ns` about `time`, radians about its axes; `None` where that is not known.
    pub fn camera_turn(&self, time: Time, span_ns: i64) -> Option<DVec3> {
        Some(self.camera_from_imu() * self.history.turn_over(time, span_ns)?)
    }

    /// Up at `time` by the unit alone, as it was calibrated to the camera, unit vector in the camera's axes: nothing that was seen is in it.
    /// `None` where that is not known.
    pub fn up_alone(&self, time: Time) -> Option<DVec3> {
        let up_imu = match &self.state {
            FilterState::Running(running) => running.alone.up_imu(),
            FilterState::External(..) => self.own_up,
            FilterState::Levelling { .. } => return None,
        };
        let at = |time: Time| self.history.at(time).ok().map(|at| at.world_from_imu);
        let since = at(time)?.inverse() * at(self.history.newest()?)?;
        Some(self.camera_from_imu * (since * up_imu))
    }

    /// Time of the newest orientation.
    pub fn newest(&self) -> Option<Time> {
        self.history.newest()
    }

    /// Begins anew, as when the unit has restarted.
    pub fn restart(&mut self) {
        self.history.clear();
        self.state = FilterState::START;
    }

    /// Covariance of the orientation's error as a turn of the world, rad^2; `None` before there is one.
    pub fn covariance(&self) -> Option<DMat3> {
        Some(self.update()?.turn_covariance())
    }

    /// Standard deviation of the heading since it was set or began, radians; `None` before there is one.
    pub fn heading_sigma(&self) -> Option<f64> {
        Some(self.covariance()?.z_axis.z.max(0.0).sqrt())
    }

    /// By how much the heading may drift, standard deviation, rad/s.
    pub fn drift_sigma(&self) -> Option<f64> {
        match &self.state {
            FilterState::Running(running) => Some(running.filter.drift_sigma(running.last.world_from_imu)),
            FilterState::External(external_ahrs, _) => Some(external_ahrs.drift_sigma()),
            FilterState::Levelling { .. } => None,
        }
    }

    fn update(&self) -> Option<&dyn AidingUpdate> {
        match &self.state {
            FilterState::Running(running) => Some(&running.filter.error_state),
            FilterState::External(external_ahrs, _) => Some(&external_ahrs.error_state),
            FilterState::Levelling { .. } => None,
        }
    }

    /// The error state, brought to the present.
    fn update_now(&mut self) -> Option<&mut dyn AidingUpdate> {
        match &mut self.state {
            FilterState::Running(running) => {
                running.filter.predict();
                Some(&mut running.filter.error_state)
            }
            FilterState::External(external_ahrs, _) => {
                external_ahrs.predict();
                Some(&mut external_ahrs.error_state)
            }
            FilterState::Levelling { .. } => None,
        }
    }

    /// How often the filter has erred by more than it said, and has fallen back to plain VQF's inclination.
    pub const fn falls(&self) -> u32 {
        match &self.state {
            FilterState::Running(running) => running.filter.falls(),
            FilterState::External(..) | FilterState::Levelling { .. } => 0,
        }
    }

    /// By how much corrections have turned the world about the vertical in all, radians: with that put back, the orientation's heading is
    /// what the unit alone makes of it.
    pub fn corrected(&self) -> f64 {
        match &self.state {
            FilterState::External(external_ahrs, _) => external_ahrs.heading(),
            FilterState::Running(_) | FilterState::Levelling { .. } => self.corrected,
        }
    }

    /// Rotation from the unit's axes to the camera's as it is known by now.
    fn camera_from_imu(&self) -> DQuat {
        let mounting = self.update().map_or(DVec3::ZERO, |update| update.mounting());
        DQuat::from_scaled_axis(mounting) * self.camera_from_imu
    }

    /// Rotation from the camera's axes to the world's with the unit as in `world_from_imu`.
    pub fn camera(&self, world_from_imu: DQuat) -> DQuat {
        (world_from_imu * self.camera_from_imu().inverse()).normalize()
    }

    /// The same for what is drawn: refraction is laid on the camera, so that the horizon that is seen lies where the one that is drawn
    /// about would.
    pub fn world_from_camera(&self, world_from_imu: DQuat) -> DQuat {
        let world_from_camera = self.camera(world_from_imu);
        let refraction = self.update().map_or(0.0, |update| update.refraction());
        let ahead = world_from_camera * DVec3::Z;
        let right = ahead.cross(DVec3::Z).normalize_or_zero();
        (DQuat::from_scaled_axis(right * -refraction) * world_from_camera).normalize()
    }

    /// Takes in where a camera saw up, unless that differs by more than `gate` (chi squared with two degrees of freedom) from what
    /// is known. `None` where nothing is known of that time.
    pub fn update_vertical(&mut self, seen: &UpSeen, gate: f64) -> Option<UpdateOutcome> {
        let then = self.history.at(seen.time).ok()?.world_from_imu;
        let world_from_camera = self.camera(then);
        let axes = DMat3::from_quat(world_from_camera);
        let turned = axes * seen.covariance * axes.transpose();
        let across = DMat2::from_cols(turned.x_axis.truncate(), turned.y_axis.truncate());
        let vertical =
            error_state::VerticalUpdate { world_from_camera, up_camera: seen.up_camera, covariance: across };
        let (turn, outcome) = self.update_now()?.update_vertical(&vertical, gate);
        match &mut self.state {
            FilterState::Running(running) if outcome.taken => running.filter.saw_up(),
            FilterState::External(external_ahrs, _) => {
                let up = world_from_camera * seen.up_camera;
                let variance = 0.5 * (across.x_axis.x + across.y_axis.y);
                external_ahrs.watch(DVec2::new(up.y, -up.x), variance, outcome);
            }
            _ => {}
        }
        self.turn(turn);
        Some(outcome)
    }

    /// Sets the heading: turns the world by `off` about the vertical, which is then known to `sigma`, radians. `false` where there is no
    /// estimate yet to be turned. What was anchored before ([`Self::anchor_heading`]) no longer is.
    pub fn set_heading(&mut self, off: f64, sigma: f64) -> bool {
        if self.update_now().is_none() {
            return false;
        }
        let turn = DQuat::from_rotation_z(off);
        match &mut self.state {
            FilterState::External(external_ahrs, _) => external_ahrs.set_heading(off, sigma),
            FilterState::Running(running) => {
                running.filter.set_heading(off, sigma);
                running.turn(turn);
            }
            FilterState::Levelling { .. } => {}
        }
        self.turn_history(turn);
        true
    }

    /// The gun's bearing on its mount is what its heading and the ship's now make it, which errs by `variance` (rad^2) beyond the gun's
    /// heading: from now on [`Self::update_mount_yaw`] tells of changes of the ship's heading. `false` where there is no heading yet.
    pub fn anchor_mount(&mut self, variance: f64) -> bool {
        self.update_now().map(|update| update.anchor_mount(variance)).is_some()
    }

    /// The gun's bearing on its mount, or what the ship's instruments say of its heading, may have changed by `variance`, rad^2.
    pub fn walk_mount(&mut self, variance: f64) -> bool {
        self.update_now().map(|update| update.walk_mount(variance)).is_some()
    }

    /// Takes in the heading as it is by the ship's and the gun's bearing on its mount; else as [`Self::update_heading`].
    pub fn update_mount_yaw(&mut self, seen: &HeadingSeen, gate: f64) -> Option<UpdateOutcome> {
        self.correct_heading(seen, Against::Mount, gate)
    }

    /// Takes in a heading, unless that differs by more than `gate` (chi squared with one degree of freedom) from what is known. `None`
    /// where nothing is known of that time.
    pub fn update_heading(&mut self, seen: &HeadingSeen, gate: f64) -> Option<UpdateOutcome> {
        self.correct_heading(seen, Against::North, gate)
    }

    /// From now on [`Self::update_anchored_heading`] tells of changes since now: what is far away holds its direction, wherever that is. It
    /// may turn by some `drift` rad/s itself, steadily, as seen from a ship under way; what is learnt of that stays over later anchors.
    pub fn anchor_heading(&mut self, drift: f64) -> bool {
        self.update_now().map(|update| update.anchor(drift)).is_some()
    }

    /// Takes in that what was anchored does not turn itself, known to that variance, (rad/s)^2. `false` where there is no estimate yet.
    pub fn update_anchor_still(&mut self, variance: f64) -> bool {
        let Some(update) = self.update_now() else { return false };
        let turn = update.update_anchor_still(variance);
        self.turn(turn);
        true
    }

    /// Takes in the heading as it is by what was anchored; else as [`Self::update_heading`].
    pub fn update_anchored_heading(&mut self, seen: &HeadingSeen, gate: f64) -> Option<UpdateOutcome> {
        self.correct_heading(seen, Against::Anchor, gate)
    }

    fn correct_heading(&mut self, seen: &HeadingSeen, against: Against, gate: f64) -> Option<UpdateOutcome> {
        self.history.at(seen.time).ok()?;
        let update = self.update_now()?;
        let heading = error_state::HeadingUpdate { against, off: wrapped(seen.off), variance: seen.variance };
        let (turn, outcome) = update.update_heading(heading, gate);
        self.turn(turn);
        Some(outcome)
    }

    /// The world is turned by a little, from now on and in what was before.
    fn turn(&mut self, turn: DQuat) {
        match &mut self.state {
            FilterState::Running(running) => running.turn(turn),
            FilterState::External(external_ahrs, _) => external_ahrs.turn(turn),
            FilterState::Levelling { .. } => {}
        }
        self.turn_history(turn);
    }

    /// What was before is turned with the world, too.
    fn turn_history(&mut self, turn: DQuat) {
        self.corrected += rotation_vector(turn).z;
        self.history.turn(turn);
    }

    /// The unit's own orientation at `time`, turned by what is known to be wrong with it.
    fn external_ahrs(&mut self, time: Time, world_from_imu: DQuat) -> DQuat {
        let (growth, mounting) = (self.settings.own_growth, self.settings.noise.mounting);
        if !matches!(self.state, FilterState::External(..)) {
            self.state = FilterState::External(Box::new(ExternalAhrs::new(growth, mounting)), time);
        }
        let FilterState::External(external_ahrs, last) = &mut self.state else { return world_from_imu };
        let dt_s = time.ns_since(*last).max(0) as f64 * 1e-9;
        *last = time.max(*last);
        external_ahrs.corrected(world_from_imu, dt_s)
    }

    fn find(&mut self, time: Time, sample: &ImuSample) -> Option<OrientationSample> {
        let rate = sample.rate - self.gyro_bias;
        if let (Some(q), Source::Auto) = (sample.world_from_imu, self.settings.source) {
            self.own_up = q.normalize().inverse() * DVec3::Z;
            let world_from_imu = self.external_ahrs(time, q.normalize());
            return Some(OrientationSample { time, world_from_imu, rate });
        }
        match &mut self.state {
            // A unit that tells its orientation now and then tells nothing in between.
            FilterState::External(_, last) if time.ns_since(*last).abs() <= GAP_NS => None,
            FilterState::Running(running) => {
                let dt_ns = time.ns_since(running.last.time);
                if dt_ns.abs() > GAP_NS {
                    self.state = FilterState::START;
                    return None;
                }
                // One that comes twice or after a younger one tells nothing new.
                if dt_ns > 0 {
                    let turn = running.step(self.settings.rate, (time, dt_ns), rate, sample.accel);
                    let last = running.last;
                    turn.into_iter().for_each(|turn| self.turn_history(turn));
                    return Some(last);
                }
                Some(running.last)
            }
            FilterState::External(..) | FilterState::Levelling { .. } => self.level_out(time, sample, rate),
        }
    }

    /// Gathers specific force until it tells which way is up.
    fn level_out(&mut self, time: Time, sample: &ImuSample, rate: DVec3) -> Option<OrientationSample> {
        /// A unit without an orientation of its own is levelled by the mean specific force over this long.
        const LEVEL_NS: i64 = 250_000_000;
        /// Steps of a filter that are shorter or longer than this are no unit's, seconds.
        const PERIODS_S: [f64; 2] = [1e-4, 0.1];
        let (since, sum, squares, count) = match self.state {
            FilterState::Levelling { since, sum, squares, count } => {
                (since.unwrap_or(time), sum, squares, count)
            }
            FilterState::Running(_) | FilterState::External(..) => (time, DVec3::ZERO, 0.0, 0),
        };
        let (sum, squares, count) = (sum + sample.accel, squares + sample.accel.length_squared(), count + 1);
        self.state = FilterState::Levelling { since: Some(since), sum, squares, count };
        let span_ns = time.ns_since(since);
        if span_ns < LEVEL_NS {
            return None;
        }
        let mean = sum / f64::from(count);
        let levelled = level(mean, self.camera_from_imu);
        let world_from_imu =
            sample.world_from_imu.map_or(levelled, |external_ahrs| headed(levelled, external_ahrs));
        let [shortest, longest] = PERIODS_S;
        let period_s = (span_ns as f64 * 1e-9 / f64::from(count - 1).max(1.0)).clamp(shortest, longest);
        let last = OrientationSample { time, world_from_imu, rate };
        let tilt = start_tilt(mean, squares / f64::from(count));
        let running = RunningFilter::new(self.settings.noise, tilt, period_s, last, sample.accel);
        self.state = FilterState::Running(Box::new(running));
        Some(last)
    }
}

/// How wrong an inclination may be that is levelled by this mean of specific force (m/s^2), with that mean square, radians: what moves the unit
/// shows in how the force changes and in how its size differs from gravity's.
fn start_tilt(mean: DVec3, square: f64) -> f64 {
    let moved = (square - mean.length_squared()).max(0.0) + (mean.length() - GRAVITY_M_S2).powi(2);
    /// Inclination after levelling a unit that waves move, and at most, radians.
    const START_TILT: f64 = 0.06;
    const START_TILT_MOST: f64 = 0.6;
    START_TILT.hypot(moved.sqrt() / GRAVITY_M_S2).min(START_TILT_MOST)
}

/// Turn over the `h` seconds from rate `from` to rate `to`, a scaled axis in the body's frame: the integral of the rate and the
/// first commutator of the Magnus expansion (Iserles & Norsett 1999, eq. 1.2), which is what coning adds. With the rate `h`
/// seconds `before` the integral is that of the parabola through all three, else of the line.
pub fn turn_between(before: Option<DVec3>, from: DVec3, to: DVec3, h: f64) -> DVec3 {
    let integral = match before {
        Some(before) => (to * 5.0 + from * 8.0 - before) * (h / 12.0),
        None => (from + to) * (h / 2.0),
    };
    integral + coning(from, to, h)
}

/// What a turn whose axis turns from `from` to `to` in `h` seconds has more than the integral of its rate.
fn coning(from: DVec3, to: DVec3, h: f64) -> DVec3 {
    from.cross(to) * (h * h / 12.0)
}

/// The orientation in which `up_imu` (the direction of the specific force at rest) points up and the camera looks north.
/// A camera that looks straight up or down keeps the heading of its picture's top.
pub fn level(up_imu: DVec3, camera_from_imu: DQuat) -> DQuat {
    let up = up_imu.try_normalize().unwrap_or(DVec3::NEG_Z);
    let tilted = DQuat::from_rotation_arc(up, DVec3::Z);
    let axis = |camera: DVec3| tilted * (camera_from_imu.inverse() * camera);
    let forward = axis(DVec3::Z);
    let north = if forward.truncate().length() > 1e-3 { forward } else { axis(DVec3::NEG_Y) };
    let azimuth = north.x.atan2(north.y);
    (DQuat::from_rotation_z(azimuth) * tilted).normalize()
}

/// `levelled`, turned about the vertical to the heading of `external_ahrs`.
fn headed(levelled: DQuat, external_ahrs: DQuat) -> DQuat {
    // The twist about z of what lies between (Dobrowolski 2015, swing-twist).
    let between = external_ahrs * levelled.inverse();
    let twist = DQuat::from_xyzw(0.0, 0.0, between.z, between.w);
    if twist.length() > 1e-6 { (twist.normalize() * levelled).normalize() } else { levelled }
}
