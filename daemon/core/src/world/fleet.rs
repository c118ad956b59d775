//! The boats of a session: where each is at any time, given what has struck it.

mod sight;

use std::sync::Arc;

use glam::{DVec2, DVec3};

use crate::{
    act::DriveOrder,
    geometry::RigidPose,
    model::{Model, ModelId},
    order::JoinPlace,
    time::Time,
    world::{
        boats::{
            Behaviour, BoatHistory, Floating, Hull, HullForm, LightsKept, LightsRigged, NavigationLight,
            Orders, RoundStrike, Signals, StepView, Traffic, step_after, step_seconds,
        },
        contact::Capsule,
        exercise::is_called,
        flare::Flare,
        scenario::{BoatSpec, Scenario, Side, place},
        searchlight::{Beam, Searchlight},
        seeing::{SceneLight, Seeing, SeeingLog},
        waves::{WaterLevel, WaveField},
    },
};

/// A boat as a scenario asks for it.
#[derive(Clone, Debug)]
pub struct Vessel {
    /// Its name in the scenario.
    pub name: String,
    /// Whom it belongs to.
    pub side: Side,
    /// Its model.
    pub model: ModelId,
    /// Its behaviour.
    pub behaviour: Behaviour,
    /// The lights that it shows by night.
    pub lights: LightsKept,
    /// When it is on fire by itself, seconds after the beginning; `None` for one that only rounds set on fire.
    pub burns_at_s: Option<f64>,
    /// It waits until it is to join.
    pub in_reserve: bool,
}

impl Vessel {
    /// The boats of a scenario. `boat_models` names the model of each.
    pub fn of_scenario(scenario: &Scenario, boat_models: &[ModelId]) -> Vec<Self> {
        let vessel = |(boat, model): (&BoatSpec, &ModelId)| Self {
            name: boat.name.clone(),
            side: boat.side,
            model: *model,
            behaviour: boat.behaviour.clone().in_session(scenario.seed),
            lights: boat.lights,
            burns_at_s: boat.burns_at_s,
            in_reserve: boat.in_reserve,
        };
        scenario.boats.iter().zip(boat_models).map(vessel).collect()
    }
}

/// A boat on the water at one time.
#[derive(Clone, Copy, Debug)]
pub struct Afloat<'a> {
    /// Index in the scenario.
    pub boat: usize,
    /// Index of the model.
    pub model_id: ModelId,
    /// The model.
    pub model: &'a Model,
    /// Pose on a flat Earth.
    pub pose: RigidPose,
    /// Mean water height at the boat on a flat Earth, metres.
    pub water_level: f64,
}

#[derive(Clone, Debug)]
struct FleetBoat {
    name: String,
    side: Side,
    model: ModelId,
    history: BoatHistory,
    lights: LightsKept,
    burns_at_s: Option<f64>,
    /// Lights on its model, where it shows any.
    rigged: Option<LightsRigged>,
    /// Seconds since the start at which it was warned.
    warned_s: Option<f64>,
    /// Its behaviour once it joins; `None` for a boat that is there.
    waiting: Option<Behaviour>,
}

impl FleetBoat {
    fn is_here(&self) -> bool {
        self.waiting.is_none()
    }

    fn traffic(&self, time_s: f64) -> Traffic {
        let state = self.history.state(time_s);
        let radius_m = 0.5 * self.history.hull().length_m;
        Traffic { position: state.position, velocity: state.velocity(), heading: state.heading, radius_m }
    }

    fn capsule(&self, time_s: f64) -> Capsule {
        Capsule::of(self.history.hull(), &self.history.state(time_s))
    }
}

/// A boat of one's own side this close is a neighbour, metres.
const NEIGHBOUR_M: f64 = 300.0;
/// The own ship as other vessels keep clear of her: the gun stands within so many metres of her side.
const OWN_SHIP: Traffic =
    Traffic { position: DVec2::ZERO, velocity: DVec2::ZERO, heading: 0.0, radius_m: OWN_RADIUS_M };
/// A boat that has sunk is in nobody's way.
const NOWHERE: Traffic =
    Traffic { position: DVec2::splat(1e7), velocity: DVec2::ZERO, heading: 0.0, radius_m: 0.0 };
