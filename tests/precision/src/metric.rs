//! How far a picture is from another one to the eye.

use anyhow::{Result, ensure};
use image::{RgbImage, imageops::crop_imm};

/// Mean FLIP (Andersson et al. 2020, through its authors' code) of `test` against `reference`, both sRGB bytes of `size`, over the pixels
/// that `mask` holds; 67 pixels a degree. `None` where the mask is empty.
pub fn flip_mean(reference: &[u8], test: &[u8], size: (u32, u32), mask: &[bool]) -> Result<Option<f64>> {
    let map = flip_map(reference, test, size)?;
    ensure!(mask.len() == map.len(), "a mask of {} pixels for a picture of {}", mask.len(), map.len());
    let (sum, count) = map
        .iter()
        .zip(mask)
        .filter(|(_, m)| **m)
        .fold((0.0, 0u32), |(sum, count), (&v, _)| (sum + f64::from(v), count + 1));
    Ok((count > 0).then(|| sum / f64::from(count)))
}

/// FLIP of every pixel.
pub fn flip_map(reference: &[u8], test: &[u8], size: (u32, u32)) -> Result<Vec<f32>> {
    let bytes = size.0 as usize * size.1 as usize * 3;
    ensure!(
        size.0 > 0 && size.1 > 0 && reference.len() == bytes && test.len() == bytes,
        "pictures of {} and {} bytes are not {} x {} RGB",
        reference.len(),
        test.len(),
        size.0,
        size.1
    );
    let picture = |data: &[u8]| nv_flip::FlipImageRgb8::with_data(size.0, size.1, data);
    Ok(nv_flip::flip(picture(reference), picture(test), nv_flip::DEFAULT_PIXELS_PER_DEGREE).to_vec())
}

/// Part of a picture about some of its pixels, with as much around them as FLIP looks at: the error over those pixels is that in the whole picture where
/// what lies beyond is equal, and is found sooner.
#[derive(Clone, Copy, Debug)]
pub struct Cutout {
    /// Left upper corner of the part, pixels of the picture.
    corner: [u32; 2],
    size: [u32; 2],
    /// First of the pixels in question within the part, and their number across and down.
    inset: [u32; 2],
    inner: [u32; 2],
}

impl Cutout {
    /// About `inner` pixels from `corner` on of a picture of `whole` pixels.
    pub fn new(corner: [u32; 2], inner: [u32; 2], whole: [u32; 2]) -> Self {
        /// The filters of FLIP reach no farther, pixels.
        const MARGIN: u32 = 24;
        let start = corner.map(|v| v.saturating_sub(MARGIN));
        let end: [u32; 2] = std::array::from_fn(|i| (corner[i] + inner[i] + MARGIN).min(whole[i]));
        Self {
            corner: start,
            size: std::array::from_fn(|i| end[i] - start[i]),
            inset: std::array::from_fn(|i| corner[i] - start[i]),
            inner,
        }
    }

    /// The part of a picture.
    pub fn cut(&self, picture: &RgbImage) -> RgbImage {
        crop_imm(picture, self.corner[0], self.corner[1], self.size[0], self.size[1]).to_image()
    }

    /// Place within the part of pixel number `i` in question, row by row.
    pub fn place(&self, i: usize) -> (u32, u32) {
        let i = i as u32;
        (self.inset[0] + i % self.inner[0], self.inset[1] + i / self.inner[0])
    }

    /// Mean FLIP of parts over the pixels in question that `mask` holds, by their numbers; none where it holds none.
    pub fn flip_mean(
        &self,
        truth: &RgbImage,
        drawn: &RgbImage,
        mask: impl IntoIterator<Item = bool>,
    ) -> Result<Option<f64>> {
        let map = flip_map(truth.as_raw(), drawn.as_raw(), (self.size[0], self.size[1]))?;
        let (mut sum, mut count) = (0.0, 0u32);
        for (i, _) in mask.into_iter().enumerate().filter(|(_, is_held)| *is_held) {
            let (x, y) = self.place(i);
            sum += f64::from(map[(y * self.size[0] + x) as usize]);
            count += 1;
        }
        Ok((count > 0).then(|| sum / f64::from(count)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flip_is_nothing_between_equals_and_counts_only_what_the_mask_holds() {
        let size = (40, 30);
        let grey = vec![120u8; 3600];
        let mut half = grey.clone();
        // The right half is red: FLIP's filters reach a few pixels over the edge.
        for (i, p) in half.chunks_exact_mut(3).enumerate() {
            if i % 40 >= 20 {
                p.copy_from_slice(&[200, 30, 30]);
            }
        }
        let columns = |from: usize, to: usize| -> Vec<bool> {
            (0..1200).map(|i| (from..to).contains(&(i % 40))).collect()
        };
        let flip = |test: &[u8], mask: &[bool]| flip_mean(&grey, test, size, mask).unwrap();
        assert_eq!(flip(&grey, &columns(0, 40)), Some(0.0));
        assert!(flip(&half, &columns(30, 40)).unwrap() > 0.3);
        assert!(flip(&half, &columns(0, 10)).unwrap() < 0.02);
        assert_eq!(flip(&half, &columns(0, 0)), None);
        assert!(flip_mean(&grey, &half[3..], size, &columns(0, 1)).is_err());
        assert!(flip_mean(&grey, &half, size, &[true]).is_err());
    }

    #[test]
    fn a_cutouts_error_is_that_in_the_whole_picture() {
        let (size, corner, inner) = ((120, 90), [40, 30], [30, 20]);
        let grey = RgbImage::from_pixel(size.0, size.1, image::Rgb([90; 3]));
        let mut drawn = grey.clone();
        for i in 0..inner[0] * inner[1] {
            let code = (i * 37 % 200) as u8;
            drawn.put_pixel(
                corner[0] + i % inner[0],
                corner[1] + i / inner[0],
                image::Rgb([code, 90, 255 - code]),
            );
        }
        let inside = |i: usize, from: usize, count: u32| (from..from + count as usize).contains(&i);
        let mask: Vec<bool> =
            (0..10_800).map(|i| inside(i % 120, 40, 30) && inside(i / 120, 30, 20)).collect();
        let whole = flip_mean(grey.as_raw(), drawn.as_raw(), size, &mask).unwrap().unwrap();
        let cutout = Cutout::new(corner, inner, [120, 90]);
        let part =
            cutout.flip_mean(&cutout.cut(&grey), &cutout.cut(&drawn), vec![true; 600]).unwrap().unwrap();
        assert!((whole - part).abs() < 1e-6, "{whole} {part}");
    }
}
