//! Heading from outside: the ship's own, the operator's presses, landmarks.
//!
//! The unit on the gun measures ship and gun together, and nothing measures the gun on its mount. What the ship says of its heading is
//! therefore worth something only while the gun's bearing on the mount is known or does not change. [`HeadingAiding`] watches that bearing, as gyro and
//! ship together make it; where it rests, the ship's heading holds the gun's, with the bearing as a state of the filter that knows as much as
//! the heading did when the rest began. Where the gun moves, the bearing is worth nothing, and the gyro coasts.

use std::{collections::VecDeque, f64::consts::FRAC_PI_2};

use glam::{DQuat, DVec3};

use super::visual_compass::SKY_DRIFT;
use crate::{
    estimate::attitude::{Attitude, HeadingSeen},
    event::{MarkKind, ShipSample},
    geometry::wrapped,
    time::{NS_PER_S, Time},
};

/// The stow of the gun: where the operator re-zeroes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stow {
    /// Bearing of the camera's axis from the ship's bow, clockwise, radians; used where the ship tells its heading.
    pub from_bow: Option<f64>,
    /// True bearing, clockwise from north, radians; used where it does not.
    pub from_north: Option<f64>,
    /// Standard deviation of either, radians.
    pub sigma: f64,
}

/// Something far away whose direction is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark {
    /// True bearing from the ship's place, clockwise from north, radians.
    pub bearing: f64,
    /// Its standard deviation, radians.
    pub sigma: f64,
}

/// Latency and standard deviation of the headings of the ship's own instruments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShipHeadings {
    /// From the measurement to the arrival of its line, nanoseconds.
    pub latency_ns: i64,
    /// Standard deviation where the instruments tell none, radians.
    pub sigma: f64,
}

/// Settings of heading aiding.
#[derive(Clone, Debug, PartialEq)]
pub struct HeadingSettings {
    /// The ship's own headings.
    pub ship: ShipHeadings,
    /// The bearing that the operator's press stands for.
    pub stow: Option<Stow>,
    /// What the camera's axis may lie on when the operator presses for a landmark.
    pub landmarks: Vec<Landmark>,
    /// By how much the deviation of the heading of a unit's own orientation grows, rad/s; absent: as units do without a compass.
    pub own_growth: Option<f64>,
    /// By how much sky line and clouds may turn themselves (one standard deviation), rad/s.
    pub sky_drift: f64,
    /// The display tells the heading's deviation above this, radians.
    pub shown_above: f64,
}

impl Default for HeadingSettings {
    fn default() -> Self {
        Self {
            ship: ShipHeadings { latency_ns: 0, sigma: 0.5f64.to_radians() },
            stow: None,
            landmarks: Vec::new(),
            own_growth: None,
            sky_drift: SKY_DRIFT,
            shown_above: 1f64.to_radians(),
        }
    }
}

/// Counts of headings from outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HeadingCounts {
    /// Headings of the ship that came.
    pub ship: u64,
    /// Of these, taken in...
    pub ship_taken: u64,
    /// ...and not believed.
    pub ship_refused: u64,
    /// Rests of the gun on its mount at whose start the ship's heading was tied to the gun's.
    pub rests: u64,
    /// Presses that set the heading.
    pub marks: u64,
    /// Presses that could not be used: nothing is configured for them, or there is no heading to be set.
    pub marks_refused: u64,
}

/// What one heading of the ship errs by from one to the next, beside its step: radians.
const LINE_SIGMA: f64 = 0.1 * std::f64::consts::PI / 180.0;

/// How well a feed's latency is known, seconds: while the ship turns, that is an error of its heading.
const LATENCY_SIGMA_S: f64 = 0.02;

/// In this time what a gyro compass errs by becomes another error: a quarter of its own period of 84 minutes (Schuler 1923), seconds.
const COMPASS_TAU_S: f64 = 1260.0;

