//! Patches followed through a video, by the tracker that follows the sky line ([`bowwave_core::estimate::skyline::SkyPatch`]).

use std::sync::Arc;

use bowwave_core::{
    estimate::skyline::{GreyPyramid, SkyPatch},
    event::{Picture, PixelFormat},
};
use glam::{DMat2, DVec2};
use image::{ImageError, ImageFormat, ImageResult};

/// Distance between patches that are taken, pixels of the finest level.
const SPACING: usize = 12;
/// Pictures after which a patch is taken anew: clouds change their shape within seconds.
const RENEW: usize = 30;
/// A patch that looks less like itself than this is lost (correlation coefficient).
const LIKENESS_MIN: f32 = 0.7;
/// The level on which the search begins: a patch is found up to 48 pixels of the finest level from where it is foretold.
const COARSEST: usize = 3;

/// A decoded picture of a video.
#[derive(Clone)]
pub struct Gray(Picture);

impl Gray {
    /// Decodes a JPEG.
    ///
    /// # Errors
    /// Where it is none, or larger than pictures may be.
    pub fn from_jpeg(jpeg: &[u8]) -> ImageResult<Self> {
        let decoded = image::load_from_memory_with_format(jpeg, ImageFormat::Jpeg)?.into_rgb8();
        let (width, height) = decoded.dimensions();
        let bytes: Arc<[u8]> = decoded.into_raw().into();
        Picture::new(PixelFormat::Rgb, width, height, bytes)
            .map(Self)
            .map_err(|e| ImageError::IoError(std::io::Error::other(e)))
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.0.width() as usize
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.0.height() as usize
    }
}

/// A patch, where it is, and how far it moved from the picture before; pixels of the finest level.
struct FollowedPatch {
    place: DVec2,
    last_step: DVec2,
    patch: SkyPatch,
}

/// Follows patches from picture to picture.
pub struct Tracker {
    patches: Vec<Option<FollowedPatch>>,
    pyramid: GreyPyramid,
    age: usize,
}

impl Tracker {
    /// Takes patches of `first` on a grid above `row_max`, wherever there is something to follow.
    pub fn start(first: &Gray, row_max: usize) -> Self {
        let mut tracker = Self { patches: Vec::new(), pyramid: GreyPyramid::default(), age: 0 };
        tracker.read(first);
        let (width, rows) = (tracker.pyramid.size.0, row_max / tracker.pyramid.reduction);
        let grid = (SPACING..rows.saturating_sub(SPACING)).step_by(SPACING).flat_map(|y| {
            (SPACING..width.saturating_sub(SPACING)).step_by(SPACING).map(move |x| (x as f64, y as f64))
        });
        let take = |place: (f64, f64)| take(&tracker.pyramid, place.into(), DVec2::ZERO);
        tracker.patches = grid.filter_map(take).map(Some).collect();
        tracker
    }

    /// Where the patches are, pixels of the picture; `None` once one is lost.
    pub fn places(&self) -> Vec<Option<DVec2>> {
        let scale = self.pyramid.reduction as f64;
        self.patches.iter().map(|p| p.as_ref().map(|p| p.place * scale)).collect()
    }

    /// Finds the patches in the next picture.
    pub fn next(&mut self, picture: &Gray) -> Vec<Option<DVec2>> {
        self.read(picture);
        self.age += 1;
        let renew = self.age.is_multiple_of(RENEW);
        for slot in &mut self.patches {
            *slot = slot.take().and_then(|patch| follow(patch, &self.pyramid, renew));
        }
        self.places()
    }

    fn read(&mut self, picture: &Gray) {
        self.pyramid.measure(&picture.0);
        self.pyramid.fill(&picture.0, 0..self.pyramid.size.1);
    }
}

fn take(pyramid: &GreyPyramid, place: DVec2, last_step: DVec2) -> Option<FollowedPatch> {
    SkyPatch::take(pyramid, place).map(|patch| FollowedPatch { place, last_step, patch })
}

fn follow(known: FollowedPatch, pyramid: &GreyPyramid, renew: bool) -> Option<FollowedPatch> {
    let coarse = known.patch.find(pyramid, known.place + known.last_step, DMat2::IDENTITY, COARSEST)?;
    // Once more from there: the search ends where a step is short, and errors of renewed patches add up.
    let found = known.patch.find(pyramid, coarse.place, DMat2::IDENTITY, 0)?;
    if found.likeness < LIKENESS_MIN {
        return None;
    }
    let (place, last_step) = (found.place, found.place - known.place);
    let same = FollowedPatch { place, last_step, ..known };
    if renew { take(pyramid, place, last_step).or(Some(same)) } else { Some(same) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grey picture of 300 x 200 pixels, codes of 255 by pixel.
    fn gray(code: impl FnMut(f64, f64) -> f64) -> Gray {
        sized(300, 200, code)
    }

    fn sized(width: u32, height: u32, mut code: impl FnMut(f64, f64) -> f64) -> Gray {
        let pixels = (0..width * height).map(|i| (f64::from(i % width), f64::from(i / width)));
        let bytes: Vec<u8> = pixels.flat_map(|(x, y)| [code(x, y).round() as u8; 3]).collect();
        Gray(Picture::new(PixelFormat::Rgb, width, height, bytes.into()).unwrap())
    }

    /// A cloudy picture seen from a place.
    fn picture(from: DVec2) -> Gray {
        let cloud = |x: f64, y: f64| {
            (x / 17.0).sin() * (y / 23.0).cos()
                + (x / 9.0 + y / 13.0).sin() * 0.5
                + (y / 11.0 - x / 31.0).cos() * 0.7
        };
        gray(|x, y| 255.0 * (0.5 + 0.05 * cloud(x + from.x, y + from.y)))
    }

    #[test]
    fn patches_are_followed_and_their_mean_to_a_tenth_of_a_pixel() {
        let mut tracker = Tracker::start(&picture(DVec2::ZERO), 150);
        let start = tracker.places();
        let mut from = DVec2::ZERO;
        // Seventy pictures: renewed twice; up to four pixels a picture.
        for i in 0..70 {
            let pace = f64::from(i) * 0.1;
            from += DVec2::new(pace.sin() * 4.0, pace.cos() * 1.3);
            tracker.next(&picture(from));
        }
        let followed: Vec<_> =
            start.iter().zip(tracker.places()).filter_map(|(a, b)| Some((*a)? - b?)).collect();
        assert!(followed.len() >= 8, "{}", followed.len());
        let mean = followed.iter().sum::<DVec2>() / followed.len() as f64;
        assert!(mean.distance(from) < 0.1, "{mean} {from}");
        // A patch of 15 pixels that was renewed twice has the noise of three searches; what the bias is found from is the mean.
        let off =
            followed.iter().map(|moved| moved.distance_squared(from)).sum::<f64>() / followed.len() as f64;
        assert!(off.sqrt() < 0.25, "{}", off.sqrt());
    }

    #[test]
    fn what_is_gone_is_lost() {
        let mut tracker = Tracker::start(&picture(DVec2::ZERO), 150);
        let mut seed = 1_u32;
        let other = gray(|_, _| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 24)
        });
        let left = tracker.next(&other).into_iter().flatten().count();
        assert_eq!(left, 0, "of {}", tracker.places().len());
        // An even picture has nothing to follow.
        assert!(Tracker::start(&gray(|_, _| 128.0), 150).places().is_empty());
    }

    #[test]
    fn small_pictures_have_no_patches() {
        assert!(Tracker::start(&sized(20, 10, |_, _| 128.0), 10).places().is_empty());
    }
}
