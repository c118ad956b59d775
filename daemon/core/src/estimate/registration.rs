//! Whether what the camera shows agrees with what is believed: the horizon with where it is predicted, and how the picture turns with how
//! the gyro says that the camera turned.
//!
//! Each way in which a trainer can be set up wrongly is a hypothesis: what the camera then sees of a turn and of the vertical that are
//! believed. Each observation adds the logarithm of how much better a hypothesis foretells it than what is believed does, and a sum below
//! nothing is begun anew (Page 1954, CUSUM). A sum reaches 20 by chance once in exp(20) observations on average at most
//! (Lorden 1971): 5e8 of them are 1.5 years at ten a second. What an observation adds is bounded, so that a single one, however wrong, alarms
//! nobody.
//!
//! A gun that rests shows neither a reversed axis nor late pictures. So a hypothesis counts as possible until what is believed has foretold
//! better than it by 7 in all (Wald 1945, sequential test): a wrong set-up passes for a right one once in exp(7) = 1100 starts at most.

mod means;
mod misfit;
mod swing;
#[cfg(test)]
mod tests;
mod unit;

use glam::{DMat3, DQuat, DVec3};

pub use self::misfit::Misfit;
use self::{
    means::{MeanOff, MeanSway, SEA_RATE, SeaDrift, TurnCost},
    swing::SwingTest,
    unit::{LEANS_MOST, UP_SIGMA, UnitWatch},
};
use super::{
    attitude::{Attitude, TAU_WAVES_S},
    schedule::Schedule,
    skyline::{TurnFinder, TurnSeen},
};
use crate::{
    event::{ImuSample, Picture},
    geometry::{Lens, rotation_vector},
    own_ship::Mask,
    time::Time,
};

/// No observation counts as more than this against any hypothesis (squared deviations).
const COST_MOST: f64 = 9.0;
/// A hypothesis that lets the vertical wander, and does not say where to, explains no more than what costs this.
const COST_WANDERS: f64 = 5.0;
/// A mount that is off, and does not say how far, explains no less than what costs this: two degrees. So far a unit alone goes off up in
/// a ship's turn.
const COST_OFF: f64 = 4.0;
/// By what share of itself a turn is told wrong by lens, shutter and times.
const TURN_SHARE: f64 = 0.08;
/// Verticals that are seen one after the other err alike: so many count as one.
const ALIKE: f64 = 5.0;
/// So many err alike where it is the unit that is off up, as a craft that speeds up tilts it.
const ALIKE_LONG: f64 = 10.0 * TAU_WAVES_S;
/// What a unit's own orientation and its rates differ by, rad/s.
const OWN_RATE: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Rate of a gun that moves at all, by .2 deg/s, as it is believed where rates in deg/s are read as rad/s, rad/s.
const FAST: f64 = 10.0 * std::f64::consts::PI / 180.0;
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
    /// It is never believed, but nothing is READY while its sum is large.
    is_doubt: bool,
    /// Logarithm of its likelihood over that of what is believed, lately, nats (CUSUM).
    sum: f64,
    /// The same by turns of the picture alone, either way, nats; bounded.
    by_turns: f64,
    /// The reverse since the start, nats (sequential test).
    against: f64,
    is_excluded: bool,
    /// Drift of the sea that turns of the picture show if it is right.
    drift: SeaDrift,
}

/// A belief ends where all sums are below this again, and nothing is confirmed before.
const LIMIT_BACK: f64 = 5.0;

/// Where a hypothesis expects up to be seen.
#[derive(Clone, Copy, Debug)]
enum UpExpected {
    /// There, where up is believed to be by the unit alone.
    At(DMat3),
    /// As it is believed, at another time; the mean error of that over two seconds.
    Then(MeanSway),
    /// At the same place off it all the time, wherever that is: the mean of ten seconds.
    Off(MeanOff),
    /// Not far off it.
    Wanders,
}

/// Costs of an observation by what is believed and by a hypothesis, and what it weighs for the alarm and for the exclusion.
#[derive(Clone, Copy, Debug)]
struct Costs {
    as_believed: f64,
    other: f64,
    weight: f64,
    against: f64,
}

impl Costs {
    const fn of(as_believed: f64, other: f64) -> Self {
        Self { as_believed, other, weight: 1.0, against: 1.0 }
    }

    /// Logarithm of the hypothesis's likelihood over that of what is believed, nats.
    const fn better(self) -> f64 {
        0.5 * (self.as_believed - self.other)
    }

