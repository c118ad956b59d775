//! A gunner's eye: boats in sight, and the chance of coming upon them.

use glam::{DVec2, DVec3};
use rand::RngExt;
use rand_pcg::Pcg64;

use crate::{
    side::Side,
    world::{
        RunningWorld,
        exercise::STOPPED_M_S,
        fleet::Fleet,
        seeing::threshold::{SEEN, chance},
    },
};

/// Metres in a nautical mile.
const NM: f64 = 1852.0;
/// Speed of the searchers for whom sweep widths were measured, nautical miles a second.
const SEARCH_NM_S: f64 = 10.0 / 3600.0;
/// Angle under which a hull's height shows what kind of boat it is, radians: eight lines of a minute of arc (Johnson 1958).
const RECOGNISED: f64 = 8.0 / 60.0 * std::f64::consts::PI / 180.0;

/// A boat in sight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sighted {
    pub boat: usize,
    /// The middle of what it shows, world, metres.
    pub at: DVec3,
    /// Its velocity over the ground, m/s.
    pub velocity: DVec3,
    /// Rate at which somebody who searches comes upon it, 1/s.
    pub found_per_s: f64,
    /// It is near enough, and seen well enough, to say what kind of boat it is.
    pub is_recognised: bool,
    /// Whose it is; only a judgement of it is used.
    pub side: Side,
    /// It has no way after having been struck, or has given up: that shows.
    pub is_over: bool,
}

/// Seeing conditions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eye {
    pub at: DVec3,
    pub visibility_m: f64,
    /// Factor of sweep widths by wind and sea for boats below 9 m (National Search and Rescue Manual, table D-1).
    pub weather: f64,
}

impl Eye {
    /// All boats that can be seen from here.
    pub fn sees(&self, running: &RunningWorld) -> Vec<Sighted> {
        let seen = running.fleet.seen_from(self.at, running.now);
        let boats: Vec<Sighted> =
            seen.iter().enumerate().filter_map(|(boat, times)| self.sight(running, boat, *times)).collect();
        boats.iter().filter(|boat| !self.is_hidden(boat, &boats, &running.fleet)).copied().collect()
    }

    /// A boat that has so many times the contrast that somebody needs who looks at it.
    fn sight(&self, running: &RunningWorld, boat: usize, times_threshold: f64) -> Option<Sighted> {
        let RunningWorld { fleet, now, start, .. } = running;
        let at = fleet.middle(boat, *now).filter(|_| fleet.swims(boat, *now))?;
        let history = fleet.history(boat)?;
        let velocity = history.state(now.secs_since(*start)).velocity().extend(0.0);
        let (range_m, length_m) = (at.distance(self.at), history.hull().length_m);
        let is_over = fleet.gave_up(boat)
            || fleet.first_hit(boat).is_some_and(|t| t <= *now) && velocity.length() < STOPPED_M_S;
        Some(Sighted {
            boat,
            at,
            velocity,
            // That searchers do not know where to look is in the sweep widths already.
            found_per_s: self.found_per_s(range_m, length_m) * chance(times_threshold),
            is_recognised: fleet.height_m(boat) / range_m.max(1.0) > RECOGNISED
                && chance(times_threshold) >= SEEN,
            side: fleet.side(boat)?,
            is_over,
        })
    }

    /// Rate at which a searcher finds a boat: Koopman's inverse cube law with the constant that gives a published sweep width W to a searcher
    /// who passes at a speed v, v W^2 / (8 pi r^3) (Koopman 1980, Search and Screening, 3.2).
    fn found_per_s(&self, range_m: f64, length_m: f64) -> f64 {
        let sweep_nm = sweep_width_nm(length_m, self.visibility_m / NM) * self.weather;
        let range_nm = (range_m / NM).max(0.02);
        SEARCH_NM_S * sweep_nm * sweep_nm / (8.0 * std::f64::consts::PI * range_nm.powi(3))
    }

