//! Where the sun stands: given outright, or from place and time.

use glam::DVec3;
use solar_positioning::{Location, RefractionCorrection, SolarPositions, delta_t, time::JulianDate};
use toml::value::{Datetime, Offset};

use super::{
    keys::{LightKeys, angle},
    spec::place,
};
use crate::text::toml::{TomlError, TomlSection, date_and_time, number};

/// Sun where the text names none: high enough for plain light, to the south-west.
const DEFAULT_DEG: (f64, f64) = (215.0, 35.0);

/// Unit vector towards the sun.
pub(super) fn direction(section: &TomlSection<'_>, keys: &LightKeys) -> Result<DVec3, TomlError> {
    let text = section.text;
    let quarter = || number(-90.0..=90.0, "degrees");
    let azimuth = text.given(&keys.sun_azimuth_deg, angle())?;
    let elevation = text.given(&keys.sun_elevation_deg, quarter())?;
    let latitude = text.given(&keys.latitude_deg, quarter())?;
    let longitude = text.given(&keys.longitude_deg, number(-180.0..=180.0, "degrees"))?;
    let utc = text.given(&keys.utc, date_and_time())?;
    if let (None, None, None) = (latitude, longitude, utc) {
        let azimuth = azimuth.unwrap_or(DEFAULT_DEG.0);
        return Ok(towards(azimuth, elevation.unwrap_or(DEFAULT_DEG.1)));
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
    at(Location { latitude, longitude }, &utc).map_err(|problem| text.error(value, problem))
}

/// Unit vector towards the sun as it is seen (refraction included) from a place at sea level: NREL's SPA.
fn at(location: Location, utc: &Datetime) -> Result<DVec3, String> {
    let (Some(date), Some(time), Some(Offset::Z)) = (utc.date, utc.time, utc.offset) else {
        return Err(format!("{utc} is not allowed; give date and time in UTC, like 2026-06-01T12:00:00Z"));
    };
    let (year, month) = (i32::from(date.year), u32::from(date.month));
    let second = f64::from(time.second.unwrap_or(0)) + f64::from(time.nanosecond.unwrap_or(0)) * 1e-9;
    let (hour, minute) = (u32::from(time.hour), u32::from(time.minute));
    let position = delta_t::estimate_from_date(year, month)
        .and_then(|delta| JulianDate::from_utc(year, month, u32::from(date.day), hour, minute, second, delta))
        .and_then(|julian| {
            let refraction = Some(RefractionCorrection::standard());
            SolarPositions::new().at_from_julian(julian, location, 0.0, refraction)
        })
        .map_err(|e| format!("{utc} is not allowed; give a time of the years 0 to 3000 ({e})"))?;
    Ok(towards(position.azimuth(), position.elevation_angle()))
}

fn towards(azimuth_deg: f64, elevation_deg: f64) -> DVec3 {
    let (azimuth, elevation) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
    place(azimuth, elevation.cos()).extend(elevation.sin())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sun_stands_where_the_reference_puts_it() {
        let lines: Vec<&str> = include_str!("../../../data/sun_spa_points.csv").lines().skip(2).collect();
        assert!(lines.len() > 40, "{} rows", lines.len());
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |i: usize| cells[i].parse::<f64>().expect("a number");
            let utc = format!("{}Z", cells[0].replace(' ', "T")).parse().expect("a time");
            let sun = at(Location { latitude: number(1), longitude: number(2) }, &utc).expect("in range");
            // Below the horizon the two differ in how far they go on with refraction.
            let elevation = if number(3) > 0.0 { number(4) } else { number(3) };
            let expected = towards(number(5), elevation);
            let error = sun.angle_between(expected).to_degrees();
            // The reference refracts in air of 12 C, the standard correction in another: low suns differ by 0.003 degrees.
            let allowed = if number(3) > 0.0 { 0.005 } else { 0.7 };
            assert!(error < allowed, "{line}: {error} deg");
        }
    }
}
