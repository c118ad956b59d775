//! A flat part of the gun from its picture: the homography of its plane (Hughes, Konttinen and Pattanaik 2004, section 5, phantom generation).
//!
//! Four or more points of the plane are measured on the gun and marked in the picture. They tell how the plane is seen, and so the place on the
//! plane of whatever else is traced in the picture. The paper takes this from the matrix of a marker; here the lens is taken out first, and the
//! points' equations are solved by the normalised direct linear transform (Hartley 1997).

use bowwave_core::geometry::Lens;
use glam::{DMat3, DVec2, DVec3};
use nalgebra::Matrix3;

use crate::{
    lens::conditioned,
    solve::so3::{dmat, dvec, nearest_rotation, vector},
};

/// A point is marked in the picture to this many pixels.
pub const MARKED_PX: f64 = 0.5;
/// Errors of places on the plane that are taken, as a share of how far its points lie from their middle.
pub const ERROR_MOST: f64 = 0.1;
/// Points that are taken.
pub const POINTS_MOST: usize = 64;
/// Points that a pixel or a millimetre parts are one.
const APART_PX: f64 = 1.0;
const APART_M: f64 = 1e-3;
/// Three points lie on a line where their triangle is no higher than this share of its longest side.
const FLAT: f64 = 0.03;
/// Farther from the lens's axis than this nothing is marked: cosine.
const OFF_AXIS: f64 = 0.17;

/// A point of the plane and where it is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenPoint {
    /// In the picture, pixels.
    pub pixel: DVec2,
    /// In the plane, metres.
    pub plane: DVec2,
}

/// Points that do not tell how a plane is seen.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlaneError {
    /// Fewer than four, or too many.
    #[error("{0} points: give 4 to {POINTS_MOST}, as x,y=X,Y in pixels and metres")]
    Count(usize),
    /// A point is not where this lens can tell it.
    #[error(
        "point {0} lies more than 80 degrees off the lens's axis: mark it nearer to the picture's middle"
    )]
    OffAxis(usize),
    /// Two points are one.
    #[error(
        "points {0} and {1} are less than a millimetre or a pixel apart: measure another one in place of one of them"
    )]
    Same(usize, usize),
    /// Three points of four lie on a line.
    #[error("points {}, {} and {} lie on a line: measure one of them elsewhere, or a fifth off that line", .0[0], .0[1], .0[2])]
    Line([usize; 3]),
    /// The points do not go around the plane as they do in the picture.
    #[error(
        "the points' order differs between picture and plane: two of them were mistaken for each other, or one lies behind the camera"
    )]
    Order,
    /// The plane is seen too nearly along itself, or is too small.
    #[error(
        "the plane is seen edge-on or too small: condition number {condition:.0}, at most {most:.0} for points that lie {spread_px:.0} px about \
         their middle. Half a pixel would be {off_mm:.0} mm on it: take a picture with the plane turned to the camera or nearer, mark points \
         farther apart, or make a model of the part (--model)"
    )]
    Condition {
        /// Of the equations.
        condition: f64,
        /// The largest that is taken.
        most: f64,
        /// Mean distance of the points from their middle, pixels.
        spread_px: f64,
        /// Error of places on the plane by one of [`MARKED_PX`], millimetres.
        off_mm: f64,
    },
    /// A place of the picture shows nothing of the plane.
    #[error("corner {0} lies at or beyond the plane's horizon: trace it on the plane")]
    Horizon(usize),
}

/// A plane as the camera sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneView {
    lens: Lens,
    /// From the plane (metres, 1) to undistorted coordinates (x/z, y/z, 1) by a factor that is above 0 where the plane is seen.
    seen_from_plane: DMat3,
    condition: f64,
    condition_most: f64,
    rms_px: f64,
}

