//! Several pictures in one.

use bowwave_core::model::Texture;
use glam::Vec2;
use image::{Rgba, RgbaImage, imageops};

use super::{TEXTURE_SIDE_MAX, surface::TexturePicture};

/// Pixels of repeated border about each picture, so that filtering takes nothing from its neighbours.
const GUTTER: u32 = 4;
/// Side of the white patch for what has no picture.
const WHITE: u32 = 4;

/// Where a picture lies in the atlas: `uv * scale + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AtlasPlace {
    pub(crate) scale: Vec2,
    pub(crate) offset: Vec2,
}

impl AtlasPlace {
    /// The whole picture.
    pub(crate) const WHOLE: Self = Self { scale: Vec2::ONE, offset: Vec2::ZERO };

    /// From the picture's coordinates to the atlas's.
    pub(crate) fn apply(&self, uv: Vec2) -> Vec2 {
        uv * self.scale + self.offset
    }
}

/// One picture with all of `pictures` in it, the place of each, and a coordinate that is white.
pub(crate) fn pack(pictures: &[&TexturePicture]) -> (Texture, Vec<AtlasPlace>, Vec2) {
    let mut images: Vec<RgbaImage> = pictures.iter().map(|p| p.rgba.clone()).collect();
    let layout = loop {
        let sizes: Vec<(u32, u32)> = images.iter().map(|i| i.dimensions()).chain([(WHITE, WHITE)]).collect();
        if let Some(layout) = shelves(&sizes) {
            break layout;
        }
        // Too much for one texture: halve everything.
        for image in &mut images {
            let (w, h) = image.dimensions();
            *image = imageops::resize(image, (w / 2).max(1), (h / 2).max(1), imageops::FilterType::Triangle);
        }
    };
    let mut atlas = RgbaImage::new(layout.width, layout.height);
    images.push(RgbaImage::from_pixel(WHITE, WHITE, Rgba([255; 4])));
    let size = Vec2::new(layout.width as f32, layout.height as f32);
    let mut places = Vec::with_capacity(images.len());
    for (image, &(x, y)) in images.iter().zip(&layout.corners) {
        blit(&mut atlas, image, x, y);
        let (w, h) = image.dimensions();
        places.push(AtlasPlace {
            scale: Vec2::new(w as f32, h as f32) / size,
            offset: Vec2::new(x as f32, y as f32) / size,
        });
    }
    let white = places.pop().map_or(Vec2::ZERO, |p| p.apply(Vec2::splat(0.5)));
    (texture(atlas), places, white)
}

/// As the model holds it.
pub(crate) fn texture(image: RgbaImage) -> Texture {
    Texture { width: image.width(), height: image.height(), rgba: image.into_raw() }
}

/// Copies a picture and repeats its border outwards.
fn blit(atlas: &mut RgbaImage, image: &RgbaImage, x: u32, y: u32) {
    let (w, h) = image.dimensions();
    for row in 0..h + 2 * GUTTER {
        for column in 0..w + 2 * GUTTER {
            let from = (column.saturating_sub(GUTTER).min(w - 1), row.saturating_sub(GUTTER).min(h - 1));
            let to = (x + column - GUTTER, y + row - GUTTER);
            if to.0 < atlas.width() && to.1 < atlas.height() {
                atlas.put_pixel(to.0, to.1, *image.get_pixel(from.0, from.1));
            }
        }
    }
}

struct AtlasLayout {
    width: u32,
    height: u32,
    corners: Vec<(u32, u32)>,
}

/// Places rectangles on shelves, tallest first; `None` where they do not fit the largest texture.
fn shelves(sizes: &[(u32, u32)]) -> Option<AtlasLayout> {
    let padded = |v: u32| v + 2 * GUTTER;
    let area: u64 = sizes.iter().map(|&(w, h)| u64::from(padded(w)) * u64::from(padded(h))).sum();
    let widest = sizes.iter().map(|s| padded(s.0)).max()?;
    let width = ((area as f64).sqrt().ceil() as u32).max(widest);
    if widest > TEXTURE_SIDE_MAX {
        return None;
    }
    let width = width.min(TEXTURE_SIDE_MAX);
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse(sizes[i].1), i));
    let mut corners = vec![(0, 0); sizes.len()];
    let (mut x, mut y, mut shelf) = (0, 0, 0);
    for i in order {
        let (w, h) = (padded(sizes[i].0), padded(sizes[i].1));
        if x + w > width {
            (x, y, shelf) = (0, y + shelf, 0);
        }
        corners[i] = (x + GUTTER, y + GUTTER);
        x += w;
        shelf = shelf.max(h);
    }
    let height = y + shelf;
    (height <= TEXTURE_SIDE_MAX).then_some(AtlasLayout { width, height, corners })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn shelves_never_overlap(sizes in proptest::collection::vec((1u32..300, 1u32..300), 1..12)) {
            let layout = shelves(&sizes).expect("fits");
            let boxes: Vec<_> = sizes.iter().zip(&layout.corners).map(|(s, c)| (c.0, c.1, c.0 + s.0, c.1 + s.1)).collect();
            for (i, a) in boxes.iter().enumerate() {
                prop_assert!(a.0 >= GUTTER && a.1 >= GUTTER && a.2 + GUTTER <= layout.width && a.3 + GUTTER <= layout.height);
                for b in &boxes[..i] {
                    let apart = a.0 >= b.2 + 2 * GUTTER || b.0 >= a.2 + 2 * GUTTER || a.1 >= b.3 + 2 * GUTTER || b.1 >= a.3 + 2 * GUTTER;
                    prop_assert!(apart, "{a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn a_coordinate_finds_its_own_picture_in_the_atlas() {
        let plain = |c: [u8; 4], w, h| TexturePicture { rgba: RgbaImage::from_pixel(w, h, Rgba(c)) };
        let pictures = [plain([200, 0, 0, 255], 17, 9), plain([0, 200, 0, 255], 5, 31)];
        let (atlas, places, white) = pack(&pictures.iter().collect::<Vec<_>>());
        let at = |uv: Vec2| {
            let x = (uv.x * atlas.width as f32) as usize;
            let y = (uv.y * atlas.height as f32) as usize;
            let i = (y * atlas.width as usize + x) * 4;
            [atlas.rgba[i], atlas.rgba[i + 1], atlas.rgba[i + 2]]
        };
        for uv in [Vec2::splat(0.01), Vec2::splat(0.5), Vec2::splat(0.99)] {
            assert_eq!(at(places[0].apply(uv)), [200, 0, 0]);
            assert_eq!(at(places[1].apply(uv)), [0, 200, 0]);
        }
        assert_eq!(at(white), [255, 255, 255]);
    }

    #[test]
    fn pictures_too_large_together_are_halved() {
        let big = || TexturePicture { rgba: RgbaImage::new(4000, 3000) };
        let pictures = [big(), big()];
        let (atlas, _, _) = pack(&pictures.iter().collect::<Vec<_>>());
        assert!(atlas.width <= TEXTURE_SIDE_MAX && atlas.height <= TEXTURE_SIDE_MAX);
    }
}
