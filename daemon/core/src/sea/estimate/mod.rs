//! The sea's state from the live picture.
//!
//! Patches of water are followed on the plane z = 0 for a minute or two, Fourier transformed in time, and searched in space for
//! waves that keep the dispersion relation. The picture's own fall of brightness towards the eye calibrates brightness to slope
//! ([`profile`]), slope and wavelength give height, and the eye's height fixes all lengths.

mod analysis;
mod grid;
mod profile;
mod record;
mod shell;
mod sky;

use glam::DVec2;

use self::{
    analysis::{Analysis, Found},
    grid::Grid,
    record::{Record, SLOT_NS, WINDOW},
};
use crate::{
    geometry::{CameraPose, Lens},
    time::Time,
};

/// Seconds of picture before the first estimate.
const LEAST_S: f64 = 40.0;

/// One picture as the estimator sees it.
pub struct Frame<'a> {
    /// Mid-exposure.
    pub time: Time,
    /// The camera; its z is the height of the eye above the mean sea.
    pub camera: CameraPose,
    /// The picture's lens.
    pub lens: &'a Lens,
    /// Linear luminance at a pixel in any unit; `None` where something else than real water or sky covers it.
    pub luminance: &'a dyn Fn(DVec2) -> Option<f32>,
}

/// Why there is no estimate.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Unknown {
    /// Not long enough yet.
    #[error("the sea has been watched for {seconds:.0} s; an estimate needs {LEAST_S:.0} s")]
    TooShort {
        /// Seconds watched.
        seconds: f64,
    },
    /// The camera does not see enough water.
    #[error("the camera does not see enough water under the horizon")]
    NoWater,
}

/// Watches the sea.
pub struct SeaMeter {
    grid: Option<Grid>,
    record: Record,
    row: Vec<f32>,
    start: Option<Time>,
    analysis: Option<Analysis>,
    analysed_at: usize,
    found: Option<Found>,
    sky: sky::SkyRows,
    /// Sky gradient per radian.
    pub sky_share: f64,
}

impl Default for SeaMeter {
    fn default() -> Self {
        Self::new()
    }
}

impl SeaMeter {
    /// A meter that has seen nothing.
    pub fn new() -> Self {
        Self {
            grid: None,
            record: Record::new(0),
            row: Vec::new(),
            start: None,
            analysis: None,
            analysed_at: 0,
            found: None,
            sky: sky::SkyRows::default(),
            sky_share: 0.0,
        }
    }

    fn slot(&self, time: Time) -> i64 {
        self.start.map_or(0, |s| time.ns_since(s) / SLOT_NS)
    }

    /// Whether the picture of that time will be looked at; others need not be prepared.
    pub fn wants(&self, time: Time) -> bool {
        self.slot(time) >= self.record.written as i64
    }

    /// Takes a picture in, and does a small piece of the analysis.
    pub fn observe(&mut self, frame: &Frame<'_>) {
        if self.grid.is_none() {
            let Ok(grid) = Grid::lay(&frame.camera, frame.lens) else { return };
            self.record = Record::new(grid.cells.len());
            self.row = vec![f32::NAN; grid.cells.len()];
            self.grid = Some(grid);
            self.start = Some(frame.time);
        }
        if self.wants(frame.time) {
            let slot = self.slot(frame.time);
            while (self.record.written as i64) < slot {
                self.record.push_missing();
            }
            if let Some(grid) = &self.grid {
                if slot % 10 == 0 {
                    self.sky.observe(frame, grid.azimuth);
                }
                grid.sample(frame, &mut self.row);
                self.record.push(&self.row);
            }
        }
        self.step();
    }

    fn step(&mut self) {
        let Some(grid) = &self.grid else { return };
        if let Some(analysis) = &mut self.analysis {
            if let Some(found) = analysis.step(grid, &self.record, self.sky_share * self.sky.gradient().unwrap_or(0.0)) {
                self.found = Some(found);
                self.analysis = None;
            }
        } else if self.record.written >= (LEAST_S * 5.0) as usize && self.record.written >= self.analysed_at + 50 {
            self.analysed_at = self.record.written;
            self.analysis = Some(Analysis::new(grid, &self.record, self.record.written.min(WINDOW)));
        }
    }

    /// Research.
    pub fn lines(&self) -> Vec<[f64; 7]> {
        self.found.iter().flat_map(|f| f.lines.iter().map(|l| [l.hz, l.density, l.towards, l.spread, l.share, l.leverage, l.freedom])).collect()
    }

    /// Research.
    pub fn debug(&self) -> String {
        let mut out = String::new();
        if let Some(f) = &self.found {
            out += &format!("sky {:.2?} T {:.0} gain {:.2} misfit {:.3} contrast {:.3} cells {}\n", self.sky.gradient(), f.seconds, f.gain, f.misfit, f.contrast, self.row.len());
            for l in &f.lines {
                out += &format!("  {:.3} Hz  E {:.5}  dir-to {:4.0}  s {:3.0} share {:.2} lev {:.2}\n", l.hz, l.density, l.towards.to_degrees(), l.spread, l.share, l.leverage);
            }
        }
        out
    }
}
