//! A gun on a ship in waves, and what a perfect or a real inertial unit on it measures: closed functions of time, sharing no more with
//! the simulated hardware than its random numbers.

use std::f64::consts::TAU;

use bowwave_core::geometry::wrapped;
use glam::{DMat3, DQuat, DVec3};
use hw_sim::ocean::random::gaussian;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;

pub(crate) const GRAVITY: f64 = 9.806_65;
/// Half the step of the differences that rates and accelerations are made of, seconds.
const STEP_S: f64 = 1e-4;
const STEP_WIDE_S: f64 = 2e-3;

/// Angles, metres and seconds of a sea that the ship lies in.
#[derive(Clone, Copy, Debug)]
pub struct ShipSea {
    /// Its name.
    pub name: &'static str,
    /// Deviation of roll, pitch and yaw, degrees.
    pub turns_deg: [f64; 3],
    /// Deviation of surge, sway and heave, metres.
    pub moves_m: [f64; 3],
    /// Period of roll, of pitch and heave, and of yaw, surge and sway, seconds.
    pub periods_s: [f64; 3],
}

/// No waves to speak of.
pub const CALM: ShipSea = ShipSea {
    name: "calm",
    turns_deg: [0.4, 0.15, 0.1],
    moves_m: [0.02, 0.03, 0.05],
    periods_s: [8.0, 5.0, 9.0],
};
/// Sea state 4: about 2 m, 8 s.
pub const SEA_4: ShipSea = ShipSea {
    name: "sea 4",
    turns_deg: [3.5, 1.3, 0.7],
    moves_m: [0.3, 0.4, 0.5],
    periods_s: [9.0, 7.5, 9.0],
};
/// Sea state 6: about 5 m, 12 s.
pub const SEA_6: ShipSea = ShipSea {
    name: "sea 6",
    turns_deg: [7.0, 2.8, 1.5],
    moves_m: [0.9, 1.1, 1.4],
    periods_s: [11.0, 9.0, 11.0],
};

/// That sea state, 0 to 6: between those above, as the heights of its waves are (WMO code table 3700, middles).
pub fn sea_state(state: usize) -> ShipSea {
    const NAMES: [&str; 7] = ["sea 0", "sea 1", "sea 2", "sea 3", "sea 4", "sea 5", "sea 6"];
    const HEIGHTS_M: [f64; 7] = [0.0, 0.05, 0.3, 0.9, 1.9, 3.2, 5.0];
    let state = state.min(6);
    let of = |sea: ShipSea, share: f64| ShipSea {
        name: NAMES[state],
        turns_deg: sea.turns_deg.map(|v| v * share),
        moves_m: sea.moves_m.map(|v| v * share),
        periods_s: sea.periods_s,
    };
    if state > 4 {
        of(SEA_6, HEIGHTS_M[state] / HEIGHTS_M[6])
    } else {
        of(SEA_4, HEIGHTS_M[state] / HEIGHTS_M[4])
    }
}

/// A narrow band of waves: sines about a period, with unit deviation.
#[derive(Clone, Debug)]
struct WaveBand(Vec<[f64; 3]>);

impl WaveBand {
    fn new(rng: &mut Pcg64, period_s: f64) -> Self {
        const WAVES: usize = 24;
        // A third of the peak's frequency to each side, evenly but not commensurably spaced; weights fall off from the peak.
        let waves: Vec<_> = (0..WAVES)
            .map(|i| {
                let off = (i as f64 + 0.9 * rng.random::<f64>()) / WAVES as f64 * 2.0 - 1.0;
                [TAU / period_s * (1.0 + 0.35 * off), (-2.5 * off * off).exp(), TAU * rng.random::<f64>()]
            })
            .collect();
        let deviation = waves.iter().map(|w| 0.5 * w[1] * w[1]).sum::<f64>().sqrt();
        Self(waves.into_iter().map(|[f, a, p]| [f, a / deviation, p]).collect())
    }

    fn at(&self, t: f64) -> f64 {
        self.0.iter().map(|[frequency, amplitude, phase]| amplitude * (frequency * t + phase).sin()).sum()
    }
}

/// A turn of the gun at a steady rate from one time to another, eased in and out.
#[derive(Clone, Copy, Debug)]
struct Slew {
    from_s: f64,
    to_s: f64,
    rate: f64,
}

impl Slew {
    const EASE_S: f64 = 0.4;

