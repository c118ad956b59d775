//! Whether what the camera shows agrees with what is believed: the horizon with where it is predicted, and how the picture turns with how
//! the gyro says that the camera turned.
//!
//! Each way in which a trainer can be set up wrongly is a hypothesis: what the camera then sees of a turn and of the vertical that are
//! believed. Each observation adds the logarithm of how much better a hypothesis foretells it than what is believed does, and a sum below
//! nothing is begun anew (Page 1954, CUSUM). A sum reaches 20 by chance once in exp(20) observations on average at most
//! (Lorden 1971): 5e8 of them are 1.5 years at ten a second. What an observation adds is bounded, so that a single one, however wrong, alarms
//! nobody.

mod misfit;

use glam::{DMat3, DQuat, DVec3};

pub use self::misfit::Misfit;
use super::{
    attitude::Attitude,
    skyline::{TurnFinder, TurnSeen},
};
use crate::{
    estimate::horizon::Mask,
    event::{ImuSample, Picture},
    geometry::{Lens, rotation_vector},
    time::Time,
};

/// No observation counts as more than this against any hypothesis (squared deviations).
const COST_MOST: f64 = 9.0;
/// A hypothesis that lets the vertical wander, and does not say where to, explains no more than what costs this.
const COST_WANDERS: f64 = 5.0;
/// What a turn costs by chance, three numbers.
const COST_TURN: f64 = 3.0;
/// How the sea and what swims on it move by themselves in the picture, rad/s: waves go by at 10 m/s some hundred metres off.
const SEA_RATE: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// By what share of itself a turn is told wrong by lens, shutter and times.
const TURN_SHARE: f64 = 0.08;
/// How far a unit alone is off up on a ship in waves, radians.
const UP_SIGMA: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// How far it goes to and fro about where it is on average, radians.
const SWAY_SIGMA: f64 = 0.25 * std::f64::consts::PI / 180.0;
/// Verticals that are seen one after the other err alike: so many count as one.
const ALIKE: f64 = 5.0;
/// What a unit's own orientation and its rates differ by, rad/s.
const OWN_RATE: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// How far the mean specific force is off up while a gun is moved about, radians.
const FORCE_SIGMA: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// What the camera would see if a trainer were set up so.
#[derive(Clone, Copy, Debug)]
struct Hypothesis {
    misfit: Misfit,
    /// From the turn that is believed to the one that is seen, camera's axes.
    turn: DMat3,
    up: UpExpected,
    late_ns: i64,
    /// Where up is on average off where it is expected.
    off: MeanOff,
    sum: f64,
}

/// Where a hypothesis expects up to be seen.
#[derive(Clone, Copy, Debug)]
enum UpExpected {
    /// There, where up is believed to be by the unit alone.
    At(DMat3),
    /// As it is believed, at another time.
    Then,
    /// At the same place off it all the time, wherever that is.
    Off,
    /// Not far off it.
    Wanders,
}

impl Hypothesis {
    const fn of(misfit: Misfit, turn: DMat3, up: UpExpected) -> Self {
        Self { misfit, turn, up, late_ns: 0, off: MeanOff { mean: DVec3::ZERO, count: 0 }, sum: 0.0 }
    }

    fn add(&mut self, as_believed: f64, other: f64, weight: f64) {
        self.sum = (self.sum + 0.5 * weight * (as_believed - other)).max(0.0);
    }
}

/// The mean of turns, over some ten seconds.
#[derive(Clone, Copy, Debug, Default)]
struct MeanOff {
    mean: DVec3,
    count: u32,
}

impl MeanOff {
    /// Takes in a turn; what it differs from the mean before by.
    fn take(&mut self, off: DVec3) -> f64 {
        const MOST: u32 = 100;
        let apart = if self.count == 0 { 0.0 } else { off.distance(self.mean) };
        self.count = (self.count + 1).min(MOST);
        self.mean += (off - self.mean) / f64::from(self.count);
        apart
    }
}

