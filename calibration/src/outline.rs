//! Outlines of the own gun in the camera's pictures, from pictures in which it turns: what is fixed to the camera keeps still, and the sea goes by.
//!
//! A pixel that the gun covers by a share `a` changes by `1 - a` times what the sea beside it does. So the gun's edge lies where a pixel's
//! deviation over all pictures is half of that of the sea a few pixels further out. A sky keeps still as well where the horizon never comes; its
//! end is no edge in most pictures, and so it is told from the gun.
//!
//! [`outlines_of`] takes the outlines from a model of the gun.

use bowwave_core::{event::Picture, own_ship::Phantom};
use glam::DVec2;

use contour::{closed_contours, simplified};

use crate::target::Plane;

mod contour;
mod cover;
mod model;

pub use model::outlines_of;

/// Pictures that are needed: fewer tell a pixel's deviation by no more than a tenth.
pub const PICTURES_LEAST: u32 = 60;
/// The quietest share of pixels, by which noise is known.
const QUIET: usize = 200;
/// A sea that deviates by no more codes than this does not go by.
const MOVES_LEAST: f32 = 2.0;
/// Pixels to either side of an edge between which codes are compared, and by how many they differ where there is an edge...
const APART: usize = 2;
const CONTRAST: f32 = 8.0;
/// ...in this share of the pictures, along this share of an outline.
const OFTEN: f64 = 0.5;
const EDGE_LEAST: f64 = 0.8;
/// Pixels beyond an edge between which the sea is looked at, and within which the edge is looked for.
const SEA_PX: [f64; 2] = [3.0, 5.0];
const SOUGHT_PX: [f64; 2] = [-2.5, 3.0];
const SOUGHT_STEP_PX: f64 = 0.125;
/// Smallest area that is kept, share of the picture: what is smaller is dirt on the lens.
const AREA_LEAST: f64 = 3e-4;
/// Outlines follow the edge to this many pixels, or with the most corners that a calibration takes.
const DETAIL_PX: f64 = 0.35;
const CORNERS_MOST: usize = 64;
/// Corners are rounded to this part of a pixel: what a file that people read needs.
const ROUNDED: f64 = 100.0;

/// Sums over pictures.
#[derive(Clone, Debug)]
pub struct OutlineFinder {
    size: (u32, u32),
    pictures: u32,
    /// Sum and sum of squares of each pixel's code less that of the first picture.
    first: Vec<f32>,
    sums: Vec<[f32; 2]>,
    /// In how many pictures there was an edge across each pixel, from left to right and down.
    edges: Vec<[u32; 2]>,
    /// The newest picture's codes.
    codes: Vec<f32>,
}

/// Outlines of all that keeps still in the pictures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FoundOutlines {
    /// The largest first.
    pub phantoms: Vec<Phantom>,
    /// Outlines that were refused because they fade into what is about them, as shares of the picture.
    pub faded: Vec<f64>,
    /// Openings in the phantoms through which the sea is seen, as shares of the picture: an outline has none.
    pub openings: Vec<f64>,
}

/// Error of a search for outlines.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OutlineError {
    /// Too few pictures.
    #[error(
        "{0} pictures are too few to tell what keeps still: give {PICTURES_LEAST} or more, in which the gun turns and tilts"
    )]
    Pictures(u32),
    /// The sea does not go by.
    #[error(
        "the pictures hardly change (by {0:.1} of 255 codes), so that nothing tells the gun from the sea: turn and tilt it by a few degrees \
         while recording, at the sea, by day"
    )]
    Still(f32),
}

impl OutlineFinder {
    /// One that has seen no picture yet, for pictures of `size` pixels.
    pub fn new(size: (u32, u32)) -> Self {
        let pixels = size.0 as usize * size.1 as usize;
        Self {
            size,
            pictures: 0,
            first: vec![0.0; pixels],
            sums: vec![[0.0; 2]; pixels],
            edges: vec![[0; 2]; pixels],
            codes: vec![0.0; pixels],
        }
    }

