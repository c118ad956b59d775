//! What is said of set-ups of which one thing is wrong.

use super::*;
use crate::{
    calibration::Calibration,
    estimate::attitude::{AttitudeSettings, Source},
    event::PixelFormat,
    geometry::look,
};

fn at(tenths: i64) -> Time {
    Time::from_ns(tenths * 100_000_000)
}

/// A gun that is swung on a ship that rolls: where it looks.
fn moved(time: Time) -> DQuat {
    let t = time.secs_since(at(0));
    look(0.4 * (1.1 * t).sin(), 0.05 * (0.7 * t).sin() - 0.03, 0.06 * (0.8 * t).sin())
}

fn turn(from: Time, to: Time) -> DVec3 {
    rotation_vector(moved(from).inverse() * moved(to))
}

fn up(time: Time) -> DVec3 {
    moved(time).inverse() * DVec3::Z
}

/// Ten seconds in which what is seen differs from what is believed; when that was told first, seconds, and what is told at the end.
fn told(turned: impl Fn(Time, Time) -> DVec3, seen: impl Fn(Time) -> DVec3) -> (Option<f64>, Option<Misfit>) {
    let (first, registration) = watched(1.0, turned, seen);
    (first, registration.wrong())
}

/// The same with the watch at the end, of a gun that moves slower by a factor.
fn watched(
    speed: f64,
    turned: impl Fn(Time, Time) -> DVec3,
    seen: impl Fn(Time) -> DVec3,
) -> (Option<f64>, Registration) {
    let slow = |time: Time| at(0).plus_ns((time.ns_since(at(0)) as f64 * speed) as i64);
    let (turned, seen) = (|from, to| turned(slow(from), slow(to)), |time| seen(slow(time)));
    let (turn, up) = (|from, to| turn(slow(from), slow(to)), |time| up(slow(time)));
    let mut registration = Registration::new(DQuat::IDENTITY, None);
    let mut first = None;
    for tenths in 10..110 {
        let (now, before) = (at(tenths), at(tenths).plus_ns(-33_000_000));
        let sight = UpSight { seen: seen(now), predicted: up(now), is_predicted: true };
        registration.up(now, &sight, |time| Some(up(time)));
        let covariance = DMat3::from_diagonal(DVec3::splat(1e-7));
        let seen = TurnSeen { from: before, turn: turned(before, now), covariance, patches: (20, 20) };
        registration.turned(&seen, now, |ns| Some(turn(before.plus_ns(-ns), now.plus_ns(-ns))));
        if registration.wrong().is_some() {
            first.get_or_insert(now.secs_since(at(10)));
        }
    }
    (first, registration)
}

#[test]
fn ready_waits_until_each_way_to_be_wrong_would_have_been_told() {
    let (_, right) = watched(1.0, turn, up);
    assert_eq!(right.checks(at(110)), RegistrationChecks { unseen_s: 0.1, is_tried: true });
    // A gun at rest shows its horizon, and neither late pictures nor a reversed axis.
    let (_, still) = watched(0.0, turn, up);
    assert_eq!(still.checks(at(110)), RegistrationChecks { unseen_s: 0.1, is_tried: false });
    for late_ms in [100, 150, 250, 400] {
        let late = |time: Time| time.plus_ns(-late_ms * 1_000_000);
        for speed in [0.1, 0.3, 1.0] {
            let (_, wrong) = watched(speed, |from, to| turn(late(from), late(to)), |time| up(late(time)));
            assert!(!wrong.checks(at(110)).is_tried, "{late_ms} ms, speed {speed}");
        }
    }
}

#[test]
fn what_no_hypothesis_has_is_not_ready_either() {
    for degrees in [20.0_f64, 30.0, 45.0] {
        let about_up = DMat3::from_quat(DQuat::from_rotation_y(degrees.to_radians()));
        let (_, wrong) = watched(1.0, |from, to| about_up * turn(from, to) * 1.25, up);
        assert!(!wrong.checks(at(110)).is_tried, "{degrees} deg");
    }
}

#[test]
fn a_reticle_in_the_picture_is_no_rate_in_degrees() {
    let (first, watch) = watched(1.0, |_, _| DVec3::ZERO, up);
    assert!(watch.wrong() != Some(Misfit::RateUnit), "after {first:?} s");
}

#[test]
fn a_gun_that_hardly_turns_has_no_rates_in_degrees() {
    // It turns by up to 2 deg/s, and the picture does not follow: whatever that is, not a unit that says sixty times too much.
    let (first, watch) = watched(0.08, |_, _| DVec3::X * 1e-4, |time| DQuat::from_rotation_x(0.2) * up(time));
    assert!(watch.wrong() != Some(Misfit::RateUnit), "after {first:?} s");
}

