//! Weighted least squares of numbers that depend on the state of the water at the hull.

use bowwave_core::frame::reflection::grid::STATES;

/// Share of the whole weight that holds each state to the mean one, so that few pixels in a rare state say little.
const STIFF: f64 = 0.01;

/// Sums of the normal equations for so many numbers.
#[derive(Clone)]
pub struct NormalEquations<const N: usize> {
    weight: f64,
    states: [[f64; STATES]; STATES],
    values: [[f64; N]; STATES],
}

/// How a pixel depends on the states: a mean, and what each state but the first adds to it.
fn terms(states: &[f64; STATES]) -> [f64; STATES] {
    let mut terms = *states;
    terms[0] = 1.0;
    terms
}

impl<const N: usize> NormalEquations<N> {
    /// Nothing yet.
    pub fn new() -> Self {
        Self { weight: 0.0, states: [[0.0; STATES]; STATES], values: [[0.0; N]; STATES] }
    }

    /// Takes in numbers of a mixture of states, summed over a share `before` of what there is.
    pub fn add(&mut self, weight: f64, states: &[f64; STATES], before: f64, sums: &[f32; N]) {
        let terms = terms(states);
        self.weight += weight * before;
        for (i, a) in terms.iter().enumerate() {
            for (j, b) in terms.iter().enumerate() {
                self.states[i][j] += weight * before * a * b;
            }
            for (sum, v) in self.values[i].iter_mut().zip(sums) {
                *sum += weight * a * f64::from(*v);
            }
        }
    }

    /// Takes in all that another one has.
    pub fn join(&mut self, other: &Self) {
        self.weight += other.weight;
        let pairs = |a: &mut [f64], b: &[f64]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        pairs(self.states.as_flattened_mut(), other.states.as_flattened());
        pairs(self.values.as_flattened_mut(), other.values.as_flattened());
    }

    /// The values in each pure state.
    pub fn solve(&self) -> [[f64; N]; STATES] {
        let (mut a, mut b) = (self.states, self.values);
        a[0][0] += 1e-9;
        for (i, row) in a.iter_mut().enumerate().skip(1) {
            row[i] += STIFF * self.weight + 1e-9;
        }
        // Gauss and Jordan; the matrix is positive definite.
        for i in 0..STATES {
            let pivot = a[i][i];
            a[i].iter_mut().for_each(|v| *v /= pivot);
            b[i].iter_mut().for_each(|v| *v /= pivot);
            let (row, right) = (a[i], b[i]);
            for j in (0..STATES).filter(|j| *j != i) {
                let factor = a[j][i];
                a[j].iter_mut().zip(row).for_each(|(v, r)| *v -= factor * r);
                b[j].iter_mut().zip(right).for_each(|(v, r)| *v -= factor * r);
            }
        }
        let mean = b[0];
        for state in b.iter_mut().skip(1) {
            state.iter_mut().zip(mean).for_each(|(v, m)| *v += m);
        }
        b
    }
}
