//! The searchlight on the gun: where its beam went of late, and what it lights.

use std::collections::VecDeque;

use glam::DVec3;

use crate::{
    daylight::{Daylight, illuminance_of_sun},
    physics::{extinction_per_m, illuminance},
    time::Time,
    world::note_clock::NoteClock,
};

/// A searchlight beside the gun, whose axis is the barrel's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchlightSpec {
    /// Luminous intensity on the axis, candela.
    pub candela: f64,
    /// Angle across the beam between where it has half of that, radians.
    pub beam: f64,
    /// It is on as the exercise begins.
    pub is_on: bool,
}

impl SearchlightSpec {
    /// Exponent of its beam, whose intensity falls with `exp(-k off^2)`, 1/rad^2.
    pub fn sharpness(&self) -> f64 {
        4.0 * std::f64::consts::LN_2 / (self.beam * self.beam)
    }

    /// Intensity `off` radians from its axis, candela.
    pub fn candela_at(&self, off: f64) -> f64 {
        self.candela * (-self.sharpness() * off * off).exp()
    }
}

impl Default for SearchlightSpec {
    /// Numbers where a scenario gives none: a small searchlight of a ship, off.
    fn default() -> Self {
        Self { candela: 200_000.0, beam: 5f64.to_radians(), is_on: false }
    }
}

/// A beam at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// The lamp's place, world, metres.
    pub lamp: DVec3,
    /// Its axis, world, unit vector.
    pub axis: DVec3,
}

/// Interval at which the beam is noted, seconds.
const NOTED_EVERY_S: f64 = 0.1;
/// Notes that are kept: as far back as a round is followed.
const KEPT: usize = 256;
/// Illuminance by which somebody in the open knows that a beam is on him, lux: four full moons.
const NOTICED_LUX: f64 = 1.0;

/// A searchlight and its beam of late.
#[derive(Clone, Debug)]
pub struct Searchlight {
    spec: SearchlightSpec,
    extinction_per_m: f64,
    /// Illuminance from which on a boat is lit, lux.
    lit_lux: f64,
    /// The beam by seconds since the start, oldest first; `None` while it is off.
    shone: VecDeque<(f64, Option<Beam>)>,
}

impl Searchlight {
    /// One that has not shone yet, in the air and light of `daylight`: by day no beam is noticed.
    pub fn new(spec: SearchlightSpec, daylight: &Daylight) -> Self {
        Self {
            spec,
            extinction_per_m: extinction_per_m(daylight.visibility_m),
            lit_lux: NOTICED_LUX.max(illuminance_of_sun(daylight.sun_direction.z)),
            shone: VecDeque::with_capacity(KEPT),
        }
    }

    /// Illuminance by it of a surface at `at` that faces it, lux.
    pub fn illuminance(&self, beam: &Beam, at: DVec3) -> f64 {
        let range_m = at.distance(beam.lamp);
        illuminance(self.spec.candela_at(off_axis(beam, at)), range_m, self.extinction_per_m)
    }

    /// The beam is this from `time_s` on.
    pub fn shine(&mut self, time_s: f64, beam: Option<Beam>) {
        if self.shone.len() == KEPT {
            self.shone.pop_front();
        }
        self.shone.push_back((time_s, beam));
    }

    /// The beam at a time, seconds since the start; `None` while it is off.
    fn beam_at(&self, time_s: f64) -> Option<&Beam> {
        self.shone.iter().rev().find(|(since_s, _)| *since_s <= time_s)?.1.as_ref()
    }

    /// Illuminance by it at `at`, of a surface that faces it, lux.
    pub fn lux(&self, at: DVec3, time_s: f64) -> f64 {
        self.beam_at(time_s).map_or(0.0, |beam| self.illuminance(beam, at))
    }

    /// Intensity by which somebody at `at` sees it shine, candela.
    pub fn candela_towards(&self, at: DVec3, time_s: f64) -> f64 {
        self.beam_at(time_s).map_or(0.0, |beam| self.spec.candela_at(off_axis(beam, at)))
    }

    /// Tests whether it lights what is at `at`: it is no darker there than by the sky, and bright enough to be noticed.
    pub fn lights(&self, at: DVec3, time_s: f64) -> bool {
        self.beam_at(time_s).is_some_and(|beam| self.illuminance(beam, at) >= self.lit_lux)
    }
}

/// Angle between a beam's axis and the line to `at`, radians; none at the lamp itself.
fn off_axis(beam: &Beam, at: DVec3) -> f64 {
    let ray = at - beam.lamp;
    ray.cross(beam.axis).length().atan2(ray.dot(beam.axis))
}

/// A searchlight's switch.
#[derive(Clone, Debug)]
pub struct LightSwitch {
    /// The searchlight.
    pub spec: SearchlightSpec,
    is_on: bool,
    /// Presses that lie ahead of what was noted, oldest first.
    pressed: VecDeque<Time>,
    clock: NoteClock,
}

