//! Lights in view: how much light of each comes to the camera, and what lamps light what is around them.

use std::f64::consts::FRAC_1_PI;

use glam::{DVec2, DVec3, Vec3};

use super::{
    fires::Burning,
    lamps::{FlashView, LAMPS_MAX, LampView},
    rounds::{ROUNDS_SEEN_MAX, fires, source_of},
    scene::{BoatView, LightView, RoundView},
    view::ViewFrustum,
};
use crate::{geometry::horizon_dip, physics::extinction_per_m, time::Time, world::RunningWorld};

/// Most lights of a boat, its fire among them.
pub const LIGHTS_A_BOAT: usize = 7;

/// Most flares among a scene's lamps.
const FLARES_MAX: usize = 4;

/// Radiance of a white matt surface below which nothing is lit: half a code in the dark.
const LEAST: f32 = 1.5e-4;
/// Nearest place that a lamp is weighed at besides the camera, metres: boats lie no nearer to a flare than this.
const WEIGHED_M: f64 = 100.0;

/// Time that a picture is exposed at night, seconds: half of a frame's.
const EXPOSURE_S: f64 = 1.0 / 60.0;
/// Luminous energy of a round's flash, candela seconds: the efficacy of a sooty flame (12.7 cd/kW, as of fires) for the .54 kJ that a heavy round
/// leaves to burn before its muzzle, a thirtieth of its energy.
const FLASH_CD_S: f64 = 6.9;
/// Distance of the muzzle from the camera, metres: the camera stands over the receiver, the barrel is as long as a heavy gun's.
const MUZZLE_M: f64 = 1.3;
/// Radius of a flash, metres.
const FLASH_RADIUS_M: f64 = 0.09;

/// The lights of the `boats` in view at `time`, for a camera that shows so many cd/m^2 as white.
pub(super) fn lights_in_view(
    running: &RunningWorld,
    view: &ViewFrustum<'_>,
    (time, white_cd_m2): (Time, f64),
    boats: &[BoatView],
    into: &mut Vec<LightView>,
) {
    into.clear();
    let fleet = &running.fleet;
    for boat in boats {
        for light in fleet.lights(boat.boat, time).iter().take(LIGHTS_A_BOAT - 1) {
            let at = boat.pose.to_world(light.place);
            let towards_eye = view.camera.position - at;
            let range_m = towards_eye.length();
            let is_hidden = at.z < boat.water_level
                || boat.beyond_horizon && towards_eye.z / range_m > horizon_dip(view.camera.position.z).sin();
            if is_hidden || range_m < 1.0 {
                continue;
            }
            let candela =
                light.candela_towards(boat.pose.world_from_body.inverse() * (towards_eye / range_m));
            let illuminance = candela * f64::from(1.0 - boat.haze) / (range_m * range_m);
            if candela > 0.0 {
                let light = light.colour.rgb() * (illuminance / white_cd_m2) as f32;
                into.push(LightView { boat: Some(boat.boat), at, light });
            }
        }
    }
    let time_s = time.secs_since(running.start);
    for fire in fires(running, view, white_cd_m2) {
        let Some(boat) = boats.iter().find(|boat| boat.boat == fire.boat) else { continue };
        let Some(at) = source_of(running, fire.boat, time)(time_s) else { continue };
        let range_m = view.camera.position.distance(at).max(1.0);
        let illuminance = fire.candela(time_s) * f64::from(1.0 - boat.haze) / (range_m * range_m);
        let light = Burning::colour() * (illuminance / white_cd_m2) as f32;
        into.push(LightView { boat: Some(fire.boat), at, light });
    }
}

