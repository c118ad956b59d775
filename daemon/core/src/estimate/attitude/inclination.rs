//! Inclination from angular rate and specific force: VQF without magnetometer (Laidig & Seel, "VQF: Highly accurate IMU orientation
//! estimation with bias estimation and magnetic disturbance rejection", Information Fusion 91, 2023), set for a gun on a ship.

use std::fmt;

use glam::{DQuat, DVec3};
use vqf_rs::{Params, VQF};

use crate::physics::GRAVITY_M_S2;

/// How VQF is set, and how well it does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InclinationSettings {
    /// Time constant of the specific force's low-pass filter, seconds: longer than the waves.
    pub tau_accel_s: f64,
    /// Its inclination is never better than this, radians, beside what errors of the unit that are estimated do to it.
    pub error_least: f64,
}

impl InclinationSettings {
    /// For a gun on a ship in waves.
    pub const GUN: Self = Self { tau_accel_s: 10.0, error_least: 1e-3 };

    /// In hands, which accelerate for shorter and turn faster, so that wrong scales turn its axes.
    pub const HAND: Self = Self { tau_accel_s: 2.0, error_least: 5e-3 };

    /// The gyro's bias is not VQF's to estimate: a gun that creeps on a calm day looks like one at rest, and its turn would be learnt as
    /// the bias. What a bias does to the inclination is known, and is counted where the bias is estimated.
    fn params(&self) -> Params {
        Params {
            tau_acc: self.tau_accel_s,
            rest_bias_est_enabled: false,
            motion_bias_est_enabled: false,
            mag_dist_rejection_enabled: false,
            ..Params::default()
        }
    }
}

/// VQF is fed steps of this length at least, seconds: its time constants are seconds, and a step costs more than all the rest of a sample.
const STEP_S: f64 = 0.008;

/// Share of a sample's period by which a step may be shorter: clocks shift by microseconds.
const SLACK: f64 = 0.2;

/// VQF between the samples of one unit without interruption.
pub(super) struct Inclination {
    vqf: VQF,
    gathered: GatheredMotion,
    /// Seconds for which specific force is still left out, and for which it has been.
    ringing_s: f64,
    shaken_s: f64,
}

/// Motion since VQF's last step: the turn, the sum of specific force in the axes at its end and of how many samples, how long.
#[derive(Clone, Copy, Debug, Default)]
struct GatheredMotion {
    turn: DVec3,
    accel: DVec3,
    count: u32,
    dt_s: f64,
}

impl Inclination {
    /// A filter for samples `period_s` apart, begun with the unit as in `world_from_imu`.
    pub(super) fn new(settings: &InclinationSettings, period_s: f64, world_from_imu: DQuat) -> Self {
        let steps = (STEP_S / period_s - SLACK).ceil().max(1.0);
        let mut vqf = VQF::new(steps * period_s, None, None, Some(settings.params()));
        // The filter takes its first sample's direction for up.
        vqf.update_acc((world_from_imu.inverse() * (DVec3::Z * GRAVITY_M_S2)).to_array());
        Self { vqf, gathered: GatheredMotion::default(), ringing_s: 0.0, shaken_s: 0.0 }
    }

    /// Takes in a turn (scaled axis, radians, the unit's axes) over `dt_s` seconds and the specific force at its end.
    pub(super) fn update(&mut self, turn: DVec3, dt_s: f64, accel: DVec3) {
        let steady = self.is_steady(accel, dt_s);
        let g = &mut self.gathered;
        // Turn after turn, and what was felt before carried along, to the second order of a turn of some degrees.
        g.turn += turn + g.turn.cross(turn) * 0.5;
        g.accel -= turn.cross(g.accel);
        if steady {
            g.accel += accel;
            g.count += 1;
        }
        g.dt_s += dt_s;
        if g.dt_s < STEP_S - SLACK * dt_s {
            return;
        }
        let g = std::mem::take(g);
        // The mean rate of the step, so that the filter's product of rate and time is the turn.
        self.vqf.update_gyr_with_ts((g.turn / g.dt_s).to_array(), g.dt_s);
        if g.count > 0 {
            self.vqf.update_acc((g.accel / f64::from(g.count)).to_array());
        }
    }

    /// Which way is up, in the unit's axes.
    pub(super) fn up_imu(&self) -> DVec3 {
        quaternion(&self.vqf).inverse() * DVec3::Z
    }

    fn is_steady(&mut self, accel: DVec3, dt_s: f64) -> bool {
        /// Specific force that differs from gravity by more than this, m/s^2, is a shock: recoil or a blow. Hands make 20 m/s^2, and twelve
        /// metres from the middle of a ship in sea state 6 waves make 3.
        const SHOCK: f64 = 60.0;
        /// What follows a shock is ringing for so long, seconds.
        const RINGING_S: f64 = 0.05;
        /// After so long without a quiet sample it is no shock but what the unit has come to measure, seconds.
        const SHOCK_MOST_S: f64 = 1.0;
        if (accel.length() - GRAVITY_M_S2).abs() > SHOCK {
            self.ringing_s = RINGING_S;
        }
        if self.ringing_s <= 0.0 {
            self.shaken_s = 0.0;
            return true;
        }
        self.ringing_s -= dt_s;
        self.shaken_s += dt_s;
        self.shaken_s > SHOCK_MOST_S
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