impl LightSwitch {
    /// A switch that nobody has pressed.
    pub const fn new(spec: SearchlightSpec) -> Self {
        Self {
            spec,
            is_on: spec.is_on,
            pressed: VecDeque::new(),
            clock: NoteClock::new(NOTED_EVERY_S, KEPT as u32),
        }
    }

    /// It is pressed; of more presses at once than anybody makes, the later ones do not count.
    pub fn press(&mut self, time: Time) {
        /// More wait only while no picture has come.
        const WAITING_MAX: usize = 256;
        if self.pressed.len() < WAITING_MAX {
            let place = self.pressed.partition_point(|pressed| *pressed <= time);
            self.pressed.insert(place, time);
        }
    }

    /// When the beam is to be noted next, and whether it is on then; `None` once it has been noted up to `now`. The scenario began at
    /// `start`.
    pub fn next_note(&mut self, start: Time, now: Time) -> Option<(Time, bool)> {
        let time = self.clock.next(start, now)?;
        while self.pressed.front().is_some_and(|pressed| *pressed <= time) {
            self.pressed.pop_front();
            self.is_on = !self.is_on;
        }
        Some((time, self.is_on))
    }

    /// The searchlight, while it is on.
    pub fn shining(&self) -> Option<&SearchlightSpec> {
        Some(&self.spec).filter(|_| self.is_on)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    const SPEC: SearchlightSpec = SearchlightSpec { candela: 200_000.0, beam: 0.14, is_on: false };

    fn beam() -> Beam {
        Beam { lamp: DVec3::Z * 8.0, axis: DVec3::Y }
    }

    fn at_night(visibility_m: f64) -> Searchlight {
        Searchlight::new(SPEC, &Daylight::fixed(DVec3::NEG_Z, visibility_m))
    }

    #[test]
    fn the_switch_is_read_at_times_of_its_own() {
        let at = |s: f64| Time::from_ns(5_000_000_000).plus_secs(s);
        // Told of late and out of order, and looked at by frames of any pace: the notes are the same.
        let notes = |frames: &[f64]| {
            let mut switch = LightSwitch::new(SPEC);
            switch.press(at(0.75));
            switch.press(at(0.32));
            let mut notes = Vec::new();
            for now in frames {
                notes.extend(std::iter::from_fn(|| switch.next_note(at(0.0), at(*now))));
            }
            notes
        };
        let all = notes(&[1.001]);
        assert_eq!(
            all.iter().map(|note| note.1).collect::<Vec<_>>(),
            (0..=10).map(|i| (4..8).contains(&i)).collect::<Vec<_>>()
        );
        assert_eq!(all, notes(&[0.0, 0.05, 0.41, 0.42, 0.9, 1.001]));
        assert_eq!(notes(&[-1.0]), []);
        let late = notes(&[3600.0]);
        assert!(
            late.len() <= KEPT + 1 && late.last().is_some_and(|(time, _)| *time > at(3599.8)),
            "{}",
            late.len()
        );
    }

    #[test]
    fn half_the_intensity_is_left_at_half_the_angle() {
        assert!((SPEC.candela_at(0.0) - 200_000.0).abs() < 1e-9);
        assert!((SPEC.candela_at(0.07) - 100_000.0).abs() < 1e-6);
        assert!(SPEC.candela_at(0.28) < 4.0);
        assert!(SPEC.candela_at(PI) >= 0.0);
    }

    #[test]
    fn light_falls_with_distance_and_haze() {
        let clear = at_night(1e9);
        let at = |range_m: f64| DVec3::new(0.0, range_m, 8.0);
        assert!((clear.illuminance(&beam(), at(200.0)) - 5.0).abs() < 1e-3);
        // At the visibility a black object keeps a fiftieth of its contrast: so much light comes through (Koschmieder 1924).
        let hazy = at_night(1000.0);
        let left = hazy.illuminance(&beam(), at(1000.0)) / clear.illuminance(&beam(), at(1000.0));
        assert!((left - 0.02).abs() < 1e-4, "{left}");
        assert!(clear.illuminance(&beam(), DVec3::Z * 8.0).is_finite(), "at the lamp itself");
    }

    #[test]
    fn a_boat_is_lit_in_the_beam_at_night_and_never_by_day() {
        let mut night = at_night(2e4);
        let (near, aside) = (DVec3::new(0.0, 300.0, 1.0), DVec3::new(60.0, 300.0, 1.0));
        assert!(!night.lights(near, 0.0), "not on yet");
        night.shine(1.0, Some(beam()));
        night.shine(2.0, None);
        assert!(!night.lights(near, 0.9));
        assert!(night.lights(near, 1.5));
        assert!(!night.lights(aside, 1.5));
        assert!(!night.lights(near * 2.0, 1.5), "too far off");
        assert!(!night.lights(near, 2.5), "off again");
        let mut day = Searchlight::new(SPEC, &Daylight::fixed(DVec3::Z, 2e4));
        day.shine(1.0, Some(beam()));
        assert!(!day.lights(near, 1.5));
        for i in 0..2 * KEPT {
            night.shine(3.0 + i as f64, Some(beam()));
        }
        assert_eq!(night.shone.len(), KEPT);
    }
}
