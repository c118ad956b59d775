use std::{f64::consts::PI, sync::Arc};

use glam::{DVec2, Vec3};

use super::*;
use crate::model::Zone;
use crate::{
    act::DriveOrder,
    daylight::Daylight,
    geometry::{ahead, heading_of},
    sea::BeaufortForce,
    world::{
        boats::{
            Act, Course, CourseState, CrewPlan, CrewState, CrewedStart, Exit, Guard, LightsKept, Propulsor,
        },
        flare::FlareSpec,
        score::boxed_model,
        searchlight::SearchlightSpec,
        waves::{Spectrum, WaveSpec},
    },
};

const KN: f64 = 1852.0 / 3600.0;

fn state(name: &str, act: Act, speed_kn: f64, exits: Vec<Exit>) -> CrewState {
    CrewState { name: name.to_owned(), act, speed_m_s: speed_kn * KN, exits }
}

fn exit(guard: Guard, to: usize) -> Exit {
    Exit { guard, chance: 1.0, to }
}

fn plan(states: Vec<CrewState>) -> Arc<CrewPlan> {
    Arc::new(CrewPlan { states })
}

/// A boat of 7 m that starts at a place by bearing (degrees) and range, towards the gun.
fn crewed(name: &str, plan: &Arc<CrewPlan>, bearing_deg: f64, range_m: f64, side: Side) -> Vessel {
    let bearing = bearing_deg.to_radians();
    let start = CrewedStart {
        plan: Arc::clone(plan),
        chance: name.bytes().map(u64::from).sum(),
        keeps_rules: side == Side::Neutral,
        propulsor: Propulsor::Outboard,
        speed_max_m_s: 27.0 * KN,
        position: ahead(bearing) * range_m,
        heading: bearing + PI,
        speed_m_s: 0.0,
        on_target_s: None,
        begins_s: 0.0,
    };
    Vessel {
        name: name.to_owned(),
        side,
        model: ModelId(0),
        behaviour: Behaviour::Crewed(start),
        lights: LightsKept::None,
        burns_at_s: None,
        in_reserve: false,
    }
}

fn models() -> Arc<[Model]> {
    Arc::new([boxed_model(Vec3::new(-3.5, -1.0, -0.3), Vec3::new(3.5, 1.0, 0.8))])
}

fn sea(force: u8) -> WaveField {
    let force = BeaufortForce::new(force).expect("on the scale");
    WaveField::new(&WaveSpec { spectrum: Spectrum::of_force(force), wind_from: 0.7 }, 3)
}

fn start() -> Time {
    Time::from_ns(5_000_000_000)
}

fn fleet(vessels: Vec<Vessel>, waves: WaveField) -> Fleet {
    Fleet::new(vessels, models(), waves, start())
}

/// Follows at 30 frames a second up to `until_s`, with a look at each frame.
fn follow(fleet: &mut Fleet, from_s: f64, until_s: f64, mut look: impl FnMut(&Fleet, f64)) {
    let frames = ((until_s - from_s) * 30.0).round() as i32;
    for frame in 1..=frames {
        let time_s = from_s + f64::from(frame) / 30.0;
        fleet.follow(start().plus_secs(time_s));
        look(fleet, time_s);
    }
}

/// Follows so many seconds at a pace of frames, and does `act` with each; what `look` sees at each whole second.
fn paced<T>(
    fleet: &mut Fleet,
    (seconds, frames_a_second): (u32, u32),
    mut act: impl FnMut(&mut Fleet, f64),
    look: impl Fn(&Fleet, f64) -> T,
) -> Vec<T> {
    let mut seen = Vec::new();
    for frame in 1..=seconds * frames_a_second {
        let time_s = f64::from(frame) / f64::from(frames_a_second);
        fleet.follow(start().plus_secs(time_s));
        act(fleet, time_s);
        if frame % frames_a_second == 0 {
            seen.push(look(fleet, time_s));
        }
    }
    seen
}

fn place(fleet: &Fleet, boat: usize, time_s: f64) -> CourseState {
    fleet.boats[boat].history.state(time_s)
}

