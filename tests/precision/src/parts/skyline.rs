//! Heading from sky line, coast and clouds.

use std::sync::Arc;

use anyhow::{Context as _, Result};
use bowwave_core::{
    estimate::skyline::{SkyView, Skyline},
    event::{Picture, PixelFormat},
    geometry::{Distortion, Lens, look},
    time::Time,
};
use glam::{DQuat, DVec2};
use rayon::prelude::*;

use super::{About, rms, worst};
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    horizon::synth::{DrawnLens, DrawnScene},
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "skyline",
    what: "Follows sky line, coast and clouds through pictures: by how much the believed heading is off since the anchor.",
    truth: "drawn skies of known heading, by the renderer of the horizon's part, seen through a bowed lens while the camera is turned and \
            rolled; the believed heading drifts by .05 deg/s",
    rivals: "the same without a pyramid; without the clouds' wind among what is sought; without a prediction of the camera's turn; each picture \
             against the one before, added up; fewer points and more",
    why: "against the anchor nothing adds up, where a chain of pictures errs by a random walk and costs twice; where wind carries clouds it is \
          carried along if it does not seek the wind too; without a pyramid it holds only what is predicted within two pixels, without a prediction it loses a gun that is trained fast. Errors are root mean squares over the series; a \
          picture without an answer counts with the drift since the last one",
};

/// Pictures a second, and by how much the believed heading drifts, rad/s clockwise.
const RATE_HZ: f64 = 10.0;
const DRIFT: f64 = 0.05 * std::f64::consts::PI / 180.0;
/// How fast the sky may drift at the horizon as is usual, and for one that is said to stand, rad/s.
const DRIFTING: f64 = 0.005 * std::f64::consts::PI / 180.0;
const STANDING: f64 = 1e-7;
/// Standard deviation of the predicted turn, radians.
const SIGMA: f64 = 3.5e-3;

/// A series of pictures of a drawn sky.
struct Series {
    lens: Lens,
    eye_m: f64,
    pictures: Vec<(Picture, [f64; 3])>,
}

impl Series {
    fn new(count: usize, shown: impl Fn(f64) -> DrawnScene + Sync) -> Result<Self> {
        let drawn = (0..count).into_par_iter().map(|i| {
            let mut shown = shown(i as f64 / RATE_HZ);
            shown.picture = i as u64;
            let mut luma = shown.draw();
            luma.resize(luma.len() * 3 / 2, 128);
            let (w, h) = (shown.size.0 as u32, shown.size.1 as u32);
            let picture =
                Picture::new(PixelFormat::Nv12, w, h, Arc::from(luma)).context("a drawn picture")?;
            let [roll, elevation] = shown.attitude;
            Ok((picture, [shown.heading, elevation, roll]))
        });
        let pictures = drawn.collect::<Result<Vec<_>>>()?;
        let first = shown(0.0);
        let plain = Lens::pinhole(first.size.0 as u32, first.size.1 as u32, 1.0);
        let lens = Lens {
            focal: DVec2::splat(first.lens.focal),
            distortion: Distortion::radial_tangential(DVec2::from(first.lens.radial), DVec2::ZERO),
            ..plain
        };
        Ok(Self { lens, eye_m: first.eye_m, pictures })
    }

    /// How the camera is believed to look in picture `i`.
    fn believed(&self, i: usize, way: Follow) -> DQuat {
        let [heading, elevation, roll] = self.pictures.get(i).map_or([0.0; 3], |p| p.1);
        let drift = DRIFT * i as f64 / RATE_HZ;
        let first = self.pictures.first().map_or(0.0, |p| p.1[0]);
        let heading = if way.predicted { heading } else { first };
        look(heading + drift, elevation, roll)
    }

    fn look(&self, skyline: &mut Skyline, i: usize, way: Follow) -> Option<(f64, bool)> {
        let view = SkyView {
            lens: self.lens,
            eye_height_m: self.eye_m,
            world_from_camera: self.believed(i, way),
            sigma: if way.pyramid { SIGMA } else { 0.0 },
            drift: way.drift,
        };
        let time = Time::from_ns((i as f64 / RATE_HZ * 1e9) as i64);
        let seen = skyline.look(time, &self.pictures.get(i)?.0, &view).ok()?;
        Some((seen.off, seen.is_anchor()))
    }

