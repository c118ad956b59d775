//! What is kept: rounds in the journal, and what went in as a recording where that is wanted. Pictures give way to rounds when
//! the disk gets full.

use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
    time::SystemTime,
};

use anyhow::{Context, Result};
use bowwave_core::{
    event::Event,
    fault::{Fault, FaultChange},
    score::ShotRecord,
    time::Time,
};
use bowwave_devices::clock::now;
use bowwave_record::{
    CameraInfo, Journal, JournalError, JournalOptions, PoseEntry, Properties, Room, Run, SpaceWatch,
};

use super::{faults::Faults, health::WallTime, settings::Settings};
use crate::{hits::JOURNAL, recorder::Recorder};

/// Rounds that wait for room in the journal's queue; more than any belt has.
const ROUNDS_WAITING_MAX: usize = 100_000;

/// Free bytes below which a disk that only takes hits counts as full: months of them.
const HITS_BYTES: u64 = 32 << 20;

/// Journal and recording of a run.
pub struct Keeping {
    journal: Journal,
    waiting: VecDeque<ShotRecord>,
    recorder: Option<Recorder>,
    space: SpaceWatch,
    quarantined: Option<PathBuf>,
    wall: Option<WallTime>,
    /// Print each committed round's number.
    print_commits: bool,
}

impl Keeping {
    /// Opens the journal in `folder` and, where the configuration says so, a recording.
    pub fn open(
        folder: &Path,
        settings: &Settings,
        boot_id: Option<String>,
        print_commits: bool,
        faults: &mut Vec<FaultChange>,
    ) -> Result<Self> {
        let run = Run {
            // Filled in once the clock is known to be set.
            started_wall_ns: None,
            scenario: settings.setup.scenario.name.clone(),
            recording: String::new(),
            seed: settings.setup.scenario.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            boot_id,
            started: Some(now()),
        };
        let options =
            JournalOptions { reserve_bytes: JournalOptions::RESERVE_BYTES, ..JournalOptions::default() };
        let journal = Journal::open_with(&folder.join(JOURNAL), &run, &options)?;
        if let Some(dirty) = journal.previous() {
            let cause = format!(
                "run {} did not end as it should ({:?}); its committed rounds are kept",
                dirty.run, dirty.end
            );
            faults.push(FaultChange::noted(now(), Fault::BootDirty, cause));
        }
        let recorder = if settings.config.record { Some(recorder(folder, settings)?) } else { None };
        let space = SpaceWatch::new(folder, space_limit(folder, recorder.is_some()));
        Ok(Self {
            journal,
            waiting: VecDeque::new(),
            recorder,
            space,
            quarantined: None,
            wall: None,
            print_commits,
        })
    }

    /// Takes in what devices reported, for the recording.
    pub fn events(&mut self, events: &[Event]) {
        if let Some(recorder) = &mut self.recorder {
            events.iter().for_each(|e| recorder.event(e));
        }
    }

    /// Takes in a pose that was used.
    pub fn pose(&mut self, entry: PoseEntry) {
        if let Some(recorder) = &mut self.recorder {
            recorder.pose(entry);
        }
    }

    /// Takes in rounds that ended.
    pub fn rounds(&mut self, records: &[ShotRecord]) {
        let room = ROUNDS_WAITING_MAX.saturating_sub(self.waiting.len());
        if records.len() > room {
            log::error!(
                "{} rounds cannot be kept: the journal takes none and memory for them is full",
                records.len() - room
            );
        }
        self.waiting.extend(records.iter().take(room).cloned());
    }

    /// The wall clock is known to be set.
    pub fn clock_set(&mut self, time: WallTime) {
        self.wall = Some(time);
    }

    /// Hands on what waits, and tells what is wrong with the disk. Never waits.
    pub fn tend(&mut self, faults: &mut Faults, events: &mut Vec<Event>) -> Result<()> {
        while let Some(record) = self.waiting.front() {
            match self.journal.shot(record) {
                Ok(()) => drop(self.waiting.pop_front()),
                // They are tried again with the next frame.
                Err(JournalError::QueueFull { .. }) => break,
                Err(e) => return Err(e).context("rounds cannot be kept"),
            }
        }
        if let Some(wall) = self.wall
            && self.journal.set_wall_clock(wall.wall_ns, wall.at).is_ok()
        {
            self.wall = None;
        }
        if self.print_commits {
            crate::commits::print(self.journal.commits().try_iter())?;
        } else {
            // Acknowledgements that nobody reads must not pile up.
            self.journal.commits().try_iter().for_each(drop);
        }
        self.tend_disk(faults, events);
        Ok(())
    }