    /// The same of one out of so many that err alike.
    fn alike(self, count: f64) -> Self {
        Self { weight: self.weight / count, against: self.against / count, ..self }
    }
}

impl Hypothesis {
    const fn of(misfit: Misfit, turn: DMat3, up: UpExpected) -> Self {
        let (sum, by_turns, against) = (0.0, 0.0, 0.0);
        Self {
            misfit,
            turn,
            up,
            late_ns: 0,
            is_doubt: false,
            sum,
            by_turns,
            against,
            is_excluded: false,
            drift: SeaDrift::NOTHING,
        }
    }

    /// Takes in an observation.
    fn add(&mut self, costs: Costs) {
        /// Evidence at which a hypothesis is excluded, nats.
        const EXCLUDED: f64 = 7.0;
        /// However much better this foretold before, what was wrong may have been put right.
        const LEAST: f64 = -40.0;
        self.sum = (self.sum + costs.weight * costs.better()).max(0.0);
        self.against = (self.against - costs.against * costs.better()).max(LEAST);
        self.is_excluded |= self.against >= EXCLUDED;
    }

    /// Takes in a turn of the picture.
    fn add_turn(&mut self, costs: Costs) {
        /// A gun that begins to move soon outweighs what it showed before.
        const MOST: f64 = 14.0;
        self.by_turns = (self.by_turns + costs.better()).clamp(-MOST, MOST);
        self.add(costs);
    }

    /// Tests whether it can be what is wrong. Late pictures show in turns as well as in the vertical, which a ship's turn tilts to and fro
    /// in a seaway as late pictures would. Another lens does, too: any error that tilts the vertical as a craft speeds up favours one of
    /// four lenses.
    fn may_be_believed(&self, swing: &SwingTest) -> bool {
        /// Evidence of turns that late pictures need, nats: enough alone.
        const LATE_BY_TURNS: f64 = 10.0;
        /// The same for another lens.
        const LENS_BY_TURNS: f64 = 3.0;
        match self.misfit {
            Misfit::Late(_) => self.by_turns >= LATE_BY_TURNS,
            Misfit::Lens => self.by_turns >= LENS_BY_TURNS,
            Misfit::Mount => !self.is_doubt && swing.may_be_camera(),
            _ => true,
        }
    }

    /// Takes in an observation by rates in another unit, which make a gun that moves at all a fast one: while none is believed to be, an
    /// error of another kind, as the bias of a unit that is turned, is explained as well by no turn at all.
    fn add_rate_unit(&mut self, costs: Costs, is_fast: bool) {
        if is_fast || costs.other >= costs.as_believed {
            self.add(costs);
        }
    }

    /// Pays for having been held against a vertical, unless it is believed: a gun that rests shows no more than it did.
    ///
    /// One that it does not foretell better by this, nats, is evidence against it. Without that, a hypothesis that a lasting small error
    /// of the unit favours, as a mount that is off or a wider lens, gathers hundredths of a degree for hours until it is believed. Half a
    /// degree is worth as much.
    fn pay(&mut self) {
        const SLACK: f64 = 0.15;
        self.sum = (self.sum - SLACK / ALIKE).max(0.0);
    }

    /// Tests whether the observations so far leave it possible. A mount that is off is held against the horizon alone.
    fn is_possible(&self) -> bool {
        !self.is_excluded && self.misfit != Misfit::Mount
    }

    /// Counts as possible again.
    fn reopen(&mut self) {
        (self.against, self.is_excluded) = (0.0, false);
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
    looks: Schedule,
    /// [`StampedPicture::is_shared`] of the picture before.
    was_shared: bool,
    hypotheses: Vec<Hypothesis>,
    own_sway: MeanSway,
    swing: SwingTest,
    /// When up was last seen, and how often since it was not for a while.
    up_seen: Option<Time>,
    sights: u32,
    turn_cost: TurnCost,
    /// Drift of the sea that turns of the picture show if what is believed is right.
    drift: SeaDrift,
    believed: Option<Misfit>,
    unit: UnitWatch,
    checked: Option<Time>,
}

/// A picture with its time and lens.
#[derive(Clone, Copy, Debug)]
pub struct StampedPicture<'a> {
    /// Middle of its exposure on the inertial unit's clock.
    pub time: Time,
    /// The picture.
    pub picture: &'a Picture,
    /// The lens that it was taken through.
    pub lens: &'a Lens,
    /// Horizon or sky are sought in it as well.
    pub is_shared: bool,
}

