//! Plays the tape: pictures to the camera's driver, packets to the unit's line, pulls to the trigger.

use std::{
    fs,
    io::{Read, Write},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::Duration,
};

use anyhow::{Context, Result};
use bowwave_core::{event::ImuSample, time::Time};
use bowwave_devices::{clock, vectornav::CommonOutput};
use bowwave_hil::{
    TAPE_SERIAL,
    protocol::{AgentMessage, PlayerFeed},
    tape::{Tape, TapePacket, flipped, halved},
};
use glam::{DQuat, DVec3};
use hw_sim::set_up::{SetUp, WrongSetUp};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};

use crate::{
    bench::{Gpio, PictureHead, camera_state, open_camera},
    link::Link,
};

/// From the request to the tape's beginning.
const PREROLL_NS: i64 = 100_000_000;
/// A picture later than this is left out, as a camera would.
const LATE_MAX_NS: i64 = 60_000_000;
/// Full scale of the unit's gyro, rad/s.
const FULL_SCALE: f64 = 34.9;

/// State that the threads share.
struct PlayerState {
    link: Arc<Link>,
    gpio: Arc<Gpio>,
    tape: Tape,
    feed: Mutex<PlayerFeed>,
    on: AtomicBool,
    /// Counts `Play`s: threads of an older one end.
    play: AtomicU64,
    late: AtomicU64,
}

/// The player.
pub struct TapePlayer {
    shared: Arc<PlayerState>,
}

impl TapePlayer {
    /// Reads the tape.
    pub fn new(link: Arc<Link>, gpio: Arc<Gpio>) -> Result<Self> {
        let tape = Tape::read(&tape_disk()?)?;
        let feed = Mutex::new(PlayerFeed::default());
        let (on, play, late) = (AtomicBool::new(false), AtomicU64::new(0), AtomicU64::new(0));
        Ok(Self { shared: Arc::new(PlayerState { link, gpio, tape, feed, on, play, late }) })
    }

    /// Begins from the tape's beginning, or ends.
    pub fn play(&self, on: bool) -> Result<Value> {
        let number = self.shared.play.fetch_add(1, Ordering::SeqCst) + 1;
        self.shared.on.store(on, Ordering::SeqCst);
        if !on {
            return Ok(json!({ "late": self.shared.late.load(Ordering::Relaxed) }));
        }
        let origin = clock::now().plus_ns(PREROLL_NS);
        let camera = Arc::clone(&self.shared);
        let unit = Arc::clone(&self.shared);
        let trigger = Arc::clone(&self.shared);
        thread::Builder::new().name("camera".into()).spawn(move || camera.camera(number, origin))?;
        thread::Builder::new().name("unit".into()).spawn(move || unit.unit(number, origin))?;
        thread::Builder::new().name("trigger".into()).spawn(move || trigger.trigger(number, origin))?;
        self.shared.link.say(&AgentMessage::Origin { at_ns: origin.ns() });
        Ok(json!(origin.ns()))
    }

    /// How to play from now on.
    pub fn feed(&self, feed: PlayerFeed) {
        *self.shared.feed() = feed;
    }

    /// Least way of a few bytes from here over the host to a serial device, which nobody else may read.
    pub fn line_delay(&self, device: &str) -> Result<Value> {
        let stty = ["-F", device, "921600", "raw", "-echo", "min", "0", "time", "10"];
        let done = std::process::Command::new("/bin/stty").args(stty).status().context("stty")?;
        anyhow::ensure!(done.success(), "stty cannot set {device}");
        let mut file = fs::File::open(device).with_context(|| device.to_owned())?;
        let mut delays = Vec::new();
        for _ in 0..60 {
            let begun = clock::now();
            self.shared.link.send_imu(&[0x55; 62]);
            let (mut bytes, mut seen) = ([0; 128], 0);
            while seen < 62 {
                match file.read(&mut bytes)? {
                    0 => break,
                    count => seen += count,
                }
            }
            if seen == 62 {
                delays.push(clock::now().ns_since(begun));
            }
            thread::sleep(Duration::from_millis(7));
        }
        delays.sort_unstable();
        let at = |share: usize| delays.get(delays.len() * share / 100).copied();
        Ok(json!({ "least_ns": delays.first(), "p50_ns": at(50), "p99_ns": at(99), "seen": delays.len() }))
    }
}

