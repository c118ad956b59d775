//! The thread that writes.

use std::{
    collections::VecDeque,
    convert::Infallible,
    io,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use bowwave_core::{fault::Fault, world::score::ShotRecord};
use crossbeam_channel::{Receiver, Sender, TryRecvError, after, at, never, select};
use rusqlite::{Connection, TransactionBehavior};

use super::{
    JournalError, JournalFault, JournalMessage, JournalSettings, JournalStatus, Quarantine, Run, StoredShot,
    Unwritten, aside,
    boot::WallClock,
    debrief::DebriefRows,
    open::{connect, empty_log_at_end, keep_log},
    place::FilePlace,
    quarantine,
    reserve::Reserve,
    row, schema,
    track::NumberedBlock,
};

/// Most rounds in one transaction.
const BATCH: usize = 1024;

/// How long the database may be held by another process within one attempt.
const BUSY: Duration = Duration::from_millis(250);

/// How often a reserve that was given up is tried again.
const RESERVE_PAUSE: Duration = Duration::from_secs(2);

/// Longest pause between attempts while the journal is being finished.
const FINISH_PAUSE_MAX: Duration = Duration::from_millis(100);

/// Result of the thread.
pub(super) struct JournalEnd {
    /// The run's number in the database.
    pub(super) run: i64,
    pub(super) committed: u64,
    pub(super) unwritten: Option<Unwritten>,
}

/// Rounds that the thread has taken and the database has not.
#[derive(Debug, Default)]
pub(super) struct Pending {
    /// To be written, oldest first.
    pub(super) held: VecDeque<ShotRecord>,
    /// Refused by the database for good, with the reason.
    rejected: Vec<(ShotRecord, String)>,
}

impl Pending {
    /// Nothing that panics is done under the lock.
    pub(super) fn of(pending: &Mutex<Self>) -> MutexGuard<'_, Self> {
        pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// All of them.
    pub(super) fn unwritten(&self) -> Vec<ShotRecord> {
        self.rejected.iter().map(|(shot, _)| shot).chain(&self.held).cloned().collect()
    }
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
    /// When the reserve that was given up is tried again, however much comes meanwhile.
    refill_at: Instant,
    /// Taken from the queue and not yet committed.
    pending: Arc<Mutex<Pending>>,
    /// The files that `connection` has open, or had.
    place: FilePlace,
    /// Committed rounds of this run may be missing in the database.
    in_doubt: bool,
    /// The file beside the database that has what is not written, once the end has met a failure.
    side_file: Option<PathBuf>,
    /// Committed rounds of this run, oldest first, for a fresh database.
    kept: VecDeque<ShotRecord>,
    /// Events of the exercise and tracks.
    debrief: DebriefRows,
    /// Committed rounds that are too many to be kept.
    not_kept: u64,
    /// Wall time to be filled in.
    clock: Option<WallClock>,
    /// Damage of the database, until it has been put aside.
    damage: Option<String>,
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
    pub(super) pending: Arc<Mutex<Pending>>,
}

impl JournalWorker {
    pub(super) fn new(
        (connection, place): (Connection, FilePlace),
        path: &Path,
        (id, run): (i64, Run),
        ends: JournalChannels,
        settings: JournalSettings,
    ) -> Self {
        let JournalChannels { incoming, closing, commits, told, pending } = ends;
        Self {
            place,
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
            refill_at: Instant::now(),
            pending,
            in_doubt: false,
            side_file: None,
            kept: VecDeque::new(),
            debrief: DebriefRows::new(settings.held_max, settings.kept_max),
            not_kept: 0,
            clock: None,
            damage: None,
            committed: 0,
            failures: 0,
        }
    }

    pub(super) fn run(mut self) -> JournalEnd {
        self.settings.busy = BUSY;
        if let Some(connection) = &self.connection
            && let Err(error) = connection.busy_timeout(BUSY)
        {
            log::warn!("journal {}: {error}", self.path.display());
        }
        self.refill_reserve();
        let mut cause = None;
        let mut deadline = None;
        loop {
            // What the queue had no room for may come with the end.
            let ends = self.is_idle() && !self.next() && self.is_idle();
            self.take_queued();
            let done = if ends { self.close_run() } else { self.attempt() };
            match done {
                Ok(()) if ends => break,
                Ok(()) => self.recovered(),
                Err(error) => {
                    if self.is_closing() {
                        let end = self.settings.options.end_within;
                        let deadline = *deadline.get_or_insert_with(|| Instant::now() + end);
                        // First of all: whoever ended the program may not wait.
                        self.put_aside();
                        if Instant::now() + self.pause() >= deadline {
                            cause = Some(error.to_string());
                            break;
                        }
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
        self.held().held.is_empty()
            && self.debrief.is_empty()
            && self.clock.is_none()
            && self.failures == 0
            && !self.in_doubt
    }

    /// Waits for something to do; `false` at the end.
    fn next(&mut self) -> bool {
        let tick = if self.low { at(self.refill_at) } else { never() };
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
            JournalMessage::Shot(shot) => self.held().held.push_back(shot),
            JournalMessage::Event(event) => self.debrief.take_event(event),
            JournalMessage::Tracks(number, block) => {
                self.debrief.take_block(NumberedBlock::new(number, &block), self.low);
            }
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

    fn held(&self) -> MutexGuard<'_, Pending> {
        Pending::of(&self.pending)
    }

    fn is_closing(&self) -> bool {
        self.closing.try_recv().is_err_and(|error: TryRecvError| error.is_disconnected())
    }

    /// Takes what is queued, as far as it may be held.
    fn take_queued(&mut self) {
        while self.held().held.len() < self.settings.held_max
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
        let done = self.write(&mut connection);
        match &done {
            Ok(()) | Err(JournalError::Locked { .. }) => self.connection = Some(connection),
            Err(error) => {
                if error.is_damage() {
                    self.damage = Some(error.to_string());
                }
                self.doubt(error);
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

    fn reopen(&mut self) -> Result<Connection, JournalError> {
        let (connection, place) = connect(&self.path, &self.settings)?;
        self.place = place;
        Ok(connection)
    }

    fn write(&mut self, connection: &mut Connection) -> Result<(), JournalError> {
        let path = self.path.clone();
        let fail = |error: rusqlite::Error| JournalError::from_sql(&path, &error);
        if self.in_doubt {
            self.insert_kept(connection).map_err(fail)?;
            self.is_in_place()?;
            self.in_doubt = false;
        }
        if !self.held().held.is_empty() {
            self.commit(connection)?;
        }
        if !self.debrief.is_empty() {
            self.debrief.commit(connection, self.id).map_err(fail)?;
        }
        if let Some(clock) = self.clock {
            if let Some(boot_id) = &self.run.boot_id {
                clock.fill_in(connection, boot_id).map_err(fail)?;
            }
            self.clock = None;
        }
        checkpoint(connection, self.settings.options.checkpoint_pages).map_err(fail)
    }

    /// Whether whoever opens the journal finds the files that were written.
    fn is_in_place(&self) -> Result<(), JournalError> {
        if FilePlace::of(&self.path).is_ok_and(|found| found == self.place) {
            return Ok(());
        }
        Err(JournalError::Moved { path: self.path.clone() })
    }

    /// Rounds that were committed may be missing after that failure.
    fn doubt(&mut self, error: &JournalError) {
        self.in_doubt |= error.casts_doubt();
        if matches!(error, JournalError::Moved { .. }) {
            let (reason, rounds_left_there) = (error.to_string(), self.not_kept);
            log::error!("{reason}");
            let quarantine = Quarantine { kept_as: None, reason, rounds_left_there };
            self.tell(|told| told.quarantine = Some(quarantine));
        }
    }

    /// Inserts what is missing of this run's committed rounds, and the run.
    fn insert_kept(&mut self, connection: &mut Connection) -> rusqlite::Result<()> {
        let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
        let id = aside::run_for(&transaction, self.id, Some(&self.run))?;
        for shot in &self.kept {
            if let Err(why) = row::insert_once(&transaction, id, shot)? {
                log::error!("shot {} is not in the journal {}: {why}", shot.shot, self.path.display());
            }
        }
        self.debrief.insert_kept(&transaction, id)?;
        transaction.commit()?;
        self.debrief.write_blocks_again();
        self.id = id;
        Ok(())
    }

    /// Puts the damaged database aside and begins another with what is known of this run.
    fn start_afresh(&mut self, reason: &str) -> Result<(), JournalError> {
        self.connection = None;
        let Self { path, settings, id, run, kept, debrief, .. } = self;
        let kept_as = quarantine::replace(path, settings, |connection| {
            let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
            schema::begin_run(&transaction, Some(*id), run)?;
            for shot in kept.iter() {
                // Taken before, so never refused.
                row::insert_once(&transaction, *id, shot)?.unwrap_or_default();
            }
            debrief.insert_kept(&transaction, *id)?;
            transaction.commit()
        })?;
        self.debrief.write_blocks_again();
        self.damage = None;
        self.in_doubt = false;
        let rounds_left_there = self.not_kept;
        self.tell(|told| {
            told.quarantine =
                Some(Quarantine { kept_as: Some(kept_as), reason: reason.to_owned(), rounds_left_there });
        });
        Ok(())
    }

    /// Commits the oldest rounds held, as many as one transaction takes.
    fn commit(&mut self, connection: &mut Connection) -> Result<(), JournalError> {
        let batch: Vec<ShotRecord> = self.held().held.iter().take(BATCH).cloned().collect();
        let insert = |connection: &mut Connection| -> rusqlite::Result<Vec<Result<(), String>>> {
            let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
            let done = batch.iter().map(|shot| row::insert_once(&transaction, self.id, shot));
            let done = done.collect::<rusqlite::Result<_>>()?;
            transaction.commit()?;
            Ok(done)
        };
        let done = insert(connection).map_err(|error| JournalError::from_sql(&self.path, &error))?;
        self.is_in_place()?;
        for (shot, done) in batch.into_iter().zip(done) {
            let mut pending = Pending::of(&self.pending);
            pending.held.pop_front();
            if let Err(reason) = done {
                log::error!("shot {} is not in the journal {}: {reason}", shot.shot, self.path.display());
                pending.rejected.push((shot, reason));
                continue;
            }
            drop(pending);
            self.committed += 1;
            // Nobody may be listening.
            let _ = self.commits.send(shot.shot);
            self.kept.push_back(shot);
        }
        let committed = self.committed;
        self.tell(|told| told.committed = committed);
        while self.kept.len() > self.settings.kept_max {
            self.kept.pop_front();
            self.not_kept += 1;
        }
        Ok(())
    }

    fn failed(&mut self, error: &JournalError) {
        self.failures = self.failures.saturating_add(1);
        let waiting = self.held().held.len();
        let fault = JournalFault { fault: error.fault(), message: error.to_string(), waiting };
        self.tell(|told| told.fault = Some(fault));
    }

    fn recovered(&mut self) {
        let over = self.failures > 0 && self.held().held.is_empty() && self.debrief.is_empty();
        if over {
            self.failures = 0;
        }
        if over || self.low {
            self.tell_space();
        }
    }

    /// Makes the reserve where there is room for it.
    fn refill_reserve(&mut self) {
        self.refill_at = Instant::now() + RESERVE_PAUSE;
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

    /// Pause before the next attempt.
    fn pause(&self) -> Duration {
        let doublings = self.failures.saturating_sub(1).min(16);
        let pause = self.settings.retry_first.saturating_mul(1 << doublings).min(self.settings.retry_max);
        if self.is_closing() { pause.min(FINISH_PAUSE_MAX) } else { pause }
    }

    /// Pauses before the next attempt and goes on emptying the queue meanwhile.
    fn wait(&mut self) {
        let pause = self.pause();
        if self.is_closing() {
            std::thread::sleep(pause);
            return;
        }
        let timer = after(pause);
        loop {
            // What may not be held any more fills the queue up, and that says so to whoever shoots.
            let nothing = never();
            let incoming =
                if self.held().held.len() < self.settings.held_max { &self.incoming } else { &nothing };
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

    /// Takes all that is queued; more than may be held.
    fn take_all(&mut self) {
        while let Ok(message) = self.incoming.try_recv() {
            self.take(message);
        }
    }

    /// Rounds that the database does not have for sure: those in doubt first, and how many those are.
    fn unwritten(&self) -> (Vec<String>, usize) {
        let doubted = if self.in_doubt { self.kept.len() } else { 0 };
        let pending = self.held().unwritten();
        let row = |record: &ShotRecord| StoredShot::line(self.id, record.clone());
        (self.kept.iter().take(doubted).chain(&pending).map(row).collect(), doubted)
    }

    /// Puts what is not written beside the database, once: the end may be cut short.
    fn put_aside(&mut self) {
        if self.side_file.is_none() {
            self.take_all();
            let (rows, _) = self.unwritten();
            self.side_file = aside::save_or_tell(&self.path, (self.id, &self.run), None, &rows);
        }
    }

    /// Closes the run, or saves what could not be written.
    fn end(mut self, cause: Option<String>) -> JournalEnd {
        self.take_all();
        self.debrief.tell_unwritten();
        let (rows, in_doubt) = self.unwritten();
        if rows.is_empty() {
            if let Some(file) = &self.side_file
                && let Err(error) = aside::remove(&self.path, file)
            {
                log::warn!("{} has rounds that are in the journal, and stays: {error}", file.display());
            }
            return JournalEnd { run: self.id, committed: self.committed, unwritten: None };
        }
        if let Some(connection) = &self.connection {
            empty_log_at_end(connection);
        }
        let refused = self.held().rejected.first().map(|(_, reason)| reason.clone());
        let cause = cause.or(refused).unwrap_or_default();
        // Anew: some of what was put aside may have been written since.
        let side_file =
            aside::save_or_tell(&self.path, (self.id, &self.run), self.side_file.as_deref(), &rows)
                .or(self.side_file);
        let Self { id: run, committed, path, .. } = self;
        let unwritten = Unwritten { path, run, committed, cause, in_doubt, rows, side_file };
        JournalEnd { run, committed, unwritten: Some(unwritten) }
    }

    /// Marks the run as finished, moves the log into the database and closes it.
    ///
    /// # Errors
    /// Rounds are to be written again, since the disk failed or the files were moved away meanwhile.
    fn close_run(&mut self) -> Result<(), JournalError> {
        let done = self.try_close_run();
        // Closed: nothing is written any more, so that what is found now is found later.
        let is_there = self.committed == 0 || self.place.has_database(&self.path);
        let moved = || JournalError::Moved { path: self.path.clone() };
        let done = done.and_then(|()| if is_there { Ok(()) } else { Err(moved()) });
        match done {
            Err(error) if self.committed > 0 && error.casts_doubt() => {
                self.doubt(&error);
                return Err(error);
            }
            Err(error) => log::warn!("{error}; its last run stays marked as unfinished"),
            Ok(()) => {}
        }
        Ok(())
    }

    fn try_close_run(&mut self) -> Result<(), JournalError> {
        let connection = match self.connection.take() {
            Some(connection) => connection,
            None => self.reopen()?,
        };
        let close = || -> rusqlite::Result<()> {
            connection.execute("UPDATE runs SET finished = 1 WHERE id = ?1", [self.id])?;
            checkpoint(&connection, 1)
        };
        close().map_err(|error| {
            keep_log(&connection);
            JournalError::from_sql(&self.path, &error)
        })?;
        empty_log_at_end(&connection);
        Ok(())
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
