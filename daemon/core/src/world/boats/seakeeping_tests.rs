use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use proptest::prelude::*;

use super::*;
use crate::{
    sea::BeaufortForce,
    world::waves::{Spectrum, WaveSpec},
};

/// A parabolic outline.
fn hull(length_m: f64, beam_m: f64, draught_m: f64) -> HullForm {
    let half = length_m / 2.0;
    HullForm::new((-half, half), draught_m, 1.2, |x| 0.5 * beam_m * (1.0 - (x / half).powi(4)))
}

fn skiff() -> HullForm {
    hull(6.0, 1.8, 0.3)
}

fn sea(force: u8, seed: u64) -> WaveField {
    let force = BeaufortForce::new(force).expect("on the scale");
    WaveField::new(&WaveSpec { spectrum: Spectrum::of_force(force), wind_from: 0.7 }, seed)
}

fn swell(height_m: f64, period_s: f64) -> WaveField {
    let spectrum = Spectrum::jonswap(height_m, period_s, 3.3).expect("in range");
    WaveField::new(&WaveSpec { spectrum, wind_from: 2.0 }, 5)
}

/// A straight course at a heading and speed.
fn course(heading: f64, speed_m_s: f64) -> impl Fn(f64) -> CourseState {
    move |t| CourseState {
        position: DVec2::new(30.0, 200.0)
            + DVec2::new(heading.sin(), heading.cos()) * (speed_m_s * t.max(0.0)),
        heading,
        speed_m_s,
        sway_m_s: 0.0,
        turn_rate: 0.0,
    }
}

/// Follows it in stretches that are no gaps.
fn follow(ride: &mut SeakeepingState, until_s: f64, course: impl Fn(f64) -> CourseState, waves: &WaveField) {
    for i in 0..=10 {
        ride.follow(until_s * f64::from(i) / 10.0, &course, waves);
    }
}

#[test]
fn frames_at_any_pace_show_the_same_motion() {
    let (waves, course) = (sea(4, 3), course(0.4, 8.0));
    let mut whole = SeakeepingState::new(skiff());
    follow(&mut whole, 20.0, &course, &waves);
    let mut stuttering = SeakeepingState::new(skiff());
    let mut t = 0.0;
    for i in 0..10_000 {
        stuttering.follow(t, &course, &waves);
        // Tenths of milliseconds, then a hitch of a second.
        t += if i % 97 == 0 { 1.1 } else { 0.013 * f64::from(i % 5) };
        if t > 20.0 {
            break;
        }
    }
    stuttering.follow(20.0, &course, &waves);
    for i in 0..300 {
        let t = 17.0 + 0.01 * f64::from(i);
        let motion = whole.at(t).expect("followed");
        assert_eq!(stuttering.at(t), Some(motion), "after {t} s");
        assert!(motion.at.is_finite());
    }
    assert_eq!(whole.at(21.0), None, "not followed yet");
    assert_eq!(whole.at(5.0), None, "no longer kept");
}

#[test]
fn a_boat_that_is_struck_moves_as_if_its_new_course_had_always_been_known() {
    let waves = sea(4, 3);
    let (fast, slow) = (course(0.4, 8.0), course(0.4, 8.0));
    let struck = |t: f64| {
        let mut state = slow(t);
        if t > 12.34 {
            state.position = fast(12.34).position;
            state.speed_m_s = 0.0;
        }
        state
    };
    let mut known = SeakeepingState::new(skiff());
    follow(&mut known, 14.0, struck, &waves);
    let mut told = SeakeepingState::new(skiff());
    follow(&mut told, 12.4, &fast, &waves);
    told.forget_after(12.34);
    told.follow(14.0, struck, &waves);
    for i in 0..300 {
        let t = 11.0 + 0.01 * f64::from(i);
        assert_eq!(told.at(t), known.at(t), "after {t} s");
    }
}

#[test]
fn a_long_swell_carries_boats_as_its_surface_goes() {
    let (waves, course) = (swell(1.5, 14.0), course(0.9, 0.0));
    let mut ride = SeakeepingState::new(skiff());
    let (mut off, mut size) = (DVec3::ZERO, DVec3::ZERO);
    for i in 0..3000 {
        let t = 10.0 + 0.1 * f64::from(i);
        ride.follow(t, &course, &waves);
        let plane = BoatMotion::of_plane(ride.form(), &course, &waves, t).at;
        let gap = ride.at(t).expect("followed").at - plane;
        off += gap * gap;
        size += plane * plane;
    }
    let share = DVec3::new((off.x / size.x).sqrt(), (off.y / size.y).sqrt(), (off.z / size.z).sqrt());
    // Of its roll remains what the short waves of the swell's tail stir up.
    assert!(share.x < 0.05 && share.y < 0.2 && share.z < 0.1, "{share}");
}

/// Mean period of a motion on calm water after a push, seconds.
fn own_period(form: &HullForm, push: DVec3, axis: usize) -> f64 {
    let state = course(0.0, 0.0)(0.0);
    let h = STEP_S;
    let water = form.water(&state, &WaveField::FLAT, 0.0);
    let mut motion = BoatMotion { at: push, rate: DVec3::ZERO };
    let mut crossings = Vec::new();
    for i in 0..3600 {
        let next = form.step([&state, &state], [&water; 2], &motion, h);
        if motion.at[axis] > 0.0 && next.at[axis] <= 0.0 {
            crossings.push(f64::from(i) * h);
        }
        motion = next;
    }
    assert!(motion.at.abs().max_element() < push.abs().max_element(), "it comes to rest: {motion:?}");
    (crossings[1] - crossings[0]).abs()
}

