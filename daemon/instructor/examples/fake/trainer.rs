//! A trainer that is none: it speaks its protocol, shows a picture that moves, and has boats that come in.

use std::{
    io::{BufReader, BufWriter},
    os::unix::net::{UnixListener, UnixStream},
    path::Path,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bowwave_core::{engagement::Engagement, order::Order, world::scenario::Scenario};
use bowwave_link::{
    BoatState, DeviceLevel, DeviceState, FromDaemon, GunState, Hello, LinkError, Picture, Status,
    StatusLevel, ToDaemon, read_to_daemon, write_from_daemon, write_picture,
};
use rustix::time::{ClockId, clock_gettime};

/// Size and pace of what a trainer that is none shows.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Width and height of its picture, pixels.
    pub size: (u32, u32),
    /// Frames a second.
    pub rate: u64,
    /// Frames for each status.
    pub frames_a_status: u64,
}

/// As a real one.
pub const USUAL: Pace = Pace { size: (1280, 720), rate: 30, frames_a_status: 6 };

/// A trainer that is none.
pub struct FakeTrainer {
    stop: Arc<AtomicBool>,
    state: Arc<Mutex<State>>,
    thread: Option<JoinHandle<()>>,
}

/// The exercise that it plays.
struct State {
    status: Status,
    /// Boats as they began.
    began: Vec<BoatState>,
    received: Vec<ToDaemon>,
    pictures: u64,
}

impl FakeTrainer {
    /// Listens at `path`; its statuses name that journal.
    pub fn start(path: &Path, journal: Option<&Path>) -> std::io::Result<Self> {
        Self::start_at(path, journal, USUAL)
    }

    /// The same at another pace.
    pub fn start_at(path: &Path, journal: Option<&Path>, pace: Pace) -> std::io::Result<Self> {
        let _ = std::fs::remove_file(path);
        let listener = UnixListener::bind(path)?;
        listener.set_nonblocking(true)?;
        let stop = Arc::new(AtomicBool::new(false));
        let mut state = State::new();
        state.status.journal = journal.map(|path| path.display().to_string());
        let state = Arc::new(Mutex::new(state));
        let thread = thread::spawn({
            let (stop, state) = (Arc::clone(&stop), Arc::clone(&state));
            move || listen(&listener, pace, &stop, &state)
        });
        Ok(Self { stop, state, thread: Some(thread) })
    }

    /// Messages that it got, but for those that ask for pictures.
    #[allow(dead_code, reason = "the example only shows it, tests ask it")]
    pub fn received(&self) -> Vec<ToDaemon> {
        lock(&self.state).received.clone()
    }

    /// Pictures that it gave.
    #[allow(dead_code, reason = "the example only shows it, tests ask it")]
    pub fn pictures(&self) -> u64 {
        lock(&self.state).pictures
    }
}

impl Drop for FakeTrainer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn lock(state: &Mutex<State>) -> std::sync::MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

fn now_ns() -> i64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

fn boat(
    name: &str,
    side: &str,
    (east_m, north_m): (f64, f64),
    heading_deg: f64,
    speed_m_s: f64,
) -> BoatState {
    BoatState {
        name: name.to_owned(),
        side: side.to_owned(),
        east_m,
        north_m,
        heading_deg,
        speed_m_s,
        swims: true,
        in_reserve: false,
        is_struck: false,
        crew: None,
        length_m: 7.0,
    }
}

fn device(name: &str, level: DeviceLevel, cause: &str, action: &str) -> DeviceState {
    let code = if level == DeviceLevel::Works { String::new() } else { "FAKE".to_owned() };
    DeviceState { name: name.to_owned(), level, code, cause: cause.to_owned(), action: action.to_owned() }
}