    /// Angle turned by `t`.
    fn at(self, t: f64) -> f64 {
        // The integral of the step 6x^5 - 15x^4 + 10x^3.
        let eased = |x: f64| match x {
            x if x <= 0.0 => 0.0,
            x if x >= 1.0 => x - 0.5,
            x => x.powi(4) * (x * x - 3.0 * x + 2.5),
        };
        let side = |at: f64| Self::EASE_S * eased((t - at) / Self::EASE_S);
        self.rate * (side(self.from_s) - side(self.to_s))
    }
}

/// The unit's true state.
#[derive(Clone, Copy, Debug)]
pub struct ShipState {
    /// Rotation from the unit's axes (x forward, y right, z down) to the world's (x east, y north, z up).
    pub world_from_imu: DQuat,
    /// Angular rate in the unit's axes, rad/s.
    pub rate: DVec3,
    /// Specific force in the unit's axes, m/s^2.
    pub accel: DVec3,
}

/// Ship, gun and lever arm.
#[derive(Clone, Debug)]
pub struct Ship {
    turns: [(WaveBand, f64); 3],
    moves: [(WaveBand, f64); 3],
    slews: Vec<Slew>,
    lever_m: DVec3,
}

impl Ship {
    /// A ship in `sea` whose gun stands 12 m from her middle and, where `gun` says so, traverses: slews of 60 deg/s, and creep of 0.1
    /// to 2 deg/s for a minute at a time.
    pub fn new(sea: ShipSea, gun: bool, seed: u64) -> Self {
        let mut rng = Pcg64::seed_from_u64(seed);
        let [roll, pitch, rest] = sea.periods_s;
        let mut band = |period, size| (WaveBand::new(&mut rng, period), size);
        let [a, b, c] = sea.turns_deg.map(f64::to_radians);
        let turns = [band(roll, a), band(pitch, b), band(rest, c)];
        let [a, b, c] = sea.moves_m;
        let moves = [band(rest, a), band(rest, b), band(pitch, c)];
        let slews = if gun { slews(&mut rng) } else { Vec::new() };
        Self { turns, moves, slews, lever_m: DVec3::new(3.0, 10.4, 5.2) }
    }

    /// Ship's axes: x to starboard, y forward, z up.
    fn world_from_ship(&self, t: f64) -> DQuat {
        let [roll, pitch, yaw] = [0, 1, 2].map(|i| self.turns[i].1 * self.turns[i].0.at(t));
        DQuat::from_rotation_z(yaw) * DQuat::from_rotation_x(pitch) * DQuat::from_rotation_y(roll)
    }

    /// The unit's axes in the world.
    pub fn world_from_imu(&self, t: f64) -> DQuat {
        let traverse: f64 = self.slews.iter().map(|s| s.at(t)).sum();
        let elevation = if self.slews.is_empty() { 0.0 } else { 0.06 * (0.21 * t).sin() };
        // x forward, y right, z down, in axes x right, y forward, z up.
        let gun_from_imu =
            DQuat::from_xyzw(std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0);
        self.world_from_ship(t)
            * DQuat::from_rotation_z(-traverse)
            * DQuat::from_rotation_x(elevation)
            * gun_from_imu
    }

    fn place(&self, t: f64) -> DVec3 {
        let moved = DVec3::from_array([0, 1, 2].map(|i| self.moves[i].1 * self.moves[i].0.at(t)));
        moved + self.world_from_ship(t) * self.lever_m
    }

    /// The unit's true state at `t` seconds.
    pub fn at(&self, t: f64) -> ShipState {
        let world_from_imu = self.world_from_imu(t);
        let turn = self.world_from_imu(t - STEP_S).inverse() * self.world_from_imu(t + STEP_S);
        // Twice the vector part: an arc cosine would round such small turns away.
        let rate = DVec3::new(turn.x, turn.y, turn.z) * (turn.w.signum() / STEP_S);
        let h = STEP_WIDE_S;
        let acceleration = (self.place(t + h) - self.place(t) * 2.0 + self.place(t - h)) / (h * h);
        let accel = world_from_imu.inverse() * (acceleration + DVec3::Z * GRAVITY);
        ShipState { world_from_imu, rate, accel }
    }
}

