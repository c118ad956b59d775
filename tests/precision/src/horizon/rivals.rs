//! Other ways to find a horizon. They know no lens, have no prediction, and always answer where there is any edge at all.

use std::f64::consts::PI;

use glam::DVec2;

/// Grey pictures by rows.
#[derive(Clone, Copy, Debug)]
pub struct GreyPicture<'a> {
    /// Luma codes.
    pub luma: &'a [u8],
    /// Width and height.
    pub size: (usize, usize),
}

/// Two points of a line, at the left and right side of the picture.
pub type LineEnds = [DVec2; 2];

/// Rolls that are tried, in degrees to either side, as the finder does.
const ROLL_MAX: i32 = 65;

impl GreyPicture<'_> {
    fn at(&self, x: usize, y: usize) -> f32 {
        self.luma.get(y * self.size.0 + x).copied().map_or(0.0, f32::from)
    }

    /// The line `x sin + y cos = distance` at the picture's sides.
    fn ends(&self, angle: f64, distance: f64) -> LineEnds {
        let at = |x: f64| DVec2::new(x, (distance - x * angle.sin()) / angle.cos());
        [at(0.0), at(self.size.0 as f64)]
    }
}

/// Edges after Canny (1986), lines after Hough (1962): the one with most edges on it.
pub fn canny_hough(grey: GreyPicture<'_>) -> Option<LineEnds> {
    let (w, h) = grey.size;
    let edges = canny(grey);
    let reach = ((w + h) as f64).ceil() as usize;
    let rolls = (2 * ROLL_MAX + 1) as usize;
    let mut votes = vec![0_u32; rolls * reach];
    for (roll, votes) in votes.chunks_exact_mut(reach).enumerate() {
        let (sin, cos) = (f64::from(roll as i32 - ROLL_MAX) * PI / 180.0).sin_cos();
        for (x, y) in &edges {
            // Bins of two pixels; the shift keeps them positive.
            let distance = *x as f64 * sin + *y as f64 * cos + w as f64;
            if let Some(vote) = votes.get_mut((distance / 2.0) as usize) {
                *vote += 1;
            }
        }
    }
    let (best, votes) = votes.iter().enumerate().max_by_key(|(_, v)| **v)?;
    let angle = f64::from((best / reach) as i32 - ROLL_MAX) * PI / 180.0;
    (*votes > 0).then(|| grey.ends(angle, (best % reach) as f64 * 2.0 + 1.0 - w as f64))
}

/// Places where the slope of the smoothed picture is largest along itself and strong, or joined to one that is.
fn canny(grey: GreyPicture<'_>) -> Vec<(usize, usize)> {
    const STRONG: f32 = 80.0;
    const WEAK: f32 = 40.0;
    let (w, h) = grey.size;
    let smooth = |x: usize, y: usize| {
        let row = |y: usize| grey.at(x - 1, y) + 2.0 * grey.at(x, y) + grey.at(x + 1, y);
        (row(y - 1) + 2.0 * row(y) + row(y + 1)) / 16.0
    };
    let mut blurred = vec![0.0_f32; w * h];
    for y in 1..h.saturating_sub(1) {
        for x in 1..w.saturating_sub(1) {
            blurred[y * w + x] = smooth(x, y);
        }
    }
    let mut slopes = vec![(0.0_f32, 0.0_f32); w * h];
    for y in 2..h.saturating_sub(2) {
        for x in 2..w.saturating_sub(2) {
            let b =
                |dx: isize, dy: isize| blurred[(y as isize + dy) as usize * w + (x as isize + dx) as usize];
            let across = b(1, -1) + 2.0 * b(1, 0) + b(1, 1) - b(-1, -1) - 2.0 * b(-1, 0) - b(-1, 1);
            let down = b(-1, 1) + 2.0 * b(0, 1) + b(1, 1) - b(-1, -1) - 2.0 * b(0, -1) - b(1, -1);
            slopes[y * w + x] = (across, down);
        }
    }
    let size = |i: usize| slopes.get(i).map_or(0.0, |s| s.0.hypot(s.1));
    let is_ridge = |i: usize| {
        let (across, down) = slopes[i];
        let step = match (across.abs() > 2.4 * down.abs(), down.abs() > 2.4 * across.abs()) {
            (true, _) => 1,
            (_, true) => w,
            _ if across * down > 0.0 => w + 1,
            _ => w - 1,
        };
        size(i) > WEAK && size(i) >= size(i - step) && size(i) > size(i + step)
    };
    let inside = (2 * w + 2)..(w * h).saturating_sub(2 * w + 2);
    let mut ridge: Vec<bool> = (0..w * h).map(|i| inside.contains(&i) && is_ridge(i)).collect();
    let mut open: Vec<usize> = inside.filter(|i| ridge[*i] && size(*i) > STRONG).collect();
    let mut edges = Vec::new();
    open.iter().for_each(|i| ridge[*i] = false);
    while let Some(i) = open.pop() {
        edges.push((i % w, i / w));
        for next in [i - w - 1, i - w, i - w + 1, i - 1, i + 1, i + w - 1, i + w, i + w + 1] {
            if ridge.get(next) == Some(&true) {
                ridge[next] = false;
                open.push(next);
            }
        }
    }
    edges
}