/// Bearings are watched over so long: waves, whose tilts move them, fall out of a slope over that.
const WATCH_NS: i64 = 30 * NS_PER_S;

/// Less than this of them tells no rest.
const REST_NS: i64 = 4 * NS_PER_S;

/// A gap after which the bearings before have no bearing on those after: the gun may have been anywhere.
const GAP_NS: i64 = 10 * NS_PER_S;

/// While nothing is heard of the ship the gun may have moved: by this in a square root of a second, rad.
const UNSEEN_WALK: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// Bearings that change by less than this are at rest, whatever is known, rad/s: what a compass's own wander looks like...
const REST_RATE: f64 = 0.03 * std::f64::consts::PI / 180.0;

/// ...and bearings that change by as much are not, whatever is not known: no gun is trained more slowly. A gyro with more bias than that, which
/// nothing has told yet, is not helped by a ship.
const CREEP_RATE: f64 = 0.075 * std::f64::consts::PI / 180.0;

/// How many deviations a bearing may lie off before it counts as moved.
const GATE: f64 = 3.5;

/// Chi squared with one degree of freedom that is exceeded once in a thousand.
const NIS_GATE: f64 = 10.8;

/// So many headings in a row that are not believed mean that the gun was moved.
const REFUSED_MAX: u32 = 10;

/// A feed that says the very same for so long, while the gun turns by [`FROZEN_TURN`], is stuck or lies still beside a gun that moves.
const FROZEN_NS: i64 = 20 * NS_PER_S;
const FROZEN_TURN: f64 = 0.3 * std::f64::consts::PI / 180.0;

/// A ship that rolls turns as well. Where the picture has tilted by [`FROZEN_ROLL`] meanwhile, which no gunner makes it do, and the feed has
/// said the very same for so long, it is stuck for sure.
const STUCK_NS: i64 = 60 * NS_PER_S;
const FROZEN_ROLL: f64 = 2.0 * std::f64::consts::PI / 180.0;

/// A bearing on the mount as gyro and ship make it: when, and how much it differs from the first one, radians.
type Bearing = (Time, f64);

/// Motion of the gun on its mount.
#[derive(Clone, Copy, Debug)]
enum MountMotion {
    /// It cannot be told yet.
    Unknown,
    Moves,
    /// The newest bearing lies so far off the line through all, radians.
    Rests {
        off: f64,
    },
}

/// Takes in headings from outside.
#[derive(Debug)]
pub(super) struct HeadingAiding {
    settings: HeadingSettings,
    watched: VecDeque<Bearing>,
    /// The newest heading of the ship with the bearing that the filter's orientation gave with it, and its standard deviation.
    newest: Option<Newest>,
    /// The bearing that [`Attitude::update_mount_yaw`] counts from.
    anchored: Option<f64>,
    refused_in_a_row: u32,
    same: Option<FrozenHeading>,
    counts: HeadingCounts,
}

#[derive(Clone, Copy, Debug)]
struct Newest {
    time: Time,
    heading: f64,
    sigma: f64,
}

/// Since when the ship has said the very same, and the gun's heading by gyro and the picture's tilt then.
#[derive(Clone, Copy, Debug)]
struct FrozenHeading {
    heading: f64,
    since: Time,
    gun: f64,
    tilt: f64,
    /// Farthest that the gun has turned, and the picture tilted, since.
    turned: f64,
    tilted: f64,
}

impl HeadingAiding {
    pub(super) const fn new(settings: HeadingSettings) -> Self {
        Self {
            settings,
            watched: VecDeque::new(),
            newest: None,
            anchored: None,
            refused_in_a_row: 0,
            same: None,
            counts: HeadingCounts {
                ship: 0,
                ship_taken: 0,
                ship_refused: 0,
                rests: 0,
                marks: 0,
                marks_refused: 0,
            },
        }
    }

    pub(super) const fn counts(&self) -> HeadingCounts {
        self.counts
    }

    pub(super) const fn settings(&self) -> &HeadingSettings {
        &self.settings
    }

