use proptest::prelude::*;

use glam::{DVec2, DVec3};

use super::*;
use crate::{
    water::{ReflectionMethod, ShadowLevel},
    world::boats::{Behaviour, BoatDamage, CourseState},
};

/// Where a boat on a known course is at a time.
fn scripted(boat: &BoatSpec, time_s: f64) -> CourseState {
    match &boat.behaviour {
        Behaviour::ScriptedCourse(course) => course.state(time_s, &BoatDamage::NONE),
        Behaviour::Crewed(_) => panic!("{} has a crew", boat.name),
    }
}

fn parse(text: &str) -> Result<Scenario, TomlError> {
    Scenario::parse(text, "test.toml")
}

fn refused(text: &str) -> String {
    parse(text).expect_err("must be refused").to_string()
}

const BOAT: &str = "[[boat]]\nname = \"a\"\nmodel = \"skiff\"\ncourse = \"straight\"\nrange_m = 200\nbearing_deg = 10\nheading_deg = 0\nspeed_kn = 9\n";

#[test]
fn every_built_in_scenario_is_valid_and_clear_of_the_camera() {
    for (name, text) in BUILT_IN {
        let scenario = Scenario::parse(text, name).unwrap_or_else(|e| panic!("{e}"));
        let radius = |boat: &BoatSpec| match boat.model.as_str() {
            "frigate" | "frigate-quad" => 70.0,
            "dhow" => 10.0,
            _ => 5.0,
        };
        let radii: Vec<f64> = scenario.boats.iter().map(radius).collect();
        scenario.check_clearance(&radii).unwrap_or_else(|e| panic!("{e}"));
    }
}

#[test]
fn the_files_of_the_folder_are_the_built_in_scenarios() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios");
    let mut files: Vec<String> = std::fs::read_dir(folder)
        .expect("the folder of scenarios")
        .map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned())
        .collect();
    files.sort();
    let mut names: Vec<String> = BUILT_IN.iter().map(|(name, _)| format!("{name}.toml")).collect();
    names.sort();
    assert_eq!(files, names);
}

#[test]
fn the_default_boats_stay_in_the_sector_that_the_camera_sweeps() {
    let scenario = parse(DEFAULT).expect("valid");
    assert_eq!(scenario.boats.len(), 3);
    for boat in &scenario.boats {
        for t in 0..=600 {
            let at = scripted(boat, f64::from(t) / 10.0).position;
            let bearing = at.x.atan2(at.y).to_degrees();
            assert!(bearing.abs() < 45.0, "{} at {bearing} deg after {t} ds", boat.name);
            assert!((60.0..=250.0).contains(&at.length()), "{} at {} m after {t} ds", boat.name, at.length());
        }
    }
}

#[test]
fn the_default_boats_keep_clear_of_each_other() {
    let scenario = parse(DEFAULT).expect("valid");
    for t in 0..=1200 {
        let at = |i: usize| scripted(&scenario.boats[i], f64::from(t) / 10.0).position;
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            assert!(at(i).distance(at(j)) > 15.0, "boats {i} and {j} after {t} ds");
        }
    }
}

#[test]
fn the_thesis_swarm_closes_200_yards_at_15_knots() {
    let (_, text) = BUILT_IN[1];
    let swarm = parse(text).expect("valid");
    let hostile: Vec<_> = swarm.boats.iter().filter(|b| b.side == Side::Hostile).collect();
    assert_eq!(hostile.len(), 6);
    for boat in hostile {
        let start = scripted(boat, 0.0);
        assert!((start.position.length() / 0.9144 - 200.0).abs() < 0.1, "{}", boat.name);
        assert!((boat.behaviour.speed_max_m_s() - 7.717).abs() < 2.0, "{}", boat.name);
    }
}

#[test]
fn an_empty_text_is_a_scenario_of_defaults() {
    let scenario = parse("").expect("valid");
    assert_eq!((scenario.seed, scenario.duration_s, scenario.boats.len()), (1, None, 0));
    assert_eq!(scenario.water.method, ReflectionMethod::Baked);
    assert_eq!(scenario.water.shadow, ShadowLevel::Gradual);
    assert_eq!(scenario.weapon.belt, 100);
    assert!((scenario.daylight.sun_direction.length() - 1.0).abs() < 1e-12);
}

#[test]
fn units_become_radians_metres_and_seconds() {
    let text = format!(
        "[sea]\nbeaufort = 4\nwind_from_deg = 90\n[light]\nsun_azimuth_deg = 90\nsun_elevation_deg = 0\nvisibility_km = 5\n{BOAT}"
    );
    let scenario = parse(&text).expect("valid");
    assert!((scenario.wind - DVec3::new(-6.688, 0.0, 0.0)).length() < 1e-3, "{}", scenario.wind);
    assert!((scenario.daylight.sun_direction - DVec3::X).length() < 1e-12);
    assert_eq!(scenario.daylight.visibility_m, 5000.0);
    let boat = scripted(&scenario.boats[0], 10.0);
    let start = DVec2::new(10_f64.to_radians().sin(), 10_f64.to_radians().cos()) * 200.0;
    assert!((boat.position - start - DVec2::Y * 46.3).length() < 1e-9, "{boat:?}");
}

