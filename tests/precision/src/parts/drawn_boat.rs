//! One boat as the product draws it, near enough to be judged by its hull.

use std::cell::RefCell;

use anyhow::{Context as _, Result};
use bowwave_core::{
    estimate::light::{Light, SeaTones},
    event::Picture,
    frame::scene::{LeftOut, Pass, PassDecision, Scene},
    geometry::Lens,
    model::Model,
    sea::BeaufortForce,
    water::ReflectionMethod,
};
use bowwave_models::resolve;
use bowwave_render::SOFTWARE;
use glam::DVec3;
use image::RgbImage;

use crate::reflection::{
    draw::{Painter, picture},
    scenes::{self, Afloats},
};

/// The picture, pixels.
pub(super) const SIZE: (u32, u32) = (1280, 720);
/// Width of the view, degrees.
const HFOV_DEG: f64 = 40.0;
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
        let painter = Painter::new(SIZE, std::slice::from_ref(&model), &[], (1, Some(SOFTWARE)))?;
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

/// A direction by elevation and azimuth clockwise from ahead, degrees.
pub(super) fn towards(elevation_deg: f64, azimuth_deg: f64) -> DVec3 {
    let (up, level) = elevation_deg.to_radians().sin_cos();
    let (right, ahead) = azimuth_deg.to_radians().sin_cos();
    DVec3::new(level * right, level * ahead, up)
}
