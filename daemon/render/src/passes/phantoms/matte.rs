//! Phantoms on the grid of pixels.

use bowwave_core::{
    estimate::recoil::FACTOR_MAX,
    frame::scene::PixelRect,
    own_ship::{Phantom, Phantoms},
};
use glam::DVec2;

use crate::rects::cut;

/// Width of an edge in the picture of a camera in focus, pixels of a screen that is [`PICTURE_HEIGHT`] pixels high: lens, colour filter and
/// compression spread a sharp edge that far.
const SOFT_PX: f64 = 1.5;
const PICTURE_HEIGHT: f64 = 720.0;
/// Distances go so many widths of an edge either way, as in `phantom.frag`.
const REACH: f64 = 2.0;
/// Most steps of a recoil that are laid out.
const STEPS_MOST: f64 = 64.0;
/// Side of the squares that are looked at or left out, pixels.
const CELL: u32 = 16;

/// Where phantoms are.
pub(super) struct Matte {
    /// Around all of them, on the screen.
    pub area: PixelRect,
    /// Width of an edge, pixels.
    pub soft_px: f32,
    /// Two bytes for each pixel of `area`: the distance to the nearest edge of what stays, and of what recoils as it rests; 0 inside by
    /// [`REACH`] widths or more, 255 outside by as much.
    pub distances: Vec<[u8; 2]>,
    /// Pixels that can be theirs in part or whole, each once, and those around that their colour may come from.
    pub rects: Vec<PixelRect>,
}

impl Matte {
    /// The pixels of `phantoms` on a screen of `size`; `None` where there are none.
    pub fn new(phantoms: &Phantoms, size: (u32, u32)) -> Option<Self> {
        let soft = SOFT_PX * f64::from(size.1) / PICTURE_HEIGHT;
        let reach = REACH * soft;
        let swept: Vec<Phantom> =
            phantoms.parts.iter().flat_map(|part| swept(part, phantoms.bore, soft)).collect();
        let bounds = swept.iter().map(Phantom::bounds);
        let [low, high] = bounds.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])?;
        let (low, high) = ((low - reach).max(DVec2::ZERO), high + reach);
        // An outline off the screen, or with a NaN, leaves nothing.
        if !(high.cmpgt(low).all() && high.is_finite()) {
            return None;
        }
        let (x, y) = (low.x as u32 / CELL * CELL, low.y as u32 / CELL * CELL);
        let (width, height) = ((high.x as u32 + 1).saturating_sub(x), (high.y as u32 + 1).saturating_sub(y));
        let area = cut(PixelRect { x, y, width, height }, size)?;
        let mut distances = vec![[u8::MAX; 2]; (area.width * area.height) as usize];
        for part in phantoms.parts.iter() {
            lay(part, area, soft, |i, code| {
                distances[i][usize::from(part.recoils)] = distances[i][usize::from(part.recoils)].min(code);
            });
        }
        let mut held = vec![false; distances.len()];
        for part in &swept {
            lay(part, area, soft, |i, code| held[i] |= code < u8::MAX);
        }
        let rects = rows_of_cells(&held, area);
        (!rects.is_empty()).then_some(Self { area, soft_px: soft as f32, distances, rects })
    }
}

/// A phantom wherever it can be: at rest, and recoiled by steps that leave nothing out.
fn swept(part: &Phantom, bore: DVec2, soft: f64) -> Vec<Phantom> {
    let farthest = part.outline().iter().map(|p| p.distance(bore)).fold(0.0, f64::max);
    let steps =
        if part.recoils { ((FACTOR_MAX - 1.0) * farthest / soft).ceil().min(STEPS_MOST) } else { 0.0 };
    let factor = |i: u32| 1.0 + f64::from(i) * (FACTOR_MAX - 1.0) / steps.max(1.0);
    (0..=steps as u32).map(|i| part.recoiled(bore, factor(i))).collect()
}

