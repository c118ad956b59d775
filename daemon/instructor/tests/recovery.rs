//! A thousand things go wrong one after the other, at the trainer's side and at browsers': whoever comes next sees how things are, and
//! nothing is left over.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod support;

use std::{
    fs,
    io::Write as _,
    os::unix::net::{UnixListener, UnixStream},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bowwave_instructor::{InstructorOptions, Limits};
use bowwave_link::{FromDaemon, Hello, write_from_daemon};
use serde_json::Value;
use support::{
    Page, Server,
    trainer::{FakeTrainer, Pace},
};
use tungstenite::Message;

const EVENTS: u32 = 1000;
/// Events before things are counted for the first time: until then pools and buffers grow.
const WARM: u32 = 50;
const PACE: Pace = Pace { size: (64, 48), rate: 200, frames_a_status: 2 };
/// Longest that the server may take to show how things are. It takes a fraction of it; a computer that is busy may not.
const IN_TIME: Duration = Duration::from_secs(20);
const WANTS: &str = r#"{"kind":"pictures","on":true}"#;

fn short(options: &mut InstructorOptions) {
    options.picture_rate = 30.0;
    options.limits = Limits {
        head_timeout: Duration::from_millis(500),
        write_timeout: Duration::from_millis(300),
        silence_max: Duration::from_millis(1500),
        trainer_silence_max: Duration::from_millis(150),
        trainer_tries: (Duration::from_millis(2), Duration::from_millis(20)),
        ..Limits::default()
    };
}

/// Numbers that are the same in each run (splitmix64).
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ (mixed >> 31)) % n
    }
}

