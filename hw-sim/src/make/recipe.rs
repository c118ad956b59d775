//! The recipe: all numbers of a recording.

use bowwave_core::{
    event::MarkKind,
    geometry::{Distortion, Lens},
    sea::BeaufortForce,
};
use glam::{DQuat, DVec3};

use super::{
    MakeError,
    motion::{GunMotion, Motion, Periodic, ShipMotion},
};
use crate::ocean::{
    cloudy::SkyRecipe,
    spectrum::{Swell, WindSea, wind_of_beaufort},
};

/// A recording to be made. The default is the trainer's embedded one: 20 s of a light breeze (Beaufort 2) that loop without a
/// seam, 1280x720 at 30 Hz, seen from 8 m.
#[derive(Clone, Debug, PartialEq)]
pub struct Recipe {
    /// Picture width, pixels.
    pub width: u32,
    /// Picture height, pixels.
    pub height: u32,
    /// Length of the recording and period of everything in it, seconds. Must hold a whole number of frames and of samples.
    pub duration_s: f64,
    /// Pictures a second.
    pub frame_rate_hz: f64,
    /// Seed of waves, clouds and noise.
    pub seed: u64,
    /// Wind, which makes the wind sea.
    pub beaufort: BeaufortForce,
    /// Where the wind comes from, radians clockwise from north.
    pub wind_from: f64,
    /// A swell besides the wind sea.
    pub swell: Option<Swell>,
    /// Sun, clouds and air.
    pub sky: SkyRecipe,
    /// Distance at which haze leaves 2 % of the contrast, metres.
    pub visibility_m: f64,
    /// The camera above the mean sea, metres.
    pub eye_height_m: f64,
    /// The camera.
    pub camera: CameraRecipe,
    /// How the ship moves.
    pub ship: ShipMotion,
    /// How the gun is moved.
    pub gun: GunMotion,
    /// The inertial unit.
    pub imu: ImuRecipe,
    /// The ship's own heading, where it reaches the gun.
    pub ship_feed: Option<ShipFeedRecipe>,
    /// When the operator presses, and at what the gun then stands by its motion, seconds after the recording's start.
    pub marks: Vec<(f64, MarkKind)>,
    /// When the trigger is pressed.
    pub trigger: Vec<Burst>,
    /// The scenario that belongs to the recording, where there is one.
    pub scenario_toml: Option<String>,
}

/// The camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraRecipe {
    /// Horizontal field of view, radians: of a fisheye as it is, else of the undistorted lens.
    pub hfov: f64,
    /// How the lens bends straight lines.
    pub distortion: Distortion,
    /// Variance of the noise of dark pixels, in squared units of white.
    pub read_noise: f64,
    /// Growth of the noise's variance with light, in units of white.
    pub shot_noise: f64,
    /// Share of the natural (cosine to the fourth) fall-off of light towards the corners, 0 to 1.
    pub vignetting: f64,
    /// JPEG quality, 1 to 100.
    pub jpeg_quality: u8,
    /// Add this to a frame's stamp to get the time on the inertial unit's host-mapped clock, nanoseconds. The pictures are
    /// sharp: motion within the exposure is not drawn.
    pub time_offset_ns: i64,
    /// From reading the picture's first row to reading its last, nanoseconds; negative where the last is read first, zero where all
    /// are exposed at once. The stamp is the middle row's.
    pub readout_ns: i64,
    /// From the stamp to the picture's arrival at the host, nanoseconds, least and most.
    pub latency_ns: [i64; 2],
}