/// The ranges of boat 0 over a run, once a second.
fn ranges(act: Act, speed_kn: f64, bearing_deg: f64, range_m: f64, seconds: f64) -> Vec<f64> {
    let crew = plan(vec![state("only", act, speed_kn, vec![])]);
    let mut fleet = fleet(vec![crewed("a", &crew, bearing_deg, range_m, Side::Hostile)], WaveField::FLAT);
    let mut ranges = Vec::new();
    follow(&mut fleet, 0.0, seconds, |fleet, time_s| {
        if (time_s * 30.0).round() as i64 % 30 == 0 {
            ranges.push(place(fleet, 0, time_s).position.length());
        }
    });
    ranges
}

#[test]
fn each_act_does_what_it_is_called() {
    let last = |ranges: &[f64]| *ranges.last().expect("some");
    let approach = ranges(Act::Approach { stop_m: 100.0 }, 20.0, 30.0, 600.0, 120.0);
    assert!((last(&approach) - 100.0).abs() < 20.0, "{approach:?}");
    assert!(approach.iter().all(|r| *r > 85.0), "it does not run on: {approach:?}");
    let circle = ranges(Act::Circle { radius_m: 150.0, clockwise: true }, 15.0, 30.0, 300.0, 180.0);
    assert!(circle[90..].iter().all(|r| (r - 150.0).abs() < 15.0), "{circle:?}");
    let flee = ranges(Act::Flee, 20.0, 30.0, 200.0, 60.0);
    assert!(last(&flee) > 550.0, "{flee:?}");
    let probe = ranges(Act::Probe { turn_m: 200.0 }, 20.0, 30.0, 600.0, 120.0);
    let nearest = probe.iter().copied().fold(f64::INFINITY, f64::min);
    assert!((130.0..200.0).contains(&nearest) && last(&probe) > 500.0, "{probe:?}");
    for (act, within) in
        [(Act::Loiter { radius_m: 60.0 }, 75.0), (Act::Fish, 220.0), (Act::Anchor, 20.0), (Act::Drift, 5.0)]
    {
        let stays = ranges(act.clone(), 3.0, 30.0, 600.0, 600.0);
        assert!(stays.iter().all(|r| (r - 600.0).abs() < within), "{act:?}: {stays:?}");
    }
    let points = vec![ahead(0.3) * 300.0, ahead(-0.3) * 300.0];
    let crew =
        plan(vec![state("only", Act::Transit { points: points.clone(), repeat: false }, 12.0, vec![])]);
    let mut fleet = fleet(vec![crewed("a", &crew, 90.0, 400.0, Side::Hostile)], WaveField::FLAT);
    let mut nearest = [f64::INFINITY; 2];
    follow(&mut fleet, 0.0, 200.0, |fleet, time_s| {
        for (nearest, point) in nearest.iter_mut().zip(&points) {
            *nearest = nearest.min(place(fleet, 0, time_s).position.distance(*point));
        }
    });
    assert!(nearest.iter().all(|d| *d < 25.0), "{nearest:?}");
    assert!(place(&fleet, 0, 200.0).speed_m_s.abs() < 0.6, "it lies still at the last");
}

#[test]
fn guards_lead_from_state_to_state() {
    let crew = plan(vec![
        state(
            "wait",
            Act::Loiter { radius_m: 40.0 },
            4.0,
            vec![exit(Guard { after_s: Some(5.0), ..Guard::default() }, 1)],
        ),
        state(
            "attack",
            Act::Attack { stop_m: Some(40.0) },
            25.0,
            vec![
                exit(Guard { hit: true, ..Guard::default() }, 2),
                exit(Guard { neighbour_hit: true, ..Guard::default() }, 3),
            ],
        ),
        state("give up", Act::Surrender, 0.0, vec![]),
        state("run", Act::Flee, 25.0, vec![]),
    ]);
    let boats = [("a", 10.0), ("b", 20.0), ("far", 200.0)];
    let vessels = boats.map(|(name, bearing)| crewed(name, &crew, bearing, 500.0, Side::Hostile));
    let mut fleet = fleet(vessels.to_vec(), sea(3));
    follow(&mut fleet, 0.0, 4.0, |_, _| {});
    assert_eq!([0, 1, 2].map(|b| fleet.crew_state(b)), [Some("wait"); 3]);
    follow(&mut fleet, 4.0, 15.0, |_, _| {});
    assert_eq!([0, 1, 2].map(|b| fleet.crew_state(b)), [Some("attack"); 3]);
    fleet.strike(0, &Zone::Hull.into(), start().plus_secs(14.99));
    follow(&mut fleet, 15.0, 40.0, |_, _| {});
    assert_eq!([0, 1, 2].map(|b| fleet.crew_state(b)), [Some("give up"), Some("run"), Some("attack")]);
    assert!(place(&fleet, 0, 40.0).speed_m_s.abs() < 1.0, "it lies still");
}

