//! The camera's lens from pictures of a plane target.
//!
//! Homographies give the focal length (Zhang 2000), bundle adjustment everything else; outliers lose their weight. Two models are fitted,
//! a pinhole with radial and tangential distortion and a fisheye; which of them it is, is decided by what is left and by views that took no
//! part. The result says how sure it is and how much of the picture was seen. Pixels are the trainer's: the centre of the first
//! is (0.5, 0.5).

mod adjust;
mod judge;
mod model;
mod start;

use bowwave_core::{
    geometry::{Distortion, Lens},
    guide::Cell,
};
use glam::{DMat3, DVec2};
use nalgebra::SMatrix;

pub use judge::Missing;
pub(crate) use judge::enough;
pub use model::LensModel;
pub use start::BoardPose;
pub(crate) use start::{conditioned, homography, pose_from};

use crate::alignment::LensEvidence;
use adjust::{AdjustState, Adjusted, adjust};
use model::{INTRINSICS, Intrinsics};

/// One corner of the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Its place on the board, metres.
    pub board: DVec2,
    /// Where it was found, pixels.
    pub pixel: DVec2,
}

/// The corners found in one picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoardView {
    /// In any order.
    pub corners: Vec<Corner>,
}

/// Why there is no lens.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LensError {
    /// Not enough pictures.
    #[error(
        "only {count} pictures show {corners} corners or more, at least {least} are needed; take more of the whole target"
    )]
    TooFew {
        /// Usable pictures.
        count: usize,
        /// How many there must be.
        least: usize,
        /// Corners that a picture needs.
        corners: usize,
    },
    /// The board was always seen from the front.
    #[error(
        "the target is never tilted by more than {most_deg:.0} deg, at least {least_deg:.0} are needed in some pictures: from the front, \
         distance and focal length cannot be told apart; tilt it to the left, the right, up and down"
    )]
    NoTilt {
        /// Largest tilt.
        most_deg: f64,
        /// Least tilt, degrees.
        least_deg: f64,
    },
    /// The focal length is not told.
    #[error(
        "the focal length is uncertain by {:.1} %, at most {:.1} % can be used; take pictures with the target tilted in other ways, \
         near and filling the picture", share * 100.0, most * 100.0
    )]
    Uncertain {
        /// Its standard deviation by the focal length.
        share: f64,
        /// The most that can be used.
        most: f64,
    },
    /// Nothing fits.
    #[error(
        "no lens explains the corners ({sigma_px:.1} pixels are left); check the target's size and layout, and that all pictures \
         are of one camera at one zoom and {width} x {height} pixels"
    )]
    NoFit {
        /// Standard deviation of the residuals, pixels.
        sigma_px: f64,
        /// Picture width.
        width: u32,
        /// Picture height.
        height: u32,
    },
}

/// Fit of one of the models.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// The model.
    pub model: LensModel,
    /// Standard deviation of a corner's coordinate, pixels.
    pub sigma_px: f64,
    /// Bayesian information criterion (Schwarz 1978): less is better, 10 is decisive.
    pub bic: f64,
    /// The same for every other picture with the lens from the rest, poses their own, pixels.
    pub held_out_px: f64,
}

/// Parts of the picture that coverage is counted in: across and down.
pub const CELLS: (usize, usize) = (8, 6);

/// How well the pictures cover what there is to see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensCoverage {
    /// Corners in each part of the picture, row by row from above.
    pub cells: [[usize; CELLS.0]; CELLS.1],
    /// Share of the parts with a corner in them.
    pub share: f64,
    /// Smallest and largest tilt of the board, radians.
    pub tilt: [f64; 2],
}

