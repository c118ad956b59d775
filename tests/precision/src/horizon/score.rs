//! The answer of a way to a picture, and how wrong it is.

use anyhow::{Context as _, Result};
use bowwave_core::{
    estimate::horizon::{Horizon, HorizonFinder, HorizonView, NoHorizon, Prior},
    event::{Picture, PixelFormat},
    geometry::{Distortion, Lens},
    own_ship::Mask,
};
use glam::{DMat2, DQuat, DVec2, DVec3};

use super::{frames::SeaFrame, synth::DrawnScene};

/// Width at which errors are stated, pixels.
pub const WIDTH: f64 = 1280.0;

/// Standard deviation of the predictions that are told, radians: a third of two degrees.
pub const PRIOR_SIGMA: f64 = 2.0 / 3.0 * std::f64::consts::PI / 180.0;

/// How far a horizon lies from the truth.
#[derive(Clone, Copy, Debug)]
pub struct Miss {
    /// Root mean square distance along the line, pixels at [`WIDTH`].
    pub px: f64,
    /// Difference of direction in the picture, degrees.
    pub deg: f64,
}

impl Miss {
    /// Whether this is no horizon any more: more than ten pixels or two degrees.
    pub fn is_failure(&self) -> bool {
        self.px > 10.0 || self.deg > 2.0
    }
}

/// How far a found direction of up is from the frame's mark; `None` without one.
pub fn miss(frame: &SeaFrame, up: DVec3) -> Option<Miss> {
    let [a, b] = frame.mark?;
    let off = |at: DVec2| frame.horizon_row(up, at.x) - at.y;
    let (left, right) = (off(a), off(b));
    let scale = WIDTH / frame.size.0 as f64;
    let slope = (b.y - a.y) / (b.x - a.x);
    let found = (b.y + right - a.y - left) / (b.x - a.x);
    Some(
        Miss {
            px: ((left * left + left * right + right * right) / 3.0).sqrt() * scale,
            deg: (found.atan() - slope.atan()).to_degrees(),
        }
        .abs(),
    )
}

impl Miss {
    fn abs(self) -> Self {
        Self { px: self.px.abs(), deg: self.deg.abs() }
    }
}

/// A direction as an inertial unit might predict it: turned by normal deviates of [`PRIOR_SIGMA`] about the axes across `up`.
pub fn predicted(up: DVec3, draw: u64) -> Prior {
    let even = |i: u64| DrawnScene::fair(draw.wrapping_mul(13).wrapping_add(i)).even(900 + i);
    let size = (-2.0 * even(1).max(1e-9).ln()).sqrt().min(2.5) * PRIOR_SIGMA;
    let (sin, cos) = (std::f64::consts::TAU * even(2)).sin_cos();
    let (x, y) = up.any_orthonormal_pair();
    Prior { up: DQuat::from_scaled_axis((x * cos + y * sin) * size) * up, sigma: PRIOR_SIGMA }
}

/// Shows a frame to the finder.
pub fn find(
    finder: &mut HorizonFinder,
    frame: &SeaFrame,
    prior: Option<Prior>,
) -> Result<std::result::Result<Horizon, NoHorizon>> {
    finder.set_mask(None);
    let view = HorizonView { lens: frame.picture_lens(), eye_height_m: frame.eye_m, prior };
    Ok(finder.find(&frame.picture()?, &view))
}

/// A drawn picture as a camera would deliver it, and what the finder is told of it.
pub struct DrawnHorizon {
    /// Its contents.
    pub shown: DrawnScene,
    /// The picture.
    pub picture: Picture,
    /// View that the finder is told.
    pub view: HorizonView,
    /// Part that is masked.
    pub mask: Option<Mask>,
}

impl DrawnHorizon {
    /// Draws it.
    pub fn new(shown: DrawnScene) -> Result<Self> {
        Self::coarse(shown, 1)
    }

    /// Draws it as a camera sees it whose pixels are `by` times as wide and as high.
    pub fn coarse(shown: DrawnScene, by: usize) -> Result<Self> {
        let (w, h) = (shown.size.0 / by, shown.size.1 / by);
        let mut bytes = binned(&shown.draw(), shown.size.0, by);
        bytes.resize(w * h * 3 / 2, 128);
        let picture = Picture::new(PixelFormat::Nv12, w as u32, h as u32, bytes.into())?;
        let lens = Lens {
            focal: DVec2::splat(shown.lens.focal / by as f64),
            distortion: Distortion::radial_tangential(DVec2::from(shown.lens.radial), DVec2::ZERO),
            ..Lens::pinhole(w as u32, h as u32, 1.0)
        };
        let mask = if shown.barrel { Some(barrel_mask().context("a mask")?) } else { None };
        let view = HorizonView { lens, eye_height_m: shown.eye_m, prior: None };
        Ok(Self { shown, picture, view, mask })
    }

    /// Shows it to the finder.
    pub fn find(
        &self,
        finder: &mut HorizonFinder,
        prior: Option<Prior>,
    ) -> std::result::Result<Horizon, NoHorizon> {
        finder.set_mask(self.mask.clone());
        finder.find(&self.picture, &HorizonView { prior, ..self.view })
    }

    /// How far a found direction of up is from the truth.
    pub fn miss(&self, up: DVec3) -> Miss {
        let off = self.off(up);
        // Roll turns the line about the middle of the picture, elevation moves it.
        let half = self.shown.size.0 as f64 / 2.0;
        let px = (off.y * self.shown.lens.focal).hypot(off.x * half / 3f64.sqrt());
        Miss { px: px * WIDTH / self.shown.size.0 as f64, deg: off.x.abs().to_degrees() }
    }

    /// Error of roll and elevation, radians.
    pub fn off(&self, up: DVec3) -> DVec2 {
        let found = DVec2::new((-up.x).atan2(-up.y), up.z.clamp(-1.0, 1.0).asin());
        found - DVec2::from(self.shown.attitude)
    }

    /// Squared error over the stated covariance: 2 in the mean where that is right.
    pub fn normalised(&self, found: &Horizon) -> f64 {
        let off = self.off(found.up);
        off.dot(DMat2::inverse(&found.covariance) * off)
    }
}

/// Means of fields of `by` times `by` codes; what is left over at the right and below is left out.
fn binned(codes: &[u8], width: usize, by: usize) -> Vec<u8> {
    let (columns, rows) = (width / by, codes.len() / width / by);
    let mean = |i: usize| {
        let corner = (i / columns * width + i % columns) * by;
        let field = (0..by).flat_map(|row| &codes[corner + row * width..][..by]);
        let sum: usize = field.map(|code| usize::from(*code)).sum();
        (sum as f64 / (by * by) as f64).round() as u8
    };
    (0..columns * rows).map(mean).collect()
}

/// Fields that the drawn barrel touches, and a little around it.
fn barrel_mask() -> Option<Mask> {
    let (width, height) = (64, 36);
    let (half, top) = DrawnScene::BARREL;
    let hides = |i: usize| {
        let x = ((i % width) as f64 + 0.5) / width as f64;
        let up = 1.0 - ((i / width) as f64 + 0.5) / height as f64;
        (x - 0.5).abs() < half + 0.02 && up < top + 0.03
    };
    Mask::new(width, height, (0..width * height).map(hides).collect())
}
