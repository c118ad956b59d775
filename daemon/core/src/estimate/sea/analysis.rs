//! One estimate in the making, a small piece of work at a time so that it fits beside a renderer.

use std::sync::Arc;

use rustfft::{Fft, FftPlanner, num_complex::Complex32};

use super::{
    Unknown,
    grid::SeaGrid,
    profile::unevenness,
    radiance::{Gains, Radiance, RadianceRow, Search},
    record::{Record, SLOT_NS},
    shell::{self, ShellLine},
    sky::SkyRows,
};

/// Frequencies looked at, Hz: waves of 770 m to 2 m.
const BAND_HZ: (f64, f64) = (0.045, 0.9);
/// Frequencies at which only noise is expected in patches that are metres large, Hz: the first, the step, how many.
const NOISE_HZ: (f64, f64, usize) = (1.5, 0.15, 6);

/// Result of an analysis.
#[derive(Clone, Debug, Default)]
pub(super) struct AnalysisResult {
    /// By rising frequency.
    pub lines: Vec<ShellLine>,
    /// Power of noise of a near patch, slope squared by Hz.
    pub noise: f64,
    /// Length of the window, seconds.
    pub seconds: f64,
    /// Variance of the spectral window, Hz^2.
    pub window_hz2: f64,
    /// Root mean square slope.
    pub rough: f64,
    /// Relative standard deviation of the change of brightness with slope.
    pub gain_sigma: f64,
}

/// The end of an analysis.
pub(super) struct FinishedAnalysis {
    pub found: Result<AnalysisResult, Unknown>,
    /// The slot after the window.
    pub end: usize,
}

/// How far the calibration of brightness to slope is.
enum SlopeCalibration {
    /// Patches are still transformed.
    Waits,
    /// Skies and roughnesses are tried.
    Searches(Search),
    /// The likely ones are averaged; those still to be counted in.
    Averages(Vec<(Radiance, f64)>, Gains),
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
    power: Vec<f64>,
    /// By line, taper and patch.
    values: Vec<Vec<Vec<Complex32>>>,
    calibration: SlopeCalibration,
    weights: Vec<f32>,
    near: Vec<bool>,
    found: AnalysisResult,
    series: Vec<f32>,
    buffer: Vec<Complex32>,
}

impl Analysis {
    /// An analysis of the newest `slots` of the record.
    pub fn new(grid: &SeaGrid, record: &Record, slots: usize) -> Self {
        let seconds = slots as f64 * SLOT_NS as f64 * 1e-9;
        let count = (seconds / 30.0).floor().clamp(2.0, 4.0) as usize;
        // Sine tapers, Riedel and Sidorenko 1995 (IEEE Trans. Signal Process. 43, 188).
        let taper = |k: usize| -> Vec<f32> {
            let size = (2.0 / (slots as f64 + 1.0)).sqrt();
            let phase = std::f64::consts::PI * k as f64 / (slots as f64 + 1.0);
            (1..=slots).map(|i| (size * (phase * i as f64).sin()) as f32).collect()
        };
        let squares: f64 = (1..=count).map(|k| (k * k) as f64).sum::<f64>() / count as f64;
        let bins = bins(seconds);
        let cells = grid.cells.len();
        Self {
            start: record.written - slots,
            slots,
            tapers: (1..=count).map(taper).collect(),
            // Padded to twice the length: lines lie half a bandwidth apart.
            fft: FftPlanner::new().plan_fft_forward(2 * slots),
            values: vec![vec![vec![Complex32::default(); cells]; count]; bins.len()],
            bins,
            next_cell: 0,
            next_line: 0,
            means: vec![f64::NAN; cells],
            power: vec![0.0; cells],
            calibration: SlopeCalibration::Waits,
            weights: Vec::new(),
            near: vec![false; cells],
            found: AnalysisResult {
                seconds,
                window_hz2: squares / (4.0 * seconds * seconds),
                ..AnalysisResult::default()
            },
            series: vec![0.0; slots],
            buffer: vec![Complex32::default(); 2 * slots],
        }
    }

