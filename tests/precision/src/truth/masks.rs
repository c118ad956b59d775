//! Where the reflection is judged.
//!
//! The region of the reflection are water pixels (the boat covers less than half of them) that lie either in the boat's exact mirror image
//! about the mean water at its hull, or where the truth changes: a channel's 8-bit code, averaged over 3 x 3 pixels, changes by more than
//! [`CHANGE_CODES`]; grown by [`MARGIN`] pixels. The mirror image is in it so that a method that draws a mirror image where the
//! truth shows none is judged there too.

use bowwave_core::geometry::RigidPose;
use glam::{DVec2, DVec3};

use super::{
    boat,
    cell::{CellPictures, CellSetup},
    files::code,
};

/// Mean change of the code that counts as one.
pub const CHANGE_CODES: f64 = 1.5;
/// Pixels by which the region is grown.
pub const MARGIN: i64 = 2;

/// The region of the reflection, one flag a pixel.
pub fn reflection(setup: &CellSetup, pictures: &CellPictures) -> Vec<bool> {
    let (w, h) = (pictures.size.0 as usize, pictures.size.1 as usize);
    let change: Vec<DVec3> = pictures
        .without
        .iter()
        .zip(&pictures.with)
        .map(|(a, b)| DVec3::from_array([0, 1, 2].map(|c| f64::from(code(b[c])) - f64::from(code(a[c])))))
        .collect();
    let water = |i: usize| pictures.hull[i] < 0.5;
    let mirrored = mirror_image(setup, (w, h));
    let mut seed = vec![false; w * h];
    for y in 0..h {
        for x in 0..w {
            let around = neighbours(x, y, 1, (w, h));
            let (mut sum, mut count) = (DVec3::ZERO, 0.0);
            for i in around {
                // Pixels that the hull touches changed because of the hull.
                if pictures.hull[i] == 0.0 {
                    sum += change[i];
                    count += 1.0;
                }
            }
            seed[y * w + x] =
                mirrored[y * w + x] || count > 0.0 && sum.abs().max_element() / count > CHANGE_CODES;
        }
    }
    (0..w * h)
        .map(|i| water(i) && neighbours(i % w, i / w, MARGIN, (w, h)).any(|j| seed[j] && water(j)))
        .collect()
}

fn neighbours(x: usize, y: usize, reach: i64, size: (usize, usize)) -> impl Iterator<Item = usize> {
    let span = move |at: usize, end: usize| {
        let low = (at as i64 - reach).max(0) as usize;
        low..(at + reach as usize + 1).min(end)
    };
    span(y, size.1).flat_map(move |j| span(x, size.0).map(move |i| j * size.0 + i))
}

/// Pixels whose centres lie in the boat's image mirrored about the level water at its hull.
fn mirror_image(setup: &CellSetup, size: (usize, usize)) -> Vec<bool> {
    let mesh = boat::mesh(&setup.model, RigidPose { ..setup.pose });
    let level = setup.pose.position.z;
    let mut eye = setup.camera.position;
    eye.z = 2.0 * level - eye.z;
    (0..size.0 * size.1)
        .map(|i| {
            let pixel = DVec2::new(
                f64::from(setup.region.x) + (i % size.0) as f64 + 0.5,
                f64::from(setup.region.y) + (i / size.0) as f64 + 0.5,
            );
            let mut direction = setup.camera.world_from_camera * setup.lens.unproject(pixel);
            if direction.z >= 0.0 {
                return false;
            }
            // The part of the mirrored ray above the water.
            direction.z = -direction.z;
            let start = eye + direction * ((level - eye.z) / direction.z);
            mesh.meet(start, direction, f64::INFINITY).is_some()
        })
        .collect()
}
