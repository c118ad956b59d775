//! Closed lines of equal value on a grid, and fewer corners for them.

use std::collections::HashMap;

use bowwave_core::geometry::distance_squared_to_segment;
use glam::DVec2;

/// Closed lines around what is below `level`; values belong to the pixels' centres, rows from the top. Outside the picture everything is above
/// it, so that a line which leaves the picture follows its border. (Marching squares, Lorensen and Cline 1987, in two dimensions; where two
/// corners that face each other are below, they are apart.)
pub(super) fn closed_contours(values: &[f32], (width, height): (u32, u32), level: f32) -> Vec<Vec<DVec2>> {
    let (w, h) = (i64::from(width), i64::from(height));
    let value = |x: i64, y: i64| {
        let inside = (0..w).contains(&x) && (0..h).contains(&y);
        if inside {
            values.get((y * w + x) as usize).copied().unwrap_or(f32::INFINITY)
        } else {
            f32::INFINITY
        }
    };
    // A crossing is named by the corner left of or above it, and which way its edge runs.
    let mut next: HashMap<Crossing, Crossing> = HashMap::new();
    for y in -1..h {
        for x in -1..w {
            let below =
                [value(x, y), value(x + 1, y), value(x + 1, y + 1), value(x, y + 1)].map(|v| v < level);
            let sides = [(x, y, false), (x + 1, y, true), (x, y + 1, false), (x, y, true)];
            // Each corner below that follows one above, clockwise, begins a line, which ends before the next above.
            for corner in 0..4 {
                if below[corner] && !below[(corner + 3) % 4] {
                    let last = (corner..corner + 4).find(|c| !below[(c + 1) % 4]).unwrap_or(corner);
                    next.insert(sides[last % 4], sides[(corner + 3) % 4]);
                }
            }
        }
    }
    let place = |(x, y, down): Crossing| {
        let (a, b) = (value(x, y), if down { value(x, y + 1) } else { value(x + 1, y) });
        let share = match (a.is_finite(), b.is_finite()) {
            (true, true) => f64::from((level - a) / (b - a)),
            // The picture ends half a pixel from its last centre.
            _ => 0.5,
        };
        let along = if down { DVec2::Y } else { DVec2::X };
        DVec2::new(x as f64 + 0.5, y as f64 + 0.5) + along * share
    };
    let mut starts: Vec<Crossing> = next.keys().copied().collect();
    starts.sort_unstable();
    let mut contours = Vec::new();
    for start in starts {
        let mut contour = Vec::new();
        let mut at = start;
        while let Some(to) = next.remove(&at) {
            contour.push(place(at));
            at = to;
        }
        if contour.len() >= 3 {
            contours.push(contour);
        }
    }
    contours
}

/// Column and row of a corner, and whether the edge runs down from it or to the right.
type Crossing = (i64, i64, bool);

/// A closed line with fewer corners, no farther from the given one than `detail` pixels, or than it takes for `most` corners (Douglas and Peucker
/// 1973, begun between the two corners farthest apart).
pub(super) fn simplified(contour: &[DVec2], detail: f64, most: usize) -> Vec<DVec2> {
    let mut detail = detail;
    loop {
        let kept = simplified_to(contour, detail);
        if kept.len() <= most {
            return kept;
        }
        detail *= 1.25;
    }
}

fn simplified_to(contour: &[DVec2], detail: f64) -> Vec<DVec2> {
    let farthest = |from: DVec2| {
        let far = |i: &usize| contour[*i].distance_squared(from);
        (0..contour.len()).max_by(|a, b| far(a).total_cmp(&far(b))).unwrap_or(0)
    };
    let Some(begin) = contour.first().map(|first| farthest(*first)) else { return Vec::new() };
    let turned: Vec<DVec2> = contour[begin..].iter().chain(&contour[..=begin]).copied().collect();
    let middle = farthest(contour[begin]);
    let middle = (middle + contour.len() - begin) % contour.len();
    let mut keeps = vec![false; turned.len()];
    keeps[0] = true;
    keeps[middle] = true;
    let mut spans = vec![(0, middle), (middle, turned.len() - 1)];
    while let Some((from, to)) = spans.pop() {
        let off = |i: usize| distance_squared_to_segment(turned[i], turned[from], turned[to]);
        let most = (from + 1..to).max_by(|a, b| off(*a).total_cmp(&off(*b)));
        if let Some(most) = most.filter(|i| off(*i) > detail * detail) {
            keeps[most] = true;
            spans.extend([(from, most), (most, to)]);
        }
    }
    turned[..contour.len()].iter().zip(keeps).filter(|(_, keep)| *keep).map(|(p, _)| *p).collect()
}
