//! Integration of angular rate to orientation.

use bowwave_core::{attitude::Attitude, event::ImuSample, time::Time};
use glam::{DQuat, DVec3, Quat};

use super::row;
use crate::{page::About, table::Row, timing::time_ns};

/// What is said of this part.
pub const ABOUT: About = About {
    part: "attitude",
    truth: "a coning motion in closed form (three rotations in a row); its rate is differentiated in closed form too, and sampled \
            as a gyro does",
    why: "the parabola through three rates with the first commutator, in f64: as close as Runge-Kutta, which answers only \
          every second sample; f32 loses the slow turn of the Earth altogether. Its time here includes the checks of each sample",
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

/// Orientation at the last sample, started from the truth at the first.
type Integrator = fn(DQuat, &[(f64, DVec3)]) -> DQuat;

fn product(start: DQuat, samples: &[(f64, DVec3)]) -> DQuat {
    // The levelled start of the product is replaced by the truth: only what follows it is compared.
    let mut attitude = Attitude::new(DVec3::ZERO, DQuat::IDENTITY);
    let mut first: Option<(DQuat, DQuat)> = None;
    let mut last = start;
    let mut truth_at_level = start;
    for (i, (t, rate)) in samples.iter().enumerate() {
        let sample = ImuSample {
            arrival: Time::from_ns(0),
            device_time_ns: 0,
            rate: *rate,
            accel: DVec3::Z * 9.81,
            world_from_imu: None,
        };
        if i > 0 {
            let (before, earlier) = samples[i - 1];
            if first.is_none() {
                truth_at_level *= DQuat::from_scaled_axis((earlier + *rate) * 0.5 * (t - before));
            }
        }
        if let Some(o) = attitude.observe(Time::from_ns(0).plus_secs(*t), &sample) {
            let (levelled, truth) = *first.get_or_insert((o.world_from_imu, truth_at_level));
            last = truth * levelled.inverse() * o.world_from_imu;
        }
    }
    last
}

fn euler(start: DQuat, samples: &[(f64, DVec3)]) -> DQuat {
    samples
        .windows(2)
        .fold(start, |q, w| (q * DQuat::from_scaled_axis(w[0].1 * (w[1].0 - w[0].0))).normalize())
}

fn single_precision(start: DQuat, samples: &[(f64, DVec3)]) -> DQuat {
    let q = samples.windows(2).fold(start.as_quat(), |q, w| {
        let turn = (w[0].1 + w[1].1) * 0.5 * (w[1].0 - w[0].0);
        (q * Quat::from_scaled_axis(turn.as_vec3())).normalize()
    });
    q.as_dquat().normalize()
}

fn mean_rate(start: DQuat, samples: &[(f64, DVec3)]) -> DQuat {
    samples.windows(2).fold(start, |q, w| {
        let turn = (w[0].1 + w[1].1) * (0.5 * (w[1].0 - w[0].0));
        (q * DQuat::from_scaled_axis(turn)).normalize()
    })
}

/// Classical Runge-Kutta on the quaternion's differential equation, two gyro samples a step.
fn runge_kutta(start: DQuat, samples: &[(f64, DVec3)]) -> DQuat {
    let derivative = |q: DQuat, w: DVec3| q * DQuat::from_xyzw(w.x, w.y, w.z, 0.0) * 0.5;
    let mut q = start;
    let mut at = 0;
    while at + 2 < samples.len() {
        let [(t0, w0), (_, w1), (t2, w2)] = [samples[at], samples[at + 1], samples[at + 2]];
        let h = t2 - t0;
        let k1 = derivative(q, w0);
        let k2 = derivative(q + k1 * (h / 2.0), w1);
        let k3 = derivative(q + k2 * (h / 2.0), w1);
        let k4 = derivative(q + k3 * h, w2);
        q = (q + (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0)).normalize();
        at += 2;
    }
    mean_rate(q, &samples[at..])
}

fn error_deg(motion: Coning, seconds: f64, integrate: Integrator) -> f64 {
    let samples = samples(motion, seconds);
    let end = samples.last().map_or(0.0, |s| s.0);
    // Twice the arc sine of the vector part keeps small angles that an arc cosine would round away.
    let difference = motion.at(end).inverse() * integrate(motion.at(0.0), &samples);
    (2.0 * difference.to_array()[..3].iter().map(|v| v * v).sum::<f64>().sqrt().min(1.0).asin()).to_degrees()
}

/// The rows.
pub fn rows(repeats: usize) -> Vec<Row> {
    let methods: [(&str, &str, Integrator); 5] = [
        ("Euler", "f64", euler),
        ("mean rate", "f32", single_precision),
        ("mean rate", "f64", mean_rate),
        ("Magnus, parabola", "f64", product),
        ("Runge-Kutta 4", "f64, double step", runge_kutta),
    ];
    let gun = Coning { a: 0.3, b: 0.15, c: 0.6 };
    let sampled = samples(gun, 60.0);
    let mut rows: Vec<Row> = methods
        .into_iter()
        .map(|(method, setting, integrate)| {
            // One that answers every second sample only is charged for both.
            let answers = if setting.contains("double") { sampled.len() / 2 } else { sampled.len() };
            let time = time_ns(repeats.min(9), || integrate(gun.at(0.0), &sampled)) / answers as f64;
            let error = error_deg(gun, 60.0, integrate);
            let mut r = row("attitude", "gun and ship turning, 60 s", method, setting, error, "deg", time);
            r.default = method.starts_with("Magnus");
            r.memory_bytes = size_of::<Attitude>();
            r
        })
        .collect();
    let extremes = [
        ("Earth's turn for 24 h", Coning { a: 7.292_115e-5, b: 0.8, c: 0.0 }, 86_400.0),
        ("creep of 0.1 deg/s, 10 min", Coning { a: 1.745e-3, b: 0.1, c: 0.0 }, 600.0),
        ("coning at 20 rad/s, 10 s", Coning { a: 5.0, b: 0.3, c: 20.0 }, 10.0),
    ];
    for (scene, motion, seconds) in extremes {
        for (method, setting, integrate) in methods {
            let mut r =
                row("attitude", scene, method, setting, error_deg(motion, seconds, integrate), "deg", 0.0);
            r.extreme = true;
            rows.push(r);
        }
    }
    rows
}
