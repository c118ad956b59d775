//! Flight of a virtual round.

use bowwave_core::gunnery::{Atmosphere, Flight, GRAVITY_M_S2, Projectile, STEP_S, g7_drag_coefficient};
use glam::DVec3;

use super::row;
use crate::{page::About, table::Row, timing::time_ns};

/// What is said of this part.
pub const ABOUT: About = About {
    part: "flight",
    truth: "trajectories integrated elsewhere by DOP853 at 1e-12 (daemon/core/data/traj_g7_pointmass.csv); for the step sizes, \
            Runge-Kutta at 0.1 ms; for the extreme cases, closed forms",
    why: "Runge-Kutta 4 at 20 ms is far below the centimetre that the reference tables need, and cheaper than any smaller step \
          of a lower order that reaches it",
};

const REFERENCE: &str = include_str!("../../../../daemon/core/data/traj_g7_pointmass.csv");

/// BC, muzzle velocity, range, time of flight, height.
fn reference() -> Vec<[f64; 5]> {
    REFERENCE
        .lines()
        .filter(|l| l.starts_with(|c: char| c.is_ascii_digit()))
        .filter_map(|l| {
            let v: Vec<f64> = l.split(',').take(5).filter_map(|f| f.parse().ok()).collect();
            v.try_into().ok()
        })
        .collect()
}

/// Height at a range by the product.
fn product_height(bc: f64, v0: f64, range: f64) -> Option<f64> {
    let round = Projectile::new(bc, v0)?;
    let mut flight = Flight::new(round, &Atmosphere::ICAO, DVec3::ZERO, DVec3::X, DVec3::ZERO)?;
    while let Some(s) = flight.next_segment(10.0) {
        if s.to.position.x >= range {
            let (mut low, mut high) = (s.from.time_s, s.to.time_s);
            for _ in 0..60 {
                let mid = 0.5 * (low + high);
                if flight.state_at(mid).position.x < range { low = mid } else { high = mid }
            }
            return Some(flight.state_at(high).position.z);
        }
    }
    None
}

const KG_M2_PER_LB_IN2: f64 = 703.069_579_639_159_3;

/// A plain point mass under this file's own steps, so that steps and orders can be compared.
#[derive(Clone, Copy)]
struct Mass {
    x: DVec3,
    v: DVec3,
}

fn acceleration(bc: f64, s: Mass) -> DVec3 {
    let air = Atmosphere::ICAO.at(s.x.z);
    let speed = s.v.length();
    let drag = std::f64::consts::PI / (8.0 * bc * KG_M2_PER_LB_IN2);
    -s.v * (drag * air.density_kg_m3 * g7_drag_coefficient(speed / air.sound_m_s) * speed)
        - DVec3::Z * GRAVITY_M_S2
}

fn semi_implicit(bc: f64, s: Mass, h: f64) -> Mass {
    let v = s.v + acceleration(bc, s) * h;
    Mass { x: s.x + v * h, v }
}

fn runge_kutta(bc: f64, s: Mass, h: f64) -> Mass {
    let a1 = acceleration(bc, s);
    let s2 = Mass { x: s.x + s.v * (h / 2.0), v: s.v + a1 * (h / 2.0) };
    let a2 = acceleration(bc, s2);
    let s3 = Mass { x: s.x + s2.v * (h / 2.0), v: s.v + a2 * (h / 2.0) };
    let a3 = acceleration(bc, s3);
    let s4 = Mass { x: s.x + s3.v * h, v: s.v + a3 * h };
    let a4 = acceleration(bc, s4);
    Mass {
        x: s.x + (s.v + 2.0 * (s2.v + s3.v) + s4.v) * (h / 6.0),
        v: s.v + (a1 + 2.0 * (a2 + a3) + a4) * (h / 6.0),
    }
}

type Step = fn(f64, Mass, f64) -> Mass;

fn fly(step: Step, h: f64, seconds: f64) -> Mass {
    let start = Mass { x: DVec3::ZERO, v: DVec3::X * 850.0 };
    (0..(seconds / h).round() as usize).fold(start, |s, _| step(0.3, s, h))
}