#[test]
fn the_sea_is_measured_only_where_that_is_asked_for() {
    let from_video = |text: &str| parse(text).expect("valid").sea_from_video;
    assert!(!from_video("") && !from_video("[sea]\nsource = \"scenario\""));
    assert!(from_video("[sea]\nsource = \"video\"\nbeaufort = 3"));
    assert!(refused("[sea]\nsource = \"camera\"").contains("sea.source: \"camera\" is not allowed"));
}

#[test]
fn former_names_of_methods_are_read_with_a_warning_that_names_the_new_one() {
    for (former, new) in [
        ("waves", "baked"),
        ("full_as_printed", "full_as_published"),
        ("physics_as_printed", "physics_as_published"),
    ] {
        let read = |name: &str| parse(&format!("[reflection]\nmethod = \"{name}\"\n")).expect("valid");
        let scenario = read(former);
        assert_eq!(scenario.water, read(new).water);
        assert_eq!(scenario.water.method.name(), new);
        let said = format!("test.toml:2:10: reflection.method: \"{former}\" is now called \"{new}\"");
        assert!(
            scenario.warnings.len() == 1 && scenario.warnings[0].starts_with(&said),
            "{:?}",
            scenario.warnings
        );
        assert_eq!(read(new).warnings, [""; 0]);
    }
}

#[test]
fn tracers_are_every_nth_round() {
    let tracers = |text: &str| -> Vec<u64> {
        let weapon = parse(text).expect("valid").weapon;
        (1..=10).filter(|&shot| weapon.is_tracer(shot)).collect()
    };
    assert_eq!(tracers("[weapon]\ntracer_every = 4"), [4, 8]);
    assert_eq!(tracers("[weapon]\ntracer_every = 0"), [0; 0]);
}

#[test]
fn mistakes_are_refused_with_place_key_value_and_what_is_allowed() {
    let cases = [
        (
            "seed = -1",
            "test.toml:1:8: seed: -1 is not allowed; give a whole number, 0 to 9223372036854775807",
        ),
        ("seed = 1.5", "test.toml:1:8: seed: 1.5 is not allowed"),
        ("name = \"\"", "test.toml:1:8: name: \"\" is not allowed; give a text in quotes"),
        ("\n\nsed = 1", "test.toml:3:1: sed: unknown key; known are name, seed, duration_s"),
        (
            "[sea]\n  beaufort = 13",
            "test.toml:2:14: sea.beaufort: 13 is not allowed; give a whole number, 0 to 12",
        ),
        ("[sea]\nbeaufort = 99999999999999999999", "test.toml:2:12: sea.beaufort: 9999"),
        ("sea = 3", "test.toml:1:7: sea: 3 is not allowed; give a table: [sea]"),
        ("[see]\nbeaufort = 2", "test.toml:1:2: see: unknown key"),
        ("[sea]\nsignificant_wave_height_m = 1", "sea.peak_period_s: is missing; give it together with"),
        (
            "[mount]\neye_height_m = nan",
            "test.toml:2:16: mount.eye_height_m: nan is not allowed; give a number, 0.5 to 100 m",
        ),
        ("[mount]\neye_height_m = inf", "mount.eye_height_m: inf is not allowed"),
        ("[mount]\neye_height_m = \"8\"", "mount.eye_height_m: \"8\" is not allowed"),
        ("[light]\nutc = \"noon\"\n", "test.toml:2:7: light.utc: \"noon\" is not allowed; give a time like"),
        (
            "[light]\nlatitude_deg = 54\nlongitude_deg = 10\nutc = 2026-06-01T12:00:00+02:00",
            "light.utc: 2026-06-01T12:00:00+02:00 is not allowed; give date and time in UTC",
        ),
        ("[light]\nlatitude_deg = 54", "light.longitude_deg: is missing; give all of"),
        ("[light]\nlatitude_deg = 54\nsun_azimuth_deg = 3", "light.sun_azimuth_deg: follows from"),
        (
            "[reflection]\nmethod = \"magic\"",
            "reflection.method: \"magic\" is not allowed; give one of \"off\", \"mirror\", \"full\", \"full_as_published\", \"physics\", \"physics_as_published\", \"baked\"",
        ),
        (
            "[reflection]\nshadow_level = 3",
            "reflection.shadow_level: 3 is not allowed; give a whole number, 0 to 2",
        ),
        ("[weapon]\nbelt = -3", "weapon.belt: -3 is not allowed; give a whole number, 0 to 100000"),
        (
            "[weapon]\nmuzzle_velocity_m_s = 0",
            "weapon.muzzle_velocity_m_s: 0 is not allowed; give a number, 50 to 2000 m/s",
        ),
        ("[boat]\nname = \"a\"", "boat: "),
        (
            "[[boat]]\nname = \"a\"\nkeel = 3\n",
            "test.toml:3:1: boat[1].keel: unknown key; known are name, model, side, course",
        ),
        ("[[boat]]\nname = \"a\"\n", "test.toml:1:1: boat[1].course: is missing; give one of \"still\""),
        ("name = \"x\nseed = 1", "test.toml:1:10: "),
    ];
    for (text, expected) in cases {
        let message = refused(text);
        assert!(message.contains(expected), "{text:?}\n gave {message}\n want {expected}");
        assert_eq!(message.lines().count(), 1, "one line: {message}");
    }
}

