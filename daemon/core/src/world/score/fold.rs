//! The score of a run: a fold over its records, the same live, in review and ashore.

use std::collections::BTreeMap;

use super::{
    BoatSheet, Breach, CallsSheet, CauseSheet, Ending, MissCause, MissExplanation, Outcome, PointsItem,
    RoundsSheet, SCORE_VERSION, ScoreSheet, ShotRecord,
};
use crate::{
    act::Act,
    model::Zone,
    side::Side,
    time::Time,
    world::{
        clock::ExerciseClock,
        exercise::{Engagement, ExerciseEvent, ExerciseFact},
    },
};

/// Rounds this far apart belong to different bursts, seconds.
const BURST_GAP_S: f64 = 2.0;

/// All that one run left, to be scored.
#[derive(Clone, Debug, Default)]
pub struct ScoreFold {
    /// Time for which the exercise stood still does not count.
    clock: ExerciseClock,
    begun: Option<Time>,
    ended: Option<Time>,
    goals: Option<GoalsAsked>,
    rounds_left: Option<u32>,
    rules: Vec<(Time, Engagement)>,
    boats: BTreeMap<String, BoatFold>,
    calls: Vec<CallAsked>,
    shots: Vec<Fired>,
    aims: Vec<AimedRound>,
    misses: Vec<MissExplanation>,
    close: BTreeMap<String, Time>,
    under_threat_s: f64,
    stoppages: u32,
    barrel_hot: u32,
    /// Neutral boats that fragments struck, beside those that rounds' records name.
    fragments: Vec<String>,
}

#[derive(Clone, Copy, Debug)]
struct GoalsAsked {
    hostile: u32,
    stop: u32,
    keep_off_m: f64,
    self_defence_m: f64,
}

#[derive(Clone, Debug, Default)]
struct BoatFold {
    side: Option<Side>,
    in_view: Option<(Time, f64)>,
    pointed: Option<Time>,
    reported: Option<Time>,
    warned: Option<Time>,
    identified: Vec<(Time, Side)>,
    over: Option<(Ending, Time, f64)>,
    nearest_m: Option<f64>,
    sank: bool,
    burns: bool,
}

/// A round as it was fired.
#[derive(Clone, Debug)]
struct AimedRound {
    fired: Time,
    /// The boat that the gun pointed at.
    boat: Option<String>,
    range_m: f64,
}

#[derive(Clone, Debug)]
struct CallAsked {
    call: Act,
    boat: String,
    asked: Time,
    before_m: Option<f64>,
    within_s: Option<f64>,
    made: Option<(Time, f64)>,
}

#[derive(Clone, Debug)]
struct Fired {
    fired: Time,
    boat: Option<String>,
    zone: Option<Zone>,
    side: Option<Side>,
    is_scored: bool,
}

impl ScoreFold {
    /// Takes in records and events.
    pub fn take(&mut self, shots: &[ShotRecord], events: &[ExerciseEvent]) {
        events.iter().for_each(|event| self.event(event));
        shots.iter().for_each(|shot| self.shot(shot));
    }

