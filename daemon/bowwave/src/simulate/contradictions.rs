//! Contradictions between a recording and its scenario: light, sea, eye height, length.

use bowwave_core::{
    geometry::{bearing_and_elevation_deg, wrapped},
    world::scenario::Scenario,
};
use bowwave_record::Properties;

/// Angle between two suns beyond which shadows and glitter contradict each other, degrees.
const SUN_DEG: f64 = 20.0;
/// Angle between two winds beyond which waves run another way, degrees.
const WIND_DEG: f64 = 45.0;
/// Share by which the eye's height may differ: a boat's distance below the horizon errs by as much.
const EYE: f64 = 0.1;
/// Difference between two significant wave heights that shows, metres, and as a share.
const WAVES_M: f64 = 0.3;
const WAVES: f64 = 0.35;
/// Factor between two visibilities that shows.
const VISIBILITY: f64 = 2.0;

/// Contradictions, each in a few words; none where the recording says nothing. `length_s` of it are played.
pub fn contradictions(scenario: &Scenario, properties: &Properties, length_s: f64) -> Vec<String> {
    let said = |key: &str| properties.extra.get(key).and_then(|text| text.parse::<f64>().ok());
    let mut found = Vec::new();
    if let (Some(azimuth), Some(elevation)) = (said("sun_azimuth_deg"), said("sun_elevation_deg")) {
        let [own_azimuth, own] = bearing_and_elevation_deg(scenario.daylight.sun_direction);
        let aside = apart_deg(azimuth, own_azimuth) * own.to_radians().cos().max(0.0);
        if aside.hypot(elevation - own) > SUN_DEG || (elevation > 0.0) != (own > 0.0) {
            found.push(format!(
                "the sun stands at {azimuth:.0} degrees and {elevation:.0} high, in the scenario at {own_azimuth:.0} and {own:.0} high"
            ));
        }
    }
    let force = f64::from(scenario.water.force.get());
    if let Some(shown) = said("beaufort").filter(|shown| (shown - force).abs() >= 1.0) {
        found.push(format!("the wind is {shown:.0} Beaufort, in the scenario {force:.0}"));
    }
    let wind = scenario.waves.wind_from.to_degrees().rem_euclid(360.0);
    if let Some(shown) = said("wind_from_deg").filter(|shown| apart_deg(*shown, wind) > WIND_DEG) {
        found.push(format!("the wind comes from {shown:.0} degrees, in the scenario from {wind:.0}"));
    }
    let height_m = scenario.waves.spectrum.significant_height_m();
    let shown =
        said("significant_height_m").filter(|m| (m - height_m).abs() > WAVES_M + WAVES * m.max(height_m));
    if let Some(shown) = shown {
        found.push(format!("the waves are {shown:.1} m high, in the scenario {height_m:.1} m"));
    }
    let eye_m = scenario.eye_height_m;
    if let Some(shown) = said("eye_height_m").filter(|shown| (shown / eye_m - 1.0).abs() > EYE) {
        found.push(format!("the eye is {shown} m high, in the scenario {eye_m} m"));
    }
    let visibility_m = scenario.daylight.visibility_m;
    let shown =
        said("visibility_m").filter(|m| !(1.0 / VISIBILITY..=VISIBILITY).contains(&(m / visibility_m)));
    if let Some(shown) = shown {
        let km = |m: f64| m / 1000.0;
        found.push(format!(
            "the visibility is {:.0} km, in the scenario {:.0} km",
            km(shown),
            km(visibility_m)
        ));
    }
    if let Some(lasts_s) = scenario.duration_s.filter(|lasts_s| *lasts_s > length_s + 0.5) {
        found.push(format!(
            "this run ends after {length_s:.1} s, the scenario after {lasts_s} s (--duration {lasts_s} plays all of it)"
        ));
    }
    found
}

/// Angle between two directions, degrees.
fn apart_deg(a: f64, b: f64) -> f64 {
    wrapped((a - b).to_radians()).to_degrees().abs()
}

#[cfg(test)]
mod tests {
    use bowwave_core::world::scenario::BUILT_IN;
    use hw_sim::{live, panorama::PanoramaRecipe};

    use super::*;

    fn built_in(name: &str) -> Scenario {
        let (_, text) = BUILT_IN.into_iter().find(|(known, _)| *known == name).unwrap();
        Scenario::parse(text, name).unwrap()
    }

    #[test]
    fn a_sea_of_its_own_contradicts_no_scenario_and_that_of_another_does() {
        let properties = |name: &str| {
            let recipe = PanoramaRecipe::of_scenario(&built_in(name), (320, 180));
            live::properties(&recipe, &live::calibration(&recipe), "nobody")
        };
        for (name, _) in BUILT_IN {
            let found = contradictions(&built_in(name), &properties(name), 1e6);
            assert!(found.is_empty(), "{name}: {found:?}");
        }
        let found = contradictions(&built_in("rough-water"), &properties("first-target"), 20.0).join("; ");
        for words in ["Beaufort", "the sun stands", "this run ends after 20.0 s"] {
            assert!(found.contains(words), "{words}: {found}");
        }
        let night = contradictions(&built_in("night-intruder"), &properties("first-target"), 1e6).join("; ");
        assert!(night.contains("the sun stands at 150 degrees and 45 high"), "{night}");
        let mut other = built_in("first-target");
        other.eye_height_m *= 1.5;
        other.daylight.visibility_m *= 0.2;
        let found = contradictions(&other, &properties("first-target"), 1e6).join("; ");
        assert!(found.contains("visibility") && found.contains("eye"), "{found}");
    }
}
