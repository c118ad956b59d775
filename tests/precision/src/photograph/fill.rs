//! Water without its reflection: filled in from the water beside it.
//!
//! Row by row, because at a grazing view a row is water of one distance: what lies left of the reflection is folded into it
//! over its left edge, what lies right over its right edge (the texture continues without a seam). Between the two, means are
//! mixed in proportion to the distance from the edges, deviations by roots of the same weights: so that the mixture of two
//! unrelated textures has the variance of one.

use image::{Rgb, RgbImage};

use super::mask::OutlineMask;

/// Rows above and below over which a side's mean colour is taken.
const MEAN_ROWS: u32 = 6;

/// The picture with `region` filled from at most `source_px` pixels left and right of `no_water`, which holds the region and
/// whatever else beside it is no open water.
pub fn without(picture: &RgbImage, region: &OutlineMask, no_water: &OutlineMask, source_px: u32) -> RgbImage {
    let bands: Vec<[Option<FillBand>; 2]> = (0..picture.height())
        .map(|y| region.span(y).map_or([None, None], |_| FillBand::beside(picture, no_water, y, source_px)))
        .collect();
    let mut filled = picture.clone();
    for y in 0..picture.height() {
        let (Some((first, last)), true) = (no_water.span(y), region.span(y).is_some()) else { continue };
        let [left, right] = [0, 1].map(|side| FillSide::new(&bands, y, side));
        for x in first..=last {
            if region.has(x, y) {
                let share = (f64::from(x - first) + 0.5) / f64::from(last - first + 1);
                if let Some(colour) = mixed(picture, y, x, share, left.as_ref(), right.as_ref()) {
                    filled.put_pixel(x, y, colour);
                }
            }
        }
    }
    filled
}

/// Columns `from` to before `to` of a row, and their mean colour.
#[derive(Clone, Copy)]
struct FillBand {
    from: u32,
    to: u32,
    mean: [f64; 3],
}

impl FillBand {
    /// What lies left and right of the region in a row; nothing where it is not in the row, or where too little is left.
    fn beside(picture: &RgbImage, region: &OutlineMask, y: u32, source_px: u32) -> [Option<Self>; 2] {
        let Some((first, last)) = region.span(y) else { return [None, None] };
        let right = (last + 1, (last + 1 + source_px).min(picture.width()));
        [(first.saturating_sub(source_px), first), right].map(|(from, to)| {
            if to <= from + 8 {
                return None;
            }
            let mut sum = [0.0; 3];
            for x in from..to {
                let pixel = picture.get_pixel(x, y).0;
                (0..3).for_each(|c| sum[c] += f64::from(pixel[c]));
            }
            Some(Self { from, to, mean: sum.map(|s| s / f64::from(to - from)) })
        })
    }
}

fn mixed(
    picture: &RgbImage,
    y: u32,
    x: u32,
    share: f64,
    left: Option<&FillSide>,
    right: Option<&FillSide>,
) -> Option<Rgb<u8>> {
    let (near_left, near_right) = match (left, right) {
        (Some(_), Some(_)) => (1.0 - share, share),
        (Some(_), None) => (1.0, 0.0),
        (None, Some(_)) => (0.0, 1.0),
        (None, None) => return None,
    };
    let mut sum = [0.0; 3];
    for (side, weight) in [(left, near_left), (right, near_right)] {
        let Some(side) = side else { continue };
        let deviation_weight = weight / near_left.hypot(near_right);
        let source = picture.get_pixel(side.folded(x), y).0;
        for c in 0..3 {
            sum[c] += weight * side.mean[c] + deviation_weight * (f64::from(source[c]) - side.mean[c]);
        }
    }
    Some(Rgb(sum.map(|v| v.round().clamp(0.0, 255.0) as u8)))
}

/// The water on one side of the reflection in one row.
struct FillSide {
    from: u32,
    to: u32,
    on_the_left: bool,
    mean: [f64; 3],
}

impl FillSide {
    /// Side 0 (left) or 1 (right) of row `y`, its mean taken over a few rows.
    fn new(bands: &[[Option<FillBand>; 2]], y: u32, side: usize) -> Option<Self> {
        let FillBand { from, to, .. } = bands[y as usize][side]?;
        let rows = y.saturating_sub(MEAN_ROWS) as usize..bands.len().min((y + MEAN_ROWS + 1) as usize);
        let near: Vec<[f64; 3]> = bands[rows].iter().filter_map(|b| Some(b[side]?.mean)).collect();
        let mean = std::array::from_fn(|c| near.iter().map(|m| m[c]).sum::<f64>() / near.len() as f64);
        Some(Self { from, to, on_the_left: side == 0, mean })
    }

    /// The column that stands in for column `x`: folded over the near edge, and over again where the side is too narrow.
    fn folded(&self, x: u32) -> u32 {
        let width = i64::from(self.to - self.from);
        let beyond = if self.on_the_left {
            i64::from(x) - i64::from(self.to)
        } else {
            i64::from(self.from) - 1 - i64::from(x)
        };
        let turn = beyond.rem_euclid(2 * width);
        let inward = if turn < width { turn } else { 2 * width - 1 - turn };
        let column =
            if self.on_the_left { i64::from(self.to) - 1 - inward } else { i64::from(self.from) + inward };
        column as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Water whose rows get brighter downwards, with waves of a fixed deviation.
    fn water(width: u32, height: u32) -> RgbImage {
        let mut state = 1_u32;
        RgbImage::from_fn(width, height, |_, y| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let wave = (state >> 24) as i32 % 41 - 20;
            let v = (90 + y as i32 / 2 + wave).clamp(0, 255) as u8;
            Rgb([v, v, v])
        })
    }

    #[test]
    fn filled_water_has_the_mean_and_the_deviation_of_the_water_beside_it() {
        let clean = water(300, 80);
        let mut dark = clean.clone();
        let outline = [[100.0, 10.0], [200.0, 10.0], [200.0, 70.0], [100.0, 70.0]];
        let region = OutlineMask::of_polygon((300, 80), &outline);
        for y in 10..70 {
            for x in 100..200 {
                dark.put_pixel(x, y, Rgb([5, 5, 5]));
            }
        }
        let filled = without(&dark, &region, &region, 80);
        let moments = |picture: &RgbImage| {
            let values: Vec<f64> = (10..70)
                .flat_map(|y| (100..200).map(move |x| (x, y)))
                .map(|(x, y)| f64::from(picture.get_pixel(x, y).0[0]) - f64::from(y) / 2.0)
                .collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
            (mean, variance.sqrt())
        };
        let ((mean, deviation), (true_mean, true_deviation)) = (moments(&filled), moments(&clean));
        assert!((mean - true_mean).abs() < 1.0, "{mean} {true_mean}");
        assert!((deviation / true_deviation - 1.0).abs() < 0.05, "{deviation} {true_deviation}");
        // What is outside stays as it is.
        assert!((0..80).all(|y| filled.get_pixel(99, y) == dark.get_pixel(99, y)));
    }

    #[test]
    fn a_region_at_the_edge_is_filled_from_its_other_side() {
        let picture = water(60, 20);
        let region = OutlineMask::of_polygon((60, 20), &[[0.0, 5.0], [20.0, 5.0], [20.0, 15.0], [0.0, 15.0]]);
        let filled = without(&picture, &region, &region, 15);
        // Folded over the edge at column 20.
        assert_eq!(filled.get_pixel(19, 10), picture.get_pixel(20, 10));
        assert_eq!(filled.get_pixel(10, 10), picture.get_pixel(29, 10));
        assert_eq!(filled.get_pixel(4, 10), picture.get_pixel(34, 10));
    }
}
