//! One cell of the truth: the picture without the boat that a method gets, and the one with it that it is held against.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use bowwave_core::{
    colour::LUMINANCE,
    estimate::light::Light,
    geometry::{CameraPose, Lens, RigidPose},
    sky::SkyLobes,
};
use glam::{DQuat, DVec2, DVec3, Vec3};
use image::{GrayImage, Rgb, RgbImage, imageops};

use crate::{
    metric::flip_mean,
    truth::{
        cell::{CellSetup, CellSpec},
        files::{self, CellFile},
        grid, masks,
    },
};

/// Elevation whose sky stands for the horizon's haze, degrees.
const HORIZON_DEG: f64 = 3.0;

/// A cell.
#[derive(Clone, Debug)]
pub struct TruthCell {
    /// Its folder's name.
    pub name: String,
    /// Its specification.
    pub spec: CellSpec,
    /// The lens of its pictures.
    pub lens: Lens,
    /// The camera.
    pub camera: CameraPose,
    /// Name of the boat's model.
    pub boat: String,
    /// Where the boat is.
    pub pose: RigidPose,
    /// Wind 10 m above the sea, m/s.
    pub wind_m_s: f64,
    /// Where it comes from, radians clockwise from north.
    pub wind_from: f64,
    /// Light on the boat.
    pub light: Light,
    /// Radiance of the sky in the direction of view by elevation, degrees, ascending.
    pub sky: Vec<(f64, Vec3)>,
    /// Picture that a method gets.
    pub without: RgbImage,
    /// The truth.
    pub with: RgbImage,
    /// Share of each pixel that the boat covers, 0 to 255.
    pub hull: GrayImage,
    /// Pixels where reflections are judged.
    pub region: Vec<bool>,
}

impl TruthCell {
    /// Reads a folder that `truth` wrote.
    pub fn load(folder: &Path) -> Result<Self> {
        let open = |name: &str| {
            let path = folder.join(name);
            image::open(&path).with_context(|| format!("cannot read {}", path.display()))
        };
        let path = folder.join("sky.csv");
        let text =
            std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let rows = text.lines().skip(1).map(|line| {
            let row: Vec<f64> = line.split(',').filter_map(|x| x.trim().parse().ok()).collect();
            <[f64; 5]>::try_from(row)
                .ok()
                .with_context(|| format!("{}: no row of sky: {line}", path.display()))
        });
        let name = folder.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let pictures = [open("without.png")?.to_rgb8(), open("with.png")?.to_rgb8()];
        let masks = [open("hull.png")?.to_luma8(), open("region.png")?.to_luma8()];
        Self::new(name, &files::read(folder)?, &rows.collect::<Result<Vec<_>>>()?, pictures, masks)
    }

    /// Renders a cell.
    pub fn render(spec: &CellSpec) -> Result<Self> {
        let setup = CellSetup::new(spec)?;
        let pictures = setup.render();
        let region = masks::reflection(&setup, &pictures);
        let described = files::describe(&setup, &pictures, &region, 0.0);
        let (width, height) = pictures.size;
        let rgb =
            |p: &[[f32; 3]]| RgbImage::from_raw(width, height, files::coded(p)).context("a picture's size");
        let grey = |bytes: Vec<u8>| GrayImage::from_raw(width, height, bytes).context("a mask's size");
        let hull = grey(pictures.hull.iter().map(|h| (h * 255.0).round() as u8).collect())?;
        let region = grey(region.iter().map(|r| if *r { 255 } else { 0 }).collect())?;
        let images = [rgb(&pictures.without)?, rgb(&pictures.with)?];
        Self::new(grid::name(spec), &described, &files::sky_rows(&setup), images, [hull, region])
    }

    fn new(
        name: String,
        of: &CellFile,
        sky_rows: &[[f64; 5]],
        [without, with]: [RgbImage; 2],
        [hull, region]: [GrayImage; 2],
    ) -> Result<Self> {
        let (width, height) = without.dimensions();
        let same = [with.dimensions(), hull.dimensions(), region.dimensions()];
        ensure!(same.iter().all(|d| *d == (width, height)), "{name}: its pictures have different sizes");
        let ahead = |row: &&[f64; 5]| row[0].abs() < 1e-6;
        let sky: Vec<(f64, Vec3)> = sky_rows
            .iter()
            .filter(ahead)
            .map(|[_, elevation, r, g, b]| (*elevation, DVec3::new(*r, *g, *b).as_vec3()))
            .collect();
        ensure!(sky.len() > 1, "{name}: no sky in the direction of view");
        let single = |v: [f64; 3]| DVec3::from_array(v).as_vec3();
        let corner = DVec2::new(f64::from(of.region.x), f64::from(of.region.y));
        Ok(Self {
            spec: of.spec.clone(),
            lens: Lens {
                focal: DVec2::new(of.camera.fx, of.camera.fy),
                centre: DVec2::new(of.camera.cx, of.camera.cy) - corner,
                ..Lens::pinhole(width, height, 1.0)
            },
            camera: CameraPose {
                world_from_camera: DQuat::from_array(of.camera.world_from_camera),
                position: DVec3::from_array(of.camera.position),
            },
            boat: of.boat.model.clone(),
            pose: RigidPose {
                world_from_body: DQuat::from_array(of.boat.world_from_boat),
                position: DVec3::from_array(of.boat.position),
            },
            wind_m_s: of.sea.wind_m_s,
            wind_from: of.sea.wind_from_deg.to_radians(),
            light: Light {
                sun_direction: DVec3::from_array(of.light.sun_direction),
                sun: single(of.light.boat_sun),
                sky: single(of.light.boat_sky),
                dome: SkyLobes::even(single(of.light.boat_sky)),
                horizon: between(&sky, HORIZON_DEG),
                sea: single(of.light.boat_sea),
            },
            name,
            sky,
            without,
            with,
            hull,
            region: region.pixels().map(|p| p.0[0] > 127).collect(),
        })
    }