/// A crew that creeps about until it is lit.
fn runs_when_lit() -> Arc<CrewPlan> {
    let lit = exit(Guard { lit: true, ..Guard::default() }, 1);
    plan(vec![
        state("creep", Act::Loiter { radius_m: 40.0 }, 4.0, vec![lit]),
        state("run", Act::Flee, 25.0, vec![]),
    ])
}

#[test]
fn a_crew_notices_a_beam_that_is_on_it_at_any_pace_of_frames() {
    let crew = runs_when_lit();
    let spec = SearchlightSpec { candela: 200_000.0, beam: 0.14, is_on: true };
    let night = Daylight::fixed(DVec3::NEG_Z, 2e4);
    let seen = |frames_a_second: u32, axis_deg: f64| {
        let boats = [("ahead", 0.0), ("aside", 30.0)];
        let vessels = boats.map(|(name, bearing)| crewed(name, &crew, bearing, 300.0, Side::Hostile));
        let mut fleet =
            fleet(vessels.to_vec(), sea(2)).with_searchlight(Some(Searchlight::new(spec, &night)));
        let beam = Beam { lamp: DVec3::Z * 8.0, axis: ahead(axis_deg.to_radians()).extend(0.0) };
        // Noted before boats are followed that far, as the world does it.
        fleet.shine(start().plus_secs(2.0), Some(beam));
        fleet.shine(start().plus_secs(3.0), None);
        let states = |fleet: &Fleet, _| [0, 1].map(|boat| fleet.crew_state(boat).map(str::to_owned));
        let states = paced(&mut fleet, (6, frames_a_second), |_, _| {}, states);
        (states, place(&fleet, 0, 6.0).position)
    };
    let (states, place) = seen(30, 0.0);
    assert_eq!(states[0], [Some("creep".to_owned()), Some("creep".to_owned())]);
    assert_eq!(states[5], [Some("run".to_owned()), Some("creep".to_owned())], "{states:?}");
    assert_eq!((states, place), seen(10, 0.0), "at any pace of frames");
    assert_eq!(seen(30, 30.0).0[5], [Some("creep".to_owned()), Some("run".to_owned())]);
    assert_eq!(seen(30, 15.0).0[5], [Some("creep".to_owned()), Some("creep".to_owned())]);
}

#[test]
fn a_crew_that_a_flare_lights_goes_on_at_any_pace_of_frames() {
    let crew = runs_when_lit();
    let run = |frames_a_second: u32| {
        let night = SceneLight::new(&Daylight::fixed(DVec3::NEG_Z, 2e4), 5.0).at(start());
        let mut fleet =
            fleet(vec![crewed("a", &crew, 0.0, 300.0, Side::Hostile)], sea(2)).with_seeing(night, 8.0);
        let mut is_lit = false;
        let light = |fleet: &mut Fleet, time_s: f64| {
            if !is_lit && time_s >= 2.0 {
                is_lit = true;
                let spec = FlareSpec::rocket(DVec2::new(0.0, 300.0));
                fleet.light_flare(Flare { spec, lit: start().plus_secs(2.0), wind: DVec2::ZERO });
            }
        };
        let states = |fleet: &Fleet, _| fleet.crew_state(0).map(str::to_owned);
        let states = paced(&mut fleet, (6, frames_a_second), light, states);
        (states, place(&fleet, 0, 6.0).position)
    };
    let (states, place) = run(30);
    assert_eq!((states[1].as_deref(), states[5].as_deref()), (Some("creep"), Some("run")), "{states:?}");
    assert_eq!((states, place), run(10));
}

