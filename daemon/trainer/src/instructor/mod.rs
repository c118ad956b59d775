//! The trainer's end of the instructor's socket.
//!
//! The loop asks for requests and hands over its status; the output thread offers finished frames. Neither ever waits: a queue that is full
//! refuses, a lock that is held is passed by, and what is written is written by a thread of the connection. One instructor's process is
//! joined at a time, the newest: one that hangs is replaced by the one that is started in its place.

mod connection;
mod socket;
mod status;
mod tap;

use std::{
    cell::Cell,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
};

use anyhow::{Context, Result};
use bowwave_core::{
    act::Act,
    order::Order,
    time::{NS_PER_S, Time},
};
use bowwave_link::Status;
use crossbeam_channel::{Receiver, Sender, bounded};

use connection::Mail;
use socket::Socket;

pub use status::status_of;
pub use tap::PictureTap;

/// Most requests that wait for the loop.
const REQUESTS: usize = 64;
/// Time between two statuses, nanoseconds.
const STATUS_NS: i64 = NS_PER_S / 5;

/// A scenario that the instructor asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AskedScenario {
    /// Where its text is from, for messages.
    pub origin: String,
    /// Its text.
    pub text: String,
    /// It is what is shown between exercises: nothing is recorded.
    pub is_stand_by: bool,
}

/// A request of the instructor's process.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// An order to the exercise.
    Order(Order),
    /// An act of the trainee's that the instructor marks.
    Act(Act),
    /// A scenario is to begin.
    Load(AskedScenario),
}

/// Whether a scenario can be used: what is wrong with it, and what to do, where it cannot.
pub type CheckScenario = Arc<dyn Fn(&AskedScenario) -> Result<(), String> + Send + Sync>;

/// Settings of the port.
#[derive(Clone)]
pub struct InstructorOptions {
    /// Path of the socket. The folder must be there.
    pub socket: PathBuf,
    /// Checks a scenario, on a thread of the connection; `None` where none can be loaded.
    pub check: Option<CheckScenario>,
}

/// The trainer's end of the socket. It outlives the sessions that it serves.
pub struct InstructorPort {
    requests: Receiver<Request>,
    mail: Arc<Mail>,
    tap: Arc<PictureTap>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    can_load: bool,
    told: Option<Time>,
    /// What is prepared stands for a status.
    prepares: Cell<bool>,
    session: u64,
    is_stand_by: bool,
    journal: Option<String>,
}

impl InstructorPort {
    /// Listens.
    ///
    /// # Errors
    /// Where the socket cannot be made: its folder is missing, something else is there, or another trainer listens.
    pub fn listen(options: InstructorOptions) -> Result<Self> {
        let socket = Socket::bind(&options.socket)?;
        let (sender, requests) = bounded(REQUESTS);
        let (mail, tap) = (Arc::new(Mail::default()), Arc::new(PictureTap::default()));
        let stop = Arc::new(AtomicBool::new(false));
        let can_load = options.check.is_some();
        let serving = Serving {
            requests: sender,
            mail: Arc::clone(&mail),
            tap: Arc::clone(&tap),
            checks: Arc::default(),
            check: options.check,
        };
        let stopping = Arc::clone(&stop);
        let thread = thread::Builder::new()
            .name("instructor".to_owned())
            .spawn(move || socket.serve(&serving, &stopping))
            .context("cannot start the thread of the instructor's socket; are too many processes running?")?;
        Ok(Self {
            requests,
            mail,
            tap,
            stop,
            thread: Some(thread),
            can_load,
            told: None,
            prepares: Cell::new(false),
            session: 0,
            is_stand_by: false,
            journal: None,
        })
    }

    /// What takes a while before the next session begins, in a few words: the instructor is shown that instead of a status.
    pub fn prepare(&self, what: &str) {
        let word = "GETTING READY".to_owned();
        let can_load = false;
        self.prepares.set(true);
        self.mail.put_preparing(Some(Status { word, cause: what.to_owned(), can_load, ..Status::default() }));
    }

    /// Another session begins. Its rounds go to that journal. What was asked for meanwhile was meant for the one before.
    pub fn begin_session(&mut self, journal: Option<&Path>, is_stand_by: bool) {
        if self.requests().count() > 0 {
            self.refuse("what was asked for while the scenario began is not done: ask again");
        }
        self.session += 1;
        self.is_stand_by = is_stand_by;
        // The instructor's process runs in another folder.
        let whole = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        self.journal = journal.map(|path| whole(path).display().to_string());
        self.told = None;
    }

    /// Where the output thread offers frames.
    pub fn tap(&self) -> Arc<PictureTap> {
        Arc::clone(&self.tap)
    }

    /// What was asked for since the last call.
    pub fn requests(&self) -> impl Iterator<Item = Request> + '_ {
        self.requests.try_iter().take(REQUESTS)
    }

    /// Tells the instructor that something is not done.
    pub fn refuse(&self, why: impl Into<String>) {
        self.mail.refuse(why.into());
    }

    /// Hands over the status that `status` makes, where one is due and somebody reads it.
    pub fn tell(&mut self, now: Time, status: impl FnOnce() -> Status) {
        let is_due = self.told.is_none_or(|told| now.ns_since(told) >= STATUS_NS);
        if !is_due || !self.mail.is_read() {
            return;
        }
        self.told = Some(now);
        if self.prepares.take() {
            self.mail.put_preparing(None);
        }
        self.mail.put_status(Status {
            session: self.session,
            stands_by: self.is_stand_by,
            can_load: self.can_load,
            journal: self.journal.clone(),
            ..status()
        });
    }
}

impl Drop for InstructorPort {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.mail.close();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            log::error!("the thread of the instructor's socket broke down; report it with the log");
        }
    }
}

/// What connections need.
#[derive(Clone)]
struct Serving {
    requests: Sender<Request>,
    mail: Arc<Mail>,
    tap: Arc<PictureTap>,
    check: Option<CheckScenario>,
    /// A scenario is being checked.
    checks: Arc<AtomicBool>,
}

#[cfg(test)]
mod tests;
