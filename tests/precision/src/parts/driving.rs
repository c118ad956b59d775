//! Surge, sway and yaw of a driven boat, and how they could be integrated.

use anyhow::{Context, Result, anyhow};
use bowwave_core::{
    sea::BeaufortForce,
    world::{
        boats::{Craft, DriveState, HullForm, Orders, Propulsor, Surroundings},
        waves::{Spectrum, WaveField, WaveSpec},
    },
};
use differential_equations::prelude::{ExplicitRungeKutta, IVP};
use glam::DVec2;

use super::{
    About,
    motion::system::{Library, RigidSystem, euler, heun, runge_kutta},
    rms,
};
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "driving",
    what: "Surge, sway and yaw of a boat under its crew's orders, with resistance from Savitsky's table, side forces, cross flow, engine \
           and helm: stepped 60 times a second by Heun's method, engine and helm by their closed forms before and after half of a step.",
    truth: "the same forces with engine and helm as closed functions of time, integrated by DOP853 at 1e-11 of the crate \
            differential-equations, piece by piece between orders. The error is the root mean square distance of the boat over 30 s",
    rivals: "Euler, Heun and Runge-Kutta 4 with steps of 1/15 to 1/480 s and the orders of their time",
    why: "errors fall with the square of the step. At 1/60 s, the grid that all boats share, a boat is within a millimetre of the model after \
          30 s of hard turns at full speed, and within 16 mm in force 4, where the slope of the water costs ten times the rest and is taken once \
          a step. Steps of a quarter of a second are still stable; of half a second no longer for a skiff",
};

const SECONDS: f64 = 30.0;
/// Times a second at which tracks are compared.
const COMPARED_HZ: usize = 15;
const RATES: [usize; 5] = [15, 30, 60, 120, 480];
/// Why the product's steps are what they are.
const GRID: &str =
    "boats lie on the grid of 1/60 s that rounds are swept on; 0.8 mm in 30 s is far less than is seen";
/// Steps of the product.
const PRODUCT_HZ: usize = 60;

/// Position, heading, and the three speeds.
type Motion = [f64; 6];

/// A boat and what is ordered from when on.
struct Manoeuvre {
    craft: Craft,
    start: DriveState,
    orders: Vec<(f64, Orders)>,
    waves: WaveField,
}

impl Manoeuvre {
    /// Engine and helm at a time, by their closed forms.
    fn machinery(&self, t: f64) -> DriveState {
        let ends = self.orders.iter().skip(1).map(|(from, _)| *from).chain([f64::INFINITY]);
        self.orders.iter().zip(ends).fold(self.start, |state, ((from, orders), end)| {
            let seconds = t.min(end) - from;
            if seconds > 0.0 { self.craft.obey(&state, orders, seconds) } else { state }
        })
    }

    fn ordered(&self, t: f64) -> Orders {
        self.orders.iter().rev().find(|(from, _)| *from <= t + 1e-9).map_or(Orders::default(), |(_, o)| *o)
    }

    /// The slopes of the water for a step of `h` seconds.
    fn around(&self, state: &DriveState, t: f64, h: f64) -> Surroundings {
        self.craft.slopes(state, &self.waves, t, h)
    }

    fn beginning(&self) -> Motion {
        let s = self.start;
        [s.centre.x, s.centre.y, s.heading, s.surge, s.sway, s.yaw_rate]
    }

    /// The track by a fixed step; empty where it left all bounds.
    fn fixed(&self, step: StepRule, hz: usize) -> Vec<DVec2> {
        let (h, mut y, mut track) = (1.0 / hz as f64, self.beginning(), Vec::new());
        for i in 0..SECONDS as usize * hz {
            if i % (hz / COMPARED_HZ) == 0 {
                track.push(DVec2::new(y[0], y[1]));
            }
            y = step(self, i as f64 * h, &y, h);
            if !y.iter().all(|v| v.abs() < 1e5) {
                return Vec::new();
            }
        }
        track
    }

