//! Rounds that burst where they strike: whom their fragments strike.

use glam::DVec3;

use super::score::Moving;
use crate::chance::drawn;

/// Draws of bursts are numbered from here.
const BURST: u64 = 1 << 40;

/// A round's fuze, which bursts it on impact, and its fragments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BurstSpec {
    /// Distance from the muzzle before which it is not armed, metres.
    pub arming_m: f64,
    /// Distance from the burst at which half of the people who stand in the open are struck, metres.
    pub lethal_m: f64,
}

/// A boat whose crew is struck by fragments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FragmentStrike {
    /// Index of the boat among those given.
    pub boat: usize,
    /// Distance of the burst from its helmsman, metres.
    pub distance_m: f64,
    /// The burst in the boat's space, metres.
    pub point: DVec3,
}

impl BurstSpec {
    /// Tests whether a round that bursts at `at` was armed.
    pub fn is_armed(&self, muzzle: DVec3, at: DVec3) -> bool {
        at.distance(muzzle) >= self.arming_m
    }

    /// Chance that somebody in the open is struck that far from the burst: half at [`Self::lethal_m`], and as a Gaussian of the distance
    /// (the Carleton damage function of weapons' effects, round about the burst).
    pub fn chance(&self, distance_m: f64) -> f64 {
        0.5f64.powf((distance_m / self.lethal_m.max(1e-6)).powi(2))
    }

    /// The boats whose helmsman is struck by fragments of round `shot`, which bursts at `at` (world, metres) and time `time_s` of the boats'
    /// clock, the nearest first.
    pub fn strikes(
        &self,
        seed: u64,
        shot: u64,
        (at, time_s): (DVec3, f64),
        muzzle: DVec3,
        boats: &[Moving<'_>],
    ) -> Vec<FragmentStrike> {
        /// Farther off than so many of the radii in which half are struck, one in five hundred is.
        const REACH: f64 = 3.0;
        /// A helmsman so far below the burst is under water, metres.
        const UNDER_M: f64 = 1.5;
        let reach_m = REACH * self.lethal_m;
        let near = |(boat, moving): (usize, &Moving<'_>)| {
            let pose = moving.pose_at(time_s, muzzle);
            let helmsman = moving.model.helm_middle();
            let point = pose.to_body(at);
            let distance_m = helmsman.distance(point);
            // Water stops fragments.
            let is_under = pose.to_world(helmsman).z < at.z - UNDER_M;
            if distance_m > reach_m || is_under {
                return None;
            }
            let is_struck = drawn(seed, [shot, BURST | boat as u64]) < self.chance(distance_m);
            is_struck.then_some(FragmentStrike { boat, distance_m, point })
        };
        let mut struck: Vec<_> = boats.iter().enumerate().filter_map(near).collect();
        struck.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
        struck
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, Vec3};

    use super::*;
    use crate::{geometry::RigidPose, world::score::boxed_model};

    #[test]
    fn half_are_struck_at_the_radius_that_says_so_and_none_far_off() {
        let burst = BurstSpec { arming_m: 20.0, lethal_m: 5.0 };
        let model = boxed_model(Vec3::splat(-2.0), Vec3::splat(2.0));
        let count = |off_m: f64| {
            let pose = RigidPose { position: DVec3::X * 300.0, world_from_body: DQuat::IDENTITY };
            let boat = Moving { model: &model, from_s: 0.0, from: pose, to_s: 1.0, to: pose };
            let at = DVec3::new(300.0 + off_m, 0.0, 0.0);
            let struck = |shot: &u64| !burst.strikes(9, *shot, (at, 0.5), DVec3::ZERO, &[boat]).is_empty();
            (0..2000).filter(struck).count()
        };
        assert!((940..1060).contains(&count(5.0)), "{}", count(5.0));
        assert!(count(0.1) > 1990);
        assert_eq!(count(16.0), 0);
        assert!(
            !burst.is_armed(DVec3::ZERO, DVec3::X * 19.0) && burst.is_armed(DVec3::ZERO, DVec3::X * 21.0)
        );
    }
}
