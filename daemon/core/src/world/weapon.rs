//! The training weapon: from trigger edges to the times at which virtual rounds leave the muzzle.

use std::collections::VecDeque;

use crate::{
    act::{Act, TraineeAct},
    chance::drawn,
    event::TriggerEdge,
    time::Time,
};

/// Edges and acts that can wait to be worked off; a contact that bounces faster than this fills the queue loses its oldest.
const INPUTS_MAX: usize = 256;

/// State of the weapon, for the display and for whoever fires it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WeaponState {
    /// It fires when the trigger is pressed.
    Ready,
    /// It was made safe.
    Safe,
    /// It needs the immediate action.
    Stoppage,
    /// A belt is being put in.
    Reloading,
    /// The belt is empty.
    Empty,
}

/// Something that the weapon meets at a time.
#[derive(Clone, Copy, Debug)]
enum WeaponInput {
    Trigger(bool),
    Act(Act),
}

/// A belt-fed weapon: fires while the trigger is held, at its cyclic rate, until the belt is empty.
///
/// A bouncing contact fires no extra round: no round leaves sooner than a full cycle after the one before.
#[derive(Clone, Debug)]
pub struct Weapon {
    cycle_ns: i64,
    belt: u32,
    spare_belts: u32,
    reload_s: f64,
    stoppages: Option<Stoppages>,
    heat: Option<BarrelHeat>,
    /// Rise of the barrel's temperature as the last round left, kelvins.
    rise_k: f64,
    rounds_left: u32,
    rounds_fired: u64,
    held: bool,
    armed: bool,
    is_safe: bool,
    is_stopped: bool,
    stops_next: bool,
    reloaded_at: Option<Time>,
    last_round: Option<Time>,
    next_round: Option<Time>,
    inputs: VecDeque<(Time, WeaponInput)>,
}

/// Heat of the barrel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BarrelHeat {
    /// Rise of the barrel's temperature with each round, kelvins.
    pub round_k: f64,
    /// Time constant with which it cools, seconds.
    pub cooling_s: f64,
    /// Rise above which it is hot: scatter grows with what it is hotter by, and is twice as wide at twice that rise, kelvins.
    pub hot_k: f64,
}

/// Chance of stoppages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stoppages {
    /// Rounds from one to the next, on average.
    pub every: f64,
    /// Seed of the chance.
    pub seed: u64,
}

impl Stoppages {
    /// Whether the weapon stops after that round, counted from 1.
    fn after(self, round: u64) -> bool {
        drawn(self.seed, [round, 0]) * self.every < 1.0
    }
}

impl Weapon {
    /// A weapon with `belt` rounds and a cyclic rate of `rounds_per_minute` (clamped to 1 to 6000).
    pub fn new(rounds_per_minute: f64, belt: u32) -> Self {
        let rate = if rounds_per_minute.is_finite() { rounds_per_minute.clamp(1.0, 6000.0) } else { 1.0 };
        Self {
            cycle_ns: (60e9 / rate).round() as i64,
            belt,
            spare_belts: 0,
            reload_s: 0.0,
            stoppages: None,
            heat: None,
            rise_k: 0.0,
            rounds_left: belt,
            rounds_fired: 0,
            held: false,
            armed: true,
            is_safe: false,
            is_stopped: false,
            stops_next: false,
            reloaded_at: None,
            last_round: None,
            next_round: None,
            inputs: VecDeque::with_capacity(INPUTS_MAX),
        }
    }

    /// With so many belts more, each of which takes that long to put in, seconds.
    #[must_use]
    pub fn with_spares(self, spare_belts: u32, reload_s: f64) -> Self {
        Self { spare_belts, reload_s: reload_s.max(0.0), ..self }
    }

    /// With stoppages by chance.
    #[must_use]
    pub fn with_stoppages(self, stoppages: Option<Stoppages>) -> Self {
        Self { stoppages, ..self }
    }

    /// With a barrel that gets hot.
    #[must_use]
    pub fn with_heat(self, heat: Option<BarrelHeat>) -> Self {
        Self { heat, ..self }
    }

