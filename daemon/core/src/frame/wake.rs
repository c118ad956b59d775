//! The wake of a boat under way: the track of its hull, and how high its waves are.
//!
//! The pattern itself (Kelvin's wedge of 19.47 degrees, transverse waves of wavelength 2 pi U^2 / g, foam) is drawn by the renderer
//! along the track; here is where the boat was, and the amounts.

use std::fmt;

use glam::{DVec2, DVec3};

use crate::{
    geometry::ahead,
    physics::GRAVITY_M_S2,
    world::boats::{CourseState, Hull},
};

/// Points that a track has at most.
pub const TRACK_POINTS: usize = 32;
/// How long a wake is followed, seconds. Foam has gone by then, and waves have run away from the track.
pub const FOLLOWED_S: f64 = 15.0;
/// How long waves are drawn, seconds: farther off they are lost among the sea's own.
pub const WAVES_S: f64 = 9.0;
/// Slower boats leave nothing that is seen, m/s: their waves are shorter than a hand.
pub const SPEED_MIN_M_S: f64 = 0.5;
/// Half of Kelvin's wedge: its sine is 1/3, its tangent 1/root 8 (Thomson 1887).
pub const WEDGE_TANGENT: f64 = 0.353_553_390_593_273_8;
/// Froude numbers (speed by the root of g times length) between which foam begins and is whole: short of 0.12 even full bows do not break
/// their waves, from 0.45 on the stern is left dry and all of it breaks (Larsson & Raven 2010, Ship Resistance and Flow, ch. 5).
pub const FOAM_FROUDE: (f64, f64) = (0.12, 0.45);

/// A place of the track.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackPoint {
    /// On the water, world, metres.
    pub position: DVec3,
    /// Unit vector to starboard of the way that the boat went here, world x and y.
    pub starboard: DVec2,
    /// Metres behind the bow, along the track; negative ahead of it.
    pub along_m: f64,
    /// Seconds since the boat's middle was here; negative where it has yet to come.
    pub age_s: f64,
    /// Speed of the boat when it was here, m/s.
    pub speed_m_s: f64,
    /// Metres to each side within which the track does not meet itself.
    pub reach_m: f64,
    /// Metres to each side to which waves, or foam thrown up by the bow, are seen.
    pub drawn_m: f64,
}

/// The track of one boat and the hull that made it.
#[derive(Clone, Copy, PartialEq)]
pub struct Wake {
    /// The hull at the water line.
    pub hull: Hull,
    /// How deep it reaches below the water line, metres.
    pub draught_m: f64,
    points: [TrackPoint; TRACK_POINTS],
    count: usize,
}

/// Of the track, as many points as there are and a hash of all their bits: the text of a scene tells two runs apart, frame by frame, and that of
/// fifty tracks alone would take a millisecond.
impl fmt::Debug for Wake {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { hull, draught_m, points: _, count } = self;
        let numbers = self.points().iter().flat_map(|point| {
            let TrackPoint { position, starboard, along_m, age_s, speed_m_s, reach_m, drawn_m } = *point;
            let DVec3 { x, y, z } = position;
            [x, y, z, starboard.x, starboard.y, along_m, age_s, speed_m_s, reach_m, drawn_m]
        });
        // As Knuth's linear congruence mixes; each number goes through a turn of the bits, so that the highest ones count below.
        let hash = numbers.fold(0_u64, |hash, number| {
            (hash ^ number.to_bits()).wrapping_mul(0x5851_f42d_4c95_7f2d).rotate_left(29)
        });
        to.debug_struct("Wake")
            .field("hull", hull)
            .field("draught_m", draught_m)
            .field("points", count)
            .field("hash", &hash)
            .finish()
    }
}

