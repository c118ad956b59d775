//! The moon's direction and phase from place and time.

use std::f64::consts::TAU;

use anyhow::{Context as _, Result};
use bowwave_core::{
    ephemeris::{Moment, Place, Utc},
    geometry::towards,
};
use glam::DVec3;

use super::About;
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "moon",
    what: "Says where the moon stands and how much of it is lit, from place and time: by night it lights boats and throws their shadows.",
    truth: "400 sightings by libastro (XEphem), years 1990 to 2049, latitudes to 89.9 degrees, refraction included; no code is shared",
    rivals: "the short series of the Astronomical Almanac, page D22, with and without the observer's place on the Earth; for the phase, \
             the age by the mean month",
    why: "two minutes of arc are a fifteenth of its disc, and it is asked twice a minute",
};

/// A place, a time, and the moon.
struct Sighting {
    at: Moment,
    towards: DVec3,
    elevation_deg: f64,
    lit: f64,
}

impl Sighting {
    /// From a line of the table; nothing for a line of another kind.
    fn of(line: &str) -> Option<Self> {
        let cells: Vec<&str> = line.split(',').collect();
        let [stamp, latitude, longitude, azimuth, elevation, lit] = cells[..] else { return None };
        let number = |text: &str| text.parse::<f64>().ok();
        let part = |from: usize, to: usize| stamp.get(from..to)?.parse::<u8>().ok();
        let of_day =
            f64::from(part(11, 13)?) * 3600.0 + f64::from(part(14, 16)?) * 60.0 + number(stamp.get(17..)?)?;
        let utc = Utc::of_day(stamp.get(..4)?.parse().ok()?, part(5, 7)?, part(8, 10)?, of_day)?;
        let place = Place::new(number(latitude)?, number(longitude)?)?;
        let elevation_deg = number(elevation)?;
        let towards = towards(number(azimuth)?.to_radians(), elevation_deg.to_radians());
        Some(Self { at: Moment { place, utc }, towards, elevation_deg, lit: number(lit)? })
    }

    /// Days since noon of the first of January 2000.
    fn days(&self) -> f64 {
        self.at.utc.ms() as f64 / 86_400_000.0 - 10_957.5
    }

    /// Sines and cosines of the sidereal time and of the latitude.
    fn turned(&self) -> ((f64, f64), (f64, f64)) {
        let sidereal = 280.46062 + 360.985_647_37 * self.days() + self.at.place.longitude_deg();
        (sidereal.to_radians().sin_cos(), self.at.place.latitude_deg().to_radians().sin_cos())
    }
}

fn product(at: &Sighting) -> Option<DVec3> {
    at.at.moon().map(|moon| moon.direction)
}

/// The Almanac's series: the moon from the Earth's centre, equatorial, in radii of the Earth.
fn series(at: &Sighting) -> DVec3 {
    let centuries = at.days() / 36_525.0;
    let of = |from: f64, a_century: f64| (from + a_century * centuries).to_radians();
    let (anomaly, evection) = (of(135.0, 477_198.87), of(259.3, -413_335.36));
    let (variation, second) = (of(235.7, 890_534.22), of(269.9, 954_397.74));
    let longitude = of(218.32, 481_267.881)
        + (6.29 * anomaly.sin() - 1.27 * evection.sin() + 0.66 * variation.sin() + 0.21 * second.sin()
            - 0.19 * of(357.5, 35_999.05).sin()
            - 0.11 * of(186.5, 966_404.03).sin())
        .to_radians();
    let latitude = (5.13 * of(93.3, 483_202.02).sin() + 0.28 * of(228.2, 960_400.89).sin()
        - 0.28 * of(318.3, 6_003.15).sin()
        - 0.17 * of(217.6, -407_332.21).sin())
    .to_radians();
    let parallax = 0.9508
        + 0.0518 * anomaly.cos()
        + 0.0095 * evection.cos()
        + 0.0078 * variation.cos()
        + 0.0028 * second.cos();
    let (up, flat) = latitude.sin_cos();
    let (along, across) = (flat * longitude.cos(), flat * longitude.sin());
    DVec3::new(along, 0.9175 * across - 0.3978 * up, 0.3978 * across + 0.9175 * up)
        / parallax.to_radians().sin()
}

/// What is in that equatorial direction, as it is seen from the place, lifted by standard air (Saemundsson 1986).
fn seen(at: &Sighting, equatorial: DVec3) -> DVec3 {
    let ((east, north), (up, level)) = at.turned();
    let DVec3 { x, y, z } = equatorial.normalize();
    let flat = x * north + y * east;
    let there = DVec3::new(y * north - x * east, z * level - flat * up, z * up + flat * level);
    let elevation_deg = there.z.clamp(-1.0, 1.0).asin().to_degrees();
    let lift_deg = 1.02 / (elevation_deg + 10.3 / (elevation_deg.max(-1.0) + 5.11)).to_radians().tan() / 60.0;
    let azimuth = there.x.atan2(there.y);
    towards(azimuth, (elevation_deg + lift_deg.clamp(0.0, 1.0)).to_radians())
}

