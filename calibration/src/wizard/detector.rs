//! Detection of horizon, board and mark in the wizard's pictures.

use bowwave_core::{calibration::Calibration, event::CameraFrame, own_ship::Mask, time::Time};
use glam::DVec2;

use crate::{
    capture::{PictureSeen, Watcher},
    lens::BoardView,
    target::{BoardFinder, Target, find_tag, look_for},
};

/// Kind of detection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DetectorMode {
    /// Nothing: only that pictures come.
    Nothing,
    /// Horizon and board: how the camera is turned.
    Orientation,
    /// The board's corners.
    Corners,
    /// The tag that marks the aim.
    Mark,
}

/// Result of a detection.
#[derive(Clone, Debug, PartialEq)]
pub enum Detection {
    /// A picture came.
    Picture,
    /// For [`DetectorMode::Orientation`].
    Orientation(PictureSeen),
    /// For [`DetectorMode::Corners`]: those of the board and the picture's size.
    Corners {
        /// None of them where no board is seen.
        view: BoardView,
        /// Width and height, pixels.
        size: (u32, u32),
    },
    /// For [`DetectorMode::Mark`]: where the mark is.
    Mark {
        /// The picture's mid-exposure by the camera's stamp.
        stamp: Time,
        /// Its place, pixels; `None` where it is not seen.
        pixel: Option<DVec2>,
    },
}

/// Looks at pictures; made anew when the lens changes.
#[derive(Debug)]
pub struct Detector {
    watcher: Watcher,
    target: Option<Target>,
    tag: usize,
    grey: Vec<u8>,
}

impl Detector {
    /// Looks through the lens of `calibration`, `eye_height_m` above the sea, for the horizon and for the board where there is one. Its tag
    /// number `tag` marks the aim.
    pub fn new(calibration: &Calibration, eye_height_m: f64, target: Option<Target>, tag: usize) -> Self {
        let mut watcher = Watcher::new(calibration.lens, eye_height_m);
        if let Some(target) = target {
            watcher = watcher.with_board(Box::new(BoardFinder::new(target)));
        }
        Self { watcher, target, tag, grey: Vec::new() }
    }

    /// Looks for no horizon in what the mask hides: the own ship.
    #[must_use]
    pub fn with_mask(mut self, mask: Option<Mask>) -> Self {
        self.watcher = self.watcher.with_mask(mask);
        self
    }

    /// Looks for that in a picture.
    pub fn look(&mut self, look: DetectorMode, frame: &CameraFrame) -> Detection {
        let picture = &frame.picture;
        match (look, &self.target) {
            (DetectorMode::Orientation, _) => Detection::Orientation(self.watcher.look(frame)),
            (DetectorMode::Corners, Some(target)) => Detection::Corners {
                view: look_for(target, picture, &mut self.grey).unwrap_or_default(),
                size: (picture.width(), picture.height()),
            },
            (DetectorMode::Mark, Some(target)) => {
                Detection::Mark { stamp: frame.mid_exposure, pixel: find_tag(target, self.tag, picture) }
            }
            _ => Detection::Picture,
        }
    }
}
