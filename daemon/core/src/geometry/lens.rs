//! The lens: from directions to pixels and back.

use glam::{DQuat, DVec2, DVec3};

/// Pinhole with radial and tangential distortion (Brown-Conrady, as OpenCV's first five coefficients without k3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Picture width in pixels.
    pub width: u32,
    /// Picture height in pixels.
    pub height: u32,
    /// Focal lengths in pixels.
    pub focal: DVec2,
    /// Principal point in pixels; the centre of the first pixel is (0.5, 0.5).
    pub centre: DVec2,
    /// Radial coefficients k1, k2.
    pub radial: DVec2,
    /// Tangential coefficients p1, p2.
    pub tangential: DVec2,
    /// How the camera turns while a rolling shutter reads the picture: from one row to the next, radians about the camera's axes.
    /// The camera's space is that of the middle row. None where all rows are exposed at once.
    pub row_turn: DVec3,
}

/// What a lens does that drawing through it has to follow; the rest is not compiled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Optics {
    /// It bends straight lines.
    pub distorted: bool,
    /// Rows are exposed one after another.
    pub rolling: bool,
}

/// Rows farther from the picture's middle than so many heights of it are taken for as far: nothing of them is seen.
const ROWS_BEYOND: f64 = 1.0;

/// More steps are never needed from one row to the one on which a point is seen.
const ROW_STEPS_MAX: usize = 12;

impl Lens {
    /// An undistorted lens with square pixels, centred, that covers `hfov` radians across.
    pub fn pinhole(width: u32, height: u32, hfov: f64) -> Self {
        let focal = f64::from(width) / 2.0 / (hfov / 2.0).tan();
        Self {
            width,
            height,
            focal: DVec2::splat(focal),
            centre: DVec2::new(f64::from(width), f64::from(height)) / 2.0,
            radial: DVec2::ZERO,
            tangential: DVec2::ZERO,
            row_turn: DVec3::ZERO,
        }
    }

    /// The same lens before a shutter that reads the picture from its first row to its last while the camera turns by `turn`
    /// (radians about its axes).
    #[must_use]
    pub fn read_while(&self, turn: DVec3) -> Self {
        Self { row_turn: turn / f64::from(self.height.max(1)), ..*self }
    }

    /// What drawing through it has to follow.
    pub fn optics(&self) -> Optics {
        let distorted = self.radial != DVec2::ZERO || self.tangential != DVec2::ZERO;
        Optics { distorted, rolling: self.row_turn != DVec3::ZERO }
    }

    /// How the camera has turned when `row` is read, from its axes then to those of the middle row.
    pub fn turned_at(&self, row: f64) -> DQuat {
        let height = f64::from(self.height);
        let rows = (row - height / 2.0).clamp(-ROWS_BEYOND * height, ROWS_BEYOND * height);
        DQuat::from_scaled_axis(self.row_turn * rows)
    }

    /// Where a point of the camera's space falls, in pixels; `None` behind the camera or where the distortion folds back.
    pub fn project(&self, camera: DVec3) -> Option<DVec2> {
        if self.row_turn == DVec3::ZERO { self.project_at_once(camera) } else { self.project_by_rows(camera) }
    }

    /// The pixel on whose row the point is seen when that row is read. The row decides how far the camera has turned, and that the
    /// row: secant steps, which gain a factor of at least five each where the picture moves by less than a fifth of itself
    /// while it is read.
    fn project_by_rows(&self, camera: DVec3) -> Option<DVec2> {
        let seen_from = |row: f64| self.project_at_once(self.turned_at(row).inverse() * camera);
        let mut row = f64::from(self.height) / 2.0;
        let mut pixel = seen_from(row)?;
        let mut moved = pixel.y - row;
        let mut slope = 0.0;
        for _ in 0..ROW_STEPS_MAX {
            let step = moved / (1.0 - slope);
            if step.abs() < 1e-10 {
                break;
            }
            row += step;
            pixel = seen_from(row)?;
            let before = std::mem::replace(&mut moved, pixel.y - row);
            // How the seen row follows the assumed one; a step may not be led astray where rows end.
            slope = (1.0 + (moved - before) / step).clamp(-0.9, 0.9);
        }
        Some(pixel)
    }

    /// Where a point falls in the middle row's camera, whatever row that is.
    fn project_at_once(&self, camera: DVec3) -> Option<DVec2> {
        if camera.z <= 1e-6 || !camera.is_finite() {
            return None;
        }
        let n = camera.truncate() / camera.z;
        let r2 = n.length_squared();
        // Radius must still grow with the angle, or the model wraps far-off points into the picture.
        if 1.0 + 3.0 * self.radial.x * r2 + 5.0 * self.radial.y * r2 * r2 <= 0.0 {
            return None;
        }
        Some(self.distort(n) * self.focal + self.centre)
    }

    /// Undistorted normalised coordinates (x/z, y/z) to distorted ones.
    pub fn distort(&self, n: DVec2) -> DVec2 {
        let r2 = n.length_squared();
        let radial = 1.0 + r2 * (self.radial.x + r2 * self.radial.y);
        let (p1, p2) = (self.tangential.x, self.tangential.y);
        let tangential = DVec2::new(
            2.0 * p1 * n.x * n.y + p2 * (r2 + 2.0 * n.x * n.x),
            p1 * (r2 + 2.0 * n.y * n.y) + 2.0 * p2 * n.x * n.y,
        );
        n * radial + tangential
    }

