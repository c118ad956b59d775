//! A crew at work: from what it sees to throttle and helm.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec2;

use super::{
    avoid::{Bound, Helmsman, Traffic},
    plan::{Act, CrewPlan, Guard},
};
use crate::{
    chance::drawn,
    geometry::{ahead, heading_of},
    physics::GRAVITY_M_S2,
    world::boats::{
        drive::{Craft, DriveState, Orders},
        path::wrap,
    },
};

/// Sideways acceleration that a hard turn begins with, of g: what helmsmen of fast boats dare.
const HARD_TURN_G: f64 = 0.9;
/// A slow boat turns no faster, rad/s.
const TURN_MAX: f64 = 0.7;
/// Share of that turn that a crew counts on when it looks for a way out: a boat takes a second to begin, and slows down.
const COUNTED_ON: f64 = 0.4;
/// A point of a transit counts as reached within so many lengths.
const REACHED_LENGTHS: f64 = 3.0;
/// Speed at which one that lies still makes room for another, m/s: one that was stopped is not under way by that.
const ROOM_M_S: f64 = 0.8;
/// Draws of fishing boats are numbered from here, those for exits below.
const FISHING: u64 = 1 << 32;

/// What a crew remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CrewMemory {
    /// Index of its state.
    pub state: usize,
    /// Seconds since the scenario began at which the state began.
    pub since_s: f64,
    /// Where it was then, world, metres.
    pub from: DVec2,
    /// Leg of what it does.
    pub leg: u32,
    /// Seconds at which the leg began.
    pub leg_since_s: f64,
    /// How many states it was in before this one.
    pub changes: u32,
    /// Exits that held and were not taken: a bit each.
    pub declined: u64,
    /// What it orders.
    pub orders: Orders,
}

/// What a crew knows at one time besides its own boat.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// Seconds since the scenario began.
    pub time_s: f64,
    /// Seed of all chance of this boat.
    pub seed: u64,
    /// Vessels near and far, without this boat, with the own ship.
    pub others: &'a [Traffic],
    /// The own ship, as one of them.
    pub own_ship: Traffic,
    /// What has happened to it.
    pub signals: Signals,
    /// Whether it keeps to the rules of the road.
    pub keeps_rules: bool,
    /// When it is to be where it attacks from, seconds since the scenario began, as others of its swarm are.
    pub on_target_s: Option<f64>,
    /// Orders of the person who drives boats.
    pub driven: Orders,
}

impl Situation<'_> {
    /// The speed at which a boat covers what is left of its way so that it comes when it is to; the state's own once that is past.
    fn in_time(&self, speed_m_s: f64, left_m: f64) -> f64 {
        /// Slower than this it would not steer.
        const SLOWEST_M_S: f64 = 1.5;
        let left_s = self.on_target_s.map_or(0.0, |due| due - self.time_s);
        if left_s <= 0.0 {
            return speed_m_s;
        }
        (left_m.max(0.0) / left_s).clamp(SLOWEST_M_S.min(speed_m_s), speed_m_s)
    }
}

/// What has happened to a boat so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Signals {
    /// It was warned.
    pub warned: bool,
    /// It was struck.
    pub hit: bool,
    /// One of its side nearby was struck.
    pub neighbour_hit: bool,
    /// A searchlight is on it.
    pub lit: bool,
    /// It sees the ship that the gun stands on, or her searchlight.
    pub sees_gun: bool,
}

/// What a crew wants of its boat.
#[derive(Clone, Copy, Debug)]
struct Wish {
    /// Where to; `None` to stop.
    bound: Option<Bound>,
    /// The act is done.
    arrived: bool,
    /// Nobody keeps clear of the own ship who means to ram her.
    rams: bool,
    /// The engine is out of gear.
    idles: bool,
    /// It makes no room for others: it lies at anchor, or has given up.
    stays: bool,
}