impl Registration {
    /// For a unit that lies so against the camera; `mask` hides the own ship in the pictures.
    pub fn new(camera_from_imu: DQuat, mask: Option<Mask>) -> Self {
        let mut finder = TurnFinder::default();
        finder.set_mask(mask);
        Self {
            camera_from_imu,
            finder,
            looks: Schedule::new(),
            was_shared: false,
            hypotheses: hypotheses(DMat3::from_quat(camera_from_imu)),
            own_sway: MeanSway::NOTHING,
            swing: SwingTest::default(),
            up_seen: None,
            sights: 0,
            turn_cost: TurnCost::default(),
            drift: SeaDrift::NOTHING,
            believed: None,
            unit: UnitWatch::default(),
            checked: None,
        }
    }

    /// Resets all evidence, as after a restart of the unit: it may be another one.
    pub fn restart(&mut self) {
        let finder = std::mem::take(&mut self.finder);
        *self = Self { finder, looks: self.looks, ..Self::new(self.camera_from_imu, None) };
    }

    /// Holds a unit's own orientation against its rates and its specific force. `rate` is without its bias.
    pub fn sample(&mut self, time: Time, sample: &ImuSample, rate: DVec3) {
        let Some(own) = self.unit.sample(time, sample, rate) else { return };
        let floor = OWN_RATE * own.span_s;
        let [seen, by_rates] = [own.seen, own.by_rates].map(|turn| self.camera_from_imu * turn);
        let cost = |map: DMat3| turn_cost(seen, map * by_rates, DMat3::ZERO, floor);
        let is_fast = by_rates.length() > FAST * own.span_s;
        for hypothesis in &mut self.hypotheses {
            match (hypothesis.misfit, own.force) {
                (Misfit::Reversed(FORCE), Some(force)) => {
                    let tilt =
                        |sign: f64| (force.angle_between(own.up * sign) / FORCE_SIGMA).powi(2).min(COST_MOST);
                    hypothesis.add(Costs::of(tilt(1.0), tilt(-1.0)).alike(ALIKE));
                }
                (Misfit::Reversed(_), _) => {
                    hypothesis.add(Costs::of(cost(DMat3::IDENTITY), cost(hypothesis.turn)))
                }
                (Misfit::RateUnit, _) => {
                    hypothesis
                        .add_rate_unit(Costs::of(cost(DMat3::IDENTITY), cost(hypothesis.turn)), is_fast);
                }
                _ => {}
            }
        }
        self.decide();
    }

    /// Holds how a picture has turned since the one before against how the camera is believed to have turned. It waits for a picture that
    /// others do not look at, unless they look at each: no frame waits for both.
    pub fn look(&mut self, stamped: &StampedPicture<'_>, attitude: &Attitude) {
        /// So often a turn is looked for: five times a second, less what stamps of pictures scatter.
        const EVERY_NS: i64 = 190_000_000;
        /// The same once each way to be set up wrongly is excluded, and until one is suspected. A change after that, as a camera that was
        /// plugged in anew, is reported three seconds later.
        const TRIED_EVERY_NS: i64 = 990_000_000;
        /// Pictures farther apart are not held against each other; a busy computer looks at few.
        const APART_NS: i64 = 400_000_000;
        let StampedPicture { time, picture, lens, is_shared } = *stamped;
        let was_shared = std::mem::replace(&mut self.was_shared, is_shared);
        let is_begun = self.finder.is_begun();
        let is_due = !is_begun && self.looks.is_due(time);
        let waits = is_begun && is_shared && !was_shared;
        if is_due {
            self.looks.put_off(time, if self.is_tried() { TRIED_EVERY_NS } else { EVERY_NS });
        }
        if is_due || waits {
            self.finder.begin(time, picture, lens);
        } else if let Some(seen) = self.finder.finish(picture, lens)
            && (1..=APART_NS).contains(&time.ns_since(seen.from))
        {
            let span_ns = time.ns_since(seen.from);
            let middle = seen.from.plus_ns(span_ns / 2);
            self.turned(&seen, time, |late_ns| attitude.camera_turn(middle.plus_ns(-late_ns), span_ns));
        }
    }

