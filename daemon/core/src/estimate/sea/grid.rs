//! Patches of the still water's plane whose brightness is followed.

use glam::{DVec2, DVec3};

use super::{SeaFrame, Unknown};
use crate::geometry::{CameraPose, Lens};

/// A patch of the plane z = 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct SeaPatch {
    /// Middle, metres east and north of the eye's foot.
    pub at: DVec2,
    /// Angle under the horizontal at which it is seen, radians.
    pub depression: f64,
    /// Azimuth relative to the middle of the grid, radians.
    pub side: f64,
    /// Horizontal unit vector away from the eye.
    pub view: DVec2,
    /// Lengths along the view and across it, metres.
    pub size: DVec2,
}

/// All patches, as they lie in the world.
#[derive(Clone, Debug)]
pub(super) struct SeaGrid {
    pub cells: Vec<SeaPatch>,
    /// Azimuth of its middle, radians clockwise from north.
    pub azimuth: f64,
    /// Height of the eye, metres.
    pub eye_m: f64,
}

/// Azimuth of the view, radians clockwise from north; `None` straight up or down.
pub(super) fn azimuth_of(camera: &CameraPose) -> Option<f64> {
    let forward = (camera.world_from_camera * DVec3::Z).truncate();
    (forward.length() > 0.05).then(|| forward.x.atan2(forward.y))
}

impl SeaGrid {
    /// Patches over the water that the camera sees, as wide in angle as they are long against their range.
    pub fn lay(camera: &CameraPose, lens: &Lens) -> Result<Self, Unknown> {
        /// Patches wanted: at least and at most.
        const CELLS: (usize, usize) = (120, 420);
        let azimuth = azimuth_of(camera).ok_or(Unknown::NoWater)?;
        let mut step = 0.08;
        for _ in 0..12 {
            let cells = cells(camera, lens, azimuth, step);
            if cells.len() > CELLS.1 {
                step *= 1.15;
            } else if cells.len() < CELLS.0 && step > 0.012 {
                step *= 0.8;
            } else {
                let enough = cells.len() >= CELLS.0 / 4;
                return if enough {
                    Ok(Self { cells, azimuth, eye_m: camera.position.z })
                } else {
                    Err(Unknown::NoWater)
                };
            }
        }
        Err(Unknown::NoWater)
    }

    /// Mean luminance of each patch; NaN where it is hidden or outside of the picture. Answers the share that is seen.
    pub fn sample(&self, frame: &SeaFrame<'_>, out: &mut [f32]) -> f64 {
        /// Points per patch and axis that are averaged.
        const TAPS: i32 = 3;
        /// A patch counts when at least this many of its points are seen.
        const TAPS_SEEN: u32 = 6;
        let camera_from_world = frame.camera.world_from_camera.inverse();
        let mut seen_cells = 0;
        for (cell, out) in self.cells.iter().zip(out.iter_mut()) {
            let (mut sum, mut seen) = (0.0, 0);
            for i in 0..TAPS * TAPS {
                let share = DVec2::new(f64::from(i % TAPS), f64::from(i / TAPS)) - f64::from(TAPS - 1) / 2.0;
                let offset = share * cell.size / f64::from(TAPS);
                let at = cell.at + cell.view * offset.x + cell.view.perp() * offset.y;
                let ray = at.extend(-frame.camera.position.z);
                let light =
                    frame.lens.project(camera_from_world * ray).and_then(|pixel| (frame.luminance)(pixel));
                if let Some(light) = light.filter(|l| l.is_finite() && *l >= 0.0) {
                    sum += light;
                    seen += 1;
                }
            }
            let enough = seen >= TAPS_SEEN;
            seen_cells += usize::from(enough);
            *out = if enough { sum / seen as f32 } else { f32::NAN };
        }
        seen_cells as f64 / self.cells.len().max(1) as f64
    }
}

fn cells(camera: &CameraPose, lens: &Lens, azimuth: f64, step: f64) -> Vec<SeaPatch> {
    /// Depression angles between which water is looked at, radians: nearer the horizon crests hide troughs.
    const DEPRESSION: (f64, f64) = (0.045, 0.7);
    /// Share of the picture's width and height that is left free at its edges, for the hand's motion.
    const MARGIN: f64 = 0.04;
    let height = camera.position.z;
    let camera_from_world = camera.world_from_camera.inverse();
    let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
    let inside = |at: DVec2| {
        let pixel = lens.project(camera_from_world * at.extend(-height));
        pixel.is_some_and(|p| p.cmpge(size * MARGIN).all() && p.cmple(size * (1.0 - MARGIN)).all())
    };
    let rows = ((DEPRESSION.1.tan() / DEPRESSION.0.tan()).ln() / step) as i32;
    let columns = (1.2 / step) as i32;
    let mut cells = Vec::new();
    for row in 0..=rows {
        let range = height / DEPRESSION.1.tan() * (f64::from(row) * step).exp();
        for column in -columns..=columns {
            let side = f64::from(column) * step;
            let view = DVec2::new((azimuth + side).sin(), (azimuth + side).cos());
            let at = view * range;
            let corner = |a: f64, b: f64| at + (view * a + view.perp() * b) * (range * step / 2.0);
            if [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
                .into_iter()
                .all(|(a, b)| inside(corner(a, b)))
            {
                cells.push(SeaPatch {
                    at,
                    depression: (height / range).atan(),
                    side,
                    view,
                    size: DVec2::splat(range * step),
                });
            }
        }
    }
    cells
}