#[test]
fn a_craft_that_speeds_up_has_no_other_lens() {
    // The unit alone has up eleven degrees off, as accelerations tilt it, for ten seconds; the picture turns as believed.
    let tilt = DQuat::from_rotation_x(11f64.to_radians());
    let (_, watch) = watched(0.3, turn, |time| tilt * up(time));
    assert!(watch.wrong() != Some(Misfit::Lens), "{:?}", watch.wrong());
}

/// Two minutes of a ship that rolls slowly, looked at as once nothing is suspected: the picture turns as believed, and the vertical is seen
/// as if it was late. When the pictures are called late, seconds.
fn late_verticals(late_ms: i64, speed: f64) -> Option<f64> {
    let slow = |time: Time| at(0).plus_ns((time.ns_since(at(0)) as f64 * speed) as i64);
    let rolled = |time: Time| DQuat::from_rotation_z(0.12 * (0.8 * slow(time).secs_since(at(0))).sin());
    let (turn, up) = (
        |from, to| rotation_vector(rolled(from).inverse() * rolled(to)),
        |time| rolled(time).inverse() * DVec3::NEG_Y,
    );
    let mut registration = Registration::new(DQuat::IDENTITY, None);
    for tenths in 10..1210 {
        let (now, before) = (at(tenths), at(tenths).plus_ns(-33_000_000));
        let sight =
            UpSight { seen: up(now.plus_ns(-late_ms * 1_000_000)), predicted: up(now), is_predicted: true };
        registration.up(now, &sight, |time| Some(up(time)));
        if tenths % 10 == 0 {
            let covariance = DMat3::from_diagonal(DVec3::splat(1e-7));
            let seen = TurnSeen { from: before, turn: turn(before, now), covariance, patches: (20, 20) };
            registration.turned(&seen, now, |ns| Some(turn(before.plus_ns(-ns), now.plus_ns(-ns))));
        }
        if matches!(registration.wrong(), Some(Misfit::Late(_))) {
            return Some(now.secs_since(at(10)));
        }
    }
    None
}

#[test]
fn verticals_that_sway_late_while_the_picture_turns_in_time_are_no_late_pictures() {
    for late_ms in [100, 200, 400] {
        for speed in [0.3, 0.5, 0.7, 1.0, 1.5] {
            assert_eq!(late_verticals(late_ms, speed), None, "{late_ms} ms, speed {speed}");
        }
    }
}

#[test]
fn a_unit_that_restarts_is_checked_anew() {
    let (_, mut watch) = watched(1.0, turn, up);
    assert!(watch.checks(at(110)).is_tried);
    watch.restart();
    assert_eq!(watch.checks(at(110)), RegistrationChecks { unseen_s: f64::INFINITY, is_tried: false });
}

#[test]
fn what_is_as_believed_is_confirmed_and_nothing_is_told() {
    assert_eq!(told(turn, up), (None, None));
    // Half a degree off: within what a unit alone is off on a ship.
    let tilt = DQuat::from_rotation_x(0.5f64.to_radians());
    assert_eq!(told(turn, |time| tilt * up(time)), (None, None));
}

#[test]
fn each_way_to_be_wrong_is_told_soon_by_its_name() {
    let diagonal = |x, y, z| DMat3::from_diagonal(DVec3::new(x, y, z));
    let turned = DMat3::from_quat(DQuat::from_rotation_z(std::f64::consts::PI));
    let quarter = DMat3::from_quat(DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2));
    let cases = [
        (turned, turned, Misfit::Turned(180)),
        (quarter, quarter, Misfit::Turned(90)),
        (diagonal(1.0, -1.0, -1.0), diagonal(-1.0, 1.0, 1.0), Misfit::Mirrored),
        (diagonal(1.0, -1.0, 1.0), DMat3::IDENTITY, Misfit::Reversed("the rate about y")),
        (DMat3::IDENTITY, diagonal(-1.0, -1.0, -1.0), Misfit::Reversed(FORCE)),
        (diagonal(1.5, 1.5, 1.0), DMat3::IDENTITY, Misfit::Lens),
    ];
    for (by_turn, by_up, misfit) in cases {
        let (first, last) = told(|from, to| by_turn * turn(from, to), |time| by_up * up(time));
        assert_eq!(last, Some(misfit));
        // A unit turned about the axis that the gun is swung about shows in what is left, which the sea's drift may be for some moments.
        let limit_s = if misfit == Misfit::Turned(90) { 2.2 } else { 2.0 };
        assert!(first.is_some_and(|s| s <= limit_s), "{misfit:?} after {first:?} s");
    }
    // The gun is believed to turn by up to 75 deg/s.
    let in_degrees = |from, to| turn(from, to) * 1f64.to_radians();
    let (first, watch) = watched(3.0, in_degrees, up);
    assert_eq!(watch.wrong(), Some(Misfit::RateUnit));
    assert!(first.is_some_and(|s| s <= 2.0), "after {first:?} s");
    let tilt = DQuat::from_rotation_x(5f64.to_radians());
    let (first, last) = told(turn, |time| tilt * up(time));
    assert_eq!(last, Some(Misfit::Mount), "after {first:?} s");
    let late = |time: Time| time.plus_ns(-200_000_000);
    let (first, last) = told(|from, to| turn(late(from), late(to)), |time| up(late(time)));
    assert_eq!(last, Some(Misfit::Late(200)), "after {first:?} s");
}