/// A horizon as it was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct UpSight {
    /// Up as it was seen, unit vector, camera's axes.
    pub seen: DVec3,
    /// Up as it was predicted.
    pub predicted: DVec3,
    /// Whether it was found where it was predicted.
    pub is_predicted: bool,
}

/// Watches a session's registration.
#[derive(Debug)]
pub(super) struct Registration {
    camera_from_imu: DQuat,
    finder: TurnFinder,
    next: Time,
    hypotheses: Vec<Hypothesis>,
    own_off: MeanOff,
    believed: Option<Misfit>,
    unit: UnitWatch,
    checked: Option<Time>,
}

/// What a unit's samples say of each other.
#[derive(Clone, Copy, Debug, Default)]
struct UnitWatch {
    size: f64,
    force: DVec3,
    samples: u32,
    /// The unit's own orientation some time ago, the time, and how it turned since by its rates.
    own: Option<(Time, DQuat, DQuat)>,
    last: Option<Time>,
}

impl UnitWatch {
    /// Samples over which the mean force forgets, and that it needs.
    const SAMPLES: f64 = 100.0;

    /// No gun on the Earth feels that on average: it is a number of g.
    fn is_in_g(&self) -> bool {
        f64::from(self.samples) >= Self::SAMPLES && self.size < 5.0
    }
}

impl Registration {
    /// For a unit that lies so against the camera; `mask` hides the own ship in the pictures.
    pub fn new(camera_from_imu: DQuat, mask: Option<Mask>) -> Self {
        let mut finder = TurnFinder::default();
        finder.set_mask(mask);
        Self {
            camera_from_imu,
            finder,
            next: Time::MIN,
            hypotheses: hypotheses(DMat3::from_quat(camera_from_imu)),
            own_off: MeanOff::default(),
            believed: None,
            unit: UnitWatch::default(),
            checked: None,
        }
    }

    /// Holds a unit's own orientation against its rates and its specific force. `rate` is without its bias.
    pub fn sample(&mut self, time: Time, sample: &ImuSample, rate: DVec3) {
        /// Over so long.
        const SPAN_NS: i64 = 100_000_000;
        let unit = &mut self.unit;
        unit.samples = unit.samples.saturating_add(1);
        let share = 1.0 / f64::from(unit.samples).min(UnitWatch::SAMPLES);
        unit.size += (sample.accel.length() - unit.size) * share;
        unit.force += (sample.accel - unit.force) * share;
        let step_s = unit.last.replace(time).map_or(0.0, |last| time.secs_since(last));
        let (Some(own), true) = (sample.world_from_imu, (0.0..0.05).contains(&step_s)) else {
            unit.own = None;
            return;
        };
        let Some((from, first, turned)) = &mut unit.own else {
            unit.own = Some((time, own, DQuat::IDENTITY));
            return;
        };
        *turned = (*turned * DQuat::from_scaled_axis(rate * step_s)).normalize();
        let span_ns = time.ns_since(*from);
        if span_ns < SPAN_NS {
            return;
        }
        let (seen, by_rates) = (rotation_vector(first.inverse() * own), rotation_vector(*turned));
        let up = own.inverse() * DVec3::Z;
        unit.own = Some((time, own, DQuat::IDENTITY));
        let (force, known) = (unit.force, f64::from(unit.samples) >= UnitWatch::SAMPLES);
        let floor = OWN_RATE * span_ns as f64 * 1e-9;
        let [seen, by_rates] = [seen, by_rates].map(|turn| self.camera_from_imu * turn);
        let cost = |map: DMat3| turn_cost(seen, map * by_rates, DMat3::ZERO, floor);
        let tilt = |sign: f64| (force.angle_between(up * sign) / FORCE_SIGMA).powi(2).min(COST_MOST);
        for hypothesis in &mut self.hypotheses {
            match hypothesis.misfit {
                Misfit::Reversed(FORCE) if known => hypothesis.add(tilt(1.0), tilt(-1.0), 1.0 / ALIKE),
                Misfit::Reversed(_) | Misfit::RateUnit => {
                    hypothesis.add(cost(DMat3::IDENTITY), cost(hypothesis.turn), 1.0);
                }
                _ => {}
            }
        }
        self.decide();
    }

