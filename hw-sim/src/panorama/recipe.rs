//! The numbers of a panorama, and those that fit a scenario.

use std::f64::consts::PI;

use bowwave_core::world::scenario::Scenario;

use super::{PanoramaError, file::PanoramaHeader};
use crate::{
    make::{GunMotion, Motion, Periodic, Recipe, ShipMotion, camera::level_focal},
    ocean::{cloudy::SkyRecipe, spectrum::Swell},
};

/// Length of the loop of the sea, seconds.
pub const LOOP_S: f64 = 12.0;
/// Length after which the ship's motion repeats, seconds: a whole number of loops.
const SHIP_LOOP_S: f64 = 60.0;
/// Stop of the simulated mount to each side, radians.
pub const TRAVERSE_MAX: f64 = 70.0 * DEG;
/// Stops of its elevation, radians.
pub(crate) const ELEVATION: [f64; 2] = [-18.0 * DEG, 14.0 * DEG];
/// Azimuth beside the view at either stop: yaw, and what a rolled picture's corners reach, radians.
const BESIDE: f64 = 12.0 * DEG;
/// Steepest elevation that is drawn, radians.
const STEEPEST: f64 = 75.0 * DEG;
/// Waves so many times as high as those of the wind have a swell among them.
const SWELL_FROM: f64 = 1.3;
const DEG: f64 = PI / 180.0;

/// A panorama to be made.
#[derive(Clone, Debug, PartialEq)]
pub struct PanoramaRecipe {
    /// Sea, sky, eye height, heave, and the camera that will be cut from it. Its gun, trigger and the ship's turns are not used.
    pub recipe: Recipe,
    /// Motion of the ship under the gun.
    pub motion: Motion,
    /// Pixels a degree, in those of the camera's middle.
    pub detail: f64,
    /// Sensor's exposure after sunset: share of what it would be by day.
    pub exposure: f64,
    /// Elevation of the scenario's sun, radians. The sky after sunset is that of a low sun without its disc, less exposed and
    /// bluer.
    pub sun_elevation: f64,
}

impl PanoramaRecipe {
    /// The sea and the light that a scenario describes, for a camera of so many pixels.
    pub fn of_scenario(scenario: &Scenario, (width, height): (u32, u32)) -> Self {
        let sun = scenario.daylight.sun_direction;
        let elevation = sun.z.clamp(-1.0, 1.0).asin();
        let exposure = exposure(elevation / DEG);
        let height_m = scenario.waves.spectrum.significant_height_m();
        let mut recipe = Recipe {
            width,
            height,
            duration_s: LOOP_S,
            seed: scenario.seed,
            beaufort: scenario.water.force,
            wind_from: scenario.waves.wind_from,
            swell: None,
            sky: SkyRecipe {
                sun_azimuth: sun.x.atan2(sun.y).rem_euclid(std::f64::consts::TAU),
                sun_elevation: elevation.clamp(1.5 * DEG, 89.0 * DEG),
                turbidity: 3.2,
                // Clouds let a share of the sunlight through.
                cloud_cover: (0.95 - 0.53 * scenario.daylight.sun_strength).clamp(0.0, 1.0),
            },
            visibility_m: scenario.daylight.visibility_m.clamp(100.0, 1e6),
            eye_height_m: scenario.eye_height_m,
            ship: ShipMotion { heave: heave(height_m, LOOP_S), ..ShipMotion::default() },
            trigger: Vec::new(),
            ..Recipe::default()
        };
        // Higher waves than this wind makes are a swell.
        let wind_sea_m = recipe.significant_height_m();
        if height_m > SWELL_FROM * wind_sea_m + 0.1 {
            recipe.swell = Some(Swell {
                height_m: (height_m * height_m - wind_sea_m * wind_sea_m).sqrt().min(12.0),
                period_s: scenario.waves.spectrum.peak_period_s().clamp(2.0, LOOP_S),
                from: scenario.waves.wind_from,
            });
        }
        // Cameras in the dark turn their gain up.
        recipe.camera.read_noise /= exposure;
        recipe.camera.latency_ns = [20_000_000, 24_000_000];
        let motion = Motion::new(ship(height_m), GunMotion::default(), recipe.eye_height_m, SHIP_LOOP_S);
        Self { recipe, motion, detail: 1.0, exposure, sun_elevation: elevation }
    }

    /// Refuses what cannot be drawn.
    pub fn check(&self) -> Result<(), PanoramaError> {
        self.recipe.check()?;
        PanoramaHeader::of(self).check()
    }

    /// Whether the sun is above the horizon.
    pub fn sun_is_up(&self) -> bool {
        self.sun_elevation > 0.0
    }

    /// Share of the twilight's blue in the light, 0 to 1: with the sun below the horizon, ozone takes the red and the yellow out of what
    /// comes from high up (Hulburt 1953, J. Opt. Soc. Am. 43, 113), and the glow of the sunset is gone by 9 degrees.
    pub(crate) fn twilight(&self) -> f64 {
        (-self.sun_elevation / (9.0 * DEG)).clamp(0.0, 1.0)
    }

