use super::*;
use crate::geometry::look;
use proptest::prelude::*;

fn sample(rate: DVec3, accel: DVec3) -> ImuSample {
    ImuSample { arrival: Time::from_ns(0), device_time_ns: 0, rate, accel, world_from_imu: None }
}

fn attitude(source: Source, gyro_bias: DVec3) -> Attitude {
    let settings = AttitudeSettings { source, rate: RateKind::Instant, noise: Noise::USUAL, own_growth: 0.0 };
    Attitude::new(settings, gyro_bias, DQuat::IDENTITY)
}

proptest! {
    #[test]
    fn levelling_finds_elevation_and_roll(el in -1.4..1.4f64, roll in -3.0..3.0f64) {
        // Camera axes serve as the unit's axes.
        let truth = look(0.0, el, roll);
        let q = level(truth.inverse() * DVec3::Z * 9.81, DQuat::IDENTITY);
        prop_assert!(q.angle_between(truth) < 1e-6, "{}", q.angle_between(truth));
    }
}

/// Orientation about a tilt that precesses: the worst case for integrating rates axis by axis.
fn coning(t: f64) -> DQuat {
    DQuat::from_rotation_z(0.5 * t) * DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(2.0 * t)
}

fn coning_rate(t: f64) -> DVec3 {
    let h = 1e-5;
    let turn = coning(t - h).inverse() * coning(t + h);
    DVec3::new(turn.x, turn.y, turn.z) * (turn.w.signum() / h)
}

/// What a unit in that motion measures at 200 Hz, and by which angle up was wrong after `settle_s`, at most.
fn worst_tilt(
    attitude: &mut Attitude,
    seconds: f64,
    settle_s: f64,
    sense: impl Fn(f64, ImuSample) -> ImuSample,
) -> f64 {
    let mut worst: f64 = 0.0;
    for i in 0..(seconds * 200.0) as i64 {
        let time = Time::from_ns(i * 5_000_000);
        let t = i as f64 * 0.005;
        let exact = sample(coning_rate(t), coning(t).inverse() * DVec3::Z * 9.806_65);
        if let Some(o) = attitude.observe(time, &sense(t, exact)) {
            assert!((o.world_from_imu.length() - 1.0).abs() < 1e-12);
            let up = o.world_from_imu * (coning(t).inverse() * DVec3::Z);
            worst = if t > settle_s { worst.max(up.truncate().length()) } else { worst };
        }
    }
    worst.to_degrees()
}

#[test]
fn integrates_a_coning_motion() {
    let h = 0.005;
    let mut q = coning(0.0);
    for i in 0..200 * 60 {
        let t = f64::from(i) * h;
        let before = (i > 0).then(|| coning_rate(t - h));
        q *= DQuat::from_scaled_axis(turn_between(before, coning_rate(t), coning_rate(t + h), h));
    }
    let off = q.inverse() * coning(60.0);
    assert!(DVec3::new(off.x, off.y, off.z).length() < 1e-5, "{off}");
}

#[test]
fn up_is_found_though_the_gyro_has_a_bias_and_the_gun_fires() {
    let bias = DVec3::new(1.7e-3, -2e-3, 1e-3);
    let mut fused = attitude(Source::Fused, DVec3::ZERO);
    let tilt = worst_tilt(&mut fused, 90.0, 30.0, |_, s| ImuSample { rate: s.rate + bias, ..s });
    assert!(tilt < 0.15, "{tilt} deg");
    // Recoil: 5 ms of 30 g to one side, ten times a second.
    let mut fused = attitude(Source::Fused, DVec3::ZERO);
    let tilt = worst_tilt(&mut fused, 60.0, 20.0, |t, s| {
        let fires = t > 30.0 && t < 40.0 && (t * 200.0).round() as i64 % 20 == 0;
        let kick = if fires { DVec3::X * 300.0 } else { DVec3::ZERO };
        ImuSample { rate: s.rate, accel: s.accel + kick, ..s }
    });
    assert!(tilt < 0.3, "{tilt} deg");
}

