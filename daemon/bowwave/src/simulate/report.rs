//! From a finished run to its summary and exit code.

use std::collections::BTreeMap;

use anyhow::Result;
use bowwave_core::{frame::scene::Pass, time::Time};
use sha2::Digest;

use super::{
    prepare::Prepared,
    run::Finished,
    summary::{Registration, Summary},
};
use crate::{
    cli::Simulate, outcome::Outcome, resident::memory_mb, sea::SeaSummary, stats::Percentiles, stdout,
    unit_clock::ClockSummary,
};

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

impl Finished {
    /// Writes the summary, tells the user, and says how the run ended.
    pub fn report(self, arguments: &Simulate, prepared: &Prepared, program_start: Time) -> Result<Outcome> {
        let faults = self.faults.clone();
        let summary = self.summary(prepared, program_start);
        summary.write(&arguments.out.join("summary.json"))?;
        if arguments.json {
            stdout::print_json(&summary)?;
        }
        eprint!("{}", summary.lines());
        for fault in &faults {
            log::error!("{fault}");
        }
        Ok(if faults.is_empty() { Outcome::Done } else { Outcome::Partly })
    }

    fn summary(self, prepared: &Prepared, program_start: Time) -> Summary {
        let stage_ms = self.stages();
        let counts = self.counts();
        let tally = self.tally;
        let scenario = &prepared.setup.scenario;
        let (width, height) = prepared.setup.screen;
        Summary {
            frames: self.output.frames,
            missed_deadlines: self.realtime.then_some(self.output.late + tally.skipped),
            size: format!("{width}x{height}"),
            device: self.device,
            frame_ms: self.output.frame_ms.percentiles(),
            stage_ms,
            first_frame_ms: self.output.first.map(|t| (t.secs_since(program_start) * 1e4).round() / 10.0),
            passes: tally.passes.passes(),
            left_out: tally.passes.left_out(),
            shots: tally.rounds[0],
            hits: tally.rounds[1],
            not_scored: tally.rounds[2],
            registration_px: Registration::of(&tally.registration, tally.registered),
            records_sha256: hex(&tally.hash.finalize()),
            frames_sha256: hex(&self.output.frames_sha256),
            peak_rss_mb: memory_mb("VmHWM:"),
            memory: self.memory.growth(),
            seed: scenario.seed,
            recording: prepared.recording.display().to_string(),
            scenario: scenario.name.clone(),
            video: format!("{:?}, copied once into memory that the GPU reads", prepared.setup.video),
            counts,
            sea: self.sea.map(SeaSummary::from),
            heading: self.heading,
            unit_clock: self.unit_clock.map(ClockSummary::from),
        }
    }

    fn stages(&self) -> BTreeMap<String, Percentiles> {
        let mut stages = BTreeMap::new();
        let mut add = |name: &str, p: Option<Percentiles>| {
            if let Some(p) = p {
                stages.insert(name.to_owned(), p);
            }
        };
        add("events", self.tally.events_ms.percentiles());
        add("step", self.tally.step_ms.percentiles());
        add("submit", self.tally.submit_ms.percentiles());
        add("gpu", self.output.gpu_ms.percentiles());
        for pass in Pass::ALL {
            add(&format!("gpu_{}", pass.name()), self.output.passes_ms[pass as usize].percentiles());
        }
        stages
    }

    fn counts(&self) -> BTreeMap<String, u64> {
        let (s, r) = (&self.sensors, &self.replay);
        [
            ("imu_samples", s.imu),
            ("imu_insane", s.imu_insane + r.imu.imu.not_finite),
            ("imu_frozen", s.imu_frozen),
            ("imu_restarts", u64::from(s.imu_restarts)),
            ("horizons_taken", s.horizons.taken),
            ("horizons_refused", s.horizons.refused),
            ("horizons_none", s.horizons.none),
            ("skyline_taken", s.skyline.taken),
            ("skyline_refused", s.skyline.refused),
            ("skyline_none", s.skyline.none),
            ("skyline_anchors", s.skyline.anchors),
            ("imu_bad_checksums", r.imu.imu.bad_crc),
            ("imu_skipped_bytes", r.imu.imu.skipped_bytes),
            ("imu_overwritten", r.imu.overflow),
            ("pictures", s.frames),
            ("pictures_backward", s.frames_backward),
            ("pictures_wrong_size", s.frames_wrong_size + r.frames.other_size),
            ("pictures_undecodable", r.frames.undecodable),
            ("pictures_overwritten", r.frames_overwritten),
            ("pictures_late", r.frames_late),
            ("faults_injected", r.faults),
            ("faults_judged", self.recovery.judged),
            ("faults_recovered", self.recovery.recovered),
            ("faults_to_be_seen", self.recovery.to_be_seen),
            ("faults_seen", self.recovery.seen),
            ("trigger_edges", r.triggers),
            ("ring_waits", self.tally.ring_waits),
            ("recording_entries_dropped", self.dropped_entries),
        ]
        .into_iter()
        .map(|(name, n)| (name.to_owned(), n))
        .collect()
    }
}
