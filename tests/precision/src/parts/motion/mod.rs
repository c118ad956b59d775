//! Motion of a boat in waves, and how it could be integrated.

mod boat;
mod stiff;
pub(super) mod system;

use anyhow::{Context, Result, anyhow};
use bowwave_core::{
    sea::BeaufortForce,
    world::waves::{Spectrum, WaveField, WaveSpec},
};
use differential_equations::prelude::{ExplicitRungeKutta, IVP};
use glam::DVec3;

use self::{
    boat::{BoatState, DrivenBoat, GRAVITY},
    system::{Library, RigidSystem as _, euler, heun, rosenbrock, runge_kutta, semi_implicit, tr_bdf2},
};
use super::{About, rms, worst};
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "motion",
    what: "Heave, pitch and roll of a boat: strips in the waves, stepped 60 times a second on a fixed grid by Heun's method with its \
           damping taken implicitly (a W method), and by a cubic between.",
    truth: "the same strip model of a 7 m hull with buoyancy, cross flow and slamming written a second time (a test problem, no \
            validated boat), integrated by DOP853 at 1e-11 of the crate differential-equations, which shares no code with the \
            integrators here; for the stiff problems the references of the Bari and Hairer test sets \
            (data/ode_stiff_reference.csv). The error is the root mean square of heave, of three times the pitch (about the bow's \
            height) and of the roll, about their means over seconds 4 to 12: the start is forgotten, and trim and rise on the plane \
            are constants that the product adds",
    rivals: "explicit and semi-implicit Euler, Heun, Runge-Kutta 4, Rosenbrock (ode23s) and TR-BDF2 with fixed steps of 1/30 to \
             1/480 s, the mean plane of the water under the hull (what the product uses beyond 2.5 km and for single pictures), and a \
             boat that does not move at all; for the stiff problems the implicit ones with step control against Radau5, BDF and \
             DOPRI5 of the library",
    why: "it follows the model within 0.2 to 2 mm in force 4 and 3 cm where it slams at 12 m/s; the mean plane is wrong there by 0.06 to \
          0.9 m. It errs as Heun's method with the same steps does, less where slams throw that one off, in a fraction of the time: the \
          waves are carried from strip to strip by one rotation. Steps lie on a grid of their own, whatever the frames' pace; the last \
          seconds are kept, so that a round can be swept against the boat between frames",
};

/// Seconds of motion, and from where on they count.
const SECONDS: f64 = 12.0;
const SETTLED_S: f64 = 4.0;
/// Times a second at which motions are compared.
const COMPARED_HZ: usize = 30;
const FRAMES: usize = SECONDS as usize * COMPARED_HZ;

/// Heave, pitch and roll at each frame; empty where the way diverged.
type MotionTrack = Vec<[f64; 3]>;

/// A fixed step.
type StepRule = fn(&DrivenBoat, f64, &BoatState, f64) -> BoatState;

const STEPS: [(&str, StepRule); 6] = [
    ("Euler", euler),
    ("semi-implicit Euler", semi_implicit),
    ("Heun", heun),
    ("Runge-Kutta 4", runge_kutta),
    ("Rosenbrock (ode23s)", |s, t, y, h| rosenbrock(s, t, y, h).map_or([f64::NAN; 6], |r| r.0)),
    ("TR-BDF2", |s, t, y, h| tr_bdf2(s, t, y, h).map_or([f64::NAN; 6], |r| r.0)),
];
/// Steps a second.
const RATES: [usize; 4] = [30, 60, 120, 480];

/// The dearest settings are left to the full report.
fn quick_limit(method: &str) -> usize {
    if method.starts_with("Rosenbrock") || method.starts_with("TR") { 30 } else { 120 }
}

fn fixed(boat: &DrivenBoat, step: StepRule, start: BoatState, hz: usize) -> MotionTrack {
    let h = 1.0 / hz as f64;
    let (mut y, mut track) = (start, Vec::with_capacity(FRAMES));
    for i in 0..FRAMES * hz / COMPARED_HZ {
        if i % (hz / COMPARED_HZ) == 0 {
            track.push([y[0], y[1], y[2]]);
        }
        y = step(boat, i as f64 * h, &y, h);
        // A boat a kilometre up has left the problem.
        if !y.iter().all(|v| v.abs() < 1e3) {
            return Vec::new();
        }
    }
    track
}

