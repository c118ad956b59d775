//! Integration of angular rate to orientation.

use anyhow::Result;
use bowwave_core::estimate::attitude::turn_between;
use glam::{DQuat, DVec3, Quat};

use super::About;
use crate::bench::{PartBench, PartMethod};

/// Description of this part.
pub const ABOUT: About = About {
    part: "attitude",
    what: "Turns a gyro's angular rates into the orientation of the gun.",
    truth: "a coning motion in closed form (three rotations in a row); its rate is differentiated in closed form too, and sampled \
            as a gyro does. The error is the largest of any answer",
    rivals: "Euler with the first rate, the mean of two rates in f32 and in f64, Runge-Kutta 4 on the quaternion over two samples",
    why: "the parabola through three rates with the first commutator, in f64: as close as Runge-Kutta, whose \
          middle samples have no better answer than the mean rate; f32 loses the slow turn of the Earth altogether",
};

const RATE_HZ: f64 = 200.0;

/// Rz(a t) Rx(b) Rz(c t).
#[derive(Clone, Copy)]
struct Coning {
    a: f64,
    b: f64,
    c: f64,
}

impl Coning {
    fn at(self, t: f64) -> DQuat {
        DQuat::from_rotation_z(self.a * t)
            * DQuat::from_rotation_x(self.b)
            * DQuat::from_rotation_z(self.c * t)
    }

    /// Rate in the body's axes: the outer turn seen through the inner two, plus the inner one.
    fn rate(self, t: f64) -> DVec3 {
        let inner = DQuat::from_rotation_x(self.b) * DQuat::from_rotation_z(self.c * t);
        inner.inverse() * (DVec3::Z * self.a) + DVec3::Z * self.c
    }
}

fn samples(motion: Coning, seconds: f64) -> Vec<(f64, DVec3)> {
    (0..(seconds * RATE_HZ) as usize).map(|i| i as f64 / RATE_HZ).map(|t| (t, motion.rate(t))).collect()
}