#[test]
fn an_engine_that_is_hit_stops_and_a_helm_that_is_hit_is_let_go() {
    let crew = plan(vec![state("attack", Act::Attack { stop_m: Some(40.0) }, 25.0, vec![])]);
    for zone in [Zone::Engine, Zone::Helm] {
        let mut fleet = fleet(vec![crewed("a", &crew, 10.0, 900.0, Side::Hostile)], WaveField::FLAT);
        follow(&mut fleet, 0.0, 12.0, |_, _| {});
        let before = place(&fleet, 0, 12.0);
        assert!(before.speed_m_s > 20.0 * KN, "{before:?}");
        fleet.strike(0, &zone.into(), start().plus_secs(11.98));
        follow(&mut fleet, 12.0, 60.0, |_, _| {});
        let after = place(&fleet, 0, 60.0);
        assert!(after.speed_m_s < 1.5, "{zone:?}: {after:?}");
        assert!(before.position.distance(after.position) < 120.0, "{zone:?}");
    }
}

#[test]
fn a_boat_that_is_holed_loses_its_engine_and_sinks_whatever_the_pace_of_frames() {
    let crew = plan(vec![state("attack", Act::Attack { stop_m: Some(40.0) }, 25.0, vec![])]);
    // Each whole second's pose.
    let run = |frames_a_second: u32| {
        let mut fleet = fleet(vec![crewed("a", &crew, 10.0, 1500.0, Side::Hostile)], sea(3));
        let mut holed = 0;
        let strike = |fleet: &mut Fleet, time_s| {
            while holed < 40 && 10.0 + 0.1 * f64::from(holed) <= time_s {
                let hole = Some((DVec3::new(-0.5, 0.8, 0.0), 20e-4));
                let strike = RoundStrike { hole, ..Zone::Hull.into() };
                fleet.strike(0, &strike, start().plus_secs(10.0 + 0.1 * f64::from(holed)));
                holed += 1;
            }
        };
        let look = |fleet: &Fleet, time_s| fleet.pose(0, start().plus_secs(time_s));
        let poses = paced(&mut fleet, (200, frames_a_second), strike, look);
        (fleet, poses)
    };
    let (fleet, poses) = run(30);
    let sinks = fleet.sinks(0).expect("it is holed").secs_since(start());
    assert!((15.0..150.0).contains(&sinks), "{sinks} s");
    assert!(fleet.afloat(start().plus_secs(sinks - 1.0)).count() == 1, "it swims");
    assert!(fleet.afloat(start().plus_secs(sinks + 30.0)).count() == 0, "it has sunk");
    assert!(place(&fleet, 0, 199.0).speed_m_s < 1.0, "its engine has drowned");
    assert_eq!(poses, run(4).1);
}

#[test]
fn a_swarm_comes_from_its_axes_and_all_at_once() {
    let text = "[sea]\nbeaufort = 3\n[[crew]]\nname = \"raider\"\n[[crew.state]]\nname = \"go\"\ndoes = \"attack\"\nspeed_kn = 26\n\
                stop_m = 60\n[[boat]]\nname = \"near\"\nmodel = \"skiff\"\ncrew = \"raider\"\nrange_m = 400\naxes_deg = [-60, 0]\n\
                count = 5\nspacing_m = 30\non_target_s = 75\n[[boat]]\nname = \"far\"\nmodel = \"skiff\"\ncrew = \"raider\"\n\
                range_m = 800\nbearing_deg = 60\ncount = 3\nspacing_m = 30\non_target_s = 75\n";
    let scenario = crate::world::scenario::Scenario::parse(text, "x").expect("sound");
    let mut fleet = Fleet::of_scenario(&scenario, models(), &[ModelId(0); 8], start());
    let bearing = |fleet: &Fleet, boat| heading_of(place(fleet, boat, 0.0).position).to_degrees();
    let bearings: Vec<f64> = (0..8).map(|boat| bearing(&fleet, boat).round()).collect();
    assert!(bearings[..3].iter().all(|deg| (deg + 60.0).abs() < 6.0), "{bearings:?}");
    assert!(bearings[3..5].iter().all(|deg| deg.abs() < 6.0), "{bearings:?}");
    let mut arrived = [None; 8];
    follow(&mut fleet, 0.0, 100.0, |fleet, time_s| {
        for (boat, arrived) in arrived.iter_mut().enumerate() {
            if place(fleet, boat, time_s).position.length() < 85.0 {
                arrived.get_or_insert(time_s);
            }
        }
    });
    let times: Vec<f64> = arrived.iter().map(|time| time.expect("it arrives")).collect();
    let (first, last) = times.iter().fold((f64::MAX, f64::MIN), |(a, b), t| (a.min(*t), b.max(*t)));
    assert!(last - first < 10.0 && (60.0..85.0).contains(&first), "{times:?}");
}

