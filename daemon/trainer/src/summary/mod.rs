//! What a run reports about itself when it ends.

pub mod clock;
pub mod heading;
pub mod memory;
pub mod recovery;
pub mod resident;
pub mod sea;
pub mod stats;
pub mod sun;
mod tally;

use std::{collections::BTreeMap, path::Path};

use anyhow::{Context, Result};
use bowwave_core::frame::scene::{LeftOut, Pass, PassDecision, Scene};
use serde::Serialize;

pub use tally::{SummaryOptions, Tally};

use self::{
    clock::ClockSummary,
    heading::HeadingSummary,
    memory::Growth,
    sea::SeaSummary,
    stats::{Percentiles, Samples},
    sun::SunSummary,
};

/// The summary of a run, `summary.json`. Times are milliseconds.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Frames shown.
    pub frames: u64,
    /// Frames that were not complete when they were due, or never drawn; null where nothing is due (--fast).
    pub missed_deadlines: Option<u64>,
    /// Screen size, as WIDTHxHEIGHT.
    pub size: String,
    /// Vulkan device and driver.
    pub device: String,
    /// From when a frame was begun until its pixels were complete. With --fast frames overlap, so that it is no time that a frame costs.
    pub frame_ms: Option<Percentiles>,
    /// From begin to begin.
    pub begun_apart_ms: Option<Percentiles>,
    /// A frame's time by stage.
    pub stage_ms: BTreeMap<String, Percentiles>,
    /// From the start of the program to the first complete frame.
    pub first_frame_ms: Option<f64>,
    /// Frames that ran each pass.
    pub passes: BTreeMap<String, u64>,
    /// For each pass and reason, the frames that left it out.
    pub left_out: BTreeMap<String, u64>,
    /// Virtual rounds fired.
    pub shots: u64,
    /// Virtual rounds that struck a hostile boat.
    pub hits: u64,
    /// Virtual rounds that struck a neutral boat.
    pub neutral_hits: u64,
    /// Virtual rounds that could not be scored.
    pub not_scored: u64,
    /// How far from the recording's truth far things were drawn; null without truth.
    pub registration_px: Option<Registration>,
    /// Hash over the records of all rounds. `bowwave replay` finds the same one from the run's recording.
    pub records_digest: String,
    /// Hash over all scenes.
    pub scenes_digest: String,
    /// SHA-256 over the SHA-256 of every frame's pixels, in order; null where it was not asked for.
    pub frames_sha256: Option<String>,
    /// Largest resident memory, megabytes.
    pub peak_rss_mb: Option<f64>,
    /// Resident memory early and late in the run; null for short runs.
    pub memory: Option<Growth>,
    /// Seed of all chance.
    pub seed: u64,
    /// The recording played; null on devices.
    pub recording: Option<String>,
    /// The scenario's name.
    pub scenario: String,
    /// Layout of the camera's pictures and how they reached the GPU.
    pub video: String,
    /// Frames of video.mp4 with the times that they show, nanoseconds on the session's clock: the first, and each from which thirty a second no
    /// longer hold. Null without a video.
    pub video_frames: Option<Vec<(u64, i64)>>,
    /// How often each fault came, by its code.
    pub faults: BTreeMap<String, u64>,
    /// What source and session counted: dropped, late, broken.
    pub counts: BTreeMap<String, u64>,
    /// The sea in the video; null where the scenario gives the sea.
    pub sea: Option<SeaSummary>,
    /// How well the heading was known at the end, and what told it; null where it never was.
    pub heading: Option<HeadingSummary>,
    /// Where the sun stood at the end, and what told it.
    pub sun: SunSummary,
    /// How the inertial unit's clock did; null where that could not be told.
    pub unit_clock: Option<ClockSummary>,
}

/// Distances on the screen between where things belong and where they were drawn, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Registration {
    /// Root mean square.
    pub rms: f64,
    /// 99th percentile of frames.
    pub p99: f64,
    /// Worst frame.
    pub max: f64,
    /// Frames compared.
    pub frames: u64,
}

impl Registration {
    /// From the per-frame errors; `None` where none was measured.
    pub fn of(errors: &Samples, frames: u64) -> Option<Self> {
        let p = errors.percentiles()?;
        Some(Self { rms: errors.rms()?, p99: p.p99, max: p.max, frames })
    }
}

/// Counts which passes ran, and why the others did not.
#[derive(Clone, Debug, Default)]
pub struct PassCounts {
    ran: [u64; Pass::COUNT],
    left_out: BTreeMap<(Pass, LeftOut), u64>,
}

impl PassCounts {
    /// Takes in a frame.
    pub fn count(&mut self, scene: &Scene) {
        for pass in Pass::ALL {
            match scene.passes[pass as usize] {
                PassDecision::Run => self.ran[pass as usize] += 1,
                PassDecision::LeftOut(why) => *self.left_out.entry((pass, why)).or_default() += 1,
            }
        }
    }

    /// Frames by pass.
    pub fn passes(&self) -> BTreeMap<String, u64> {
        Pass::ALL.into_iter().map(|p| (p.name().to_owned(), self.ran[p as usize])).collect()
    }

    /// Frames by pass and reason.
    pub fn left_out(&self) -> BTreeMap<String, u64> {
        self.left_out.iter().map(|((p, why), n)| (format!("{}: {}", p.name(), why.name()), *n)).collect()
    }
}

impl Summary {
    /// Writes `summary.json`: a new file that takes the place of a former one, so that nobody reads half of it.
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut text = serde_json::to_string_pretty(self).context("cannot put the summary into JSON")?;
        text.push('\n');
        let new = path.with_extension("json.new");
        std::fs::write(&new, text)
            .and_then(|()| std::fs::rename(&new, path))
            .with_context(|| format!("cannot write {}; check the disk", path.display()))
    }

    /// The few lines that a person reads.
    pub fn lines(&self) -> String {
        let ms = |p: Option<Percentiles>| {
            p.map_or("-".into(), |p| {
                format!("p50 {:.1}, p95 {:.1}, p99 {:.1}, max {:.1} ms", p.p50, p.p95, p.p99, p.max)
            })
        };
        let frame = if self.missed_deadlines.is_some() { "frame time" } else { "frame latency" };
        let missed = self
            .missed_deadlines
            .map_or("no deadlines in --fast".into(), |n| format!("{n} missed deadlines"));
        let registration = self.registration_px.map_or("no truth in this recording".into(), |r| {
            format!("rms {:.2}, p99 {:.2}, max {:.2} px", r.rms, r.p99, r.max)
        });
        let clock = self.unit_clock.map_or("too short to tell".into(), |c| {
            format!(
                "{:+.1} ppm (sigma {:.1}), jitter {:.3} ms, {:.3} at most",
                c.drift_ppm, c.drift_sigma_ppm, c.jitter_ms, c.jitter_max_ms
            )
        });
        let neutral = match self.neutral_hits {
            0 => String::new(),
            hits => format!(", {hits} HIT A NEUTRAL"),
        };
        let heading =
            self.heading.map_or("not known".into(), |h| format!("±{:.2} deg (1 sigma)", h.sigma_deg));
        format!(
            "{} frames of {} on {}; {missed}\n{frame:15}{}\nregistration   {registration}\nheading        {heading}\nunit's clock   {clock}\nrounds         {} fired, {} hit{neutral}, {} not scored\n",
            self.frames,
            self.size,
            self.device,
            ms(self.frame_ms),
            self.shots,
            self.hits,
            self.not_scored,
        )
    }
}
