//! The boats of a session: where each is at any time, given what has struck it.

use std::sync::Arc;

use glam::DVec2;

use crate::{
    geometry::RigidPose,
    model::{Model, ModelId, Zone},
    time::Time,
    world::{
        boats::{Behaviour, BoatHistory, Floating, Hull, HullForm},
        scenario::Side,
        waves::WaveField,
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
}

/// All boats.
#[derive(Clone, Debug)]
pub struct Fleet {
    boats: Vec<FleetBoat>,
    models: Arc<[Model]>,
    waves: WaveField,
    start: Time,
    followed: Time,
}

impl Fleet {
    /// Boats that begin at `start`. Each vessel's model must be in `models`.
    pub fn new(vessels: Vec<Vessel>, models: Arc<[Model]>, waves: WaveField, start: Time) -> Self {
        let boat = |vessel: Vessel| {
            let model = models.get(usize::from(vessel.model.0));
            let hull = model.map_or(Hull { length_m: 1.0, beam_m: 1.0 }, Hull::of);
            let form = model.map_or_else(|| HullForm::new((-0.5, 0.5), 0.3, 1.2, |_| 0.5), HullForm::of);
            let history = BoatHistory::new(vessel.behaviour, hull, form);
            FleetBoat { name: vessel.name, side: vessel.side, model: vessel.model, history }
        };
        let boats = vessels.into_iter().map(boat).collect();
        Self { boats, models, waves, start, followed: start }
    }

    /// Follows all boats up to `time`.
    pub fn follow(&mut self, time: Time) {
        self.followed = self.followed.max(time);
        let until_s = self.followed.secs_since(self.start);
        for boat in &mut self.boats {
            boat.history.follow(until_s, &self.waves);
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

    /// How a boat lies on the water at `time`. At times that it was not followed to, or that lie too far back, it lies in the mean plane
    /// of the water.
    pub fn floating(&self, boat: usize, time: Time) -> Option<Floating> {
        let seconds = time.secs_since(self.start);
        Some(self.boats.get(boat)?.history.floating(seconds, &self.waves))
    }

    /// All boats that have a model, as they lie at `time`.
    pub fn afloat(&self, time: Time) -> impl Iterator<Item = Afloat<'_>> {
        self.boats.iter().enumerate().filter_map(move |(boat, b)| {
            let (model, floating) = (self.model(boat)?, self.floating(boat, time)?);
            let Floating { pose, water_level } = floating;
            Some(Afloat { boat, model_id: b.model, model, pose, water_level })
        })
    }

    /// Where a boat was over the last seconds, by seconds since the scenario began.
    pub fn history(&self, boat: usize) -> Option<&BoatHistory> {
        Some(&self.boats.get(boat)?.history)
    }

    /// Height at `time` of the water about a place, metres, in the mean over a hull that points north: waves that are shorter than it go
    /// through its wake without lifting it.
    pub fn water_over(&self, place: DVec2, hull: Hull, time: Time) -> f64 {
        let Hull { length_m, beam_m } = hull;
        self.waves.plane_under(place, 0.0, length_m, beam_m, time.secs_since(self.start)).height_m
    }

    /// Takes in that a boat was struck. A hit on the engine stops it, one on the helm ends its attack; the first counts.
    pub fn strike(&mut self, boat: usize, zone: Zone, time: Time) {
        let seconds = time.secs_since(self.start);
        if let Some(boat) = self.boats.get_mut(boat) {
            boat.history.strike(zone, seconds);
        }
        self.follow(self.followed);
    }
}
