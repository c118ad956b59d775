use proptest::prelude::*;

use super::*;
use crate::test_data::rows;

fn level(bc: f64, v0: f64, wind: DVec3) -> Flight {
    fired(bc, v0, DVec3::Y, wind)
}

fn fired(bc: f64, v0: f64, direction: DVec3, wind: DVec3) -> Flight {
    let projectile = Projectile::new(bc, v0).expect("a usable round");
    Flight::new(projectile, &Atmosphere::ICAO, DVec3::ZERO, direction, wind).expect("finite")
}

/// When the flight's y passes `range_m`, by bisection within the segment that holds it.
fn crossing(flight: &mut Flight, range_m: f64) -> FlightState {
    let segment = loop {
        let segment = flight.next_segment(60.0).expect("gets there within a minute");
        if segment.to.position.y >= range_m {
            break segment;
        }
    };
    let (mut low, mut high) = (segment.from.time_s, segment.to.time_s);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if flight.state_at(middle).position.y < range_m { low = middle } else { high = middle }
    }
    flight.state_at(high)
}

#[test]
fn reproduces_the_reference_trajectories() {
    let table = rows(include_str!("../../../data/traj_g7_pointmass.csv"));
    assert_eq!(table.len(), 30);
    let (mut worst_s, mut worst_m, mut worst_m_s) = (0.0_f64, 0.0_f64, 0.0_f64);
    for row in &table {
        let end = crossing(&mut level(row[0], row[1], DVec3::ZERO), row[2]);
        worst_s = worst_s.max((end.time_s - row[3]).abs());
        worst_m = worst_m.max((end.position.z - row[4]).abs());
        worst_m_s = worst_m_s.max((end.velocity.length() - row[5]).abs());
    }
    eprintln!("worst of {} rows: {worst_s:.2e} s, {worst_m:.2e} m, {worst_m_s:.2e} m/s", table.len());
    // What is asked for is 1 ms and 1 cm; this holds it a thousand times closer.
    assert!(
        worst_s < 1e-6 && worst_m < 1e-5 && worst_m_s < 2e-4,
        "{worst_s} s, {worst_m} m, {worst_m_s} m/s"
    );
}

#[test]
fn is_within_a_millisecond_and_a_centimetre_of_an_independent_solver() {
    // Columns pbc_*: py_ballisticcalc, with its own atmosphere and interpolation of the drag table.
    for row in rows(include_str!("../../../data/traj_g7_pointmass.csv")) {
        let end = crossing(&mut level(row[0], row[1], DVec3::ZERO), row[2]);
        assert!((end.time_s - row[6]).abs() < 1e-3, "{row:?}: {end:?}");
        assert!((end.position.z - row[7]).abs() < 1e-2, "{row:?}: {end:?}");
    }
}

#[test]
fn without_drag_it_is_the_parabola() {
    for elevation_deg in [-80.0_f64, -10.0, 0.0, 0.3, 45.0, 89.0, 90.0] {
        let direction = DVec3::new(0.0, elevation_deg.to_radians().cos(), elevation_deg.to_radians().sin());
        let mut flight = fired(f64::INFINITY, 850.0, direction, DVec3::new(12.0, -3.0, 0.0));
        for i in 1..=100 {
            let t = 0.0837 * f64::from(i);
            flight.advance(t - flight.time_s());
            let exact = direction * 850.0 * t - DVec3::Z * (GRAVITY_M_S2 / 2.0 * t * t);
            let error = (flight.state().position - exact).length();
            assert!(error < 1e-9 * (1.0 + exact.length()), "{elevation_deg} deg, {t} s: {error} m");
        }
    }
}

#[test]
fn crosswind_follows_the_lag_rule() {
    // Didion: drift = W (t - x / v0), exact for a flat trajectory and a small wind.
    for (bc, v0) in [(0.3, 850.0), (0.7, 900.0), (0.33, 890.0)] {
        for range in [300.0, 1000.0, 1500.0] {
            let end = crossing(&mut level(bc, v0, DVec3::X * 5.0), range);
            let lag = 5.0 * (end.time_s - range / v0);
            let error = (end.position.x - lag).abs();
            assert!(error < 0.002 * lag, "bc {bc}, {range} m: drift {} m, lag rule {lag} m", end.position.x);
        }
    }
}

#[test]
fn a_following_wind_equals_slower_air() {
    // Galilei: in the air's own frame a round fired into wind W along its path starts at v0 - W.
    let mut with_wind = level(0.4, 900.0, DVec3::Y * 40.0);
    let mut still_air = level(0.4, 860.0, DVec3::ZERO);
    for i in 1..200 {
        let t = 0.011 * f64::from(i);
        with_wind.advance(t - with_wind.time_s());
        still_air.advance(t - still_air.time_s());
        let expected = still_air.state().position + DVec3::Y * 40.0 * t;
        assert!((with_wind.state().position - expected).length() < 1e-8, "{t} s");
    }
}