    /// Scatter of the round that left last, by that from a cold barrel.
    pub fn scatter(&self) -> f64 {
        self.heat.map_or(1.0, |heat| (self.rise_k / heat.hot_k.max(1e-3)).max(1.0))
    }

    /// Rounds left in the belt.
    pub const fn rounds_left(&self) -> u32 {
        self.rounds_left
    }

    /// Rounds left with those of spare belts.
    pub const fn rounds_in_all(&self) -> u32 {
        self.rounds_left.saturating_add(self.spare_belts.saturating_mul(self.belt))
    }

    /// Its state after all that it has met.
    pub const fn state(&self) -> WeaponState {
        if self.reloaded_at.is_some() {
            WeaponState::Reloading
        } else if self.is_stopped {
            WeaponState::Stoppage
        } else if self.is_safe {
            WeaponState::Safe
        } else if self.rounds_left == 0 {
            WeaponState::Empty
        } else {
            WeaponState::Ready
        }
    }

    /// Takes in an edge of the trigger. Edges may arrive before the time they lie at is reached.
    pub fn edge(&mut self, edge: TriggerEdge) {
        self.put(edge.time, WeaponInput::Trigger(edge.pressed));
    }

    /// Takes in an act of the trainee, as an edge.
    pub fn act(&mut self, act: TraineeAct) {
        if matches!(act.act, Act::Reload | Act::Clear | Act::Safe | Act::Ready) {
            self.put(act.time, WeaponInput::Act(act.act));
        }
    }

    fn put(&mut self, time: Time, input: WeaponInput) {
        if self.inputs.len() == INPUTS_MAX {
            self.inputs.pop_front();
        }
        let place = self.inputs.partition_point(|(at, _)| *at <= time);
        self.inputs.insert(place, (time, input));
    }

    /// Arms or disarms. Disarmed, the weapon meets edges and fires nothing; armed again, it fires at the next press.
    pub fn arm(&mut self, armed: bool) {
        self.armed = armed;
        if !armed {
            self.next_round = None;
        }
    }

    /// Has a stoppage after the next round.
    pub const fn stop_next(&mut self) {
        self.stops_next = true;
    }

    /// The next round that leaves the muzzle no later than `until`; `None` once there is none. Call until it says so.
    pub fn fire(&mut self, until: Time) -> Option<Time> {
        loop {
            let input = self.inputs.front().copied().filter(|(time, _)| *time <= until);
            let belt_in = self.reloaded_at.filter(|time| *time <= until);
            let round = self.next_round.filter(|t| *t <= until);
            match (input, belt_in, round) {
                (input, Some(time), _) if input.is_none_or(|(at, _)| time <= at) => self.belt_is_in(time),
                // A release at the very time of a round comes too late to hold it back.
                (Some((time, input)), _, round) if round.is_none_or(|t| time < t) => {
                    self.inputs.pop_front();
                    self.meet(time, input);
                }
                (_, _, Some(time)) => return Some(self.leave(time)),
                _ => return None,
            }
        }
    }

    fn meet(&mut self, time: Time, input: WeaponInput) {
        match input {
            WeaponInput::Trigger(pressed) if pressed == self.held => {}
            WeaponInput::Trigger(pressed) => {
                self.held = pressed;
                self.next_round = None;
                self.begin(time);
            }
            WeaponInput::Act(Act::Reload) => {
                // A belt that is put in takes the place of the one before, with what is left in it.
                if self.reloaded_at.is_none() && self.spare_belts > 0 {
                    self.next_round = None;
                    self.reloaded_at = Some(time.plus_secs(self.reload_s));
                }
            }
            WeaponInput::Act(Act::Clear) => self.is_stopped = false,
            WeaponInput::Act(Act::Safe) => {
                self.is_safe = true;
                self.next_round = None;
            }
            WeaponInput::Act(Act::Ready) => self.is_safe = false,
            WeaponInput::Act(_) => {}
        }
    }