    /// What was watched is worth nothing any more, as when the unit has restarted.
    pub(super) fn forget(&mut self) {
        self.watched.clear();
        (self.newest, self.anchored, self.same, self.refused_in_a_row) = (None, None, None, 0);
    }

    /// Takes in what the ship's instruments said.
    pub(super) fn ship(&mut self, sample: &ShipSample, attitude: &mut Attitude) {
        let Some(heading) = sample.heading else { return };
        self.counts.ship += 1;
        let time = sample.arrival.plus_ns(-self.settings.ship.latency_ns);
        let Ok(then) = attitude.at(time) else { return };
        let camera = attitude.camera(then.world_from_imu);
        let Some(bearing) = bearing_on_mount(camera, heading, sample) else { return };
        let before = self.newest;
        if before.is_some_and(|b| time <= b.time) {
            return;
        }
        let sigma = sample.heading_sigma.unwrap_or(self.settings.ship.sigma);
        // An instrument that says that it is not at its best is believed half as much.
        let sigma = if sample.reduced { 2.0 * sigma } else { sigma };
        self.newest = Some(Newest { time, heading, sigma });
        let dt_s = before.map_or(0.0, |b| time.secs_since(b.time));
        let turned = before.map_or(0.0, |b| wrapped(heading - b.heading) / dt_s);
        let line = LINE_SIGMA.hypot(turned * LATENCY_SIGMA_S);
        self.pass_time(time, dt_s, sigma, attitude);
        let gun = bearing + heading + attitude.corrected();
        let tilt = (camera * DVec3::X).z.clamp(-1.0, 1.0).asin();
        if self.is_stuck(time, heading, gun, tilt) {
            self.watched.clear();
            self.release();
            return;
        }
        self.watch(time, bearing + attitude.corrected());
        let drift = attitude.drift_sigma().unwrap_or(0.0);
        match self.rests(line, drift) {
            MountMotion::Moves => {
                // What was before it moved says nothing of the next rest.
                let moving = self.watched.len().saturating_sub(1);
                self.watched.drain(..moving);
                self.release();
            }
            MountMotion::Unknown => {}
            MountMotion::Rests { off } => match self.anchored {
                None => self.tie(bearing - off, line, attitude),
                Some(anchored) => self.hold(time, bearing - anchored, line, attitude),
            },
        }
    }

    /// What `dt_s` seconds since the last line do to what is known of the bearing.
    fn pass_time(&mut self, time: Time, dt_s: f64, sigma: f64, attitude: &mut Attitude) {
        if self.watched.back().is_some_and(|(last, _)| time.ns_since(*last) > GAP_NS) {
            self.watched.clear();
        }
        if self.anchored.is_none() {
            return;
        }
        // Lines of a feed come once a second or more often; what is beyond is silence.
        let unseen_s = (dt_s - 2.0).max(0.0);
        let wander = 2.0 * sigma * sigma * dt_s / COMPASS_TAU_S;
        attitude.walk_mount(wander + UNSEEN_WALK * UNSEEN_WALK * unseen_s);
    }

    fn is_stuck(&mut self, time: Time, heading: f64, gun: f64, tilt: f64) -> bool {
        match &mut self.same {
            Some(same) if same.heading == heading => {
                same.turned = same.turned.max(wrapped(gun - same.gun).abs());
                same.tilted = same.tilted.max((tilt - same.tilt).abs());
                time.ns_since(same.since) > FROZEN_NS && same.turned > FROZEN_TURN
            }
            _ => {
                self.same = Some(FrozenHeading { heading, since: time, gun, tilt, turned: 0.0, tilted: 0.0 });
                false
            }
        }
    }

    /// For how long the feed has said the very same though the ship moves, seconds; `None` where it does not, or is silent.
    pub(super) fn frozen_s(&self, now: Time) -> Option<f64> {
        let (same, newest) = (self.same?, self.newest?);
        let said = newest.time.ns_since(same.since) > STUCK_NS && now.ns_since(newest.time) <= GAP_NS;
        (said && same.turned > FROZEN_TURN && same.tilted > FROZEN_ROLL).then(|| now.secs_since(same.since))
    }

