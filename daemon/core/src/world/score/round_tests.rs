use glam::{DQuat, DVec2, Vec3};
use proptest::prelude::*;

use super::*;
use crate::{
    geometry::RigidPose,
    model::Model,
    world::{
        boats::{BoatDamage, Course, Hull, quasi_static},
        gunnery::{Atmosphere, Projectile},
        score::hit::tests::boxed,
        waves::{Spectrum, WaveSpec},
    },
};

const FRAME_S: f64 = 1.0 / 30.0;
const MUZZLE: DVec3 = DVec3::new(0.0, 0.0, 8.0);

fn flight(direction: DVec3) -> Flight {
    let round = Projectile::new(0.33, 890.0).expect("a usable round");
    Flight::new(round, &Atmosphere::ICAO, MUZZLE, direction, DVec3::ZERO).expect("finite")
}

/// Fires along `direction` at `fired_s` and follows the round frame by frame against one boat.
fn shoot(
    direction: DVec3,
    fired_s: f64,
    model: &Model,
    pose: impl Fn(f64) -> RigidPose,
    sea: &WaveField,
) -> (Round, End) {
    let mut round = Round::new(1, fired_s, flight(direction));
    for frame in 0..2000 {
        let (from_s, to_s) = (f64::from(frame) * FRAME_S, f64::from(frame + 1) * FRAME_S);
        if to_s < fired_s {
            continue;
        }
        let boat = Moving { model, from_s, from: pose(from_s), to_s, to: pose(to_s) };
        if let Some(end) = round.advance(to_s, &[boat], sea) {
            return (round, end);
        }
    }
    panic!("a round ends within its life");
}

/// Direction that hits a point at rest, by iterating on the miss.
fn aim(target: DVec3) -> DVec3 {
    let mut aimed = target;
    for _ in 0..20 {
        let mut round = flight(aimed - MUZZLE);
        let range = (target - MUZZLE).length();
        while (round.state().position - MUZZLE).length() < range {
            round.advance(0.001);
        }
        let end = round.state();
        let late = ((end.position - MUZZLE).length() - range) / end.velocity.length();
        let at = end.position - end.velocity * late;
        aimed += target - at;
    }
    aimed - MUZZLE
}

fn still(position: DVec3) -> impl Fn(f64) -> RigidPose {
    move |_| RigidPose { world_from_body: DQuat::IDENTITY, position }
}

#[test]
fn an_aimed_round_strikes_the_point_it_was_aimed_at() {
    let model = boxed(Vec3::new(-3.0, -1.0, -0.5), Vec3::new(3.0, 1.0, 1.5));
    for (x, y) in [(0.0, 200.0), (60.0, 250.0), (-300.0, 800.0), (0.0, 60.0)] {
        let boat = DVec3::new(x, y, 0.0);
        // The near side of the box, on the hull's half.
        let target = boat + DVec3::new(1.5, -1.0, 0.7);
        let (_, end) = shoot(aim(target), 0.013, &model, still(boat), &WaveField::FLAT);
        let End::Struck { zone, point, at, range_m, time_s, boat: 0 } = end else { panic!("{end:?}") };
        assert_eq!(zone, Zone::Hull);
        assert!((at - target).length() < 0.01, "{at} is not {target}");
        assert!((point - (target - boat)).length() < 0.01);
        assert!((range_m - (target - MUZZLE).length()).abs() < 0.01);
        assert!(time_s > 0.013 + range_m / 890.0);
    }
}

