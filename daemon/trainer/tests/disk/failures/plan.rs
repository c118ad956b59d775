//! Trouble as the layer makes it.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::mpsc::{RecvTimeoutError, Sender, channel},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use nix::{errno::Errno, sys::signal::Signal};
use rusqlite::{Connection, OpenFlags, config::DbConfig};

use super::cases::{Case, DiskFailure, End, Lasting, Meddling, Trouble};
use crate::{
    layer::{Call, FolderFiles, Plan, Verdict},
    shoot,
    step::Step,
};

/// Calls that a failure lasts where it does not last for ever.
const SOME: usize = 25;
/// How long a lock is held where it is not held for ever.
const LOCKED: Duration = Duration::from_millis(100);
/// While a call takes five seconds a program is ended so often this much later.
const SLOW_STEP: Duration = Duration::from_millis(60);
/// Between two attempts to lock the database: whoever tries all the time keeps others from making it.
const LOCK_PAUSE: Duration = Duration::from_millis(1);
/// Calls for which a file system that has given up says nothing.
const SILENT: usize = 8;
/// In front of the names of files that are moved.
pub const MOVED: &str = "moved-";
/// What is put in the database's place.
const FOREIGN: &[u8] = b"Minutes of the meeting: somebody has saved a text under this name.\n";

/// What goes wrong in one run; nothing without a case.
pub struct TroublePlan {
    case: Option<Case>,
    folder: PathBuf,
    begun: Option<Instant>,
    has_refused: bool,
    has_signalled: bool,
    locker: Option<Locker>,
}

/// Somebody who locks the database, in a thread: SQLite may wait for the program that is traced meanwhile.
struct Locker {
    /// Its end lets the database go.
    wanted: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Locker {
    fn start(path: PathBuf, lasting: Lasting) -> Self {
        let (wanted, ends) = channel();
        let thread = thread::spawn(move || {
            let mut held: Option<(Connection, Instant)> = None;
            while ends.recv_timeout(LOCK_PAUSE) == Err(RecvTimeoutError::Timeout) {
                match &held {
                    None => held = lock(&path).ok().map(|connection| (connection, Instant::now())),
                    Some((_, since)) if lasting == Lasting::Some && since.elapsed() > LOCKED => break,
                    Some(_) => {}
                }
            }
        });
        Self { wanted: Some(wanted), thread: Some(thread) }
    }
}

impl Drop for Locker {
    fn drop(&mut self) {
        self.wanted = None;
        self.thread.take().unwrap().join().unwrap();
    }
}

impl TroublePlan {
    pub fn new(folder: &Path, case: Option<Case>) -> Self {
        let folder = folder.to_path_buf();
        Self { case, folder, begun: None, has_refused: false, has_signalled: false, locker: None }
    }

    fn meddle(&mut self, meddling: Meddling, lasting: Lasting, files: &mut FolderFiles) {
        let names = [shoot::NAME.to_owned(), format!("{}-wal", shoot::NAME)];
        let path = |name: &str| self.folder.join(name);
        match meddling {
            Meddling::Locked => {
                self.locker = Some(Locker::start(path(&names[0]), lasting));
                return;
            }
            Meddling::Moved => {
                for name in &names {
                    let to = format!("{MOVED}{name}");
                    // What is not there yet is not moved.
                    let _ = fs::rename(path(name), path(&to));
                    files.rename(name, &to);
                }
            }
            Meddling::Deleted | Meddling::Replaced => {
                for name in &names {
                    let _ = fs::remove_file(path(name));
                    files.remove(name);
                }
            }
        }
        let _ = fs::remove_file(path(&format!("{}-shm", shoot::NAME)));
        if meddling == Meddling::Replaced {
            fs::write(path(&names[0]), FOREIGN).unwrap();
            let file = files.create(&names[0]);
            files.steps.push(Step::Write { file, offset: 0, bytes: FOREIGN.to_vec() });
            files.steps.push(Step::Sync { file });
        }
        // Whoever did it left the disk time.
        files.steps.push(Step::SyncFolder);
    }

    /// What the disk says to a call so long after it began to fail.
    fn failure(failure: DiskFailure, since: usize, call: &Call, files: &FolderFiles) -> Verdict {
        let makes_one = matches!(call, Call::Open { name, makes: true, .. } if !files.has(name));
        let changes = match call {
            Call::Write { .. } | Call::Resize { .. } | Call::Remove { .. } | Call::Rename { .. } => true,
            Call::Open { writes, .. } => *writes || makes_one,
            Call::Read | Call::Sync | Call::OpenFolder => false,
        };
        match failure {
            DiskFailure::Full => match call {
                Call::Write { .. } | Call::Resize { length: 1.. } => Verdict::Refuse(Errno::ENOSPC),
                Call::Open { .. } if makes_one => Verdict::Refuse(Errno::ENOSPC),
                _ => Verdict::Pass,
            },
            DiskFailure::InputOutput => Verdict::Refuse(Errno::EIO),
            DiskFailure::Abort if *call == Call::Sync => Verdict::Pretend,
            DiskFailure::Abort if since < SILENT => Verdict::Pass,
            DiskFailure::ReadOnly | DiskFailure::Abort if changes => Verdict::Refuse(Errno::EROFS),
            DiskFailure::Slow if since == 0 => Verdict::Wait(Duration::from_secs(5)),
            DiskFailure::ReadOnly | DiskFailure::Abort | DiskFailure::Slow => Verdict::Pass,
        }
    }
}

impl Plan for TroublePlan {
    fn verdict(&mut self, number: usize, call: &Call, files: &mut FolderFiles) -> Verdict {
        let Some(case) = self.case.filter(|case| number >= case.at) else { return Verdict::Pass };
        let since = number - case.at;
        if since == 0 {
            self.begun = Some(Instant::now());
            files.steps.push(Step::Trouble);
        }
        match case.trouble {
            Trouble::Meddling(meddling, lasting) => {
                if since == 0 {
                    self.meddle(meddling, lasting, files);
                }
                Verdict::Pass
            }
            Trouble::Disk(_, Lasting::Some) if since >= SOME => Verdict::Pass,
            Trouble::Disk(failure, _) => {
                let verdict = Self::failure(failure, since, call, files);
                if matches!(verdict, Verdict::Refuse(_)) && !self.has_refused {
                    self.has_refused = true;
                    files.steps.push(Step::Refused);
                }
                verdict
            }
        }
    }

    fn tick(&mut self, calls: usize) -> Option<Signal> {
        let case = self.case?;
        let (later, signal) = match case.end {
            End::Terminated(later) => (later, Signal::SIGTERM),
            End::Killed(later) => (later, Signal::SIGKILL),
            End::Itself | End::PowerCuts(_) => return None,
        };
        let begun = self.begun.filter(|_| !self.has_signalled)?;
        self.has_signalled = match case.trouble {
            // A program that waits makes no calls.
            Trouble::Disk(DiskFailure::Slow, _) => begun.elapsed() >= SLOW_STEP * later as u32,
            _ => calls > case.at + later,
        };
        self.has_signalled.then_some(signal)
    }
}

/// A connection that lets nobody else write; fails where the program writes at this moment.
fn lock(path: &Path) -> rusqlite::Result<Connection> {
    let connection = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_WRITE)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true)?;
    connection.busy_timeout(Duration::ZERO)?;
    connection.execute_batch("BEGIN IMMEDIATE")?;
    Ok(connection)
}