/// Her hull, as far as boats are held off it.
const OWN_HULL: Capsule = Capsule::round(OWN_RADIUS_M);
/// Radius about the gun that the own ship takes up, metres.
const OWN_RADIUS_M: f64 = 12.0;

/// Tests whether a large vessel hides the gun from something at `at`.
fn hides(vessel: &Traffic, at: DVec2) -> bool {
    /// Shorter vessels are looked over.
    const LOW_M: f64 = 8.0;
    let range2 = at.length_squared();
    if vessel.radius_m < LOW_M || vessel.position == DVec2::ZERO || range2 < 1.0 {
        return false;
    }
    let along = vessel.position.dot(at) / range2;
    let off = (vessel.position - at * along).length();
    (0.0..1.0).contains(&along) && off < 0.6 * vessel.radius_m
}

/// Tests whether a large vessel of the `traffic` hides the gun from a boat at `at`, which is one of them.
fn is_hidden(boat: usize, at: DVec2, traffic: impl Iterator<Item = Traffic>) -> bool {
    traffic.enumerate().any(|(other, vessel)| other != boat && hides(&vessel, at))
}

/// All boats.
#[derive(Clone, Debug)]
pub struct Fleet {
    boats: Vec<FleetBoat>,
    models: Arc<[Model]>,
    waves: WaveField,
    start: Time,
    followed: Time,
    /// Boats that were struck, with the seconds since the start.
    struck: Vec<(usize, f64)>,
    /// Orders of the person who drives boats, each from those seconds on.
    driven: Vec<(f64, Orders)>,
    searchlight: Option<Searchlight>,
    flares: Vec<Flare>,
    seeing: SeeingLog,
    /// Height of the gun over the water, metres.
    gun_m: f64,
    /// Share of light that each model throws back.
    reflectances: Vec<f64>,
}

impl Fleet {
    /// Boats that begin at `start`. Each vessel's model must be in `models`.
    pub fn new(vessels: Vec<Vessel>, models: Arc<[Model]>, waves: WaveField, start: Time) -> Self {
        let boat = |vessel: Vessel| {
            let Vessel { name, side, model: id, behaviour, lights, burns_at_s, in_reserve } = vessel;
            let model = models.get(usize::from(id.0));
            let hull = model.map_or(Hull { length_m: 1.0, beam_m: 1.0 }, Hull::of);
            let form = model.map_or_else(|| HullForm::new((-0.5, 0.5), 0.3, 1.2, |_| 0.5), HullForm::of);
            let waiting = in_reserve.then(|| behaviour.clone());
            let history = BoatHistory::new(behaviour, hull, form);
            let rigged = model.filter(|_| lights != LightsKept::None).map(LightsRigged::on);
            FleetBoat { name, side, model: id, history, lights, burns_at_s, rigged, warned_s: None, waiting }
        };
        let boats = vessels.into_iter().map(boat).collect();
        let (struck, driven) = (Vec::new(), Vec::new());
        let reflectances = models.iter().map(Model::reflectance).collect();
        Self {
            boats,
            models,
            waves,
            start,
            followed: start,
            struck,
            driven,
            searchlight: None,
            flares: Vec::new(),
            seeing: SeeingLog::steady(Seeing::clear_day()),
            gun_m: Self::GUN_M,
            reflectances,
        }
    }

    /// Height of a gun where no scenario gives one, metres.
    const GUN_M: f64 = 8.0;

    /// The same in that light and air, about a gun so high over the water, metres.
    pub fn with_seeing(self, seeing: Seeing, gun_m: f64) -> Self {
        Self { seeing: SeeingLog::steady(seeing), gun_m, ..self }
    }

    /// Light and air are these from `time` on. Boats have not been followed that far.
    pub fn see_by(&mut self, time: Time, seeing: Seeing) {
        self.seeing.note(time.secs_since(self.start), seeing);
    }

    /// The same where the gun has a searchlight.
    pub fn with_searchlight(self, searchlight: Option<Searchlight>) -> Self {
        Self { searchlight, ..self }
    }

    /// A flare is lit, by which crews see and are seen.
    pub fn light_flare(&mut self, flare: Flare) {
        self.flares.push(flare);
        self.forget_crews_after(flare.lit.secs_since(self.start));
    }

