//! Seeing between the gun and the boats.

use glam::{DVec2, DVec3};

use super::Fleet;
use crate::{
    geometry::{ahead, starboard},
    physics::{extinction_per_m, illuminance},
    time::Time,
    world::{
        boats::{CourseState, FIRE_CANDELA_KW, Traffic, fire_heat_kw},
        flare::Flare,
        seeing::{Glare, Seeing, Target, threshold},
    },
};

/// Share of light that the own ship throws back: grey paint.
const SHIP_REFLECTANCE: f64 = 0.3;
/// Width of the own ship as crews see her, metres: as much of her as lies about the gun.
const SHIP_BREADTH_M: f64 = 24.0;
/// Illuminance by the full moon, high in a clear sky, lux (Kyba, Mohar and Posch 2017, "How bright is moonlight?").
const FULL_MOON_LUX: f64 = 0.25;
/// Eyes of a crew are no lower than that over the water, metres.
const EYES_LEAST_M: f64 = 1.2;

impl Fleet {
    /// Contrast, or light, of each boat at `time` over what half of the glimpses of somebody at `eye` need who looks at it: world, metres. 0 for
    /// what is hidden or has sunk.
    pub fn seen_from(&self, eye: DVec3, time: Time) -> Vec<f64> {
        let time_s = time.secs_since(self.start);
        let traffic: Vec<Traffic> = self.traffic(time_s).collect();
        let Some(seeing) = self.seeing.at(time_s) else { return vec![0.0; self.boats.len()] };
        let seen = |boat: usize| {
            let state = self.boats[boat].history.state(time_s);
            if !self.swims_at(boat, time_s) || super::is_hidden(boat, state.position, traffic.iter().copied())
            {
                return 0.0;
            }
            let target = self.target(boat, &state, eye, time);
            seeing.times_threshold(eye, state.position.extend(0.0), &target, Glare::default())
        };
        (0..self.boats.len()).map(seen).collect()
    }

    /// Light and air at `time`.
    pub fn seeing(&self, time: Time) -> Option<&Seeing> {
        self.seeing.at(time.secs_since(self.start))
    }

    /// Illuminance by flares of what faces them at `at`, lux.
    fn flares_lux(&self, at: DVec3, time: Time) -> f64 {
        let air = self.seeing(time).map_or(0.0, |seeing| extinction_per_m(seeing.visibility_m));
        let lux = |flare: &Flare| Some(illuminance(flare.candela(time), flare.at(time)?.distance(at), air));
        self.flares.iter().filter_map(lux).sum()
    }

    /// Tests whether flares light the crew of a boat at `at` so that it knows: by at least a full moon's light, and no less than sky, sun or moon give.
    pub(super) fn is_under_flare(&self, boat: usize, at: DVec2, time_s: f64) -> bool {
        if self.flares.is_empty() {
            return false;
        }
        let ambient = |seeing: &Seeing| seeing.ambient.sky_lux + seeing.ambient.direct_lux;
        let known_lux = FULL_MOON_LUX.max(self.seeing.at(time_s).map_or(0.0, ambient));
        let crew = at.extend(0.5 * self.height_m(boat));
        self.flares_lux(crew, self.start.plus_secs(time_s)) >= known_lux
    }

    /// A boat as somebody at `eye` has it before the eye.
    fn target(&self, boat: usize, state: &CourseState, eye: DVec3, time: Time) -> Target {
        let time_s = time.secs_since(self.start);
        let me = &self.boats[boat];
        let (hull, height_m) = (me.history.hull(), self.height_m(boat));
        let towards_eye = (eye - state.position.extend(height_m)).normalize_or(DVec3::Z);
        let flat = towards_eye.truncate().normalize_or(DVec2::Y);
        let (along, across) = (flat.dot(ahead(state.heading)), flat.dot(starboard(state.heading)));
        // The boat's space: x forward, y to port.
        let of_boat = DVec3::new(
            towards_eye.truncate().dot(ahead(state.heading)),
            -towards_eye.truncate().dot(starboard(state.heading)),
            towards_eye.z,
        );
        let lights = self.lights(boat, time).iter().map(|light| light.candela_towards(of_boat)).sum::<f64>();
        let burns = self.burns_since(boat).map_or(0.0, |since| fire_heat_kw(time.secs_since(since)));
        let fire = burns * FIRE_CANDELA_KW;
        let middle = state.position.extend(0.5 * height_m);
        Target {
            breadth_m: hull.length_m * across.abs() + hull.beam_m * along.abs(),
            height_m: (height_m - me.history.settled_m(time_s)).max(0.0),
            reflectance: self.reflectances.get(usize::from(me.model.0)).copied().unwrap_or(SHIP_REFLECTANCE),
            lamp_lux: self.searchlight.as_ref().map_or(0.0, |lamp| lamp.lux(middle, time_s))
                + self.flares_lux(middle, time),
            candela: lights + fire,
        }
    }

    /// Tests whether the crew of a boat at `at` sees the ship that the gun stands on, by the light of the sky and of flares; or its searchlight, which
    /// blinds those that it is on.
    pub(super) fn sees_gun(&self, boat: usize, at: DVec2, time_s: f64) -> bool {
        let helm_m = self.model(boat).map_or(0.0, |model| model.helm_middle().z);
        let eye = at.extend(helm_m.max(EYES_LEAST_M));
        let lamp = self.searchlight.as_ref();
        let ship = Target {
            breadth_m: SHIP_BREADTH_M,
            height_m: self.gun_m,
            reflectance: SHIP_REFLECTANCE,
            lamp_lux: self.flares_lux(DVec3::Z * self.gun_m, self.start.plus_secs(time_s)),
            candela: lamp.map_or(0.0, |lamp| lamp.candela_towards(eye, time_s)),
        };
        let glare = Glare { lux: lamp.map_or(0.0, |lamp| lamp.lux(eye, time_s)), off: 0.0 };
        let times = |seeing: &Seeing| seeing.times_threshold(eye, DVec3::ZERO, &ship, glare);
        self.seeing.at(time_s).is_some_and(|seeing| threshold::chance(times(seeing)) >= threshold::SEEN)
    }
}

#[cfg(test)]
#[path = "sight_tests.rs"]
mod tests;
