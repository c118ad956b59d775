use bowwave_core::time::Time;
use glam::{DMat3, DQuat, DVec3};
use proptest::prelude::*;

use super::{
    compare_tests::{held, known, of},
    *,
};
use crate::{
    simulated::{Motion, Random, Recipe, Recording},
    solve::so3::{exp, log},
};

pub(super) const TENTH: f64 = 0.1 * std::f64::consts::PI / 180.0;
const FIFTIETH: f64 = 0.2 * TENTH;

fn solved(recording: &Recording) -> Result<Alignment, AlignmentError> {
    solve(&recording.readings, &recording.orientations, &Options::default())
}

/// Half a minute by hand with 0.1 deg and 2 ms of noise.
pub(super) fn by_hand(seed: u64) -> Recipe {
    Recipe { seconds: 30.0, ..Recipe::minute(Motion::ByHand, TENTH, 2e-3, seed) }
}

fn turn_error(recipe: &Recipe, a: &Alignment) -> DVec3 {
    log(recipe.camera_from_imu * a.camera_from_imu.inverse())
}

/// The error is what the result says of it: within four standard deviations in rotation and offset, and small.
fn holds(recipe: &Recipe, a: &Alignment, most_mrad: f64, most_ms: f64) {
    let turn = turn_error(recipe, a);
    let off_ms = (a.offset_s - recipe.offset_s) * 1e3;
    assert!(turn.length() * 1e3 < most_mrad, "{} mrad", turn.length() * 1e3);
    assert!(off_ms.abs() < most_ms, "{off_ms} ms");
    let square = turn.dot(a.rotation_covariance.inverse() * turn);
    // Chi-squared with three degrees of freedom: one in 20 000 is beyond 22.
    assert!(square < 22.0, "{square} for {turn}, stated {}", a.rotation_sigma());
    assert!(off_ms.abs() < 4.0 * a.offset_sigma_s * 1e3, "{off_ms} ms, stated {}", a.offset_sigma_s * 1e3);
    let bias = (a.gyro_bias - recipe.gyro_bias) / a.gyro_bias_sigma;
    assert!(bias.abs().max_element() < 5.0, "bias off by {bias} sigmas");
}

fn map_orientations(
    recording: &mut Recording,
    mut f: impl FnMut(usize, Time, DQuat) -> Option<(Time, DQuat)>,
) {
    let mut number = 0;
    recording.orientations.retain_mut(|o| match o {
        Observation::Orientation { stamp, reference_from_camera, .. } => {
            let new = f(number, *stamp, *reference_from_camera);
            number += 1;
            if let Some((s, q)) = new {
                (*stamp, *reference_from_camera) = (s, q);
            }
            new.is_some()
        }
        Observation::Up { .. } => true,
    });
}

#[test]
fn errors_are_small_and_as_large_as_stated() {
    let (mut rotation, mut offset) = (0, 0);
    let mut motions = 0;
    for (motion, sigma, jitter, most) in [
        (Motion::ByHand, FIFTIETH, 0.0, (0.2, 0.05)),
        (Motion::ByHand, TENTH, 2e-3, (0.75, 0.3)),
        (Motion::TraverseAndElevation, FIFTIETH, 0.0, (0.73, 0.2)),
        (Motion::TraverseAndElevation, TENTH, 2e-3, (2.0, 0.71)),
        (Motion::AtSea, TENTH, 2e-3, (3.3, 1.0)),
    ] {
        for seed in 0..4 {
            let recipe = Recipe::minute(motion, sigma, jitter, seed);
            let a = solved(&recipe.record()).unwrap();
            holds(&recipe, &a, most.0, most.1);
            assert_eq!(a.grade, Grade::Good, "{motion:?}: {:?}", a.findings());
            let turn = turn_error(&recipe, &a);
            rotation += u32::from(turn.dot(a.rotation_covariance.inverse() * turn) < 14.16);
            offset += u32::from((a.offset_s - recipe.offset_s).abs() < 3.0 * a.offset_sigma_s);
            motions += 1;
            // What the noises are is found.
            let scale = a.noise.orientation_scale;
            assert!((0.93..1.07).contains(&scale), "{scale}");
            if jitter > 0.0 && motion == Motion::ByHand {
                assert!((a.noise.jitter_s - jitter).abs() < 3e-4, "{}", a.noise.jitter_s);
            }
            let squares = a.residuals.iter().map(|r| r.normalised.powi(2)).sum::<f64>();
            let mean = squares / a.residuals.len() as f64;
            assert!((0.9..1.1).contains(&mean), "{mean}");
        }
    }
    // Three sigma hold 99.7 %: of 20 not more than one may be outside.
    assert!(rotation + 1 >= motions && offset + 1 >= motions, "{rotation} and {offset} of {motions} within");
}

