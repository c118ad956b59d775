//! Navigation lights and fires in view: how much light of each comes to the camera.

use super::{
    fires::Burning,
    rounds::{fires, source_of},
    scene::{BoatView, LightView},
    view::ViewFrustum,
};
use crate::{geometry::horizon_dip, time::Time, world::RunningWorld};

/// Most lights of a boat, its fire among them.
pub const LIGHTS_A_BOAT: usize = 7;

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
