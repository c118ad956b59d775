use proptest::prelude::*;

use super::*;

const NORTH_250: DVec2 = DVec2::new(0.0, 250.0);

fn samples() -> Vec<(&'static str, Course)> {
    let course = |c: Result<Course, CourseError>| c.expect("can be sailed");
    let points = [DVec2::new(100.0, 200.0), DVec2::new(120.0, 80.0), DVec2::new(-20.0, 120.0)];
    vec![
        ("still", course(Course::still(NORTH_250, 1.0))),
        ("straight", course(Course::straight(NORTH_250, 2.0, 7.7))),
        ("weave", course(Course::weave(NORTH_250, 1.0, 12.0, 15.0, 10.0))),
        ("waypoints", course(Course::waypoints(NORTH_250, &points, 6.0, false))),
        ("patrol", course(Course::waypoints(NORTH_250, &points, 6.0, true))),
        ("closing", course(Course::closing(NORTH_250, 0.4, 7.7, 60.0, Arrival::Stop))),
        ("circling", course(Course::closing(NORTH_250, PI, 7.7, 60.0, Arrival::Circle))),
    ]
}

/// Position, heading, speed and turn rate must belong together at every time.
fn check_consistent(name: &str, course: &Course, damage: &BoatDamage, until_s: f64) {
    let h = 1e-4;
    let mut t = h;
    while t < until_s {
        let (before, now, after) =
            (course.state(t - h, damage), course.state(t, damage), course.state(t + h, damage));
        let velocity = (after.position - before.position) / (2.0 * h);
        let expected = ahead(now.heading) * now.speed_m_s;
        // Within a step of a joint between pieces the differences straddle it: speed is continuous there, its change is not.
        assert!((velocity - expected).length() < 1e-2, "{name} at {t} s: {velocity} is not {expected}");
        assert!(now.speed_m_s <= course.speed_max_m_s() + 1e-9, "{name} at {t} s");
        t += 0.0371;
    }
}

#[test]
fn states_are_consistent() {
    for (name, course) in samples() {
        check_consistent(name, &course, &BoatDamage::NONE, 120.0);
    }
}

#[test]
fn states_are_consistent_after_damage() {
    let cases = [
        BoatDamage { engine_s: Some(20.0), helm_s: None, ..BoatDamage::NONE },
        BoatDamage { engine_s: None, helm_s: Some(20.0), ..BoatDamage::NONE },
        BoatDamage { engine_s: Some(15.0), helm_s: Some(16.5), ..BoatDamage::NONE },
        BoatDamage { engine_s: Some(16.5), helm_s: Some(15.0), ..BoatDamage::NONE },
        BoatDamage { engine_s: Some(0.0), helm_s: None, ..BoatDamage::NONE },
    ];
    for (name, course) in samples() {
        for damage in &cases {
            check_consistent(name, &course, damage, 60.0);
            let (rest, later) = (course.state(300.0, damage), course.state(3000.0, damage));
            assert!((rest.position - later.position).length() < 1e-6, "{name} {damage:?} comes to rest");
            assert!(rest.speed_m_s < 1e-6, "{name} {damage:?}: {} m/s", rest.speed_m_s);
        }
    }
}

#[test]
fn an_engine_hit_costs_the_way_of_its_time_constant() {
    let course = Course::straight(DVec2::ZERO, 0.0, 10.0).expect("can be sailed");
    let end = course.state(1e6, &BoatDamage { engine_s: Some(30.0), helm_s: None, ..BoatDamage::NONE });
    assert!((end.position.y - (300.0 + 10.0 * ENGINE_LOST_S)).abs() < 1e-9, "{end:?}");
}

#[test]
fn an_attacker_stops_where_it_is_told() {
    for start_heading in [0.0, 0.5, 1.5, 3.0, PI, -0.5, -2.0, -PI] {
        let course =
            Course::closing(NORTH_250, start_heading, 7.7, 60.0, Arrival::Stop).expect("can be sailed");
        let end = course.state(500.0, &BoatDamage::NONE);
        assert!((end.position.length() - 60.0).abs() < 1e-6, "{start_heading}: {end:?}");
        assert!(
            wrap(end.heading - heading_of(-end.position)).abs() < 1e-6,
            "{start_heading}: faces the ship"
        );
    }
}

#[test]
fn at_15_knots_200_yards_take_24_seconds() {
    // Nelson 2009, chapter I: 0.1 nautical miles by 15 knots.
    let course = Course::closing(DVec2::new(0.0, 185.2), PI, 15.0 * 1852.0 / 3600.0, 1.0, Arrival::Stop);
    let state = course.expect("can be sailed").state(12.0, &BoatDamage::NONE);
    assert!((state.position.y - 92.6).abs() < 1e-9, "{state:?}");
}

