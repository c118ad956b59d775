//! A cell as the trainer sees it, and the renderer that draws it.

use std::{sync::Arc, time::Duration};

use anyhow::{Context, Result, ensure};
use bowwave_core::{
    colour::LUMINANCE,
    estimate::light::{SKY_SINES, SeaTones, SkyLight, ToneSample},
    event::{Picture, PixelFormat},
    frame::{
        plan::sea_reflects,
        scene::{Hud, LeftOut, Pass, PassDecision, Scene},
        view::ViewFrustum,
    },
    geometry::{CameraPose, Lens, Optics},
    model::{Model, ModelId},
    sea::BeaufortForce,
    water::{ReflectionMethod, ShadowLevel, Water},
    world::fleet::Afloat,
};
use bowwave_render::{
    Completions, DrawRequest, FinishedFrame, Needs, RenderConfig, Renderer, SOFTWARE, TimeOuts,
};
use glam::{DQuat, DVec2, DVec3, Vec3};
use image::RgbImage;

use super::{cell::TruthCell, scenes::flat};
use crate::truth::boat;

/// Sea closer to the horizon than this is not measured, tangent.
const TANGENT_MIN: f64 = 0.004;

/// Estimates of a scene that the trainer has beside the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beliefs {
    /// Wind 10 m above the sea, m/s.
    pub wind_m_s: f64,
    /// Where it comes from, radians clockwise from north.
    pub wind_from: f64,
    /// The wind's force.
    pub force: BeaufortForce,
    /// Factor to the radiance of the sky that boats hide from the sea.
    pub sky: f32,
    /// Factor to the sky's light on the boat.
    pub skylight: f32,
    /// The eye's height.
    pub eye: EyeHeight,
    /// Which quantity holds with a wrong eye height: the boat's place in the picture, from which its range and size follow, so that everything is
    /// larger or smaller, seen alike; or its range and size, so that the water is seen under another angle. Either way the
    /// boat stands where the truth has it.
    pub range_kept: bool,
}

/// The eye's height by the right one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EyeHeight {
    /// It.
    Right,
    /// A tenth too low.
    Low,
    /// A tenth too high.
    High,
}

impl EyeHeight {
    const ALL: [Self; 3] = [Self::Right, Self::Low, Self::High];

    fn scale(self) -> f64 {
        match self {
            Self::Right => 1.0,
            Self::Low => 0.9,
            Self::High => 1.1,
        }
    }
}

impl Beliefs {
    /// The right ones.
    pub fn right(cell: &TruthCell) -> Self {
        Self {
            wind_m_s: cell.wind_m_s,
            wind_from: cell.wind_from,
            force: BeaufortForce::of_wind(cell.wind_m_s),
            sky: 1.0,
            skylight: 1.0,
            eye: EyeHeight::Right,
            range_kept: false,
        }
    }
}

/// The scene of a cell, seen through the region of interest alone. A method that a session would leave out in a sea of that force is
/// left out here as well.
pub fn scene(cell: &TruthCell, method: ReflectionMethod, beliefs: &Beliefs, models: &DrawnModels) -> Scene {
    let seen = if sea_reflects(beliefs.force) { method } else { ReflectionMethod::Off };
    forced_scene(cell, seen, beliefs, models)
}

/// The same in any sea.
pub fn forced_scene(
    cell: &TruthCell,
    method: ReflectionMethod,
    beliefs: &Beliefs,
    models: &DrawnModels,
) -> Scene {
    let (camera, pose, size) = if beliefs.range_kept {
        (higher(&cell.camera, beliefs.eye.scale(), cell.pose.position), cell.pose, EyeHeight::Right)
    } else {
        let (mut camera, mut pose, scale) = (cell.camera, cell.pose, beliefs.eye.scale());
        camera.position *= scale;
        pose.position *= scale;
        (camera, pose, beliefs.eye)
    };
    let (model_id, model) = models.of(size);
    let wind = -DVec2::new(beliefs.wind_from.sin(), beliefs.wind_from.cos()) * beliefs.wind_m_s;
    let eye = ViewFrustum {
        camera: &camera,
        lens: &cell.lens,
        visibility_m: 1e9,
        wind,
        reflections: true,
        wakes: false,
        water_within_m: f64::INFINITY,
    };
    let water_level = pose.position.z;
    let boat = eye.see(&Afloat { boat: 0, model_id, model, pose, water_level });
    let mut light = cell.light;
    light.sky *= beliefs.skylight;
    light.horizon *= beliefs.sky;
    Scene {
        boats: boat.map(|b| flat(b, pose, water_level)).into_iter().collect(),
        light,
        wind,
        sky: SkyLight { nodes: SKY_SINES.map(|s| cell.sky_at(s.asin().to_degrees()) * beliefs.sky) },
        tones: tones(&cell.without, &cell.lens, &camera),
        ..bare_scene(
            camera,
            cell.lens,
            Water { method, force: beliefs.force, shadow: ShadowLevel::None },
            light,
        )
    }
}

