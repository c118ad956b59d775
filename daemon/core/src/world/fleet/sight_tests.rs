use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

use super::*;
use crate::{
    model::{Model, ModelId},
    world::{
        flare::FlareSpec,
        scenario::Scenario,
        score::boxed_model,
        searchlight::{Beam, Searchlight},
    },
};

const GUN: DVec3 = DVec3::new(0.0, 0.0, 8.0);

fn start() -> Time {
    Time::from_ns(5_000_000_000)
}

/// Boats of 7 m under a sun at that elevation, degrees, in the west.
fn fleet(sun_deg: f64, boats: &[&str]) -> (Scenario, Fleet) {
    let boats: String = boats
        .iter()
        .map(|boat| format!("[[boat]]\nmodel = \"skiff\"\ncourse = \"still\"\n{boat}\n"))
        .collect();
    let text = format!(
        "[sea]\nbeaufort = 2\n[light]\nsun_azimuth_deg = 270\nsun_elevation_deg = {sun_deg}\n\
         visibility_km = 10\n[searchlight]\n{boats}"
    );
    let scenario = Scenario::parse(&text, "x").expect("sound");
    let models: Arc<[Model]> = Arc::new([boxed_model(Vec3::new(-3.5, -1.0, -0.3), Vec3::new(3.5, 1.0, 1.2))]);
    let of_boats = vec![ModelId(0); scenario.boats.len()];
    let light = Searchlight::new(scenario.searchlight.expect("one"), &scenario.daylight);
    let fleet = Fleet::of_scenario(&scenario, models, &of_boats, start()).with_searchlight(Some(light));
    (scenario, fleet)
}

fn seen(fleet: &Fleet) -> Vec<bool> {
    fleet.seen_from(GUN, start()).iter().map(|times| threshold::chance(*times) >= threshold::SEEN).collect()
}

fn at_800_m(more: &str) -> String {
    format!("name = \"a\"\nrange_m = 800\nbearing_deg = 0\n{more}")
}

#[test]
fn a_dark_boat_is_seen_by_day_and_not_by_night_and_one_with_lights_is() {
    let dark = at_800_m("");
    let lit = at_800_m("side = \"neutral\"\nlights = \"anchored\"");
    assert_eq!(seen(&fleet(30.0, &[&dark]).1), [true]);
    assert_eq!(seen(&fleet(-20.0, &[&dark]).1), [false]);
    assert_eq!(seen(&fleet(-20.0, &[&lit]).1), [true]);
}

#[test]
fn the_searchlight_shows_a_dark_boat_and_gives_the_gun_away() {
    let (_, mut fleet) = fleet(-20.0, &[&at_800_m("")]);
    let at = fleet.boats[0].history.state(0.0).position;
    assert!(!fleet.sees_gun(0, at, 0.0), "too far off for starlight");
    let aside = (at.extend(0.6) - GUN).normalize() + DVec3::X * 0.2;
    let beam = |axis: DVec3| Some(Beam { lamp: GUN, axis: axis.normalize() });
    fleet.shine(start(), beam(at.extend(0.6) - GUN));
    assert_eq!(seen(&fleet), [true]);
    assert!(fleet.sees_gun(0, at, 0.0));
    fleet.shine(start(), beam(aside));
    assert_eq!(seen(&fleet), [false]);
}

#[test]
fn crews_see_the_gun_as_far_as_the_light_lets_them() {
    let farthest = |sun_deg: f64| {
        let (_, fleet) = fleet(sun_deg, &[&at_800_m("")]);
        (1..200)
            .rev()
            .map(|i| f64::from(i) * 50.0)
            .find(|m| fleet.sees_gun(0, DVec2::Y * *m, 0.0))
            .unwrap_or(0.0)
    };
    let [day, dusk, night] = [30.0, -6.0, -30.0].map(farthest);
    assert!(day > 6000.0, "{day}");
    assert!((2000.0..=day).contains(&dusk), "{dusk}");
    assert!((200.0..1500.0).contains(&night), "{night}");
}

#[test]
fn what_stands_before_a_boat_hides_it() {
    let (_, fleet) =
        fleet(30.0, &[&at_800_m(""), &at_800_m("").replace("800", "700").replace("\"a\"", "\"b\"")]);
    assert_eq!(seen(&fleet), [true, true], "boats are looked over");
    let large = Traffic { position: DVec2::Y * 400.0, velocity: DVec2::ZERO, heading: 0.0, radius_m: 30.0 };
    assert!(super::super::is_hidden(
        0,
        DVec2::Y * 800.0,
        [Traffic { radius_m: 3.0, ..large }, large].into_iter()
    ));
}

#[test]
fn a_flare_shows_a_dark_boat_at_night_and_a_boat_on_fire_shows_itself() {
    let (_, mut dark) = fleet(-20.0, &[&at_800_m("")]);
    assert_eq!(seen(&dark), [false]);
    let spec = FlareSpec::rocket(DVec2::new(0.0, 700.0));
    dark.light_flare(Flare { spec, lit: start().plus_secs(-5.0), wind: DVec2::ZERO });
    assert_eq!(seen(&dark), [true]);
    assert!(dark.seen_from(GUN, start().plus_secs(40.0))[0] < 1.0, "it has burnt out");
    assert_eq!(seen(&fleet(-20.0, &[&at_800_m("burns_at_s = 0")]).1), [true]);
}

#[test]
fn a_flare_lets_crews_know_that_they_are_seen_and_shows_them_the_ship() {
    let rocket = |place: DVec2| Flare {
        spec: FlareSpec::rocket(place),
        lit: start().plus_secs(-5.0),
        wind: DVec2::ZERO,
    };
    let under = |sun_deg: f64, place: DVec2| {
        let (_, mut fleet) = fleet(sun_deg, &[&at_800_m("")]);
        let at = fleet.boats[0].history.state(0.0).position;
        assert!(!fleet.is_under_flare(0, at, 0.0), "none burns");
        fleet.light_flare(rocket(place));
        // Before it, while it burns, after it.
        [-6.0, 0.0, 26.0].map(|time_s| fleet.is_under_flare(0, at, time_s))
    };
    assert_eq!(under(-20.0, DVec2::new(0.0, 700.0)), [false, true, false]);
    assert_eq!(under(-20.0, DVec2::new(0.0, -400.0)), [false; 3], "too far off");
    assert_eq!(under(10.0, DVec2::new(0.0, 700.0)), [false; 3], "by day nobody minds it");
    let (_, mut dark) = fleet(-20.0, &[&at_800_m("")]);
    let at = dark.boats[0].history.state(0.0).position;
    assert!(!dark.sees_gun(0, at, 0.0));
    dark.light_flare(rocket(DVec2::new(100.0, 0.0)));
    assert!(dark.sees_gun(0, at, 0.0));
}