    fn watch(&mut self, time: Time, bearing: f64) {
        let unwrapped = match self.watched.back() {
            Some((_, last)) => last + wrapped(bearing - last),
            None => bearing,
        };
        self.watched.push_back((time, unwrapped));
        while self.watched.front().is_some_and(|(first, _)| time.ns_since(*first) > WATCH_NS) {
            self.watched.pop_front();
        }
    }

    /// Whether the gun rests on its mount, as far as can be told. One line errs by `line`, and the gyro may drift by `drift` rad/s.
    fn rests(&self, line: f64, drift: f64) -> MountMotion {
        let (Some(&(first, _)), Some(&(last, newest))) = (self.watched.front(), self.watched.back()) else {
            return MountMotion::Unknown;
        };
        let count = self.watched.len() as f64;
        let seconds = |time: &Time| time.secs_since(first);
        let mean_s = self.watched.iter().map(|(t, _)| seconds(t)).sum::<f64>() / count;
        let mean = self.watched.iter().map(|(_, b)| b).sum::<f64>() / count;
        let (mut square, mut product) = (0.0, 0.0);
        for (time, bearing) in &self.watched {
            let from_mean = seconds(time) - mean_s;
            square += from_mean * from_mean;
            product += from_mean * (bearing - mean);
        }
        let slope = if square > 0.0 { product / square } else { 0.0 };
        let scatter = self.watched.iter().map(|(t, b)| (b - mean - slope * (seconds(t) - mean_s)).powi(2));
        // Waves tilt the mount, which moves bearings without the gun: their own scatter tells by how much.
        let sigma = line.hypot((scatter.sum::<f64>() / count).sqrt());
        // What scatters by waves does not scatter from line to line: of a second's lines only one is counted.
        let alike = count / count.min(last.secs_since(first) + 1.0);
        let uncertain = if square > 0.0 { sigma * (alike / square).sqrt() } else { f64::INFINITY };
        let most = (REST_RATE + GATE * uncertain.hypot(drift)).min(CREEP_RATE);
        let off = newest - mean - slope * (last.secs_since(first) - mean_s);
        if slope.abs() > most + GATE * uncertain || off.abs() > GATE * line.hypot(sigma) {
            return MountMotion::Moves;
        }
        if last.ns_since(first) < REST_NS || uncertain > CREEP_RATE / 4.0 {
            return MountMotion::Unknown;
        }
        if slope.abs() <= most { MountMotion::Rests { off } } else { MountMotion::Moves }
    }

    fn release(&mut self) {
        self.anchored = None;
        self.refused_in_a_row = 0;
    }

    /// A rest begins: the bearing is what all that was watched says that it now is.
    fn tie(&mut self, bearing: f64, line: f64, attitude: &mut Attitude) {
        let count = self.watched.len() as f64;
        if attitude.anchor_mount(line * line / count.min(10.0)) {
            self.anchored = Some(bearing);
            self.counts.rests += 1;
        }
    }

    /// The ship's heading holds the gun's: the world is to be turned by `off`.
    fn hold(&mut self, time: Time, off: f64, line: f64, attitude: &mut Attitude) {
        let seen = HeadingSeen { time, off, variance: line * line };
        if attitude.update_mount_yaw(&seen, NIS_GATE).is_some_and(|outcome| outcome.taken) {
            self.counts.ship_taken += 1;
            self.refused_in_a_row = 0;
            return;
        }
        self.counts.ship_refused += 1;
        self.refused_in_a_row += 1;
        if self.refused_in_a_row >= REFUSED_MAX {
            self.watched.clear();
            self.release();
        }
    }

