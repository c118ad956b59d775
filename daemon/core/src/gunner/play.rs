//! A scenario from beginning to end with a simulated gunner at the gun.

use std::{collections::VecDeque, sync::Arc};

use glam::{DVec2, DVec3};
use rand_pcg::Pcg64;

use super::{
    eye::Eye,
    hand::Hand,
    head::{Head, KnownWeapon, Moment},
    skill::Skill,
};
use crate::{
    act::{Act, TraineeAct},
    event::TriggerEdge,
    model::{Model, ModelId},
    time::Time,
    world::{
        BoreAim, World,
        exercise::{Engagement, ExerciseEvent, ExerciseFact, group_of},
        scenario::Scenario,
        score::{ScoreFold, ShotRecord},
    },
};

/// How far back the gun's way is kept, seconds.
const KEPT_S: f64 = 1.0;
/// Significant wave height of the sea that [`Skill::sea_mrad`] is for, metres.
const SEA_2_M: f64 = 0.3;
/// Stream of the gunner's chance; boats and rounds have others.
const STREAM: u128 = 0x9u128 << 96;
/// Time that is played after the last hostile boat was stopped, seconds.
const AFTER_S: f64 = 10.0;

/// What a played scenario left.
#[derive(Clone, Debug, Default)]
pub struct Played {
    /// Rounds, in the order in which they ended.
    pub shots: Vec<ShotRecord>,
    /// Events of the exercise.
    pub events: Vec<ExerciseEvent>,
    /// How long it was, seconds of the exercise.
    pub seconds: f64,
}

impl Played {
    /// All of it, to be scored.
    pub fn fold(&self) -> ScoreFold {
        let mut fold = ScoreFold::default();
        fold.take(&self.shots, &self.events);
        fold
    }
}

/// The gun's way over the last second.
struct BoreTrack {
    kept: VecDeque<(Time, DVec2)>,
    muzzle: DVec3,
}

impl BoreTrack {
    fn push(&mut self, time: Time, bore: DVec2) {
        self.kept.push_back((time, bore));
        while self.kept.front().is_some_and(|(first, _)| time.secs_since(*first) > KEPT_S) {
            self.kept.pop_front();
        }
    }

    /// Where the gun pointed, on a straight way from step to step.
    fn at(&self, time: Time) -> BoreAim {
        let after = self.kept.partition_point(|(at, _)| *at < time);
        let angles = match (after.checked_sub(1).and_then(|i| self.kept.get(i)), self.kept.get(after)) {
            (Some((from, a)), Some((to, b))) => {
                *a + (*b - *a) * (time.secs_since(*from) / to.secs_since(*from).max(1e-9))
            }
            (Some((_, only)), None) | (None, Some((_, only))) => *only,
            (None, None) => DVec2::ZERO,
        };
        let (flat, up) = (angles.y.cos(), angles.y.sin());
        let bore = DVec3::new(angles.x.sin() * flat, angles.x.cos() * flat, up);
        BoreAim { muzzle: self.muzzle, bore, pose_age_ns: 0, unscored: None }
    }
}

/// A gunner at the gun of a world.
pub struct Gunner {
    skill: Skill,
    head: Head,
    hand: Hand,
    eye: Eye,
    wander: f64,
    groups: Vec<usize>,
    asked_to_warn: bool,
    self_defence_m: f64,
    random: Pcg64,
    pressed: bool,
    wanted: Option<DVec2>,
    /// Azimuth to each side of north that the mount turns to, radians.
    traverse: f64,
}

/// What a gunner does in a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GunnerMove {
    /// Whether the trigger is held from now on.
    pub pressed: bool,
    /// What is said or done besides.
    pub acts: Vec<Act>,
    /// Azimuth (clockwise from north) and elevation of the gun after the step, radians.
    pub bore: DVec2,
    /// Rates at which what is aimed at moves, rad/s.
    pub rates: DVec2,
    /// Whether the scenario's hostile boats are all stopped or gone.
    pub is_decided: bool,
}

impl Gunner {
    /// One that plays `scenario` and looks to the north. All chance follows from the scenario's seed.
    pub fn new(scenario: &Scenario, skill: &Skill) -> Self {
        let mut random = Pcg64::new(u128::from(scenario.seed), STREAM);
        let weapon = KnownWeapon {
            projectile: scenario.weapon.projectile,
            cycle_s: 60.0 / scenario.weapon.rounds_per_minute.max(1.0),
            wind: scenario.wind,
        };
        let names: Vec<&str> = scenario.boats.iter().map(|boat| group_of(&boat.name)).collect();
        Self {
            skill: *skill,
            head: Head::new(*skill, weapon, scenario.boats.len(), &mut random),
            hand: Hand::at(0.0, 0.0),
            eye: Eye {
                at: DVec3::new(0.0, 0.0, scenario.eye_height_m),
                visibility_m: scenario.daylight.visibility_m,
                weather: weather(scenario.water.force.get()),
            },
            wander: wander(scenario, skill),
            groups: names.iter().map(|name| names.iter().position(|n| n == name).unwrap_or(0)).collect(),
            asked_to_warn: scenario.exercise.calls.iter().any(|call| call.call == Act::Warn),
            self_defence_m: scenario.exercise.self_defence_m,
            random,
            pressed: false,
            wanted: None,
            traverse: f64::INFINITY,
        }
    }

