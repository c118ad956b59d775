//! Lights by night: those of boats, and the gun's searchlight.

use bowwave_core::{
    act::{Act, TraineeAct},
    frame::scene::{LightView, RoundView},
};

use super::*;

/// Lights of the last scene, and why the pass does not run where it does not.
fn lights(text: &str) -> (Vec<LightView>, PassDecision) {
    let mut s = session(text);
    let mut seen = (Vec::new(), PassDecision::Run);
    for tick in 1..10 {
        let now = Time::from_ns(tick * 33 * MS);
        feed(&mut s, now);
        let scene = s.tick(Tick::at(now)).view.scene;
        seen = (scene.lights.clone(), scene.passes[Pass::Lights as usize]);
    }
    seen
}

#[test]
fn by_night_a_neutral_boat_shows_its_lights_and_a_hostile_one_none() {
    let night = |light: &str, boat: &str| {
        let text = SCENARIO.replace("side = \"hostile\"", boat);
        lights(&format!("{text}\n[light]\nsun_elevation_deg = {light}\n"))
    };
    let left_out = |why| (Vec::new(), PassDecision::LeftOut(why));
    // It may burn, where there are rounds to set it on fire.
    assert_eq!(night("-12", "side = \"hostile\""), left_out(LeftOut::NoLightInView));
    let peaceful = SCENARIO.replace("belt = 5", "belt = 0");
    assert_eq!(
        lights(&format!("{peaceful}\n[light]\nsun_elevation_deg = -12\n")),
        left_out(LeftOut::NoLights)
    );
    assert_eq!(night("30", "side = \"neutral\""), left_out(LeftOut::Daylight));
    let (anchored, decision) = night("-12", "side = \"neutral\"");
    assert_eq!((anchored.len(), decision), (1, PassDecision::Run), "it lies still");
    // It heads east, so that its starboard side is seen from the south: white over green.
    let (starboard, _) = night("-12", "lights = \"under-way\"");
    let green = |light: &LightView| light.light.y > 2.0 * light.light.x;
    assert_eq!(starboard.iter().map(green).collect::<Vec<_>>(), [false, true]);
    assert!(starboard.iter().all(|l| l.light.min_element() >= 0.0 && l.light.max_element() > 0.0));
    assert!(
        (starboard[0].at.z - 3.0).abs() < 0.2 && (starboard[0].at.y - 200.0).abs() < 5.0,
        "{starboard:?}"
    );
}

#[test]
fn the_searchlight_is_switched_by_the_act_and_lights_by_night_alone() {
    let peaceful = SCENARIO.replace("belt = 5", "belt = 0");
    let light = |table: &str, elevation: &str, acts: &[i64]| {
        let mut s = session(&format!("{peaceful}\n{table}\n[light]\nsun_elevation_deg = {elevation}\n"));
        let mut seen = Vec::new();
        for tick in 1..30 {
            let now = Time::from_ns(tick * 33 * MS);
            feed(&mut s, now);
            for _ in acts.iter().filter(|at| **at == tick) {
                s.event(&Event::Act(TraineeAct { time: now, act: Act::Light }));
            }
            let scene = s.tick(Tick::at(now)).view.scene;
            seen.push((scene.searchlight.is_some(), scene.passes[Pass::Lamplight as usize]));
        }
        seen
    };
    let left_out = |why| (false, PassDecision::LeftOut(why));
    let (none, off) = (left_out(LeftOut::NoLamps), left_out(LeftOut::NoLampShines));
    assert_eq!(light("", "-12", &[5]).last(), Some(&none));
    assert_eq!(light("[searchlight]", "30", &[5]).last(), Some(&left_out(LeftOut::Daylight)));
    assert_eq!(light("[searchlight]", "-12", &[]).last(), Some(&off));
    assert_eq!(light("[searchlight]\non = true", "-12", &[]).last(), Some(&(true, PassDecision::Run)));
    let switched = light("[searchlight]", "-12", &[5, 15]);
    assert_eq!((switched[3], switched[12].0, switched[28]), (off, true, off), "{switched:?}");
}

