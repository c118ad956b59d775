//! Recordings with known truth in memory: what camera and unit report of one mount that moves by formulas, handed over as devices do.
//! The geometry of horizon and board is written anew here; only the lens and the movement's formulas are the product's.

use std::f64::consts::TAU;

use bowwave_calibration::{
    capture::{Capture, HorizonSeen, PictureSeen},
    lens::Corner,
    simulated::{Motion, Random, Recipe},
    target::{Target, seen},
};
use bowwave_core::{
    calibration::Calibration,
    event::{Event, ImuSample},
    geometry::{Distortion, Lens, horizon_dip},
};
use glam::{DMat2, DQuat, DVec2, DVec3};

/// What a recording shows and how it was moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Pattern {
    /// In the hand before the sea, a minute.
    HorizonByHand,
    /// In the hand before the sea, a quarter of a minute.
    HorizonShort,
    /// Swung on its mount on land, before the sea.
    HorizonOnMount,
    /// Left and right only, on land.
    HorizonTraverse,
    /// Left and right on a ship that rolls and pitches.
    HorizonAtSea,
    /// Raised and lowered a little, slowly.
    HorizonSlow,
    /// In the hand before a board, a minute.
    BoardByHand,
    /// In the hand before a board, a quarter of a minute.
    BoardShort,
    /// Left and right only before a board.
    BoardTraverse,
    /// Swung on its mount before a board.
    BoardOnMount,
}

impl Pattern {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::HorizonByHand,
        Self::HorizonShort,
        Self::HorizonOnMount,
        Self::HorizonTraverse,
        Self::HorizonAtSea,
        Self::HorizonSlow,
        Self::BoardByHand,
        Self::BoardShort,
        Self::BoardTraverse,
        Self::BoardOnMount,
    ];

    fn movement(self) -> (Motion, f64) {
        match self {
            Self::HorizonByHand | Self::BoardByHand => (Motion::ByHand, 60.0),
            Self::HorizonShort | Self::BoardShort => (Motion::ByHand, 16.0),
            Self::HorizonOnMount | Self::BoardOnMount => (Motion::TraverseAndElevation, 60.0),
            Self::HorizonTraverse | Self::BoardTraverse => (Motion::TraverseOnly, 45.0),
            Self::HorizonAtSea => (Motion::AtSea, 90.0),
            Self::HorizonSlow => (Motion::SlowMount, 60.0),
        }
    }

    fn is_board(self) -> bool {
        matches!(self, Self::BoardByHand | Self::BoardShort | Self::BoardTraverse | Self::BoardOnMount)
    }
}

/// Readings a second of the unit, pictures a second.
const GYRO_HZ: f64 = 200.0;
const CAMERA_HZ: f64 = 10.0;
const GRAVITY: f64 = 9.81;

/// A recording's truth and its noises.
#[derive(Clone, Debug)]
pub struct MadeRecording {
    /// Everything random follows from it.
    pub seed: u64,
    /// What it shows.
    pub pattern: Pattern,
    /// The truth: what a calibration without any error would say, with the deviations that it would state.
    pub truth: Calibration,
    /// The gyro's true scale: reading by rate.
    pub scale: DVec3,
    /// Camera above the sea, metres.
    pub eye_height_m: f64,
    motion: Recipe,
    /// Noise of the horizon: offset (pixels), slope (radians), how long it is alike (seconds).
    line: (f64, f64, f64),
    /// How far off the stated deviation of a horizon is, times.
    stated_by: f64,
    /// Error of the dip that all pictures share, radians.
    refraction: f64,
    /// Noise of corners, pixels, and of stamps, seconds.
    corner_px: f64,
    jitter_s: f64,
    /// Noise density of the gyro, rad/sqrt(s), how its bias walks, rad/s/sqrt(s), bias of the accelerometer, m/s^2.
    gyro_walk: f64,
    bias_walk: f64,
    accel_bias: DVec3,
    /// Acceleration of the ship, m/s^2.
    surge: f64,
    /// Share of the pictures with something wild.
    wild: f64,
}

