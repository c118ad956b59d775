//! Every way to mirror against ray-traced truth: mean FLIP in the reflection's region, and the bias of its luminance.
//!
//!     cargo run --release -p precision --bin reflection -- FOLDER_OF_CELLS [PART_OF_NAME] [--pictures DIR]
//!
//! A cell is a folder with `cell.toml`, `without.png` and `with.png` (8-bit sRGB), `hull.png`, `region.png` and `sky.csv`. A method gets the
//! picture without the boat, camera, boat, light and wind, as the trainer has them, and draws with the GPU.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
    time::Duration,
};

use anyhow::{Context, Result, anyhow, bail};
use bowwave_core::{
    event::{Picture, PixelFormat},
    geometry::{CameraPose, Lens, RigidPose},
    light::{LUMINANCE, srgb_to_linear},
    model::{Model, ModelId},
    reflection::{SKY_SINES, Sample, SeaTones, SkyLight},
    scene::{Hud, LeftOut, Light, Pass, PassDecision, ReflectionMethod, Scene, ShadowLevel, Status, Water},
    sea::BeaufortForce,
    view::{Afloat, Eye},
};
use bowwave_render::{Needs, RenderConfig, Renderer, TimeOuts};
use glam::{DQuat, DVec2, DVec3, Vec3};
use precision::{metric::flip_mean, truth::boat::box_boat};

struct Cell {
    name: String,
    table: toml::Table,
    without: image::RgbImage,
    with: image::RgbImage,
    hull: image::GrayImage,
    region: image::GrayImage,
    sky: Vec<(f64, Vec3)>,
}

impl Cell {
    fn load(dir: &Path) -> Result<Self> {
        let open = |name: &str| {
            let path = dir.join(name);
            image::open(&path).with_context(|| format!("cannot read {}", path.display()))
        };
        let text = |name: &str| {
            let path = dir.join(name);
            std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
        };
        let mut sky = Vec::new();
        for line in text("sky.csv")?.lines() {
            let v: Vec<f64> = line.split(',').filter_map(|x| x.trim().parse().ok()).collect();
            if let [azimuth, elevation, r, g, b] = v[..]
                && azimuth.abs() < 1e-6
            {
                sky.push((elevation, Vec3::new(r as f32, g as f32, b as f32)));
            }
        }
        Ok(Self {
            name: dir.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
            table: text("cell.toml")?.parse()?,
            without: open("without.png")?.to_rgb8(),
            with: open("with.png")?.to_rgb8(),
            hull: open("hull.png")?.to_luma8(),
            region: open("region.png")?.to_luma8(),
            sky,
        })
    }

    fn value(&self, section: &str, key: &str) -> Result<&toml::Value> {
        let value = self.table.get(section).and_then(|s| s.get(key));
        value.ok_or_else(|| anyhow!("{}: cell.toml has no {section}.{key}", self.name))
    }

    fn number(&self, section: &str, key: &str) -> Result<f64> {
        let v = self.value(section, key)?;
        let number = v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
        number.ok_or_else(|| anyhow!("{}: {section}.{key} is no number", self.name))
    }

    fn numbers<const N: usize>(&self, section: &str, key: &str) -> Result<[f64; N]> {
        let list = self.value(section, key)?.as_array().map(|a| a.iter().filter_map(toml::Value::as_float));
        let list: Vec<f64> = list.into_iter().flatten().collect();
        list.try_into().map_err(|_| anyhow!("{}: {section}.{key} is no list of {N} numbers", self.name))
    }

    fn sky_at(&self, degrees: f64) -> Vec3 {
        let i = self.sky.partition_point(|p| p.0 < degrees).clamp(1, self.sky.len() - 1);
        let (a, b) = (self.sky[i - 1], self.sky[i]);
        a.1.lerp(b.1, ((degrees - a.0) / (b.0 - a.0)).clamp(0.0, 1.0) as f32)
    }
}

