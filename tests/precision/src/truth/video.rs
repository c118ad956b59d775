//! Moving pictures of a boat-free sea whose spectrum is known: what an estimate from video is held against.

use std::{fmt::Write as _, fs, path::Path};

use anyhow::{Context, Result, ensure};
use bowwave_core::geometry::{CameraPose, Lens, look};
use glam::{DVec2, DVec3};
use hw_sim::ocean::{
    random::LightPath,
    sky::SkySpec,
    spectrum::{LongWaves, Spectrum, frequency},
    trace::{TracedScene, WaterBody},
    waves::{Resolution, TracedSea, Waves},
};
use rayon::prelude::*;

use super::{
    cell::{daylight, exposure},
    files,
};

/// Settings of a film.
#[derive(Clone, Debug, serde::Serialize)]
pub struct VideoSpec {
    /// Wind 10 m above the sea, m/s.
    pub wind_m_s: f64,
    /// Where wind and waves come from, degrees clockwise from north; the camera looks north.
    pub wind_from_deg: f64,
    /// Height of the eye, metres.
    pub eye_m: f64,
    /// Length, seconds.
    pub seconds: f64,
    /// Pictures a second.
    pub fps: f64,
    /// Picture width, pixels; the height is 9/16 of it.
    pub width: u32,
    /// Angle across, degrees.
    pub hfov_deg: f64,
    /// Camera's pitch, degrees above the horizon.
    pub pitch_deg: f64,
    /// Paths a pixel.
    pub samples: u32,
    /// Which waves.
    pub wave_seed: u64,
    /// Shortest wave that has a shape, metres.
    pub shortest_m: f64,
    /// Name of the light.
    pub lighting: String,
    /// Sky and sun.
    pub sky: SkySpec,
    /// Long waves.
    pub long_waves: LongWaves,
}

#[derive(serde::Serialize)]
struct VideoFacts<'a> {
    significant_height_m: f64,
    peak_period_s: f64,
    peak_wavelength_m: f64,
    frames: u32,
    width: u32,
    height: u32,
    fx: f64,
    cx: f64,
    cy: f64,
    horizon_row: f64,
    spec: &'a VideoSpec,
}

/// Renders the frames `00000.png` and on into `out`, with `video.toml` and `spectrum.csv`. Frames that are there already are kept.
pub fn make(spec: &VideoSpec, out: &Path) -> Result<()> {
    let numbers = [spec.wind_m_s, spec.eye_m, spec.seconds, spec.fps, spec.hfov_deg, spec.pitch_deg];
    ensure!(numbers.iter().all(|v| v.is_finite()), "a video's numbers must be finite: {spec:?}");
    ensure!(
        spec.width >= 16 && spec.samples > 0,
        "width {} and samples {} are too few",
        spec.width,
        spec.samples
    );
    let frames = (spec.seconds * spec.fps).round().clamp(1.0, 1e6) as u32;
    let spectrum = Spectrum::new(spec.wind_m_s, spec.wind_from_deg.to_radians(), spec.long_waves);
    let resolution = Resolution { shortest_m: spec.shortest_m, cells: 512, ..Resolution::default() };
    let sea = TracedSea::new(&spectrum, &resolution, spec.wave_seed);
    let lens = Lens::pinhole(spec.width, spec.width * 9 / 16, spec.hfov_deg.to_radians());
    let camera = CameraPose {
        world_from_camera: look(0.0, spec.pitch_deg.to_radians(), 0.0),
        position: DVec3::new(0.0, 0.0, spec.eye_m),
    };
    let (sky, body) = (daylight(&spec.sky)?, WaterBody::default());
    let light = TracedScene::boat_light(&sky, &body);
    let mut scene = TracedScene { sky, waves: Waves::statistical(&spectrum), body, boat: None, light };
    let gain = exposure(&scene, &lens, &camera);
    fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    put(&out.join("spectrum.csv"), &spectrum_table(&spectrum)?)?;
    put(&out.join("video.toml"), &known(spec, &spectrum, &lens, frames)?)?;
    for frame in 0..frames {
        let file = out.join(format!("{frame:05}.png"));
        if file.exists() {
            continue;
        }
        scene.waves = sea.at(f64::from(frame) / spec.fps);
        let picture = picture(&scene, &lens, &camera, gain, (spec.samples, frame));
        files::rgb(&file, (lens.width, lens.height), files::coded(&picture))?;
    }
    Ok(())
}

fn picture(
    scene: &TracedScene,
    lens: &Lens,
    camera: &CameraPose,
    gain: f64,
    draw: (u32, u32),
) -> Vec<[f32; 3]> {
    let (samples, frame) = draw;
    (0..lens.width * lens.height)
        .into_par_iter()
        .map(|i| {
            let corner = DVec2::new(f64::from(i % lens.width), f64::from(i / lens.width));
            let mut sum = DVec3::ZERO;
            for index in 0..samples {
                // Frames draw other paths, as a camera's noise is new in each.
                let mut path = LightPath::new(u64::from(frame), u64::from(i), u64::from(index));
                let pixel = corner + DVec2::new(path.unit(), path.unit());
                let direction = camera.world_from_camera * lens.unproject(pixel);
                sum += scene.trace(camera.position, direction, &mut path).without;
            }
            (sum * gain / f64::from(samples)).as_vec3().to_array()
        })
        .collect()
}

fn known(spec: &VideoSpec, spectrum: &Spectrum, lens: &Lens, frames: u32) -> Result<String> {
    let kp = spectrum.peak();
    let waves = kp.is_finite();
    let known = VideoFacts {
        significant_height_m: spectrum.significant_height_m(),
        peak_period_s: if waves { std::f64::consts::TAU / frequency(kp) } else { 0.0 },
        peak_wavelength_m: if waves { std::f64::consts::TAU / kp } else { 0.0 },
        frames,
        width: lens.width,
        height: lens.height,
        fx: lens.focal.x,
        cx: lens.centre.x,
        cy: lens.centre.y,
        horizon_row: lens.centre.y + lens.focal.y * spec.pitch_deg.to_radians().tan(),
        spec,
    };
    toml::to_string(&known).context("cannot write a video's description as TOML")
}

/// The spectrum over wave number, with its contrast between along and across the wind.
fn spectrum_table(spectrum: &Spectrum) -> Result<String> {
    let mut text = String::from("k_rad_m,omega_rad_s,s_k_m3,contrast\n");
    let kp = spectrum.peak();
    if kp.is_finite() {
        for i in 0..400 {
            let k = kp / 5.0 * (f64::from(i) / 400.0 * 1000f64.ln()).exp();
            let (s, contrast) = (spectrum.omnidirectional(k), spectrum.contrast(k));
            writeln!(text, "{k:.6e},{:.6e},{s:.6e},{contrast:.4}", frequency(k))?;
        }
    }
    Ok(text)
}

fn put(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}
