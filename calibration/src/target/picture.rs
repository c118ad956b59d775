//! Grey pictures, smoothed and reduced.

use glam::DVec2;

/// A grey picture: codes row by row, the upper left pixel first.
#[derive(Clone, Copy, Debug)]
pub struct Grey<'a> {
    width: usize,
    height: usize,
    codes: &'a [u8],
}

impl<'a> Grey<'a> {
    /// The longest side that is looked at, pixels.
    pub const SIDE_MAX: usize = 8192;

    /// `None` where the codes are not as many as the pixels, or a side is longer than [`Grey::SIDE_MAX`].
    pub fn new(width: usize, height: usize, codes: &'a [u8]) -> Option<Self> {
        let sound = width.max(height) <= Self::SIDE_MAX && width * height == codes.len();
        sound.then_some(Self { width, height, codes })
    }

    /// Width and height, pixels.
    pub const fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }
}

/// A picture that can be asked between its pixels. The centre of the first pixel is (0.5, 0.5).
#[derive(Clone, Debug)]
pub(crate) struct Plane {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f32>,
}

impl Plane {
    /// The picture smoothed by weights 1, 2, 1 across and down: a deviation of 0.7 pixels, against noise and JPEG's steps.
    pub fn smoothed(picture: &Grey) -> Self {
        let values = picture.codes.iter().map(|c| f32::from(*c)).collect();
        Self { width: picture.width, height: picture.height, values }.smooth()
    }

    fn smooth(mut self) -> Self {
        let (w, h) = (self.width, self.height);
        if w < 3 || h < 3 {
            return self;
        }
        for row in self.values.chunks_exact_mut(w) {
            let mut before = row[0];
            for x in 0..w {
                let after = row[(x + 1).min(w - 1)];
                let here = row[x];
                row[x] = 0.25 * (before + 2.0 * here + after);
                before = here;
            }
        }
        let mut above: Vec<f32> = self.values[..w].to_vec();
        for y in 0..h {
            let (head, tail) = self.values.split_at_mut((y + 1) * w);
            let row = &mut head[y * w..];
            let below = tail.get(..w);
            for (x, (value, above)) in row.iter_mut().zip(&mut above).enumerate() {
                let here = *value;
                *value = 0.25 * (*above + 2.0 * here + below.map_or(here, |b| b[x]));
                *above = here;
            }
        }
        self
    }

    /// Half as large, smoothed again.
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut values = Vec::with_capacity(width * height);
        for y in 0..height {
            let (upper, lower) = self.values[2 * y * self.width..].split_at(self.width);
            let pairs = upper.chunks_exact(2).zip(lower[..self.width].chunks_exact(2));
            values.extend(pairs.take(width).map(|(a, b)| 0.25 * (a[0] + a[1] + b[0] + b[1])));
        }
        Self { width, height, values }.smooth()
    }

    /// Whether there are `reach` pixels to every side of a place.
    pub fn surrounds(&self, place: DVec2, reach: f64) -> bool {
        let end = DVec2::new(self.width as f64, self.height as f64) - reach;
        place.cmpge(DVec2::splat(reach)).all() && place.cmple(end).all()
    }

    /// The value at a place, between four pixels; beyond the edge that of the edge. A place that is no number has the first pixel's.
    pub fn at(&self, place: DVec2) -> f64 {
        let along = |v: f64, count: usize| {
            let v = (v - 0.5).clamp(0.0, count.saturating_sub(1) as f64);
            let first = (v as usize).min(count.saturating_sub(2));
            (first, v - first as f64)
        };
        let ((x, a), (y, b)) = (along(place.x, self.width), along(place.y, self.height));
        let get = |x: usize, y: usize| {
            f64::from(self.values[y.min(self.height - 1) * self.width + x.min(self.width - 1)])
        };
        let row = |y: usize| get(x, y) * (1.0 - a) + get(x + 1, y) * a;
        row(y) * (1.0 - b) + row(y + 1) * b
    }
}
