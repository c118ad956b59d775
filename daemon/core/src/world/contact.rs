//! Hulls that touch.

use glam::DVec2;

use super::boats::{CourseState, Hull};
use crate::geometry::ahead;

/// A hull seen from above: all that lies within half its beam of a line along its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    middle: DVec2,
    /// From the middle to the forward end of the line.
    half: DVec2,
    radius_m: f64,
    velocity: DVec2,
}

/// Two hulls that overlap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// The way by which the first has to move to lie beside the other, metres.
    pub push: DVec2,
    /// The change of its velocity after which it no longer closes, m/s.
    pub stop: DVec2,
}

impl Capsule {
    /// Of a boat.
    pub fn of(hull: Hull, state: &CourseState) -> Self {
        let radius_m = 0.5 * hull.beam_m;
        let half = ahead(state.heading) * (0.5 * hull.length_m - radius_m).max(0.0);
        Self { middle: state.position, half, radius_m, velocity: state.velocity() }
    }

    /// Of something round that lies still at the origin.
    pub const fn round(radius_m: f64) -> Self {
        Self { middle: DVec2::ZERO, half: DVec2::ZERO, radius_m, velocity: DVec2::ZERO }
    }

    /// How far this one has to move off the other; `None` where they do not touch.
    pub fn touches(&self, other: &Self) -> Option<Touch> {
        let reach = self.radius_m + other.radius_m;
        let far = reach + self.half.length() + other.half.length();
        if self.middle.distance_squared(other.middle) >= far * far {
            return None;
        }
        let (mine, theirs) = self.nearest(other);
        let off = mine - theirs;
        let distance = off.length();
        if distance >= reach {
            return None;
        }
        // Past the other's middle line the way out is back, not on.
        let outwards = self.middle - other.middle;
        let side = if off.dot(outwards) < 0.0 { -1.0 } else { 1.0 };
        let away = (off * side).try_normalize().or_else(|| outwards.try_normalize()).unwrap_or(DVec2::X);
        let closing = (self.velocity - other.velocity).dot(away).min(0.0);
        Some(Touch { push: away * (reach - side * distance), stop: -away * closing })
    }

    /// Water between the two, metres; negative where they overlap.
    #[cfg(test)]
    pub fn gap_m(&self, other: &Self) -> f64 {
        let (mine, theirs) = self.nearest(other);
        mine.distance(theirs) - self.radius_m - other.radius_m
    }

    /// The points of both lines that are nearest to each other (Ericson 2005, Real-Time Collision Detection, 5.1.9).
    fn nearest(&self, other: &Self) -> (DVec2, DVec2) {
        let (d1, d2) = (2.0 * self.half, 2.0 * other.half);
        let (p1, p2) = (self.middle - self.half, other.middle - other.half);
        let r = p1 - p2;
        let (a, e, f, c, b) = (d1.length_squared(), d2.length_squared(), d2.dot(r), d1.dot(r), d1.dot(d2));
        let share =
            |above: f64, below: f64| if below > 1e-12 { (above / below).clamp(0.0, 1.0) } else { 0.0 };
        let s = share(b * f - c * e, a * e - b * b);
        let t = share(b * s + f, e);
        // The other's end may be nearer to another place of this one.
        let s = share(b * t - c, a);
        (p1 + d1 * s, p2 + d2 * t)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SKIFF: Hull = Hull { length_m: 7.0, beam_m: 2.0 };

    fn boat(x: f64, y: f64, heading: f64, speed_m_s: f64) -> Capsule {
        Capsule::of(
            SKIFF,
            &CourseState { position: DVec2::new(x, y), heading, speed_m_s, ..CourseState::default() },
        )
    }

    #[test]
    fn boats_beside_each_other_do_not_touch_and_one_that_closes_is_stopped() {
        let me = boat(0.0, 0.0, 0.0, 5.0);
        assert_eq!(me.touches(&boat(2.1, 0.0, 0.0, 5.0)), None);
        assert_eq!(me.touches(&boat(0.0, 7.1, 0.0, 0.0)), None, "bow to stern");
        let touch = me.touches(&boat(0.0, 6.5, 0.0, 0.0)).expect("they overlap");
        assert!((touch.push - DVec2::new(0.0, -0.5)).length() < 1e-9, "{touch:?}");
        assert!((touch.stop - DVec2::new(0.0, -5.0)).length() < 1e-9, "{touch:?}");
    }

    proptest! {
        /// One push frees hulls whose middle lines do not cross; where they do, it moves their middles apart.
        #[test]
        fn a_push_frees_hulls(x in -6.0..6.0_f64, y in -6.0..6.0_f64, heading in 0.0..6.3_f64) {
            let (me, other) = (boat(0.0, 0.0, 0.0, 3.0), boat(x, y, heading, 2.0));
            let Some(touch) = me.touches(&other) else { return Ok(()) };
            let moved = Capsule { middle: me.middle + touch.push, ..me };
            let (mine, theirs) = me.nearest(&other);
            let outwards = me.middle - other.middle;
            if mine.distance(theirs) > 1e-6 && (mine - theirs).dot(outwards) > 0.0 {
                prop_assert!(moved.gap_m(&other) > -1e-9, "{touch:?}");
            } else {
                prop_assert!(moved.middle.distance(other.middle) > me.middle.distance(other.middle), "{touch:?}");
            }
            prop_assert!((me.velocity + touch.stop - other.velocity).dot(touch.push) > -1e-9);
        }
    }
}