impl Wake {
    /// The wake of a boat at `time_s`. `course` tells where it was at any time since 0; before, it came straight on as it was at 0.
    /// `water` is the height of the water at a place now. `None` where the boat has lain still.
    pub fn of(
        hull: Hull,
        draught_m: f64,
        time_s: f64,
        course: impl Fn(f64) -> CourseState,
        water: impl Fn(DVec2) -> f64,
    ) -> Option<Self> {
        /// The track begins so far ahead of the bow, in lengths.
        const AHEAD: f64 = 0.08;
        let state = |age: f64| {
            let before = (age - time_s).max(0.0);
            let state = course((time_s - age).max(0.0));
            CourseState {
                position: state.position - ahead(state.heading) * (state.speed_m_s * before),
                ..state
            }
        };
        let now = state(0.0);
        let mut wake = Self { hull, draught_m, points: [TrackPoint::default(); TRACK_POINTS], count: 0 };
        let half = hull.length_m / 2.0;
        for along_m in [-AHEAD * hull.length_m, 0.0, half / 2.0, half] {
            let at = CourseState { position: now.position + ahead(now.heading) * (half - along_m), ..now };
            wake.push(&at, along_m, (along_m - half) / now.speed_m_s.max(SPEED_MIN_M_S), &water);
        }
        let (mut along_m, mut before) = (half, now);
        let steps = TRACK_POINTS - wake.count;
        for i in 1..=steps {
            // Closer to each other where the wake is fresh.
            let age = FOLLOWED_S * (i as f64 / steps as f64).powf(1.25);
            let then = state(age);
            let moved = (then.position - before.position).length();
            if moved < 0.1 * hull.beam_m {
                continue;
            }
            along_m += moved;
            wake.push(&then, along_m, age, &water);
            before = then;
        }
        let moving = wake.points().iter().any(|p| p.speed_m_s >= SPEED_MIN_M_S);
        moving.then_some(wake)
    }

    fn push(&mut self, at: &CourseState, along_m: f64, age_s: f64, water: impl Fn(DVec2) -> f64) {
        /// Share of the ring about a turning boat's centre that its track takes before it would meet itself.
        const INSIDE_TURN: f64 = 0.85;
        let curvature = (at.turn_rate / at.speed_m_s.max(SPEED_MIN_M_S)).abs();
        if let Some(point) = self.points.get_mut(self.count) {
            *point = TrackPoint {
                position: at.position.extend(water(at.position)),
                starboard: -ahead(at.heading).perp(),
                along_m,
                age_s,
                speed_m_s: at.speed_m_s,
                reach_m: INSIDE_TURN / curvature.max(1e-6),
                drawn_m: drawn_m(&self.hull, self.draught_m, at.speed_m_s, along_m, age_s),
            };
            self.count += 1;
        }
    }

    /// The track from ahead of the bow backwards.
    pub fn points(&self) -> &[TrackPoint] {
        self.points.get(..self.count).unwrap_or(&[])
    }

    /// Corners on the water of each strip from one point to the next, numbered as those of a box that is flat: bit 0 tells sides,
    /// bit 2 ends.
    pub fn strips(&self) -> impl ExactSizeIterator<Item = [DVec3; 8]> {
        self.points().windows(2).map(|pair| {
            std::array::from_fn(|corner| {
                let (point, side) = (&pair[corner / 4], if corner & 1 == 0 { 1.0 } else { -1.0 });
                point.position + (point.starboard * (side * self.half_width_m(point))).extend(0.0)
            })
        })
    }

    /// The same with every point moved upwards by what `lift` says of its place, metres.
    #[must_use]
    pub fn lifted(mut self, lift: impl Fn(DVec2) -> f64) -> Self {
        for point in &mut self.points {
            point.position.z += lift(point.position.truncate());
        }
        self
    }

    /// Metres to each side of a point that is drawn: the mixed water behind the hull, and what is seen of its waves and of the bow's foam.
    pub fn half_width_m(&self, point: &TrackPoint) -> f64 {
        let beam_m = self.hull.beam_m;
        (1.4 * beam_m + 0.4 + point.drawn_m).min(point.reach_m.max(0.6 * beam_m))
    }
}

