//! What pictures tell the wizard.

use bowwave_core::{calibration::Calibration, estimate::horizon::Mask, event::CameraFrame, time::Time};
use glam::DVec2;

use crate::{
    camera::View,
    capture::{Seen, Watcher},
    target::{BoardFinder, Target, find_tag, look_for},
};

/// What is looked for in pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Nothing: only that pictures come.
    Nothing,
    /// Horizon and board: how the camera is turned.
    Orientation,
    /// The board's corners.
    Corners,
    /// The tag that marks the aim.
    Mark,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// A picture came.
    Picture,
    /// For [`Look::Orientation`].
    Orientation(Seen),
    /// For [`Look::Corners`]: those of the board and the picture's size.
    Corners {
        /// None of them where no board is seen.
        view: View,
        /// Width and height, pixels.
        size: (u32, u32),
    },
    /// For [`Look::Mark`]: where the mark is.
    Mark {
        /// The picture's mid-exposure by the camera's stamp.
        stamp: Time,
        /// Its place, pixels; `None` where it is not seen.
        pixel: Option<DVec2>,
    },
}

/// Looks at pictures; made anew when the lens changes.
#[derive(Debug)]
pub struct Eyes {
    watcher: Watcher,
    target: Option<Target>,
    tag: usize,
    grey: Vec<u8>,
}

impl Eyes {
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
    pub fn look(&mut self, look: Look, frame: &CameraFrame) -> Finding {
        let picture = &frame.picture;
        match (look, &self.target) {
            (Look::Orientation, _) => Finding::Orientation(self.watcher.look(frame)),
            (Look::Corners, Some(target)) => Finding::Corners {
                view: look_for(target, picture, &mut self.grey).unwrap_or_default(),
                size: (picture.width(), picture.height()),
            },
            (Look::Mark, Some(target)) => {
                Finding::Mark { stamp: frame.mid_exposure, pixel: find_tag(target, self.tag, picture) }
            }
            _ => Finding::Picture,
        }
    }
}