fn almanac(at: &Sighting) -> Option<DVec3> {
    let ((sin, cos), (up, level)) = at.turned();
    Some(seen(at, series(at) - DVec3::new(level * cos, level * sin, up)))
}

fn from_the_centre(at: &Sighting) -> Option<DVec3> {
    Some(seen(at, series(at)))
}

/// Share that is lit by the product.
fn lit(at: &Sighting) -> Option<f64> {
    at.at.moon().map(|moon| moon.lit)
}

/// Share that is lit by the age since a new moon, with the mean month.
fn mean_month(at: &Sighting) -> Option<f64> {
    let age = (at.days() - 5.597_66) / 29.530_588_9;
    Some(0.5 - 0.5 * (TAU * age).cos())
}

/// A way, whether it is the product's, and what it makes of a sighting.
type MoonWay<T> = (&'static str, bool, fn(&Sighting) -> Option<T>);

const WAYS: [MoonWay<DVec3>; 3] = [
    ("short ELP-2000/82, skymath", true, product),
    ("Almanac's short series", false, almanac),
    ("the same from the Earth's centre", false, from_the_centre),
];

const PHASES: [MoonWay<f64>; 2] = [("elongation, skymath", true, lit), ("mean month", false, mean_month)];

/// Largest error, degrees; NaN counts as the opposite direction.
fn largest(way: fn(&Sighting) -> Option<DVec3>, sightings: &[&Sighting]) -> f64 {
    let error = |at: &&Sighting| {
        let found = way(at).filter(|d| d.is_finite()).unwrap_or(-at.towards);
        found.angle_between(at.towards).to_degrees()
    };
    sightings.iter().map(error).fold(0.0, f64::max)
}

fn largest_share(way: fn(&Sighting) -> Option<f64>, sightings: &[&Sighting]) -> f64 {
    sightings.iter().map(|at| (way(at).unwrap_or(2.0) - at.lit).abs()).fold(0.0, f64::max)
}

fn points() -> Vec<Sighting> {
    include_str!("../../data/moon_libastro_points.csv").lines().filter_map(Sighting::of).collect()
}

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    const ASKED: &str = "asked twice a minute: its time does not count";
    let points = points();
    let all: Vec<&Sighting> = points.iter().collect();
    let first = all.first().context("no sighting")?;
    let ways = WAYS.iter().map(|(name, default, way)| {
        let timed = Way::new(name, "largest error", largest(*way, &all), 1, move || way(first));
        if *default { timed.default_although(ASKED) } else { timed }
    });
    bench.scene(&format!("libastro's sightings, {}", all.len()), "deg", 0.0, ways.collect());
    let phases = PHASES.iter().map(|(name, default, way)| {
        let timed = Way::new(name, "largest error", largest_share(*way, &all), 1, move || way(first));
        if *default { timed.default_although(ASKED) } else { timed }
    });
    bench.scene("share that is lit", "of the disc", 0.0, phases.collect());
    let of =
        |wanted: fn(&Sighting) -> bool| -> Vec<&Sighting> { points.iter().filter(|at| wanted(at)).collect() };
    for (case, sightings) in [
        ("below 5 deg", of(|at| at.elevation_deg < 5.0)),
        ("above 75 deg", of(|at| at.elevation_deg > 75.0)),
        ("beyond the polar circles", of(|at| at.at.place.latitude_deg().abs() > 66.0)),
    ] {
        let tried = WAYS.iter().map(|(name, default, way)| ExtremeResult {
            default: *default,
            ..ExtremeResult::rival(name, "largest error", largest(*way, &sightings))
        });
        bench.extreme(&format!("{case}, {} sightings", sightings.len()), "deg", tried.collect());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_product_is_within_two_minutes_and_rivals_within_what_they_are_known_for() {
        let points = points();
        assert!(points.len() >= 400, "{}", points.len());
        let all: Vec<&Sighting> = points.iter().collect();
        let error = |n: usize| largest(WAYS[n].2, &all);
        assert!(error(0) < 2.0 / 60.0, "{}", error(0));
        assert!(error(1) < 0.5 && (0.5..1.5).contains(&error(2)), "{} {}", error(1), error(2));
        assert!(largest_share(lit, &all) < 0.005 && largest_share(mean_month, &all) < 0.15);
    }
}