    /// Fires from a press on.
    fn begin(&mut self, time: Time) {
        let is_ready = self.state() == WeaponState::Ready && self.armed;
        self.next_round = (self.held && is_ready).then(|| {
            let ready = self.last_round.map_or(time, |t| t.plus_ns(self.cycle_ns));
            ready.max(time)
        });
    }

    fn belt_is_in(&mut self, time: Time) {
        self.reloaded_at = None;
        self.spare_belts = self.spare_belts.saturating_sub(1);
        self.rounds_left = self.belt;
        self.is_stopped = false;
        // The trigger has to be pressed again.
        self.next_round = None;
        self.last_round = self.last_round.map(|last| last.min(time));
    }

    fn leave(&mut self, time: Time) -> Time {
        self.rounds_left -= 1;
        self.rounds_fired += 1;
        if let Some(heat) = self.heat {
            let cooled_s = self.last_round.map_or(f64::INFINITY, |last| time.secs_since(last));
            self.rise_k = self.rise_k * (-cooled_s / heat.cooling_s.max(1e-3)).exp() + heat.round_k;
        }
        self.last_round = Some(time);
        let by_chance = self.stoppages.is_some_and(|chance| chance.after(self.rounds_fired));
        self.is_stopped = std::mem::take(&mut self.stops_next) || by_chance;
        let goes_on = self.held && self.rounds_left > 0 && !self.is_stopped;
        self.next_round = goes_on.then(|| time.plus_ns(self.cycle_ns));
        time
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn edge(ms: i64, pressed: bool) -> TriggerEdge {
        TriggerEdge { time: Time::from_ns(ms * 1_000_000), pressed }
    }

    fn rounds(weapon: &mut Weapon, until_ms: i64) -> Vec<i64> {
        std::iter::from_fn(|| weapon.fire(Time::from_ns(until_ms * 1_000_000)))
            .map(|t| t.ns() / 1_000_000)
            .collect()
    }

    #[test]
    fn a_disarmed_weapon_fires_nothing_and_needs_a_new_press() {
        let mut w = Weapon::new(600.0, 10);
        w.edge(edge(1000, true));
        assert_eq!(rounds(&mut w, 1150), [1000, 1100]);
        w.arm(false);
        assert_eq!(rounds(&mut w, 2000), [0i64; 0]);
        w.arm(true);
        assert_eq!(rounds(&mut w, 3000), [0i64; 0], "held all the time");
        w.edge(edge(3000, false));
        w.edge(edge(3500, true));
        assert_eq!(rounds(&mut w, 3500), [3500]);
    }

    #[test]
    fn fires_at_the_edge_and_then_at_its_rate() {
        let mut w = Weapon::new(600.0, 10);
        w.edge(edge(1000, true));
        w.edge(edge(1350, false));
        assert_eq!(rounds(&mut w, 1250), [1000, 1100, 1200]);
        assert_eq!(rounds(&mut w, 5000), [1300]);
        assert_eq!(w.rounds_left(), 6);
    }

    #[test]
    fn a_bouncing_contact_fires_once() {
        let mut w = Weapon::new(600.0, 10);
        for (ms, pressed) in [(1000, true), (1001, false), (1003, true), (1004, false)] {
            w.edge(edge(ms, pressed));
        }
        assert_eq!(rounds(&mut w, 2000), [1000]);
    }

    fn act(ms: i64, act: Act) -> TraineeAct {
        TraineeAct { time: Time::from_ns(ms * 1_000_000), act }
    }

    #[test]
    fn a_stoppage_lasts_until_the_immediate_action_and_a_new_press() {
        let mut w = Weapon::new(600.0, 10);
        w.edge(edge(0, true));
        assert_eq!(rounds(&mut w, 150), [0, 100]);
        w.stop_next();
        assert_eq!(rounds(&mut w, 1000), [200], "the round it stops with is fired");
        assert_eq!(w.state(), WeaponState::Stoppage);
        w.act(act(2000, Act::Clear));
        assert_eq!(rounds(&mut w, 3000), [0i64; 0], "held all the time");
        assert_eq!(w.state(), WeaponState::Ready);
        w.edge(edge(3100, false));
        w.edge(edge(3200, true));
        assert_eq!(rounds(&mut w, 3250), [3200]);
    }

    #[test]
    fn stoppages_come_by_chance_as_often_as_asked() {
        let stoppages = Stoppages { every: 50.0, seed: 3 };
        let count = (1..=100_000).filter(|round| stoppages.after(*round)).count();
        assert!((1800..2200).contains(&count), "{count}");
    }

    #[test]
    fn a_belt_takes_its_time_and_safe_holds_fire() {
        let mut w = Weapon::new(600.0, 3).with_spares(1, 5.0);
        assert_eq!(w.rounds_in_all(), 6);
        w.edge(edge(0, true));
        assert_eq!(rounds(&mut w, 1000), [0, 100, 200]);
        assert_eq!(w.state(), WeaponState::Empty);
        w.act(act(1000, Act::Reload));
        w.edge(edge(1100, false));
        w.edge(edge(2000, true));
        assert_eq!(rounds(&mut w, 4000), [0i64; 0]);
        assert_eq!(w.state(), WeaponState::Reloading);
        assert_eq!(rounds(&mut w, 6500), [0i64; 0], "pressed before the belt was in");
        w.edge(edge(6600, false));
        w.act(act(6700, Act::Safe));
        w.edge(edge(6800, true));
        w.edge(edge(7000, false));
        w.act(act(7100, Act::Ready));
        w.edge(edge(7200, true));
        assert_eq!(rounds(&mut w, 7250), [7200]);
        assert_eq!((w.rounds_left(), w.rounds_in_all()), (2, 2));
        w.act(act(7300, Act::Reload));
        assert_eq!(rounds(&mut w, 7500), [7300, 7400], "there is no belt more");
    }

    #[test]
    fn a_barrel_gets_hot_by_its_rounds_and_cools_between_them() {
        let heat = BarrelHeat { round_k: 1.5, cooling_s: 600.0, hot_k: 300.0 };
        let mut w = Weapon::new(600.0, 1000).with_heat(Some(heat));
        w.edge(edge(0, true));
        assert_eq!(rounds(&mut w, 19_950).len(), 200);
        assert_eq!(w.scatter(), 1.0, "200 rounds at once are what it bears");
        assert_eq!(rounds(&mut w, 49_950).len(), 300);
        // The sum of what each round leaves by the end.
        let rise_k: f64 = (0..500).map(|i| 1.5 * (-0.1 * f64::from(i) / 600.0).exp()).sum();
        assert!((w.scatter() - rise_k / 300.0).abs() < 1e-9, "{}", w.scatter());
        w.edge(edge(49_970, false));
        w.edge(edge(1_500_000, true));
        assert_eq!(rounds(&mut w, 1_500_050).len(), 1);
        assert_eq!(w.scatter(), 1.0);
    }

    #[test]
    fn the_belt_ends() {
        let mut w = Weapon::new(600.0, 3);
        w.edge(edge(0, true));
        assert_eq!(rounds(&mut w, 10_000), [0, 100, 200]);
        w.edge(edge(20_000, false));
        w.edge(edge(20_100, true));
        assert_eq!(rounds(&mut w, 30_000), [0i64; 0]);
    }

    proptest! {
        /// However the edges fall and however the time is cut up, the rounds are the same and a cycle apart.
        #[test]
        fn rounds_do_not_depend_on_when_they_are_asked_for(
            mut times in proptest::collection::vec(0i64..3000, 1..40), step in 1i64..400,
        ) {
            times.sort_unstable();
            let mut whole = Weapon::new(500.0, 1000);
            for (i, ms) in times.iter().enumerate() {
                whole.edge(edge(*ms, i % 2 == 0));
            }
            let mut cut = whole.clone();
            let expected = rounds(&mut whole, 4000);
            let mut got = Vec::new();
            let mut t = 0;
            while t < 4000 {
                t = (t + step).min(4000);
                got.extend(rounds(&mut cut, t));
            }
            prop_assert_eq!(&got, &expected);
            prop_assert!(got.windows(2).all(|w| w[1] - w[0] >= 119));
        }
    }
}
