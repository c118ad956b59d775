//! One connection: a thread that reads requests, and one that writes what there is to say.

use std::{
    collections::VecDeque,
    io::{self, BufReader},
    net::Shutdown,
    os::unix::net::UnixStream,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bowwave_core::world::scenario;
use bowwave_link::{
    FromDaemon, Hello, LinkError, Status, ToDaemon, VERSION, read_to_daemon, write_from_daemon, write_picture,
};
use crossbeam_channel::TrySendError;

use super::{AskedScenario, Request, Serving};

/// A process that does not read for so long is let go.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);
/// One that has connected and says nothing for so long, likewise.
const HELLO_TIMEOUT: Duration = Duration::from_secs(5);
/// How often the writing thread looks for something to write while nothing wakes it.
const PATIENCE: Duration = Duration::from_millis(20);
/// How often what the trainer prepares is said.
const PREPARING_EVERY: Duration = Duration::from_millis(500);
/// Refusals that wait; more would say the same.
const REFUSALS: usize = 16;

/// What waits to be written.
#[derive(Debug, Default)]
pub(super) struct Mail {
    is_read: AtomicBool,
    is_closed: AtomicBool,
    waiting: Mutex<Waiting>,
    there: Condvar,
}

#[derive(Debug, Default)]
struct Waiting {
    status: Option<Box<Status>>,
    /// Stands for a status twice a second while the loop does not run.
    preparing: Option<Box<Status>>,
    refusals: VecDeque<String>,
    pictures: bool,
}

impl Mail {
    /// Tests whether somebody is connected.
    pub(super) fn is_read(&self) -> bool {
        self.is_read.load(Ordering::Relaxed)
    }

    /// Puts a status in the place of one that waits. Passes by where the mail is being taken: the next status is newer.
    pub(super) fn put_status(&self, status: Status) {
        if let Ok(mut waiting) = self.waiting.try_lock() {
            waiting.status = Some(Box::new(status));
            self.there.notify_one();
        }
    }

    /// Has a status stand for those of a loop that does not run yet.
    pub(super) fn put_preparing(&self, status: Option<Status>) {
        self.waiting().preparing = status.map(Box::new);
    }

    /// Adds a refusal. The lock is held for moments only.
    pub(super) fn refuse(&self, why: String) {
        let mut waiting = self.waiting();
        if waiting.refusals.len() < REFUSALS {
            waiting.refusals.push_back(why);
            self.there.notify_one();
        }
    }

    /// Ends the connection.
    pub(super) fn close(&self) {
        self.is_closed.store(true, Ordering::Relaxed);
        self.there.notify_all();
    }

    fn want_picture(&self) {
        self.waiting().pictures = true;
        self.there.notify_one();
    }

    fn clear(&self) {
        let mut waiting = self.waiting();
        *waiting = Waiting { preparing: waiting.preparing.take(), ..Waiting::default() };
    }

    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A connection that is served.
pub(super) struct Connection {
    stream: UnixStream,
    ended: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
    serving: Serving,
}

impl Connection {
    /// Begins to serve.
    pub(super) fn start(stream: UnixStream, serving: Serving) -> io::Result<Self> {
        stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
        stream.set_read_timeout(Some(HELLO_TIMEOUT))?;
        let ended = Arc::new(AtomicBool::new(false));
        serving.mail.clear();
        let (reads, writes) = (stream.try_clone()?, stream.try_clone()?);
        let mut connection =
            Self { stream, ended: Arc::clone(&ended), threads: Vec::new(), serving: serving.clone() };
        let reader = Reader { serving: serving.clone() };
        let has_ended = Arc::clone(&ended);
        connection.spawn("instructor-in", move || {
            if let Err(e) = reader.read(&reads) {
                log::info!("the instructor's process has gone: {e}");
            }
            has_ended.store(true, Ordering::Release);
            reader.serving.mail.there.notify_all();
        })?;
        let has_ended = Arc::clone(&ended);
        connection.spawn("instructor-out", move || {
            if let Err(e) = write(&writes, &serving, &has_ended) {
                log::info!("the instructor's process does not read: {e}");
            }
            has_ended.store(true, Ordering::Release);
            // Wakes the thread that reads.
            let _ = writes.shutdown(Shutdown::Both);
        })?;
        Ok(connection)
    }

    fn spawn(&mut self, name: &str, run: impl FnOnce() + Send + 'static) -> io::Result<()> {
        self.threads.push(thread::Builder::new().name(name.to_owned()).spawn(run)?);
        Ok(())
    }

    /// Tests whether the other side is gone.
    pub(super) fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Acquire)
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Release);
        // It may be closed already.
        let _ = self.stream.shutdown(Shutdown::Both);
        self.serving.mail.there.notify_all();
        for thread in self.threads.drain(..) {
            if thread.join().is_err() {
                log::error!("a thread of the instructor's connection broke down; report it with the log");
            }
        }
        self.serving.mail.is_read.store(false, Ordering::Relaxed);
        self.serving.tap.forget();
    }
}

struct Reader {
    serving: Serving,
}

