use super::*;
use crate::world::{
    boats::{Behaviour, CrewedStart},
    scenario::Scenario,
};

const BOAT: &str = r#"
[[boat]]
name = "a"
model = "skiff"
crew = "attacker"
range_m = 400
bearing_deg = 10
"#;
const CREW: &str = r#"
[[crew]]
name = "own"
[[crew.state]]
name = "wait"
does = "loiter"
speed_kn = 4
radius_m = 50
[[crew.state.next]]
to = "go"
after_s = 5
chance = 0.5
[[crew.state]]
name = "go"
does = "attack"
speed_kn = 20
stop_m = 50
"#;

fn parse(text: &str) -> Result<Scenario, TomlError> {
    Scenario::parse(text, "test.toml")
}

fn refused(text: &str) -> String {
    parse(text).expect_err(text).to_string()
}

fn starts(text: &str) -> Vec<CrewedStart> {
    let scenario = parse(text).expect("valid");
    let crewed = scenario.boats.into_iter().map(|boat| match boat.behaviour {
        Behaviour::Crewed(start) => start,
        Behaviour::ScriptedCourse(_) => panic!("{} has no crew", boat.name),
    });
    crewed.collect()
}

#[test]
fn the_built_in_crews_are_valid_and_end_nowhere() {
    let crews = built_in().expect("valid");
    let names: Vec<&str> = crews.iter().map(|crew| crew.name.as_str()).collect();
    assert_eq!(names, ["fisher", "anchored", "curious", "prober", "attacker", "rammer", "driven"]);
    for crew in &crews {
        for exit in crew.plan.states.iter().flat_map(|state| &state.exits) {
            assert!(exit.to < crew.plan.states.len(), "{}", crew.name);
        }
    }
}

#[test]
fn a_crew_of_the_scenario_is_read_and_goes_before_a_built_in_one() {
    let own = starts(&format!("{CREW}{}", BOAT.replace("attacker", "own")));
    let plan = &own[0].plan;
    assert_eq!(plan.states.len(), 2);
    assert_eq!(plan.states[0].act, Act::Loiter { radius_m: 50.0 });
    let guard = Guard { after_s: Some(5.0), ..Guard::default() };
    assert_eq!(plan.states[0].exits, [Exit { guard, chance: 0.5, to: 1 }]);
    assert!((plan.states[1].speed_m_s - 20.0 * M_S_PER_KN).abs() < 1e-12);
    let replaced = starts(&format!("{}{BOAT}", CREW.replace("\"own\"", "\"attacker\"")));
    assert_eq!(replaced[0].plan.states[0].name, "wait");
}

#[test]
fn a_group_stands_about_its_place_and_each_has_its_own_name_and_chance() {
    let text = format!("seed = 5\n{BOAT}count = 3\nformation = \"wedge\"\nspacing_m = 30\nspeed_kn = 10\n");
    let names: Vec<String> = parse(&text).expect("valid").boats.into_iter().map(|b| b.name).collect();
    assert_eq!(names, ["a-1", "a-2", "a-3"]);
    let group = starts(&text);
    assert!((group[0].position.length() - 400.0).abs() < 1e-9);
    assert!(group.windows(2).all(|pair| pair[0].chance != pair[1].chance));
    assert!(group.iter().all(|b| !b.keeps_rules && (b.speed_m_s - 10.0 * M_S_PER_KN).abs() < 1e-12));
    let neutral = starts(&BOAT.replace("crew =", "side = \"neutral\"\ncrew ="));
    assert!(neutral[0].keeps_rules);
}

