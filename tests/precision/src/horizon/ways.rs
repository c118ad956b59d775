//! The finder and its rivals, shown the same pictures.

use anyhow::Result;
use bowwave_core::{
    estimate::horizon::HorizonFinder,
    geometry::{Lens, horizon_dip},
};
use glam::DVec3;

use super::{
    frames::SeaFrame,
    rivals::{self, GreyPicture, LineEnds},
    score::{self, DrawnHorizon, Miss},
};
use crate::bench::PartMethod;

/// A way to find a horizon.
#[derive(Clone, Copy, Debug)]
pub enum HorizonMethod {
    /// The product's, told nothing, or told a prediction.
    Finder {
        /// Whether a prediction is told.
        prior: bool,
    },
    /// One of the rivals.
    Rival(fn(GreyPicture<'_>) -> Option<LineEnds>),
}

/// All ways, with their names and settings; what the product uses is first.
pub const METHODS: [PartMethod<HorizonMethod>; 5] = [
    PartMethod::product("column steps, judged", "with prediction", HorizonMethod::Finder { prior: true }),
    PartMethod::rival("column steps, judged", "no prediction", HorizonMethod::Finder { prior: false }),
    PartMethod::rival("column steps, best line", "", HorizonMethod::Rival(rivals::column_steps)),
    PartMethod::rival("Canny and Hough", "", HorizonMethod::Rival(rivals::canny_hough)),
    PartMethod::rival("Otsu", "", HorizonMethod::Rival(rivals::otsu)),
];

/// Up of a camera whose horizon falls on two pixels, the first on the left.
pub fn up_through(lens: &Lens, ends: LineEnds, eye_m: f64) -> DVec3 {
    let [a, b] = ends.map(|place| lens.unproject(place));
    let level = b.cross(a).normalize();
    // Both rays lie below the horizontal by the dip, not in one plane with the eye.
    let middle = (a + b).normalize();
    (level - middle * (horizon_dip(eye_m).sin() / middle.dot(a))).normalize()
}

/// Up as a way finds it in a marked frame; `None` for no horizon.
pub fn in_frame(
    method: HorizonMethod,
    finder: &mut HorizonFinder,
    frame: &SeaFrame,
    draw: u64,
) -> Result<Option<DVec3>> {
    match method {
        HorizonMethod::Finder { prior } => {
            let prior = frame.marked_up().filter(|_| prior).map(|up| score::predicted(up, draw));
            Ok(score::find(finder, frame, prior)?.ok().map(|h| h.up))
        }
        HorizonMethod::Rival(find) => {
            let ends = find(GreyPicture { luma: &frame.luma, size: frame.size });
            Ok(ends.map(|ends| up_through(&frame.lens, ends, frame.eye_m)))
        }
    }
}

/// Up as a way finds it in a drawn picture; `None` for no horizon.
pub fn in_drawn(method: HorizonMethod, finder: &mut HorizonFinder, drawn: &DrawnHorizon) -> Option<DVec3> {
    match method {
        HorizonMethod::Finder { prior } => {
            let up = DVec3::from(drawn.shown.up());
            let prior = prior.then(|| score::predicted(up, drawn.shown.seed));
            drawn.find(finder, prior).ok().map(|h| h.up)
        }
        HorizonMethod::Rival(find) => {
            let (w, h) = drawn.shown.size;
            let luma = drawn.picture.bytes().get(..w * h)?;
            // Lines of a lens that bows them are taken where they cross the middle third.
            let [a, b] = find(GreyPicture { luma, size: (w, h) })?;
            let at = |share: f64| a + (b - a) * share;
            Some(up_through(&drawn.view.lens, [at(1.0 / 3.0), at(2.0 / 3.0)], drawn.shown.eye_m))
        }
    }
}

/// How far off it is; a whole picture where nothing was found.
pub fn px(miss: Option<Miss>) -> f64 {
    miss.map_or(score::WIDTH, |m| m.px.min(score::WIDTH))
}