#[test]
fn a_miss_knows_how_close_it_came_and_where_it_fell() {
    let model = boxed(Vec3::new(-3.0, -1.0, -0.5), Vec3::new(3.0, 1.0, 1.5));
    let boat = DVec3::new(0.0, 300.0, 0.0);
    let target = boat + DVec3::new(5.0, 0.0, 0.7);
    let (round, end) = shoot(aim(target), 0.0, &model, still(boat), &WaveField::FLAT);
    let nearest = round.nearest().expect("there is a boat");
    assert!((nearest.distance_m - 2.0).abs() < 0.05, "{nearest:?}");
    assert!((nearest.range_m - 300.0).abs() < 2.0, "{nearest:?}");
    let End::Splashed { at, time_s } = end else { panic!("{end:?}") };
    assert!(at.z.abs() < 1e-3 && at.y > 300.0, "{at}");
    assert!(time_s > nearest.time_s);
}

#[test]
fn a_short_round_is_as_close_as_its_splash() {
    let model = boxed(Vec3::new(-3.0, -1.0, -0.5), Vec3::new(3.0, 1.0, 1.5));
    let boat = DVec3::new(0.0, 300.0, 0.0);
    let (round, end) = shoot(aim(DVec3::new(0.0, 280.0, 0.0)), 0.0, &model, still(boat), &WaveField::FLAT);
    let End::Splashed { at, .. } = end else { panic!("{end:?}") };
    assert!((at.y - 280.0).abs() < 0.1, "{at}");
    let nearest = round.nearest().expect("there is a boat");
    assert!((nearest.distance_m - 19.0).abs() < 0.1, "{nearest:?}: from the hull's near side");
    // The splash's range is not the boat's.
    assert!((nearest.range_m - (boat - MUZZLE).length()).abs() < 0.1, "{nearest:?}");
}

#[test]
fn the_sea_in_front_of_a_hull_shields_what_lies_below_the_water() {
    let model = boxed(Vec3::new(-3.0, -1.0, -1.5), Vec3::new(3.0, 1.0, 1.0));
    let boat = DVec3::new(0.0, 60.0, 0.0);
    let (_, end) = shoot(aim(boat + DVec3::new(0.0, -1.0, -0.4)), 0.0, &model, still(boat), &WaveField::FLAT);
    assert!(matches!(end, End::Splashed { .. }), "{end:?}");
}

#[test]
fn splashes_lie_on_the_waves() {
    let spectrum = Spectrum::jonswap(1.2, 5.0, 3.3).expect("in range");
    let sea = WaveField::new(&WaveSpec { spectrum, wind_from: 0.0 }, 3);
    let model = boxed(Vec3::splat(-1.0), Vec3::ONE);
    let mut spread = 0.0_f64;
    for i in 0..40 {
        let direction = DVec3::new(0.02 * f64::from(i), 1.0, -0.01);
        let (_, end) = shoot(direction, 0.37 * f64::from(i), &model, still(DVec3::Y * -500.0), &sea);
        let End::Splashed { at, time_s } = end else { panic!("{end:?}") };
        assert!((at.z - sea.height(at.truncate(), time_s)).abs() < 1e-4, "{at}");
        spread = spread.max(at.z.abs());
    }
    assert!(spread > 0.2, "crests and troughs are met: {spread} m");
}

#[test]
fn a_round_into_the_sky_is_spent() {
    let model = boxed(Vec3::splat(-1.0), Vec3::ONE);
    let (_, end) = shoot(DVec3::new(0.0, 1.0, 3.0), 1.0, &model, still(DVec3::Y * 90.0), &WaveField::FLAT);
    assert_eq!(end, End::Spent { time_s: 1.0 + LIFE_S });
}

#[test]
fn how_time_is_cut_into_frames_does_not_change_the_end() {
    let model = boxed(Vec3::new(-3.0, -1.0, -0.5), Vec3::new(3.0, 1.0, 1.5));
    let pose = |t: f64| RigidPose {
        world_from_body: DQuat::IDENTITY,
        position: DVec3::new(-20.0 + 15.0 * t, 400.0, 0.0),
    };
    let run = |frame_s: f64| {
        let mut round = Round::new(1, 0.004, flight(aim(DVec3::new(-11.0, 399.0, 0.6))));
        (0..).find_map(|i| {
            let (from_s, to_s) = (f64::from(i) * frame_s, f64::from(i + 1) * frame_s);
            round.advance(
                to_s,
                &[Moving { model: &model, from_s, from: pose(from_s), to_s, to: pose(to_s) }],
                &WaveField::FLAT,
            )
        })
    };
    let (coarse, fine) = (run(0.1), run(0.011));
    let (Some(End::Struck { point: p, time_s: t, .. }), Some(End::Struck { point: q, time_s: u, .. })) =
        (coarse, fine)
    else {
        panic!("{coarse:?}, {fine:?}");
    };
    assert!((p - q).length() < 1e-3 && (t - u).abs() < 1e-4, "{p} at {t}, {q} at {u}");
}

