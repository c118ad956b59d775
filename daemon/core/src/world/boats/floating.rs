//! How a boat lies on the water.

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::{
    course::CourseState,
    hull::{Hull, HullForm},
    motion::BoatMotion,
};
use crate::{
    geometry::{RigidPose, ahead},
    physics::GRAVITY_M_S2,
    world::waves::WaveField,
};

/// Bow-up trim of a boat that planes, radians.
const PLANING_TRIM: f64 = 4.0 * std::f64::consts::PI / 180.0;
/// Rise of a boat that planes, by its length.
pub(super) const PLANING_RISE: f64 = 0.012;
/// Froude numbers (speed by the root of g times length) between which a boat climbs onto the plane.
const PLANING_FROUDE: (f64, f64) = (0.4, 1.1);
/// Share of the angle of a balanced turn by which a planing boat leans inwards.
const LEAN: f64 = 0.6;
/// Greatest lean into a turn, radians.
const LEAN_MAX: f64 = 0.35;

/// A boat on the water.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floating {
    /// Pose on a flat Earth.
    pub pose: RigidPose,
    /// Mean height of the water at the hull on a flat Earth, metres.
    pub water_level: f64,
}

/// Puts a boat into the mean plane of the water under its hull: a quasi-static attitude, that of a boat without inertia. It rises and trims as it planes,
/// and leans into its turns.
pub fn quasi_static(state: &CourseState, hull: &Hull, waves: &WaveField, time_s: f64) -> Floating {
    in_mean_plane(state, hull, &WayAttitude::scripted(state, hull), waves, time_s)
}

/// As [`quasi_static`], with the attitude that its way gives it.
pub(super) fn in_mean_plane(
    state: &CourseState,
    hull: &Hull,
    way: &WayAttitude,
    waves: &WaveField,
    time_s: f64,
) -> Floating {
    let water = waves.plane_under(state.position, state.heading, hull.length_m, hull.beam_m, time_s);
    let at = DVec3::new(water.height_m, water.port_slope.atan(), water.forward_slope.atan());
    Floating { pose: lay(state, way, at), water_level: water.height_m }
}

/// Pose of a boat on the waves where its motion has brought it; it rises, trims and leans by its way as well.
pub(super) fn pose_in_waves(
    state: &CourseState,
    way: &WayAttitude,
    form: &HullForm,
    motion: &BoatMotion,
) -> RigidPose {
    let mut at = motion.at;
    // From the centre of buoyancy to the boat's origin.
    at.x -= form.centre_m * at.z.sin();
    lay(state, way, at)
}

/// What its way through the water, or water in it, does to a boat's attitude.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WayAttitude {
    /// Bow up, radians.
    pub trim: f64,
    /// Port up, radians.
    pub lean: f64,
    /// Upwards, metres.
    pub rise_m: f64,
}

impl std::ops::Add for WayAttitude {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let Self { trim, lean, rise_m } = other;
        Self { trim: self.trim + trim, lean: self.lean + lean, rise_m: self.rise_m + rise_m }
    }
}

impl WayAttitude {
    /// Of a boat on a course that is known beforehand, of which no more is known than its size.
    pub fn scripted(state: &CourseState, hull: &Hull) -> Self {
        let planing = planing_share(state.speed_m_s, hull.length_m);
        Self {
            trim: PLANING_TRIM * planing,
            // A turn to starboard leans the boat to starboard: port comes up.
            lean: lean(state.speed_m_s, state.turn_rate) * planing,
            rise_m: PLANING_RISE * hull.length_m * planing,
        }
    }
}

/// A boat at heave, roll and pitch `at`.
fn lay(state: &CourseState, way: &WayAttitude, at: DVec3) -> RigidPose {
    let pitch_up = at.z + way.trim;
    let port_up = at.y + way.lean;
    let level = level_attitude(ahead(state.heading));
    let world_from_body = level * DQuat::from_rotation_y(-pitch_up) * DQuat::from_rotation_x(port_up);
    let height = at.x + way.rise_m;
    RigidPose { world_from_body, position: state.position.extend(height) }
}

/// The pose of a picture boat ([`crate::model::ModelKind::Quad`]) that is seen from `eye`: upright, its starboard side towards
/// the eye, so that its x axis points to the viewer's right.
pub fn facing(pose: &RigidPose, eye: DVec3) -> RigidPose {
    let towards = (eye - pose.position).truncate();
    let forward = if towards.length_squared() > 1e-12 { towards.normalize().perp() } else { DVec2::X };
    RigidPose { world_from_body: level_attitude(forward), position: pose.position }
}

/// Attitude of a level boat whose bow points along the unit vector `forward`.
fn level_attitude(forward: DVec2) -> DQuat {
    DQuat::from_mat3(&DMat3::from_cols(forward.extend(0.0), forward.perp().extend(0.0), DVec3::Z))
}

/// Angle by which a planing boat leans into a turn at `speed_m_s` and `turn_rate` (rad/s clockwise), radians, port up.
pub(super) fn lean(speed_m_s: f64, turn_rate: f64) -> f64 {
    let balanced = (speed_m_s * turn_rate / GRAVITY_M_S2).atan();
    (LEAN * balanced).clamp(-LEAN_MAX, LEAN_MAX)
}

/// 0 for a boat that displaces water, 1 for one that planes.
fn planing_share(speed_m_s: f64, length_m: f64) -> f64 {
    let froude = speed_m_s / (GRAVITY_M_S2 * length_m.max(0.1)).sqrt();
    ramp(froude, PLANING_FROUDE)
}

