//! The sun's direction: given outright, from place and time, or as the ship's instruments tell.

use glam::DVec3;
use toml::value::{Datetime, Offset};

use super::keys::{LightKeys, angle};
use crate::{
    ephemeris::{Moment, Place, Utc},
    geometry::towards,
    text::toml::{TomlError, TomlSection, date_and_time, number},
};

/// Sun where the text names none: high enough for plain light, to the south-west.
const DEFAULT_DEG: (f64, f64) = (215.0, 35.0);

/// The sun as the run begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SunGiven {
    /// Unit vector towards it, world.
    pub(super) direction: DVec3,
    /// Place and time that it follows from.
    pub(super) moment: Option<Moment>,
    /// The text says something of it.
    pub(super) named: bool,
}

/// The sun of a table `[light]`.
pub(super) fn given(section: &TomlSection<'_>, keys: &LightKeys) -> Result<SunGiven, TomlError> {
    let text = section.text;
    let quarter = || number(-90.0..=90.0, "degrees");
    let azimuth = text.given(&keys.sun_azimuth_deg, angle())?;
    let elevation = text.given(&keys.sun_elevation_deg, quarter())?;
    let latitude = text.given(&keys.latitude_deg, quarter())?;
    let longitude = text.given(&keys.longitude_deg, number(-180.0..=180.0, "degrees"))?;
    let utc = text.given(&keys.utc, date_and_time())?;
    if let (None, None, None) = (latitude, longitude, utc) {
        let named = azimuth.is_some() || elevation.is_some();
        let (azimuth, elevation) = (azimuth.unwrap_or(DEFAULT_DEG.0), elevation.unwrap_or(DEFAULT_DEG.1));
        let direction = towards(azimuth.to_radians(), elevation.to_radians());
        return Ok(SunGiven { direction, moment: None, named });
    }
    if let Some(value) = keys.sun_azimuth_deg.as_ref().or(keys.sun_elevation_deg.as_ref()) {
        return Err(
            text.error(value, "follows from latitude_deg, longitude_deg and utc; leave out it or them")
        );
    }
    let together = "all of latitude_deg, longitude_deg and utc, or none";
    let latitude = latitude.ok_or_else(|| section.missing("latitude_deg", together))?;
    let longitude = longitude.ok_or_else(|| section.missing("longitude_deg", together))?;
    let (Some(utc), Some(value)) = (utc, &keys.utc) else { return Err(section.missing("utc", together)) };
    let place = Place::new(latitude, longitude)
        .ok_or_else(|| section.missing("latitude_deg", "a latitude of -90 to 90 and a longitude"))?;
    let utc = instant(&utc).map_err(|problem| text.error(value, problem))?;
    let moment = Moment { place, utc };
    let direction = moment.sun().ok_or_else(|| text.error(value, "is a time for which no sun is known"))?;
    Ok(SunGiven { direction, moment: Some(moment), named: true })
}

/// The time that a text gives.
fn instant(utc: &Datetime) -> Result<Utc, String> {
    let (Some(date), Some(time), Some(Offset::Z)) = (utc.date, utc.time, utc.offset) else {
        return Err(format!("{utc} is not allowed; give date and time in UTC, like 2026-06-01T12:00:00Z"));
    };
    let second = f64::from(time.second.unwrap_or(0)) + f64::from(time.nanosecond.unwrap_or(0)) * 1e-9;
    let of_day = f64::from(time.hour) * 3600.0 + f64::from(time.minute) * 60.0 + second;
    Utc::of_day(i32::from(date.year), date.month, date.day, of_day)
        .ok_or_else(|| format!("{utc} is not allowed; give a time of the years 0 to 2999"))
}