impl CrewPlan {
    /// Where the anchor of a crew lies that is at anchor, world, metres.
    pub fn anchor(&self, memory: &CrewMemory) -> Option<DVec2> {
        let act = &self.states.get(memory.state)?.act;
        matches!(act, Act::Anchor).then_some(memory.from)
    }

    /// What the crew remembers and orders next, `memory` being of its last decision.
    pub fn decide(
        &self,
        craft: &Craft,
        boat: &DriveState,
        memory: &CrewMemory,
        at: &Situation<'_>,
    ) -> CrewMemory {
        let mut memory = *memory;
        let mut wish = self.wish(craft, boat, &mut memory, at);
        if let Some(to) = self.exit(boat, &mut memory, &wish, at) {
            memory = CrewMemory {
                state: to,
                since_s: at.time_s,
                from: boat.centre,
                leg: 0,
                leg_since_s: at.time_s,
                changes: memory.changes.wrapping_add(1),
                declined: 0,
                orders: memory.orders,
            };
            wish = self.wish(craft, boat, &mut memory, at);
        }
        let is_driven = self.states.get(memory.state).is_some_and(|state| state.act == Act::Driven);
        memory.orders = if is_driven { at.driven } else { orders(craft, boat, &wish, at) };
        memory
    }

    fn exit(
        &self,
        boat: &DriveState,
        memory: &mut CrewMemory,
        wish: &Wish,
        at: &Situation<'_>,
    ) -> Option<usize> {
        let state = self.states.get(memory.state)?;
        let range_m = boat.centre.length();
        for (number, exit) in state.exits.iter().enumerate().take(64) {
            let bit = 1_u64 << number;
            if !exit.guard.holds(at.time_s - memory.since_s, range_m, wish.arrived, &at.signals) {
                memory.declined &= !bit;
                continue;
            }
            if memory.declined & bit != 0 {
                continue;
            }
            let chance = drawn(at.seed, [u64::from(memory.changes), number as u64]);
            if chance < exit.chance && exit.to < self.states.len() {
                return Some(exit.to);
            }
            memory.declined |= bit;
        }
        None
    }

    fn wish(&self, craft: &Craft, boat: &DriveState, memory: &mut CrewMemory, at: &Situation<'_>) -> Wish {
        let Some(state) = self.states.get(memory.state) else { return Wish::STOP };
        let speed = state.speed_m_s.min(craft.speed_max_m_s);
        let (range_m, outward) = (boat.centre.length(), heading_of(boat.centre));
        let inward = wrap(outward + PI);
        match &state.act {
            Act::Transit { points, repeat } => transit(craft, boat, memory, (points, *repeat), speed),
            Act::Loiter { radius_m } => loiter(boat, memory, *radius_m, speed),
            Act::Fish => fish(boat, memory, at, speed),
            Act::Anchor => Wish { arrived: false, idles: true, stays: true, ..Wish::STOP },
            Act::Drift => Wish { arrived: false, idles: true, ..Wish::STOP },
            Act::Stop | Act::Driven => Wish::STOP,
            Act::Surrender => Wish { stays: true, ..Wish::STOP },
            Act::Approach { stop_m } | Act::Attack { stop_m: Some(stop_m) } => {
                let left_m = range_m - stop_m;
                let near = left_m < craft.length_m;
                let speed = at.in_time(speed, left_m);
                if near { Wish::STOP } else { Wish::go(inward, craft.slowing(speed, left_m)) }
            }
            Act::Attack { stop_m: None } => {
                Wish { rams: true, ..Wish::go(inward, at.in_time(speed, range_m)) }
            }
            Act::Probe { turn_m } => {
                if memory.leg == 0 && range_m < *turn_m {
                    memory.leg = 1;
                }
                let arrived = memory.leg == 1 && range_m > 2.0 * turn_m;
                Wish { arrived, ..Wish::go(if memory.leg == 0 { inward } else { outward }, speed) }
            }
            Act::Circle { radius_m, clockwise } => {
                let side = if *clockwise { 1.0 } else { -1.0 };
                // Along the circle, and towards it by how far off it is.
                let off = ((range_m - radius_m) / (0.5 * radius_m)).clamp(-1.0, 1.0);
                Wish::go(outward + side * FRAC_PI_2 * (1.0 + off * 0.9), speed)
            }
            Act::Flee => Wish::go(outward, speed),
        }
    }
}

