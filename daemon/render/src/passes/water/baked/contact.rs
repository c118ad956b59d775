//! The shadow of a hull on the water by the scene's own light, in place of eq. 7.

use bowwave_core::{
    colour::LUMINANCE,
    estimate::light::Light,
    frame::scene::{BoatView, Scene},
    sea::mean_square_slope,
};
use glam::{DVec2, Vec3};
use shaders_spirv::interface::{ContactBlock, WaterBlock};

use crate::passes::water::{SEEN_DOWN, block::mirrored_sky, line::HullLine};

/// The hull's shadow is followed so far, in its heights: there a wall hides a hundredth of the sky.
const CONTACT_HEIGHTS: f64 = 2.5;
/// Light that comes out of clear water, as a share of a white matt surface (Mobley 1994, fig. 3.27): no less does.
const CLEAR_WATER: f64 = 0.015;
/// A shadow of less is not seen: half a code of a mid grey.
const CONTACT_SEEN: f64 = 0.01;

/// The shadow's own block; and in `common`, how strong the shadow is at most and how far it reaches.
pub(crate) fn contact_block(
    scene: &Scene,
    boat: &BoatView,
    line: &HullLine,
    common: &mut WaterBlock,
) -> ContactBlock {
    let eye = (scene.camera.position.z - boat.water_level).max(0.01);
    let away = (boat.pose.position - scene.camera.position).truncate();
    let range = away.length().max(0.1);
    let (tangent, per_pixel) = (eye / range, 1.0 / scene.lens.focal.y);
    let high = line.height * range * per_pixel;
    let contact = Contact::of(&scene.light, away / range, tangent, high, scene.wind.length());
    let reach = contact.sun_m.max(CONTACT_HEIGHTS * high).min(0.8 * range);
    let reach_px = (eye / (range - reach) - tangent) / per_pixel;
    let seen = contact.sky * 0.5 + contact.sun > CONTACT_SEEN;
    common.shadow = if seen { 1.0 } else { 0.0 };
    common.shadow_fall = (1.0 / reach_px.max(1.0)) as f32;
    ContactBlock {
        sight: [tangent, per_pixel, eye, high].map(|v| v as f32),
        sky: contact.sky as f32,
        sun: contact.sun as f32,
        sun_m: contact.sun_m as f32,
        ..ContactBlock::default()
    }
}

/// Light that a hull can keep from the water before it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Contact {
    /// Share of the sea's light that the sky made within the water.
    sky: f64,
    /// The same of the sun, where the hull's shadow lies on this side of it.
    sun: f64,
    /// How far towards the eye that shadow reaches, metres.
    sun_m: f64,
}

impl Contact {
    /// For a hull of a height that is seen along the unit vector `away` with that tangent below the horizontal.
    fn of(light: &Light, away: DVec2, tangent: f64, high_m: f64, wind_m_s: f64) -> Self {
        let rough = mean_square_slope(wind_m_s).sqrt();
        let luminance = |v: Vec3| f64::from(v.dot(LUMINANCE));
        // What the picture's sea holds beyond the mirrored sky has come out of the water.
        let mirrored = |down: f64| luminance(mirrored_sky(light, down, rough));
        let up = light.sun_direction.z.max(0.0);
        let (sun, sky) = (luminance(light.sun) * up, luminance(light.sky));
        let body = (luminance(light.sea) - mirrored(SEEN_DOWN)).max(CLEAR_WATER * (sun + sky));
        let share = body / (body + mirrored(tangent)).max(1e-6);
        let of_sun = sun / (sun + sky).max(1e-6);
        // Away from the sun the shadow falls; towards the eye where the sun stands behind the boat.
        let towards_eye = light.sun_direction.truncate().dot(away);
        let sun_m = if towards_eye > 0.0 { high_m * towards_eye / up.max(0.02) } else { 0.0 };
        let sun = if sun_m > 0.0 { share * of_sun } else { 0.0 };
        Self { sky: share * (1.0 - of_sun), sun, sun_m }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::testing;

    #[test]
    fn a_hull_keeps_from_the_water_what_had_come_out_of_it() {
        let mut light = testing::empty_scene(64, 64).light;
        let of = |light: &Light| Contact::of(light, DVec2::Y, 0.1, 2.0, 3.0);
        // The sun stands to the south, behind the eye: no shadow on this side, and the sky's part of the water's light.
        light.sea = Vec3::splat(0.4);
        light.sun_direction = DVec3::new(0.0, -0.8, 0.6);
        let behind_eye = of(&light);
        assert_eq!((behind_eye.sun, behind_eye.sun_m), (0.0, 0.0));
        assert!(behind_eye.sky > 0.0 && behind_eye.sky < 0.5, "{behind_eye:?}");
        // Behind the boat it throws the hull's shadow 2 m * 0.8 / 0.6 towards the eye.
        light.sun_direction = DVec3::new(0.0, 0.8, 0.6);
        let behind_boat = of(&light);
        assert!((behind_boat.sun_m - 2.0 * 0.8 / 0.6).abs() < 1e-9);
        assert!(behind_boat.sun > behind_boat.sky);
        // Of a sea that is darker than the sky that it mirrors, what clear water gives is kept off: a few hundredths.
        light.sea = Vec3::splat(1e-3);
        let dark = of(&light);
        assert!(
            dark.sky > 0.0 && dark.sky + dark.sun < 0.15 * (behind_boat.sky + behind_boat.sun),
            "{dark:?}"
        );
        light.sun_direction = DVec3::new(0.0, 0.0, -1.0);
        assert!(of(&light).sun_m.is_finite());
    }
}
