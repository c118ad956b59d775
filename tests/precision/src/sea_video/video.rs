//! A camera over the sea: pixels are rendered when somebody looks at them.

use std::f64::consts::TAU;

use bowwave_core::geometry::{CameraPose, Lens, look};
use glam::{DVec2, DVec3};
use hw_sim::ocean::{
    random::{keyed_normal, keyed_uniform},
    spectrum::cox_munk_total,
    systems::{SystemSea, WaveSystem},
};

use super::{
    gauges::{Gauged, Gauges},
    light::{SeaSky, water},
};

/// Contents of a clip.
#[derive(Clone, Debug)]
pub struct SeaClip {
    /// Class under which the errors are gathered.
    pub class: &'static str,
    /// The waves.
    pub systems: Vec<WaveSystem>,
    /// Wind that roughens the water, m/s.
    pub wind_m_s: f64,
    /// The light.
    pub sky: SeaSky,
    /// Light that comes out of the water.
    pub upwelling: f64,
    /// Height of the eye above the mean sea, metres.
    pub eye_m: f64,
    /// Mean direction of view: azimuth and elevation, radians.
    pub look: (f64, f64),
    /// The lens.
    pub lens: Lens,
    /// Size of the hand's motion: 1 is a degree.
    pub motion: f64,
    /// Error of the pose that is told, radians rms.
    pub pose_error_rad: f64,
    /// Meteorological visibility, metres.
    pub visibility_m: f64,
    /// Luminance that reaches the top of the code range.
    pub white: f64,
    /// Noise of the camera at white, share of white.
    pub noise: f64,
    /// Seed of waves, motion and noise.
    pub seed: u64,
}

/// One sRGB code to linear light.
fn decode(code: f64) -> f64 {
    if code <= 0.040_45 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

fn encode(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The clip at one time after the other.
pub struct SeaVideo {
    /// Its contents.
    pub clip: SeaClip,
    ocean: SystemSea,
    time_s: f64,
    codes: Vec<f32>,
    squares: f64,
    count: f64,
    gauges: Gauges,
}

impl SeaVideo {
    /// The first picture.
    pub fn new(clip: SeaClip) -> Self {
        let ocean = SystemSea::new(&clip.systems, 0.5 * cox_munk_total(clip.wind_m_s), clip.seed);
        let codes = (0..256).map(|i| decode(f64::from(i) / 255.0) as f32).collect();
        let gauges = Gauges::lay(clip.eye_m, clip.look.0);
        Self { clip, ocean, time_s: 0.0, codes, squares: 0.0, count: 0.0, gauges }
    }

    /// Moves on to `t` seconds, and takes note of the height of the water in view.
    pub fn advance(&mut self, t: f64) {
        self.time_s = t;
        self.ocean.advance(t);
        for i in 0..400 {
            let (u, v) = (keyed_uniform(2 * i + 1), keyed_uniform(2 * i + 2));
            let azimuth = self.clip.look.0 + (u - 0.5) * 0.7;
            let range = self.clip.eye_m * 2.0 * 6f64.powf(v);
            self.squares += self.ocean.height(DVec2::new(azimuth.sin(), azimuth.cos()) * range).powi(2);
            self.count += 1.0;
        }
        self.gauges.write(t, |place| self.ocean.water(place));
    }

    /// Peak and direction of the water that was in view, by its buoys.
    pub fn gauged(&self) -> Option<Gauged> {
        self.gauges.read()
    }

    /// Four standard deviations of the spectrum's height, metres.
    pub fn significant_m(&self) -> f64 {
        self.ocean.significant_m
    }

    /// Four standard deviations of the water that was in view, metres.
    pub fn seen_m(&self) -> f64 {
        4.0 * (self.squares / self.count.max(1.0)).sqrt()
    }

    fn wobble(&self, t: f64, axis: u64, periods: [f64; 3]) -> f64 {
        let wave = |(i, p): (usize, f64)| {
            let phase = keyed_uniform(self.clip.seed.wrapping_mul(31).wrapping_add(axis * 8 + i as u64));
            (TAU * (t / p + phase)).sin()
        };
        periods.into_iter().enumerate().map(wave).sum::<f64>() * (2.0_f64 / 3.0).sqrt()
    }

    /// Where the camera truly is.
    pub fn pose(&self, t: f64) -> CameraPose {
        let size = self.clip.motion.to_radians();
        let turn = |axis, share| self.wobble(t, axis, [1.3, 3.7, 9.1]) * share * size;
        let (azimuth, elevation) = self.clip.look;
        CameraPose {
            world_from_camera: look(azimuth + turn(0, 0.6), elevation + turn(1, 0.4), turn(2, 0.5)),
            position: DVec3::Z * self.clip.eye_m,
        }
    }

    /// The pose as an inertial unit tells it: wrong by a constant, a slow and a fast part.
    pub fn told_pose(&self, t: f64) -> CameraPose {
        let pose = self.pose(t);
        let key = self.clip.seed.wrapping_mul(0x51ed).wrapping_add((t * 1000.0) as u64 * 3);
        let axis = |i: u64| {
            let constant = 2.0 * keyed_uniform(self.clip.seed ^ (0xabc + i)) - 1.0;
            let slow = self.wobble(t, 40 + i, [2.3, 7.3, 21.0]);
            (0.8 * constant + 0.6 * slow + 0.4 * keyed_normal(key + i)[0]) * self.clip.pose_error_rad * 1.1
        };
        let error = glam::DQuat::from_scaled_axis(DVec3::new(axis(0), axis(1), axis(2)));
        CameraPose { world_from_camera: (pose.world_from_camera * error).normalize(), ..pose }
    }

    /// Light along a ray before the camera, and whether it is sky.
    pub fn radiance(&self, ray: DVec3) -> f64 {
        let clip = &self.clip;
        let eye = DVec3::Z * clip.eye_m;
        let Some(at) = self.ocean.hit(eye, ray, 4000.0) else { return clip.sky.luminance(ray) };
        let range = (at - eye).length();
        let footprint = range / clip.lens.focal.x / (-ray.z).max(0.003).sqrt();
        let facet = self.ocean.facet(at.truncate(), footprint);
        let light = water(clip.sky, ray, &facet, clip.upwelling);
        let haze = 1.0 - (-3.912 * range / clip.visibility_m).exp();
        let air = clip.sky.luminance(DVec3::new(ray.x, ray.y, 0.0));
        light + (air - light) * haze
    }

    /// The linear luminance that the code of a pixel stands for; `None` outside of the picture.
    pub fn luminance(&self, pixel: DVec2) -> Option<f32> {
        let lens = &self.clip.lens;
        let place = pixel.floor();
        if !(place.x >= 0.0
            && place.y >= 0.0
            && place.x < f64::from(lens.width)
            && place.y < f64::from(lens.height))
        {
            return None;
        }
        let pose = self.pose(self.time_s);
        let ray = pose.world_from_camera * lens.unproject(place + 0.5);
        let light = self.radiance(ray) / self.clip.white;
        let key = (place.y as u64) << 32 | (place.x as u64) << 12;
        let noise = keyed_normal(key ^ ((self.time_s * 1000.0) as u64).wrapping_mul(0x2545_f491))[0];
        let noisy = light + noise * self.clip.noise * (light.max(0.0) + 0.02).sqrt();
        let code = (encode(noisy.clamp(0.0, 1.0)) * 255.0).round() as usize;
        self.codes.get(code).copied()
    }
}
