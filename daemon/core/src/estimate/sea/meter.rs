//! Takes pictures in, keeps the record, and runs one analysis after the other in small pieces.

use super::{
    LEAST_S, Restart, SeaEstimate, SeaFrame, Unknown,
    analysis::{Analysis, FinishedAnalysis},
    grid::{SeaGrid, azimuth_of},
    record::{Record, SLOT_NS, WINDOW},
    sky::SkyRows,
    summary::summarise,
};
use crate::time::{NS_PER_S, Time};

/// Time between the starts of two analyses, samples.
const EVERY: usize = 20;
/// Sky rows are looked at every so many samples.
const SKY_EVERY: usize = 10;
/// Missing samples that end a watch: 5 s.
const GAP: i64 = 25;
/// Equal samples after which a picture stands still: 2 s.
const FROZEN: usize = 10;
/// Share of the patches ever seen at once that must be seen, and for how many samples it may be less.
const SEEN: (f64, usize) = (0.6, 25);
/// A camera turned farther than this from where the watch began, radians, shows the water through another part of its lens, whose
/// fall of brightness would look like long waves: its pictures count as missing.
const TURNED: f64 = 0.1;
/// Patches that must be seen at all.
const LEAST_SEEN: f64 = 30.0;
/// Relative change of the eye's height that ends a watch.
const HEIGHT_CHANGE: f64 = 0.05;
/// Heights of the eye that are possible, metres.
const EYE_M: std::ops::RangeInclusive<f64> = 0.5..=200.0;
/// Mean luminance below which the codes of a picture are too coarse to show waves.
const DARK: f32 = 0.0012;

/// One watch over the same water.
struct SeaWatch {
    grid: SeaGrid,
    start: Time,
    record: Record,
    row: Vec<f32>,
    before: Vec<f32>,
    equal: usize,
    unseen: usize,
    most_seen: f64,
    sky: SkyRows,
    analysed_at: usize,
    analysis: Option<Analysis>,
}

/// Watches the sea.
///
/// Call [`Self::observe`] with every picture; what it costs is spread over them. Memory is fixed once a watch has begun.
pub struct SeaMeter {
    watch: Option<SeaWatch>,
    newest: Option<Time>,
    after: Option<Restart>,
    outcome: Result<SeaEstimate, Unknown>,
}

impl Default for SeaMeter {
    fn default() -> Self {
        Self::new()
    }
}

impl SeaMeter {
    /// A meter that has seen nothing.
    pub fn new() -> Self {
        let outcome = Err(Unknown::TooShort { seconds: 0.0, after: None });
        Self { watch: None, newest: None, after: None, outcome }
    }

    /// The newest estimate, or why there is none.
    pub fn estimate(&self) -> Result<SeaEstimate, Unknown> {
        self.outcome
    }

    /// Whether the picture of that time will be looked at; the luminance of others need not be prepared.
    pub fn wants(&self, time: Time) -> bool {
        self.watch.as_ref().is_none_or(|w| w.slot(time) >= w.record.written as i64)
    }

    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> usize {
        let of = |w: &SeaWatch| w.record.bytes() + w.analysis.as_ref().map_or(0, Analysis::bytes);
        size_of::<Self>() + self.watch.as_ref().map_or(0, of)
    }

    /// Takes a picture in, and does a small piece of the analysis. Times must not run backwards; a picture older than the newest
    /// is passed over, unless time itself has jumped.
    pub fn observe(&mut self, frame: &SeaFrame<'_>) {
        let step_ns = self.newest.map_or(0, |newest| frame.time.ns_since(newest));
        if step_ns < 0 && step_ns > -GAP * SLOT_NS {
            return;
        }
        self.newest = Some(frame.time);
        if step_ns.abs() > GAP * SLOT_NS {
            self.restart(Restart::Gap);
        }
        if !usable(frame) {
            self.restart(Restart::Pose);
            self.outcome = Err(Unknown::BadPose { eye_m: frame.camera.position.z });
            return;
        }
        if self.watch.is_none() {
            match SeaWatch::begin(frame) {
                Ok(watch) => self.watch = Some(watch),
                Err(why) => {
                    self.outcome = Err(why);
                    return;
                }
            }
        }
        let Some(watch) = &mut self.watch else { return };
        match watch.take(frame) {
            Ok(()) => {}
            Err(Restart::Frozen) => {
                self.restart(Restart::Frozen);
                self.outcome =
                    Err(Unknown::Frozen { seconds: FROZEN as f64 * SLOT_NS as f64 / NS_PER_S as f64 });
                return;
            }
            Err(why) => {
                self.restart(why);
                return;
            }
        }
        if let Some(outcome) = watch.work() {
            self.outcome = outcome;
        } else if self.outcome.is_err() && watch.seconds() < LEAST_S {
            self.outcome = Err(Unknown::TooShort { seconds: watch.seconds(), after: self.after });
        }
    }

