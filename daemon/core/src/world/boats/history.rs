//! Where one boat was over the last seconds: states on a fixed grid, each made from the one before.

use glam::DVec2;

use super::{
    behaviour::Behaviour,
    course::{BoatDamage, Course, CourseState, RoundStrike},
    crewed::{CrewedBoat, StepView},
    floating::{Floating, WayAttitude, in_mean_plane, pose_in_waves},
    flooding::Flooding,
    grid::{GridHistory, Lookup, STEP_S, seconds, step_after},
    hull::{Hull, HullForm},
    lights::Conduct,
    seakeeping::{GAP, SeakeepingState},
};
use crate::{geometry::RigidPose, world::waves::WaveField};

/// Seconds of a boat's past that can be asked for: the foam of its wake (15 s), as it lies behind a picture that is as old as
/// orientations are kept (2 s), and a second more.
pub const HISTORY_S: f64 = 18.0;
/// States kept.
const KEPT: usize = (HISTORY_S / STEP_S) as usize;

/// What moves a boat.
#[derive(Clone, Debug)]
enum Pilot {
    Scripted(Course),
    Crewed(Box<CrewedBoat>),
}

/// One boat: what it does, what has struck it, and where it was.
#[derive(Clone, Debug)]
pub struct BoatHistory {
    pilot: Pilot,
    damage: BoatDamage,
    flooding: Flooding,
    hull: Hull,
    states: GridHistory<CourseState>,
    seakeeping: SeakeepingState,
    /// Step at which it begins: 0 but for a boat of the reserve.
    begins: i64,
}

impl BoatHistory {
    /// A boat as it begins: with the scenario, or later where its behaviour is [`Behaviour::begun_at`].
    pub fn new(behaviour: Behaviour, hull: Hull, form: HullForm) -> Self {
        let mut states = GridHistory::new(KEPT);
        let begins = step_after(behaviour.begins_s());
        states.restart(begins, behaviour.begin());
        let pilot = match behaviour {
            Behaviour::ScriptedCourse(course) => Pilot::Scripted(course),
            Behaviour::Crewed(start) => Pilot::Crewed(Box::new(CrewedBoat::new(start, &form))),
        };
        let (damage, flooding) = (BoatDamage::NONE, Flooding::default());
        let seakeeping = SeakeepingState::new(form).begun_at(begins);
        Self { pilot, damage, flooding, hull, states, seakeeping, begins }
    }

    /// The same boat, as nothing had happened to it, with that behaviour.
    pub fn restart(&mut self, behaviour: Behaviour) {
        *self = Self::new(behaviour, self.hull, self.seakeeping.form().clone());
    }

    /// The hull's size at the waterline.
    pub const fn hull(&self) -> Hull {
        self.hull
    }

    /// Whether a crew drives it, so that it has to be stepped beside all others.
    pub const fn is_crewed(&self) -> bool {
        matches!(self.pilot, Pilot::Crewed(_))
    }

    /// Steps a scripted boat up to `until_s`, seconds since the scenario began, and lets waves move any boat up to there. Does nothing for
    /// what is already stepped. A stretch of more than 10 s is not stepped through.
    pub fn follow(&mut self, until_s: f64, waves: &WaveField) {
        if let Pilot::Scripted(course) = &self.pilot {
            let last = step_after(until_s);
            if self.states.newest().is_none_or(|newest| last.saturating_sub(newest) > GAP) {
                let begins = self.begins;
                let is_young = last.saturating_sub(begins) <= GAP;
                let first = if is_young { begins } else { last.saturating_sub(KEPT as i64 - 1).max(begins) };
                self.states.restart(first, course.state(seconds(first), &self.damage));
            }
            while let Some(newest) = self.states.newest()
                && newest < last
            {
                self.states.push(course.state(seconds(newest + 1), &self.damage));
            }
        }
        if !waves.is_flat() {
            let states = &self.states;
            // Motion in waves begins as of a boat that lies where the scenario begins.
            self.seakeeping.follow(until_s, |time_s| state_in(states, time_s.max(0.0)), waves);
        }
    }

    /// When it begins, seconds since the scenario began; the past of one that is there from the start is known before.
    pub(crate) fn begins_s(&self) -> f64 {
        if self.begins > 0 { seconds(self.begins) } else { f64::NEG_INFINITY }
    }

    /// Step of the newest state.
    pub(crate) fn newest(&self) -> i64 {
        self.states.newest().unwrap_or(0)
    }

    /// Whether a crew decides at the newest step.
    pub(crate) fn decides(&self) -> bool {
        match &self.pilot {
            Pilot::Crewed(boat) => boat.decides(self.newest()),
            Pilot::Scripted(_) => false,
        }
    }

    /// A crewed boat goes on by a step; the others are as `view` has them.
    pub(crate) fn step(&mut self, view: &StepView<'_>) {
        let number = self.newest();
        if let Pilot::Crewed(boat) = &mut self.pilot {
            self.states.push(boat.step(number, &self.damage, view));
        }
    }

    /// Conduct at the newest step by the rules of the road: one that never moves lies at anchor.
    pub fn conduct(&self) -> Conduct {
        match &self.pilot {
            Pilot::Crewed(boat) => boat.conduct(),
            Pilot::Scripted(course) if course.speed_max_m_s() > 0.0 => Conduct::UnderWay,
            Pilot::Scripted(_) => Conduct::Anchored,
        }
    }

