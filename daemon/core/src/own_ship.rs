//! The own gun and ship as the camera sees them: real things before the virtual world.
//!
//! A [`Phantom`] is the model of a real thing that is drawn for what it hides, and not for itself (Hughes, Konttinen and Pattanaik 2004,
//! section 3). Barrel, sight and shield move with the camera, so that an outline in its picture is all of their shape that a frame needs.

mod mask;

use std::sync::Arc;

use glam::DVec2;

use crate::geometry::{Lens, distance_squared_to_segment, is_inside};

pub use mask::Mask;

/// Pixels of the picture around a phantom in which no horizon and no sky is sought.
const MARGIN_PX: f64 = 2.0;
/// The same around one that recoils.
const RECOIL_PX: f64 = 12.0;

/// The own gun and ship in the pictures; by default nothing of them is seen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnShip {
    /// Mask of what is not looked at: no horizon and no sky is sought there.
    pub mask: Option<Mask>,
    /// What hides boats, water and rounds, on the calibrated picture.
    pub phantoms: Phantoms,
}

/// All phantoms of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Phantoms {
    /// Each of them.
    pub parts: Arc<[Phantom]>,
    /// Where the bore vanishes, pixels: what recoils moves away from there.
    pub bore: DVec2,
}

impl Phantoms {
    /// The same where pictures by `lens` are seen by `screen` ([`Lens::covering`]).
    #[must_use]
    pub fn on_screen(&self, lens: &Lens, screen: &Lens) -> Self {
        let moved = |p: DVec2| (p - lens.centre) * (screen.focal / lens.focal) + screen.centre;
        Self { parts: self.parts.iter().map(|part| part.mapped(moved)).collect(), bore: moved(self.bore) }
    }
}

impl OwnShip {
    /// What is seen of it in pictures of `size` pixels: `phantoms` of a gun whose bore vanishes at `bore`, and polygons of which no more is known
    /// than that the sea is not seen there.
    pub fn new(phantoms: Vec<Phantom>, bore: DVec2, hidden: &[Vec<DVec2>], size: (u32, u32)) -> Self {
        let mask = Mask::of_places(size, |place| {
            hidden.iter().any(|polygon| is_inside(polygon, place))
                || phantoms.iter().any(|phantom| {
                    phantom.is_within(place, if phantom.recoils { RECOIL_PX } else { MARGIN_PX })
                })
        });
        Self { mask, phantoms: Phantoms { parts: phantoms.into(), bore } }
    }
}

/// A real thing that hides virtual ones, by its outline in the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Phantom {
    /// Its name; may be empty.
    pub name: String,
    /// Corners of a polygon in pixels, x right, y down, from the picture's upper left corner; of one that crosses itself what is inside by the
    /// even-odd rule.
    outline: Vec<DVec2>,
    /// Upper left and lower right corner of the picture that it was traced in, pixels.
    picture: [DVec2; 2],
    /// It slides back along the bore with each round.
    pub recoils: bool,
}

impl Phantom {
    /// By its outline in a picture of `size` pixels.
    pub fn new(name: impl Into<String>, outline: Vec<DVec2>, size: (u32, u32)) -> Self {
        let size = DVec2::new(f64::from(size.0), f64::from(size.1));
        Self { name: name.into(), outline, picture: [DVec2::ZERO, size], recoils: false }
    }

    /// The same as a part that recoils, or that does not.
    #[must_use]
    pub fn recoiling(self, recoils: bool) -> Self {
        Self { recoils, ..self }
    }

    /// Corners of its outline, pixels.
    pub fn outline(&self) -> &[DVec2] {
        &self.outline
    }

    /// The same with each place moved.
    fn mapped(&self, moved: impl Fn(DVec2) -> DVec2) -> Self {
        Self {
            name: self.name.clone(),
            outline: self.outline.iter().map(|p| moved(*p)).collect(),
            picture: self.picture.map(&moved),
            recoils: self.recoils,
        }
    }

    /// The same slid back along a bore that vanishes at `bore`, seen `factor` times as far from there.
    #[must_use]
    pub fn recoiled(&self, bore: DVec2, factor: f64) -> Self {
        Self { picture: self.picture, ..self.mapped(|p| bore + (p - bore) * factor) }
    }