/// Told the number of a sample and the orientation then.
type TellSample<'a> = &'a mut dyn FnMut(usize, DQuat);
/// Tells the orientation at every sample, started from the truth at the first.
type Integrator = fn(DQuat, &[(f64, DVec3)], TellSample<'_>);

fn product(start: DQuat, samples: &[(f64, DVec3)], tell: TellSample<'_>) {
    let mut q = start;
    let mut before = None;
    for (i, w) in samples.windows(2).enumerate() {
        let turn = turn_between(before, w[0].1, w[1].1, w[1].0 - w[0].0);
        before = Some(w[0].1);
        q = (q * DQuat::from_scaled_axis(turn)).normalize();
        tell(i + 1, q);
    }
}

/// Steps from sample to sample by the turn that `turn` makes of both rates and the time between them.
fn step_by_step(
    start: DQuat,
    samples: &[(f64, DVec3)],
    tell: TellSample<'_>,
    turn: impl Fn(DVec3, DVec3, f64) -> DVec3,
) {
    let mut q = start;
    for (i, w) in samples.windows(2).enumerate() {
        q = (q * DQuat::from_scaled_axis(turn(w[0].1, w[1].1, w[1].0 - w[0].0))).normalize();
        tell(i + 1, q);
    }
}

fn euler(start: DQuat, samples: &[(f64, DVec3)], tell: TellSample<'_>) {
    step_by_step(start, samples, tell, |a, _, h| a * h);
}

fn mean_rate(start: DQuat, samples: &[(f64, DVec3)], tell: TellSample<'_>) {
    step_by_step(start, samples, tell, |a, b, h| (a + b) * (0.5 * h));
}

fn single_precision(start: DQuat, samples: &[(f64, DVec3)], tell: TellSample<'_>) {
    let mut q = start.as_quat();
    for (i, w) in samples.windows(2).enumerate() {
        let turn = (w[0].1 + w[1].1) * 0.5 * (w[1].0 - w[0].0);
        q = (q * Quat::from_scaled_axis(turn.as_vec3())).normalize();
        tell(i + 1, q.as_dquat().normalize());
    }
}

/// Classical Runge-Kutta on the quaternion's differential equation, two gyro samples a step. The sample between is answered
/// by the mean rate from the step before: no later sample is known then.
fn runge_kutta(start: DQuat, samples: &[(f64, DVec3)], tell: TellSample<'_>) {
    let derivative = |q: DQuat, w: DVec3| q * DQuat::from_xyzw(w.x, w.y, w.z, 0.0) * 0.5;
    let mut q = start;
    let mut at = 0;
    while at + 2 < samples.len() {
        let [(t0, w0), (t1, w1), (t2, w2)] = [samples[at], samples[at + 1], samples[at + 2]];
        tell(at + 1, (q * DQuat::from_scaled_axis((w0 + w1) * (0.5 * (t1 - t0)))).normalize());
        let h = t2 - t0;
        let k1 = derivative(q, w0);
        let k2 = derivative(q + k1 * (h / 2.0), w1);
        let k3 = derivative(q + k2 * (h / 2.0), w1);
        let k4 = derivative(q + k3 * h, w2);
        q = (q + (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0)).normalize();
        tell(at + 2, q);
        at += 2;
    }
}

/// Largest error of any answer, degrees.
fn error_deg(motion: Coning, seconds: f64, integrate: Integrator) -> f64 {
    let samples = samples(motion, seconds);
    let mut worst = 0f64;
    integrate(motion.at(0.0), &samples, &mut |i, q| {
        // Twice the arc sine of the vector part keeps small angles that an arc cosine would round away.
        let off = (motion.at(samples[i].0).inverse() * q).to_array();
        let half = off[..3].iter().map(|v| v * v).sum::<f64>().sqrt().min(1.0).asin();
        worst = if half.is_nan() { f64::NAN } else { worst.max(2.0 * half) };
    });
    worst.to_degrees()
}

const METHODS: [PartMethod<Integrator>; 5] = [
    PartMethod::rival("Euler", "f64", euler),
    PartMethod::rival("mean rate", "f32", single_precision),
    PartMethod::rival("mean rate", "f64", mean_rate),
    PartMethod::product("Magnus, parabola", "f64", product),
    PartMethod::rival("Runge-Kutta 4", "f64, double step", runge_kutta),
];

const EXCUSE: &str = "Runge-Kutta needs pairs of even steps, and either errs far less than a gyro drifts";

/// Measures the scene and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let gun = Coning { a: 0.3, b: 0.15, c: 0.6 };
    let sampled = samples(gun, 60.0);
    let sampled = &sampled;
    let ways = METHODS.map(|m| {
        let error = error_deg(gun, 60.0, m.run);
        let work = move || {
            let mut last = DQuat::IDENTITY;
            (m.run)(gun.at(0.0), sampled, &mut |_, q| last = q);
            last
        };
        let way = m.way(error, sampled.len(), work).holds(size_of::<(DQuat, DVec3)>());
        if m.default { way.default_although(EXCUSE) } else { way }
    });
    bench.scene("gun and ship turning, 60 s", "deg", 1e-12, ways.into());
    for (case, motion, seconds) in [
        ("Earth's turn for 2 h", Coning { a: 7.292_115e-5, b: 0.8, c: 0.0 }, 7200.0),
        ("creep of 0.1 deg/s, 10 min", Coning { a: 1.745e-3, b: 0.1, c: 0.0 }, 600.0),
        ("coning at 20 rad/s, 10 s", Coning { a: 5.0, b: 0.3, c: 20.0 }, 10.0),
    ] {
        bench.extreme(case, "deg", METHODS.map(|m| m.tried(error_deg(motion, seconds, m.run))).into());
    }
    Ok(())
}
