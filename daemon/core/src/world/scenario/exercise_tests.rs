use super::*;
use crate::world::scenario::Scenario;

const BOATS: &str = r#"
[[boat]]
name = "skiff"
model = "skiff"
crew = "attacker"
count = 3
formation = "wedge"
spacing_m = 30
range_m = 900
bearing_deg = 10
[[boat]]
name = "dhow"
model = "dhow"
side = "neutral"
course = "still"
range_m = 700
bearing_deg = 340
"#;

fn parse(text: &str) -> Result<ExerciseSpec, String> {
    let scenario = Scenario::parse(&format!("{text}{BOATS}"), "x.toml").map_err(|e| e.to_string())?;
    Ok(scenario.exercise)
}

#[test]
fn an_exercise_is_read_as_it_is_written() {
    let spec = parse(
        r#"
briefing = """
You guard the port quarter.
Warn what comes near."""
[rules]
engagement = "warn"
self_defence_m = 100
[goals]
keep_off_m = 150
stop = 2
par = [31, 74.5]
[[call]]
say = "report"
about = "skiff"
within_s = 30
[[call]]
say = "neutral"
about = "neutral"
before_m = 400
[[event]]
at_s = 40
rules = "free"
message = "Weapons free"
[[event]]
boat = "skiff-2"
within_m = 300
stoppage = true
[[event]]
boat = "hostile"
struck = true
message = "They are hit"
"#,
    )
    .expect("sound");
    assert_eq!(spec.briefing.as_deref(), Some("You guard the port quarter.\nWarn what comes near."));
    assert_eq!((spec.rules, spec.self_defence_m), (Some(Engagement::Warn), 100.0));
    assert_eq!(spec.goals, Goals { keep_off_m: 150.0, stop: Some(2), par: Some([31.0, 74.5]) });
    assert_eq!(spec.calls.len(), 2);
    assert_eq!(spec.calls[1].call, Act::Identify(Side::Neutral));
    assert!(spec.calls[0].about.covers("skiff-3", Side::Hostile));
    assert!(!spec.calls[0].about.covers("skiff-x", Side::Hostile));
    assert_eq!(spec.happenings[0].effects.len(), 2);
    assert_eq!(spec.happenings[2].cause, HappeningCause::Struck(About::Side(Side::Hostile)));
    assert_eq!(parse("").expect("sound"), ExerciseSpec::default());
}