/// Reach to each side of the track of all that is seen but the mixed water behind the hull, metres. The last seconds of it, faint as they are,
/// are cut off at the sides.
fn drawn_m(hull: &Hull, draught_m: f64, speed_m_s: f64, along_m: f64, age_s: f64) -> f64 {
    let drawn = ((WAVES_S - age_s) / (0.5 * WAVES_S)).clamp(0.0, 1.0);
    let wedge = WITH_CUSP * WEDGE_TANGENT * along_m.max(0.0);
    let seen = || {
        waves_within_m(hull, draught_m, speed_m_s, along_m, age_s)
            .max(bow_foam_within_m(hull, speed_m_s, along_m, age_s))
    };
    if drawn * wedge > 0.0 { (drawn * wedge).min(seen()) } else { 0.0 }
}

/// Waves of the cusp reach so many times as far as the wedge.
const WITH_CUSP: f64 = 1.2;

/// Reach to each side of the track of waves that are steep enough to be drawn, metres: `wake.frag` draws either of Kelvin's two waves from its
/// least slope on. Of a boat that is fast for its length, the long waves at the wedge's edge are not.
fn waves_within_m(hull: &Hull, draught_m: f64, speed_m_s: f64, along_m: f64, age_s: f64) -> f64 {
    /// Slope below which nothing of a wave is drawn, fall of the spectrum beyond which nothing is, and by how much noise raises waves at most.
    const SLOPE_SEEN: f64 = 0.003;
    const FALL_MAX: f64 = 9.0;
    const UNEVEN: f64 = 1.45;
    /// Places that are looked at, from the wedge's edge inwards: shares of its tangent.
    const PLACES: [f64; 6] = [1.0, 0.85, 0.7, 0.5, 0.3, 0.1];
    let (length_m, along_m) = (hull.length_m, along_m.max(0.02 * hull.length_m));
    let fresh = (1.0 - age_s / WAVES_S).clamp(0.0, 1.0);
    let highest = 0.4 * height_m(speed_m_s, hull, draught_m) * fresh * fresh;
    let k0 = GRAVITY_M_S2 / speed_m_s.max(0.3).powi(2);
    let own = [0.1 * length_m, 0.15 * hull.beam_m].map(|m| 0.5 * std::f64::consts::LOG2_E * m * m);
    let is_seen = |share: f64| {
        let tangent = share * WEDGE_TANGENT;
        let (aside_m, from_bow_m) = (tangent * along_m, along_m * tangent.hypot(1.0));
        let far_m = aside_m + 0.1 * from_bow_m + 0.3 * length_m;
        let inside = (1.0 - share * share).max(0.0);
        let sharp = (k0 * from_bow_m).max(0.1).sqrt();
        let strength =
            UNEVEN * highest * (length_m / far_m).powf(DISTANCE_POWER) / (inside + 1.0 / sharp).sqrt().sqrt();
        // Tangents of the angles of the transverse and the diverging wave that are seen here.
        let middle = std::f64::consts::FRAC_1_SQRT_2;
        let [one, two] = [-1.0, 1.0].map(|side| 0.25 * (1.0 + side * inside.sqrt()) / tangent);
        [one.min(middle), two.max(middle)].into_iter().any(|t| {
            let k = k0 * (1.0 + t * t);
            let long_ones = (k * length_m / std::f64::consts::TAU).powi(2);
            let fall = k0 * k * (own[0] + t * t * own[1]);
            strength * long_ones / (1.0 + long_ones) * k >= SLOPE_SEEN && fall <= FALL_MAX
        })
    };
    let outermost = PLACES.iter().position(|share| is_seen(*share));
    // From the place that is seen to the one farther out, of which nothing is.
    outermost.map_or(0.0, |i| WITH_CUSP * WEDGE_TANGENT * along_m * PLACES[i.saturating_sub(1)])
}