#[test]
fn mistakes_are_named_by_line_column_and_remedy() {
    let boat = |from: &str, to: &str| refused(&BOAT.replace(from, to));
    let crew = |from: &str, to: &str| refused(&CREW.replace(from, to));
    let cases = [
        (
            boat("attacker", "pirate"),
            "test.toml:5:8: boat[1].crew: \"pirate\" is not allowed; give one of \"fisher\", \"anchored\"",
        ),
        (
            boat("crew =", "course = \"still\"\ncrew ="),
            "test.toml:6:8: boat[1].crew: a boat has a course or a crew; leave out one of them",
        ),
        (
            boat("crew = \"attacker\"\n", ""),
            "boat[1].course: is missing; give one of \"still\", \"straight\"",
        ),
        (
            boat("crew = \"attacker\"", "course = \"still\"\ncount = 3"),
            "test.toml:6:9: boat[1].count: has no meaning without crew",
        ),
        (
            boat("range_m = 400", "range_m = 400\nstop_m = 30"),
            "test.toml:7:10: boat[1].stop_m: has no meaning for a boat with a crew",
        ),
        (
            boat("range_m = 400", "range_m = 400\nengine = \"steam\""),
            "boat[1].engine: \"steam\" is not allowed; give one of \"outboard\", \"jet\", \"shaft\"",
        ),
        (
            boat("range_m = 400", "range_m = 400\nspeed_kn = 40"),
            "boat[1].speed_kn: 40 is not allowed; give a number, 0 to 28 kn (speed_max_kn)",
        ),
        (
            boat("range_m = 400", "range_m = 400\ncount = 0"),
            "boat[1].count: 0 is not allowed; give a whole number, 1 to 40",
        ),
        (
            boat("range_m = 400", "range_m = 400\nformation = \"line\""),
            "boat[1].formation: \"line\" is not allowed; give one of \"abreast\", \"column\", \"wedge\", \"scattered\"",
        ),
        (
            refused(&format!("{BOAT}count = 40\n{}count = 40\n", BOAT.replace("\"a\"", "\"b\""))),
            "boat[2].count: makes more than 64 boats in all; ask for fewer",
        ),
        (
            crew("\"loiter\"", "\"dance\""),
            "test.toml:6:8: crew[1].state[1].does: \"dance\" is not allowed; give one of \"transit\"",
        ),
        (
            crew("radius_m = 50", "radius_m = 50\nturn_m = 5"),
            "crew[1].state[1].turn_m: has no meaning for \"loiter\"; leave it out (that has speed_kn, radius_m)",
        ),
        (
            crew("speed_kn = 4\n", ""),
            "test.toml:4:1: crew[1].state[1].speed_kn: is missing; give a number, 0.1 to 100 kn",
        ),
        (
            crew("to = \"go\"", "to = \"gone\""),
            "crew[1].state[1].next[1].to: \"gone\" is not allowed; give one of \"wait\", \"go\"",
        ),
        (
            crew("after_s = 5\n", ""),
            "crew[1].state[1].next[1].after_s: is missing; give at least one of after_s, within_m",
        ),
        (
            crew("after_s = 5", "hit = false"),
            "crew[1].state[1].next[1].hit: false is not allowed; give true, or leave it out",
        ),
        (
            crew("chance = 0.5", "chance = 2"),
            "crew[1].state[1].next[1].chance: 2 is not allowed; give a number, 0 to 1",
        ),
        (
            crew("chance = 0.5", "likely = 2"),
            "crew[1].state[1].next[1].likely: unknown key; known are to, chance",
        ),
        (crew("stop_m = 50", ""), "crew[1].state[2].stop_m: is missing; give the range at which it stops"),
        (
            crew("stop_m = 50", "stop_m = 50\nrams = true"),
            "crew[1].state[2].stop_m: has no meaning for a crew that rams",
        ),
        (crew("name = \"go\"", "name = \"wait\""), "crew[1].state[2].name: another state is called \"wait\""),
        (
            refused("[[crew]]\nname = \"idle\"\n"),
            "test.toml:1:1: crew[1].state: is missing; give at least one table [[crew.state]]",
        ),
        (refused(&format!("{CREW}{CREW}")), "crew[2].name: another crew is called \"own\""),
        (
            crew(
                "does = \"loiter\"\nspeed_kn = 4\nradius_m = 50",
                "does = \"transit\"\nspeed_kn = 4\nwaypoints = []",
            ),
            "crew[1].state[1].waypoints: has no points",
        ),
    ];
    for (message, expected) in cases {
        assert!(message.contains(expected), "{message}\n want {expected}");
        assert_eq!(message.lines().count(), 1, "one line: {message}");
    }
}
