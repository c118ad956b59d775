//! A boat with its crew, stepped on the grid of all boats' times.

use std::sync::Arc;

use glam::DVec2;

use super::{
    behaviour::CrewedStart,
    course::{BoatDamage, CourseState},
    crew::{Act, CrewMemory, CrewPlan, CrewState, Signals, Situation, Traffic},
    drive::{Craft, DriveState, Orders, Surroundings},
    grid::{GridHistory, STEP_S, seconds, step_after},
    hull::HullForm,
    lights::Conduct,
    seakeeping::FAR_M,
};
use crate::{
    geometry::{ahead, starboard},
    world::waves::WaveField,
};

/// Steps kept: a strike lies at most a frame back, and a frame may have been followed two steps beyond.
const KEPT: usize = 64;
/// Steps from one decision of a crew to the next: ten a second.
const DECISION: i64 = 6;

/// Hull and crew at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Crewed {
    drive: DriveState,
    memory: CrewMemory,
}

/// A boat that a crew drives.
#[derive(Clone, Debug)]
pub struct CrewedBoat {
    plan: Arc<CrewPlan>,
    craft: Craft,
    seed: u64,
    keeps_rules: bool,
    on_target_s: Option<f64>,
    kept: GridHistory<Crewed>,
}

/// The rest of the world as one boat sees it at a step.
#[derive(Clone, Copy, Debug)]
pub struct StepView<'a> {
    /// The other vessels, with the own ship.
    pub others: &'a [Traffic],
    /// The own ship.
    pub own_ship: Traffic,
    /// Events that have befallen the boat, for a step at which its crew decides.
    pub signals: Option<Signals>,
    /// The sea.
    pub waves: &'a WaveField,
    /// Orders of the person who drives boats.
    pub driven: Orders,
}

impl CrewedBoat {
    /// A boat as the scenario begins.
    pub fn new(start: CrewedStart, form: &HullForm) -> Self {
        let craft = Craft::new(form, start.propulsor, start.speed_max_m_s);
        let drive = DriveState::steady(&craft, start.position, start.heading, start.speed_m_s);
        let mut kept = GridHistory::new(KEPT);
        let (since_s, leg_since_s) = (start.begins_s, start.begins_s);
        let memory = CrewMemory { from: drive.centre, since_s, leg_since_s, ..CrewMemory::default() };
        kept.restart(step_after(start.begins_s), Crewed { drive, memory });
        let CrewedStart { plan, chance: seed, keeps_rules, on_target_s, .. } = start;
        Self { plan, craft, seed, keeps_rules, on_target_s, kept }
    }

    /// The hull with its engine.
    pub const fn craft(&self) -> &Craft {
        &self.craft
    }

    /// The newest state, as frames see it.
    pub fn course(&self) -> Option<CourseState> {
        self.kept.last().map(|now| now.drive.course(&self.craft))
    }

    /// The name of the state that the crew is in.
    pub fn state_name(&self) -> &str {
        self.state().map_or("", |state| state.name.as_str())
    }

    /// The state that the crew is in at the newest step.
    fn state(&self) -> Option<&CrewState> {
        self.plan.states.get(self.kept.last().map_or(0, |now| now.memory.state))
    }

    /// Conduct at the newest step by the rules of the road.
    pub fn conduct(&self) -> Conduct {
        match self.state().map(|state| &state.act) {
            Some(Act::Fish) => Conduct::Fishing,
            Some(Act::Anchor) => Conduct::Anchored,
            _ => Conduct::UnderWay,
        }
    }

    /// Whether its crew has given up.
    pub fn gave_up(&self) -> bool {
        self.state().is_some_and(|state| matches!(state.act, Act::Surrender))
    }

    /// Whether its crew decides at step `number`. Not all crews do so at the same step: no frame has to wait for all of them.
    pub fn decides(&self, number: i64) -> bool {
        (number + (self.seed % DECISION as u64) as i64) % DECISION == 0
    }

    /// The state a step after `number`.
    pub(super) fn step(&mut self, number: i64, damage: &BoatDamage, view: &StepView<'_>) -> CourseState {
        let Some(now) = self.kept.last().copied() else { return CourseState::default() };
        let time_s = seconds(number);
        let mut memory = now.memory;
        if let Some(signals) = view.signals {
            let situation = Situation {
                time_s,
                seed: self.seed,
                others: view.others,
                own_ship: view.own_ship,
                signals,
                keeps_rules: self.keeps_rules,
                on_target_s: self.on_target_s,
                driven: view.driven,
            };
            memory = self.plan.decide(&self.craft, &now.drive, &memory, &situation);
        }
        let struck = |at: Option<f64>| at.is_some_and(|s| s <= time_s);
        // Without its helmsman a boat goes on as the helm stands, and its engine stops: his cord is pulled.
        let orders = match (struck(damage.engine_lost_s()), struck(damage.helm_s)) {
            (_, true) => Orders::default(),
            (true, false) => Orders { throttle: 0.0, ..memory.orders },
            (false, false) => memory.orders,
        };
        let around =
            Surroundings { anchor: self.plan.anchor(&memory), ..self.slopes(&now.drive, view.waves, time_s) };
        let drive = self.craft.step(&now.drive, &orders, &around, STEP_S);
        self.kept.push(Crewed { drive, memory });
        drive.course(&self.craft)
    }

    /// The slopes of the water that move a boat along: farther off that would not be seen.
    fn slopes(&self, boat: &DriveState, waves: &WaveField, time_s: f64) -> Surroundings {
        if boat.centre.length() > FAR_M {
            return Surroundings::default();
        }
        self.craft.slopes(boat, waves, time_s, STEP_S)
    }

    /// Moves the boat off another by `push` (metres), and takes the speed with which it closes (`along` that way, m/s) from it.
    pub fn push(&mut self, push: DVec2, stop: DVec2) {
        if let Some(now) = self.kept.last_mut() {
            now.drive.centre += push;
            now.drive.surge += stop.dot(ahead(now.drive.heading));
            now.drive.sway += stop.dot(starboard(now.drive.heading));
        }
    }

    /// Forgets what comes after `time_s`.
    pub(super) fn forget_after(&mut self, time_s: f64) {
        self.kept.forget_after(time_s);
    }
}