/// Smooth step from 0 at the first of `ends` and below to 1 at the second and beyond.
pub(super) fn ramp(value: f64, ends: (f64, f64)) -> f64 {
    let t = ((value - ends.0) / (ends.1 - ends.0)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::waves::{Spectrum, WaveSpec};

    const SKIFF: Hull = Hull { length_m: 6.0, beam_m: 1.8 };
    const FRIGATE: Hull = Hull { length_m: 130.0, beam_m: 15.0 };

    fn at(heading: f64, speed_m_s: f64, turn_rate: f64) -> CourseState {
        CourseState { position: DVec2::new(30.0, 200.0), heading, speed_m_s, sway_m_s: 0.0, turn_rate }
    }

    #[test]
    fn on_a_flat_sea_a_boat_at_rest_is_level_and_points_where_it_heads() {
        let boat = quasi_static(&at(0.5, 0.0, 0.0), &SKIFF, &WaveField::FLAT, 3.0);
        let bow = boat.pose.world_from_body * DVec3::X;
        assert!((bow - DVec3::new(0.5_f64.sin(), 0.5_f64.cos(), 0.0)).length() < 1e-12, "{bow}");
        let port = boat.pose.world_from_body * DVec3::Y;
        assert!((port - DVec3::new(-0.5_f64.cos(), 0.5_f64.sin(), 0.0)).length() < 1e-12, "{port}");
        assert_eq!((boat.pose.position.z, boat.water_level), (0.0, 0.0));
    }

    #[test]
    fn a_boat_on_the_plane_lifts_its_bow_and_leans_into_the_turn() {
        let boat = quasi_static(&at(0.0, 15.0, 0.3), &SKIFF, &WaveField::FLAT, 0.0);
        let trim = (boat.pose.world_from_body * DVec3::X).z.asin();
        assert!((trim - PLANING_TRIM).abs() < 1e-9, "{trim}");
        assert!((boat.pose.world_from_body * DVec3::Y).z > 0.1, "port rises in a turn to starboard");
        assert!(boat.pose.position.z > 0.05);
        let ship = quasi_static(&at(0.0, 15.0, 0.01), &FRIGATE, &WaveField::FLAT, 0.0);
        assert!((ship.pose.world_from_body * DVec3::X).z < 1e-3, "a frigate does not plane");
    }

    #[test]
    fn a_boat_lies_in_the_plane_of_the_water_and_a_frigate_moves_less_than_a_skiff() {
        let spectrum = Spectrum::jonswap(0.8, 4.5, 3.3).expect("in range");
        let waves = WaveField::new(&WaveSpec { spectrum, wind_from: 0.3 }, 9);
        let motion = |hull: &Hull| {
            let (mut heave, mut pitch) = (0.0, 0.0);
            for i in 0..3000 {
                let t = f64::from(i) * 0.77;
                let boat = quasi_static(&at(0.9, 0.0, 0.0), hull, &waves, t);
                heave += boat.pose.position.z.powi(2) / 3000.0;
                pitch += (boat.pose.world_from_body * DVec3::X).z.powi(2) / 3000.0;
            }
            (heave.sqrt(), pitch.sqrt())
        };
        let ((skiff_heave, skiff_pitch), (ship_heave, ship_pitch)) = (motion(&SKIFF), motion(&FRIGATE));
        assert!((skiff_heave - 0.2).abs() < 0.02, "a skiff goes with the waves: {skiff_heave} m");
        assert!(ship_heave < 0.2 * skiff_heave, "{ship_heave} m against {skiff_heave} m");
        assert!(ship_pitch < 0.1 * skiff_pitch, "{ship_pitch} against {skiff_pitch}");
    }

    #[test]
    fn bow_and_sides_of_a_small_boat_follow_the_water() {
        let spectrum = Spectrum::jonswap(1.5, 9.0, 3.3).expect("in range");
        let waves = WaveField::new(&WaveSpec { spectrum, wind_from: 2.0 }, 5);
        let (mut gap, mut sea) = (0.0, 0.0);
        for i in 0..500 {
            let t = f64::from(i) * 1.3;
            let boat = quasi_static(&at(f64::from(i), 0.0, 0.0), &SKIFF, &waves, t);
            for corner in [DVec3::X * 3.0, DVec3::X * -3.0, DVec3::Y * 0.9, DVec3::Y * -0.9] {
                let world = boat.pose.to_world(corner);
                let water = waves.height(world.truncate(), t);
                gap += (world.z - water).powi(2) / 2000.0;
                sea += water.powi(2) / 2000.0;
            }
        }
        // What is left are the waves shorter than the boat.
        assert!(
            gap.sqrt() < 0.2 * sea.sqrt(),
            "gap {} m in a sea of {} m (standard deviations)",
            gap.sqrt(),
            sea.sqrt()
        );
    }

    #[test]
    fn a_picture_shows_its_starboard_side_to_the_eye() {
        let pose = quasi_static(&at(2.2, 9.0, 0.1), &SKIFF, &WaveField::FLAT, 0.0).pose;
        let eye = DVec3::new(-3.0, 5.0, 8.0);
        let turned = facing(&pose, eye);
        let to_eye = (eye - pose.position).truncate().normalize().extend(0.0);
        assert!((turned.world_from_body * DVec3::NEG_Y - to_eye).length() < 1e-12);
        assert!((turned.world_from_body * DVec3::Z - DVec3::Z).length() < 1e-12);
        assert!(facing(&pose, pose.position).world_from_body.is_finite());
    }
}