#[test]
fn one_axis_or_none_is_refused_and_what_is_missing_named() {
    for (motion, expected) in [
        (Motion::TraverseOnly, Movement::Elevation),
        (Motion::ElevationOnly, Movement::Traverse),
        (Motion::RollOnly, Movement::Elevation),
        (Motion::Rest, Movement::Any),
    ] {
        let error = solved(&Recipe::minute(motion, TENTH, 2e-3, 3).record()).unwrap_err();
        let AlignmentError::NotObservable { missing, ratio, .. } = error else {
            panic!("{motion:?}: {error}")
        };
        assert_eq!(missing, expected, "{motion:?}");
        assert!(ratio < RATIO_REFUSED, "{ratio}");
        assert!(error.to_string().contains(&expected.to_string()), "{error}");
    }
}

const RATIO_REFUSED: f64 = 0.02;

#[test]
fn slow_motion_is_solved_but_graded_poor() {
    let recipe = Recipe::minute(Motion::SlowMount, TENTH, 2e-3, 2);
    let a = solved(&recipe.record()).unwrap();
    holds(&recipe, &a, 23.0, 18.0);
    assert_eq!(a.grade, Grade::Poor);
}

/// On a level mount the axis of traverse is the vertical itself, about which neither horizon nor gravity tells anything. On a deck that
/// heels it is not, and gravity in the unit's axes and the horizon in the camera's tell the angle that traverse leaves open.
#[test]
fn horizon_and_gravity_resolve_traverse_about_a_heeled_axis() {
    let recipe = Recipe::minute(Motion::TraverseOnly, TENTH, 2e-3, 4);
    let level = recipe.record();
    let both: Vec<Observation> = level.orientations.iter().chain(&level.ups).copied().collect();
    let error = solve(&level.readings, &both, &Options::default()).unwrap_err();
    assert!(matches!(error, AlignmentError::NotObservable { missing: Movement::Elevation, .. }), "{error}");

    // The same recording on a deck that heels by ten degrees: only where up is differs.
    let heeled = exp(DVec3::Y * 10f64.to_radians()) * DVec3::Z;
    let (truth, mut random) = (poses(&recipe), Random::new(9));
    let mut recording = level;
    for (reading, world_from_camera) in recording.readings.iter_mut().zip(&truth.0) {
        let up = recipe.camera_from_imu.inverse() * (world_from_camera.inverse() * heeled);
        reading.specific_force = Some(up * 9.81 + random.vector() * 0.3);
    }
    for (o, world_from_camera) in recording.ups.iter_mut().zip(&truth.1) {
        if let Observation::Up { up_in_camera, .. } = o {
            *up_in_camera = exp(random.vector() * TENTH) * (world_from_camera.inverse() * heeled);
        }
    }
    let both: Vec<Observation> = recording.orientations.iter().chain(&recording.ups).copied().collect();
    let a = solve(&recording.readings, &both, &Options::default()).unwrap();
    holds(&recipe, &a, 60.0, 0.5);
    assert!(a.rotation_sigma().max_element() < 0.03, "{}", a.rotation_sigma());
}

