//! Places of boats in a layer that they share, as mirror layer and shadow map. Every boat gets a place of its own, so that one's water never
//! takes another's light; what is blurred anyway is drawn smaller.

use bowwave_core::frame::scene::PixelRect;
use glam::DVec2;

/// Places begin and end at multiples of this: the softened layer is the layer at a third of its size.
pub(crate) const SOFT: u32 = 3;
/// Most texels for a pixel: what is softened needs three.
pub(crate) const SCALE_MAX: f64 = 3.0;
/// Transparent texels around each place, so that bilinear fetches at its edge, softened ones too, take nothing from the next.
const GUTTER: u32 = 2 * SOFT;

/// One boat's place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placed {
    /// Texels of the layer.
    pub(crate) atlas: (u32, u32),
    /// The place, gutter included.
    pub(crate) place: PixelRect,
    /// Texels for each screen pixel.
    pub(crate) scale: f64,
    /// Texel position of screen pixel (0, 0).
    pub(crate) offset: DVec2,
}

impl Default for Placed {
    fn default() -> Self {
        let place = PixelRect { x: 0, y: 0, width: 1, height: 1 };
        Self { atlas: (1, 1), place, scale: 1.0, offset: DVec2::ZERO }
    }
}

impl Placed {
    /// Smallest and largest texture coordinates of the place, half a softened texel inside its edge.
    pub(crate) fn bounds(&self) -> [f32; 4] {
        let (w, h) = (f64::from(self.atlas.0), f64::from(self.atlas.1));
        let p = &self.place;
        let inside = 0.5 * f64::from(SOFT);
        [
            ((f64::from(p.x) + inside) / w) as f32,
            ((f64::from(p.y) + inside) / h) as f32,
            ((f64::from(p.x + p.width) - inside) / w) as f32,
            ((f64::from(p.y + p.height) - inside) / h) as f32,
        ]
    }

    /// Viewport (x, y, width, height) that draws a screen of `size` so that the boat falls on its place.
    pub(crate) fn viewport(&self, size: (u32, u32)) -> [f32; 4] {
        let (w, h) = (f64::from(size.0) * self.scale, f64::from(size.1) * self.scale);
        [self.offset.x as f32, self.offset.y as f32, w as f32, h as f32]
    }
}

/// Finds places for rectangles, each with its wanted texels for a screen pixel (at most [`SCALE_MAX`]), row by row. What does not fit is
/// made smaller together until it does. `places` keeps its memory.
pub(crate) fn place(atlas: (u32, u32), wanted: &[(PixelRect, f64)], places: &mut Vec<Placed>) {
    let mut shrink = 1.0;
    // Ten halvings bring 64 screens into one texel each.
    for _ in 0..20 {
        if try_place(atlas, wanted, shrink, places) {
            return;
        }
        shrink *= std::f64::consts::FRAC_1_SQRT_2;
    }
    places.clear();
}

fn try_place(atlas: (u32, u32), wanted: &[(PixelRect, f64)], shrink: f64, places: &mut Vec<Placed>) -> bool {
    places.clear();
    let (mut x, mut y, mut shelf) = (0, 0, 0);
    for (rect, scale) in wanted {
        let scale = scale.clamp(1e-3, SCALE_MAX) * shrink;
        let texels = |pixels: u32| {
            (((f64::from(pixels) * scale).ceil() as u32).max(1) + 2 * GUTTER).next_multiple_of(SOFT)
        };
        let (width, height) = (texels(rect.width), texels(rect.height));
        if x + width > atlas.0 {
            (x, y, shelf) = (0, y + shelf, 0);
        }
        if x + width > atlas.0 || y + height > atlas.1 {
            return false;
        }
        let origin = DVec2::new(f64::from(x + GUTTER), f64::from(y + GUTTER));
        let offset = origin - DVec2::new(f64::from(rect.x), f64::from(rect.y)) * scale;
        places.push(Placed { atlas, place: PixelRect { x, y, width, height }, scale, offset });
        x += width;
        shelf = shelf.max(height);
    }
    true
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn places_lie_inside_and_apart_and_hold_their_rectangles(
            rects in prop::collection::vec((0_u32..1200, 0_u32..700, 1_u32..800, 1_u32..500, 0.05_f64..3.0), 1..20),
        ) {
            let atlas = (1284, 366);
            let wanted: Vec<_> = rects
                .iter()
                .map(|&(x, y, width, height, scale)| (PixelRect { x, y, width, height }, scale))
                .collect();
            let mut places = Vec::new();
            place(atlas, &wanted, &mut places);
            prop_assert_eq!(places.len(), wanted.len());
            for (i, (placed, (rect, _))) in places.iter().zip(&wanted).enumerate() {
                let p = placed.place;
                prop_assert!([p.x, p.y, p.width, p.height].iter().all(|v| v.is_multiple_of(SOFT)));
                prop_assert!(p.x + p.width <= atlas.0 && p.y + p.height <= atlas.1);
                let at = |x: u32, y: u32| DVec2::new(f64::from(x), f64::from(y)) * placed.scale + placed.offset;
                let (low, high) = (at(rect.x, rect.y), at(rect.x + rect.width, rect.y + rect.height));
                prop_assert!(low.x >= f64::from(p.x + GUTTER) - 1e-6 && low.y >= f64::from(p.y + GUTTER) - 1e-6);
                prop_assert!(high.x <= f64::from(p.x + p.width - GUTTER) + 1e-6);
                prop_assert!(high.y <= f64::from(p.y + p.height - GUTTER) + 1e-6);
                for other in &places[..i] {
                    let o = other.place;
                    let apart = p.x >= o.x + o.width || o.x >= p.x + p.width || p.y >= o.y + o.height || o.y >= p.y + p.height;
                    prop_assert!(apart);
                }
            }
        }
    }
}