#[test]
fn mistakes_in_a_boat_name_the_boat() {
    let with = |from: &str, to: &str| refused(&BOAT.replace(from, to));
    assert!(
        with("speed_kn = 9", "speed_kn = 900")
            .contains("test.toml:8:12: boat[1].speed_kn: 900 is not allowed")
    );
    assert!(
        with("speed_kn = 9\n", "").contains("boat[1].speed_kn: is missing; give a number, 0.1 to 100 kn")
    );
    assert!(with("range_m = 200", "range_m = 0").contains("boat[1].range_m: 0 is not allowed"));
    assert!(with("straight", "ramming").contains("boat[1].course: \"ramming\" is not allowed"));
    assert!(with("straight", "still").contains("boat[1].speed_kn: has no meaning on a still course"));
    assert!(
        refused(&format!("{BOAT}{BOAT}"))
            .contains("test.toml:10:8: boat[2].name: \"a\" is the name of boat[1] too")
    );
    let weave = BOAT.replace("straight", "weave") + "weave_amplitude_m = 50\nweave_period_s = 5\n";
    assert!(refused(&weave).contains("test.toml:9:21: boat[1].weave_amplitude_m: a weave of 50 m in 5 s"));
    let points = BOAT.replace("straight", "waypoints").replace("heading_deg = 0\n", "")
        + "waypoints = [[10, 300], [20]]\n";
    assert!(refused(&points).contains("test.toml:8:25: boat[1].waypoints: [20] is not allowed; give pairs"));
    let near = BOAT.replace("straight", "closing").replace("range_m = 200", "range_m = 50");
    assert!(refused(&near).contains("test.toml:5:11: boat[1].range_m: it starts 50 m away, too close"));
}

#[test]
fn a_boat_in_the_camera_is_refused() {
    let inside = BOAT
        .replace("range_m = 200", "range_m = 4")
        .replace("straight", "still")
        .replace("speed_kn = 9\n", "");
    let error =
        parse(&inside).expect("valid so far").check_clearance(&[5.0]).expect_err("inside").to_string();
    assert!(
        error.contains("test.toml:5:11: boat[1]: a comes within 7.0 m of the camera from the start"),
        "{error}"
    );

    let through = parse(&BOAT.replace("heading_deg = 0", "heading_deg = 190")).expect("valid so far");
    assert_eq!(through.check_clearance(&[]), Ok(()), "boats without a radius are not checked");
    let error = through.check_clearance(&[5.0]).expect_err("runs over the camera").to_string();
    assert!(error.contains("of the camera after 42 s"), "{error}");
    // 200 m at 9 kn take 43 s.
    let in_time =
        parse(&format!("duration_s = 40\n{}", BOAT.replace("heading_deg = 0", "heading_deg = 190")));
    assert_eq!(in_time.expect("valid").check_clearance(&[5.0]), Ok(()));
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(text in prop::collection::vec(any::<char>(), 0..100)) {
        let _ = parse(&String::from_iter(text));
    }

    /// Any value at any key is either taken or refused in one line that names the key.
    #[test]
    fn hostile_values_are_refused_in_place(
        line in 0..60_usize,
        value in prop::sample::select(vec![
            "nan", "-inf", "1e400", "-1", "0", "99999999999999999999999", "\"\"", "\"\\u0000\"", "[]", "[[1]]", "{}", "true",
            "1979-05-27", "07:32:00", "0xff", "1e-320", "\"straight\"", "[[[]], 3]",
        ]),
    ) {
        let lines: Vec<&str> = DEFAULT.lines().collect();
        prop_assume!(lines.get(line).is_some_and(|l| l.contains(" = ")));
        let key = lines[line].split(" = ").next().expect("a key");
        let mut changed: Vec<String> = lines.iter().map(|l| (*l).to_owned()).collect();
        changed[line] = format!("{key} = {value}");
        if let Err(error) = parse(&changed.join("\n")) {
            let shown = error.to_string();
            prop_assert!(shown.lines().count() == 1, "{shown}");
            prop_assert!(error.line > 0 && error.line <= lines.len(), "{shown}");
            prop_assert!(error.key.is_empty() || error.line == line + 1 || error.key.contains("boat"), "{shown}");
        }
    }
}