    /// Takes in an event.
    pub fn event(&mut self, event: &ExerciseEvent) {
        match event.fact {
            ExerciseFact::Paused => self.clock.pause(event.time),
            ExerciseFact::Resumed => self.clock.resume(event.time),
            _ => None,
        };
        let time = self.clock.of_host(event.time);
        match &event.fact {
            ExerciseFact::Began { hostile, stop, keep_off_m, self_defence_m, .. } => {
                self.begun = Some(time);
                let (keep_off_m, self_defence_m) = (*keep_off_m, *self_defence_m);
                self.goals = Some(GoalsAsked { hostile: *hostile, stop: *stop, keep_off_m, self_defence_m });
            }
            ExerciseFact::Rules { rules } => self.rules.push((time, *rules)),
            ExerciseFact::CallAsked { call, boat, before_m, within_s } => self.calls.push(CallAsked {
                call: *call,
                boat: boat.clone(),
                asked: time,
                before_m: *before_m,
                within_s: *within_s,
                made: None,
            }),
            ExerciseFact::InView { boat, side, range_m } => {
                let boat = self.boat(boat);
                boat.side = Some(*side);
                boat.in_view.get_or_insert((time, *range_m));
            }
            ExerciseFact::Pointed { boat, .. } => drop(self.boat(boat).pointed.get_or_insert(time)),
            ExerciseFact::Did { act, boat, range_m } => self.did(time, *act, boat.as_deref(), *range_m),
            ExerciseFact::Fired { boat, range_m, .. } => {
                self.aims.push(AimedRound {
                    fired: time,
                    boat: boat.clone(),
                    range_m: range_m.unwrap_or(f64::INFINITY),
                });
            }
            ExerciseFact::CameClose { boat } => drop(self.close.insert(boat.clone(), time)),
            ExerciseFact::NoLongerClose { boat } => self.no_longer_close(boat, time),
            ExerciseFact::Stopped { boat, range_m } => {
                self.boat(boat).over = Some((Ending::Stopped, time, *range_m));
            }
            ExerciseFact::TurnedAway { boat, range_m } => {
                self.boat(boat).over = Some((Ending::TurnedAway, time, *range_m));
            }
            ExerciseFact::CameBack { boat } => self.boat(boat).over = None,
            ExerciseFact::Stoppage => self.stoppages += 1,
            ExerciseFact::BarrelHot => self.barrel_hot += 1,
            ExerciseFact::Fragments { boat, side: Side::Neutral, .. } => self.fragments.push(boat.clone()),
            // The round counts for the boat that its record names.
            ExerciseFact::Fragments { .. } => {}
            ExerciseFact::Sank { boat, .. } => self.boat(boat).sank = true,
            ExerciseFact::CaughtFire { boat, .. } => self.boat(boat).burns = true,
            ExerciseFact::Joined { side, is_to_stop, .. } => {
                if let Some(goals) = &mut self.goals {
                    goals.hostile += u32::from(*side == Side::Hostile);
                    goals.stop += u32::from(*is_to_stop);
                }
            }
            ExerciseFact::Message { .. }
            | ExerciseFact::Note { .. }
            | ExerciseFact::StoppageOrdered
            | ExerciseFact::Paused
            | ExerciseFact::Resumed => {}
            ExerciseFact::Missed { why, .. } => {
                self.misses.extend(Some(*why).filter(MissExplanation::was_aimed))
            }
            ExerciseFact::Nearest { boat, side, range_m } => {
                let boat = self.boat(boat);
                (boat.side, boat.nearest_m) = (Some(*side), Some(*range_m));
            }
            ExerciseFact::Ended { rounds_left } => {
                self.ended = Some(time);
                self.rounds_left = Some(*rounds_left);
                let close: Vec<String> = self.close.keys().cloned().collect();
                close.iter().for_each(|boat| self.no_longer_close(boat, time));
            }
        }
    }

    /// Takes in a round.
    pub fn shot(&mut self, shot: &ShotRecord) {
        let fired = self.clock.of_host(shot.fired);
        let (boat, zone, side, is_scored) = match &shot.outcome {
            Outcome::Hit { boat, zone, side, .. } => {
                (Some(boat.clone()), Some(*zone), Some(side.unwrap_or(Side::Hostile)), true)
            }
            Outcome::Miss { boat, .. } => (boat.clone(), None, None, true),
            Outcome::NotScored { .. } => (None, None, None, false),
        };
        self.shots.push(Fired { fired, boat, zone, side, is_scored });
    }

    fn boat(&mut self, name: &str) -> &mut BoatFold {
        self.boats.entry(name.to_owned()).or_default()
    }

    /// Time under threat is that of one boat at a time: two that are close at once count once.
    fn no_longer_close(&mut self, boat: &str, time: Time) {
        let Some(since) = self.close.remove(boat) else { return };
        // The others go on from here.
        let others = self.close.values_mut();
        let mut first = since;
        for other in others {
            first = first.min(*other);
            *other = time.max(*other);
        }
        self.under_threat_s += time.secs_since(first).max(0.0);
    }

    fn did(&mut self, time: Time, act: Act, boat: Option<&str>, range_m: Option<f64>) {
        let Some(name) = boat else { return };
        let calls = self.calls.iter_mut().filter(|call| call.call == act && call.boat == name);
        for call in calls.filter(|call| call.made.is_none()) {
            call.made = Some((time, range_m.unwrap_or(f64::INFINITY)));
        }
        let boat = self.boat(name);
        match act {
            Act::Report => drop(boat.reported.get_or_insert(time)),
            Act::Warn => drop(boat.warned.get_or_insert(time)),
            Act::Identify(side) => boat.identified.push((time, side)),
            Act::Reload | Act::Clear | Act::Safe | Act::Ready | Act::Light | Act::Drive(_) => {}
        }
    }