    /// By how much the heading is wrong in each picture after the first, degrees, and how many pictures had an answer.
    fn errors(&self, way: Follow) -> (Vec<f64>, usize) {
        let mut skyline = way.skyline();
        // What of the drift is known by now, and what was known when the present anchor was taken.
        let (mut known, mut before, mut answered) = (0.0, 0.0, 0);
        let mut errors = Vec::new();
        for i in 0..self.pictures.len() {
            if way.chained && i > 0 {
                skyline.forget();
                let _ = self.look(&mut skyline, i - 1, way);
                before = known;
            }
            match self.look(&mut skyline, i, way) {
                Some((_, true)) => before = known,
                Some((off, false)) => {
                    answered += 1;
                    known = before + off;
                }
                None => {}
            }
            let first = self.pictures.first().map_or(0.0, |p| p.1[0]);
            let turned = self.pictures.get(i).map_or(0.0, |p| p.1[0]) - first;
            let truth = DRIFT * i as f64 / RATE_HZ - if way.predicted { 0.0 } else { turned };
            errors.push((known - truth).to_degrees());
        }
        (errors, answered)
    }
}

/// A way to follow the sky.
#[derive(Clone, Copy)]
struct Follow {
    pyramid: bool,
    predicted: bool,
    chained: bool,
    points: usize,
    /// How fast what is at the horizon may drift, rad/s.
    drift: f64,
}

impl Follow {
    const PRODUCT: Self =
        Self { pyramid: true, predicted: true, chained: false, points: Skyline::POINTS, drift: DRIFTING };

    fn skyline(self) -> Skyline {
        Skyline::of_points(self.points)
    }
}

const WAYS: [(&str, &str, Follow); 7] = [
    ("anchored", "60 points", Follow::PRODUCT),
    ("anchored", "20 points", Follow { points: 20, ..Follow::PRODUCT }),
    ("anchored", "120 points", Follow { points: 120, ..Follow::PRODUCT }),
    ("anchored", "no wind", Follow { drift: STANDING, ..Follow::PRODUCT }),
    ("anchored", "no pyramid", Follow { pyramid: false, ..Follow::PRODUCT }),
    ("anchored", "no prediction", Follow { predicted: false, ..Follow::PRODUCT }),
    ("picture to picture", "60 points", Follow { chained: true, ..Follow::PRODUCT }),
];

/// A fair sky through a bowed lens.
fn fair() -> DrawnScene {
    DrawnScene { lens: DrawnLens { focal: 1108.5, radial: [-0.1, 0.02] }, ..DrawnScene::fair(7003) }
}

/// A gun that is trained to and fro by `degrees`, at `deg_s` at most, on a ship that rolls.
fn trained(t: f64, degrees: f64, deg_s: f64) -> DrawnScene {
    let roll = 4f64.to_radians() * (0.9 * t).sin();
    let elevation = (-2.0 + 1.5 * (1.3 * t).sin()).to_radians();
    let heading = degrees.to_radians() * (deg_s / degrees.max(1e-9) * t).sin();
    DrawnScene { attitude: [roll, elevation], heading, ..fair() }
}

fn scene(bench: &mut PartBench, name: &str, series: &Series) {
    let ways = WAYS.map(|(method, setting, way)| {
        let (errors, answered) = series.errors(way);
        let end = errors.last().copied().unwrap_or(f64::NAN).abs();
        let mut skyline = way.skyline();
        let mut next = 0;
        let timed = move || {
            next = (next + 1) % series.pictures.len();
            if next == 0 {
                skyline.forget();
            }
            if way.chained && next > 0 {
                skyline.forget();
                let _ = series.look(&mut skyline, next - 1, way);
            }
            series.look(&mut skyline, next, way)
        };
        let way = Way::new(method, setting, rms(errors), 1, timed).note(format!(
            "{answered} of {} answered, off by {end:.4} deg at the end",
            series.pictures.len() - 1
        ));
        let default = setting == "60 points" && method == "anchored";
        if default { way.default_although(EXACT) } else { way }
    });
    bench.scene(name, "deg", 0.002, ways.into());
}

