//! Flight of a virtual round.

use anyhow::{Context, Result, anyhow};
use bowwave_core::{
    physics::GRAVITY_M_S2,
    world::gunnery::{Atmosphere, DragModel, DragTable, Flight, Projectile, STEP_S},
};
use differential_equations::prelude::*;
use glam::DVec3;

use super::{About, table, worst};
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "flight",
    what: "Flies a round as a point mass under gravity, drag and wind; the hit test sweeps its path.",
    truth: "trajectories integrated elsewhere, drag table included, by DOP853 at 1e-12 (daemon/core/data/traj_g7_pointmass.csv); \
            where those have none, DOP853 at 1e-12 of the crate differential-equations over the product's drag and air, whose \
            own tables are tested in core; closed forms",
    rivals: "explicit and semi-implicit Euler, Heun, Runge-Kutta 4 with other steps, and DOP853 with step control",
    why: "Runge-Kutta 4 at 20 ms stays below the centimetre that a hit test needs, through Mach 1 too, and is cheaper than any \
          smaller step of a lower order that reaches it; step control costs more than it saves on flights of seconds. Only the \
          draggiest rounds that the trainer takes (BC 0.01 at 3000 m/s) leave it: see the extreme cases",
};

const REFERENCE: &str = include_str!("../../../../daemon/core/data/traj_g7_pointmass.csv");
const KG_M2_PER_LB_IN2: f64 = 703.069_579_639_159_3;

/// Position and velocity.
pub type Mass = [f64; 6];

/// A round with drag in air that moves.
#[derive(Clone, Copy)]
pub struct FlownRound {
    /// Its drag.
    pub drag: DragModel,
    /// The ballistic coefficient that goes with it, lb/in^2.
    pub bc: f64,
    /// Velocity of the air, m/s.
    pub wind: DVec3,
}

impl FlownRound {
    /// Change of position and velocity a second.
    pub fn rate(&self, s: &Mass) -> Mass {
        let air = Atmosphere::ICAO.at(s[2]);
        let v = DVec3::new(s[3], s[4], s[5]);
        let through = v - self.wind;
        let speed = through.length();
        let drag = std::f64::consts::PI / (8.0 * self.bc * KG_M2_PER_LB_IN2);
        let cd = self.drag.coefficient(speed / air.sound_m_s);
        let a = -through * (drag * air.density_kg_m3 * cd * speed) - DVec3::Z * GRAVITY_M_S2;
        [v.x, v.y, v.z, a.x, a.y, a.z]
    }
}

impl ODE<f64, Mass> for FlownRound {
    fn diff(&self, _t: f64, y: &Mass, dydt: &mut Mass) {
        *dydt = self.rate(y);
    }
}

fn start(velocity: DVec3) -> Mass {
    [0.0, 0.0, 0.0, velocity.x, velocity.y, velocity.z]
}

fn position(s: &Mass) -> DVec3 {
    DVec3::new(s[0], s[1], s[2])
}

/// By the library's step control.
fn dop853(round: &FlownRound, velocity: DVec3, seconds: f64, tolerance: f64) -> Result<DVec3> {
    let method = ExplicitRungeKutta::dop853().rtol(tolerance).atol(tolerance).max_steps(1_000_000);
    let solution = IVP::ode(round, 0.0, seconds, start(velocity))
        .method(method)
        .solve()
        .map_err(|e| anyhow!("DOP853 gave up: {e:?}"))?;
    solution.y.last().map(position).context("DOP853 returned nothing")
}

fn plus(s: &Mass, rate: &Mass, h: f64) -> Mass {
    std::array::from_fn(|i| s[i] + rate[i] * h)
}

type FlightStep = fn(&FlownRound, &Mass, f64) -> Mass;

fn euler(round: &FlownRound, s: &Mass, h: f64) -> Mass {
    plus(s, &round.rate(s), h)
}

fn semi_implicit(round: &FlownRound, s: &Mass, h: f64) -> Mass {
    let mut next = plus(s, &round.rate(s), h);
    for i in 0..3 {
        next[i] = s[i] + next[i + 3] * h;
    }
    next
}

