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

use bowwave_core::{fault::Fault, world::score::ShotRecord};
use crossbeam_channel::{Receiver, Sender, TryRecvError, after, never, select};
use rusqlite::{Connection, ErrorCode, TransactionBehavior};

use super::{
    JournalError, JournalFault, JournalMessage, JournalSettings, JournalStatus, Quarantine, Run, StoredShot,
    Unwritten,
    boot::WallClock,
    open::{connect, empty_log_at_end, keep_log, with_suffix},
    quarantine,
    reserve::Reserve,
    row, schema,
};

/// Most rounds in one transaction.
const BATCH: usize = 1024;

/// How long the database may be held by another process within one attempt.
const BUSY: Duration = Duration::from_millis(250);

/// How often a reserve that was given up is tried again.
const RESERVE_PAUSE: Duration = Duration::from_secs(2);

/// Longest pause between attempts while the journal is being finished.
const FINISH_PAUSE_MAX: Duration = Duration::from_millis(500);

/// Result of the thread.
pub(super) struct JournalEnd {
    pub(super) committed: u64,
    pub(super) unwritten: Option<Unwritten>,
}

/// The state of the thread.
pub(super) struct JournalWorker {
    /// `None` after a failure that leaves in doubt what it would read: it is opened anew.
    connection: Option<Connection>,
    path: PathBuf,
    id: i64,
    run: Run,
    incoming: Receiver<JournalMessage>,
    /// Disconnected once the journal is being finished. The queue cannot tell while it is full.
    closing: Receiver<Infallible>,
    commits: Sender<u64>,
    told: Arc<Mutex<JournalStatus>>,
    settings: JournalSettings,
    reserve: Reserve,
    /// The reserve is not there: the disk is full, or was and has not got room enough yet.
    low: bool,
    /// Taken from the queue and not yet committed, oldest first.
    held: VecDeque<ShotRecord>,
    /// Committed rounds of this run, oldest first, for a fresh database.
    kept: VecDeque<ShotRecord>,
    /// Committed rounds that are too many to be kept.
    not_kept: u64,
    /// Wall time to be filled in.
    clock: Option<WallClock>,
    /// Damage of the database, until it has been put aside.
    damage: Option<String>,
    /// Rounds that the database refuses for good, with the reason.
    rejected: Vec<(ShotRecord, String)>,
    committed: u64,
    /// Failures since the last success.
    failures: u32,
}

/// The thread's ends of the journal's channels.
pub(super) struct JournalChannels {
    pub(super) incoming: Receiver<JournalMessage>,
    pub(super) closing: Receiver<Infallible>,
    pub(super) commits: Sender<u64>,
    pub(super) told: Arc<Mutex<JournalStatus>>,
}

impl JournalWorker {
    pub(super) fn new(
        connection: Connection,
        path: &Path,
        (id, run): (i64, Run),
        ends: JournalChannels,
        settings: JournalSettings,
    ) -> Self {
        let JournalChannels { incoming, closing, commits, told } = ends;
        Self {
            connection: Some(connection),
            path: path.into(),
            id,
            run,
            incoming,
            closing,
            commits,
            told,
            settings,
            reserve: Reserve::new(path, settings.options.reserve_bytes),
            low: false,
            held: VecDeque::new(),
            kept: VecDeque::new(),
            not_kept: 0,
            clock: None,
            damage: None,
            rejected: Vec::new(),
            committed: 0,
            failures: 0,
        }
    }

