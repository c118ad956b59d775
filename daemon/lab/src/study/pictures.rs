//! The pictures of a study: only water with a reflection in it, as in the thesis.

use std::path::Path;

use anyhow::{Context, Result, bail};
use bowwave_core::{
    frame::scene::BoatView,
    geometry::{CameraPose, Lens, horizon_dip},
    model::{Model, ModelId, ModelKind},
    water::{ReflectionMethod, ShadowLevel},
    world::boats::facing,
};
use bowwave_models::{Boat, BoatModels};
use glam::{DVec2, DVec3};
use image::{RgbImage, imageops};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{
    backgrounds::Background,
    design::{CONDITIONS, Condition, REPLICATES},
};
use crate::{
    compose::pictures as files_of,
    offscreen::OffscreenRenderer,
    photo::Photo,
    still::{Composed, Still, StillBoat, StillPlace},
};

/// Boats by replicate.
const BOATS: [Boat; REPLICATES] = Boat::ALL;

/// Wanted length of a boat, as a share of the picture's width.
const LENGTH_SHARE: f64 = 0.35;
/// Lowest water line, as a share of the rows below the horizon: the rest is for the reflection.
const LOWEST_SHARE: f64 = 0.42;
/// Width of what is cut out, in lengths of the boat as seen.
const CUT_LENGTHS: f64 = 1.5;
/// Height of what is cut out by its width.
const CUT_SHAPE: f64 = 0.55;
/// Widest picture that is shown: photographs are made smaller.
const WIDTH_MAX_PX: u32 = 1280;
/// Narrowest picture that is shown, pixels; smaller ones tell people nothing.
const WIDTH_MIN_PX: u32 = 64;

/// The photographs of real reflections of a folder: file name and picture.
pub fn real(folder: &Path) -> Result<Vec<(String, RgbImage)>> {
    if !folder.is_dir() {
        bail!(
            "no folder {}; name one that holds photographs of real reflections with --real",
            folder.display()
        );
    }
    let mut real = Vec::new();
    for path in files_of(folder)? {
        let picture = Photo::read(&path)?.picture;
        let (width, height) = (picture.width(), picture.height());
        if width < WIDTH_MIN_PX {
            bail!("{} is {width} pixels wide; it must have {WIDTH_MIN_PX} at least", path.display());
        }
        let image =
            RgbImage::from_raw(width, height, picture.bytes().to_vec()).context("a picture of no RGB")?;
        let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        real.push((name, fitted(image)));
    }
    Ok(real)
}

fn fitted(image: RgbImage) -> RgbImage {
    let (width, height) = image.dimensions();
    if width <= WIDTH_MAX_PX {
        return image;
    }
    let height = (u64::from(height) * u64::from(WIDTH_MAX_PX) / u64::from(width)).max(1) as u32;
    imageops::resize(&image, WIDTH_MAX_PX, height, imageops::FilterType::Lanczos3)
}

/// Draws generated pictures.
pub struct Drawer {
    backgrounds: [Background; 2],
    methods: [ReflectionMethod; 2],
    models: BoatModels,
    renderer: OffscreenRenderer,
    seed: u64,
}

impl Drawer {
    /// Loads the boats: shapes first, then pictures of the same ones.
    pub fn new(
        backgrounds: [Background; 2],
        methods: [ReflectionMethod; 2],
        gpu: Option<String>,
        seed: u64,
    ) -> Result<Self> {
        let mut models = BoatModels::default();
        for boat in BOATS {
            models.list.push(bowwave_models::resolve(boat.name(), Path::new(""))?);
        }
        for boat in BOATS {
            models.list.push(bowwave_models::side_view(boat)?);
        }
        let renderer = OffscreenRenderer::new(models.clone(), gpu, false);
        Ok(Self { backgrounds, methods, models, renderer, seed })
    }

