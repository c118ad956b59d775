//! A gunner's decisions: to look, to speak, to fire.

use glam::{DVec2, DVec3};
use rand::RngExt;
use rand_pcg::Pcg64;

use super::{
    eye::{Sighted, happens, normal},
    hand::difference,
    skill::Skill,
};
use crate::{
    act::Act,
    geometry::heading_of,
    side::Side,
    world::{
        exercise::Engagement,
        gunnery::{Projectile, aim_to_hit},
        weapon::WeaponState,
    },
};

/// A barrel this near to a boat points at it, for a report, radians.
const POINTED: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Boats of a group no further apart are spoken of together, radians.
const BESIDE: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// Boats nearer than that are reported, named, warned and fired at before anything is said of others, metres.
const URGENT_M: f64 = 300.0;
/// A boat that was warned has this long to turn, seconds.
const HEEDS_S: f64 = 6.0;
/// Range within which a boat is warned, metres.
const WARNS_WITHIN_M: f64 = 700.0;
/// The lead is thought of so often, seconds.
const THINKS_S: f64 = 0.1;
/// Share of what a burst is seen to miss by that the eye misjudges it by.
const MISJUDGED: f64 = 0.2;

/// What is known of a boat.
#[derive(Clone, Debug)]
struct Known {
    is_found: bool,
    is_reported: bool,
    called: Option<Side>,
    warned_s: Option<f64>,
    /// Factors by which lead and range are misjudged.
    lead: f64,
    range: f64,
    /// What bursts were seen to miss by, radians to the right and over.
    correction: DVec2,
}

/// What is done with the gun.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Task {
    /// Nothing is to be pointed at.
    Search,
    /// Something is said of a boat that is pointed at.
    Say(usize, Act),
    /// A boat is fired at.
    Engage(usize),
}

/// Conditions of a moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment<'a> {
    /// Seconds since the scenario began.
    pub time_s: f64,
    pub span_s: f64,
    pub sighted: &'a [Sighted],
    pub rules: Option<Engagement>,
    /// Hostile boats are to be warned, by rule or by call.
    pub warns: bool,
    pub self_defence_m: f64,
    pub weapon: WeaponState,
    /// The muzzle, world, metres.
    pub eye: DVec3,
    /// Angle between the gun and what it was to point at, radians.
    pub off: f64,
    /// Groups of the boats, by their numbers.
    pub groups: &'a [usize],
}

/// What the hands are to do.
#[derive(Clone, Debug, Default)]
pub(super) struct Decision {
    /// Where the gun is to point and how that moves: azimuth and elevation, radians and rad/s.
    pub wanted: Option<(DVec2, DVec2)>,
    pub trigger: bool,
    pub acts: Vec<Act>,
}

/// The weapon, as its gunner knows it.
#[derive(Clone, Copy, Debug)]
pub(super) struct KnownWeapon {
    pub projectile: Projectile,
    pub cycle_s: f64,
    pub wind: DVec3,
}

/// A gunner's mind.
#[derive(Clone, Debug)]
pub(super) struct Head {
    skill: Skill,
    weapon: KnownWeapon,
    known: Vec<Known>,
    task: Task,
    since_s: f64,
    /// When this engagement's first round may be fired.
    ready_s: f64,
    burst_ends_s: Option<f64>,
    pause_ends_s: f64,
    thought_s: f64,
    /// Aim over the line of sight, azimuth and elevation, radians.
    lead: DVec2,
    handles_s: Option<f64>,
    seen: Vec<DVec2>,
}

