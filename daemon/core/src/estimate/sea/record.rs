//! The last minutes of every patch's brightness, on an even grid of time.

/// Time between two kept samples, nanoseconds: 5 Hz, twice the frequency of waves of 0.25 m.
pub(super) const SLOT_NS: i64 = 200_000_000;
/// Longest window that is analysed, samples: 128 s.
pub(super) const WINDOW: usize = 640;
/// Samples kept beyond the window, so that an analysis in progress is not overwritten.
const SLACK: usize = 96;

/// Contrasts beyond this many standard deviations are cut to it.
const OUTLIER: f32 = 4.0;

/// Samples by slot, in a ring.
#[derive(Clone, Debug)]
pub(super) struct Record {
    cells: usize,
    values: Vec<f32>,
    /// Slots written since the start.
    pub written: usize,
}

impl Record {
    pub fn new(cells: usize) -> Self {
        Self { cells, values: vec![f32::NAN; cells * (WINDOW + SLACK)], written: 0 }
    }

    pub fn bytes(&self) -> usize {
        self.values.capacity() * size_of::<f32>()
    }

    fn place(&self, slot: usize) -> usize {
        slot % (WINDOW + SLACK) * self.cells
    }

    /// Appends the samples of one slot.
    pub fn push(&mut self, row: &[f32]) {
        let at = self.place(self.written);
        self.values[at..at + self.cells].copy_from_slice(row);
        self.written += 1;
    }

    /// Appends a slot without samples.
    pub fn push_missing(&mut self) {
        let at = self.place(self.written);
        self.values[at..at + self.cells].fill(f32::NAN);
        self.written += 1;
    }

    pub fn get(&self, slot: usize, cell: usize) -> f32 {
        self.values[self.place(slot) + cell]
    }

    /// Whether the slots from `start` on are still kept.
    pub fn keeps(&self, start: usize) -> bool {
        self.written.saturating_sub(start) <= WINDOW + SLACK
    }

    /// Fills `series` with the contrast of one patch over the slots from `start`: brightness over its mean, less one, without
    /// its linear trend; zero where it was not seen. Answers the mean and the share of slots seen.
    pub fn contrast(&self, start: usize, cell: usize, series: &mut [f32]) -> (f64, f64) {
        let n = series.len();
        let (mut sum, mut count, mut t1, mut t2, mut ty) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (i, out) in series.iter_mut().enumerate() {
            *out = self.get(start + i, cell);
            if out.is_finite() {
                let (t, v) = (i as f64, f64::from(*out));
                sum += v;
                count += 1.0;
                t1 += t;
                t2 += t * t;
                ty += t * v;
            }
        }
        let seen = count / (n.max(1) as f64);
        let (mean, middle) = (sum / count, t1 / count);
        let trend = (ty - sum * middle) / (t2 - t1 * middle);
        if !(mean > 0.0 && trend.is_finite()) {
            series.fill(0.0);
            return (f64::NAN, 0.0);
        }
        let mut square = 0.0;
        for (i, out) in series.iter_mut().enumerate() {
            let level = mean + trend * (i as f64 - middle);
            *out = if out.is_finite() { ((f64::from(*out) - level) / mean) as f32 } else { 0.0 };
            square += out.powi(2);
        }
        // A bird, a splash or one false pose must not ring through the spectrum.
        let bound = OUTLIER * (square / f32::max(count as f32, 1.0)).sqrt();
        series.iter_mut().for_each(|v| *v = v.clamp(-bound, bound));
        (mean, seen)
    }
}
