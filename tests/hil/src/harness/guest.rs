//! The agent in the machine, from the host's side.

use std::{
    collections::HashMap,
    fs::File,
    io::{BufRead, BufReader, LineWriter, Write},
    os::unix::net::UnixStream,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, Sender, channel},
    },
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, anyhow, bail};
use bowwave_hil::protocol::{AgentCommand, AgentMessage, Request};
use serde_json::Value;

/// Longest wait for a reply to a request that takes no time of its own.
const PATIENCE: Duration = Duration::from_secs(20);

/// A line of the machine's journal.
#[derive(Clone, Debug)]
pub struct JournalEntry {
    /// On the machine's monotonic clock.
    pub at_ns: i64,
    /// Its fields.
    pub fields: Value,
}

impl JournalEntry {
    /// Its text.
    pub fn text(&self) -> &str {
        self.fields["MESSAGE"].as_str().unwrap_or_default()
    }
}

/// Messages that the agent has sent.
#[derive(Default)]
struct Heard {
    hello: Option<(i64, String, String)>,
    journal: Vec<JournalEntry>,
    lines: Vec<(i64, String)>,
    triggers: Vec<(i64, i64, bool)>,
    origin_ns: Option<i64>,
    failures: Vec<String>,
    ended: bool,
}

struct GuestState {
    heard: Mutex<Heard>,
    news: Condvar,
    waiting: Mutex<HashMap<u64, Sender<Result<Value, String>>>>,
}

/// A request that is being carried out.
pub struct Pending {
    what: String,
    reply: Receiver<Result<Value, String>>,
}

impl Pending {
    /// Waits for its answer.
    pub fn answer(self, patience: Duration) -> Result<Value> {
        match self.reply.recv_timeout(patience) {
            Ok(result) => result.map_err(|e| anyhow!("{}: {e}", shortened(&self.what))),
            Err(_) => bail!("no answer in {} s to {}", patience.as_secs(), shortened(&self.what)),
        }
    }
}

/// The connection.
pub struct Guest {
    socket: UnixStream,
    shared: Arc<GuestState>,
    next: u64,
    /// Host time of the machine's monotonic zero, and how well it is known.
    zero: Option<(Instant, Duration)>,
}

impl Guest {
    /// Listens on the agent's port. The machine's journal goes into `journal` as it comes, for whoever looks what is going on.
    pub fn new(socket: UnixStream, journal: File) -> Result<Self> {
        let shared =
            Arc::new(GuestState { heard: Mutex::default(), news: Condvar::new(), waiting: Mutex::default() });
        let lines = BufReader::new(socket.try_clone()?);
        let listener = Arc::clone(&shared);
        let mut journal = LineWriter::new(journal);
        thread::Builder::new().name("agent".into()).spawn(move || {
            for line in lines.lines().map_while(Result::ok) {
                if let Some(entry) = listener.hear(&line) {
                    // The test goes on without it.
                    drop(writeln!(journal, "{:10.3} {}", entry.at_ns as f64 * 1e-9, entry.text()));
                }
            }
            listener.heard().ended = true;
            locked(&listener.waiting).clear();
            listener.news.notify_all();
        })?;
        Ok(Self { socket, shared, next: 0, zero: None })
    }

    /// Waits until the agent is there, and compares the clocks.
    pub fn greet(&mut self, patience: Duration) -> Result<(String, String)> {
        let hello = self.wait(patience, "the agent", |heard| heard.hello.clone())?;
        for _ in 0..10 {
            let begun = Instant::now();
            let now_ns = self.call(AgentCommand::Ping)?.as_i64().context("a time")?;
            let way = begun.elapsed();
            let zero = begun + way / 2 - Duration::from_nanos(now_ns.unsigned_abs());
            if self.zero.is_none_or(|(_, best)| way < best) {
                self.zero = Some((zero, way));
            }
        }
        Ok((hello.1, hello.2))
    }

    /// Host time of a time of the machine.
    pub fn host_time(&self, guest_ns: i64) -> Instant {
        let (zero, _) = self.zero.unwrap_or((Instant::now(), Duration::ZERO));
        zero + Duration::from_nanos(guest_ns.max(0).unsigned_abs())
    }

    /// The machine's time now.
    pub fn now_ns(&self) -> i64 {
        let (zero, _) = self.zero.unwrap_or((Instant::now(), Duration::ZERO));
        zero.elapsed().as_nanos() as i64
    }

    /// How well the clocks are compared, ms.
    pub fn clock_uncertainty_ms(&self) -> f64 {
        self.zero.map_or(f64::NAN, |(_, way)| way.as_secs_f64() * 500.0)
    }

    /// A request that takes no time of its own.
    pub fn call(&mut self, command: AgentCommand) -> Result<Value> {
        self.call_within(command, PATIENCE)
    }

    /// A request, and how long it may take.
    pub fn call_within(&mut self, command: AgentCommand, patience: Duration) -> Result<Value> {
        self.send(command)?.answer(patience)
    }

