//! What an instructor orders, and the exercise's time that stands while it is paused.

use super::{RunningWorld, World};
use crate::{
    order::{InstructorOrder, Order},
    time::Time,
    world::{
        clock::ExerciseClock,
        exercise::{ExerciseEvent, ExerciseFact},
        score::{Outcome, ShotRecord},
        weapon::WeaponState,
    },
};

impl World {
    /// Takes in an order of the instructor's. One that is none is left out: its sender has been refused by [`Order::check`].
    pub fn order(&mut self, order: &InstructorOrder) {
        /// More wait only while no picture has come.
        const WAITING_MAX: usize = 64;
        if order.order.check().is_err() {
            return;
        }
        match &order.order {
            Order::Pause => {
                let time = self.clock.pause(order.time);
                self.pauses.extend(time.map(|time| ExerciseEvent { time, fact: ExerciseFact::Paused }));
            }
            Order::Resume => {
                let time = self.clock.resume(order.time);
                // A trigger that was held all the time fires at the next press.
                self.weapon.arm(false);
                self.pauses.extend(time.map(|time| ExerciseEvent { time, fact: ExerciseFact::Resumed }));
            }
            Order::Join { boat, at } => {
                if self.joining.len() < WAITING_MAX {
                    self.joining.push((boat.clone(), *at));
                }
            }
            Order::Rules { .. } | Order::Stoppage | Order::Message { .. } | Order::Note { .. } => {
                self.watch.order(order.order.clone());
            }
        }
    }

    /// Why an order cannot be carried out now, and what to do; `None` where it can.
    pub fn refuses(&self, order: &Order) -> Option<String> {
        match order {
            Order::Join { boat, at } => {
                let Some(running) = &self.running else {
                    return Some("no boat can join before the first picture: wait for the camera".to_owned());
                };
                running.fleet.refuses(boat, at.is_some())
            }
            Order::Stoppage if self.weapon.state() == WeaponState::Stoppage => {
                Some("the weapon has a stoppage already".to_owned())
            }
            Order::Pause if self.clock.is_paused() => Some("the exercise stands still already".to_owned()),
            Order::Resume if !self.clock.is_paused() => Some("the exercise goes on already".to_owned()),
            _ => None,
        }
    }

    /// Boats of the reserve join at `now`.
    pub(super) fn have_join(&mut self, running: &mut RunningWorld, now: Time) {
        for (boat, at) in self.joining.drain(..) {
            for joined in running.fleet.join(&boat, at, now) {
                let Some(side) = running.fleet.side(joined) else { continue };
                let place = running.fleet.middle(joined, now).unwrap_or_default();
                let fact = ExerciseFact::Joined {
                    boat: running.fleet.name(joined).to_owned(),
                    side,
                    range_m: place.truncate().length(),
                    is_to_stop: self.watch.stops_one_more(side),
                };
                self.events.push(ExerciseEvent { time: now, fact });
            }
        }
    }

    /// Puts what the last call gave from the exercise's time into the host's.
    pub(super) fn give_host_times(&mut self, records: &mut [ShotRecord]) {
        let clock = &self.clock;
        let to_host = |time: &mut Time| *time = clock.to_host(*time);
        for record in records {
            to_host(&mut record.fired);
            if let Outcome::Hit { time, .. } | Outcome::Miss { time, .. } = &mut record.outcome {
                to_host(time);
            }
        }
        self.events.iter_mut().for_each(|event| to_host(&mut event.time));
        self.events.splice(0..0, self.pauses.drain(..));
        let host_ns = |ns: &mut i64| *ns = clock.to_host(Time::from_ns(*ns)).ns();
        self.tracks.samples.iter_mut().for_each(|sample| host_ns(&mut sample.time_ns));
        for round in &mut self.tracks.rounds {
            let fired = Time::from_ns(round.fired_ns);
            let fired_host = clock.to_host(fired);
            if clock.has_paused() {
                for point in &mut round.points {
                    let at = clock.to_host(fired.plus_secs(f64::from(point.after_s)));
                    point.after_s = at.secs_since(fired_host) as f32;
                }
            }
            round.fired_ns = fired_host.ns();
        }
    }

    /// The clock of the exercise, which stands while it is paused.
    pub const fn clock(&self) -> &ExerciseClock {
        &self.clock
    }
}