    /// The score of what was taken in so far.
    pub fn sheet(&self) -> ScoreSheet {
        let (rounds, struck_neutrals) = self.rounds();
        let (calls, breaches) = (self.calls_sheet(), self.breaches());
        let begun = self.begun.or_else(|| self.shots.first().map(|s| s.fired));
        let last = self.ended.or_else(|| self.shots.last().map(|s| s.fired));
        let items = self.goals.map_or_else(Vec::new, |goals| self.items(&goals, &rounds, &calls));
        let points = self.goals.map(|_| {
            let faults = 20.0 * f64::from(struck_neutrals) + 10.0 * breaches.len() as f64;
            let earned = if items.is_empty() { 100.0 } else { items.iter().map(|item| item.points).sum() };
            (earned - faults).clamp(0.0, 100.0)
        });
        ScoreSheet {
            version: SCORE_VERSION,
            points,
            items,
            duration_s: begun.zip(last).map_or(0.0, |(begun, last)| last.secs_since(begun)),
            hostile: self.goals.map_or(0, |goals| goals.hostile),
            stopped: self.ended(Ending::Stopped),
            turned_away: self.ended(Ending::TurnedAway),
            under_threat_s: self.under_threat_s,
            nearest_m: self.hostile().filter_map(|b| b.nearest_m).reduce(f64::min),
            rounds,
            calls,
            breaches,
            boats: self.boats.iter().map(|(name, boat)| self.boat_sheet(name, boat)).collect(),
            misses: self.causes(),
        }
    }

    /// Hostile boats.
    fn hostile(&self) -> impl Iterator<Item = &BoatFold> {
        self.boats.values().filter(|b| b.side == Some(Side::Hostile))
    }

    /// Hostile boats that ended so.
    fn ended(&self, ending: Ending) -> u32 {
        self.hostile().filter(|b| b.over.is_some_and(|over| over.0 == ending)).count() as u32
    }