    /// Takes a picture; one of another size is not taken.
    pub fn see(&mut self, picture: &Picture) {
        if (picture.width(), picture.height()) != self.size {
            return;
        }
        let width = self.size.0 as usize;
        for (y, codes) in self.codes.chunks_exact_mut(width).enumerate() {
            let pixels = picture.row(y).chunks_exact(picture.format().pixel_bytes());
            pixels.zip(codes).for_each(|(pixel, code)| *code = luma(pixel));
        }
        if self.pictures == 0 {
            self.first.clone_from(&self.codes);
        }
        self.pictures += 1;
        for ((code, first), [sum, squares]) in self.codes.iter().zip(&self.first).zip(&mut self.sums) {
            let off = code - first;
            *sum += off;
            *squares += off * off;
        }
        for (apart, axis) in [(2 * APART, 0), (2 * APART * width, 1)] {
            let middle = self.edges.iter_mut().skip(apart / 2);
            let pairs = self.codes.iter().zip(self.codes.iter().skip(apart));
            middle.zip(pairs).for_each(|(edge, (a, b))| edge[axis] += u32::from((a - b).abs() >= CONTRAST));
        }
    }

    /// Outlines of what kept still.
    ///
    /// # Errors
    /// Too few pictures, or pictures that do not change.
    pub fn find(&self) -> Result<FoundOutlines, OutlineError> {
        if self.pictures < PICTURES_LEAST {
            return Err(OutlineError::Pictures(self.pictures));
        }
        let deviation = self.deviation();
        let moves = quantile(&deviation.values, deviation.values.len() / 2);
        if moves < MOVES_LEAST {
            return Err(OutlineError::Still(moves));
        }
        // Between what keeps still and the sea, on a scale of ratios.
        let still = ((1.0 + quantile(&deviation.values, deviation.values.len() / QUIET)) * moves).sqrt();
        let mut found = FoundOutlines::default();
        let all = f64::from(self.size.0) * f64::from(self.size.1);
        let mut contours: Vec<_> = closed_contours(&deviation.values, self.size, still)
            .into_iter()
            .map(|contour| (area(&contour), contour))
            .filter(|(area, _)| area.abs() >= AREA_LEAST * all)
            .collect();
        contours.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (area, contour) in contours {
            if area < 0.0 {
                found.openings.push(-area / all);
                continue;
            }
            if self.edge_share(&contour) < EDGE_LEAST {
                found.faded.push(area / all);
                continue;
            }
            let corners = simplified(&self.refined(&contour, &deviation), DETAIL_PX, CORNERS_MOST);
            let outline = corners.into_iter().map(|p| (p * ROUNDED).round() / ROUNDED).collect();
            let name = format!("part {}", found.phantoms.len() + 1);
            found.phantoms.push(Phantom::new(name, outline, self.size));
        }
        Ok(found)
    }

    /// Standard deviation of each pixel, codes, without that of the quietest ones: noise.
    fn deviation(&self) -> Plane {
        let count = self.pictures as f32;
        let variance = |[sum, squares]: &[f32; 2]| (squares / count - (sum / count) * (sum / count)).max(0.0);
        let mut variances: Vec<f32> = self.sums.iter().map(variance).collect();
        let noise = quantile(&variances, variances.len() / QUIET);
        variances.iter_mut().for_each(|v| *v = (*v - noise).max(0.0).sqrt());
        Plane { width: self.size.0 as usize, height: self.size.1 as usize, values: variances }
    }

    /// The pictures' mean, codes, rows from the top; black before the first.
    pub fn mean(&self) -> Vec<u8> {
        let count = self.pictures.max(1) as f32;
        self.first
            .iter()
            .zip(&self.sums)
            .map(|(first, [sum, _])| (first + sum / count).round() as u8)
            .collect()
    }

