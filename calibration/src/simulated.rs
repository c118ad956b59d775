//! Recordings with known truth, for tests and for trying out: a camera and an inertial unit on one rigid mount that moves by closed
//! formulas. Nothing here uses the solvers.

use std::f64::consts::TAU;

use bowwave_core::{geometry::look, time::Time};
use glam::{DQuat, DVec3};

use crate::alignment::{ImuReading, Observation};

/// How the mount moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Camera and unit in the hand: about three axes, up to 60 deg/s.
    ByHand,
    /// The gun swung about both its axes, up to 40 deg/s.
    TraverseAndElevation,
    /// The gun trained slowly by a few degrees.
    SlowMount,
    /// The gun swung left and right only.
    TraverseOnly,
    /// The gun raised and lowered only.
    ElevationOnly,
    /// The camera rolled about its line of sight only.
    RollOnly,
    /// The gun swung left and right on a ship that rolls and pitches.
    AtSea,
    /// Nothing moves.
    Rest,
}

/// Amplitude in radians and band in hertz of one angle.
type SineBand = (f64, f64, f64);

impl Motion {
    /// Traverse, elevation, roll.
    fn bands(self) -> [SineBand; 3] {
        let deg = |d: f64, low: f64, high: f64| (d.to_radians(), low, high);
        let none = (0.0, 0.1, 0.2);
        match self {
            Self::ByHand => [deg(15.0, 0.15, 0.9), deg(12.0, 0.15, 0.9), deg(12.0, 0.15, 0.9)],
            Self::TraverseAndElevation => [deg(20.0, 0.05, 0.3), deg(8.0, 0.05, 0.3), none],
            Self::SlowMount => [deg(3.0, 0.02, 0.08), deg(2.0, 0.02, 0.08), none],
            Self::TraverseOnly => [deg(20.0, 0.05, 0.3), none, none],
            Self::ElevationOnly => [none, deg(10.0, 0.05, 0.3), none],
            Self::RollOnly => [none, none, deg(15.0, 0.1, 0.5)],
            Self::AtSea => [deg(15.0, 0.05, 0.3), deg(2.0, 0.1, 0.2), deg(4.0, 0.07, 0.14)],
            Self::Rest => [none; 3],
        }
    }
}

/// Recipe of a simulated recording. Angles in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recipe {
    /// The movement.
    pub motion: Motion,
    /// Everything random follows from it.
    pub seed: u64,
    /// Length of the recording.
    pub seconds: f64,
    /// Pictures a second.
    pub camera_hz: f64,
    /// Noise of the camera's orientation about each axis.
    pub camera_sigma: f64,
    /// Noise of the camera's stamps, seconds.
    pub jitter_s: f64,
    /// Readings a second.
    pub gyro_hz: f64,
    /// Angle random walk of the gyro, rad/sqrt(s).
    pub gyro_walk: f64,
    /// Its bias, rad/s.
    pub gyro_bias: DVec3,
    /// Rotation from the unit to the camera.
    pub camera_from_imu: DQuat,
    /// Time offset, added to the camera's stamps.
    pub offset_s: f64,
    /// Read-out time of the picture; where the target is in it differs from picture to picture.
    pub readout_s: f64,
}

impl Recipe {
    /// A minute at 30 pictures and 200 readings a second; a middling MEMS gyro (0.005 deg/s/sqrt(Hz), half a degree a second of bias); unit
    /// x forward, y right, z down, askew by some degrees; offset of some tens of milliseconds.
    pub fn minute(motion: Motion, camera_sigma: f64, jitter_s: f64, seed: u64) -> Self {
        let mut random = Random::new(seed ^ 0x0051_7cc1_b727_220a);
        let askew = random.vector() * 0.05;
        Self {
            motion,
            seed,
            seconds: 60.0,
            camera_hz: 30.0,
            camera_sigma,
            jitter_s,
            gyro_hz: 200.0,
            gyro_walk: 0.005f64.to_radians(),
            gyro_bias: random.vector() * 0.3f64.to_radians(),
            camera_from_imu: DQuat::from_scaled_axis(askew) * DQuat::from_xyzw(-0.5, -0.5, -0.5, 0.5),
            offset_s: 0.03 * random.gauss(),
            readout_s: 0.0,
        }
    }

    /// Angles and their rates of one axis: a sum of sines.
    fn sines(&self) -> [Vec<[f64; 3]>; 3] {
        const SINES: usize = 6;
        let mut random = Random::new(self.seed);
        self.motion.bands().map(|(amplitude, low, high)| {
            (0..SINES)
                .map(|_| {
                    let hz = low * (high / low).powf(random.unit());
                    [amplitude * (2.0 / SINES as f64).sqrt(), TAU * hz, TAU * random.unit()]
                })
                .collect()
        })
    }

    /// When the recording's first reading is made.
    pub const EPOCH: Time = Time::from_ns(3_600_000_000_000);

