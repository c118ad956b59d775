//! Elevation of 90 degrees, where yaw and roll of Euler angles turn about one axis, and the seam of yaw: from the bytes of units that tell
//! angles to where the camera looks.

use bowwave_core::{
    estimate::attitude::{Attitude, AttitudeSettings, Noise, RateKind, Source},
    event::ImuSample,
    geometry::look,
    time::Time,
};
use glam::{DQuat, DVec3};

use super::{ImuDecoder, ImuFormat};

/// The unit sits x forward, y right, z down behind the camera.
const CAMERA_FROM_IMU: DQuat = DQuat::from_xyzw(-0.5, -0.5, -0.5, 0.5);
const DEG: f64 = std::f64::consts::PI / 180.0;
/// Standard gravity, m/s^2.
const G: f64 = 9.806_65;
const SAMPLES: i64 = 1200;

/// Traverse, elevation and roll, radians, so many seconds from the middle of the recording.
type PoleMotion = fn(f64) -> [f64; 3];

fn over_the_top(s: f64) -> [f64; 3] {
    [0.7, 90.0 * DEG + 20.0 * DEG * s, 0.2]
}

fn under_the_bottom(s: f64) -> [f64; 3] {
    [-2.0, -90.0 * DEG - 20.0 * DEG * s, 0.1]
}

/// Three hundredths of a degree beside the pole: yaw swings by nearly half a turn within three hundredths of a second.
fn past_the_top(s: f64) -> [f64; 3] {
    let forward = DVec3::new(0.03 * DEG, 20.0 * DEG * s, 1.0).normalize();
    [forward.x.atan2(forward.y), forward.z.asin(), forward.x.atan2(forward.y)]
}

/// Traversed while the barrel points straight up.
fn turned_at_the_top(s: f64) -> [f64; 3] {
    [40.0 * DEG * s, 90.0 * DEG, 0.0]
}

/// Through south, where a yaw of 180 degrees becomes one of -180.
fn through_south(s: f64) -> [f64; 3] {
    [std::f64::consts::PI + 40.0 * DEG * s, 0.3, 0.1]
}

const MOTIONS: [(&str, PoleMotion); 5] = [
    ("over the top", over_the_top),
    ("under the bottom", under_the_bottom),
    ("past the top", past_the_top),
    ("turned at the top", turned_at_the_top),
    ("through south", through_south),
];

/// The camera so many seconds from the middle; at rest at first, so that what is fused can be levelled.
fn world_from_camera(motion: PoleMotion, s: f64) -> DQuat {
    let since = (s + 2.5).max(0.0);
    let eased = if since < 0.5 { since * since } else { since - 0.25 };
    let [traverse, elevation, roll] = motion(eased - 2.25);
    look(traverse, elevation, roll)
}

fn world_from_imu(motion: PoleMotion, s: f64) -> DQuat {
    world_from_camera(motion, s) * CAMERA_FROM_IMU
}

fn seconds(format: ImuFormat, n: i64) -> f64 {
    (n - SAMPLES / 2) as f64 * format.simulated_period_ns() as f64 * 1e-9
}

fn truth(format: ImuFormat, motion: PoleMotion, n: i64) -> ImuSample {
    let (s, h) = (seconds(format, n), 1e-5);
    let at = world_from_imu(motion, s);
    let turn = world_from_imu(motion, s - h).inverse() * world_from_imu(motion, s + h);
    let turn = if turn.w < 0.0 { -turn } else { turn };
    let ns = n * format.simulated_period_ns();
    ImuSample {
        arrival: Time::from_ns(1_000_000_000 + ns),
        device_time_ns: ns,
        rate: turn.to_scaled_axis() / (2.0 * h),
        accel: at.inverse() * (DVec3::Z * G),
        world_from_imu: Some(at),
    }
}

