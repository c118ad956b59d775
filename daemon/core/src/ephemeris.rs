//! Sun and moon as they are seen from a place on the sea at a time.
//!
//! The sun by NREL's SPA (Reda and Andreas 2004), within .0003 degrees; the moon by a short form of ELP-2000/82 (Meeus 1998, chapters 40, 47
//! and 48), within two minutes of arc, and its light by Krisciunas and Schaefer 1991. Both are refracted as in standard air.

use std::fmt;

use glam::DVec3;
use skymath::Angle;
use solar_positioning::{RefractionCorrection, SolarPositions, delta_t, time::JulianDate};
use time::{Date, Month, OffsetDateTime, Time, UtcOffset};

use crate::geometry::towards;

/// A place at sea level, WGS 84.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    latitude_deg: f64,
    longitude_deg: f64,
}

impl Place {
    /// Degrees north and east; `None` beyond 90 or 180 either way, or for NaN.
    pub fn new(latitude_deg: f64, longitude_deg: f64) -> Option<Self> {
        let fits = latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0;
        fits.then_some(Self { latitude_deg, longitude_deg })
    }

    /// Degrees north.
    pub const fn latitude_deg(self) -> f64 {
        self.latitude_deg
    }

    /// Degrees east.
    pub const fn longitude_deg(self) -> f64 {
        self.longitude_deg
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let half = |degrees: f64, [positive, negative]: [char; 2]| {
            if degrees < 0.0 { negative } else { positive }
        };
        let (latitude, longitude) = (self.latitude_deg, self.longitude_deg);
        let (north, east) = (half(latitude, ['N', 'S']), half(longitude, ['E', 'W']));
        write!(f, "{:.3} {north} {:.3} {east}", latitude.abs(), longitude.abs())
    }
}

/// A time of the years 0 to 2999, UTC, whole milliseconds since 1970.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Utc(i64);

impl Utc {
    /// From milliseconds since the beginning of 1970; `None` outside the years 0 to 2999.
    pub fn from_ms(ms: i64) -> Option<Self> {
        (0..=2999).contains(&Self::of_unix(ms)?.year()).then_some(Self(ms))
    }

    /// From a date and seconds of its day, up to the end of a leap second.
    pub fn of_day(year: i32, month: u8, day: u8, second: f64) -> Option<Self> {
        let date = Date::from_calendar_date(year, Month::try_from(month).ok()?, day).ok()?;
        let midnight = date.with_time(Time::MIDNIGHT).assume_offset(UtcOffset::UTC).unix_timestamp();
        let within = (0.0..86_401.0).contains(&second);
        within.then(|| Self::from_ms(midnight * 1000 + (second * 1000.0).round() as i64)).flatten()
    }

    /// Milliseconds since the beginning of 1970.
    pub const fn ms(self) -> i64 {
        self.0
    }

    /// So many seconds later; `None` outside the years 0 to 2999.
    pub fn plus_secs(self, seconds: f64) -> Option<Self> {
        self.0.checked_add((seconds * 1000.0).round() as i64).and_then(Self::from_ms)
    }

    /// Year, month, day, and seconds of the day.
    pub fn day(self) -> (i32, u8, u8, f64) {
        let date = self.date();
        let of_day = f64::from(self.0.rem_euclid(86_400_000) as i32) / 1000.0;
        (date.year(), u8::from(date.month()), date.day(), of_day)
    }

    fn date(self) -> OffsetDateTime {
        // What was made by `from_ms` is within its years.
        Self::of_unix(self.0).unwrap_or(OffsetDateTime::UNIX_EPOCH)
    }

    fn of_unix(ms: i64) -> Option<OffsetDateTime> {
        OffsetDateTime::from_unix_timestamp_nanos(i128::from(ms) * 1_000_000).ok()
    }
}

impl fmt::Display for Utc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (date, month) = (self.date(), u8::from(self.date().month()));
        let (hour, minute) = (date.hour(), date.minute());
        write!(f, "{:04}-{month:02}-{:02} {hour:02}:{minute:02} UTC", date.year(), date.day())
    }
}

/// A place and a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// The place.
    pub place: Place,
    /// The time.
    pub utc: Utc,
}

/// The moon as it is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moon {
    /// Unit vector towards it, x east, y north, z up.
    pub direction: DVec3,
    /// Share of its disc that the sun lights, 0 to 1.
    pub lit: f64,
    /// Its irradiance above the air over that of the sun.
    pub irradiance: f64,
}

