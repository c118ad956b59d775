//! Scenario files with one mistake each: the reader names it by line, column and key with what to do, and the JSON schema refuses what a
//! schema can.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use bowwave_core::world::scenario::{BUILT_IN, Scenario, TEMPLATE};
use bowwave_tests::bowwave;
use jsonschema::Validator;
use serde_json::Value;

/// A sound scenario with something of everything.
const SOUND: &str = r#"name = "Everything"
seed = 3
duration_s = 120
briefing = "Guard the port quarter."
[sea]
beaufort = 2
wind_from_deg = 250
[mount]
eye_height_m = 8.0
[light]
sun_azimuth_deg = 215
sun_elevation_deg = 35
visibility_km = 20
[reflection]
method = "baked"
shadow_level = 1
[weapon]
kind = "heavy-machine-gun"
rounds_per_minute = 500
belt = 100
spare_belts = 2
reload_s = 8
stoppage_every = 300
muzzle_velocity_m_s = 890
ballistic_coefficient_g7_lb_in2 = 0.33
dispersion_mrad = 0.6
tracer_every = 5
[searchlight]
candela = 150000
beam_deg = 6
on = true
[rules]
engagement = "warn"
self_defence_m = 100
[goals]
keep_off_m = 150
stop = 2
[[call]]
say = "report"
about = "raider"
before_m = 400
[[event]]
at_s = 40
rules = "free"
message = "Weapons free"
[[event]]
boat = "hostile"
struck = true
stoppage = true
[[event]]
at_s = 50
[event.flare]
bearing_deg = 77
range_m = 432
height_m = 250
[[crew]]
name = "wolf"
[[crew.state]]
name = "wait"
does = "loiter"
speed_kn = 5
radius_m = 40
[[crew.state.next]]
to = "come"
after_s = 15
lit = true
chance = 0.5
[[crew.state]]
name = "come"
does = "attack"
speed_kn = 15
stop_m = 60
[[boat]]
name = "raider"
model = "skiff"
side = "hostile"
crew = "wolf"
engine = "outboard"
speed_max_kn = 28
range_m = 450
bearing_deg = -10
count = 3
formation = "wedge"
spacing_m = 40
[[boat]]
name = "trader"
model = "dhow"
side = "neutral"
course = "weave"
heading_deg = 90
speed_kn = 6
weave_amplitude_m = 10
weave_period_s = 60
range_m = 300
bearing_deg = 20
"#;

