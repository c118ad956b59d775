//! The sky's light by elevation, from the rows above the horizon.

use glam::{DVec2, DVec3};

use super::Frame;

/// Elevations looked at, radians above the horizontal.
const ELEVATIONS: [f64; 12] = [0.01, 0.02, 0.035, 0.05, 0.07, 0.1, 0.13, 0.17, 0.22, 0.28, 0.36, 0.45];
/// Azimuths looked at, radians from the middle of the view.
const SIDES: [f64; 5] = [-0.4, -0.2, 0.0, 0.2, 0.4];
/// Share of the old value kept at each look: looks come every two seconds.
const KEEP: f64 = 0.85;

/// Mean luminance of the sky by elevation and side.
#[derive(Clone, Debug, Default)]
pub(super) struct SkyRows {
    means: [[Option<f64>; SIDES.len()]; ELEVATIONS.len()],
}

impl SkyRows {
    /// Takes a picture in.
    pub fn observe(&mut self, frame: &Frame<'_>, azimuth: f64) {
        let camera_from_world = frame.camera.world_from_camera.inverse();
        for (row, e) in self.means.iter_mut().zip(ELEVATIONS) {
            for (mean, side) in row.iter_mut().zip(SIDES) {
                let flat = DVec2::new((azimuth + side).sin(), (azimuth + side).cos()) * e.cos();
                let ray: DVec3 = camera_from_world * flat.extend(e.sin());
                let light = frame.lens.project(ray).and_then(|pixel| (frame.luminance)(pixel));
                let Some(light) = light.filter(|l| l.is_finite() && *l >= 0.0).map(f64::from) else { continue };
                *mean = Some(mean.map_or(light, |old| old * KEEP + light * (1.0 - KEEP)));
            }
        }
    }

    /// Fall of the logarithm of luminance with elevation, per radian, by least squares over what was seen; `None` below five
    /// points.
    pub fn gradient(&self) -> Option<f64> {
        let (mut n, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (row, e) in self.means.iter().zip(ELEVATIONS) {
            for light in row.iter().flatten().filter(|l| **l > 1e-6) {
                let log = light.ln();
                n += 1.0;
                x += e;
                y += log;
                xx += e * e;
                xy += e * log;
            }
        }
        let spread = n * xx - x * x;
        (n >= 5.0 && spread > 1e-6).then(|| (n * xy - x * y) / spread)
    }
}
