//! How much lower than the true horizon its edge is seen through haze.

use anyhow::{Context as _, Result};
use bowwave_core::{
    estimate::horizon::{HorizonFinder, HorizonView, Prior, lowered_by_haze},
    event::{Picture, PixelFormat},
    geometry::Lens,
};
use glam::{DQuat, DVec3};
use hw_sim::make::{Recipe, Studio};

use super::{About, rms};
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "haze",
    what: "Tells by how much lower than the true horizon the edge stands that is found in haze, so that inclination is not bent to it.",
    truth: "drawn seas of known attitude by the simulator's own renderer, which marches through waves and haze column by column and knows \
            nothing of the finder; noise, shading towards the corners and JPEG included",
    rivals: "leaving the edge where it is found",
    why: "the finder itself is asked once, at the start, what it makes of pictures of sky, water and haze alone; a visibility that is known \
          to a third, as from a weather report, still takes most of the error away",
};

const WIDTH: u32 = 960;
/// Pixels of 1920 over 60 deg in a radian, at the picture's middle.
const PX: f64 = 1662.8;

/// Pictures in one haze.
struct HazyPictures {
    pictures: Vec<(Picture, DQuat)>,
    lens: Lens,
    eye_height_m: f64,
}

impl HazyPictures {
    fn new(eye_height_m: f64, visibility_m: f64, count: u32) -> Result<Self> {
        let recipe = Recipe {
            width: WIDTH,
            height: WIDTH * 9 / 16,
            frame_rate_hz: 1.0,
            eye_height_m,
            visibility_m,
            ..Recipe::default()
        };
        let studio = Studio::new(&recipe)?;
        let shoot = |frame| {
            let (pose, rgb) = studio.shoot_rgb(frame);
            let picture = Picture::new(PixelFormat::Rgb, recipe.width, recipe.height, rgb.into())
                .context("a drawn picture of another size")?;
            Ok((picture, pose.world_from_camera))
        };
        Ok(Self {
            pictures: (0..count).map(|i| shoot(2 * i)).collect::<Result<_>>()?,
            lens: recipe.lens(),
            eye_height_m,
        })
    }

    /// By how much too high the camera seems to look in each picture, radians.
    fn errors(&self) -> Vec<f64> {
        let mut finder = HorizonFinder::new();
        let error = |(picture, truth): &(Picture, DQuat)| {
            let up = truth.inverse() * DVec3::Z;
            let prior = Some(Prior { up, sigma: 0.2f64.to_radians() });
            let view = HorizonView { lens: self.lens, eye_height_m: self.eye_height_m, prior };
            let found = *truth * finder.find(picture, &view).ok()?.up;
            let ahead = (*truth * DVec3::Z).truncate().normalize_or_zero();
            Some(found.truncate().dot(ahead))
        };
        self.pictures.iter().filter_map(error).collect()
    }
}

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let count = if bench.is_quick() { 3 } else { 10 };
    for (eye_height_m, visibility_km) in
        [(8.0, 60.0), (8.0, 35.0), (8.0, 20.0), (8.0, 10.0), (3.0, 20.0), (20.0, 20.0)]
    {
        let visibility_m = 1000.0 * visibility_km;
        let drawn = HazyPictures::new(eye_height_m, visibility_m, count)?;
        let errors = drawn.errors();
        let left = |lowered: f64| PX * rms(errors.iter().map(|e| e - lowered));
        let lowered =
            |share: f64| lowered_by_haze(&drawn.lens, eye_height_m, visibility_m * share).unwrap_or(f64::NAN);
        let asked = || lowered(1.0);
        let note = format!("{} of {count} found", errors.len());
        let case = format!("eye {eye_height_m} m, visibility {visibility_km} km");
        let ways = vec![
            Way::new("the finder asked", "visibility known", left(lowered(1.0)), 1, asked)
                .default_if(true)
                .note(note),
            Way::new("the edge as it is found", "", left(0.0), 1, || 0.0),
        ];
        bench.scene(&case, "px of 1920", 0.02, ways);
        let wrong = [1.0 / 1.3, 1.3].map(|share| left(lowered(share))).into_iter().fold(0.0, f64::max);
        let tried = ExtremeResult::product("the finder asked", "visibility wrong by a third", wrong);
        bench.extreme(&case, "px of 1920", vec![tried]);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_haze_does_is_known() {
        let drawn = HazyPictures::new(8.0, 20_000.0, 2).unwrap();
        let errors = drawn.errors();
        assert_eq!(errors.len(), 2);
        let lowered = lowered_by_haze(&drawn.lens, 8.0, 20_000.0).expect("an edge");
        let (left, found) = (rms(errors.iter().map(|e| e - lowered)), rms(errors.iter().copied()));
        assert!(left < 0.5 * found, "{left} of {found} rad are left");
    }
}
