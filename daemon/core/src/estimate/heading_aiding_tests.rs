use std::f64::consts::TAU;

use glam::DVec3;

use super::*;
use crate::{
    calibration::Calibration,
    estimate::attitude::{AttitudeSettings, Source},
    event::ImuSample,
    geometry::{Lens, look},
};

const DEG: f64 = std::f64::consts::PI / 180.0;

/// A unit that finds its orientation by itself and drifts, on a gun on a ship that yaws about north.
struct HeadingRig {
    attitude: Attitude,
    aid: HeadingAiding,
    drift_deg_s: f64,
    /// The gun's bearing on its mount, degrees, over time.
    bearing: fn(f64) -> f64,
    /// What the ship's line says of a heading at that time, degrees; `None`: no line.
    line: fn(f64, f64) -> Option<f64>,
    /// By how much the sea rolls ship and gun, degrees.
    roll_deg: f64,
    t: f64,
}

/// The ship's heading, degrees: through north, so that it wraps.
fn ship_deg(t: f64) -> f64 {
    4.0 * (t * 0.05).sin() + 0.5 * (t * 0.7).sin()
}

fn calibration() -> Calibration {
    Calibration::nominal(Lens::pinhole(4, 2, 1.0))
}

impl HeadingRig {
    fn new(
        drift_deg_s: f64,
        bearing: fn(f64) -> f64,
        line: fn(f64, f64) -> Option<f64>,
        settings: HeadingSettings,
    ) -> Self {
        let mut of_unit = AttitudeSettings::new(Source::Auto, &calibration());
        // A unit that does not drift is known not to.
        of_unit.own_growth = (0.002 + 2.0 * drift_deg_s) * DEG;
        let attitude = Attitude::new(of_unit, DVec3::ZERO, DQuat::IDENTITY);
        Self {
            attitude,
            aid: HeadingAiding::new(settings),
            drift_deg_s,
            bearing,
            line,
            roll_deg: 0.0,
            t: 0.0,
        }
    }

    fn time(&self) -> Time {
        Time::from_ns(NS_PER_S).plus_secs(self.t)
    }

    fn truth_deg(&self) -> f64 {
        ship_deg(self.t) + (self.bearing)(self.t)
    }

    /// What is believed less what is true, degrees.
    fn error_deg(&self) -> f64 {
        let believed = azimuth(self.attitude.at(self.time()).unwrap().world_from_imu).unwrap();
        wrapped(believed - self.truth_deg() * DEG) / DEG
    }

    fn run(&mut self, until: f64) {
        while self.t < until {
            self.t += 0.01;
            let roll = self.roll_deg * (0.7 * self.t).sin() * DEG;
            let said = look((self.truth_deg() + self.drift_deg_s * self.t) * DEG, -0.1, roll);
            let sample = ImuSample {
                arrival: self.time(),
                device_time_ns: self.time().ns(),
                rate: DVec3::ZERO,
                accel: DVec3::Z,
                world_from_imu: Some(said),
            };
            self.attitude.observe(self.time(), &sample);
            // Five lines a second, in tenths of a degree.
            if (self.t * 100.0).round() as i64 % 20 == 0
                && let Some(deg) = (self.line)(self.t, ship_deg(self.t))
            {
                let told = (deg * 10.0).round() / 10.0;
                let sample = ShipSample {
                    arrival: self.time(),
                    heading: Some((told * DEG).rem_euclid(TAU)),
                    roll: None,
                    pitch: None,
                    heading_sigma: None,
                    reduced: false,
                };
                self.aid.ship(&sample, &mut self.attitude);
            }
        }
    }
}

fn every(_: f64, deg: f64) -> Option<f64> {
    Some(deg)
}

fn stow() -> HeadingSettings {
    let stow = Stow { from_bow: Some(30.0 * DEG), from_north: Some(10.0 * DEG), sigma: 0.2 * DEG };
    let landmark = |deg: f64| Landmark { bearing: deg * DEG, sigma: 0.1 * DEG };
    let landmarks = vec![landmark(100.0), landmark(30.0), landmark(-30.0)];
    HeadingSettings { stow: Some(stow), landmarks, ..HeadingSettings::default() }
}