impl PlayerState {
    fn feed(&self) -> MutexGuard<'_, PlayerFeed> {
        self.feed.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn current(&self, number: u64) -> bool {
        self.on.load(Ordering::SeqCst) && self.play.load(Ordering::SeqCst) == number
    }

    /// Tape times without end: the round and the place in it.
    fn rounds(&self, length: usize) -> impl Iterator<Item = (i64, usize)> {
        let rounds = if length == 0 { 0 } else { i64::MAX };
        (0..rounds).flat_map(move |round| (0..length).map(move |i| (round, i)))
    }

    fn camera(&self, number: u64, origin: Time) {
        let Ok(mut device) = open_camera() else {
            self.link.say(&AgentMessage::Failure { what: "the camera's bench side is gone".into() });
            return;
        };
        let mut random = Pcg64Mcg::seed_from_u64(0xca3);
        let (mut frozen, mut spoilt) = (None, false);
        for (round, index) in self.rounds(self.tape.header.frames.len()) {
            let frame = self.tape.header.frames[index];
            let at = |ns: i64| origin.plus_ns(round * self.tape.header.period_ns + ns);
            clock::sleep_until(at(frame.arrival_ns));
            if !self.current(number) {
                return;
            }
            if clock::now().ns_since(at(frame.arrival_ns)) > LATE_MAX_NS {
                self.late.fetch_add(1, Ordering::Relaxed);
                spoilt = true;
                continue;
            }
            let feed = self.feed().clone();
            if feed.stall {
                continue;
            }
            frozen = if feed.freeze { frozen.or(Some(index)) } else { None };
            let exposed = at(frame.exposed_ns);
            if let Some(bytes) =
                self.picture(frozen.unwrap_or(index), exposed, &feed, &mut random, &mut spoilt)
            {
                // An unplugged camera takes none.
                drop(device.write_all(&bytes));
            }
        }
    }

    /// The picture as the running mode wants it, with what the feed does to it.
    /// `spoilt`: the one before was left out, flagged or short. The next one is neither flagged nor short, for two in a row are 100 ms
    /// without a picture, which is a stall.
    fn picture(
        &self,
        index: usize,
        exposed: Time,
        feed: &PlayerFeed,
        random: &mut Pcg64Mcg,
        spoilt: &mut bool,
    ) -> Option<Vec<u8>> {
        let mode = camera_state().ok().filter(|m| m.streaming == 1)?;
        let header = &self.tape.header;
        let mut bytes = match mode.fourcc.as_str() {
            "MJPG" => self.tape.jpeg(index).to_vec(),
            "YUYV" if mode.width == header.width => self.full_size(index, wrong(feed)),
            "YUYV" if mode.width == header.width / 2 => {
                halved(self.tape.yuyv(index), header.width, header.height)
            }
            _ => return None,
        };
        if mode.fourcc == "MJPG" && random.random_bool(feed.corrupt.clamp(0.0, 1.0)) {
            if random.random_bool(0.5) {
                bytes.truncate(random.random_range(2..bytes.len().max(4) * 3 / 4));
            } else {
                let scan = bytes.len() / 3;
                random.fill_bytes(&mut bytes[scan..scan + 200]);
            }
        }
        let spared = std::mem::take(spoilt);
        let short = random.random_bool(feed.short.clamp(0.0, 1.0)) && !spared;
        if short {
            bytes.truncate(bytes.len() / 2);
        }
        let back = random.random_bool(feed.backwards.clamp(0.0, 1.0));
        let flagged = random.random_bool(feed.flagged.clamp(0.0, 1.0)) && !spared;
        *spoilt = short || flagged;
        let fourcc = mode.fourcc.as_bytes();
        let head = PictureHead {
            flagged,
            timestamp_ns: exposed.plus_ns(if back { -2_000_000_000 } else { 0 }).ns(),
            fourcc: fourcc.try_into().ok()?,
            width: mode.width,
            height: mode.height,
        };
        Some([&head.bytes()[..], &bytes].concat())
    }

