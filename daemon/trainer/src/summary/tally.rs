//! What the loop counts, and its summary.

use std::collections::BTreeMap;

use bowwave_core::{
    estimate::pose::registration_error_px,
    frame::scene::Pass,
    geometry::CameraPose,
    session::{Session, View},
    time::Time,
    world::{
        scenario::Side,
        score::{Outcome, ShotRecord},
    },
};
use hw_sim::fault::Fault as InjectedFault;

use super::{
    PassCounts, Registration, Summary,
    clock::ClockSummary,
    heading::HeadingSummary,
    memory::MemoryWatch,
    recovery::Recovery,
    resident::memory_mb,
    sea::SeaSummary,
    stats::{Percentiles, Samples},
};
use crate::{
    clock::{DueFrame, TickClock},
    presenter::{OutputReport, VideoTimes},
};

/// What a summary says besides what was measured.
#[derive(Clone, Debug, Default)]
pub struct SummaryOptions {
    /// When the program began.
    pub program_start: Time,
    /// The recording played.
    pub recording: Option<String>,
    /// When the recording begins, and the faults that are injected into it.
    pub injected: Option<(Time, Vec<InjectedFault>)>,
}

/// What the loop counts.
#[derive(Debug)]
pub struct Tally {
    frames: u64,
    blind: u64,
    completed: u64,
    passes: PassCounts,
    registration: Samples,
    registered: u64,
    begun_apart_ms: Samples,
    last_begun: Option<Time>,
    events_ms: Samples,
    step_ms: Samples,
    submit_ms: Samples,
    ring_waits: u64,
    /// Fired, struck, not scored.
    /// Fired, struck a hostile boat, not scored, struck a neutral one.
    rounds: [u64; 4],
    recovery: Option<Recovery>,
    memory: MemoryWatch,
}

fn ms_between(from: Time, to: Time) -> f64 {
    to.secs_since(from) * 1e3
}

impl Tally {
    /// Nothing has happened.
    pub fn new(options: &SummaryOptions) -> Self {
        Self {
            frames: 0,
            blind: 0,
            completed: 0,
            passes: PassCounts::default(),
            registration: Samples::default(),
            registered: 0,
            begun_apart_ms: Samples::default(),
            last_begun: None,
            events_ms: Samples::default(),
            step_ms: Samples::default(),
            submit_ms: Samples::default(),
            ring_waits: 0,
            rounds: [0; 4],
            recovery: options.injected.clone().map(|(origin, faults)| Recovery::new(origin, faults)),
            memory: MemoryWatch::default(),
        }
    }

    /// Frames handed to the GPU.
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// A frame is handed over.
    pub fn frame(&mut self, view: &View<'_>, due: DueFrame, truth: Option<CameraPose>) {
        let scene = view.scene;
        self.frames += 1;
        self.blind += u64::from(view.blind);
        self.passes.count(scene);
        self.memory.frame(scene.frame);
        if let Some(recovery) = &mut self.recovery {
            recovery.frame(due.tick.time, &scene.hud.status);
        }
        if let Some(last) = self.last_begun.replace(due.begun) {
            self.begun_apart_ms.push(ms_between(last, due.begun));
        }
        if let Some(truth) = truth.filter(|_| view.pose_known) {
            let error =
                registration_error_px(&scene.lens, truth.world_from_camera, scene.camera.world_from_camera);
            // Poses too far apart to compare are as bad as the screen is wide.
            self.registration.push(error.unwrap_or(f64::from(scene.lens.width)));
            self.registered += 1;
        }
    }

    /// How long a frame's stages took: when it was begun, its events were fetched, the session was stepped, and it was submitted.
    pub fn times(&mut self, waited: bool, [begun, collected, stepped, submitted]: [Time; 4]) {
        self.ring_waits += u64::from(waited);
        self.events_ms.push(ms_between(begun, collected));
        self.step_ms.push(ms_between(collected, stepped));
        self.submit_ms.push(ms_between(stepped, submitted));
    }

    /// A frame is complete.
    pub const fn completed(&mut self) {
        self.completed += 1;
    }

    /// Whether a frame has been completed.
    pub const fn shown(&self) -> bool {
        self.completed > 0
    }

    /// Rounds ended.
    pub fn records(&mut self, records: &[ShotRecord]) {
        for record in records {
            self.rounds[0] += 1;
            let neutral = matches!(record.outcome, Outcome::Hit { side: Some(Side::Neutral), .. });
            self.rounds[1] += u64::from(!neutral && matches!(record.outcome, Outcome::Hit { .. }));
            self.rounds[3] += u64::from(neutral);
            self.rounds[2] += u64::from(matches!(record.outcome, Outcome::NotScored { .. }));
        }
    }

