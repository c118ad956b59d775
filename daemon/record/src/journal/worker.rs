//! The thread that writes.

use std::{
    collections::VecDeque,
    convert::Infallible,
    fs::OpenOptions,
    io::{self, Write},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use bowwave_core::score::ShotRecord;
use crossbeam_channel::{Receiver, Sender, TryRecvError, after, never, select};
use rusqlite::{Connection, ErrorCode, TransactionBehavior};

use super::{JournalError, JournalFault, Settings, StoredShot, Unwritten, open::with_suffix, row};

/// Most rounds in one transaction.
const BATCH: usize = 1024;

/// How long the database may be held by another process within one attempt.
const BUSY: Duration = Duration::from_millis(250);

/// Longest pause between attempts while the journal is being finished.
const FINISH_PAUSE_MAX: Duration = Duration::from_millis(500);

/// What the thread leaves.
pub(super) struct Ended {
    pub(super) committed: u64,
    pub(super) unwritten: Option<Unwritten>,
}

/// The state of the thread.
pub(super) struct Worker {
    connection: Connection,
    path: PathBuf,
    run: i64,
    incoming: Receiver<ShotRecord>,
    /// Disconnected once the journal is being finished. The queue cannot tell while it is full.
    closing: Receiver<Infallible>,
    commits: Sender<u64>,
    fault: Arc<Mutex<Option<JournalFault>>>,
    settings: Settings,
    /// Taken from the queue and not yet committed, oldest first.
    held: VecDeque<ShotRecord>,
    /// What the database refuses for good, with the reason.
    rejected: Vec<(ShotRecord, String)>,
    committed: u64,
    /// Failures since the last success.
    failures: u32,
}

/// The thread's ends of the journal's channels.
pub(super) struct Ends {
    pub(super) incoming: Receiver<ShotRecord>,
    pub(super) closing: Receiver<Infallible>,
    pub(super) commits: Sender<u64>,
    pub(super) fault: Arc<Mutex<Option<JournalFault>>>,
}

impl Worker {
    pub(super) fn new(connection: Connection, path: &Path, run: i64, ends: Ends, settings: Settings) -> Self {
        let Ends { incoming, closing, commits, fault } = ends;
        Self {
            connection,
            path: path.into(),
            run,
            incoming,
            closing,
            commits,
            fault,
            settings,
            held: VecDeque::new(),
            rejected: Vec::new(),
            committed: 0,
            failures: 0,
        }
    }

    pub(super) fn run(mut self) -> Ended {
        if let Err(error) = self.connection.busy_timeout(BUSY) {
            log::warn!("journal {}: {error}", self.path.display());
        }
        let mut cause = None;
        // Each attempt of the last phase counts afresh: the disk may have come back.
        let mut last_attempts = 0;
        loop {
            if self.held.is_empty() {
                match self.incoming.recv() {
                    Ok(shot) => self.held.push_back(shot),
                    Err(_) => break,
                }
            }
            self.take_queued();
            match self.commit() {
                Ok(()) => self.recovered(),
                Err(error) => {
                    let error = JournalError::from_sql(&self.path, &error);
                    last_attempts += u32::from(self.is_closing());
                    if last_attempts >= self.settings.finish_attempts {
                        cause = Some(error.to_string());
                        break;
                    }
                    self.failed(&error);
                    self.wait();
                }
            }
        }
        self.end(cause)
    }

    fn is_closing(&self) -> bool {
        self.closing.try_recv().is_err_and(|error: TryRecvError| error.is_disconnected())
    }

    /// Takes what is queued, as far as it may be held.
    fn take_queued(&mut self) {
        let room = self.settings.held_max.saturating_sub(self.held.len());
        self.held.extend(self.incoming.try_iter().take(room));
    }

    /// Commits the oldest rounds held, as many as one transaction takes.
    fn commit(&mut self) -> rusqlite::Result<()> {
        let count = self.held.len().min(BATCH);
        let mut refused = Vec::new();
        let transaction = self.connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
        for (index, shot) in self.held.iter().take(count).enumerate() {
            match row::insert(&transaction, self.run, shot) {
                Ok(true) => {}
                // There already: after a COMMIT that failed and took effect all the same, or a number used twice.
                Ok(false) if stored(&transaction, self.run, shot)? => {}
                Ok(false) => refused.push((index, "its number is taken by another shot".to_owned())),
                Err(error) if is_refusal(&error) => refused.push((index, error.to_string())),
                Err(error) => return Err(error),
            }
        }
        transaction.commit()?;
        let mut refused = refused.into_iter().peekable();
        for (index, shot) in self.held.drain(..count).enumerate() {
            if let Some((_, reason)) = refused.next_if(|(at, _)| *at == index) {
                log::error!("shot {} is not in the journal {}: {reason}", shot.shot, self.path.display());
                self.rejected.push((shot, reason));
                continue;
            }
            self.committed += 1;
            // Nobody may be listening.
            let _ = self.commits.send(shot.shot);
        }
        Ok(())
    }

    fn failed(&mut self, error: &JournalError) {
        self.failures = self.failures.saturating_add(1);
        if self.failures == 1 {
            let code = match error {
                JournalError::Full { .. } => "DISK_FULL",
                JournalError::ReadOnly { .. } => "DISK_RO",
                _ => "DISK_FSYNC",
            };
            log::error!("{code} {error}; shots are kept in memory until then");
        }
        self.tell(Some(JournalFault { message: error.to_string(), waiting: self.held.len() }));
    }

    fn recovered(&mut self) {
        if self.failures > 0 && self.held.is_empty() {
            log::info!(
                "the journal {} is written again after {} attempts",
                self.path.display(),
                self.failures
            );
            self.failures = 0;
            self.tell(None);
        }
    }

    fn tell(&self, fault: Option<JournalFault>) {
        *self.fault.lock().unwrap_or_else(PoisonError::into_inner) = fault;
    }

    /// Pauses before the next attempt and goes on emptying the queue meanwhile.
    fn wait(&mut self) {
        let doublings = self.failures.saturating_sub(1).min(16);
        let pause = self.settings.retry_first.saturating_mul(1 << doublings).min(self.settings.retry_max);
        if self.is_closing() {
            std::thread::sleep(pause.min(FINISH_PAUSE_MAX));
            return;
        }
        let timer = after(pause);
        loop {
            // What may not be held any more fills the queue up, and that says so to whoever shoots.
            let nothing = never();
            let incoming = if self.held.len() < self.settings.held_max { &self.incoming } else { &nothing };
            select! {
                recv(incoming) -> shot => match shot {
                    Ok(shot) => self.held.push_back(shot),
                    Err(_) => return,
                },
                recv(self.closing) -> _ => return,
                recv(timer) -> _ => return,
            }
        }
    }

    /// Closes the run, or saves what could not be written.
    fn end(mut self, cause: Option<String>) -> Ended {
        // After giving up, more than may be held can still be queued.
        self.held.extend(self.incoming.try_iter());
        if self.held.is_empty() && self.rejected.is_empty() {
            let sql = "UPDATE runs SET finished = 1 WHERE id = ?1";
            if let Err(error) = self.connection.execute(sql, [self.run]) {
                log::warn!(
                    "{}; its last run stays marked as unfinished",
                    JournalError::from_sql(&self.path, &error)
                );
            }
            return Ended { committed: self.committed, unwritten: None };
        }
        let cause =
            cause.or_else(|| self.rejected.first().map(|(_, reason)| reason.clone())).unwrap_or_default();
        let rows: Vec<String> = self
            .rejected
            .iter()
            .map(|(shot, _)| shot)
            .chain(&self.held)
            .map(|record| StoredShot { run: self.run, record: record.clone() }.to_json().to_string())
            .collect();
        let side_file = match save(&self.path, self.run, &rows) {
            Ok(file) => Some(file),
            Err(error) => {
                log::error!("nor could the shots be put beside the journal {}: {error}", self.path.display());
                None
            }
        };
        let unwritten =
            Unwritten { path: self.path, run: self.run, committed: self.committed, cause, rows, side_file };
        Ended { committed: self.committed, unwritten: Some(unwritten) }
    }
}

/// Whether this very round is in the database.
fn stored(connection: &Connection, run: i64, shot: &ShotRecord) -> rusqlite::Result<bool> {
    let sql = format!("SELECT {} FROM shots WHERE run = ?1 AND shot = ?2", row::COLUMNS);
    let (_, _, found) =
        connection.prepare_cached(&sql)?.query_row((run, shot.shot.cast_signed()), row::parse)?;
    // Compared as text: NaN is to equal NaN.
    Ok(found.is_ok_and(|record| {
        StoredShot { run, record }.to_json() == StoredShot { run, record: shot.clone() }.to_json()
    }))
}

/// Whether the database refuses the round itself: no other attempt will help.
fn is_refusal(error: &rusqlite::Error) -> bool {
    matches!(error, rusqlite::Error::ToSqlConversionFailure(_))
        || matches!(
            error.sqlite_error_code(),
            Some(ErrorCode::ConstraintViolation | ErrorCode::TooBig | ErrorCode::TypeMismatch)
        )
}

/// Puts the rows into a file beside the database, and onto the disk.
fn save(path: &Path, run: i64, rows: &[String]) -> io::Result<PathBuf> {
    let file_path = with_suffix(path, &format!(".unwritten-{run}.jsonl"));
    let mut file = OpenOptions::new().create(true).append(true).open(&file_path)?;
    let mut text = rows.join("\n");
    text.push('\n');
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    Ok(file_path)
}
