//! The journal of hits: an SQLite database that keeps every virtual round of every run.
//!
//! Written by a thread of its own from a bounded queue, one transaction for whatever is queued, in WAL mode with
//! `synchronous=FULL`: once a round's number comes out of [`Journal::commits`] it survives a crash and a power cut. While the
//! disk is full or gone, rounds are kept in memory and written as soon as it is back.

mod error;
mod open;
mod query;
mod row;
mod worker;

use std::{
    convert::Infallible,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    thread::JoinHandle,
    time::Duration,
};

use bowwave_core::score::ShotRecord;
use crossbeam_channel::{Receiver, Sender, TrySendError, bounded, unbounded};

pub use error::{JournalError, Unwritten};
pub use query::{RunSelection, ShotFilter, StoredRun, read_runs, read_shots};
pub use row::StoredShot;
use worker::{Ended, Ends, Worker};

/// Rounds that may wait for the writing thread before [`Journal::shot`] refuses: minutes of firing.
const QUEUE: usize = 4096;

/// What a run of the trainer was about.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Run {
    /// Wall time of its beginning, nanoseconds since 1970, where the clock is known to be set.
    pub started_wall_ns: Option<i64>,
    /// Name or file of the scenario.
    pub scenario: String,
    /// File of the recording; empty for live runs.
    pub recording: String,
    /// Seed of the session.
    pub seed: u64,
    /// Version of the program.
    pub version: String,
}

/// Why rounds wait in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JournalFault {
    /// What is wrong and what to do, one line.
    pub message: String,
    /// Rounds that wait.
    pub waiting: usize,
}

/// What a finished journal holds of its run.
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
struct Settings {
    /// Most pages of the database.
    pages_max: Option<u32>,
    /// Most rounds kept in memory while the database cannot be written.
    held_max: usize,
    /// First pause after a failure; doubles up to `retry_max`.
    retry_first: Duration,
    /// Longest pause.
    retry_max: Duration,
    /// Failures after which [`Journal::finish`] gives up.
    finish_attempts: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            pages_max: None,
            held_max: 100_000,
            retry_first: Duration::from_millis(50),
            retry_max: Duration::from_secs(5),
            finish_attempts: 6,
        }
    }
}

/// The journal of one run, open for writing.
pub struct Journal {
    path: PathBuf,
    run: i64,
    quarantined: Option<PathBuf>,
    queue: Option<Sender<ShotRecord>>,
    /// Never carries anything; its end tells the thread to finish.
    open: Option<Sender<Infallible>>,
    commits: Receiver<u64>,
    fault: Arc<Mutex<Option<JournalFault>>>,
    thread: Option<JoinHandle<Ended>>,
}

impl Journal {
    /// Opens or makes the database at `path` and begins a run in it. A damaged database is put aside under another name
    /// ([`Journal::quarantined`]) and a fresh one begun.
    pub fn open(path: &Path, run: &Run) -> Result<Self, JournalError> {
        Self::open_with(path, run, Settings::default())
    }

    fn open_with(path: &Path, run: &Run, settings: Settings) -> Result<Self, JournalError> {
        let opened = open::for_writing(path, settings.pages_max)?;
        let id = open::begin_run(&opened.connection, path, run)?;
        let (queue, incoming) = bounded(QUEUE);
        // Eight bytes a round, and rounds are bounded by belts: not worth losing an acknowledgement for.
        let (committed, commits) = unbounded();
        let (open, closing) = bounded(0);
        let fault = Arc::new(Mutex::new(None));
        let ends = Ends { incoming, closing, commits: committed, fault: Arc::clone(&fault) };
        let worker = Worker::new(opened.connection, path, id, ends, settings);
        let thread =
            std::thread::Builder::new().name("journal".to_owned()).spawn(move || worker.run()).map_err(
                |source| JournalError::File { path: path.into(), doing: "start the thread for", source },
            )?;
        Ok(Self {
            path: path.into(),
            run: id,
            quarantined: opened.quarantined,
            queue: Some(queue),
            open: Some(open),
            commits,
            fault,
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

    /// Where a damaged database was put, if there was one. Worth a line to the user.
    pub fn quarantined(&self) -> Option<&Path> {
        self.quarantined.as_deref()
    }

    /// Queues a round; never waits. [`JournalError::QueueFull`] means that the round was not taken and the caller still has
    /// it.
    pub fn shot(&self, shot: &ShotRecord) -> Result<(), JournalError> {
        let Some(queue) = &self.queue else { return Err(self.stopped()) };
        queue.try_send(shot.clone()).map_err(|error| match error {
            TrySendError::Full(shot) => JournalError::QueueFull { path: self.path.clone(), shot: shot.shot },
            TrySendError::Disconnected(_) => self.stopped(),
        })
    }

    /// Numbers of rounds, each once its transaction has been committed to the disk, and only then.
    pub const fn commits(&self) -> &Receiver<u64> {
        &self.commits
    }

    /// What keeps rounds from being written at present, if anything.
    pub fn fault(&self) -> Option<JournalFault> {
        self.fault.lock().unwrap_or_else(PoisonError::into_inner).clone()
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