    /// The operator pressed.
    pub(super) fn mark(&mut self, kind: MarkKind, time: Time, attitude: &mut Attitude) {
        let done = match kind {
            MarkKind::Stow => self.rezero(time, attitude),
            MarkKind::Landmark => self.landmark(time, attitude),
        };
        *(if done.is_some() { &mut self.counts.marks } else { &mut self.counts.marks_refused }) += 1;
    }

    fn rezero(&mut self, time: Time, attitude: &mut Attitude) -> Option<()> {
        let stow = self.settings.stow?;
        let now = azimuth(attitude.camera(attitude.at(time).ok()?.world_from_imu))?;
        let heard = self.newest.filter(|n| time.ns_since(n.time) <= GAP_NS);
        if let (Some(from_bow), Some(ship)) = (stow.from_bow, heard) {
            let sigma = stow.sigma.hypot(ship.sigma);
            if !attitude.set_heading(wrapped(now - (ship.heading + from_bow)), sigma) {
                return None;
            }
            // What the ship's heading errs by all the time is in the bearing, too: no number of lines takes it away.
            attitude.anchor_mount(LINE_SIGMA * LINE_SIGMA);
            self.watched.clear();
            self.anchored = Some(from_bow);
            return Some(());
        }
        let from_north = stow.from_north?;
        self.set(wrapped(now - from_north), stow.sigma, attitude)
    }

    /// Of the landmarks it is the one that lies nearest by what is believed; where two are about as near, none.
    fn landmark(&mut self, time: Time, attitude: &mut Attitude) -> Option<()> {
        let now = azimuth(attitude.camera(attitude.at(time).ok()?.world_from_imu))?;
        let off = |landmark: &Landmark| wrapped(now - landmark.bearing);
        let mut by_distance: Vec<_> = self.settings.landmarks.iter().collect();
        by_distance.sort_by(|a, b| off(a).abs().total_cmp(&off(b).abs()));
        let nearest = **by_distance.first()?;
        let unsure = attitude.heading_sigma()?.hypot(nearest.sigma);
        let second = by_distance.get(1).map_or(f64::INFINITY, |l| off(l).abs());
        if off(&nearest).abs() + GATE * unsure > second {
            return None;
        }
        let seen = HeadingSeen { time, off: off(&nearest), variance: nearest.sigma * nearest.sigma };
        match attitude.update_heading(&seen, NIS_GATE) {
            Some(outcome) if outcome.taken => Some(()),
            // Who looks through the camera knows better than what has drifted.
            _ => self.set(off(&nearest), nearest.sigma, attitude),
        }
    }

    fn set(&mut self, off: f64, sigma: f64, attitude: &mut Attitude) -> Option<()> {
        self.watched.clear();
        self.release();
        attitude.set_heading(off, sigma).then_some(())
    }
}

/// Where the camera's axis points, clockwise from north, as its right-hand side tells it; `None` where that stands on end.
fn azimuth(world_from_camera: DQuat) -> Option<f64> {
    level_azimuth(world_from_camera * DVec3::X)
}

/// The bearing of something whose right-hand side is `right`: clockwise from y.
fn level_azimuth(right: DVec3) -> Option<f64> {
    (right.truncate().length() > 0.3).then(|| right.x.atan2(right.y) - FRAC_PI_2)
}

/// The gun's bearing from the ship's bow, clockwise, radians. The trunnions lie in the deck's plane whatever the elevation, so they and not
/// the camera's axis tell it; with the ship's roll and pitch exactly, without them to the square of its tilt.
fn bearing_on_mount(world_from_camera: DQuat, heading: f64, ship: &ShipSample) -> Option<f64> {
    let world_from_ship = DQuat::from_rotation_z(-heading)
        * DQuat::from_rotation_x(ship.pitch.unwrap_or(0.0))
        * DQuat::from_rotation_y(ship.roll.unwrap_or(0.0));
    level_azimuth(world_from_ship.inverse() * world_from_camera * DVec3::X)
}

#[cfg(test)]
#[path = "heading_aiding_tests.rs"]
mod tests;
