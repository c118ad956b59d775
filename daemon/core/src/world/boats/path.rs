//! Tracks made of straight lines and arcs, by distance sailed.

use std::f64::consts::{PI, TAU};

use glam::DVec2;

use crate::geometry::{ahead, heading_of, starboard};

/// A place on a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PathPlace {
    pub position: DVec2,
    /// Radians clockwise from north.
    pub heading: f64,
    /// Change of heading per metre sailed, clockwise.
    pub curvature: f64,
}

/// One stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PathPiece {
    /// Distance sailed where it starts, metres.
    start_m: f64,
    /// Infinite for a last piece that goes on for ever.
    length_m: f64,
    place: PathPlace,
}

impl PathPiece {
    fn at(&self, along_m: f64) -> PathPlace {
        let PathPlace { position, heading, curvature } = self.place;
        if curvature == 0.0 {
            return PathPlace { position: position + ahead(heading) * along_m, ..self.place };
        }
        // An endless circle must not lose digits, so whole turns are taken off first.
        let turned = (along_m * curvature) % TAU;
        let centre = position + starboard(heading) / curvature;
        let now = heading + turned;
        PathPlace { position: centre - starboard(now) / curvature, heading: now, curvature }
    }
}

/// The end of a path, after the last piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ending {
    /// The last piece is endless, or the boat stays at its end.
    Stay,
    /// The path goes on at this distance from its start.
    Repeat(f64),
}

/// Pieces one after the other.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CoursePath {
    pieces: Vec<PathPiece>,
    /// Where the next piece starts.
    end: PathPlace,
    length_m: f64,
    ending: Ending,
}

impl CoursePath {
    pub fn start(position: DVec2, heading: f64) -> Self {
        let end = PathPlace { position, heading, curvature: 0.0 };
        Self { pieces: Vec::new(), end, length_m: 0.0, ending: Ending::Stay }
    }

    /// Goes straight on for `length_m`, or for ever where that is infinite.
    #[must_use]
    pub fn line(self, length_m: f64) -> Self {
        self.piece(0.0, length_m)
    }

    /// Turns by `angle` (positive to starboard) on a circle of `radius_m`; for ever where the angle is infinite.
    #[must_use]
    pub fn turn(self, angle: f64, radius_m: f64) -> Self {
        self.piece(angle.signum() / radius_m, angle.abs() * radius_m)
    }

    fn piece(mut self, curvature: f64, length_m: f64) -> Self {
        if length_m > 0.0 {
            let piece =
                PathPiece { start_m: self.length_m, length_m, place: PathPlace { curvature, ..self.end } };
            if length_m.is_finite() {
                self.end = PathPlace { curvature: 0.0, ..piece.at(length_m) };
            }
            self.pieces.push(piece);
            self.length_m += length_m;
        }
        self
    }

    /// Comes back to what was sailed after `from_m`, for ever.
    #[must_use]
    pub fn repeat_from(mut self, from_m: f64) -> Self {
        self.ending = Ending::Repeat(from_m);
        self
    }

    /// Metres from start to end, infinite for an endless last piece.
    pub const fn length_m(&self) -> f64 {
        self.length_m
    }

    pub const fn ending(&self) -> Ending {
        self.ending
    }

    /// The place after `sailed_m` metres.
    pub fn at(&self, sailed_m: f64) -> PathPlace {
        let sailed_m = match self.ending {
            Ending::Repeat(from_m) if sailed_m > from_m => {
                from_m + (sailed_m - from_m).rem_euclid(self.length_m - from_m)
            }
            _ => sailed_m.max(0.0),
        };
        let next = self.pieces.partition_point(|p| p.start_m <= sailed_m);
        match self.pieces.get(next.saturating_sub(1)) {
            Some(piece) if sailed_m - piece.start_m <= piece.length_m => piece.at(sailed_m - piece.start_m),
            _ => self.end,
        }
    }
}

