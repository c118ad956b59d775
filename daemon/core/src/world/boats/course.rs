//! The courses that a scenario can give a boat.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};

use super::path::{self, CoursePath, Ending, wrap};
use crate::{
    geometry::{ahead, heading_of, starboard},
    model::Zone,
};

/// Radius of the turns of a boat, metres, where nothing makes them tighter.
const TURN_RADIUS_M: f64 = 25.0;
/// Time constant of a boat that comes to rest at the end of its course, seconds.
const ARRIVAL_S: f64 = 3.0;
/// Time constant with which a boat loses its way after its engine is hit, seconds.
const ENGINE_LOST_S: f64 = 3.0;
/// The same after its helmsman is hit, who lets go of the throttle.
const HELM_LOST_S: f64 = 5.0;
/// A boat without helmsman that drifts towards the own ship comes to rest this far from it, metres.
const DRIFT_CLEAR_M: f64 = 30.0;
/// Sharpest corner of a track, radians: a boat cannot turn about on the spot.
const CORNER_MAX: f64 = 150.0 * PI / 180.0;

/// Where a boat is on the sea, before waves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CourseState {
    /// World x (east) and y (north) of the boat's origin, metres; the own ship is at (0, 0).
    pub position: DVec2,
    /// Radians clockwise from north.
    pub heading: f64,
    /// Speed over ground along the heading, m/s; negative astern.
    pub speed_m_s: f64,
    /// Speed over ground to starboard, m/s: 0 on courses that are known beforehand.
    pub sway_m_s: f64,
    /// Change of heading, rad/s clockwise.
    pub turn_rate: f64,
}

impl CourseState {
    /// Between two states `span_s` apart, at `share` (0 to 1) of the way: the cubics (Hermite) with their velocities and turn rates.
    pub fn between(&self, next: &Self, span_s: f64, share: f64) -> Self {
        if share <= 0.0 {
            return *self;
        }
        let (s, t) = (share, 1.0 - share);
        // Share of the way between both ends, and of each end's change over the span.
        let (to, out, back) = (s * s * (1.0 + 2.0 * t), t * t * s * span_s, s * s * t * span_s);
        let turn = wrap(next.heading - self.heading);
        Self {
            position: self.position + (next.position - self.position) * to + self.velocity() * out
                - next.velocity() * back,
            heading: self.heading + turn * to + self.turn_rate * out - next.turn_rate * back,
            speed_m_s: self.speed_m_s * t + next.speed_m_s * s,
            sway_m_s: self.sway_m_s * t + next.sway_m_s * s,
            turn_rate: self.turn_rate * t + next.turn_rate * s,
        }
    }

    /// Velocity over ground, m/s.
    pub fn velocity(&self) -> DVec2 {
        ahead(self.heading) * self.speed_m_s + starboard(self.heading) * self.sway_m_s
    }

    /// The state `seconds` later (earlier where negative) of a boat that goes straight on.
    #[must_use]
    pub fn straight_on(&self, seconds: f64) -> Self {
        Self { position: self.position + self.velocity() * seconds, turn_rate: 0.0, ..*self }
    }

    /// The state `seconds` later of a boat that keeps its speed and turn rate.
    #[must_use]
    pub fn moved(&self, seconds: f64) -> Self {
        let half = 0.5 * self.turn_rate * seconds;
        let heading = self.heading + half;
        let velocity = ahead(heading) * self.speed_m_s + starboard(heading) * self.sway_m_s;
        Self { position: self.position + velocity * seconds, heading: self.heading + 2.0 * half, ..*self }
    }
}

/// When a boat lost what it needs to go on, seconds since the scenario began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoatDamage {
    /// The engine was hit: the boat loses its way along its course.
    pub engine_s: Option<f64>,
    /// The helm was hit: the boat goes straight on and slowly loses its way.
    pub helm_s: Option<f64>,
    /// Water in the hull drowned the engine, or will.
    pub drowned_s: Option<f64>,
    /// The boat burns since then.
    pub fire_s: Option<f64>,
    /// The boat was hit anywhere.
    pub first_s: Option<f64>,
}