impl Head {
    pub fn new(skill: Skill, weapon: KnownWeapon, boats: usize, random: &mut Pcg64) -> Self {
        let known = (0..boats)
            .map(|_| Known {
                is_found: false,
                is_reported: false,
                called: None,
                warned_s: None,
                lead: 1.0 + skill.lead_error * normal(random),
                range: (1.0 + skill.range_error * normal(random)).clamp(0.3, 3.0),
                correction: DVec2::ZERO,
            })
            .collect();
        Self {
            skill,
            weapon,
            known,
            task: Task::Search,
            since_s: 0.0,
            ready_s: 0.0,
            burst_ends_s: None,
            pause_ends_s: 0.0,
            thought_s: f64::NEG_INFINITY,
            lead: DVec2::ZERO,
            handles_s: None,
            seen: Vec::new(),
        }
    }

    /// A round was seen to pass a boat by so much, mrad to the right and over.
    pub fn saw_miss(&mut self, boat: usize, error_mrad: [f64; 2]) {
        if self.task == Task::Engage(boat) {
            self.seen.push(DVec2::from_array(error_mrad) * 1e-3);
        }
    }

    /// What is done next.
    pub fn decide(&mut self, at: &Moment<'_>, random: &mut Pcg64) -> Decision {
        for boat in at.sighted {
            let known = &mut self.known[boat.boat];
            known.is_found |= happens(random, boat.found_per_s * self.skill.search, at.span_s);
        }
        let mut decision = Decision::default();
        self.handle(at, &mut decision);
        let task = self.next_task(at);
        if task != self.task {
            self.task = task;
            self.since_s = at.time_s;
            self.ready_s = at.time_s + self.skill.first_shot_s * (0.8 + 0.5 * random.random::<f64>());
            (self.burst_ends_s, self.pause_ends_s) = (None, 0.0);
            self.thought_s = f64::NEG_INFINITY;
            self.seen.clear();
        }
        match self.task {
            Task::Search => {}
            Task::Say(boat, act) => self.say(boat, act, at, &mut decision, random),
            Task::Engage(boat) => self.engage(boat, at, &mut decision, random),
        }
        decision
    }

    /// Belts and stoppages.
    fn handle(&mut self, at: &Moment<'_>, decision: &mut Decision) {
        let (act, takes_s) = match at.weapon {
            WeaponState::Stoppage => (Act::Clear, self.skill.clear_s),
            WeaponState::Empty => (Act::Reload, self.skill.reaction_s),
            WeaponState::Safe => (Act::Ready, self.skill.reaction_s),
            WeaponState::Ready | WeaponState::Reloading => {
                self.handles_s = None;
                return;
            }
        };
        if at.time_s - *self.handles_s.get_or_insert(at.time_s) >= takes_s {
            self.handles_s = None;
            decision.acts.push(act);
        }
    }

    fn next_task(&self, at: &Moment<'_>) -> Task {
        let found = || self.found(at);
        let range_m = |b: &Sighted| b.at.distance(at.eye);
        let may = |b: &&Sighted| self.may_fire(b, range_m(b), at);
        let target = found().filter(may).max_by(|a, b| {
            let urgency = |s: &Sighted| {
                let stays = if self.task == Task::Engage(s.boat) { 1.5 } else { 1.0 };
                stays / arrives_s(s, at.eye)
            };
            urgency(a).total_cmp(&urgency(b))
        });
        if let Some(target) = target.filter(|t| range_m(t) < URGENT_M || self.task == Task::Engage(t.boat)) {
            return Task::Engage(target.boat);
        }
        if let Task::Say(boat, act) = self.task
            && found().any(|b| b.boat == boat)
            && self.is_open(boat, act)
        {
            return self.task;
        }
        self.to_say(at).or(target.map(|target| Task::Engage(target.boat))).unwrap_or(Task::Search)
    }