impl Wish {
    /// To lie still, which is done.
    const STOP: Self = Self { bound: None, arrived: true, rams: false, idles: false, stays: false };

    /// To go on a course at a speed, which is not done.
    const fn go(course: f64, speed_m_s: f64) -> Self {
        Self {
            bound: Some(Bound { course, speed_m_s }),
            arrived: false,
            rams: false,
            idles: false,
            stays: false,
        }
    }
}

/// Throttle and helm that fulfil a wish and keep clear of others.
fn orders(craft: &Craft, boat: &DriveState, wish: &Wish, at: &Situation<'_>) -> Orders {
    let me = Traffic {
        position: boat.centre,
        velocity: ahead(boat.heading) * boat.surge,
        heading: boat.heading,
        radius_m: 0.5 * craft.length_m,
    };
    let turn_rate = COUNTED_ON * hard_turn(boat.surge);
    let helmsman = Helmsman { turn_rate, margin_m: craft.length_m, keeps_rules: at.keeps_rules };
    if wish.idles || wish.bound.is_none() && boat.surge.abs() < 0.1 {
        let room = if wish.stays { None } else { helmsman.room(&me, at.others) };
        let Some(course) = room else { return Orders::default() };
        return craft.steer_for(boat, helmsman.clear(&me, Bound { course, speed_m_s: ROOM_M_S }, at.others));
    }
    let wanted = wish.bound.unwrap_or(Bound { course: boat.heading, speed_m_s: 0.0 });
    let bound = if wish.rams {
        let others: Vec<Traffic> = at.others.iter().copied().filter(|o| *o != at.own_ship).collect();
        helmsman.clear(&me, wanted, &others)
    } else {
        helmsman.clear(&me, wanted, at.others)
    };
    craft.steer_for(boat, bound)
}

/// From point to point, to the last or for ever.
fn transit(
    craft: &Craft,
    boat: &DriveState,
    memory: &mut CrewMemory,
    (points, repeat): (&[DVec2], bool),
    speed_m_s: f64,
) -> Wish {
    let count = points.len() as u32;
    let reached = |to: &DVec2| boat.centre.distance(*to) < REACHED_LENGTHS * craft.length_m;
    if points.get(memory.leg as usize).is_some_and(reached) {
        memory.leg = if repeat { (memory.leg + 1) % count.max(1) } else { memory.leg + 1 };
    }
    let Some(to) = points.get(memory.leg as usize) else { return Wish::STOP };
    let off = *to - boat.centre;
    let is_last = !repeat && memory.leg + 1 == count;
    Wish::go(heading_of(off), if is_last { craft.slowing(speed_m_s, off.length()) } else { speed_m_s })
}

/// Drifts until it is half the radius off, then goes back to a third of it.
fn loiter(boat: &DriveState, memory: &mut CrewMemory, radius_m: f64, speed_m_s: f64) -> Wish {
    let off = boat.centre - memory.from;
    let limit = if memory.leg == 0 { 0.5 } else { 0.3 };
    memory.leg = u32::from(off.length() > limit * radius_m);
    let back = Wish::go(heading_of(-off), speed_m_s);
    if memory.leg == 0 { Wish { arrived: false, ..Wish::STOP } } else { back }
}

/// The turn that helmsmen dare at a speed, rad/s.
pub(crate) fn hard_turn(speed_m_s: f64) -> f64 {
    TURN_MAX.min(HARD_TURN_G * GRAVITY_M_S2 / speed_m_s.abs().max(0.1))
}