/// The line that divides the picture into two parts of the most different brightness (Otsu 1979), over angle and offset.
pub fn otsu(grey: GreyPicture<'_>) -> Option<LineEnds> {
    const FIELD: usize = 8;
    let (columns, rows) = (grey.size.0 / FIELD, grey.size.1 / FIELD);
    let mean = |c: usize, r: usize| {
        let sum: f32 =
            (0..FIELD * FIELD).map(|i| grey.at(c * FIELD + i % FIELD, r * FIELD + i / FIELD)).sum();
        f64::from(sum) / (FIELD * FIELD) as f64
    };
    let fields: Vec<(f64, f64, f64)> = (0..columns * rows)
        .map(|i| ((i % columns) as f64 + 0.5, (i / columns) as f64 + 0.5, mean(i % columns, i / columns)))
        .collect();
    let total: f64 = fields.iter().map(|f| f.2).sum();
    let mut best: Option<(f64, f64, f64)> = None;
    for roll in -ROLL_MAX..=ROLL_MAX {
        let angle = f64::from(roll) * PI / 180.0;
        let (sin, cos) = angle.sin_cos();
        let mut bins = vec![(0.0, 0.0); 2 * columns + rows];
        for (x, y, code) in &fields {
            if let Some((sum, count)) = bins.get_mut((x * sin + y * cos + columns as f64) as usize) {
                *sum += code;
                *count += 1.0;
            }
        }
        let (mut sum, mut count) = (0.0, 0.0);
        for (bin, (s, n)) in bins.iter().enumerate() {
            sum += s;
            count += n;
            let rest = fields.len() as f64 - count;
            if count < 1.0 || rest < 1.0 {
                continue;
            }
            let difference = sum / count - (total - sum) / rest;
            let variance = difference * difference * count * rest;
            if best.is_none_or(|b| b.0 < variance) {
                best = Some((variance, angle, (bin + 1) as f64 - columns as f64));
            }
        }
    }
    let (_, angle, distance) = best?;
    Some(grey.ends(angle, distance * FIELD as f64))
}

/// The strongest step of each column of eight pixels, and the line through two of them that most agree with; least squares of
/// these.
pub fn column_steps(grey: GreyPicture<'_>) -> Option<LineEnds> {
    const FIELD: usize = 8;
    const ROWS: usize = 8;
    let (w, h) = grey.size;
    let points: Vec<DVec2> = (0..w / FIELD)
        .filter_map(|column| {
            let row = |y: usize| (0..FIELD).map(|x| grey.at(column * FIELD + x, y)).sum::<f32>();
            let mut sums = vec![0.0];
            (0..h).for_each(|y| sums.push(sums[y] + row(y)));
            let step = |y: usize| (sums[y + ROWS] - 2.0 * sums[y] + sums[y - ROWS]).abs();
            let best = (ROWS..(h + 1).saturating_sub(ROWS)).max_by(|a, b| step(*a).total_cmp(&step(*b)))?;
            Some(DVec2::new((column * FIELD) as f64 + 4.0, best as f64))
        })
        .collect();
    let near =
        |a: DVec2, b: DVec2, p: &&DVec2| (a.y + (b.y - a.y) * (p.x - a.x) / (b.x - a.x) - p.y).abs() < 3.0;
    let pairs =
        points.iter().enumerate().flat_map(|(i, a)| points.iter().skip(i + 8).step_by(5).map(|b| (*a, *b)));
    let (a, b) = pairs.max_by_key(|(a, b)| points.iter().filter(|p| near(*a, *b, p)).count())?;
    let on: Vec<&DVec2> = points.iter().filter(|p| near(a, b, p)).collect();
    let n = on.len() as f64;
    let mean = on.iter().copied().sum::<DVec2>() / n;
    let (xx, xy) = on.iter().fold((0.0, 0.0), |(xx, xy), p| {
        let d = **p - mean;
        (xx + d.x * d.x, xy + d.x * d.y)
    });
    let at = |x: f64| DVec2::new(x, mean.y + xy / xx * (x - mean.x));
    (xx > 0.0).then(|| [at(0.0), at(w as f64)])
}