#[test]
fn a_gun_that_rests_is_held_by_the_ship() {
    let mut rig = HeadingRig::new(0.02, |_| 30.0, every, HeadingSettings::default());
    rig.run(120.0);
    assert!(rig.error_deg().abs() < 0.2, "{} deg, alone 2.4", rig.error_deg());
    let counts = rig.aid.counts();
    assert_eq!((counts.ship, counts.rests), (600, 1), "{counts:?}");
    assert!(rig.attitude.heading_sigma().unwrap() < 0.4 * DEG);
}

#[test]
fn a_constant_offset_of_the_ships_does_nothing() {
    let mut rig = HeadingRig::new(0.02, |_| 30.0, |_, deg| Some(deg + 20.0), HeadingSettings::default());
    rig.run(120.0);
    assert!(rig.error_deg().abs() < 0.2, "{} deg", rig.error_deg());
}

/// From 30 to 60 s the gun swings by 40 deg; then it rests where it came to.
#[test]
fn a_gun_that_is_moved_coasts_and_is_tied_again() {
    let swung = |t: f64| 30.0 + 40.0 * ((t - 30.0) / 30.0).clamp(0.0, 1.0);
    let mut rig = HeadingRig::new(0.02, swung, every, HeadingSettings::default());
    let mut worst: f64 = 0.0;
    for step in 0..240 {
        rig.run(f64::from(step) * 0.5 + 0.5);
        worst = worst.max(rig.error_deg().abs());
    }
    // It drifts for 30 s and for the time that either end of a move takes to be seen.
    assert!(worst < 1.0, "{worst} deg");
    assert!(rig.aid.counts().rests >= 2, "{:?}", rig.aid.counts());
}

#[test]
fn a_feed_that_freezes_is_left() {
    let frozen = |t: f64, deg| Some(if t > 30.0 { 5.0 } else { deg });
    let mut rig = HeadingRig::new(0.0, |_| 30.0, frozen, HeadingSettings::default());
    let mut worst: f64 = 0.0;
    for step in 0..300 {
        rig.run(f64::from(step) * 0.5 + 0.5);
        worst = worst.max(rig.error_deg().abs());
    }
    assert!(worst < 0.4, "{worst} deg");
}

#[test]
fn a_feed_that_is_frozen_is_told_of_until_it_goes_on() {
    let frozen = |t: f64, deg| Some(if (30.0..150.0).contains(&t) { 5.0 } else { deg });
    let mut rig = HeadingRig::new(0.0, |_| 30.0, frozen, HeadingSettings::default());
    rig.roll_deg = 4.0;
    rig.run(85.0);
    assert_eq!(rig.aid.frozen_s(rig.time()), None, "a minute must pass");
    rig.run(100.0);
    let told = rig.aid.frozen_s(rig.time()).expect("frozen");
    assert!((told - 70.0).abs() < 0.5, "{told} s");
    rig.run(151.0);
    assert_eq!(rig.aid.frozen_s(rig.time()), None, "it goes on");
}

#[test]
fn a_ship_that_lies_still_has_no_frozen_feed() {
    // At a pier: the gun is trained, the ship stands; then at sea with a feed that has gone silent, which another fault tells.
    let mut rig =
        HeadingRig::new(0.0, |t| 40.0 * (0.3 * t).sin(), |_, _| Some(5.0), HeadingSettings::default());
    rig.run(150.0);
    assert_eq!(rig.aid.frozen_s(rig.time()), None);
    let silent = |t: f64, _| (t < 100.0).then_some(5.0);
    let mut rig =
        HeadingRig { roll_deg: 4.0, ..HeadingRig::new(0.0, |_| 30.0, silent, HeadingSettings::default()) };
    rig.run(99.0);
    assert!(rig.aid.frozen_s(rig.time()).is_some());
    rig.run(115.0);
    assert_eq!(rig.aid.frozen_s(rig.time()), None);
}

#[test]
fn a_drop_out_is_ridden_through() {
    let gone = |t: f64, deg| (!(40.0..100.0).contains(&t)).then_some(deg);
    let mut rig = HeadingRig::new(0.01, |_| 30.0, gone, HeadingSettings::default());
    rig.run(100.0);
    let coasted = rig.error_deg();
    // A minute of the unit's drift is 0.6 deg; it was learnt while the ship held the heading.
    assert!(coasted.abs() < 0.2, "{coasted} deg");
    rig.run(160.0);
    // The rest after it is tied to what the heading was by then.
    assert!(rig.error_deg().abs() < coasted.abs() + 0.1, "{} deg", rig.error_deg());
}