fn product(seconds: f64) -> Option<DVec3> {
    let round = Projectile::new(0.3, 850.0)?;
    let mut flight = Flight::new(round, &Atmosphere::ICAO, DVec3::ZERO, DVec3::X, DVec3::ZERO)?;
    flight.advance(seconds);
    Some(flight.state().position)
}

/// The rows.
pub fn rows(repeats: usize) -> Vec<Row> {
    // 2.4 s: from Mach 2.5 to below the speed of sound.
    let seconds = 2.4;
    let truth = fly(runge_kutta, 1e-4, seconds).x;
    let scene = "BC 0.3, 850 m/s, 2.4 s, through Mach 1";
    let mut rows = Vec::new();
    let steps: [(&str, Step, f64); 7] = [
        ("semi-implicit Euler", semi_implicit, 0.01),
        ("semi-implicit Euler", semi_implicit, 0.001),
        ("semi-implicit Euler", semi_implicit, 0.0001),
        ("Runge-Kutta 4", runge_kutta, 0.1),
        ("Runge-Kutta 4", runge_kutta, 0.05),
        ("Runge-Kutta 4", runge_kutta, 0.01),
        ("Runge-Kutta 4", runge_kutta, 0.005),
    ];
    for (method, step, h) in steps {
        let error = fly(step, h, seconds).x.distance(truth) * 1e3;
        let time = time_ns(repeats, || fly(step, h, seconds).x);
        let mut r = row("flight", scene, method, &format!("{} ms", h * 1e3), error, "mm", time);
        r.memory_bytes = size_of::<Mass>();
        rows.push(r);
    }
    let error = product(seconds).map_or(f64::NAN, |x| x.distance(truth) * 1e3);
    let mut r = row(
        "flight",
        scene,
        "Flight (Runge-Kutta 4)",
        &format!("{} ms", STEP_S * 1e3),
        error,
        "mm",
        time_ns(repeats, || product(seconds)),
    );
    (r.default, r.memory_bytes) = (true, size_of::<Flight>());
    r.note = "keeps the last 0.6 s, so that hits can be swept at any time".into();
    rows.push(r);

    let mut extreme = |scene: &str, error_mm: f64, note: &str| {
        let mut r = row("flight", scene, "Flight (Runge-Kutta 4)", "", error_mm, "mm", 0.0);
        (r.extreme, r.note) = (true, note.into());
        rows.push(r);
    };
    let table = reference();
    let worst = table
        .iter()
        .map(|[bc, v0, range, _, height]| {
            product_height(*bc, *v0, *range).map_or(f64::NAN, |z| (z - height).abs() * 1e3)
        })
        .fold(0.0, |a: f64, b| if b.is_nan() { b } else { a.max(b) });
    extreme("reference table", worst, &format!("{} trajectory points, 100 m to 1500 m; height", table.len()));
    let vacuum = Projectile::new(f64::INFINITY, 850.0)
        .and_then(|p| Flight::new(p, &Atmosphere::ICAO, DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0), DVec3::ZERO))
        .map_or(f64::NAN, |mut f| {
            f.advance(60.0);
            let v = 850.0 / 2f64.sqrt();
            let exact = DVec3::new(v * 60.0, 0.0, v * 60.0 - 0.5 * GRAVITY_M_S2 * 3600.0);
            f.state().position.distance(exact) * 1e3
        });
    extreme("vacuum parabola, 45 deg, 60 s", vacuum, "against the closed form");
    let slow = Projectile::new(0.05, 0.0)
        .and_then(|p| Flight::new(p, &Atmosphere::ICAO, DVec3::ZERO, DVec3::X, DVec3::ZERO))
        .map_or(f64::NAN, |mut f| {
            f.advance(0.2);
            (f.state().position.z + 0.5 * GRAVITY_M_S2 * 0.04).abs() * 1e3
        });
    extreme("dropped from rest, 0.2 s", slow, "against free fall; air takes a little of it");
    rows
}
