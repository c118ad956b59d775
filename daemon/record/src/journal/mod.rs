//! The journal of hits: an SQLite database that keeps every virtual round of every run.
//!
//! Written by a thread of its own from a bounded queue, one transaction for whatever is queued, in WAL mode with
//! `synchronous=FULL`: once a round's number comes out of [`Journal::commits`] it survives a crash and a power cut. While the
//! disk is full or gone, rounds are kept in memory and written as soon as it is back. After an fsync that failed nothing
//! since the last one that succeeded is taken for written; the database is opened anew and written again. A database that
//! turns out to be damaged is put aside at any time, and a fresh one goes on with this run's rounds.
//!
//! Files beside the database `hits.sqlite`: `-wal` and `-shm` are SQLite's, `.reserve` keeps space for when the disk is full,
//! `.corrupt-N` are damaged databases, `.making` and `.fresh` exist while one is put aside, `.unwritten-N.jsonl` has the
//! rounds of run N that the database never took.

mod boot;
mod error;
mod open;
mod quarantine;
mod query;
mod reserve;
mod row;
mod schema;
mod worker;

use std::{
    convert::Infallible,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread::JoinHandle,
    time::Duration,
};

use bowwave_core::{fault::Fault, time::Time, world::score::ShotRecord};
use crossbeam_channel::{Receiver, Sender, TrySendError, bounded, unbounded};

use boot::WallClock;
pub use boot::{DirtyEnd, DirtyRun, boot_id};
pub use error::{JournalError, Unwritten};
pub use query::{RunSelection, ShotFilter, StoredRun, read_runs, read_shots};
pub use row::StoredShot;
use worker::{JournalChannels, JournalEnd, JournalWorker};

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
}

impl JournalOptions {
    /// A reserve of this size keeps some 30,000 rounds.
    pub const RESERVE_BYTES: u64 = 8 << 20;
}

impl Default for JournalOptions {
    /// Without a reserve: for runs on a desk.
    fn default() -> Self {
        Self { reserve_bytes: 0, checkpoint_pages: 1000, own: false }
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

/// A damaged database that was put aside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quarantine {
    /// Where it is now.
    pub kept_as: PathBuf,
    /// How it is damaged.
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
    /// Failures after which [`Journal::finish`] gives up.
    finish_attempts: u32,
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
            finish_attempts: 6,
        }
    }
}

/// State that the thread reports.
#[derive(Debug, Default)]
struct JournalStatus {
    fault: Option<JournalFault>,
    quarantine: Option<Quarantine>,
}

/// Message to the thread.
#[derive(Debug)]
enum JournalMessage {
    Shot(ShotRecord),
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
    thread: Option<JoinHandle<JournalEnd>>,
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
        let opened = open::for_writing(path, &settings)?;
        let fail = |error: rusqlite::Error| JournalError::from_sql(path, &error);
        let previous = boot::last_dirty(&opened.connection, run.boot_id.as_deref()).map_err(fail)?;
        let id = schema::begin_run(&opened.connection, None, run).map_err(fail)?;
        let (queue, incoming) = bounded(QUEUE);
        // Eight bytes a round, and rounds are bounded by belts: not worth losing an acknowledgement for.
        let (committed, commits) = unbounded();
        let (open, closing) = bounded(0);
        let told = Arc::new(Mutex::new(JournalStatus { fault: None, quarantine: opened.quarantined }));
        let ends = JournalChannels { incoming, closing, commits: committed, told: Arc::clone(&told) };
        let worker = JournalWorker::new(opened.connection, path, (id, run.clone()), ends, settings);
        let thread =
            std::thread::Builder::new().name("journal".to_owned()).spawn(move || worker.run()).map_err(
                |source| JournalError::File { path: path.into(), doing: "start the thread for", source },
            )?;
        Ok(Self {
            path: path.into(),
            run: id,
            previous,
            queue: Some(queue),
            open: Some(open),
            commits,
            told,
            thread: Some(thread),
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

    /// Tells what the wall clock shows, nanoseconds since 1970, at a time since boot, once it is known to be set. All runs of
    /// this boot without a wall time get theirs. Never waits; where the queue is full, say it again later.
    pub fn set_wall_clock(&self, wall_ns: i64, at: Time) -> Result<(), JournalError> {
        self.send(JournalMessage::Clock(WallClock { wall_ns, at }), 0)
    }

    fn send(&self, message: JournalMessage, shot: u64) -> Result<(), JournalError> {
        let Some(queue) = &self.queue else { return Err(self.stopped()) };
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
    pub fn finish(mut self) -> Result<JournalSummary, JournalError> {
        self.close()
    }

    fn close(&mut self) -> Result<JournalSummary, JournalError> {
        self.queue = None;
        self.open = None;
        let Some(thread) = self.thread.take() else { return Err(self.stopped()) };
        let ended = thread.join().map_err(|_| self.stopped())?;
        match ended.unwritten {
            Some(unwritten) => Err(JournalError::Unwritten(Box::new(unwritten))),
            None => Ok(JournalSummary { path: self.path.clone(), run: self.run, committed: ended.committed }),
        }
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
            if let JournalError::Unwritten(unwritten) = error {
                for line in unwritten.rows.iter().filter(|_| unwritten.side_file.is_none()) {
                    log::error!("not in the journal: {line}");
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