    /// Everything together.
    #[allow(clippy::too_many_arguments, reason = "the ends of a run, once")]
    pub fn summary(
        &self,
        session: &Session,
        output: OutputReport,
        clock: &TickClock,
        (device, video): (&str, &str),
        faults: impl Iterator<Item = (&'static str, u64)>,
        counters: Vec<(&'static str, u64)>,
        options: &SummaryOptions,
    ) -> Summary {
        let (plan, digest) = (session.plan(), session.digest());
        let [shots, hits, not_scored, neutral_hits] = self.rounds;
        let first_frame = output.first.map(|t| ms_between(options.program_start, t));
        Summary {
            frames: output.frames,
            missed_deadlines: clock.is_paced().then_some(output.late + clock.missed_and_slips().0),
            size: format!("{}x{}", plan.size.0, plan.size.1),
            device: device.to_owned(),
            frame_ms: output.frame_ms.percentiles(),
            begun_apart_ms: self.begun_apart_ms.percentiles().filter(|_| clock.is_paced()),
            stage_ms: self.stages(&output),
            first_frame_ms: first_frame.map(|ms| (ms * 10.0).round() / 10.0),
            passes: self.passes.passes(),
            left_out: self.passes.left_out(),
            shots,
            hits,
            neutral_hits,
            not_scored,
            registration_px: Registration::of(&self.registration, self.registered),
            records_digest: format!("{:016x}", digest.records.get()),
            scenes_digest: format!("{:016x}", digest.scenes.get()),
            frames_sha256: output.frames_sha256.map(|hash| hash.iter().map(|b| format!("{b:02x}")).collect()),
            peak_rss_mb: memory_mb("VmHWM:"),
            memory: self.memory.growth(),
            seed: session.seed(),
            recording: options.recording.clone(),
            scenario: session.scenario_name().to_owned(),
            video: format!("{:?}, {video}", plan.video),
            video_frames: output.video.as_ref().map(VideoTimes::marks),
            faults: faults.map(|(code, n)| (code.to_owned(), n)).collect(),
            counts: self.counts(session, clock, counters),
            sea: session.sea().map(SeaSummary::from),
            heading: HeadingSummary::of(session),
            sun: session.luminaries().into(),
            unit_clock: session.unit_clock().map(ClockSummary::from),
        }
    }

    fn stages(&self, output: &OutputReport) -> BTreeMap<String, Percentiles> {
        let own = [
            ("events", &self.events_ms),
            ("step", &self.step_ms),
            ("submit", &self.submit_ms),
            ("gpu", &output.gpu_ms),
        ];
        let own = own.map(|(name, samples)| (name.to_owned(), samples));
        let passes = Pass::ALL.map(|pass| (format!("gpu_{}", pass.name()), &output.passes_ms[pass as usize]));
        own.into_iter().chain(passes).filter_map(|(name, s)| Some((name, s.percentiles()?))).collect()
    }

    fn counts(
        &self,
        session: &Session,
        clock: &TickClock,
        counters: Vec<(&'static str, u64)>,
    ) -> BTreeMap<String, u64> {
        let s = session.sensor_counts();
        let (missed, slips) = clock.missed_and_slips();
        let mut counts: BTreeMap<String, u64> =
            counters.into_iter().map(|(name, n)| (name.to_owned(), n)).collect();
        // What the source left out and what the session did not take are one number to the reader.
        let also = |counts: &BTreeMap<String, u64>, name: &str| counts.get(name).copied().unwrap_or(0);
        let (not_finite, other_size) =
            (also(&counts, "imu_not_finite"), also(&counts, "pictures_other_size"));
        let of_session = [
            ("imu_insane", s.imu_implausible + not_finite),
            ("imu_frozen", s.imu_frozen),
            ("imu_restarts", u64::from(s.imu_restarts)),
            ("imu_fallbacks", u64::from(s.imu_fallbacks)),
            ("horizons_taken", s.horizons.taken),
            ("horizons_refused", s.horizons.refused),
            ("horizons_none", s.horizons.none),
            ("skyline_taken", s.skyline.taken),
            ("skyline_refused", s.skyline.refused),
            ("skyline_none", s.skyline.none),
            ("skyline_anchors", s.skyline.anchors),
            ("pictures", s.frames),
            ("pictures_backward", s.frames_backward),
            ("pictures_wrong_size", s.frames_wrong_size + other_size),
            ("frames_blind", self.blind),
            ("ticks_missed", missed),
            ("ticks_slipped", slips),
            ("ring_waits", self.ring_waits),
        ];
        counts.extend(of_session.map(|(name, n)| (name.to_owned(), n)));
        counts.entry("imu_samples".to_owned()).or_insert(s.imu);
        if let Some(r) = &self.recovery {
            let judged = [
                ("faults_judged", r.judged),
                ("faults_recovered", r.recovered),
                ("faults_to_be_seen", r.to_be_seen),
                ("faults_seen", r.seen),
            ];
            counts.extend(judged.map(|(name, n)| (name.to_owned(), n)));
        }
        counts
    }
}