/// A camera `factor` times as high that has `place` at the same height in its picture.
fn higher(camera: &CameraPose, factor: f64, place: DVec3) -> CameraPose {
    let position = camera.position * DVec3::new(1.0, 1.0, factor);
    let below = |eye: DVec3| ((eye.z - place.z) / (place - eye).truncate().length()).atan();
    // Camera y is down: what turns z towards it is a negative turn about x.
    let down = DQuat::from_rotation_x(below(camera.position) - below(position));
    CameraPose { world_from_camera: camera.world_from_camera * down, position }
}

/// A scene without boats that runs the passes of boats and water all the same.
pub fn bare_scene(
    camera: CameraPose,
    lens: Lens,
    water: Water,
    light: bowwave_core::estimate::light::Light,
) -> Scene {
    let mut passes = [PassDecision::LeftOut(LeftOut::NoRounds); Pass::COUNT];
    for pass in [Pass::Video, Pass::Mirror, Pass::Water, Pass::Boats] {
        passes[pass as usize] = PassDecision::Run;
    }
    Scene {
        frame: 0,
        time_s: 0.0,
        camera,
        lens,
        passes,
        boats: Vec::new(),
        rounds: Vec::new(),
        lights: Vec::new(),
        lamps: Vec::new(),
        flash: None,
        searchlight: None,
        recoil: 1.0,
        light,
        water,
        wind: DVec2::ZERO,
        sky: SkyLight::of_bands(light.horizon, light.sky),
        tones: SeaTones::default(),
        noise: None,
        hud: Hud::READY,
        guide: None,
    }
}

/// How bright the sea of a picture is.
pub fn tones(picture: &RgbImage, lens: &Lens, camera: &CameraPose) -> SeaTones {
    let sample = |(x, y, pixel): (u32, u32, &image::Rgb<u8>)| {
        let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let code = Vec3::from_array(pixel.0.map(|c| f32::from(c) / 255.0));
        let tangent = camera.tangent_below(lens, at);
        (tangent > TANGENT_MIN).then(|| ToneSample { tangent, luma: f64::from(code.dot(LUMINANCE)) })
    };
    let samples: Vec<ToneSample> = picture.enumerate_pixels().filter_map(sample).collect();
    SeaTones::fit(&samples).unwrap_or_default()
}

/// A boat in the sizes that eye heights make of it.
pub struct DrawnModels {
    name: String,
    list: Vec<Model>,
}

impl DrawnModels {
    /// Of the truth's boat of that name.
    pub fn named(name: &str) -> Result<Self> {
        Ok(Self::of_model(&boat::model(name)?))
    }

    /// Of a model.
    pub fn of_model(model: &Model) -> Self {
        let list = EyeHeight::ALL.map(|eye| scaled(model, eye.scale()));
        Self { name: model.name.clone(), list: list.to_vec() }
    }

    /// All sizes, as a renderer wants them.
    pub fn list(&self) -> &[Model] {
        &self.list
    }

    /// The model that is used with an eye of that height.
    pub fn of(&self, eye: EyeHeight) -> (ModelId, &Model) {
        let index = eye as u16;
        (ModelId(index), &self.list[usize::from(index)])
    }
}

fn scaled(model: &Model, scale: f64) -> Model {
    let mut out = model.clone();
    let single = scale as f32;
    out.vertices.iter_mut().for_each(|v| v.position *= single);
    out.waterline.iter_mut().for_each(|p| *p *= scale);
    (out.min, out.max) = (model.min * single, model.max * single);
    out
}

/// One frame in so many has the times of its passes.
pub const TIMED_EVERY: u64 = 4;

/// A renderer for pictures of one size that can mirror in every way; nothing but compiled shaders stays from frame to frame.
pub struct Painter {
    renderer: Renderer,
    done: Completions,
    size: (u32, u32),
}

impl Painter {
    /// For any of `methods`, on a device that is named as in [`RenderConfig`].
    pub fn new(
        size: (u32, u32),
        models: &[Model],
        methods: &[ReflectionMethod],
        boats_on: (usize, Option<&str>),
    ) -> Result<Self> {
        Self::through(Optics::default(), size, models, methods, boats_on)
    }

