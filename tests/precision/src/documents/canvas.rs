//! Pictures of the simulated camera, and what the product's own renderer draws over them.

use std::time::Duration;

use anyhow::{Context as _, Result};
use bowwave_core::{
    estimate::light::Light,
    frame::{
        scene::{Pass, PassDecision, Scene},
        view::ViewFrustum,
    },
    geometry::{CameraPose, Lens, RigidPose},
    model::{Model, ModelId},
    own_ship::Phantoms,
    sea::BeaufortForce,
    water::{ReflectionMethod, ShadowLevel, Water},
    world::fleet::Afloat,
};
use bowwave_render::{DrawRequest, Needs, PictureShape, RenderConfig, Renderer, SOFTWARE, TimeOuts};
use glam::{DQuat, DVec2, DVec3};
use hw_sim::make::{Recipe, Studio};
use image::{RgbImage, imageops};

use crate::{
    parts::relight::bell,
    path_traced::{Kind, TracedLight},
    reflection::draw::{bare_scene, picture, tones},
    truth::files::{code, linear},
};

/// Size of drawn pictures.
pub const SIZE: (u32, u32) = (640, 360);
/// Longest wait for a frame: others may keep the processor that draws.
const WAIT: Duration = Duration::from_secs(120);

/// A sea as the simulated camera took it.
pub struct SeaShot {
    /// The picture.
    pub picture: RgbImage,
    /// Where the camera was.
    pub camera: CameraPose,
    /// Its lens.
    pub lens: Lens,
    /// Unit vector towards the sun.
    pub sun: DVec3,
}

impl SeaShot {
    /// With the sun so high and so far clockwise from north, degrees, in air of that visibility.
    pub fn new([elevation_deg, azimuth_deg]: [f64; 2], visibility_m: f64) -> Result<Self> {
        let base = Recipe::default();
        let mut sky = base.sky;
        (sky.sun_elevation, sky.sun_azimuth) = (elevation_deg.to_radians(), azimuth_deg.to_radians());
        let recipe = Recipe { width: SIZE.0, height: SIZE.1, frame_rate_hz: 1.0, visibility_m, sky, ..base };
        let (camera, rgb) = Studio::new(&recipe)?.shoot_rgb(0);
        let picture = RgbImage::from_raw(SIZE.0, SIZE.1, rgb).context("a drawn picture of another size")?;
        let (sin, cos) = sky.sun_azimuth.sin_cos();
        let (up, level) = sky.sun_elevation.sin_cos();
        Ok(Self { picture, camera, lens: recipe.lens(), sun: DVec3::new(level * sin, level * cos, up) })
    }

    /// The same by night: so much of its light, and noise of so many codes.
    pub fn darkened(self, share: f32, noise: f32) -> Self {
        let mut picture = self.picture;
        for (i, value) in picture.iter_mut().enumerate() {
            let dark = f32::from(code(linear(*value) * share)) + noise * bell(i as u64) as f32;
            *value = dark.round().clamp(0.0, 255.0) as u8;
        }
        Self { picture, ..self }
    }

    /// A pose on the water: metres ahead, degrees to the right, and where the bow points by the direction of view.
    pub fn afloat(&self, range_m: f64, right_deg: f64, heading_deg: f64) -> RigidPose {
        let ahead = (self.camera.world_from_camera * DVec3::Z).truncate().normalize_or(DVec2::Y);
        let turned = |deg: f64| DVec2::from_angle(-deg.to_radians()).rotate(ahead);
        let bow = turned(heading_deg);
        RigidPose {
            world_from_body: DQuat::from_rotation_z(bow.y.atan2(bow.x)),
            position: (self.camera.position.truncate() + turned(right_deg) * range_m).extend(0.0),
        }
    }

    /// The sun's and the sky's light on boats; white that faces the sun is so bright.
    pub fn light(&self, white: f32) -> Result<Light> {
        Ok(TracedLight::new(Kind::Clear, self.sun, white)?.product())
    }

