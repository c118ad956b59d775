//! Pictures cut from a panorama of the sea, against pictures drawn directly.

use anyhow::{Context, Result};
use bowwave_core::world::scenario::{BUILT_IN, Scenario};
use hw_sim::{
    live::CutCamera,
    make::{GunMotion, Periodic, Recipe, Studio},
    panorama::{self, Panorama, PanoramaRecipe},
};

use super::About;
use crate::bench::{ExtremeResult, PartBench};

/// Description of this part.
pub const ABOUT: About = About {
    part: "cut",
    what: "Cuts the pictures of a simulated camera that somebody turns out of a panorama of the sea.",
    truth: "the same sea at the same instant, drawn directly for the camera as recordings are; for the waves' texture also drawn three times as finely",
    rivals: "the direct drawing itself against the finer one; a panorama of half the pixels a degree",
    why: "A direct drawing of a frame takes longer than the frame lasts. Mean and place are those of the direct drawing to .6 of a code and a \
          tenth of a pixel. The waves' texture differs from the direct drawing's, which takes its columns elsewhere, by no more than that \
          differs from a finer one",
};

/// Traverse about north and elevation of the views, degrees.
const VIEWS: [(f64, f64); 3] = [(0.0, -6.0), (-55.0, 1.0), (66.0, -16.0)];

/// A picture of three bytes a pixel.
struct Rgb {
    bytes: Vec<u8>,
    width: usize,
    height: usize,
}

/// What two pictures differ by.
#[derive(Clone, Copy, Default)]
struct Difference {
    /// Mean difference, codes.
    mean: f64,
    /// Mean absolute difference, codes.
    texture: f64,
    /// Shift of the sky, pixels.
    sky_px: f64,
    /// Shift of the horizon, pixels.
    horizon_px: f64,
}

impl Rgb {
    fn green(&self, x: usize, y: usize) -> f64 {
        f64::from(self.bytes[3 * (y * self.width + x) + 1])
    }

    /// Row of the horizon in a column near a row: where the darkening from sky to water is half done, by its integral.
    fn edge(&self, x: usize, about: f64) -> f64 {
        const REACH: usize = 7;
        let middle = about as usize;
        let value = |y: usize| (0..3).map(|dx| self.green(x + dx, y)).sum::<f64>();
        let (sky, water) = (value(middle - REACH), value(middle + REACH));
        let covered: f64 = (middle - REACH..middle + REACH).map(|y| (value(y) - water) / (sky - water)).sum();
        (middle - REACH) as f64 + covered
    }

    fn against(&self, other: &Self, horizon: impl Fn(usize) -> Option<f64>) -> Difference {
        let pairs = || self.bytes.iter().zip(&other.bytes).map(|(a, b)| f64::from(*a) - f64::from(*b));
        let count = self.bytes.len() as f64;
        let columns: Vec<(usize, f64)> =
            (8..self.width - 11).step_by(3).filter_map(|x| Some((x, horizon(x)?))).collect();
        let inside = |row: f64| row > 16.0 && row < self.height as f64 - 16.0;
        let edges: Vec<f64> = columns
            .iter()
            .filter(|(_, row)| inside(*row))
            .map(|&(x, row)| self.edge(x, row) - other.edge(x, row))
            .filter(|shift| shift.is_finite())
            .collect();
        // Lucas and Kanade 1981 over the sky.
        let (mut a, mut b) = ([0.0; 3], [0.0; 2]);
        for &(x, row) in &columns {
            for y in 1..(row - 12.0).clamp(1.0, self.height as f64 - 1.0) as usize {
                let gx = (other.green(x + 1, y) - other.green(x - 1, y)) / 2.0;
                let gy = (other.green(x, y + 1) - other.green(x, y - 1)) / 2.0;
                let off = other.green(x, y) - self.green(x, y);
                a = [a[0] + gx * gx, a[1] + gx * gy, a[2] + gy * gy];
                b = [b[0] + gx * off, b[1] + gy * off];
            }
        }
        let determinant = a[0] * a[2] - a[1] * a[1];
        let shift = [(b[0] * a[2] - b[1] * a[1]) / determinant, (a[0] * b[1] - a[1] * b[0]) / determinant];
        Difference {
            mean: pairs().sum::<f64>().abs() / count,
            texture: pairs().map(f64::abs).sum::<f64>() / count,
            sky_px: if determinant > 0.0 { shift[0].hypot(shift[1]) } else { 0.0 },
            horizon_px: (edges.iter().sum::<f64>() / edges.len().max(1) as f64).abs(),
        }
    }
}