    /// Flares that were lit, oldest first.
    pub fn flares(&self) -> &[Flare] {
        &self.flares
    }

    /// The searchlight's beam is this from `time` on. Boats have not been followed that far.
    pub fn shine(&mut self, time: Time, beam: Option<Beam>) {
        if let Some(searchlight) = &mut self.searchlight {
            searchlight.shine(time.secs_since(self.start), beam);
        }
    }

    /// The boats of a scenario. `boat_models` names the model of each.
    pub fn of_scenario(
        scenario: &Scenario,
        models: Arc<[Model]>,
        boat_models: &[ModelId],
        start: Time,
    ) -> Self {
        let seeing = SceneLight::new(&scenario.daylight, scenario.wind.length()).at(start);
        Self::new(Vessel::of_scenario(scenario, boat_models), models, scenario.wave_field(), start)
            .with_seeing(seeing, scenario.eye_height_m)
    }

    /// Follows all boats up to `time`.
    pub fn follow(&mut self, time: Time) {
        self.followed = self.followed.max(time);
        let until_s = self.followed.secs_since(self.start);
        // A scripted boat knows nothing of others and can go ahead.
        for boat in self.boats.iter_mut().filter(|b| b.is_here() && !b.history.is_crewed()) {
            boat.history.follow(until_s, &self.waves);
        }
        self.step_crews(until_s);
        for boat in self.boats.iter_mut().filter(|b| b.is_here() && b.history.is_crewed()) {
            boat.history.follow(until_s, &self.waves);
        }
    }

    /// A boat of the reserve joins at `time`, or all of the group of that name; at that place instead of the scenario's where one is given. Boats have
    /// not been followed that far. Gives those that joined.
    pub fn join(&mut self, name: &str, at: Option<JoinPlace>, time: Time) -> Vec<usize> {
        let seconds = time.secs_since(self.start);
        let is_meant = |b: &FleetBoat| b.waiting.is_some() && is_called(&b.name, name);
        let joining: Vec<usize> = (0..self.boats.len()).filter(|i| is_meant(&self.boats[*i])).collect();
        let starts = joining.iter().filter_map(|i| self.boats[*i].waiting.as_ref());
        let middle = starts.map(|b| b.begin().position).sum::<DVec2>() / joining.len().max(1) as f64;
        for i in &joining {
            let boat = &mut self.boats[*i];
            let Some(behaviour) = boat.waiting.take() else { continue };
            let to = at.map_or(middle, |at| place(at.bearing_deg.to_radians(), at.range_m));
            boat.history.restart(behaviour.moved(middle, to).begun_at(seconds));
            boat.burns_at_s = boat.burns_at_s.map(|after_s| after_s + seconds);
        }
        joining
    }

    /// Why a boat, or a group, of that name cannot join, or not elsewhere than the scenario says; `None` where it can.
    pub fn refuses(&self, name: &str, is_elsewhere: bool) -> Option<String> {
        let known = |b: &&FleetBoat| is_called(&b.name, name);
        let mut waiting = self.boats.iter().filter(known).filter_map(|b| b.waiting.as_ref()).peekable();
        if waiting.peek().is_none() {
            let why = if self.boats.iter().any(|b| known(&b)) {
                "is on the water already"
            } else {
                "is no boat of this scenario's reserve"
            };
            return Some(format!("{name} {why}: choose one that waits"));
        }
        let is_fixed = |behaviour: &Behaviour| matches!(behaviour, Behaviour::ScriptedCourse(_));
        (is_elsewhere && waiting.any(is_fixed))
            .then(|| format!("{name} goes a fixed course: have it join without another place"))
    }

    /// Tests whether a boat waits in reserve.
    pub fn in_reserve(&self, boat: usize) -> bool {
        self.boats.get(boat).is_some_and(|b| !b.is_here())
    }

