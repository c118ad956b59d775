//! A unit on the simulated ship whose errors are drawn from what the product's filter assumes of it, and what a camera and other aids tell
//! it: how wrong orientation is, and whether the filter knows.

use bowwave_core::{
    estimate::attitude::{
        Attitude, AttitudeSettings, HeadingSeen, Noise, OWN_GROWTH, REFRACTION_SIGMA, RateKind, Source,
        UpSeen,
    },
    event::ImuSample,
    geometry::wrapped,
    time::Time,
};
use glam::{DMat2, DMat3, DQuat, DVec3};
use hw_sim::ocean::random::gaussian;
use rand::SeedableRng as _;
use rand_pcg::Pcg64;

use crate::ship::{self, Ship, ShipReading, ShipSea, UnitErrors, inclination_error};

/// How the calibration has the camera against the unit.
pub const CAMERA_FROM_IMU: DQuat = DQuat::from_xyzw(-0.5, -0.5, -0.5, 0.5);
/// From exposure to what is seen being known, seconds.
const SEEN_LATE_S: f64 = 0.045;
/// How often something is seen, seconds.
const SEEN_EVERY_S: f64 = 0.1 - 1e-6;
/// Chi squared at 99.9 % with two degrees of freedom and with one.
const LIMIT_UP: f64 = 13.8;
const LIMIT_HEADING: f64 = 10.8;
/// Errors count from here on, seconds.
pub const SETTLED_S: f64 = 60.0;
/// Errors so far apart in time are nearly independent, seconds.
const INDEPENDENT_S: f64 = 20.0;

/// Horizon that a camera sees ten times a second.
#[derive(Clone, Copy, Debug)]
pub struct AidedHorizon {
    /// It is seen for so long, then not for as long, seconds.
    pub seen_s: f64,
    /// White noise on each of its axes, radians.
    pub sigma: f64,
}

/// Source of the heading.
#[derive(Clone, Copy, Debug)]
pub enum Heading {
    /// Nothing after the start.
    Start,
    /// Something far away is seen ten times a second, with that white noise (radians), and turns by that rate (rad/s).
    Anchored(f64, f64),
    /// A compass, ten times a second, with that white noise (radians).
    Compass(f64),
}

/// Aiding observations beside the samples of a unit.
#[derive(Clone, Copy, Debug)]
pub struct SeenAids {
    camera_from_imu: DQuat,
    dip: f64,
    horizon: Option<AidedHorizon>,
    heading: Heading,
    seed: u64,
}

/// One simulated recording with its aids.
#[derive(Debug)]
pub struct AidedRecording {
    /// The unit's samples, to be damaged where that is what is tried.
    pub samples: Vec<ShipReading>,
    aids: SeenAids,
}

/// How a recording's errors come about.
#[derive(Clone, Copy, Debug)]
pub enum AidedUnit {
    /// Those of [`UnitErrors::usual`], with a camera that sits as much beside its place as is usual.
    Usual,
    /// Drawn from what the filter assumes.
    Drawn,
}

impl AidedRecording {
    /// `seconds` in that sea.
    pub fn new(
        sea: ShipSea,
        unit: AidedUnit,
        (horizon, heading): (Option<AidedHorizon>, Heading),
        seconds: f64,
        seed: u64,
    ) -> Self {
        let (errors, mounted_wrong, dip) = unit.errors(seed);
        let camera_from_imu = DQuat::from_scaled_axis(mounted_wrong) * CAMERA_FROM_IMU;
        Self {
            samples: ship::samples(&Ship::new(sea, true, seed), &errors, seconds, seed + 100),
            aids: SeenAids { camera_from_imu, dip, horizon, heading, seed },
        }
    }

    /// Goes through it; tells each sample with the orientation that was known then.
    pub fn run(&self, aided: &mut dyn Estimator, tell: impl FnMut(&ShipReading, DQuat, &dyn Estimator)) {
        self.aids.run(self.samples.iter().copied(), aided, tell);
    }
}

/// An estimator as the product has it on the gun, of that orientation.
pub fn product(source: Source) -> Attitude {
    let settings =
        AttitudeSettings { source, rate: RateKind::Instant, noise: Noise::USUAL, own_growth: OWN_GROWTH };
    Attitude::new(settings, DVec3::ZERO, CAMERA_FROM_IMU)
}