#[test]
fn a_horizon_is_believed_where_it_can_be_true() {
    let mut fused = attitude(Source::Fused, DVec3::ZERO);
    // A unit that feels gravity a third of a degree wrong, and a camera that sees the horizon.
    let wrong = DQuat::from_rotation_x(0.35f64.to_radians());
    worst_tilt(&mut fused, 60.0, 0.0, |t, s| ImuSample {
        accel: coning(t).inverse() * (wrong * (coning(t) * s.accel)),
        ..s
    });
    let now = Time::from_ns(11_990 * 5_000_000);
    let at = |time: Time| coning(time.ns() as f64 * 1e-9);
    let covariance = DMat3::IDENTITY * 0.03f64.to_radians().powi(2);
    let up = |time: Time| at(time).inverse() * DVec3::Z;
    let found = |fused: &Attitude| fused.newest().and_then(|t| fused.at(t).ok()).unwrap().world_from_imu;
    let error =
        |fused: &Attitude| (found(fused) * up(fused.newest().unwrap())).truncate().length().to_degrees();
    assert!(error(&fused) > 0.2, "{}", error(&fused));
    let shore = DQuat::from_rotation_y(0.2) * up(now);
    let seen = UpSeen { time: now, up_camera: shore, covariance };
    assert!(!fused.update_vertical(&seen, 13.8).unwrap().taken);
    assert!(error(&fused) > 0.2);
    for _ in 0..10 {
        let seen = UpSeen { time: now, up_camera: up(now), covariance };
        assert!(fused.update_vertical(&seen, 13.8).unwrap().taken);
    }
    // What is drawn follows the horizon wholly, though a part of what differs may be refraction.
    let drawn = fused.world_from_camera(fused.at(now).unwrap().world_from_imu);
    assert!((drawn * up(now)).truncate().length() < 2e-4, "{}", drawn * up(now));
    assert!(error(&fused) < 0.1, "{}", error(&fused));
    // A horizon says up no better than refraction lets it.
    let deviations = fused.covariance().unwrap();
    assert!((0.0..0.07f64.to_radians().powi(2)).contains(&deviations.x_axis.x), "{deviations}");
    let early = UpSeen { time: Time::from_ns(0), up_camera: DVec3::Y, covariance };
    assert_eq!(fused.update_vertical(&early, 13.8), None);
    let broken = UpSeen { time: now, up_camera: DVec3::NAN, covariance };
    assert!(!fused.update_vertical(&broken, 13.8).unwrap().taken);
}

/// By what the heading found is wrong at its newest time, radians.
fn heading_error(fused: &Attitude) -> f64 {
    let time = fused.newest().unwrap();
    let off = coning(time.ns() as f64 * 1e-9) * fused.at(time).unwrap().world_from_imu.inverse();
    2.0 * (off.z / off.w).atan()
}

#[test]
fn a_heading_is_set_and_held_by_what_was_anchored() {
    let mut fused = attitude(Source::Fused, DVec3::ZERO);
    let bias = |_: f64, s: ImuSample| ImuSample { rate: s.rate + DVec3::Z * 2e-3, ..s };
    worst_tilt(&mut fused, 60.0, 0.0, bias);
    assert!(fused.set_heading(heading_error(&fused), 1e-3));
    assert!(heading_error(&fused).abs() < 1e-9);
    let deviation = |fused: &Attitude| fused.covariance().unwrap().z_axis.z.sqrt();
    assert!((deviation(&fused) - 1e-3).abs() < 1e-9);
    assert!(fused.anchor_heading(0.0));
    // What is anchored in tells of changes only: it makes nothing surer than the heading was.
    let time = fused.newest().unwrap();
    let seen = |off| HeadingSeen { time, off, variance: 1e-8 };
    assert!(fused.update_anchored_heading(&seen(2e-5), 10.8).unwrap().taken);
    assert!(deviation(&fused) > 0.99e-3, "{}", deviation(&fused));
    assert!(!fused.update_anchored_heading(&seen(0.1), 10.8).unwrap().taken, "another island");
    assert!(fused.update_heading(&seen(1e-3), 10.8).unwrap().taken);
    assert!(deviation(&fused) < 2e-4, "{}", deviation(&fused));
    assert!((heading_error(&fused) + 1e-3).abs() < 1e-4, "{}", heading_error(&fused));
    let broken = HeadingSeen { off: f64::NAN, ..seen(0.0) };
    assert!(!fused.update_heading(&broken, 10.8).unwrap().taken);
}