#[test]
fn a_flare_of_the_scenario_hangs_over_its_place_by_night_and_lights_what_is_there() {
    let seen = |elevation: &str| {
        let event = "[[event]]\nat_s = 0.3\nflare = { bearing_deg = 0, range_m = 300, height_m = 60 }\n";
        let mut s = session(&format!("{SCENARIO}\n{event}[light]\nsun_elevation_deg = {elevation}\n"));
        let mut seen = Vec::new();
        for tick in 1..40 {
            let now = Time::from_ns(tick * 33 * MS);
            feed(&mut s, now);
            let scene = s.tick(Tick::at(now)).view.scene;
            let points = scene.lights.iter().filter(|light| light.boat.is_none()).count();
            seen.push((scene.lamps.clone(), points, scene.passes[Pass::Lamplight as usize]));
        }
        seen
    };
    let night = seen("-12");
    assert_eq!((night[2].0.len(), night[2].2), (0, PassDecision::LeftOut(LeftOut::NoLampShines)));
    let (lamps, points, decision) = &night[38];
    assert_eq!((lamps.len(), *points, *decision), (1, 1, PassDecision::Run));
    let lamp = lamps[0];
    assert!(lamp.is_high && (lamp.at - DVec3::new(0.0, 300.0, 56.0)).length() < 10.0, "{lamp:?}");
    // 80,000 cd 60 m above are 22 lux, and so much over pi of the camera's white.
    let flat = lamp.flat_at(DVec3::new(0.0, 300.0, 0.0));
    assert!((flat.x / lamp.strength.x * std::f32::consts::PI * 80_000.0 - 24.0).abs() < 4.0, "{flat}");
    assert!(seen("30").iter().all(|(lamps, ..)| lamps.is_empty()), "by day it is nothing");
}

#[test]
fn a_round_flashes_before_the_muzzle_by_night_where_the_gun_is_known() {
    let seen = |elevation: &str, recoils: bool| {
        let lens = calibration().lens;
        let corner = |x: f64, y: f64| lens.centre + DVec2::new(x, y);
        let outline = vec![corner(-1.0, 4.0), corner(1.0, 4.0), corner(4.0, 20.0), corner(-4.0, 20.0)];
        let barrel = Phantom::new("barrel", outline, (lens.width, lens.height)).recoiling(recoils);
        let own_ship = OwnShip::new(vec![barrel], lens.centre, &[], (lens.width, lens.height));
        let text = format!("{SCENARIO}\n[light]\nsun_elevation_deg = {elevation}\n");
        let mut s = session_on(&text, calibration(), own_ship);
        let edges = burst(1000, 1900);
        let (mut flashes, mut balls) = (0, Vec::new());
        for tick in 1..80 {
            let now = Time::from_ns(tick * 33 * MS);
            feed_late(&mut s, now, 25 * MS);
            let before = now.plus_ns(-33 * MS);
            for edge in edges.iter().filter(|edge| edge.time > before && edge.time <= now) {
                s.event(&Event::Trigger(*edge));
            }
            let scene = s.tick(Tick::at(now)).view.scene;
            flashes += usize::from(scene.flash.is_some_and(|flash| flash.on_gun.min_element() > 0.0));
            let flames = scene.rounds.iter().filter(|round| matches!(round, RoundView::Flame { .. }));
            balls.extend(flames.map(|flame| scene.camera.to_camera(flame.place())));
        }
        (flashes, balls)
    };
    let (flashes, balls) = seen("-12", true);
    // Of five rounds those that left within a picture's exposure, which is half of the time.
    assert!((1..=5).contains(&flashes) && balls.len() == flashes, "{flashes} {balls:?}");
    // It stands where the outline of what recoils comes nearest to the bore.
    assert!(
        balls.iter().all(|at| at.length() < 1.5 && at.y > 0.05 && at.y < 0.4 && at.x.abs() < 0.1),
        "{balls:?}"
    );
    assert_eq!(seen("-12", false).0, 0, "nobody knows where the muzzle is");
    assert_eq!(seen("30", true).0, 0, "by day it is nothing");
}

#[test]
fn lights_that_nobody_knows_are_refused_with_those_there_are() {
    let text = SCENARIO.replace("side = \"hostile\"", "lights = \"trawling\"");
    let error = Scenario::parse(&text, "test").expect_err("no such lights").to_string();
    for part in ["trawling", "off", "rules", "under-way", "fishing", "anchored"] {
        assert!(error.contains(part), "{error}");
    }
}