    /// Smallest and largest coordinates, pixels.
    pub fn bounds(&self) -> [DVec2; 2] {
        let none = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        self.outline.iter().fold(none, |[low, high], p| [low.min(*p), high.max(*p)])
    }

    /// Pixels from `place` to the nearest edge that is seen, negative inside; infinite where all of it is one or the other. Along the picture's
    /// border nothing ends but the picture.
    pub fn distance(&self, place: DVec2) -> f64 {
        let nearest = self
            .edges()
            .map(|(from, to)| distance_squared_to_segment(place, from, to))
            .fold(f64::INFINITY, f64::min);
        if is_inside(&self.outline, place) { -nearest.sqrt() } else { nearest.sqrt() }
    }

    /// Edges that are seen: those that do not lie on the picture's border.
    pub fn edges(&self) -> impl Iterator<Item = (DVec2, DVec2)> {
        let next = self.outline.iter().cycle().skip(1);
        self.outline.iter().zip(next).map(|(a, b)| (*a, *b)).filter(|(a, b)| !self.lies_on_border(*a, *b))
    }

    /// Whether `place` lies in it or no more than `margin` pixels beside it.
    fn is_within(&self, place: DVec2, margin: f64) -> bool {
        let [low, high] = self.bounds();
        let near = place.cmpge(low - margin).all() && place.cmple(high + margin).all();
        near && self.distance(place) <= margin
    }

    fn lies_on_border(&self, a: DVec2, b: DVec2) -> bool {
        /// A corner this near to the picture's border was meant to lie on it, pixels of the picture.
        const NEAR_PX: f64 = 0.5;
        let on = |line: f64, a: f64, b: f64| (a - line).abs() <= NEAR_PX && (b - line).abs() <= NEAR_PX;
        self.picture.iter().any(|corner| on(corner.x, a.x, b.x) || on(corner.y, a.y, b.y))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn barrel() -> Phantom {
        let corners = [[600.0, 560.0], [680.0, 560.0], [760.0, 720.0], [520.0, 720.0]];
        Phantom::new("barrel", corners.map(DVec2::from_array).to_vec(), (1280, 720))
    }

    #[test]
    fn distance_counts_from_edges_that_are_seen() {
        let barrel = barrel();
        assert_eq!(barrel.distance(DVec2::new(640.0, 550.0)), 10.0);
        assert_eq!(barrel.distance(DVec2::new(640.0, 570.0)), -10.0);
        // Beside the picture's border the nearest edge is the side, not the border.
        assert!(barrel.distance(DVec2::new(640.0, 719.5)) < -100.0);
        let all = [[0.0, 0.0], [1280.0, 0.0], [1280.0, 720.0], [0.0, 720.0]].map(DVec2::from_array);
        assert_eq!(Phantom::new("", all.to_vec(), (1280, 720)).distance(DVec2::ONE), f64::NEG_INFINITY);
    }

    #[test]
    fn the_mask_reaches_around_a_phantom() {
        let ship = OwnShip::new(vec![barrel()], DVec2::ZERO, &[], (1280, 720));
        let mask = ship.mask.expect("there is a phantom");
        assert!(mask.hides(640.0 / 1280.0, 559.0 / 720.0) && !mask.hides(640.0 / 1280.0, 540.0 / 720.0));
        assert_eq!(OwnShip::new(Vec::new(), DVec2::ZERO, &[], (1280, 720)), OwnShip::default());
    }

    proptest! {
        #[test]
        fn on_a_larger_screen_everything_is_as_much_farther(x in 0.0..1280.0f64, y in 0.0..720.0f64) {
            let lens = Lens::pinhole(1280, 720, 1.0);
            let barrel = barrel();
            let all = Phantoms { parts: Arc::new([barrel.clone()]), bore: lens.centre };
            let large = &all.on_screen(&lens, &lens.covering(1920, 1080)).parts[0];
            let place = DVec2::new(x, y);
            prop_assert!((large.distance(place * 1.5) - 1.5 * barrel.distance(place)).abs() < 1e-9);
        }
    }
}