/// A round's strike on a boat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundStrike {
    /// The part.
    pub zone: Zone,
    /// The place in the boat's space, metres, and the area of the hole there, m^2; `None` for fragments.
    pub hole: Option<(DVec3, f64)>,
    /// It sets fire to the engine.
    pub ignites: bool,
}

impl From<Zone> for RoundStrike {
    fn from(zone: Zone) -> Self {
        Self { zone, hole: None, ignites: false }
    }
}

/// The end of an attacker's course.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Arrival {
    /// It lies still.
    Stop,
    /// It circles the own ship clockwise.
    Circle,
}

/// Why a course cannot be sailed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CourseError {
    /// Something is not finite.
    #[error("a position, heading or speed of the course is not finite")]
    NotFinite,
    /// A weave that needs more than the boat's speed.
    #[error(
        "a weave of {amplitude_m} m in {period_s} s swings sideways at {sideways_m_s:.1} m/s, more than the boat's {speed_m_s:.1} m/s; \
         lengthen the period or lower the amplitude"
    )]
    Weave {
        /// To each side, metres.
        amplitude_m: f64,
        /// Seconds from side to side and back.
        period_s: f64,
        /// Greatest sideways speed, m/s.
        sideways_m_s: f64,
        /// The boat's speed, m/s.
        speed_m_s: f64,
    },
    /// Two points of a track that coincide.
    #[error("points {index} and {} of the track are less than 5 m apart", index + 1)]
    PointsCoincide {
        /// The first of both; 0 is the boat's start.
        index: usize,
    },
    /// A corner that no boat can turn.
    #[error(
        "the track turns by more than 150 degrees at point {index}; put another point there to turn about"
    )]
    SharpCorner {
        /// The corner; 0 is the boat's start.
        index: usize,
    },
    /// A track without points.
    #[error("a track needs at least one point besides the start, or two to be repeated")]
    TooFewPoints,
    /// An attacker that starts within its own stopping distance.
    #[error(
        "it starts {range_m:.0} m away, too close to turn in and stop at {stop_m:.0} m; start farther off"
    )]
    TooClose {
        /// Distance at the start, metres.
        range_m: f64,
        /// Where it is to stop, metres.
        stop_m: f64,
    },
}

/// A course that is known beforehand: a closed function of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    track: CourseTrack,
    speed_m_s: f64,
    /// When it begins, seconds since the scenario began.
    begins_s: f64,
}

#[derive(Clone, Debug, PartialEq)]
enum CourseTrack {
    CoursePath(CoursePath),
    Weave { start: DVec2, heading: f64, forward_m_s: f64, amplitude_m: f64, rad_s: f64 },
}

impl Course {
    /// Lies still.
    pub fn still(start: DVec2, heading: f64) -> Result<Self, CourseError> {
        Self::of(CoursePath::start(start, heading), start, heading, 0.0)
    }

    /// Goes straight on.
    pub fn straight(start: DVec2, heading: f64, speed_m_s: f64) -> Result<Self, CourseError> {
        Self::of(CoursePath::start(start, heading).line(f64::INFINITY), start, heading, speed_m_s)
    }

    fn of(path: CoursePath, start: DVec2, heading: f64, speed_m_s: f64) -> Result<Self, CourseError> {
        check_finite(start, heading, speed_m_s)?;
        Ok(Self { track: CourseTrack::CoursePath(path), speed_m_s, begins_s: 0.0 })
    }

    /// The same, begun so many seconds after the scenario.
    #[must_use]
    pub fn begun_at(self, seconds: f64) -> Self {
        Self { begins_s: seconds, ..self }
    }

    /// When it begins, seconds since the scenario began.
    pub const fn begins_s(&self) -> f64 {
        self.begins_s
    }