/// What stands in the sound one, what stands in its place, the key that is named, and whether a schema can tell.
const MISTAKES: [(&str, &str, &str, bool); 71] = [
    ("name = \"Everything\"", "name = 5", "name", true),
    ("name = \"Everything\"", "name = \"\"", "name", true),
    ("seed = 3", "seed = -3", "seed", true),
    ("seed = 3", "seed = 3.5", "seed", true),
    ("duration_s = 120", "duration_s = 0", "duration_s", true),
    ("duration_s = 120", "duration_s = \"long\"", "duration_s", true),
    ("duration_s = 120", "duration = 120", "duration", true),
    ("briefing = \"Guard the port quarter.\"", "briefing = \"\"", "briefing", true),
    ("beaufort = 2", "beaufort = 13", "sea.beaufort", true),
    ("beaufort = 2", "beaufort = 2.5", "sea.beaufort", true),
    ("wind_from_deg = 250", "wind_from_deg = 400", "sea.wind_from_deg", true),
    ("wind_from_deg = 250", "peak_period_s = 6", "sea.significant_wave_height_m", false),
    ("eye_height_m = 8.0", "eye_height_m = 0", "mount.eye_height_m", true),
    ("eye_height_m = 8.0", "eye_hight_m = 8.0", "mount.eye_hight_m", true),
    ("sun_elevation_deg = 35", "sun_elevation_deg = 95", "light.sun_elevation_deg", true),
    ("visibility_km = 20", "visibility_km = 0", "light.visibility_km", true),
    ("method = \"baked\"", "method = \"baked \"", "reflection.method", true),
    ("shadow_level = 1", "shadow_level = 3", "reflection.shadow_level", true),
    ("kind = \"heavy-machine-gun\"", "kind = \"musket\"", "weapon.kind", true),
    ("rounds_per_minute = 500", "rounds_per_minute = 0", "weapon.rounds_per_minute", true),
    ("belt = 100", "belt = -1", "weapon.belt", true),
    ("belt = 100", "belt = true", "weapon.belt", true),
    ("spare_belts = 2", "spare_belts = 1001", "weapon.spare_belts", true),
    ("reload_s = 8", "reload_s = -8", "weapon.reload_s", true),
    ("stoppage_every = 300", "stoppage_every = -1", "weapon.stoppage_every", true),
    ("muzzle_velocity_m_s = 890", "muzzle_velocity_m_s = 20", "weapon.muzzle_velocity_m_s", true),
    ("dispersion_mrad = 0.6", "dispersion_mrad = 60", "weapon.dispersion_mrad", true),
    ("tracer_every = 5", "tracers_every = 5", "weapon.tracers_every", true),
    ("candela = 150000", "candela = 50", "searchlight.candela", true),
    ("beam_deg = 6", "beam = 6", "searchlight.beam", true),
    ("on = true", "on = \"yes\"", "searchlight.on", true),
    ("bearing_deg = 77", "bearing = 77", "event[3].flare.bearing", true),
    ("height_m = 250", "height_m = 5", "event[3].flare.height_m", true),
    ("range_m = 432\n", "", "event[3].flare.range_m", true),
    ("lit = true", "lit = false", "crew[1].state[1].next[1].lit", true),
    ("engagement = \"warn\"", "engagement = \"fire\"", "rules.engagement", true),
    ("engagement = \"warn\"\n", "", "rules.engagement", true),
    ("self_defence_m = 100", "self_defense_m = 100", "rules.self_defense_m", true),
    ("keep_off_m = 150", "keep_off_m = -150", "goals.keep_off_m", true),
    ("stop = 2", "stop = 4", "goals.stop", false),
    ("stop = 2", "par = [10]", "goals.par", true),
    ("say = \"report\"", "say = \"reload\"", "call[1].say", true),
    ("say = \"report\"\n", "", "call[1].say", true),
    ("about = \"raider\"", "about = \"raiders\"", "call[1].about", false),
    ("before_m = 400", "before_m = 0", "call[1].before_m", true),
    ("before_m = 400\n", "", "call[1].before_m", true),
    ("at_s = 40", "at_s = -40", "event[1].at_s", true),
    ("at_s = 40\n", "", "event[1].at_s", true),
    ("rules = \"free\"", "rules = \"loose\"", "event[1].rules", true),
    ("message = \"Weapons free\"", "message = \"Waffen frei für alle\"", "event[1].message", true),
    ("struck = true", "struck = false", "event[2].struck", true),
    ("boat = \"hostile\"\n", "", "event[2].boat", true),
    ("stoppage = true", "stoppage = \"yes\"", "event[2].stoppage", true),
    ("does = \"loiter\"", "does = \"lurk\"", "crew[1].state[1].does", true),
    ("speed_kn = 5\n", "", "crew[1].state[1].speed_kn", false),
    ("radius_m = 40", "radius_m = 4", "crew[1].state[1].radius_m", true),
    ("radius_m = 40", "radius_m = 40\nturn_m = 90", "crew[1].state[1].turn_m", false),
    ("to = \"come\"", "to = \"go\"", "crew[1].state[1].next[1].to", false),
    ("after_s = 15\nlit = true\n", "", "crew[1].state[1].next[1].after_s", true),
    ("chance = 0.5", "chance = 1.5", "crew[1].state[1].next[1].chance", true),
    ("stop_m = 60\n", "", "crew[1].state[2].stop_m", false),
    ("model = \"skiff\"\n", "", "boat[1].model", true),
    ("side = \"hostile\"", "side = \"enemy\"", "boat[1].side", true),
    ("crew = \"wolf\"", "crew = \"wolves\"", "boat[1].crew", false),
    ("engine = \"outboard\"", "engine = \"oars\"", "boat[1].engine", true),
    ("range_m = 450", "range_m = 0", "boat[1].range_m", true),
    ("count = 3", "count = 0", "boat[1].count", true),
    ("formation = \"wedge\"", "formation = \"line\"", "boat[1].formation", true),
    ("spacing_m = 40", "spacing_m = 2", "boat[1].spacing_m", true),
    ("course = \"weave\"", "course = \"zigzag\"", "boat[2].course", true),
    ("weave_period_s = 60\n", "", "boat[2].weave_period_s", false),
];