#[test]
fn a_circling_boat_keeps_its_distance_for_ever() {
    for start in [NORTH_250, DVec2::new(-120.0, -90.0)] {
        let course = Course::closing(start, 0.3, 9.0, 60.0, Arrival::Circle).expect("can be sailed");
        for t in [200.0, 1e3, 1e5, 1e7] {
            let state = course.state(t, &BoatDamage::NONE);
            assert!((state.position.length() - 60.0).abs() < 1e-5, "{start} at {t} s: {state:?}");
            assert!(state.position.dot(ahead(state.heading)).abs() < 1e-4, "tangential");
        }
    }
}

#[test]
fn a_boat_without_helmsman_does_not_run_into_the_own_ship() {
    let course = Course::closing(NORTH_250, PI, 15.0, 40.0, Arrival::Stop).expect("can be sailed");
    for hit in [5.0, 10.0, 12.0, 14.0, 60.0] {
        let damage = BoatDamage { engine_s: None, helm_s: Some(hit), ..BoatDamage::NONE };
        for t in 0..200 {
            let at = course.state(f64::from(t), &damage).position;
            assert!(at.length() >= DRIFT_CLEAR_M - 1e-9, "hit at {hit} s: {at} at {t} s");
        }
    }
}

#[test]
fn positions_stay_exact_after_days() {
    let course = Course::weave(DVec2::ZERO, 0.6, 8.0, 10.0, 8.0).expect("can be sailed");
    let forward = course.state(8.0, &BoatDamage::NONE).position / 8.0;
    let days = course.state(8.0 * 100_000.0, &BoatDamage::NONE).position;
    assert!((days - forward * 8.0 * 100_000.0).length() < 1e-5);
}

#[test]
fn what_cannot_be_sailed_is_refused() {
    let nan = Course::straight(DVec2::NAN, 0.0, 1.0);
    assert_eq!(nan, Err(CourseError::NotFinite));
    let weave = Course::weave(NORTH_250, 0.0, 2.0, 30.0, 5.0);
    assert!(matches!(weave, Err(CourseError::Weave { .. })), "{weave:?}");
    assert!(Course::weave(NORTH_250, 0.0, 2.0, 0.0, 0.0).is_err());
    let close = Course::closing(DVec2::new(0.0, 50.0), 0.0, 5.0, 45.0, Arrival::Stop);
    assert!(matches!(close, Err(CourseError::TooClose { .. })), "{close:?}");
    let back = Course::waypoints(DVec2::ZERO, &[DVec2::new(0.0, 90.0), DVec2::new(1.0, 0.0)], 5.0, false);
    assert_eq!(back, Err(CourseError::SharpCorner { index: 1 }));
    let twice = Course::waypoints(DVec2::ZERO, &[DVec2::new(0.0, 90.0), DVec2::new(0.0, 91.0)], 5.0, false);
    assert_eq!(twice, Err(CourseError::PointsCoincide { index: 1 }));
    assert_eq!(Course::waypoints(DVec2::ZERO, &[], 5.0, false), Err(CourseError::TooFewPoints));
}

proptest! {
    #[test]
    fn the_first_time_within_a_radius_is_found(
        x in -300.0..300.0_f64, y in -300.0..300.0_f64, heading in -7.0..7.0_f64, speed in 0.5..20.0_f64,
        radius in 1.0..40.0_f64, amplitude in 0.0..20.0_f64,
    ) {
        let start = DVec2::new(x, y);
        prop_assume!(start.length() > radius + 1.0);
        let course = Course::weave(start, heading, speed, amplitude, 20.0 + 7.0 * amplitude / speed).expect("can be sailed");
        let by_steps = (0..60_000).map(|i| f64::from(i) * 0.005)
            .find(|&t| course.state(t, &BoatDamage::NONE).position.length() < radius - 0.11);
        let found = course.first_within(radius, 300.0);
        if let Some(t) = by_steps {
            let found = found.expect("found by steps");
            prop_assert!(found <= t + 1e-9);
        }
        if let Some(t) = found {
            prop_assert!(course.state(t, &BoatDamage::NONE).position.length() < radius);
        }
    }

    #[test]
    fn closing_always_turns_in_smoothly(
        bearing in -7.0..7.0_f64, range in 60.0..2000.0_f64, heading in -7.0..7.0_f64, circle in any::<bool>(),
    ) {
        let arrival = if circle { Arrival::Circle } else { Arrival::Stop };
        let course = Course::closing(ahead(bearing) * range, heading, 10.0, 20.0, arrival).expect("can be sailed");
        let mut last = course.state(0.0, &BoatDamage::NONE);
        for i in 1..1500 {
            let now = course.state(f64::from(i) * 0.2, &BoatDamage::NONE);
            prop_assert!((now.position - last.position).length() <= 2.0 + 1e-6, "jump at step {i}");
            prop_assert!(wrap(now.heading - last.heading).abs() < 0.4, "spin at step {i}");
            prop_assert!(now.position.length() > 20.0 - 1e-6, "closer than told at step {i}");
            last = now;
        }
        prop_assert!((course.state(1e4, &BoatDamage::NONE).position.length() - 20.0).abs() < 1e-5);
    }
}
