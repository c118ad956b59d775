//! The journal of hits: an SQLite database that keeps every virtual round of every run.
//!
//! Written by a thread of its own from a bounded queue, one transaction for whatever is queued, in WAL mode with
//! `synchronous=FULL`: once a round's number comes out of [`Journal::commits`] it survives a crash and a power cut. While the
//! disk is full or gone, rounds are kept in memory and written as soon as it is back. After an fsync that failed nothing
//! since the last one that succeeded is taken for written; the database is opened anew and written again. A database that
//! turns out to be damaged is put aside at any time, and a fresh one goes on with this run's rounds. A database that was deleted, moved or
//! replaced is noticed before a round is acknowledged. After any failure of the disk what was acknowledged of this run counts as in doubt
//! and is inserted again where it is missing.
//!
//! Files beside the database `hits.sqlite`: `-wal` and `-shm` are SQLite's, `.reserve` keeps space for when the disk is full,
//! `.corrupt-N` are damaged databases, `.making` and `.fresh` exist while one is put aside, `.unwritten-N.jsonl` has the
//! rounds of run N that the database never took, until the next run takes them in: then it is `.taken-N.jsonl`, or `.refused-N.jsonl`
//! where the database refuses some of them for good.

mod aside;
mod boot;
mod debrief;
mod details;
mod error;
mod event;
mod open;
mod place;
mod quarantine;
mod query;
mod reserve;
mod row;
mod schema;
mod track;
mod worker;

use std::{
    convert::Infallible,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread::JoinHandle,
    time::Duration,
};

use bowwave_core::{
    fault::Fault,
    time::Time,
    world::{exercise::ExerciseEvent, score::ShotRecord, track::TrackBlock},
};
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TrySendError, bounded, unbounded};

pub use aside::{put_aside, side_files};
use boot::WallClock;
pub use boot::{DirtyEnd, DirtyRun, boot_id};
pub use details::{BoatDetails, CameraDetails, RunDetails};
pub use error::{JournalError, Unwritten};
use event::NumberedEvent;
pub use event::{StoredEvent, read_events};
use place::FolderHold;
pub use query::{RunSelection, ShotFilter, StoredRun, read_runs, read_shots};
pub use row::StoredShot;
pub use track::{StoredTracks, read_tracks};
use worker::{JournalChannels, JournalEnd, JournalWorker, Pending};

/// Rounds that may wait for the writing thread before [`Journal::shot`] refuses: minutes of firing.
const QUEUE: usize = 4096;

/// Description of a run of the trainer.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Run {
    /// Wall time of its beginning, nanoseconds since 1970, where the clock is known to be set. [`Journal::set_wall_clock`]
    /// fills it in later.
    pub started_wall_ns: Option<i64>,
    /// Name or file of the scenario.
    pub scenario: String,
    /// File of the recording; empty for live runs.
    pub recording: String,
    /// Seed of the session.
    pub seed: u64,
    /// Version of the program.
    pub version: String,
    /// The boot it runs in, see [`boot_id`].
    pub boot_id: Option<String>,
    /// Time of its beginning since that boot.
    pub started: Option<Time>,
    /// Details for the debrief, as JSON; `None` where there are none, as in journals before tables of version 5.
    pub details: Option<String>,
}

/// How a journal is kept.
#[derive(Clone, Copy, Debug)]
pub struct JournalOptions {
    /// Size of the file that keeps space for rounds when the disk is full, bytes; 0 for none. It stays there between runs.
    pub reserve_bytes: u64,
    /// Pages in the log beyond which they are moved into the database.
    pub checkpoint_pages: u32,
    /// The path is the program's own: whatever lies there was a journal, and is put aside where it no longer is one. Else a file
    /// that is no database is taken for somebody's, named by mistake, and left as it is.
    pub own: bool,
    /// How long the end may take while the disk fails or does not answer; what is not written until then is kept elsewhere.
    pub end_within: Duration,
}

impl JournalOptions {
    /// A reserve of this size keeps some 30,000 rounds.
    pub const RESERVE_BYTES: u64 = 8 << 20;
}

