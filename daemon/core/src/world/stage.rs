//! Stage two as a whole: the trigger's edges and where the barrel points in, boats, rounds and records out.

mod orders;

use std::{collections::VecDeque, sync::Arc};

use glam::DVec3;

use super::{
    clock::ExerciseClock,
    exercise::{ExerciseEvent, ExerciseFact, ExerciseWatch, WatchedBoat, pointed_at},
    flare::Flare,
    fleet::{Fleet, Vessel},
    rounds::{Ammunition, FragmentHit, Launch, Rounds},
    scenario::{Scenario, Side},
    score::{AIM_TREND_S, BoreSample, NotScored, Outcome, ShotRecord},
    sea_change::{SeaChange, conditions_of},
    searchlight::{Beam, LightSwitch, Searchlight, SearchlightSpec},
    seeing::{SceneLight, threshold},
    track::{TrackBlock, TrackSampler},
    waves::WaveField,
    weapon::{Stoppages, Weapon, WeaponState},
};
use crate::{
    act::{Act, DriveOrder, TraineeAct},
    daylight::Daylight,
    estimate::sea::SeaConditions,
    event::{ShipFix, TriggerEdge},
    model::{Model, ModelId, Zone},
    order::JoinPlace,
    time::Time,
};

/// The longest time that a round is followed, seconds, and a second more.
const ROUND_OVER_S: f64 = 21.0;
/// Orders of the person who drives boats come no later than this, seconds.
const DRIVEN_LATE_S: f64 = 0.25;
/// Rounds whose time is kept: those within a picture's exposure.
const FIRED_KEPT: usize = 4;
/// How long a text of the scenario stands, seconds.
const MESSAGE_S: f64 = 6.0;
/// How long a result stands, seconds: it is shown, and a hit is not replaced by a miss.
pub const RESULT_S: f64 = 1.5;

/// Where the barrel pointed as a round left it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoreAim {
    /// The muzzle, world, metres.
    pub muzzle: DVec3,
    /// Direction of the barrel, world, unit vector.
    pub bore: DVec3,
    /// Age of the pose used, nanoseconds; negative where it was interpolated.
    pub pose_age_ns: i64,
    /// Why the round is not scored; `None` where it is.
    pub unscored: Option<NotScored>,
}

/// Rounds of a session so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Score {
    /// Rounds fired.
    pub shots: u64,
    /// Rounds that struck a hostile boat.
    pub hits: u64,
    /// Rounds that struck a neutral one.
    pub neutral_hits: u64,
}

/// The result of the round that counts as the newest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastResult {
    /// When it struck, or was closest.
    pub time: Time,
    /// Whose boat it struck, and where; `None` for a miss.
    pub struck: Option<(Side, Zone)>,
}

/// The virtual world.
#[derive(Debug)]
pub struct World {
    name: String,
    vessels: Vec<Vessel>,
    models: Arc<[Model]>,
    ammunition: Ammunition,
    weapon: Weapon,
    waves: WaveField,
    sea_change: SeaChange,
    running: Option<RunningWorld>,
    clock: ExerciseClock,
    /// Boats of the reserve that are to join with the next call.
    joining: Vec<(String, Option<JoinPlace>)>,
    watch: ExerciseWatch,
    /// What happened in the exercise within the last call.
    events: Vec<ExerciseEvent>,
    /// Pauses that the next call gives as events, times of the host.
    pauses: Vec<ExerciseEvent>,
    /// Tracks of boats and rounds that the last call added.
    tracks: TrackBlock,
    sampler: Option<TrackSampler>,
    /// The scenario's newest text for the trainee, with its time.
    message: Option<(Time, Arc<str>)>,
    score: Score,
    last_result: Option<LastResult>,
    is_hot: bool,
    /// Orders of the person who drives boats that wait for the next call.
    driving: Vec<(Time, DriveOrder)>,
    searchlight: Option<LightSwitch>,
    daylight: Daylight,
    light: SceneLight,
    /// Height of the gunner's eye over the water, metres.
    eye_m: f64,
}

/// Boats and rounds, from the first picture on.
#[derive(Debug)]
pub struct RunningWorld {
    /// When the scenario began.
    pub start: Time,
    /// Up to when boats and rounds were followed.
    pub now: Time,
    /// The boats.
    pub fleet: Fleet,
    /// The rounds.
    pub rounds: Rounds,
    /// When the newest rounds left the barrel, oldest first; a handful at most.
    pub fired: VecDeque<Time>,
}

