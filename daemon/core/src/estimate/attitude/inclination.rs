//! Inclination from angular rate and specific force by plain VQF, without magnetometer (Laidig & Seel, "VQF: Highly accurate IMU orientation
//! estimation with bias estimation and magnetic disturbance rejection", Information Fusion 91, 2023): it forgets every error within seconds,
//! so that the filter that is better is held against it, and falls back to it where it has gone wrong.

use std::fmt;

use glam::{DQuat, DVec3};
use vqf_rs::{Params, VQF};

use crate::physics::GRAVITY_M_S2;

/// VQF is fed steps of this length at least, seconds: its time constants are seconds, and a step costs more than all the rest of a sample.
const STEP_S: f64 = 0.04;

/// Share of a sample's period by which a step may be shorter: clocks shift by microseconds.
const SLACK: f64 = 0.2;

/// VQF between the samples of one unit without interruption.
pub(super) struct Inclination {
    vqf: VQF,
    gathered: GatheredMotion,
}

/// Motion since VQF's last step: the turn, the sum of specific force in the axes at its end and of how many samples, how long.
#[derive(Clone, Copy, Debug, Default)]
struct GatheredMotion {
    turn: DVec3,
    accel: DVec3,
    count: u32,
    dt_s: f64,
}

/// Time constant of the specific force's low-pass filter as VQF's authors have it, seconds.
pub(super) const TAU_PUBLISHED_S: f64 = 3.0;
/// One that is longer than waves.
pub const TAU_WAVES_S: f64 = 10.0;

/// Its authors' setting but for the time constant, without estimates of the bias: its own would take a gun that creeps on a calm day for one at
/// rest, and its turn for the bias.
fn params(tau_s: f64) -> Params {
    Params {
        tau_acc: tau_s,
        rest_bias_est_enabled: false,
        motion_bias_est_enabled: false,
        mag_dist_rejection_enabled: false,
        ..Params::default()
    }
}

impl Inclination {
    /// A filter for samples `period_s` apart, begun with the unit as in `world_from_imu`.
    pub(super) fn new(tau_s: f64, period_s: f64, world_from_imu: DQuat) -> Self {
        let steps = (STEP_S / period_s - SLACK).ceil().max(1.0);
        let mut vqf = VQF::new(steps * period_s, None, None, Some(params(tau_s)));
        // The filter takes its first sample's direction for up.
        vqf.update_acc((world_from_imu.inverse() * (DVec3::Z * GRAVITY_M_S2)).to_array());
        Self { vqf, gathered: GatheredMotion::default() }
    }

    /// Takes in a turn (scaled axis, radians, the unit's axes) over `dt_s` seconds and the specific force at its end.
    pub(super) fn update(&mut self, turn: DVec3, dt_s: f64, accel: DVec3) {
        let g = &mut self.gathered;
        // Turn after turn, and what was felt before carried along, to the second order of a turn of some degrees.
        g.turn += turn + g.turn.cross(turn) * 0.5;
        g.accel += accel - turn.cross(g.accel);
        g.count += 1;
        g.dt_s += dt_s;
        if g.dt_s < STEP_S - SLACK * dt_s {
            return;
        }
        let g = std::mem::take(g);
        // The mean rate of the step, so that the filter's product of rate and time is the turn.
        self.vqf.update_gyr_with_ts((g.turn / g.dt_s).to_array(), g.dt_s);
        self.vqf.update_acc((g.accel / f64::from(g.count)).to_array());
    }

    /// Direction of up in the unit's axes at the newest sample, unit vector.
    pub(super) fn up_imu(&self) -> DVec3 {
        DQuat::from_scaled_axis(-self.gathered.turn) * (quaternion(&self.vqf).inverse() * DVec3::Z)
    }
}

fn quaternion(vqf: &VQF) -> DQuat {
    let q = vqf.quat_6d();
    DQuat::from_xyzw(q.1, q.2, q.3, q.0)
}

impl fmt::Debug for Inclination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Inclination").field("orientation", &quaternion(&self.vqf)).finish_non_exhaustive()
    }
}