    /// Forgets what was seen.
    fn restart(&mut self, why: Restart) {
        if self.watch.take().is_some() {
            self.after = Some(why);
        }
        self.outcome = Err(Unknown::TooShort { seconds: 0.0, after: self.after });
    }
}

/// Angle between two azimuths, radians.
fn turn(a: f64, b: f64) -> f64 {
    (a - b).sin().atan2((a - b).cos()).abs()
}

fn usable(frame: &SeaFrame<'_>) -> bool {
    let (camera, lens) = (&frame.camera, frame.lens);
    let turned =
        camera.world_from_camera.is_finite() && (camera.world_from_camera.length() - 1.0).abs() < 1e-3;
    let glass = lens.focal.is_finite()
        && lens.focal.cmpgt(glam::DVec2::splat(1.0)).all()
        && lens.centre.is_finite()
        && lens.distortion.is_finite();
    turned && glass && camera.position.is_finite() && EYE_M.contains(&camera.position.z)
}

impl SeaWatch {
    fn begin(frame: &SeaFrame<'_>) -> Result<Self, Unknown> {
        let grid = SeaGrid::lay(&frame.camera, frame.lens)?;
        let cells = grid.cells.len();
        Ok(Self {
            grid,
            start: frame.time,
            record: Record::new(cells),
            row: vec![f32::NAN; cells],
            before: vec![f32::NAN; cells],
            equal: 0,
            unseen: 0,
            most_seen: 0.0,
            sky: SkyRows::default(),
            analysed_at: 0,
            analysis: None,
        })
    }

    fn slot(&self, time: Time) -> i64 {
        time.ns_since(self.start).div_euclid(SLOT_NS)
    }

    fn seconds(&self) -> f64 {
        self.record.written as f64 * SLOT_NS as f64 / NS_PER_S as f64
    }

    /// Keeps the picture's samples if they are due; says why the watch ends if it does.
    fn take(&mut self, frame: &SeaFrame<'_>) -> Result<(), Restart> {
        let (slot, due) = (self.slot(frame.time), self.record.written as i64);
        if slot < due {
            return Ok(());
        }
        if slot - due > GAP {
            return Err(Restart::Gap);
        }
        if (frame.camera.position.z / self.grid.eye_m - 1.0).abs() > HEIGHT_CHANGE {
            return Err(Restart::Height);
        }
        (due..slot).for_each(|_| self.record.push_missing());
        if azimuth_of(&frame.camera).is_none_or(|a| turn(a, self.grid.azimuth) > TURNED) {
            self.unseen += 1;
            self.record.push_missing();
            return if self.unseen > SEEN.1 { Err(Restart::Turned) } else { Ok(()) };
        }
        if self.record.written.is_multiple_of(SKY_EVERY) {
            self.sky.observe(&frame.camera, frame.lens, self.grid.azimuth, false, &|p| {
                (frame.luminance)(p).map(|l| [l; 3])
            });
        }
        let seen = self.grid.sample(frame, &mut self.row);
        self.most_seen = self.most_seen.max(seen);
        let few = seen < SEEN.0 * self.most_seen || seen * (self.row.len() as f64) < LEAST_SEEN;
        self.unseen = if few { self.unseen + 1 } else { 0 };
        if self.unseen > SEEN.1 {
            return Err(Restart::Turned);
        }
        let dark = self.row.iter().all(|v| !v.is_finite() || *v < DARK);
        let same = self.row.iter().zip(&self.before).all(|(a, b)| a.to_bits() == b.to_bits());
        self.equal = if same && !dark && seen > 0.0 { self.equal + 1 } else { 0 };
        if self.equal >= FROZEN {
            return Err(Restart::Frozen);
        }
        self.before.copy_from_slice(&self.row);
        self.record.push(&self.row);
        Ok(())
    }

    /// Does one piece of the analysis; its outcome once it is done.
    fn work(&mut self) -> Option<Result<SeaEstimate, Unknown>> {
        if let Some(analysis) = &mut self.analysis {
            // Too few pictures to keep up with the record: begin again.
            if !self.record.keeps(analysis.start()) {
                self.analysis = None;
                return None;
            }
            let FinishedAnalysis { found, end } = analysis.step(&self.grid, &self.record, &self.sky)?;
            self.analysis = None;
            let time = self.start.plus_ns(end as i64 * SLOT_NS);
            return Some(found.and_then(|found| summarise(&found, self.grid.eye_m, time)));
        }
        let written = self.record.written;
        if self.seconds() >= LEAST_S && written >= self.analysed_at + EVERY {
            self.analysed_at = written;
            self.analysis = Some(Analysis::new(&self.grid, &self.record, written.min(WINDOW)));
        }
        None
    }
}
