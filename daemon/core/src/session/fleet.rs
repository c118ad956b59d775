//! The boats of a session: where each is at any time, given what has struck it.

use std::sync::Arc;

use crate::{
    boats::{Course, Damage, Floating, Hull, facing, float},
    geometry::RigidPose,
    model::{Model, ModelId, ModelKind, Zone},
    sea::WaveField,
    time::Time,
    view::{Afloat, Eye},
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
    damage: Damage,
}

/// All boats.
#[derive(Clone, Debug)]
pub struct Fleet {
    members: Vec<Member>,
    models: Arc<[Model]>,
    waves: WaveField,
    start: Time,
}

impl Fleet {
    /// Boats that begin their courses at `start`. Each vessel's model must be in `models`.
    pub fn new(vessels: Vec<Vessel>, models: Arc<[Model]>, waves: WaveField, start: Time) -> Self {
        let member = |vessel: Vessel| {
            let hull =
                models.get(usize::from(vessel.model.0)).map_or(Hull { length_m: 1.0, beam_m: 1.0 }, Hull::of);
            Member { vessel, hull, damage: Damage::NONE }
        };
        Self { members: vessels.into_iter().map(member).collect(), models, waves, start }
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

    /// Where a boat is at `time`.
    pub fn floating(&self, boat: usize, time: Time) -> Option<Floating> {
        let member = self.members.get(boat)?;
        let seconds = time.secs_since(self.start);
        Some(float(&member.vessel.course.state(seconds, &member.damage), &member.hull, &self.waves, seconds))
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
        }
    }

    /// The boats that `eye` sees at `time`, farthest first.
    pub fn seen(&self, eye: &Eye<'_>, time: Time, into: &mut Vec<crate::scene::BoatView>) {
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
            into.extend(eye.see(&afloat));
        }
        into.sort_by(|a, b| b.range_m.total_cmp(&a.range_m));
    }
}
