//! The reflection of one boat drawn on the processor, pixel by pixel: what the GPU's shaders are held against.

use glam::{DVec2, Vec3, Vec4};

use super::{
    grid::outer_tones,
    lobes::{BANDS, Lobes, ReflectionTransfer},
};
use crate::colour::{LUMINANCE, linear_to_srgb};
use crate::estimate::light::SeaTones;

/// No narrower a stretch of hull is asked for, half of it in pixels: what the shaders' grid can hold.
pub const HALF_WIDTH_MIN_PX: f64 = 1.5;

/// Where a boat's hull meets the water in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct HullFoot {
    /// The point from which the line is measured, pixels.
    pub anchor: DVec2,
    /// Unit vector in which gravity pulls.
    pub down: DVec2,
    /// Position across, right of the anchor, of the line's first column, and from one to the next, pixels.
    pub first: f64,
    /// See `first`.
    pub pitch: f64,
    /// The line: pixels below the anchor, column by column.
    pub line: Vec<f64>,
    /// Height of the eye over the water, metres.
    pub eye_m: f64,
    /// Tangent of the angle below the horizontal under which the anchor is seen.
    pub tangent: f64,
    /// Pixels to a tangent of 1 about the anchor.
    pub focal_px: f64,
    /// Pixels above the line that are drawn along the hull: waves before the hull stand as high.
    pub foot_px: f64,
}

/// A boat as a picture that stands on its hull-water line.
#[derive(Clone, Debug, PartialEq)]
pub struct Billboard {
    /// Position across, right of the anchor, of the left edge of the first column, pixels.
    pub first: f64,
    /// Width of a column, pixels.
    pub pitch: f64,
    /// Mean premultiplied linear light and cover of each band, from the water up, column by column.
    pub columns: Vec<[Vec4; BANDS]>,
}

impl Billboard {
    /// Running sums along the columns, so that any stretch's mean is one difference.
    fn sums(&self) -> Vec<[Vec4; BANDS]> {
        let mut sum = [Vec4::ZERO; BANDS];
        let mut sums = vec![sum];
        for column in &self.columns {
            for (s, c) in sum.iter_mut().zip(column) {
                *s += c;
            }
            sums.push(sum);
        }
        sums
    }
}

/// Draws the reflection into `picture`, linear light in rows of `width`.
pub fn compose(
    picture: &mut [Vec3],
    width: usize,
    place: &HullFoot,
    billboard: &Billboard,
    lobes: &Lobes,
    tones: &SeaTones,
) {
    if lobes.reach_m <= 0.0 || width == 0 {
        return;
    }
    let sums = billboard.sums();
    for (n, pixel) in picture.iter_mut().enumerate() {
        let at = DVec2::new((n % width) as f64 + 0.5, (n / width) as f64 + 0.5) - place.anchor;
        let (across, down) = (at.dot(DVec2::new(place.down.y, -place.down.x)), at.dot(place.down));
        let (line, near, beside) = place.hull(across);
        let below = down - line;
        // Beside the hull there is sea above the line, farther off than the boat.
        let foot_px = if beside { 0.0 } else { place.foot_px };
        // Water above the line is a wave before the hull, as far from it as one as far below.
        let tangent = near + below.abs() / place.focal_px;
        if below < -foot_px || tangent <= 1e-5 {
            continue;
        }
        let distance = place.eye_m * (1.0 / near - 1.0 / tangent);
        if distance > lobes.reach_m {
            continue;
        }
        let px_per_m = place.focal_px * near / place.eye_m;
        let code = Vec3::from(pixel.to_array().map(linear_to_srgb)).dot(LUMINANCE);
        let tone = tones.tone(tangent, code);
        let luminance = pixel.dot(LUMINANCE);
        let (added, taken) = gather(&lobes.at(lobes.place(distance)), tone, luminance, |lobe, band| {
            let centre = across + f64::from(lobe.aside_m) * px_per_m;
            let half = (f64::from(lobe.half_width_m) * px_per_m).max(HALF_WIDTH_MIN_PX);
            let edge = |x: f64| running(&sums, (x - billboard.first) / billboard.pitch, band);
            (edge(centre + half) - edge(centre - half)) * (billboard.pitch / (2.0 * half)) as f32
        });
        *pixel = *pixel * (Vec3::ONE - taken) + added;
    }
}

impl HullFoot {
    /// Pixels below the anchor of the line at a position across, the tangent under which it is seen there, and whether that is beside the
    /// hull.
    fn hull(&self, across: f64) -> (f64, f64, bool) {
        let last = self.line.len().saturating_sub(1) as f64;
        let place = (across - self.first) / self.pitch;
        let column = place.clamp(0.0, last);
        let first = column as usize;
        let at = |i: usize| self.line.get(i).or(self.line.last()).copied().unwrap_or(0.0);
        let line = at(first) + (at(first + 1) - at(first)) * column.fract();
        (line, (self.tangent + line / self.focal_px).max(1e-5), place != column)
    }
}

/// Light thrown back, and share of the pixel's own light that is taken away, at a tone, over all bands.
fn gather(
    lobes: &[ReflectionTransfer; BANDS],
    tone: f32,
    luminance: f32,
    mean: impl Fn(&ReflectionTransfer, usize) -> Vec4,
) -> (Vec3, Vec3) {
    let (mut thrown, mut taken) = ([Vec3::ZERO; 2], [Vec3::ZERO; 2]);
    for (band, lobe) in lobes.iter().enumerate() {
        let seen = mean(lobe, band);
        for (sums, of, each) in
            [(&mut thrown, lobe.thrown, seen.truncate()), (&mut taken, lobe.taken, lobe.hue * seen.w)]
        {
            sums[0] += each * of.mean;
            sums[1] += each * of.slope;
        }
    }
    // All channels change alike with the tone.
    let at_tone = |[mean, slope]: [Vec3; 2]| {
        let ratio = (slope.dot(LUMINANCE) / mean.dot(LUMINANCE).max(1e-6)).clamp(-1.0, 1.0);
        mean * (1.0 + outer_tones(tone) * ratio).max(0.0)
    };
    let sky_most = lobes.first().map_or(0.0, |l| l.sky_most);
    let of_sky = (sky_most / luminance.max(1e-6)).min(1.0);
    (at_tone(thrown), at_tone(taken).clamp(Vec3::ZERO, Vec3::ONE) * of_sky)
}

/// A running sum at a place between columns.
fn running(sums: &[[Vec4; BANDS]], place: f64, band: usize) -> Vec4 {
    let last = sums.len().saturating_sub(1);
    let place = place.clamp(0.0, last as f64);
    let first = (place as usize).min(last.saturating_sub(1));
    let at = |i: usize| sums.get(i).map_or(Vec4::ZERO, |s| s[band]);
    at(first) + (at(first + 1) - at(first)) * (place - first as f64) as f32
}
