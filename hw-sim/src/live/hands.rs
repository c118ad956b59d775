//! Hands on the simulated gun: what somebody at a mouse, a script or a simulated gunner wants of it.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use bowwave_core::{act::Act, time::Time};
use glam::DVec2;

use super::gun::Wish;

/// Longest time that a direction in the world goes on at its rate without another word, seconds.
const GOES_ON_S: f64 = 0.2;

/// Hands that any thread may move.
#[derive(Clone, Debug, Default)]
pub struct Hands(Arc<Mutex<Held>>);

#[derive(Clone, Debug, Default)]
struct Held {
    aim: Aim,
    pressed: bool,
    acts: VecDeque<Act>,
    blows: u32,
}

#[derive(Clone, Copy, Debug)]
enum Aim {
    /// A turn from where the gun was at the begin: traverse to the right and elevation, radians.
    Turned(DVec2),
    /// Azimuth and elevation in the world at a time, radians, and their rates.
    World(Time, DVec2, DVec2),
}

impl Default for Aim {
    fn default() -> Self {
        Self::Turned(DVec2::ZERO)
    }
}

impl Hands {
    /// Turns the gun on its mount by so much to the right and upwards, radians.
    pub fn turn(&self, by: DVec2) {
        let mut held = self.lock();
        let so_far = if let Aim::Turned(so_far) = held.aim { so_far } else { DVec2::ZERO };
        // A little beyond the stops, so that turning back is felt at once.
        let beyond = DVec2::new(1.3, 0.35);
        held.aim = Aim::Turned((so_far + by).clamp(-beyond, beyond));
    }

    /// Keeps the gun on an azimuth and elevation in the world that moves on at these rates from `time` on.
    pub fn point(&self, time: Time, direction: DVec2, rates: DVec2) {
        self.lock().aim = Aim::World(time, direction, rates);
    }

    /// Presses or releases the trigger.
    pub fn press(&self, pressed: bool) {
        self.lock().pressed = pressed;
    }

    /// Acts besides the trigger.
    pub fn act(&self, act: Act) {
        self.lock().acts.push_back(act);
    }

    /// So many rounds went off: each gives the mount a blow.
    pub fn blow(&self, rounds: u32) {
        self.lock().blows += rounds;
    }

    /// What is wanted at a time by hands that began with the gun at `rest` (on its mount).
    pub(super) fn wish(&self, time: Time, rest: DVec2) -> Wish {
        match self.lock().aim {
            Aim::Turned(by) => Wish::Mount(rest + by, DVec2::ZERO),
            Aim::World(since, direction, rates) => {
                let ahead_s = time.secs_since(since).clamp(0.0, GOES_ON_S);
                Wish::World(
                    direction + rates * ahead_s,
                    if ahead_s < GOES_ON_S { rates } else { DVec2::ZERO },
                )
            }
        }
    }

    /// Whether the trigger is pressed, and the next act.
    pub(super) fn word(&self) -> (bool, Option<Act>) {
        let mut held = self.lock();
        (held.pressed, held.acts.pop_front())
    }

    /// Rounds that went off since the last call.
    pub(super) fn take_blows(&self) -> u32 {
        std::mem::take(&mut self.lock().blows)
    }

    /// Whole even where a holder panicked.
    fn lock(&self) -> MutexGuard<'_, Held> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
