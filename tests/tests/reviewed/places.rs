//! Places on the Earth, for maps.

use std::fs;

use bowwave_record::{RunSelection, read_tracks};
use bowwave_tests::{bowwave, expect_code, said};
use serde_json::Value;

use crate::{listed, reviewed};

/// Latitude and longitude of the gun, degrees.
const GUN: [f64; 2] = [54.1, 7.9];

/// Metres of a degree of longitude and of latitude there (WGS 84).
fn degree_m() -> [f64; 2] {
    let (equator_m, squared) = (6_378_137.0, 0.006_694_379_990_14);
    let (sin, cos) = GUN[0].to_radians().sin_cos();
    let root = (1.0 - squared * sin * sin).sqrt();
    [equator_m / root * cos, equator_m * (1.0 - squared) / root.powi(3)].map(|m| m * 1f64.to_radians())
}

#[test]
fn maps_get_tracks_and_rounds_where_they_were() {
    let run = reviewed();
    let journal = run.page.parent().unwrap().to_str().unwrap();
    let unknown = bowwave(["review", journal, "--format", "geojson"]);
    expect_code(&unknown, 1);
    let words = said(&unknown);
    assert!(words.contains("--place LAT,LON") && words.contains("latitude_deg"), "{words}");
    let made = bowwave(["review", journal, "--format", "geojson", "--place", "54.1,7.9"]);
    expect_code(&made, 0);
    let text = fs::read_to_string(String::from_utf8(made.stdout).unwrap().trim()).unwrap();
    let map: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(map["type"], "FeatureCollection");
    let features = map["features"].as_array().unwrap();
    assert_eq!(listed(&features[0]["geometry"]["coordinates"]), [GUN[1], GUN[0]]);
    let tracks = read_tracks(&run.page.with_file_name("hits.sqlite"), RunSelection::Latest).unwrap().tracks;
    let boat = features.iter().find(|f| f["properties"]["name"] == "passer-by").unwrap();
    assert_eq!(boat["geometry"]["type"], "MultiLineString");
    let places = boat["geometry"]["coordinates"][0].as_array().unwrap();
    let times_s = listed(&boat["properties"]["times_s"][0]);
    assert!(places.len() == tracks.samples.len() && times_s.len() == places.len());
    let degree_m = degree_m();
    for (sample, place) in tracks.samples.iter().zip(places) {
        let [x, y, _] = sample.boats[1].unwrap().position.map(f64::from);
        let place = listed(place);
        let off = [(place[0] - GUN[1]) * degree_m[0] - x, (place[1] - GUN[0]) * degree_m[1] - y];
        assert!(off[0].hypot(off[1]) < 0.02, "{off:?}");
    }
    let rounds = features.iter().filter(|f| f["properties"]["kind"] == "round").count();
    assert_eq!(rounds, tracks.rounds.len());
    // The flight recording is of the same place then.
    let acmi = bowwave([
        "review",
        journal,
        "--format",
        "acmi",
        "--place",
        "54.1,7.9",
        "--out",
        "/dev/stdout",
        "--force",
    ]);
    let acmi = String::from_utf8(acmi.stdout).unwrap();
    assert!(acmi.contains("\n0,ReferenceLongitude=7.9\n0,ReferenceLatitude=54.1\n"), "{acmi:.200}");
    let nowhere = bowwave(["review", journal, "--place", "-91,0"]);
    expect_code(&nowhere, 2);
    assert!(said(&nowhere).contains("is no place: write LAT,LON"), "{}", said(&nowhere));
}
