//! Polygons as pixels.

/// A set of pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutlineMask {
    /// Width and height.
    pub size: (u32, u32),
    inside: Vec<bool>,
}

/// Samples along each side of a pixel.
const SAMPLES: u32 = 4;

/// Share of pixel (`x`, `y`) that any of the polygons covers (even-odd within each).
pub fn coverage(polygons: &[Vec<[f64; 2]>], x: u32, y: u32) -> f32 {
    let [x0, y0, x1, y1] = [x, y, x + 1, y + 1].map(f64::from);
    let near: Vec<&Vec<[f64; 2]>> = polygons
        .iter()
        .filter(|polygon| {
            let [left, top, right, bottom] = bounds([*polygon]);
            left < x1 && right > x0 && top < y1 && bottom > y0
        })
        .collect();
    let mut hits = 0;
    for i in 0..SAMPLES * SAMPLES {
        let sub = |k: u32| (f64::from(k) + 0.5) / f64::from(SAMPLES);
        let p = [x0 + sub(i % SAMPLES), y0 + sub(i / SAMPLES)];
        hits += u32::from(near.iter().any(|polygon| contains(polygon, p)));
    }
    hits as f32 / (SAMPLES * SAMPLES) as f32
}

/// Whether a point lies within a polygon.
pub fn contains(polygon: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let mut inside = false;
    for (i, &[bx, by]) in polygon.iter().enumerate() {
        let [ax, ay] = polygon[(i + polygon.len() - 1) % polygon.len()];
        if (ay > y) != (by > y) && x < ax + (bx - ax) * (y - ay) / (by - ay) {
            inside = !inside;
        }
    }
    inside
}

/// Least and greatest coordinates of all corners.
pub fn bounds<'a>(polygons: impl IntoIterator<Item = &'a Vec<[f64; 2]>>) -> [f64; 4] {
    polygons
        .into_iter()
        .flatten()
        .fold([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY], |b, p| {
            [b[0].min(p[0]), b[1].min(p[1]), b[2].max(p[0]), b[3].max(p[1])]
        })
}

impl OutlineMask {
    /// The pixels of a picture of `size` whose middle lies in the polygon.
    pub fn of_polygon(size: (u32, u32), polygon: &[[f64; 2]]) -> Self {
        let inside = (0..size.1)
            .flat_map(|y| (0..size.0).map(move |x| (x, y)))
            .map(|(x, y)| contains(polygon, [f64::from(x) + 0.5, f64::from(y) + 0.5]))
            .collect();
        Self { size, inside }
    }

    /// With the pixels of further polygons.
    #[must_use]
    pub fn and(mut self, polygons: &[Vec<[f64; 2]>]) -> Self {
        for polygon in polygons {
            let more = Self::of_polygon(self.size, polygon);
            self.inside.iter_mut().zip(more.inside).for_each(|(a, b)| *a |= b);
        }
        self
    }

    /// Whether a pixel belongs to it; none outside the picture does.
    pub fn has(&self, x: u32, y: u32) -> bool {
        x < self.size.0 && y < self.size.1 && self.inside[(y * self.size.0 + x) as usize]
    }

    /// How many pixels it has.
    pub fn count(&self) -> usize {
        self.inside.iter().filter(|i| **i).count()
    }

    /// First and last column of a row, where it has any.
    pub fn span(&self, y: u32) -> Option<(u32, u32)> {
        let first = (0..self.size.0).find(|&x| self.has(x, y))?;
        let last = (0..self.size.0).rev().find(|&x| self.has(x, y))?;
        Some((first, last))
    }

    /// Least and greatest column and row; `None` where it is empty.
    pub fn bounds(&self) -> Option<[u32; 4]> {
        let rows: Vec<(u32, (u32, u32))> =
            (0..self.size.1).filter_map(|y| self.span(y).map(|s| (y, s))).collect();
        let first = rows.first()?.0;
        let last = rows.last()?.0;
        let left = rows.iter().map(|r| r.1.0).min()?;
        let right = rows.iter().map(|r| r.1.1).max()?;
        Some([left, first, right, last])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_has_half_of_its_box() {
        let triangle = vec![[0.0, 0.0], [40.0, 0.0], [0.0, 40.0]];
        let mask = OutlineMask::of_polygon((50, 50), &triangle);
        assert!((mask.count() as f64 - 800.0).abs() <= 20.0, "{}", mask.count());
        // Pixels whose centres lie on the edge do not belong to it.
        assert_eq!(mask.bounds(), Some([0, 0, 38, 38]));
        assert_eq!(mask.span(49), None);
        assert!(mask.has(1, 1) && !mask.has(39, 39) && !mask.has(60, 1));
        // The slanting edge covers half of the pixels that it cuts through.
        let edge: f32 =
            (0..40).map(|i| coverage(std::slice::from_ref(&triangle), i, 39 - i)).sum::<f32>() / 40.0;
        assert!((edge - 0.5).abs() < 0.15, "{edge}");
    }
}