    /// Its scene with these boats of `models`.
    pub fn scene(
        &self,
        light: Light,
        models: &[Model],
        boats: &[(usize, RigidPose)],
        visibility_m: f64,
    ) -> Result<Scene> {
        let force = BeaufortForce::new(2).context("no such force")?;
        let water = Water { method: ReflectionMethod::Baked, force, shadow: ShadowLevel::None };
        let mut scene = bare_scene(self.camera, self.lens, water, light);
        scene.tones = tones(&self.picture, &self.lens, &self.camera);
        scene.wind = DVec2::new(0.6, -0.8) * force.wind_mean_m_s();
        let eye = ViewFrustum {
            camera: &self.camera,
            lens: &self.lens,
            visibility_m,
            wind: scene.wind,
            reflections: true,
            wakes: false,
            water_within_m: f64::INFINITY,
        };
        for (boat, (model, pose)) in boats.iter().enumerate() {
            let of = Afloat {
                boat,
                model_id: ModelId(u16::try_from(*model)?),
                model: models.get(*model).context("no such model")?,
                pose: *pose,
                water_level: 0.0,
            };
            scene.boats.extend(eye.see(&of));
        }
        scene.boats.sort_by(|a, b| b.range_m.total_cmp(&a.range_m));
        if light.sun_shines() {
            scene.passes[Pass::Shadow as usize] = PassDecision::Run;
        }
        Ok(scene)
    }

    /// What the product draws of a scene over this picture.
    pub fn draw(&self, scene: &Scene, models: &[Model], phantoms: Phantoms) -> Result<RgbImage> {
        draw_over(&self.picture, scene, models, phantoms)
    }
}

/// What the product draws of a scene over a picture, on the software driver.
pub fn draw_over(before: &RgbImage, scene: &Scene, models: &[Model], phantoms: Phantoms) -> Result<RgbImage> {
    let before = picture(before)?;
    let config = RenderConfig {
        width: before.width(),
        height: before.height(),
        device: Some(SOFTWARE.to_owned()),
        validation: false,
        frames_in_flight: 1,
        needs: Needs {
            noise: false,
            boats_max: scene.boats.len(),
            lights_max: scene.lights.len(),
            lamps: scene.runs(Pass::Lamplight),
            rounds_max: scene.rounds.len(),
            wakes_max: 0,
            waters: vec![(scene.water.method, scene.water.shadow)],
            optics: scene.lens.optics(),
            phantoms,
        },
        picture: Some(PictureShape::of(&before)),
        time_outs: TimeOuts { frame: WAIT, warm_up: WAIT },
    };
    let (mut renderer, mut done) = Renderer::new(&config, models)?;
    renderer.submit(DrawRequest::new(scene, &before, true))?;
    let frame = done.wait_next(WAIT)?.context("no frame within two minutes")?;
    let rgb = frame.rgba().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    RgbImage::from_raw(before.width(), before.height(), rgb).context("a frame of another size")
}

/// Pixels around the first boat of a scene.
pub fn around(scene: &Scene) -> Result<[u32; 4]> {
    let hull = scene.boats.first().and_then(|b| b.hull).context("the boat is out of the picture")?;
    let (x, y) = (hull.x.saturating_sub(12), hull.y.saturating_sub(12));
    Ok([x, y, (hull.width + 24).min(SIZE.0 - x), (hull.height + 40).min(SIZE.1 - y)])
}

/// A part of a picture, enlarged so many times without smoothing.
pub fn crop(of: &RgbImage, [x, y, width, height]: [u32; 4], times: u32) -> RgbImage {
    let part = imageops::crop_imm(of, x, y, width, height).to_image();
    imageops::resize(&part, width * times, height * times, imageops::FilterType::Nearest)
}

/// A picture in which light is `gain` times as strong, so that a dark one is seen on a page.
pub fn brightened(of: &RgbImage, gain: f32) -> RgbImage {
    let mut made = of.clone();
    made.iter_mut().for_each(|value| *value = code((linear(*value) * gain).min(1.0)));
    made
}