    /// Along which share of an outline there is an edge in most pictures; the picture's border does not count.
    fn edge_share(&self, contour: &[DVec2]) -> f64 {
        let (mut edge, mut all) = (0.0, 0.0);
        for (from, to) in contour.iter().zip(contour.iter().cycle().skip(1)) {
            let middle = from.midpoint(*to);
            let Some(counts) = self.pixel(middle).and_then(|i| self.edges.get(i)) else { continue };
            if self.is_border(middle) {
                continue;
            }
            let often = f64::from(counts[0].max(counts[1])) >= OFTEN * f64::from(self.pictures);
            let length = from.distance(*to);
            all += length;
            edge += if often { length } else { 0.0 };
        }
        if all > 0.0 { edge / all } else { 0.0 }
    }

    /// The outline where deviations are half of the sea's beside it.
    fn refined(&self, contour: &[DVec2], deviation: &Plane) -> Vec<DVec2> {
        let at = |place: DVec2| deviation.at(place);
        let steps = |[from, to]: [f64; 2]| {
            let count = ((to - from) / SOUGHT_STEP_PX).round() as u32;
            (0..=count).map(move |i| from + f64::from(i) * SOUGHT_STEP_PX)
        };
        let moved = |i: usize| {
            // The outline's run over some pixels, so that single ones do not turn it.
            let count = contour.len();
            let [before, here, after] = [i + count - 3 % count, i, i + 3].map(|k| contour[k % count]);
            // Clockwise on the screen: the outside is to the left.
            let out = -(after - before).normalize_or_zero().perp();
            if self.is_border(here) {
                return here;
            }
            let (sea, count) =
                steps(SEA_PX).fold((0.0, 0.0), |(sum, n), px| (sum + at(here + out * px), n + 1.0));
            let half = 0.5 * sea / count;
            // From the outside: what lies further in may have edges of its own.
            let crossed = steps(SOUGHT_PX).rfind(|px| at(here + out * *px) < half);
            crossed.map_or(here, |px| here + out * (px + 0.5 * SOUGHT_STEP_PX))
        };
        (0..contour.len()).map(moved).collect()
    }

    /// Tests whether a place is so near to the picture's border that nothing is seen beyond.
    fn is_border(&self, place: DVec2) -> bool {
        let size = DVec2::new(f64::from(self.size.0), f64::from(self.size.1));
        let margin = DVec2::splat(APART as f64 + 0.5);
        place.cmplt(margin).any() || place.cmpgt(size - margin).any()
    }

    /// Number of the pixel that holds a place.
    fn pixel(&self, place: DVec2) -> Option<usize> {
        let (width, height) = (f64::from(self.size.0), f64::from(self.size.1));
        let inside = (0.0..width).contains(&place.x) && (0.0..height).contains(&place.y);
        inside.then(|| place.y as usize * self.size.0 as usize + place.x as usize)
    }
}

/// Luma of a pixel's first bytes, codes: of three it is weighed as ITU-R BT.601 does.
fn luma(pixel: &[u8]) -> f32 {
    match *pixel {
        [r, g, b] => 0.299 * f32::from(r) + 0.587 * f32::from(g) + 0.114 * f32::from(b),
        [luma, ..] => f32::from(luma),
        [] => 0.0,
    }
}

/// Area of a closed polygon, squared pixels (the shoelace formula): above 0 where a contour runs around what keeps still, below where around
/// what does not.
fn area(polygon: &[DVec2]) -> f64 {
    let sum: f64 = polygon.iter().zip(polygon.iter().cycle().skip(1)).map(|(a, b)| a.perp_dot(*b)).sum();
    sum / 2.0
}

/// The value that `below` others are not above; 0 of none.
fn quantile(values: &[f32], below: usize) -> f32 {
    let mut sorted = values.to_vec();
    if below >= sorted.len() { 0.0 } else { *sorted.select_nth_unstable_by(below, f32::total_cmp).1 }
}

#[cfg(test)]
mod tests;
