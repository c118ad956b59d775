//! The aim that hits: where a barrel has to point for a round to meet a target that moves.

use glam::DVec3;

use super::{Atmosphere, Flight, Projectile};

/// The longest flight that counts as in range, seconds.
const FLIGHT_MAX_S: f64 = 12.0;
/// Distance by which a solution may miss the target, metres.
const CLOSE_M: f64 = 0.002;
/// Flights that are tried.
const TRIES: usize = 8;

/// A direction of fire that meets a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AimSolution {
    /// Direction of the barrel, world, unit vector.
    pub direction: DVec3,
    /// Time of flight, seconds.
    pub time_s: f64,
    /// The target as it is met, world, metres.
    pub at: DVec3,
}

/// The aim that hits `target`, which tells the target's place (world, metres) so many seconds after the round left the `muzzle`; `None`
/// beyond the weapon's range.
///
/// Shoots, sees by which angle the round passes the target at the target's distance, and turns the barrel by that angle: the fixed point of
/// it is the solution, and each try divides the error by about the ratio of range to the curvature of the path.
pub fn aim_to_hit(
    projectile: Projectile,
    muzzle: DVec3,
    wind: DVec3,
    target: impl Fn(f64) -> DVec3,
) -> Option<AimSolution> {
    let mut direction = (target(0.0) - muzzle).try_normalize()?;
    for _ in 0..TRIES {
        let (time_s, round) = at_distance(projectile, muzzle, direction, wind, &target)?;
        let at = target(time_s);
        let (wanted, flown) = ((at - muzzle).try_normalize()?, (round - muzzle).try_normalize()?);
        if round.distance(at) < CLOSE_M {
            return Some(AimSolution { direction, time_s, at });
        }
        direction = (direction + wanted - flown).try_normalize()?;
    }
    None
}

/// When and where a round is as far from the muzzle as the target.
fn at_distance(
    projectile: Projectile,
    muzzle: DVec3,
    direction: DVec3,
    wind: DVec3,
    target: impl Fn(f64) -> DVec3,
) -> Option<(f64, DVec3)> {
    let mut flight = Flight::new(projectile, &Atmosphere::ICAO, muzzle, direction, wind)?;
    let beyond = |time_s: f64, round: DVec3| round.distance(muzzle) - target(time_s).distance(muzzle);
    while let Some(segment) = flight.next_segment(FLIGHT_MAX_S) {
        let (from, to) = (segment.from, segment.to);
        if beyond(to.time_s, to.position) < 0.0 {
            continue;
        }
        let (mut low, mut high) = (from.time_s, to.time_s);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if beyond(middle, flight.state_at(middle).position) < 0.0 { low = middle } else { high = middle }
        }
        return Some((high, flight.state_at(high).position));
    }
    None
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn heavy() -> Projectile {
        Projectile::new(0.337, 893.0).expect("a round")
    }

    proptest! {
        /// A round fired so passes through the target.
        #[test]
        fn the_aim_that_hits_hits(
            bearing in 0.0..6.3_f64, range in 60.0..1500.0_f64, height in -8.0..5.0_f64,
            vx in -20.0..20.0_f64, vy in -20.0..20.0_f64, wind in -12.0..12.0_f64,
        ) {
            let (muzzle, wind) = (DVec3::new(1.0, 0.5, 8.0), DVec3::new(wind, 3.0, 0.0));
            let begin = DVec3::new(bearing.sin() * range, bearing.cos() * range, height);
            let target = |s: f64| begin + DVec3::new(vx, vy, 0.0) * s;
            let found = aim_to_hit(heavy(), muzzle, wind, target).expect("in range");
            let mut flight = Flight::new(heavy(), &Atmosphere::ICAO, muzzle, found.direction, wind).expect("a flight");
            flight.advance(found.time_s);
            prop_assert!(flight.state().position.distance(target(found.time_s)) < 0.01);
        }
    }

    #[test]
    fn what_is_out_of_range_has_none() {
        let none = aim_to_hit(heavy(), DVec3::ZERO, DVec3::ZERO, |_| DVec3::new(0.0, 9000.0, 0.0));
        assert_eq!(none, None);
        assert_eq!(aim_to_hit(heavy(), DVec3::ZERO, DVec3::ZERO, |_| DVec3::ZERO), None);
    }
}
