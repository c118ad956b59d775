//! How much lower than the true horizon the edge lies that is seen through haze.
//!
//! Near the horizon haze has nearly the sky's colour, and water at half the horizon's distance stands only a pixel below it: what is found
//! as the edge is that of water some kilometres nearer. How much that is depends on how edges are found, so the finder itself is asked, with
//! pictures of nothing but sky, water and haze, as a camera's tone curve has them.

use std::sync::Arc;

use super::{HorizonFinder, HorizonView, Prior};
use crate::{
    colour::linear_to_srgb,
    event::{Picture, PixelFormat},
    geometry::{Distortion, Lens, horizon_dip, look},
    physics::haze_share,
};
use glam::DVec3;

/// Light of sky, and of water without haze, over that of white.
const SKY: f64 = 0.58;
const WATER: f64 = 0.1;

/// By how much lower than the true horizon the finder sees it with that lens from that height, at a meteorological visibility of
/// `visibility_m` metres; radians. `None` where haze, or too coarse a picture, leaves no edge that could be found and believed.
pub fn lowered_by_haze(lens: &Lens, eye_height_m: f64, visibility_m: f64) -> Option<f64> {
    /// Rows of the pictures in the lens's own pixels: a tenth of a picture's height, but no fewer than the finder wants.
    const ROWS: u32 = 256;
    /// The horizon stands at so many different places within a row.
    const PHASES: u32 = 4;
    /// How well the pictures' up is foretold to the finder, radians.
    const PRIOR_SIGMA: f64 = 0.1f64.to_radians();
    let height = lens.height.min(ROWS);
    let flat = Lens {
        height,
        distortion: Distortion::None,
        row_turn: DVec3::ZERO,
        centre: glam::DVec2::new(lens.centre.x, f64::from(height) / 2.0),
        ..*lens
    };
    let mut finder = HorizonFinder::new();
    let (mut sum, mut count) = (0.0, 0);
    for phase in 0..PHASES {
        let elevation = f64::from(phase) / f64::from(PHASES) / lens.focal.y;
        let Some(picture) = picture(&flat, elevation, eye_height_m, visibility_m) else { continue };
        let prior = Prior { up: look(0.0, elevation, 0.0).inverse() * DVec3::Z, sigma: PRIOR_SIGMA };
        let view = HorizonView { lens: flat, eye_height_m, prior: Some(prior) };
        if let Ok(found) = finder.find(&picture, &view) {
            // An edge that lies lower makes the camera look higher.
            sum += found.elevation() - elevation;
            count += 1;
        }
    }
    (count > 0).then(|| sum / f64::from(count))
}

/// Sky, water and haze, seen level but for `elevation` (radians). Light is summed before it is put in codes, which moves an edge towards
/// the dark.
fn picture(lens: &Lens, elevation: f64, eye_height_m: f64, visibility_m: f64) -> Option<Picture> {
    /// Pieces of a row, over which its light is summed.
    const PIECES: u32 = 8;
    let row_bytes = lens.width as usize * 3;
    let mut bytes = Vec::with_capacity(row_bytes * lens.height as usize);
    for row in 0..lens.height {
        let piece = |i: u32| {
            let y = f64::from(row) + (f64::from(i) + 0.5) / f64::from(PIECES);
            let depression = ((y - lens.centre.y) / lens.focal.y).atan() - elevation;
            seen(depression, eye_height_m, visibility_m)
        };
        let light = (0..PIECES).map(piece).sum::<f64>() / f64::from(PIECES);
        bytes.resize(bytes.len() + row_bytes, (255.0 * linear_to_srgb(light as f32)).round() as u8);
    }
    Picture::new(PixelFormat::Rgb, lens.width, lens.height, Arc::from(bytes)).ok()
}

/// Light at an angle below the horizontal.
fn seen(depression: f64, eye_height_m: f64, visibility_m: f64) -> f64 {
    let dip = horizon_dip(eye_height_m);
    if depression <= dip {
        return SKY;
    }
    // The nearer of the two places where a ray at that angle meets a sea that drops with the square of distance; at the dip they are one.
    let root = (depression * depression - dip * dip).sqrt();
    let range = 2.0 * eye_height_m / (depression + root);
    let haze = f64::from(haze_share(range, visibility_m));
    WATER + haze * (SKY - WATER)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::curvature_drop;

    #[test]
    fn haze_lowers_the_edge_that_is_seen() {
        let lens = Lens::pinhole(1280, 720, 1.05);
        let by = |visibility_m| lowered_by_haze(&lens, 8.0, visibility_m).expect("an edge").to_degrees();
        // A sixth of a pixel is the camera's own tone curve, haze or none.
        assert!(by(500_000.0).abs() < 0.012, "{} deg in clear air", by(500_000.0));
        assert!((0.01..0.05).contains(&by(35_000.0)), "{} deg", by(35_000.0));
        assert!(by(15_000.0) > 1.5 * by(35_000.0), "{} deg", by(15_000.0));
        // Coarse pictures have an edge as well.
        let coarse = lowered_by_haze(&Lens::pinhole(160, 96, 1.05), 8.0, 35_000.0).map(f64::to_degrees);
        assert!(coarse.is_some_and(|deg| deg.abs() < 0.15), "{coarse:?} deg");
        // Fog leaves no edge.
        assert_eq!(lowered_by_haze(&lens, 8.0, 300.0), None);
        assert_eq!(lowered_by_haze(&Lens { width: 8, ..lens }, 8.0, 35_000.0), None);
    }

    #[test]
    fn water_is_seen_where_geometry_has_it() {
        // From 8 m, 1 km away: 8 mrad less what the Earth's curve and refraction make, 0.068 mrad.
        let depression = (8.0 + curvature_drop(1000.0)) / 1000.0;
        let half = 3912.0 / 2f64.ln();
        assert!((seen(depression, 8.0, half) - 0.5 * (SKY + WATER)).abs() < 1e-4);
        assert_eq!(seen(0.0, 8.0, half), SKY);
    }
}