impl Moment {
    /// Unit vector towards the sun, x east, y north, z up. `None` where its library refuses the date.
    pub fn sun(self) -> Option<DVec3> {
        let date = self.utc.date();
        let delta_s = delta_t::estimate_from_date(date.year(), u32::from(u8::from(date.month()))).ok()?;
        let julian = 2_440_587.5 + self.utc.0 as f64 / 86_400_000.0;
        let place = solar_positioning::Location {
            latitude: self.place.latitude_deg,
            longitude: self.place.longitude_deg,
        };
        let at = JulianDate::new(julian, delta_s).ok()?;
        let refraction = Some(RefractionCorrection::standard());
        let seen = SolarPositions::new().at_from_julian(at, place, 0.0, refraction).ok()?;
        Some(towards(seen.azimuth().to_radians(), seen.elevation_angle().to_radians()))
    }

    /// The moon. `None` where its library refuses the date.
    pub fn moon(self) -> Option<Moon> {
        /// Kilometres, of the mean distance that its brightness is stated for.
        const MEAN_KM: f64 = 384_400.0;
        /// Visual magnitude of the sun above the air.
        const SUN: f64 = -26.74;
        let date = self.utc.date();
        let degrees = Angle::from_degrees;
        let (latitude, longitude) = (degrees(self.place.latitude_deg), degrees(self.place.longitude_deg));
        let site = skymath::Location::new(latitude, longitude, 0.0).ok()?;
        let moon = skymath::moon_position_topocentric(date, &site);
        // Without azimuth and elevation, which say nothing at a pole or in the zenith.
        let hour = (skymath::lst(date, longitude) - moon.ra()).radians();
        let direction = of_hour_angle(latitude.radians(), moon.dec().radians(), hour);
        let phase_deg = skymath::moon_phase_angle(date).degrees().abs();
        let magnitude = -12.73 + 0.026 * phase_deg + 4e-9 * phase_deg.powi(4);
        let nearer = MEAN_KM / skymath::moon_distance_km(date);
        Some(Moon {
            direction: refracted(direction),
            lit: skymath::moon_illumination(date),
            irradiance: 10f64.powf(0.4 * (SUN - magnitude)) * nearer * nearer,
        })
    }
}

/// Unit vector by declination and hour angle, radians; the angle is zero in the meridian and grows westwards.
fn of_hour_angle(latitude: f64, declination: f64, hour: f64) -> DVec3 {
    let (sin, cos) = latitude.sin_cos();
    let (up, flat) = declination.sin_cos();
    DVec3::new(-flat * hour.sin(), up * cos - flat * sin * hour.cos(), up * sin + flat * cos * hour.cos())
}