impl RunningWorld {
    /// Notes whom fragments of rounds struck that ended, and why others missed.
    fn note_ends(&mut self, events: &mut Vec<ExerciseEvent>) {
        let Self { fleet, rounds, .. } = self;
        for FragmentHit { shot, time, boat } in rounds.take_fragments() {
            let Some(side) = fleet.side(boat) else { continue };
            let fact = ExerciseFact::Fragments { shot, boat: fleet.name(boat).to_owned(), side };
            events.push(ExerciseEvent { time, fact });
        }
        for missed in rounds.take_explained() {
            let (shot, boat) = (missed.shot, fleet.name(missed.boat).to_owned());
            let fact = ExerciseFact::Missed { shot, boat, why: missed.why };
            events.push(ExerciseEvent { time: missed.time, fact });
        }
    }

    fn note_fired(&mut self, time: Time) {
        self.fired.push_back(time);
        if self.fired.len() > FIRED_KEPT {
            self.fired.pop_front();
        }
    }

    /// The event that a round was fired.
    fn fired(&self, shot: u64, time: Time, aim: &BoreAim) -> ExerciseEvent {
        let boats = self.watched(Some(aim), None);
        let at = pointed_at(&boats).and_then(|boat| boats.get(boat));
        let (boat, range_m) = (at.map(|b| b.name.to_owned()), at.map(|b| b.range_m));
        ExerciseEvent { time, fact: ExerciseFact::Fired { shot, boat, range_m } }
    }

    /// All boats, for whoever watches the exercise, while the barrel points as `aim` says, if that is known; where an eye at `watcher` looks at them,
    /// with the chances that it sees each.
    fn watched(&self, aim: Option<&BoreAim>, watcher: Option<DVec3>) -> Vec<WatchedBoat<'_>> {
        let aim = aim.filter(|aim| aim.unscored.is_none());
        let Self { fleet, now, .. } = self;
        let eye = aim.map_or(DVec3::ZERO, |aim| aim.muzzle);
        let seen = watcher.map_or_else(Vec::new, |eye| fleet.seen_from(eye, *now));
        let watched = |boat: usize| {
            let at = fleet.middle(boat, *now)?;
            let speed_m_s = fleet.history(boat)?.state(now.secs_since(self.start)).velocity().length();
            Some(WatchedBoat {
                name: fleet.name(boat),
                side: fleet.side(boat)?,
                in_reserve: fleet.in_reserve(boat),
                range_m: at.truncate().distance(eye.truncate()),
                speed_m_s,
                off_bore: aim
                    .filter(|_| fleet.swims(boat, *now))
                    .map(|aim| aim.bore.angle_between(at - aim.muzzle)),
                seen: threshold::chance(seen.get(boat).copied().unwrap_or(0.0)),
                struck: fleet.first_hit(boat).filter(|struck| struck <= now),
                is_lit: fleet.is_lit(boat, *now),
                gave_up: fleet.gave_up(boat),
                sinks: fleet.sinks(boat),
                burns_since: fleet.burns_since(boat),
            })
        };
        (0..fleet.len()).filter_map(watched).collect()
    }
}

/// The barrel over the last moments before a round, oldest first, as far as it was known where it pointed.
fn barrel_before(fired: Time, aim: &mut impl FnMut(Time) -> BoreAim) -> Vec<BoreSample> {
    /// Samples: as many as pictures in that time.
    const SAMPLES: u32 = 21;
    let sample = |i: u32| {
        let before_s = AIM_TREND_S * f64::from(i) / f64::from(SAMPLES);
        let BoreAim { muzzle, bore, unscored, .. } = aim(fired.plus_secs(-before_s));
        unscored.is_none().then_some(BoreSample { before_s, muzzle, bore })
    };
    (1..=SAMPLES).rev().filter_map(sample).collect()
}

impl World {
    /// The world of a scenario before it begins. `boat_models` names the model of each of its boats.
    pub fn new(scenario: &Scenario, models: Arc<[Model]>, boat_models: &[ModelId]) -> Self {
        Self {
            name: scenario.name.clone(),
            vessels: Vessel::of_scenario(scenario, boat_models),
            models,
            ammunition: Ammunition {
                weapon: scenario.weapon.clone(),
                wind: scenario.wind,
                seed: scenario.seed,
            },
            weapon: Self::weapon_of(scenario),
            waves: scenario.wave_field(),
            sea_change: SeaChange::new(&scenario.waves),
            running: None,
            clock: ExerciseClock::default(),
            joining: Vec::new(),
            watch: ExerciseWatch::new(scenario.exercise.clone()),
            events: Vec::new(),
            pauses: Vec::new(),
            tracks: TrackBlock::default(),
            sampler: None,
            message: None,
            score: Score::default(),
            last_result: None,
            is_hot: false,
            driving: Vec::new(),
            searchlight: scenario.searchlight.map(LightSwitch::new),
            daylight: scenario.daylight,
            light: SceneLight::new(&scenario.daylight, scenario.wind.length()),
            eye_m: scenario.eye_height_m,
        }
    }

