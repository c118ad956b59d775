//! A simulated gun that somebody at a mouse, a script or a simulated gunner aims.

use bowwave_core::{event::Event, geometry::CameraPose, gunner::Gunner, time::Time, world::World};
use glam::DVec2;
use hw_sim::{live::Live, replay::ReplayError};

/// A simulated gun.
pub struct LiveSource {
    live: Live,
    /// Angle of the picture's width at its middle, radians.
    width: f64,
    gunner: Option<Gunner>,
    /// Step of the gunner that comes next.
    step: u64,
    pressed: bool,
    rounds: u32,
    error: Option<ReplayError>,
}

impl LiveSource {
    /// Of a simulated gun whose picture's width spans `width` radians at the rate of its middle; `gunner` aims it where there is one.
    pub const fn new(live: Live, width: f64, gunner: Option<Gunner>) -> Self {
        Self { live, width, gunner, step: 0, pressed: false, rounds: 0, error: None }
    }

    /// When it begins, on the clock of its events.
    pub const fn origin(&self) -> Time {
        self.live.origin()
    }

    pub(super) fn collect(&mut self, until: Time, events: &mut Vec<Event>) {
        // An error ends the run; what came before it is still shown.
        if let Err(e) = self.live.collect(until, events) {
            self.error.get_or_insert(e);
        }
    }

    pub(super) fn turn(&self, [right, up]: [f64; 2]) {
        self.live.hands().turn(DVec2::new(right, up) * self.width);
    }

    pub(super) fn watch(&mut self, world: &World) {
        let rounds = world.score().shots as u32;
        self.live.hands().blow(rounds.saturating_sub(self.rounds));
        self.rounds = rounds;
        let (Some(gunner), Some(running)) = (&mut self.gunner, world.running()) else { return };
        gunner.hear(world);
        let time_s = running.now.secs_since(running.start);
        // Frames come as often as a gunner's steps, rounded to nanoseconds: a step is due half of one early. Those that a stall held up are made
        // good.
        while (self.step as f64 - 0.5) * Gunner::STEP_S <= time_s {
            let Some(moved) = gunner.step(world, self.step as f64 * Gunner::STEP_S) else { return };
            self.step += 1;
            let hands = self.live.hands();
            // What the picture shows is what is aimed by: boat and barrel are both of its time.
            hands.point(running.now, moved.bore, moved.rates);
            moved.acts.into_iter().for_each(|act| hands.act(act));
            if moved.pressed != self.pressed {
                self.pressed = moved.pressed;
                hands.press(moved.pressed);
            }
        }
    }

    pub(super) const fn has_ended(&self) -> bool {
        self.error.is_some()
    }

    pub(super) const fn take_error(&mut self) -> Option<ReplayError> {
        self.error.take()
    }

    pub(super) fn truth_at(&self, mid_exposure: Time) -> Option<CameraPose> {
        self.live.truth_at(mid_exposure)
    }

    pub(super) fn counters(&self) -> Vec<(&'static str, u64)> {
        let stats = self.live.stats();
        vec![
            ("imu_bad_checksums", stats.imu.bad_crc),
            ("imu_skipped_bytes", stats.imu.skipped_bytes),
            ("imu_overwritten", stats.imu_overflow),
            ("imu_line_lost_bytes", stats.line_lost_bytes),
            ("pictures_overwritten", stats.frames_overwritten),
            ("pictures_late", stats.frames_late),
        ]
    }

    pub(super) fn stop(self) -> Result<(), ReplayError> {
        self.live.stop()
    }
}