/// A camera's lens with its uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct LensCalibration {
    /// Which model fits best.
    pub model: LensModel,
    /// Picture width and height in pixels.
    pub size: (u32, u32),
    /// fx, fy, cx, cy (pixels), then k1, k2, p1, p2 or the fisheye's k1 to k4.
    pub intrinsics: [f64; 8],
    /// Standard deviation of each.
    pub sigma: [f64; 8],
    /// Their covariance.
    pub covariance: [[f64; 8]; 8],
    /// Standard deviation of a corner's coordinate, pixels.
    pub sigma_px: f64,
    /// Both models.
    pub evidence: Vec<Evidence>,
    /// Coverage of the picture.
    pub coverage: LensCoverage,
    /// The board in each view that was used: number of the view and pose.
    pub poses: Vec<(usize, BoardPose)>,
    /// Covariance of each pose's rotation (camera's axes, rad^2).
    pub pose_covariances: Vec<DMat3>,
}

impl LensCalibration {
    /// The lens as the trainer's file holds it.
    pub fn lens(&self) -> Lens {
        self.model.lens(self.intrinsics, self.size)
    }

    /// Standard deviation of the focal length, pixels: the larger of both.
    pub fn focal_sigma_px(&self) -> f64 {
        self.sigma[0].max(self.sigma[1])
    }
}

/// Fewest corners of a picture, and pictures.
pub(crate) const CORNERS_LEAST: usize = 8;
const VIEWS_LEAST: usize = 4;
/// Most residual, as a share of the picture's width.
const LEFT_MOST: f64 = 0.005;

/// Finds the lens from corners in pictures of `width` x `height` pixels.
///
/// # Errors
/// Where there are too few pictures, none is tilted, the focal length is not told, or nothing fits.
pub fn solve(views: &[BoardView], (width, height): (u32, u32)) -> Result<LensCalibration, LensError> {
    /// How often views that do not fit are left out and the rest is fitted anew.
    const REFITS: usize = 2;
    /// Least tilt that some picture must have, radians.
    const TILT_LEAST: f64 = 0.17;
    /// Most relative uncertainty of the focal length.
    const FOCAL_MOST: f64 = 0.05;
    let size = DVec2::new(f64::from(width), f64::from(height)).max(DVec2::ONE);
    let (mut numbers, mut views) = clean(views, size);
    let few = |count| LensError::TooFew { count, least: VIEWS_LEAST, corners: CORNERS_LEAST };
    let no_fit = |sigma_px| LensError::NoFit { sigma_px, width, height };
    let mut tries = 0;
    let (evidence, best, fit) = loop {
        if views.len() < VIEWS_LEAST {
            return Err(few(views.len()));
        }
        let fits: Vec<(Evidence, Adjusted)> = [LensModel::RadialTangential, LensModel::Fisheye]
            .into_iter()
            .filter_map(|model| weigh(model, &views, size))
            .filter(|(e, _)| e.sigma_px.is_finite())
            .collect();
        let evidence: Vec<Evidence> = fits.iter().map(|f| f.0).collect();
        let (best, fit) = choose(fits).ok_or_else(|| no_fit(f64::INFINITY))?;
        // A view whose pose came to rest in a wrong valley spoils the others.
        let sound = adjust::sound(best.model, &fit, &views);
        tries += 1;
        if tries > REFITS || sound.iter().all(|s| *s) {
            break (evidence, best, fit);
        }
        let mut keep = sound.iter().copied();
        numbers.retain(|_| keep.next().unwrap_or(true));
        let mut keep = sound.iter().copied();
        views.retain(|_| keep.next().unwrap_or(true));
    };
    let tilts: Vec<f64> = fit.state.poses.iter().map(BoardPose::tilt).collect();
    let tilt =
        [tilts.iter().copied().fold(f64::INFINITY, f64::min), tilts.iter().copied().fold(0.0, f64::max)];
    if tilt[1] < TILT_LEAST {
        let least_deg = TILT_LEAST.to_degrees();
        return Err(LensError::NoTilt { most_deg: tilt[1].to_degrees(), least_deg });
    }
    if best.sigma_px > LEFT_MOST * size.x {
        return Err(no_fit(best.sigma_px));
    }
    let unknown = LensError::Uncertain { share: 1.0, most: FOCAL_MOST };
    let covariance = fit.covariance.ok_or(unknown)?;
    let sigma: [f64; INTRINSICS] = std::array::from_fn(|i| covariance[(i, i)].max(0.0).sqrt());
    let intrinsics: [f64; INTRINSICS] = fit.state.intrinsics.into();
    let share = (sigma[0] / intrinsics[0]).max(sigma[1] / intrinsics[1]).abs();
    if !(share <= FOCAL_MOST && intrinsics[0] > 0.0 && intrinsics[1] > 0.0) {
        return Err(LensError::Uncertain { share, most: FOCAL_MOST });
    }
    let rotation =
        |c: &Option<nalgebra::Matrix3<f64>>| c.as_ref().map_or(DMat3::ZERO, crate::solve::so3::dmat);
    Ok(LensCalibration {
        model: best.model,
        size: (width, height),
        intrinsics,
        sigma,
        covariance: covariance.into(),
        sigma_px: best.sigma_px,
        evidence,
        coverage: LensCoverage::of(&views, size, tilt),
        pose_covariances: fit.rotations.iter().map(rotation).collect(),
        poses: numbers.into_iter().zip(fit.state.poses).collect(),
    })
}

