//! The camera's noise by brightness, found in pictures of the sea.

use anyhow::Result;
use bowwave_core::{
    colour::{linear_to_srgb, srgb_to_linear},
    estimate::light::CameraNoise,
    event::{Picture, PixelFormat},
};
use glam::Vec3;
use hw_sim::make::{GunMotion, Periodic, Recipe, Studio};

use super::About;
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "noise",
    what: "Finds the camera's noise by brightness in a picture of the sea, to draw it on boats.",
    truth: "the spread of a simulated camera's picture about the same picture without noise, by brightness: as it comes, and after a JPEG",
    rivals: "Immerkaer's operator over the whole picture (1996), by brightness; the difference of two pictures in a row; the spread about the plane of each patch",
    why: "Immerkaer's operator is as good where noise is white, at 19 times the time; a JPEG takes half of what it answers to. Waves pass for noise in the other two. The evenest three in ten of the patches of a \
          brightness show noise alone if any do; what choosing them takes off is known. Errors are of green's deviation, rms over eight lights",
};

/// A picture, 8-bit sRGB.
struct Shot {
    bytes: Vec<u8>,
    size: (u32, u32),
}

impl Shot {
    fn picture(&self) -> Result<Picture> {
        let (width, height) = self.size;
        Ok(Picture::new(PixelFormat::Rgb, width, height, self.bytes.clone().into())?)
    }

    fn green(&self, x: usize, y: usize) -> f64 {
        f64::from(self.bytes[3 * (y * self.size.0 as usize + x) + 1]) / 255.0
    }
}

/// One scene: what is seen, what came just before, and green's deviation by its light.
struct Scene {
    seen: Shot,
    before: Shot,
    truth: Vec<(f32, f32)>,
}

/// Groups of pixels by light.
const LIGHTS: usize = 8;

/// Light of one code more, both from 0 to 1.
fn slope(code: f64) -> f64 {
    const STEP: f32 = 1e-3;
    let code = code as f32;
    f64::from((srgb_to_linear(code + STEP) - srgb_to_linear(code - STEP)) / (2.0 * STEP))
}

/// Deviations by light from pairs of a code and a squared error of it, in groups of as many.
fn by_light(mut pairs: Vec<(f64, f64)>) -> Vec<(f32, f32)> {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let each = pairs.len().div_ceil(LIGHTS).max(1);
    let group = |some: &[(f64, f64)]| {
        let count = some.len() as f64;
        let code = some.iter().map(|p| p.0).sum::<f64>() / count;
        let error = (some.iter().map(|p| p.1).sum::<f64>() / count).sqrt() * slope(code);
        (srgb_to_linear(code as f32), error as f32)
    };
    pairs.chunks(each).map(group).collect()
}

impl Scene {
    fn new(gain: f64, down: f64, quality: Option<u8>) -> Result<Self> {
        let mut recipe = Recipe { width: 640, height: 360, ..Recipe::default() };
        let still = |angle: f64| Periodic::new(angle, &[]);
        recipe.gun = GunMotion { traverse: still(0.4), elevation: still(-down) };
        recipe.camera.read_noise *= gain;
        recipe.camera.shot_noise *= gain;
        recipe.camera.jpeg_quality = quality.unwrap_or(90);
        let size = (recipe.width, recipe.height);
        let studio = Studio::new(&recipe)?;
        let shoot = |frame: u32| -> Result<Shot> {
            let bytes = match quality {
                None => studio.shoot_rgb(frame).1,
                Some(_) => image::load_from_memory(&studio.shoot(frame)?.jpeg)?.to_rgb8().into_raw(),
            };
            Ok(Shot { bytes, size })
        };
        let (before, seen) = (shoot(4)?, shoot(5)?);
        (recipe.camera.read_noise, recipe.camera.shot_noise) = (0.0, 0.0);
        let clean = Shot { bytes: Studio::new(&recipe)?.shoot_rgb(5).1, size };
        let mut pairs = Vec::new();
        for y in 0..size.1 as usize {
            for x in 0..size.0 as usize {
                let code = clean.green(x, y);
                // Beyond white nothing is drawn, and noise is cut off.
                if code < 0.95 {
                    pairs.push((code, (seen.green(x, y) - code).powi(2)));
                }
            }
        }
        // What is drawn is rounded to whole codes anyway.
        let rounded = |(code, squared): (f64, f64)| (code, squared - 1.0 / (12.0 * 255.0 * 255.0));
        let truth = by_light(pairs.into_iter().map(rounded).collect());
        Ok(Self { seen, before, truth })
    }

    /// Rms of the relative error of a deviation by light, per cent.
    fn error(&self, found: &dyn Fn(f32) -> f32) -> f64 {
        let off = self.truth.iter().map(|(light, truth)| f64::from(found(*light) / truth - 1.0).powi(2));
        100.0 * (off.sum::<f64>() / self.truth.len() as f64).sqrt()
    }
}

/// Deviation that is found at the nearest light.
fn nearest(found: &[(f32, f32)], light: f32) -> f32 {
    let off = |p: &&(f32, f32)| (linear_to_srgb(p.0) - linear_to_srgb(light)).abs();
    found.iter().min_by(|a, b| off(a).total_cmp(&off(b))).map_or(0.0, |p| p.1)
}

