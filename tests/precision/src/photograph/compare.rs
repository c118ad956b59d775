//! How far a drawn reflection is from the real one.

use anyhow::Result;
use image::{RgbImage, imageops};

use super::mask::OutlineMask;
use crate::metric::flip_mean;

/// Pixels around the region that FLIP's filters look at.
const MARGIN_PX: u32 = 24;

/// Octaves of the gradient spectrum.
const OCTAVES: u32 = 5;

/// Two measures; 0 is the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Mean FLIP (Andersson et al. 2020) in the region.
    pub flip: f64,
    /// Root mean square, over octaves of scale and both directions, of the binary logarithm of the ratio of gradient power.
    pub spectrum: f64,
}

/// Holds `test` against `truth` in `region`.
pub fn compare(truth: &RgbImage, test: &RgbImage, region: &OutlineMask) -> Result<Difference> {
    anyhow::ensure!(truth.dimensions() == test.dimensions(), "the pictures have different sizes");
    let [left, top, right, bottom] =
        region.bounds().ok_or_else(|| anyhow::anyhow!("the region lies outside the picture"))?;
    let (x0, y0) = (left.saturating_sub(MARGIN_PX), top.saturating_sub(MARGIN_PX));
    let x1 = (right + MARGIN_PX + 1).min(truth.width());
    let y1 = (bottom + MARGIN_PX + 1).min(truth.height());
    let crop = |p: &RgbImage| imageops::crop_imm(p, x0, y0, x1 - x0, y1 - y0).to_image();
    let (truth, test) = (crop(truth), crop(test));
    let inside = |x: u32, y: u32| region.has(x0 + x, y0 + y);
    let judged: Vec<bool> = truth.enumerate_pixels().map(|(x, y, _)| inside(x, y)).collect();
    let flip = flip_mean(truth.as_raw(), test.as_raw(), truth.dimensions(), &judged)?;
    Ok(Difference { flip: flip.unwrap_or(0.0), spectrum: spectrum(&truth, &test, inside) })
}

fn spectrum(truth: &RgbImage, test: &RgbImage, inside: impl Fn(u32, u32) -> bool) -> f64 {
    let (a, b) = (powers(truth, &inside), powers(test, &inside));
    let octaves: Vec<f64> = a.iter().zip(&b).map(|(a, b)| ((b + FLOOR) / (a + FLOOR)).log2()).collect();
    (octaves.iter().map(|o| o * o).sum::<f64>() / octaves.len().max(1) as f64).sqrt()
}

/// Gradient power of one step of an 8-bit code every eighth pixel: less is not seen, and no ratio of nothing is taken.
const FLOOR: f64 = 1.0 / 8.0;

/// Mean squared differences of luma (BT.601 codes) between neighbouring cells of 1, 2, 4... pixels, across and down, in cells
/// that lie wholly inside.
fn powers(picture: &RgbImage, inside: &impl Fn(u32, u32) -> bool) -> Vec<f64> {
    let (width, height) = picture.dimensions();
    let luma: Vec<f64> = picture
        .pixels()
        .map(|p| 0.299 * f64::from(p.0[0]) + 0.587 * f64::from(p.0[1]) + 0.114 * f64::from(p.0[2]))
        .collect();
    let mut powers = Vec::new();
    for octave in 0..OCTAVES {
        let cell = 1 << octave;
        let (columns, rows) = (width / cell, height / cell);
        let mean = |cx: u32, cy: u32| -> Option<f64> {
            let mut sum = 0.0;
            for y in cy * cell..(cy + 1) * cell {
                for x in cx * cell..(cx + 1) * cell {
                    if !inside(x, y) {
                        return None;
                    }
                    sum += luma[(y * width + x) as usize];
                }
            }
            Some(sum / f64::from(cell * cell))
        };
        let cells: Vec<Option<f64>> =
            (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))).map(|(x, y)| mean(x, y)).collect();
        for (dx, dy) in [(1, 0), (0, 1)] {
            let (mut sum, mut count) = (0.0, 0.0);
            for y in 0..rows.saturating_sub(dy) {
                for x in 0..columns.saturating_sub(dx) {
                    let at = |x: u32, y: u32| cells[(y * columns + x) as usize];
                    if let (Some(a), Some(b)) = (at(x, y), at(x + dx, y + dy)) {
                        sum += (a - b) * (a - b);
                        count += 1.0;
                    }
                }
            }
            if count > 0.0 {
                powers.push(sum / count);
            }
        }
    }
    powers
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    fn stripes(period: u32, height: u8) -> RgbImage {
        RgbImage::from_fn(96, 96, |_, y| {
            Rgb([if (y / period).is_multiple_of(2) { 100 } else { 100 + height }; 3])
        })
    }

    fn whole() -> OutlineMask {
        OutlineMask::of_polygon((96, 96), &[[0.0, 0.0], [96.0, 0.0], [96.0, 96.0], [0.0, 96.0]])
    }

    #[test]
    fn the_same_picture_differs_by_nothing() {
        let picture = stripes(4, 60);
        assert_eq!(compare(&picture, &picture, &whole()).unwrap(), Difference { flip: 0.0, spectrum: 0.0 });
    }

    #[test]
    fn gradient_power_follows_its_definition() {
        // Rows alternate by 60 at every fourth row: one step in four of the vertical neighbours.
        let powers = powers(&stripes(4, 60), &|_, _| true);
        assert!((powers[1] - 3600.0 * 23.0 / 95.0).abs() < 1e-6, "{}", powers[1]);
        assert_eq!(powers[0], 0.0);
        // Cells of four rows alternate every time, cells of eight are all the same.
        assert!((powers[5] - 3600.0).abs() < 1e-6 && powers[7].abs() < 1e-9);
    }

    #[test]
    fn weaker_waves_are_octaves_away_and_far_is_worse_than_near() {
        let truth = stripes(4, 80);
        let (near, far) = (stripes(4, 72), stripes(4, 20));
        let (near, far) =
            (compare(&truth, &near, &whole()).unwrap(), compare(&truth, &far, &whole()).unwrap());
        assert!(near.flip < far.flip && near.spectrum < far.spectrum, "{near:?} {far:?}");
        // Of ten figures three have waves: a quarter of the height is a sixteenth of the power, four octaves.
        assert!((far.spectrum - (16.0_f64 * 3.0 / 10.0).sqrt()).abs() < 0.15, "{}", far.spectrum);
    }

    #[test]
    fn what_lies_outside_the_region_does_not_count() {
        let truth = stripes(4, 60);
        let mut test = truth.clone();
        (60..96).for_each(|x| (0..96).for_each(|y| test.put_pixel(x, y, Rgb([0, 0, 0]))));
        let left = OutlineMask::of_polygon((96, 96), &[[0.0, 0.0], [24.0, 0.0], [24.0, 96.0], [0.0, 96.0]]);
        let difference = compare(&truth, &test, &left).unwrap();
        assert!(difference.flip < 1e-3 && difference.spectrum < 1e-9, "{difference:?}");
    }
}