/// The direction in which something beyond the air in `direction` is seen.
fn refracted(direction: DVec3) -> DVec3 {
    let without = Angle::from_radians(direction.z.clamp(-1.0, 1.0).asin());
    // It has none for what is far below the horizon, which nobody sees.
    let elevation = skymath::refraction_true_to_apparent(without).unwrap_or(without).radians();
    (direction.truncate().normalize_or_zero() * elevation.cos()).extend(elevation.sin())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moment(latitude: f64, longitude: f64, utc: (i32, u8, u8, f64)) -> Moment {
        let (year, month, day, second) = utc;
        let place = Place::new(latitude, longitude).expect("a place");
        Moment { place, utc: Utc::of_day(year, month, day, second).expect("a time") }
    }

    #[test]
    fn the_sun_stands_where_the_reference_puts_it() {
        let lines: Vec<&str> = include_str!("../data/sun_spa_points.csv").lines().skip(2).collect();
        assert!(lines.len() > 40, "{} rows", lines.len());
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |i: usize| cells[i].parse::<f64>().expect("a number");
            let part = |at: std::ops::Range<usize>| cells[0][at].parse::<u32>().expect("digits");
            let second = part(11..13) * 3600 + part(14..16) * 60 + part(17..19);
            let (month, day) = (part(5..7) as u8, part(8..10) as u8);
            let utc = (part(0..4) as i32, month, day, f64::from(second));
            let sun = moment(number(1), number(2), utc).sun().expect("in range");
            // Below the horizon the two differ in how far they go on with refraction.
            let elevation = if number(3) > 0.0 { number(4) } else { number(3) };
            let expected = towards(number(5).to_radians(), elevation.to_radians());
            let error = sun.angle_between(expected).to_degrees();
            // The reference refracts in air of 12 C, the standard correction in another: low suns differ by 0.003 degrees.
            let allowed = if number(3) > 0.0 { 0.005 } else { 0.7 };
            assert!(error < allowed, "{line}: {error} deg");
        }
    }

    /// Greatest eclipse, place and time by NASA's catalogue (Espenak and Meeus): there the moon covers the sun, however it is computed.
    #[test]
    fn an_eclipse_is_where_and_when_it_was_predicted() {
        for (latitude, longitude, utc) in [
            (25.3, -104.1, (2024, 4, 8, 65_836.0)),
            (65.2, -25.2, (2026, 8, 12, 63_951.0)),
            (25.5, 33.2, (2027, 8, 2, 36_396.0)),
        ] {
            let there = moment(latitude, longitude, utc);
            let (sun, moon) = (there.sun().expect("in range"), there.moon().expect("in range"));
            let apart = sun.angle_between(moon.direction).to_degrees();
            // A tenth of a degree of place and two minutes of arc of the moon, where its parallax is a degree.
            assert!(apart < 0.05, "{utc:?}: {apart} deg");
            assert!(moon.lit < 1e-3 && moon.irradiance < 1e-9, "{moon:?}");
        }
        // Total eclipses of the moon: it is full, and stands against the sun.
        for utc in [(2025, 9, 7, 65_512.0_f64), (2026, 3, 3, 41_622.0)] {
            // Where it stands overhead.
            let there = moment(0.0, (540.0 - utc.3 / 240.0).rem_euclid(360.0) - 180.0, utc);
            let (sun, moon) = (there.sun().expect("in range"), there.moon().expect("in range"));
            assert!(moon.lit > 0.999 && (2e-6..3.5e-6).contains(&moon.irradiance), "{moon:?}");
            assert!(sun.angle_between(-moon.direction).to_degrees() < 2.0);
        }
    }

    #[test]
    fn sun_and_moon_are_finite_at_poles_in_the_zenith_and_over_three_thousand_years() {
        for (latitude, longitude) in [(90.0, 0.0), (-90.0, 12.0), (0.0, 180.0), (0.0, -180.0), (66.5, 7.0)] {
            let mut before: Option<DVec3> = None;
            for hour in 0..48 {
                let there = moment(
                    latitude,
                    longitude,
                    (2026, 6, 20 + (hour / 24) as u8, f64::from(hour % 24) * 3600.0),
                );
                let (sun, moon) = (there.sun().expect("in range"), there.moon().expect("in range"));
                assert!((sun.length() - 1.0).abs() < 1e-9 && (moon.direction.length() - 1.0).abs() < 1e-9);
                if let Some(before) = before.filter(|moon| moon.z.abs() > 0.1) {
                    let step = before.angle_between(moon.direction).to_degrees();
                    assert!(step < 16.0, "{latitude}: {step} deg in an hour");
                }
                before = Some(moon.direction);
            }
        }
        for year in (0..3000).step_by(500).chain([2999]) {
            let there = moment(54.0, 8.0, (year, 2, 28, 80_000.0));
            assert!(
                there.sun().expect("in range").is_finite()
                    && there.moon().expect("in range").irradiance.is_finite()
            );
        }
    }

    #[test]
    fn what_is_no_place_or_time_is_none() {
        for (latitude, longitude) in [(90.1, 0.0), (0.0, -180.5), (f64::NAN, 0.0), (0.0, f64::INFINITY)] {
            assert_eq!(Place::new(latitude, longitude), None);
        }
        for (year, month, day, second) in [
            (2026, 2, 29, 0.0),
            (2026, 13, 1, 0.0),
            (2026, 0, 1, 0.0),
            (3000, 1, 1, 0.0),
            (2026, 1, 1, f64::NAN),
        ] {
            assert_eq!(Utc::of_day(year, month, day, second), None);
        }
        assert_eq!(Utc::from_ms(i64::MAX), None);
        let last = Utc::of_day(2999, 12, 31, 86_399.0).expect("in range");
        assert_eq!((last.plus_secs(1.0), last.plus_secs(f64::INFINITY)), (None, None));
        assert_eq!(last.day(), (2999, 12, 31, 86_399.0));
    }
}