    /// Tests whether a nearer boat of some size stands before it.
    fn is_hidden(&self, boat: &Sighted, boats: &[Sighted], fleet: &Fleet) -> bool {
        let from = |s: &Sighted| s.at.truncate() - self.at.truncate();
        let sight: DVec2 = from(boat);
        boats.iter().any(|other| {
            let off = from(other);
            let along = off.dot(sight) / sight.length_squared().max(1.0);
            let beside = (off - sight * along).length();
            let half_m = fleet.history(other.boat).map_or(0.0, |h| 0.3 * h.hull().length_m);
            other.boat != boat.boat
                && (0.0..0.98).contains(&along)
                && beside < half_m
                && fleet.height_m(other.boat) >= fleet.height_m(boat.boat)
        })
    }
}

/// Sweep width of a ship's lookouts for a boat, nautical miles: between the values for boats of 5, 7, 12 and 24 m at visibilities of 3 to 20
/// miles (IAMSAR manual, volume II, table N-4).
fn sweep_width_nm(length_m: f64, visibility_nm: f64) -> f64 {
    let (short, long, share) = between(&LENGTHS_M, length_m);
    let width = |row: usize| {
        let (hazy, clear, share) = between(&VISIBILITIES_NM, visibility_nm);
        WIDTHS_NM[row][hazy] + share * (WIDTHS_NM[row][clear] - WIDTHS_NM[row][hazy])
    };
    let width_nm = width(short) + share * (width(long) - width(short));
    // In thicker haze the width shrinks with what can be seen.
    width_nm * (visibility_nm / VISIBILITIES_NM[0]).clamp(0.0, 1.0)
}

/// Lengths of boats of that table, metres.
const LENGTHS_M: [f64; 4] = [5.0, 7.0, 12.0, 24.0];
/// Visibilities of that table, nautical miles.
const VISIBILITIES_NM: [f64; 5] = [3.0, 5.0, 10.0, 15.0, 20.0];
/// Sweep widths of that table by length and visibility, nautical miles.
const WIDTHS_NM: [[f64; 5]; 4] = [
    [1.1, 1.4, 1.9, 2.1, 2.3],
    [2.0, 2.9, 4.3, 5.2, 5.8],
    [2.8, 4.5, 7.6, 9.4, 11.6],
    [3.2, 5.6, 10.7, 14.7, 18.1],
];

/// The nodes beside a value, and how far it lies from the first to the second; at the ends, that end.
fn between(nodes: &[f64], value: f64) -> (usize, usize, f64) {
    let upper = nodes.partition_point(|node| *node < value).clamp(1, nodes.len() - 1);
    let (low, high) = (nodes[upper - 1], nodes[upper]);
    (upper - 1, upper, ((value - low) / (high - low)).clamp(0.0, 1.0))
}

/// Draws whether something that happens so often happened within `span_s`.
pub(super) fn happens(random: &mut Pcg64, per_s: f64, span_s: f64) -> bool {
    random.random::<f64>() < 1.0 - (-per_s * span_s).exp()
}

/// A normal deviate (Box and Muller 1958).
pub(super) fn normal(random: &mut Pcg64) -> f64 {
    let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.random::<f64>()).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sweep_widths_are_those_of_the_table() {
        for (length_m, visibility_nm, width_nm) in [
            (5.0, 3.0, 1.1),
            (7.0, 10.0, 4.3),
            (12.0, 5.0, 4.5),
            (30.0, 25.0, 18.1),
            (7.0, 1.5, 1.0),
            (6.0, 4.0, 1.85),
        ] {
            assert!((sweep_width_nm(length_m, visibility_nm) - width_nm).abs() < 1e-9);
        }
    }

    #[test]
    fn a_boat_on_a_straight_track_is_found_as_the_inverse_cube_law_says() {
        let eye = Eye { at: DVec3::ZERO, visibility_m: 10.0 * NM, weather: 1.0 };
        for lateral_nm in [0.5, 1.0, 2.0] {
            // The searcher passes at 10 knots; a step of a second.
            let track = (-40_000..=40_000).map(|s| f64::from(s) * SEARCH_NM_S);
            let exposure: f64 =
                track.map(|along_nm| eye.found_per_s(NM * f64::hypot(along_nm, lateral_nm), 7.0)).sum();
            let expected = 4.3 * 4.3 / (4.0 * std::f64::consts::PI * lateral_nm * lateral_nm);
            assert!((exposure / expected - 1.0).abs() < 0.01, "{exposure} {expected}");
        }
    }
}
