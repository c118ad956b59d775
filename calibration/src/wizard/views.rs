//! Pictures of the board for the lens: those that differ, taken while it was held still.

use glam::DVec2;

use crate::{
    lens::{BoardView, CORNERS_LEAST, LensCoverage},
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
pub(super) enum BoardShown {
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

/// Pictures of the board that differ from each other.
#[derive(Clone, Debug, Default)]
pub(super) struct WizardViews {
    kept: Vec<BoardView>,
    lies: Vec<[f64; 5]>,
    size: Option<(u32, u32)>,
    last: Option<[f64; 5]>,
    shown: BoardShown,
    /// Smallest and largest share of the picture that the board filled.
    filled: Option<[f64; 2]>,
}

impl WizardViews {
    pub(super) fn take(&mut self, view: BoardView, size: (u32, u32)) {
        if *self.size.get_or_insert(size) != size {
            // Pictures of another camera, or of another mode, tell of another lens.
            *self = Self { size: Some(size), ..Self::default() };
        }
        let before = self.last.take();
        if view.corners.len() < CORNERS_LEAST {
            self.shown = BoardShown::Absent;
            return;
        }
        let now = lie(&view);
        self.last = Some(now);
        let width = f64::from(size.0);
        let fills = fills(&view, size);
        self.shown = if fills < FAR {
            BoardShown::Far
        } else if before.is_none_or(|b| apart(&b, &now) > STILL * width) {
            BoardShown::Moving
        } else if self.lies.iter().any(|l| apart(l, &now) < OTHER * width) || self.kept.len() >= KEPT_MOST {
            BoardShown::Known
        } else {
            let [least, most] = self.filled.unwrap_or([fills; 2]);
            self.filled = Some([least.min(fills), most.max(fills)]);
            self.kept.push(view);
            self.lies.push(now);
            BoardShown::New
        };
    }

    pub(super) fn kept(&self) -> &[BoardView] {
        &self.kept
    }

    pub(super) fn size(&self) -> (u32, u32) {
        self.size.unwrap_or((1, 1))
    }

    pub(super) const fn shown(&self) -> BoardShown {
        self.shown
    }

    pub(super) const fn filled(&self) -> Option<[f64; 2]> {
        self.filled
    }

    pub(super) fn coverage(&self) -> LensCoverage {
        let (width, height) = self.size();
        LensCoverage::of(&self.kept, DVec2::new(width.into(), height.into()), [0.0; 2])
    }
}

/// Share of the picture that the rectangle around the corners fills.
fn fills(view: &BoardView, (width, height): (u32, u32)) -> f64 {
    let (low, high) = view
        .corners
        .iter()
        .fold((DVec2::MAX, DVec2::MIN), |(low, high), c| (low.min(c.pixel), high.max(c.pixel)));
    let extent = high - low;
    extent.x * extent.y / (f64::from(width) * f64::from(height))
}