impl Craft {
    /// The speed at which a boat comes to a place that is so far off: it needs some lengths to lose its way.
    fn slowing(&self, speed_m_s: f64, distance_m: f64) -> f64 {
        speed_m_s.min(1.0 + distance_m.max(0.0) / self.length_m)
    }

    /// Throttle and helm that bring the boat to a course and a speed.
    pub fn steer_for(&self, boat: &DriveState, bound: Bound) -> Orders {
        /// The turn that is wanted by what is missing of the course, 1/s.
        const COURSE_GAIN: f64 = 0.8;
        /// Throttle by what is missing of the speed, s/m.
        const SPEED_GAIN: f64 = 0.35;
        let off = wrap(bound.course - boat.heading);
        let turn = (COURSE_GAIN * off).clamp(-hard_turn(boat.surge), hard_turn(boat.surge));
        let missing = bound.speed_m_s - boat.surge;
        // A boat that has to turn about first does so slowly.
        let speed =
            if off.abs() > 1.2 { bound.speed_m_s.min(0.6 * self.speed_max_m_s) } else { bound.speed_m_s };
        let throttle = if bound.speed_m_s < 0.1 {
            -0.25 * boat.surge
        } else {
            self.throttle_for(speed) + SPEED_GAIN * missing
        };
        Orders { throttle: throttle.clamp(-1.0, 1.0), ..self.turn_at(boat, turn) }
    }

    /// The helm that makes a boat turn at a rate, rad/s.
    pub fn turn_at(&self, boat: &DriveState, turn_rate: f64) -> Orders {
        /// Helm by what is missing of the turn wanted, a full helm at half a radian a second.
        const TURN_GAIN: f64 = 2.0;
        let astern = if boat.surge < -0.3 { -1.0 } else { 1.0 };
        let known = self.helm_for(boat.surge, turn_rate);
        let missing = TURN_GAIN * (turn_rate - boat.yaw_rate);
        let most = self.hard_over(boat.surge);
        Orders { throttle: 0.0, helm: ((known + missing) * astern).clamp(-most, most) }
    }
}

/// Legs of a fishing boat: half a minute to two at a walking pace on a course that changes little, then as long without way.
fn fish(boat: &DriveState, memory: &mut CrewMemory, at: &Situation<'_>, speed_m_s: f64) -> Wish {
    let visit = u64::from(memory.changes) << 32;
    let chance = |leg: u32, what: u64| drawn(at.seed, [visit | u64::from(leg), FISHING + what]);
    let leg_s = 30.0 + 90.0 * chance(memory.leg, 0);
    // Four legs go about the same way.
    let course = TAU * chance(memory.leg / 4, 1) + 1.5 * (chance(memory.leg, 2) - 0.5);
    let moving = memory.leg.is_multiple_of(2);
    if at.time_s - memory.leg_since_s > leg_s {
        memory.leg += 1;
        memory.leg_since_s = at.time_s;
    }
    // Home again before it is out of sight of where it began.
    let home = memory.from - boat.centre;
    let course = if home.length() > 150.0 { heading_of(home) } else { course };
    let bound = moving.then_some(Bound { course, speed_m_s });
    Wish { bound, arrived: false, ..Wish::STOP }
}

impl Guard {
    fn holds(&self, in_state_s: f64, range_m: f64, arrived: bool, signals: &Signals) -> bool {
        let Self { after_s, within_m, beyond_m, .. } = *self;
        let asked = |asks: bool, is: bool| !asks || is;
        after_s.is_none_or(|s| in_state_s >= s)
            && within_m.is_none_or(|m| range_m <= m)
            && beyond_m.is_none_or(|m| range_m >= m)
            && asked(self.arrived, arrived)
            && asked(self.warned, signals.warned)
            && asked(self.hit, signals.hit)
            && asked(self.neighbour_hit, signals.neighbour_hit)
            && asked(self.lit, signals.lit)
            && asked(self.sees_gun, signals.sees_gun)
    }
}