impl AidedUnit {
    /// The unit's errors, by what the camera sits beside its place (radians, the camera's axes), and by what the horizon stands too high.
    fn errors(self, seed: u64) -> (UnitErrors, DVec3, f64) {
        let noise = Noise::USUAL;
        let mut rng = Pcg64::seed_from_u64(seed + 1000);
        let mut drawn =
            |sigma: DVec3| DVec3::new(gaussian(&mut rng), gaussian(&mut rng), gaussian(&mut rng)) * sigma;
        // What a turn about each axis is measured too large by about each.
        let gains =
            [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * noise.scale + (DVec3::ONE - axis) * noise.skew);
        match self {
            Self::Usual => (UnitErrors::usual(), DVec3::new(7e-4, -6e-4, 5e-4), 0.0),
            Self::Drawn => {
                let errors = UnitErrors {
                    gyro_noise: noise.gyro,
                    gyro_bias: drawn(noise.bias),
                    gyro_walk: noise.bias_walk,
                    gyro_matrix: DMat3::from_cols(drawn(gains[0]), drawn(gains[1]), drawn(gains[2])),
                    accel_bias: drawn(DVec3::splat(noise.force)),
                    ..UnitErrors::usual()
                };
                (errors, drawn(noise.mounting), drawn(DVec3::splat(REFRACTION_SIGMA)).x)
            }
        }
    }
}

impl SeenAids {
    /// A horizon as it is with the usual unit, and a heading.
    pub const fn usual(horizon: Option<AidedHorizon>, heading: Heading) -> Self {
        Self { camera_from_imu: CAMERA_FROM_IMU, dip: 0.0, horizon, heading, seed: 1 }
    }

    /// Goes through `samples`; tells each with the orientation that was known then.
    pub fn run(
        &self,
        samples: impl Iterator<Item = ShipReading>,
        aided: &mut dyn Estimator,
        mut tell: impl FnMut(&ShipReading, DQuat, &dyn Estimator),
    ) {
        let mut rng = Pcg64::seed_from_u64(self.seed);
        let (mut up_waits, mut heading_waits): (Option<UpSeen>, Option<HeadingSeen>) = (None, None);
        let (mut anchored, mut next_s) = (None, 0.0);
        for s in samples {
            let time = Time::from_ns(0).plus_secs(s.time_s);
            let (rate, accel) = (s.rate, s.accel);
            let sample =
                ImuSample { arrival: time, device_time_ns: time.ns(), rate, accel, world_from_imu: None };
            let Some(found) = aided.observe(time, &sample) else { continue };
            if s.time_s >= next_s {
                next_s = s.time_s + SEEN_EVERY_S;
                up_waits = self.up(&s, &mut rng).map(|(up_camera, covariance)| UpSeen {
                    time,
                    up_camera,
                    covariance,
                });
                heading_waits = self.heading(&s, found, aided, &mut anchored, &mut rng);
            }
            let late = |seen: Time| time.secs_since(seen) > SEEN_LATE_S;
            if let Some(seen) = up_waits.take_if(|seen| late(seen.time)) {
                aided.update_vertical(&seen);
            }
            if let Some(seen) = heading_waits.take_if(|seen| late(seen.time)) {
                aided.update_heading(&seen, matches!(self.heading, Heading::Anchored(..)));
            }
            tell(&s, found, aided);
        }
    }

    fn up(&self, s: &ShipReading, rng: &mut Pcg64) -> Option<(DVec3, DMat3)> {
        let horizon = self.horizon.filter(|h| s.time_s % (2.0 * h.seen_s) < h.seen_s)?;
        let world_from_camera = s.truth.world_from_imu * self.camera_from_imu.inverse();
        let noise = DVec3::new(gaussian(rng), gaussian(rng), 0.0) * horizon.sigma;
        let ahead = (world_from_camera * DVec3::Z).truncate().normalize_or_zero();
        let up_world = DQuat::from_scaled_axis(noise) * (DVec3::Z - ahead.extend(0.0) * self.dip).normalize();
        Some((world_from_camera.inverse() * up_world, DMat3::IDENTITY * horizon.sigma.powi(2)))
    }