#[test]
fn hulls_float_at_their_waterline_and_swing_as_such_boats_do() {
    let rest = course(0.0, 0.0)(0.0);
    let frigate = hull(120.0, 14.0, 4.5);
    for form in [skiff(), hull(14.0, 4.5, 1.2), frigate.clone()] {
        let water = form.water(&rest, &WaveField::FLAT, 0.0);
        let next = form.step([&rest, &rest], [&water; 2], &BoatMotion::default(), STEP_S);
        assert!(next.at.length() < 1e-9 && next.rate.length() < 1e-9, "{next:?}");
    }
    // Rolling periods of open boats and of frigates (IMO 2008 IS Code, 2.3: 2 C B / sqrt GM).
    let roll = DVec3::new(0.0, 0.1, 0.0);
    let (small, large) = (own_period(&skiff(), roll, 1), own_period(&frigate, roll, 1));
    assert!((1.0..2.5).contains(&small) && (7.0..14.0).contains(&large), "{small} s and {large} s");
    let heave = own_period(&frigate, DVec3::new(0.3, 0.0, 0.0), 0);
    assert!((4.0..9.0).contains(&heave), "{heave} s");
}

#[test]
fn a_frigate_hardly_moves_where_a_skiff_is_thrown_about() {
    let (waves, course) = (sea(4, 9), course(0.9, 0.0));
    let spread = |form: HullForm| {
        let mut ride = SeakeepingState::new(form);
        let mut sum = DVec3::ZERO;
        for i in 0..3000 {
            let t = 30.0 + 0.1 * f64::from(i);
            ride.follow(t, &course, &waves);
            let at = ride.at(t).expect("followed").at;
            sum += at * at / 3000.0;
        }
        DVec3::new(sum.x.sqrt(), sum.y.sqrt(), sum.z.sqrt())
    };
    let (small, large) = (spread(skiff()), spread(hull(120.0, 14.0, 4.5)));
    // The sea's own standard deviation is 0.25 m.
    assert!((0.15..0.35).contains(&small.x), "{small}");
    assert!(
        large.x < 0.35 * small.x && large.z < 0.1 * small.z && large.y < 0.5 * small.y,
        "{large}, {small}"
    );
}

#[test]
fn a_gap_of_an_hour_is_not_followed_through() {
    let (waves, course) = (sea(3, 3), course(0.4, 0.0));
    let mut ride = SeakeepingState::new(skiff());
    ride.follow(1.0, &course, &waves);
    ride.follow(3601.0, &course, &waves);
    let jumped = ride.at(3600.5).expect("followed");
    assert!(ride.motions.len() <= KEPT);
    // What it does then is what the sea of that time makes of any boat.
    let mut other = SeakeepingState::new(skiff());
    other.follow(3592.0, &course, &waves);
    other.follow(3601.0, &course, &waves);
    let gap = (other.at(3600.5).expect("followed").at - jumped.at).abs();
    assert!(gap.x < 0.01 && gap.y < 0.1 && gap.z < 0.01, "{gap}");
    ride.follow(f64::NAN, &course, &waves);
    assert!(ride.at(f64::NAN).is_none_or(|m| m.at.is_finite()));
}

#[test]
fn boats_of_scenarios_at_full_speed_never_leave_the_water_for_good() {
    let cases = [
        (skiff(), 15.0, 4),
        (skiff(), 0.0, 6),
        (hull(9.0, 2.8, 0.5), 23.0, 5),
        (hull(15.0, 4.5, 1.3), 5.0, 7),
        (hull(120.0, 14.0, 4.5), 15.0, 9),
    ];
    for (form, speed, force) in cases {
        for heading in [0.7, 2.3, 3.8] {
            let (waves, course) = (sea(force, 5), course(heading, speed));
            let mut motion = BoatMotion::of_plane(&form, &course, &waves, 0.0);
            for number in 0..3600 {
                let (a, b) = (course(seconds(number)), course(seconds(number + 1)));
                let now = form.water(&a, &waves, seconds(number));
                let then = form.water(&b, &waves, seconds(number + 1));
                motion = form.step([&a, &b], [&now, &then], &motion, STEP_S);
                assert!(
                    form.is_sane(&motion, waves.crest_max_m(), 0.0),
                    "force {force}, step {number}: {motion:?}"
                );
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// A dish of half a metre at 90 knots may turn over; it is put back, and no number ever is none.
    #[test]
    fn no_hull_on_no_sea_at_any_speed_ends_in_numbers_that_are_none(
        length in 0.3..200.0_f64, slender in 1.0..12.0_f64, deep in 0.0..1.0_f64, force in 0_u8..=12, seed in 0_u64..50,
        heading in -PI..PI, speed in 0.0..50.0_f64, hitch in 0.001..2.0_f64,
    ) {
        let waves = sea(force, seed);
        let course = course(heading, speed);
        let mut ride = SeakeepingState::new(hull(length, length / slender, deep * length / slender));
        for i in 0..50 {
            let t = f64::from(i) * hitch.min(0.4);
            ride.follow(t, &course, &waves);
            let motion = ride.at(t);
            let sane = motion.is_some_and(|m| ride.form().is_sane(&m, waves.crest_max_m(), 0.0));
            prop_assert!(sane, "{motion:?} after {t} s");
        }
    }
}