    fn tend_disk(&mut self, faults: &mut Faults, events: &mut Vec<Event>) {
        let broken = self.journal.fault();
        let cause = |fault| {
            broken
                .as_ref()
                .filter(|b| b.fault == fault)
                .map(|b| format!("{} ({} rounds wait in memory)", b.message, b.waiting))
        };
        faults.set(Fault::DiskReadOnly, cause(Fault::DiskReadOnly), events);
        faults.set(Fault::DiskFsync, cause(Fault::DiskFsync), events);
        let low = match self.space.room(now()) {
            Room::Enough => None,
            Room::Low { free_bytes } => Some(format!(
                "{} MB are free: the recording ends, the rest is for hits; free the data partition",
                free_bytes / 1_000_000
            )),
        };
        if low.is_some()
            && let Some(recorder) = self.recorder.take()
        {
            // What was recorded so far is whole. It is not begun anew within the run.
            end_recording(recorder);
        }
        faults.set(Fault::DiskFull, cause(Fault::DiskFull).or(low), events);
        if let Some(quarantine) = self.journal.quarantined()
            && self.quarantined.as_ref() != Some(&quarantine.kept_as)
        {
            let cause = format!(
                "the journal was damaged ({}); it is kept as {} and a fresh one begun",
                quarantine.reason,
                quarantine.kept_as.display()
            );
            self.quarantined = Some(quarantine.kept_as);
            faults.set(Fault::DbQuarantine, None, events);
            faults.set(Fault::DbQuarantine, Some(cause), events);
        }
    }

    /// The voltage sinks: what is in memory goes to the disk now.
    pub fn flush(&mut self) {
        if let Some(recorder) = &mut self.recorder {
            recorder.flush();
        }
    }

    /// Writes everything and ends.
    pub fn finish(mut self) -> Result<()> {
        // Room comes as the journal writes.
        let give_up = now().plus_secs(0.3);
        while let Some(record) = self.waiting.front() {
            match self.journal.shot(record) {
                Ok(()) => drop(self.waiting.pop_front()),
                Err(JournalError::QueueFull { .. }) if now() < give_up => {
                    std::thread::sleep(std::time::Duration::from_millis(2));
                }
                Err(e) => {
                    log::error!("{} rounds are lost: {e}", self.waiting.len());
                    break;
                }
            }
        }
        let commits = self.journal.commits().clone();
        let ended = self.journal.finish();
        if self.print_commits {
            crate::commits::print(commits.try_iter())?;
        }
        if let Some(recorder) = self.recorder.take() {
            end_recording(recorder);
        }
        ended?;
        Ok(())
    }
}

/// Free bytes below which the disk counts as full: room for a recording's end, or for hits alone, and never more than a part
/// of a small disk.
fn space_limit(folder: &Path, records: bool) -> u64 {
    let (limit, part) = if records { (SpaceWatch::LIMIT_BYTES, 8) } else { (HITS_BYTES, 32) };
    match rustix::fs::statvfs(folder) {
        Ok(s) => limit.min(s.f_blocks.saturating_mul(s.f_frsize) / part),
        Err(_) => limit,
    }
}

fn end_recording(recorder: Recorder) {
    let dropped = recorder.dropped();
    if dropped > 0 {
        log::warn!("the recording lacks {dropped} entries that the disk was too slow for");
    }
    if let Err(e) = recorder.finish() {
        log::error!("the recording did not end well: {e:#}; `bowwave simulate` plays what is whole");
    }
}

fn recorder(folder: &Path, settings: &Settings) -> Result<Recorder> {
    let lens = &settings.setup.calibration.lens;
    let properties = Properties {
        calibration_toml: settings.calibration_toml.clone(),
        scenario_toml: Some(settings.scenario_toml.clone()),
        loop_ns: None,
        start: Time::from_ns(now().ns().max(0)),
        source: "live".to_owned(),
        picture: (lens.width, lens.height),
        camera_info: Some(CameraInfo::from_lens(lens)),
        extra: std::collections::BTreeMap::new(),
    };
    // A name of its own for each run: nothing that was recorded is overwritten.
    let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs();
    let name = |n: u32| folder.join(format!("recording-{wall}-{n}.mcap"));
    let path =
        (0..1000).map(name).find(|p| !p.exists()).context("a thousand recordings of this second exist")?;
    Recorder::start(&path, &properties, false)
}