    /// Holds how a picture has turned against how the camera is believed to have turned.
    pub fn look(&mut self, time: Time, picture: &Picture, lens: &Lens, attitude: &Attitude) {
        /// So often a turn is looked for.
        const EVERY_NS: i64 = 200_000_000;
        /// Pictures farther apart are not held against each other.
        const APART_NS: i64 = 150_000_000;
        if self.finder.is_begun() {
            if let Some(seen) = self.finder.finish(picture, lens)
                && (1..=APART_NS).contains(&time.ns_since(seen.from))
            {
                let span_ns = time.ns_since(seen.from);
                let middle = seen.from.plus_ns(span_ns / 2);
                self.turned(&seen, time, |late_ns| attitude.camera_turn(middle.plus_ns(-late_ns), span_ns));
            }
        } else if time >= self.next {
            self.next = time.plus_ns(EVERY_NS);
            self.finder.begin(time, picture, lens);
        }
    }

    /// Takes in how the camera was seen to turn until `time`; `believed` says how it is believed to have turned as long, so much earlier.
    fn turned(&mut self, seen: &TurnSeen, time: Time, believed: impl Fn(i64) -> Option<DVec3>) {
        let floor = SEA_RATE * time.secs_since(seen.from);
        let Some(own) = believed(0) else { return };
        let cost = |believed: DVec3| turn_cost(seen.turn, believed, seen.covariance, floor);
        let as_believed = cost(own);
        for hypothesis in &mut self.hypotheses {
            let other = believed(hypothesis.late_ns).map_or(COST_TURN, |turn| cost(hypothesis.turn * turn));
            hypothesis.add(as_believed, other, 1.0);
        }
        self.decide();
    }

    /// Holds where up was seen against where the unit alone has it; `alone` gives that of a time.
    pub fn up(&mut self, time: Time, up: &UpSight, alone: impl Fn(Time) -> Option<DVec3>) {
        let Some(own) = alone(time) else { return };
        let cost = |off: f64, sigma: f64| (off * off / (sigma * sigma)).min(COST_MOST);
        let off = between(own, up.seen);
        let as_believed = cost(off.length(), UP_SIGMA);
        let sway = cost(self.own_off.take(off), SWAY_SIGMA);
        if up.is_predicted && off.length() < 3.0 * UP_SIGMA {
            self.checked = Some(time);
        }
        for hypothesis in &mut self.hypotheses {
            match hypothesis.up {
                // The unit's own orientation is not made of the force that it sends.
                UpExpected::At(_)
                    if hypothesis.misfit == Misfit::Reversed(FORCE) && self.unit.own.is_some() => {}
                UpExpected::At(map) => {
                    let other = cost((map * own).angle_between(up.seen), UP_SIGMA);
                    hypothesis.add(as_believed, other, 1.0);
                }
                UpExpected::Then => {
                    let Some(then) = alone(time.plus_ns(-hypothesis.late_ns)) else { continue };
                    let apart = hypothesis.off.take(between(then, up.seen));
                    hypothesis.add(sway, cost(apart, SWAY_SIGMA), 1.0 / ALIKE);
                }
                UpExpected::Off => {
                    let apart = hypothesis.off.take(off);
                    hypothesis.add(as_believed, cost(apart, UP_SIGMA), 1.0 / ALIKE);
                }
                UpExpected::Wanders => {
                    hypothesis.add(as_believed, as_believed.min(COST_WANDERS), 1.0 / ALIKE)
                }
            }
        }
        self.decide();
    }

