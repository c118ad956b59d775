//! `bowwave scenario`: from a new file to a picture of it, and mistakes named by their place.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::fs;

use bowwave_tests::{bowwave, expect_code, said, write};

fn printed(output: &std::process::Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn an_instructor_comes_from_a_new_file_to_its_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let (file, picture) = (path("mine.toml"), path("mine.svg"));
    let made = bowwave(["scenario", "new", &file]);
    expect_code(&made, 0);
    assert!(said(&made).contains(&format!("bowwave scenario check {file}")), "{}", said(&made));
    let checked = bowwave(["scenario", "check", &file, "three-axes"]);
    expect_code(&checked, 0);
    let answer = printed(&checked);
    assert!(
        answer.contains("\"My scenario\" is sound: 3 hostile and 2 neutral boats, 4 with crews"),
        "{answer}"
    );
    let drawn = bowwave(["scenario", "preview", &file, "--out", &picture, "--seconds", "60"]);
    expect_code(&drawn, 0);
    let svg = fs::read_to_string(&picture).expect("the picture");
    for name in ["raider-1", "raider-3", "fisher", "passer-by", ">gun<", ">attack<", "nearest"] {
        assert!(svg.contains(name), "{name} is missing");
    }
    // A boat's track has a point for each second, and no number that a browser cannot read.
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
    let again = bowwave(["scenario", "preview", &file, "--out", &picture]);
    expect_code(&again, 1);
    assert!(said(&again).contains("is there already; name another file, or add --force"), "{}", said(&again));
    expect_code(&bowwave(["scenario", "new", &file]), 1);
    expect_code(&bowwave(["scenario", "new", &file, "--from", "swarm", "--force"]), 0);
    assert!(fs::read_to_string(&file).expect("the file").contains("name = \"Swarm\""));
}

#[test]
fn each_wrong_scenario_is_named_by_its_place_and_the_sound_ones_are_still_looked_at() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str, text: &str| write(folder.path(), name, text);
    let wrong = path(
        "wrong.toml",
        "[[boat]]\nname = \"a\"\nmodel = \"skiff\"\ncrew = \"pirate\"\nrange_m = 300\nbearing_deg = 3\n",
    );
    let close = path(
        "close.toml",
        "[[boat]]\nname = \"a\"\nmodel = \"skiff\"\ncrew = \"rammer\"\nrange_m = 4\nbearing_deg = 3\n",
    );
    let output = bowwave(["scenario", "check", &wrong, "swarm", &close]);
    expect_code(&output, 1);
    let (told, answer) = (said(&output), printed(&output));
    assert!(
        told.contains("wrong.toml:4:8: boat[1].crew: \"pirate\" is not allowed; give one of \"fisher\""),
        "{told}"
    );
    assert!(told.contains("close.toml:5:11: boat[1]: a comes within"), "{told}");
    assert!(answer.contains("swarm: \"Swarm\" is sound"), "{answer}");
}

#[test]
fn check_tells_all_mistakes_that_do_not_follow_from_each_other() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "name = \"Odd\"\nduration_s = 0\n[sea]\nbeaufort = 13\nwind = 3\n[goals]\nstop = 2\n[[boat]]\nname = \"a\"\nmodel = \"skiff\"\n\
                crew = \"attacker\"\nrange_m = -3\nbearing_deg = 400\ncount = 0\n";
    let file = write(folder.path(), "odd.toml", text);
    let output = bowwave(["scenario", "check", &file]);
    expect_code(&output, 1);
    let told = said(&output);
    let lines: Vec<&str> = told.lines().filter(|line| line.contains("odd.toml:")).collect();
    let places = ["2:14: duration_s", "4:12: sea.beaufort", "5:1: sea.wind", "13:15: boat[1].bearing_deg"];
    for place in places {
        assert_eq!(
            lines.iter().filter(|line| line.contains(&format!("odd.toml:{place}"))).count(),
            1,
            "{place}\n{told}"
        );
    }
    // What else is wrong with that boat is told once it has a bearing, but nothing that came of taking lines out is.
    for follows in ["goals.stop", "is missing"] {
        assert!(!told.contains(follows), "{told}");
    }
}