    /// Unit vector in the camera's space of what falls on `pixel`. Fixed-point iteration; error below 1e-9 for the lenses
    /// that [`Lens::project`] accepts inside the picture.
    pub fn unproject(&self, pixel: DVec2) -> DVec3 {
        let distorted = (pixel - self.centre) / self.focal;
        let mut n = distorted;
        for _ in 0..60 {
            let step = distorted - self.distort(n);
            n += step;
            if step.length_squared() < 1e-24 {
                break;
            }
        }
        let seen = DVec3::new(n.x, n.y, 1.0).normalize();
        if self.row_turn == DVec3::ZERO { seen } else { self.turned_at(pixel.y) * seen }
    }

    /// The lens of the same camera when its picture is scaled to cover a `width` x `height` screen and centred (what falls
    /// outside is cut off).
    #[must_use]
    pub fn covering(&self, width: u32, height: u32) -> Self {
        let from = DVec2::new(f64::from(self.width), f64::from(self.height));
        let to = DVec2::new(f64::from(width), f64::from(height));
        let scale = (to / from).max_element();
        Self {
            width,
            height,
            focal: self.focal * scale,
            centre: (self.centre - from / 2.0) * scale + to / 2.0,
            row_turn: self.row_turn / scale,
            ..*self
        }
    }

    /// Half the diagonal field of view, radians: no visible direction is farther from the axis.
    pub fn half_diagonal(&self) -> f64 {
        let (w, h) = (f64::from(self.width), f64::from(self.height));
        [DVec2::ZERO, DVec2::new(w, 0.0), DVec2::new(0.0, h), DVec2::new(w, h)]
            .into_iter()
            .map(|corner| self.unproject(corner).z.clamp(-1.0, 1.0).acos())
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_camera_that_turns_right_shears_what_stands_upright() {
        // Clockwise from above is a turn about the camera's y, which points down.
        let lens = Lens::pinhole(1280, 720, 1.0).read_while(DVec3::Y * 0.01);
        let at = |down: f64| lens.project(DVec3::new(0.0, down, 1.0)).unwrap();
        let (above, below) = (at(-0.25), at(0.25));
        // What is read later is seen farther left.
        assert!(above.x > 640.0 && below.x < 640.0, "{above} {below}");
        let expected = 0.01 * (below.y - above.y) / 720.0 * lens.focal.x;
        assert!((above.x - below.x - expected).abs() < 0.02, "{above} {below} {expected}");
    }

    proptest! {
        #[test]
        fn unproject_inverts_project(
            x in 0.0..1280.0f64, y in 0.0..720.0f64, k1 in -0.2..0.2f64, k2 in -0.02..0.02f64,
            p1 in -0.005..0.005f64, p2 in -0.005..0.005f64,
        ) {
            let mut lens = Lens::pinhole(1280, 720, 1.0);
            lens.radial = DVec2::new(k1, k2);
            lens.tangential = DVec2::new(p1, p2);
            let pixel = DVec2::new(x, y);
            let back = lens.project(lens.unproject(pixel) * 37.0).unwrap();
            prop_assert!(back.distance(pixel) < 1e-6, "{back} {pixel}");
        }

        /// 30 ms at up to 60 deg/s about any axis.
        #[test]
        fn unproject_inverts_project_row_by_row(
            x in 0.0..1280.0f64, y in 0.0..720.0f64, turn in [-0.0314..0.0314f64, -0.0314..0.0314, -0.0314..0.0314],
            k1 in -0.2..0.1f64,
        ) {
            let mut lens = Lens::pinhole(1280, 720, 1.0).read_while(DVec3::from(turn));
            lens.radial.x = k1;
            let pixel = DVec2::new(x, y);
            let seen = lens.unproject(pixel);
            prop_assert!(lens.project(seen * 37.0).unwrap().distance(pixel) < 1e-8);
            // The middle row is seen as with a global shutter, and a screen shows what the picture does.
            let still = Lens { row_turn: DVec3::ZERO, ..lens };
            let middle = DVec2::new(x, 360.0);
            prop_assert!(lens.unproject(middle).distance(still.unproject(middle)) < 1e-12);
            let shown = lens.covering(1920, 1080).project(seen).unwrap();
            prop_assert!(shown.distance(pixel * 1.5) < 1e-8, "{shown} {pixel}");
        }

        #[test]
        fn covering_scales_about_the_centre(w in 16u32..4000, h in 16u32..4000) {
            let lens = Lens::pinhole(1280, 720, 1.0);
            let screen = lens.covering(w, h);
            let axis = screen.project(DVec3::Z).unwrap();
            prop_assert!(axis.distance(DVec2::new(f64::from(w), f64::from(h)) / 2.0) < 1e-9);
            // Both sides of the picture reach at least the screen's edge.
            let scale = screen.focal.x / lens.focal.x;
            prop_assert!(1280.0 * scale >= f64::from(w) - 1e-6 && 720.0 * scale >= f64::from(h) - 1e-6);
        }
    }
}