/// `world_from_camera` at every reading and at every picture: the recipe without noise and with the board as the world.
fn poses(recipe: &Recipe) -> (Vec<DQuat>, Vec<DQuat>) {
    let still = Recipe { camera_sigma: 1e-12, jitter_s: 0.0, ..*recipe };
    let at = |hz: f64, shift: f64| {
        let fine = Recipe { camera_hz: hz, offset_s: 0.0, seconds: recipe.seconds + 3.0, ..still }.record();
        let q = |o: &Observation| match o {
            Observation::Orientation { reference_from_camera, stamp, .. } => {
                (*reference_from_camera, stamp.secs_since(fine.readings[0].time))
            }
            Observation::Up { .. } => (DQuat::IDENTITY, 0.0),
        };
        let board_from_world = {
            let (first, _) = q(&fine.orientations[0]);
            let Observation::Up { up_in_camera, .. } = fine.ups[0] else { panic!("no up") };
            DQuat::from_rotation_arc(first * up_in_camera, DVec3::Z)
        };
        let all: Vec<(DQuat, f64)> = fine.orientations.iter().map(q).collect();
        all.into_iter().filter(|(_, t)| *t >= shift - 1e-6).map(|(q, _)| board_from_world * q).collect()
    };
    // Readings begin at 0, pictures of the simulation at 0.7 s; heeling is about a fixed axis, so that only the pace matters.
    let pictures: Vec<DQuat> = at(recipe.camera_hz, 0.0);
    let fine: Vec<DQuat> = at(recipe.gyro_hz, 0.0);
    let before = (0.7 * recipe.gyro_hz) as usize;
    let readings = std::iter::repeat_n(fine[0], before).chain(fine).collect();
    (readings, pictures)
}

#[test]
fn the_horizon_alone_is_enough_where_all_three_axes_move() {
    let recipe = Recipe::minute(Motion::ByHand, TENTH, 2e-3, 5);
    let recording = recipe.record();
    let a = solve(&recording.readings, &recording.ups, &Options::default()).unwrap();
    holds(&recipe, &a, 1.0, 0.5);
    // Without accelerometers too.
    let bare: Vec<ImuReading> =
        recording.readings.iter().map(|r| ImuReading { specific_force: None, ..*r }).collect();
    holds(&recipe, &solve(&bare, &recording.ups, &Options::default()).unwrap(), 1.0, 0.5);
    // Together with a board, the reference of which stands askew.
    let both: Vec<Observation> = recording.orientations.iter().chain(&recording.ups).copied().collect();
    holds(&recipe, &solve(&recording.readings, &both, &Options::default()).unwrap(), 0.75, 0.3);
}

#[test]
fn far_off_points_without_a_target() {
    let recipe = Recipe::minute(Motion::ByHand, TENTH, 0.0, 6);
    let recording = Recipe { camera_sigma: 1e-9, ..recipe }.record();
    let mut random = Random::new(4);
    let seen: Vec<(Time, DQuat)> = recording
        .orientations
        .iter()
        .filter_map(|o| match o {
            Observation::Orientation { stamp, reference_from_camera, .. } => {
                Some((*stamp, *reference_from_camera))
            }
            Observation::Up { .. } => None,
        })
        .collect();
    // Three chains: the scene was lost twice.
    let increments: Vec<Increment> = seen
        .windows(2)
        .enumerate()
        .filter(|(i, _)| *i != 400 && *i != 401 && *i != 1000)
        .map(|(_, w)| Increment {
            from: w[0].0,
            to: w[1].0,
            from_from_to: w[0].1.inverse() * w[1].1 * exp(random.vector() * 2e-4),
            sigma: 2e-4,
        })
        .collect();
    let chains = chained(&increments);
    assert_eq!(chains.len(), increments.len() + 3);
    let a = solve(&recording.readings, &chains, &Options::default()).unwrap();
    holds(&recipe, &a, 1.5, 0.5);
    assert_eq!(a.grade, Grade::Good);
}

#[test]
fn half_a_second_of_offset_either_way() {
    for offset_s in [-0.5, 0.5] {
        let recipe = Recipe { offset_s, ..by_hand(11) };
        holds(&recipe, &solved(&recipe.record()).unwrap(), 0.9, 0.4);
    }
}

#[test]
fn mounted_the_wrong_way_round() {
    for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.0, 0.8)] {
        let recipe = Recipe { camera_from_imu: exp(axis * std::f64::consts::PI), ..by_hand(12) };
        holds(&recipe, &solved(&recipe.record()).unwrap(), 0.9, 0.4);
    }
}

#[test]
fn mirrored_axes_are_refused() {
    for flip in [DVec3::new(1.0, 1.0, -1.0), DVec3::new(-1.0, 1.0, 1.0), DVec3::NEG_ONE] {
        let mut recording = by_hand(13).record();
        recording.readings.iter_mut().for_each(|r| r.rate *= flip);
        let error = solved(&recording).unwrap_err();
        assert!(matches!(error, AlignmentError::Mirrored { .. }), "{flip}: {error}");
        assert!(error.to_string().contains("mirrored"));
    }
}