impl State {
    fn new() -> Self {
        let mut began = vec![
            boat("skiff-1", "hostile", (-180.0, 620.0), 165.0, 9.0),
            boat("skiff-2", "hostile", (320.0, 540.0), 215.0, 8.0),
            boat("dhow", "neutral", (60.0, 380.0), 80.0, 3.0),
            boat("skiff-3", "hostile", (0.0, 900.0), 180.0, 10.0),
        ];
        if let Some(last) = began.last_mut() {
            (last.swims, last.in_reserve) = (false, true);
        }
        let devices = vec![
            device("camera", DeviceLevel::Works, "works", ""),
            device("inertial unit", DeviceLevel::Works, "works", ""),
            device("ship's heading", DeviceLevel::Warning, "NO SENTENCES", "CHECK THE LINE TO THE COMPASS"),
            device("trigger", DeviceLevel::Works, "works", ""),
            device("disk", DeviceLevel::Works, "works", ""),
        ];
        let status = Status {
            scenario: "A test that moves".to_owned(),
            session: 1,
            can_load: true,
            duration_s: Some(180.0),
            word: "READY".to_owned(),
            level: StatusLevel::Good,
            rules: Some(Engagement::Tight),
            weapon: "ready".to_owned(),
            rounds_left: 100,
            boats: began.clone(),
            devices,
            gun: Some(GunState { bearing_deg: 0.0, elevation_deg: 1.0, view_deg: 55.0 }),
            ..Status::default()
        };
        Self { status, began, received: Vec::new(), pictures: 0 }
    }

    fn step(&mut self, seconds: f64) {
        let Self { status, began, .. } = self;
        status.number += 1;
        status.time_ns = now_ns();
        if !status.is_paused && !status.stands_by {
            status.clock_s += seconds;
        }
        // Boats go on until they are near, then come once more.
        let lap = status.clock_s % 60.0;
        for (boat, from) in status.boats.iter_mut().zip(began) {
            let (sin, cos) = boat.heading_deg.to_radians().sin_cos();
            boat.east_m = from.east_m + sin * boat.speed_m_s * lap;
            boat.north_m = from.north_m + cos * boat.speed_m_s * lap;
        }
        if let Some(gun) = &mut status.gun {
            gun.bearing_deg = (25.0 * (status.clock_s / 4.0).sin()).rem_euclid(360.0);
        }
    }

    /// Does as ordered: a refusal, where it cannot.
    fn take(&mut self, message: &ToDaemon) -> Option<String> {
        let status = &mut self.status;
        match message {
            ToDaemon::Order { order } => match order {
                Order::Rules { rules } => status.rules = Some(*rules),
                Order::Stoppage => "stoppage".clone_into(&mut status.weapon),
                Order::Message { text } => status.message = Some(text.clone()),
                Order::Note { .. } => {}
                Order::Join { boat, .. } => {
                    let found = status.boats.iter_mut().find(|b| b.name == *boat && b.in_reserve);
                    let Some(found) = found else { return Some(format!("no boat {boat} is in reserve")) };
                    (found.swims, found.in_reserve) = (true, false);
                }
                Order::Pause => status.is_paused = true,
                Order::Resume => status.is_paused = false,
            },
            ToDaemon::Load { origin, scenario } => match Scenario::parse(scenario, origin) {
                Ok(scenario) => {
                    status.scenario = scenario.name;
                    status.session += 1;
                    status.duration_s = scenario.duration_s;
                    (status.clock_s, status.is_paused, status.stands_by) = (0.0, true, false);
                    let begin = |spec: &bowwave_core::world::scenario::BoatSpec| {
                        let state = spec.behaviour.begin();
                        let place = (state.position.x, state.position.y);
                        boat(&spec.name, spec.side.name(), place, state.heading.to_degrees(), state.speed_m_s)
                    };
                    self.began = scenario.boats.iter().map(begin).collect();
                    status.boats = self.began.clone();
                }
                Err(error) => return Some(error.to_string()),
            },
            ToDaemon::StandBy => {
                status.stands_by = true;
                status.boats.clear();
                self.began.clear();
            }
            ToDaemon::Hello { .. } | ToDaemon::Picture | ToDaemon::Act { .. } => {}
        }
        None
    }
}

fn listen(listener: &UnixListener, pace: Pace, stop: &AtomicBool, state: &Mutex<State>) {
    while !stop.load(Ordering::Relaxed) {
        match listener.accept() {
            Ok((stream, _)) => {
                if let Err(error) = play(&stream, pace, stop, state) {
                    log::info!("the instructor's process: {error}");
                }
                let _ = stream.shutdown(std::net::Shutdown::Both);
            }
            Err(_) => thread::sleep(Duration::from_millis(20)),
        }
    }
}

