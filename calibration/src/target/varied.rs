//! Which of many pictures to calibrate with.

use glam::DVec2;

use crate::lens::BoardView;

/// Numbers that tell how the board lies in a picture: its middle, its extent, its slant, all in pixels.
pub(crate) fn lie(view: &BoardView) -> [f64; 5] {
    let count = view.corners.len().max(1) as f64;
    let middle = view.corners.iter().map(|c| c.pixel).sum::<DVec2>() / count;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for corner in &view.corners {
        let off = corner.pixel - middle;
        xx += off.x * off.x / count;
        xy += off.x * off.y / count;
        yy += off.y * off.y / count;
    }
    [middle.x, middle.y, xx.sqrt(), yy.sqrt(), xy.abs().sqrt().copysign(xy)]
}

/// How differently the board lies in two pictures, pixels.
pub(crate) fn apart(a: &[f64; 5], b: &[f64; 5]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
}

/// Numbers of `most` views, in order, among which every other one has a similar one: the one with most corners, then whichever differs
/// most from those taken (Gonzalez 1985). Of a recording, many pictures show the same.
pub fn varied(views: &[BoardView], most: usize) -> Vec<usize> {
    let lies: Vec<[f64; 5]> = views.iter().map(lie).collect();
    let mut taken = Vec::new();
    let mut off = vec![f64::INFINITY; views.len()];
    // Of equals the first.
    let mut next = (0..views.len()).rev().max_by_key(|i| views[*i].corners.len());
    while let Some(i) = next.filter(|i| taken.len() < most && off[*i] > 0.0) {
        taken.push(i);
        for (k, off) in off.iter_mut().enumerate() {
            *off = off.min(apart(&lies[i], &lies[k]));
        }
        next = (0..views.len()).rev().max_by(|a, b| off[*a].total_cmp(&off[*b]));
    }
    taken.sort_unstable();
    taken
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::Corner;

    #[test]
    fn repeated_pictures_are_taken_once() {
        let at = |x: f64, size: f64| BoardView {
            corners: (0..4)
                .map(|i| DVec2::new(f64::from(i % 2), f64::from(i / 2)))
                .map(|board| Corner { board, pixel: DVec2::new(x, 50.0) + board * size })
                .collect(),
        };
        let views: Vec<BoardView> = (0..90)
            .map(|i| at([10.0, 400.0, 800.0][i / 30], if i % 30 < 15 { 20.0 } else { 90.0 }))
            .collect();
        assert_eq!(varied(&views, 100), [0, 15, 30, 45, 60, 75]);
        assert_eq!(varied(&views, 3).len(), 3);
        assert_eq!(varied(&[], 3), [0; 0]);
    }
}
