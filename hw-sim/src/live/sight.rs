//! Barrel and front sight of the simulated gun, which its own camera sees: whoever aims at a desk aims with them, as with the gun's own.
//!
//! They stand in the simulated camera's picture, not in what the trainer draws: on a gun there are the real ones.

use bowwave_core::{geometry::Lens, own_ship::Phantom};
use glam::{DVec2, DVec3};

/// Muzzle in the camera's axes, metres: that of made calibrations.
const MUZZLE: DVec3 = DVec3::new(0.0, 0.12, 0.6);
/// The barrel's radius at the muzzle and where it leaves the picture, metres.
const BARREL: [f64; 2] = [0.016, 0.022];
/// Half the post's width at its top and its foot, metres: 4 and 7 mrad wide.
const POST: [f64; 2] = [0.0012, 0.0021];
/// Grey of post and barrel.
const GREY: [f64; 2] = [34.0, 46.0];
/// How far the post reaches into the barrel, metres: outlines that touch would leave a seam.
const SUNK: f64 = 0.006;

/// What of the gun stands in the picture.
pub(super) struct Sight {
    lens: Lens,
    at_rest: Vec<Covered>,
}

/// Byte of the picture, share that is covered (of 256), grey.
type Covered = (u32, u16, u16);

impl Sight {
    /// As a lens shows it.
    pub fn new(lens: &Lens) -> Self {
        let at_rest = outlines(lens, 0.0);
        Self { lens: *lens, at_rest: covered(lens, &at_rest) }
    }

    /// Draws it into a picture of three bytes a pixel, its muzzle so many times as far from where the bore vanishes as at rest.
    pub fn draw(&self, recoil: f64, rgb: &mut [u8]) {
        if recoil == 1.0 {
            lay(&self.at_rest, rgb);
        } else {
            let about = self.lens.centre;
            let recoiled =
                outlines(&self.lens, 0.0).map(|outline| outline.map(|p| about + (p - about) * recoil));
            lay(&covered(&self.lens, &recoiled), rgb);
        }
    }
}

/// The muzzle's factor where the barrel is so far back along its bore, metres.
pub(super) fn recoil(back_m: f64) -> f64 {
    MUZZLE.z / (MUZZLE.z - back_m)
}

/// Pixels of barrel and post.
fn covered(lens: &Lens, outlines: &[[DVec2; 4]; 2]) -> Vec<Covered> {
    let mut pixels = Vec::new();
    for (outline, grey) in outlines.iter().zip([GREY[1], GREY[0]]) {
        let (low, high) =
            outline.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
        let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
        let (low, high) = ((low - 1.0).max(DVec2::ZERO), (high + 1.0).min(size));
        for y in low.y as u32..high.y as u32 {
            for x in low.x as u32..high.x as u32 {
                let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let inside = depth(outline, at);
                let covered = (inside + 0.5).clamp(0.0, 1.0);
                if covered > 0.0 {
                    let shade = grey * (0.45 + 0.9 * roundness(outline, at));
                    pixels.push((3 * (y * lens.width + x), (256.0 * covered) as u16, shade as u16));
                }
            }
        }
    }
    pixels
}

fn lay(pixels: &[Covered], rgb: &mut [u8]) {
    for &(at, covered, grey) in pixels {
        for value in rgb.iter_mut().skip(at as usize).take(3) {
            *value = ((u32::from(*value) * (256 - u32::from(covered)) + u32::from(grey) * u32::from(covered))
                >> 8) as u8;
        }
    }
}

/// Barrel and post as they are seen.
pub(super) fn phantoms(lens: &Lens) -> Vec<Phantom> {
    let outlines = outlines(lens, SUNK).into_iter().map(Vec::from);
    let phantom = |(name, outline)| Phantom::new(name, outline, (lens.width, lens.height)).recoiling(true);
    ["barrel", "front sight"].into_iter().zip(outlines).map(phantom).collect()
}

/// Outlines of barrel and post, pixels, clockwise; the post reaches `sunk` metres into the barrel.
fn outlines(lens: &Lens, sunk: f64) -> [[DVec2; 4]; 2] {
    let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
    // The barrel leaves the picture where its lower edge does.
    let near_m = MUZZLE.y / ((size.y - lens.centre.y) / lens.focal.y);
    let pixel = |x: f64, y: f64, z: f64| lens.centre + lens.focal * DVec2::new(x / z, y / z);
    let quad = |corners: [DVec2; 4]| corners.map(|p| p.clamp(DVec2::ZERO, size));
    let foot = MUZZLE.y - BARREL[0];
    [
        quad([
            pixel(-BARREL[0], foot, MUZZLE.z),
            pixel(BARREL[0], foot, MUZZLE.z),
            pixel(BARREL[1], MUZZLE.y, near_m),
            pixel(-BARREL[1], MUZZLE.y, near_m),
        ]),
        quad([
            pixel(-POST[0], 0.0, MUZZLE.z),
            pixel(POST[0], 0.0, MUZZLE.z),
            pixel(POST[1], foot + sunk, MUZZLE.z),
            pixel(-POST[1], foot + sunk, MUZZLE.z),
        ]),
    ]
}

/// Share of the light that round metal throws back at a place across it: most a little left of its middle, towards the sky's light.
fn roundness(outline: &[DVec2; 4], at: DVec2) -> f64 {
    let down = ((at.y - outline[0].y) / (outline[3].y - outline[0].y)).clamp(0.0, 1.0);
    let (left, right) = (outline[0].lerp(outline[3], down).x, outline[1].lerp(outline[2], down).x);
    let across = ((at.x - left) / (right - left).max(1e-9)).clamp(0.0, 1.0);
    let off = 2.2 * (across - 0.42);
    (1.0 - off * off).max(0.0)
}

/// How far a place is within a convex outline that runs clockwise, pixels; negative outside.
fn depth(outline: &[DVec2; 4], at: DVec2) -> f64 {
    (0..4)
        .map(|i| {
            let (from, to) = (outline[i], outline[(i + 1) % 4]);
            (to - from).normalize_or_zero().perp_dot(at - from)
        })
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_post_ends_where_the_barrel_points() {
        let lens = Lens::pinhole(1280, 720, 1.0);
        let mut rgb = vec![200; 3 * 1280 * 720];
        Sight::new(&lens).draw(1.0, &mut rgb);
        let dark = |x: usize, y: usize| rgb[3 * (y * 1280 + x)] < 80;
        assert!(dark(640, 364) && !dark(640, 357) && !dark(634, 364));
        assert!(dark(640, 700) && !dark(400, 700));
        let share = rgb.iter().filter(|v| **v < 100).count() as f64 / rgb.len() as f64;
        assert!((0.002..0.03).contains(&share), "{share}");
        for corner in phantoms(&lens).iter().flat_map(Phantom::outline) {
            assert!((0.0..=1280.0).contains(&corner.x) && (0.0..=720.0).contains(&corner.y));
        }
    }
}