    /// A picture as a camera that is set up so gives it.
    fn full_size(&self, index: usize, wrong: WrongSetUp) -> Vec<u8> {
        let count = self.tape.header.frames.len();
        let shown = self.tape.yuyv((index + count - wrong.frames_late(30)) % count);
        match wrong.flips() {
            [false, false] => shown.to_vec(),
            flips => flipped(shown, self.tape.header.width, flips),
        }
    }

    fn unit(&self, number: u64, origin: Time) {
        let mut random = Pcg64Mcg::seed_from_u64(0x1b0);
        let mut last: Option<TapePacket> = None;
        let header = &self.tape.header;
        for (round, index) in self.rounds(header.samples.len()) {
            let sample = header.samples[index];
            let feed = self.feed().clone();
            let due = origin.plus_ns(round * header.period_ns + sample.arrival_ns);
            clock::sleep_until(due);
            if !self.current(number) {
                return;
            }
            if feed.mute {
                continue;
            }
            let sent = if feed.stuck { last.unwrap_or(sample) } else { sample };
            last = Some(sent);
            let device_ns = sample.device_ns + round * header.device_period_ns;
            let mut bytes = packet(&sent, device_ns, &feed);
            if random.random_bool(feed.garbage.clamp(0.0, 1.0)) {
                if random.random_bool(0.5) {
                    bytes.truncate(bytes.len() / 2);
                } else {
                    let mut garbage = [0; 40];
                    random.fill_bytes(&mut garbage);
                    bytes.splice(0..0, garbage);
                }
            }
            self.link.send_imu(&bytes);
        }
    }

    fn trigger(&self, number: u64, origin: Time) {
        let header = &self.tape.header;
        for (round, index) in self.rounds(header.triggers.len()) {
            let (at_ns, pressed) = header.triggers[index];
            clock::sleep_until(origin.plus_ns(round * header.period_ns + at_ns));
            if !self.current(number) {
                return;
            }
            if !self.feed().trigger {
                continue;
            }
            match self.gpio.pull(0, &[(0, pressed)]).as_deref() {
                Ok([[before_ns, after_ns]]) => {
                    let (before_ns, after_ns) = (*before_ns, *after_ns);
                    self.link.say(&AgentMessage::Trigger { before_ns, after_ns, pressed });
                }
                other => {
                    self.link.say(&AgentMessage::Failure { what: format!("the trigger's line: {other:?}") })
                }
            }
        }
    }
}

fn wrong(feed: &PlayerFeed) -> WrongSetUp {
    SetUp::named(&feed.set_up).map_or(WrongSetUp::Nothing, |set_up| set_up.wrong)
}

fn packet(sample: &TapePacket, device_ns: i64, feed: &PlayerFeed) -> Vec<u8> {
    let mut rate = DVec3::from_array(sample.rate);
    if feed.saturated {
        rate = DVec3::splat(FULL_SCALE);
    }
    if feed.nan {
        rate = DVec3::NAN;
    }
    let sample = wrong(feed).sample(ImuSample {
        arrival: Time::from_ns(0),
        device_time_ns: device_ns,
        rate,
        accel: DVec3::from_array(sample.accel),
        world_from_imu: sample.attitude.map(DQuat::from_array),
    });
    let mut bytes = Vec::with_capacity(CommonOutput::MAX_BYTES);
    if let Some(output) = CommonOutput::from_sample(&sample) {
        output.encode(&mut bytes);
    }
    bytes
}

/// The disk that the tape is on.
fn tape_disk() -> Result<PathBuf> {
    for disk in fs::read_dir("/sys/block").context("/sys/block")?.flatten() {
        let serial = fs::read_to_string(disk.path().join("serial")).unwrap_or_default();
        if serial.trim() == TAPE_SERIAL {
            return Ok(Path::new("/dev").join(disk.file_name()));
        }
    }
    anyhow::bail!("no disk {TAPE_SERIAL}")
}