    /// The next thing to say: of boats that are near, all there is to say, then of the others.
    fn to_say(&self, at: &Moment<'_>) -> Option<Task> {
        // Which side is said when it is known.
        let acts = [Act::Report, Act::Identify(Side::Hostile), Act::Warn];
        let range_m = |b: &Sighted| b.at.distance(at.eye);
        let nearest = |within_m: f64, act: Act| {
            let is_due = |b: &&Sighted| {
                let known = &self.known[b.boat];
                let in_turn = match act {
                    Act::Identify(_) => b.is_recognised,
                    Act::Warn => {
                        at.warns && known.called == Some(Side::Hostile) && range_m(b) < WARNS_WITHIN_M
                    }
                    _ => true,
                };
                range_m(b) < within_m && self.is_open(b.boat, act) && in_turn
            };
            self.found(at)
                .filter(is_due)
                .min_by(|a, b| range_m(a).total_cmp(&range_m(b)))
                .map(|b| Task::Say(b.boat, act))
        };
        let within = |reach_m| acts.into_iter().find_map(|act| nearest(reach_m, act));
        [URGENT_M, f64::INFINITY].into_iter().find_map(within)
    }

    /// Boats that are known to be there and still matter.
    fn found<'a>(&'a self, at: &'a Moment<'_>) -> impl Iterator<Item = &'a Sighted> {
        at.sighted.iter().filter(|b| self.known[b.boat].is_found && !b.is_over)
    }

    /// Whether something is still to be said of a boat.
    fn is_open(&self, boat: usize, act: Act) -> bool {
        let known = &self.known[boat];
        match act {
            Act::Report => !known.is_reported,
            Act::Identify(_) => known.called.is_none(),
            Act::Warn => known.warned_s.is_none(),
            _ => false,
        }
    }

    fn may_fire(&self, boat: &Sighted, range_m: f64, at: &Moment<'_>) -> bool {
        let known = &self.known[boat.boat];
        if known.called != Some(Side::Hostile) || range_m > self.skill.fires_within_m {
            return false;
        }
        let defends = range_m < at.self_defence_m;
        match at.rules.unwrap_or_default() {
            Engagement::Hold => defends,
            Engagement::Warn => defends || known.warned_s.is_some_and(|s| at.time_s - s > HEEDS_S),
            Engagement::Tight | Engagement::Free => true,
        }
    }

    fn say(&mut self, boat: usize, act: Act, at: &Moment<'_>, decision: &mut Decision, random: &mut Pcg64) {
        let Some(sighted) = at.sighted.iter().find(|b| b.boat == boat) else { return };
        decision.wanted = Some((angles(sighted.at - at.eye), rate(sighted, at.eye)));
        let takes_s = match act {
            Act::Identify(_) => self.skill.identify_s,
            _ => self.skill.reaction_s,
        };
        if at.time_s - self.since_s < takes_s || at.off > POINTED {
            return;
        }
        let said = if let Act::Identify(_) = act {
            let errs = random.random::<f64>() < self.skill.misjudges;
            let other = if sighted.side == Side::Hostile { Side::Neutral } else { Side::Hostile };
            Act::Identify(if errs { other } else { sighted.side })
        } else {
            act
        };
        // Those of its group beside it are meant as well.
        let beside = at.sighted.iter().filter(|b| {
            let off = (b.at - at.eye).angle_between(sighted.at - at.eye);
            at.groups[b.boat] == at.groups[boat] && off < BESIDE
        });
        for boat in beside.map(|b| b.boat).collect::<Vec<_>>() {
            let known = &mut self.known[boat];
            known.is_found = true;
            match said {
                Act::Report => known.is_reported = true,
                Act::Warn => known.warned_s = Some(at.time_s),
                Act::Identify(side) => known.called = Some(side),
                _ => {}
            }
        }
        decision.acts.push(said);
    }

    fn engage(&mut self, boat: usize, at: &Moment<'_>, decision: &mut Decision, random: &mut Pcg64) {
        let Some(sighted) = at.sighted.iter().find(|b| b.boat == boat) else { return };
        let sight = sighted.at - at.eye;
        if at.time_s - self.thought_s >= THINKS_S {
            self.thought_s = at.time_s;
            self.lead = self.think(sighted, at.eye);
        }
        let correction = self.known[boat].correction;
        let elevation = angles(sight).y;
        // To the right is a smaller turn in azimuth the flatter one looks.
        let aside = DVec2::new(correction.x / elevation.cos().max(0.1), correction.y);

        let aim = angles(sight) + self.lead + aside;
        decision.wanted = Some((aim, rate(sighted, at.eye)));
        let close_m = 0.5 * 5.0_f64.max(sighted.velocity.length() * 0.2);
        let is_on = at.off < 2e-3 + close_m / sight.length().max(1.0);
        match self.burst_ends_s {
            Some(end_s) if at.time_s < end_s && self.is_clear(aim, at) => {
                decision.trigger = at.weapon == WeaponState::Ready
            }
            Some(_) => {
                self.burst_ends_s = None;
                self.pause_ends_s = at.time_s + self.skill.pause_s;
            }
            None if at.time_s >= self.ready_s.max(self.pause_ends_s)
                && is_on
                && self.is_clear(aim, at)
                && at.weapon == WeaponState::Ready =>
            {
                self.correct(boat, random);
                let rounds = f64::from(self.skill.burst) * (0.7 + 0.6 * random.random::<f64>());
                self.burst_ends_s = Some(at.time_s + rounds * self.weapon.cycle_s);
                decision.trigger = true;
            }
            None => {}
        }
    }

    /// Tests whether no boat that is not known as hostile is near the line of fire, before or behind the target.
    fn is_clear(&self, aim: DVec2, at: &Moment<'_>) -> bool {
        at.sighted
            .iter()
            .filter(|b| self.known[b.boat].called != Some(Side::Hostile))
            .all(|b| difference(angles(b.at - at.eye), aim).x.abs() > self.skill.clearance_mrad * 1e-3)
    }

    /// Takes what the last burst was seen to miss by off the aim.
    fn correct(&mut self, boat: usize, random: &mut Pcg64) {
        if self.seen.is_empty() {
            return;
        }
        let mean = self.seen.iter().sum::<DVec2>() / self.seen.len() as f64;
        let misjudged = DVec2::new(normal(random), normal(random)) * MISJUDGED + 1.0;
        self.known[boat].correction -= mean * misjudged * self.skill.corrects;
        self.seen.clear();
    }

    /// Aim over the line of sight that this gunner holds for right.
    fn think(&self, sighted: &Sighted, eye: DVec3) -> DVec2 {
        let known = &self.known[sighted.boat];
        let sight = sighted.at - eye;
        let Some(forward) = sight.try_normalize() else { return DVec2::ZERO };
        let along = forward * sighted.velocity.dot(forward);
        let across = (sighted.velocity - along) * known.lead;
        // At another range the same turn of the line of sight is another speed.
        let (at, velocity) = (eye + sight * known.range, (across + along) * known.range);
        let weapon = &self.weapon;
        let aim = aim_to_hit(weapon.projectile, eye, weapon.wind, |s| at + velocity * s);
        aim.map_or(DVec2::ZERO, |aim| difference(angles(aim.direction), angles(sight)))
    }
}

/// Azimuth, clockwise from north, and elevation of a direction, radians.
pub(super) fn angles(direction: DVec3) -> DVec2 {
    DVec2::new(heading_of(direction.truncate()), direction.z.atan2(direction.x.hypot(direction.y)))
}

/// Rate of the line of sight to a boat, azimuth and elevation, rad/s.
fn rate(boat: &Sighted, eye: DVec3) -> DVec2 {
    const SPAN_S: f64 = 0.05;
    let sight = boat.at - eye;
    difference(angles(sight + boat.velocity * SPAN_S), angles(sight)) / SPAN_S
}

/// Seconds until a boat is here if it goes on so; of one that does not close, as if it did so slowly.
fn arrives_s(boat: &Sighted, eye: DVec3) -> f64 {
    let sight = boat.at - eye;
    let range_m = sight.length().max(1.0);
    let closing = -boat.velocity.dot(sight) / range_m;
    range_m / closing.max(1.0)
}