    /// `anchored`: when, and by how much the believed heading was wrong then.
    fn heading(
        &self,
        s: &ShipReading,
        found: DQuat,
        aided: &mut dyn Estimator,
        anchored: &mut Option<(f64, f64)>,
        rng: &mut Pcg64,
    ) -> Option<HeadingSeen> {
        let time = Time::from_ns(0).plus_secs(s.time_s);
        let off = ship::heading_error(found, s.truth.world_from_imu);
        match self.heading {
            Heading::Start => None,
            Heading::Compass(sigma) => {
                Some(HeadingSeen { time, off: off + sigma * gaussian(rng), variance: sigma * sigma })
            }
            Heading::Anchored(sigma, rate) => {
                if s.time_s < SETTLED_S {
                    return None;
                }
                let (since, then) = *anchored.get_or_insert_with(|| {
                    aided.anchor(rate.abs().max(1e-6));
                    (s.time_s, off)
                });
                let turned = rate * (s.time_s - since);
                Some(HeadingSeen {
                    time,
                    off: off - then + turned + sigma * gaussian(rng),
                    variance: sigma * sigma,
                })
            }
        }
    }
}

/// An estimator of orientation from samples and aids.
pub trait Estimator {
    /// The orientation at a sample.
    fn observe(&mut self, time: Time, sample: &ImuSample) -> Option<DQuat>;
    /// Takes in where up was seen.
    fn update_vertical(&mut self, seen: &UpSeen);
    /// Remembers the heading; what is anchored turns by about `drift` rad/s.
    fn anchor(&mut self, drift: f64);
    /// Takes in a heading, absolute or since it was anchored.
    fn update_heading(&mut self, seen: &HeadingSeen, anchored: bool);
    /// Covariance of the turn of the world by which it is wrong.
    fn covariance(&self) -> Option<DMat3>;
}

impl Estimator for Attitude {
    fn observe(&mut self, time: Time, sample: &ImuSample) -> Option<DQuat> {
        self.observe(time, sample).map(|o| o.world_from_imu)
    }

    fn update_vertical(&mut self, seen: &UpSeen) {
        self.update_vertical(seen, LIMIT_UP);
    }

    fn anchor(&mut self, drift: f64) {
        self.anchor_heading(drift);
    }

    fn update_heading(&mut self, seen: &HeadingSeen, anchored: bool) {
        match anchored {
            true => self.update_anchored_heading(seen, LIMIT_HEADING),
            false => self.update_heading(seen, LIMIT_HEADING),
        };
    }

    fn covariance(&self) -> Option<DMat3> {
        self.covariance()
    }
}

/// How wrong a run was after a minute.
#[derive(Clone, Debug, Default)]
pub struct AidedOutcome {
    /// Root mean square and worst of the angle by which up is wrong, degrees.
    pub up_deg: [f64; 2],
    /// The same of the heading less what it was wrong by at the start.
    pub heading_deg: [f64; 2],
    /// Squares of up's error over their variances (two in the mean where the filter is right), every 20 s.
    pub surprises: Vec<f64>,
}

/// Runs the estimator through the recording.
pub fn outcome(recording: &AidedRecording, aided: &mut dyn Estimator) -> AidedOutcome {
    let mut out = AidedOutcome::default();
    let (mut count, mut next, mut start) = (0.0, SETTLED_S, None);
    recording.run(aided, |s, found, aided| {
        let truth = s.truth.world_from_imu;
        let start = *start.get_or_insert_with(|| ship::heading_error(truth, found));
        if s.time_s < SETTLED_S {
            return;
        }
        let tilt = inclination_error(truth, found).to_degrees();
        let heading = ship::heading_error(truth, found);
        let heading = wrapped(heading - start).to_degrees();
        for (sums, error) in [(&mut out.up_deg, tilt), (&mut out.heading_deg, heading)] {
            sums[0] += error * error;
            sums[1] = sums[1].max(error.abs());
        }
        count += 1.0;
        if s.time_s >= next {
            next += INDEPENDENT_S;
            out.surprises.extend(aided.covariance().map(|c| nis(truth, found, c)));
        }
    });
    out.up_deg[0] = (out.up_deg[0] / count).sqrt();
    out.heading_deg[0] = (out.heading_deg[0] / count).sqrt();
    out
}

fn nis(truth: DQuat, found: DQuat, covariance: DMat3) -> f64 {
    let off = truth * found.inverse();
    let turn = (off * off.w.signum()).to_scaled_axis().truncate();
    let across = DMat2::from_cols(covariance.x_axis.truncate(), covariance.y_axis.truncate());
    turn.dot(across.inverse() * turn)
}

/// What the mean of `n` squares with two degrees of freedom each lies between in 95 of 100 cases (Wilson & Hilferty 1931).
pub fn bounds(n: usize) -> [f64; 2] {
    let k = 2.0 * n as f64;
    [-1.96, 1.96].map(|z| 2.0 * (1.0 - 2.0 / (9.0 * k) + z * (2.0 / (9.0 * k)).sqrt()).powi(3))
}