    /// The track by the product.
    fn driven(&self, hz: usize) -> Vec<DVec2> {
        let (h, mut state, mut track) = (1.0 / hz as f64, self.start, Vec::new());
        for i in 0..SECONDS as usize * hz {
            let t = i as f64 * h;
            if i % (hz / COMPARED_HZ).max(1) == 0 {
                track.push(state.centre);
            }
            state = self.craft.step(&state, &self.ordered(t), &self.around(&state, t, h), h);
        }
        track
    }

    fn truth(&self, tolerance: f64) -> Result<Vec<DVec2>> {
        let mut track = Vec::new();
        let mut y = self.beginning();
        let ends = self.orders.iter().skip(1).map(|(from, _)| *from).chain([SECONDS]);
        for ((from, _), end) in self.orders.iter().zip(ends) {
            let first = (from * COMPARED_HZ as f64).round() as usize;
            let last = (end * COMPARED_HZ as f64).round() as usize;
            let times: Vec<f64> = (first..=last).map(|i| i as f64 / COMPARED_HZ as f64).collect();
            // Corners of the table between long steps would be missed.
            let method =
                ExplicitRungeKutta::dop853().rtol(tolerance).atol(tolerance).h_max(5e-3).max_steps(1_000_000);
            let solution = IVP::ode(&Library(self), *from, end, y)
                .method(method)
                .t_eval(&times)
                .solve()
                .map_err(|e| anyhow!("DOP853 gave up: {e:?}"))?;
            track.extend(solution.y.iter().take(last - first).map(|y| DVec2::new(y[0], y[1])));
            y = *solution.y.last().context("DOP853 gave no state")?;
        }
        (track.len() == SECONDS as usize * COMPARED_HZ).then_some(track).context("DOP853 skipped times")
    }
}

impl RigidSystem<6> for Manoeuvre {
    fn rate(&self, t: f64, y: &Motion) -> Motion {
        let [x, north, heading, surge, sway, yaw_rate] = *y;
        let state =
            DriveState { centre: DVec2::new(x, north), heading, surge, sway, yaw_rate, ..self.machinery(t) };
        let rates = self.craft.rates(&state, &self.around(&state, t, 0.0));
        [rates.centre.x, rates.centre.y, rates.heading, rates.surge, rates.sway, rates.yaw_rate]
    }
}

fn apart(track: &[DVec2], truth: &[DVec2]) -> f64 {
    if track.is_empty() {
        return f64::INFINITY;
    }
    rms(track.iter().zip(truth).map(|(a, b)| a.distance(*b)))
}

fn hull(length_m: f64, beam_m: f64, draught_m: f64) -> HullForm {
    let half = length_m / 2.0;
    HullForm::new((-half, half), draught_m, 1.2, |x| 0.5 * beam_m * (1.0 - (x / half).max(0.0).powi(3)))
}

/// The manoeuvres, each with its name.
fn manoeuvres() -> Result<Vec<(&'static str, Manoeuvre)>> {
    let skiff = || Craft::new(&hull(7.0, 1.6, 0.28), Propulsor::Outboard, 14.0);
    let jet = || Craft::new(&hull(9.0, 2.6, 0.5), Propulsor::Jet, 18.0);
    let ship = || Craft::new(&hull(125.0, 14.0, 4.5), Propulsor::Shaft, 14.0);
    let order = |throttle: f64, helm: f64| Orders { throttle, helm };
    let made = |craft: Craft, speed_m_s: f64, orders: Vec<(f64, Orders)>, waves: WaveField| {
        let start = DriveState::steady(&craft, DVec2::new(20.0, 300.0), 0.3, speed_m_s);
        Manoeuvre { craft, start, orders, waves }
    };
    let force = BeaufortForce::new(4).context("force 4")?;
    let sea = WaveField::new(&WaveSpec { spectrum: Spectrum::of_force(force), wind_from: 0.0 }, 3);
    let zigzag = |throttle: f64| {
        (0..10).map(move |i| (3.0 * f64::from(i), order(throttle, if i % 2 == 0 { 0.7 } else { -0.7 })))
    };
    Ok(vec![
        ("a skiff at 27 kn, hard over", made(skiff(), 14.0, vec![(0.0, order(1.0, 0.7))], WaveField::FLAT)),
        ("a skiff zigzags from rest", made(skiff(), 0.0, zigzag(1.0).collect(), WaveField::FLAT)),
        ("a skiff zigzags in force 4", made(skiff(), 10.0, zigzag(0.8).collect(), sea)),
        (
            "a jet at 35 kn stops, goes astern and ahead",
            made(
                jet(),
                18.0,
                vec![(0.0, order(-1.0, 0.0)), (8.0, order(-0.7, 1.0)), (18.0, order(1.0, -1.0))],
                WaveField::FLAT,
            ),
        ),
        ("a ship at 27 kn, hard over", made(ship(), 14.0, vec![(0.0, order(1.0, 1.0))], WaveField::FLAT)),
    ])
}

