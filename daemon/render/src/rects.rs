//! Rectangles of the screen.

use ash::vk;
use bowwave_core::frame::scene::PixelRect;

/// A rectangle as Vulkan has it.
pub(crate) fn rect(r: PixelRect) -> vk::Rect2D {
    vk::Rect2D {
        offset: vk::Offset2D { x: i32::try_from(r.x).unwrap_or(0), y: i32::try_from(r.y).unwrap_or(0) },
        extent: vk::Extent2D { width: r.width, height: r.height },
    }
}

/// The corners x0, y0, x1, y1 of a rectangle.
pub(crate) fn corners(r: PixelRect) -> [f32; 4] {
    [r.x as f32, r.y as f32, (r.x + r.width) as f32, (r.y + r.height) as f32]
}

/// `r` cut to a screen of `size`; `None` where nothing is left. What a scene says is not trusted to lie on the screen.
pub(crate) fn cut(r: PixelRect, size: (u32, u32)) -> Option<PixelRect> {
    let right = r.x.saturating_add(r.width).min(size.0);
    let lower = r.y.saturating_add(r.height).min(size.1);
    (r.x < right && r.y < lower).then(|| PixelRect {
        x: r.x,
        y: r.y,
        width: right - r.x,
        height: lower - r.y,
    })
}

/// The parts of `whole` that none of `cutters` covers. `rest` keeps its memory.
pub(crate) fn around_all(whole: PixelRect, cutters: &[PixelRect], rest: &mut Vec<PixelRect>) {
    rest.clear();
    rest.push(whole);
    for cutter in cutters {
        cut_from(*cutter, rest);
    }
}

/// Takes `cutter` out of the pieces.
fn cut_from(cutter: PixelRect, pieces: &mut Vec<PixelRect>) {
    let mut i = 0;
    while i < pieces.len() {
        if overlap(pieces[i], cutter).is_none() {
            i += 1;
        } else {
            let whole = pieces.swap_remove(i);
            pieces.extend(around(whole, cutter).into_iter().flatten());
        }
    }
}

/// The pixels that both hold.
pub(crate) fn overlap(a: PixelRect, b: PixelRect) -> Option<PixelRect> {
    let (x, y) = (a.x.max(b.x), a.y.max(b.y));
    let (right, lower) = ((a.x + a.width).min(b.x + b.width), (a.y + a.height).min(b.y + b.height));
    (x < right && y < lower).then(|| PixelRect { x, y, width: right - x, height: lower - y })
}

/// The up to four parts of `a` around `b`.
fn around(a: PixelRect, b: PixelRect) -> [Option<PixelRect>; 4] {
    let Some(o) = overlap(a, b) else { return [Some(a), None, None, None] };
    let part = |x: u32, y: u32, right: u32, lower: u32| {
        (x < right && y < lower).then(|| PixelRect { x, y, width: right - x, height: lower - y })
    };
    let (right, lower) = (a.x + a.width, a.y + a.height);
    let (o_right, o_lower) = (o.x + o.width, o.y + o.height);
    [
        part(a.x, a.y, right, o.y),
        part(a.x, o_lower, right, lower),
        part(a.x, o.y, o.x, o_lower),
        part(o_right, o.y, right, o_lower),
    ]
}

/// The smallest rectangle that holds both.
pub(crate) fn joined(a: PixelRect, b: PixelRect) -> PixelRect {
    let (x, y) = (a.x.min(b.x), a.y.min(b.y));
    let (right, lower) = ((a.x + a.width).max(b.x + b.width), (a.y + a.height).max(b.y + b.height));
    PixelRect { x, y, width: right - x, height: lower - y }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn r(x: u32, y: u32, width: u32, height: u32) -> PixelRect {
        PixelRect { x, y, width, height }
    }

    #[test]
    fn rectangles_are_cut_and_joined() {
        assert_eq!(cut(r(10, 10, 20, 20), (25, 100)), Some(r(10, 10, 15, 20)));
        assert_eq!(cut(r(30, 10, 20, 20), (25, 100)), None);
        assert_eq!(cut(r(u32::MAX, 10, 20, 20), (25, 100)), None);
        let mut rest = Vec::new();
        let (whole, cutters) = (r(0, 0, 50, 40), [r(10, 5, 40, 10), r(5, 0, 10, 40), r(20, 10, 25, 20)]);
        around_all(whole, &cutters, &mut rest);
        for y in 0..50 {
            for x in 0..60 {
                let holds =
                    |q: &PixelRect| (q.x..q.x + q.width).contains(&x) && (q.y..q.y + q.height).contains(&y);
                let wanted = usize::from(holds(&whole) && !cutters.iter().any(holds));
                assert_eq!(rest.iter().filter(|q| holds(q)).count(), wanted, "pixel {x} {y}");
            }
        }
        assert_eq!(joined(r(10, 40, 5, 5), r(20, 10, 5, 5)), r(10, 10, 15, 35));
    }
}
