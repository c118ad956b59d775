//! The simulated gun, unit and trigger as a pure function of what the hands want: no clock, no threads.

use bowwave_core::{
    act::TraineeAct,
    event::{Event, TriggerEdge},
    geometry::CameraPose,
    time::{Time, secs_to_ns},
};
use bowwave_devices::vectornav::CommonOutput;
use glam::{DQuat, DVec2};
use rand_pcg::Pcg64;

use super::{
    gun::{Gun, MountModel, STEP_S},
    hands::Hands,
    script::Script,
    sight::recoil,
};
use crate::{
    make::{
        Recipe,
        imu::{Exact, Unit, draw_latency},
    },
    ocean::random::{gaussian, stream},
    panorama::PanoramaRecipe,
};

/// Length after which the unit's slow errors repeat, seconds.
const SLOW_S: f64 = 60.0;
/// A round's blow on the mount: turn upwards and its deviation, deviation to the side, rad/s. A heavy machine gun's recoil of 50 N s passes the
/// pintle some millimetres off, most of it taken by the cradle's buffer.
const BLOW: [f64; 3] = [0.02, 0.02, 0.025];

/// Gun, unit and trigger.
pub(super) struct Bench {
    pub gun: Gun,
    unit: Unit,
    imu_from_camera: DQuat,
    recipe: Recipe,
    hands: Hands,
    script: Option<Script>,
    rest: DVec2,
    origin: Time,
    samples: u64,
    pressed: bool,
    blows: Pcg64,
    latency: Pcg64,
    frames: u32,
}

impl Bench {
    /// A bench whose time begins with the host's clock, until [`Self::begun`] says when.
    pub fn new(panorama: &PanoramaRecipe, hands: Hands, script: Option<Script>) -> Self {
        let recipe = panorama.recipe.clone();
        let gun = Gun::new(MountModel::default(), panorama.motion.clone());
        Self {
            rest: gun.angles(),
            gun,
            unit: Unit::new(&recipe),
            imu_from_camera: recipe.camera_from_imu().inverse(),
            hands,
            script,
            origin: Time::from_ns(0),
            samples: 0,
            pressed: false,
            blows: stream(recipe.seed, 0xb10),
            latency: stream(recipe.seed, 0xca3),
            frames: 0,
            recipe,
        }
    }

    /// The same with its time beginning at `origin`.
    pub fn begun(self, origin: Time) -> Self {
        Self { origin, ..self }
    }

    /// Time at which the next sample is measured.
    pub fn next_sample(&self) -> Time {
        self.time_of(self.samples as f64 / self.recipe.imu.rate_hz)
    }

    /// Moves the gun to the next sample and measures it: puts the unit's packet into `packet`, and adds what the hands did besides to `events`.
    /// Gives the packet's arrival.
    pub fn sample(&mut self, packet: &mut Vec<u8>, events: &mut Vec<Event>) -> Time {
        let time_s = self.samples as f64 / self.recipe.imu.rate_hz;
        let time = self.time_of(time_s);
        self.samples += 1;
        if let Some(script) = &mut self.script {
            script.play(time_s, time, &self.hands);
        }
        for _ in 0..self.hands.take_blows() {
            let [up, spread, aside] = BLOW;
            let blow = DVec2::new(aside * gaussian(&mut self.blows), up + spread * gaussian(&mut self.blows));
            self.gun.kick(blow);
        }
        while self.gun.time_s() < time_s - 0.5 * STEP_S {
            let wish = self.hands.wish(self.time_of(self.gun.time_s()), self.rest);
            self.gun.step(&wish);
        }
        let (pressed, act) = self.hands.word();
        if pressed != self.pressed {
            self.pressed = pressed;
            events.push(Event::Trigger(TriggerEdge { time, pressed }));
        }
        events.extend(act.map(|act| Event::Act(TraineeAct { time, act })));
        let exact = Exact::of(&self.gun.state(time_s), self.imu_from_camera);
        let sample = self.unit.measure(&exact, (self.origin, time_s), time_s / SLOW_S, 0.0);
        packet.clear();
        if let Some(output) = CommonOutput::from_sample(&sample) {
            output.encode(packet);
        }
        sample.arrival
    }

    /// The next picture: its number, stamp and mid-exposure.
    pub fn next_frame(&self) -> DueFrame {
        let stamp = self.origin.plus_ns(self.recipe.frame_stamp_ns(self.frames));
        let exposed_s = stamp.secs_since(self.origin) + self.recipe.exposure_delay_s();
        DueFrame { number: self.frames, stamp, exposed_s }
    }

    /// Goes on to the next picture; when the one that was due reaches the host.
    pub fn frame_taken(&mut self) -> Time {
        let stamp = self.next_frame().stamp;
        self.frames += 1;
        stamp.plus_ns(draw_latency(&mut self.latency, self.recipe.camera.latency_ns))
    }

    /// The last moment of a picture's exposure, seconds after the begin.
    pub fn exposure_end_s(&self, frame: &DueFrame) -> f64 {
        frame.exposed_s + 0.5 * self.recipe.camera.readout_ns.unsigned_abs() as f64 * 1e-9
    }

    /// The camera's pose at a time that the gun has reached.
    pub fn pose(&self, time_s: f64) -> CameraPose {
        self.gun.pose(time_s)
    }

    /// How many times as far from where the bore vanishes the muzzle is seen at such a time as at rest.
    pub fn recoil(&self, time_s: f64) -> f64 {
        recoil(self.gun.recoil_m(time_s))
    }

    /// A time of the bench on the host's clock.
    pub fn time_of(&self, time_s: f64) -> Time {
        self.origin.plus_ns(secs_to_ns(time_s))
    }
}

/// A picture that is due.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DueFrame {
    pub number: u32,
    pub stamp: Time,
    /// Its mid-exposure, seconds after the begin.
    pub exposed_s: f64,
}