/// Hands over the number of each pixel of `area` near a phantom, and its distance as a code.
fn lay(phantom: &Phantom, area: PixelRect, soft: f64, mut put: impl FnMut(usize, u8)) {
    let reach = REACH * soft;
    let [low, high] = phantom.bounds();
    let within = |low: f64, high: f64, first: u32, count: u32| {
        let begin = (low - reach - f64::from(first)).max(0.0) as u32;
        begin..((high + reach - f64::from(first)).max(0.0) as u32 + 1).min(count)
    };
    for y in within(low.y, high.y, area.y, area.height) {
        for x in within(low.x, high.x, area.x, area.width) {
            let at = DVec2::new(f64::from(area.x + x) + 0.5, f64::from(area.y + y) + 0.5);
            let widths = phantom.distance(at) / soft;
            let code = ((widths / REACH).clamp(-1.0, 1.0) + 1.0) * 127.5;
            put((y * area.width + x) as usize, code.round() as u8);
        }
    }
}

/// Cells that hold something of a phantom, those of a row joined.
fn rows_of_cells(held: &[bool], area: PixelRect) -> Vec<PixelRect> {
    let columns = area.width.div_ceil(CELL);
    let mut rects: Vec<PixelRect> = Vec::new();
    for top in (0..area.height).step_by(CELL as usize) {
        let height = CELL.min(area.height - top);
        for column in 0..columns {
            let left = column * CELL;
            let width = CELL.min(area.width - left);
            let holds = (top..top + height).any(|y| {
                let first = (y * area.width + left) as usize;
                held.get(first..first + width as usize).is_some_and(|row| row.contains(&true))
            });
            if !holds {
                continue;
            }
            let cell = PixelRect { x: area.x + left, y: area.y + top, width, height };
            match rects.last_mut() {
                Some(last) if last.y == cell.y && last.x + last.width == cell.x => last.width += width,
                _ => rects.push(cell),
            }
        }
    }
    rects
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_that_a_phantom_touches_is_in_one_rectangle() {
        let size = (320, 180);
        let corners = |list: &[[f64; 2]]| list.iter().map(|c| DVec2::from_array(*c)).collect::<Vec<_>>();
        let phantoms = [
            Phantom::new(
                "barrel",
                corners(&[[150.0, 120.0], [170.0, 120.0], [190.0, 180.0], [130.0, 180.0]]),
                size,
            ),
            Phantom::new("rail", corners(&[[-20.0, 30.0], [40.0, 34.0], [40.0, 37.0], [-20.0, 33.0]]), size),
        ];
        let all = Phantoms { parts: phantoms.clone().into(), bore: DVec2::new(160.0, 90.0) };
        let matte = Matte::new(&all, size).unwrap();
        for y in 0..size.1 {
            for x in 0..size.0 {
                let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let distance = phantoms.iter().map(|p| p.distance(at)).fold(f64::INFINITY, f64::min);
                let holds =
                    |q: &PixelRect| (q.x..q.x + q.width).contains(&x) && (q.y..q.y + q.height).contains(&y);
                let held = matte.rects.iter().filter(|r| holds(r)).count();
                assert!(held == 1 || held == 0 && distance > 0.5 * f64::from(matte.soft_px), "pixel {x} {y}");
                if held == 1 {
                    let row = (y - matte.area.y) * matte.area.width;
                    let codes = matte.distances[(row + x - matte.area.x) as usize];
                    let code = f64::from(codes[0].min(codes[1]));
                    let widths = (code / 127.5 - 1.0) * REACH;
                    let wanted = (distance / f64::from(matte.soft_px)).clamp(-REACH, REACH);
                    assert!((widths - wanted).abs() < 0.01, "pixel {x} {y}: {widths} {wanted}");
                }
            }
        }
    }

    #[test]
    fn what_is_not_on_the_screen_is_left_out() {
        let beside = |x: f64| vec![DVec2::new(x, 0.0), DVec2::new(x + 9.0, 0.0), DVec2::new(x, 9.0)];
        for x in [-500.0, 900.0, f64::NAN, f64::INFINITY] {
            let part = Phantom::new("", beside(x), (320, 180)).recoiling(true);
            let phantoms = Phantoms { parts: [part].into(), bore: DVec2::ZERO };
            assert!(Matte::new(&phantoms, (320, 180)).is_none(), "{x}");
        }
        assert!(Matte::new(&Phantoms::default(), (320, 180)).is_none());
    }
}