/// What corners tell of a lens that was calibrated, about it; `None` where they do not tell all of its numbers. The coefficients beyond the first
/// are taken for what they are.
pub(crate) fn evidence(views: &[BoardView], lens: &Lens) -> Option<LensEvidence> {
    let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
    let (_, views) = clean(views, size);
    if views.len() < VIEWS_LEAST {
        return None;
    }
    let (model, coefficients) = match lens.distortion {
        Distortion::None => (LensModel::RadialTangential, [0.0; 4]),
        Distortion::RadialTangential(d) => {
            (LensModel::RadialTangential, [d.radial().x, d.radial().y, d.tangential().x, d.tangential().y])
        }
        Distortion::Fisheye(d) => (LensModel::Fisheye, d.k()),
    };
    let (f, c, [k1, k2, k3, k4]) = (lens.focal, lens.centre, coefficients);
    let known = Intrinsics::from([f.x, f.y, c.x, c.y, k1, k2, k3, k4]);
    let poses: Option<Vec<BoardPose>> = views.iter().map(|v| start::pose(lens, &v.corners)).collect();
    let found = adjust(model, AdjustState { intrinsics: known, poses: poses? }, &views, false);
    if found.sigma_px > LEFT_MOST * size.x {
        return None;
    }
    let information = found.covariance?.try_inverse()?;
    let mut by = SMatrix::<f64, INTRINSICS, 4>::zeros();
    (by[(0, 0)], by[(1, 0)], by[(2, 1)], by[(3, 2)], by[(4, 3)]) = (f.x, f.y, f.x, f.y, 1.0);
    Some(LensEvidence {
        information: by.transpose() * information * by,
        right: by.transpose() * information * (found.state.intrinsics - known),
    })
}

/// Views with enough corners that are numbers within the picture, and their numbers.
fn clean(views: &[BoardView], size: DVec2) -> (Vec<usize>, Vec<BoardView>) {
    let sound = |c: &&Corner| {
        let inside = c.pixel.cmpge(DVec2::ZERO).all() && c.pixel.cmple(size).all();
        inside && c.board.is_finite() && c.board.length() < 1e3
    };
    views
        .iter()
        .enumerate()
        .map(|(i, v)| (i, BoardView { corners: v.corners.iter().filter(sound).copied().collect() }))
        .filter(|(_, v)| v.corners.len() >= CORNERS_LEAST)
        .unzip()
}