    fn weapon_of(scenario: &Scenario) -> Weapon {
        let spec = &scenario.weapon;
        // The weapon's chance is not that of the rounds' scatter.
        let stoppages = spec.stoppage_every.map(|every| Stoppages { every, seed: !scenario.seed });
        Weapon::new(spec.rounds_per_minute, spec.belt)
            .with_spares(spec.spare_belts, spec.reload_s)
            .with_stoppages(stoppages)
            .with_heat(spec.heat)
    }

    /// The sea that a scenario assumes until it is measured; `None` where it is not to be measured.
    pub fn sea_assumed(scenario: &Scenario) -> Option<SeaConditions> {
        scenario.sea_from_video.then(|| conditions_of(&scenario.waves))
    }

    /// Takes in an edge of the trigger.
    pub fn trigger(&mut self, edge: TriggerEdge) {
        // Who presses in a pause presses again after it.
        if !edge.pressed || !self.clock.stands_at(edge.time) {
            self.weapon.edge(TriggerEdge { time: self.clock.of_host(edge.time), ..edge });
        }
    }

    /// Takes in place and time that the ship's instruments told.
    pub fn ship_fix(&mut self, fix: &ShipFix) {
        self.light.fix(&ShipFix { arrival: self.clock.of_host(fix.arrival), ..*fix });
    }

    /// Takes in an act of the trainee.
    pub fn act(&mut self, act: TraineeAct) {
        let act = TraineeAct { time: self.clock.of_host(act.time), ..act };
        if let Act::Drive(order) = act.act {
            /// More wait only while no picture has come.
            const WAITING_MAX: usize = 256;
            if self.driving.len() < WAITING_MAX {
                self.driving.push((act.time, order));
            }
            return;
        }
        if let (Act::Light, Some(switch)) = (act.act, &mut self.searchlight) {
            switch.press(act.time);
        }
        self.weapon.act(act);
        self.watch.act(act);
    }

    /// Arms or disarms the weapon.
    pub fn arm(&mut self, armed: bool) {
        self.weapon.arm(armed);
    }

    /// Fires what the trigger asks for up to `known` and follows boats and rounds up to `until`, or as far as they were followed
    /// already. The first call begins the scenario, at `begin`. `aim` tells where the barrel pointed at a time.
    pub fn advance(
        &mut self,
        begin: Time,
        until: Time,
        known: Time,
        mut aim: impl FnMut(Time) -> BoreAim,
        records: &mut Vec<ShotRecord>,
    ) {
        self.events.clear();
        self.tracks.clear();
        self.clock.follow(until);
        let clock = self.clock.clone();
        let [begin, until, known] = [begin, until, known].map(|time| clock.of_host(time));
        self.step(begin, until, known, |time| aim(clock.to_host(time)), records);
        self.give_host_times(records);
    }

    /// Steps the exercise in its own time.
    fn step(
        &mut self,
        begin: Time,
        until: Time,
        known: Time,
        mut aim: impl FnMut(Time) -> BoreAim,
        records: &mut Vec<ShotRecord>,
    ) {
        let mut running = self.running.take().unwrap_or_else(|| self.begin(begin));
        let now = running.now.max(until);
        for (time, order) in self.driving.drain(..) {
            // An order that comes late, or with a time of its own, counts from about now on.
            let time = time.clamp(running.now.plus_secs(-DRIVEN_LATE_S).min(now), now);
            running.fleet.drive(order, time);
        }
        while let Some((time, seeing)) = self.light.next_note(running.start, now) {
            running.fleet.see_by(time, seeing);
        }
        self.have_join(&mut running, now);
        self.shine(&mut running, now, &mut aim);
        let was_stopped = self.weapon.state() == WeaponState::Stoppage;
        while let Some(fired) = self.weapon.fire(known.min(now)) {
            self.score.shots += 1;
            let scatter = self.weapon.scatter();
            self.note_heat(fired, scatter);
            let BoreAim { muzzle, bore, pose_age_ns, unscored } = aim(fired);
            let shot = self.score.shots;
            running.note_fired(fired);
            self.events.push(running.fired(shot, fired, &BoreAim { muzzle, bore, pose_age_ns, unscored }));
            match unscored {
                None => {
                    let launch = Launch { shot, fired, muzzle, bore, pose_age_ns, scatter };
                    running.rounds.launch(launch, barrel_before(fired, &mut aim), running.start, records);
                }
                Some(cause) => {
                    let outcome = Outcome::NotScored { cause };
                    records.push(ShotRecord { shot, fired, muzzle, bore, pose_age_ns, outcome });
                }
            }
        }
        running.rounds.advance(now, running.start, &mut running.fleet, records);
        running.now = now;
        let sampler = self.sampler.get_or_insert(TrackSampler::new(running.start));
        if self.clock.is_paused() {
            // While the camera's pose then is still known.
            sampler.finish(now, &running.fleet, &mut self.tracks.samples);
        } else {
            sampler.sample(now, &running.fleet, &mut self.tracks.samples);
        }
        self.tracks.rounds.extend(running.rounds.take_paths());
        if self.weapon.state() == WeaponState::Stoppage && !was_stopped {
            self.events.push(ExerciseEvent { time: now, fact: ExerciseFact::Stoppage });
        }
        self.watch_exercise(&mut running, aim(now));
        self.running = Some(running);
        self.count(records);
    }