fn truth(boat: &DrivenBoat, start: BoatState, tolerance: f64) -> Result<MotionTrack> {
    let times: Vec<f64> = (0..FRAMES).map(|i| i as f64 / COMPARED_HZ as f64).collect();
    // Kinks between long steps would be missed: none is longer than two milliseconds.
    let method =
        ExplicitRungeKutta::dop853().rtol(tolerance).atol(tolerance).h_max(2e-3).max_steps(1_000_000);
    let solution = IVP::ode(&Library(boat), 0.0, SECONDS, start)
        .method(method)
        .t_eval(&times)
        .solve()
        .map_err(|e| anyhow!("DOP853 gave up: {e:?}"))?;
    let track: MotionTrack = solution.y.iter().take(FRAMES).map(|y| [y[0], y[1], y[2]]).collect();
    (track.len() == FRAMES).then_some(track).context("DOP853 skipped times")
}

fn apart(track: &[[f64; 3]], truth: &[[f64; 3]]) -> f64 {
    if track.is_empty() {
        return f64::INFINITY;
    }
    let settled = (SETTLED_S * COMPARED_HZ as f64) as usize;
    let off: Vec<DVec3> = track
        .iter()
        .zip(truth)
        .skip(settled)
        .map(|(a, b)| weighed(DVec3::from(*a) - DVec3::from(*b)))
        .collect();
    let mean = off.iter().sum::<DVec3>() / off.len() as f64;
    rms(off.iter().map(|o| (*o - mean).length()))
}

/// Heave, the bow's height by the pitch, the side's by the roll: metres.
fn weighed(off: DVec3) -> DVec3 {
    off * DVec3::new(1.0, 3.0, 1.0)
}

fn mean_plane(boat: &DrivenBoat) -> MotionTrack {
    (0..FRAMES)
        .map(|i| {
            let y = boat.quasi_static(i as f64 / COMPARED_HZ as f64);
            [y[0], y[1], y[2]]
        })
        .collect()
}

/// Largest rate of change of the rates along the way, by the Jacobian's norm, and largest acceleration, in g.
fn hardness(boat: &DrivenBoat, track: &[[f64; 3]]) -> (f64, f64) {
    let states = track.windows(2).enumerate().map(|(i, w)| {
        let hz = COMPARED_HZ as f64;
        let rate = |j: usize| (w[1][j] - w[0][j]) * hz;
        (i as f64 / hz, [w[0][0], w[0][1], w[0][2], rate(0), rate(1), rate(2)])
    });
    states.fold((0.0, 0.0), |(stiff, hard): (f64, f64), (t, y)| {
        let f = boat.rate(t, &y);
        let jacobian = boat.jacobian(t, &y, &f);
        let norm = jacobian.iter().map(|r| r.iter().map(|v| v.abs()).sum::<f64>()).fold(0.0, f64::max);
        (stiff.max(norm), hard.max((f[3] / GRAVITY).abs()))
    })
}