    /// A request whose answer is fetched later: the agent carries out several at a time.
    pub fn send(&mut self, command: AgentCommand) -> Result<Pending> {
        let what = format!("{command:?}");
        self.next += 1;
        let (sender, reply) = channel();
        locked(&self.shared.waiting).insert(self.next, sender);
        let mut line = serde_json::to_vec(&Request { id: self.next, command })?;
        line.push(b'\n');
        self.socket.write_all(&line).with_context(|| format!("the agent's port, {what}"))?;
        Ok(Pending { what, reply })
    }

    /// Runs a program in the machine; its standard output where it ended well.
    pub fn run(&mut self, argv: &[&str]) -> Result<String> {
        let (code, out, err) = self.run_any(argv, Duration::from_secs(60))?;
        if code != 0 {
            bail!("{} in the machine: exit code {code}: {}", argv.join(" "), err.trim());
        }
        Ok(out)
    }

    /// Runs a program in the machine: exit code, standard output and error.
    pub fn run_any(&mut self, argv: &[&str], patience: Duration) -> Result<(i64, String, String)> {
        let argv = argv.iter().map(|a| (*a).to_owned()).collect();
        let command = AgentCommand::Run { argv, timeout_ms: patience.as_millis() as u64 };
        let value = self.call_within(command, patience + Duration::from_secs(5))?;
        let text = |key: &str| value[key].as_str().unwrap_or_default().to_owned();
        Ok((value["code"].as_i64().unwrap_or(-1), text("out"), text("err")))
    }

    /// Runs a line of shell in the machine.
    pub fn shell(&mut self, line: &str) -> Result<String> {
        self.run(&["/bin/sh", "-c", line])
    }

    fn wait<T>(
        &self,
        patience: Duration,
        what: &str,
        mut wanted: impl FnMut(&Heard) -> Option<T>,
    ) -> Result<T> {
        let until = Instant::now() + patience;
        let mut heard = self.shared.heard();
        loop {
            if let Some(found) = wanted(&heard) {
                return Ok(found);
            }
            if heard.ended {
                bail!("waiting for {what}: the machine has ended");
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                let failures = heard.failures.join("; ");
                bail!("waited {:.0} s for {what} {failures}", patience.as_secs_f64());
            }
            heard = self.shared.news.wait_timeout(heard, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Waits for a line of the journal that was written at `since_ns` or later.
    pub fn journal(
        &self,
        since_ns: i64,
        patience: Duration,
        what: &str,
        wanted: impl Fn(&JournalEntry) -> bool,
    ) -> Result<JournalEntry> {
        self.wait(patience, what, |heard| {
            // Lines come nearly by time; the newest are at the end.
            let recent = heard.journal.iter().rev().take_while(|e| e.at_ns + 5_000_000_000 >= since_ns);
            recent.filter(|e| e.at_ns >= since_ns && wanted(e)).min_by_key(|e| e.at_ns).cloned()
        })
    }

    /// Lines of the journal that have come, at `since_ns` or later.
    pub fn journal_since(&self, since_ns: i64) -> Vec<JournalEntry> {
        self.shared.heard().journal.iter().filter(|e| e.at_ns >= since_ns).cloned().collect()
    }

    /// Lines of followed files and pipes that have come, and when.
    pub fn lines(&self) -> Vec<(i64, String)> {
        self.shared.heard().lines.clone()
    }

    /// Pulls of the tape's own trigger that were played: before, after, pressed.
    pub fn triggers(&self) -> Vec<(i64, i64, bool)> {
        self.shared.heard().triggers.clone()
    }

    /// When the tape began.
    pub fn origin_ns(&self) -> Option<i64> {
        self.shared.heard().origin_ns
    }

    /// Failures that the agent told of.
    pub fn failures(&self) -> Vec<String> {
        self.shared.heard().failures.clone()
    }
}

impl GuestState {
    fn heard(&self) -> MutexGuard<'_, Heard> {
        locked(&self.heard)
    }

    /// Takes a message in; the journal's line, where it is one.
    fn hear(&self, line: &str) -> Option<JournalEntry> {
        let message = match serde_json::from_str::<AgentMessage>(line) {
            Ok(message) => message,
            Err(e) => {
                self.heard().failures.push(format!("no message ({e}): {}", shortened(line)));
                return None;
            }
        };
        let mut written = None;
        let mut heard = self.heard();
        match message {
            AgentMessage::Hello { now_ns, kernel, gpio_chip } => {
                heard.hello = Some((now_ns, kernel, gpio_chip))
            }
            AgentMessage::Reply { id, result } => {
                if let Some(sender) = locked(&self.waiting).remove(&id) {
                    drop(sender.send(result));
                }
            }
            AgentMessage::Journal { at_ns, fields } => {
                let entry = JournalEntry { at_ns, fields };
                written = Some(entry.clone());
                heard.journal.push(entry);
            }
            AgentMessage::Line { at_ns, text, .. } => heard.lines.push((at_ns, text)),
            AgentMessage::Origin { at_ns } => heard.origin_ns = Some(at_ns),
            AgentMessage::Trigger { before_ns, after_ns, pressed } => {
                heard.triggers.push((before_ns, after_ns, pressed));
            }
            AgentMessage::Failure { what } => heard.failures.push(what),
        }
        drop(heard);
        self.news.notify_all();
        written
    }
}

fn shortened(text: &str) -> String {
    text.chars().take(120).collect()
}

fn locked<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}