    /// Steps all crewed boats together, so that each sees the others as they are.
    fn step_crews(&mut self, until_s: f64) {
        let last = step_after(until_s);
        let newest = |b: &FleetBoat| (b.is_here() && b.history.is_crewed()).then(|| b.history.newest());
        let Some(first) = self.boats.iter().filter_map(newest).min() else { return };
        let mut traffic = Vec::with_capacity(self.boats.len() + 1);
        for number in first..last {
            let time_s = step_seconds(number);
            traffic.clear();
            traffic.extend(self.traffic(time_s));
            let driven = self.driven_at(time_s);
            for i in 0..self.boats.len() {
                let history = &self.boats[i].history;
                // One that joined just now begins at a later step than others go on from.
                if !self.boats[i].is_here() || !history.is_crewed() || history.newest() != number {
                    continue;
                }
                // The boat's own place among the others is taken by the own ship.
                let me = std::mem::replace(&mut traffic[i], OWN_SHIP);
                let boat = &self.boats[i];
                let signals = boat.history.decides().then(|| self.signals(i, &me, time_s, &traffic));
                let view =
                    StepView { others: &traffic, own_ship: OWN_SHIP, signals, waves: &self.waves, driven };
                self.boats[i].history.step(&view);
                traffic[i] = me;
            }
            self.keep_apart(step_seconds(number + 1));
        }
    }