/// A problem: name, boat, start.
fn problems() -> Result<Vec<(&'static str, DrivenBoat, BoatState)>> {
    let named = |(name, boat): (&'static str, DrivenBoat)| {
        let start = boat.start();
        (name, boat, start)
    };
    let force = BeaufortForce::new(4).context("force 4")?;
    let sea = WaveSpec { spectrum: Spectrum::of_force(force), wind_from: 0.0 };
    let problems = [
        ("chop of 0.5 m and 2.5 s at 5 m/s", DrivenBoat::in_regular_waves(0.5, 2.5, 5.0)),
        ("slamming: 1.5 m and 4 s at 12 m/s", DrivenBoat::in_regular_waves(1.5, 4.0, 12.0)),
        ("extreme: 3 m and 5 s at 15 m/s", DrivenBoat::in_regular_waves(3.0, 5.0, 15.0)),
        ("force 4, the product's sea, at rest", DrivenBoat::new(WaveField::new(&sea, 3), 0.0)),
        ("force 4, the product's sea, at 5 m/s", DrivenBoat::new(WaveField::new(&sea, 3), 5.0)),
    ];
    Ok(problems.map(named).into())
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    for (scene, boat, start) in problems()? {
        let exact = truth(&boat, start, 1e-11)?;
        let own = apart(&truth(&boat, start, 1e-9)?, &exact);
        let boat = &boat;
        let mut ways = Vec::new();
        for (method, step) in STEPS {
            for hz in RATES {
                if bench.is_quick() && hz > quick_limit(method) {
                    continue;
                }
                let error = apart(&fixed(boat, step, start, hz), &exact);
                let work = move || fixed(boat, step, start, hz);
                let seconds = SECONDS as usize;
                let unsettled = error.is_infinite() && method == "TR-BDF2";
                let note = if unsettled { "Newton's iteration does not settle at the kinks" } else { "" };
                ways.push(
                    Way::new(method, &format!("1/{hz} s"), error, seconds, work)
                        .holds(size_of::<BoatState>())
                        .note(note),
                );
            }
        }
        let plane = apart(&mean_plane(boat), &exact);
        ways.push(Way::new("mean plane", "no inertia", plane, SECONDS as usize, move || mean_plane(boat)));
        let moved = apart(&vec![[0.0; 3]; FRAMES], &exact);
        ways.push(Way::new("flat water", "", moved, SECONDS as usize, || vec![[0.0; 3]; FRAMES]));
        let (stiffness, g) = hardness(boat, &exact);
        let error = apart(&boat.ridden(COMPARED_HZ, FRAMES), &exact);
        ways.push(
            Way::new("strips, W method", "1/60 s", error, SECONDS as usize, move || {
                boat.ridden(COMPARED_HZ, FRAMES)
            })
            .default_if(true)
            .note(format!("stiffness up to {stiffness:.0}/s, accelerations up to {g:.1} g")),
        );
        bench.scene(&format!("{scene}; time for a second of motion"), "m rms", own, ways);
    }
    drop_on_calm_water(bench)?;
    elsewhere(bench);
    stiff::measure(bench)
}

/// The same kinds of problem with a model and integrators made elsewhere, so that both may be compared.
fn elsewhere(bench: &mut PartBench) {
    let text = include_str!("../../../data/boat_heave_pitch_work_precision.csv");
    let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
    for case in ["calm_drop", "chop_H0.5_T2.5_U5", "slam_H1.5_T4_U12", "extreme_H3_T5_U15"] {
        let of_case = rows.iter().filter(|r| r[0] == case && ["0.033333", "0.008333"].contains(&r[2]));
        let tried = of_case.map(|r| {
            let setting = if r[2] == "0.008333" { "1/120 s" } else { "1/30 s" };
            let error = r.get(4).and_then(|e| e.parse().ok()).unwrap_or(f64::NAN);
            ExtremeResult::rival(r[1], setting, error)
        });
        bench.extreme(&format!("{case}, as found elsewhere; error after 10 s"), "m", tried.collect());
    }
}

/// The fall onto flat water, where the mean plane has nothing to say.
fn drop_on_calm_water(bench: &mut PartBench) -> Result<()> {
    for (case, height_m) in [("dropped from 0.5 m onto flat water", 0.5), ("dropped from 5 m", 5.0)] {
        let boat = DrivenBoat::in_regular_waves(0.0, 3.0, 0.0);
        let start = [height_m, 0.1, 0.0, 0.0, 0.0, 0.0];
        let exact = truth(&boat, start, 1e-11)?;
        let all = |track: &[[f64; 3]]| {
            if track.is_empty() {
                return f64::INFINITY;
            }
            worst(track.iter().zip(&exact).map(|(a, b)| weighed(DVec3::from(*a) - DVec3::from(*b)).length()))
        };
        let mut tried = Vec::new();
        for (method, step) in STEPS {
            for hz in [30, 120] {
                tried.push(ExtremeResult::rival(
                    method,
                    &format!("1/{hz} s"),
                    all(&fixed(&boat, step, start, hz)),
                ));
            }
        }
        bench.extreme(case, "m", tried);
    }
    Ok(())
}