#[test]
fn a_model_that_there_is_not_is_named_where_the_boat_stands() {
    let folder = tempfile::tempdir().expect("a folder");
    let boat =
        "[[boat]]\nname = \"a\"\nmodel = \"trawler\"\ncourse = \"still\"\nrange_m = 300\nbearing_deg = 3\n";
    let file = write(folder.path(), "trawler.toml", &format!("name = \"Trawler\"\n{boat}"));
    let told = said(&bowwave(["scenario", "check", &file]));
    assert!(told.contains("trawler.toml:6:11: boat[1]: cannot load the model of a: there is no model \"trawler\"; built in are"), "{told}");
}

#[test]
fn what_is_hardly_meant_is_pointed_out_and_no_built_in_scenario_has_any() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "name = \"Odd\"\nduration_s = 60\nbriefing = \"Odd.\"\n[weapon]\nbelt = 0\n[rules]\nengagement = \"free\"\n[goals]\n\
                keep_off_m = 400\n[[event]]\nat_s = 90\nmessage = \"late\"\n[[call]]\nsay = \"warn\"\nabout = \"a\"\nbefore_m = 350\n\
                [[boat]]\nname = \"a\"\nmodel = \"skiff\"\ncrew = \"attacker\"\nrange_m = 300\nbearing_deg = 3\non_target_s = 80\n[searchlight]\n[light]\nsun_elevation_deg = 40\nsource = \"scenario\"\n[[crew]]\nname = \"slow\"\n\
                [[crew.state]]\nname = \"lie\"\ndoes = \"stop\"\n[[crew.state]]\nname = \"run\"\ndoes = \"flee\"\nspeed_kn = 20\n[[boat]]\n\
                name = \"slow\"\nmodel = \"skiff\"\ncrew = \"slow\"\nspeed_max_kn = 10\nrange_m = 500\nbearing_deg = 30\n";
    let file = write(folder.path(), "odd.toml", text);
    let output = bowwave(["scenario", "check", &file]);
    expect_code(&output, 0);
    let told = said(&output);
    for doubt in [
        "event[1] at 90 s never happens: the scenario ends after 60 s",
        "call[1] (\"warn\" of \"a\") cannot be in time for \"a\": it begins 300 m off",
        "\"a\" begins 300 m off, within goals.keep_off_m = 400",
        "weapon.belt is 0: nobody can fire",
        "\"a\" is due at 80 s: the scenario ends after 60 s",
        "searchlight lights nobody: the sun is up",
        "\"slow\" cannot make the 20 kn that its crew's state \"run\" asks for: its speed_max_kn is 10",
        "nothing leads the crew of \"slow\" to its state \"run\"",
    ] {
        assert!(told.contains(doubt), "{doubt}\n{told}");
    }
    let json = printed(&bowwave(["scenario", "list", "--json"]));
    let list: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let names: Vec<&str> =
        list.as_array().expect("a list").iter().filter_map(|e| e["name"].as_str()).collect();
    let all = bowwave(["scenario", "check"].into_iter().chain(names));
    expect_code(&all, 0);
    assert!(!said(&all).contains("look at this"), "{}", said(&all));
}

#[test]
fn the_crowds_that_frames_are_timed_with_are_fifty_boats() {
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/data");
    for (crowd, boats) in
        [("ahead", "35 hostile and 15 neutral boats"), ("around", "40 hostile and 10 neutral boats")]
    {
        let checked = bowwave(["scenario", "check", &format!("{data}/crowd-{crowd}.toml")]);
        expect_code(&checked, 0);
        let answer = printed(&checked);
        assert!(answer.contains(&format!("is sound: {boats}, 50 with crews")), "{answer}");
    }
}

#[test]
fn the_list_has_every_built_in_scenario() {
    let table = printed(&bowwave(["scenario", "list"]));
    let json = printed(&bowwave(["scenario", "list", "--json"]));
    let list: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let listed = list.as_array().expect("a list");
    assert!(listed.len() >= 6, "{json}");
    for entry in listed {
        let name = entry["name"].as_str().expect("a name");
        assert!(table.lines().any(|line| line.starts_with(name)), "{name} is not in the table");
    }
}
