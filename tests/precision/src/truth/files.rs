//! A cell on disk.

use std::{fmt::Write as _, fs, path::Path};

use anyhow::{Context, Result};
use glam::{DVec2, DVec3};
use image::{GrayImage, RgbImage};

use super::{
    cell::{CellSpec, PICTURE, Pictures, Region, Setup},
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

/// A linear picture as sRGB bytes.
pub fn coded(pixels: &[[f32; 3]]) -> Vec<u8> {
    pixels.iter().flat_map(|p| p.map(code)).collect()
}

/// What `cell.toml` says beside the [`CellSpec`] (read it with [`read_spec`]).
#[derive(serde::Serialize)]
struct Written<'a> {
    spec: &'a CellSpec,
    camera: Camera,
    region: Region,
    boat: Boat,
    sea: Sea,
    light: Light,
    truth: Own,
}

#[derive(serde::Serialize)]
struct Camera {
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    vfov_deg: f64,
    position: [f64; 3],
    /// x, y, z, w.
    world_from_camera: [f64; 4],
}

#[derive(serde::Serialize)]
struct Boat {
    model: String,
    position: [f64; 3],
    /// x, y, z, w.
    world_from_boat: [f64; 4],
}

#[derive(serde::Serialize)]
struct Sea {
    wind_m_s: f64,
    wind_from_deg: f64,
    significant_height_m: f64,
    peak_wavelength_m: f64,
    slope_variance_along: f64,
    slope_variance_across: f64,
    resolved_along: f64,
    resolved_across: f64,
}

#[derive(serde::Serialize)]
struct Light {
    sun_direction: [f64; 3],
    gain: f64,
    boat_sun: [f64; 3],
    boat_sky: [f64; 3],
    boat_sea: [f64; 3],
    water_body: [f64; 3],
}

#[derive(serde::Serialize)]
struct Own {
    samples: u32,
    render_s: f64,
    reflection_pixels: usize,
    mean_change: [f64; 3],
}

/// Renders the cell and writes it as `folder`, which appears when it is complete and replaces one that was there.
pub fn make(spec: &CellSpec, folder: &Path) -> Result<()> {
    let start = std::time::Instant::now();
    let setup = Setup::new(spec)?;
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

fn write(setup: &Setup, pictures: &Pictures, render_s: f64, folder: &Path) -> Result<()> {
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
    put(&folder.join("sky.csv"), sky_table(setup)?.as_bytes())?;
    let described = describe(setup, pictures, &region, render_s);
    let text = toml::to_string(&described).context("cannot write a cell as TOML")?;
    put(&folder.join("cell.toml"), text.as_bytes())
}

fn describe<'a>(setup: &'a Setup, pictures: &Pictures, region: &[bool], render_s: f64) -> Written<'a> {
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
    Written {
        spec,
        camera: Camera {
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
        boat: Boat {
            model: spec.boat.clone(),
            position: setup.pose.position.to_array(),
            world_from_boat: setup.pose.world_from_body.to_array(),
        },
        sea: Sea {
            wind_m_s: setup.spectrum.wind_m_s,
            wind_from_deg: spec.wind_from_deg,
            significant_height_m: setup.spectrum.significant_height_m(),
            peak_wavelength_m: std::f64::consts::TAU / setup.spectrum.peak(),
            slope_variance_along: all.x,
            slope_variance_across: all.y,
            resolved_along: waves.resolved().x,
            resolved_across: waves.resolved().y,
        },
        light: Light {
            sun_direction: setup.scene.sky.sun_direction.to_array(),
            gain: setup.gain,
            boat_sun: light.sun.to_array(),
            boat_sky: light.sky.to_array(),
            boat_sea: light.sea.to_array(),
            water_body: body.to_array(),
        },
        truth: Own {
            samples: spec.samples,
            render_s,
            reflection_pixels: count,
            mean_change: (change / count.max(1) as f64).to_array(),
        },
    }
}

/// Radiance of the sky over elevation, in the picture's linear values, in the direction of view, across it and behind.
fn sky_table(setup: &Setup) -> Result<String> {
    let mut text = String::from("azimuth_deg,elevation_deg,r,g,b\n");
    for azimuth in (0..360).step_by(30) {
        for elevation in
            [0.25, 0.5, 1.0, 2.0, 3.0, 5.0, 7.5, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0f64]
        {
            let (a, e) = (f64::from(azimuth).to_radians(), elevation.to_radians());
            let direction = (DVec2::new(a.sin(), a.cos()) * e.cos()).extend(e.sin());
            let c = setup.scene.sky.radiance(direction) * setup.gain;
            writeln!(text, "{azimuth},{elevation},{:.5},{:.5},{:.5}", c.x, c.y, c.z)?;
        }
    }
    Ok(text)
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