#[test]
fn a_belief_ends_after_its_cause() {
    let mut registration = Registration::new(DQuat::IDENTITY, None);
    let see = |registration: &mut Registration, tenths: i64, map: DMat3| {
        let sight = UpSight { seen: map * up(at(tenths)), predicted: up(at(tenths)), is_predicted: true };
        registration.up(at(tenths), &sight, |time| Some(up(time)));
    };
    let upside_down = DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0));
    (0..30).for_each(|tenths| see(&mut registration, tenths, upside_down));
    assert!(registration.wrong().is_some());
    assert_eq!(registration.checks(at(30)).unseen_s, f64::INFINITY);
    (30..60).for_each(|tenths| see(&mut registration, tenths, DMat3::IDENTITY));
    assert_eq!(registration.wrong(), None);
    assert!(registration.checks(at(60)).unseen_s < 0.2);
}

#[test]
fn force_in_g_is_told_by_its_size_and_rates_by_the_units_own_orientation() {
    let fed = |factor: f64, rates: DVec3, own: bool| {
        let mut registration = Registration::new(DQuat::IDENTITY, None);
        for i in 0..600 {
            let time = Time::from_ns(i * 5_000_000);
            let rate = turn(time.plus_ns(-5_000_000), time) / 0.005;
            let sample = ImuSample {
                arrival: time,
                device_time_ns: i * 5_000_000,
                rate,
                accel: up(time) * 9.8 * factor,
                world_from_imu: own.then(|| moved(time)),
            };
            registration.sample(time, &sample, rate * rates);
        }
        registration.wrong()
    };
    assert_eq!(fed(1.0, DVec3::ONE, true), None);
    assert_eq!(fed(1.0 / 9.8, DVec3::ONE, true), Some(Misfit::ForceUnit));
    assert_eq!(fed(1.0 / 9.8, DVec3::ONE, false), Some(Misfit::ForceUnit));
    assert_eq!(fed(1.0, DVec3::ONE.with_y(-1.0), true), Some(Misfit::Reversed("the rate about y")));
    assert_eq!(fed(1.0, DVec3::ONE * 57.3, true), Some(Misfit::RateUnit));
    assert_eq!(fed(-1.0, DVec3::ONE, true), Some(Misfit::Reversed(FORCE)));
}

#[test]
fn hours_of_a_small_error_are_no_wrong_set_up() {
    let mut registration = Registration::new(DQuat::IDENTITY, None);
    // The unit alone has up half a degree off all the time, as in a long turn; an hour, ten times a second.
    let seen = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.5f64.to_radians()) * DVec3::Y;
    for tenths in 0..36_000 {
        let sight = UpSight { seen, predicted: seen, is_predicted: true };
        registration.up(at(tenths), &sight, |_| Some(DVec3::Y));
        assert_eq!(registration.wrong(), None, "after {tenths} tenths of a second");
    }
}