#[test]
fn a_person_drives_a_boat_and_the_pace_of_frames_does_not_matter() {
    let crew = plan(vec![state("driven", Act::Driven, 0.0, vec![])]);
    let orders = [
        (1.0, DriveOrder::Ahead),
        (1.2, DriveOrder::Ahead),
        (1.4, DriveOrder::Ahead),
        (20.0, DriveOrder::Starboard),
        (24.0, DriveOrder::Midships),
        (40.0, DriveOrder::Astern),
    ];
    let run = |frames_a_second: u32| {
        let mut fleet = fleet(vec![crewed("mine", &crew, 0.0, 900.0, Side::Hostile)], sea(2));
        let mut due = orders.iter().peekable();
        let drive = |fleet: &mut Fleet, time_s| {
            while let Some((at_s, order)) = due.next_if(|(at_s, _)| *at_s <= time_s) {
                fleet.drive(*order, start().plus_secs(*at_s));
            }
        };
        paced(&mut fleet, (45, frames_a_second), drive, |fleet, time_s| place(fleet, 0, time_s))
    };
    let states = run(30);
    assert!(states[0].speed_m_s.abs() < 0.5, "it lies still until it is told to go");
    assert!(states[18].speed_m_s > 5.0, "{:?}", states[18]);
    let turned = (states[28].heading - states[19].heading).to_degrees();
    assert!((20.0..300.0).contains(&turned), "to starboard by {turned} deg");
    assert_eq!(states, run(4));
}

/// Crews of all kinds about the gun: attackers, one that rams, fishing boats, passers-by and a scripted ship.
fn crowd(count: usize) -> Vec<Vessel> {
    let attack = plan(vec![
        state(
            "wait",
            Act::Loiter { radius_m: 30.0 },
            4.0,
            vec![exit(Guard { after_s: Some(20.0), ..Guard::default() }, 1)],
        ),
        state(
            "attack",
            Act::Attack { stop_m: Some(40.0) },
            20.0,
            vec![exit(Guard { within_m: Some(60.0), ..Guard::default() }, 2)],
        ),
        state("circle", Act::Circle { radius_m: 70.0, clockwise: true }, 15.0, vec![]),
    ]);
    let fish = plan(vec![state("fish", Act::Fish, 3.0, vec![])]);
    let feint = plan(vec![state(
        "probe",
        Act::Probe { turn_m: 120.0 },
        22.0,
        vec![exit(Guard { arrived: true, ..Guard::default() }, 0)],
    )]);
    let through = vec![DVec2::new(400.0, 60.0), DVec2::new(-400.0, -80.0)];
    let transit = plan(vec![state("pass", Act::Transit { points: through, repeat: true }, 10.0, vec![])]);
    let mut vessels: Vec<Vessel> = (0..count)
        .map(|i| {
            let (crew, side) = match i % 5 {
                0 | 1 => (&attack, Side::Hostile),
                2 => (&feint, Side::Hostile),
                3 => (&fish, Side::Neutral),
                _ => (&transit, Side::Neutral),
            };
            let bearing = 360.0 * i as f64 / count as f64;
            crewed(&format!("boat-{i}"), crew, bearing, 250.0 + 23.0 * (i % 7) as f64, side)
        })
        .collect();
    let course = Course::straight(DVec2::new(-450.0, 170.0), 0.5 * PI, 3.0).expect("it can be sailed");
    let behaviour = Behaviour::ScriptedCourse(course);
    vessels.push(Vessel {
        name: "scripted".to_owned(),
        side: Side::Neutral,
        model: ModelId(0),
        behaviour,
        lights: LightsKept::None,
        burns_at_s: None,
        in_reserve: false,
    });
    vessels
}

