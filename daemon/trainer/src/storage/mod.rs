//! Rounds go into the journal, and the session's inputs into a recording where that is wanted. Pictures give way to rounds when the
//! disk gets full.

mod commits;
mod recorder;
mod tracks;

use std::{
    collections::VecDeque,
    io,
    path::PathBuf,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use bowwave_core::{
    event::{Event, Tick},
    fault::{Fault, FaultChange},
    session::SessionDigest,
    time::{NS_PER_S, Time},
    world::{exercise::ExerciseEvent, score::ShotRecord, track::TrackBlock},
};
use bowwave_devices::clock::now;
use bowwave_record::{
    Journal, JournalError, JournalOptions, PoseEntry, Quarantine, Room, Run, SpaceWatch, StoredShot,
    put_aside,
};

pub use recorder::{Recorder, RecorderOptions};
use tracks::TrackQueue;

use crate::supervisor::{FaultLog, WallTime};

/// The journal's file in the folder of a run.
pub const JOURNAL: &str = "hits.sqlite";

/// Rounds that wait for room in the journal's queue; more than any belt has.
const ROUNDS_WAITING_MAX: usize = 100_000;
/// Events of the exercise that wait likewise.
const EVENTS_WAITING_MAX: usize = 100_000;

/// Free bytes below which a disk that only takes hits counts as full: months of them.
const HITS_BYTES: u64 = 32 << 20;

/// How long to wait before a journal that cannot be opened is tried again.
const OPEN_AGAIN_NS: i64 = NS_PER_S;

/// Settings of the storage of a run.
#[derive(Clone, Debug)]
pub struct StorageOptions {
    /// Folder of journal and recording.
    pub folder: PathBuf,
    /// The run, for the journal.
    pub run: Run,
    /// How the journal is opened.
    pub journal: JournalOptions,
    /// The recording, where there is to be one.
    pub recording: Option<RecorderOptions>,
    /// A journal that cannot be opened ends the run. Else rounds wait in memory.
    pub strict: bool,
    /// Print each committed round's number.
    pub print_commits: bool,
}

impl StorageOptions {
    /// The journal's file.
    fn journal_path(&self) -> PathBuf {
        self.folder.join(JOURNAL)
    }

    fn open(&self) -> Result<Journal, JournalError> {
        Journal::open_with(&self.journal_path(), &self.run, &self.journal)
    }

    /// The same in a thread: the frame does not wait for the disk.
    fn open_aside(&self) -> io::Result<JoinHandle<Result<Journal, JournalError>>> {
        let options = self.clone();
        thread::Builder::new().name("journal-open".to_owned()).spawn(move || options.open())
    }

    /// The result of that thread, once it has ended.
    fn opened(&self, thread: JoinHandle<Result<Journal, JournalError>>) -> Result<Journal, JournalError> {
        let broke_down = |_| Err(self.unopened("opening it broke down; report it with the log"));
        thread.join().unwrap_or_else(broke_down)
    }

    fn unopened(&self, reason: &str) -> JournalError {
        JournalError::Disk { path: self.journal_path(), reason: reason.to_owned() }
    }
}

/// The journal, or why there is none yet.
enum JournalState {
    Open(Journal),
    Shut {
        error: JournalError,
        /// Beginning of the fault.
        told_from: Time,
        next: Time,
        /// The disk may take its time: the frame does not wait for it.
        attempt: Option<JoinHandle<Result<Journal, JournalError>>>,
    },
}

impl JournalState {
    /// The journal, if it can be opened soon.
    fn start(options: &StorageOptions) -> Self {
        /// The start waits so long for the journal; a slow disk, or one that somebody has locked, opens it later...
        const OPEN_WITHIN: Duration = Duration::from_millis(500);
        /// ...and is told of after so long.
        const OPEN_TOLD_NS: i64 = 3 * NS_PER_S;
        let shut = |error: JournalError, attempt: Option<JoinHandle<_>>| {
            log::error!("{error}; hits are kept in memory until it can be opened");
            let told_from = now().plus_ns(if attempt.is_some() { OPEN_TOLD_NS } else { 0 });
            Self::Shut { error, told_from, next: now().plus_ns(OPEN_AGAIN_NS), attempt }
        };
        let thread = match options.open_aside() {
            Ok(thread) => thread,
            Err(e) => return shut(options.unopened(&format!("no thread to open it: {e}")), None),
        };
        let until = Instant::now() + OPEN_WITHIN;
        if !comes_before(until, || thread.is_finished()) {
            return shut(options.unopened("it has not answered yet"), Some(thread));
        }
        match options.opened(thread) {
            Ok(journal) => Self::Open(journal),
            Err(error) => shut(error, None),
        }
    }
}

/// Journal and recording of a run.
pub struct Storage {
    options: StorageOptions,
    store: JournalState,
    waiting: VecDeque<ShotRecord>,
    /// Events that wait, with the number of the first.
    events: VecDeque<ExerciseEvent>,
    events_sent: u64,
    tracks: TrackQueue,
    recorder: Option<Recorder>,
    /// A recording that takes nothing more, until what waits is written.
    closed: Option<Recorder>,
    /// Why nothing is recorded although it should be.
    recording_failed: Option<String>,
    /// Entries of an ended recording that were lost.
    lost: u64,
    space: SpaceWatch,
    quarantined: Option<Quarantine>,
    wall: Option<WallTime>,
    print_commits: bool,
}

impl Storage {
    /// Opens the journal and begins the recording.
    ///
    /// # Errors
    /// Only strict storage fails; else what is wrong becomes a fault.
    pub fn open(options: StorageOptions, faults: &mut Vec<FaultChange>) -> Result<Self> {
        let store =
            if options.strict { JournalState::Open(options.open()?) } else { JournalState::start(&options) };
        if let JournalState::Open(journal) = &store {
            faults.extend(dirty(journal).filter(|_| !options.strict));
        }
        let mut recording_failed = None;
        let recorder = match options.recording.as_ref().map(Recorder::start).transpose() {
            Ok(recorder) => recorder,
            Err(e) if options.strict => return Err(e),
            Err(e) => {
                recording_failed = Some(format!("nothing is recorded: {e:#}"));
                None
            }
        };
        // Room for a recording's end, or for hits alone, and never more than a part of a small disk.
        let (limit, part) = if recorder.is_some() { (SpaceWatch::LIMIT_BYTES, 8) } else { (HITS_BYTES, 32) };
        let space = SpaceWatch::new(&options.folder, limit, part);
        let print_commits = options.print_commits;
        Ok(Self {
            options,
            store,
            waiting: VecDeque::new(),
            events: VecDeque::new(),
            events_sent: 0,
            tracks: TrackQueue::default(),
            recorder,
            closed: None,
            recording_failed,
            lost: 0,
            space,
            quarantined: None,
            wall: None,
            print_commits,
        })
    }

    /// Takes in what the session is about to meet with a tick, for the recording. `digest` is over what the session gave before.
    pub fn inputs(&mut self, events: &[Event], tick: Tick, digest: SessionDigest) {
        if let Some(recorder) = &mut self.recorder {
            recorder.inputs(events, tick, Some(digest));
        }
    }

    /// Whether the recording gives way to what must keep up with the camera.
    pub const fn spare(&mut self, spares: bool) {
        if let Some(recorder) = &mut self.recorder {
            recorder.spare(spares);
        }
    }

    /// Takes in the pose that was used for a picture, and the true one where that is known.
    pub fn poses(&mut self, used: Option<PoseEntry>, truth: Option<PoseEntry>) {
        if let Some(recorder) = &mut self.recorder {
            used.into_iter().for_each(|pose| recorder.pose(pose));
            truth.into_iter().for_each(|pose| recorder.truth(pose));
        }
    }

    /// Takes in what a tick, or the end, gave for the journal.
    pub fn take(&mut self, rounds: &[ShotRecord], events: &[ExerciseEvent], tracks: &TrackBlock) {
        self.rounds(rounds);
        self.exercise(events);
        self.tracks.take(tracks);
    }

    /// Takes in rounds that ended. Those that find no place are in the log, which may be on another disk.
    fn rounds(&mut self, records: &[ShotRecord]) {
        let rest = self.keep(records);
        if !rest.is_empty() {
            log::error!(
                "{} rounds cannot be kept: the journal takes none and memory for them is full",
                rest.len()
            );
        }
        for record in rest {
            log::error!("not in the journal: {}", StoredShot::line(0, record.clone()));
        }
    }

    /// Takes in events of the exercise. What finds no place is in the log.
    fn exercise(&mut self, events: &[ExerciseEvent]) {
        let room = EVENTS_WAITING_MAX.saturating_sub(self.events.len());
        let (kept, rest) = events.split_at(room.min(events.len()));
        self.events.extend(kept.iter().cloned());
        for event in rest {
            log::error!("event not in the journal: {event:?}");
        }
    }

    /// Keeps rounds for the journal; the rest that finds no place.
    fn keep<'a>(&mut self, records: &'a [ShotRecord]) -> &'a [ShotRecord] {
        let room = ROUNDS_WAITING_MAX.saturating_sub(self.waiting.len());
        let (kept, rest) = records.split_at(room.min(records.len()));
        self.waiting.extend(kept.iter().cloned());
        rest
    }

    /// The wall clock is known to be set.
    pub fn clock_set(&mut self, time: WallTime) {
        self.wall = Some(time);
    }

    /// Hands on what waits, and tells what is wrong with the disk. Never waits.
    pub fn poll(&mut self, faults: &mut FaultLog, events: &mut Vec<Event>) -> Result<()> {
        self.open_again(faults, events);
        if let JournalState::Open(journal) = &self.store {
            while let Some(record) = self.waiting.front() {
                match journal.shot(record) {
                    Ok(()) => drop(self.waiting.pop_front()),
                    // They are tried again with the next frame.
                    Err(JournalError::QueueFull { .. }) => break,
                    Err(e) => return Err(e).context("rounds cannot be kept"),
                }
            }
            send_events(journal, &mut self.events, &mut self.events_sent);
            self.tracks.send(journal);
            if let Some(wall) = self.wall
                && journal.set_wall_clock(wall.wall_ns, wall.at).is_ok()
            {
                self.wall = None;
            }
            if self.print_commits {
                commits::print(journal.commits().try_iter())?;
            } else {
                // Acknowledgements that nobody reads must not pile up.
                journal.commits().try_iter().for_each(drop);
            }
        }
        self.poll_disk(faults, events);
        Ok(())
    }

    /// Tries to open a journal that could not be opened.
    fn open_again(&mut self, faults: &mut FaultLog, events: &mut Vec<Event>) {
        let JournalState::Shut { error, told_from, next, attempt } = &mut self.store else { return };
        if let Some(thread) = attempt.take_if(|thread| thread.is_finished()) {
            match self.options.opened(thread) {
                Ok(journal) => {
                    if let Some(change) = dirty(&journal) {
                        faults.take(change, events);
                    }
                    log::warn!("the journal is open; {} rounds from memory go into it", self.waiting.len());
                    self.store = JournalState::Open(journal);
                    return;
                }
                Err(e) => (*error, *told_from) = (e, now()),
            }
            *next = now().plus_ns(OPEN_AGAIN_NS);
        }
        if attempt.is_none() && now() >= *next {
            match self.options.open_aside() {
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
            JournalState::Open(journal) => journal
                .fault()
                .map(|b| (b.fault, format!("{} ({} rounds wait in memory)", b.message, b.waiting))),
            JournalState::Shut { told_from, .. } if now() < *told_from => None,
            JournalState::Shut { error, .. } => {
                Some((error.fault(), format!("{error} ({} rounds wait in memory)", self.waiting.len())))
            }
        }
    }

    fn poll_disk(&mut self, faults: &mut FaultLog, events: &mut Vec<Event>) {
        let broken = self.broken();
        let cause = |fault| broken.as_ref().filter(|(f, _)| *f == fault).map(|(_, why)| why.clone());
        let room = self.space.room();
        let read_only = (room == Room::ReadOnly)
            .then(|| "the data partition is mounted read-only: hits are kept in memory; look at the kernel's log, replace the disk".to_owned());
        faults.set(Fault::DbLocked, cause(Fault::DbLocked), events);
        faults.set(Fault::DiskReadOnly, cause(Fault::DiskReadOnly).or(read_only), events);
        if let Some(recorder) = self.recorder.take_if(|r| r.has_ended()) {
            // It ends by itself only where it cannot write.
            self.recording_failed = Some("the recording has ended: see the log".to_owned());
            self.lost += end_recording(recorder);
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
            && let Some(mut recorder) = self.recorder.take()
        {
            // What was recorded so far is whole. It is not begun anew within the run.
            recorder.close();
            self.closed = Some(recorder);
        }
        if let Some(recorder) = self.closed.take_if(|r| r.has_ended()) {
            self.lost += end_recording(recorder);
        }
        faults.set(Fault::DiskFull, cause(Fault::DiskFull).or(low), events);
        if let JournalState::Open(journal) = &self.store
            && let Some(quarantine) = journal.quarantined()
            && self.quarantined.as_ref() != Some(&quarantine)
        {
            let cause = match &quarantine.kept_as {
                Some(kept_as) => format!(
                    "the journal was damaged ({}); it is kept as {} and a fresh one begun",
                    quarantine.reason,
                    kept_as.display()
                ),
                None => quarantine.reason.clone(),
            };
            let left = quarantine.rounds_left_there;
            let cause =
                if left > 0 { format!("{cause}; {left} rounds of this run are only there") } else { cause };
            self.quarantined = Some(quarantine);
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

    /// Writes everything and ends. Tells how many entries the recording lacks, and what went wrong.
    pub fn finish(mut self) -> (u64, Vec<anyhow::Error>) {
        let mut wrong = Vec::new();
        let until = Instant::now() + self.options.journal.end_within;
        // It writes what waits while the journal ends.
        if let Some(recorder) = &mut self.recorder {
            recorder.close();
        }
        let journal = match self.store {
            JournalState::Open(journal) => Some(journal),
            // Trying once more may take longer than the end may. The next run takes in what is put aside.
            JournalState::Shut { attempt, .. } => {
                attempt.filter(JoinHandle::is_finished).and_then(|thread| self.options.opened(thread).ok())
            }
        };
        let written = match journal {
            Some(journal) => {
                send_events(&journal, &mut self.events, &mut self.events_sent);
                self.tracks.finish(&journal);
                write_out(journal, &mut self.waiting, &self.options)
            }
            None if self.waiting.is_empty() => Ok(()),
            None => {
                let StorageOptions { run, journal, .. } = &self.options;
                let path = self.options.journal_path();
                Err(put_aside(&path, run, self.waiting.drain(..), journal.end_within).into())
            }
        };
        wrong.extend(written.err());
        for event in &self.events {
            log::error!("event not in the journal: {event:?}");
        }
        self.tracks.tell_unwritten();
        if self.options.strict && self.options.recording.is_some() && self.recorder.is_none() {
            let why = "the recording ended before the run: the disk is full or cannot be written; free it and run again";
            wrong.push(anyhow::anyhow!(why));
        }
        if let Some(recorder) = self.recorder.take().or(self.closed.take()) {
            if self.options.strict {
                self.lost += recorder.lost();
                wrong.extend(recorder.finish().err());
            } else {
                self.lost += end_recording_until(recorder, until);
            }
        }
        (self.lost, wrong)
    }
}

/// Hands events to the journal, as far as it takes them: the others are tried again.
fn send_events(journal: &Journal, events: &mut VecDeque<ExerciseEvent>, sent: &mut u64) {
    while let Some(event) = events.front()
        && journal.event(*sent + 1, event).is_ok()
    {
        events.pop_front();
        *sent += 1;
    }
}

/// Hands what waits to the journal and ends it.
fn write_out(journal: Journal, waiting: &mut VecDeque<ShotRecord>, options: &StorageOptions) -> Result<()> {
    let commits = journal.commits().clone();
    let ended = journal.finish_with(waiting.drain(..));
    if options.print_commits {
        commits::print(commits.try_iter())?;
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

/// Ends a recording and tells how many entries it lacks.
fn end_recording(recorder: Recorder) -> u64 {
    let lost = recorder.lost();
    if lost > 0 {
        log::warn!("the recording lacks {lost} entries that the disk was too slow for");
    }
    if let Err(e) = recorder.finish() {
        log::error!("the recording did not end well: {e:#}; `bowwave simulate` plays what is whole");
    }
    lost
}

/// The same of a recording that was closed, waiting for its disk no longer than `until`: a service that takes longer to end is killed.
fn end_recording_until(recorder: Recorder, until: Instant) -> u64 {
    if comes_before(until, || recorder.has_ended()) {
        return end_recording(recorder);
    }
    let lost = recorder.lost();
    log::error!(
        "the disk did not take the recording's end in time: what waited for it is lost, and {lost} entries before that; check the disk; `bowwave simulate` plays what is whole"
    );
    lost
}

/// Waits until a thread is done, no longer than `until`; whether it is.
fn comes_before(until: Instant, is_done: impl Fn() -> bool) -> bool {
    while !is_done() {
        if Instant::now() > until {
            return false;
        }
        thread::sleep(Duration::from_millis(1));
    }
    true
}

#[cfg(test)]
mod tests;