/// Each mistake is named by line, column and key, with what to do.
#[test]
fn mistakes_are_named_where_they_stand() {
    let cases = [
        ("briefing = 5\n", "x.toml:1:12: briefing: 5 is not allowed; give a text"),
        ("briefing = \" \"\n", "x.toml:1:12: briefing: "),
        ("[rules]\n", "x.toml:1:1: rules.engagement: is missing; give one of \"hold\""),
        (
            "[rules]\nengagement = \"fire\"\n",
            "x.toml:2:14: rules.engagement: \"fire\" is not allowed; give one of",
        ),
        ("[rules]\nengagement = \"hold\"\nself_defence_m = -1\n", "x.toml:3:18: rules.self_defence_m: -1"),
        ("[goals]\nstop = 4\n", "x.toml:2:8: goals.stop: 4 is not allowed; give a whole number, 0 to 3"),
        (
            "[goals]\nkeep_off = 4\n",
            "x.toml:2:1: goals.keep_off: unknown key; known are keep_off_m, stop, par; did you mean keep_off_m?",
        ),
        ("[goals]\nkeep_off_m = nan\n", "x.toml:2:14: goals.keep_off_m: nan is not allowed"),
        ("[goals]\npar = [10]\n", "x.toml:2:7: goals.par: [10] is not allowed; give a list of 2"),
        (
            "[[call]]\nabout = \"skiff\"\nwithin_s = 3\n",
            "x.toml:1:1: call[1].say: is missing; give one of \"report\"",
        ),
        (
            "[[call]]\nsay = \"reload\"\nabout = \"skiff\"\nwithin_s = 3\n",
            "x.toml:2:7: call[1].say: \"reload\" is not allowed",
        ),
        (
            "[[call]]\nsay = \"warn\"\nabout = \"skif\"\nwithin_s = 3\n",
            "x.toml:3:9: call[1].about: \"skif\" is not allowed; give \"hostile\", \"neutral\", or the name of a boat or a group: skiff, dhow",
        ),
        (
            "[[call]]\nsay = \"warn\"\nabout = \"skiff\"\n",
            "x.toml:1:1: call[1].before_m: is missing; give the range",
        ),
        (
            "[[call]]\nsay = \"warn\"\nabout = \"skiff\"\nbefore_m = 0\n",
            "x.toml:4:12: call[1].before_m: 0 is not allowed",
        ),
        ("[[event]]\nmessage = \"x\"\n", "x.toml:1:1: event[1].at_s: is missing"),
        ("[[event]]\nat_s = 3\n", "x.toml:1:1: event[1].message: is missing; give what happens"),
        (
            "[[event]]\nat_s = 3\nwithin_m = 5\nboat = \"dhow\"\nmessage = \"x\"\n",
            "x.toml:3:12: event[1].within_m: stands beside at_s",
        ),
        (
            "[[event]]\nat_s = 3\nboat = \"dhow\"\nmessage = \"x\"\n",
            "x.toml:3:8: event[1].boat: has no meaning beside at_s",
        ),
        ("[[event]]\nwithin_m = 30\nmessage = \"x\"\n", "x.toml:1:1: event[1].boat: is missing"),
        (
            "[[event]]\nstruck = false\nboat = \"dhow\"\nmessage = \"x\"\n",
            "x.toml:2:10: event[1].struck: false is not allowed",
        ),
        (
            "[[event]]\nat_s = 3\nrules = \"free\"\n",
            "x.toml:3:9: event[1].rules: changes rules that there are not",
        ),
        ("[[event]]\nat_s = -3\nmessage = \"x\"\n", "x.toml:2:8: event[1].at_s: -3 is not allowed"),
        ("[[event]]\nat_s = 3\nmessage = \"a\\u0007\"\n", "x.toml:3:11: event[1].message: "),
        (
            "[[event]]\nat_s = 3\nstoppage = 1\n",
            "x.toml:3:12: event[1].stoppage: 1 is not allowed; give true or false",
        ),
        (
            "[weapon]\nkind = \"musket\"\n",
            "x.toml:2:8: weapon.kind: \"musket\" is not allowed; give one of \"heavy-machine-gun\"",
        ),
        ("[weapon]\nspare_belts = -1\n", "x.toml:2:15: weapon.spare_belts: -1 is not allowed"),
        ("[weapon]\nreload_s = \"long\"\n", "x.toml:2:12: weapon.reload_s: \"long\" is not allowed"),
        ("[weapon]\nstoppage_every = inf\n", "x.toml:2:18: weapon.stoppage_every: inf is not allowed"),
        ("[weapon]\nricochet_below_deg = 60\n", "x.toml:2:22: weapon.ricochet_below_deg: 60 is not allowed"),
        (
            "[weapon]\ndrag_table = [[0, 0.1], [1, 0.2]]\n",
            "x.toml:2:14: weapon.drag_table: needs sectional_density_lb_in2 beside it",
        ),
        (
            "[weapon]\nsectional_density_lb_in2 = 0.2\n",
            "x.toml:2:28: weapon.sectional_density_lb_in2: needs drag_table beside it",
        ),
        (
            "[weapon]\nsectional_density_lb_in2 = 0.2\ndrag_table = [[1, 0.1], [0, 0.2]]\n",
            "x.toml:3:14: weapon.drag_table: [[1, 0.1], [0, 0.2]] is not allowed; give a list of 2 to 32 pairs",
        ),
        (
            "[weapon]\nballistic_coefficient_g7_lb_in2 = 0.3\nballistic_coefficient_g1_lb_in2 = 0.6\n",
            "x.toml:3:35: weapon.ballistic_coefficient_g1_lb_in2: gives the round a second drag",
        ),
        ("[weapon]\nfragments_m = 50\n", "x.toml:2:15: weapon.fragments_m: 50 is not allowed"),
        ("rules = \"hold\"\n", "x.toml:1:9: rules: \"hold\" is not allowed; give a table: [rules]"),
        ("[call]\nsay = \"warn\"\n", "x.toml:1:1: call: "),
    ];
    for (text, expected) in cases {
        let told = parse(text).expect_err(text);
        assert!(told.starts_with(expected), "{text}\n{told}\n{expected}");
    }
}

#[test]
fn a_built_in_weapon_may_be_changed_key_by_key() {
    let weapon = |text: &str| Scenario::parse(text, "x").expect("sound").weapon;
    let heavy = weapon("[weapon]\nkind = \"heavy-machine-gun\"\nbelt = 50\n");
    assert_eq!((heavy.kind.as_deref(), heavy.belt, heavy.spare_belts), (Some("heavy-machine-gun"), 50, 3));
    assert_eq!(heavy.projectile.muzzle_velocity_m_s(), 893.0);
    assert_eq!(heavy.projectile.drag().name(), "g7");
    let ball = "[weapon]\nkind = \"heavy-machine-gun\"\nballistic_coefficient_sphere_lb_in2 = 0.3\n";
    assert_eq!(weapon(ball).projectile.drag().name(), "sphere");
    let table = "[weapon]\nsectional_density_lb_in2 = 0.2\ndrag_table = [[0, 0.1], [1.0, 0.5], [3, 0.3]]\n";
    assert_eq!(weapon(table).projectile.drag().coefficient(1.0), 0.5);
    let cold = "[weapon]\nkind = \"heavy-machine-gun\"\nbarrel_heat_k = 0\n";
    assert_eq!((heavy.heat.is_some(), weapon(cold).heat, heavy.burst), (true, None, None));
    assert!(weapon("[weapon]\nkind = \"automatic-grenade-launcher\"\n").burst.is_some());
    let plain = weapon("");
    assert_eq!(
        (plain.kind, plain.belt, plain.stoppage_every, plain.ricochet_below_deg),
        (None, 100, None, 0.0)
    );
    assert_eq!(weapon("[weapon]\nkind = \"cannon-25-mm\"\ntracer_every = 0\n").tracer_every, None);
}
