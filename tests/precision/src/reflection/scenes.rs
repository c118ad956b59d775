//! Seas and boats that are made here, where no truth is needed.

use bowwave_core::{
    estimate::light::{Light, SeaTones},
    frame::{
        scene::{BoatView, Scene},
        view::ViewFrustum,
    },
    geometry::{CameraPose, Lens, RigidPose, look},
    model::{Model, ModelId},
    sea::BeaufortForce,
    sky::SkyLobes,
    water::{ReflectionMethod, ShadowLevel, Water},
    world::fleet::Afloat,
};
use glam::{DQuat, DVec2, DVec3, Vec3};
use image::{Rgb, RgbImage};

use super::draw::bare_scene;
use crate::truth::{
    boat::box_boat,
    cell::{HFOV_DEG, PICTURE},
};

/// Radiance of the sky in these scenes, linear.
pub const SKY: f32 = 0.5;

/// The truth's lens.
pub fn lens() -> Lens {
    Lens::pinhole(PICTURE.0, PICTURE.1, HFOV_DEG.to_radians())
}

/// A camera that looks north over the sea, down by half of what a boat at `range_m` is below it, as the truth's.
pub fn camera(eye_m: f64, range_m: f64) -> CameraPose {
    let depression = (eye_m / range_m).atan();
    CameraPose { world_from_camera: look(0.0, -depression / 2.0, 0.0), position: DVec3::new(0.0, 0.0, eye_m) }
}

/// Grey light.
pub fn light(sun: f32) -> Light {
    Light {
        sun_direction: DVec3::new(0.3, -0.5, 0.8).normalize(),
        sun: Vec3::splat(sun),
        sky: Vec3::splat(SKY),
        dome: SkyLobes::even(Vec3::splat(SKY)),
        horizon: Vec3::splat(SKY),
        sea: Vec3::splat(0.08),
    }
}

/// The truth's box boat, all of it in one grey.
pub fn grey_boat(albedo: f32) -> Model {
    let mut model = box_boat();
    model.vertices.iter_mut().for_each(|v| v.albedo = Vec3::splat(albedo));
    model
}

/// A picture of sky over sea whose waves are sines that get longer and higher on the screen towards its lower edge: code `mean`, moved by
/// up to `height` codes.
pub fn sea(lens: &Lens, camera: &CameraPose, mean: f64, height: f64) -> RgbImage {
    RgbImage::from_fn(lens.width, lens.height, |x, y| {
        let at = glam::DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let ray = camera.world_from_camera * lens.unproject(at);
        if ray.z >= -1e-4 {
            return Rgb([188; 3]);
        }
        let water = camera.position.truncate() + ray.truncate() * (camera.position.z.max(0.5) / -ray.z);
        // What is finer than a pixel's footprint is not seen.
        let footprint = camera.position.z.max(0.5) / (ray.z * ray.z) / lens.focal.y;
        let waves = [(9.0, 0.6, 0.2), (4.1, -0.3, 1.3), (1.9, 0.9, 2.9), (0.8, -0.7, 4.1), (0.37, 0.4, 5.3)];
        let sum: f64 = waves
            .iter()
            .map(|(length, slant, phase): &(f64, f64, f64)| {
                let along = (water.y + slant * water.x) / length;
                let kept = (-(2.0 * footprint / length).powi(2)).exp();
                kept * (std::f64::consts::TAU * along + phase).sin()
            })
            .sum();
        let code = (mean + height * sum / 2.5).clamp(0.0, 255.0).round() as u8;
        Rgb([code; 3])
    })
}

/// Where a boat is and how it lies in the water.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Afloats {
    /// Horizontal distance ahead, metres.
    pub range_m: f64,
    /// To the right, metres.
    pub right_m: f64,
    /// Where the bow points, degrees clockwise from the direction of view.
    pub heading_deg: f64,
    /// Height of the water at it, metres.
    pub water_level: f64,
    /// Height of its origin over that water, metres.
    pub lifted_m: f64,
    /// Bow up, degrees.
    pub pitch_deg: f64,
    /// To starboard, degrees.
    pub roll_deg: f64,
}

impl Afloats {
    /// Upright and almost abeam on the mean water, as in the truth's grid.
    pub fn at(range_m: f64) -> Self {
        Self {
            range_m,
            right_m: 0.0,
            heading_deg: 80.0,
            water_level: 0.0,
            lifted_m: 0.0,
            pitch_deg: 0.0,
            roll_deg: 0.0,
        }
    }

    /// The pose of its boat.
    pub fn pose(&self) -> RigidPose {
        let level = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2 - self.heading_deg.to_radians());
        let pitch = DQuat::from_rotation_y(-self.pitch_deg.to_radians());
        let roll = DQuat::from_rotation_x(self.roll_deg.to_radians());
        let position = DVec3::new(self.right_m, self.range_m, self.water_level + self.lifted_m);
        RigidPose { world_from_body: level * pitch * roll, position }
    }
}

/// A boat as it is seen where the Earth is flat.
pub fn flat(seen: BoatView, pose: RigidPose, water_level: f64) -> BoatView {
    BoatView { pose, water_level: water_level + seen.hidden_m, beyond_horizon: false, ..seen }
}

/// A scene over a sea of those tones: `model`'s boats in the wind of a force that comes from ahead on the left. The Earth is flat.
pub fn scene(
    (camera, lens): (CameraPose, Lens),
    tones: SeaTones,
    model: &Model,
    boats: &[Afloats],
    (method, force): (ReflectionMethod, BeaufortForce),
) -> Scene {
    let light = light(0.0);
    let mut scene = bare_scene(camera, lens, Water { method, force, shadow: ShadowLevel::None }, light);
    scene.tones = tones;
    scene.wind = DVec2::new(0.6, -0.8) * force.wind_mean_m_s();
    let wind = scene.wind;
    let eye = ViewFrustum {
        camera: &camera,
        lens: &lens,
        visibility_m: 1e9,
        wind,
        reflections: true,
        wakes: false,
        water_within_m: f64::INFINITY,
    };
    for (boat, afloat) in boats.iter().enumerate() {
        let (pose, water_level) = (afloat.pose(), afloat.water_level);
        let seen = eye.see(&Afloat { boat, model_id: ModelId(0), model, pose, water_level });
        scene.boats.extend(seen.map(|b| flat(b, pose, water_level)));
    }
    scene.boats.sort_by(|a, b| b.range_m.total_cmp(&a.range_m));
    scene
}
