//! The boats of a session: where each is at any time, given what has struck it.

use std::sync::Arc;

use crate::{
    frame::{
        view::{Afloat, Eye},
        wake::Wake,
    },
    geometry::RigidPose,
    model::{Model, ModelId, ModelKind, Zone},
    time::Time,
    world::{
        boats::{Course, Damage, Floating, Hull, HullForm, Ride, facing, float, ride},
        waves::WaveField,
    },
};
use glam::DVec3;

/// One boat.
#[derive(Clone, Debug)]
pub struct Vessel {
    /// Its name in the scenario.
    pub name: String,
    /// Its model.
    pub model: ModelId,
    /// Where it goes.
    pub course: Course,
}

#[derive(Clone, Debug)]
struct Member {
    vessel: Vessel,
    hull: Hull,
    ride: Ride,
    damage: Damage,
}

/// All boats.
#[derive(Clone, Debug)]
pub struct Fleet {
    members: Vec<Member>,
    models: Arc<[Model]>,
    waves: WaveField,
    start: Time,
    followed: Time,
}

impl Fleet {
    /// Boats that begin their courses at `start`. Each vessel's model must be in `models`.
    pub fn new(vessels: Vec<Vessel>, models: Arc<[Model]>, waves: WaveField, start: Time) -> Self {
        let member = |vessel: Vessel| {
            let model = models.get(usize::from(vessel.model.0));
            let hull = model.map_or(Hull { length_m: 1.0, beam_m: 1.0 }, Hull::of);
            let form = model.map_or_else(|| HullForm::new((-0.5, 0.5), 0.3, 1.2, |_| 0.5), HullForm::of);
            Member { vessel, hull, ride: Ride::new(form), damage: Damage::NONE }
        };
        let members = vessels.into_iter().map(member).collect();
        Self { members, models, waves, start, followed: start }
    }

    /// Follows all boats up to `time`. On a flat sea there is nothing to follow.
    pub fn follow(&mut self, time: Time) {
        self.followed = self.followed.max(time);
        if self.waves.is_flat() {
            return;
        }
        let until_s = self.followed.secs_since(self.start);
        for Member { vessel, ride, damage, .. } in &mut self.members {
            ride.follow(until_s, |t| vessel.course.state(t, damage), &self.waves);
        }
    }

    /// The sea is another after `from`.
    pub fn set_waves(&mut self, waves: WaveField, from: Time) {
        self.waves = waves;
        let from_s = from.secs_since(self.start);
        self.members.iter_mut().for_each(|m| m.ride.forget_after(from_s));
        self.follow(self.followed);
    }

    /// How many boats there are.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// A boat's name.
    pub fn name(&self, boat: usize) -> &str {
        self.members.get(boat).map_or("", |m| m.vessel.name.as_str())
    }

    /// A boat's model.
    pub fn model(&self, boat: usize) -> Option<&Model> {
        self.models.get(usize::from(self.members.get(boat)?.vessel.model.0))
    }

    /// Where a boat is at `time`. At times that it was not followed to, or that lie too far back, it lies in the mean plane of the
    /// water.
    pub fn floating(&self, boat: usize, time: Time) -> Option<Floating> {
        let Member { vessel, hull, ride: motions, damage } = self.members.get(boat)?;
        let seconds = time.secs_since(self.start);
        let state = vessel.course.state(seconds, damage);
        Some(match motions.at(seconds) {
            Some(motion) => ride(&state, hull, motions.form(), &motion, &self.waves, seconds),
            None => float(&state, hull, &self.waves, seconds),
        })
    }

    /// What a boat has left on the water at `time`.
    fn wake(&self, boat: usize, time: Time) -> Option<Wake> {
        let member = self.members.get(boat)?;
        let (seconds, model) = (time.secs_since(self.start), self.model(boat)?);
        let Hull { length_m, beam_m } = member.hull;
        Wake::of(
            member.hull,
            f64::from(-model.min.z),
            seconds,
            |t| member.vessel.course.state(t, &member.damage),
            // Waves shorter than the hull go through its wake without lifting it.
            |place| self.waves.plane_under(place, 0.0, length_m, beam_m, seconds).height_m,
        )
    }

    /// A boat's pose as rounds from `muzzle` meet it: pictures turn towards who looks at them.
    pub fn target(&self, boat: usize, time: Time, muzzle: DVec3) -> Option<RigidPose> {
        let pose = self.floating(boat, time)?.pose;
        let quad = self.model(boat)?.kind == ModelKind::Quad;
        Some(if quad { facing(&pose, muzzle) } else { pose })
    }

    /// Takes in that a boat was struck. A hit on the engine stops it, one on the helm ends its attack; the first counts.
    pub fn strike(&mut self, boat: usize, zone: Zone, time: Time) {
        let seconds = time.secs_since(self.start);
        if let Some(member) = self.members.get_mut(boat) {
            let slot = match zone {
                Zone::Engine => &mut member.damage.engine_s,
                Zone::Helm => &mut member.damage.helm_s,
                Zone::Hull => return,
            };
            *slot = Some(slot.map_or(seconds, |first| first.min(seconds)));
            member.ride.forget_after(seconds);
        }
        self.follow(self.followed);
    }

    /// The boats that `eye` sees at `time`, farthest first.
    pub fn seen(&self, eye: &Eye<'_>, time: Time, into: &mut Vec<crate::frame::scene::BoatView>) {
        into.clear();
        for (boat, member) in self.members.iter().enumerate() {
            let (Some(model), Some(floating)) = (self.model(boat), self.floating(boat, time)) else {
                continue;
            };
            let afloat = Afloat {
                boat,
                model_id: member.vessel.model,
                model,
                pose: floating.pose,
                water_level: floating.water_level,
            };
            into.extend(eye.see_with_wake(&afloat, || self.wake(boat, time)));
        }
        into.sort_by(|a, b| b.range_m.total_cmp(&a.range_m));
    }
}
