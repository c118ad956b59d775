//! The seas that boats are drawn into: the user's, or two simulated ones.

use std::{
    f64::consts::TAU,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use bowwave_core::sea::BeaufortForce;
use hw_sim::make::{GunMotion, Periodic, Recipe, ShipMotion, Studio};
use image::RgbImage;

use super::design::REPLICATES;
use crate::{compose::pictures, photo::Photo, still::Still};

/// A sea and how it was photographed.
#[derive(Debug)]
pub struct Background {
    /// Level of the factor, as the key names it.
    pub name: String,
    /// Camera, sea and light; its boats are left out.
    pub still: Still,
    /// Its pictures; replicates take them in turn.
    pub photos: Vec<Photo>,
}

/// Two scenes as `bowwave compose` reads them, or the two simulated seas where none is named.
pub fn gather(scenes: &[PathBuf]) -> Result<[Background; 2]> {
    match scenes {
        [] => Ok([simulated("bright", BRIGHT)?, simulated("grey", GREY)?]),
        [first, second] => Ok([photographed(first)?, photographed(second)?]),
        other => bail!(
            "{} backgrounds given; a study has two: give --background twice, or not at all",
            other.len()
        ),
    }
}

fn photographed(path: &Path) -> Result<Background> {
    let still = Still::read(path, "`bowwave compose --example` shows what it looks like")?;
    let mut photos = Vec::new();
    for picture in
        pictures(&path.parent().unwrap_or(Path::new("")).join(&still.picture))?.iter().take(REPLICATES)
    {
        let photo = Photo::read(picture)?;
        // What does not fit is told before anything is drawn.
        still.sight((photo.picture.width(), photo.picture.height()), photo.focal_px)?;
        photos.push(photo);
    }
    let name = path.file_stem().map_or_else(|| "background".to_owned(), |s| s.to_string_lossy().into_owned());
    Ok(Background { name: name.replace(',', " "), still, photos })
}

/// Parameters in which the two simulated seas differ.
struct Weather {
    seed: u64,
    beaufort: u8,
    sun_deg: (f64, f64),
    clouds: f64,
    sun_strength: f64,
}

const BRIGHT: Weather =
    Weather { seed: 21, beaufort: 1, sun_deg: (140.0, 48.0), clouds: 0.15, sun_strength: 1.0 };
const GREY: Weather =
    Weather { seed: 22, beaufort: 2, sun_deg: (250.0, 30.0), clouds: 0.95, sun_strength: 0.2 };

/// Height of the simulated eye, metres.
const EYE_M: f64 = 6.0;
/// How far below the horizon the simulated camera looks, degrees.
const DOWN_DEG: f64 = 5.0;
/// Where the simulated camera looks and the wind comes from, degrees.
const AHEAD_DEG: f64 = 0.0;
const WIND_FROM_DEG: f64 = 330.0;
/// Frames between two pictures of a simulated sea: waves have gone on by then.
const FRAMES_APART: u32 = 75;

fn simulated(name: &str, weather: Weather) -> Result<Background> {
    let still_at = |degrees: f64| Periodic::new(degrees.to_radians(), &[]);
    let mut recipe = Recipe {
        duration_s: 20.0,
        seed: weather.seed,
        beaufort: BeaufortForce::new(weather.beaufort).context("no such wind force")?,
        wind_from: WIND_FROM_DEG.to_radians().rem_euclid(TAU),
        swell: None,
        eye_height_m: EYE_M,
        ship: ShipMotion {
            heading: still_at(0.0),
            pitch: still_at(0.0),
            roll: still_at(0.0),
            heave: Periodic::new(0.0, &[]),
        },
        gun: GunMotion { traverse: still_at(AHEAD_DEG), elevation: still_at(-DOWN_DEG) },
        ..Recipe::default()
    };
    recipe.camera.hfov = 40f64.to_radians();
    recipe.sky.sun_azimuth = weather.sun_deg.0.to_radians();
    recipe.sky.sun_elevation = weather.sun_deg.1.to_radians();
    recipe.sky.cloud_cover = weather.clouds;
    let studio = Studio::new(&recipe)?;
    let mut photos = Vec::with_capacity(REPLICATES);
    for replicate in 0..REPLICATES as u32 {
        let (_, rgb) = studio.shoot_rgb(replicate * FRAMES_APART);
        let image = RgbImage::from_raw(recipe.width, recipe.height, rgb).context("no picture of the sea")?;
        photos.push(Photo::new(image, "the simulated sea", None)?);
    }
    let text = format!(
        "picture = \"simulated\"\nseed = {}\n[camera]\neye_height_m = {EYE_M}\nhfov_deg = 40\npitch_deg = -{DOWN_DEG}\n\
         azimuth_deg = {AHEAD_DEG}\n[sea]\nbeaufort = {}\nwind_from_deg = {WIND_FROM_DEG}\n[light]\nsun_azimuth_deg = {}\n\
         sun_elevation_deg = {}\nsun_strength = {}\n",
        weather.seed, weather.beaufort, weather.sun_deg.0, weather.sun_deg.1, weather.sun_strength
    );
    Ok(Background { name: name.to_owned(), still: Still::parse(&text, "the simulated sea")?, photos })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_simulated_camera_looks_where_its_scene_says() {
        let background = simulated("bright", Weather { beaufort: 0, ..BRIGHT }).expect("a sea");
        let photo = &background.photos[0].picture;
        let (lens, camera) = background.still.sight((photo.width(), photo.height()), None).expect("a camera");
        let row = horizon_row(&lens, &camera);
        // The sky's last row is brighter than the water's first ones: the step lies where the scene puts the horizon.
        let luma = |y: u32| photo.srgb_at(20, y).iter().sum::<f32>();
        let step = (row as u32 - 12..row as u32 + 12).max_by(|a, b| {
            let drop = |y: u32| luma(y) - luma(y + 1);
            drop(*a).total_cmp(&drop(*b))
        });
        let step = f64::from(step.expect("rows"));
        assert!((step + 1.0 - row).abs() < 3.0, "the picture's horizon is at {step}, the scene's at {row}");
    }

    fn horizon_row(lens: &bowwave_core::geometry::Lens, camera: &bowwave_core::geometry::CameraPose) -> f64 {
        super::super::pictures::horizon_row(lens, camera, 20.0).expect("a horizon")
    }
}
