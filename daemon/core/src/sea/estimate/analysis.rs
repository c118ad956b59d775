//! One estimate in the making, a small piece of work at a time so that it fits beside a renderer.

use std::sync::Arc;

use rustfft::{Fft, FftPlanner, num_complex::Complex32};

use super::{
    grid::Grid,
    profile::Profile,
    record::{Record, SLOT_NS},
    shell::{self, Line},
};

/// Patches transformed in one piece of work.
const CELLS_A_STEP: usize = 8;
/// Highest frequency looked at, Hz: waves of 2 m.
const HIGHEST_HZ: f64 = 0.9;
/// Lowest frequency looked at, Hz.
const LOWEST_HZ: f64 = 0.045;
/// A patch must have been seen for this share of the window.
const SEEN: f64 = 0.7;

/// What a finished analysis found.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    pub lines: Vec<Line>,
    pub seconds: f64,
    pub gain: f64,
    pub misfit: f64,
    pub contrast: f64,
}

/// An analysis in progress.
pub(super) struct Analysis {
    start: usize,
    slots: usize,
    tapers: Vec<Vec<f32>>,
    fft: Arc<dyn Fft<f32>>,
    bins: Vec<usize>,
    next_cell: usize,
    next_line: usize,
    means: Vec<f64>,
    seen: Vec<f64>,
    power: Vec<f64>,
    /// By line, taper and patch.
    values: Vec<Vec<Vec<Complex32>>>,
    weights: Vec<f32>,
    found: Found,
    scratch: (Vec<f32>, Vec<Complex32>),
}

impl Analysis {
    /// An analysis of the newest `slots` of the record.
    pub fn new(grid: &Grid, record: &Record, slots: usize) -> Self {
        let start = record.written - slots;
        let seconds = slots as f64 * SLOT_NS as f64 * 1e-9;
        let count = (seconds / 20.0).round().clamp(3.0, 5.0) as usize;
        // Sine tapers, Riedel and Sidorenko 1995.
        let taper = |k: usize| -> Vec<f32> {
            let size = (2.0 / (slots as f64 + 1.0)).sqrt();
            let phase = std::f64::consts::PI * k as f64 / (slots as f64 + 1.0);
            (1..=slots).map(|i| (size * (phase * i as f64).sin()) as f32).collect()
        };
        let width = 1.0 / (2.0 * seconds);
        let mut bins = Vec::new();
        let mut hz = LOWEST_HZ.max(2.5 / seconds);
        while hz < HIGHEST_HZ {
            bins.push((hz / width).round() as usize);
            hz += width.max(0.03 * hz);
        }
        bins.dedup();
        let cells = grid.cells.len();
        Self {
            start,
            slots,
            tapers: (1..=count).map(taper).collect(),
            fft: FftPlanner::new().plan_fft_forward(2 * slots),
            values: vec![vec![vec![Complex32::default(); cells]; count]; bins.len()],
            bins,
            next_cell: 0,
            next_line: 0,
            means: vec![f64::NAN; cells],
            seen: vec![0.0; cells],
            power: vec![0.0; cells],
            weights: Vec::new(),
            found: Found { seconds, ..Found::default() },
            scratch: (vec![0.0; slots], vec![Complex32::default(); 2 * slots]),
        }
    }

    /// Does one piece of work; the result once all is done.
    pub fn step(&mut self, grid: &Grid, record: &Record, sky_gradient: f64) -> Option<Found> {
        let cells = grid.cells.len();
        if self.next_cell < cells {
            let end = (self.next_cell + CELLS_A_STEP).min(cells);
            (self.next_cell..end).for_each(|cell| self.transform(record, cell));
            self.next_cell = end;
            return None;
        }
        if self.weights.is_empty() {
            self.calibrate(grid, sky_gradient)?;
            return None;
        }
        if self.next_line < self.bins.len() {
            let width = 1.0 / (2.0 * self.found.seconds);
            let hz = self.bins[self.next_line] as f64 * width;
            let values = &self.values[self.next_line];
            let observed = shell::Observed { hz, cells: &grid.cells, weights: &self.weights, values };
            self.found.lines.extend(shell::fit(&observed));
            self.next_line += 1;
            return None;
        }
        Some(std::mem::take(&mut self.found))
    }

    fn transform(&mut self, record: &Record, cell: usize) {
        let (series, buffer) = (&mut self.scratch.0, &mut self.scratch.1);
        let (mean, seen) = record.contrast(self.start, cell, series);
        self.means[cell] = mean;
        self.seen[cell] = seen;
        self.power[cell] = series.iter().map(|v| f64::from(v * v)).sum::<f64>() / (self.slots as f64 * seen).max(1.0);
        // One-sided density: twice the squared transform, times the time between samples.
        let scale = (2.0 * SLOT_NS as f64 * 1e-9 / seen.max(0.1)).sqrt() as f32;
        for (k, taper) in self.tapers.iter().enumerate() {
            buffer.fill(Complex32::default());
            for ((out, v), h) in buffer.iter_mut().zip(series.iter()).zip(taper) {
                out.re = v * h * scale;
            }
            self.fft.process(buffer);
            for (line, &bin) in self.bins.iter().enumerate() {
                // Conjugated: a wave is the real part of exp(i (k x - omega t)).
                self.values[line][k][cell] = buffer[bin].conj();
            }
        }
    }

    /// Turns contrast into slope. `None` where there is no profile to calibrate with.
    fn calibrate(&mut self, grid: &Grid, sky_gradient: f64) -> Option<()> {
        for (mean, seen) in self.means.iter_mut().zip(&self.seen) {
            if *seen < SEEN {
                *mean = f64::NAN;
            }
        }
        let profile = Profile::fit(&grid.cells, &self.means);
        self.weights = vec![0.0; grid.cells.len()];
        let Some(profile) = profile else { return Some(()) };
        self.found.misfit = profile.misfit;
        let (mut gain_sum, mut contrast_sum, mut count) = (0.0, 0.0, 0.0);
        for (i, cell) in grid.cells.iter().enumerate() {
            let gain = profile.by_depression(cell.depression) + sky_gradient;
            if !self.means[i].is_finite() || gain.abs() < 0.3 {
                continue;
            }
            let deviation = self.power[i].sqrt().max(1e-4);
            self.weights[i] = (gain.abs() / deviation) as f32;
            gain_sum += gain;
            contrast_sum += deviation;
            count += 1.0;
            for line in &mut self.values {
                for values in line.iter_mut() {
                    values[i] /= gain as f32;
                }
            }
        }
        let mean: f32 = self.weights.iter().sum::<f32>() / f32::max(count as f32, 1.0);
        self.weights.iter_mut().for_each(|w| *w /= mean.max(1e-30));
        self.found.gain = gain_sum / f64::max(count, 1.0);
        self.found.contrast = contrast_sum / f64::max(count, 1.0);
        Some(())
    }

    /// First slot of the window.
    pub fn start(&self) -> usize {
        self.start
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let values: usize = self.values.iter().flatten().map(|v| v.capacity() * size_of::<Complex32>()).sum();
        values + self.slots * (self.tapers.len() + 5) * size_of::<f32>()
    }
}