#[test]
fn the_operators_press_sets_the_heading() {
    // With the ship's heading: 30 deg from the bow.
    let mut rig = HeadingRig::new(0.0, |_| 30.0, every, stow());
    rig.run(1.0);
    rig.attitude.set_heading(7.0 * DEG, 0.0);
    rig.aid.forget();
    rig.run(3.0);
    assert!((rig.error_deg() + 7.0).abs() < 0.01);
    rig.aid.mark(MarkKind::Stow, rig.time(), &mut rig.attitude);
    assert!(rig.error_deg().abs() < 0.2, "{} deg", rig.error_deg());
    let sigma = rig.attitude.heading_sigma().unwrap() / DEG;
    assert!((sigma - 0.2f64.hypot(0.5)).abs() < 0.05, "{sigma} deg");
    rig.run(60.0);
    assert!(rig.error_deg().abs() < 0.2, "{} deg", rig.error_deg());
    assert!(
        rig.attitude.heading_sigma().unwrap() / DEG > 0.45,
        "no number of lines makes the ship's heading better"
    );
    // Without it: 10 deg from north.
    let mut alone = HeadingRig::new(0.0, |t| 10.0 - ship_deg(t), |_, _| None, stow());
    alone.run(2.0);
    alone.attitude.set_heading(-3.0 * DEG, 0.0);
    alone.aid.mark(MarkKind::Stow, alone.time(), &mut alone.attitude);
    assert!(alone.error_deg().abs() < 1e-6, "{} deg", alone.error_deg());
    assert_eq!((alone.aid.counts().marks, alone.aid.counts().marks_refused), (1, 0));
}

#[test]
fn a_landmark_is_the_one_that_is_near_and_none_where_two_are() {
    let mut rig = HeadingRig::new(0.0, |t| 30.0 - ship_deg(t), |_, _| None, stow());
    rig.run(2.0);
    rig.attitude.set_heading(-2.0 * DEG, 1.0 * DEG);
    rig.aid.mark(MarkKind::Landmark, rig.time(), &mut rig.attitude);
    assert!(rig.error_deg().abs() < 0.1, "{} deg", rig.error_deg());
    // Between two of them, and as unsure.
    rig.attitude.set_heading(32.0 * DEG, 10.0 * DEG);
    let before = rig.error_deg();
    rig.aid.mark(MarkKind::Landmark, rig.time(), &mut rig.attitude);
    assert!((rig.error_deg() - before).abs() < 1e-9);
    assert_eq!((rig.aid.counts().marks, rig.aid.counts().marks_refused), (1, 1));
}

#[test]
fn presses_that_nothing_is_configured_for_do_nothing() {
    let mut rig = HeadingRig::new(0.0, |_| 30.0, every, HeadingSettings::default());
    rig.run(2.0);
    for kind in [MarkKind::Stow, MarkKind::Landmark] {
        rig.aid.mark(kind, rig.time(), &mut rig.attitude);
    }
    assert_eq!((rig.aid.counts().marks, rig.aid.counts().marks_refused), (0, 2));
    assert!(rig.error_deg().abs() < 1e-9);
}

#[test]
fn the_trunnions_tell_the_bearing_whatever_the_elevation() {
    let ship = ShipSample {
        arrival: Time::MIN,
        heading: Some(1.0),
        roll: Some(0.2),
        pitch: Some(-0.1),
        heading_sigma: None,
        reduced: false,
    };
    let world_from_ship =
        DQuat::from_rotation_z(-1.0) * DQuat::from_rotation_x(-0.1) * DQuat::from_rotation_y(0.2);
    for elevation in [-0.5, 0.0, 0.7, 1.4] {
        let camera = world_from_ship * look(0.7, elevation, 0.0);
        let bearing = bearing_on_mount(camera, 1.0, &ship).unwrap();
        assert!((bearing - 0.7).abs() < 1e-9, "{elevation}: {bearing}");
        let level = ShipSample { roll: None, pitch: None, ..ship };
        let bearing = bearing_on_mount(camera, 1.0, &level).unwrap();
        assert!((bearing - 0.7).abs() < 0.03, "to the square of the tilt: {bearing}");
    }
}