/// A path along corners with each corner cut by an arc of at most `radius_m`. At least two points, neighbours apart, no turn
/// near 180 degrees: the caller has checked.
pub(super) fn along(points: &[DVec2], radius_m: f64, closed: bool) -> CoursePath {
    let n = points.len();
    let leg = |i: usize| points[(i + 1) % n] - points[i % n];
    // The corner at the end of leg i: angle turned, and length of both legs that the arc takes.
    let corner = |i: usize| {
        let (a, b) = (leg(i), leg(i + 1));
        let angle = wrap(heading_of(b) - heading_of(a));
        let half = (angle / 2.0).tan().abs();
        let cut = (radius_m * half).min(0.45 * a.length().min(b.length()));
        (angle, cut, if half > 1e-9 { cut / half } else { f64::INFINITY })
    };
    let turn = |path: CoursePath, (angle, _, radius): (f64, f64, f64)| {
        if radius.is_finite() { path.turn(angle, radius) } else { path }
    };
    let legs = if closed { n } else { n - 1 };
    let before_first = if closed { corner(n - 1).1 } else { 0.0 };
    let mut path = CoursePath::start(points[0], heading_of(leg(0))).line(before_first);
    let mut cut_before = before_first;
    for i in 0..legs {
        let last = !closed && i + 1 == legs;
        let cut_after = if last { 0.0 } else { corner(i).1 };
        path = path.line(leg(i).length() - cut_before - cut_after);
        if !last {
            path = turn(path, corner(i));
        }
        cut_before = cut_after;
    }
    if closed { path.repeat_from(before_first) } else { path }
}

/// An angle brought to -pi to pi.
pub(super) fn wrap(angle: f64) -> f64 {
    let a = angle.rem_euclid(TAU);
    if a > PI { a - TAU } else { a }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn check_smooth(path: &CoursePath, until_m: f64) {
        let step = 0.01;
        let mut last = path.at(0.0);
        for i in 1..(until_m / step) as u32 {
            let now = path.at(f64::from(i) * step);
            let moved = now.position - last.position;
            assert!((moved.length() - step).abs() < 1e-4, "{i}: moved {} m in {step} m", moved.length());
            assert!(wrap(now.heading - heading_of(moved)).abs() < 0.02, "{i}: heading {} off", now.heading);
            last = now;
        }
    }

    #[test]
    fn a_square_with_cut_corners_repeats_without_a_seam() {
        let square = [(0.0, 0.0), (0.0, 100.0), (100.0, 100.0), (100.0, 0.0)].map(|(x, y)| DVec2::new(x, y));
        let path = along(&square, 10.0, true);
        check_smooth(&path, 1500.0);
        // Four sides less the corners: each arc is pi/2 * 10 instead of twice 10.
        let lap = 4.0 * (80.0 + PI / 2.0 * 10.0);
        assert!((path.length_m() - 10.0 - lap).abs() < 1e-9);
        let (once, later) = (path.at(25.0), path.at(25.0 + 1e6 * lap));
        assert!((once.position - later.position).length() < 1e-5);
    }

    #[test]
    fn a_line_ends_at_its_last_point() {
        let points = [DVec2::ZERO, DVec2::new(30.0, 0.0), DVec2::new(30.0, 40.0)];
        let path = along(&points, 5.0, false);
        check_smooth(&path, path.length_m() - 0.02);
        assert!((path.at(1e9).position - points[2]).length() < 1e-9);
    }

    #[test]
    fn an_endless_circle_keeps_its_radius() {
        let path = CoursePath::start(DVec2::new(0.0, 80.0), PI / 2.0).turn(f64::INFINITY, 80.0);
        for sailed in [0.0, 1.0, 1e4, 1e9] {
            assert!((path.at(sailed).position.length() - 80.0).abs() < 1e-6, "{sailed}");
        }
    }

    proptest! {
        #[test]
        fn any_track_is_smooth(
            radii in prop::collection::vec(100.0..200.0_f64, 4..8), radius in 1.0..60.0_f64, closed in any::<bool>(),
            mirrored in any::<bool>(),
        ) {
            let n = radii.len();
            let side = if mirrored { -1.0 } else { 1.0 };
            let corner = |(i, r): (usize, &f64)| ahead(side * TAU * i as f64 / n as f64) * *r;
            let points: Vec<DVec2> = radii.iter().enumerate().map(corner).collect();
            let path = along(&points, radius, closed);
            let mut last = path.at(0.0);
            for i in 1..900 {
                let now = path.at(f64::from(i));
                let moved = (now.position - last.position).length();
                prop_assert!(moved < 1.0 + 1e-9, "jump of {moved} m at {i} m");
                prop_assert!(moved > 0.5 || f64::from(i) > path.length_m(), "stands still at {i} m");
                last = now;
            }
        }
    }
}