    pub(super) fn run(mut self) -> JournalEnd {
        if let Some(connection) = &self.connection {
            be_patient(connection, &self.path);
        }
        self.refill_reserve();
        let mut cause = None;
        // Each attempt of the last phase counts afresh: the disk may have come back.
        let mut last_attempts = 0;
        loop {
            if self.is_idle() && !self.next() {
                break;
            }
            self.take_queued();
            match self.attempt() {
                Ok(()) => self.recovered(),
                Err(error) => {
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

    /// Nothing is to be written.
    fn is_idle(&self) -> bool {
        self.held.is_empty() && self.clock.is_none() && self.failures == 0
    }

    /// Waits for something to do; `false` at the end.
    fn next(&mut self) -> bool {
        let tick = if self.low { after(RESERVE_PAUSE) } else { never() };
        select! {
            recv(self.incoming) -> message => match message {
                Ok(message) => self.take(message),
                Err(_) => return false,
            },
            recv(tick) -> _ => self.refill_reserve(),
        }
        true
    }

    fn take(&mut self, message: JournalMessage) {
        match message {
            JournalMessage::Shot(shot) => self.held.push_back(shot),
            JournalMessage::Clock(clock) => {
                // A fresh database would begin this run with it.
                self.run.started_wall_ns = self
                    .run
                    .started_wall_ns
                    .or_else(|| self.run.started.and_then(|started| clock.wall_ns(started)));
                self.clock = Some(clock);
            }
        }
    }

    fn is_closing(&self) -> bool {
        self.closing.try_recv().is_err_and(|error: TryRecvError| error.is_disconnected())
    }

    /// Takes what is queued, as far as it may be held.
    fn take_queued(&mut self) {
        while self.held.len() < self.settings.held_max
            && let Ok(message) = self.incoming.try_recv()
        {
            self.take(message);
        }
    }

    /// Writes the oldest rounds held, and sees to the database as far as it needs it.
    fn attempt(&mut self) -> Result<(), JournalError> {
        if let Some(reason) = self.damage.clone() {
            self.start_afresh(&reason)?;
        }
        let mut connection = match self.connection.take() {
            Some(connection) => connection,
            None => self.reopen()?,
        };
        let done = self.write(&mut connection).map_err(|error| JournalError::from_sql(&self.path, &error));
        match &done {
            Ok(()) | Err(JournalError::Locked { .. }) => self.connection = Some(connection),
            Err(error) => {
                if error.is_damage() {
                    self.damage = Some(error.to_string());
                }
                // What this connection and the system's memory hold is not to be trusted any more.
                keep_log(&connection);
                drop(connection);
                if matches!(error, JournalError::Full { .. }) {
                    self.low = true;
                    // Straight on: this is what the space was kept for.
                    if self.reserve.release() {
                        return Ok(());
                    }
                }
            }
        }
        done
    }

    fn reopen(&self) -> Result<Connection, JournalError> {
        let connection = connect(&self.path, &self.settings)?;
        be_patient(&connection, &self.path);
        Ok(connection)
    }

    fn write(&mut self, connection: &mut Connection) -> rusqlite::Result<()> {
        if !self.held.is_empty() {
            self.commit(connection)?;
        }
        if let Some(clock) = self.clock {
            if let Some(boot_id) = &self.run.boot_id {
                clock.fill_in(connection, boot_id)?;
            }
            self.clock = None;
        }
        checkpoint(connection, self.settings.options.checkpoint_pages)
    }

    /// Puts the damaged database aside and begins another with what is known of this run.
    fn start_afresh(&mut self, reason: &str) -> Result<(), JournalError> {
        self.connection = None;
        let Self { path, settings, id, run, kept, .. } = self;
        let kept_as = quarantine::replace(path, settings, |connection| {
            let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
            schema::begin_run(&transaction, Some(*id), run)?;
            for shot in kept.iter() {
                row::insert(&transaction, *id, shot)?;
            }
            transaction.commit()
        })?;
        self.damage = None;
        let rounds_left_there = self.not_kept;
        self.tell(|told| {
            told.quarantine = Some(Quarantine { kept_as, reason: reason.to_owned(), rounds_left_there });
        });
        Ok(())
    }

    /// Commits the oldest rounds held, as many as one transaction takes.
    fn commit(&mut self, connection: &mut Connection) -> rusqlite::Result<()> {
        let count = self.held.len().min(BATCH);
        let mut refused = Vec::new();
        let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
        for (index, shot) in self.held.iter().take(count).enumerate() {
            match row::insert(&transaction, self.id, shot) {
                Ok(true) => {}
                // There already: after a COMMIT that failed and took effect all the same, or a number used twice.
                Ok(false) if stored(&transaction, self.id, shot)? => {}
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
            self.kept.push_back(shot);
        }
        while self.kept.len() > self.settings.kept_max {
            self.kept.pop_front();
            self.not_kept += 1;
        }
        Ok(())
    }

    fn failed(&mut self, error: &JournalError) {
        self.failures = self.failures.saturating_add(1);
        let fault =
            JournalFault { fault: error.fault(), message: error.to_string(), waiting: self.held.len() };
        self.tell(|told| told.fault = Some(fault));
    }

    fn recovered(&mut self) {
        let over = self.failures > 0 && self.held.is_empty();
        if over {
            self.failures = 0;
        }
        if over || self.low {
            self.tell_space();
        }
    }

    /// Makes the reserve where there is room for it.
    fn refill_reserve(&mut self) {
        let made = self.reserve.make();
        if let Err(error) = &made {
            log::debug!("no space kept for the journal {}: {error}", self.path.display());
        }
        // What is no lack of space will show when rounds are written.
        self.low = made.is_err_and(|error| error.kind() == io::ErrorKind::StorageFull);
        if self.failures == 0 {
            self.tell_space();
        }
    }

    /// No fault, or that of a disk which is full but for the space that was kept.
    fn tell_space(&self) {
        let fault = self.low.then(|| JournalFault {
            fault: Fault::DiskFull,
            message: format!("{}; shots are still written", JournalError::Full { path: self.path.clone() }),
            waiting: 0,
        });
        self.tell(|told| told.fault = fault);
    }

    fn tell(&self, change: impl FnOnce(&mut JournalStatus)) {
        change(&mut self.told.lock().unwrap_or_else(PoisonError::into_inner));
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
                recv(incoming) -> message => match message {
                    Ok(message) => self.take(message),
                    Err(_) => return,
                },
                recv(self.closing) -> _ => return,
                recv(timer) -> _ => return,
            }
        }
    }

    /// Closes the run, or saves what could not be written.
    fn end(mut self, cause: Option<String>) -> JournalEnd {
        // After giving up, more than may be held can still be queued.
        while let Ok(message) = self.incoming.try_recv() {
            self.take(message);
        }
        if self.held.is_empty() && self.rejected.is_empty() {
            if let Err(error) = self.close_run() {
                log::warn!("{error}; its last run stays marked as unfinished");
            }
            return JournalEnd { committed: self.committed, unwritten: None };
        }
        if let Some(connection) = &self.connection {
            empty_log_at_end(connection);
        }
        let cause =
            cause.or_else(|| self.rejected.first().map(|(_, reason)| reason.clone())).unwrap_or_default();
        let rows: Vec<String> = self
            .rejected
            .iter()
            .map(|(shot, _)| shot)
            .chain(&self.held)
            .map(|record| StoredShot { run: self.id, record: record.clone() }.to_json().to_string())
            .collect();
        let side_file = match save(&self.path, self.id, &rows) {
            Ok(file) => Some(file),
            Err(error) => {
                log::error!("nor could the shots be put beside the journal {}: {error}", self.path.display());
                None
            }
        };
        let unwritten =
            Unwritten { path: self.path, run: self.id, committed: self.committed, cause, rows, side_file };
        JournalEnd { committed: self.committed, unwritten: Some(unwritten) }
    }

    /// Marks the run as finished and moves the log into the database.
    fn close_run(&mut self) -> Result<(), JournalError> {
        let connection = match self.connection.take() {
            Some(connection) => connection,
            None => self.reopen()?,
        };
        let close = || -> rusqlite::Result<()> {
            connection.execute("UPDATE runs SET finished = 1 WHERE id = ?1", [self.id])?;
            checkpoint(&connection, 1)
        };
        close().map_err(|error| JournalError::from_sql(&self.path, &error))?;
        empty_log_at_end(&connection);
        Ok(())
    }
}

fn be_patient(connection: &Connection, path: &Path) {
    if let Err(error) = connection.busy_timeout(BUSY) {
        log::warn!("journal {}: {error}", path.display());
    }
}

/// Moves the log into the database where it has at least so many pages that are not there yet.
fn checkpoint(connection: &Connection, pages_min: u32) -> rusqlite::Result<()> {
    let mut ask = connection.prepare_cached("PRAGMA wal_checkpoint(NOOP)")?;
    let waiting: i64 = ask.query_row([], |row| Ok(row.get::<_, i64>(1)? - row.get::<_, i64>(2)?))?;
    if waiting < i64::from(pages_min) {
        return Ok(());
    }
    // Readers may keep some of it in the log: then it is moved later.
    connection.query_row("PRAGMA wal_checkpoint(PASSIVE)", [], |_| Ok(()))
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
