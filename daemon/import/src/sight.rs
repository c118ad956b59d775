//! The gyro's bias against what the pictures show: what is far away turns only as the camera does.
//!
//! Patches of the upper part of the picture (sky, or the far shore) are followed; the bias is that with which the gyro's
//! path, looked at through the calibrated lens, puts them where they were seen. A camera that turns slowly and evenly is
//! no hindrance, as it would be for a mean over rest. What moves by itself (clouds in the wind, a near mast) falls out of the
//! robust weights where it is the minority, and into the stated deviation where it changes.

use bowwave_core::{calibration::Calibration, event::ImuSample, time::Time};
use glam::{DMat3, DVec2, DVec3};

use crate::{
    BiasSource, GyroBias,
    bias::{BIAS_MAX, SIGMA_MIN},
    gyro::GyroPath,
    track::{Gray, Tracker},
};

/// The share of the picture's height, from the top, in which things are taken to be far away.
pub(crate) const FAR_SHARE: f64 = 0.42;
/// Fewer patches do not bear a bias.
const PATCHES_MIN: usize = 8;
/// Only each so many-th picture is compared; the ones between serve to follow the patches.
const STRIDE: usize = 3;
/// A patch farther than this from its place pulls no harder than at this distance, pixels (Huber 1964).
const ROBUST_PX: f64 = 1.0;
/// Step of the numerical derivative, rad/s: a few hundredths of a pixel over seconds.
const STEP: f64 = 1e-5;
const ITERATIONS: usize = 8;

/// Where each patch was seen, by picture; patches that were lost on the way are left out.
pub(crate) struct Sightings {
    times: Vec<Time>,
    /// For each patch, its place in each picture.
    tracks: Vec<Vec<DVec2>>,
}

/// Gathers sightings as pictures come.
pub(crate) struct PatchWatch {
    tracker: Option<Tracker>,
    times: Vec<Time>,
    seen: Vec<Vec<Option<DVec2>>>,
}

impl PatchWatch {
    pub(crate) const fn new() -> Self {
        Self { tracker: None, times: Vec::new(), seen: Vec::new() }
    }

    /// Takes in the next picture.
    pub(crate) fn see(&mut self, time: Time, picture: &Gray) {
        let places = match &mut self.tracker {
            Some(tracker) => tracker.next(picture),
            slot => {
                let far_rows = (picture.height() as f64 * FAR_SHARE) as usize;
                slot.insert(Tracker::start(picture, far_rows)).places()
            }
        };
        self.times.push(time);
        self.seen.push(places);
    }

    /// All that was followed from the first picture to the last.
    pub(crate) fn finish(self) -> Sightings {
        let patches = self.seen.first().map_or(0, Vec::len);
        let track = |p: usize| -> Option<Vec<DVec2>> {
            self.seen.iter().map(|places| places.get(p).copied().flatten()).collect()
        };
        Sightings { tracks: (0..patches).filter_map(track).collect(), times: self.times }
    }
}

/// The bias over the whole span of the sightings, with the standard error that the scatter of the biases of its single
/// seconds gives; `None` where the pictures do not bear one.
pub(crate) fn bias(
    samples: &[ImuSample],
    calibration: &Calibration,
    sightings: &Sightings,
) -> Option<GyroBias> {
    let (first, last) = (*sightings.times.first()?, *sightings.times.last()?);
    let seconds = last.secs_since(first);
    let parts = seconds.round() as usize;
    if sightings.tracks.len() < PATCHES_MIN || parts < 2 {
        return None;
    }
    let count = sightings.times.len();
    let rate = fit(samples, calibration, sightings, 0..count)?;
    let of_parts = (0..parts)
        .map(|i| fit(samples, calibration, sightings, i * count / parts..(i + 1) * count / parts))
        .collect::<Option<Vec<_>>>()?;
    let n = parts as f64;
    let mean = of_parts.iter().sum::<DVec3>() / n;
    let variance = of_parts.iter().map(|b| (b - mean) * (b - mean)).sum::<DVec3>() / (n - 1.0);
    let sigma = DVec3::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt()) / n.sqrt();
    let usable = sigma.is_finite() && rate.abs().max_element() <= BIAS_MAX;
    let source = BiasSource::Pictures { patches: sightings.tracks.len() };
    usable.then(|| GyroBias { rate, sigma: sigma.max(DVec3::splat(SIGMA_MIN)), seconds, source })
}

/// Gauss and Newton over the three components of the bias.
fn fit(
    samples: &[ImuSample],
    calibration: &Calibration,
    sightings: &Sightings,
    span: std::ops::Range<usize>,
) -> Option<DVec3> {
    let residuals = |bias: DVec3| residuals(samples, calibration, sightings, span.clone(), bias);
    let mut bias = calibration.gyro_bias;
    for _ in 0..ITERATIONS {
        let now = residuals(bias)?;
        let slopes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| residuals(bias + axis * STEP));
        let [Some(x), Some(y), Some(z)] = slopes else { return None };
        let (mut normal, mut pull) = (DMat3::ZERO, DVec3::ZERO);
        for (((r, x), y), z) in now.iter().zip(&x).zip(&y).zip(&z) {
            let weight = ROBUST_PX / r.length().max(ROBUST_PX);
            for (r, slope) in [
                (r.x, DVec3::new(x.x - r.x, y.x - r.x, z.x - r.x)),
                (r.y, DVec3::new(x.y - r.y, y.y - r.y, z.y - r.y)),
            ] {
                let slope = slope / STEP;
                normal += DMat3::from_cols(slope * slope.x, slope * slope.y, slope * slope.z) * weight;
                pull += slope * (r * weight);
            }
        }
        let step = normal.inverse() * pull;
        if !step.is_finite() {
            return None;
        }
        bias -= step;
        if step.length() < 1e-8 {
            return Some(bias);
        }
    }
    Some(bias)
}