impl MadeRecording {
    /// Draws a recording by its seed.
    pub fn draw(seed: u64) -> Self {
        let mut random = Random::new(seed ^ 0xc4ec_0001);
        let pattern = Pattern::ALL[(random.unit() * Pattern::ALL.len() as f64) as usize % Pattern::ALL.len()];
        let (movement, seconds) = pattern.movement();
        let motion = Recipe { seconds, ..Recipe::minute(movement, 1e-3, 0.0, seed) };
        let mut between = |low: f64, high: f64| low * (high / low).powf(random.unit());
        let focal = between(700.0, 1400.0);
        let (line_px, slope, alike) = (between(0.2, 1.0), between(0.2e-3, 1e-3), between(0.02, 1.5));
        let (stated_by, corner_px, jitter) = (between(0.5, 2.0), between(0.05, 0.2), between(0.05e-3, 1e-3));
        let (walk, bias_walk) = (between(0.0015f64, 0.01).to_radians(), between(1e-6, 1e-5));
        let eye_height_m = between(4.0, 25.0);
        let surge = if pattern == Pattern::HorizonAtSea { between(0.2, 0.8) } else { 0.0 };
        let rolling = if random.unit() < 0.5 { 0.0 } else { 0.012 + 0.016 * random.unit() };
        let radial = DVec2::new(-0.15 * random.unit(), 0.03 * random.unit());
        let lens = Lens {
            focal: DVec2::splat(focal),
            centre: DVec2::new(640.0 + 6.0 * random.gauss(), 360.0 + 6.0 * random.gauss()),
            distortion: Distortion::radial_tangential(radial, DVec2::ZERO),
            ..Lens::pinhole(1280, 720, 1.0)
        };
        let truth = Calibration {
            focal_sigma_px: 0.6,
            camera_from_imu: motion.camera_from_imu,
            camera_from_imu_sigma: DVec3::splat(0.7e-3),
            time_offset_ns: (motion.offset_s * 1e9) as i64,
            time_offset_sigma_ns: 150_000,
            readout_ns: (rolling * 1e9) as i64,
            readout_sigma_ns: if rolling > 0.0 { 300_000 } else { 0 },
            gyro_bias: motion.gyro_bias,
            gyro_bias_sigma: DVec3::splat(0.004f64.to_radians()),
            ..Calibration::nominal(lens)
        };
        Self {
            seed,
            pattern,
            truth,
            scale: DVec3::ONE,
            eye_height_m,
            motion,
            line: (line_px, slope, alike),
            stated_by,
            refraction: 0.1f64.to_radians() * random.gauss(),
            corner_px,
            jitter_s: jitter,
            gyro_walk: walk,
            bias_walk,
            accel_bias: random.vector() * 0.03,
            surge,
            wild: 0.02 * random.unit(),
        }
    }

    /// Plays the recording to a capture that looks through `lens` (which the calibration holds, right or wrong).
    pub fn play(&self, lens: Lens) -> Capture {
        let mut random = Random::new(self.seed ^ 0xc4ec_0002);
        let mut capture = Capture::new(lens, self.eye_height_m);
        self.readings(&mut random, &mut capture);
        let count = ((self.motion.seconds - 1.4) * CAMERA_HZ) as usize;
        let times: Vec<f64> = (0..count).map(|i| 0.7 + i as f64 / CAMERA_HZ).collect();
        let poses = self.motion.poses(&times);
        let later: Vec<f64> = times.iter().map(|t| t + 1e-3).collect();
        let rates_later = self.motion.poses(&later);
        let mut error = DVec2::ZERO;
        let keep = (-1.0 / (CAMERA_HZ * self.line.2)).exp();
        for ((t, (pose, rate)), (_, next)) in times.iter().zip(&poses).zip(&rates_later) {
            let swing = Swing { pose: *pose, rate: *rate, spin: (*next - *rate) / 1e-3 };
            let fresh = DVec2::new(random.gauss(), random.gauss()) * (1.0 - keep * keep).sqrt();
            error = error * keep + fresh;
            let wild = if random.unit() < self.wild { 8.0 * random.gauss() } else { 0.0 };
            let late = self.jitter_s * random.gauss() - self.truth.time_offset_ns as f64 * 1e-9;
            let mut picture = PictureSeen {
                stamp: Recipe::EPOCH.plus_secs(t + late),
                fits: true,
                horizon: None,
                is_blurred: false,
                board: None,
            };
            if self.pattern.is_board() {
                let corners = self.corners(&swing, &mut random);
                picture.board = (corners.len() >= 24).then(|| seen(&lens, corners)).flatten();
            } else {
                let off = DVec2::new((error.x + wild) * self.line.0, error.y * self.line.1);
                picture.horizon = self.horizon(&swing, &lens, off);
            }
            capture.see(&picture);
        }
        capture
    }

