//! The body that lights the sky, sun or moon, followed as they move.

use glam::DVec3;

use crate::{
    daylight::{Daylight, illuminance_of_sun},
    ephemeris::{Moment, Moon, Place, Utc},
    event::ShipFix,
    sky::SUN_LUX,
    time::Time,
};

/// Interval at which sun and moon are computed, seconds: the sun has moved by an eighth of a degree.
const EVERY_S: f64 = 30.0;

/// Sun and moon at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Luminaries {
    /// Unit vector towards the sun, world.
    pub sun: DVec3,
    /// The moon; `None` where neither scenario nor ship tells place and time.
    pub moon: Option<Moon>,
    /// Place and time that they follow from.
    pub moment: Option<Moment>,
    /// These are the ship's.
    pub from_ship: bool,
    /// The ship's place and time, and the sun there, where the scenario does not take them.
    pub unused: Option<(Moment, DVec3)>,
}

impl Luminaries {
    /// A sun that nothing is known of but its direction.
    const fn fixed(sun: DVec3) -> Self {
        Self { sun, moon: None, moment: None, from_ship: false, unused: None }
    }

    /// The moon, where it gives a level surface more light than the sun does.
    pub fn moonlight(&self) -> Option<&Moon> {
        self.moon.as_ref().filter(|moon| {
            moon.direction.z > 0.0
                && moon.irradiance * illuminance_of_sun(moon.direction.z) > illuminance_of_sun(self.sun.z)
        })
    }

    /// Illuminance of a surface that faces that body above the air, lux.
    pub fn brightest_lux(&self) -> f64 {
        SUN_LUX * self.moonlight().map_or(1.0, |moon| moon.irradiance)
    }

    /// Tests whether vessels show their lights: from sunset, when the upper limb is seen to go down, to sunrise (COLREGS rule 20 (b)).
    pub fn is_between_sunset_and_sunrise(&self) -> bool {
        const SUNSET_DEG: f64 = -0.833;
        self.sun.z < SUNSET_DEG.to_radians().sin()
    }

    /// Unit vector towards the body that gives a level surface the most light.
    pub fn brightest(&self) -> DVec3 {
        self.moonlight().map_or(self.sun, |moon| moon.direction)
    }
}

/// Follows sun and moon from what the scenario gives and what the ship's instruments tell.
#[derive(Clone, Debug)]
pub struct SkyClock {
    /// Scenario's sun, place and time; the latter run from the first picture on.
    daylight: Daylight,
    begun: Option<Time>,
    place: Option<Place>,
    utc: Option<(Time, Utc)>,
    computed: Option<Time>,
    luminaries: Luminaries,
}

impl SkyClock {
    /// A clock that has not begun.
    pub const fn new(daylight: &Daylight) -> Self {
        Self {
            daylight: *daylight,
            begun: None,
            place: None,
            utc: None,
            computed: None,
            luminaries: Luminaries::fixed(daylight.sun_direction),
        }
    }

    /// Takes in what the ship's instruments told.
    pub fn fix(&mut self, fix: &ShipFix) {
        let known = self.ship(fix.arrival).is_some();
        self.place = fix.place.or(self.place);
        self.utc = fix.utc.map(|utc| (fix.arrival, utc)).or(self.utc);
        if !known && self.ship(fix.arrival).is_some() {
            self.computed = None;
        }
    }

    /// Place and time at `time` by the ship's instruments; `None` before they told both.
    fn ship(&self, time: Time) -> Option<Moment> {
        let (arrival, utc) = self.utc?;
        Some(Moment { place: self.place?, utc: utc.plus_secs(time.secs_since(arrival))? })
    }

    /// Sun and moon when they were last computed.
    pub const fn luminaries(&self) -> &Luminaries {
        &self.luminaries
    }

