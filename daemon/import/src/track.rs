//! Patches followed through pictures (Lucas and Kanade 1981, translation only, in two resolutions).

use glam::DVec2;
use image::{ImageFormat, ImageResult};

/// Half the side of a patch, pixels.
const RADIUS: i32 = 24;
/// Distance between the points of a patch that are compared, pixels; the picture is smoothed to about as much.
const SPACING: usize = 2;
/// Pictures after which a patch is taken anew: clouds change their shape within seconds.
const RENEW: usize = 30;
/// A patch that looks less like itself than this is lost (correlation coefficient).
const LIKENESS_MIN: f64 = 0.8;
/// A step farther than this leads away from the patch, pixels.
const STEP_MAX_PX: f64 = 20.0;
/// How much smaller the coarse picture is.
const COARSE: usize = 4;

/// A grey picture.
#[derive(Clone)]
pub struct Gray {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Gray {
    /// Decodes a JPEG and smooths it a little against its blocks.
    pub fn from_jpeg(jpeg: &[u8]) -> ImageResult<Self> {
        let picture = image::load_from_memory_with_format(jpeg, ImageFormat::Jpeg)?.to_luma32f();
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let mut gray = Self { width, height, values: picture.into_raw() };
        for _ in 0..2 {
            gray = gray.smoothed();
        }
        Ok(gray)
    }

    /// Width in pixels.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// The pixel, or the nearest one at the edge.
    fn get(&self, x: usize, y: usize) -> f32 {
        self.values[y.min(self.height - 1) * self.width + x.min(self.width - 1)]
    }

    /// Weighted 1, 2, 1 across and down.
    fn smoothed(&self) -> Self {
        let mut across = Vec::with_capacity(self.values.len());
        for line in self.values.chunks_exact(self.width) {
            let (first, last) = (line.first().copied().unwrap_or(0.0), line.last().copied().unwrap_or(0.0));
            let left = std::iter::once(first).chain(line.iter().copied());
            let right = line.iter().copied().skip(1).chain(std::iter::once(last));
            across.extend(left.zip(line).zip(right).map(|((a, b), c)| (a + 2.0 * b + c) / 4.0));
        }
        let line = |y: usize| across.get(y * self.width..(y + 1) * self.width).unwrap_or(&[]);
        let mut values = Vec::with_capacity(across.len());
        for y in 0..self.height {
            let (above, below) = (line(y.saturating_sub(1)), line((y + 1).min(self.height - 1)));
            values.extend(above.iter().zip(line(y)).zip(below).map(|((a, b), c)| (a + 2.0 * b + c) / 4.0));
        }
        Self { values, ..*self }
    }

    fn reduced(&self) -> Self {
        let (width, height) = (self.width / COARSE, self.height / COARSE);
        let mean = |x: usize, y: usize| {
            let cells =
                (0..COARSE * COARSE).map(|i| self.get(x * COARSE + i % COARSE, y * COARSE + i / COARSE));
            cells.sum::<f32>() / (COARSE * COARSE) as f32
        };
        let values = (0..width * height).map(|i| mean(i % width, i / width)).collect();
        Self { width, height, values }
    }