/// Why the pyramid is there though a scene here does without.
const EXACT: &str = "the turn is predicted exactly here; the pyramid is for predictions that are not";

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let count = if bench.is_quick() { 16 } else { 150 };
    scene(bench, "clouds, trained at 15 deg/s, 1280x720", &Series::new(count, |t| trained(t, 20.0, 15.0))?);
    let coast = |t: f64| DrawnScene { coast: 0.02, ..trained(t, 40.0, 60.0) };
    scene(bench, "coast and clouds, trained at 60 deg/s, 1280x720", &Series::new(count, coast)?);
    for (name, shown) in EXTREMES {
        let series = Series::new(count, |t| half(shown(t)))?;
        let tried = WAYS.map(|(method, setting, way)| {
            let (errors, answered) = series.errors(way);
            ExtremeResult {
                default: setting == "60 points" && method == "anchored",
                ..ExtremeResult::rival(method, setting, worst(errors.into_iter().map(f64::abs)))
            }
            .note(format!("{answered} of {} answered", series.pictures.len() - 1))
        });
        bench.extreme(name, "deg", tried.into());
    }
    Ok(())
}

/// The same in half the size, which is drawn in a quarter of the time.
fn half(shown: DrawnScene) -> DrawnScene {
    let lens = DrawnLens { focal: 0.5 * shown.lens.focal, ..shown.lens };
    DrawnScene { size: (shown.size.0 / 2, shown.size.1 / 2), lens, ..shown }
}

/// An extreme case: what is shown after so many seconds.
type Extreme = (&'static str, fn(f64) -> DrawnScene);

const EXTREMES: [Extreme; 12] = [
    ("no texture in the sky", |t| DrawnScene { contrast: [0.0, 10.0], ..trained(t, 10.0, 10.0) }),
    ("faint clouds, a code", |t| DrawnScene { contrast: [0.8, 10.0], ..trained(t, 10.0, 10.0) }),
    ("all water", |t| DrawnScene { attitude: [0.0, -0.8], ..trained(t, 10.0, 10.0) }),
    ("all sky", |t| DrawnScene { attitude: [0.0, 0.5], ..trained(t, 10.0, 10.0) }),
    ("glare: sky at the sensor's limit", |t| DrawnScene {
        codes: [280.0, 270.0, 120.0],
        ..trained(t, 10.0, 10.0)
    }),
    ("clouds drift by .03 deg/s behind a coast", |t| DrawnScene {
        coast: 0.02,
        clouds_turned: (0.03 * t).to_radians(),
        ..trained(t, 10.0, 10.0)
    }),
    ("clouds 1 km up go by at 10 m/s", |t| DrawnScene {
        clouds_gone: [0.01 * t, 0.0],
        ..trained(t, 10.0, 10.0)
    }),
    ("the same behind a coast", |t| DrawnScene {
        coast: 0.02,
        clouds_gone: [0.01 * t, 0.0],
        ..trained(t, 10.0, 10.0)
    }),
    ("ships pass at 2 deg/s", |t| DrawnScene {
        ships: 5,
        ships_turned: (2.0 * t).to_radians(),
        ..trained(t, 10.0, 10.0)
    }),
    ("jump by 40 deg after a second", |t| DrawnScene {
        heading: if t < 1.0 { 0.0 } else { 0.7 },
        ..trained(0.0, 10.0, 0.0)
    }),
    ("smeared over 12 rows", |t| DrawnScene { smear: 12, ..trained(t, 10.0, 10.0) }),
    ("noise of 8 codes", |t| DrawnScene { noise: 8.0, ..trained(t, 10.0, 10.0) }),
];