    /// Notes where the searchlight's beam went up to `now`, before boats are followed that far.
    fn shine(&mut self, running: &mut RunningWorld, now: Time, aim: &mut impl FnMut(Time) -> BoreAim) {
        let Some(switch) = &mut self.searchlight else { return };
        while let Some((time, is_on)) = switch.next_note(running.start, now) {
            let aim = is_on.then(|| aim(time)).filter(|aim| aim.unscored.is_none());
            running.fleet.shine(time, aim.map(|aim| Beam { lamp: aim.muzzle, axis: aim.bore }));
        }
    }

    /// The searchlight, while it is on.
    pub fn searchlight(&self) -> Option<&SearchlightSpec> {
        self.searchlight.as_ref().and_then(LightSwitch::shining)
    }

    /// Notes that the barrel has got hot, or has cooled.
    fn note_heat(&mut self, time: Time, scatter: f64) {
        let is_hot = scatter > 1.0;
        if is_hot && !self.is_hot {
            self.events.push(ExerciseEvent { time, fact: ExerciseFact::BarrelHot });
            self.message = Some((time, "BARREL HOT: rounds scatter, cease fire".into()));
        }
        self.is_hot = is_hot;
    }

    /// Notes what has happened up to now.
    fn watch_exercise(&mut self, running: &mut RunningWorld, aim: BoreAim) {
        running.note_ends(&mut self.events);
        self.count_fragments();
        let boats = running.watched(Some(&aim), Some(DVec3::Z * self.eye_m));
        let orders = self.watch.follow(running.now, &boats, self.weapon.rounds_in_all(), &mut self.events);
        for boat in orders.warned {
            running.fleet.warn(boat, running.now);
        }
        if orders.stoppage {
            self.weapon.stop_next();
        }
        let (lit, wind) = (running.now, self.ammunition.wind.truncate());
        for spec in orders.flares {
            running.fleet.light_flare(Flare { spec, lit, wind });
        }
        for event in &self.events {
            if let ExerciseFact::Message { text } = &event.fact {
                self.message = Some((event.time, text.as_str().into()));
            }
        }
    }

    /// What happened in the exercise within the last call that went on or ended.
    pub fn events(&self) -> &[ExerciseEvent] {
        &self.events
    }

    /// Tracks that the last call which went on or ended added. The camera's is the caller's to fill in.
    pub const fn tracks(&self) -> &TrackBlock {
        &self.tracks
    }

    /// The exercise around boats and rounds.
    pub const fn watch(&self) -> &ExerciseWatch {
        &self.watch
    }

    /// The scenario's text for the trainee at `time`, if there is one.
    pub fn message(&self, time: Time) -> Option<Arc<str>> {
        let (since, text) = self.message.as_ref()?;
        (time.secs_since(*since) < MESSAGE_S).then(|| Arc::clone(text))
    }

    /// State of the weapon.
    pub const fn weapon_state(&self) -> WeaponState {
        self.weapon.state()
    }

    fn begin(&self, start: Time) -> RunningWorld {
        let fleet = Fleet::new(self.vessels.clone(), Arc::clone(&self.models), self.waves.clone(), start)
            .with_searchlight(self.searchlight.as_ref().map(|s| Searchlight::new(s.spec, &self.daylight)))
            .with_seeing(self.light.clone().at(start), self.eye_m);
        let rounds = Rounds::new(self.ammunition.clone(), self.waves.clone(), start);
        let fired = VecDeque::with_capacity(FIRED_KEPT + 1);
        RunningWorld { start, now: start, fleet, rounds, fired }
    }

