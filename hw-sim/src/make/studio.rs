//! Everything that is prepared once, to draw any frame of a recording.

use std::sync::Mutex;

use bowwave_core::geometry::CameraPose;

use super::{
    MakeError,
    camera::{FrameMemory, RecipeCamera, SeaScene, ViewCoverage, level_focal},
    march::{SeaShader, SeaShaderInput},
    motion::Motion,
    recipe::Recipe,
};
use crate::ocean::{
    cloudy::{CloudyDome, CloudySky, Panorama},
    looped::{LoopedSea, LoopedSurface},
    spectrum::{WindSea, cox_munk_fits, wind_of_beaufort},
};

/// Draws the frames of one recipe. Frames may be drawn in any order and from several threads.
pub struct Studio {
    motion: Motion,
    field: LoopedSea,
    scene: SeaScene,
    camera: RecipeCamera,
    exposure_delay_s: f64,
    frame_rate_hz: f64,
    frames: u32,
    size: (u32, u32),
    /// Tiles and pictures of threads that are done with a frame, for the next one.
    spare: Mutex<Vec<(LoopedSurface, FrameMemory)>>,
}

/// One drawn frame.
pub struct StudioShot {
    /// The picture as the camera delivers it.
    pub jpeg: Vec<u8>,
    /// Where the camera was at its exposure.
    pub truth: CameraPose,
}

impl Studio {
    /// Prepares waves, sky and camera; about a second of work.
    pub fn new(recipe: &Recipe) -> Result<Self, MakeError> {
        Self::with_detail(recipe, 1.0)
    }

    /// The same with waves drawn `detail` times as finely as recordings have them, as a truth to compare pictures with.
    pub fn with_detail(recipe: &Recipe, detail: f32) -> Result<Self, MakeError> {
        recipe.check()?;
        let mut camera = RecipeCamera::new(recipe);
        camera.refine(detail);
        let coverage = ViewCoverage::new(recipe);
        let lens = recipe.lens();
        let focals = FocalLengths { sky: lens.focal.x as f32, sea: detail * level_focal(&lens) };
        let LitSea { field, scene, surface } = LitSea::new(recipe, &coverage, focals, true)?;
        Ok(Self {
            motion: recipe.motion(),
            field,
            scene,
            camera,
            exposure_delay_s: recipe.exposure_delay_s(),
            frame_rate_hz: recipe.frame_rate_hz,
            frames: recipe.frames(),
            size: (recipe.width, recipe.height),
            spare: Mutex::new(vec![(surface, FrameMemory::default())]),
        })
    }

    /// How many frames the recipe has.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Width and height of the pictures.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Frame number `frame`, from 0, as JPEG. Numbers beyond the last begin the loop again, with other noise.
    pub fn shoot(&self, frame: u32) -> Result<StudioShot, MakeError> {
        let (truth, jpeg) = self.draw(frame, |rgb| self.camera.encode(rgb));
        let jpeg = jpeg.map_err(|source| MakeError::Encode { frame, source })?;
        Ok(StudioShot { jpeg, truth })
    }

    /// The same frame before it is encoded: 8-bit sRGB, rows from the top.
    pub fn shoot_rgb(&self, frame: u32) -> (CameraPose, Vec<u8>) {
        self.draw(frame, <[u8]>::to_vec)
    }

    fn draw<T>(&self, frame: u32, take: impl FnOnce(&[u8]) -> T) -> (CameraPose, T) {
        let spare = self.spare.lock().ok().and_then(|mut spare| spare.pop());
        let (mut surface, mut memory) =
            spare.unwrap_or_else(|| (self.field.surface(), FrameMemory::default()));
        let time_s = f64::from(frame) / self.frame_rate_hz + self.exposure_delay_s;
        let pose = self.motion.at(time_s).pose;
        let turned = |after_s: f64| self.motion.at(time_s + after_s).pose.world_from_camera;
        self.field.evaluate(time_s, &mut surface);
        self.camera.expose(&self.scene, &surface, (&pose, &turned), frame, &mut memory);
        let taken = take(&memory.rgb);
        if let Ok(mut spare) = self.spare.lock() {
            spare.push((surface, memory));
        }
        (pose, taken)
    }
}

/// Pixels per radian at which sky and sea are prepared.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FocalLengths {
    pub sky: f32,
    pub sea: f32,
}

/// The waves of a recipe and how they are lit.
pub(crate) struct LitSea {
    pub field: LoopedSea,
    pub scene: SeaScene,
    /// The surface at the recording's begin, and memory for another instant.
    pub surface: LoopedSurface,
}

impl LitSea {
    /// Prepares what is seen within `coverage`, without the sun's own light where it is down; about a second of work.
    pub fn new(
        recipe: &Recipe,
        coverage: &ViewCoverage,
        focals: FocalLengths,
        sun_is_up: bool,
    ) -> Result<Self, MakeError> {
        let wind = wind_of_beaufort(recipe.beaufort.get());
        let sea = WindSea::new(wind);
        let field =
            LoopedSea::new(&sea, recipe.wind_from, recipe.swell.as_ref(), recipe.duration_s, recipe.seed);
        let mut surface = field.surface();
        field.evaluate(0.0, &mut surface);
        let mut sky = CloudySky::new(&recipe.sky, recipe.seed).ok_or(MakeError::Recipe {
            what: "sky.turbidity",
            value: recipe.sky.turbidity,
            range: "1 to 10",
        })?;
        if !sun_is_up {
            sky.sun_irradiance = [0.0; 3];
        }
        let panorama = Panorama::new(&sky, coverage.azimuth, coverage.above, focals.sky);
        let dome = CloudyDome::new(&sky);
        let input = SeaShaderInput {
            eye_height: recipe.eye_height_m as f32,
            focal: focals.sea,
            steepest: coverage.below,
            visibility_m: recipe.visibility_m as f32,
            slopes: cox_munk_fits(wind),
            wind_from: recipe.wind_from,
            wind,
            upwelling: upwelling(&sky),
            seed: recipe.seed,
        };
        let water = SeaShader::new(&input, &sky, &dome, &surface);
        Ok(Self { field, scene: SeaScene { sky, panorama, water }, surface })
    }
}

/// Light that comes up out of clear deep water, in the picture's units: 2 to 5 % of what falls on it, blue-green (Mobley
/// 1994, irradiance reflectance of open water at 450, 550 and 620 nm, spread over the hemisphere and dimmed by the surface).
fn upwelling(sky: &CloudySky) -> [f32; 3] {
    let overhead = sky.clear(glam::Vec3::Z);
    let sin = sky.sun.z;
    std::array::from_fn(|c| {
        let falling = sky.sun_irradiance[c] * sin + std::f32::consts::PI * 1.2 * overhead[c];
        let reflectance = [0.007, 0.036, 0.056][c];
        falling * reflectance / (std::f32::consts::PI * 1.9)
    })
}