    /// The same through a lens and shutter that need `optics`.
    pub fn through(
        optics: Optics,
        size: (u32, u32),
        models: &[Model],
        methods: &[ReflectionMethod],
        (boats_max, device): (usize, Option<&str>),
    ) -> Result<Self> {
        let waters = methods.iter().map(|m| (*m, ShadowLevel::None)).collect();
        let config = RenderConfig {
            width: size.0,
            height: size.1,
            device: device.map(str::to_owned),
            validation: false,
            frames_in_flight: 1,
            needs: Needs {
                noise: false,
                boats_max,
                lights_max: 0,
                lamps: false,
                rounds_max: 0,
                wakes_max: 0,
                waters,
                optics,
                phantoms: Default::default(),
            },
            picture: None,
            // Others may keep the processor that draws.
            time_outs: TimeOuts { frame: Duration::from_secs(60), warm_up: Duration::from_secs(120) },
        };
        let (mut renderer, done) = Renderer::new(&config, models)?;
        renderer.time_every(TIMED_EVERY);
        Ok(Self { renderer, done, size })
    }

    /// Memory on the device, bytes.
    pub fn bytes(&self) -> usize {
        self.renderer.memory().iter().map(|(_, bytes)| *bytes as usize).sum()
    }

    /// Draws one frame over a new picture.
    pub fn paint(&mut self, scene: &Scene, picture: &Picture) -> Result<RgbImage> {
        let size = self.size;
        let frame = self.frame(scene, picture)?;
        let rgb = frame.rgba().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        RgbImage::from_raw(size.0, size.1, rgb).context("a frame of another size")
    }

    /// The same, with what is known of the frame.
    pub fn frame(&mut self, scene: &Scene, picture: &Picture) -> Result<FinishedFrame> {
        self.renderer.submit(DrawRequest::new(scene, picture, true))?;
        self.done.wait_next(Duration::from_secs(120))?.context("no frame within two minutes")
    }
}

/// The picture as it comes from a camera.
pub fn picture(of: &RgbImage) -> Result<Picture> {
    let bytes: Arc<[u8]> = Arc::from(of.as_raw().as_slice());
    Ok(Picture::new(PixelFormat::Rgb, of.width(), of.height(), bytes)?)
}

/// Draws cells with software Vulkan, whose frames are the same everywhere. One renderer stays until a cell of another size or boat comes.
#[derive(Default)]
pub struct DrawingStudio {
    models: Option<DrawnModels>,
    painter: Option<Painter>,
}

impl DrawingStudio {
    /// Draws a cell.
    pub fn draw(
        &mut self,
        cell: &TruthCell,
        method: ReflectionMethod,
        beliefs: &Beliefs,
    ) -> Result<RgbImage> {
        self.draw_scene(cell, |models| scene(cell, method, beliefs, models))
    }

    /// Draws a scene over a cell's picture.
    pub fn draw_scene(
        &mut self,
        cell: &TruthCell,
        scene: impl FnOnce(&DrawnModels) -> Scene,
    ) -> Result<RgbImage> {
        let models = match self.models.take() {
            Some(models) if models.name == cell.boat => models,
            _ => {
                self.painter = None;
                DrawnModels::named(&cell.boat)?
            }
        };
        ensure!(!models.list.is_empty(), "{}: no model", cell.name);
        let painter = match self.painter.take() {
            Some(painter) if painter.size == cell.size() => painter,
            _ => Painter::new(cell.size(), &models.list, &ReflectionMethod::ALL, (1, Some(SOFTWARE)))?,
        };
        let drawn = self
            .painter
            .insert(painter)
            .paint(&scene(&models), &picture(&cell.without)?)
            .with_context(|| cell.name.clone());
        self.models = Some(models);
        drawn
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reflection::scenes;

    #[test]
    fn a_wrong_height_leaves_the_boat_where_it_is_in_the_picture() {
        let (lens, camera) = (scenes::lens(), scenes::camera(8.0, 60.0));
        let place = DVec3::new(0.0, 60.0, 0.2);
        let pixel = |camera: &CameraPose| lens.project(camera.to_camera(place)).unwrap();
        let wrong = higher(&camera, 1.1, place);
        assert!((wrong.position.z - 8.8).abs() < 1e-12);
        assert!((pixel(&wrong) - pixel(&camera)).length() < 1e-6);
        // The horizon is not: 10 % of 7.4 degrees higher.
        let far = DVec3::new(0.0, 1e9, 0.0);
        let rise = lens.project(camera.to_camera(far)).unwrap() - lens.project(wrong.to_camera(far)).unwrap();
        assert!((15.0..25.0).contains(&rise.y), "{rise}");
    }

    #[test]
    fn a_boat_seen_from_higher_up_is_larger_and_seen_alike() {
        let models = DrawnModels::of_model(&scenes::grey_boat(0.1));
        let lengths = EyeHeight::ALL.map(|eye| models.of(eye).1.length_m());
        assert!((lengths[1] / lengths[0] - 0.9).abs() < 1e-6 && (lengths[2] / lengths[0] - 1.1).abs() < 1e-6);
    }
}