/// The scene of a cell, seen through the region of interest alone.
fn scene(cell: &Cell, model: &Model) -> Result<Scene> {
    let (width, height) = cell.without.dimensions();
    let corner = DVec2::new(cell.number("region", "x")?, cell.number("region", "y")?);
    let lens = Lens {
        width,
        height,
        focal: DVec2::new(cell.number("camera", "fx")?, cell.number("camera", "fy")?),
        centre: DVec2::new(cell.number("camera", "cx")?, cell.number("camera", "cy")?) - corner,
        radial: DVec2::ZERO,
        tangential: DVec2::ZERO,
    };
    let camera = CameraPose {
        world_from_camera: DQuat::from_array(cell.numbers("camera", "world_from_camera")?),
        position: DVec3::from_array(cell.numbers("camera", "position")?),
    };
    let pose = RigidPose {
        world_from_body: DQuat::from_array(cell.numbers("boat", "world_from_boat")?),
        position: DVec3::from_array(cell.numbers("boat", "position")?),
    };
    let wind_m_s = cell.number("sea", "wind_m_s")?;
    let from = cell.number("sea", "wind_from_deg")?.to_radians();
    let light = |key: &str| Ok::<_, anyhow::Error>(DVec3::from_array(cell.numbers("light", key)?).as_vec3());
    let eye = Eye { camera: &camera, lens: &lens, visibility_m: 1e9, reflections: true };
    let water_level = pose.position.z;
    let boat = eye.see(&Afloat { boat: 0, model_id: ModelId(0), model, pose, water_level });
    let mut passes = [PassDecision::LeftOut(LeftOut::NoRounds); Pass::COUNT];
    for pass in [Pass::Video, Pass::Mirror, Pass::Water, Pass::Boats] {
        passes[pass as usize] = PassDecision::Run;
    }
    let force = BeaufortForce::of_wind(wind_m_s);
    Ok(Scene {
        frame: 0,
        camera,
        lens,
        passes,
        boats: boat.into_iter().collect(),
        rounds: Vec::new(),
        light: Light {
            sun_direction: DVec3::from_array(cell.numbers("light", "sun_direction")?),
            sun: light("boat_sun")?,
            sky: light("boat_sky")?,
            horizon: cell.sky_at(3.0),
            sea: light("boat_sea")?,
        },
        water: Water { method: ReflectionMethod::Off, force, shadow: ShadowLevel::None },
        wind: -DVec2::new(from.sin(), from.cos()) * wind_m_s,
        sky: SkyLight { nodes: SKY_SINES.map(|s| cell.sky_at(s.asin().to_degrees())) },
        tones: tones(cell, &lens, &camera),
        hud: Hud { status: Status::Ready, warning: None, rounds_left: 0, shots: 0, hits: 0, clock_s: 0.0 },
    })
}

fn tones(cell: &Cell, lens: &Lens, camera: &CameraPose) -> SeaTones {
    let sample = |(x, y, pixel): (u32, u32, &image::Rgb<u8>)| {
        let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let up = (camera.world_from_camera * lens.unproject(at)).z;
        let code = Vec3::from_array(pixel.0.map(|c| f32::from(c) / 255.0));
        let tangent = -up / (1.0 - up * up).sqrt();
        (tangent > 0.004).then(|| Sample { tangent, luma: f64::from(code.dot(LUMINANCE)) })
    };
    let samples: Vec<Sample> = cell.without.enumerate_pixels().filter_map(sample).collect();
    SeaTones::fit(&samples).unwrap_or_default()
}