impl Reader {
    /// Reads until the other side is gone or says what is none of the protocol.
    fn read(&self, stream: &UnixStream) -> Result<(), LinkError> {
        let mut from = BufReader::new(stream);
        match read_to_daemon(&mut from)? {
            ToDaemon::Hello { hello } if hello.version == VERSION => {
                log::info!("the instructor's process {} is joined", hello.program);
            }
            ToDaemon::Hello { hello } => {
                let why = format!(
                    "the trainer speaks version {VERSION} of the instructor's protocol, and this process {} version {}: use programs of one version",
                    hello.program, hello.version
                );
                self.serving.mail.refuse(why.clone());
                self.serving.mail.is_read.store(true, Ordering::Relaxed);
                // Whoever is refused is to read why.
                thread::sleep(PATIENCE * 10);
                return Err(LinkError::Content(why));
            }
            _ => return Err(LinkError::Content("a request before the greeting".to_owned())),
        }
        stream.set_read_timeout(None)?;
        self.serving.mail.is_read.store(true, Ordering::Relaxed);
        loop {
            match read_to_daemon(&mut from) {
                Ok(message) => self.take(message),
                Err(LinkError::Closed) => return Ok(()),
                Err(e) => return Err(e),
            }
        }
    }

    fn take(&self, message: ToDaemon) {
        let request = match message {
            ToDaemon::Hello { .. } => return,
            ToDaemon::Picture => {
                self.serving.tap.want();
                self.serving.mail.want_picture();
                return;
            }
            ToDaemon::Order { order } => match order.check() {
                Ok(()) => Request::Order(order),
                Err(e) => return self.serving.mail.refuse(e.to_string()),
            },
            ToDaemon::Act { act } => Request::Act(act),
            ToDaemon::Load { origin, scenario } => {
                let origin = bowwave_core::text::one_line(&origin);
                return self.check(AskedScenario { origin, text: scenario, is_stand_by: false });
            }
            ToDaemon::StandBy => return self.check(stand_by()),
        };
        self.serving.ask(request);
    }

    /// Has a scenario checked, which may take minutes, and then asked for. Whatever else is asked for goes on meanwhile.
    fn check(&self, asked: AskedScenario) {
        let mail = &self.serving.mail;
        let Some(check) = self.serving.check.clone() else {
            return mail
                .refuse("this trainer plays one recording or scenario: start it with another".to_owned());
        };
        if self.serving.checks.swap(true, Ordering::AcqRel) {
            return mail.refuse("a scenario is being made ready already: wait for it".to_owned());
        }
        let serving = self.serving.clone();
        let checked = thread::Builder::new().name("instructor-check".to_owned()).spawn(move || {
            match check(&asked) {
                Ok(()) => serving.ask(Request::Load(asked)),
                Err(why) => serving.mail.refuse(why),
            }
            serving.checks.store(false, Ordering::Release);
        });
        if let Err(e) = checked {
            self.serving.checks.store(false, Ordering::Release);
            mail.refuse(format!("the scenario could not be checked: {e}"));
        }
    }
}

impl Serving {
    /// Hands a request to the loop, where there is room for it.
    fn ask(&self, request: Request) {
        match self.requests.try_send(request) {
            Ok(()) => {}
            Err(TrySendError::Full(_)) => {
                self.mail.refuse("too much was asked for at once: ask again in a moment".to_owned());
            }
            Err(TrySendError::Disconnected(_)) => {}
        }
    }
}

/// The scenario between exercises.
fn stand_by() -> AskedScenario {
    let empty = scenario::BUILT_IN.iter().find(|(name, _)| *name == "empty");
    let text = empty.map_or_else(String::new, |(_, text)| (*text).to_owned());
    AskedScenario { origin: "built-in scenario empty".to_owned(), text, is_stand_by: true }
}

/// Writes what there is until the connection ends.
fn write(mut stream: &UnixStream, serving: &Serving, has_ended: &AtomicBool) -> Result<(), LinkError> {
    let mail = &serving.mail;
    write_from_daemon(&mut stream, FromDaemon::Hello(Hello::new(env!("CARGO_PKG_VERSION"))))?;
    let (mut awaits_picture, mut number, mut said) = (false, 0, Instant::now());
    while !has_ended.load(Ordering::Acquire) && !mail.is_closed.load(Ordering::Relaxed) {
        let (status, refusals) = {
            let waiting = mail.waiting();
            let is_idle = |w: &mut Waiting| w.status.is_none() && w.refusals.is_empty() && !w.pictures;
            // A frame is not announced here: it is looked for below.
            let patience = if awaits_picture { Duration::ZERO } else { PATIENCE * 10 };
            let waited = mail.there.wait_timeout_while(waiting, patience, is_idle);
            let mut waiting = waited.unwrap_or_else(PoisonError::into_inner).0;
            awaits_picture |= std::mem::take(&mut waiting.pictures);
            let status = waiting.status.take();
            let preparing = || waiting.preparing.clone().filter(|_| said.elapsed() >= PREPARING_EVERY);
            let status = status.or_else(preparing);
            (status, std::mem::take(&mut waiting.refusals))
        };
        for why in refusals {
            write_from_daemon(&mut stream, FromDaemon::Refused(why))?;
        }
        if let Some(mut status) = status {
            number += 1;
            (status.number, said) = (number, Instant::now());
            write_from_daemon(&mut stream, FromDaemon::Status(status))?;
        }
        if awaits_picture && let Some(picture) = serving.tap.take(PATIENCE) {
            awaits_picture = false;
            let written = write_picture(&mut stream, &picture);
            serving.tap.give_back(picture);
            written?;
        }
    }
    Ok(())
}