fn heun(round: &FlownRound, s: &Mass, h: f64) -> Mass {
    let k1 = round.rate(s);
    let k2 = round.rate(&plus(s, &k1, h));
    std::array::from_fn(|i| s[i] + (k1[i] + k2[i]) * (h / 2.0))
}

fn runge_kutta(round: &FlownRound, s: &Mass, h: f64) -> Mass {
    let k1 = round.rate(s);
    let k2 = round.rate(&plus(s, &k1, h / 2.0));
    let k3 = round.rate(&plus(s, &k2, h / 2.0));
    let k4 = round.rate(&plus(s, &k3, h));
    std::array::from_fn(|i| s[i] + (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) * (h / 6.0))
}

fn fly(step: FlightStep, round: &FlownRound, velocity: DVec3, seconds: f64, h: f64) -> DVec3 {
    let steps = (seconds / h).round() as usize;
    position(&(0..steps).fold(start(velocity), |s, _| step(round, &s, h)))
}

fn product(round: &FlownRound, velocity: DVec3, seconds: f64) -> Option<DVec3> {
    let projectile = Projectile::with_drag(round.drag, round.bc, velocity.length())?;
    let direction = velocity.try_normalize().unwrap_or(DVec3::X);
    let mut flight = Flight::new(projectile, &Atmosphere::ICAO, DVec3::ZERO, direction, round.wind)?;
    flight.advance(seconds);
    Some(flight.state().position)
}

fn apart_mm(a: Option<DVec3>, b: DVec3) -> f64 {
    a.map_or(f64::NAN, |a| a.distance(b) * 1e3)
}

const STEPS: [(&str, FlightStep, f64); 12] = [
    ("Euler", euler, 0.01),
    ("Euler", euler, 0.001),
    ("semi-implicit Euler", semi_implicit, 0.01),
    ("semi-implicit Euler", semi_implicit, 0.001),
    ("semi-implicit Euler", semi_implicit, 0.0002),
    ("Heun", heun, 0.05),
    ("Heun", heun, 0.01),
    ("Heun", heun, 0.002),
    ("Runge-Kutta 4", runge_kutta, 0.1),
    ("Runge-Kutta 4", runge_kutta, 0.05),
    ("Runge-Kutta 4", runge_kutta, 0.01),
    ("Runge-Kutta 4", runge_kutta, 0.005),
];
const PRODUCT: &str = "Flight (Runge-Kutta 4)";

fn product_setting() -> String {
    format!("{} ms", STEP_S * 1e3)
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    for (scene, velocity, seconds) in [
        ("BC 0.3, 850 m/s, 1 s, above Mach 1.5", DVec3::X * 850.0, 1.0),
        ("BC 0.3, 850 m/s, 2.4 s, through Mach 1", DVec3::X * 850.0, 2.4),
    ] {
        let round = FlownRound { drag: DragModel::G7, bc: 0.3, wind: DVec3::new(0.0, 5.0, 0.0) };
        let truth = dop853(&round, velocity, seconds, 1e-12)?;
        let coarse = dop853(&round, velocity, seconds, 1e-10)?;
        let mut ways = Vec::new();
        for (method, step, h) in STEPS {
            let error = apart_mm(Some(fly(step, &round, velocity, seconds, h)), truth);
            let work = move || fly(step, &round, velocity, seconds, h);
            ways.push(Way::new(method, &format!("{} ms", h * 1e3), error, 1, work).holds(size_of::<Mass>()));
        }
        for tolerance in [1e-3, 1e-6] {
            let error = apart_mm(dop853(&round, velocity, seconds, tolerance).ok(), truth);
            let work = move || dop853(&round, velocity, seconds, tolerance).ok();
            ways.push(Way::new("DOP853, step control", &format!("{tolerance:.0e}"), error, 1, work));
        }
        let error = apart_mm(product(&round, velocity, seconds), truth);
        ways.push(
            Way::new(PRODUCT, &product_setting(), error, 1, move || product(&round, velocity, seconds))
                .default_if(true)
                .holds(size_of::<Flight>())
                .note("keeps the last 0.6 s, so that hits can be swept at any time"),
        );
        bench.scene(scene, "mm", apart_mm(Some(coarse), truth), ways);
    }
    reference_case(bench);
    hard_flights(bench)?;
    closed_forms(bench);
    Ok(())
}

