//! Least squares with damped steps (Levenberg 1944; Marquardt 1963): the loop, without a model of what is solved for.

/// How the damping of the steps changes, and when to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping {
    /// Damping of the first step.
    pub first: f64,
    /// Factor after a step that is no better, ...
    pub rise: f64,
    /// ... and the least damping that follows one.
    pub rise_least: f64,
    /// Factor after a step that is better, ...
    pub fall: f64,
    /// ... and the least damping that follows one.
    pub fall_least: f64,
    /// Most steps.
    pub steps: usize,
    /// Most dampings that are tried for one step.
    pub tries: usize,
}

/// A step that is no worse than where it began.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Improvement<S> {
    /// Where it leads.
    pub state: S,
    /// Whether it is so small that no further one is needed.
    pub is_last: bool,
}

/// Goes on from `state` while steps improve it, and returns the last state.
///
/// `linearise` makes the normal equations at a state, or `None` where there are none and the loop ends. `step` solves them with a damping and
/// tries where that leads: `None` where they cannot be solved or the cost is higher there.
pub fn levenberg_marquardt<S, N>(
    mut state: S,
    settings: Damping,
    mut linearise: impl FnMut(&S) -> Option<N>,
    mut step: impl FnMut(&S, &N, f64) -> Option<Improvement<S>>,
) -> S {
    let mut damping = settings.first;
    for _ in 0..settings.steps {
        let Some(normal) = linearise(&state) else { break };
        let mut better = None;
        for _ in 0..settings.tries {
            better = step(&state, &normal, damping);
            if better.is_some() {
                break;
            }
            damping = (damping * settings.rise).max(settings.rise_least);
        }
        let Some(improvement) = better else { break };
        state = improvement.state;
        damping = (damping * settings.fall).max(settings.fall_least);
        if improvement.is_last {
            break;
        }
    }
    state
}

#[cfg(test)]
mod tests {
    use super::*;

    const USUAL: Damping = Damping {
        first: 1e-3,
        rise: 10.0,
        rise_least: 1e-9,
        fall: 0.1,
        fall_least: 0.0,
        steps: 200,
        tries: 8,
    };

    /// Residuals of Rosenbrock's valley: 10 (y - x^2) and 1 - x.
    fn residuals([x, y]: [f64; 2]) -> [f64; 2] {
        [10.0 * (y - x * x), 1.0 - x]
    }

    fn cost(at: [f64; 2]) -> f64 {
        residuals(at).iter().map(|r| r * r).sum()
    }

    /// The damped step of the two normal equations by Cramer's rule.
    fn damped(at: [f64; 2], damping: f64) -> [f64; 2] {
        let ([a, b], x) = (residuals(at), at[0]);
        let (xx, xy, yy) = (400.0 * x * x + 1.0, -200.0 * x, 100.0);
        let (px, py) = (-20.0 * x * a - b, 10.0 * a);
        let (xx, yy) = (xx * (1.0 + damping), yy * (1.0 + damping));
        let determinant = xx * yy - xy * xy;
        [-(yy * px - xy * py) / determinant, -(xx * py - xy * px) / determinant]
    }

    #[test]
    fn a_bent_valley_is_followed_to_its_end() {
        let end = levenberg_marquardt(
            [-1.2, 1.0],
            USUAL,
            |_| Some(()),
            |at, (), damping| {
                let step = damped(*at, damping);
                let state = [at[0] + step[0], at[1] + step[1]];
                let is_last = step[0].abs() + step[1].abs() < 1e-12;
                (cost(state) <= cost(*at)).then_some(Improvement { state, is_last })
            },
        );
        assert!((end[0] - 1.0).abs() < 1e-9 && (end[1] - 1.0).abs() < 1e-9, "{end:?}");
    }

    #[test]
    fn what_cannot_be_improved_stays_and_damping_is_bounded() {
        let mut tried = Vec::new();
        let end = levenberg_marquardt(
            7,
            USUAL,
            |_| Some(()),
            |_, (), damping| {
                tried.push(damping);
                None
            },
        );
        assert_eq!((end, tried.len()), (7, USUAL.tries));
        assert!((tried[7] / 1e4 - 1.0).abs() < 1e-9, "{tried:?}");
        assert_eq!(levenberg_marquardt(3, USUAL, |_| None::<()>, |_, (), _| unreachable!()), 3);
    }
}
