//! One cell of the grid: a boat on a sea under a sky seen by a camera, and its two pictures.

use anyhow::{Context, Result, ensure};
use bowwave_core::{
    geometry::{CameraPose, Lens, RigidPose, look},
    model::Model,
    sea::BeaufortForce,
};
use glam::{DVec2, DVec3};
use hw_sim::ocean::{
    random::LightPath,
    sky::{Daylight, SkySpec},
    spectrum::{LongWaves, Spectrum},
    trace::{BoatLight, TracedScene, WaterBody},
    waves::{Resolution, TracedSea, Waves},
};
use rayon::prelude::*;

use super::boat;

/// Width and height of the whole picture, pixels.
pub const PICTURE: (u32, u32) = (1280, 720);
/// Angle that the whole picture covers across, degrees.
pub const HFOV_DEG: f64 = 45.0;
/// Largest region of interest, pixels.
const ROI_MAX: (f64, f64) = (256.0, 192.0);
/// Mean linear value of the whole picture that the exposure aims at.
const EXPOSED_MEAN: f64 = 0.25;

/// Everything that tells one cell from another.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CellSpec {
    /// Horizontal distance from the eye to the boat's origin, metres.
    pub range_m: f64,
    /// Sea state of the thesis, which is Beaufort force, 0 to 4.
    pub state: u8,
    /// Height of the eye, metres.
    pub eye_m: f64,
    /// Where the boat's bow points, degrees clockwise from north; the camera looks north.
    pub heading_deg: f64,
    /// Where the wind comes from, degrees clockwise from north.
    pub wind_from_deg: f64,
    /// Name of the boat's model.
    pub boat: String,
    /// Time of the waves, seconds.
    pub time_s: f64,
    /// Which waves.
    pub wave_seed: u64,
    /// Which paths.
    pub noise_seed: u64,
    /// Paths a pixel.
    pub samples: u32,
    /// Name of the light.
    pub lighting: String,
    /// Sky and sun.
    pub sky: SkySpec,
    /// Long waves.
    pub long_waves: LongWaves,
    /// How finely waves are traced.
    pub resolution: Resolution,
    /// Water below the surface.
    pub body: WaterBody,
}

/// A rectangle of the whole picture, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct CellRegion {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// A cell made ready: camera, scene, and where to look.
pub struct CellSetup {
    /// Its specification.
    pub spec: CellSpec,
    /// Spectrum of the sea.
    pub spectrum: Spectrum,
    /// The whole picture's lens.
    pub lens: Lens,
    /// Where the camera is.
    pub camera: CameraPose,
    /// Light, water and boat.
    pub scene: TracedScene,
    /// The boat's model.
    pub model: Model,
    /// Where the boat is.
    pub pose: RigidPose,
    /// Rectangle that is rendered.
    pub region: CellRegion,
    /// Factor from radiance to linear picture values.
    pub gain: f64,
}

/// CellPictures of one cell, row by row from the top, linear and exposed.
pub struct CellPictures {
    /// Columns and rows.
    pub size: (u32, u32),
    /// Without the boat.
    pub without: Vec<[f32; 3]>,
    /// With it.
    pub with: Vec<[f32; 3]>,
    /// Share of each pixel that the boat itself covers.
    pub hull: Vec<f32>,
}

/// The sea of a state of the thesis: no waves for 0, else Elfouhaily's for the force's mean wind, fully developed.
pub fn sea_of_state(state: u8) -> Option<(f64, LongWaves)> {
    let wind = BeaufortForce::new(state)?.wind_mean_m_s();
    let long = if state == 0 { LongWaves::Flat } else { LongWaves::Elfouhaily { inverse_wave_age: 0.84 } };
    Some((wind, long))
}

/// The light of `spec`.
pub fn daylight(spec: &SkySpec) -> Result<Daylight> {
    Daylight::new(spec).with_context(|| format!("no clear sky for a sun at {} deg", spec.sun_elevation_deg))
}

