//! One boat as the product draws it, near enough to be judged by its hull.

use std::cell::RefCell;

use anyhow::{Context as _, Result};
use bowwave_core::{
    estimate::light::{Light, SeaTones},
    event::Picture,
    frame::scene::{BoatView, LeftOut, Pass, PassDecision, Scene},
    geometry::{Lens, RigidPose},
    model::{Model, ModelId},
    sea::BeaufortForce,
    water::ReflectionMethod,
};
use bowwave_models::resolve;
use bowwave_render::SOFTWARE;
use glam::{DQuat, DVec3, Vec3};
use image::RgbImage;

use crate::{
    reflection::{
        draw::{Painter, picture},
        scenes::{self, Afloats},
    },
    truth::boat::block,
};

/// The picture, pixels.
pub(super) const SIZE: (u32, u32) = (1280, 720);
/// Width of the view, degrees.
const HFOV_DEG: f64 = 40.0;
/// Sides of what stands before the sun where a boat is to be in the shade, metres.
const BLOCK_M: f32 = 400.0;
/// Height of the eye, metres.
pub(super) const EYE_M: f64 = 8.0;

/// A boat and what draws it.
pub(super) struct DrawnBoat {
    pub(super) model: Model,
    painter: RefCell<Painter>,
    black: Picture,
}

impl DrawnBoat {
    /// A boat of that name.
    pub(super) fn new(name: &str) -> Result<Self> {
        let mut model = resolve(name, std::path::Path::new(""))?;
        // Rays do not look at textures.
        model.texture = None;
        let half = Vec3::splat(BLOCK_M / 2.0);
        let models = [model, block(-half, half, Vec3::ZERO)];
        let painter = Painter::new(SIZE, &models, &[], (models.len(), Some(SOFTWARE)))?;
        let [model, _] = models;
        Ok(Self { model, painter: RefCell::new(painter), black: picture(&RgbImage::new(SIZE.0, SIZE.1))? })
    }

    /// Its scene: no reflection, and shadows where the sun shines.
    pub(super) fn scene(&self, range_m: f64, afloat: Afloats, light: Light) -> Result<Scene> {
        let lens = Lens::pinhole(SIZE.0, SIZE.1, HFOV_DEG.to_radians());
        let camera = scenes::camera(EYE_M, range_m);
        let calm = BeaufortForce::new(1).context("no such force")?;
        let (tones, off) = (SeaTones::default(), (ReflectionMethod::Off, calm));
        let mut scene = scenes::scene((camera, lens), tones, &self.model, &[afloat], off);
        for pass in [Pass::Mirror, Pass::Water, Pass::Hud] {
            scene.passes[pass as usize] = PassDecision::LeftOut(LeftOut::ReflectionOff);
        }
        scene.light = light;
        scene.passes[Pass::Shadow as usize] =
            if light.sun_shines() { PassDecision::Run } else { PassDecision::LeftOut(LeftOut::NoSun) };
        Ok(scene)
    }

    /// Draws a scene over black.
    pub(super) fn paint(&self, scene: &Scene) -> Result<RgbImage> {
        self.paint_over(scene, &self.black)
    }

    /// Draws a scene over a picture.
    pub(super) fn paint_over(&self, scene: &Scene, before: &Picture) -> Result<RgbImage> {
        self.painter.borrow_mut().paint(scene, before)
    }
}

/// A boat a little heeled and trimmed, straight ahead.
pub(super) fn afloat(range_m: f64, heading_deg: f64) -> Afloats {
    Afloats { heading_deg, roll_deg: 4.0, pitch_deg: 2.0, ..Afloats::at(range_m) }
}

/// The scene without the shadow's pass.
pub(super) fn without_shadow(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.passes[Pass::Shadow as usize] = PassDecision::LeftOut(LeftOut::NoSun);
    scene
}

/// The scene with a block between the boat and the sun that is not in the picture. So all of the sun's disc is hidden; what comes of the sun by way
/// of the hull is still there, as the product has it.
pub(super) fn in_shade(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    if let Some(boat) = scene.boats.first().cloned() {
        let away = scene.light.sun_direction * f64::from(2.0 * BLOCK_M);
        let pose = RigidPose { world_from_body: DQuat::IDENTITY, position: boat.pose.position + away };
        scene.boats.push(BoatView { model: ModelId(1), pose, hull: None, wake: None, ..boat });
    }
    scene
}

/// A direction by elevation and azimuth clockwise from ahead, degrees.
pub(super) fn towards(elevation_deg: f64, azimuth_deg: f64) -> DVec3 {
    let (up, level) = elevation_deg.to_radians().sin_cos();
    let (right, ahead) = azimuth_deg.to_radians().sin_cos();
    DVec3::new(level * right, level * ahead, up)
}

#[cfg(test)]
mod tests {
    use bowwave_core::sky::SkyLobes;

    use super::*;

    #[test]
    fn a_boat_in_the_shade_has_no_sun_but_what_its_hull_throws() {
        let drawn = DrawnBoat::new("skiff").unwrap();
        let sky = Vec3::splat(0.1);
        for sun_direction in [towards(3.0, 100.0), towards(40.0, 200.0), DVec3::Z] {
            let light = Light {
                sun_direction,
                sun: Vec3::splat(0.7),
                sky,
                dome: SkyLobes::even(sky),
                horizon: sky,
                sea: 0.2 * sky,
            };
            let scene = drawn.scene(60.0, afloat(60.0, 70.0), light).unwrap();
            let sunless = Scene { light: Light { sun: Vec3::ZERO, ..light }, ..without_shadow(&scene) };
            let [lit, shaded, sunless] =
                [&without_shadow(&scene), &in_shade(&scene), &sunless].map(|s| drawn.paint(s).unwrap());
            let codes = |picture: &RgbImage| picture.pixels().map(|p| u64::from(p.0[1])).sum::<u64>();
            let between = sunless.pixels().zip(shaded.pixels()).zip(lit.pixels());
            let off = between.filter(|((low, at), high)| at.0[1] + 3 < low.0[1] || at.0[1] > high.0[1] + 3);
            // A pixel of an edge has its middle beyond the triangle, where the light of its corners is drawn on.
            let off = off.count();
            assert!(off <= 2, "{off} pixels");
            // The hull throws less than half of what the sun brings.
            let (low, at, high) = (codes(&sunless), codes(&shaded), codes(&lit));
            assert!(low < at && 2 * (at - low) < high - low, "{low} {at} {high}");
        }
    }
}
