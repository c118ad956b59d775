//! A cell on disk.

use std::{fmt::Write as _, fs, path::Path};

use anyhow::{Context, Result};
use glam::{DVec2, DVec3};
use image::{GrayImage, RgbImage};

use super::{
    cell::{CellPictures, CellRegion, CellSetup, CellSpec, PICTURE},
    masks,
};

/// Pixels across the overview.
const OVERVIEW: u32 = 240;
/// Paths a pixel of the overview.
const OVERVIEW_SAMPLES: u32 = 4;

/// A linear value as an sRGB code (IEC 61966-2-1), clipped as a camera does.
pub fn code(linear: f32) -> u8 {
    let v = f64::from(linear).clamp(0.0, 1.0);
    let coded = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (coded * 255.0).round() as u8
}

/// An sRGB code as a linear value.
pub fn linear(code: u8) -> f32 {
    bowwave_core::colour::srgb_to_linear(f32::from(code) / 255.0)
}

/// A linear picture as sRGB bytes.
pub fn coded(pixels: &[[f32; 3]]) -> Vec<u8> {
    pixels.iter().flat_map(|p| p.map(code)).collect()
}

/// Contents of `cell.toml`.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct CellFile {
    /// Everything that made the cell.
    pub spec: CellSpec,
    /// The camera of the whole picture.
    pub camera: CellCamera,
    /// Rectangle of it that is rendered.
    pub region: CellRegion,
    /// The boat.
    pub boat: CellBoat,
    /// The sea.
    pub sea: CellSea,
    /// Light in the picture's linear values.
    pub light: CellLight,
    /// About the truth itself.
    pub truth: CellMaking,
}

/// The camera of the whole picture.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct CellCamera {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length across, pixels.
    pub fx: f64,
    /// Focal length down, pixels.
    pub fy: f64,
    /// Column of the optical axis.
    pub cx: f64,
    /// Row of the optical axis.
    pub cy: f64,
    /// Angle that the picture covers down, degrees.
    pub vfov_deg: f64,
    /// Place in the world, metres.
    pub position: [f64; 3],
    /// Quaternion x, y, z, w.
    pub world_from_camera: [f64; 4],
}

/// The boat.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct CellBoat {
    /// Name of its model.
    pub model: String,
    /// Its origin in the world, metres.
    pub position: [f64; 3],
    /// Quaternion x, y, z, w.
    pub world_from_boat: [f64; 4],
}

/// The sea.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct CellSea {
    /// Wind 10 m above it, m/s.
    pub wind_m_s: f64,
    /// Where the wind comes from, degrees clockwise from north.
    pub wind_from_deg: f64,
    /// Significant wave height, metres.
    pub significant_height_m: f64,
    /// Length of the waves that carry most, metres.
    pub peak_wavelength_m: f64,
    /// Mean square slope along the wind.
    pub slope_variance_along: f64,
    /// Mean square slope across it.
    pub slope_variance_across: f64,
    /// Part of the former that has a shape.
    pub resolved_along: f64,
    /// Part of the latter that has a shape.
    pub resolved_across: f64,
}

/// Light in the picture's linear values.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct CellLight {
    /// Unit vector towards the sun, world.
    pub sun_direction: [f64; 3],
    /// Factor from radiance to linear picture values.
    pub gain: f64,
    /// Of a white matt surface that faces the sun.
    pub boat_sun: [f64; 3],
    /// Of one that faces up, by the sky alone.
    pub boat_sky: [f64; 3],
    /// Of one that faces down, by the sea.
    pub boat_sea: [f64; 3],
    /// Light that comes out of the water.
    pub water_body: [f64; 3],
}

/// About the truth itself.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct CellMaking {
    /// Paths a pixel.
    pub samples: u32,
    /// Time that it took, seconds.
    pub render_s: f64,
    /// Pixels where reflections are judged.
    pub reflection_pixels: usize,
    /// Mean change that the boat makes to them, linear.
    pub mean_change: [f64; 3],
}

/// Renders the cell and writes it as `folder`, which appears when it is complete and replaces one that was there.
pub fn make(spec: &CellSpec, folder: &Path) -> Result<()> {
    let start = std::time::Instant::now();
    let setup = CellSetup::new(spec)?;
    let pictures = setup.render();
    let render_s = start.elapsed().as_secs_f64();
    let part = folder.with_extension("part");
    if part.exists() {
        fs::remove_dir_all(&part).with_context(|| format!("cannot remove {}", part.display()))?;
    }
    write(&setup, &pictures, render_s, &part)?;
    if folder.exists() {
        fs::remove_dir_all(folder).with_context(|| format!("cannot replace {}", folder.display()))?;
    }
    fs::rename(&part, folder).with_context(|| format!("cannot rename {} to its name", part.display()))
}

fn write(setup: &CellSetup, pictures: &CellPictures, render_s: f64, folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let region = masks::reflection(setup, pictures);
    rgb(&folder.join("without.png"), pictures.size, coded(&pictures.without))?;
    rgb(&folder.join("with.png"), pictures.size, coded(&pictures.with))?;
    raw(&folder.join("without.f32"), &pictures.without)?;
    raw(&folder.join("with.f32"), &pictures.with)?;
    let hull = pictures.hull.iter().map(|&h| (h * 255.0).round() as u8).collect();
    grey(&folder.join("hull.png"), pictures.size, hull)?;
    grey(
        &folder.join("region.png"),
        pictures.size,
        region.iter().map(|&r| if r { 255 } else { 0 }).collect(),
    )?;
    let overview = setup.overview(OVERVIEW, OVERVIEW_SAMPLES);
    rgb(&folder.join("overview.png"), overview.size, coded(&overview.without))?;
    let mut sky = String::from("azimuth_deg,elevation_deg,r,g,b\n");
    for [azimuth, elevation, r, g, b] in sky_rows(setup) {
        writeln!(sky, "{azimuth},{elevation},{r:.5},{g:.5},{b:.5}")?;
    }
    put(&folder.join("sky.csv"), sky.as_bytes())?;
    let described = describe(setup, pictures, &region, render_s);
    let text = toml::to_string(&described).context("cannot write a cell as TOML")?;
    put(&folder.join("cell.toml"), text.as_bytes())
}