    /// Width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        self.without.dimensions()
    }

    /// Sky in the direction of view at an elevation, degrees.
    pub fn sky_at(&self, degrees: f64) -> Vec3 {
        between(&self.sky, degrees)
    }

    /// The part of it that a camera with a smaller picture sees: `width` x `height` pixels from (`x`, `y`) on.
    pub fn cropped(&self, x: u32, y: u32, width: u32, height: u32) -> Self {
        let rgb = |p: &RgbImage| imageops::crop_imm(p, x, y, width, height).to_image();
        let hull = imageops::crop_imm(&self.hull, x, y, width, height).to_image();
        let size = hull.dimensions();
        let old = self.size().0 as usize;
        let region = (0..size.0 as usize * size.1 as usize).map(|i| {
            let (column, row) = (i % size.0 as usize + x as usize, i / size.0 as usize + y as usize);
            self.region[row * old + column]
        });
        let centre = self.lens.centre - DVec2::new(f64::from(x), f64::from(y));
        Self {
            lens: Lens { width: size.0, height: size.1, centre, ..self.lens },
            without: rgb(&self.without),
            with: rgb(&self.with),
            hull,
            region: region.collect(),
            ..self.clone()
        }
    }

    /// The truth's own hull over a method's water, so that only the water differs.
    pub fn with_hull(&self, drawn: &RgbImage) -> RgbImage {
        let mut out = drawn.clone();
        for ((pixel, hull), truth) in out.pixels_mut().zip(self.hull.pixels()).zip(self.with.pixels()) {
            if hull.0[0] > 0 {
                *pixel = *truth;
            }
        }
        out
    }

    /// Picture of a method that is right but for noise: the boat's change along other paths, put onto this cell's picture without it.
    /// Renders the cell again.
    pub fn renewed(&self) -> Result<RgbImage> {
        let other = Self::render(&CellSpec { noise_seed: self.spec.noise_seed + 1, ..self.spec.clone() })?;
        ensure!(other.size() == self.size(), "{}: rendered again it has another size", self.name);
        let mut drawn = self.without.clone();
        let pixels = drawn.iter_mut().zip(other.without.iter()).zip(other.with.iter());
        for ((code, without), with) in pixels {
            *code = files::code(files::linear(*code) + files::linear(*with) - files::linear(*without));
        }
        Ok(drawn)
    }

    /// Mean FLIP of [`TruthCell::renewed`]. A method that knows the exact change errs by less, about this over the root of two.
    pub fn noise(&self) -> Result<f64> {
        Ok(self.errors(&self.renewed()?)?.flip)
    }

    /// How far a drawn picture is from the truth where the reflection is.
    pub fn errors(&self, drawn: &RgbImage) -> Result<CellErrors> {
        let drawn = self.with_hull(drawn);
        let flip = flip_mean(self.with.as_raw(), drawn.as_raw(), self.size(), &self.region)?;
        let sum = |of: &RgbImage| -> f64 {
            of.pixels().zip(&self.region).filter(|(_, judged)| **judged).map(|(p, _)| luminance(p)).sum()
        };
        let truth = sum(&self.with);
        Ok(CellErrors {
            flip: flip.unwrap_or(0.0),
            bias: sum(&drawn) - truth,
            change: truth - sum(&self.with_hull(&self.without)),
        })
    }
}

/// How far a drawn picture is from the truth where the reflection is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellErrors {
    /// Mean FLIP.
    pub flip: f64,
    /// Sum over the pixels of linear luminance beyond the truth's.
    pub bias: f64,
    /// Sum over the pixels of the luminance that the boat adds to the truth.
    pub change: f64,
}

/// Linear luminance of a pixel of sRGB codes.
pub fn luminance(p: &Rgb<u8>) -> f64 {
    f64::from(Vec3::from_array(p.0.map(files::linear)).dot(LUMINANCE))
}

fn between(sky: &[(f64, Vec3)], degrees: f64) -> Vec3 {
    let i = sky.partition_point(|p| p.0 < degrees).clamp(1, sky.len() - 1);
    let (a, b) = (sky[i - 1], sky[i]);
    a.1.lerp(b.1, ((degrees - a.0) / (b.0 - a.0)).clamp(0.0, 1.0) as f32)
}

/// Complete cells of a folder whose names contain `part`, by name.
pub fn folders(folder: &Path, part: &str) -> Result<Vec<PathBuf>> {
    let entries =
        std::fs::read_dir(folder).with_context(|| format!("cannot read the folder {}", folder.display()))?;
    let mut cells: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    let named = |p: &PathBuf| p.file_name().is_some_and(|n| n.to_string_lossy().contains(part));
    // While a cell is written its folder's name ends in .part.
    cells.retain(|p| named(p) && p.extension().is_none_or(|e| e != "part") && p.join("cell.toml").exists());
    cells.sort();
    if cells.is_empty() {
        bail!(
            "{} holds no finished cell whose name contains '{part}'; `precision truth grid --out {0}` makes them",
            folder.display()
        );
    }
    Ok(cells)
}