    /// Direction of the gun: azimuth (clockwise from north) and elevation, radians.
    pub fn bore(&self) -> DVec2 {
        self.hand.bore()
    }

    /// Whether the trigger is held.
    pub const fn presses(&self) -> bool {
        self.pressed
    }

    /// The same on a mount that turns no further than `traverse` radians to each side of north: boats beyond are left alone.
    pub fn within(self, traverse: f64) -> Self {
        Self { traverse, ..self }
    }

    /// Notes what happened in the world since the last call; once after each of its advances.
    pub fn hear(&mut self, world: &World) {
        let Some(running) = world.running() else { return };
        for event in world.events() {
            if let ExerciseFact::Missed { boat, why, .. } = &event.fact
                && let Some(boat) = (0..running.fleet.len()).find(|b| running.fleet.name(*b) == boat)
            {
                self.head.saw_miss(boat, why.error_mrad);
            }
        }
    }

    /// Sees the world as it is `time_s` seconds after the begin, and acts for the next [`STEP_S`](Self::STEP_S). `None` before the world runs.
    pub fn step(&mut self, world: &World, time_s: f64) -> Option<GunnerMove> {
        let running = world.running()?;
        let mut sighted = self.eye.sees(running);
        sighted.retain(|boat| (boat.at.x.atan2(boat.at.y)).abs() <= self.traverse);
        let off = self.wanted.map_or(f64::INFINITY, |wanted| self.hand.off(wanted));
        let moment = Moment {
            time_s,
            span_s: Self::STEP_S,
            sighted: &sighted,
            rules: world.watch().rules(),
            warns: self.asked_to_warn || world.watch().rules() == Some(Engagement::Warn),
            self_defence_m: self.self_defence_m,
            weapon: world.weapon_state(),
            eye: self.eye.at,
            off,
            groups: &self.groups,
        };
        let decision = self.head.decide(&moment, &mut self.random);
        self.pressed = decision.trigger;
        self.wanted = decision.wanted.map(|(at, _)| at);
        let rates = decision.wanted.map_or(DVec2::ZERO, |(_, rates)| rates);
        if let Some(to) = decision.wanted {
            self.hand.follow(&self.skill, to, self.wander, Self::STEP_S, &mut self.random);
        }
        Some(GunnerMove {
            pressed: decision.trigger,
            acts: decision.acts,
            bore: self.hand.bore(),
            rates,
            is_decided: world.watch().is_decided(),
        })
    }

    /// Step of a gunner, seconds: people do nothing faster than 5 rad/s.
    pub const STEP_S: f64 = 1.0 / 30.0;
}

/// Plays a scenario for `limit_s` seconds at most, or until some seconds after all hostile boats are stopped or gone. All chance follows from
/// the scenario's seed. `boat_models` names the model of each boat.
pub fn play(
    scenario: &Scenario,
    models: Arc<[Model]>,
    boat_models: &[ModelId],
    skill: &Skill,
    limit_s: f64,
) -> Played {
    let begin = Time::from_ns(0);
    let mut world = World::new(scenario, models, boat_models);
    let mut gunner = Gunner::new(scenario, skill);
    let muzzle = DVec3::new(0.0, 0.0, scenario.eye_height_m);
    let mut track = BoreTrack { kept: VecDeque::new(), muzzle };
    let mut played = Played::default();
    let mut over_since = None;
    let mut step = 0_u32;
    loop {
        let time_s = f64::from(step) * Gunner::STEP_S;
        let time = begin.plus_secs(time_s);
        let pressed = gunner.presses();
        track.push(time, gunner.bore());
        world.advance(begin, time, time, |at| track.at(at), &mut played.shots);
        played.events.extend_from_slice(world.events());
        gunner.hear(&world);
        let Some(moved) = gunner.step(&world, time_s) else { break };
        for act in moved.acts {
            world.act(TraineeAct { time, act });
        }
        if moved.pressed != pressed {
            world.trigger(TriggerEdge { time, pressed: moved.pressed });
        }
        if moved.is_decided {
            over_since.get_or_insert(time_s);
        } else {
            over_since = None;
        }
        played.seconds = time_s;
        if time_s >= limit_s || over_since.is_some_and(|since| time_s - since > AFTER_S) {
            break;
        }
        step += 1;
    }
    world.finish(&mut played.shots);
    played.events.extend_from_slice(world.events());
    played
}

/// Wander of the aim on this sea, one standard deviation, radians.
fn wander(scenario: &Scenario, skill: &Skill) -> f64 {
    /// Beyond that sea nobody aims any worse.
    const MOST: f64 = 2.0;
    let height_m = scenario.waves.spectrum.significant_height_m();
    (skill.aim_mrad + skill.sea_mrad * (height_m / SEA_2_M).min(MOST)) * 1e-3
}

/// Factor of sweep widths for small boats by wind force: half above 15 knots, a quarter above 25.
const fn weather(force: u8) -> f64 {
    match force {
        0..=4 => 1.0,
        5..=6 => 0.5,
        _ => 0.25,
    }
}

#[cfg(test)]
#[path = "play_tests.rs"]
mod tests;