fn schema() -> Value {
    let output = bowwave(["scenario", "schema"]);
    assert!(output.status.success());
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn validator() -> Validator {
    jsonschema::validator_for(&schema()).expect("a sound schema")
}

/// A TOML text as JSON; times become texts.
fn json_of(text: &str) -> Value {
    let table: toml::Table = text.parse().expect("TOML");
    serde_json::to_value(table).expect("JSON")
}

#[test]
fn each_mistake_is_named_where_it_stands_and_the_schema_refuses_what_it_can() {
    Scenario::parse(SOUND, "x.toml").expect("sound");
    let validator = validator();
    assert!(validator.is_valid(&json_of(SOUND)), "{:?}", validator.iter_errors(&json_of(SOUND)).next());
    for (right, wrong, key, is_seen_by_schema) in MISTAKES {
        assert_eq!(SOUND.matches(right).count(), 1, "{right}");
        let text = SOUND.replace(right, wrong);
        let told = Scenario::parse(&text, "x.toml").map(|_| ()).expect_err(wrong).to_string();
        let at = SOUND.find(right).expect("it is there");
        let (place, said) = told.split_once(": ").expect("a place");
        let (named, problem) = said.split_once(": ").expect("a key");
        assert_eq!(named, key, "{wrong}: {told}");
        let numbers: Vec<usize> = place.split(':').skip(1).map(|n| n.parse().expect("a number")).collect();
        let line = text[..at].lines().count() + 1;
        if wrong.is_empty() || problem.starts_with("is missing") {
            // What is left out has no place of its own: its table has.
            let table = text.lines().nth(numbers[0] - 1).expect("a line");
            assert!(table.starts_with('[') && numbers[0] < line && numbers[1] == 1, "{told}");
        } else {
            let line = line + wrong.matches('\n').count();
            let last = wrong.lines().last().expect("a line");
            let column = match last.split_once(" = ") {
                Some((name, _)) if !problem.starts_with("unknown key") => name.len() + 4,
                _ => 1,
            };
            assert_eq!(numbers, [line, column], "{wrong}: {told}");
        }
        let remedy = ["give ", "leave ", "did you mean", "known are", "ask for"];
        assert!(remedy.iter().any(|word| problem.contains(word)), "no remedy: {told}");
        let is_valid = validator.is_valid(&json_of(&text));
        assert_eq!(!is_valid, is_seen_by_schema, "{wrong}: the schema says {is_valid}");
    }
}

#[test]
fn all_that_is_built_in_and_the_template_keep_to_the_schema() {
    let validator = validator();
    for (name, text) in BUILT_IN.into_iter().chain([("template", TEMPLATE)]) {
        let json = json_of(text);
        assert!(validator.is_valid(&json), "{name}: {:?}", validator.iter_errors(&json).next());
    }
}

/// The reader lists its keys where one is unknown.
fn keys_of_reader(text: &str) -> Vec<String> {
    let told = Scenario::parse(text, "x.toml").map(|_| ()).expect_err(text).to_string();
    let known = told.split("known are ").nth(1).expect("a list of keys");
    let known = known.split(';').next().expect("keys");
    let mut keys: Vec<String> = known.split(", ").map(str::to_owned).collect();
    keys.sort();
    keys
}

#[test]
fn each_table_of_the_schema_has_the_keys_of_the_reader() {
    let schema = schema();
    let tables = [
        ("", "xyz = 1\n"),
        ("/properties/sea", "[sea]\nxyz = 1\n"),
        ("/properties/mount", "[mount]\nxyz = 1\n"),
        ("/properties/light", "[light]\nxyz = 1\n"),
        ("/properties/reflection", "[reflection]\nxyz = 1\n"),
        ("/properties/weapon", "[weapon]\nxyz = 1\n"),
        ("/properties/searchlight", "[searchlight]\nxyz = 1\n"),
        ("/properties/rules", "[rules]\nxyz = 1\n"),
        ("/properties/goals", "[goals]\nxyz = 1\n"),
        ("/properties/call/items", "[[call]]\nxyz = 1\n"),
        ("/properties/event/items", "[[event]]\nxyz = 1\n"),
        ("/properties/event/items/properties/flare", "[[event]]\nflare = { xyz = 1 }\n"),
        ("/properties/crew/items", "[[crew]]\nxyz = 1\n"),
        ("/properties/crew/items/properties/state/items", "[[crew]]\n[[crew.state]]\nxyz = 1\n"),
        (
            "/properties/crew/items/properties/state/items/properties/next/items",
            "[[crew]]\n[[crew.state]]\n[[crew.state.next]]\nxyz = 1\n",
        ),
        ("/properties/boat/items", "[[boat]]\nxyz = 1\n"),
    ];
    for (pointer, text) in tables {
        let table = schema.pointer(pointer).unwrap_or_else(|| panic!("no {pointer}"));
        let mut keys: Vec<String> = table["properties"].as_object().expect("keys").keys().cloned().collect();
        keys.sort();
        assert_eq!(keys, keys_of_reader(text), "{pointer}");
    }
}
