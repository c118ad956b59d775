//! Stiff test problems: van der Pol and Robertson.

use std::fmt::Debug;

use anyhow::{Result, ensure};
use differential_equations::prelude::*;

use super::system::{Library, RigidSystem, Tolerance, controlled, rosenbrock, runge_kutta, tr_bdf2};
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    parts::worst,
};

const REFERENCE: &str = include_str!("../../../data/ode_stiff_reference.csv");

/// Van der Pol's oscillator with the parameter 1e-6, to t = 2.
struct VanDerPol;

impl RigidSystem<2> for VanDerPol {
    fn rate(&self, _t: f64, y: &[f64; 2]) -> [f64; 2] {
        [y[1], ((1.0 - y[0] * y[0]) * y[1] - y[0]) / 1e-6]
    }

    fn jacobian(&self, _t: f64, y: &[f64; 2], _rate: &[f64; 2]) -> [[f64; 2]; 2] {
        [[0.0, 1.0], [(-2.0 * y[0] * y[1] - 1.0) / 1e-6, (1.0 - y[0] * y[0]) / 1e-6]]
    }
}

/// Robertson's reaction, to t = 1e11.
struct Robertson;

impl RigidSystem<3> for Robertson {
    fn rate(&self, _t: f64, y: &[f64; 3]) -> [f64; 3] {
        let (slow, fast, square) = (0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]);
        [fast - slow, slow - fast - square, square]
    }

    fn jacobian(&self, _t: f64, y: &[f64; 3], _rate: &[f64; 3]) -> [[f64; 3]; 3] {
        let (a, b, c) = (1e4 * y[2], 1e4 * y[1], 6e7 * y[1]);
        [[-0.04, a, b], [0.04, -a - c, -b], [0.0, c, 0.0]]
    }
}

/// A problem with its reference.
struct StiffProblem<const N: usize, S> {
    name: &'static str,
    system: S,
    start: [f64; N],
    until: f64,
    reference: [f64; N],
    /// Absolute tolerance over relative, by component.
    scale: [f64; N],
}

fn reference<const N: usize>(problem: &str) -> Result<[f64; N]> {
    let values: Vec<f64> = REFERENCE
        .lines()
        .filter(|l| l.starts_with(problem))
        .filter_map(|l| l.split(',').nth(2)?.parse().ok())
        .collect();
    ensure!(values.len() == N, "{} values of {problem} in the reference", values.len());
    Ok(std::array::from_fn(|i| values[i]))
}

impl<const N: usize, S: RigidSystem<N>> StiffProblem<N, S> {
    fn error(&self, end: Option<[f64; N]>) -> f64 {
        end.map_or(f64::INFINITY, |end| {
            let off = worst((0..N).map(|i| (end[i] / self.reference[i] - 1.0).abs()));
            if off.is_nan() { f64::INFINITY } else { off }
        })
    }

    fn tolerance(&self, relative: f64) -> Tolerance<N> {
        Tolerance { absolute: self.scale.map(|s| s * relative), relative }
    }

    fn radau5(&self, relative: f64) -> Option<[f64; N]> {
        let t = self.tolerance(relative);
        let method =
            ImplicitRungeKutta::radau5().rtol(relative).atol(t.absolute).h0(1e-6).max_steps(1_000_000);
        let solved = IVP::ode(&Library(&self.system), 0.0, self.until, self.start).method(method).solve();
        last(solved)
    }

    fn bdf(&self, relative: f64) -> Option<[f64; N]> {
        let t = self.tolerance(relative);
        let method = BackwardDifferentiationFormula::adaptive().rtol(relative).atol(t.absolute).h0(1e-6);
        last(IVP::ode(&Library(&self.system), 0.0, self.until, self.start).method(method).solve())
    }

    fn dopri5(&self, relative: f64, steps: usize) -> Option<[f64; N]> {
        let t = self.tolerance(relative);
        let method = ExplicitRungeKutta::dopri5().rtol(relative).atol(t.absolute).h0(1e-8).max_steps(steps);
        last(IVP::ode(&Library(&self.system), 0.0, self.until, self.start).method(method).solve())
    }

    fn measure(&self, bench: &mut PartBench) {
        let mut ways = Vec::new();
        let bytes = size_of::<[f64; N]>();
        for relative in [1e-3, 1e-5, 1e-7] {
            let setting = format!("{relative:.0e}");
            let tolerance = self.tolerance(relative);
            let own: [(&str, super::system::Estimating<S, N>); 2] =
                [("Rosenbrock (ode23s)", rosenbrock), ("TR-BDF2", tr_bdf2)];
            for (method, step) in own {
                // Order 2 needs a hundred thousand steps for seven digits.
                if relative < 1e-6 && bench.is_quick() {
                    continue;
                }
                let run = move || controlled(&self.system, step, self.start, self.until, tolerance);
                ways.push(Way::new(method, &setting, self.error(run()), 1, run).holds(bytes));
            }
            let run = move || self.radau5(relative);
            ways.push(Way::new("Radau5 (library)", &setting, self.error(run()), 1, run).holds(bytes));
            let run = move || self.bdf(relative);
            ways.push(Way::new("BDF (library)", &setting, self.error(run()), 1, run).holds(bytes));
        }
        let scene = format!("stiff: {}; the product integrates nothing like it", self.name);
        bench.scene(&scene, "relative", 1e-12, ways);
        self.explicit(bench);
    }

    /// Explicit methods, which need steps shorter than the fastest time of the problem.
    fn explicit(&self, bench: &mut PartBench) {
        let steps = 2_000_000;
        let fixed = |count: usize| {
            let h = self.until / count as f64;
            let mut y = self.start;
            for i in 0..count {
                y = runge_kutta(&self.system, i as f64 * h, &y, h);
                if !y.iter().all(|v| v.is_finite()) {
                    return None;
                }
            }
            Some(y)
        };
        let mut tried = vec![ExtremeResult::rival("Runge-Kutta 4", "1e5 steps", self.error(fixed(100_000)))];
        tried.push(ExtremeResult::rival("Runge-Kutta 4", "2e6 steps", self.error(fixed(steps))));
        let end = self.dopri5(1e-5, steps);
        let note = if end.is_none() { "gave up after 2e6 steps" } else { "" };
        tried
            .push(ExtremeResult::rival("DOPRI5 (library)", "1e-5, step control", self.error(end)).note(note));
        bench.extreme(&format!("{}, explicit", self.name), "relative", tried);
    }
}

fn last<const N: usize, E: Debug>(solved: Result<Solution<f64, [f64; N]>, E>) -> Option<[f64; N]> {
    solved.ok()?.y.last().copied()
}

/// Measures both problems.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    StiffProblem {
        name: "van der Pol, 1e-6, to t = 2",
        system: VanDerPol,
        start: [2.0, 0.0],
        until: 2.0,
        reference: reference("vdp")?,
        scale: [1.0, 1.0],
    }
    .measure(bench);
    StiffProblem {
        name: "Robertson, to t = 1e11",
        system: Robertson,
        start: [1.0, 0.0, 0.0],
        until: 1e11,
        reference: reference("robertson")?,
        scale: [1e-8, 1e-14, 1e-8],
    }
    .measure(bench);
    Ok(())
}