/// Worst errors through a motion, radians: where the camera looks and how its picture is turned, both at samples and halfway between.
fn worst(format: ImuFormat, motion: PoleMotion, source: Source) -> [f64; 2] {
    let settings = AttitudeSettings { source, rate: RateKind::Instant, noise: Noise::USUAL, own_growth: 0.0 };
    let mut attitude = Attitude::new(settings, DVec3::ZERO, CAMERA_FROM_IMU);
    let mut decoder = ImuDecoder::fixed(format);
    let (mut worst, mut compared, mut heading) = ([0.0f64; 2], 0, None);
    for n in 0..SAMPLES {
        let s = truth(format, motion, n);
        let mut samples = Vec::new();
        samples.extend(decoder.samples(&format.send(&s, n, true), s.arrival));
        for sample in samples {
            let number =
                sample.arrival.ns_since(truth(format, motion, 0).arrival) / format.simulated_period_ns();
            if attitude.observe(Time::from_ns(number * format.simulated_period_ns()), &sample).is_none() {
                continue;
            }
            for back in [0.0, 0.5] {
                let time =
                    Time::from_ns(((number as f64 - back) * format.simulated_period_ns() as f64) as i64);
                let Ok(found) = attitude.at(time) else { continue };
                let true_camera = world_from_camera(
                    motion,
                    seconds(format, number) - back * format.simulated_period_ns() as f64 * 1e-9,
                );
                let camera = attitude.camera(found.world_from_imu);
                assert!(camera.is_finite() && (camera.length() - 1.0).abs() < 1e-12, "{camera}");
                // Nobody tells a filter of rates and forces where north is: what it began with stays.
                let heading = *heading.get_or_insert_with(|| match source {
                    Source::Auto => DQuat::IDENTITY,
                    Source::Fused => true_camera * camera.inverse(),
                });
                let camera = heading * camera;
                worst[0] = worst[0].max((camera * DVec3::Z).angle_between(true_camera * DVec3::Z));
                worst[1] = worst[1].max(camera.angle_between(true_camera));
                compared += 1;
            }
        }
    }
    assert!(compared > 2 * SAMPLES - 200, "{format}: {compared}");
    worst
}

/// An attitude that is told to half a unit of the format's last digit in three angles, of which two add up at the pole, is known that well and no
/// worse: yaw and roll by themselves mean nothing there, but what they make together does.
#[test]
fn angles_at_the_pole_lose_nothing_of_where_the_camera_looks() {
    for (format, digit_deg) in [
        (ImuFormat::VectorNavAscii, 1e-3),
        // Its numbers of 24 bits are carried over one period by the rates, to 2.5e-4 deg where it turns fastest.
        (ImuFormat::Sbg, 3e-4),
        (ImuFormat::Bno08x, 1e-2),
        (ImuFormat::Witmotion, 180.0 / 32_768.0),
    ] {
        for (name, motion) in MOTIONS {
            let [direction, whole] = worst(format, motion, Source::Auto).map(|v| v / DEG);
            println!("{format}, {name}: looks {direction:.6} deg aside, turned by {whole:.6} deg");
            assert!(
                direction < 1.2 * digit_deg && whole < 1.2 * digit_deg,
                "{format}, {name}: {direction} {whole}"
            );
        }
    }
}

/// Rates and forces know no pole, whatever angles come along.
#[test]
fn what_is_fused_here_passes_the_pole() {
    for (name, motion) in MOTIONS {
        let [direction, whole] = worst(ImuFormat::VectorNavAscii, motion, Source::Fused).map(|v| v / DEG);
        println!("fused, {name}: looks {direction:.6} deg aside, turned by {whole:.6} deg");
        assert!(direction < 0.02 && whole < 0.02, "{name}: {direction} {whole}");
    }
}

/// Precision is lost in the unit, not here: one that makes its angles of a matrix of f32 has a pitch that is off by a hundredth of a degree and
/// more near the pole, where the sine hardly changes.
#[test]
fn a_unit_that_reckons_in_f32_is_off_near_the_pole() {
    let worst_near = |elevation: std::ops::Range<i32>| {
        let off = |hundredth: i32| {
            let truth = look(0.3, f64::from(hundredth) * 0.01 * DEG, 0.1) * CAMERA_FROM_IMU;
            let m = glam::DMat3::from_quat(truth).as_mat3();
            // Of a world of forward, right, down: ours has no part in it.
            let (yaw, pitch, roll) =
                (m.x_axis.y.atan2(m.x_axis.x), (-m.x_axis.z).asin(), m.y_axis.z.atan2(m.z_axis.z));
            let told = super::axes::from_yaw_pitch_roll([yaw, pitch, roll].map(f64::from));
            told.angle_between(truth) / DEG
        };
        elevation.map(off).fold(0.0, f64::max)
    };
    let (far, near) = (worst_near(0..6000), worst_near(8990..9000));
    println!("angles made in f32: {far:.6} deg off below 60 deg of elevation, {near:.4} deg near the pole");
    assert!(far < 2e-5 && (0.002..0.1).contains(&near), "{far} {near}");
}
