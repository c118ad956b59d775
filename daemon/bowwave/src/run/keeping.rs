//! What is kept: rounds in the journal, and what went in as a recording where that is wanted. Pictures give way to rounds when
//! the disk gets full.

use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
    thread::{self, JoinHandle},
    time::{Duration, SystemTime},
};

use anyhow::{Context, Result};
use bowwave_core::{
    event::Event,
    fault::{Fault, FaultChange},
    time::{NS_PER_S, Time},
    world::score::ShotRecord,
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

/// How long to wait before a journal that cannot be opened is tried again.
const OPEN_AGAIN_NS: i64 = NS_PER_S;

/// What is needed to open the journal, as often as it takes.
#[derive(Clone)]
struct Place {
    path: PathBuf,
    run: Run,
}

impl Place {
    fn open(&self) -> Result<Journal, JournalError> {
        let options = JournalOptions {
            reserve_bytes: JournalOptions::RESERVE_BYTES,
            own: true,
            ..JournalOptions::default()
        };
        Journal::open_with(&self.path, &self.run, &options)
    }
}

/// The journal, or why there is none yet.
enum Store {
    Open(Journal),
    Shut {
        error: JournalError,
        next: Time,
        /// The disk may take its time: the frame does not wait for it.
        attempt: Option<JoinHandle<Result<Journal, JournalError>>>,
    },
}

/// Journal and recording of a run.
pub struct Keeping {
    place: Place,
    store: Store,
    waiting: VecDeque<ShotRecord>,
    recorder: Option<Recorder>,
    /// Why nothing is recorded although it should be.
    recording_failed: Option<String>,
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
    ) -> Self {
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
        let place = Place { path: folder.join(JOURNAL), run };
        let store = match place.open() {
            Ok(journal) => {
                faults.extend(dirty(&journal));
                Store::Open(journal)
            }
            Err(error) => {
                log::error!("{error}; hits are kept in memory until it can be opened");
                Store::Shut { error, next: now().plus_ns(OPEN_AGAIN_NS), attempt: None }
            }
        };
        let mut recording_failed = None;
        let recorder = if settings.config.record {
            let begun = begin_recording(folder, "recording", settings).map(|begun| begun.0);
            begun.inspect_err(|e| recording_failed = Some(format!("nothing is recorded: {e:#}"))).ok()
        } else {
            None
        };
        let space = SpaceWatch::new(folder, space_limit(folder, recorder.is_some()));
        Self {
            place,
            store,
            waiting: VecDeque::new(),
            recorder,
            recording_failed,
            space,
            quarantined: None,
            wall: None,
            print_commits,
        }
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
        self.open_again(faults, events);
        if let Store::Open(journal) = &self.store {
            while let Some(record) = self.waiting.front() {
                match journal.shot(record) {
                    Ok(()) => drop(self.waiting.pop_front()),
                    // They are tried again with the next frame.
                    Err(JournalError::QueueFull { .. }) => break,
                    Err(e) => return Err(e).context("rounds cannot be kept"),
                }
            }
            if let Some(wall) = self.wall
                && journal.set_wall_clock(wall.wall_ns, wall.at).is_ok()
            {
                self.wall = None;
            }
            if self.print_commits {
                crate::commits::print(journal.commits().try_iter())?;
            } else {
                // Acknowledgements that nobody reads must not pile up.
                journal.commits().try_iter().for_each(drop);
            }
        }
        self.tend_disk(faults, events);
        Ok(())
    }

    /// Tries to open a journal that could not be opened.
    fn open_again(&mut self, faults: &mut Faults, events: &mut Vec<Event>) {
        let Store::Shut { error, next, attempt } = &mut self.store else { return };
        if let Some(thread) = attempt.take_if(|thread| thread.is_finished()) {
            match thread.join() {
                Ok(Ok(journal)) => {
                    if let Some(change) = dirty(&journal) {
                        faults.take(change, events);
                    }
                    log::warn!("the journal is open; {} rounds from memory go into it", self.waiting.len());
                    self.store = Store::Open(journal);
                    return;
                }
                Ok(Err(e)) => *error = e,
                Err(_) => log::error!("opening the journal broke down; report it with the log"),
            }
            *next = now().plus_ns(OPEN_AGAIN_NS);
        }
        if attempt.is_none() && now() >= *next {
            let place = self.place.clone();
            match thread::Builder::new().name("journal-open".to_owned()).spawn(move || place.open()) {
                Ok(thread) => *attempt = Some(thread),
                Err(e) => {
                    log::debug!("no thread to open the journal: {e}");
                    *next = now().plus_ns(OPEN_AGAIN_NS);
                }
            }
        }
    }

    /// What is wrong with the journal: code, and why.
    fn broken(&self) -> Option<(Fault, String)> {
        match &self.store {
            Store::Open(journal) => journal
                .fault()
                .map(|b| (b.fault, format!("{} ({} rounds wait in memory)", b.message, b.waiting))),
            Store::Shut { error, .. } => {
                Some((error.fault(), format!("{error} ({} rounds wait in memory)", self.waiting.len())))
            }
        }
    }

    fn tend_disk(&mut self, faults: &mut Faults, events: &mut Vec<Event>) {
        let broken = self.broken();
        let cause = |fault| broken.as_ref().filter(|(f, _)| *f == fault).map(|(_, why)| why.clone());
        let room = self.space.room(now());
        let read_only = (room == Room::ReadOnly)
            .then(|| "the data partition is mounted read-only: hits are kept in memory; look at the kernel's log, replace the disk".to_owned());
        faults.set(Fault::DiskReadOnly, cause(Fault::DiskReadOnly).or(read_only), events);
        if let Some(recorder) = self.recorder.take_if(|r| r.has_ended()) {
            // It ends by itself only where it cannot write.
            self.recording_failed = Some("the recording has ended: see the log".to_owned());
            end_recording(recorder);
        }
        faults.set(Fault::DiskFsync, cause(Fault::DiskFsync).or(self.recording_failed.clone()), events);
        let low = match room {
            Room::Enough | Room::ReadOnly => None,
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
        if let Store::Open(journal) = &self.store
            && let Some(quarantine) = journal.quarantined()
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
        let journal = match self.store {
            Store::Open(journal) => Some(journal),
            // The last chance of rounds that are in memory only.
            Store::Shut { attempt: None, .. } if !self.waiting.is_empty() => {
                self.place.open().inspect_err(|e| log::error!("{e}")).ok()
            }
            Store::Shut { .. } => None,
        };
        let written = match journal {
            Some(journal) => write_out(journal, &mut self.waiting, self.print_commits),
            None if self.waiting.is_empty() => Ok(()),
            None => Err(anyhow::anyhow!(
                "{} rounds are lost: the journal could not be opened",
                self.waiting.len()
            )),
        };
        if let Some(recorder) = self.recorder.take() {
            end_recording(recorder);
        }
        written
    }
}

/// Hands what waits to the journal and ends it.
fn write_out(journal: Journal, waiting: &mut VecDeque<ShotRecord>, print_commits: bool) -> Result<()> {
    // Room comes as the journal writes.
    let give_up = now().plus_secs(0.3);
    while let Some(record) = waiting.front() {
        match journal.shot(record) {
            Ok(()) => drop(waiting.pop_front()),
            Err(JournalError::QueueFull { .. }) if now() < give_up => {
                thread::sleep(Duration::from_millis(2));
            }
            Err(e) => {
                log::error!("{} rounds are lost: {e}", waiting.len());
                break;
            }
        }
    }
    let commits = journal.commits().clone();
    let ended = journal.finish();
    if print_commits {
        crate::commits::print(commits.try_iter())?;
    }
    ended?;
    Ok(())
}

/// The run before did not end as it should.
fn dirty(journal: &Journal) -> Option<FaultChange> {
    let dirty = journal.previous()?;
    let cause = format!(
        "run {} did not end as it should ({:?}); its committed rounds are kept",
        dirty.run, dirty.end
    );
    Some(FaultChange::noted(now(), Fault::BootDirty, cause))
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

/// Begins a recording in `folder` whose name begins with `what`; tells where it lies.
pub fn begin_recording(folder: &Path, what: &str, settings: &Settings) -> Result<(Recorder, PathBuf)> {
    let lens = &settings.setup.calibration.lens;
    let properties = Properties {
        calibration_toml: settings.calibration_toml.clone(),
        scenario_toml: Some(settings.scenario_toml.clone()),
        loop_ns: None,
        start: Time::from_ns(now().ns().max(0)),
        source: "live".to_owned(),
        picture: (lens.width, lens.height),
        camera_info: Some(CameraInfo::from_lens(lens)),
        extra: [("eye_height_m".to_owned(), settings.setup.scenario.eye_height_m.to_string())].into(),
    };
    // A name of its own for each run: nothing that was recorded is overwritten.
    let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs();
    let name = |n: u32| folder.join(format!("{what}-{wall}-{n}.mcap"));
    let path =
        (0..1000).map(name).find(|p| !p.exists()).context("a thousand recordings of this second exist")?;
    Ok((Recorder::start(&path, &properties, false)?, path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::settings::Reader;
    use bowwave_core::world::score::{NotScored, Outcome};
    use bowwave_record::{ShotFilter, read_shots};
    use glam::DVec3;

    fn round(shot: u64) -> ShotRecord {
        ShotRecord {
            shot,
            fired: now(),
            muzzle: DVec3::ZERO,
            bore: DVec3::Y,
            pose_age_ns: 0,
            outcome: Outcome::NotScored { cause: NotScored::ImuStale },
        }
    }

    /// A data folder that is not there at the start, as behind a disk that failed.
    #[test]
    fn rounds_wait_in_memory_until_the_journal_can_be_opened() {
        let base = std::env::temp_dir().join(format!("bowwave-keeping-{}", std::process::id()));
        std::fs::create_dir_all(&base).unwrap();
        let folder = base.join("data");
        let settings = Reader { config: base.join("bowwave.toml"), last_good: None }.read().unwrap();
        let mut keeping = Keeping::open(&folder, &settings, None, false, &mut Vec::new());
        let (mut faults, mut events) = (Faults::new(None), Vec::new());
        keeping.rounds(&[round(1), round(2)]);
        keeping.tend(&mut faults, &mut events).unwrap();
        let (fault, why) = keeping.broken().unwrap();
        assert!(why.contains("2 rounds wait"), "{why}");
        assert!(faults.warnings().any(|f| f == fault), "the LCD tells");

        std::fs::create_dir_all(&folder).unwrap();
        let until = now().plus_secs(20.0);
        while keeping.broken().is_some() && now() < until {
            keeping.tend(&mut faults, &mut events).unwrap();
            thread::sleep(Duration::from_millis(20));
        }
        keeping.rounds(&[round(3)]);
        keeping.tend(&mut faults, &mut events).unwrap();
        assert_eq!(faults.warnings().count(), 0);
        keeping.finish().unwrap();
        let stored = read_shots(&folder.join(JOURNAL), &ShotFilter::default()).unwrap();
        assert_eq!(stored.iter().map(|s| s.record.shot).collect::<Vec<_>>(), [1, 2, 3]);
        std::fs::remove_dir_all(&base).unwrap();
    }
}
