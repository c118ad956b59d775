//! The Fourier transform that turns the amplitudes of a tile's waves into heights.

use std::sync::Arc;

use rayon::prelude::*;
use rustfft::{Fft, FftNum, FftPlanner, num_complex::Complex};

/// Numbers whose rows are worth several threads.
const PARALLEL: usize = 512 * 512;
/// Side of the squares by which a tile is transposed; divides every tile's side.
const BLOCK: usize = 16;

/// The inverse transform over both axes of a square of `n` x `n` numbers, without scaling.
pub struct Transform<T: FftNum> {
    n: usize,
    fft: Arc<dyn Fft<T>>,
}

impl<T: FftNum> Transform<T> {
    /// For squares of `n` x `n` numbers, `n` a multiple of 16.
    pub fn new(n: usize) -> Self {
        Self { n, fft: FftPlanner::new().plan_fft_inverse(n) }
    }

    /// Transforms `data` by way of `swap`, which is as large. Rows and columns have changed places afterwards.
    pub fn run(&self, data: &mut Vec<Complex<T>>, swap: &mut Vec<Complex<T>>) {
        self.rows(data);
        self.transpose(data, swap);
        self.rows(swap);
        std::mem::swap(data, swap);
    }

    /// The same, but rows stay rows.
    pub fn run_in_place(&self, data: &mut Vec<Complex<T>>, swap: &mut Vec<Complex<T>>) {
        self.run(data, swap);
        self.transpose(data, swap);
        std::mem::swap(data, swap);
    }

    fn rows(&self, data: &mut [Complex<T>]) {
        if data.len() < PARALLEL {
            self.fft.process(data);
        } else {
            data.par_chunks_mut(self.n).for_each(|row| self.fft.process(row));
        }
    }

    fn transpose(&self, from: &[Complex<T>], to: &mut [Complex<T>]) {
        let n = self.n;
        for by in (0..n).step_by(BLOCK) {
            for bx in (0..n).step_by(BLOCK) {
                for y in by..by + BLOCK {
                    for x in bx..bx + BLOCK {
                        to[x * n + y] = from[y * n + x];
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rustfft::num_complex::Complex64;

    use super::*;

    #[test]
    fn one_wave_is_its_closed_form_in_rows_and_columns() {
        let n = 32;
        // Three cycles along a row, five down a column.
        let mut data = vec![Complex64::ZERO; n * n];
        data[5 * n + 3] = Complex64::ONE;
        let mut swap = vec![Complex64::ZERO; n * n];
        let transform = Transform::new(n);
        let (mut turned, mut kept) = (data.clone(), data);
        transform.run(&mut turned, &mut swap);
        transform.run_in_place(&mut kept, &mut swap);
        for y in 0..n {
            for x in 0..n {
                let phase = std::f64::consts::TAU * (3 * x + 5 * y) as f64 / n as f64;
                let expected = Complex64::from_polar(1.0, phase);
                assert!((kept[y * n + x] - expected).norm() < 1e-12);
                assert!((turned[x * n + y] - expected).norm() < 1e-12);
            }
        }
    }
}
