//! Whether a lens is good enough, and what pictures would make it better.

use std::fmt;

use glam::DVec2;
use nalgebra::SMatrix;

use super::{
    CELLS, LensCalibration, LensCoverage,
    model::{INTRINSICS, direction, project},
};
use crate::{alignment::Grade, solve::so3::vector};

/// Requirements of a complete set of pictures.
pub(crate) mod enough {
    /// Fewest pictures.
    pub(crate) const PICTURES: usize = 12;
    /// Tilt that some picture should have, radians.
    pub(crate) const TILT: f64 = 0.35;
    /// Share of the parts of the picture that should have corners.
    pub(crate) const SHARE: f64 = 0.75;
}

use enough::{PICTURES, SHARE, TILT};
/// Most residual, pixels, of the grades good and usable: sharp pictures of a flat board leave less than half of the first.
const LEFT_PX: [f64; 2] = [0.4, 1.0];

/// Kind of picture that is missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Missing {
    /// There are only so many.
    Pictures(usize),
    /// The board is tilted by no more than this, radians.
    Tilt(f64),
    /// No corner lies in this part of the picture.
    Part(&'static str),
    /// Large residual, pixels: blur, a board that is bent, or the wrong one.
    Fit(f64),
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pictures(count) => {
                write!(
                    f,
                    "take {} more pictures: {count} were used, {PICTURES} are enough",
                    PICTURES - count.min(&PICTURES)
                )
            }
            Self::Tilt(most) => write!(
                f,
                "tilt the board more, to all four sides: at most {:.0} deg so far, {:.0} are needed",
                most.to_degrees(),
                TILT.to_degrees()
            ),
            Self::Part(part) => write!(f, "take pictures with the board in the {part} of the picture"),
            Self::Fit(px) => write!(
                f,
                "{px:.2} pixels are left where a sharp picture of a flat board leaves 0.2: hold camera and board still, light it better, \
                 check that it is flat and that --target names its layout"
            ),
        }
    }
}

/// The picture's parts that matter most, since boats and horizon are seen there as well: rows and columns of cells.
const PARTS: [(&str, [usize; 4]); 8] = [
    ("upper left corner", [0, 2, 0, 2]),
    ("upper right corner", [0, 2, CELLS.0 - 2, CELLS.0]),
    ("lower left corner", [CELLS.1 - 2, CELLS.1, 0, 2]),
    ("lower right corner", [CELLS.1 - 2, CELLS.1, CELLS.0 - 2, CELLS.0]),
    ("upper middle", [0, 1, 2, CELLS.0 - 2]),
    ("lower middle", [CELLS.1 - 1, CELLS.1, 2, CELLS.0 - 2]),
    ("left middle", [2, CELLS.1 - 2, 0, 1]),
    ("right middle", [2, CELLS.1 - 2, CELLS.0 - 1, CELLS.0]),
];

impl LensCoverage {
    /// The parts of the picture that matter most and have no corner.
    pub(crate) fn missing(&self) -> impl Iterator<Item = Missing> + '_ {
        let is_seen = |[top, bottom, left, right]: [usize; 4]| {
            let seen = |row: &[usize; CELLS.0]| row.iter().take(right).skip(left).any(|count| *count > 0);
            self.cells.iter().take(bottom).skip(top).any(seen)
        };
        PARTS.iter().filter(move |(_, part)| !is_seen(*part)).map(|(name, _)| Missing::Part(name))
    }
}

impl LensCalibration {
    /// Largest standard deviation of the angle between the picture's middle and a place on its edge, radians: how far boats are misplaced
    /// by the lens alone. How the picture's middle looks is no part of it, since mounting and boresight are measured through the same
    /// lens. Infinite where the lens folds back before a corner, as that of a fisheye may where no board was seen.
    pub fn edge_sigma(&self) -> f64 {
        let size = DVec2::new(f64::from(self.size.0), f64::from(self.size.1));
        let around =
            [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (1.0, 0.5), (1.0, 1.0), (0.5, 1.0), (0.0, 1.0), (0.0, 0.5)];
        around.into_iter().map(|share| self.angle_sigma(size * DVec2::from(share))).fold(0.0, f64::max)
    }

    /// Standard deviation of the angle between the picture's middle and a pixel, radians; infinite where no direction falls on it.
    pub fn angle_sigma(&self, pixel: DVec2) -> f64 {
        let middle = DVec2::new(f64::from(self.size.0), f64::from(self.size.1)) / 2.0;
        let (Some(here), Some(there)) = (self.turn_by_intrinsics(pixel), self.turn_by_intrinsics(middle))
        else {
            return f64::INFINITY;
        };
        let own = SMatrix::<f64, INTRINSICS, INTRINSICS>::from(self.covariance);
        let by = here - there;
        (by * own * by.transpose()).trace().max(0.0).sqrt()
    }

    /// How the direction of a pixel, right and down, turns with the intrinsics.
    fn turn_by_intrinsics(&self, pixel: DVec2) -> Option<SMatrix<f64, 2, INTRINSICS>> {
        let lens = self.lens();
        let direction = direction(&lens, pixel)?;
        let (_, by_point, by_intrinsics) = project(&lens, direction)?;
        // Two directions across the line of sight.
        let right = glam::DVec3::Y.cross(direction).normalize();
        let down = direction.cross(right);
        let across = SMatrix::<f64, 3, 2>::from_columns(&[vector(right), vector(down)]);
        Some((by_point * across).try_inverse()? * by_intrinsics)
    }

    /// Pictures that would make it better.
    pub fn missing(&self) -> Vec<Missing> {
        let mut out = Vec::new();
        if self.sigma_px > LEFT_PX[0] {
            out.push(Missing::Fit(self.sigma_px));
        }
        if self.poses.len() < PICTURES {
            out.push(Missing::Pictures(self.poses.len()));
        }
        if self.coverage.tilt[1] < TILT {
            out.push(Missing::Tilt(self.coverage.tilt[1]));
        }
        out.extend(self.coverage.missing());
        out
    }

    /// How good it is, by the angle that boats are misplaced by.
    pub fn grade(&self) -> Grade {
        let edge = self.edge_sigma();
        let within = |i: usize| edge <= Grade::ROTATION[i] && self.sigma_px <= LEFT_PX[i];
        if within(0) && self.coverage.share >= SHARE && self.poses.len() >= PICTURES {
            Grade::Good
        } else if within(1) {
            Grade::Usable
        } else {
            Grade::Poor
        }
    }
}