#[test]
fn blur_and_few_poses_leave_enough() {
    let recipe = by_hand(14);
    // Fast pictures are blurred: two thirds of all are missing, in bursts.
    let mut recording = recipe.record();
    map_orientations(&mut recording, |i, s, q| (i % 45 < 15).then_some((s, q)));
    holds(&recipe, &solved(&recording).unwrap(), 1.5, 0.6);
    // One picture in two seconds.
    let mut recording = recipe.record();
    map_orientations(&mut recording, |i, s, q| (i % 60 == 0).then_some((s, q)));
    assert!(recording.orientations.len() < 16);
    holds(&recipe, &solved(&recording).unwrap(), 8.0, 4.0);
    recording.orientations.truncate(5);
    assert!(matches!(solved(&recording), Err(AlignmentError::TooFew { count: 5, .. })));
}

#[test]
fn clipped_rates_are_stepped_over() {
    let recipe = by_hand(15);
    let mut recording = recipe.record();
    let limit = 0.8;
    recording
        .readings
        .iter_mut()
        .for_each(|r| r.rate = r.rate.clamp(DVec3::splat(-limit), DVec3::splat(limit)));
    let a = solved(&recording).unwrap();
    assert!(a.left_out.clipped > 50, "{:?}", a.left_out);
    holds(&recipe, &a, 2.5, 0.8);
}

#[test]
fn a_third_of_the_poses_wild() {
    let recipe = by_hand(16);
    let mut recording = recipe.record();
    let mut random = Random::new(1);
    map_orientations(&mut recording, |i, s, q| {
        Some((s, if i % 3 == 0 { q * exp(random.vector()) } else { q }))
    });
    let a = solved(&recording).unwrap();
    assert!(a.checks.outliers > 0.25 && a.grade < Grade::Good, "{:?}", a.checks);
    assert!(a.findings().iter().any(|f| matches!(f, AlignmentFinding::ManyOutliers(_))));
    holds(&recipe, &a, 2.0, 1.0);
}

#[test]
fn stamps_that_repeat_and_run_backwards() {
    let recipe = by_hand(17);
    let mut recording = recipe.record();
    let stamps: Vec<Time> = recording.readings.iter().map(|r| r.time).collect();
    for i in (200..stamps.len()).step_by(311) {
        recording.readings[i].time = stamps[i - 1];
        recording.readings[i + 5].time = stamps[i - 90];
    }
    recording.readings[50].time = Time::from_ns(i64::MAX);
    recording.readings[70].time = Time::MIN;
    map_orientations(&mut recording, |i, s, q| {
        Some((if i % 97 == 5 { s.plus_ns(-150_000_000) } else { s }, q))
    });
    let a = solved(&recording).unwrap();
    assert!(a.left_out.out_of_order > 20, "{:?}", a.left_out);
    holds(&recipe, &a, 1.5, 0.6);
}

#[test]
fn a_rolling_shutter_is_found() {
    let recipe = Recipe { readout_s: 0.03, jitter_s: 2e-4, ..by_hand(18) };
    let recording = recipe.record();
    let options = Options { estimate_readout: true, ..Options::default() };
    let a = solve(&recording.readings, &recording.orientations, &options).unwrap();
    holds(&recipe, &a, 0.9, 0.3);
    let (readout, sigma) = a.readout_s.unwrap();
    assert!((readout - 0.03).abs() < 4.0 * sigma && sigma < 1e-3, "{readout} +- {sigma}");
    // Left out of account it is noise of the stamps.
    let unaware = solved(&recording).unwrap();
    assert!(unaware.noise.jitter_s > 6e-3, "{:?}", unaware.noise);
    holds(&recipe, &unaware, 3.0, 2.0);
}

#[test]
fn a_wrong_stamp_flag_comes_out_as_offset() {
    // Stamps of the exposure's start instead of its middle, 16 ms of exposure.
    let recipe = by_hand(19);
    let mut recording = recipe.record();
    map_orientations(&mut recording, |_, s, q| Some((s.plus_ns(-8_000_000), q)));
    let a = solved(&recording).unwrap();
    holds(&Recipe { offset_s: recipe.offset_s + 8e-3, ..recipe }, &a, 0.9, 0.4);
}