/// The largest differences over the views of a scenario: cut against direct, cut from half the pixels, direct against finer.
fn differences(name: &str, size: (u32, u32), views: &[(f64, f64)]) -> Result<[Difference; 3]> {
    let (_, text) = BUILT_IN.into_iter().find(|(known, _)| *known == name).context("no such scenario")?;
    let mut panorama = PanoramaRecipe::of_scenario(&Scenario::parse(text, name)?, size);
    panorama.recipe.frame_rate_hz = 1.0;
    (panorama.recipe.camera.read_noise, panorama.recipe.camera.shot_noise) = (0.0, 0.0);
    let folder = tempfile::tempdir()?;
    let mut worst = [Difference::default(); 3];
    let mut seas = Vec::new();
    for (file, share) in [("whole", 1.0), ("half", 0.5)] {
        let recipe = PanoramaRecipe { detail: share, ..panorama.clone() };
        let path = folder.path().join(file);
        panorama::make(&recipe, &path, &mut |_, _| {})?;
        seas.push(Panorama::open(&path)?);
    }
    let mut camera = CutCamera::new(&panorama.recipe);
    for (i, &(traverse, elevation)) in views.iter().enumerate() {
        let frame = 2 + i as u32;
        let still = |degrees: f64| Periodic::new(degrees.to_radians(), &[]);
        let recipe = Recipe {
            gun: GunMotion { traverse: still(traverse), elevation: still(elevation) },
            ..panorama.recipe.clone()
        };
        let (width, height) = (size.0 as usize, size.1 as usize);
        let picture = |bytes: Vec<u8>| Rgb { bytes, width, height };
        let (pose, direct) = Studio::new(&recipe)?.shoot_rgb(frame);
        let finer = Studio::with_detail(&recipe, 3.0)?.shoot_rgb(frame).1;
        let (direct, finer) = (picture(direct), picture(finer));
        let lens = recipe.lens();
        // The horizon's dip: d = sqrt(2 h / (7/6 R)), in radians (refraction as the drawing has it).
        let dip = (2.0 * recipe.eye_height_m * 0.87 / 6.371e6).sqrt();
        let horizon = |x: usize| {
            (0..4 * height).map(|y| y as f64 / 4.0).find(|y| {
                let d = pose.world_from_camera * lens.unproject(glam::DVec2::new(x as f64 + 1.5, *y));
                d.z / d.x.hypot(d.y) < -dip
            })
        };
        let mut cut = |sea: &mut Panorama| -> Result<Rgb> {
            let azimuths = camera.aim(&sea.view(), std::iter::repeat(pose.world_from_camera));
            sea.show(frame as usize, azimuths)?;
            let mut rgb = vec![0; camera.bytes()];
            camera.cut(&sea.view(), frame, &mut rgb);
            Ok(picture(rgb))
        };
        let found = [
            cut(&mut seas[0])?.against(&direct, horizon),
            cut(&mut seas[1])?.against(&direct, horizon),
            direct.against(&finer, horizon),
        ];
        for (worst, found) in worst.iter_mut().zip(found) {
            *worst = Difference {
                mean: worst.mean.max(found.mean),
                texture: worst.texture.max(found.texture),
                sky_px: worst.sky_px.max(found.sky_px),
                horizon_px: worst.horizon_px.max(found.horizon_px),
            };
        }
    }
    Ok(worst)
}

/// One number of a difference.
type DifferenceOf = fn(&Difference) -> f64;

/// Measures the extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let (scenes, size, views): (&[&str], _, _) = if bench.is_quick() {
        (&["first-target"], (640, 360), &VIEWS[..1])
    } else {
        (&["first-target", "rough-water", "swarm-of-nine"], (1280, 720), &VIEWS[..])
    };
    for name in scenes {
        let [cut, half, finer] = differences(name, size, views)?;
        let rows: [(&str, &str, DifferenceOf); 4] = [
            ("mean", "codes", |d| d.mean),
            ("place of the sky", "px", |d| d.sky_px),
            ("place of the horizon", "px", |d| d.horizon_px),
            ("waves, mean absolute difference", "codes", |d| d.texture),
        ];
        for (what, unit, value) in rows {
            bench.extreme(
                &format!("{name}: {what}"),
                unit,
                vec![
                    ExtremeResult::product("cut from the panorama", "", value(&cut)),
                    ExtremeResult::rival("cut from half the pixels", "", value(&half)),
                    ExtremeResult::rival("drawn directly, against three times as finely", "", value(&finer)),
                ],
            );
        }
    }
    Ok(())
}