#[test]
fn a_ship_that_turns_is_no_wrong_set_up_and_a_mount_that_is_off_is_one() {
    // Five minutes; the ship turns at 5 deg/s for twenty seconds of each forty, to either side by turns, with 12 m/s of way: up leans by
    // 6 deg. The gun stands, or is swung so far to either side in nine seconds, and its own up leans with the ship's.
    let run = |turns: bool, off_deg: f64, swing_deg: f64| {
        let mut registration = Registration::new(DQuat::IDENTITY, None);
        let mut lean = 0.0;
        for step in 0..60_000_i64 {
            let time = Time::from_ns(step * 5_000_000);
            let phase = (step / 200) % 80;
            let rate = if turns && phase < 20 {
                0.087
            } else if turns && (40..60).contains(&phase) {
                -0.087
            } else {
                0.0
            };
            lean += (rate * 12.0 / 9.8 - lean) * 0.0005;
            let phase = std::f64::consts::TAU / 9.0 * time.secs_since(at(0));
            let traverse = swing_deg.to_radians() * phase.sin();
            let rate = rate + swing_deg.to_radians() * std::f64::consts::TAU / 9.0 * phase.cos();
            let sample = ImuSample {
                arrival: time,
                device_time_ns: step * 5_000_000,
                rate: DVec3::Z * rate,
                accel: DVec3::Z * 9.8,
                world_from_imu: None,
            };
            registration.sample(time, &sample, sample.rate);
            if step % 20 == 0 {
                let ahead = DQuat::from_rotation_z(-traverse) * DVec3::X;
                let leant = DQuat::from_axis_angle(ahead, lean) * DVec3::Z;
                let seen = DQuat::from_rotation_x(off_deg.to_radians()) * leant;
                let sight = UpSight { seen, predicted: DVec3::Z, is_predicted: true };
                registration.up(time, &sight, |_| Some(DVec3::Z));
            }
            if registration.wrong().is_some() {
                return registration.wrong();
            }
        }
        None
    };
    for swing_deg in [0.0, 17.0, 28.0] {
        assert_eq!(run(true, 0.0, swing_deg), None, "swung by {swing_deg} deg");
    }
    assert_eq!(run(false, 4.0, 0.0), Some(Misfit::Mount));
}

#[test]
fn a_sea_that_drifts_by_is_no_other_lens() {
    // A minute of a ship that turns steadily; the waves that the picture shows go by at 1 deg/s, so that it seems to turn by less.
    let turned_by = |rate: f64| {
        let mut registration = Registration::new(DQuat::IDENTITY, None);
        (0..300).find_map(|fifth| {
            let (from, now) = (at(2 * fifth), at(2 * fifth).plus_ns(100_000_000));
            let covariance = DMat3::from_diagonal(DVec3::splat(5e-7));
            let turn = DVec3::Y * (rate - 1f64.to_radians()) * 0.1;
            let seen = TurnSeen { from, turn, covariance, patches: (8, 8) };
            registration.turned(&seen, now, |_| Some(DVec3::Y * rate * 0.1));
            registration.wrong()
        })
    };
    assert_eq!(turned_by(3f64.to_radians()), None);
    assert_eq!(turned_by(-1.5f64.to_radians()), None);
}

#[test]
fn a_line_that_is_seen_now_and_then_is_no_horizon_of_a_mount_that_is_off() {
    // Twelve degrees off each time, so often one picture after the other, then none for ten seconds.
    let after = |sights: i64| {
        let mut registration = Registration::new(DQuat::IDENTITY, None);
        let seen = DQuat::from_rotation_x(12f64.to_radians()) * DVec3::Z;
        (0..36_000_i64).filter(|tenths| tenths % 100 < sights).find_map(|tenths| {
            let sight = UpSight { seen, predicted: DVec3::Z, is_predicted: false };
            registration.up(at(tenths), &sight, |_| Some(DVec3::Z));
            registration.wrong()
        })
    };
    assert_eq!(after(5), None);
    assert_eq!(after(40), Some(Misfit::Mount));
}

/// Pictures of a camera in which a turn was looked for, of those in which horizon and sky are sought in every `busy`-th.
fn looked_for(period_ns: i64, busy: usize) -> Vec<usize> {
    let (picture, lens) =
        (Picture::black(PixelFormat::Yuyv, 640, 360).unwrap(), Lens::pinhole(640, 360, 1.1));
    let settings = AttitudeSettings::new(Source::Auto, &Calibration::nominal(lens));
    let attitude = Attitude::new(settings, DVec3::ZERO, DQuat::IDENTITY);
    let mut registration = Registration::new(DQuat::IDENTITY, None);
    (0..24)
        .filter(|&i: &usize| {
            let time = at(0).plus_ns(i as i64 * period_ns);
            let is_shared = i.is_multiple_of(busy);
            let was_begun = registration.finder.is_begun();
            let stamped = StampedPicture { time, picture: &picture, lens: &lens, is_shared };
            registration.look(&stamped, &attitude);
            was_begun && !registration.finder.is_begun()
        })
        .collect()
}

#[test]
fn a_turn_is_looked_for_in_pictures_that_nothing_else_is_sought_in_where_there_are_such() {
    // At 30 Hz horizon and sky take every third picture.
    assert_eq!(looked_for(33_333_333, 3), [1, 7, 13, 19]);
    // At 20 Hz every other one.
    assert_eq!(looked_for(50_000_000, 2), [1, 5, 9, 13, 17, 21]);
    // At 10 Hz they take each, and turns are looked for as often as without them.
    assert_eq!(looked_for(100_000_000, 1), looked_for(100_000_000, 1000));
    assert_eq!(looked_for(100_000_000, 1).len(), 12);
}