#[test]
fn a_gyro_with_a_wrong_scale_is_told() {
    let recipe = by_hand(20);
    let mut recording = recipe.record();
    let scale = DVec3::new(1.0, 0.99, 1.0);
    recording.readings.iter_mut().for_each(|r| r.rate *= scale);
    let a = solved(&recording).unwrap();
    let findings = a.findings();
    assert!(
        matches!(findings.as_slice(), [AlignmentFinding::GyroScale(1, s)] if (s - 0.0101).abs() < 0.002),
        "{findings:?}"
    );
    // The rotation is off by more than stated then, but not by much.
    assert!(turn_error(&recipe, &a).length() < 5e-3);
}

#[test]
fn no_numbers_are_left_out() {
    let recipe = by_hand(21);
    let mut recording = recipe.record();
    recording.readings[500].rate.x = f64::NAN;
    recording.readings[501].rate = DVec3::INFINITY;
    recording.readings[900].specific_force = Some(DVec3::NAN);
    map_orientations(&mut recording, |i, s, q| {
        Some((s, if i == 40 { DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0) } else { q }))
    });
    let a = solved(&recording).unwrap();
    assert_eq!(a.left_out.not_finite, 3);
    holds(&recipe, &a, 0.9, 0.4);
}

#[test]
fn a_mount_that_slips_is_inconsistent() {
    let recipe = by_hand(22);
    let mut recording = recipe.record();
    let middle = recording.readings.len() / 2;
    let slip = exp(DVec3::X * 0.02);
    recording.readings[middle..].iter_mut().for_each(|r| r.rate = slip * r.rate);
    let a = solved(&recording).unwrap();
    assert!(a.findings().iter().any(|f| matches!(f, AlignmentFinding::Inconsistent(_))), "{:?}", a.checks);
    assert!(a.grade < Grade::Good);
}