/// The inertial unit, in VectorNav's axes (x forward, y right, z down).
#[derive(Clone, Debug, PartialEq)]
pub struct ImuRecipe {
    /// Samples a second.
    pub rate_hz: f64,
    /// Deviation of the gyro's white noise, rad/s a sample.
    pub gyro_noise: f64,
    /// Deviation of the accelerometer's white noise, m/s^2 a sample.
    pub accel_noise: f64,
    /// Constant gyro bias, rad/s; the calibration knows it.
    pub gyro_bias: DVec3,
    /// Deviation of the gyro bias's slow walk, rad/s; no calibration knows it. It sums to zero over the recording.
    pub gyro_bias_walk: f64,
    /// Constant accelerometer bias, m/s^2.
    pub accel_bias: DVec3,
    /// Smallest step of the rates, rad/s.
    pub gyro_step: f64,
    /// Smallest step of the accelerations, m/s^2.
    pub accel_step: f64,
    /// Deviation of the unit's own roll and pitch from truth, radians, slowly varying.
    pub tilt_error: f64,
    /// Deviation of the unit's own heading from truth, radians, slowly varying.
    pub heading_error: f64,
    /// Small turn of the unit against its nominal place on the camera, radians about the camera's axes.
    pub misalignment: DVec3,
    /// How much faster than the host's the unit's clock runs, parts per million.
    pub clock_drift_ppm: f64,
    /// The unit's clock at the recording's start, nanoseconds.
    pub clock_start_ns: i64,
    /// From the measurement to the packet's arrival at the host, nanoseconds, least and most.
    pub latency_ns: [i64; 2],
    /// Jolt when the trigger is pressed: dry shots; nothing without.
    pub jolt: Option<Jolt>,
}

/// How a gun jolts when its sear lets go, along the unit's x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jolt {
    /// From the press to the jolt, seconds.
    pub latency_s: f64,
    /// Deviation of that from press to press, seconds.
    pub spread_s: f64,
    /// Its first and largest acceleration, m/s^2.
    pub peak: f64,
}

impl Jolt {
    /// Acceleration so many seconds after the sear let go, m/s^2: it rings out.
    pub fn felt(&self, since_s: f64) -> f64 {
        if since_s < 0.0 { 0.0 } else { self.peak * (-since_s / 0.04).exp() * (300.0 * since_s).cos() }
    }
}

/// The ship's own heading as lines of `$HEHDT`, or of `$PASHR` with roll and pitch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShipFeedRecipe {
    /// Lines a second; a whole number within the recording.
    pub rate_hz: f64,
    /// Deviation of the heading's white noise, radians.
    pub noise: f64,
    /// Constant error, radians.
    pub offset: f64,
    /// Smallest step of what is told, degrees.
    pub step_deg: f64,
    /// Whether roll and pitch are told, too.
    pub attitude: bool,
    /// From the measurement to the line's last byte at the host, nanoseconds, least and most.
    pub latency_ns: [i64; 2],
}

impl Default for ShipFeedRecipe {
    fn default() -> Self {
        let deg = f64::to_radians;
        // A gyro compass: ten lines a second in tenths of a degree, 20 characters each at 4800 baud.
        Self {
            rate_hz: 10.0,
            noise: deg(0.05),
            offset: 0.0,
            step_deg: 0.1,
            attitude: false,
            latency_ns: [60_000_000, 75_000_000],
        }
    }
}

/// One pull of the trigger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Burst {
    /// Seconds after the recording's start.
    pub start_s: f64,
    /// How long it is held, seconds.
    pub length_s: f64,
}

impl Default for Recipe {
    fn default() -> Self {
        let deg = f64::to_radians;
        let turn = |mean: f64, list: &[(u32, f64, f64)]| {
            let list: Vec<_> = list.iter().map(|&(n, a, p)| (n, deg(a), p)).collect();
            Periodic::new(deg(mean), &list)
        };
        let burst = |start_s, length_s| Burst { start_s, length_s };
        Self {
            width: 1280,
            height: 720,
            duration_s: 20.0,
            frame_rate_hz: 30.0,
            seed: 1,
            beaufort: light_breeze(),
            wind_from: deg(330.0),
            swell: Some(Swell { height_m: 0.35, period_s: 20.0 / 3.0, from: deg(295.0) }),
            sky: SkyRecipe {
                sun_azimuth: deg(112.0),
                sun_elevation: deg(38.0),
                turbidity: 3.2,
                cloud_cover: 0.42,
            },
            visibility_m: 35_000.0,
            eye_height_m: 8.0,
            camera: CameraRecipe::default(),
            ship: ShipMotion {
                heading: turn(318.0, &[(1, 0.4, 0.3), (3, 0.15, 1.9)]),
                pitch: turn(0.2, &[(4, 0.7, 0.8), (5, 0.35, 2.6)]),
                roll: turn(0.4, &[(2, 1.1, 0.4), (3, 2.2, 1.1)]),
                heave: Periodic::new(0.0, &[(3, 0.025, 0.2), (4, 0.015, 1.4)]),
            },
            gun: GunMotion {
                // About bearing 0 (the bow lies at 318 degrees).
                traverse: turn(42.0, &[(1, 11.0, 0.0), (2, 14.0, 0.6), (5, 0.6, 1.0)]),
                elevation: turn(-6.2, &[(2, 0.9, 2.0), (3, 0.5, 0.2), (7, 0.12, 0.0)]),
            },
            imu: ImuRecipe::default(),
            ship_feed: None,
            marks: Vec::new(),
            trigger: vec![burst(3.2, 0.45), burst(6.1, 0.3), burst(10.4, 0.8), burst(15.7, 0.5)],
            scenario_toml: None,
        }
    }
}