    /// Weaves about a straight line: `amplitude_m` to each side, once in `period_s`. The root mean square of its speed over
    /// ground is `speed_m_s`; it starts on the line, on its way to starboard.
    pub fn weave(
        start: DVec2,
        heading: f64,
        speed_m_s: f64,
        amplitude_m: f64,
        period_s: f64,
    ) -> Result<Self, CourseError> {
        check_finite(start, heading, speed_m_s + amplitude_m + period_s)?;
        let rad_s = TAU / period_s;
        let sideways_m_s = amplitude_m * rad_s;
        // Also turns down periods of zero.
        if sideways_m_s.is_nan() || sideways_m_s.abs() > speed_m_s {
            return Err(CourseError::Weave { amplitude_m, period_s, sideways_m_s, speed_m_s });
        }
        let forward_m_s = (speed_m_s * speed_m_s - sideways_m_s * sideways_m_s / 2.0).sqrt();
        let track = CourseTrack::Weave { start, heading, forward_m_s, amplitude_m, rad_s };
        Ok(Self { track, speed_m_s, begins_s: 0.0 })
    }

    /// Sails from `start` along `points` and lies still at the last, or goes back to the start and round again for ever.
    /// Corners are cut by arcs.
    pub fn waypoints(
        start: DVec2,
        points: &[DVec2],
        speed_m_s: f64,
        repeat: bool,
    ) -> Result<Self, CourseError> {
        let mut all = vec![start];
        all.extend_from_slice(points);
        for &point in &all {
            check_finite(point, 0.0, speed_m_s)?;
        }
        let n = all.len();
        if n < if repeat { 3 } else { 2 } {
            return Err(CourseError::TooFewPoints);
        }
        let leg = |i: usize| all[(i + 1) % n] - all[i % n];
        let legs = if repeat { n } else { n - 1 };
        if let Some(index) = (0..legs).find(|&i| leg(i).length() < 5.0) {
            return Err(CourseError::PointsCoincide { index });
        }
        let corners = if repeat { n } else { n - 2 };
        let sharp = |i: &usize| wrap(heading_of(leg(i + 1)) - heading_of(leg(*i))).abs() > CORNER_MAX;
        if let Some(index) = (0..corners).find(sharp) {
            return Err(CourseError::SharpCorner { index: (index + 1) % n });
        }
        let path = path::along(&all, TURN_RADIUS_M, repeat);
        Ok(Self { track: CourseTrack::CoursePath(path), speed_m_s, begins_s: 0.0 })
    }

    /// Turns towards the own ship at (0, 0), closes to `stop_m` and then lies still or circles at that distance.
    pub fn closing(
        start: DVec2,
        heading: f64,
        speed_m_s: f64,
        stop_m: f64,
        arrival: Arrival,
    ) -> Result<Self, CourseError> {
        check_finite(start, heading, speed_m_s + stop_m)?;
        let range_m = start.length();
        let radius = TURN_RADIUS_M.min(range_m / 8.0);
        // Where the straight run ends, from the own ship: the circle is entered by a turn to port that touches it.
        let run_end = match arrival {
            Arrival::Stop => stop_m,
            Arrival::Circle => (stop_m * stop_m + 2.0 * stop_m * radius).sqrt(),
        };
        if stop_m.is_nan() || stop_m <= 0.0 || range_m - 2.0 * radius <= run_end {
            return Err(CourseError::TooClose { range_m, stop_m });
        }
        let (angle, run_m) = turn_in(start, heading, radius);
        let mut path = CoursePath::start(start, heading).turn(angle, radius).line(run_m - run_end);
        if arrival == Arrival::Circle {
            path = path.turn(-(radius / (stop_m + radius)).acos(), radius).turn(f64::INFINITY, stop_m);
        }
        Ok(Self { track: CourseTrack::CoursePath(path), speed_m_s, begins_s: 0.0 })
    }

    /// Greatest speed over ground on this course, m/s.
    pub fn speed_max_m_s(&self) -> f64 {
        match self.track {
            CourseTrack::CoursePath(_) => self.speed_m_s,
            CourseTrack::Weave { forward_m_s, amplitude_m, rad_s, .. } => {
                forward_m_s.hypot(amplitude_m * rad_s)
            }
        }
    }