    /// Takes in how the camera was seen to turn until `time`; `believed` says how it is believed to have turned as long, so much earlier.
    fn turned(&mut self, seen: &TurnSeen, time: Time, believed: impl Fn(i64) -> Option<DVec3>) {
        let span_s = time.secs_since(seen.from);
        let floor = SEA_RATE * span_s;
        let Some(own) = believed(0) else { return };
        let cost = |expected: DVec3, drift: &mut SeaDrift| {
            let drifted = expected + drift.take_in((seen.turn - expected) / span_s) * span_s;
            turn_cost(seen.turn, drifted, seen.covariance, floor)
        };
        let as_believed = cost(own, &mut self.drift);
        let stands = seen.turn.length() < 0.5 * floor;
        let is_fast = own.length() > FAST * span_s;
        if own.length() > 3.0 * floor {
            self.turn_cost.take(as_believed);
        }
        for hypothesis in &mut self.hypotheses {
            let Some(turn) = believed(hypothesis.late_ns) else { continue };
            let costs = Costs::of(as_believed, cost(hypothesis.turn * turn, &mut hypothesis.drift));
            match hypothesis.misfit {
                // What stands in the picture, as a reticle does, does not turn at all.
                Misfit::RateUnit if stands => {}
                Misfit::RateUnit => hypothesis.add_rate_unit(costs, is_fast),
                _ => hypothesis.add_turn(costs),
            }
        }
        self.decide();
    }

    /// Holds where up was seen against where the unit alone has it; `alone` gives that of a time.
    pub fn up(&mut self, time: Time, up: &UpSight, alone: impl Fn(Time) -> Option<DVec3>) {
        /// A horizon in view is found in most pictures; a level line of another kind, as the edge of a cloud, now and then, and may be as far
        /// off each time. So many have to follow each other, a second's, before they count for what does not say where up is seen.
        const SIGHTS_FEWEST: u32 = 10;
        let Some(own) = alone(time) else { return };
        let cost = |off: f64, sigma: f64| (off * off / (sigma * sigma)).min(COST_MOST);
        let off = between(own, up.seen);
        let (up_sigma, lasting) = (self.unit.up_sigma(), self.unit.lasting_up_sigma());
        let doubted = self.unit.doubted_up_sigma();
        let as_believed = cost(off.length(), up_sigma);
        self.count_sight(time);
        let sway_sigma = self.unit.sway_sigma(self.own_sway.mean.length());
        let sway = cost(self.own_sway.take_apart(off), sway_sigma);
        self.swing.take(own, off, self.unit.heading());
        if up.is_predicted && off.length() < 3.0 * UP_SIGMA {
            self.checked = Some(time);
        }
        let is_fast = self.unit.rate() > FAST;
        let is_steady = self.sights >= SIGHTS_FEWEST;
        for hypothesis in &mut self.hypotheses {
            match &mut hypothesis.up {
                // The unit's own orientation is not made of the force that it sends.
                UpExpected::At(_) if hypothesis.misfit == Misfit::Reversed(FORCE) && self.unit.has_own() => {}
                UpExpected::At(map) => {
                    let other = cost((*map * own).angle_between(up.seen), up_sigma);
                    // By little is as well a mount that is off, and a ship's turn, whose tilt is to any side for a gun that is swung.
                    let weight = match hypothesis.misfit {
                        Misfit::Lens => 1.0 / ALIKE_LONG,
                        _ if other > as_believed || off.length() > LEANS_MOST => 1.0,
                        _ => 0.0,
                    };
                    hypothesis.add(Costs { as_believed, other, weight, against: 1.0 / ALIKE });
                }
                UpExpected::Then(mean) => {
                    let Some(then) = alone(time.plus_ns(-hypothesis.late_ns)) else { continue };
                    let apart = mean.take_apart(between(then, up.seen));
                    hypothesis.add(Costs::of(sway, cost(apart, sway_sigma)).alike(ALIKE));
                }
                UpExpected::Off(mean) => {
                    let sigma = if hypothesis.is_doubt { doubted } else { lasting };
                    let apart = mean.take_apart(off);
                    if !is_steady {
                        continue;
                    }
                    let costs = Costs::of(cost(off.length(), sigma), COST_OFF + cost(apart, sigma));
                    hypothesis.add(costs.alike(ALIKE));
                }
                UpExpected::Wanders if !is_steady => {}
                UpExpected::Wanders => {
                    let costs = Costs::of(as_believed, as_believed.min(COST_WANDERS)).alike(ALIKE);
                    match hypothesis.misfit {
                        Misfit::RateUnit => hypothesis.add_rate_unit(costs, is_fast),
                        _ => hypothesis.add(costs),
                    }
                }
            }
            let is_believed = Some(hypothesis.misfit) == self.believed;
            if !matches!(hypothesis.up, UpExpected::Then(_) | UpExpected::Wanders) && !is_believed {
                hypothesis.pay();
            }
        }
        self.decide();
    }