/// Contents of a cell's file; `region` is [`masks::reflection`]'s.
pub fn describe(setup: &CellSetup, pictures: &CellPictures, region: &[bool], render_s: f64) -> CellFile {
    let (lens, light, spec) = (&setup.lens, setup.exposed_light(), &setup.spec);
    let waves = &setup.scene.waves;
    let all = waves.all_slopes().sigma * waves.all_slopes().sigma;
    let body = DVec3::from_array(spec.body.reflectance) / std::f64::consts::PI
        * (setup.scene.sky.sky_irradiance + setup.scene.sky.sun_horizontal())
        * setup.gain;
    let count = region.iter().filter(|&&r| r).count();
    let mut change = DVec3::ZERO;
    for i in (0..region.len()).filter(|&i| region[i]) {
        change +=
            DVec3::from_array([0, 1, 2].map(|c| f64::from(pictures.with[i][c] - pictures.without[i][c])));
    }
    CellFile {
        spec: spec.clone(),
        camera: CellCamera {
            width: PICTURE.0,
            height: PICTURE.1,
            fx: lens.focal.x,
            fy: lens.focal.y,
            cx: lens.centre.x,
            cy: lens.centre.y,
            vfov_deg: 2.0 * (f64::from(PICTURE.1) / 2.0 / lens.focal.y).atan().to_degrees(),
            position: setup.camera.position.to_array(),
            world_from_camera: setup.camera.world_from_camera.to_array(),
        },
        region: setup.region,
        boat: CellBoat {
            model: spec.boat.clone(),
            position: setup.pose.position.to_array(),
            world_from_boat: setup.pose.world_from_body.to_array(),
        },
        sea: CellSea {
            wind_m_s: setup.spectrum.wind_m_s,
            wind_from_deg: spec.wind_from_deg,
            significant_height_m: setup.spectrum.significant_height_m(),
            peak_wavelength_m: std::f64::consts::TAU / setup.spectrum.peak(),
            slope_variance_along: all.x,
            slope_variance_across: all.y,
            resolved_along: waves.resolved().x,
            resolved_across: waves.resolved().y,
        },
        light: CellLight {
            sun_direction: setup.scene.sky.sun_direction.to_array(),
            gain: setup.gain,
            boat_sun: light.sun.to_array(),
            boat_sky: light.sky.to_array(),
            boat_sea: light.sea.to_array(),
            water_body: body.to_array(),
        },
        truth: CellMaking {
            samples: spec.samples,
            render_s,
            reflection_pixels: count,
            mean_change: (change / count.max(1) as f64).to_array(),
        },
    }
}

/// Radiance of the sky, in the picture's linear values: azimuth and elevation in degrees (clockwise from the direction of view), red, green,
/// blue. The sun's disc is not in it.
pub fn sky_rows(setup: &CellSetup) -> Vec<[f64; 5]> {
    const ELEVATIONS: [f64; 15] =
        [0.25, 0.5, 1.0, 2.0, 3.0, 5.0, 7.5, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0];
    let row = |azimuth: f64, elevation: f64| {
        let (a, e) = (azimuth.to_radians(), elevation.to_radians());
        let direction = (DVec2::new(a.sin(), a.cos()) * e.cos()).extend(e.sin());
        let c = setup.scene.sky.radiance(direction) * setup.gain;
        [azimuth, elevation, c.x, c.y, c.z]
    };
    let azimuths = (0..360).step_by(30).map(f64::from);
    azimuths.flat_map(|azimuth| ELEVATIONS.map(|elevation| row(azimuth, elevation))).collect()
}

/// Contents of a folder's `cell.toml`.
pub fn read(folder: &Path) -> Result<CellFile> {
    let path = folder.join("cell.toml");
    let text = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    toml::from_str(&text).with_context(|| format!("{} is no cell", path.display()))
}

/// The specification in a `cell.toml`.
pub fn read_spec(path: &Path) -> Result<CellSpec> {
    #[derive(serde::Deserialize)]
    struct Outer {
        spec: CellSpec,
    }
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let outer: Outer = toml::from_str(&text).with_context(|| format!("{} is no cell", path.display()))?;
    Ok(outer.spec)
}

fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

fn raw(path: &Path, pixels: &[[f32; 3]]) -> Result<()> {
    let bytes: Vec<u8> = pixels.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    put(path, &bytes)
}

/// Writes an sRGB PNG.
pub fn rgb(path: &Path, size: (u32, u32), bytes: Vec<u8>) -> Result<()> {
    let picture =
        RgbImage::from_raw(size.0, size.1, bytes).context("a picture has the wrong number of bytes")?;
    picture.save(path).with_context(|| format!("cannot write {}", path.display()))
}

fn grey(path: &Path, size: (u32, u32), bytes: Vec<u8>) -> Result<()> {
    let picture =
        GrayImage::from_raw(size.0, size.1, bytes).context("a mask has the wrong number of bytes")?;
    picture.save(path).with_context(|| format!("cannot write {}", path.display()))
}