    /// Where the boat is `time_s` seconds after the scenario began (the start before that).
    pub fn state(&self, time_s: f64, damage: &BoatDamage) -> CourseState {
        let time_s = (time_s - self.begins_s).max(0.0);
        let damage = &damage.since(self.begins_s);
        let (under_way_s, share) = damage.under_way(time_s);
        let helm_s = damage.helm_s.map(|s| s.max(0.0)).filter(|&s| s < time_s);
        let Some(helm_s) = helm_s else {
            let mut state = self.undamaged(under_way_s);
            state.speed_m_s *= share;
            state.turn_rate *= share;
            return state;
        };
        let (until_helm_s, _) = damage.under_way(helm_s);
        let at_helm = self.undamaged(until_helm_s);
        drift(&at_helm, under_way_s - until_helm_s, share)
    }

    fn undamaged(&self, time_s: f64) -> CourseState {
        match &self.track {
            CourseTrack::CoursePath(path) => on_path(path, self.speed_m_s, time_s),
            &CourseTrack::Weave { start, heading, forward_m_s, amplitude_m, rad_s } => {
                let (sin, cos) = ((rad_s * time_s) % TAU).sin_cos();
                let sideways = amplitude_m * rad_s * cos;
                let speed_m_s = forward_m_s.hypot(sideways);
                let position = start
                    + ahead(heading) * (forward_m_s * time_s)
                    + starboard(heading) * (amplitude_m * sin);
                let turn_rate = if speed_m_s > 0.0 {
                    -forward_m_s * amplitude_m * rad_s * rad_s * sin / (speed_m_s * speed_m_s)
                } else {
                    0.0
                };
                CourseState {
                    position,
                    heading: heading + sideways.atan2(forward_m_s),
                    speed_m_s,
                    sway_m_s: 0.0,
                    turn_rate,
                }
            }
        }
    }

    /// The first time before `until_s` at which the undamaged boat is less than `radius_m` from (0, 0), within 0.1 m.
    pub fn first_within(&self, radius_m: f64, until_s: f64) -> Option<f64> {
        let speed = self.speed_max_m_s();
        let mut time_s = 0.0;
        while time_s <= until_s {
            let gap = self.undamaged(time_s).position.length() - radius_m;
            if gap < 0.0 {
                return Some(time_s);
            }
            if speed <= 0.0 {
                return None;
            }
            // No boat closes the gap faster than its speed allows.
            time_s += gap.max(0.1) / speed;
        }
        None
    }
}

impl BoatDamage {
    /// No damage.
    pub const NONE: Self =
        Self { engine_s: None, helm_s: None, drowned_s: None, fire_s: None, first_s: None };

    /// Takes in a hit at `time_s`; says whether it changes what the boat can do. The first hit of each part counts.
    pub fn add(&mut self, zone: Zone, time_s: f64) -> bool {
        self.first_s = Some(self.first_s.map_or(time_s, |first| first.min(time_s)));
        let slot = match zone {
            Zone::Engine => &mut self.engine_s,
            Zone::Helm => &mut self.helm_s,
            Zone::Hull => return false,
        };
        let earlier = slot.is_none_or(|first| time_s < first);
        if earlier {
            *slot = Some(time_s);
        }
        earlier
    }

    /// When its engine failed, or will.
    pub fn engine_lost_s(&self) -> Option<f64> {
        self.engine_s.into_iter().chain(self.drowned_s).reduce(f64::min)
    }

    /// The same on a clock that begins at `begins_s`.
    fn since(&self, begins_s: f64) -> Self {
        let since = |at: Option<f64>| at.map(|s| s - begins_s);
        Self {
            engine_s: since(self.engine_s),
            helm_s: since(self.helm_s),
            drowned_s: since(self.drowned_s),
            fire_s: since(self.fire_s),
            first_s: since(self.first_s),
        }
    }

