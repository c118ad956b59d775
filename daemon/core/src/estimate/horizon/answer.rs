//! The horizon of a picture, or why there is none.

use glam::{DMat2, DMat3, DVec3};

use super::fit::angles_of;
use crate::geometry::{Lens, look};

/// Where up is predicted to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Up in the camera's axes, unit length.
    pub up: DVec3,
    /// Its standard deviation about any axis, radians.
    pub sigma: f64,
}

/// Prior knowledge about a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HorizonView {
    /// The camera's lens; where it is given for another size than the picture has, it is scaled.
    pub lens: Lens,
    /// Height of the eye above the sea, metres.
    pub eye_height_m: f64,
    /// Where up is predicted to be, if anybody knows.
    pub prior: Option<Prior>,
}

/// The horizon of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Horizon {
    /// Up in the camera's axes (x right, y down, z forward), unit length, dip taken into account.
    pub up: DVec3,
    /// Covariance of roll and elevation, rad^2.
    pub covariance: DMat2,
    /// Its quality.
    pub quality: LineQuality,
}

impl Horizon {
    /// Roll of the camera, clockwise, as in [`crate::geometry::look`], radians.
    pub fn roll(&self) -> f64 {
        angles_of(self.up).x
    }

    /// Elevation of the camera's axis above the horizontal, as in [`crate::geometry::look`], radians.
    pub fn elevation(&self) -> f64 {
        angles_of(self.up).y
    }
}

impl Horizon {
    /// Covariance of the error of [`Self::up`], rad^2, in the camera's axes.
    pub fn up_covariance(&self) -> DMat3 {
        let (roll, elevation) = (self.roll(), self.elevation());
        let up = |roll: f64, elevation: f64| look(0.0, elevation, roll).inverse() * DVec3::Z;
        let step = 1e-4;
        let by_roll = (up(roll + step, elevation) - up(roll - step, elevation)) / (2.0 * step);
        let by_elevation = (up(roll, elevation + step) - up(roll, elevation - step)) / (2.0 * step);
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
        let c = self.covariance;
        outer(by_roll, by_roll) * c.x_axis.x
            + outer(by_elevation, by_elevation) * c.y_axis.y
            + (outer(by_roll, by_elevation) + outer(by_elevation, by_roll)) * c.x_axis.y
    }
}

/// Quality of a line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineQuality {
    /// Columns of eight pixels with an edge on the line, and neighbours that have too.
    pub columns: usize,
    /// These over the columns that the line crosses.
    pub solid_share: f64,
    /// Columns with an edge on the line below what is no sky, over these and the free ones.
    pub land_share: f64,
    /// Columns in which sky reaches down past the line, over these and the free ones.
    pub past_share: f64,
    /// Columns in which sky ends a little above the line, over these and the free ones.
    pub above_share: f64,
    /// Free columns above which nothing up to the picture's edge has as large a step, over all free ones.
    pub open_share: f64,
    /// Columns that the line crosses, not hidden, over all.
    pub visible_share: f64,
    /// Mean step of brightness across it, codes of 255.
    pub contrast: f64,
    /// That over what is found on lines parallel to it.
    pub peak_ratio: f64,
    /// How much rows above it differ from one to the next, codes: the median over the columns.
    pub texture: f64,
    /// What of that the picture's noise makes, codes.
    pub noise: f64,
    /// Share of the change over twenty rows that lies within three.
    pub sharpness: f64,
    /// Standard deviation of the edges about it, reduced pixels.
    pub scatter_px: f64,
    /// All of it in one number: the acceptance Q of the search.
    pub score: f64,
}

/// Why there is no horizon.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoHorizon {
    /// The picture is too small to hold one that is any good.
    #[error("the picture is too small")]
    TooSmall,
    /// It is predicted to lie outside of the picture.
    #[error("the horizon is predicted outside of the picture")]
    OutOfView,
    /// Nothing stands out.
    #[error("no line stands out")]
    Featureless,
    /// The best line is not clear enough, or too faint.
    #[error("the best line scores only {:.2}, with a step of {:.1} codes", .0.score, .0.contrast)]
    Unclear(LineQuality),
    /// The best line is smeared, by motion or fog.
    #[error("the best line is blurred, its sharpness is {:.2}", .0.sharpness)]
    Blurred(LineQuality),
    /// What is above the best line is no sky: a shore's water line.
    #[error("above the best line rows differ by {:.1} codes, which is no sky", .0.texture)]
    Textured(LineQuality),
    /// The best line is not where the horizon is predicted.
    #[error("the best line is not where the horizon is predicted")]
    Elsewhere(LineQuality),
}
