//! Points worth following: those whose patch is known by more than an edge (Shi & Tomasi 1994).

use glam::DVec2;

use super::{
    grid::FIELD,
    pyramid::{GreyPyramid, PyramidLevel},
};

/// Half the side of the window that a point is judged by, pixels of the second level: as much as a patch's on the finest.
const WINDOW: usize = 3;
/// Mean square of the slopes in the weaker direction that a point has at least, in what noise makes.
const TEXTURE_MIN: f32 = 1.5;
/// Pixels of the second level in a field, and with the windows that hang over it.
const SIDE: usize = FIELD / 2;
const WIDE: usize = SIDE + 2 * WINDOW;

/// The best point of the field with this corner (pixels of the finest level), found on the second; a place of the finest level. `usable`
/// says which places may be taken.
pub(super) fn best(
    pyramid: &GreyPyramid,
    corner: (usize, usize),
    usable: impl Fn(DVec2) -> bool,
) -> Option<DVec2> {
    let level = &pyramid.levels[1];
    // Half of the noise is left on the second level, and half of its square in a slope.
    let least = TEXTURE_MIN * 0.5 * (0.5 * pyramid.noise).powi(2);
    let mut products = [[0.0f32; 3]; WIDE * WIDE];
    for (i, product) in products.iter_mut().enumerate() {
        let (x, y) = (corner.0 / 2 + i % WIDE, corner.1 / 2 + i / WIDE);
        *product = slopes(level, x, y).unwrap_or_default();
    }
    let mut best: Option<(f32, DVec2)> = None;
    // Every other place is enough: a window is seven pixels wide.
    for i in 0..(SIDE / 2) * (SIDE / 2) {
        let (x, y) = (2 * (i % (SIDE / 2)), 2 * (i / (SIDE / 2)));
        let mut sum = [0.0f32; 3];
        for row in products.chunks_exact(WIDE).skip(y).take(2 * WINDOW + 1) {
            for product in row.iter().skip(x).take(2 * WINDOW + 1) {
                sum = [sum[0] + product[0], sum[1] + product[1], sum[2] + product[2]];
            }
        }
        let texture = weaker(sum) / ((2 * WINDOW + 1) * (2 * WINDOW + 1)) as f32;
        if texture > least && best.is_none_or(|(most, _)| texture > most) {
            let place = DVec2::new((corner.0 + 2 * x) as f64, (corner.1 + 2 * y) as f64) + 0.5;
            if usable(place) {
                best = Some((texture, place));
            }
        }
    }
    best.map(|(_, place)| place)
}

/// Squared and mixed slopes about the pixel that lies `WINDOW` to the left of and above (x, y), so that fields at the edge need no sign.
fn slopes(level: &PyramidLevel, x: usize, y: usize) -> Option<[f32; 3]> {
    let (x, y) = (x.checked_sub(WINDOW)?, y.checked_sub(WINDOW)?);
    let across = level.code(x + 1, y)? - level.code(x.checked_sub(1)?, y)?;
    let down = level.code(x, y + 1)? - level.code(x, y.checked_sub(1)?)?;
    Some([0.25 * across * across, 0.25 * across * down, 0.25 * down * down])
}

/// The smaller eigenvalue.
fn weaker([xx, xy, yy]: [f32; 3]) -> f32 {
    0.5 * (xx + yy) - (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt()
}