    /// The camera so many seconds after the first reading, in a world with z up, and its rate in its own axes, rad/s. Asked for many instants
    /// at once, because the movement is made of `seed` anew.
    pub fn poses(&self, seconds: &[f64]) -> Vec<(DQuat, DVec3)> {
        let sines = self.sines();
        seconds.iter().map(|t| pose(&sines, *t)).collect()
    }

    /// The recording.
    pub fn record(&self) -> Recording {
        let sines = self.sines();
        let mut random = Random::new(self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 77);
        // The board, or the world, stands any way; recordings do not begin at the clock's zero.
        let board_from_world = DQuat::from_scaled_axis(random.vector());
        let epoch = Self::EPOCH;
        let camera_s = |i: usize| 0.7 + i as f64 / self.camera_hz;
        let imu_from_camera = self.camera_from_imu.inverse();
        let density = self.gyro_walk * self.gyro_hz.sqrt();
        let readings = (0..(self.seconds * self.gyro_hz) as usize)
            .map(|i| {
                let t = i as f64 / self.gyro_hz;
                let (world_from_camera, rate) = pose(&sines, t);
                let up = imu_from_camera * (world_from_camera.inverse() * DVec3::Z);
                ImuReading {
                    time: epoch.plus_secs(t),
                    rate: imu_from_camera * rate + self.gyro_bias + random.vector() * density,
                    specific_force: Some(up * 9.81 + random.vector() * 0.3),
                }
            })
            .collect();
        let count = ((self.seconds - 1.4) * self.camera_hz) as usize;
        let mut orientations = Vec::with_capacity(count);
        let mut ups = Vec::with_capacity(count);
        for i in 0..count {
            let row = if self.readout_s > 0.0 { random.unit() - 0.5 } else { 0.0 };
            let (world_from_camera, _) = pose(&sines, camera_s(i) + row * self.readout_s);
            let stamp = epoch.plus_secs(camera_s(i) - self.offset_s + self.jitter_s * random.gauss());
            let noise = DQuat::from_scaled_axis(random.vector() * self.camera_sigma);
            orientations.push(Observation::Orientation {
                stamp,
                reference_from_camera: board_from_world * world_from_camera * noise,
                sigma: self.camera_sigma,
                row,
                chain: 0,
            });
            let noise = DQuat::from_scaled_axis(random.vector() * self.camera_sigma);
            ups.push(Observation::Up {
                stamp,
                up_in_camera: noise * (world_from_camera.inverse() * DVec3::Z),
                sigma: self.camera_sigma,
                row,
            });
        }
        Recording { recipe: *self, readings, orientations, ups }
    }
}

/// `world_from_camera` and the rate in the camera's axes, both in closed form.
fn pose(sines: &[Vec<[f64; 3]>; 3], t: f64) -> (DQuat, DVec3) {
    let [traverse, elevation, roll] = sines.each_ref().map(|all| {
        all.iter().fold((0.0, 0.0), |(angle, rate), [a, w, phase]| {
            let (sin, cos) = (w * t + phase).sin_cos();
            (angle + a * sin, rate + a * w * cos)
        })
    });
    let by_elevation =
        DQuat::from_rotation_x(-elevation.0) * (DVec3::Y * traverse.1) + DVec3::X * elevation.1;
    let rate = DQuat::from_rotation_z(-roll.0) * by_elevation + DVec3::Z * roll.1;
    (look(traverse.0, elevation.0, roll.0), rate)
}

/// A simulated recording with its truth.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The truth.
    pub recipe: Recipe,
    /// Of the inertial unit.
    pub readings: Vec<ImuReading>,
    /// Of a target board.
    pub orientations: Vec<Observation>,
    /// Of the horizon, with noise of its own.
    pub ups: Vec<Observation>,
}

/// Random numbers: splitmix64 (Steele, Lea & Flood 2014) and Box & Muller's method.
#[derive(Clone, Debug)]
pub struct Random(u64);

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Random {
    /// The sequence that belongs to `seed`.
    pub fn new(seed: u64) -> Self {
        // The state counts on by a constant: seeds that differ by it would give one sequence, shifted.
        Self(mix(mix(seed) ^ 0x6a09_e667_f3bc_c909))
    }

    /// Uniform in (0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        ((mix(self.0) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    /// Standard normal.
    pub fn gauss(&mut self) -> f64 {
        (-2.0 * self.unit().ln()).sqrt() * (TAU * self.unit()).cos()
    }

    /// Three standard normal numbers.
    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.gauss(), self.gauss(), self.gauss())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_the_derivative_of_poses() {
        for motion in [Motion::ByHand, Motion::AtSea, Motion::TraverseAndElevation] {
            let sines = Recipe::minute(motion, 1e-3, 0.0, 5).sines();
            for t in [0.0, 1.7, 33.3] {
                let h = 1e-5;
                let turn = pose(&sines, t - h).0.inverse() * pose(&sines, t + h).0;
                let off = crate::solve::so3::log(turn) / (2.0 * h) - pose(&sines, t).1;
                assert!(off.length() < 1e-8, "{motion:?} at {t}: {off}");
            }
        }
    }
}