    /// The points of a patch about `at`, bilinear; the centre of the first pixel is (0.5, 0.5). `None` where it is not whole.
    fn patch(&self, at: DVec2, radius: i32) -> Option<Vec<f64>> {
        let corner = at - DVec2::splat(0.5 + f64::from(radius));
        let side = 2 * usize::try_from(radius).ok()? + 1;
        if !(corner.x >= 0.0 && corner.y >= 0.0) {
            return None;
        }
        let (x, y) = (corner.x as usize, corner.y as usize);
        if x + side >= self.width || y + side >= self.height {
            return None;
        }
        // All points lie equally far between their pixels.
        let (u, v) = (corner.x.fract() as f32, corner.y.fract() as f32);
        let mut points = Vec::with_capacity((side / SPACING + 1).pow(2));
        for row in (0..side).step_by(SPACING) {
            let start = (y + row) * self.width + x;
            let upper = self.values.get(start..=start + side)?;
            let lower = self.values.get(start + self.width..=start + self.width + side)?;
            let between = |line: &[f32]| match line {
                [a, b] => a * (1.0 - u) + b * u,
                _ => 0.0,
            };
            let pairs = upper.windows(2).zip(lower.windows(2)).step_by(SPACING);
            points.extend(pairs.map(|(a, b)| f64::from(between(a) * (1.0 - v) + between(b) * v)));
        }
        Some(points)
    }
}

/// A patch as it looked, with its slopes.
#[derive(Clone)]
struct Template {
    radius: i32,
    values: Vec<f64>,
    slopes: Vec<DVec2>,
    /// Sums of squared and mixed slopes.
    normal: [f64; 3],
}

impl Template {
    fn take(picture: &Gray, at: DVec2, radius: i32) -> Option<Self> {
        let values = without_mean(picture.patch(at, radius)?);
        let slope = |step: DVec2| -> Option<Vec<f64>> {
            let (a, b) = (picture.patch(at + step, radius)?, picture.patch(at - step, radius)?);
            Some(a.iter().zip(&b).map(|(a, b)| (a - b) / 2.0).collect())
        };
        let slopes: Vec<DVec2> =
            slope(DVec2::X)?.into_iter().zip(slope(DVec2::Y)?).map(|(x, y)| DVec2::new(x, y)).collect();
        let normal =
            slopes.iter().fold([0.0; 3], |[xx, xy, yy], s| [xx + s.x * s.x, xy + s.x * s.y, yy + s.y * s.y]);
        Some(Self { radius, values, slopes, normal })
    }

    /// The weaker direction's texture.
    fn texture(&self) -> f64 {
        let [xx, xy, yy] = self.normal;
        (xx + yy) / 2.0 - ((xx - yy).powi(2) / 4.0 + xy * xy).sqrt()
    }

    /// Where the patch lies in `picture`, near `guess`, and how much it looks like itself there.
    fn find(&self, picture: &Gray, guess: DVec2) -> Option<(DVec2, f64)> {
        let [xx, xy, yy] = self.normal;
        let determinant = xx * yy - xy * xy;
        let mut at = guess;
        for _ in 0..30 {
            let found = without_mean(picture.patch(at, self.radius)?);
            let pull = self
                .slopes
                .iter()
                .zip(self.values.iter().zip(&found))
                .map(|(slope, (then, now))| *slope * (then - now))
                .sum::<DVec2>();
            let step = DVec2::new(yy * pull.x - xy * pull.y, xx * pull.y - xy * pull.x) / determinant;
            at += step;
            if !step.is_finite() || step.length() >= STEP_MAX_PX {
                return None;
            }
            if step.length() < 0.005 {
                let found = without_mean(picture.patch(at, self.radius)?);
                return Some((at, likeness(&self.values, &found)));
            }
        }
        None
    }
}

fn without_mean(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter_mut().for_each(|v| *v -= mean);
    values
}

fn likeness(a: &[f64], b: &[f64]) -> f64 {
    let dot = |p: &[f64], q: &[f64]| p.iter().zip(q).map(|(p, q)| p * q).sum::<f64>();
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
}

struct Patch {
    place: DVec2,
    last_step: DVec2,
    fine: Template,
    coarse: Template,
}

/// Follows patches from picture to picture.
pub struct Tracker {
    patches: Vec<Option<Patch>>,
    age: usize,
}

impl Tracker {
    /// Chooses patches of `first` on a grid above `row_max`: the half with the most texture.
    pub fn start(first: &Gray, row_max: usize) -> Self {
        let small = first.reduced();
        let margin = RADIUS as usize + 4;
        let step = RADIUS as usize;
        let mut found: Vec<Patch> = (margin..row_max.saturating_sub(margin))
            .step_by(step)
            .flat_map(|y| (margin..first.width.saturating_sub(margin)).step_by(step).map(move |x| (x, y)))
            .filter_map(|(x, y)| take(first, &small, DVec2::new(x as f64, y as f64)))
            .collect();
        found.sort_by(|a, b| b.fine.texture().total_cmp(&a.fine.texture()));
        found.truncate(found.len() / 2);
        Self { patches: found.into_iter().map(Some).collect(), age: 0 }
    }