impl Default for JournalOptions {
    /// Without a reserve: for runs on a desk.
    fn default() -> Self {
        Self { reserve_bytes: 0, checkpoint_pages: 1000, own: false, end_within: Duration::from_secs(10) }
    }
}

/// Present fault of the journal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JournalFault {
    /// One of [`Fault::DiskFull`], [`Fault::DiskReadOnly`] and [`Fault::DiskFsync`].
    pub fault: Fault,
    /// Cause and remedy, one line.
    pub message: String,
    /// Rounds that wait in memory. 0 where rounds are still written, into the space that was kept for them.
    pub waiting: usize,
}

/// A database in whose place a fresh one was begun.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quarantine {
    /// Where it is now; `None` for one that was deleted or moved by somebody else.
    pub kept_as: Option<PathBuf>,
    /// What is wrong with it.
    pub reason: String,
    /// Rounds of the present run that only it may have: more were fired than are kept in memory.
    pub rounds_left_there: u64,
}

/// Summary of a finished journal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JournalSummary {
    /// The database.
    pub path: PathBuf,
    /// The run's number in it.
    pub run: i64,
    /// Rounds that were committed.
    pub committed: u64,
}

/// Bounds and patience; others than the defaults only in tests.
#[derive(Clone, Copy, Debug)]
struct JournalSettings {
    /// Most pages of the database.
    pages_max: Option<u32>,
    /// Pages of the database that SQLite may keep in memory.
    pages_cached: Option<u32>,
    /// Options of the journal's user.
    options: JournalOptions,
    /// Most committed rounds of this run kept in memory, for a fresh database.
    kept_max: usize,
    /// Most rounds kept in memory while the database cannot be written.
    held_max: usize,
    /// First pause after a failure; doubles up to `retry_max`.
    retry_first: Duration,
    /// Longest pause.
    retry_max: Duration,
    /// How long the database may be held by another process within one attempt.
    busy: Duration,
}

impl From<&JournalOptions> for JournalSettings {
    fn from(options: &JournalOptions) -> Self {
        Self {
            pages_max: None,
            pages_cached: None,
            options: *options,
            kept_max: 10_000,
            held_max: 100_000,
            retry_first: Duration::from_millis(50),
            retry_max: Duration::from_secs(1),
            busy: open::BUSY,
        }
    }
}

/// State that the thread reports.
#[derive(Debug, Default)]
struct JournalStatus {
    fault: Option<JournalFault>,
    quarantine: Option<Quarantine>,
    committed: u64,
}

/// Message to the thread.
#[derive(Debug)]
enum JournalMessage {
    Shot(ShotRecord),
    Event(NumberedEvent),
    Tracks(u64, TrackBlock),
    Clock(WallClock),
}

/// The journal of one run, open for writing.
pub struct Journal {
    path: PathBuf,
    run: i64,
    previous: Option<DirtyRun>,
    queue: Option<Sender<JournalMessage>>,
    /// Never carries anything; its end tells the thread to finish.
    open: Option<Sender<Infallible>>,
    commits: Receiver<u64>,
    told: Arc<Mutex<JournalStatus>>,
    /// What the thread has taken and not written yet.
    pending: Arc<Mutex<Pending>>,
    /// What is queued, for when the thread does not answer.
    queued: Receiver<JournalMessage>,
    ended: Receiver<JournalEnd>,
    end_within: Duration,
    thread: Option<JoinHandle<()>>,
    _hold: FolderHold,
}

impl Journal {
    /// Opens or makes the database at `path` and begins a run in it. A damaged database is put aside under another name
    /// ([`Journal::quarantined`]) and a fresh one begun.
    pub fn open(path: &Path, run: &Run) -> Result<Self, JournalError> {
        Self::open_with(path, run, &JournalOptions::default())
    }

    /// The same with other options.
    pub fn open_with(path: &Path, run: &Run, options: &JournalOptions) -> Result<Self, JournalError> {
        Self::start(path, run, JournalSettings::from(options))
    }

