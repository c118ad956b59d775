//! Light and air over the last minutes, by the scenario's clock.

use std::collections::VecDeque;

use super::{ambient::Ambient, sight::Seeing};
use crate::{
    daylight::Daylight,
    estimate::light::{Luminaries, SkyClock},
    event::ShipFix,
    time::Time,
    world::note_clock::NoteClock,
};

/// Interval at which the light is noted, seconds.
const NOTED_EVERY_S: f64 = 10.0;
/// Notes that are kept: as far back as crews are stepped again.
const KEPT: usize = 16;

/// Light and air by seconds since the scenario began.
#[derive(Clone, Debug)]
pub struct SeeingLog {
    /// Oldest first; the first counts for all times before it.
    noted: VecDeque<(f64, Seeing)>,
}

impl SeeingLog {
    /// Light and air that do not change.
    pub fn steady(seeing: Seeing) -> Self {
        Self { noted: VecDeque::from([(0.0, seeing)]) }
    }

    /// It is so from `time_s` on.
    pub fn note(&mut self, time_s: f64, seeing: Seeing) {
        if self.noted.back().is_some_and(|(_, newest)| *newest == seeing) {
            return;
        }
        if self.noted.len() == KEPT {
            self.noted.pop_front();
        }
        self.noted.push_back((time_s, seeing));
    }

    /// Light and air at a time.
    pub fn at(&self, time_s: f64) -> Option<&Seeing> {
        let newest = self.noted.iter().rev().find(|(since_s, _)| *since_s <= time_s);
        newest.or_else(|| self.noted.front()).map(|(_, seeing)| seeing)
    }
}

/// Light of a scenario as sun and moon move.
#[derive(Clone, Debug)]
pub struct SceneLight {
    sky: SkyClock,
    daylight: Daylight,
    wind_m_s: f64,
    clock: NoteClock,
}

impl SceneLight {
    /// Light before a scenario of that daylight and wind begins.
    pub const fn new(daylight: &Daylight, wind_m_s: f64) -> Self {
        Self {
            sky: SkyClock::new(daylight),
            daylight: *daylight,
            wind_m_s,
            clock: NoteClock::new(NOTED_EVERY_S, KEPT as u32),
        }
    }

    /// Takes in place and time that the ship's instruments told.
    pub fn fix(&mut self, fix: &ShipFix) {
        self.sky.fix(fix);
    }

    /// Light and air at `time`; times do not go back.
    pub fn at(&mut self, time: Time) -> Seeing {
        self.sky.follow(time);
        let Luminaries { sun, moon, .. } = self.sky.luminaries();
        let Daylight { sun_strength, visibility_m, .. } = self.daylight;
        Seeing { ambient: Ambient::new(*sun, sun_strength, moon.as_ref(), self.wind_m_s), visibility_m }
    }

    /// The next light to note, with its time; `None` once it has been noted up to `now`. The scenario began at `start`.
    pub fn next_note(&mut self, start: Time, now: Time) -> Option<(Time, Seeing)> {
        let time = self.clock.next(start, now)?;
        Some((time, self.at(time)))
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::ephemeris::{Moment, Place, Utc};

    fn seconds(s: f64) -> Time {
        Time::from_ns(3_000_000_000).plus_secs(s)
    }

    #[test]
    fn light_is_noted_by_the_scenarios_clock_whatever_the_pace() {
        let place = Place::new(50.0, 0.0).expect("a place");
        let moment = Moment { place, utc: Utc::of_day(2024, 3, 20, 64_800.0).expect("a time") };
        let daylight = Daylight { moment: Some(moment), ..Daylight::fixed(DVec3::Z, 1e4) };
        let notes = |paces: &[f64]| {
            let mut light = SceneLight::new(&daylight, 5.0);
            let now = paces.iter().map(|pace| seconds(*pace));
            now.flat_map(|now| std::iter::from_fn(|| light.next_note(seconds(0.0), now)).collect::<Vec<_>>())
                .collect::<Vec<_>>()
        };
        let all = notes(&[95.0]);
        assert_eq!(all.len(), 10);
        assert_eq!(all, notes(&[0.0, 0.5, 31.0, 32.0, 90.0, 95.0]));
        assert!(all[9].1.ambient.sky_cd_m2 < all[0].1.ambient.sky_cd_m2, "the sun goes down");
        assert!(notes(&[1e5]).len() <= KEPT + 1);
    }

    #[test]
    fn a_time_has_the_light_that_was_noted_last_before_it() {
        let seeing =
            |visibility_m: f64| Seeing { ambient: Ambient::new(DVec3::Z, 1.0, None, 5.0), visibility_m };
        let mut log = SeeingLog::steady(seeing(1.0));
        for i in 0..40 {
            log.note(f64::from(i) * 10.0, seeing(f64::from(i + 2)));
        }
        let at = |time_s: f64| log.at(time_s).expect("noted").visibility_m;
        assert_eq!([at(395.0), at(389.0), at(1e9)], [41.0, 40.0, 41.0]);
        assert_eq!(at(0.0), 26.0, "the oldest that is kept");
        assert_eq!(log.noted.len(), KEPT);
    }
}
