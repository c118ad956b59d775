//! Which lens model is fitted, and its intrinsics as one vector; the model itself is that of [`bowwave_core::geometry`].

use bowwave_core::geometry::{Distortion, Lens};
use glam::{DVec2, DVec3};
use nalgebra::{SMatrix, SVector, Vector2};

pub(super) use bowwave_core::geometry::INTRINSICS;

/// Focal lengths, principal point, four coefficients of distortion.
pub(super) type Intrinsics = SVector<f64, INTRINSICS>;

/// Lens model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LensModel {
    /// Pinhole with radial k1, k2 and tangential p1, p2 (Brown 1971; Conrady 1919).
    RadialTangential,
    /// Equidistant fisheye with k1 to k4 (Kannala & Brandt 2006, eq. 6; OpenCV's fisheye).
    Fisheye,
}

/// Pixel, by the point (2 x 3), by the intrinsics (2 x 8).
pub(super) type Projected = (Vector2<f64>, SMatrix<f64, 2, 3>, SMatrix<f64, 2, INTRINSICS>);

/// A direction whose pixel is off by more than this lies on the model's rim, pixels.
const BACK_MOST_PX: f64 = 1e-6;

impl LensModel {
    /// The lens of these intrinsics for pictures of that size.
    pub(super) fn lens(self, intrinsics: [f64; INTRINSICS], (width, height): (u32, u32)) -> Lens {
        let [fx, fy, cx, cy, a, b, c, d] = intrinsics;
        Lens {
            width,
            height,
            focal: DVec2::new(fx, fy),
            centre: DVec2::new(cx, cy),
            distortion: match self {
                Self::RadialTangential => Distortion::radial_tangential(DVec2::new(a, b), DVec2::new(c, d)),
                Self::Fisheye => Distortion::fisheye([a, b, c, d]),
            },
            row_turn: DVec3::ZERO,
        }
    }

    /// The same while it is solved for, when the picture's size does not matter.
    pub(super) fn trial(self, intrinsics: &Intrinsics) -> Lens {
        self.lens((*intrinsics).into(), (1, 1))
    }
}

/// The pixel of a point with its derivatives as matrices; `None` where the lens has none.
pub(super) fn project(lens: &Lens, point: DVec3) -> Option<Projected> {
    let told = lens.linearise(point)?;
    let by_point = SMatrix::<f64, 2, 3>::from_fn(|row, axis| told.by_point[row][axis]);
    let by_intrinsics = SMatrix::<f64, 2, INTRINSICS>::from_fn(|row, i| told.by_intrinsics[row][i]);
    Some((Vector2::new(told.pixel.x, told.pixel.y), by_point, by_intrinsics))
}

/// Direction of a pixel; `None` where no direction falls on it.
pub(super) fn direction(lens: &Lens, pixel: DVec2) -> Option<DVec3> {
    let direction = lens.unproject(pixel);
    lens.project(direction).filter(|back| back.distance(pixel) < BACK_MOST_PX).map(|_| direction)
}