impl Default for CameraRecipe {
    fn default() -> Self {
        Self {
            hfov: 60f64.to_radians(),
            distortion: Distortion::None,
            read_noise: 2.5e-6,
            shot_noise: 3.0e-5,
            vignetting: 0.5,
            jpeg_quality: 86,
            time_offset_ns: 4_000_000,
            readout_ns: 0,
            latency_ns: [12_000_000, 15_000_000],
        }
    }
}

impl Default for ImuRecipe {
    fn default() -> Self {
        let deg = f64::to_radians;
        Self {
            rate_hz: 200.0,
            // 0.0035 deg/s and 0.14 mg per root hertz, as data sheets of the class state, over 100 Hz.
            gyro_noise: deg(0.035),
            accel_noise: 0.0137,
            gyro_bias: DVec3::new(deg(0.11), deg(-0.07), deg(0.16)),
            gyro_bias_walk: deg(0.004),
            accel_bias: DVec3::new(0.015, -0.02, 0.03),
            gyro_step: deg(0.01),
            accel_step: 0.0025,
            tilt_error: deg(0.02),
            heading_error: deg(0.025),
            misalignment: DVec3::new(0.0042, -0.0031, 0.0055),
            clock_drift_ppm: 35.0,
            clock_start_ns: 81_234_567_000,
            latency_ns: [300_000, 2_000_000],
            jolt: None,
        }
    }
}

impl Recipe {
    /// The lens that the pictures are drawn with.
    pub fn lens(&self) -> Lens {
        let CameraRecipe { hfov, distortion, .. } = self.camera;
        match distortion {
            Distortion::Fisheye(fisheye) => Lens::fisheye(self.width, self.height, hfov, fisheye.k()),
            _ => Lens { distortion, ..Lens::pinhole(self.width, self.height, hfov) },
        }
    }

    /// The camera's exact motion; time 0 is the recording's start.
    pub fn motion(&self) -> Motion {
        Motion::new(self.ship.clone(), self.gun.clone(), self.eye_height_m, self.duration_s)
    }

