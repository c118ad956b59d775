//! The calibration target: a board of square tags (an "AprilGrid", as Kalibr prints them).
//!
//! Tags of the family 36h11 with a black border two modules wide stand in rows and columns. Black squares fill the places where the gaps
//! between them cross, so that every corner of a tag is a crossing of two black and two white fields: a saddle of brightness, whose place
//! neither blur nor exposure moves. A board can be seen in part, because every tag says which one it is.

mod bend;
mod board;
mod codes;
mod corner;
mod detect;
mod kalibr;
mod picture;
mod quads;
mod read;
mod varied;

use std::{fmt, str::FromStr};

use glam::DVec2;

pub use board::{BoardFinder, find_tag, look_for, seen};
pub(crate) use board::{OFF_MOST_PX, Oriented, SHEARED_MOST_PX, orient};
pub use corner::Refinement;
pub use detect::{Tag, detect, detect_by, view};
pub use kalibr::KalibrError;
pub use picture::Grey;
pub(crate) use picture::Plane;
pub use varied::varied;
pub(crate) use varied::{apart, lie};

/// Modules along a tag's side: six of data, two of border on either side.
pub const MODULES: usize = 10;
/// Modules of data along a side.
const DATA: usize = 6;
/// Modules of the border.
const BORDER: usize = 2;

/// Size and layout of a board.
///
/// Tag 0 is the lower left one, ids run to the right and then upwards. Places on the board are metres from the lower left corner of
/// tag 0, x to the right, y up, seen from the front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    columns: usize,
    rows: usize,
    tag_m: f64,
    spacing: f64,
}

/// Why there is no such target.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TargetError {
    /// Not of the form that is read.
    #[error(
        "'{0}' is no target: write COLUMNSxROWS:TAG_MM or COLUMNSxROWS:TAG_MM:SPACING, as 6x6:22 or 6x6:22:0.3"
    )]
    Form(String),
    /// A number that cannot be.
    #[error(
        "a board of {columns} x {rows} tags of {:.1} mm, {spacing} of that apart, cannot be: 1 to {} tags of 1 to 2000 mm, 0.1 to 1 of \
         that apart", tag_m * 1e3, codes::TAG36H11.len()
    )]
    Size {
        /// Tags across.
        columns: usize,
        /// Tags upwards.
        rows: usize,
        /// Side of a tag, metres.
        tag_m: f64,
        /// Gap by side.
        spacing: f64,
    },
}

impl Target {
    /// The board that is printed where nothing else is said: 6 x 6 tags that fill a sheet of A4.
    pub const A4: Self = Self { columns: 6, rows: 6, tag_m: 0.022, spacing: 0.3 };

    /// A board of `columns` x `rows` tags whose black squares have a side of `tag_m` metres and stand `spacing` times that apart.
    ///
    /// # Errors
    /// Where there are no tags, more than the family has, or sizes that nobody prints.
    pub fn new(columns: usize, rows: usize, tag_m: f64, spacing: f64) -> Result<Self, TargetError> {
        let count = columns.saturating_mul(rows);
        let sound = (1..=codes::TAG36H11.len()).contains(&count)
            && (0.001..=2.0).contains(&tag_m)
            && (0.1..=1.0).contains(&spacing);
        sound.then_some(Self { columns, rows, tag_m, spacing }).ok_or(TargetError::Size {
            columns,
            rows,
            tag_m,
            spacing,
        })
    }

    /// Tags across.
    pub const fn columns(&self) -> usize {
        self.columns
    }

    /// Tags upwards.
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Side of a tag, metres.
    pub const fn tag_m(&self) -> f64 {
        self.tag_m
    }

    /// Gap between two tags by a tag's side.
    pub const fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Number of tags.
    pub const fn tags(&self) -> usize {
        self.columns * self.rows
    }

    /// Width and height from the outer edge of the outermost black squares, metres.
    pub fn size_m(&self) -> DVec2 {
        let along = |count: usize| self.tag_m * (count as f64 * (1.0 + self.spacing) + self.spacing);
        DVec2::new(along(self.columns), along(self.rows))
    }

    /// Corners of a tag on the board, metres: lower left, lower right, upper right, upper left.
    pub fn corners(&self, id: usize) -> [DVec2; 4] {
        let pitch = self.tag_m * (1.0 + self.spacing);
        let at = DVec2::new((id % self.columns) as f64, (id / self.columns) as f64) * pitch;
        let t = self.tag_m;
        [at, at + DVec2::new(t, 0.0), at + DVec2::splat(t), at + DVec2::new(0.0, t)]
    }
}

/// Whether a module of a tag is white, row by row from the upper left of the whole tag, border included; tags that are not of the family
/// are black.
pub fn is_white(id: usize, row: usize, column: usize) -> bool {
    let within = BORDER..BORDER + DATA;
    let code = codes::TAG36H11.get(id).copied().unwrap_or(0);
    let bit = |row: usize, column: usize| DATA * DATA - 1 - (DATA * (row - BORDER) + column - BORDER);
    within.contains(&row) && within.contains(&column) && code >> bit(row, column) & 1 == 1
}

impl FromStr for Target {
    type Err = TargetError;

    fn from_str(text: &str) -> Result<Self, TargetError> {
        let form = || TargetError::Form(text.to_owned());
        let mut parts = text.split(':');
        let (columns, rows) = parts.next().and_then(|p| p.split_once(['x', 'X'])).ok_or_else(form)?;
        let whole = |s: &str| s.trim().parse::<usize>().map_err(|_| form());
        let number = |s: &str| s.trim().parse::<f64>().map_err(|_| form());
        let tag_mm = number(parts.next().ok_or_else(form)?)?;
        let spacing = parts.next().map_or(Ok(Self::A4.spacing), number)?;
        if parts.next().is_some() {
            return Err(form());
        }
        Self::new(whole(columns)?, whole(rows)?, tag_mm / 1e3, spacing)
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Thousandths of a millimetre are finer than anything that is printed.
        let tag_mm = (self.tag_m * 1e6).round() / 1e3;
        write!(f, "{}x{}:{tag_mm}:{}", self.columns, self.rows, self.spacing)
    }
}

#[cfg(test)]
mod tests;
