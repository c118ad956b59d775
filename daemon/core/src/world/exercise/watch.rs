//! Watches an exercise as it goes, and notes what the score needs.

use super::{
    event::{ExerciseEvent, ExerciseFact},
    spec::{Engagement, ExerciseSpec, HappeningCause, HappeningEffect, group_of},
};
use crate::{
    act::{Act, TraineeAct},
    order::Order,
    side::Side,
    time::Time,
    world::{flare::FlareSpec, seeing::threshold::SEEN},
};

/// A barrel that points no further off a boat than this points at it, radians.
const POINTS: f64 = 2.0 * std::f64::consts::PI / 180.0;
/// How long it has to for that to count as seen, seconds.
const POINTED_S: f64 = 0.5;
/// A boat slower than this has no way, m/s.
pub const STOPPED_M_S: f64 = 1.0;
/// A boat that opens at this speed goes away, and one that closes at it comes on, m/s.
const OPENS_M_S: f64 = 2.0;
/// How long it has to, seconds.
const OPENED_S: f64 = 3.0;
/// A boat as the watch sees it.
#[derive(Clone, Copy, Debug)]
pub struct WatchedBoat<'a> {
    /// Its name.
    pub name: &'a str,
    /// Whom it belongs to.
    pub side: Side,
    /// It waits in reserve: nothing is noted of it.
    pub in_reserve: bool,
    /// Distance from the gun, metres.
    pub range_m: f64,
    /// Speed through the water, m/s.
    pub speed_m_s: f64,
    /// Angle between the barrel and the boat's middle, radians; `None` while it is not known where the barrel points.
    pub off_bore: Option<f64>,
    /// Chance that a glimpse shows it to somebody who looks at it, 0 to 1.
    pub seen: f64,
    /// When it was first struck.
    pub struck: Option<Time>,
    /// The searchlight is on it.
    pub is_lit: bool,
    /// Its crew has given up.
    pub gave_up: bool,
    /// When it is full of water and sinks.
    pub sinks: Option<Time>,
    /// Since when it burns.
    pub burns_since: Option<Time>,
}

/// What is known of a boat so far.
#[derive(Clone, Debug, Default)]
struct BoatNotes {
    nearest_m: Option<f64>,
    last: Option<(Time, f64)>,
    in_view: bool,
    pointed_since: Option<Time>,
    pointed: bool,
    is_close: bool,
    /// By a call, or by light.
    warned: bool,
    opening_since: Option<Time>,
    closing_since: Option<Time>,
    is_stopped: bool,
    is_away: bool,
    has_sunk: bool,
    burns: bool,
}

/// Watches one exercise.
#[derive(Clone, Debug)]
pub struct ExerciseWatch {
    spec: ExerciseSpec,
    boats: Vec<BoatNotes>,
    rules: Engagement,
    happened: Vec<bool>,
    acts: Vec<TraineeAct>,
    orders: Vec<Order>,
    begun: Option<Time>,
    is_decided: bool,
}

/// Orders of the watch to weapon, crews and sky.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WatchOrders {
    /// Boats that were warned, by their numbers.
    pub warned: Vec<usize>,
    /// The weapon has a stoppage.
    pub stoppage: bool,
    /// Flares that are lit.
    pub flares: Vec<FlareSpec>,
}

/// Most acts, or orders, that wait: more come only while there is no picture.
const WAITING_MAX: usize = 256;

impl ExerciseWatch {
    /// For an exercise that has not begun.
    pub fn new(spec: ExerciseSpec) -> Self {
        Self {
            rules: spec.rules.unwrap_or_default(),
            happened: vec![false; spec.happenings.len()],
            spec,
            boats: Vec::new(),
            acts: Vec::new(),
            orders: Vec::new(),
            begun: None,
            is_decided: false,
        }
    }

    /// Rules of engagement that hold now; `None` where the scenario gives none.
    pub fn rules(&self) -> Option<Engagement> {
        self.spec.rules.map(|_| self.rules)
    }

    /// Tests whether all hostile boats were stopped or have turned away, where there were any.
    pub const fn is_decided(&self) -> bool {
        self.is_decided
    }

    /// Takes in an act. It counts with the next [`Self::follow`].
    pub fn act(&mut self, act: TraineeAct) {
        if self.acts.len() < WAITING_MAX {
            self.acts.push(act);
        }
    }

    /// Takes in an order of the instructor's: one of rules, text or stoppage. It counts with the next [`Self::follow`].
    pub fn order(&mut self, order: Order) {
        if self.orders.len() < WAITING_MAX {
            self.orders.push(order);
        }
    }

    /// Tests whether the goals ask for one more to be stopped where a boat of that side joins.
    pub const fn stops_one_more(&self, side: Side) -> bool {
        matches!(side, Side::Hostile) && self.spec.goals.stop.is_none()
    }