    /// Where the patches are.
    pub fn places(&self) -> Vec<Option<DVec2>> {
        self.patches.iter().map(|p| p.as_ref().map(|p| p.place)).collect()
    }

    /// Finds the patches in the next picture.
    pub fn next(&mut self, picture: &Gray) -> Vec<Option<DVec2>> {
        let small = picture.reduced();
        self.age += 1;
        let renew = self.age.is_multiple_of(RENEW);
        for slot in &mut self.patches {
            *slot = slot.take().and_then(|patch| follow(patch, picture, &small, renew));
        }
        self.places()
    }
}

fn take(picture: &Gray, small: &Gray, place: DVec2) -> Option<Patch> {
    let fine = Template::take(picture, place, RADIUS)?;
    let coarse = Template::take(small, place / COARSE as f64, RADIUS / COARSE as i32 + 2)?;
    Some(Patch { place, last_step: DVec2::ZERO, fine, coarse })
}

fn follow(patch: Patch, picture: &Gray, small: &Gray, renew: bool) -> Option<Patch> {
    let guess = patch.place + patch.last_step;
    let coarse = patch.coarse.find(small, guess / COARSE as f64).map_or(guess, |(at, _)| at * COARSE as f64);
    let (place, likeness) = patch.fine.find(picture, coarse)?;
    if likeness < LIKENESS_MIN {
        return None;
    }
    let last_step = place - patch.place;
    if renew {
        return take(picture, small, place).map(|fresh| Patch { last_step, ..fresh });
    }
    Some(Patch { place, last_step, ..patch })
}

#[cfg(test)]
mod tests {
    use super::{Gray, Tracker};
    use glam::DVec2;

    /// A cloudy picture seen from a place.
    fn picture(from: DVec2) -> Gray {
        let (width, height) = (300, 200);
        let cloud = |x: f64, y: f64| {
            (x / 17.0).sin() * (y / 23.0).cos()
                + (x / 9.0 + y / 13.0).sin() * 0.5
                + (y / 11.0 - x / 31.0).cos() * 0.7
        };
        let values = (0..width * height)
            .map(|i| (f64::from(i % width), f64::from(i / width)))
            .map(|(x, y)| (0.5 + 0.05 * cloud(x + from.x, y + from.y)) as f32)
            .collect();
        Gray { width: width as usize, height: height as usize, values }
    }

    #[test]
    fn patches_are_followed_to_a_twentieth_of_a_pixel() {
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
        for moved in followed {
            assert!(moved.distance(from) < 0.05, "{moved} {from}");
        }
    }

    #[test]
    fn what_is_gone_is_lost() {
        let mut tracker = Tracker::start(&picture(DVec2::ZERO), 150);
        let mut seed = 1_u32;
        let mut noise = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / (1 << 24) as f32
        };
        let other = Gray { values: (0..60_000).map(|_| noise()).collect(), width: 300, height: 200 };
        let left = tracker.next(&other).into_iter().flatten().count();
        assert_eq!(left, 0, "of {}", tracker.places().len());
        // An even picture has nothing to follow, and none of it is found again.
        let even = Gray { width: 300, height: 200, values: vec![0.5; 60_000] };
        assert_eq!(Tracker::start(&even, 150).next(&even).into_iter().flatten().count(), 0);
    }

    #[test]
    fn small_pictures_have_no_patches() {
        let tiny = Gray { width: 20, height: 10, values: vec![0.5; 200] };
        assert!(Tracker::start(&tiny, 10).places().is_empty());
    }
}