/// The path's time of flight and height at a range.
fn crossing(mut advance: impl FnMut() -> DVec3, range: f64, h: f64) -> f64 {
    // Both ends and their neighbours: a cubic through four points of the path, by Neville's scheme in x.
    let mut last = [DVec3::ZERO; 4];
    for i in 0..(60.0 / h) as usize {
        last.rotate_left(1);
        last[3] = advance();
        if i >= 3 && last[2].x >= range {
            let mut z = last.map(|p| p.z);
            for width in 1..4 {
                for j in 0..4 - width {
                    let (a, b) = (last[j].x, last[j + width].x);
                    z[j] = ((range - b) * z[j] + (a - range) * z[j + 1]) / (a - b);
                }
            }
            return z[0];
        }
    }
    f64::NAN
}

/// Height at the ranges of the table from elsewhere.
fn reference_case(bench: &mut PartBench) {
    let rows = table(REFERENCE);
    let case = format!("{} points of trajectories from elsewhere, 100 to 1500 m; height", rows.len());
    let mut tried = Vec::new();
    for (method, step, h) in STEPS {
        let error = worst(rows.iter().map(|row| {
            let (round, mut s) =
                (FlownRound { drag: DragModel::G7, bc: row[0], wind: DVec3::ZERO }, start(DVec3::X * row[1]));
            let mut at = 0;
            let path = || {
                // The muzzle itself is the first point.
                if at > 0 {
                    s = step(&round, &s, h);
                }
                at += 1;
                position(&s)
            };
            (crossing(path, row[2], h) - row[4]).abs() * 1e3
        }));
        tried.push(ExtremeResult::rival(method, &format!("{} ms", h * 1e3), error));
    }
    let error =
        worst(rows.iter().map(|row| {
            product_height(row[0], row[1], row[2]).map_or(f64::NAN, |z| (z - row[4]).abs() * 1e3)
        }));
    tried.push(ExtremeResult::product(PRODUCT, &product_setting(), error));
    bench.extreme(&case, "mm", tried);
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

/// A flight that is hard in some way: name, drag, ballistic coefficients, velocity, seconds.
type Hard = (&'static str, DragModel, [f64; 3], DVec3, f64);

/// Flights without a closed form, against DOP853.
fn hard_flights(bench: &mut PartBench) -> Result<()> {
    let up = |degrees: f64, speed: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        DVec3::new(cos, 0.0, sin) * speed
    };
    // Drag that doubles within a tenth of a Mach number, as a table of few points may have it.
    let steep = DragTable::new(&[(0.0, 0.15), (0.9, 0.15), (1.0, 0.4), (1.1, 0.45), (4.0, 0.25)]);
    let steep = steep.map_or(DragModel::G7, DragModel::Table);
    let (g7, g1, ball) = (DragModel::G7, DragModel::G1, DragModel::Sphere);
    let cases: [Hard; 9] = [
        ("Mach 1.1 to 0.9: 375 m/s, 3 s", g7, [0.1, 0.3, 0.5], up(0.0, 375.0), 3.0),
        ("Mach 0.95, where drag doubles: 323 m/s, 3 s", g7, [0.1, 0.3, 0.5], up(0.0, 323.0), 3.0),
        ("speed to zero: straight up and back, 100 m/s, 20 s", g7, [0.05, 0.1, 0.3], up(90.0, 100.0), 20.0),
        ("speed to zero at once: BC 0.01, 3000 m/s, 10 s", g7, [0.01, 0.02, 0.05], up(0.0, 3000.0), 10.0),
        ("steep, 80 deg up, 850 m/s, 60 s", g7, [0.1, 0.3, 0.5], up(80.0, 850.0), 60.0),
        ("steep, 60 deg down, 850 m/s, 3 s", g7, [0.1, 0.3, 0.5], up(-60.0, 850.0), 3.0),
        ("G1 through Mach 1: 450 m/s, 4 s", g1, [0.1, 0.3, 0.6], up(1.0, 450.0), 4.0),
        ("a ball through Mach 1: 450 m/s, 4 s", ball, [0.1, 0.3, 0.6], up(1.0, 450.0), 4.0),
        ("a table of five points through Mach 1: 450 m/s, 4 s", steep, [0.1, 0.2, 0.3], up(1.0, 450.0), 4.0),
    ];
    for (case, drag, coefficients, velocity, seconds) in cases {
        let mut truths = Vec::new();
        for bc in coefficients {
            let round = FlownRound { drag, bc, wind: DVec3::new(0.0, 5.0, 0.0) };
            truths.push((round, dop853(&round, velocity, seconds, 1e-12)?));
        }
        let mut tried = Vec::new();
        for (method, step, h) in STEPS {
            let fly = |(round, truth): &(FlownRound, DVec3)| {
                let error = apart_mm(Some(fly(step, round, velocity, seconds, h)), *truth);
                if error.is_finite() { error } else { f64::INFINITY }
            };
            tried.push(ExtremeResult::rival(
                method,
                &format!("{} ms", h * 1e3),
                worst(truths.iter().map(fly)),
            ));
        }
        let error = worst(truths.iter().map(|(r, truth)| apart_mm(product(r, velocity, seconds), *truth)));
        tried.push(ExtremeResult::product(PRODUCT, &product_setting(), error));
        bench.extreme(&format!("{case}; BC {coefficients:?}"), "mm", tried);
    }
    Ok(())
}

/// Cases with a closed form.
fn closed_forms(bench: &mut PartBench) {
    let vacuum = FlownRound { drag: DragModel::G7, bc: f64::INFINITY, wind: DVec3::ZERO };
    let velocity = DVec3::new(1.0, 0.0, 1.0).normalize() * 850.0;
    let exact = velocity * 60.0 - DVec3::Z * (0.5 * GRAVITY_M_S2 * 3600.0);
    let mut tried: Vec<ExtremeResult> = STEPS
        .map(|(method, step, h)| {
            let error = apart_mm(Some(fly(step, &vacuum, velocity, 60.0, h)), exact);
            ExtremeResult::rival(method, &format!("{} ms", h * 1e3), error)
        })
        .into();
    let error = apart_mm(product(&vacuum, velocity, 60.0), exact);
    tried.push(ExtremeResult::product(PRODUCT, &product_setting(), error));
    bench.extreme("vacuum parabola, 45 deg, 60 s", "mm", tried);

    let rested = FlownRound { drag: DragModel::G7, bc: 0.05, wind: DVec3::ZERO };
    let fallen = product(&rested, DVec3::ZERO, 0.2).map_or(f64::NAN, |p| p.z);
    let error = (fallen + 0.5 * GRAVITY_M_S2 * 0.04).abs() * 1e3;
    let tried = ExtremeResult::product(PRODUCT, &product_setting(), error);
    bench.extreme(
        "dropped from rest, 0.2 s, against free fall",
        "mm",
        vec![tried.note("air takes a little of it")],
    );

    // In the air's own frame the round flies straight, so the wind W moves it by W (t - x / v0), gravity or not.
    let lag =
        |round: &FlownRound, p: DVec3, v0: f64, t: f64| (p.y - round.wind.y * (t - p.x / v0)).abs() * 1e3;
    let winds =
        [0.1, 5.0, 25.0].map(|w| FlownRound { drag: DragModel::G7, bc: 0.3, wind: DVec3::new(0.0, w, 0.0) });
    let mut tried: Vec<ExtremeResult> = STEPS
        .map(|(method, step, h)| {
            let errors = winds.map(|r| lag(&r, fly(step, &r, DVec3::X * 850.0, 3.0, h), 850.0, 3.0));
            ExtremeResult::rival(method, &format!("{} ms", h * 1e3), worst(errors))
        })
        .into();
    let errors =
        winds.map(|r| product(&r, DVec3::X * 850.0, 3.0).map_or(f64::NAN, |p| lag(&r, p, 850.0, 3.0)));
    tried.push(
        ExtremeResult::product(PRODUCT, &product_setting(), worst(errors))
            .note("every one-step method keeps the rule: it shows mistakes, not steps"),
    );
    bench.extreme("crosswind of 0.1, 5, 25 m/s against the lag rule, 3 s", "mm", tried);
}