    /// Looks at all boats at `time`, and adds what happened since the last look to `events`.
    pub fn follow(
        &mut self,
        time: Time,
        boats: &[WatchedBoat<'_>],
        rounds: u32,
        events: &mut Vec<ExerciseEvent>,
    ) -> WatchOrders {
        let mut note = |fact| events.push(ExerciseEvent { time, fact });
        let begun = self.begun.unwrap_or_else(|| {
            let hostile = boats.iter().filter(|b| b.side == Side::Hostile && !b.in_reserve).count() as u32;
            let ExerciseSpec { goals, self_defence_m, .. } = self.spec;
            note(ExerciseFact::Began {
                rounds,
                hostile,
                keep_off_m: goals.keep_off_m,
                self_defence_m,
                stop: goals.stop.unwrap_or(hostile).min(hostile),
            });
            if self.spec.rules.is_some() {
                note(ExerciseFact::Rules { rules: self.rules });
            }
            time
        });
        self.begun = Some(begun);
        self.boats.resize_with(boats.len(), BoatNotes::default);
        let mut orders = WatchOrders::default();
        for (boat, notes) in boats.iter().zip(&mut self.boats).filter(|(boat, _)| !boat.in_reserve) {
            notes.look(boat, time, &self.spec, &mut note);
        }
        let is_threat = |boat: &WatchedBoat<'_>| boat.side == Side::Hostile && !boat.in_reserve;
        let mut threats = boats.iter().zip(&self.boats).filter(|(boat, _)| is_threat(boat)).peekable();
        self.is_decided =
            threats.peek().is_some() && threats.all(|(_, notes)| notes.is_stopped || notes.is_away);
        for TraineeAct { time, act } in std::mem::take(&mut self.acts) {
            let about = if act.is_about_a_boat() { spoken_of(boats) } else { Vec::new() };
            let mut did = |boat: Option<String>, range_m| {
                events.push(ExerciseEvent { time, fact: ExerciseFact::Did { act, boat, range_m } });
            };
            if about.is_empty() {
                did(None, None);
            }
            for boat in about {
                did(Some(boats[boat].name.to_owned()), Some(boats[boat].range_m));
                if act == Act::Warn {
                    orders.warned.push(boat);
                    self.boats[boat].warned = true;
                }
            }
        }
        self.happen(time, begun, boats, &mut orders, events);
        self.obey(time, &mut orders, events);
        orders
    }

    /// Obeys the instructor's orders.
    fn obey(&mut self, time: Time, orders: &mut WatchOrders, events: &mut Vec<ExerciseEvent>) {
        for order in std::mem::take(&mut self.orders) {
            let fact = match order {
                Order::Rules { rules } => {
                    // From now on there are rules, also where the scenario gave none.
                    self.spec.rules.get_or_insert(rules);
                    self.rules = rules;
                    ExerciseFact::Rules { rules }
                }
                Order::Stoppage => {
                    orders.stoppage = true;
                    ExerciseFact::StoppageOrdered
                }
                Order::Message { text } => ExerciseFact::Message { text },
                Order::Note { text } => ExerciseFact::Note { text },
                Order::Join { .. } | Order::Pause | Order::Resume => continue,
            };
            events.push(ExerciseEvent { time, fact });
        }
    }

    /// What is due happens, once.
    fn happen(
        &mut self,
        time: Time,
        begun: Time,
        boats: &[WatchedBoat<'_>],
        orders: &mut WatchOrders,
        events: &mut Vec<ExerciseEvent>,
    ) {
        let mut note = |fact| events.push(ExerciseEvent { time, fact });
        for (happening, happened) in self.spec.happenings.iter().zip(&mut self.happened) {
            let is_due = match &happening.cause {
                HappeningCause::At(seconds) => time.secs_since(begun) >= *seconds,
                HappeningCause::Within(about, metres) => {
                    let is_within = |b: &WatchedBoat<'_>| !b.in_reserve && b.range_m <= *metres;
                    boats.iter().any(|b| about.covers(b.name, b.side) && is_within(b))
                }
                HappeningCause::Struck(about) => {
                    boats.iter().any(|b| about.covers(b.name, b.side) && b.struck.is_some_and(|s| s <= time))
                }
            };
            if *happened || !is_due {
                continue;
            }
            *happened = true;
            for effect in &happening.effects {
                match effect {
                    HappeningEffect::Rules(rules) => {
                        self.rules = *rules;
                        note(ExerciseFact::Rules { rules: *rules });
                    }
                    HappeningEffect::Stoppage => orders.stoppage = true,
                    HappeningEffect::Flare(flare) => orders.flares.push(*flare),
                    HappeningEffect::Message(text) => note(ExerciseFact::Message { text: text.clone() }),
                }
            }
        }
    }

    /// The exercise is over.
    pub fn finish(
        &mut self,
        time: Time,
        boats: &[WatchedBoat<'_>],
        rounds_left: u32,
        events: &mut Vec<ExerciseEvent>,
    ) {
        if self.begun.is_none() {
            return;
        }
        let mut note = |fact| events.push(ExerciseEvent { time, fact });
        for (boat, notes) in boats.iter().zip(&self.boats) {
            if let Some(range_m) = notes.nearest_m {
                note(ExerciseFact::Nearest { boat: boat.name.to_owned(), side: boat.side, range_m });
            }
        }
        note(ExerciseFact::Ended { rounds_left });
    }
}

impl BoatNotes {
    fn look(
        &mut self,
        boat: &WatchedBoat<'_>,
        time: Time,
        spec: &ExerciseSpec,
        note: &mut impl FnMut(ExerciseFact),
    ) {
        let (name, range_m) = (|| boat.name.to_owned(), boat.range_m);
        self.nearest_m = Some(self.nearest_m.map_or(range_m, |nearest| nearest.min(range_m)));
        if !self.in_view && boat.seen >= SEEN {
            self.in_view = true;
            note(ExerciseFact::InView { boat: name(), side: boat.side, range_m });
            for call in spec.calls.iter().filter(|call| call.about.covers(boat.name, boat.side)) {
                let (before_m, within_s) = (call.before_m, call.within_s);
                note(ExerciseFact::CallAsked { call: call.call, boat: name(), before_m, within_s });
            }
        }
        self.point(boat, time, note);
        if !self.burns && boat.burns_since.is_some_and(|since| since <= time) {
            self.burns = true;
            note(ExerciseFact::CaughtFire { boat: name(), range_m });
        }
        if !self.has_sunk && boat.sinks.is_some_and(|sinks| sinks <= time) {
            self.has_sunk = true;
            note(ExerciseFact::Sank { boat: name(), range_m });
        }
        if boat.side == Side::Hostile {
            self.threat(boat, time, spec.goals.keep_off_m, note);
        } else if boat.struck.is_some() && boat.speed_m_s < STOPPED_M_S && !self.is_stopped {
            self.is_stopped = true;
            note(ExerciseFact::Stopped { boat: name(), range_m });
        }
        self.warned |= boat.is_lit;
        self.last = Some((time, range_m));
    }

    fn point(&mut self, boat: &WatchedBoat<'_>, time: Time, note: &mut impl FnMut(ExerciseFact)) {
        if self.pointed || !self.in_view {
            return;
        }
        if boat.off_bore.is_none_or(|off| off > POINTS) {
            self.pointed_since = None;
            return;
        }
        if time.secs_since(*self.pointed_since.get_or_insert(time)) >= POINTED_S {
            self.pointed = true;
            note(ExerciseFact::Pointed { boat: boat.name.to_owned(), range_m: boat.range_m });
        }
    }

    /// Follows a hostile boat until it is stopped or goes away for good.
    fn threat(
        &mut self,
        boat: &WatchedBoat<'_>,
        time: Time,
        keep_off_m: f64,
        note: &mut impl FnMut(ExerciseFact),
    ) {
        let (name, range_m) = (|| boat.name.to_owned(), boat.range_m);
        let opens_m_s =
            self.last.map_or(0.0, |(last, was_m)| (range_m - was_m) / time.secs_since(last).max(1e-3));
        let goes = lasts(&mut self.opening_since, opens_m_s > OPENS_M_S, time);
        let comes = lasts(&mut self.closing_since, opens_m_s < -OPENS_M_S, time);
        if boat.struck.is_some() && boat.speed_m_s < STOPPED_M_S && !self.is_stopped {
            self.is_stopped = true;
            note(ExerciseFact::Stopped { boat: name(), range_m });
        } else if !self.is_stopped && !self.is_away {
            self.is_away = boat.gave_up || goes && (boat.struck.is_some() || self.warned);
            if self.is_away {
                note(ExerciseFact::TurnedAway { boat: name(), range_m });
            }
        } else if self.is_away && !self.is_stopped && comes && !boat.gave_up {
            self.is_away = false;
            note(ExerciseFact::CameBack { boat: name() });
        }
        let is_close = !self.is_stopped && !self.is_away && range_m < keep_off_m;
        if is_close != self.is_close {
            self.is_close = is_close;
            let boat = name();
            note(if is_close {
                ExerciseFact::CameClose { boat }
            } else {
                ExerciseFact::NoLongerClose { boat }
            });
        }
    }
}

/// Tests whether something has been so for long enough; `since` keeps since when.
fn lasts(since: &mut Option<Time>, is_so: bool, time: Time) -> bool {
    *since = is_so.then(|| since.unwrap_or(time));
    since.is_some_and(|since| time.secs_since(since) >= OPENED_S)
}

/// The boat that the barrel points at.
pub fn pointed_at(boats: &[WatchedBoat<'_>]) -> Option<usize> {
    let off = |boat: &WatchedBoat<'_>| boat.off_bore.filter(|off| *off <= POINTS);
    let candidates = boats.iter().enumerate().filter_map(|(i, boat)| Some((i, off(boat)?)));
    candidates.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

/// The boats that a word is about: the one that the barrel points at, and those of its group that it points at as well.
fn spoken_of(boats: &[WatchedBoat<'_>]) -> Vec<usize> {
    let Some(nearest) = pointed_at(boats) else { return Vec::new() };
    let group = group_of(boats[nearest].name);
    let is_meant = |i: &usize| {
        *i == nearest
            || group_of(boats[*i].name) == group && boats[*i].off_bore.is_some_and(|off| off <= POINTS)
    };
    (0..boats.len()).filter(is_meant).collect()
}

#[cfg(test)]
#[path = "watch_tests.rs"]
mod tests;