    /// All boats as others see them.
    fn traffic(&self, time_s: f64) -> impl Iterator<Item = Traffic> + '_ {
        let boats = self.boats.iter().enumerate();
        boats.map(move |(i, b)| if self.swims_at(i, time_s) { b.traffic(time_s) } else { NOWHERE })
    }

    /// Orders at a time of the person who drives boats.
    fn driven_at(&self, time_s: f64) -> Orders {
        let last = self.driven.iter().rev().find(|(since, _)| *since <= time_s);
        last.map_or_else(Orders::default, |(_, orders)| *orders)
    }

    /// Takes in an order of that person.
    pub fn drive(&mut self, order: DriveOrder, time: Time) {
        const THROTTLE_NOTCH: f64 = 0.25;
        const HELM_NOTCH: f64 = 1.0 / 3.0;
        let time_s = time.secs_since(self.start).max(self.driven.last().map_or(0.0, |last| last.0));
        let was = self.driven_at(time_s);
        let throttle = |by: f64| Orders { throttle: (was.throttle + by).clamp(-1.0, 1.0), ..was };
        let helm = |by: f64| Orders { helm: (was.helm + by).clamp(-1.0, 1.0), ..was };
        let orders = match order {
            DriveOrder::Ahead => throttle(THROTTLE_NOTCH),
            DriveOrder::Astern => throttle(-THROTTLE_NOTCH),
            DriveOrder::Port => helm(-HELM_NOTCH),
            DriveOrder::Starboard => helm(HELM_NOTCH),
            DriveOrder::Midships => Orders { helm: 0.0, ..was },
        };
        // Steps look no further back than frames do.
        const KEPT: usize = 64;
        if self.driven.len() == KEPT {
            self.driven.remove(0);
        }
        self.driven.push((time_s, orders));
        self.forget_crews_after(time_s);
    }

    /// All crews are stepped together, so all go on from `time_s`.
    fn forget_crews_after(&mut self, time_s: f64) {
        for boat in self.boats.iter_mut().filter(|b| b.history.is_crewed()) {
            boat.history.forget_after(time_s);
        }
        self.follow(self.followed);
    }

    /// Events that have befallen a boat which is at `at`.
    fn signals(&self, boat: usize, at: &Traffic, time_s: f64, traffic: &[Traffic]) -> Signals {
        let Some(me) = self.boats.get(boat) else { return Signals::default() };
        let at = at.position;
        let near = |&(other, since_s): &(usize, f64)| {
            let alike = self.boats.get(other).is_some_and(|b| b.side == me.side);
            let close = traffic.get(other).is_some_and(|t| t.position.distance(at) < NEIGHBOUR_M);
            other != boat && since_s <= time_s && alike && close
        };
        let hidden = is_hidden(boat, at, traffic.iter().copied());
        Signals {
            warned: me.warned_s.is_some_and(|s| s <= time_s),
            hit: me.history.first_hit_s().is_some_and(|s| s <= time_s),
            neighbour_hit: self.struck.iter().any(near),
            lit: (!hidden && self.is_in_beam(boat, at, time_s)) || self.is_under_flare(boat, at, time_s),
            sees_gun: !hidden && self.sees_gun(boat, at, time_s),
        }
    }

    /// Tests whether the searchlight is on a boat.
    pub fn is_lit(&self, boat: usize, time: Time) -> bool {
        let time_s = time.secs_since(self.start);
        let Some(at) = self.boats.get(boat).map(|me| me.traffic(time_s).position) else { return false };
        self.is_in_beam(boat, at, time_s) && !is_hidden(boat, at, self.traffic(time_s))
    }

    /// Tests whether the searchlight would light the crew of a boat at `at`, if nothing is before it.
    fn is_in_beam(&self, boat: usize, at: DVec2, time_s: f64) -> bool {
        let crew = || at.extend(0.5 * self.height_m(boat));
        self.searchlight.as_ref().is_some_and(|light| light.lights(crew(), time_s))
    }

    /// No crewed boat passes through another vessel: where hulls would touch, it is held off.
    fn keep_apart(&mut self, time_s: f64) {
        let afloat = |(i, b): (usize, &FleetBoat)| self.swims_at(i, time_s).then(|| b.capsule(time_s));
        let hulls: Vec<Option<Capsule>> = self.boats.iter().enumerate().map(afloat).collect();
        for i in 0..self.boats.len() {
            let Some(hull) = hulls[i].filter(|_| self.boats[i].history.is_crewed()) else { continue };
            for (j, other) in hulls.iter().enumerate().filter(|(j, _)| *j != i) {
                let shared = self.boats[j].history.is_crewed();
                if let Some(touch) = other.and_then(|other| hull.touches(&other)) {
                    let part = if shared { 0.5 } else { 1.0 };
                    self.boats[i].history.push(touch.push * part, touch.stop * part);
                }
            }
            if let Some(touch) = hull.touches(&OWN_HULL) {
                self.boats[i].history.push(touch.push, touch.stop);
            }
        }
    }

    /// The sea is another after `from`.
    pub fn set_waves(&mut self, waves: WaveField, from: Time) {
        self.waves = waves;
        let from_s = from.secs_since(self.start);
        self.boats.iter_mut().for_each(|b| b.history.forget_waves_after(from_s));
        self.follow(self.followed);
    }

    /// How many boats there are.
    pub fn len(&self) -> usize {
        self.boats.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.boats.is_empty()
    }

    /// A boat's name.
    pub fn name(&self, boat: usize) -> &str {
        self.boats.get(boat).map_or("", |b| b.name.as_str())
    }

    /// Whom a boat belongs to.
    pub fn side(&self, boat: usize) -> Option<Side> {
        self.boats.get(boat).map(|b| b.side)
    }

    /// A boat's model.
    pub fn model(&self, boat: usize) -> Option<&Model> {
        self.models.get(usize::from(self.boats.get(boat)?.model.0))
    }

    /// Middle of a boat's visible part at `time`, world, metres.
    pub fn middle(&self, boat: usize, time: Time) -> Option<DVec3> {
        Some(self.pose(boat, time)?.to_world(DVec3::Z * (0.5 * self.height_m(boat))))
    }

    /// Height that a boat shows over the water, metres.
    pub fn height_m(&self, boat: usize) -> f64 {
        self.model(boat).map_or(0.0, |model| f64::from(model.max.z).max(0.0))
    }

    /// When a boat was first struck.
    pub fn first_hit(&self, boat: usize) -> Option<Time> {
        let seconds = self.boats.get(boat)?.history.first_hit_s()?;
        Some(self.start.plus_secs(seconds))
    }

    /// A boat's crew has given up.
    pub fn gave_up(&self, boat: usize) -> bool {
        self.boats.get(boat).is_some_and(|b| b.history.gave_up())
    }

    /// Takes in that a boat was warned.
    pub fn warn(&mut self, boat: usize, time: Time) {
        let seconds = time.secs_since(self.start);
        if let Some(warned) = self.boats.get_mut(boat) {
            warned.warned_s.get_or_insert(seconds);
        }
        self.forget_crews_after(seconds);
    }

    /// Pose of a boat at `time`, as [`Self::floating`] has it, in half the time.
    pub fn pose(&self, boat: usize, time: Time) -> Option<RigidPose> {
        let seconds = time.secs_since(self.start);
        Some(self.boats.get(boat)?.history.pose(seconds, &self.waves))
    }

    /// How a boat lies on the water at `time`. At times that it was not followed to, or that lie too far back, it lies in the mean plane
    /// of the water.
    pub fn floating(&self, boat: usize, time: Time) -> Option<Floating> {
        let seconds = time.secs_since(self.start);
        Some(self.boats.get(boat)?.history.floating(seconds, &self.waves))
    }

    /// All boats that have a model and have not sunk, as they lie at `time`.
    pub fn afloat(&self, time: Time) -> impl Iterator<Item = Afloat<'_>> {
        let swims = move |&(boat, _): &(usize, &FleetBoat)| self.swims(boat, time);
        self.boats.iter().enumerate().filter(swims).filter_map(move |(boat, b)| {
            let (model, floating) = (self.model(boat)?, self.floating(boat, time)?);
            let Floating { pose, water_level } = floating;
            Some(Afloat { boat, model_id: b.model, model, pose, water_level })
        })
    }

    /// Where a boat was over the last seconds, by seconds since the scenario began.
    pub fn history(&self, boat: usize) -> Option<&BoatHistory> {
        Some(&self.boats.get(boat)?.history)
    }

    /// Height at `time` of the water about places, metres, in the mean over a hull that points north: waves that are shorter than it go
    /// through its wake without lifting it.
    pub fn water_over(&self, hull: Hull, time: Time) -> WaterLevel {
        self.waves.level_over(hull.length_m, hull.beam_m, time.secs_since(self.start))
    }

    /// The lights that a boat shows by night as it goes at `time`.
    pub fn lights(&self, boat: usize, time: Time) -> &[NavigationLight] {
        /// Fishing vessels that are slower through the water lie still.
        const LIES_M_S: f64 = 0.25;
        let Some((boat, rigged)) = self.boats.get(boat).and_then(|b| Some((b, b.rigged.as_ref()?))) else {
            return &[];
        };
        let conduct = match boat.lights {
            LightsKept::None => return &[],
            LightsKept::ByConduct => boat.history.conduct(),
            LightsKept::Always(conduct) => conduct,
        };
        let speed = boat.history.state(time.secs_since(self.start)).velocity().length();
        rigged.shown(conduct, speed > LIES_M_S)
    }

    /// The name of the state that a boat's crew is in at the newest step; `None` for boats without one.
    pub fn crew_state(&self, boat: usize) -> Option<&str> {
        self.boats.get(boat)?.history.crew_state()
    }

    /// When a boat is full of water and sinks, if it does with the holes that it has.
    pub fn sinks(&self, boat: usize) -> Option<Time> {
        Some(self.start.plus_secs(self.boats.get(boat)?.history.sinks_s()?))
    }

    /// Since when a boat burns.
    pub fn burns_since(&self, boat: usize) -> Option<Time> {
        let boat = self.boats.get(boat)?;
        let since_s = boat.history.fire_s().into_iter().chain(boat.burns_at_s).reduce(f64::min)?;
        Some(self.start.plus_secs(since_s))
    }

    /// Tests whether a boat is there at `time` and shows anything over the water: it has not sunk.
    pub fn swims(&self, boat: usize, time: Time) -> bool {
        self.swims_at(boat, time.secs_since(self.start))
    }

    /// The same at a time in seconds since the start.
    pub fn swims_at(&self, boat: usize, time_s: f64) -> bool {
        /// Waves and the end that goes down last.
        const SLACK_M: f64 = 2.0;
        let here = self.boats.get(boat).filter(|b| b.is_here() && b.history.begins_s() <= time_s);
        let settled_m = here.map(|b| b.history.settled_m(time_s));
        settled_m.is_some_and(|settled_m| settled_m <= self.height_m(boat) + SLACK_M)
    }

    /// Takes in that a boat was struck. A hit on the engine stops it, one on the helm ends its attack; the first counts.
    pub fn strike(&mut self, boat: usize, strike: &RoundStrike, time: Time) {
        let seconds = time.secs_since(self.start);
        if let Some(struck) = self.boats.get_mut(boat) {
            struck.history.strike(strike, seconds);
            self.struck.push((boat, seconds));
        }
        // What crews see of it, they see from then on.
        self.forget_crews_after(seconds);
    }
}

#[cfg(test)]
#[path = "fleet_tests.rs"]
mod tests;
