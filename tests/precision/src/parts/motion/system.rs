//! Differential equations and the ways to step through them.

use differential_equations::prelude::{Matrix, ODE};

/// y' = f(t, y).
pub trait RigidSystem<const N: usize> {
    /// f(t, y).
    fn rate(&self, t: f64, y: &[f64; N]) -> [f64; N];

    /// df/dy, by forward differences where no better is known.
    fn jacobian(&self, t: f64, y: &[f64; N], rate: &[f64; N]) -> [[f64; N]; N] {
        let mut jacobian = [[0.0; N]; N];
        for column in 0..N {
            let step = f64::EPSILON.sqrt() * y[column].abs().max(1e-5);
            let mut moved = *y;
            moved[column] += step;
            let ahead = self.rate(t, &moved);
            for row in 0..N {
                jacobian[row][column] = (ahead[row] - rate[row]) / step;
            }
        }
        jacobian
    }

    /// Whether f depends on t itself.
    fn depends_on_time(&self) -> bool {
        false
    }
}

/// The same system for the library's solvers.
pub struct Library<'a, S>(pub &'a S);

impl<const N: usize, S: RigidSystem<N>> ODE<f64, [f64; N]> for Library<'_, S> {
    fn diff(&self, t: f64, y: &[f64; N], dydt: &mut [f64; N]) {
        *dydt = self.0.rate(t, y);
    }

    fn jacobian(&self, t: f64, y: &[f64; N], j: &mut Matrix<f64>) {
        let jacobian = self.0.jacobian(t, y, &self.0.rate(t, y));
        for (row, values) in jacobian.iter().enumerate() {
            for (column, value) in values.iter().enumerate() {
                j[(row, column)] = *value;
            }
        }
    }
}

/// y + h k.
pub fn plus<const N: usize>(y: &[f64; N], k: &[f64; N], h: f64) -> [f64; N] {
    std::array::from_fn(|i| y[i] + h * k[i])
}

/// Explicit Euler.
pub fn euler<const N: usize>(s: &impl RigidSystem<N>, t: f64, y: &[f64; N], h: f64) -> [f64; N] {
    plus(y, &s.rate(t, y), h)
}

/// Semi-implicit Euler for a state of positions, then their speeds: the new speeds move the positions.
pub fn semi_implicit<const N: usize>(s: &impl RigidSystem<N>, t: f64, y: &[f64; N], h: f64) -> [f64; N] {
    let mut next = plus(y, &s.rate(t, y), h);
    for i in 0..N / 2 {
        next[i] = y[i] + h * next[i + N / 2];
    }
    next
}

/// Heun's method of order 2.
pub fn heun<const N: usize>(s: &impl RigidSystem<N>, t: f64, y: &[f64; N], h: f64) -> [f64; N] {
    let k1 = s.rate(t, y);
    let k2 = s.rate(t + h, &plus(y, &k1, h));
    std::array::from_fn(|i| y[i] + h / 2.0 * (k1[i] + k2[i]))
}

/// The classical Runge-Kutta method of order 4.
pub fn runge_kutta<const N: usize>(s: &impl RigidSystem<N>, t: f64, y: &[f64; N], h: f64) -> [f64; N] {
    let k1 = s.rate(t, y);
    let k2 = s.rate(t + h / 2.0, &plus(y, &k1, h / 2.0));
    let k3 = s.rate(t + h / 2.0, &plus(y, &k2, h / 2.0));
    let k4 = s.rate(t + h, &plus(y, &k3, h));
    std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
}

/// 1 / (2 + sqrt 2), which makes both implicit methods below L-stable.
const D: f64 = 0.292_893_218_813_452_5;

/// One step of the Rosenbrock method of ode23s (Shampine and Reichelt 1997): order 2, L-stable. With the estimate of its
/// error; `None` where the matrix is singular.
pub fn rosenbrock<const N: usize>(
    s: &impl RigidSystem<N>,
    t: f64,
    y: &[f64; N],
    h: f64,
) -> Option<([f64; N], [f64; N])> {
    let e32 = 6.0 + 2f64.sqrt();
    let f0 = s.rate(t, y);
    let w = Factors::of(&shifted(&s.jacobian(t, y, &f0), h * D))?;
    let by_time = if s.depends_on_time() {
        let step = h * 1e-4;
        let ahead = s.rate(t + step, y);
        std::array::from_fn(|i| (ahead[i] - f0[i]) / step)
    } else {
        [0.0; N]
    };
    let k1 = w.solve(&plus(&f0, &by_time, h * D));
    let f1 = s.rate(t + h / 2.0, &plus(y, &k1, h / 2.0));
    let k2: [f64; N] = plus(&w.solve(&plus(&f1, &k1, -1.0)), &k1, 1.0);
    let next = plus(y, &k2, h);
    let f2 = s.rate(t + h, &next);
    let right: [f64; N] =
        std::array::from_fn(|i| f2[i] - e32 * (k2[i] - f1[i]) - 2.0 * (k1[i] - f0[i]) + h * D * by_time[i]);
    let k3 = w.solve(&right);
    Some((next, std::array::from_fn(|i| h / 6.0 * (k1[i] - 2.0 * k2[i] + k3[i]))))
}