impl CellSetup {
    /// Makes the waves, puts the boat afloat and points the camera.
    pub fn new(spec: &CellSpec) -> Result<Self> {
        let finite = [spec.range_m, spec.eye_m, spec.heading_deg, spec.wind_from_deg, spec.time_s];
        ensure!(finite.iter().all(|v| v.is_finite()), "a cell's numbers must be finite: {spec:?}");
        ensure!(spec.range_m >= 5.0 && spec.range_m <= 5000.0, "range_m {} is not 5 to 5000", spec.range_m);
        ensure!(spec.eye_m > 0.5 && spec.eye_m <= 100.0, "eye_m {} is not 0.5 to 100", spec.eye_m);
        let Some((wind, _)) = sea_of_state(spec.state) else {
            anyhow::bail!("sea state {} is not on the scale of 0 to 12", spec.state)
        };
        let spectrum = Spectrum::new(wind, spec.wind_from_deg.to_radians(), spec.long_waves);
        let waves = TracedSea::new(&spectrum, &spec.resolution, spec.wave_seed).at(spec.time_s);
        let sky = daylight(&spec.sky)?;
        let model = boat::model(&spec.boat)?;
        let (place, heading) = (DVec2::new(0.0, spec.range_m), spec.heading_deg.to_radians());
        let pose = boat::float(&model, place, heading, &waves);
        let lens = Lens::pinhole(PICTURE.0, PICTURE.1, HFOV_DEG.to_radians());
        let depression = (spec.eye_m / spec.range_m).atan();
        let camera = CameraPose {
            world_from_camera: look(0.0, -depression / 2.0, 0.0),
            position: DVec3::new(0.0, 0.0, spec.eye_m),
        };
        // CellRegion and exposure are those of the mean water, so that they stay while waves move.
        let level = boat::float(&model, place, heading, &Waves::mirror());
        let region = region_of(&model, &level, &lens, &camera);
        let light = TracedScene::boat_light(&sky, &spec.body);
        let mut scene =
            TracedScene { sky, waves: Waves::statistical(&spectrum), body: spec.body, boat: None, light };
        let gain = exposure(&scene, &lens, &camera);
        (scene.waves, scene.boat) = (waves, Some(boat::mesh(&model, pose)));
        Ok(Self { spec: spec.clone(), spectrum, lens, camera, scene, model, pose, region, gain })
    }

    /// Light on the boat in the picture's linear values.
    pub fn exposed_light(&self) -> BoatLight {
        let BoatLight { sun, sky, sea } = self.scene.light;
        BoatLight { sun: sun * self.gain, sky: sky * self.gain, sea: sea * self.gain }
    }

    fn sample(&self, pixel: DVec2, path: &mut LightPath) -> (DVec3, DVec3, bool) {
        let direction = self.camera.world_from_camera * self.lens.unproject(pixel);
        let sample = self.scene.trace(self.camera.position, direction, path);
        (sample.without, sample.with, sample.hull)
    }

    /// Renders the region.
    pub fn render(&self) -> CellPictures {
        let r = self.region;
        let pixels: Vec<([f32; 3], [f32; 3], f32)> = (0..r.width * r.height)
            .into_par_iter()
            .map(|i| self.pixel(r.x + i % r.width, r.y + i / r.width))
            .collect();
        CellPictures {
            size: (r.width, r.height),
            without: pixels.iter().map(|p| p.0).collect(),
            with: pixels.iter().map(|p| p.1).collect(),
            hull: pixels.iter().map(|p| p.2).collect(),
        }
    }

    fn pixel(&self, x: u32, y: u32) -> ([f32; 3], [f32; 3], f32) {
        let (mut without, mut with, mut hull) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        // The same pixel of the whole picture draws the same paths whatever the region.
        let number = u64::from(y) * u64::from(PICTURE.0) + u64::from(x);
        for index in 0..self.spec.samples {
            let mut path = LightPath::new(self.spec.noise_seed, number, u64::from(index));
            let pixel = DVec2::new(f64::from(x) + path.unit(), f64::from(y) + path.unit());
            let (a, b, c) = self.sample(pixel, &mut path);
            without += a;
            with += b;
            hull += f64::from(c);
        }
        let scale = self.gain / f64::from(self.spec.samples);
        (
            (without * scale).as_vec3().to_array(),
            (with * scale).as_vec3().to_array(),
            (hull / f64::from(self.spec.samples)) as f32,
        )
    }

