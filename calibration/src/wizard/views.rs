//! Pictures of the board for the lens: those that differ, taken while it was held still.

use glam::DVec2;

use crate::{
    camera::{CORNERS_LEAST, Coverage, View},
    target::{apart, lie},
};

/// Of two pictures the board counts as held still where it moved by less than this share of the picture's width.
const STILL: f64 = 0.004;
/// A picture is another one where the board lies differently by this share of the picture's width.
const OTHER: f64 = 0.06;
/// The board should fill more than this share of the picture.
const FAR: f64 = 0.03;
/// Pictures that are kept at most.
const KEPT_MOST: usize = 120;

/// How the board was in the last picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Shown {
    /// Not to be seen.
    #[default]
    Absent,
    /// So far off that its corners tell little.
    Far,
    /// On the move.
    Moving,
    /// As in a picture that is already there.
    Known,
    /// Kept.
    New,
}

/// What was kept.
#[derive(Clone, Debug, Default)]
pub(super) struct Views {
    kept: Vec<View>,
    lies: Vec<[f64; 5]>,
    size: Option<(u32, u32)>,
    last: Option<[f64; 5]>,
    shown: Shown,
    /// Smallest and largest share of the picture that the board filled.
    filled: Option<[f64; 2]>,
}

impl Views {
    pub(super) fn take(&mut self, view: View, size: (u32, u32)) {
        if *self.size.get_or_insert(size) != size {
            // Pictures of another camera, or of another mode, tell of another lens.
            *self = Self { size: Some(size), ..Self::default() };
        }
        let before = self.last.take();
        if view.corners.len() < CORNERS_LEAST {
            self.shown = Shown::Absent;
            return;
        }
        let now = lie(&view);
        self.last = Some(now);
        let width = f64::from(size.0);
        let fills = fills(&view, size);
        self.shown = if fills < FAR {
            Shown::Far
        } else if before.is_none_or(|b| apart(&b, &now) > STILL * width) {
            Shown::Moving
        } else if self.lies.iter().any(|l| apart(l, &now) < OTHER * width) || self.kept.len() >= KEPT_MOST {
            Shown::Known
        } else {
            let [least, most] = self.filled.unwrap_or([fills; 2]);
            self.filled = Some([least.min(fills), most.max(fills)]);
            self.kept.push(view);
            self.lies.push(now);
            Shown::New
        };
    }

    pub(super) fn kept(&self) -> &[View] {
        &self.kept
    }

    pub(super) fn size(&self) -> (u32, u32) {
        self.size.unwrap_or((1, 1))
    }

    pub(super) const fn shown(&self) -> Shown {
        self.shown
    }

    pub(super) const fn filled(&self) -> Option<[f64; 2]> {
        self.filled
    }

    pub(super) fn coverage(&self) -> Coverage {
        let (width, height) = self.size();
        Coverage::of(&self.kept, DVec2::new(width.into(), height.into()), [0.0; 2])
    }
}

/// Share of the picture that the rectangle around the corners fills.
fn fills(view: &View, (width, height): (u32, u32)) -> f64 {
    let (low, high) = view
        .corners
        .iter()
        .fold((DVec2::MAX, DVec2::MIN), |(low, high), c| (low.min(c.pixel), high.max(c.pixel)));
    let extent = high - low;
    extent.x * extent.y / (f64::from(width) * f64::from(height))
}