/// The operator that answers to noise and to no plane, 36 times whose variance noise has.
fn laplacian(shot: &Shot) -> Vec<(f32, f32)> {
    const KERNEL: [[f64; 3]; 3] = [[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]];
    let mut pairs = Vec::new();
    for y in 1..shot.size.1 as usize - 1 {
        for x in 1..shot.size.0 as usize - 1 {
            let mut sum = 0.0;
            for (j, row) in KERNEL.iter().enumerate() {
                sum += row.iter().enumerate().map(|(i, k)| k * shot.green(x + i - 1, y + j - 1)).sum::<f64>();
            }
            pairs.push((shot.green(x, y), sum * sum / 36.0));
        }
    }
    by_light(pairs)
}

/// Half the square of what changed from one picture to the next.
fn changed(shot: &Shot, before: &Shot) -> Vec<(f32, f32)> {
    let mut pairs = Vec::new();
    for y in 0..shot.size.1 as usize {
        for x in 0..shot.size.0 as usize {
            let (now, then) = (shot.green(x, y), before.green(x, y));
            pairs.push((0.5 * (now + then), 0.5 * (now - then).powi(2)));
        }
    }
    by_light(pairs)
}

/// Spread about each patch's mean and slope, of all patches.
fn all_patches(shot: &Shot) -> Vec<(f32, f32)> {
    const SIDE: usize = 8;
    let mut pairs = Vec::new();
    for y in (0..shot.size.1 as usize - SIDE).step_by(2 * SIDE) {
        for x in (0..shot.size.0 as usize - SIDE).step_by(2 * SIDE) {
            let pixels = || (0..SIDE * SIDE).map(|i| (i % SIDE, i / SIDE));
            let mean = pixels().map(|(i, j)| shot.green(x + i, y + j)).sum::<f64>() / 64.0;
            let at = |i: usize| i as f64 - 3.5;
            let right = pixels().map(|(i, j)| at(i) * shot.green(x + i, y + j)).sum::<f64>() / 336.0;
            let down = pixels().map(|(i, j)| at(j) * shot.green(x + i, y + j)).sum::<f64>() / 336.0;
            let off = |(i, j)| shot.green(x + i, y + j) - mean - right * at(i) - down * at(j);
            pairs.push((mean, pixels().map(|p| off(p).powi(2)).sum::<f64>() / 61.0));
        }
    }
    by_light(pairs)
}

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let deg = f64::to_radians;
    let mut cases = vec![
        ("a camera in the dark, 20 times the noise", 20.0, deg(-2.0), None),
        ("the same, JPEG of quality 90", 20.0, deg(-2.0), Some(90)),
        ("the same, nothing but sea in view", 20.0, deg(14.0), None),
    ];
    if !bench.is_quick() {
        cases.extend([
            ("60 times the noise", 60.0, deg(-2.0), None),
            ("the same, JPEG of quality 75", 60.0, deg(-2.0), Some(75)),
            ("5 times the noise", 5.0, deg(-2.0), None),
            ("by day", 1.0, deg(-2.0), None),
        ]);
    }
    for (case, gain, down, quality) in cases {
        let scene = Scene::new(gain, down, quality)?;
        let picture = scene.seen.picture()?;
        let found = CameraNoise::of(&picture);
        let product = |light: f32| found.map_or(0.0, |noise| noise.deviation(Vec3::splat(light)).y);
        let rivals = [
            ("Immerkaer", laplacian(&scene.seen)),
            ("two pictures", changed(&scene.seen, &scene.before)),
            ("all patches", all_patches(&scene.seen)),
        ];
        let mut ways = vec![
            Way::new("patches", "evenest 3 of 10", scene.error(&product), 1, || CameraNoise::of(&picture))
                .default_if(true),
        ];
        for (method, table) in &rivals {
            let error = scene.error(&|light| nearest(table, light));
            let (seen, before) = (&scene.seen, &scene.before);
            ways.push(Way::new(method, "whole picture", error, 1, move || match *method {
                "Immerkaer" => laplacian(seen),
                "two pictures" => changed(seen, before),
                _ => all_patches(seen),
            }));
        }
        bench.scene(case, "% of the deviation", 2.0, ways);
    }
    extremes(bench)
}

/// Pictures without anything to measure noise by: the largest deviation that is found, codes at a light of 0.2; finite.
fn extremes(bench: &mut PartBench) -> Result<()> {
    let of = |code: fn(usize) -> u8| -> Result<f64> {
        let shot = Shot { bytes: (0..64 * 64 * 3).map(code).collect(), size: (64, 64) };
        let found = CameraNoise::of(&shot.picture()?);
        Ok(found.map_or(0.0, |noise| {
            let codes = 255.0 * noise.deviation(Vec3::splat(0.2)).max_element();
            f64::from(codes) / slope(f64::from(linear_to_srgb(0.2)))
        }))
    };
    for (case, code) in [
        ("a black picture", (|_| 0) as fn(usize) -> u8),
        ("a white picture", |_| 255),
        ("a picture of one grey", |_| 90),
        ("stripes of black and white, a pixel wide", |i| if i / 3 % 2 == 0 { 0 } else { 255 }),
    ] {
        bench.extreme(
            case,
            "codes found",
            vec![ExtremeResult::product("patches", "evenest 3 of 10", of(code)?)],
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_of_a_camera_in_the_dark_is_found_within_15_per_cent_and_rivals_take_waves_for_it() {
        let scene = Scene::new(20.0, (-2f64).to_radians(), None).expect("a picture");
        let found = CameraNoise::of(&scene.seen.picture().expect("a picture")).expect("patches");
        let error = scene.error(&|light| found.deviation(Vec3::splat(light)).y);
        assert!(error < 15.0, "{error} %");
        let table = changed(&scene.seen, &scene.before);
        assert!(scene.error(&|light| nearest(&table, light)) > error);
    }
}