    /// Whether its crew has given up.
    pub fn gave_up(&self) -> bool {
        match &self.pilot {
            Pilot::Crewed(boat) => boat.gave_up(),
            Pilot::Scripted(_) => false,
        }
    }

    /// The name of the state that its crew is in at the newest step.
    pub fn crew_state(&self) -> Option<&str> {
        match &self.pilot {
            Pilot::Crewed(boat) => Some(boat.state_name()),
            Pilot::Scripted(_) => None,
        }
    }

    /// Moves a crewed boat off another, see [`CrewedBoat::push`].
    pub(crate) fn push(&mut self, off: DVec2, stop: DVec2) {
        if let (Pilot::Crewed(boat), Some(last)) = (&mut self.pilot, self.states.last_mut()) {
            boat.push(off, stop);
            *last = boat.course().unwrap_or(*last);
        }
    }

    /// When it was first struck, seconds since the scenario began.
    pub fn first_hit_s(&self) -> Option<f64> {
        self.damage.first_s
    }

    /// Where the boat is or was at a time. Before the oldest state that is kept, and so before the scenario began, it came straight on;
    /// after the newest it goes on as it does there.
    pub fn state(&self, time_s: f64) -> CourseState {
        state_in(&self.states, time_s)
    }

    /// Pose of the boat on the water at a time. Where its motion in waves is not known (on a flat sea there is none), it lies in the mean
    /// plane of the water.
    pub fn pose(&self, time_s: f64, waves: &WaveField) -> RigidPose {
        let state = self.state(time_s);
        self.pose_of(&state, time_s).unwrap_or_else(|| self.in_mean_plane(&state, waves, time_s).pose)
    }

    /// The same, and the height of the water under it, which takes as long as the rest.
    pub fn floating(&self, time_s: f64, waves: &WaveField) -> Floating {
        let state = self.state(time_s);
        let Some(pose) = self.pose_of(&state, time_s) else {
            return self.in_mean_plane(&state, waves, time_s);
        };
        let Hull { length_m, beam_m, .. } = self.hull;
        let water = waves.plane_under(state.position, state.heading, length_m, beam_m, time_s);
        Floating { pose, water_level: water.height_m }
    }

    /// Pose by the motion in waves, where that is known.
    fn pose_of(&self, state: &CourseState, time_s: f64) -> Option<RigidPose> {
        let motion = self.seakeeping.at(time_s)?;
        Some(pose_in_waves(state, &self.attitude(state, time_s), self.seakeeping.form(), &motion))
    }

    fn in_mean_plane(&self, state: &CourseState, waves: &WaveField, time_s: f64) -> Floating {
        in_mean_plane(state, &self.hull, &self.attitude(state, time_s), waves, time_s)
    }

    fn attitude(&self, state: &CourseState, time_s: f64) -> WayAttitude {
        let way = match &self.pilot {
            Pilot::Scripted(_) => WayAttitude::scripted(state, &self.hull),
            Pilot::Crewed(boat) => boat.craft().way_attitude(state),
        };
        if self.flooding.is_dry() {
            way
        } else {
            way + self.flooding.attitude(self.seakeeping.form(), time_s)
        }
    }

    /// How far water in the hull has brought it down at a time, metres.
    pub fn settled_m(&self, time_s: f64) -> f64 {
        if self.flooding.is_dry() {
            return 0.0;
        }
        -self.flooding.attitude(self.seakeeping.form(), time_s).rise_m
    }

    /// When the hull is full of water and sinks, seconds since the scenario began, by the holes that it has.
    pub fn sinks_s(&self) -> Option<f64> {
        self.flooding.sinks_s()
    }

    /// Since when it burns, seconds since the scenario began.
    pub const fn fire_s(&self) -> Option<f64> {
        self.damage.fire_s
    }

    /// Takes in that the boat was struck at `time_s`: what is stepped after that follows from it. A hit on the engine stops it, one on
    /// the helm ends its attack; the first of each counts. Each hole that the sea reaches lets water in.
    pub fn strike(&mut self, strike: &RoundStrike, time_s: f64) {
        let mut changes = self.damage.add(strike.zone, time_s);
        if strike.ignites {
            self.damage.fire_s.get_or_insert(time_s);
        }
        if let Some((point, hole_m2)) = strike.hole
            && self.flooding.add(self.seakeeping.form(), point, hole_m2, time_s)
        {
            self.damage.drowned_s = self.flooding.engine_drowns_s();
            changes = true;
        }
        if changes {
            self.forget_after(time_s);
        }
    }

    /// Forgets what comes after `time_s`.
    pub fn forget_after(&mut self, time_s: f64) {
        self.states.forget_after(time_s);
        self.seakeeping.forget_after(time_s);
        if let Pilot::Crewed(boat) = &mut self.pilot {
            boat.forget_after(time_s);
        }
    }

    /// Forgets how waves moved the boat after `time_s`: the sea is another from there on.
    pub fn forget_waves_after(&mut self, time_s: f64) {
        self.seakeeping.forget_after(time_s);
    }
}

fn state_in(states: &GridHistory<CourseState>, time_s: f64) -> CourseState {
    match states.around(time_s) {
        Some(Lookup::Between(from, to, share)) => from.between(to, STEP_S, share),
        Some(Lookup::Before(first, before_s)) => first.straight_on(-before_s),
        Some(Lookup::After(last, past_s)) => last.moved(past_s),
        // A history holds at least the state that it began with.
        None => CourseState::default(),
    }
}

#[cfg(test)]
#[path = "history_tests.rs"]
mod tests;