fn slews(rng: &mut Pcg64) -> Vec<Slew> {
    const CREEPS_DEG: [f64; 6] = [0.1, 1.4, -0.5, 2.0, -1.4, 0.3];
    let mut slews = Vec::new();
    let mut t = 45.0;
    for turn in 0..40 {
        let from_s = t + 5.0 * rng.random::<f64>();
        // There and back, now more to one side, now to the other.
        for (after, rate, lasts) in
            [(0.0, 60.0, 1.5), (3.0, -60.0, 1.2), (6.0, 25.0, 2.0), (10.0, -25.0, 2.7)]
        {
            let sign = if turn % 2 == 0 { 1.0 } else { -1.0 };
            slews.push(Slew {
                from_s: from_s + after,
                to_s: from_s + after + lasts,
                rate: sign * f64::to_radians(rate),
            });
        }
        let creep = from_s + 15.0;
        let rate = CREEPS_DEG[turn % CREEPS_DEG.len()].to_radians();
        slews.push(Slew { from_s: creep, to_s: creep + 60.0, rate });
        t = creep + 70.0;
    }
    slews
}

/// How a real unit errs.
#[derive(Clone, Copy, Debug)]
pub struct UnitErrors {
    /// Samples a second.
    pub rate_hz: f64,
    /// White noise of the rate, rad/s/sqrt(Hz).
    pub gyro_noise: f64,
    /// Constant part of the rate's error, rad/s.
    pub gyro_bias: DVec3,
    /// Random walk of the rate's error, rad/s in a square root of a second.
    pub gyro_walk: f64,
    /// What the rate errs by, as shares of the true rate's axes: wrong scales on the diagonal, axes that are not square elsewhere.
    pub gyro_matrix: DMat3,
    /// The Earth's turn in the world's axes, rad/s, which a gyro measures too.
    pub earth: DVec3,
    /// White noise of the specific force, m/s^2/sqrt(Hz).
    pub accel_noise: f64,
    /// Constant part of its error, m/s^2.
    pub accel_bias: DVec3,
}

impl UnitErrors {
    /// A unit of the VN-100's class (0.0035 deg/s and 0.14 mg per square root of a hertz) with a bias of 0.05 deg/s on each axis.
    pub fn usual() -> Self {
        Self {
            rate_hz: 200.0,
            gyro_noise: 0.0035f64.to_radians(),
            gyro_bias: DVec3::new(0.05, -0.05, 0.05) * std::f64::consts::PI / 180.0,
            gyro_walk: 2e-4f64.to_radians(),
            gyro_matrix: DMat3::from_diagonal(DVec3::splat(3e-4)),
            earth: DVec3::ZERO,
            accel_noise: 1.4e-3,
            accel_bias: DVec3::new(0.008, -0.006, 0.01),
        }
    }
}

/// Reading of a unit.
#[derive(Clone, Copy, Debug)]
pub struct ShipReading {
    /// When, seconds.
    pub time_s: f64,
    /// Angular rate, rad/s, the unit's axes.
    pub rate: DVec3,
    /// Specific force, m/s^2, the unit's axes.
    pub accel: DVec3,
    /// The truth then.
    pub truth: ShipState,
}

/// The samples of a unit that errs so on that ship.
pub fn samples(ship: &Ship, errors: &UnitErrors, seconds: f64, seed: u64) -> Vec<ShipReading> {
    stream(ship, errors, seconds, seed).collect()
}

/// The same one after the other.
pub fn stream<'a>(
    ship: &'a Ship,
    errors: &'a UnitErrors,
    seconds: f64,
    seed: u64,
) -> impl Iterator<Item = ShipReading> + use<'a> {
    let mut rng = Pcg64::seed_from_u64(seed ^ 0x51a7);
    let dt = 1.0 / errors.rate_hz;
    let mut walk = DVec3::ZERO;
    (0..(seconds * errors.rate_hz) as usize).map(move |i| {
        let time_s = i as f64 * dt;
        let truth = ship.at(time_s);
        let mut white = || DVec3::new(gaussian(&mut rng), gaussian(&mut rng), gaussian(&mut rng));
        walk += white() * errors.gyro_walk * dt.sqrt();
        let earth = truth.world_from_imu.inverse() * errors.earth;
        let rate = truth.rate
            + earth
            + errors.gyro_matrix * truth.rate
            + errors.gyro_bias
            + walk
            + white() * errors.gyro_noise / dt.sqrt();
        let accel = truth.accel + errors.accel_bias + white() * errors.accel_noise / dt.sqrt();
        ShipReading { time_s, rate, accel, truth }
    })
}

/// Angle by which up is wrong, radians.
pub fn inclination_error(truth: DQuat, found: DQuat) -> f64 {
    let off = found * truth.inverse();
    2.0 * off.x.hypot(off.y).min(1.0).asin()
}

/// Angle about the vertical, radians, signed.
pub fn heading_error(truth: DQuat, found: DQuat) -> f64 {
    let off = found * truth.inverse();
    wrapped(2.0 * off.z.atan2(off.w))
}
