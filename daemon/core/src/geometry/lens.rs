//! The lens: from directions to pixels and back.

use glam::{DQuat, DVec2, DVec3};

use super::Distortion;

/// A camera's lens.
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
    /// How it bends straight lines.
    pub distortion: Distortion,
    /// How the camera turns while a rolling shutter reads the picture: from one row to the next, radians about the camera's axes.
    /// The camera's space is that of the middle row. None where all rows are exposed at once.
    pub row_turn: DVec3,
}

/// Which model of distortion a lens needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bend {
    /// None: straight lines stay straight.
    #[default]
    None,
    /// [`RadialTangential`](super::RadialTangential).
    RadialTangential,
    /// [`Fisheye`](super::Fisheye).
    Fisheye,
}

/// Properties of a lens that drawing through it has to follow; the rest is not compiled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Optics {
    /// How it bends straight lines.
    pub bend: Bend,
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
            distortion: Distortion::None,
            row_turn: DVec3::ZERO,
        }
    }

    /// An equidistant fisheye with square pixels, centred, that covers `hfov` radians across, with k1 to k4.
    pub fn fisheye(width: u32, height: u32, hfov: f64, k: [f64; 4]) -> Self {
        let distortion = Distortion::fisheye(k);
        let edge = DVec3::new((hfov / 2.0).sin(), 0.0, (hfov / 2.0).cos());
        // A model that folds before the picture's edge is stretched to it as if it did not bend.
        let radius = distortion.project(edge).map_or(hfov / 2.0, |edge| edge.x);
        let focal = DVec2::splat(f64::from(width) / 2.0 / radius);
        Self { focal, distortion, ..Self::pinhole(width, height, 1.0) }
    }

    /// The same lens before a shutter that reads the picture from its first row to its last while the camera turns by `turn`
    /// (radians about its axes).
    #[must_use]
    pub fn read_while(&self, turn: DVec3) -> Self {
        Self { row_turn: turn / f64::from(self.height.max(1)), ..*self }
    }

    /// What drawing through it has to follow.
    pub fn optics(&self) -> Optics {
        let bend = match self.distortion {
            Distortion::None => Bend::None,
            Distortion::RadialTangential(_) => Bend::RadialTangential,
            Distortion::Fisheye(_) => Bend::Fisheye,
        };
        Optics { bend, rolling: self.row_turn != DVec3::ZERO }
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
        Some(self.distortion.project(camera)? * self.focal + self.centre)
    }

    /// Unit vector in the camera's space of what falls on `pixel`; error below 1e-9 wherever [`Lens::project`] leads there at all, else a
    /// direction near the rim of what does.
    pub fn unproject(&self, pixel: DVec2) -> DVec3 {
        let seen = self.distortion.unproject((pixel - self.centre) / self.focal).normalize();
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

    /// Whether some direction falls on a pixel, with room for rounding at the rim.
    fn within(lens: &Lens, pixel: DVec2) -> bool {
        let far = |pixel: DVec2| ((pixel - lens.centre) / lens.focal).length();
        match lens.distortion {
            Distortion::None => true,
            Distortion::RadialTangential(d) => {
                let (k, tangential, far) = (d.radial(), d.tangential().length(), far(pixel));
                // From the axis outwards: until the radial terms show what is this far, none may grow so slowly that the tangential ones,
                // whose derivative is at most six times their size times the radius, fold it.
                for r in (1..25_000).map(|i| f64::from(i) * 2e-3) {
                    let (r2, r4) = (r * r, r * r * r * r);
                    if 1.0 + 3.0 * k.x * r2 + 5.0 * k.y * r4 <= 8.0 * tangential * r {
                        return false;
                    }
                    if 0.999 * r * (1.0 + k.x * r2 + k.y * r4) > far + 4.0 * tangential * r2 {
                        return true;
                    }
                }
                false
            }
            Distortion::Fisheye(d) => {
                let rim = DVec3::new((0.999 * d.reach()).sin(), 0.0, (0.999 * d.reach()).cos());
                lens.project(rim).is_some_and(|rim| far(pixel) < far(rim))
            }
        }
    }

    #[test]
    fn what_folds_back_is_refused_and_stays_refused() {
        // Grows again beyond its fold: what lies there must not come back into the picture.
        let folding = Distortion::radial_tangential(DVec2::new(-0.6, 0.12), DVec2::ZERO);
        let lens = Lens { distortion: folding, ..Lens::pinhole(1280, 720, 1.0) };
        let at = |tangent: f64| lens.project(DVec3::new(tangent, 0.0, 1.0));
        let Distortion::RadialTangential(d) = folding else { panic!("{folding:?}") };
        let reach = d.reach2().sqrt();
        assert!(at(0.99 * reach).is_some());
        for beyond in [1.01, 1.5, 2.0, 5.0, 50.0] {
            assert_eq!(at(beyond * reach), None, "{beyond}");
        }
        assert_eq!(lens.project(DVec3::NEG_Z), None);
        let fisheye = Lens::fisheye(1280, 720, 2.0, [-0.1, 0.0, 0.0, 0.0]);
        let Distortion::Fisheye(d) = fisheye.distortion else { panic!("{fisheye:?}") };
        // 1 - 0.3 a^2 = 0.
        assert!((d.reach() - (1.0 / 0.3f64).sqrt()).abs() < 1e-9);
        let at = |angle: f64| fisheye.project(DVec3::new(angle.sin(), 0.0, angle.cos()));
        assert!(at(0.99 * d.reach()).is_some() && at(1.01 * d.reach()).is_none() && at(3.1).is_none());
    }

    #[test]
    fn a_fisheye_sees_behind_itself() {
        let lens = Lens::fisheye(1000, 1000, 190f64.to_radians(), [0.0; 4]);
        let edge = lens.unproject(DVec2::new(1000.0, 500.0));
        assert!((edge.z - 95f64.to_radians().cos()).abs() < 1e-9, "{edge}");
        assert!((lens.half_diagonal().to_degrees() - 95.0 * 2f64.sqrt()).abs() < 1e-6);
    }

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
        /// Any direction comes back, up to the corners of pictures from a telephoto's to a fisheye's.
        #[test]
        fn unproject_inverts_project(
            u in 0.0..1.0f64, v in 0.0..1.0f64, hfov in 20.0..150.0f64, k1 in -0.4..0.3f64, k2 in -0.05..0.05f64,
            p in [-0.005..0.005f64, -0.005..0.005f64], fisheye in [-0.1..0.05f64, -0.03..0.03, -0.005..0.005, -1e-3..1e-3],
            across in 60.0..190.0f64,
        ) {
            let hfov = hfov.to_radians();
            let bent = Lens {
                distortion: Distortion::radial_tangential(DVec2::new(k1, k2), DVec2::from(p)),
                ..Lens::pinhole(1280, 720, hfov)
            };
            let wide = Lens::fisheye(1280, 720, across.to_radians(), fisheye);
            for lens in [bent, wide] {
                let pixel = DVec2::new(u * 1280.0, v * 720.0);
                let seen = lens.unproject(pixel);
                prop_assert!(seen.is_finite() && (seen.length() - 1.0).abs() < 1e-12, "{seen}");
                // Pixels beyond the rim see nothing; all others come back.
                if within(&lens, pixel) {
                    let back = lens.project(seen * 37.0).unwrap_or(DVec2::NAN);
                    prop_assert!(back.distance(pixel) < 1e-9 * lens.focal.x.max(1000.0), "{back} {pixel} {lens:?}");
                }
            }
        }

        /// Directions, not pixels: what the model can show comes back though the picture were larger.
        #[test]
        fn project_inverts_unproject(
            off in 0.0..1.4f64, around in 0.0..6.3f64, k1 in -0.4..0.4f64, k2 in -0.05..0.1f64,
        ) {
            let distortion = Distortion::radial_tangential(DVec2::new(k1, k2), DVec2::ZERO);
            let lens = Lens { distortion, ..Lens::pinhole(1280, 720, 1.0) };
            let direction = DVec3::new(off.sin() * around.cos(), off.sin() * around.sin(), off.cos());
            // Near the fold, where the radius hardly grows any more, nothing can tell directions apart.
            let reach = match distortion { Distortion::RadialTangential(d) => d.reach2().sqrt(), _ => f64::INFINITY };
            if let Some(pixel) = lens.project(direction).filter(|_| off.tan() < 0.98 * reach) {
                prop_assert!(lens.unproject(pixel).distance(direction) < 1e-9, "{direction}");
            } else {
                prop_assert!(off.tan() >= 0.98 * reach);
            }
        }

        /// 30 ms at up to 60 deg/s about any axis.
        #[test]
        fn unproject_inverts_project_row_by_row(
            x in 0.0..1280.0f64, y in 0.0..720.0f64, turn in [-0.0314..0.0314f64, -0.0314..0.0314, -0.0314..0.0314],
            k1 in -0.2..0.1f64,
        ) {
            let mut lens = Lens::pinhole(1280, 720, 1.0).read_while(DVec3::from(turn));
            lens.distortion = Distortion::radial_tangential(DVec2::X * k1, DVec2::ZERO);
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