    fn readings(&self, random: &mut Random, capture: &mut Capture) {
        let times: Vec<f64> =
            (0..(self.motion.seconds * GYRO_HZ) as usize).map(|i| i as f64 / GYRO_HZ).collect();
        let imu_from_camera = self.truth.camera_from_imu.inverse();
        let (mut bias, density) = (self.truth.gyro_bias, self.gyro_walk * GYRO_HZ.sqrt());
        let waves: Vec<(DVec3, f64, f64)> =
            (0..4).map(|_| (random.vector(), 0.08 + 0.1 * random.unit(), TAU * random.unit())).collect();
        for (t, (world_from_camera, rate)) in times.iter().zip(self.motion.poses(&times)) {
            let ship: DVec3 =
                waves.iter().map(|(along, hz, at)| *along * (TAU * hz * t + at).sin() * 0.5).sum();
            let felt = DVec3::Z * GRAVITY + ship * self.surge;
            let force = imu_from_camera * (world_from_camera.inverse() * felt);
            bias += random.vector() * self.bias_walk / GYRO_HZ.sqrt();
            let true_rate = imu_from_camera * rate;
            let time = Recipe::EPOCH.plus_secs(*t);
            capture.take(&Event::Imu(ImuSample {
                arrival: time.plus_secs(-0.05e-3 * random.unit().ln()),
                device_time_ns: time.ns() - 7_000_000,
                rate: true_rate * self.scale + bias + random.vector() * density,
                accel: force + self.accel_bias + random.vector() * 0.2,
                world_from_imu: None,
            }));
        }
    }

    /// The horizon through the lens that is believed.
    fn horizon(&self, swing: &Swing, believed: &Lens, off: DVec2) -> Option<HorizonSeen> {
        let true_dip = horizon_dip(self.eye_height_m) + self.refraction;
        let up = swing.pose.inverse() * DVec3::Z;
        let ahead = (DVec3::Z - up * up.z).try_normalize()?;
        let half = (0.5 * f64::from(believed.width) / self.truth.lens.focal.x).atan();
        let inside = |p: &DVec2| (0.0..1280.0).contains(&p.x) && (0.0..720.0).contains(&p.y);
        let seen = |i: i32| {
            let turn = DQuat::from_axis_angle(up, half * f64::from(i) / 8.0);
            let ray = (turn * ahead) * true_dip.cos() - up * true_dip.sin();
            let pixel = self.rolled(swing, ray)?;
            let moved = off.x + off.y * (pixel.x - 640.0);
            Some(pixel + DVec2::new(0.0, moved)).filter(inside)
        };
        let pixels: Vec<DVec2> = (-8..=8).filter_map(seen).collect();
        let middle = pixels.iter().map(|p| p.y).sum::<f64>() / pixels.len().max(1) as f64;
        if pixels.len() < 9 {
            return None;
        }
        let rays: Vec<DVec3> = pixels.iter().map(|p| believed.unproject(*p)).collect();
        let up_in_camera = level(&rays, horizon_dip(self.eye_height_m), up)?;
        let sigma = (self.line.0 / believed.focal.y).hypot(self.line.1) / 2f64.sqrt() * self.stated_by;
        Some(HorizonSeen { up_in_camera, sigma, pixel: DVec2::new(640.0, middle) })
    }