fn draw(cell: &Cell, scene: &Scene, model: &Model) -> Result<image::RgbImage> {
    let (width, height) = cell.without.dimensions();
    let config = RenderConfig {
        width,
        height,
        device: None,
        validation: false,
        frames_in_flight: 1,
        needs: Needs { boats_max: 1, rounds_max: 0, waters: vec![(scene.water.method, scene.water.shadow)] },
        picture: None,
        time_outs: TimeOuts::default(),
    };
    let bytes: Arc<[u8]> = Arc::from(cell.without.as_raw().as_slice());
    let picture = Picture::new(PixelFormat::Rgb, width, height, bytes).context("no picture")?;
    let (mut renderer, mut done) = Renderer::new(&config, std::slice::from_ref(model))?;
    renderer.submit(scene, &picture, true)?;
    let frame = done.wait_next(Duration::from_secs(60))?.context("no frame within a minute")?;
    let rgb = frame.rgba().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    image::RgbImage::from_raw(width, height, rgb).context("a frame of another size")
}

/// The truth's own hull over a method's water, so that only the water differs.
fn with_hull(cell: &Cell, drawn: &image::RgbImage) -> image::RgbImage {
    let mut out = drawn.clone();
    for (x, y, pixel) in out.enumerate_pixels_mut() {
        if cell.hull.get_pixel(x, y).0[0] > 0 {
            *pixel = *cell.with.get_pixel(x, y);
        }
    }
    out
}

/// Mean FLIP over the region, and sum of luminance differences from `cell.with`.
fn errors(cell: &Cell, drawn: &image::RgbImage) -> Result<(f64, f64)> {
    let light = |p: &image::Rgb<u8>| {
        f64::from(Vec3::from_array(p.0.map(|c| srgb_to_linear(f32::from(c) / 255.0))).dot(LUMINANCE))
    };
    let judged: Vec<bool> = cell.region.pixels().map(|p| p.0[0] > 127).collect();
    let flip = flip_mean(cell.with.as_raw(), drawn.as_raw(), cell.with.dimensions(), &judged)?;
    let pixels = judged.iter().zip(drawn.pixels()).zip(cell.with.pixels());
    let bias =
        pixels.filter(|((judged, _), _)| **judged).map(|((_, got), want)| light(got) - light(want)).sum();
    Ok((flip.unwrap_or(0.0), bias))
}

fn run() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().context("name the folder of the cells")?;
    let (mut part, mut pictures) = (String::new(), None);
    while let Some(a) = arguments.next() {
        if a == "--pictures" {
            pictures = Some(PathBuf::from(arguments.next().context("--pictures wants a folder")?));
        } else {
            part = a;
        }
    }
    let mut cells: Vec<PathBuf> = std::fs::read_dir(&folder)?.filter_map(|e| Some(e.ok()?.path())).collect();
    cells.retain(|p| p.join("cell.toml").exists() && p.to_string_lossy().contains(&part));
    cells.sort();
    if cells.is_empty() {
        bail!("{folder} holds no finished cell whose name contains '{part}'");
    }
    let model = box_boat();
    println!(
        "{:36} {}",
        "FLIP (bias of the change)",
        ReflectionMethod::ALL.map(|m| format!("{:>19}", m.name())).concat()
    );
    let mut sums = [0.0; ReflectionMethod::ALL.len()];
    for dir in &cells {
        let cell = Cell::load(dir)?;
        let mut scene = scene(&cell, &model)?;
        let change = errors(&cell, &with_hull(&cell, &cell.without))?.1.abs().max(1e-9);
        let mut line = format!("{:36}", cell.name);
        for (sum, method) in sums.iter_mut().zip(ReflectionMethod::ALL) {
            scene.water.method = method;
            let drawn = with_hull(&cell, &draw(&cell, &scene, &model)?);
            let (flip, bias) = errors(&cell, &drawn)?;
            *sum += flip;
            line += &format!("     {flip:.3} ({:+6.2})", bias / change);
            if let Some(dir) = &pictures {
                std::fs::create_dir_all(dir)?;
                drawn.save(dir.join(format!("{}-{}.png", cell.name, method.name())))?;
            }
        }
        println!("{line}");
    }
    let means = sums.map(|s| format!("     {:.4}        ", s / cells.len() as f64)).concat();
    println!("{:36}{means}", "mean");
    Ok(())
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("reflection: {e:#}");
            ExitCode::FAILURE
        }
    }
}