impl PlaneView {
    /// From points of the plane that are seen through `lens`.
    ///
    /// An error of `e` pixels is a relative one of `e / s` in the equations, where `s` is the points' mean distance from their middle in pixels,
    /// and the solution's relative error is at most about the condition number times that. So places on the plane are off by about
    /// `condition e / s` of the points' own extent; with [`MARKED_PX`] and [`ERROR_MOST`] this bounds the condition number.
    ///
    /// # Errors
    /// Too few points, points that are one or lie on a line, a plane that is seen edge-on.
    pub fn new(lens: &Lens, points: &[SeenPoint]) -> Result<Self, PlaneError> {
        if !(4..=POINTS_MOST).contains(&points.len()) {
            return Err(PlaneError::Count(points.len()));
        }
        if let Some((a, b)) = same(points) {
            return Err(PlaneError::Same(a, b));
        }
        let seen = |(i, p): (usize, &SeenPoint)| {
            Ok((p.plane, tangents(lens, p.pixel).ok_or(PlaneError::OffAxis(i + 1))?))
        };
        let pairs = points.iter().enumerate().map(seen).collect::<Result<Vec<_>, PlaneError>>()?;
        let spread_px = spread(pairs.iter().map(|(_, seen)| *seen * lens.focal));
        let most = ERROR_MOST * spread_px / MARKED_PX;
        let (h, condition) = conditioned(&pairs).unwrap_or((Matrix3::zeros(), f64::INFINITY));
        // A NaN is refused as well.
        let is_told = condition <= most;
        if !is_told {
            if let Some(line) = line_of(points) {
                return Err(PlaneError::Line(line));
            }
            let spread_mm = 1000.0 * spread(points.iter().map(|p| p.plane));
            let off_mm = condition * MARKED_PX / spread_px * spread_mm;
            return Err(PlaneError::Condition { condition, most, spread_px, off_mm });
        }
        let h = dmat(&h);
        let depth = |plane: DVec2| (h * plane.extend(1.0)).z;
        let ahead = points.iter().filter(|p| depth(p.plane) > 0.0).count();
        if ahead != 0 && ahead != points.len() {
            return Err(PlaneError::Order);
        }
        let seen_from_plane = if ahead == 0 { -h } else { h };
        let mut view = Self { lens: *lens, seen_from_plane, condition, condition_most: most, rms_px: 0.0 };
        let squares: f64 = points.iter().map(|p| view.off(p).powi(2)).sum();
        view.rms_px = (squares / points.len() as f64).sqrt();
        Ok(view)
    }

    /// Condition number of the equations, and the largest that is taken for these points.
    pub fn condition(&self) -> [f64; 2] {
        [self.condition, self.condition_most]
    }

    /// By how much the points miss their pixels, rms; of four they never do.
    pub fn rms_px(&self) -> f64 {
        self.rms_px
    }

    fn off(&self, point: &SeenPoint) -> f64 {
        self.pixel(point.plane).map_or(f64::INFINITY, |pixel| pixel.distance(point.pixel))
    }

    /// The pixel of a place on the plane, metres; `None` where the camera does not see it.
    pub fn pixel(&self, plane: DVec2) -> Option<DVec2> {
        let seen = self.seen_from_plane * plane.extend(1.0);
        if seen.z > 0.0 { self.lens.project(seen) } else { None }
    }

    /// Places on the plane, metres, of pixels.
    ///
    /// # Errors
    /// Names the first that does not show the plane.
    pub fn places(&self, pixels: &[DVec2]) -> Result<Vec<DVec2>, PlaneError> {
        let plane_from_seen = self.seen_from_plane.inverse();
        let place = |(i, pixel): (usize, &DVec2)| {
            let seen = tangents(&self.lens, *pixel).ok_or(PlaneError::OffAxis(i + 1))?;
            let place = plane_from_seen * seen.extend(1.0);
            // A ray that meets the plane before the camera has the sign of the points' own.
            let place = Some(place).filter(|p| p.z > 0.0).map(|p| p.truncate() / p.z);
            place.filter(|p| p.is_finite()).ok_or(PlaneError::Horizon(i + 1))
        };
        pixels.iter().enumerate().map(place).collect()
    }

