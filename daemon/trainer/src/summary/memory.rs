//! Resident memory over a run: a leak shows as growth from the first tenth to the last.

use serde::Serialize;

use super::resident::memory_mb;

/// How often it is looked at, frames: twice a minute of the recording.
const EVERY: u64 = 900;

/// Megabytes of resident memory, by look.
#[derive(Clone, Debug, Default)]
pub struct MemoryWatch {
    mb: Vec<f32>,
}

/// Growth of memory.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// Median of the second tenth of the run, megabytes: the first warms up.
    pub early_mb: f64,
    /// Median of the last tenth, megabytes.
    pub late_mb: f64,
}

impl MemoryWatch {
    /// Looks, where it is time.
    pub fn frame(&mut self, frame: u64) {
        if frame.is_multiple_of(EVERY)
            && let Some(mb) = memory_mb("VmRSS:")
        {
            self.mb.push(mb as f32);
        }
    }

    /// Growth over the run; `None` for runs of less than five minutes.
    pub fn growth(&self) -> Option<Growth> {
        let tenth = self.mb.len() / 10;
        let early = median(self.mb.get(tenth..2 * tenth)?)?;
        let late = median(self.mb.get(self.mb.len() - tenth..)?)?;
        Some(Growth { early_mb: early, late_mb: late })
    }
}

fn median(values: &[f32]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted.get(sorted.len() / 2).map(|v| f64::from((v * 10.0).round()) / 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_is_from_the_second_tenth_to_the_last() {
        assert_eq!(MemoryWatch::default().growth(), None);
        let mb = (0..100).map(|i| if i < 10 { 50.0 } else { 70.0 + i as f32 * 0.1 }).collect();
        assert_eq!(MemoryWatch { mb }.growth(), Some(Growth { early_mb: 71.5, late_mb: 79.5 }));
    }
}