/// A fixed step.
type StepRule = fn(&Manoeuvre, f64, &Motion, f64) -> Motion;

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let steps: [(&str, StepRule); 3] = [("Euler", euler), ("Heun", heun), ("Runge-Kutta 4", runge_kutta)];
    for (scene, manoeuvre) in manoeuvres()? {
        let exact = manoeuvre.truth(1e-11)?;
        let own = apart(&manoeuvre.truth(1e-9)?, &exact);
        let manoeuvre = &manoeuvre;
        let mut ways = Vec::new();
        for (method, step) in steps {
            for hz in RATES {
                if bench.is_quick() && hz > 120 {
                    continue;
                }
                let error = apart(&manoeuvre.fixed(step, hz), &exact);
                let work = move || manoeuvre.fixed(step, hz);
                ways.push(Way::new(method, &format!("1/{hz} s"), error, SECONDS as usize, work));
            }
        }
        let error = apart(&manoeuvre.driven(PRODUCT_HZ), &exact);
        let product =
            Way::new("Heun, engine and helm split off", "1/60 s", error, SECONDS as usize, move || {
                manoeuvre.driven(PRODUCT_HZ)
            })
            .holds(size_of::<DriveState>());
        // Where orders seldom jump, fewer steps of a higher order do as much.
        let smooth = !scene.contains("zigzags");
        ways.push(if smooth { product.default_although(GRID) } else { product.default_if(true) });
        bench.scene(&format!("{scene}; time for a second of motion"), "m rms", own, ways);
    }
    halving(bench)
}

/// The product's own steps halved, and steps far too long.
fn halving(bench: &mut PartBench) -> Result<()> {
    for (scene, manoeuvre) in manoeuvres()? {
        let exact = manoeuvre.truth(1e-11)?;
        let tried = [15, 30, 60, 120, 240, 480].map(|hz| {
            let error = apart(&manoeuvre.driven(hz), &exact);
            let setting = format!("1/{hz} s");
            if hz == PRODUCT_HZ {
                ExtremeResult::product("Heun, engine and helm split off", &setting, error)
            } else {
                ExtremeResult::rival("Heun, engine and helm split off", &setting, error)
            }
        });
        bench.extreme(&format!("{scene}, steps halved"), "m rms", tried.to_vec());
        let coarse = |h: f64| {
            let mut state = manoeuvre.start;
            let mut fastest = 0.0_f64;
            for i in 0..600 {
                let t = (f64::from(i) * h) % SECONDS;
                state =
                    manoeuvre.craft.step(&state, &manoeuvre.ordered(t), &manoeuvre.around(&state, t, h), h);
                fastest = fastest.max(state.surge.hypot(state.sway));
            }
            fastest / manoeuvre.craft.speed_max_m_s
        };
        let tried = [0.1, 0.25, 0.5]
            .map(|h| ExtremeResult::product("Heun, engine and helm split off", &format!("{h} s"), coarse(h)));
        bench.extreme(
            &format!("{scene}, steps far too long: fastest by the greatest speed"),
            "of 1",
            tried.to_vec(),
        );
    }
    Ok(())
}