/// One step of TR-BDF2 (Bank 1985, with the error estimate of Hosea and Shampine 1996): order 2, L-stable. `None` where
/// Newton's iteration does not settle.
pub fn tr_bdf2<const N: usize>(
    s: &impl RigidSystem<N>,
    t: f64,
    y: &[f64; N],
    h: f64,
) -> Option<([f64; N], [f64; N])> {
    let (gamma, w) = (2.0 - 2f64.sqrt(), 2f64.sqrt() / 4.0);
    let f0 = s.rate(t, y);
    let factors = Factors::of(&shifted(&s.jacobian(t, y, &f0), h * D))?;
    // Both stages have the form z = known + h D f(z).
    let settle = |at: f64, known: &[f64; N], guess: [f64; N]| {
        let mut z = guess;
        let mut last = f64::INFINITY;
        for _ in 0..12 {
            let f = s.rate(at, &z);
            let miss: [f64; N] = std::array::from_fn(|i| known[i] + h * D * f[i] - z[i]);
            let change = factors.solve(&miss);
            z = plus(&z, &change, 1.0);
            let size = change.iter().zip(&z).map(|(c, z)| c.abs() / z.abs().max(1e-9)).fold(0.0, f64::max);
            if !size.is_finite() || size > 2.0 * last {
                return None;
            }
            if size < 1e-11 {
                return Some(z);
            }
            last = size;
        }
        (last < 1e-6).then_some(z)
    };
    let middle = settle(t + gamma * h, &plus(y, &f0, h * D), plus(y, &f0, 0.0))?;
    let fm: [f64; N] = std::array::from_fn(|i| (middle[i] - y[i]) / (h * D) - f0[i]);
    let known = std::array::from_fn(|i| y[i] + h * w * (f0[i] + fm[i]));
    let next = settle(t + h, &known, middle)?;
    let f1: [f64; N] = std::array::from_fn(|i| (next[i] - known[i]) / (h * D));
    let third = [(1.0 - w) / 3.0 - w, (3.0 * w + 1.0) / 3.0 - w, D / 3.0 - D];
    let raw = std::array::from_fn(|i| h * (third[0] * f0[i] + third[1] * fm[i] + third[2] * f1[i]));
    // Through the matrix once: stiff components of the raw estimate are far too large.
    Some((next, factors.solve(&raw)))
}

/// I - factor J.
fn shifted<const N: usize>(jacobian: &[[f64; N]; N], factor: f64) -> [[f64; N]; N] {
    std::array::from_fn(|r| std::array::from_fn(|c| f64::from(r == c) - factor * jacobian[r][c]))
}

/// An LU factorisation with row exchanges.
struct Factors<const N: usize> {
    lu: [[f64; N]; N],
    order: [usize; N],
}

impl<const N: usize> Factors<N> {
    fn of(matrix: &[[f64; N]; N]) -> Option<Self> {
        let (mut lu, mut order) = (*matrix, std::array::from_fn(|i| i));
        for k in 0..N {
            let pivot = (k..N).max_by(|a, b| lu[*a][k].abs().total_cmp(&lu[*b][k].abs()))?;
            lu.swap(k, pivot);
            order.swap(k, pivot);
            if lu[k][k] == 0.0 || !lu[k][k].is_finite() {
                return None;
            }
            for row in k + 1..N {
                lu[row][k] /= lu[k][k];
                for column in k + 1..N {
                    lu[row][column] -= lu[row][k] * lu[k][column];
                }
            }
        }
        Some(Self { lu, order })
    }

    fn solve(&self, right: &[f64; N]) -> [f64; N] {
        let mut x: [f64; N] = std::array::from_fn(|i| right[self.order[i]]);
        for row in 1..N {
            x[row] -= (0..row).map(|c| self.lu[row][c] * x[c]).sum::<f64>();
        }
        for row in (0..N).rev() {
            let sum: f64 = (row + 1..N).map(|c| self.lu[row][c] * x[c]).sum();
            x[row] = (x[row] - sum) / self.lu[row][row];
        }
        x
    }
}