    /// Rotation from the inertial unit's axes to the camera's.
    pub fn camera_from_imu(&self) -> DQuat {
        // The unit's x, y, z are the camera's z, x, y.
        let nominal = DQuat::from_mat3(&glam::DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y));
        (DQuat::from_scaled_axis(self.imu.misalignment) * nominal).normalize()
    }

    /// Seconds from a frame's stamp to when it was really exposed, on the clock of [`Recipe::motion`]. The calibrated offset
    /// leads to the inertial unit's time as the host sees it, late by the link's least latency.
    pub fn exposure_delay_s(&self) -> f64 {
        (self.camera.time_offset_ns - self.imu.latency_ns[0]) as f64 * 1e-9
    }

    /// Significant height of wind sea and swell together (their energies add), metres.
    pub fn significant_height_m(&self) -> f64 {
        let wind_sea = WindSea::new(wind_of_beaufort(self.beaufort.get())).significant_height();
        wind_sea.hypot(self.swell.map_or(0.0, |swell| swell.height_m))
    }

    /// How many frames.
    pub fn frames(&self) -> u32 {
        (self.duration_s * self.frame_rate_hz).round() as u32
    }

    /// How many samples of the inertial unit.
    pub fn samples(&self) -> u32 {
        (self.duration_s * self.imu.rate_hz).round() as u32
    }

    /// Length in nanoseconds.
    pub fn duration_ns(&self) -> i64 {
        bowwave_core::time::secs_to_ns(self.duration_s)
    }

    /// A frame's stamp, nanoseconds after the start.
    pub fn frame_stamp_ns(&self, frame: u32) -> i64 {
        // Divided last: an accumulated period of 33.3 ms would drift.
        bowwave_core::time::secs_to_ns(f64::from(frame) / self.frame_rate_hz)
    }

    /// Refuses numbers that make no recording.
    pub fn check(&self) -> Result<(), MakeError> {
        let bad = |what: &'static str, value: f64, range: &'static str| {
            Err(MakeError::Recipe { what, value, range })
        };
        let inside = |what, value: f64, low: f64, high: f64, range| {
            if (low..=high).contains(&value) { Ok(()) } else { bad(what, value, range) }
        };
        let camera = &self.camera;
        inside("width", f64::from(self.width), 16.0, 4096.0, "16 to 4096 px")?;
        inside("height", f64::from(self.height), 16.0, 4096.0, "16 to 4096 px")?;
        inside("duration_s", self.duration_s, 0.5, 600.0, "0.5 to 600 s")?;
        inside("frame_rate_hz", self.frame_rate_hz, 1.0, 240.0, "1 to 240 Hz")?;
        inside("imu.rate_hz", self.imu.rate_hz, 10.0, 1000.0, "10 to 1000 Hz")?;
        inside("sky.sun_elevation", self.sky.sun_elevation, 0.02, 1.56, "1.2 to 89 degrees")?;
        inside("sky.turbidity", self.sky.turbidity, 1.0, 10.0, "1 to 10")?;
        inside("sky.cloud_cover", self.sky.cloud_cover, 0.0, 1.0, "0 to 1")?;
        inside("visibility_m", self.visibility_m, 100.0, 1e6, "100 m to 1000 km")?;
        inside("eye_height_m", self.eye_height_m, 1.0, 200.0, "1 to 200 m")?;
        inside("camera.hfov", camera.hfov, 0.02, 1.75, "1.2 to 100 degrees")?;
        inside("camera.read_noise", camera.read_noise, 0.0, 0.1, "0 to 0.1")?;
        inside("camera.shot_noise", camera.shot_noise, 0.0, 0.1, "0 to 0.1")?;
        inside("camera.vignetting", camera.vignetting, 0.0, 1.0, "0 to 1")?;
        inside("camera.readout_ns", camera.readout_ns as f64, -1e8, 1e8, "-100 to 100 ms")?;
        inside("camera.jpeg_quality", f64::from(camera.jpeg_quality), 1.0, 100.0, "1 to 100")?;
        inside("imu.clock_drift_ppm", self.imu.clock_drift_ppm, -400.0, 400.0, "-400 to 400 ppm")?;
        if let Some(jolt) = &self.imu.jolt {
            inside("imu.jolt.latency_s", jolt.latency_s, -0.2, 0.2, "-0.2 to 0.2 s")?;
            inside("imu.jolt.spread_s", jolt.spread_s, 0.0, 0.05, "0 to 0.05 s")?;
            inside("imu.jolt.peak", jolt.peak, 0.0, 1e3, "0 to 1000 m/s^2")?;
        }
        if let Some(swell) = &self.swell {
            inside("swell.height_m", swell.height_m, 0.0, 12.0, "0 to 12 m")?;
            inside("swell.period_s", swell.period_s, 2.0, 20.0, "2 to 20 s")?;
        }
        let feed = self.ship_feed.iter().map(|feed| ("ship_feed.latency_ns", feed.latency_ns));
        let latencies = [("camera.latency_ns", camera.latency_ns), ("imu.latency_ns", self.imu.latency_ns)];
        for (what, latency) in latencies.into_iter().chain(feed) {
            inside(what, latency[0] as f64, 0.0, latency[1] as f64, "0 to the greatest latency")?;
            inside(what, latency[1] as f64, 0.0, 2e8, "0 to 200 ms")?;
        }
        let feed = self.ship_feed.iter().map(|feed| ("ship_feed.rate_hz", feed.rate_hz));
        let rates = [("frame_rate_hz", self.frame_rate_hz), ("imu.rate_hz", self.imu.rate_hz)];
        for (what, rate) in rates.into_iter().chain(feed) {
            let count = self.duration_s * rate;
            if (count - count.round()).abs() > 1e-6 {
                return bad(what, rate, "a whole number within duration_s, or the recording cannot loop");
            }
        }
        if !self.motion().is_finite() {
            return bad("ship or gun", f64::NAN, "finite motions");
        }
        if let Some(feed) = &self.ship_feed {
            inside("ship_feed.rate_hz", feed.rate_hz, 0.1, 50.0, "0.1 to 50 Hz")?;
            inside("ship_feed.step_deg", feed.step_deg, 1e-6, 10.0, "above 0, to 10 degrees")?;
        }
        for (time_s, _) in &self.marks {
            inside("marks", *time_s, 0.0, self.duration_s, "within the recording")?;
        }
        for burst in &self.trigger {
            inside("trigger.start_s", burst.start_s, 0.0, self.duration_s, "within the recording")?;
            inside(
                "trigger.length_s",
                burst.length_s,
                1e-3,
                self.duration_s - burst.start_s,
                "released within it",
            )?;
        }
        if self.eye_height_m < self.eye_height_least_m() {
            let range = "above the crests: three quarters of the significant wave height, wind sea and swell";
            return bad("eye_height_m", self.eye_height_m, range);
        }
        self.check_view()
    }

    /// Least height of the camera above the mean sea, metres: three deviations of the water's height. It would otherwise be under water time
    /// and again.
    pub fn eye_height_least_m(&self) -> f64 {
        0.75 * self.significant_height_m()
    }

    /// The picture is drawn from a level camera's: no line of sight may come near straight down or up.
    fn check_view(&self) -> Result<(), MakeError> {
        let (lens, motion) = (self.lens(), self.motion());
        let half = lens.half_diagonal();
        let steepest = (0..200)
            .map(|i| {
                let pose = motion.at(self.duration_s * f64::from(i) / 200.0).pose;
                (pose.world_from_camera * DVec3::Z).z.abs().min(1.0).asin()
            })
            .fold(0.0, f64::max);
        if steepest + half > 75f64.to_radians() {
            return Err(MakeError::Recipe {
                what: "gun.elevation",
                value: steepest.to_degrees(),
                range: "within 75 degrees of level together with half the diagonal field of view",
            });
        }
        Ok(())
    }
}

