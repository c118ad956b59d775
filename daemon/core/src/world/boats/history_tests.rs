use glam::DVec2;

use super::*;
use crate::model::Zone;
use crate::{
    sea::BeaufortForce,
    world::{
        boats::Course,
        waves::{Spectrum, WaveSpec},
    },
};

const SKIFF: Hull = Hull { length_m: 6.0, beam_m: 1.8 };

fn boat(course: Course) -> BoatHistory {
    let form = HullForm::new((-3.0, 3.0), 0.3, 1.2, |x: f64| 0.9 * (1.0 - (x / 3.0).powi(4)));
    BoatHistory::new(Behaviour::ScriptedCourse(course), SKIFF, form)
}

/// Round a square of 200 m with arcs of 25 m radius.
fn square() -> Course {
    let points = [(100.0, 100.0), (100.0, -100.0), (-100.0, -100.0)].map(|(x, y)| DVec2::new(x, y));
    Course::waypoints(DVec2::new(-100.0, 100.0), &points, 9.0, true).expect("it can be sailed")
}

fn sea() -> WaveField {
    let force = BeaufortForce::new(4).expect("on the scale");
    WaveField::new(&WaveSpec { spectrum: Spectrum::of_force(force), wind_from: 0.7 }, 3)
}

/// Steps to `until_s` as frames do.
fn follow(boat: &mut BoatHistory, until_s: f64, waves: &WaveField) {
    for frame in 0..=(until_s * 30.0) as i32 {
        boat.follow(f64::from(frame) / 30.0, waves);
    }
    boat.follow(until_s, waves);
}

#[test]
fn between_its_states_a_boat_is_where_its_course_has_it() {
    let weave = Course::weave(DVec2::new(40.0, 150.0), 1.1, 9.0, 10.0, 9.0).expect("it can be sailed");
    for (course, off_m) in [(weave, 1e-7), (square(), 2e-4)] {
        let mut boat = boat(course.clone());
        follow(&mut boat, 60.0, &WaveField::FLAT);
        for i in 0..17_000 {
            let t = 42.5 + 1e-3 * f64::from(i);
            let (is, was) = (boat.state(t), course.state(t, &BoatDamage::NONE));
            assert!((is.position - was.position).length() < off_m, "{t}: {is:?}, {was:?}");
            let turned = (is.heading - was.heading).sin().abs();
            assert!(turned < 2e-3 && (is.speed_m_s - was.speed_m_s).abs() < 1e-3, "{t}: {is:?}, {was:?}");
        }
    }
}

#[test]
fn states_do_not_depend_on_the_pace_of_frames() {
    let waves = sea();
    let (mut steady, mut stuttering) = (boat(square()), boat(square()));
    follow(&mut steady, 30.0, &waves);
    for i in 0..=10 {
        stuttering.follow(3.0 * f64::from(i), &waves);
    }
    for i in 0..400 {
        let t = 26.5 + 0.00871 * f64::from(i);
        assert_eq!(steady.floating(t, &waves), stuttering.floating(t, &waves), "after {t} s");
    }
}

#[test]
fn what_strikes_a_boat_changes_what_comes_after_and_nothing_before() {
    let waves = sea();
    let (mut hit, mut spared) = (boat(square()), boat(square()));
    follow(&mut hit, 20.0, &waves);
    follow(&mut spared, 20.0, &waves);
    hit.strike(&Zone::Engine.into(), 19.77);
    hit.follow(20.0, &waves);
    for t in [10.0, 19.0, 19.75] {
        assert_eq!(hit.floating(t, &waves), spared.floating(t, &waves), "{t}");
    }
    follow(&mut hit, 26.0, &waves);
    assert!(hit.state(26.0).speed_m_s < 1.2 && hit.state(19.0).speed_m_s > 8.9);
    // Told later, it is where it would be had it been told at once; a second hit on the engine changes nothing.
    let mut told = boat(square());
    told.strike(&Zone::Engine.into(), 19.77);
    follow(&mut told, 26.0, &waves);
    hit.strike(&Zone::Engine.into(), 22.0);
    hit.strike(&Zone::Hull.into(), 23.0);
    for i in 0..60 {
        let t = 23.0 + 0.05 * f64::from(i);
        assert_eq!(hit.floating(t, &waves), told.floating(t, &waves), "{t}");
    }
}

#[test]
fn the_past_is_bounded_and_before_it_a_boat_came_straight_on() {
    let mut boat = boat(Course::straight(DVec2::new(5.0, 90.0), 1.0, 6.0).expect("it can be sailed"));
    follow(&mut boat, 1.0, &WaveField::FLAT);
    let before = boat.state(-3.0).position - boat.state(0.0).position;
    assert!((before + DVec2::new(1.0f64.sin(), 1.0f64.cos()) * 18.0).length() < 1e-9, "{before}");
    follow(&mut boat, 60.0, &WaveField::FLAT);
    assert!(boat.states.len() <= KEPT);
    let course = Course::straight(DVec2::new(5.0, 90.0), 1.0, 6.0).expect("it can be sailed");
    for age in [0.0, 7.3, 15.0, 17.5] {
        let off = boat.state(60.0 - age).position - course.state(60.0 - age, &BoatDamage::NONE).position;
        assert!(off.length() < 1e-9, "{age} s ago: {off}");
    }
}

#[test]
fn after_a_gap_a_boat_is_where_its_course_has_it_with_all_of_its_wake() {
    let (waves, course) = (sea(), square());
    let mut boat = boat(course.clone());
    boat.follow(1.0, &waves);
    boat.follow(3601.0, &waves);
    for age in [0.0, 1.0, 15.0, 17.0] {
        let t = 3601.0 - age;
        let off = boat.state(t).position - course.state(t, &BoatDamage::NONE).position;
        assert!(off.length() < 2e-4, "{age} s ago: {off}");
    }
    boat.follow(f64::NAN, &waves);
    assert!(boat.state(f64::NAN).speed_m_s.is_finite());
}