/// Reach to each side of the track of the foam that the bow throws up, metres, as `wake.frag` has it drift off.
fn bow_foam_within_m(hull: &Hull, speed_m_s: f64, along_m: f64, age_s: f64) -> f64 {
    /// Cover of which no lace is seen.
    const COVER_MIN: f64 = 0.03;
    let since_bow_s = (age_s + 0.5 * hull.length_m / speed_m_s.max(SPEED_MIN_M_S)).max(0.0);
    let foams = froude(speed_m_s, hull.length_m) > FOAM_FROUDE.0;
    let is_seen = foams && 0.7 * (-since_bow_s / 3.53).exp() > COVER_MIN;
    if is_seen { 0.8 * hull.beam_m + 0.24 * along_m.max(0.0) } else { 0.0 }
}

/// Height from trough to crest of the highest waves of a boat, one length of it off its track, metres.
///
/// The lesser of two: what recreational boats were measured to make in all their ranges of speed (Bhowmik et al. 1991: H = 0.537
/// V^-0.346 y^-0.345 L^0.56 D^0.355, metres and seconds), and the bow wave that a slow boat can raise at all (Noblesse et al. 2006:
/// Z = 2.2 tan a / (1 + F_D) U^2 / g, a the half angle of the bow, F_D the Froude number by draught).
pub fn height_m(speed_m_s: f64, hull: &Hull, draught_m: f64) -> f64 {
    if speed_m_s < SPEED_MIN_M_S || hull.length_m <= 0.0 || draught_m <= 0.0 {
        return 0.0;
    }
    let measured =
        0.537 * speed_m_s.powf(-0.346) * hull.length_m.powf(0.56 - DISTANCE_POWER) * draught_m.powf(0.355);
    // A bow widens over two fifths of its length.
    let tangent = hull.beam_m / (0.8 * hull.length_m);
    let froude = speed_m_s / (GRAVITY_M_S2 * draught_m).sqrt();
    let raised = 2.2 * tangent / (1.0 + froude) * speed_m_s * speed_m_s / GRAVITY_M_S2;
    measured.min(raised)
}

/// Wave heights fall with this power of the distance (Bhowmik et al. 1991; the cusp's own is 1/3, Havelock 1908).
pub const DISTANCE_POWER: f64 = 0.345;

