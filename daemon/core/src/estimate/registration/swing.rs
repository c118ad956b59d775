//! Sequential test of a swung gun: is up off with the camera, or with the world?

use glam::{DQuat, DVec3};

use super::{
    ALIKE, COST_MOST,
    means::{MeanSway, SWAY_AGE_S},
    unit::{LEANS_MOST, SHIP_TURN_MOST, SWAY_SIGMA, UP_SIGMA},
};

/// Sequential test of where up is off: a mount that is off shows it at the same place of the picture wherever the gun points. What leans a
/// unit, and the crest of a shore that is taken for the horizon, stand in the world, or turn with the ship.
///
/// Both foretell how it moves in the picture within the second that the mean of two seconds is old.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SwingTest {
    in_camera: MeanSway,
    in_world: MeanSway,
    /// Logarithm of the likelihood of the camera over that of the world, nats; bounded.
    nats: f64,
    /// Error of up, radians.
    off: f64,
}

impl SwingTest {
    /// Takes in by how far up is off its place `own`, camera's axes, with the gun at `heading`, radians from any.
    pub(super) fn take(&mut self, own: DVec3, off: DVec3, heading: f64) {
        /// Evidence that is kept: a mount may come loose.
        const MOST: f64 = 14.0;
        let level = DQuat::from_rotation_z(heading) * DQuat::from_rotation_arc(own, DVec3::Z);
        let by_camera = self.in_camera.take_apart(off);
        let by_world = self.in_world.take_apart(level * off);
        self.off = self.in_camera.mean.length();
        // The ship may turn, to either side, and what leans the unit with it. Neither is held against so much.
        let slack = self.off * SHIP_TURN_MOST * SWAY_AGE_S;
        let cost = |apart: f64| ((apart - slack).max(0.0) / SWAY_SIGMA).powi(2).min(COST_MOST);
        self.nats = (self.nats + 0.5 * (cost(by_world) - cost(by_camera)) / ALIKE).clamp(-MOST, MOST);
    }

    /// Begins with new means: up was not seen for a while.
    pub(super) fn pause(&mut self) {
        (self.in_camera, self.in_world) = (MeanSway::NOTHING, MeanSway::NOTHING);
    }

    /// Tests whether it may be the camera that up is off with. By little, a gun that is not swung sees a shore as well. Nothing leans a unit
    /// further than [`LEANS_MOST`].
    pub(super) fn may_be_camera(&self) -> bool {
        /// Evidence, nats, that is enough alone.
        const ENOUGH: f64 = 5.0;
        /// Without it, up is off by more than this, radians, as far as READY allows.
        const FAR: f64 = 3.0 * UP_SIGMA;
        self.nats >= ENOUGH || self.off > LEANS_MOST || (self.nats > -ENOUGH && self.off > FAR)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests whether a minute of a gun that is swung so far to either side in nine seconds, on a ship that turns at so many deg/s, may show a
    /// mount that is off. Up is off by `off_deg` in the picture, or leans as far with the ship.
    fn may_be_camera(swing_deg: f64, ship_deg_s: f64, off_deg: f64, leans: bool) -> bool {
        let mut test = SwingTest::default();
        for tenths in 0..600 {
            let t = f64::from(tenths) * 0.1;
            let traverse = swing_deg.to_radians() * (std::f64::consts::TAU / 9.0 * t).sin();
            let axis = if leans { DQuat::from_rotation_z(-traverse) * DVec3::X } else { DVec3::X };
            test.take(DVec3::Z, axis * off_deg.to_radians(), traverse + ship_deg_s.to_radians() * t);
        }
        test.may_be_camera()
    }

    #[test]
    fn a_mount_that_is_off_swings_with_the_gun_and_a_lean_does_not() {
        for ship_deg_s in [-5.0, 0.0, 5.0] {
            for swing_deg in [17.0, 28.0] {
                for off_deg in [2.5, 4.0, 6.0] {
                    let what = format!("{off_deg} deg, swung by {swing_deg}, ship {ship_deg_s} deg/s");
                    assert!(!may_be_camera(swing_deg, ship_deg_s, off_deg, true), "a lean of {what}");
                    assert!(may_be_camera(swing_deg, ship_deg_s, off_deg, false), "a mount off by {what}");
                }
            }
        }
    }

    #[test]
    fn a_gun_that_stands_shows_a_mount_that_is_off_by_more_than_a_shore_rises() {
        assert!(!may_be_camera(0.0, 0.0, 2.2, false));
        assert!(may_be_camera(0.0, 0.0, 5.0, false));
    }
}