    /// Pixels per radian of azimuth and per tangent of elevation.
    pub(crate) fn focal(&self) -> f64 {
        self.detail * f64::from(level_focal(&self.recipe.lens()))
    }

    /// Tangents of the elevation of the upper and the lower edge.
    pub(crate) fn tangents(&self) -> [f64; 2] {
        let lens = self.recipe.lens();
        // The diagonal holds every roll.
        let half = (f64::from(lens.width).hypot(f64::from(lens.height)) / 2.0 / lens.focal.x).atan();
        let tall = (f64::from(lens.height) / 2.0 / lens.focal.y).atan();
        // A rolled picture's corner reaches farther than its edge's middle, by less than the diagonal does.
        let reach = tall + 0.35 * (half - tall) + self.motion.sway();
        let within = |angle: f64| angle.clamp(-STEEPEST, STEEPEST).tan();
        [within(ELEVATION[1] + reach), within(ELEVATION[0] - reach)]
    }

    /// Azimuths of the left and the right edge, radians: the same to both sides of north, where scenarios begin to look.
    pub(crate) fn azimuths(&self) -> [f64; 2] {
        let half = (TRAVERSE_MAX + self.recipe.camera.hfov / 2.0 + BESIDE).min(PI);
        [-half, half]
    }

    /// Frames of the loop.
    pub fn frames(&self) -> u32 {
        self.recipe.frames()
    }
}

/// Share of the day's exposure at a sun's elevation in degrees: a camera's automatic exposure makes good for most of what twilight takes, and
/// loses three stops by nautical dusk.
fn exposure(elevation_deg: f64) -> f64 {
    (elevation_deg / 4.0).clamp(-3.5, 0.0).exp2()
}

/// A ship of some thousand tonnes without way in waves of that height: periods of 10 s in roll, 6 s in pitch; amplitudes grow with the waves,
/// and less than they do.
fn ship(height_m: f64) -> ShipMotion {
    let gain = height_m.max(0.0).powf(0.6).min(3.0);
    let turn = |mean_deg: f64, list: &[(f64, f64, f64)]| {
        let waves: Vec<_> = list
            .iter()
            .map(|&(period_s, amplitude_deg, phase)| {
                ((SHIP_LOOP_S / period_s).round() as u32, gain * amplitude_deg * DEG, phase)
            })
            .collect();
        Periodic::new(mean_deg * DEG, &waves)
    };
    ShipMotion {
        // The bow lies at 318 degrees, as in the built-in recording.
        heading: turn(318.0, &[(20.0, 0.5, 0.3), (12.0, 0.2, 1.9)]),
        pitch: turn(0.2, &[(6.0, 0.7, 0.8), (5.0, 0.35, 2.6)]),
        roll: turn(0.4, &[(10.0, 2.2, 0.4), (60.0 / 7.0, 1.3, 1.1)]),
        heave: heave(height_m, SHIP_LOOP_S),
    }
}

/// Heave of such a ship: whole cycles in the sea's loop.
fn heave(height_m: f64, period_s: f64) -> Periodic {
    let loops = (period_s / LOOP_S).round() as u32;
    let gain = height_m.clamp(0.0, 4.0);
    Periodic::new(0.0, &[(2 * loops, 0.06 * gain, 0.2), (loops, 0.05 * gain, 1.4)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_scenario_has_a_panorama_that_can_be_made() {
        for (name, text) in bowwave_core::world::scenario::BUILT_IN {
            let panorama = PanoramaRecipe::of_scenario(&Scenario::parse(text, name).unwrap(), (1280, 720));
            panorama.check().unwrap_or_else(|e| panic!("{name}: {e}"));
            let [left, right] = panorama.azimuths();
            let [up, down] = panorama.tangents();
            assert!(
                (right - left).to_degrees() >= 140.0 && (up.atan() - down.atan()).to_degrees() >= 50.0,
                "{name}"
            );
        }
    }

    #[test]
    fn a_camera_sees_less_after_sunset() {
        for (elevation, share) in
            [(40.0, 1.0), (0.0, 1.0), (-4.0, 0.5), (-12.0, 0.125), (-40.0, 2f64.powf(-3.5))]
        {
            assert!((exposure(elevation) - share).abs() < 1e-12, "{elevation}");
        }
        let of = |name: &str| {
            let (_, text) =
                bowwave_core::world::scenario::BUILT_IN.into_iter().find(|(n, _)| *n == name).unwrap();
            PanoramaRecipe::of_scenario(&Scenario::parse(text, name).unwrap(), (1280, 720))
        };
        assert!(of("first-target").sun_is_up() && !of("dusk-patrol").sun_is_up());
        assert!(of("night-intruder").exposure < of("dusk-patrol").exposure);
        assert!(of("night-intruder").recipe.camera.read_noise > of("first-target").recipe.camera.read_noise);
    }
}
