//! From a recipe to a panorama's file.

use std::path::Path;

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::{
    PanoramaError, PanoramaRecipe,
    file::{PanoramaHeader, PanoramaWriter},
};
use crate::{
    jpeg,
    make::{
        camera::{LIGHT_MAX, SeaScene, ViewCoverage, open_sky, transfer},
        march::{LevelView, SeaPicture, ViewShape},
        studio::{FocalLengths, LitSea},
    },
    ocean::looped::{LoopedSurface, split},
};

/// Steps of the transfer table.
const STEPS: usize = 8192;
/// Frames drawn at once before they are written.
const BATCH: u32 = 16;

/// Weights of a linear sRGB colour's luminance (IEC 61966-2-1).
const LUMINANCE: Vec4 = Vec4::new(0.2126, 0.7152, 0.0722, 0.0);
/// Colour of the twilight, of luminance 1.
const TWILIGHT: Vec4 = Vec4::new(0.76, 1.0, 1.65, 0.0);

/// Draws the frames of a panorama.
pub(super) struct PanoramaStudio {
    sea: LitSea,
    panorama: PanoramaRecipe,
    header: PanoramaHeader,
    transfer: Vec<u8>,
    twilight: f32,
}

impl PanoramaStudio {
    pub fn new(panorama: &PanoramaRecipe) -> Result<Self, PanoramaError> {
        panorama.check()?;
        let header = PanoramaHeader::of(panorama);
        let [left, right] = panorama.azimuths();
        let [up, down] = panorama.tangents();
        let coverage = ViewCoverage {
            azimuth: [left as f32 - 0.01, right as f32 + 0.01],
            above: up as f32 + 0.01,
            below: -down as f32 + 0.01,
        };
        let focal = panorama.focal() as f32;
        let sea = LitSea::new(
            &panorama.recipe,
            &coverage,
            FocalLengths { sky: focal, sea: focal },
            panorama.sun_is_up(),
        )?;
        let exposure = panorama.exposure as f32;
        let transfer = (0..STEPS)
            .map(|i| (255.0 * transfer(exposure * (i as f32 + 0.5) * LIGHT_MAX / STEPS as f32)).round() as u8)
            .collect();
        Ok(Self { sea, panorama: panorama.clone(), header, transfer, twilight: panorama.twilight() as f32 })
    }

    /// All rows of the sea at a frame, three bytes a pixel.
    pub fn sea(&self, frame: u32, surface: &mut LoopedSurface, picture: &mut SeaPicture) -> Vec<u8> {
        let time_s =
            f64::from(frame) / self.panorama.recipe.frame_rate_hz + self.panorama.recipe.exposure_delay_s();
        self.sea.field.evaluate(time_s, surface);
        let eye_height = self.panorama.recipe.motion().at(time_s).pose.position.z as f32;
        let header = &self.header;
        let view = LevelView {
            shape: ViewShape::Cylinder,
            width: header.columns,
            height: header.sea_rows,
            focal: header.focal as f32,
            centre: (-header.azimuth_left * header.focal) as f32,
            level_row: header.level_row as f32,
            azimuth: 0.0,
        };
        let SeaScene { sky, water, .. } = &self.sea.scene;
        water.draw(surface, sky, &view, eye_height, picture);
        let mut rgb = Vec::with_capacity(3 * header.columns * header.sea_rows);
        for (i, water) in picture.texels.iter().enumerate() {
            let (row, column) = (header.sky_rows + i / header.columns, i % header.columns);
            self.develop(*water, row, column, &mut rgb);
        }
        rgb
    }

    /// All rows of the sky, three bytes a pixel.
    pub fn sky(&self) -> Vec<u8> {
        let mut rgb = Vec::with_capacity(3 * self.header.columns * self.header.sky_rows);
        for row in 0..self.header.sky_rows {
            (0..self.header.columns).for_each(|column| self.develop(Vec4::ZERO, row, column, &mut rgb));
        }
        rgb
    }

    /// Adds a pixel: water over sky.
    fn develop(&self, water: Vec4, row: usize, column: usize, rgb: &mut Vec<u8>) {
        let open = 1.0 - water.w;
        let light = if open < 1e-3 { water } else { water + open * self.sky_at(row, column) };
        let light = light + self.twilight * (Vec4::dot(light, LUMINANCE) * TWILIGHT - light);
        let steps =
            (light * (STEPS as f32 / LIGHT_MAX)).clamp(Vec4::splat(0.5), Vec4::splat(STEPS as f32 - 0.5));
        rgb.extend(steps.to_array()[..3].iter().map(|step| self.transfer[split(*step).0 & (STEPS - 1)]));
    }

    fn sky_at(&self, row: usize, column: usize) -> Vec4 {
        let [azimuth, tangent] = self.header.direction(row, column);
        let (azimuth, tangent) = (azimuth as f32, tangent as f32);
        let scene = &self.sea.scene;
        let sun = if self.panorama.sun_is_up() { scene.sky.sun } else { Vec3::NEG_Z };
        open_sky(scene, azimuth, tangent, Vec3::new(azimuth.sin(), azimuth.cos(), tangent), sun)
    }
}

/// Makes the panorama of `recipe` in a new file at `path`; `progress` hears of (frames done, frames in all). An existing file is not
/// overwritten; a failure leaves the file cut short.
pub fn make(
    recipe: &PanoramaRecipe,
    path: &Path,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<(), PanoramaError> {
    let studio = PanoramaStudio::new(recipe)?;
    let header = studio.header.clone();
    let mut writer = PanoramaWriter::create(path, &header)?;
    let frames = recipe.frames();
    progress(0, u64::from(frames));
    let tiles = |rgb: &[u8], rows: usize| -> Result<Vec<Vec<u8>>, PanoramaError> {
        let quality = recipe.recipe.camera.jpeg_quality;
        (0..header.tiles())
            .map(|tile| encode(rgb, header.columns, rows, header.tile_columns(tile), quality))
            .collect()
    };
    writer.tiles(&tiles(&studio.sky(), header.sky_rows)?)?;
    for first in (0..frames).step_by(BATCH as usize) {
        let last = frames.min(first + BATCH);
        let drawn: Vec<Result<Vec<Vec<u8>>, PanoramaError>> = (first..last)
            .into_par_iter()
            .with_max_len(1)
            .map_init(
                || (studio.sea.field.surface(), SeaPicture::default()),
                |(surface, picture), frame| tiles(&studio.sea(frame, surface, picture), header.sea_rows),
            )
            .collect();
        for frame in drawn {
            writer.tiles(&frame?)?;
        }
        progress(u64::from(last), u64::from(frames));
    }
    writer.finish()
}

/// The JPEG of some columns of a picture.
fn encode(
    rgb: &[u8],
    width: usize,
    rows: usize,
    columns: std::ops::Range<usize>,
    quality: u8,
) -> Result<Vec<u8>, PanoramaError> {
    let part: Vec<u8> = rgb
        .chunks_exact(3 * width)
        .flat_map(|row| &row[3 * columns.start..3 * columns.end])
        .copied()
        .collect();
    jpeg::encode(&part, (columns.len() as u32, rows as u32), quality).map_err(PanoramaError::Encode)
}