    fn decide(&mut self) {
        /// The sum at which a hypothesis is believed.
        const LIMIT: f64 = 20.0;
        /// A belief ends where all sums are below this again.
        const LIMIT_BACK: f64 = 5.0;
        /// One that is believed stays until another's sum is larger by this.
        const LIMIT_OTHER: f64 = 2.0;
        /// No sum goes beyond this, so that a belief ends soon after its cause.
        const SUM_MOST: f64 = 60.0;
        let most = self.hypotheses.iter().map(|h| h.sum).fold(0.0, f64::max);
        // What is ahead stays ahead.
        let beyond = (most - SUM_MOST).max(0.0);
        self.hypotheses.iter_mut().for_each(|h| h.sum = (h.sum - beyond).max(0.0));
        let most = self.hypotheses.iter().max_by(|a, b| a.sum.total_cmp(&b.sum));
        let Some(most) = most else { return };
        if most.sum >= LIMIT {
            let alike = self.hypotheses.iter().filter(|h| Some(h.misfit) == self.believed);
            let held = alike.map(|h| h.sum).fold(0.0, f64::max);
            if most.sum > held + LIMIT_OTHER {
                self.believed = Some(most.misfit);
            }
        } else if most.sum < LIMIT_BACK {
            self.believed = None;
        }
    }

    /// What is wrong; `None` where nothing is known to be.
    pub fn wrong(&self) -> Option<Misfit> {
        if self.unit.is_in_g() { Some(Misfit::ForceUnit) } else { self.believed }
    }

    /// For how long nothing in the picture has confirmed what is believed, seconds; without end where nothing has so far.
    pub fn unchecked_s(&self, now: Time) -> f64 {
        self.checked.map_or(f64::INFINITY, |checked| now.secs_since(checked).max(0.0))
    }
}

/// The turn that takes `from` to `to`, unit vectors.
fn between(from: DVec3, to: DVec3) -> DVec3 {
    rotation_vector(DQuat::from_rotation_arc(from, to))
}

/// Squared deviations between a turn that was seen and one that is expected.
fn turn_cost(seen: DVec3, expected: DVec3, covariance: DMat3, floor: f64) -> f64 {
    let spread = floor * floor + TURN_SHARE * TURN_SHARE * expected.length_squared();
    let covariance = covariance + DMat3::from_diagonal(DVec3::splat(spread));
    let off = seen - expected;
    off.dot(covariance.inverse() * off).min(COST_MOST)
}

/// The specific force, as it is named where it is reversed.
const FORCE: &str = "the specific force";

/// All ways to be set up wrongly.
fn hypotheses(camera_from_imu: DMat3) -> Vec<Hypothesis> {
    use UpExpected::{At, Off, Then, Wanders};
    let (identity, diagonal) = (DMat3::IDENTITY, |x, y, z| DMat3::from_diagonal(DVec3::new(x, y, z)));
    let of_unit = |imu: DMat3| camera_from_imu * imu * camera_from_imu.transpose();
    let mut all: Vec<_> = quarter_turns()
        .into_iter()
        .map(|turn| {
            let angle = rotation_vector(DQuat::from_mat3(&turn)).length().to_degrees().round() as u16;
            Hypothesis::of(Misfit::Turned(angle), of_unit(turn), At(of_unit(turn)))
        })
        .collect();
    let reversed = [
        ("the rate about x", diagonal(-1.0, 1.0, 1.0)),
        ("the rate about y", diagonal(1.0, -1.0, 1.0)),
        ("the rate about z", diagonal(1.0, 1.0, -1.0)),
        ("the rate", -identity),
    ];
    all.extend(reversed.map(|(what, imu)| Hypothesis::of(Misfit::Reversed(what), of_unit(imu), Wanders)));
    all.push(Hypothesis::of(Misfit::Reversed(FORCE), identity, At(-identity)));
    all.push(Hypothesis::of(Misfit::RateUnit, identity * 1f64.to_radians(), Wanders));
    // The plane through the eye and a line of the picture tilts as the picture is stretched.
    all.extend(
        [0.6, 0.77, 1.3, 1.7]
            .map(|scale| Hypothesis::of(Misfit::Lens, identity * scale, At(diagonal(1.0, 1.0, scale)))),
    );
    all.push(Hypothesis::of(Misfit::Mirrored, diagonal(1.0, -1.0, -1.0), At(diagonal(-1.0, 1.0, 1.0))));
    all.push(Hypothesis::of(Misfit::Mirrored, diagonal(-1.0, 1.0, -1.0), At(diagonal(1.0, -1.0, 1.0))));
    all.extend([100, 200, 400].map(|ms: u16| {
        let late = Hypothesis::of(Misfit::Late(ms), identity, Then);
        Hypothesis { late_ns: i64::from(ms) * 1_000_000, ..late }
    }));
    all.push(Hypothesis::of(Misfit::Mount, identity, Off));
    all
}