    /// The whole boat-free picture, `width` pixels wide, with `samples` paths a pixel: context for whoever measures light in it.
    pub fn overview(&self, width: u32, samples: u32) -> CellPictures {
        let height = width * PICTURE.1 / PICTURE.0;
        let scale = f64::from(PICTURE.0) / f64::from(width);
        let without: Vec<[f32; 3]> = (0..width * height)
            .into_par_iter()
            .map(|i| {
                let mut sum = DVec3::ZERO;
                for index in 0..samples {
                    let mut path =
                        LightPath::new(self.spec.noise_seed ^ 0x0f, u64::from(i), u64::from(index));
                    let place =
                        DVec2::new(f64::from(i % width) + path.unit(), f64::from(i / width) + path.unit());
                    sum += self.sample(place * scale, &mut path).0;
                }
                (sum * self.gain / f64::from(samples)).as_vec3().to_array()
            })
            .collect();
        let hull = vec![0.0; without.len()];
        CellPictures { size: (width, height), with: without.clone(), without, hull }
    }

    /// Where a world point falls in the region, pixels.
    pub fn project(&self, world: DVec3) -> Option<DVec2> {
        let p = self.lens.project(self.camera.to_camera(world))?;
        Some(p - DVec2::new(f64::from(self.region.x), f64::from(self.region.y)))
    }
}

/// The gain that brings the mean of the whole boat-free picture to `EXPOSED_MEAN`, as a camera's meter would, from a coarse rendering
/// in which what is brighter than white (the sun) counts as white.
pub fn exposure(scene: &TracedScene, lens: &Lens, camera: &CameraPose) -> f64 {
    let grid = (24u32, 18u32);
    let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
    let values: Vec<f64> = (0..grid.0 * grid.1)
        .into_par_iter()
        .map(|i| {
            let corner = DVec2::new(f64::from(i % grid.0), f64::from(i / grid.0));
            let mut sum = 0.0;
            for sample in 0..16 {
                let mut path = LightPath::new(91, u64::from(i), sample);
                let place = corner + DVec2::new(path.unit(), path.unit());
                let pixel = place / DVec2::new(f64::from(grid.0), f64::from(grid.1)) * size;
                let direction = camera.world_from_camera * lens.unproject(pixel);
                sum += luminance(scene.trace(camera.position, direction, &mut path).without) / 16.0;
            }
            sum
        })
        .collect();
    // Values above white saturate: settle by iteration.
    let mean = |gain: f64| values.iter().map(|v| (v * gain).min(1.0)).sum::<f64>() / values.len() as f64;
    let mut gain = EXPOSED_MEAN / (values.iter().sum::<f64>() / values.len() as f64).max(1e-9);
    for _ in 0..20 {
        gain *= EXPOSED_MEAN / mean(gain).max(1e-9);
    }
    gain
}

/// Relative luminance of linear sRGB (IEC 61966-2-1).
pub fn luminance(c: DVec3) -> f64 {
    c.dot(DVec3::new(0.212_6, 0.715_2, 0.072_2))
}

/// The rectangle that holds the boat, its mirror image about the water and half as much below it, cut where it is too large: from the top
/// first, since the reflection is what matters.
fn region_of(model: &Model, pose: &RigidPose, lens: &Lens, camera: &CameraPose) -> CellRegion {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for vertex in &model.vertices {
        let world = pose.to_world(vertex.position.as_dvec3());
        let level = pose.position.z;
        for z in [world.z.max(level), 2.0 * level - world.z.max(level)] {
            if let Some(p) = lens.project(camera.to_camera(world.truncate().extend(z))) {
                low = low.min(p);
                high = high.max(p);
            }
        }
    }
    let size = high - low;
    let margin = DVec2::new(6.0 + 0.1 * size.x, 4.0);
    low -= margin;
    high += margin + DVec2::new(0.0, 0.25 * size.y + 8.0);
    let extra = ((DVec2::splat(48.0) - (high - low)) / 2.0).max(DVec2::ZERO);
    low -= extra;
    high += extra;
    let over = high - low - DVec2::new(ROI_MAX.0, ROI_MAX.1);
    if over.x > 0.0 {
        low.x += over.x / 2.0;
        high.x -= over.x / 2.0;
    }
    if over.y > 0.0 {
        low.y += over.y * 0.65;
        high.y -= over.y * 0.35;
    }
    let picture = DVec2::new(f64::from(PICTURE.0), f64::from(PICTURE.1));
    let low = low.floor().clamp(DVec2::ZERO, picture - 16.0);
    let high = high.ceil().clamp(low + 16.0, picture);
    CellRegion {
        x: low.x as u32,
        y: low.y as u32,
        width: (high.x - low.x) as u32,
        height: (high.y - low.y) as u32,
    }
}