    /// Where a direction that stands still in the world, given in the camera's axes at mid-exposure, falls when its row is read.
    fn rolled(&self, swing: &Swing, at: DVec3) -> Option<DVec2> {
        let lens = &self.truth.lens;
        let mut pixel = lens.project(at)?;
        for _ in 0..4 * i32::from(self.truth.readout_ns != 0) {
            pixel = lens.project(swing.turned(self.late(pixel)).inverse() * at)?;
        }
        Some(pixel)
    }

    fn late(&self, pixel: DVec2) -> f64 {
        (pixel.y / 720.0 - 0.5) * self.truth.readout_ns as f64 * 1e-9
    }

    /// Corners of a board that the camera goes round.
    fn corners(&self, swing: &Swing, random: &mut Random) -> Vec<Corner> {
        const AWAY_M: f64 = 0.42;
        let world_from_board = DQuat::from_rotation_x(0.5 * std::f64::consts::PI);
        let middle = (Target::A4.size_m() / 2.0).extend(0.0);
        let place = |late: f64| {
            let world_from_camera = swing.pose * swing.turned(late);
            // Going round it, the camera sees it from one side and from the other.
            let camera = (DVec3::Y - world_from_camera * DVec3::Z) * (1.9 * AWAY_M);
            (world_from_camera.inverse(), DVec3::Y * AWAY_M - camera)
        };
        let lens = &self.truth.lens;
        let seen = |board: DVec2| {
            let at = |late: f64| {
                let (camera_from_world, from_camera) = place(late);
                let point = world_from_board * (board.extend(0.0) - middle) + from_camera;
                lens.project(camera_from_world * point)
            };
            let mut pixel = at(0.0)?;
            for _ in 0..3 * i32::from(self.truth.readout_ns != 0) {
                pixel = at(self.late(pixel))?;
            }
            let inside = (0.0..1280.0).contains(&pixel.x) && (0.0..720.0).contains(&pixel.y);
            inside.then_some((board, pixel))
        };
        let all = (0..Target::A4.tags()).step_by(2).flat_map(|id| Target::A4.corners(id));
        let all: Vec<(DVec2, DVec2)> = all.filter_map(seen).collect();
        let mut noisy = |(board, pixel)| {
            let off = DVec2::new(random.gauss(), random.gauss()) * self.corner_px;
            Corner { board, pixel: pixel + off }
        };
        all.into_iter().map(&mut noisy).collect()
    }
}

/// A camera that turns while a picture is read.
struct Swing {
    pose: DQuat,
    rate: DVec3,
    spin: DVec3,
}

impl Swing {
    /// From the camera's axes so many seconds later to those at mid-exposure.
    fn turned(&self, late: f64) -> DQuat {
        DQuat::from_scaled_axis((self.rate + self.spin * (0.5 * late)) * late)
    }
}

/// Up that fits best to directions on a horizon, by Gauss and Newton's steps.
fn level(rays: &[DVec3], dip: f64, near: DVec3) -> Option<DVec3> {
    let mut up = near;
    for _ in 0..4 {
        let (a, b) = up.any_orthonormal_pair();
        let (mut n, mut g) = (DMat2::ZERO, DVec2::ZERO);
        for ray in rays {
            let by = DVec2::new(ray.dot(a), ray.dot(b));
            n += DMat2::from_cols(by * by.x, by * by.y);
            g += by * (ray.dot(up) + dip.sin());
        }
        let step = n.inverse() * g;
        up = (up - a * step.x - b * step.y).try_normalize()?;
    }
    up.is_finite().then_some(up)
}