    /// Does one piece of work; what was found once all is done.
    pub fn step(&mut self, grid: &SeaGrid, record: &Record, sky: &SkyRows) -> Option<FinishedAnalysis> {
        /// Patches transformed in one piece of work.
        const CELLS_A_STEP: usize = 8;
        let end = self.start + self.slots;
        let cells = grid.cells.len();
        if self.next_cell < cells {
            let next = (self.next_cell + CELLS_A_STEP).min(cells);
            (self.next_cell..next).for_each(|cell| self.transform(record, cell));
            self.next_cell = next;
            return None;
        }
        if self.weights.is_empty() {
            return self.light(grid, sky).err().map(|why| FinishedAnalysis { found: Err(why), end });
        }
        if self.next_line < self.bins.len() {
            self.line(grid);
            return None;
        }
        let mut found = std::mem::take(&mut self.found);
        found.noise /= NOISE_HZ.2 as f64;
        Some(FinishedAnalysis { found: Ok(found), end })
    }

    fn transform(&mut self, record: &Record, cell: usize) {
        /// A patch must have been seen for this share of the window.
        const SEEN: f64 = 0.7;
        let (mean, seen) = record.contrast(self.start, cell, &mut self.series);
        if seen < SEEN {
            return;
        }
        self.means[cell] = mean;
        let square: f64 = self.series.iter().map(|v| f64::from(v * v)).sum();
        self.power[cell] = square / (self.slots as f64 * seen);
        // One-sided density: twice the squared transform, times the time between samples.
        let scale = (2.0 * SLOT_NS as f64 * 1e-9 / seen).sqrt() as f32;
        for (k, taper) in self.tapers.iter().enumerate() {
            self.buffer.fill(Complex32::default());
            for ((out, v), h) in self.buffer.iter_mut().zip(&self.series).zip(taper) {
                out.re = v * h * scale;
            }
            self.fft.process(&mut self.buffer);
            for (line, &bin) in self.values.iter_mut().zip(&self.bins) {
                // Conjugated: a wave is the real part of exp(i (k x - omega t)).
                line[k][cell] = self.buffer[bin].conj();
            }
        }
    }

    /// One piece of the calibration of brightness to slope, or why the picture does not allow it.
    fn light(&mut self, grid: &SeaGrid, sky: &SkyRows) -> Result<(), Unknown> {
        /// Fits counted in in one piece of work.
        const FITS_A_STEP: usize = 3;
        match &mut self.calibration {
            SlopeCalibration::Waits => {
                self.check(grid)?;
                let mut rows = sky.rows(1);
                rows.extend(self.water_rows(grid));
                self.calibration = SlopeCalibration::Searches(Search::new(rows, grid.eye_m));
            }
            SlopeCalibration::Searches(search) => {
                if !search.step() {
                    self.calibration = SlopeCalibration::Averages(search.likely(), Gains::default());
                }
            }
            SlopeCalibration::Averages(fits, gains) => {
                let rest = fits.split_off(fits.len().saturating_sub(FITS_A_STEP));
                rest.iter().for_each(|(fit, weight)| gains.add(fit, *weight));
                if fits.is_empty() {
                    let gains = std::mem::take(gains);
                    self.calibrate(grid, &gains)?;
                }
            }
        }
        Ok(())
    }

    /// Whether the water is bright and even enough.
    fn check(&self, grid: &SeaGrid) -> Result<(), Unknown> {
        /// Unevenness of the water's mean brightness beyond which it is not only water: even seas lie at 0.003 to 0.045, glitter at
        /// 0.09 to 0.25.
        const UNEVEN: f64 = 0.065;
        /// Mean luminance of water below which waves drown in the picture's codes.
        const DARK: f64 = 0.0012;
        let seen: Vec<f64> = self.means.iter().copied().filter(|m| m.is_finite()).collect();
        let luminance = seen.iter().sum::<f64>() / seen.len().max(1) as f64;
        if luminance < DARK {
            return Err(Unknown::Dark { luminance });
        }
        let misfit = unevenness(&grid.cells, &self.means).ok_or(Unknown::NoWater)?;
        if misfit > UNEVEN { Err(Unknown::Uneven { misfit }) } else { Ok(()) }
    }