    /// The picture of a condition.
    pub fn draw(&mut self, condition: Condition, replicate: usize) -> Result<RgbImage> {
        let background = &self.backgrounds[usize::from(condition.second_background)];
        let photo = &background.photos[replicate % background.photos.len()];
        let which = replicate + if condition.textured { BOATS.len() } else { 0 };
        let model = &self.models.list[which];
        let number = CONDITIONS.iter().position(|c| *c == condition).unwrap_or(0) * REPLICATES + replicate;
        let mut random = Pcg64Mcg::seed_from_u64(self.seed.wrapping_add(number as u64));
        let mut still = background.still.clone();
        still.water.method = self.methods[usize::from(condition.second_method)];
        still.water.shadow = if condition.shadow { ShadowLevel::Gradual } else { ShadowLevel::None };
        let size = (photo.picture.width(), photo.picture.height());
        let (lens, camera) = still.sight(size, photo.focal_px)?;
        let (pixel, heading) = place(&lens, &camera, &still, model, &mut random)
            .with_context(|| format!("the background {} leaves no room for a boat", background.name))?;
        still.boats = vec![StillBoat::new(model.name.as_str(), StillPlace::Pixel(pixel), heading)];
        let id = ModelId(u16::try_from(which).context("too many models")?);
        let composed = still
            .compose(&photo.picture, 0, (&self.models.list, &[id]), photo.focal_px)
            .with_context(|| format!("the background {} leaves no room for a boat", background.name))?;
        let drawn = self.renderer.draw(&composed, &photo.picture)?;
        cut(&drawn, &composed, model)
    }
}

/// Row of the sea's horizon in a column of the picture.
pub fn horizon_row(lens: &Lens, camera: &CameraPose, column: f64) -> Option<f64> {
    let ahead = camera.world_from_camera * lens.unproject(DVec2::new(column, lens.centre.y));
    let dip = horizon_dip(camera.position.z);
    let level = ahead.truncate().try_normalize()? * dip.cos();
    let row = lens.project(camera.world_from_camera.inverse() * level.extend(-dip.sin()))?.y;
    Some(row)
}

/// A pixel of the water for the boat's middle, and its heading.
fn place(
    lens: &Lens,
    camera: &CameraPose,
    still: &Still,
    model: &Model,
    random: &mut Pcg64Mcg,
) -> Result<(DVec2, f64)> {
    let (width, height) = (f64::from(lens.width), f64::from(lens.height));
    let column = width * random.random_range(0.42..0.58);
    let horizon = horizon_row(lens, camera, column).context("the horizon cannot be found")?;
    if horizon > 0.9 * height {
        bail!("its horizon lies in row {horizon:.0} of {height:.0}: too little water");
    }
    let range_m = model.length_m() * lens.focal.x / (LENGTH_SHARE * width) * random.random_range(0.9..1.15);
    let ray = camera.world_from_camera * lens.unproject(DVec2::new(column, horizon));
    let ground = ray.truncate().normalize_or(DVec2::Y) * range_m;
    let wanted = lens.project(camera.to_camera(ground.extend(0.0))).map_or(horizon, |p| p.y);
    let below = height - horizon.max(0.0);
    let lowest = horizon.max(0.0) + LOWEST_SHARE * below * random.random_range(0.9..1.0);
    let row = wanted.max(horizon + 0.04 * below).min(lowest);
    let aside = if random.random_range(0..2) == 0 { 90.0_f64 } else { -90.0 };
    let heading = still.camera.azimuth + (aside + random.random_range(-30.0..30.0)).to_radians();
    Ok((DVec2::new(column, row), heading))
}

/// The part of the picture below the lowest point of the hull, in which neither boat nor horizon is seen.
fn cut(drawn: &RgbImage, composed: &Composed, model: &Model) -> Result<RgbImage> {
    let scene = &composed.scene;
    let boat = scene.boats.first().context("the boat lies outside the picture")?;
    let foot = corners(boat, model, scene.camera.position)
        .filter_map(|p| scene.lens.project(scene.camera.to_camera(p)));
    let (low, high) = foot.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let (width, height) = (f64::from(drawn.width()), f64::from(drawn.height()));
    if !(low.is_finite() && high.is_finite()) || high.y + 24.0 >= height {
        bail!("the boat's water line reaches the picture's lower edge; there is no room for its reflection");
    }
    let wide = (CUT_LENGTHS * (high.x - low.x)).clamp(0.2 * width, width);
    let left = ((low.x + high.x - wide) / 2.0).clamp(0.0, width - wide);
    let top = high.y.max(0.0).ceil() + 1.0;
    let tall = (CUT_SHAPE * wide).min(height - top);
    Ok(imageops::crop_imm(drawn, left as u32, top as u32, wide as u32, tall as u32).to_image())
}

/// The water line's corners in the world, as drawn: pictures turn towards the eye.
fn corners<'a>(boat: &'a BoatView, model: &'a Model, eye: DVec3) -> impl Iterator<Item = DVec3> + 'a {
    let pose = if model.kind == ModelKind::Quad { facing(&boat.pose, eye) } else { boat.pose };
    model.waterline.iter().map(move |p| pose.to_world(p.extend(0.0)).with_z(boat.water_level))
}
