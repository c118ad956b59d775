//! What a run reports about itself when it ends, `summary.json` in the data folder.

use std::{collections::BTreeMap, path::Path};

use anyhow::{Context, Result};
use bowwave_core::{
    frame::scene::{Pass, Scene},
    pacing::FrameClock,
    session::Session,
    time::Time,
    world::score::{Outcome, ShotRecord},
};
use serde::Serialize;

use super::{faults::Faults, hardware::Hardware, stage::Stage};
use crate::{
    headings::HeadingSummary,
    output::Done,
    sea::SeaSummary,
    stats::{Percentiles, Samples},
    unit_clock::ClockSummary,
};

/// What the loop counts.
#[derive(Debug, Default)]
pub struct Tally {
    /// Frames handed to the GPU.
    pub frames: u64,
    blind: u64,
    completed: u64,
    passes: [u64; Pass::COUNT],
    frame_ms: Samples,
    begun_apart_ms: Samples,
    last_begun: Option<Time>,
    rounds: [u64; 3],
}

impl Tally {
    /// A frame was handed over.
    pub fn frame(&mut self, scene: &Scene, blind: bool, begun: Time) {
        self.frames += 1;
        self.blind += u64::from(blind);
        for (count, pass) in self.passes.iter_mut().zip(Pass::ALL) {
            *count += u64::from(scene.runs(pass));
        }
        if let Some(last) = self.last_begun.replace(begun) {
            self.begun_apart_ms.push(begun.secs_since(last) * 1e3);
        }
    }

    /// A frame is complete.
    pub fn done(&mut self, done: Done) {
        self.completed += 1;
        self.frame_ms.push(done.complete.secs_since(done.begun) * 1e3);
    }

    /// Rounds ended.
    pub fn records(&mut self, records: &[ShotRecord]) {
        for record in records {
            self.rounds[0] += 1;
            self.rounds[1] += u64::from(matches!(record.outcome, Outcome::Hit { .. }));
            self.rounds[2] += u64::from(matches!(record.outcome, Outcome::NotScored { .. }));
        }
    }

    /// Whether a frame has been completed.
    pub const fn shown(&self) -> bool {
        self.completed > 0
    }

    /// Everything together.
    pub fn summary(
        &self,
        session: &Session,
        stage: &Stage,
        hardware: &Hardware,
        faults: &Faults,
        clock: &FrameClock,
    ) -> Summary {
        let size = session.plan().size;
        let sensors = session.sensor_counts();
        let mut counts: BTreeMap<String, u64> =
            hardware.counters().into_iter().map(|(name, n)| (name.to_owned(), n)).collect();
        for (name, n) in [
            ("imu_insane", sensors.imu_insane),
            ("imu_frozen", sensors.imu_frozen),
            ("imu_restarts", u64::from(sensors.imu_restarts)),
            ("horizons_taken", sensors.horizons.taken),
            ("horizons_refused", sensors.horizons.refused),
            ("horizons_none", sensors.horizons.none),
            ("skyline_taken", sensors.skyline.taken),
            ("skyline_refused", sensors.skyline.refused),
            ("skyline_none", sensors.skyline.none),
            ("skyline_anchors", sensors.skyline.anchors),
            ("pictures_backward", sensors.frames_backward),
            ("pictures_wrong_size", sensors.frames_wrong_size),
            ("frames_blind", self.blind),
            ("ticks_missed", clock.missed()),
            ("ticks_slipped", clock.slips()),
        ] {
            counts.insert(name.to_owned(), n);
        }
        let passes = Pass::ALL.iter().zip(self.passes).map(|(p, n)| (p.name().to_owned(), n));
        Summary {
            frames: self.frames,
            size: format!("{}x{}", size.0, size.1),
            device: stage.device(),
            frame_ms: self.frame_ms.percentiles(),
            begun_apart_ms: self.begun_apart_ms.percentiles(),
            passes: passes.collect(),
            shots: self.rounds[0],
            hits: self.rounds[1],
            not_scored: self.rounds[2],
            video: format!("{:?}, {}", session.plan().video, stage.picture_path()),
            faults: faults.counts().map(|(code, n)| (code.to_owned(), n)).collect(),
            counts,
            sea: session.sea().map(SeaSummary::from),
            heading: HeadingSummary::of(session),
            unit_clock: session.unit_clock().map(ClockSummary::from),
        }
    }
}

/// The summary of a run. Times are milliseconds.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Frames drawn.
    pub frames: u64,
    /// Screen size, as WIDTHxHEIGHT.
    pub size: String,
    /// Vulkan device and driver.
    pub device: String,
    /// From a frame's begin until its pixels were complete.
    pub frame_ms: Option<Percentiles>,
    /// From begin to begin.
    pub begun_apart_ms: Option<Percentiles>,
    /// Frames that ran each pass.
    pub passes: BTreeMap<String, u64>,
    /// Virtual rounds fired.
    pub shots: u64,
    /// Virtual rounds that struck a boat.
    pub hits: u64,
    /// Virtual rounds that could not be scored.
    pub not_scored: u64,
    /// Layout of the camera's pictures and how they reached the GPU.
    pub video: String,
    /// How often each fault came, by its code.
    pub faults: BTreeMap<String, u64>,
    /// What devices and session counted.
    pub counts: BTreeMap<String, u64>,
    /// The sea in the video; null where the scenario gives the sea.
    pub sea: Option<SeaSummary>,
    /// How well the heading was known at the end, and what told it; null where it never was.
    pub heading: Option<HeadingSummary>,
    /// How the inertial unit's clock did; null where that could not be told.
    pub unit_clock: Option<ClockSummary>,
}

impl Summary {
    /// Writes it as JSON.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self).context("cannot put the summary into JSON")?;
        std::fs::write(path, text + "\n")
            .with_context(|| format!("cannot write {}; check the disk", path.display()))
    }
}