    /// Computes sun and moon for `time`, where they have moved since.
    pub fn follow(&mut self, time: Time) {
        let begun = *self.begun.get_or_insert(time);
        if self.computed.is_some_and(|computed| (0.0..EVERY_S).contains(&time.secs_since(computed))) {
            return;
        }
        let Daylight { sun_direction, moment, from_ship, .. } = self.daylight;
        let (used, unused) = if from_ship { (self.ship(time), None) } else { (None, self.ship(time)) };
        let given = || {
            let Moment { place, utc } = moment?;
            Some(Moment { place, utc: utc.plus_secs(time.secs_since(begun))? })
        };
        let moment = used.or_else(given);
        self.computed = Some(time);
        self.luminaries = Luminaries {
            sun: moment.and_then(Moment::sun).unwrap_or(sun_direction),
            moon: moment.and_then(Moment::moon),
            moment,
            from_ship: used.is_some(),
            unused: unused.and_then(|ship| Some((ship, ship.sun()?))),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn daylight(moment: Option<Moment>, from_ship: bool) -> Daylight {
        Daylight { moment, from_ship, ..Daylight::fixed(DVec3::X, 20_000.0) }
    }

    fn at(clock: &mut SkyClock, time_ns: i64) -> Luminaries {
        clock.follow(Time::from_ns(time_ns));
        *clock.luminaries()
    }

    fn fix(second: i64, place: Option<(f64, f64)>, ms: Option<i64>) -> ShipFix {
        ShipFix {
            arrival: Time::from_ns(second * 1_000_000_000),
            place: place.and_then(|(latitude, longitude)| Place::new(latitude, longitude)),
            utc: ms.and_then(Utc::from_ms),
        }
    }

    /// 2026-06-01, 12:00 UTC.
    const NOON_MS: i64 = 1_780_315_200_000;
    const GERMAN_BIGHT: (f64, f64) = (54.1, 7.9);

    #[test]
    fn the_ships_place_and_time_come_once_both_are_told() {
        let mut clock = SkyClock::new(&daylight(None, true));
        assert_eq!(at(&mut clock, 0).sun, DVec3::X);
        clock.fix(&fix(1, Some(GERMAN_BIGHT), None));
        assert_eq!(at(&mut clock, 1_500_000_000).sun, DVec3::X);
        clock.fix(&fix(2, None, Some(NOON_MS)));
        let seen = at(&mut clock, 2_500_000_000);
        // The sun is in the south and 90 - 54.1 + 22 degrees high, half an hour after its noon there.
        assert!(seen.from_ship && (seen.sun.z.asin().to_degrees() - 57.4).abs() < 0.5, "{seen:?}");
        assert!(seen.moon.is_some());
        // An hour on it has moved by 15 degrees of hour angle, though the feed fell silent.
        let later = at(&mut clock, 3_602_000_000_000);
        let turned = later.sun.angle_between(seen.sun).to_degrees();
        assert!((10.0..16.0).contains(&turned), "{turned}");
    }

    #[test]
    fn a_scenario_that_names_its_sun_keeps_it() {
        let mut clock = SkyClock::new(&daylight(None, false));
        clock.fix(&fix(1, Some(GERMAN_BIGHT), Some(NOON_MS)));
        let seen = at(&mut clock, 1_500_000_000);
        assert_eq!((seen.sun, seen.moon, seen.from_ship), (DVec3::X, None, false));
        assert!(seen.unused.is_some());
    }

    #[test]
    fn a_scenarios_own_time_runs_from_the_first_picture() {
        let place = Place::new(54.1, 7.9).expect("a place");
        let utc = Utc::from_ms(NOON_MS).expect("a time");
        let mut clock = SkyClock::new(&daylight(Some(Moment { place, utc }), false));
        let first = at(&mut clock, 77_000_000_000);
        assert_eq!(first.moment, Some(Moment { place, utc }));
        let later = at(&mut clock, 137_000_000_000).moment.expect("known");
        assert_eq!(later.utc.ms() - NOON_MS, 60_000);
    }

    #[test]
    fn a_high_full_moon_lights_the_night_and_no_day() {
        let moon = Moon { direction: DVec3::new(0.0, 0.6, 0.8), lit: 1.0, irradiance: 2.5e-6 };
        let with = |elevation_deg: f64, moon: Moon| {
            let (sin, cos) = elevation_deg.to_radians().sin_cos();
            let sun = DVec3::new(cos, 0.0, sin);
            Luminaries { moon: Some(moon), ..Luminaries::fixed(sun) }
        };
        assert!(with(-18.0, moon).moonlight().is_some() && with(-10.0, moon).moonlight().is_some());
        for elevation_deg in [-5.0, 0.0, 40.0] {
            assert_eq!(with(elevation_deg, moon).brightest(), with(elevation_deg, moon).sun);
        }
        let crescent = Moon { irradiance: 1e-9, ..moon };
        assert!(with(-11.0, crescent).moonlight().is_none());
        let set = Moon { direction: DVec3::new(0.0, 0.6, -0.8), ..moon };
        assert!(with(-18.0, set).moonlight().is_none());
    }

    #[test]
    fn a_level_surface_gets_more_from_a_higher_sun() {
        let lux: Vec<f64> =
            (-90..=90).map(|deg| illuminance_of_sun(f64::from(deg).to_radians().sin())).collect();
        assert!(lux.is_sorted() && lux.iter().all(|lux| *lux > 0.0), "{lux:?}");
        assert!((illuminance_of_sun(0.0) - 759.0).abs() < 1e-6);
    }
}