    fn start(path: &Path, run: &Run, settings: JournalSettings) -> Result<Self, JournalError> {
        let hold = FolderHold::take(path)?;
        let mut opened = open::for_writing(path, &settings)?;
        let fail = |error: rusqlite::Error| JournalError::from_sql(path, &error);
        let previous = boot::last_dirty(&opened.connection, run.boot_id.as_deref()).map_err(fail)?;
        aside::take_in(&mut opened.connection, path);
        let id = schema::begin_run(&opened.connection, None, run).map_err(fail)?;
        let (queue, incoming) = bounded(QUEUE);
        // Eight bytes a round, and rounds are bounded by belts: not worth losing an acknowledgement for.
        let (committed, commits) = unbounded();
        let (open, closing) = bounded(0);
        let told = Arc::new(Mutex::new(JournalStatus {
            quarantine: opened.quarantined,
            ..JournalStatus::default()
        }));
        let pending = Arc::new(Mutex::new(Pending::default()));
        let (end, ended) = bounded(1);
        let ends = JournalChannels {
            incoming: incoming.clone(),
            closing,
            commits: committed,
            told: Arc::clone(&told),
            pending: Arc::clone(&pending),
        };
        let worker =
            JournalWorker::new((opened.connection, opened.place), path, (id, run.clone()), ends, settings);
        let thread = std::thread::Builder::new()
            .name("journal".to_owned())
            // Nobody waits any more for one that took too long.
            .spawn(move || drop(end.send(worker.run())))
            .map_err(|source| JournalError::File {
                path: path.into(),
                doing: "start the thread for",
                source,
            })?;
        Ok(Self {
            path: path.into(),
            run: id,
            previous,
            queue: Some(queue),
            open: Some(open),
            commits,
            told,
            pending,
            queued: incoming,
            ended,
            end_within: settings.options.end_within,
            thread: Some(thread),
            _hold: hold,
        })
    }

    /// The run's number in the database.
    pub const fn run(&self) -> i64 {
        self.run
    }

    /// The database.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The last damaged database that was put aside, if any: when the journal was opened or since. Raises
    /// [`Fault::DbQuarantine`].
    pub fn quarantined(&self) -> Option<Quarantine> {
        self.told().quarantine.clone()
    }

    /// The run before this one where it did not end as it should: worth a [`Fault::BootDirty`]. Another program that has the
    /// same database open and runs at this moment looks like a crash.
    pub const fn previous(&self) -> Option<&DirtyRun> {
        self.previous.as_ref()
    }

    /// Queues a round; never waits. [`JournalError::QueueFull`] means that the round was not taken and the caller still has
    /// it.
    pub fn shot(&self, shot: &ShotRecord) -> Result<(), JournalError> {
        self.send(JournalMessage::Shot(shot.clone()), shot.shot)
    }

    /// Queues an event of the exercise, by its number in the run; never waits. Errors as of [`Self::shot`]. Events that are never written
    /// are lines of the log.
    pub fn event(&self, number: u64, event: &ExerciseEvent) -> Result<(), JournalError> {
        self.send(JournalMessage::Event(NumberedEvent { number, event: event.clone() }), 0)
    }

    /// Queues a block of tracks, by its number in the run; never waits. Errors as of [`Self::shot`]. Tracks give way to rounds: where the disk
    /// has no room for them they are left out, and the log says so.
    pub fn tracks(&self, number: u64, block: TrackBlock) -> Result<(), JournalError> {
        self.send(JournalMessage::Tracks(number, block), 0)
    }

    /// Tells what the wall clock shows, nanoseconds since 1970, at a time since boot, once it is known to be set. All runs of
    /// this boot without a wall time get theirs. Never waits; where the queue is full, say it again later.
    pub fn set_wall_clock(&self, wall_ns: i64, at: Time) -> Result<(), JournalError> {
        self.send(JournalMessage::Clock(WallClock { wall_ns, at }), 0)
    }