#[expect(clippy::expect_used, reason = "2 lies within the scale")]
fn light_breeze() -> BeaufortForce {
    BeaufortForce::new(2).expect("a Beaufort force")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_sound_and_sweeps_about_north() {
        let recipe = Recipe::default();
        recipe.check().unwrap();
        assert_eq!((recipe.frames(), recipe.samples()), (600, 4000));
        let motion = recipe.motion();
        let (mut least, mut most, mut fastest) = (0.0f64, 0.0f64, 0.0f64);
        for i in 0..2000 {
            let state = motion.at(f64::from(i) * 0.01);
            let forward = state.pose.world_from_camera * DVec3::Z;
            let azimuth = forward.x.atan2(forward.y).to_degrees();
            (least, most) = (least.min(azimuth), most.max(azimuth));
            fastest = fastest.max(state.rate.length().to_degrees());
        }
        assert!((-28.0..-17.0).contains(&least) && (17.0..28.0).contains(&most), "{least} to {most}");
        assert!((9.0..22.0).contains(&fastest), "{fastest} deg/s");
    }

    #[test]
    fn recipes_that_make_no_recording_are_refused() {
        type Spoil = fn(&mut Recipe);
        let cases: [(&str, Spoil); 8] = [
            ("eye_height_m", |r| r.swell = Some(Swell { height_m: 12.0, period_s: 10.0, from: 0.0 })),
            ("width", |r| r.width = 0),
            ("duration_s", |r| r.duration_s = f64::NAN),
            ("frame_rate_hz", |r| r.frame_rate_hz = 30.01),
            ("sky.sun_elevation", |r| r.sky.sun_elevation = -0.1),
            ("ship or gun", |r| r.ship.roll.mean = f64::NAN),
            ("gun.elevation", |r| r.gun.elevation.mean = -1.2),
            ("trigger.length_s", |r| r.trigger[0].length_s = 60.0),
        ];
        for (name, spoil) in cases {
            let mut recipe = Recipe::default();
            spoil(&mut recipe);
            let error = recipe.check().unwrap_err().to_string();
            assert!(error.contains(name), "{name}: {error}");
        }
    }
}
