//! How what the camera is taken to have seen changes with its lens, its read-out and the horizon's dip.

use bowwave_core::geometry::{Distortion, Lens};
use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::{Matrix2x3, Matrix2x6, Matrix6, Vector2, Vector6};

use crate::{
    alignment::{BySight, LENS_AND_DIP},
    lens::{BoardPose, Corner},
    solve::so3::{matrix, vector},
};

/// A lens whose focal length is longer by a share, whose principal point lies farther right and down by so many focal lengths, and whose first
/// coefficient of distortion is larger.
pub(crate) fn changed(lens: &Lens, [focal, right, down, bend]: [f64; 4]) -> Lens {
    let distortion = match lens.distortion {
        Distortion::None => Distortion::radial_tangential(DVec2::new(bend, 0.0), DVec2::ZERO),
        Distortion::RadialTangential(d) => {
            Distortion::radial_tangential(d.radial() + DVec2::new(bend, 0.0), d.tangential())
        }
        Distortion::Fisheye(d) => {
            let [first, rest @ ..] = d.k();
            Distortion::fisheye([first + bend, rest[0], rest[1], rest[2]])
        }
    };
    Lens {
        focal: lens.focal * (1.0 + focal),
        centre: lens.centre + DVec2::new(right, down) * lens.focal,
        distortion,
        ..*lens
    }
}

/// Up that fits best to directions on a horizon below the horizontal by `dip`, near `up`: least squares of the sines of their heights.
pub(crate) fn up_through(rays: &[DVec3], dip: f64, up: DVec3) -> Option<DVec3> {
    let mut up = up;
    for _ in 0..3 {
        let across = up.any_orthonormal_vector();
        let other = up.cross(across);
        let (mut n, mut g) = (nalgebra::Matrix2::zeros(), Vector2::zeros());
        for ray in rays {
            let by = Vector2::new(ray.dot(across), ray.dot(other));
            n += by * by.transpose();
            g += by * (ray.dot(up) + dip.sin());
        }
        let step = -n.cholesky()?.solve(&g);
        up = (up + across * step.x + other * step.y).try_normalize()?;
    }
    up.is_finite().then_some(up)
}

/// Changes that derivatives are taken by: shares and radians.
const STEP: f64 = 1e-3;
/// The same for the read-out, seconds.
const STEP_S: f64 = 1e-3;

/// The lens with each of its numbers a little less and a little more.
#[derive(Clone, Debug)]
pub(crate) struct ChangedLenses {
    still: Lens,
    pairs: [[Lens; 2]; 4],
}

impl ChangedLenses {
    pub(crate) fn of(lens: &Lens) -> Self {
        let one = |number: usize, by: f64| {
            let mut numbers = [0.0; 4];
            numbers[number] = by;
            changed(lens, numbers)
        };
        Self { still: *lens, pairs: std::array::from_fn(|i| [one(i, -STEP), one(i, STEP)]) }
    }

    /// Of a horizon: its pixels across the picture are looked at through other lenses. `turned` takes a direction seen at a row (off the middle,
    /// in heights) to the middle row's camera, for a read-out in seconds.
    pub(crate) fn of_horizon(
        &self,
        up: DVec3,
        dip: f64,
        readout_s: f64,
        turned: impl Fn(f64, f64) -> DQuat,
    ) -> Option<BySight> {
        /// Points are this far from the picture's middle at most, share of its width; on either side so many.
        const END: f64 = 0.45;
        const POINTS: i32 = 4;
        let lens = &self.still;
        let (sin, cos) = dip.sin_cos();
        let ahead = (DVec3::Z - up * up.z).try_normalize()?;
        let half = (END * f64::from(lens.width) / lens.focal.x).atan();
        let pixel = |i: i32| {
            let turn = DQuat::from_axis_angle(up, half * f64::from(i) / f64::from(POINTS));
            lens.project((turn * ahead) * cos - up * sin)
        };
        let pixels: Vec<DVec2> = (-POINTS..=POINTS).filter_map(pixel).collect();
        let seen = |lens: &Lens, dip: f64, readout_s: f64| {
            let ray = |p: &DVec2| {
                let row = p.y / f64::from(lens.height) - 0.5;
                turned(row.clamp(-1.0, 1.0), readout_s) * lens.unproject(*p)
            };
            let rays: Vec<DVec3> = pixels.iter().map(ray).collect();
            up_through(&rays, dip, up)
        };
        let slope = |less: Option<DVec3>, more: Option<DVec3>, step: f64| {
            let (less, more) = less.zip(more)?;
            Some(up.cross(more - less) / (2.0 * step))
        };
        let mut by = [DVec3::ZERO; LENS_AND_DIP];
        for (out, [less, more]) in by.iter_mut().zip(&self.pairs) {
            *out = slope(seen(less, dip, readout_s), seen(more, dip, readout_s), STEP)?;
        }
        by[4] = slope(seen(lens, dip - STEP, readout_s), seen(lens, dip + STEP, readout_s), STEP)?;
        let rows = [readout_s - STEP_S, readout_s + STEP_S].map(|s| seen(lens, dip, s));
        Some(BySight { readout: slope(rows[0], rows[1], STEP_S)?, lens: by })
    }
}

