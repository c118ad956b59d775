//! The sun's direction from place and time.

use std::f64::consts::{PI, TAU};

use anyhow::{Context as _, Result};
use bowwave_core::geometry::towards as direction;
use glam::DVec3;
use solar_positioning::{Location, RefractionCorrection, SolarPositions, time::JulianDate};

use super::About;
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "sun",
    what: "Says where the sun stands, from place and time.",
    truth: "512 directions from NREL's own program (spa.c, Reda and Andreas 2004), years 1910 to 2014, latitudes to both poles, refraction included; \
            and the example of its report",
    rivals: "Grena's third algorithm (2012), PSA (Blanco-Muriel 2001), both without refraction where they have none; equations 1 to 4 of Kolivand and \
             Sunar 2014 as printed, and mended: (J - 80) and (J - 81) as in their source, the azimuth in its quadrant, integer days",
    why: "it is asked once a scenario: 4 us buy an error of nothing",
};

/// A place, a moment, and the sun.
struct Sighting {
    place: Location,
    /// Year, month, day, hour, minute.
    utc: (i32, u32, u32, u32, u32),
    second: f64,
    towards: DVec3,
    elevation_deg: f64,
}

impl Sighting {
    /// From a line of NREL's points; nothing for a line of another kind.
    fn of(line: &str) -> Option<Self> {
        let cells: Vec<&str> = line.split(',').collect();
        let [stamp, latitude, longitude, azimuth, zenith] = cells.get(..5)? else { return None };
        let number = |text: &str| text.parse::<f64>().ok();
        let part = |from: usize, to: usize| stamp.get(from..to)?.parse::<u32>().ok();
        let place = Location { latitude: number(latitude)?, longitude: number(longitude)? };
        let utc = (part(0, 4)? as i32, part(5, 7)?, part(8, 10)?, part(11, 13)?, part(14, 16)?);
        let elevation_deg = 90.0 - number(zenith)?;
        let towards = direction(number(azimuth)?.to_radians(), elevation_deg.to_radians());
        Some(Self { place, utc, second: f64::from(part(17, 19)?), towards, elevation_deg })
    }

    /// NREL's points have no difference between clock and Earth's turn.
    fn julian(&self) -> Option<JulianDate> {
        let (year, month, day, hour, minute) = self.utc;
        JulianDate::from_utc(year, month, day, hour, minute, self.second, 0.0).ok()
    }

    fn hours(&self) -> f64 {
        f64::from(self.utc.3) + f64::from(self.utc.4) / 60.0 + self.second / 3600.0
    }

    /// Days since the year began, from 1 on.
    fn day_of_year(&self) -> Option<f64> {
        let first = JulianDate::from_utc(self.utc.0, 1, 1, 0, 0, 0.0, 0.0).ok()?;
        Some((self.julian()?.julian_date() - first.julian_date()).floor() + 1.0)
    }
}

fn by_library(positions: &SolarPositions, at: &Sighting) -> Option<DVec3> {
    let refraction = RefractionCorrection::new(1000.0, 10.0).ok();
    let position = positions.at_from_julian(at.julian()?, at.place, 0.0, refraction).ok()?;
    Some(direction(position.azimuth().to_radians(), position.elevation_angle().to_radians()))
}

fn spa(at: &Sighting) -> Option<DVec3> {
    by_library(&SolarPositions::new(), at)
}

fn grena(at: &Sighting) -> Option<DVec3> {
    by_library(&SolarPositions::grena3(), at)
}

/// Blanco-Muriel, Alarcon-Padilla, Lopez-Moratalla and Lara-Coira 2001, "Computing the solar vector".
fn psa(at: &Sighting) -> Option<DVec3> {
    let days = at.julian()?.julian_date() - 2_451_545.0;
    let omega = 2.1429 - 0.001_039_459_4 * days;
    let longitude = 4.895_063_0 + 0.017_202_791_698 * days;
    let anomaly = 6.240_060_0 + 0.017_201_969_9 * days;
    let ecliptic = longitude + 0.033_416_07 * anomaly.sin() + 0.000_348_94 * (2.0 * anomaly).sin()
        - 0.000_113_4
        - 0.000_020_3 * omega.sin();
    let tilt = 0.409_092_8 - 6.214_0e-9 * days + 0.000_039_6 * omega.cos();
    let ascension = (tilt.cos() * ecliptic.sin()).atan2(ecliptic.cos());
    let declination = (tilt.sin() * ecliptic.sin()).asin();
    let sidereal_h = 6.697_424_324_2 + 0.065_709_828_3 * days + at.hours();
    let hour_angle = (sidereal_h * 15.0 + at.place.longitude).to_radians() - ascension;
    let towards = of_hour_angle(at.place.latitude.to_radians(), declination, hour_angle);
    let zenith = towards.z.clamp(-1.0, 1.0).acos();
    let parallax = 6371.01 / 149_597_890.0 * zenith.sin();
    Some(direction(towards.x.atan2(towards.y), 0.5 * PI - zenith - parallax))
}

/// Direction by declination and hour angle, radians; the angle is zero at noon and grows westwards.
fn of_hour_angle(latitude: f64, declination: f64, hour_angle: f64) -> DVec3 {
    let (sin, cos) = latitude.sin_cos();
    DVec3::new(
        -declination.cos() * hour_angle.sin(),
        declination.sin() * cos - declination.cos() * sin * hour_angle.cos(),
        declination.sin() * sin + declination.cos() * cos * hour_angle.cos(),
    )
}