    /// Rounds still in the air are recorded as misses: the session ends here.
    pub fn finish(&mut self, records: &mut Vec<ShotRecord>) {
        self.events.clear();
        self.tracks.clear();
        if let Some(running) = &mut self.running {
            let boats = running.watched(None, None);
            let mut ended = Vec::new();
            self.watch.finish(running.now, &boats, self.weapon.rounds_in_all(), &mut ended);
            let RunningWorld { start, now, fleet, rounds, .. } = running;
            // Boats that are followed further forget where they were.
            if let Some(sampler) = &mut self.sampler {
                sampler.finish(*now, fleet, &mut self.tracks.samples);
            }
            rounds.advance(now.plus_secs(ROUND_OVER_S), *start, fleet, records);
            self.tracks.rounds.extend(rounds.take_paths());
            running.note_ends(&mut self.events);
            self.events.append(&mut ended);
        }
        self.count_fragments();
        self.count(records);
        self.give_host_times(records);
    }

    /// Lets the waves, and with them boats, go over to a sea that was measured. What was followed up to now stays as it was.
    pub fn follow_sea(&mut self, measured: &SeaConditions) {
        let Some(running) = &mut self.running else { return };
        let now_s = running.now.secs_since(running.start);
        if let Some(spec) = self.sea_change.next(measured, now_s) {
            let next = WaveField::new(&spec, self.ammunition.seed);
            self.waves = std::mem::replace(&mut self.waves, WaveField::FLAT).changing_to(next, now_s);
            running.fleet.set_waves(self.waves.clone(), running.now);
            running.rounds.set_sea(self.waves.clone());
        }
    }

    /// Counts neutral boats whose crews fragments struck.
    fn count_fragments(&mut self) {
        let is_neutral = |event: &&ExerciseEvent| {
            matches!(event.fact, ExerciseFact::Fragments { side: Side::Neutral, .. })
        };
        let times: Vec<Time> = self.events.iter().filter(is_neutral).map(|event| event.time).collect();
        for time in times {
            self.score.neutral_hits += 1;
            self.note_result(time, Some((Side::Neutral, Zone::Helm)));
        }
    }

    fn count(&mut self, records: &[ShotRecord]) {
        for record in records {
            let (time, struck) = match &record.outcome {
                Outcome::Hit { time, side, zone, .. } => {
                    (*time, Some((side.unwrap_or(Side::Hostile), *zone)))
                }
                Outcome::Miss { time, .. } => (*time, None),
                Outcome::NotScored { .. } => continue,
            };
            let is_neutral = matches!(struck, Some((Side::Neutral, _)));
            self.score.hits += u64::from(struck.is_some() && !is_neutral);
            self.score.neutral_hits += u64::from(is_neutral);
            self.note_result(time, struck);
        }
    }

    /// Has a result shown, unless one that stands is of more weight.
    fn note_result(&mut self, time: Time, struck: Option<(Side, Zone)>) {
        // Of several results at once a hit is what the sailor wants to see, and one on a neutral what he must.
        let rank =
            |struck: Option<(Side, Zone)>| struck.map_or(0, |(side, _)| 1 + u8::from(side == Side::Neutral));
        let gives_way = |r: LastResult| rank(struck) >= rank(r.struck) || time.secs_since(r.time) > RESULT_S;
        if self.last_result.is_none_or(gives_way) {
            self.last_result = Some(LastResult { time, struck });
        }
    }

    /// Boats and rounds; `None` before the first picture.
    pub const fn running(&self) -> Option<&RunningWorld> {
        self.running.as_ref()
    }

    /// The scenario's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The seed of all its chance.
    pub const fn seed(&self) -> u64 {
        self.ammunition.seed
    }

    /// Rounds left in the belt.
    pub const fn rounds_left(&self) -> u32 {
        self.weapon.rounds_left()
    }

    /// Rounds fired and rounds that struck.
    pub const fn score(&self) -> Score {
        self.score
    }

    /// The result that counts as the newest; `None` before there is one.
    pub const fn last_result(&self) -> Option<LastResult> {
        self.last_result
    }

    /// Seconds from the scenario's begin to `time`; 0 before it.
    pub fn clock_s(&self, time: Time) -> f64 {
        self.running.as_ref().map_or(0.0, |r| time.secs_since(r.start))
    }
}