#[test]
fn boats_keep_clear_of_each_other_and_of_the_own_ship() {
    for (count, force, seconds) in [(12, 2, 300.0), (30, 4, 120.0)] {
        let mut fleet = fleet(crowd(count), sea(force));
        let (mut closest, mut nearest) = ((f64::INFINITY, 0, 0, 0.0), f64::INFINITY);
        follow(&mut fleet, 0.0, seconds, |fleet, time_s| {
            let hulls: Vec<_> = fleet.boats.iter().map(|b| b.capsule(time_s)).collect();
            for i in 0..hulls.len() {
                nearest = nearest.min(hulls[i].gap_m(&OWN_HULL));
                for j in 0..i {
                    let gap = hulls[i].gap_m(&hulls[j]);
                    if gap < closest.0 {
                        closest = (gap, i, j, time_s);
                    }
                }
            }
        });
        let beam_m = 2.0;
        println!("{count} boats: {closest:?}, own ship {nearest}");
        assert!(closest.0 > beam_m, "{count} boats: {closest:?}");
        assert!(nearest > beam_m, "{count} boats: {nearest} m from the own ship");
    }
}

#[test]
fn one_that_rams_reaches_the_own_ship_and_no_further() {
    let crew = plan(vec![state("ram", Act::Attack { stop_m: None }, 25.0, vec![])]);
    let mut fleet = fleet(vec![crewed("a", &crew, 40.0, 400.0, Side::Hostile)], sea(3));
    let mut nearest = f64::INFINITY;
    follow(&mut fleet, 0.0, 90.0, |fleet, time_s| {
        nearest = nearest.min(fleet.boats[0].capsule(time_s).gap_m(&OWN_HULL));
    });
    assert!((-0.5..0.1).contains(&nearest), "{nearest} m");
}

#[test]
fn where_crews_are_does_not_depend_on_the_pace_of_frames() {
    let strikes = [(0_usize, Zone::Engine, 31.234), (7, Zone::Hull, 47.0)];
    let run = |frames: &[f64]| {
        let mut fleet = fleet(crowd(15), sea(4));
        let mut due = strikes.iter().peekable();
        for time_s in frames {
            fleet.follow(start().plus_secs(*time_s));
            if let Some((boat, zone, at)) = due.next_if(|(_, _, at)| at <= time_s) {
                fleet.strike(*boat, &(*zone).into(), start().plus_secs(*at));
            }
        }
        (0..16).map(|b| fleet.pose(b, start().plus_secs(59.0)).expect("there")).collect::<Vec<_>>()
    };
    let steady: Vec<f64> = (1..=1800).map(|i| f64::from(i) / 30.0).collect();
    let mut stuttering: Vec<f64> = (1..=600).map(|i| 0.1 * f64::from(i) + 0.013 * f64::from(i % 5)).collect();
    stuttering.retain(|t| !(40.0..41.0).contains(t));
    stuttering.push(60.0);
    assert_eq!(run(&steady), run(&stuttering));
}

#[test]
fn a_course_over_ground_is_where_the_boat_goes() {
    let mut fleet = fleet(crowd(10), WaveField::FLAT);
    follow(&mut fleet, 0.0, 60.0, |fleet, time_s| {
        if time_s < 1.0 {
            return;
        }
        for boat in 0..10 {
            let (now, before) = (place(fleet, boat, time_s), place(fleet, boat, time_s - 1.0 / 60.0));
            let went = (now.position - before.position) * 60.0;
            let off = went.distance(0.5 * (now.velocity() + before.velocity()));
            assert!(off < 0.05, "{boat} at {time_s}: {off} m/s, {}", heading_of(went));
        }
    });
}