/// Whoever is at the trainer's end of the socket.
enum Trainer {
    Sound(#[allow(dead_code, reason = "it goes as it is dropped")] FakeTrainer),
    Broken(#[allow(dead_code, reason = "it goes as it is dropped")] Peer),
    None,
}

/// What a peer that is no trainer does with those that join.
#[derive(Clone, Copy, Debug)]
enum Breaks {
    /// It takes nobody in: they wait in the system's queue.
    TakesNobody,
    /// It neither reads nor writes.
    Hangs,
    /// It greets and says nothing more.
    GreetsAndHangs,
    /// Half a message, and nothing more.
    Half,
    /// Bytes that are no message.
    Garbage,
    /// A message that claims to have 4 GiB.
    TooLong,
    /// It greets, and the socket is closed.
    GreetsAndCloses,
}

const BREAKS: [Breaks; 7] = [
    Breaks::TakesNobody,
    Breaks::Hangs,
    Breaks::GreetsAndHangs,
    Breaks::Half,
    Breaks::Garbage,
    Breaks::TooLong,
    Breaks::GreetsAndCloses,
];

/// A peer that is no trainer.
struct Peer {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Peer {
    fn start(path: &std::path::Path, breaks: Breaks) -> Self {
        let _ = fs::remove_file(path);
        let listener = UnixListener::bind(path).unwrap();
        listener.set_nonblocking(true).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let thread = thread::spawn({
            let stop = Arc::clone(&stop);
            move || {
                let mut held = Vec::new();
                while !stop.load(Ordering::Relaxed) {
                    if !matches!(breaks, Breaks::TakesNobody) {
                        held.extend(listener.accept().ok().and_then(|(stream, _)| answer(stream, breaks)));
                    }
                    // Those that gave up are gone.
                    held.truncate(4);
                    thread::sleep(Duration::from_millis(2));
                }
            }
        });
        Self { stop, thread: Some(thread) }
    }
}

/// Answers; the stream, where it is to stay open.
fn answer(mut stream: UnixStream, breaks: Breaks) -> Option<UnixStream> {
    // Whoever joined may be gone already.
    let greet = |stream: &mut UnixStream| {
        let _ = write_from_daemon(stream, FromDaemon::Hello(Hello::new("none")));
    };
    match breaks {
        Breaks::TakesNobody | Breaks::Hangs => return Some(stream),
        Breaks::GreetsAndHangs => {
            greet(&mut stream);
            return Some(stream);
        }
        Breaks::Half => {
            greet(&mut stream);
            let _ = stream.write_all(&[0, 1, 0, 0, 0, 0x82, 0xa4]);
            return Some(stream);
        }
        Breaks::Garbage => drop(stream.write_all(&[0xc1; 300])),
        Breaks::TooLong => {
            greet(&mut stream);
            let _ = stream.write_all(&[0xff; 64]);
        }
        Breaks::GreetsAndCloses => greet(&mut stream),
    }
    None
}

impl Drop for Peer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// A browser that looks on all the while, and counts what it gets.
struct Watcher {
    stop: Arc<AtomicBool>,
    counts: Arc<[AtomicU64; 2]>,
    thread: Option<JoinHandle<()>>,
}

impl Watcher {
    fn start(server: &Server) -> Self {
        let mut page = server.page(None);
        page.socket.get_mut().set_read_timeout(Some(Duration::from_millis(100))).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let counts = Arc::new([AtomicU64::new(0), AtomicU64::new(0)]);
        let thread = thread::spawn({
            let (stop, counts) = (Arc::clone(&stop), Arc::clone(&counts));
            move || look(&mut page, &stop, &counts)
        });
        Self { stop, counts, thread: Some(thread) }
    }

    /// Statuses and pictures that came.
    fn came(&self) -> [u64; 2] {
        [0, 1].map(|i| self.counts[i].load(Ordering::Relaxed))
    }

    /// Ends it: it looked on until now.
    fn end(mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().expect("a watcher that did nothing wrong was thrown out");
    }
}

fn look(page: &mut Page, stop: &AtomicBool, [statuses, pictures]: &[AtomicU64; 2]) {
    page.say(WANTS);
    let mut said = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        match page.socket.read() {
            Ok(Message::Text(text)) if text.contains(r#""kind":"status""#) => {
                statuses.fetch_add(1, Ordering::Relaxed);
            }
            Ok(Message::Binary(_)) => {
                pictures.fetch_add(1, Ordering::Relaxed);
                page.say(r#"{"kind":"drawn","frame":1}"#);
            }
            Ok(Message::Close(_)) => panic!("closed"),
            Ok(_) => {}
            Err(tungstenite::Error::Io(error))
                if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {}
            Err(error) => panic!("{error}"),
        }
        if said.elapsed() > Duration::from_millis(300) {
            page.say(r#"{"kind":"ping","t":1}"#);
            said = Instant::now();
        }
    }
}

/// Everything that the dice act on.
struct Trial {
    server: Server,
    trainer: Trainer,
    /// Pages that ask for pictures, and neither take nor say anything.
    silent: Vec<Page>,
    dice: Dice,
}

impl Trial {
    /// One thing that goes wrong, or right again: what it was.
    fn event(&mut self) -> String {
        let path = self.server.socket.clone();
        match self.dice.below(20) {
            0..=5 => {
                // At once, or a while after the one before is gone.
                if self.dice.below(2) == 0 {
                    self.trainer = Trainer::None;
                }
                let next = FakeTrainer::start_at(&path, None, PACE).unwrap();
                self.trainer = Trainer::Sound(next);
                "the trainer starts".to_owned()
            }
            6 | 7 => {
                self.trainer = Trainer::None;
                "the trainer ends, its socket's file stays".to_owned()
            }
            8 | 9 => {
                self.trainer = Trainer::None;
                let _ = fs::remove_file(&path);
                "the trainer ends, its socket's file goes".to_owned()
            }
            10 => {
                self.trainer = Trainer::None;
                let _ = fs::remove_file(&path);
                fs::write(&path, "no socket").unwrap();
                "a file that is no socket".to_owned()
            }
            11 => {
                let breaks = BREAKS[self.dice.below(7) as usize];
                self.trainer = Trainer::Broken(Peer::start(&path, breaks));
                format!("a peer that is no trainer: {breaks:?}")
            }
            12..=14 => self.page_ends(),
            15 | 16 => {
                let mut page = self.server.page(None);
                page.say(WANTS);
                self.silent.push(page);
                if self.silent.len() > 6 {
                    self.silent.remove(0);
                }
                "a page that acknowledges nothing".to_owned()
            }
            17 => {
                let _ = self.server.connect().write_all(b"GET /ws HTTP/1.1\r\nHost: ");
                "half a request".to_owned()
            }
            18 => {
                let mut page = self.server.page(None);
                for _ in 0..100 {
                    // It is thrown out meanwhile.
                    let _ = page.socket.send(Message::text(r#"{"kind":"take_control"}"#));
                }
                page.ends();
                "a page that says too much".to_owned()
            }
            _ => {
                let mut page = self.server.page(None);
                page.say("garbage");
                page.wait("refused");
                "a page that says what is no message".to_owned()
            }
        }
    }

    fn page_ends(&mut self) -> String {
        let mut page = self.server.page(None);
        page.say(WANTS);
        match self.dice.below(3) {
            0 => {
                page.socket.close(None).unwrap();
                page.ends();
                "a page is closed".to_owned()
            }
            1 => "a page goes at once".to_owned(),
            _ => {
                // What came and was not taken makes a reset of it.
                thread::sleep(Duration::from_millis(15));
                "a page is cut".to_owned()
            }
        }
    }

    /// Whoever comes now is shown how things are.
    fn check(&self, words: &str) {
        let mut page = self.server.page(None);
        page.socket.get_mut().set_read_timeout(Some(IN_TIME)).unwrap();
        page.say(WANTS);
        let is_up = matches!(self.trainer, Trainer::Sound(_));
        let mut seen = Seen::default();
        let begun = Instant::now();
        while !seen.is_enough(is_up) {
            assert!(begun.elapsed() < IN_TIME, "{words}: up is {is_up}, and this is shown: {seen:?}");
            match page.socket.read() {
                Ok(Message::Text(text)) => seen.news(&serde_json::from_str(&text).unwrap()),
                Ok(Message::Binary(bytes)) => {
                    assert!(bytes[16..].starts_with(&[0xff, 0xd8]), "{words}");
                    seen.picture = seen.joined;
                    page.say(r#"{"kind":"drawn","frame":1}"#);
                }
                Ok(Message::Close(_)) | Err(_) => {
                    panic!("{words}: ended after {:?}: {seen:?}", begun.elapsed())
                }
                Ok(_) => {}
            }
        }
    }
}

/// News that a page has got.
#[derive(Debug, Default)]
struct Seen {
    joined: bool,
    lost: bool,
    number: Option<u64>,
    risen: bool,
    picture: bool,
}

impl Seen {
    fn news(&mut self, news: &Value) {
        if news["kind"] == "link" {
            self.joined = news["joined"] == true;
            self.lost = !self.joined && !news["words"].as_str().unwrap().is_empty();
            (self.number, self.risen, self.picture) = (None, false, false);
        } else if news["kind"] == "status" && self.joined {
            let number = news["status"]["number"].as_u64();
            self.risen |= self.number.is_some_and(|before| Some(before) < number);
            self.number = number;
        }
    }

    fn is_enough(&self, is_up: bool) -> bool {
        if is_up { self.joined && self.risen && self.picture } else { self.lost }
    }
}

/// Threads, open files and peak of memory (kB) of this process.
fn held() -> (usize, usize, u64) {
    let count = |folder: &str| fs::read_dir(folder).unwrap().count();
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let peak = status.lines().find(|line| line.starts_with("VmHWM")).unwrap();
    let peak_kb = peak.split_whitespace().nth(1).unwrap().parse().unwrap();
    (count("/proc/self/task"), count("/proc/self/fd"), peak_kb)
}

/// The same, as soon as no more is held than at most that, or after the time that idle threads of the pool stay.
fn settled(threads: usize, files: usize) -> (usize, usize, u64) {
    let begun = Instant::now();
    loop {
        let now = held();
        if (now.0 <= threads && now.1 <= files) || begun.elapsed() > IN_TIME {
            return now;
        }
        thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn a_thousand_faults_leave_nothing_behind_and_whoever_comes_sees_how_things_are() {
    let server = Server::with(false, short);
    let (trainer, silent, dice) = (Trainer::None, Vec::new(), Dice(7));
    let mut trial = Trial { server, trainer, silent, dice };
    let watchers = [Watcher::start(&trial.server), Watcher::start(&trial.server)];
    let begun = Instant::now();
    let (mut first, mut slowest) = ((0, 0, 0), (Duration::ZERO, String::new()));
    for event in 1..=EVENTS {
        let words = format!("event {event}, {}", trial.event());
        let happened = Instant::now();
        trial.check(&words);
        if happened.elapsed() > slowest.0 {
            slowest = (happened.elapsed(), words);
        }
        if event == WARM {
            trial.silent.clear();
            trial.trainer = Trainer::Sound(FakeTrainer::start_at(&trial.server.socket, None, PACE).unwrap());
            trial.check("the first count");
            thread::sleep(Duration::from_millis(700));
            first = held();
        }
    }
    println!("{EVENTS} events in {:.1} s, the slowest {:?}", begun.elapsed().as_secs_f64(), slowest);
    trial.silent.clear();
    trial.trainer = Trainer::Sound(FakeTrainer::start_at(&trial.server.socket, None, PACE).unwrap());
    trial.check("the last count");
    let last = settled(first.0 + 2, first.1 + 3);
    println!("threads, open files and peak kB after {WARM} events {first:?}, at the end {last:?}");
    assert!(last.0 <= first.0 + 2 && last.1 <= first.1 + 3, "{first:?} {last:?}");
    assert!(last.2 <= first.2 + (24 << 10), "{first:?} {last:?}");
    for watcher in watchers {
        let before = watcher.came();
        let until = Instant::now() + IN_TIME;
        while watcher.came().iter().zip(before).any(|(now, before)| *now == before) {
            assert!(Instant::now() < until, "a page that was open all the while gets nothing: {before:?}");
            thread::sleep(Duration::from_millis(5));
        }
        watcher.end();
    }
}