/// A step with an estimate of its error.
pub type Estimating<S, const N: usize> = fn(&S, f64, &[f64; N], f64) -> Option<([f64; N], [f64; N])>;

/// Tolerance of a step, by component: absolute, and relative to the component.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance<const N: usize> {
    /// Absolute.
    pub absolute: [f64; N],
    /// Relative.
    pub relative: f64,
}

/// Steps of a length that keeps each one's error within the tolerance; `None` after too many of them.
pub fn controlled<const N: usize, S: RigidSystem<N>>(
    system: &S,
    step: Estimating<S, N>,
    start: [f64; N],
    until: f64,
    tolerance: Tolerance<N>,
) -> Option<[f64; N]> {
    let (mut t, mut y, mut h) = (0.0, start, 1e-6_f64.min(until));
    for _ in 0..3_000_000 {
        if t >= until {
            return Some(y);
        }
        h = h.min(until - t);
        let off = step(system, t, &y, h).map(|(next, error)| {
            let share = |i: usize| {
                let size = next[i].abs().max(y[i].abs());
                error[i].abs() / (tolerance.absolute[i] + tolerance.relative * size)
            };
            (next, (0..N).map(share).fold(0.0, |a: f64, b| if b.is_nan() { b } else { a.max(b) }))
        });
        let Some((next, off)) = off.filter(|(_, off)| off.is_finite()) else {
            h *= 0.25;
            continue;
        };
        if off <= 1.0 {
            // The remaining stretch may be too short to move t.
            t = if h >= until - t { until } else { t + h };
            y = next;
        }
        h *= (0.8 * off.max(1e-9).powf(-1.0 / 3.0)).clamp(0.2, 4.0);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y'' = -y - 0.1 y' + cos 2t, as position and speed.
    struct Spring;

    impl RigidSystem<2> for Spring {
        fn rate(&self, t: f64, y: &[f64; 2]) -> [f64; 2] {
            [y[1], -y[0] - 0.1 * y[1] + (2.0 * t).cos()]
        }

        fn depends_on_time(&self) -> bool {
            true
        }
    }

    fn order(step: impl Fn(f64, &[f64; 2], f64) -> [f64; 2]) -> f64 {
        let end = |n: usize| {
            let h = 4.0 / n as f64;
            (0..n).fold([1.0, 0.0], |y, i| step(i as f64 * h, &y, h))
        };
        let exact = {
            let h = 4.0 / 20_000.0;
            (0..20_000).fold([1.0, 0.0], |y, i| runge_kutta(&Spring, f64::from(i) * h, &y, h))
        };
        let off = |n| (0..2).map(|i| (end(n)[i] - exact[i]).abs()).fold(0.0, f64::max);
        (off(100) / off(200)).log2()
    }

    #[test]
    fn every_method_has_the_order_it_should_have() {
        let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 0.3, "{found}, not {wanted}");
        near(order(|t, y, h| euler(&Spring, t, y, h)), 1.0);
        near(order(|t, y, h| semi_implicit(&Spring, t, y, h)), 1.0);
        near(order(|t, y, h| heun(&Spring, t, y, h)), 2.0);
        near(order(|t, y, h| runge_kutta(&Spring, t, y, h)), 4.0);
        near(order(|t, y, h| rosenbrock(&Spring, t, y, h).unwrap().0), 2.0);
        near(order(|t, y, h| tr_bdf2(&Spring, t, y, h).unwrap().0), 2.0);
    }

    #[test]
    fn estimates_fall_with_the_third_power_of_the_step() {
        for step in [rosenbrock::<2>, tr_bdf2::<2>] as [Estimating<Spring, 2>; 2] {
            let estimate = |h: f64| step(&Spring, 0.3, &[1.0, 0.5], h).unwrap().1[1].abs();
            let order = (estimate(0.02) / estimate(0.01)).log2();
            assert!((order - 3.0).abs() < 0.4, "{order}");
        }
    }

    #[test]
    fn a_linear_system_is_solved() {
        let m = [[0.0, 2.0, 1.0], [1.0, 1.0, 0.0], [3.0, 0.0, 1.0]];
        let x = Factors::of(&m).unwrap().solve(&[7.0, 3.0, 6.0]);
        assert!(x.iter().zip([1.0, 2.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-14), "{x:?}");
        assert!(Factors::of(&[[1.0, 2.0], [2.0, 4.0]]).is_none());
    }
}
