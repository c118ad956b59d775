//! Lights by night: those of boats, and the gun's searchlight.

use bowwave_core::{
    act::{Act, TraineeAct},
    frame::scene::LightView,
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
    let light = |table: &str, elevation: &str, acts: &[i64]| {
        let mut s = session(&format!("{SCENARIO}\n{table}\n[light]\nsun_elevation_deg = {elevation}\n"));
        let mut seen = Vec::new();
        for tick in 1..30 {
            let now = Time::from_ns(tick * 33 * MS);
            feed(&mut s, now);
            for _ in acts.iter().filter(|at| **at == tick) {
                s.event(&Event::Act(TraineeAct { time: now, act: Act::Light }));
            }
            let scene = s.tick(Tick::at(now)).view.scene;
            seen.push((scene.searchlight.is_some(), scene.passes[Pass::Searchlight as usize]));
        }
        seen
    };
    let left_out = |why| (false, PassDecision::LeftOut(why));
    let (none, off) = (left_out(LeftOut::NoSearchlight), left_out(LeftOut::SearchlightOff));
    assert_eq!(light("", "-12", &[5]).last(), Some(&none));
    assert_eq!(light("[searchlight]", "30", &[5]).last(), Some(&left_out(LeftOut::Daylight)));
    assert_eq!(light("[searchlight]", "-12", &[]).last(), Some(&off));
    assert_eq!(light("[searchlight]\non = true", "-12", &[]).last(), Some(&(true, PassDecision::Run)));
    let switched = light("[searchlight]", "-12", &[5, 15]);
    assert_eq!((switched[3], switched[12].0, switched[28]), (off, true, off), "{switched:?}");
}

#[test]
fn lights_that_nobody_knows_are_refused_with_those_there_are() {
    let text = SCENARIO.replace("side = \"hostile\"", "lights = \"trawling\"");
    let error = Scenario::parse(&text, "test").expect_err("no such lights").to_string();
    for part in ["trawling", "off", "rules", "under-way", "fishing", "anchored"] {
        assert!(error.contains(part), "{error}");
    }
}