    /// Turns contrast into slope.
    fn calibrate(&mut self, grid: &SeaGrid, gains: &Gains) -> Result<(), Unknown> {
        /// Relative spread of the likely calibrations beyond which a height would be a guess.
        const UNSURE: f64 = 0.45;
        /// Patches with less change of brightness with slope tell nothing, per radian.
        const LEAST_GAIN: f64 = 0.3;
        let sigma = gains.sigma();
        // No number where there was no fit at all.
        if sigma.is_nan() || sigma >= UNSURE {
            return Err(Unknown::Unsure { sigma });
        }
        self.found.gain_sigma = sigma;
        self.found.rough = gains.rough();
        let mut weights = vec![0.0; grid.cells.len()];
        for (i, cell) in grid.cells.iter().enumerate() {
            let gain = gains.at(cell.depression);
            if !self.means[i].is_finite() || !gain.is_finite() || gain.abs() < LEAST_GAIN {
                continue;
            }
            weights[i] = (gain.abs() / self.power[i].sqrt().max(1e-4)) as f32;
            let values = self.values.iter_mut().flatten();
            values.for_each(|values| values[i] /= gain as f32);
        }
        let count = weights.iter().filter(|w| **w > 0.0).count();
        let mean = weights.iter().sum::<f32>() / count.max(1) as f32;
        weights.iter_mut().for_each(|w| *w /= mean.max(1e-30));
        self.weights = weights;
        self.choose_near(grid, self.found.rough);
        Ok(())
    }

    /// Marks the patches from which heights are taken.
    fn choose_near(&mut self, grid: &SeaGrid, rough: f64) {
        /// Heights come from patches seen no flatter than this, radians, and than so many times the root mean square slope: farther out
        /// crests hide troughs.
        const NEAR: (f64, f64) = (0.08, 1.0);
        /// Patches that are near anyhow: the nearest.
        const NEAR_LEAST: usize = 20;
        let mut by_depression: Vec<usize> =
            (0..grid.cells.len()).filter(|&i| self.weights[i] > 0.0).collect();
        by_depression.sort_by(|&a, &b| grid.cells[b].depression.total_cmp(&grid.cells[a].depression));
        for (rank, i) in by_depression.into_iter().enumerate() {
            self.near[i] = rank < NEAR_LEAST || grid.cells[i].depression > NEAR.0.max(NEAR.1 * rough);
        }
    }

    /// Looks for waves at the next frequency, or takes the noise there.
    fn line(&mut self, grid: &SeaGrid) {
        let hz = self.bins[self.next_line] as f64 / (2.0 * self.found.seconds);
        let values = &self.values[self.next_line];
        let (weights, near) = (&self.weights, &self.near);
        let observed = shell::Observed { hz, cells: &grid.cells, weights, near, values };
        if hz < BAND_HZ.1 {
            self.found.lines.extend(shell::fit(&observed));
        } else {
            self.found.noise += shell::noise(&observed);
        }
        self.next_line += 1;
    }

    /// Mean brightness of the water in a dozen depressions.
    fn water_rows(&self, grid: &SeaGrid) -> Vec<RadianceRow> {
        let mut sums = [(0.0, 0.0, 0.0); 12];
        for (cell, mean) in grid.cells.iter().zip(&self.means).filter(|(_, m)| m.is_finite() && **m > 1e-6) {
            let bin = ((cell.depression / 0.045).ln() / 0.23).clamp(0.0, 11.0) as usize;
            let (depression, light, n) = &mut sums[bin];
            *depression += cell.depression.ln();
            *light += mean.ln();
            *n += 1.0;
        }
        let row = |(depression, light, n): &(f64, f64, f64)| RadianceRow {
            elevation: -f64::exp(depression / n),
            light: f64::exp(light / n),
            weight: 3.0,
        };
        sums.iter().filter(|s| s.2 > 1.0).map(row).collect()
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

/// Bins of the padded transform that are looked at: waves, then noise.
fn bins(seconds: f64) -> Vec<usize> {
    /// Lines lie at least this share of their frequency apart.
    const LINE_STEP: f64 = 0.03;
    let width = 1.0 / (2.0 * seconds);
    let mut bins = Vec::new();
    let mut hz = BAND_HZ.0.max(2.5 / seconds);
    while hz < BAND_HZ.1 {
        bins.push((hz / width).round() as usize);
        hz += width.max(LINE_STEP * hz);
    }
    bins.dedup();
    bins.retain(|&b| (b as f64) * width < BAND_HZ.1);
    bins.extend((0..NOISE_HZ.2).map(|i| ((NOISE_HZ.0 + NOISE_HZ.1 * i as f64) / width) as usize));
    bins
}