#[test]
fn fused_it_starts_at_the_units_own_heading() {
    let mut fused = attitude(Source::Fused, DVec3::ZERO);
    let truth = look(2.5, 0.2, 0.1);
    let mut still = sample(DVec3::ZERO, truth.inverse() * DVec3::Z * 9.806_65);
    // Its inclination is five degrees wrong, and is not taken.
    still.world_from_imu = Some(DQuat::from_rotation_x(0.09) * truth);
    let found = (0..100).filter_map(|i| fused.observe(Time::from_ns(i * 5_000_000), &still)).last().unwrap();
    assert!(
        found.world_from_imu.angle_between(truth) < 0.02,
        "{}",
        found.world_from_imu.angle_between(truth)
    );
    assert!((found.world_from_imu * (truth.inverse() * DVec3::Z)).truncate().length() < 1e-3);
}

#[test]
fn after_a_gap_it_is_levelled_anew() {
    let mut fused = attitude(Source::Fused, DVec3::ZERO);
    let at = |ms: i64| Time::from_ns(ms * 1_000_000);
    let still = sample(DVec3::ZERO, DVec3::Z * 9.8);
    for i in 0..100 {
        fused.observe(at(i * 5), &still);
    }
    assert!(fused.observe(at(700), &still).is_some(), "200 ms are bridged");
    assert!(fused.observe(at(1800), &still).is_none(), "1.1 s are not");
    assert!(fused.observe(at(1700), &still).is_none(), "nor is a time before");
    assert!((0..100).any(|i| fused.observe(at(2000 + i * 5), &still).is_some()));
}

#[test]
fn the_units_own_orientation_is_taken_as_it_is() {
    let q = look(1.0, 0.2, 0.1);
    let mut s = sample(DVec3::X, DVec3::Z);
    s.world_from_imu = Some(q);
    let o = attitude(Source::Auto, DVec3::X).observe(Time::from_ns(5), &s).unwrap();
    assert!(o.world_from_imu.angle_between(q) < 1e-9);
    assert_eq!(o.rate, DVec3::ZERO);
}

/// A unit's own orientation, sent 100 times a second while it looks the same way, wrong by a turn of the world that `wrong` tells by the
/// second; `aid` is told of each tenth with the time and with what is believed. Gives root mean square and largest error after `settle_s`,
/// radians, with the heading's and without.
fn external_ahrs(
    estimator: &mut Attitude,
    (from_s, to_s, settle_s): (f64, f64, f64),
    wrong: impl Fn(f64) -> DVec3,
    mut aid: impl FnMut(&mut Attitude, Time, f64),
) -> (f64, f64) {
    let truth = look(0.4, -0.1, 0.02);
    let (mut square, mut worst, mut count) = (0.0, 0.0f64, 0.0f64);
    for i in (from_s * 100.0) as i64..(to_s * 100.0) as i64 {
        let (t, time) = (i as f64 * 0.01, Time::from_ns(i * 10_000_000));
        let mut s = sample(DVec3::ZERO, DVec3::Z);
        s.world_from_imu = Some(DQuat::from_scaled_axis(wrong(t)) * truth);
        let found = estimator.observe(time, &s).unwrap().world_from_imu;
        if i % 10 == 0 {
            aid(estimator, time, t);
        }
        if t >= settle_s {
            let off = rotation_vector(truth * found.inverse());
            square += off.length_squared();
            worst = worst.max(off.length());
            count += 1.0;
        }
    }
    ((square / count).sqrt(), worst)
}

const DEG: f64 = std::f64::consts::PI / 180.0;

