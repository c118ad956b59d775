//! A board that stands square before the camera.

use bowwave_calibration::target::{MODULES, Target, TargetError, is_white};
use glam::{DVec2, IVec2};

/// How it is named to the trainer.
pub const NAME: &str = "3x2:100";
/// Share of the picture's width that it fills.
const FILLS: f64 = 0.85;
/// Places within a pixel, each way, that its brightness is the mean of.
const WITHIN: u32 = 5;

/// Pixels of a metre of the board, and where its place zero lies in the picture.
fn scale(target: &Target, (width, height): (u32, u32)) -> (f64, DVec2) {
    let size = target.size_m();
    let px = FILLS * f64::from(width) / size.x;
    let gap = target.spacing() * target.tag_m();
    let left_below = 0.5 * (DVec2::new(width.into(), height.into()) + DVec2::new(-size.x, size.y) * px);
    (px, left_below + DVec2::new(gap, -gap) * px)
}

/// Where the middle of a tag is seen, pixels.
///
/// # Errors
/// Where [`NAME`] were no board.
pub fn middle(tag: usize, size: (u32, u32)) -> Result<DVec2, TargetError> {
    let target: Target = NAME.parse()?;
    let (px, zero) = scale(&target, size);
    let [low, _, high, _] = target.corners(tag);
    Ok(zero + 0.5 * (low + high) * DVec2::new(px, -px))
}

/// The picture of it, as YUYV.
///
/// # Errors
/// Where [`NAME`] were no board.
pub fn yuyv(size: (u32, u32)) -> Result<Vec<u8>, TargetError> {
    let target: Target = NAME.parse()?;
    let (px, zero) = scale(&target, size);
    let mut out = Vec::with_capacity((size.0 * size.1 * 2) as usize);
    for (y, x) in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (y, x))) {
        let within = (0..WITHIN * WITHIN).filter(|i| {
            let at = DVec2::new((i % WITHIN).into(), (i / WITHIN).into()) + 0.5;
            let place = DVec2::new(x.into(), y.into()) + at / f64::from(WITHIN);
            is_black(&target, (place - zero) * DVec2::new(1.0, -1.0) / px)
        });
        let black = within.count() as f64 / f64::from(WITHIN * WITHIN);
        out.extend([(16.0 + 219.0 * (0.9 - 0.8 * black)).round() as u8, 128]);
    }
    Ok(out)
}

/// Whether a place of the board, metres, is black: in a tag, or in a square between tags.
fn is_black(target: &Target, place: DVec2) -> bool {
    let (tag, pitch) = (target.tag_m(), target.tag_m() * (1.0 + target.spacing()));
    let at = (place / pitch).floor();
    let within = place - at * pitch;
    let (at, most) = (at.as_ivec2(), IVec2::new(target.columns() as i32, target.rows() as i32));
    let in_tag = within.cmplt(DVec2::splat(tag));
    if in_tag.all() {
        let modules = within / tag * MODULES as f64;
        let (row, column) = (MODULES - 1 - modules.y as usize, modules.x as usize);
        let is_there = at.cmpge(IVec2::ZERO).all() && at.cmplt(most).all();
        return is_there && !is_white((at.y * most.x + at.x) as usize, row, column);
    }
    !in_tag.any() && at.cmpge(IVec2::NEG_ONE).all() && at.cmplt(most).all()
}

#[cfg(test)]
mod tests {
    use bowwave_calibration::target::find_tag;
    use bowwave_core::event::{Picture, PixelFormat};

    use super::*;

    #[test]
    fn its_tags_are_found_where_they_are_said_to_be() {
        let size = (192, 128);
        let picture = Picture::new(PixelFormat::Yuyv, size.0, size.1, yuyv(size).unwrap().into()).unwrap();
        for tag in [0, 4] {
            let found = find_tag(&NAME.parse().unwrap(), tag, &picture).unwrap();
            let truth = middle(tag, size).unwrap();
            assert!(found.distance(truth) < 0.1, "{tag}: {found} {truth}");
        }
    }
}