    /// Seconds that an undamaged boat would have needed for the way made until `time_s`, and the share of its speed left.
    ///
    /// Each loss makes the speed decay exponentially from its own time on, so the way made has a closed form between them.
    fn under_way(&self, time_s: f64) -> (f64, f64) {
        let losses = [(self.engine_lost_s(), ENGINE_LOST_S), (self.helm_s, HELM_LOST_S)];
        let mut losses = losses.map(|(at, constant)| (at.map_or(f64::INFINITY, |s| s.max(0.0)), constant));
        losses.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut way_s, mut share, mut rate, mut from) = (0.0, 1.0, 0.0, 0.0);
        let ends = [losses[0].0, losses[1].0, f64::INFINITY];
        for (i, end) in ends.into_iter().enumerate() {
            let span = end.min(time_s) - from;
            if span > 0.0 {
                let decayed: f64 = -(-rate * span).exp_m1();
                way_s += share * if rate > 0.0 { decayed / rate } else { span };
                share *= 1.0 - decayed;
                from += span;
            }
            if let Some((_, constant)) = losses.get(i) {
                rate += 1.0 / constant;
            }
        }
        (way_s, share)
    }
}

/// A boat that lost its helmsman `way_s` seconds of undamaged way ago: straight on, but not into the own ship.
fn drift(at_helm: &CourseState, way_s: f64, share: f64) -> CourseState {
    let direction = ahead(at_helm.heading);
    let wanted = at_helm.speed_m_s * way_s;
    let clear = DRIFT_CLEAR_M.min(at_helm.position.length());
    let along = -at_helm.position.dot(direction);
    let across2 = at_helm.position.length_squared() - along * along;
    // A small slack, so that a boat at the very edge may still go away from it.
    let blocked_at = if along > 1e-6 && across2 < clear * clear {
        (along - (clear * clear - across2).sqrt()).max(0.0)
    } else {
        f64::INFINITY
    };
    let stopped = wanted >= blocked_at;
    CourseState {
        position: at_helm.position + direction * wanted.min(blocked_at),
        heading: at_helm.heading,
        speed_m_s: if stopped { 0.0 } else { at_helm.speed_m_s * share },
        sway_m_s: 0.0,
        turn_rate: 0.0,
    }
}

fn on_path(path: &CoursePath, speed_m_s: f64, time_s: f64) -> CourseState {
    let (mut sailed_m, mut speed) = (speed_m_s * time_s, speed_m_s);
    if path.ending() == Ending::Stay && path.length_m().is_finite() {
        // Comes to rest exponentially over the last stretch.
        let braking_m = (speed_m_s * ARRIVAL_S).min(path.length_m() / 2.0);
        let over = sailed_m - (path.length_m() - braking_m);
        if over > 0.0 {
            let left = (-over / braking_m).exp();
            sailed_m = path.length_m() - braking_m * left;
            speed *= left;
        } else if braking_m <= 0.0 {
            speed = 0.0;
        }
    }
    let place = path.at(sailed_m);
    CourseState {
        position: place.position,
        heading: place.heading,
        speed_m_s: speed,
        sway_m_s: 0.0,
        turn_rate: place.curvature * speed,
    }
}

/// Angle (positive to starboard) by which a boat turns on a circle of `radius` until it points at (0, 0), and how far it
/// then is from there.
fn turn_in(start: DVec2, heading: f64, radius: f64) -> (f64, f64) {
    let off = wrap(heading_of(-start) - heading);
    if off.abs() < 1e-9 {
        return (0.0, start.length());
    }
    let side = off.signum();
    let centre = start + starboard(heading) * (side * radius);
    let run = (centre.length_squared() - radius * radius).max(0.0).sqrt();
    let leaving = heading_of(-centre) + side * radius.atan2(run);
    // Between 0 and a full turn; a hair below zero is no turn, not a full one.
    let angle = (side * (leaving - heading) + 1e-9).rem_euclid(TAU) - 1e-9;
    (side * angle.max(0.0), run)
}

fn check_finite(position: DVec2, heading: f64, rest: f64) -> Result<(), CourseError> {
    if position.is_finite() && heading.is_finite() && rest.is_finite() && heading.abs() < 1e3 * FRAC_PI_2 {
        Ok(())
    } else {
        Err(CourseError::NotFinite)
    }
}

#[cfg(test)]
#[path = "course_tests.rs"]
mod tests;