/// Froude number by length.
pub fn froude(speed_m_s: f64, length_m: f64) -> f64 {
    speed_m_s / (GRAVITY_M_S2 * length_m.max(0.1)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::boats::{BoatDamage, Course};

    const SKIFF: Hull = Hull { length_m: 7.0, beam_m: 2.0 };

    fn wake(course: &Course, time_s: f64) -> Option<Wake> {
        Wake::of(SKIFF, 0.4, time_s, |t| course.state(t, &BoatDamage::NONE), |_| 0.0)
    }

    #[test]
    fn a_boat_that_lies_still_leaves_nothing_and_one_that_stopped_leaves_what_it_had() {
        let still = Course::still(DVec2::new(0.0, 80.0), 0.4).unwrap();
        assert_eq!(wake(&still, 20.0), None);
        let points = [DVec2::new(100.0, 80.0)];
        let arriving = Course::waypoints(DVec2::new(0.0, 80.0), &points, 8.0, false).unwrap();
        let stopped = wake(&arriving, 22.0).expect("it was under way");
        assert!(arriving.state(22.0, &BoatDamage::NONE).speed_m_s < SPEED_MIN_M_S);
        assert!(stopped.points()[0].speed_m_s < SPEED_MIN_M_S);
        assert!(stopped.points().iter().any(|p| p.speed_m_s > 7.0));
        assert_eq!(wake(&arriving, 90.0), None, "long after it lies still");
    }

    #[test]
    fn a_wake_follows_the_track_of_a_turning_boat() {
        let centre = DVec2::new(0.0, 0.0);
        let square =
            [(100.0, 100.0), (100.0, -100.0), (-100.0, -100.0)].map(|(x, y)| DVec2::new(x, y) + centre);
        let course = Course::waypoints(DVec2::new(-100.0, 100.0), &square, 9.0, true).unwrap();
        // Some seconds after the first corner the boat goes another way than it came.
        let time =
            (0..60).map(f64::from).find(|t| course.state(*t, &BoatDamage::NONE).heading > 3.0).unwrap();
        let wake = wake(&course, time + 2.0).unwrap();
        for p in wake.points().iter().filter(|p| p.age_s > 0.0 && p.age_s < time) {
            let was = course.state(time + 2.0 - p.age_s, &BoatDamage::NONE);
            assert!((p.position.truncate() - was.position).length() < 1e-9, "age {}", p.age_s);
            assert!(p.starboard.dot(DVec2::new(was.heading.cos(), -was.heading.sin())) > 0.999_999);
        }
        let turned = wake.points().iter().filter(|p| p.reach_m < 30.0).count();
        assert!(turned > 1, "the arc of 25 m radius limits the wake's width");
        // Distances along the track: chords of the arc are a little shorter than the arc.
        let last = wake.points().last().unwrap();
        assert!((last.along_m - 3.5 - 9.0 * FOLLOWED_S).abs() < 2.0, "{}", last.along_m);
    }

    #[test]
    fn before_the_scenario_began_a_boat_came_straight_on() {
        let course = Course::straight(DVec2::new(5.0, 90.0), 1.0, 6.0).unwrap();
        let wake = wake(&course, 0.0).unwrap();
        let last = wake.points().last().unwrap();
        assert!((last.along_m - 3.5 - 6.0 * FOLLOWED_S).abs() < 1e-6);
        assert!(wake.points().iter().all(|p| p.position.is_finite()));
    }

    #[test]
    fn heights_are_those_of_the_sources() {
        // Bhowmik's equation at 10 m for a boat of 10 m and 0.7 m draught at 8 m/s, by hand: 0.537 * 0.487 * 0.452 * 3.631 * 0.881.
        let launch = Hull { length_m: 10.0, beam_m: 3.0 };
        assert!((height_m(8.0, &launch, 0.7) - 0.378).abs() < 0.003, "{}", height_m(8.0, &launch, 0.7));
        // Slow, the bow wave: 2.2 * 0.375 / (1 + 1 / 2.62) * 1 / 9.81.
        assert!((height_m(1.0, &launch, 0.7) - 0.0608).abs() < 0.001, "{}", height_m(1.0, &launch, 0.7));
        assert_eq!(height_m(0.0, &launch, 0.7), 0.0);
        for speed in [0.5, 3.0, 20.0, 1e3] {
            assert!(height_m(speed, &launch, 0.7).is_finite());
        }
        assert!((froude(4.0, 10.0) - 0.4039).abs() < 1e-3);
        assert!((WEDGE_TANGENT.atan().to_degrees() - 19.47).abs() < 0.01);
    }

    #[test]
    fn the_text_of_a_wake_tells_the_last_bit_of_each_number() {
        let course = Course::straight(DVec2::new(5.0, 90.0), 1.0, 6.0).unwrap();
        let wake = wake(&course, 40.0).unwrap();
        let text = format!("{wake:?}");
        for i in [0, wake.points().len() - 1] {
            for change in [
                |p: &mut TrackPoint| p.position.z = p.position.z.next_up(),
                |p: &mut TrackPoint| p.starboard.y = p.starboard.y.next_up(),
                |p: &mut TrackPoint| p.reach_m = p.reach_m.next_up(),
            ] {
                let mut other = wake;
                change(&mut other.points[i]);
                assert_ne!(text, format!("{other:?}"), "{i}");
            }
        }
    }

    #[test]
    fn the_ribbon_holds_the_wedge() {
        let course = Course::straight(DVec2::new(5.0, 90.0), 1.0, 6.0).unwrap();
        let wake = wake(&course, 40.0).unwrap();
        for p in wake.points().iter().filter(|p| p.age_s < WAVES_S / 2.0) {
            assert!(wake.half_width_m(p) > WEDGE_TANGENT * p.along_m.max(0.0) + SKIFF.beam_m / 2.0);
        }
    }
}