fn play(stream: &UnixStream, pace: Pace, stop: &AtomicBool, state: &Mutex<State>) -> Result<(), LinkError> {
    stream.set_nonblocking(false)?;
    let mut writes = BufWriter::with_capacity(1 << 18, stream.try_clone()?);
    let mut reads = BufReader::new(stream.try_clone()?);
    read_to_daemon(&mut reads)?;
    write_from_daemon(&mut writes, FromDaemon::Hello(Hello::new("fake")))?;
    let (asked, gone) = (AtomicU64::new(0), AtomicBool::new(false));
    let refused = Mutex::new(None);
    thread::scope(|scope| {
        scope.spawn(|| {
            while let Ok(message) = read_to_daemon(&mut reads) {
                if message == ToDaemon::Picture {
                    asked.fetch_add(1, Ordering::Relaxed);
                    continue;
                }
                let mut state = lock(state);
                if let Some(why) = state.take(&message) {
                    *refused.lock().unwrap_or_else(PoisonError::into_inner) = Some(why);
                }
                state.received.push(message);
            }
            gone.store(true, Ordering::Relaxed);
        });
        let outcome = show(&mut writes, pace, stop, state, &asked, (&gone, &refused));
        let _ = stream.shutdown(std::net::Shutdown::Both);
        outcome
    })
}

fn show(
    to: &mut BufWriter<UnixStream>,
    pace: Pace,
    stop: &AtomicBool,
    state: &Mutex<State>,
    asked: &AtomicU64,
    (gone, refused): (&AtomicBool, &Mutex<Option<String>>),
) -> Result<(), LinkError> {
    let Pace { size: (width, height), rate, frames_a_status } = pace;
    let sea = sea(pace.size);
    let mut next = Instant::now();
    for frame in 1.. {
        if stop.load(Ordering::Relaxed) || gone.load(Ordering::Relaxed) {
            break;
        }
        if frame % frames_a_status == 0 {
            let mut state = lock(state);
            state.step(frames_a_status as f64 / rate as f64);
            let status = Box::new(state.status.clone());
            drop(state);
            write_from_daemon(to, FromDaemon::Status(status))?;
        }
        let why = refused.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(why) = why {
            write_from_daemon(to, FromDaemon::Refused(why))?;
        }
        if asked.swap(0, Ordering::Relaxed) > 0 {
            let rgba = moved(&sea, width, frame);
            write_picture(to, &Picture { frame, complete_ns: now_ns(), width, height, rgba })?;
            lock(state).pictures += 1;
        }
        next += Duration::from_nanos(1_000_000_000 / rate);
        thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    Ok(())
}

/// A sky and a sea with the noise of a camera.
fn sea((width, height): (u32, u32)) -> Vec<u8> {
    let mut noise = 1u32;
    let mut pixels = Vec::with_capacity((width * height * 4) as usize);
    for y in 0..height {
        for x in 0..width {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let grain = f64::from(noise >> 24) / 32.0;
            let down = f64::from(y) / f64::from(height);
            let wave =
                (f64::from(x) * 0.02 + (down * 14.0).exp2() * 0.02).sin() * 14.0 * (down - 0.45).max(0.0);
            let rgb = if down < 0.45 {
                [150.0 + 60.0 * down, 180.0 + 50.0 * down, 215.0 + 20.0 * down]
            } else {
                [58.0 + wave * 5.0, 88.0 + wave * 5.0, 104.0 + wave * 5.0]
            };
            pixels.extend(rgb.map(|c| (c + grain).clamp(0.0, 255.0) as u8));
            pixels.push(255);
        }
    }
    pixels
}

/// The sea with a boat that crosses.
fn moved(sea: &[u8], width: u32, frame: u64) -> Vec<u8> {
    let mut pixels = sea.to_vec();
    let width = u64::from(width);
    let left = (frame * 4) % width.saturating_sub(120).max(1);
    for y in 330u64..352 {
        let slant = (y - 330) / 2;
        let from = ((y * width + left + slant) * 4) as usize;
        if let Some(row) = pixels.get_mut(from..from + (100 - 2 * slant as usize) * 4) {
            row.chunks_exact_mut(4).for_each(|pixel| pixel.copy_from_slice(&[70, 66, 60, 255]));
        }
    }
    pixels
}