    /// Points before faults are taken off.
    fn items(&self, goals: &GoalsAsked, rounds: &RoundsSheet, calls: &CallsSheet) -> Vec<PointsItem> {
        const THREAT_S: f64 = 20.0;
        const HIT_SHARE: f64 = 0.2;
        let mut parts: Vec<(&'static str, f64, f64)> = Vec::new();
        if goals.stop > 0 {
            let over = self.hostile().filter_map(|b| b.over);
            let worth = over.map(|(_, _, range_m)| if range_m >= goals.keep_off_m { 1.0 } else { 0.5 });
            let mut worth: Vec<f64> = worth.collect();
            worth.sort_by(|a, b| b.total_cmp(a));
            // The sum of none is -0.
            let met = worth.iter().take(goals.stop as usize).sum::<f64>() + 0.0;
            parts.push(("threats", 50.0, met / f64::from(goals.stop)));
            let share = f64::from(rounds.hits) / f64::from(rounds.fired.max(1));
            parts.push(("gunnery", 15.0, (share / HIT_SHARE).min(1.0)));
        }
        if goals.hostile > 0 {
            parts.push(("range kept", 15.0, (1.0 - self.under_threat_s / THREAT_S).max(0.0)));
        }
        if calls.asked > 0 {
            let made = f64::from(calls.in_time) + 0.5 * f64::from(calls.late) - f64::from(calls.wrong);
            parts.push(("calls", 20.0, (made / f64::from(calls.asked)).max(0.0)));
        }
        let whole: f64 = parts.iter().map(|(_, weight, _)| weight).sum();
        let item = |(item, weight, met): (&'static str, f64, f64)| {
            let of = 100.0 * weight / whole;
            PointsItem { item, of, points: of * met }
        };
        parts.into_iter().map(item).collect()
    }

    /// Rounds, and how many neutral boats were struck.
    fn rounds(&self) -> (RoundsSheet, u32) {
        let mut sheet = RoundsSheet {
            fired: self.shots.len() as u32,
            left: self.rounds_left,
            stoppages: self.stoppages,
            barrel_hot: self.barrel_hot,
            ..RoundsSheet::default()
        };
        let mut neutrals: Vec<&str> = Vec::new();
        let mut before: Option<(Time, Option<&str>)> = None;
        for shot in self.by_time() {
            sheet.not_scored += u32::from(!shot.is_scored);
            let is_hit = shot.zone.is_some() && shot.side == Some(Side::Hostile);
            if let (Some(zone), true) = (shot.zone, is_hit) {
                sheet.hits += 1;
                *sheet.by_part.entry(zone.name()).or_default() += 1;
            }
            let boat = shot.boat.as_deref();
            if let (Some(Side::Neutral), Some(boat)) = (shot.side, boat) {
                sheet.neutral_hits += 1;
                if !neutrals.contains(&boat) {
                    neutrals.push(boat);
                }
            }
            let begins =
                before.is_none_or(|(time, of)| shot.fired.secs_since(time) > BURST_GAP_S || of != boat);
            sheet.bursts += u32::from(begins);
            sheet.first_round_hits += u32::from(begins && is_hit);
            before = Some((shot.fired, boat));
        }
        for boat in &self.fragments {
            sheet.neutral_hits += 1;
            if !neutrals.contains(&boat.as_str()) {
                neutrals.push(boat);
            }
        }
        let stopped = self.ended(Ending::Stopped);
        sheet.per_stop = (stopped > 0).then(|| f64::from(sheet.fired) / f64::from(stopped));
        (sheet, neutrals.len() as u32)
    }

    /// Rounds in the order in which they were fired.
    fn by_time(&self) -> Vec<&Fired> {
        let mut shots: Vec<&Fired> = self.shots.iter().collect();
        shots.sort_by_key(|shot| shot.fired);
        shots
    }

    fn calls_sheet(&self) -> CallsSheet {
        let mut sheet = CallsSheet { asked: self.calls.len() as u32, ..CallsSheet::default() };
        for call in &self.calls {
            match call.made {
                None => sheet.missing += 1,
                Some((time, range_m)) => {
                    let in_time = call.before_m.is_none_or(|m| range_m >= m)
                        && call.within_s.is_none_or(|s| time.secs_since(call.asked) <= s);
                    if in_time { sheet.in_time += 1 } else { sheet.late += 1 }
                }
            }
        }
        let is_wrong = |b: &&BoatFold| {
            let last = b.identified.last();
            last.is_some_and(|(_, called)| b.side.is_some_and(|side| side != *called))
        };
        sheet.wrong = self.boats.values().filter(is_wrong).count() as u32;
        sheet
    }

    fn breaches(&self) -> Vec<Breach> {
        let mut breaches: Vec<Breach> = Vec::new();
        let mut last = Time::MIN;
        for aim in &self.aims {
            let now = self.rules.iter().rev().find(|(since, _)| *since <= aim.fired);
            let Some((_, rules)) = now.filter(|(_, rules)| self.breaks(aim, *rules)) else { continue };
            let at_s = self.begun.map_or(0.0, |begun| aim.fired.secs_since(begun));
            match breaches.last_mut() {
                Some(b) if b.rules == *rules && aim.fired.secs_since(last) <= BURST_GAP_S => b.rounds += 1,
                _ => breaches.push(Breach { at_s, rules: *rules, boat: aim.boat.clone(), rounds: 1 }),
            }
            last = aim.fired;
        }
        breaches
    }

    fn breaks(&self, aim: &AimedRound, rules: Engagement) -> bool {
        let boat = aim.boat.as_ref().and_then(|name| self.boats.get(name));
        let is_near = self.goals.is_some_and(|goals| aim.range_m <= goals.self_defence_m);
        if is_near && boat.is_some_and(|b| b.side == Some(Side::Hostile)) {
            return false;
        }
        let before = |time: Option<Time>| time.is_some_and(|time| time <= aim.fired);
        match (rules, boat) {
            (Engagement::Hold, _) => true,
            (Engagement::Warn, Some(boat)) => !before(boat.warned),
            (Engagement::Tight, Some(boat)) => {
                let called = boat.identified.iter().rev().find(|(time, _)| *time <= aim.fired);
                called.is_none_or(|(_, side)| *side != Side::Hostile)
            }
            // A shot across the bow is none at a boat.
            (Engagement::Warn | Engagement::Tight, None) => false,
            // A neutral that is struck is a fault of its own.
            (Engagement::Free, _) => false,
        }
    }

    fn boat_sheet(&self, name: &str, boat: &BoatFold) -> BoatSheet {
        let since = |time: Option<Time>| Some(time?.secs_since(boat.in_view?.0));
        let hits = self.shots.iter().filter(|s| s.zone.is_some() && s.boat.as_deref() == Some(name)).count();
        BoatSheet {
            name: name.to_owned(),
            side: boat.side.map(Side::name),
            in_view_m: boat.in_view.map(|(_, range_m)| range_m),
            // Who reports what nobody could see yet has not detected it before that.
            detected_s: since(boat.pointed.into_iter().chain(boat.reported).min()).map(|s| s.max(0.0)),
            pointed_s: since(boat.pointed),
            reported_s: since(boat.reported),
            identified_s: since(boat.identified.last().map(|(time, _)| *time)),
            identified_as: boat.identified.last().map(|(_, side)| side.name()),
            warned_s: since(boat.warned),
            hits: hits as u32,
            ending: boat.over.map(|over| over.0),
            ended_m: boat.over.map(|over| over.2),
            nearest_m: boat.nearest_m,
            sank: boat.sank,
            burns: boat.burns,
        }
    }

    fn causes(&self) -> Vec<CauseSheet> {
        let of = |cause: MissCause| {
            let misses = self.misses.iter().filter(|miss| miss.largest() == cause);
            let parts: Vec<[f64; 2]> = misses.map(|miss| miss.parts_mrad[cause as usize]).collect();
            let mean = |axis: usize| parts.iter().map(|p| p[axis]).sum::<f64>() / parts.len().max(1) as f64;
            CauseSheet { cause: cause.name(), rounds: parts.len() as u32, mean_mrad: [mean(0), mean(1)] }
        };
        MissCause::ALL.map(of).into_iter().filter(|cause| cause.rounds > 0).collect()
    }
}

#[cfg(test)]
#[path = "fold_tests.rs"]
mod tests;