/// How far each patch was seen from where the gyro's path puts it, pixels; `None` where that is out of sight.
fn residuals(
    samples: &[ImuSample],
    calibration: &Calibration,
    sightings: &Sightings,
    span: std::ops::Range<usize>,
    bias: DVec3,
) -> Option<Vec<DVec2>> {
    let path = GyroPath::integrate(samples, bias);
    let lens = &calibration.lens;
    let imu_from_camera = calibration.camera_from_imu.inverse();
    let poses: Vec<_> = sightings
        .times
        .get(span.clone())?
        .iter()
        .map(|t| path.world_from_imu(t.plus_ns(calibration.time_offset_ns)) * imu_from_camera)
        .collect();
    let start = *poses.first()?;
    let mut out = Vec::new();
    for track in &sightings.tracks {
        let places = track.get(span.clone())?;
        let world = start * lens.unproject(*places.first()?);
        for (pose, place) in poses.iter().zip(places).skip(1).step_by(STRIDE) {
            out.push(lens.project(pose.inverse() * world)? - *place);
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::{Sightings, bias};
    use crate::{START, output::tests_calibration};
    use bowwave_core::event::ImuSample;
    use glam::{DQuat, DVec2, DVec3};

    /// A camera that turns evenly about a tilted axis, a gyro with a bias, and patches with a little noise.
    fn scene(turn: DVec3, truth: DVec3, noise_px: f64) -> (Vec<ImuSample>, Sightings) {
        let calibration = tests_calibration();
        let in_imu = calibration.camera_from_imu.inverse() * turn;
        let samples = (0..1300)
            .map(|i| ImuSample {
                arrival: START.plus_ns(i * 5_000_000 - 500_000_000),
                device_time_ns: i * 5_000_000,
                rate: in_imu + truth,
                accel: DVec3::ZERO,
                world_from_imu: None,
            })
            .collect();
        let times: Vec<_> = (0..150).map(|i| START.plus_ns(i * 33_366_667)).collect();
        let mut seed = 1_u64;
        let mut noise = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((seed >> 40) as f64 / f64::from(1 << 24) - 0.5) * noise_px
        };
        let tracks = (0..30)
            .map(|p| {
                let world = calibration
                    .lens
                    .unproject(DVec2::new(60.0 + f64::from(p) * 20.0, 40.0 + f64::from(p % 5) * 30.0));
                times
                    .iter()
                    .map(|t| {
                        let turned = DQuat::from_scaled_axis(turn * t.secs_since(START)).inverse() * world;
                        calibration.lens.project(turned).unwrap() + DVec2::new(noise(), noise())
                    })
                    .collect()
            })
            .collect();
        (samples, Sightings { times, tracks })
    }

    #[test]
    fn a_turning_camera_does_not_hide_the_bias() {
        let truth = DVec3::new(0.004, -0.011, 0.015);
        for turn in [DVec3::ZERO, DVec3::new(0.005, -0.003, 0.006), DVec3::new(0.0, 0.03, 0.0)] {
            let (samples, sightings) = scene(turn, truth, 0.4);
            let found = bias(&samples, &tests_calibration(), &sightings).unwrap();
            let off = (found.rate - truth).abs();
            // A tenth of a milliradian a second: 0.6 px after ten seconds.
            assert!(off.max_element() < 1e-4, "{turn}: {off}");
            assert!(off.cmple(found.sigma * 4.0).all(), "{turn}: {off} {}", found.sigma);
            assert!((found.seconds - 4.97).abs() < 0.01);
        }
    }

    #[test]
    fn patches_that_move_by_themselves_are_outvoted() {
        let truth = DVec3::new(0.004, -0.011, 0.015);
        let (samples, mut sightings) = scene(DVec3::ZERO, truth, 0.2);
        for track in sightings.tracks.iter_mut().take(6) {
            for (i, place) in track.iter_mut().enumerate() {
                place.x += i as f64 * 0.5;
            }
        }
        let found = bias(&samples, &tests_calibration(), &sightings).unwrap();
        assert!((found.rate - truth).length() < 4e-4, "{}", found.rate - truth);
    }

    #[test]
    fn too_little_to_hold_on_to_gives_none() {
        let (samples, mut sightings) = scene(DVec3::ZERO, DVec3::ZERO, 0.1);
        sightings.tracks.truncate(7);
        assert!(bias(&samples, &tests_calibration(), &sightings).is_none());
        let (samples, mut sightings) = scene(DVec3::ZERO, DVec3::ZERO, 0.1);
        sightings.times.truncate(20);
        assert!(bias(&samples, &tests_calibration(), &sightings).is_none());
        let empty = Sightings { times: Vec::new(), tracks: Vec::new() };
        assert!(bias(&samples, &tests_calibration(), &empty).is_none());
    }
}
