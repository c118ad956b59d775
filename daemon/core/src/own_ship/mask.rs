//! Mask of the own ship or gun in the picture.

use glam::DVec2;

use crate::geometry::is_inside;

/// Fields of a mask that polygons are laid on, across and down: of 8 pixels in a picture of 1280 x 720.
const FIELDS: (usize, usize) = (160, 90);

/// A field is looked at in so many places each way.
const PLACES: usize = 4;

/// Parts of the picture that show the own ship or the gun: they stay where they are in the picture, and have edges of their
/// own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    width: usize,
    height: usize,
    hidden: Vec<bool>,
}

impl Mask {
    /// A grid of `width` x `height` fields that covers the whole picture, rows from the top; `true` is not looked at. `None`
    /// where there are not as many fields as that, or none.
    pub fn new(width: usize, height: usize, hidden: Vec<bool>) -> Option<Self> {
        let fields = width.checked_mul(height)?;
        (fields > 0 && fields == hidden.len()).then_some(Self { width, height, hidden })
    }

    /// Hides the fields in which some place of a picture of `size` pixels is hidden; places are pixels, x right, y down, from its upper left
    /// corner. `None` where nothing is hidden.
    pub fn of_places(size: (u32, u32), is_hidden: impl Fn(DVec2) -> bool) -> Option<Self> {
        let (width, height) = FIELDS;
        let step = DVec2::new(f64::from(size.0) / width as f64, f64::from(size.1) / height as f64);
        let hidden: Vec<bool> = (0..width * height)
            .map(|i| {
                let corner = DVec2::new((i % width) as f64, (i / width) as f64);
                (0..PLACES * PLACES).any(|k| {
                    let part = DVec2::new((k % PLACES) as f64 + 0.5, (k / PLACES) as f64 + 0.5);
                    is_hidden((corner + part / PLACES as f64) * step)
                })
            })
            .collect();
        hidden.contains(&true).then_some(Self { width, height, hidden })
    }

    /// Hides what lies in any of `polygons`, whose corners are pixels of a picture of `size` pixels; of one that crosses itself what is inside
    /// by the even-odd rule. `None` where nothing is hidden.
    pub fn of_polygons(polygons: &[Vec<DVec2>], size: (u32, u32)) -> Option<Self> {
        Self::of_places(size, |place| polygons.iter().any(|polygon| is_inside(polygon, place)))
    }

    /// Which share of the picture is hidden.
    pub fn share(&self) -> f64 {
        self.hidden.iter().filter(|hidden| **hidden).count() as f64 / self.hidden.len() as f64
    }

    /// Whether the field at these shares of width and height is hidden.
    pub(crate) fn hides(&self, x: f64, y: f64) -> bool {
        let column = ((x * self.width as f64) as usize).min(self.width - 1);
        let row = ((y * self.height as f64) as usize).min(self.height - 1);
        self.hidden.get(row * self.width + column).copied().unwrap_or(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_hide_what_lies_in_them() {
        let corners = |list: &[[f64; 2]]| list.iter().map(|c| DVec2::from_array(*c)).collect::<Vec<_>>();
        // A triangle on the left and a bar at the bottom.
        let triangle = corners(&[[0.0, 0.0], [320.0, 360.0], [0.0, 720.0]]);
        let bar = corners(&[[0.0, 680.0], [1280.0, 680.0], [1280.0, 720.0], [0.0, 720.0]]);
        let mask = Mask::of_polygons(&[triangle, bar], (1280, 720)).unwrap();
        for (x, y, hidden) in [(100, 360, true), (300, 360, true), (340, 360, false), (300, 100, false)]
            .into_iter()
            .chain([(1200, 700, true), (1200, 660, false), (20, 700, true)])
        {
            assert_eq!(mask.hides(f64::from(x) / 1280.0, f64::from(y) / 720.0), hidden, "{x} {y}");
        }
        // An eighth of the picture, and the bar's eighteenth beside it.
        let expected = 0.125 + 40.0 / 720.0 - 0.5 * 40.0 * 40.0 * 320.0 / 360.0 / (1280.0 * 720.0);
        assert!((mask.share() - expected).abs() < 0.01, "{}", mask.share());
        assert!(Mask::of_polygons(&[], (1280, 720)).is_none());
    }
}