/// Of a board: the step that its pose takes where the lens changes. `rate` is the camera's, `past` how fast the board moves past it beside that.
pub(crate) fn of_board(
    lens: &Lens,
    corners: &[Corner],
    pose: &BoardPose,
    rate: DVec3,
    past: DVec3,
) -> Option<BySight> {
    let mut n = Matrix6::zeros();
    let mut by = [Vector6::zeros(); 5];
    for corner in corners {
        let turned = pose.camera_from_board * corner.board.extend(0.0);
        let at = turned + pose.place;
        let told = lens.linearise(at)?;
        let by_point = Matrix2x3::from_fn(|row, axis| told.by_point[row][axis]);
        let across = DMat3::from_cols(DVec3::X.cross(turned), DVec3::Y.cross(turned), DVec3::Z.cross(turned));
        let mut j = Matrix2x6::zeros();
        j.fixed_columns_mut::<3>(0).copy_from(&(by_point * matrix(across)));
        j.fixed_columns_mut::<3>(3).copy_from(&by_point);
        n += j.transpose() * j;
        for (sum, column) in by.iter_mut().zip(columns(&told.by_intrinsics, lens)) {
            *sum += j.transpose() * column;
        }
        let row = corner.pixel.y / f64::from(lens.height) - 0.5;
        by[4] -= j.transpose() * (by_point * vector((rate.cross(at) - past) * row));
    }
    let inverse = n.cholesky()?;
    let turn = |i: usize| {
        let step = -inverse.solve(&by[i]);
        DVec3::new(step[0], step[1], step[2])
    };
    let lens = [turn(0), turn(1), turn(2), turn(3), DVec3::ZERO];
    Some(BySight { readout: turn(4), lens })
}

/// How a pixel changes with the four numbers of [`changed`], by the eight of the lens.
pub(crate) fn columns(by_intrinsics: &[[f64; 8]; 2], lens: &Lens) -> [Vector2<f64>; 4] {
    let column = |i: usize| Vector2::new(by_intrinsics[0][i], by_intrinsics[1][i]);
    [
        column(0) * lens.focal.x + column(1) * lens.focal.y,
        column(2) * lens.focal.x,
        column(3) * lens.focal.y,
        column(4),
    ]
}

#[cfg(test)]
mod tests {
    use bowwave_core::geometry::look;

    use super::*;

    /// What derivatives say a changed lens makes of a horizon is what it makes of it.
    #[test]
    fn a_horizon_turns_with_the_lens_as_the_derivatives_say() {
        let lens = Lens {
            distortion: Distortion::radial_tangential(DVec2::new(-0.1, 0.03), DVec2::ZERO),
            ..Lens::pinhole(1280, 720, 1.0)
        };
        let up = look(0.0, 0.12, 0.1).inverse() * DVec3::Z;
        let by = ChangedLenses::of(&lens).of_horizon(up, 2e-3, 0.0, |_, _| DQuat::IDENTITY).unwrap();
        // Longer: what is below the middle is seen less far below.
        let turned = |turn: DVec3| ((DQuat::from_scaled_axis(turn) * up).z - up.z) * 1e3;
        assert!(turned(by.lens[0] * 0.01) < -0.5, "{}", turned(by.lens[0] * 0.01));
        // The principal point farther down by a hundredth: all is seen farther up by that.
        assert!((turned(by.lens[2] * 0.01).abs() - 9.7).abs() < 0.5, "{}", turned(by.lens[2] * 0.01));
        assert!((by.lens[4].length() - 1.0).abs() < 0.05, "{by:?}");
        assert_eq!(by.readout, DVec3::ZERO);
    }
}