    fn send(&self, message: JournalMessage, shot: u64) -> Result<(), JournalError> {
        let is_written = self.thread.as_ref().is_some_and(|thread| !thread.is_finished());
        let Some(queue) = self.queue.as_ref().filter(|_| is_written) else { return Err(self.stopped()) };
        queue.try_send(message).map_err(|error| match error {
            TrySendError::Full(_) => JournalError::QueueFull { path: self.path.clone(), shot },
            TrySendError::Disconnected(_) => self.stopped(),
        })
    }

    /// Numbers of rounds, each once its transaction has been committed to the disk, and only then.
    pub const fn commits(&self) -> &Receiver<u64> {
        &self.commits
    }

    /// Present fault of the journal, if any.
    pub fn fault(&self) -> Option<JournalFault> {
        self.told().fault.clone()
    }

    fn told(&self) -> MutexGuard<'_, JournalStatus> {
        self.told.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes what is queued and closes the database. Where rounds cannot be written they go to a file beside it, and
    /// [`JournalError::Unwritten`] carries them too.
    pub fn finish(self) -> Result<JournalSummary, JournalError> {
        self.finish_with([])
    }

    /// The same with rounds that the queue had no room for.
    pub fn finish_with(
        mut self,
        rest: impl IntoIterator<Item = ShotRecord>,
    ) -> Result<JournalSummary, JournalError> {
        Pending::of(&self.pending).held.extend(rest);
        self.close()
    }

    fn close(&mut self) -> Result<JournalSummary, JournalError> {
        self.queue = None;
        self.open = None;
        let Some(thread) = self.thread.take() else { return Err(self.stopped()) };
        let ended = match self.await_end() {
            Ok(ended) => {
                // Nothing is left to do there.
                drop(thread.join());
                ended
            }
            Err(cause) => self.end_without_the_thread(cause),
        };
        match ended.unwritten {
            Some(unwritten) => {
                unwritten.log_rows();
                Err(JournalError::Unwritten(Box::new(unwritten)))
            }
            None => {
                Ok(JournalSummary { path: self.path.clone(), run: ended.run, committed: ended.committed })
            }
        }
    }

    /// Waits for the thread's end, as long as it gets on; else why it does not come.
    fn await_end(&self) -> Result<JournalEnd, &'static str> {
        loop {
            let before = self.told().committed;
            // The thread itself gives up at that time where the disk answers with failures.
            match self.ended.recv_timeout(self.end_within + Duration::from_millis(100)) {
                Ok(ended) => return Ok(ended),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err("the thread that writes it broke down; report it with the log");
                }
                Err(RecvTimeoutError::Timeout) if self.told().committed == before => {
                    return Err("the disk does not answer; check it");
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// The end where the thread does not come to it. A disk that does not answer would not take a file, either.
    fn end_without_the_thread(&self, cause: &str) -> JournalEnd {
        let mut records = Pending::of(&self.pending).unwritten();
        records.extend(self.queued.try_iter().filter_map(|message| match message {
            JournalMessage::Shot(shot) => Some(shot),
            JournalMessage::Event(event) => {
                log::error!("event not in the journal: {}", event.fact());
                None
            }
            JournalMessage::Tracks(number, _) => {
                log::error!("block {number} of the boats' tracks is not in the journal");
                None
            }
            JournalMessage::Clock(_) => None,
        }));
        let committed = self.told().committed;
        let row = |record| StoredShot::line(self.run, record);
        let unwritten = Unwritten {
            path: self.path.clone(),
            run: self.run,
            committed,
            cause: cause.to_owned(),
            in_doubt: 0,
            rows: records.into_iter().map(row).collect(),
            side_file: None,
        };
        JournalEnd { run: self.run, committed, unwritten: Some(unwritten) }
    }

    fn stopped(&self) -> JournalError {
        JournalError::Stopped { path: self.path.clone() }
    }
}

impl Drop for Journal {
    /// A journal that was not finished writes what it has all the same; only the log hears of failures.
    fn drop(&mut self) {
        if self.thread.is_some()
            && let Err(error) = self.close()
        {
            log::error!("{error}");
        }
    }
}

#[cfg(test)]
mod tests;