#[test]
fn recordings_that_cannot_be_solved_say_why() {
    let recording = by_hand(23).record();
    let late: Vec<Observation> = recording
        .orientations
        .iter()
        .map(|o| match o {
            Observation::Orientation { stamp, reference_from_camera, sigma, row, chain } => {
                Observation::Orientation {
                    stamp: stamp.plus_secs(500.0),
                    reference_from_camera: *reference_from_camera,
                    sigma: *sigma,
                    row: *row,
                    chain: *chain,
                }
            }
            Observation::Up { .. } => *o,
        })
        .collect();
    let options = Options::default();
    assert!(matches!(solve(&recording.readings, &late, &options), Err(AlignmentError::NoOverlap { .. })));
    assert!(matches!(solve(&[], &recording.orientations, &options), Err(AlignmentError::TooFew { .. })));
    assert!(matches!(solve(&recording.readings, &[], &options), Err(AlignmentError::TooFew { .. })));
    let mut long = recording.readings.clone();
    long.last_mut().unwrap().time = recording.readings[0].time.plus_secs(4000.0);
    assert!(matches!(solve(&long, &recording.orientations, &options), Err(AlignmentError::TooLong { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever comes in, there is an answer or an error, and an answer is made of numbers.
    #[test]
    fn nothing_from_outside_panics(seed in 0u64..1_000_000, wild in 0.0..0.6f64, count in 0usize..400) {
        let mut random = Random::new(seed);
        let odd = |random: &mut Random, v: f64| match (random.unit() / wild.max(1e-9) * 6.0) as u32 {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => 1e300,
            3 => 0.0,
            4 => -v,
            _ => v,
        };
        let readings: Vec<ImuReading> = (0..count)
            .map(|i| ImuReading {
                time: Time::from_ns(odd(&mut random, i as f64 * 5e6) as i64),
                rate: DVec3::new(random.gauss(), odd(&mut random, 0.3), random.gauss()),
                specific_force: Some(DVec3::new(0.0, 0.0, odd(&mut random, 9.81))),
            })
            .collect();
        let observations: Vec<Observation> = (0..count / 3)
            .map(|i| {
                let stamp = Time::from_ns(odd(&mut random, i as f64 * 15e6) as i64);
                let sigma = odd(&mut random, 1e-3);
                let row = odd(&mut random, 0.1);
                if random.unit() < 0.5 {
                    let q = exp(random.vector());
                    let q = DQuat::from_xyzw(q.x, q.y, odd(&mut random, q.z), q.w);
                    Observation::Orientation { stamp, reference_from_camera: q, sigma, row, chain: (i / 50) as u32 }
                } else {
                    Observation::Up { stamp, up_in_camera: random.vector() * odd(&mut random, 1.0), sigma, row }
                }
            })
            .collect();
        let options = Options {
            offset_range_s: odd(&mut random, 0.2),
            estimate_readout: random.unit() < 0.5,
            gyro_range: Some(odd(&mut random, 2.0)),
            horizon_sigma: odd(&mut random, 1e-3),
        };
        if let Ok(a) = solve(&readings, &observations, &options) {
            prop_assert!(a.camera_from_imu.is_finite() && a.offset_s.is_finite() && a.offset_sigma_s.is_finite());
            prop_assert!(a.rotation_covariance.to_cols_array().iter().all(|v| v.is_finite()));
            prop_assert!(a.rotation_covariance != DMat3::ZERO);
        }
        let _ = closed_form(&readings, &observations, &options);
    }
}

#[test]
fn horizons_that_share_an_error_are_no_surer_than_it() {
    let recording = by_hand(40).record();
    let options = Options { horizon_sigma: 1.7e-3, ..Options::default() };
    let plain = solve(&recording.readings, &recording.ups, &Options::default()).unwrap();
    let shared = solve(&recording.readings, &recording.ups, &options).unwrap();
    let (before, after) = (plain.rotation_sigma(), shared.rotation_sigma());
    assert!(after.x > 1.5e-3 && after.x < 1.1 * before.x.hypot(1.7e-3), "{before} {after}");
    assert!((after.z - before.z).abs() < 0.2e-3 && shared.grade == Grade::Usable, "{before} {after}");
    // A board tells the rotation without it.
    let board = solve(&recording.readings, &recording.orientations, &options).unwrap();
    assert!(board.rotation_sigma().max_element() < 1e-3);
}

/// A camera on a gimbal hardly turns, while the gyro beside it feels what the gimbal takes away: residuals are white and halves observability, but the
/// offset is a number by chance.
#[test]
fn a_gyro_that_feels_what_the_camera_does_not_see_is_refused() {
    for seed in 0..4 {
        let mut recording = Recipe::minute(Motion::SlowMount, FIFTIETH, 0.0, seed).record();
        let mut random = Random::new(seed + 70);
        let mut shake = DVec3::ZERO;
        for reading in &mut recording.readings {
            // A rate of 2 deg/s that forgets itself within some hundredths of a second.
            shake = shake * 0.8 + random.vector() * 0.02;
            reading.rate += shake;
        }
        let error = solved(&recording).unwrap_err();
        assert!(matches!(error, AlignmentError::NotShared { share } if share < 0.5), "{seed}: {error}");
        let told = held(&recording, &recording.orientations, &known(&recording.recipe, DVec3::ZERO, 0.03));
        let offset = of(&told, Parameter::Offset);
        assert_eq!(offset.judgement, Judgement::NotTold, "{offset:?}");
    }
}

/// Stated deviations hold where errors are alike from picture to picture.
#[test]
fn pictures_that_err_alike_widen_what_is_stated() {
    let mut squares = Vec::new();
    for seed in 0..8 {
        let recipe = Recipe { seconds: 30.0, ..Recipe::minute(Motion::ByHand, 1e-5, 0.0, seed) };
        let mut recording = recipe.record();
        let (mut random, mut error) = (Random::new(seed + 5), DVec3::ZERO);
        map_orientations(&mut recording, |_, stamp, q| {
            error = error * 0.4 + random.vector() * TENTH;
            Some((stamp, q * exp(error)))
        });
        let a = solved(&recording).unwrap();
        assert!(a.checks.correlation > 0.1 && a.checks.widened > 1.2, "{:?}", a.checks);
        assert!(a.findings().iter().any(|f| matches!(f, AlignmentFinding::Alike(_))), "{:?}", a.findings());
        squares.push(((a.offset_s - recipe.offset_s) / a.offset_sigma_s).powi(2));
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!(mean < 2.5, "{squares:?}");
}