    /// Counts up as seen. Forgets how the unit was off it lately unless it was seen just before: a turn of the ship, or a shore in place of
    /// the horizon, moves that meanwhile.
    fn count_sight(&mut self, time: Time) {
        /// Time after which up was not seen just before, seconds.
        const GAP_S: f64 = 2.0;
        self.sights = self.sights.saturating_add(1);
        if self.up_seen.replace(time).is_none_or(|last| time.secs_since(last) > GAP_S) {
            self.sights = 1;
            self.own_sway = MeanSway::NOTHING;
            self.swing.pause();
            for hypothesis in &mut self.hypotheses {
                if let UpExpected::Then(mean) = &mut hypothesis.up {
                    *mean = MeanSway::NOTHING;
                }
            }
        }
    }

    fn decide(&mut self) {
        /// The sum at which a hypothesis is believed.
        const LIMIT: f64 = 20.0;
        /// One that is believed stays until another's sum is larger by this.
        const LIMIT_OTHER: f64 = 2.0;
        /// No sum goes beyond this, so that a belief ends soon after its cause.
        const SUM_MOST: f64 = 60.0;
        // What is believed may be so until its sum says otherwise.
        let told = |h: &&Hypothesis| {
            Some(h.misfit) == self.believed && !h.is_doubt || h.may_be_believed(&self.swing)
        };
        let most = self.hypotheses.iter().filter(told).map(|h| h.sum).fold(0.0, f64::max);
        // What is ahead stays ahead.
        let beyond = (most - SUM_MOST).max(0.0);
        self.hypotheses.iter_mut().for_each(|h| h.sum = (h.sum - beyond).clamp(0.0, SUM_MOST));
        let most = self.hypotheses.iter().filter(told).max_by(|a, b| a.sum.total_cmp(&b.sum));
        let Some(most) = most else { return };
        if most.sum >= LIMIT {
            let alike = self.hypotheses.iter().filter(told).filter(|h| Some(h.misfit) == self.believed);
            let held = alike.map(|h| h.sum).fold(0.0, f64::max);
            if most.sum > held + LIMIT_OTHER {
                let misfit = most.misfit;
                self.believed = Some(misfit);
                let mut alike = self.hypotheses.iter_mut().filter(|h| h.misfit == misfit);
                alike.by_ref().for_each(Hypothesis::reopen);
            }
        } else if most.sum < LIMIT_BACK {
            self.believed = None;
        }
    }

    /// What is wrong; `None` where nothing is known to be.
    pub fn wrong(&self) -> Option<Misfit> {
        if self.unit.is_in_g() { Some(Misfit::ForceUnit) } else { self.believed }
    }

    /// Confirmation of what is believed.
    pub fn checks(&self, now: Time) -> RegistrationChecks {
        RegistrationChecks {
            unseen_s: self.checked.map_or(f64::INFINITY, |checked| now.secs_since(checked).max(0.0)),
            is_tried: self.is_tried(),
        }
    }

    /// As [`RegistrationChecks::is_tried`].
    fn is_tried(&self) -> bool {
        self.hypotheses.iter().all(|h| !h.is_possible() && h.sum < LIMIT_BACK) && self.turn_cost.is_usual()
    }
}

/// Confirmation by the pictures of the orientation that is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegistrationChecks {
    /// For how long no horizon was seen where it should be, seconds; without end where none has been so far.
    pub unseen_s: f64,
    /// Whether the camera has turned enough, and been seen to, that each way to be set up wrongly would have been told.
    pub is_tried: bool,
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
    // Another lens shows turns about the picture's axes larger or smaller, and one about the optical axis as it is; the plane through the eye
    // and a line of the picture tilts as the picture is stretched.
    all.extend([0.6, 0.77, 1.3, 1.7].map(|scale| {
        Hypothesis::of(Misfit::Lens, diagonal(scale, scale, 1.0), At(diagonal(1.0, 1.0, scale)))
    }));
    all.push(Hypothesis::of(Misfit::Mirrored, diagonal(1.0, -1.0, -1.0), At(diagonal(-1.0, 1.0, 1.0))));
    all.push(Hypothesis::of(Misfit::Mirrored, diagonal(-1.0, 1.0, -1.0), At(diagonal(1.0, -1.0, 1.0))));
    all.extend([100, 150, 200, 300, 400].map(|ms: u16| {
        let late = Hypothesis::of(Misfit::Late(ms), identity, Then(MeanSway::NOTHING));
        Hypothesis { late_ns: i64::from(ms) * 1_000_000, ..late }
    }));
    let off = Hypothesis::of(Misfit::Mount, identity, Off(MeanOff::NOTHING));
    all.extend([off, Hypothesis { is_doubt: true, ..off }]);
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