#[test]
fn halving_the_step_changes_nothing_that_matters() {
    // Includes the steep rise of drag at Mach 1 (340 m/s), slow flight, and an almost vertical shot.
    let cases = [
        (0.3, 850.0, 0.0_f64),
        (0.5, 380.0, 0.0),
        (0.3, 345.0, 2.0),
        (0.2, 335.0, 0.0),
        (0.1, 900.0, 1.0),
        (0.3, 850.0, 85.0),
    ];
    for (bc, v0, elevation_deg) in cases {
        let direction = DVec3::new(0.0, elevation_deg.to_radians().cos(), elevation_deg.to_radians().sin());
        let flight = fired(bc, v0, direction, DVec3::ZERO);
        let (mut coarse, mut fine) = (flight.state(), flight.state());
        let mut worst = 0.0_f64;
        for _ in 0..250 {
            coarse = flight.dynamics.runge_kutta(&coarse, STEP_S);
            for _ in 0..16 {
                fine = flight.dynamics.runge_kutta(&fine, STEP_S / 16.0);
            }
            worst = worst.max((coarse.position - fine.position).length());
        }
        eprintln!("bc {bc}, {v0} m/s, {elevation_deg} deg: worst {worst:.1e} m in 5 s");
        assert!(worst < 3e-3, "bc {bc}, {v0} m/s, {elevation_deg} deg: {worst} m");
    }
}

#[test]
fn positions_between_steps_lie_on_the_integrated_path() {
    let mut flight = level(0.33, 890.0, DVec3::X * 8.0);
    flight.advance(0.4);
    for i in 0..19 {
        for fraction in [0.25, 0.5, 0.9] {
            let node = flight.kept(i);
            let exact = flight.dynamics.runge_kutta(&node, STEP_S * fraction);
            let dense = flight.state_at(node.time_s + STEP_S * fraction);
            assert!((dense.position - exact.position).length() < 2e-6, "step {i} + {fraction}");
            assert!((dense.velocity - exact.velocity).length() < 1e-3, "step {i} + {fraction}");
        }
    }
}

#[test]
fn the_path_does_not_depend_on_how_it_is_asked_for() {
    let mut by_frames = level(0.33, 890.0, DVec3::X);
    let mut at_once = by_frames.clone();
    let mut end = DVec3::ZERO;
    for frame in 1..=90 {
        while let Some(segment) = by_frames.next_segment(f64::from(frame) / 30.0) {
            assert_eq!(segment.from.position, end, "no gap between segments");
            assert!(segment.to.time_s - segment.from.time_s <= STEP_S * (1.0 + 1e-9));
            end = segment.to.position;
        }
        assert_eq!(by_frames.time_s(), f64::from(frame) / 30.0);
    }
    at_once.advance(3.0);
    assert_eq!(at_once.state(), by_frames.state());
}

#[test]
fn chords_stay_close_to_the_path() {
    let mut flight = level(0.1, 900.0, DVec3::ZERO);
    while let Some(s) = flight.next_segment(2.0) {
        let middle = flight.state_at((s.from.time_s + s.to.time_s) / 2.0).position;
        let along = (s.to.position - s.from.position).normalize();
        let off = (middle - s.from.position).reject_from_normalized(along).length();
        assert!(off < 1e-3, "{off} m off the chord at {} s", s.from.time_s);
    }
}

#[test]
fn a_round_that_cannot_be_flown_is_refused() {
    for (bc, v0) in [(0.0, 850.0), (-1.0, 850.0), (f64::NAN, 850.0), (0.3, -1.0), (0.3, f64::NAN), (0.3, 1e9)]
    {
        assert!(Projectile::new(bc, v0).is_none(), "bc {bc}, {v0} m/s");
    }
    let round = Projectile::new(0.3, 850.0).expect("a usable round");
    for bad in [DVec3::ZERO, DVec3::NAN, DVec3::splat(f64::INFINITY)] {
        assert!(Flight::new(round, &Atmosphere::ICAO, DVec3::ZERO, bad, DVec3::ZERO).is_none(), "{bad}");
    }
    assert!(Flight::new(round, &Atmosphere::ICAO, DVec3::NAN, DVec3::Y, DVec3::ZERO).is_none());
    assert!(Flight::new(round, &Atmosphere::ICAO, DVec3::ZERO, DVec3::Y, DVec3::NAN).is_none());
}

#[test]
fn odd_times_are_ridden_out() {
    let mut flight = level(0.3, 850.0, DVec3::ZERO);
    flight.advance(f64::NAN);
    flight.advance(-3.0);
    assert_eq!(flight.state().position, DVec3::ZERO);
    assert!(flight.next_segment(f64::NAN).is_none());
    flight.advance(2.0);
    for t in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, 1.999] {
        assert!(flight.state_at(t).position.is_finite(), "{t}");
    }
}

proptest! {
    #[test]
    fn stays_finite_and_never_gains_energy_in_still_air(
        bc in 0.01..2.0_f64, v0 in 0.0..3000.0_f64, azimuth in 0.0..7.0_f64, elevation in -1.58..1.58_f64,
    ) {
        let direction = DVec3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
        let mut flight = fired(bc, v0, direction, DVec3::ZERO);
        let energy = |s: &FlightState| s.velocity.length_squared() / 2.0 + GRAVITY_M_S2 * s.position.z;
        let mut last = energy(&flight.state());
        for _ in 0..60 {
            flight.advance(0.5);
            let state = flight.state();
            prop_assert!(state.position.is_finite() && state.velocity.is_finite());
            let now = energy(&state);
            prop_assert!(now <= last + 1e-6 * last.abs().max(1.0), "energy rose from {last} to {now}");
            last = now;
        }
    }

    #[test]
    fn stays_finite_in_any_wind(
        bc in 0.01..2.0_f64, v0 in 0.0..3000.0_f64, z in -1.0..1.0_f64, wx in -100.0..100.0_f64, wz in -100.0..100.0_f64,
    ) {
        let mut flight = fired(bc, v0, DVec3::new(0.1, 1.0, z), DVec3::new(wx, -wz, wz));
        flight.advance(40.0);
        prop_assert!(flight.state().position.is_finite() && flight.state().velocity.length() < 3100.0);
    }
}