/// A crew that does everything there is but to ram, so long each, beginning with `first`.
fn versatile(first: usize, each_s: f64) -> Arc<CrewPlan> {
    let points = vec![DVec2::new(350.0, 120.0), DVec2::new(-350.0, 160.0), DVec2::new(-200.0, -300.0)];
    let acts = [
        ("transit", Act::Transit { points, repeat: true }, 18.0),
        ("loiter", Act::Loiter { radius_m: 40.0 }, 5.0),
        ("fish", Act::Fish, 3.0),
        ("attack", Act::Attack { stop_m: Some(40.0) }, 25.0),
        ("circle", Act::Circle { radius_m: 90.0, clockwise: first.is_multiple_of(2) }, 20.0),
        ("probe", Act::Probe { turn_m: 120.0 }, 25.0),
        ("stop", Act::Stop, 0.0),
        ("flee", Act::Flee, 25.0),
        ("approach", Act::Approach { stop_m: 100.0 }, 25.0),
        ("anchor", Act::Anchor, 0.0),
        ("drift", Act::Drift, 0.0),
    ];
    let count = acts.len();
    let after = |i: usize| exit(Guard { after_s: Some(each_s), ..Guard::default() }, (i + 1) % count);
    let states = (0..count).map(|i| {
        let (name, act, speed_kn) = acts[(first + i) % count].clone();
        state(name, act, speed_kn, vec![after(i)])
    });
    plan(states.collect())
}

/// `./check soak` gives each sea an hour (BOWWAVE_SEA_S=3600).
#[test]
fn boats_stay_sound_in_every_sea_whatever_they_do_and_however_the_computer_stalls() {
    let seconds = std::env::var("BOWWAVE_SEA_S").ok().and_then(|s| s.parse().ok()).unwrap_or(60.0);
    let mut unsound = Vec::new();
    for force in 0..=7 {
        let waves = sea(force);
        let height_m =
            Spectrum::of_force(BeaufortForce::new(force).expect("on the scale")).significant_height_m();
        let vessels: Vec<Vessel> = (0..11)
            .map(|i| {
                let crew = versatile(i, if seconds > 600.0 { 40.0 } else { 15.0 });
                let bearing = 360.0 * i as f64 / 11.0;
                crewed(&format!("boat-{i}"), &crew, bearing, 220.0 + 30.0 * (i % 3) as f64, Side::Hostile)
            })
            .collect();
        let mut fleet = fleet(vessels, waves);
        let (mut closest, mut nearest, mut fastest, mut highest) =
            (f64::INFINITY, f64::INFINITY, 0.0_f64, 0.0_f64);
        let mut time_s = 0.0;
        let mut frame = 0_u64;
        while time_s < seconds {
            frame += 1;
            // Every twenty seconds the process gets no time for one.
            time_s += if frame.is_multiple_of(600) { 1.0 } else { 1.0 / 30.0 };
            fleet.follow(start().plus_secs(time_s));
            if !frame.is_multiple_of(3) {
                continue;
            }
            let hulls: Vec<_> = fleet.boats.iter().map(|b| b.capsule(time_s)).collect();
            for (i, hull) in hulls.iter().enumerate() {
                nearest = nearest.min(hull.gap_m(&OWN_HULL));
                closest = hulls[..i].iter().map(|other| hull.gap_m(other)).fold(closest, f64::min);
                let floats = fleet.floating(i, start().plus_secs(time_s)).expect("there");
                let up = floats.pose.world_from_body * DVec3::Z;
                fastest = fastest.max(place(&fleet, i, time_s).speed_m_s.abs());
                highest = highest.max((floats.pose.position.z - floats.water_level).abs());
                assert!(
                    floats.pose.position.is_finite() && up.is_finite(),
                    "force {force}, {time_s} s, boat {i}"
                );
                assert!(up.z > 0.3, "force {force}, {time_s} s, boat {i} capsizes: {up}");
            }
        }
        println!(
            "force {force}, {height_m:.1} m, {seconds} s: boats {closest:.1} m apart, own ship {nearest:.1} m; at most {fastest:.1} m/s, {highest:.2} m off the water"
        );
        // No faster than its engine drives it and the sea before the wind pushes it; no higher over the water than a metre's leap off a crest
        // when the trough is below: the highest wave of an hour has twice the significant height (Rayleigh).
        let beam_m = 2.0;
        let is_sound = closest > beam_m
            && nearest > beam_m
            && fastest < 27.0 * KN * 1.25
            && highest < 1.0 + 2.0 * height_m;
        if !is_sound {
            unsound.push(force);
        }
    }
    assert!(unsound.is_empty(), "in seas of force {unsound:?}");
}