/// A model fitted to all views, and to every other one.
fn weigh(model: LensModel, views: &[BoardView], size: DVec2) -> Option<(Evidence, Adjusted)> {
    let all = fit(model, views, size)?;
    let half = |odd: usize| -> Vec<BoardView> { views.iter().skip(odd).step_by(2).cloned().collect() };
    let (told, asked) = (half(0), half(1));
    // From the common solution on: what is wanted is what the lens of one half says of the other.
    let poses = all.state.poses.iter().step_by(2).copied().collect();
    let own = adjust(model, AdjustState { intrinsics: all.state.intrinsics, poses }, &told, false);
    let poses = all.state.poses.iter().skip(1).step_by(2).copied().collect();
    let other = adjust(model, AdjustState { intrinsics: own.state.intrinsics, poses }, &asked, true);
    let numbers = 2.0 * views.iter().map(|v| v.corners.len()).sum::<usize>() as f64;
    let parameters = (INTRINSICS + 6 * views.len()) as f64;
    let bic = numbers * (all.sigma_px * all.sigma_px).ln() + parameters * numbers.ln();
    Some((Evidence { model, sigma_px: all.sigma_px, bic, held_out_px: other.sigma_px }, all))
}

/// The fisheye only where both measures speak for it: the trainer draws through the other.
fn choose(mut fits: Vec<(Evidence, Adjusted)>) -> Option<(Evidence, Adjusted)> {
    if let [first, second] = fits.as_slice() {
        let better = second.0.bic + 10.0 < first.0.bic && second.0.held_out_px < first.0.held_out_px;
        return fits.drain(..).nth(usize::from(better));
    }
    fits.pop()
}

/// Fits one model from Zhang's focal length, or from usual ones where that leads nowhere.
fn fit(model: LensModel, views: &[BoardView], size: DVec2) -> Option<Adjusted> {
    let middle = size / 2.0;
    let guesses = start::focal(views, middle).into_iter().chain([0.8, 0.35, 1.6, 4.0].map(|f| f * size.x));
    let mut best: Option<Adjusted> = None;
    for focal in guesses.filter(|f| (0.1..50.0).contains(&(f / size.x))) {
        let mut intrinsics = Intrinsics::zeros();
        (intrinsics[0], intrinsics[1]) = (focal, focal);
        (intrinsics[2], intrinsics[3]) = (middle.x, middle.y);
        let lens = model.trial(&intrinsics);
        let poses: Option<Vec<BoardPose>> = views.iter().map(|v| start::pose(&lens, &v.corners)).collect();
        let Some(poses) = poses else { continue };
        let found = adjust(model, AdjustState { intrinsics, poses }, views, false);
        if best.as_ref().is_none_or(|b| found.sigma_px < b.sigma_px) {
            best = Some(found);
        }
        // Half a pixel is what a good fit leaves; a worse one may be a wrong valley.
        if best.as_ref().is_some_and(|b| b.sigma_px < 0.5) {
            break;
        }
    }
    best.filter(|b| b.state.intrinsics.iter().all(|v| v.is_finite()))
}

impl LensCoverage {
    /// Of corners in pictures of that size, and of the board's smallest and largest tilt.
    pub(crate) fn of(views: &[BoardView], size: DVec2, tilt: [f64; 2]) -> Self {
        let mut cells = [[0; CELLS.0]; CELLS.1];
        for corner in views.iter().flat_map(|v| &v.corners) {
            let share = corner.pixel / size;
            let x = ((share.x * CELLS.0 as f64) as usize).min(CELLS.0 - 1);
            let y = ((share.y * CELLS.1 as f64) as usize).min(CELLS.1 - 1);
            cells[y][x] += 1;
        }
        let seen = cells.iter().flatten().filter(|count| **count > 0).count();
        Self { cells, share: seen as f64 / (CELLS.0 * CELLS.1) as f64, tilt }
    }

    /// How much there is in each part, row by row from above.
    pub fn levels(&self) -> Vec<Cell> {
        let mean = self.cells.iter().flatten().sum::<usize>() / (CELLS.0 * CELLS.1);
        let level = |count: &usize| match *count {
            0 => Cell::Empty,
            count if count > mean / 2 => Cell::Many,
            _ => Cell::Few,
        };
        self.cells.iter().flatten().map(level).collect()
    }
}

#[cfg(test)]
mod tests;