/// Solar time in hours and declination in radians by Kolivand and Sunar's equations 1 and 2, with the days that they take from the date.
fn solar_time(at: &Sighting, [of_time, of_declination]: [f64; 2]) -> Option<(f64, f64)> {
    let day = at.day_of_year()?;
    // The standard meridian of UTC is Greenwich's; longitudes grow westwards in equation 1.
    let longitude = -at.place.longitude.to_radians();
    let time = at.hours() + 0.170 * (2.0 * TAU * (day - of_time) / 373.0).sin()
        - 0.129 * (TAU * (day - 8.0) / 355.0).sin()
        - 12.0 * longitude / PI;
    Some((time, 0.4093 * (TAU * (day - of_declination) / 368.0).sin()))
}

/// As printed: equations 3 and 4 with their arctangent of one argument, from south, growing westwards.
fn printed(at: &Sighting) -> Option<DVec3> {
    let (time, declination) = solar_time(at, [180.0, 8.0])?;
    let (sin, cos) = at.place.latitude.to_radians().sin_cos();
    let turn = PI * time / 12.0;
    let elevation = (sin * declination.sin() - cos * declination.cos() * turn.cos()).asin();
    let down = cos * declination.sin() - sin * declination.cos() * turn.cos();
    let azimuth = (-declination.cos() * turn.sin() / down).atan();
    Some(direction(PI + azimuth, elevation))
}

fn mended(at: &Sighting) -> Option<DVec3> {
    let (time, declination) = solar_time(at, [80.0, 81.0])?;
    Some(of_hour_angle(at.place.latitude.to_radians(), declination, PI * time / 12.0 - PI))
}

/// A way, whether it is the product's, and what it makes of a moment.
type SunWay = (&'static str, bool, fn(&Sighting) -> Option<DVec3>);

const WAYS: [SunWay; 5] = [
    ("SPA, solar-positioning", true, spa),
    ("Grena 3, solar-positioning", false, grena),
    ("PSA", false, psa),
    ("Kolivand eq. 1-4, mended", false, mended),
    ("Kolivand eq. 1-4, as printed", false, printed),
];

/// Largest error, degrees; one that is no number is as far as it can be.
fn largest(way: fn(&Sighting) -> Option<DVec3>, sightings: &[&Sighting]) -> f64 {
    let error = |at: &&Sighting| {
        let found = way(at).unwrap_or(-at.towards);
        let error = found.angle_between(at.towards).to_degrees();
        if error.is_finite() { error } else { 180.0 }
    };
    sightings.iter().map(error).fold(0.0, f64::max)
}

fn points() -> Vec<Sighting> {
    include_str!("../../data/sun_nrel_spa_c_points.csv").lines().filter_map(Sighting::of).collect()
}

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let points = points();
    let up: Vec<&Sighting> = points.iter().filter(|p| p.elevation_deg > 0.0).collect();
    let first = up.first().context("no point has the sun up")?;
    let ways = WAYS.iter().map(|(name, default, way)| {
        let timed = Way::new(name, "largest error", largest(*way, &up), 1, move || way(first));
        if *default {
            timed.default_although("asked once a scenario: its time does not count")
        } else {
            timed
        }
    });
    bench.scene(&format!("NREL's points, sun up, {}", up.len()), "deg", 0.0, ways.collect());
    let low: Vec<&Sighting> = points.iter().filter(|p| p.elevation_deg <= 0.0).collect();
    let polar: Vec<&Sighting> = points.iter().filter(|p| p.place.latitude.abs() > 66.0).collect();
    let steep: Vec<&Sighting> = points.iter().filter(|p| p.elevation_deg > 80.0).collect();
    for (case, sightings) in
        [("sun down", low), ("beyond the polar circles", polar), ("sun above 80 deg", steep)]
    {
        let tried = WAYS.iter().map(|(name, default, way)| ExtremeResult {
            default: *default,
            ..ExtremeResult::rival(name, "largest error", largest(*way, &sightings))
        });
        bench.extreme(&format!("{case}, {} points", sightings.len()), "deg", tried.collect());
    }
    // The example of NREL's report: Golden, 17 October 2003, 12:30:30 local time, 1830 m, 820 mbar, 11 C, delta T 67 s.
    let refraction = RefractionCorrection::new(820.0, 11.0)?;
    let place = Location { latitude: 39.742_476, longitude: -105.178_6 };
    let moment = JulianDate::from_utc(2003, 10, 17, 19, 30, 30.0, 67.0)?;
    let found = SolarPositions::new().at_from_julian(moment, place, 1830.14, Some(refraction))?;
    let expected = direction(194.340_24_f64.to_radians(), (90.0 - 50.111_62_f64).to_radians());
    let found = direction(found.azimuth().to_radians(), found.elevation_angle().to_radians());
    let error = found.angle_between(expected).to_degrees();
    bench.extreme("example of NREL's report", "deg", vec![ExtremeResult::product(WAYS[0].0, "", error)]);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_product_is_nrels_and_the_rivals_are_what_they_are_known_for() {
        let points = points();
        assert!(points.len() > 500, "{}", points.len());
        let up: Vec<&Sighting> = points.iter().filter(|p| p.elevation_deg > 0.0).collect();
        let error = |n: usize| largest(WAYS[n].2, &up);
        assert!(error(0) < 0.0005, "SPA: {}", error(0));
        assert!(error(3) < 1.5 && error(4) > 10.0, "mended {}, printed {}", error(3), error(4));
    }
}