    /// The plane in the camera's space as the homography tells it (Zhang 2000, section 3.1); `None` where it contradicts itself.
    pub fn in_camera(&self) -> Option<PlaneFrame> {
        let h = self.seen_from_plane;
        let scale = 2.0 / (h.x_axis.length() + h.y_axis.length());
        let (x, y) = (h.x_axis * scale, h.y_axis * scale);
        let (rotation, ..) =
            nearest_rotation(&Matrix3::from_columns(&[vector(x), vector(y), vector(x.cross(y))]))?;
        let origin = dvec(&vector(h.z_axis * scale));
        let frame = PlaneFrame { origin, right: rotation * DVec3::X, up: rotation * DVec3::Y };
        (origin.is_finite() && frame.right.is_finite() && frame.up.is_finite()).then_some(frame)
    }
}

/// A plane in space: where its origin lies and how its axes run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneFrame {
    /// Its origin, metres.
    pub origin: DVec3,
    /// Unit vector along its first axis.
    pub right: DVec3,
    /// Unit vector along its second axis.
    pub up: DVec3,
}

impl PlaneFrame {
    /// By its origin and two axes of any length.
    ///
    /// # Errors
    /// Axes that are no directions or not at right angles to a degree.
    pub fn new(origin: DVec3, right: DVec3, up: DVec3) -> Result<Self, String> {
        let (Some(right), Some(up)) = (right.try_normalize(), up.try_normalize()) else {
            return Err("an axis of the plane has no length: give the direction in which it runs".to_owned());
        };
        let off = right.dot(up).abs().min(1.0).asin().to_degrees();
        if off > 1.0 {
            let angle = 90.0 - off;
            return Err(format!("the plane's axes meet at {angle:.0} degrees: give two at right angles"));
        }
        let up = up.reject_from_normalized(right).normalize();
        Ok(Self { origin, right, up })
    }

    /// A place on the plane in space, metres.
    pub fn at(&self, plane: DVec2) -> DVec3 {
        self.origin + self.right * plane.x + self.up * plane.y
    }
}

/// Undistorted coordinates of a pixel, x/z and y/z.
fn tangents(lens: &Lens, pixel: DVec2) -> Option<DVec2> {
    let ray = lens.unproject(pixel);
    (ray.z > OFF_AXIS).then(|| ray.truncate() / ray.z)
}

/// Mean distance of places from their middle.
fn spread(places: impl Iterator<Item = DVec2> + Clone) -> f64 {
    let count = places.clone().count().max(1) as f64;
    let middle = places.clone().sum::<DVec2>() / count;
    places.map(|p| p.distance(middle)).sum::<f64>() / count
}

/// Numbers of two points that are one.
fn same(points: &[SeenPoint]) -> Option<(usize, usize)> {
    let pairs = (0..points.len()).flat_map(|a| (a + 1..points.len()).map(move |b| (a, b)));
    let is_same = |(a, b): &(usize, usize)| {
        let (a, b) = (points[*a], points[*b]);
        a.plane.distance(b.plane) < APART_M || a.pixel.distance(b.pixel) < APART_PX
    };
    pairs.into_iter().find(is_same).map(|(a, b)| (a + 1, b + 1))
}

/// Numbers of three points on a line, where all others but one lie on it, too: then nothing holds the plane's turn about it.
fn line_of(points: &[SeenPoint]) -> Option<[usize; 3]> {
    let count = points.len();
    let is_flat = |[a, b, c]: [usize; 3]| {
        let [a, b, c] = [a, b, c].map(|i| points[i].plane);
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        (b - a).perp_dot(c - a).abs() < FLAT * longest
    };
    let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
    let on = |(a, b): (usize, usize)| -> Vec<usize> {
        (0..count).filter(|c| *c == a || *c == b || is_flat([a, b, *c])).collect()
    };
    let longest =
        pairs.map(on).max_by_key(Vec::len).filter(|line| line.len() >= 3 && line.len() + 1 >= count)?;
    Some([longest[0] + 1, longest[1] + 1, longest[2] + 1])
}

#[cfg(test)]
mod tests;