/// Lamps at `time`, for a camera that shows so many cd/m^2 as white.
pub(super) fn lamps_at(
    running: &RunningWorld,
    view: &ViewFrustum<'_>,
    (time, white_cd_m2): (Time, f64),
    into: &mut Vec<LampView>,
) {
    into.clear();
    let extinction_per_m = extinction_per_m(view.visibility_m);
    let time_s = time.secs_since(running.start);
    let burning = fires(running, view, white_cd_m2).filter_map(|fire| {
        let foot = source_of(running, fire.boat, time)(time_s)?;
        let at = foot + DVec3::Z * (0.5 * fire.flame_height_m(time_s));
        let strength = Burning::colour() * (fire.candela(time_s) / white_cd_m2) as f32;
        Some(LampView { at, strength, extinction_per_m, is_high: false })
    });
    let flares = running.fleet.flares().iter().rev().filter_map(|flare| {
        let strength = Vec3::splat((flare.candela(time) / white_cd_m2) as f32);
        Some(LampView { at: flare.at(time)?, strength, extinction_per_m, is_high: true })
    });
    let lights = |lamp: &LampView| {
        let off_m = lamp.at.distance(view.camera.position);
        let near = view.camera.position.lerp(lamp.at, (1.0 - WEIGHED_M / off_m).max(0.0));
        lamp.matt_at(near).max_element() > LEAST
    };
    into.extend(burning.chain(flares.take(FLARES_MAX)).filter(lights).take(LAMPS_MAX));
}

/// Flares, as points of light.
pub(super) fn flares_in_view(lamps: &[LampView], view: &ViewFrustum<'_>, into: &mut Vec<LightView>) {
    into.extend(lamps.iter().filter(|lamp| lamp.is_high).map(|lamp| {
        // Towards the camera air takes its share as towards anything else.
        let light = lamp.matt_at(view.camera.position) * std::f32::consts::PI;
        LightView { boat: None, at: lamp.at, light }
    }));
}

/// The flash of a round that left the barrel while the picture of `time` was exposed; `muzzle` is where the muzzle is seen, as a direction in the
/// camera's axes.
pub(super) fn flash_at(
    running: &RunningWorld,
    view: &ViewFrustum<'_>,
    (time, white_cd_m2): (Time, f64),
    muzzle: DVec3,
    into: &mut Vec<RoundView>,
) -> Option<FlashView> {
    let flashes = running.fired.iter().filter(|fired| (0.0..EXPOSURE_S).contains(&time.secs_since(**fired)));
    let candela = FLASH_CD_S / EXPOSURE_S * flashes.count() as f64;
    if candela <= 0.0 {
        return None;
    }
    let strength = Burning::colour() * (candela / white_cd_m2) as f32;
    let at = view.camera.position + view.camera.world_from_camera * muzzle * MUZZLE_M;
    let area = std::f64::consts::PI * FLASH_RADIUS_M * FLASH_RADIUS_M;
    if into.len() >= ROUNDS_SEEN_MAX {
        // Farthest first: the flash is nearer than any.
        into.remove(0);
    }
    into.push(RoundView::Flame {
        at,
        radius_m: (2.0 * FLASH_RADIUS_M) as f32,
        light: strength / area as f32,
        seed: (time.secs_since(running.start) * 30.0 % 64.0) as f32,
    });
    // The barrel runs from the flash towards the camera: light falls on its top by the inverse square and the slant, h / x^3, whose mean this is.
    let (near_m, far_m) = (0.3_f64, MUZZLE_M);
    let mean = 0.5 * FLASH_RADIUS_M * (near_m.powi(-2) - far_m.powi(-2)) / (far_m - near_m);
    Some(FlashView { on_gun: strength * (FRAC_1_PI * mean) as f32 })
}

/// Pixel of the muzzle: the corner of what recoils nearest to where the bore vanishes; `None` where nothing is known to recoil.
pub(super) fn muzzle_px<'a>(recoiling: impl Iterator<Item = &'a [DVec2]>, bore: DVec2) -> Option<DVec2> {
    recoiling.flatten().min_by(|a, b| a.distance_squared(bore).total_cmp(&b.distance_squared(bore))).copied()
}