/// The 23 turns that take axes to axes.
fn quarter_turns() -> Vec<DMat3> {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    let mut turns = Vec::new();
    for x in axes {
        for y in axes.into_iter().filter(|y| y.dot(x) == 0.0) {
            let turn = DMat3::from_cols(x, y, x.cross(y));
            if turn != DMat3::IDENTITY {
                turns.push(turn);
            }
        }
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::look;

    fn at(tenths: i64) -> Time {
        Time::from_ns(tenths * 100_000_000)
    }

    /// A gun that is swung on a ship that rolls: where it looks.
    fn moved(time: Time) -> DQuat {
        let t = time.secs_since(at(0));
        look(0.4 * (1.1 * t).sin(), 0.05 * (0.7 * t).sin() - 0.03, 0.06 * (0.8 * t).sin())
    }

    fn turn(from: Time, to: Time) -> DVec3 {
        rotation_vector(moved(from).inverse() * moved(to))
    }

    fn up(time: Time) -> DVec3 {
        moved(time).inverse() * DVec3::Z
    }

    /// Ten seconds in which what is seen differs from what is believed; when that was told first, seconds, and what is told at the end.
    fn told(
        turned: impl Fn(Time, Time) -> DVec3,
        seen: impl Fn(Time) -> DVec3,
    ) -> (Option<f64>, Option<Misfit>) {
        let mut registration = Registration::new(DQuat::IDENTITY, None);
        let mut first = None;
        for tenths in 10..110 {
            let (now, before) = (at(tenths), at(tenths).plus_ns(-33_000_000));
            let sight = UpSight { seen: seen(now), predicted: up(now), is_predicted: true };
            registration.up(now, &sight, |time| Some(up(time)));
            let covariance = DMat3::from_diagonal(DVec3::splat(1e-7));
            let seen = TurnSeen { from: before, turn: turned(before, now), covariance, patches: (20, 20) };
            registration.turned(&seen, now, |ns| Some(turn(before.plus_ns(-ns), now.plus_ns(-ns))));
            if registration.wrong().is_some() {
                first.get_or_insert(now.secs_since(at(10)));
            }
        }
        (first, registration.wrong())
    }

    #[test]
    fn what_is_as_believed_is_confirmed_and_nothing_is_told() {
        assert_eq!(told(turn, up), (None, None));
        // Half a degree off: within what a unit alone is off on a ship.
        let tilt = DQuat::from_rotation_x(0.5f64.to_radians());
        assert_eq!(told(turn, |time| tilt * up(time)), (None, None));
    }

    #[test]
    fn each_way_to_be_wrong_is_told_within_two_seconds_by_its_name() {
        let diagonal = |x, y, z| DMat3::from_diagonal(DVec3::new(x, y, z));
        let turned = DMat3::from_quat(DQuat::from_rotation_z(std::f64::consts::PI));
        let quarter = DMat3::from_quat(DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2));
        let cases = [
            (turned, turned, Misfit::Turned(180)),
            (quarter, quarter, Misfit::Turned(90)),
            (diagonal(1.0, -1.0, -1.0), diagonal(-1.0, 1.0, 1.0), Misfit::Mirrored),
            (diagonal(1.0, -1.0, 1.0), DMat3::IDENTITY, Misfit::Reversed("the rate about y")),
            (DMat3::IDENTITY, diagonal(-1.0, -1.0, -1.0), Misfit::Reversed(FORCE)),
            (DMat3::IDENTITY * 1f64.to_radians(), DMat3::IDENTITY, Misfit::RateUnit),
            (DMat3::IDENTITY * 1.5, DMat3::IDENTITY, Misfit::Lens),
        ];
        for (by_turn, by_up, misfit) in cases {
            let (first, last) = told(|from, to| by_turn * turn(from, to), |time| by_up * up(time));
            assert_eq!(last, Some(misfit));
            assert!(first.is_some_and(|s| s <= 2.0), "{misfit:?} after {first:?} s");
        }
        let tilt = DQuat::from_rotation_x(5f64.to_radians());
        let (first, last) = told(turn, |time| tilt * up(time));
        assert_eq!(last, Some(Misfit::Mount), "after {first:?} s");
        let late = |time: Time| time.plus_ns(-200_000_000);
        let (first, last) = told(|from, to| turn(late(from), late(to)), |time| up(late(time)));
        assert_eq!(last, Some(Misfit::Late(200)), "after {first:?} s");
    }

    #[test]
    fn a_belief_ends_after_its_cause() {
        let mut registration = Registration::new(DQuat::IDENTITY, None);
        let see = |registration: &mut Registration, tenths: i64, map: DMat3| {
            let sight = UpSight { seen: map * up(at(tenths)), predicted: up(at(tenths)), is_predicted: true };
            registration.up(at(tenths), &sight, |time| Some(up(time)));
        };
        let upside_down = DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0));
        (0..30).for_each(|tenths| see(&mut registration, tenths, upside_down));
        assert!(registration.wrong().is_some());
        assert_eq!(registration.unchecked_s(at(30)), f64::INFINITY);
        (30..60).for_each(|tenths| see(&mut registration, tenths, DMat3::IDENTITY));
        assert_eq!(registration.wrong(), None);
        assert!(registration.unchecked_s(at(60)) < 0.2);
    }

    #[test]
    fn force_in_g_is_told_by_its_size_and_rates_by_the_units_own_orientation() {
        let fed = |factor: f64, rates: DVec3, own: bool| {
            let mut registration = Registration::new(DQuat::IDENTITY, None);
            for i in 0..600 {
                let time = Time::from_ns(i * 5_000_000);
                let rate = turn(time.plus_ns(-5_000_000), time) / 0.005;
                let sample = ImuSample {
                    arrival: time,
                    device_time_ns: i * 5_000_000,
                    rate,
                    accel: up(time) * 9.8 * factor,
                    world_from_imu: own.then(|| moved(time)),
                };
                registration.sample(time, &sample, rate * rates);
            }
            registration.wrong()
        };
        assert_eq!(fed(1.0, DVec3::ONE, true), None);
        assert_eq!(fed(1.0 / 9.8, DVec3::ONE, true), Some(Misfit::ForceUnit));
        assert_eq!(fed(1.0 / 9.8, DVec3::ONE, false), Some(Misfit::ForceUnit));
        assert_eq!(fed(1.0, DVec3::ONE.with_y(-1.0), true), Some(Misfit::Reversed("the rate about y")));
        assert_eq!(fed(1.0, DVec3::ONE * 57.3, true), Some(Misfit::RateUnit));
        assert_eq!(fed(-1.0, DVec3::ONE, true), Some(Misfit::Reversed(FORCE)));
    }
}