/// What a horizon with that noise says, which is drawn.
fn horizon_seen(rng: &mut rand_pcg::Pcg64, time: Time, sigma: f64) -> UpSeen {
    let mut noise = || (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>() * sigma;
    let up_camera = look(0.4, -0.1, 0.02).inverse() * DVec3::new(noise(), noise(), 1.0);
    UpSeen { time, up_camera, covariance: DMat3::IDENTITY * sigma * sigma }
}

#[test]
fn a_units_own_inclination_is_held_by_horizons() {
    let mut rng = <rand_pcg::Pcg64 as rand::SeedableRng>::seed_from_u64(3);
    // Half a degree off, a tenth to and fro: a unit on a small ship.
    let wrong = |t: f64| DVec3::new(0.5 + 0.1 * (0.9 * t).sin(), -0.3 + 0.1 * (0.7 * t).cos(), 0.0) * DEG;
    let mut estimator = attitude(Source::Auto, DVec3::ZERO);
    let sigma = 0.03 * DEG;
    let (rms, worst) = external_ahrs(&mut estimator, (0.0, 60.0, 10.0), wrong, |estimator, time, _| {
        let outcome = estimator.update_vertical(&horizon_seen(&mut rng, time, sigma), 13.8).unwrap();
        assert!(outcome.nis < 25.0, "{outcome:?}");
    });
    assert!(rms < 0.05 * DEG && worst < 0.15 * DEG, "{} {} deg", rms / DEG, worst / DEG);
    // It knows how wrong it is: refraction is nothing here, but may have been.
    let known = estimator.covariance().unwrap();
    assert!((0.02 * DEG..0.2 * DEG).contains(&known.x_axis.x.sqrt()), "{known}");
    // Without a horizon its mean is held.
    let (rms, _) = external_ahrs(&mut estimator, (60.0, 80.0, 60.0), wrong, |_, _, _| ());
    assert!(rms < 0.15 * DEG, "{} deg", rms / DEG);
}

#[test]
fn a_units_own_heading_is_averaged_where_the_sky_holds_it() {
    // To and fro by 0.05 deg, and it drifts by 5 deg/h.
    let wrong = |t: f64| DVec3::Z * (0.05 * (1.1 * t).sin() + t * 5.0 / 3600.0) * DEG;
    let run = |with_sky: bool| {
        let mut estimator = attitude(Source::Auto, DVec3::ZERO);
        let truth = look(0.4, -0.1, 0.02);
        let mut held = None;
        external_ahrs(&mut estimator, (0.0, 60.0, 20.0), wrong, |estimator, time, _| {
            if !with_sky {
                return;
            }
            let believed = estimator.at(time).unwrap().world_from_imu;
            let off = rotation_vector(truth * believed.inverse()).z;
            match held {
                None => {
                    estimator.anchor_heading(1e-6);
                    held = Some(off);
                }
                Some(then) => {
                    let seen = HeadingSeen { time, off: off - then, variance: (0.005 * DEG).powi(2) };
                    estimator.update_anchored_heading(&seen, 1e3).unwrap();
                }
            }
        })
        .0 / DEG
    };
    let (alone, held) = (run(false), run(true));
    assert!(alone > 0.06 && held < 0.04, "{alone} {held} deg");
}

#[test]
fn a_unit_that_errs_otherwise_than_was_thought_is_not_left_to_itself() {
    let mut rng = <rand_pcg::Pcg64 as rand::SeedableRng>::seed_from_u64(3);
    // It starts two degrees off, settles, and then swings by a degree.
    let wrong = |t: f64| {
        let start = 2.0 * (-t / 8.0).exp();
        DVec3::new(start, 0.0, 0.0) * DEG + DVec3::X * if t > 60.0 { (0.8 * t).sin() * DEG } else { 0.0 }
    };
    let mut estimator = attitude(Source::Auto, DVec3::ZERO);
    let seen_up = |t: f64| t % 20.0 < 10.0;
    let (rms, _) = external_ahrs(&mut estimator, (0.0, 160.0, 30.0), wrong, |estimator, time, t| {
        if seen_up(t) {
            estimator.update_vertical(&horizon_seen(&mut rng, time, 0.03 * DEG), 13.8);
        }
    });
    // Alone it errs by .62 deg; half of the time nothing helps.
    assert!(rms < 0.55 * DEG, "{} deg", rms / DEG);
    let known = estimator.covariance().unwrap();
    assert!(known.x_axis.x.sqrt() > 0.3 * DEG, "{known}");
}

#[test]
fn a_heading_that_is_set_turns_what_is_known_of_up() {
    let wrong = |_: f64| DVec3::new(0.5, 0.0, 0.0) * DEG;
    let mut rng = <rand_pcg::Pcg64 as rand::SeedableRng>::seed_from_u64(3);
    let mut estimator = attitude(Source::Auto, DVec3::ZERO);
    external_ahrs(&mut estimator, (0.0, 20.0, 0.0), wrong, |estimator, time, _| {
        estimator.update_vertical(&horizon_seen(&mut rng, time, 0.01 * DEG), 13.8);
    });
    let up = |estimator: &Attitude| {
        let found = estimator.at(estimator.newest().unwrap()).unwrap().world_from_imu;
        (found * (look(0.4, -0.1, 0.02).inverse() * DVec3::Z)).truncate().length()
    };
    assert!(up(&estimator) < 0.06 * DEG);
    assert!(estimator.set_heading(100.0 * DEG, 0.1 * DEG));
    assert!((estimator.heading_sigma().unwrap() - 0.1 * DEG).abs() < 1e-12);
    assert!((estimator.corrected() - 100.0 * DEG).abs() < 0.1 * DEG);
    external_ahrs(&mut estimator, (20.0, 25.0, 99.0), wrong, |_, _, _| ());
    assert!(up(&estimator) < 0.08 * DEG, "{} deg", up(&estimator) / DEG);
}

/// A unit in a hand: carried to and fro by decimetres, about once a second, while it turns slowly about every axis.
fn carried(t: f64) -> (DQuat, DVec3) {
    let place = |t: f64| {
        DVec3::new((5.1 * t).sin() + (7.3 * t).cos(), (4.3 * t).cos() + (6.7 * t).sin(), (5.9 * t).sin())
            * 0.1
    };
    let h = 1e-3;
    let acceleration = (place(t + h) - place(t) * 2.0 + place(t - h)) / (h * h);
    let turned = DQuat::from_rotation_z(0.4 * t) * DQuat::from_rotation_x(0.6 * (0.5 * t).sin());
    (turned * DQuat::from_rotation_y(0.5 * (0.3 * t).cos()), acceleration)
}

fn carried_sample(t: f64) -> (DQuat, ImuSample) {
    let h = 1e-5;
    let (q, acceleration) = carried(t);
    let rate = rotation_vector(carried(t - h).0.inverse() * carried(t + h).0) / (2.0 * h);
    (q, sample(rate, q.inverse() * (acceleration + DVec3::Z * GRAVITY_M_S2)))
}

/// By how much bias and up are wrong at most after `from_s` of two minutes in a hand, rad/s and radians, where `sense` has the unit feel it.
fn worst_in_a_hand(
    fused: &mut Attitude,
    from_s: f64,
    sense: impl Fn(i32, ImuSample) -> ImuSample,
) -> (f64, f64) {
    let (mut bias, mut tilt) = (0.0f64, 0.0f64);
    for i in 0..120 * 200 {
        let t = f64::from(i) * 0.005;
        let (q, exact) = carried_sample(t);
        let s = sense(i, exact);
        let found = fused.observe(Time::from_ns(i64::from(i) * 5_000_000), &s);
        if let Some(found) = found.filter(|_| t > from_s) {
            bias = bias.max((s.rate - found.rate).abs().max_element());
            tilt = tilt.max((found.world_from_imu * (q.inverse() * DVec3::Z)).truncate().length());
        }
    }
    (bias, tilt)
}

#[test]
fn no_bias_is_invented_of_a_unit_that_is_carried_about() {
    let mut fused = attitude(Source::Fused, DVec3::ZERO);
    let (bias, tilt) = worst_in_a_hand(&mut fused, 40.0, |_, s| s);
    assert!(bias < 0.1 * DEG && tilt < 0.5 * DEG, "{} deg/s {} deg", bias / DEG, tilt / DEG);
    assert_eq!(fused.falls(), 0);
}

#[test]
fn a_turn_that_no_sample_told_is_found_by_plain_vqf() {
    let mut fused = attitude(Source::Fused, DVec3::ZERO);
    let wrong = DQuat::from_rotation_x(0.5);
    let mut tilt = [0.0f64; 2];
    for i in 0..120 * 200 {
        let t = f64::from(i) * 0.005;
        let (q, s) = carried_sample(t);
        let later = t > 60.0;
        // From a minute on the unit sits otherwise in the hand, and its gyro says nothing of that.
        let turn = if later { wrong } else { DQuat::IDENTITY };
        let s = ImuSample { rate: turn * s.rate, accel: turn * s.accel, ..s };
        let Some(found) = fused.observe(Time::from_ns(i64::from(i) * 5_000_000), &s) else { continue };
        let off = (found.world_from_imu * (turn * (q.inverse() * DVec3::Z))).truncate().length();
        for (worst, from_s) in tilt.iter_mut().zip([60.0, 80.0]) {
            *worst = if t > from_s { worst.max(off) } else { *worst };
        }
    }
    assert!(fused.falls() >= 1, "{tilt:?}");
    assert!(tilt[0] > 0.4 && tilt[1] < 3.0 * DEG, "{tilt:?}");
}

#[test]
fn a_blow_has_two_sides() {
    let mut fused = attitude(Source::Fused, DVec3::ZERO);
    // Struck by 5 ms of 20 g each 0.4 s, and brought back within 150 ms.
    let blow = |i: i32| match i % 80 {
        10 => -200.0,
        11..=40 => 200.0 / 30.0,
        _ => 0.0,
    };
    let struck = |i, s: ImuSample| ImuSample { accel: s.accel + DVec3::X * blow(i), ..s };
    let (bias, tilt) = worst_in_a_hand(&mut fused, 30.0, struck);
    assert!(tilt < 0.7 * DEG && bias < 0.1 * DEG, "{} deg {} deg/s", tilt / DEG, bias / DEG);
}

#[test]
fn a_ships_steady_turn_that_was_taken_for_a_rest_is_forgotten_after_three_rests() {
    let mut fused = attitude(Source::Fused, DVec3::ZERO);
    let bias = DVec3::new(0.05, -0.02, 0.03) * DEG;
    let mut off = [0.0f64; 2];
    for i in 0..170 * 200 {
        let t = f64::from(i) * 0.005;
        // The ship turns by a degree each second at first. Then the gun rolls for 34 s, and lies still for six, again and again.
        let phase = (t % 40.0) * 0.7;
        let rolls = t > 5.0 && t % 40.0 < 34.0;
        let (roll, rate) = match (t < 5.0, rolls) {
            (true, _) => (0.0, DVec3::Z * DEG),
            (_, true) => (0.2 * phase.sin(), DVec3::X * (0.2 * 0.7 * phase.cos())),
            (_, false) => (0.2 * (34f64 * 0.7).sin(), DVec3::ZERO),
        };
        let up = DQuat::from_rotation_x(-roll) * DVec3::Z;
        let s = sample(rate + bias, up * GRAVITY_M_S2);
        let Some(found) = fused.observe(Time::from_ns(i64::from(i) * 5_000_000), &s) else { continue };
        let wrong = ((s.rate - found.rate) - bias).abs().max_element();
        for (worst, range) in off.iter_mut().zip([6.0..110.0, 125.0..170.0]) {
            *worst = if range.contains(&t) { worst.max(wrong) } else { *worst };
        }
    }
    assert!(off[0] > 0.9 * DEG && off[1] < 0.07 * DEG, "{} {} deg/s", off[0] / DEG, off[1] / DEG);
}
