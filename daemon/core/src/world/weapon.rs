//! The training weapon: from trigger edges to the times at which virtual rounds leave the muzzle.

use std::collections::VecDeque;

use crate::{event::TriggerEdge, time::Time};

/// Edges that can wait to be worked off; a contact that bounces faster than this fills the queue loses its oldest.
const EDGES_MAX: usize = 256;

/// A belt-fed weapon: fires while the trigger is held, at its cyclic rate, until the belt is empty.
///
/// A bouncing contact fires no extra round: no round leaves sooner than a full cycle after the one before.
#[derive(Clone, Debug)]
pub struct Weapon {
    cycle_ns: i64,
    rounds_left: u32,
    held: bool,
    armed: bool,
    last_round: Option<Time>,
    next_round: Option<Time>,
    edges: VecDeque<TriggerEdge>,
}

impl Weapon {
    /// A weapon with `belt` rounds and a cyclic rate of `rounds_per_minute` (clamped to 1 to 6000).
    pub fn new(rounds_per_minute: f64, belt: u32) -> Self {
        let rate = if rounds_per_minute.is_finite() { rounds_per_minute.clamp(1.0, 6000.0) } else { 1.0 };
        Self {
            cycle_ns: (60e9 / rate).round() as i64,
            rounds_left: belt,
            held: false,
            armed: true,
            last_round: None,
            next_round: None,
            edges: VecDeque::with_capacity(EDGES_MAX),
        }
    }

    /// Rounds left in the belt.
    pub const fn rounds_left(&self) -> u32 {
        self.rounds_left
    }

    /// Takes in an edge of the trigger. Edges may arrive before the time they lie at is reached.
    pub fn edge(&mut self, edge: TriggerEdge) {
        if self.edges.len() == EDGES_MAX {
            self.edges.pop_front();
        }
        let place = self.edges.partition_point(|e| e.time <= edge.time);
        self.edges.insert(place, edge);
    }

    /// Arms or disarms. Disarmed, the weapon meets edges and fires nothing; armed again, it fires at the next press.
    pub fn arm(&mut self, armed: bool) {
        self.armed = armed;
        if !armed {
            self.next_round = None;
        }
    }

    /// The next round that leaves the muzzle no later than `until`; `None` once there is none. Call until it says so.
    pub fn fire(&mut self, until: Time) -> Option<Time> {
        loop {
            let edge = self.edges.front().copied().filter(|e| e.time <= until);
            let round = self.next_round.filter(|t| *t <= until);
            match (edge, round) {
                // A release at the very time of a round comes too late to hold it back.
                (Some(e), r) if r.is_none_or(|t| e.time < t) => {
                    self.edges.pop_front();
                    self.apply(e);
                }
                (_, Some(time)) => return Some(self.leave(time)),
                _ => return None,
            }
        }
    }

    fn apply(&mut self, edge: TriggerEdge) {
        if edge.pressed == self.held {
            return;
        }
        self.held = edge.pressed;
        self.next_round = (self.held && self.armed && self.rounds_left > 0).then(|| {
            let ready = self.last_round.map_or(edge.time, |t| t.plus_ns(self.cycle_ns));
            ready.max(edge.time)
        });
    }

    fn leave(&mut self, time: Time) -> Time {
        self.rounds_left -= 1;
        self.last_round = Some(time);
        self.next_round = (self.held && self.rounds_left > 0).then(|| time.plus_ns(self.cycle_ns));
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
        assert_eq!(rounds(&mut w, 2000), []);
        w.arm(true);
        assert_eq!(rounds(&mut w, 3000), [], "held all the time");
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
