//! Another time of day for a scenario: its text with another sun.

use serde::Deserialize;
use toml_edit::{DocumentMut, Item, Table, value};

/// A time of day.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum DayTime {
    /// The sun that the scenario says.
    #[default]
    Written,
    /// High sun.
    Day,
    /// The sun a little below the horizon.
    Dusk,
    /// No light of the sun.
    Night,
}

impl DayTime {
    /// Elevation of the sun, degrees.
    fn elevation_deg(self) -> Option<f64> {
        match self {
            Self::Written => None,
            Self::Day => Some(35.0),
            Self::Dusk => Some(-4.0),
            Self::Night => Some(-20.0),
        }
    }
}

/// Sun where a scenario says none, degrees: to the south-west.
const AZIMUTH_DEG: f64 = 215.0;

/// The text with the sun of that time of day, and in words what was changed. Comments stay.
///
/// # Errors
/// In words, where the text is no TOML, or its light follows from a place and a time.
pub(crate) fn at(text: &str, time: DayTime) -> Result<(String, Option<String>), String> {
    let Some(elevation_deg) = time.elevation_deg() else { return Ok((text.to_owned(), None)) };
    let mut document: DocumentMut = text
        .parse()
        .map_err(|e: toml_edit::TomlError| format!("the scenario is no TOML: {}", e.message()))?;
    let light = document.entry("light").or_insert_with(|| Item::Table(Table::new()));
    let light = light.as_table_like_mut().ok_or("light is no table in the scenario")?;
    if let Some(key) =
        ["latitude_deg", "longitude_deg", "utc"].into_iter().find(|key| light.contains_key(key))
    {
        return Err(format!(
            "the scenario's light follows from place and time (light.{key}): start it as written, or change the time in its text"
        ));
    }
    let azimuth_deg = light.get("sun_azimuth_deg").and_then(number).unwrap_or(AZIMUTH_DEG);
    let before = light.get("sun_elevation_deg").and_then(number);
    set(light, "sun_azimuth_deg", value(azimuth_deg));
    set(light, "sun_elevation_deg", value(elevation_deg));
    let was = before.map_or_else(String::new, |before| format!(", not {before}"));
    let mut words = format!("the sun stands at {elevation_deg} degrees{was}, bearing {azimuth_deg}");
    if light.get("source").and_then(Item::as_str) == Some("ship") {
        set(light, "source", value("scenario"));
        words += "; the light no longer follows the ship's place and time";
    }
    Ok((document.to_string(), Some(words)))
}

fn number(item: &Item) -> Option<f64> {
    item.as_float().or_else(|| item.as_integer().map(|whole| whole as f64))
}

/// Sets a key and keeps the comment behind it.
fn set(table: &mut dyn toml_edit::TableLike, key: &str, mut new: Item) {
    if let (Some(old), Some(new)) = (table.get(key).and_then(Item::as_value), new.as_value_mut()) {
        *new.decor_mut() = old.decor().clone();
    }
    table.insert(key, new);
}

#[cfg(test)]
mod tests {
    use bowwave_core::world::scenario::{BUILT_IN, Scenario};
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_scenario_gets_another_sun_and_keeps_its_comments() {
        let text = "# first\nname = \"a\"\n[light] # of the sun\nsun_elevation_deg = 12 # low\nsource = \"ship\"\n\n# boats\n";
        let (night, words) = at(text, DayTime::Night).unwrap();
        let words = words.unwrap();
        assert!(words.contains("-20 degrees, not 12") && words.contains("no longer follows"), "{words}");
        for kept in
            ["# first", "# of the sun", "sun_elevation_deg = -20.0 # low", "source = \"scenario\"", "# boats"]
        {
            assert!(night.contains(kept), "{kept} in {night}");
        }
        assert!(Scenario::parse(&night, "x").unwrap().daylight.sun_direction.z < 0.0);
        assert_eq!(at(text, DayTime::Written).unwrap(), (text.to_owned(), None));
        assert!(at("[light]\nlatitude_deg = 1", DayTime::Dusk).unwrap_err().contains("latitude_deg"));
        assert!(at("light = 3", DayTime::Dusk).is_err() && at("a = ", DayTime::Dusk).is_err());
        let (inline, _) = at("light = { source = \"ship\" }", DayTime::Day).unwrap();
        assert!(Scenario::parse(&inline, "x").is_ok(), "{inline}");
    }

    #[test]
    fn built_in_scenarios_can_be_played_at_night_or_say_why_not() {
        for (name, text) in BUILT_IN {
            match at(text, DayTime::Night) {
                Ok((night, _)) => {
                    let scenario = Scenario::parse(&night, name).unwrap();
                    assert!(
                        scenario.daylight.sun_direction.z < 0.0 && !scenario.daylight.from_ship,
                        "{name}"
                    );
                }
                Err(why) => assert!(text.contains("utc") && why.contains("place and time"), "{name}: {why}"),
            }
        }
    }

    proptest! {
        #[test]
        fn any_text_is_changed_or_refused(text in "(\\[?light\\]?|\n|=|[a-z_]{1,6}|\\.|\\{|\\}|1|\"|#){0,30}") {
            let _ = at(&text, DayTime::Dusk);
        }
    }
}