#[test]
fn a_boat_on_waves_is_struck_where_it_floats() {
    let spectrum = Spectrum::jonswap(1.0, 5.0, 3.3).expect("in range");
    let sea = WaveField::new(&WaveSpec { spectrum, wind_from: 1.0 }, 8);
    let model = boxed(Vec3::new(-3.0, -1.0, -0.5), Vec3::new(3.0, 1.0, 1.5));
    let course = Course::straight(DVec2::new(0.0, 200.0), 1.2, 6.0).expect("can be sailed");
    let pose = |t: f64| quasi_static(&course.state(t, &BoatDamage::NONE), &Hull::of(&model), &sea, t).pose;
    for i in 0..20 {
        let fired = 0.9 * f64::from(i);
        // Where a point of the boat will be when the round gets there.
        let target = (0..4).fold(pose(fired).position, |at, _| {
            pose(fired + at.distance(MUZZLE) / 850.0).to_world(DVec3::new(0.5, -1.0, 1.0))
        });
        let (_, end) = shoot(aim(target), fired, &model, pose, &sea);
        let End::Struck { point, .. } = end else { panic!("shot at {fired} s: {end:?}") };
        assert!((point.z - 1.0).abs() < 0.15 && (point.x - 0.5).abs() < 0.15, "shot at {fired} s: {point}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Against an oracle that asks for every 20 microseconds whether the round is in the box.
    #[test]
    fn no_boat_is_tunnelled_through(
        speed in -250.0..250.0_f64, lead in -6.0..6.0_f64, turn in -4.0..4.0_f64, range in 30.0..250.0_f64,
        length in 0.3..8.0_f32,
    ) {
        let model = boxed(Vec3::new(-length, -0.4, 0.0), Vec3::new(length, 0.4, 2.0));
        let flight_s = range / 880.0;
        let pose = |t: f64| RigidPose {
            world_from_body: DQuat::from_rotation_z(turn * t),
            position: DVec3::new(speed * (t - flight_s) + lead, range, 0.0),
        };
        let direction = aim(DVec3::new(0.0, range, 1.0));
        let mut oracle = flight(direction);
        let (mut inside, mut deepest) = (None, f64::NEG_INFINITY);
        while oracle.state().position.y < range + 12.0 {
            oracle.advance(2e-5);
            let (t, at) = (oracle.time_s(), oracle.state().position);
            let p = pose(t).to_body(at);
            let depth = (p - model.min.as_dvec3()).min(model.max.as_dvec3() - p).min_element();
            deepest = depth.max(deepest);
            if depth > 0.0 && inside.is_none() && at.z > 0.0 {
                inside = Some(t);
            }
        }
        let (_, end) = shoot(direction, 0.0, &model, pose, &WaveField::FLAT);
        match end {
            // The path bends by 5 mm at most between the places at which it is taken into the boat's space.
            End::Struck { time_s, .. } => {
                prop_assert!(deepest > -0.02, "struck, but {deepest} m outside");
                if let Some(t) = inside && deepest > 0.02 {
                    prop_assert!((time_s - t).abs() < 1e-3, "struck at {time_s} s, inside at {t} s");
                }
            }
            _ => prop_assert!(deepest < 0.02, "{end:?}, but {deepest} m inside"),
        }
    }
}
