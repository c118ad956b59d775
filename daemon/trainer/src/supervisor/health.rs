//! What can be wrong with the computer itself: heat, and a wall clock that steps or was never set. A thread of its own: files in
//! `/sys` may take long to read.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, SystemTime},
};

use anyhow::{Context, Result};
use bowwave_core::{
    fault::Fault,
    time::{NS_PER_S, Time},
};
use bowwave_devices::{clock::now, report::Reporter};
use crossbeam_channel::{Receiver, Sender, bounded};

/// Above this the trainer draws less, unless the configuration says otherwise: most boards throttle from 80 to 85 on.
const LIMIT_C: f64 = 78.0;
/// So much cooler it must be until it draws all again.
const HYSTERESIS_C: f64 = 5.0;
/// A wall clock that moves against the monotonic one by more than this within a second has stepped.
const STEP_NS: i64 = NS_PER_S / 2;
/// A wall clock before this was never set: 2025-01-01, before the program was made.
const SET_AFTER_NS: i64 = 1_735_689_600 * NS_PER_S;
/// Where the system's start leaves a mark when it had to guess the time: whole seconds that the wall clock is ahead of the
/// monotonic one. As long as it still is, nobody has set it.
const GUESS: &str = "/run/bowwave-clock-guessed";
/// The mark is in whole seconds, of two clocks that are read one after the other.
const GUESS_NS: i64 = 3 * NS_PER_S;
/// How often everything is looked at, and how often the thread says that it lives.
const EVERY: Duration = Duration::from_millis(1000);
const BEAT: Duration = Duration::from_millis(100);

/// What is watched besides the devices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HealthSettings {
    /// File with a temperature in thousandths of a degree; else all thermal zones.
    pub thermal: Option<PathBuf>,
    /// From this temperature on the trainer draws less, degrees Celsius.
    pub temperature_c_max: Option<f64>,
}

/// The wall clock at an instant of the monotonic one, once it is known to be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WallTime {
    /// Nanoseconds since 1970.
    pub wall_ns: i64,
    /// At this time.
    pub at: Time,
}

/// The running thread.
#[derive(Debug)]
pub struct Health {
    stop: Arc<AtomicBool>,
    clock_set: Receiver<WallTime>,
    thread: Option<JoinHandle<()>>,
}

impl Health {
    /// Starts to watch.
    pub fn start(settings: &HealthSettings, reporter: Reporter) -> Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let (sender, clock_set) = bounded(1);
        let zones = settings.thermal.clone().map_or_else(thermal_zones, |path| vec![path]);
        let limit_c = settings.temperature_c_max.unwrap_or(LIMIT_C);
        let stopped = Arc::clone(&stop);
        let thread = thread::Builder::new()
            .name("health".to_owned())
            .spawn(move || watch(&zones, limit_c, &reporter, &sender, &stopped))
            .context("cannot start the thread that watches the computer; are too many processes running?")?;
        Ok(Self { stop, clock_set, thread: Some(thread) })
    }

    /// The wall clock, told once, when it is known to be set.
    pub fn clock_set(&self) -> Option<WallTime> {
        self.clock_set.try_recv().ok()
    }

    /// Ends the thread, within a tenth of a second; one that waits for a sensor is left to itself.
    pub fn stop(mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let Some(thread) = self.thread.take() else { return };
        let until = now().plus_ns(2 * BEAT.as_nanos() as i64);
        while !thread.is_finished() && now() < until {
            thread::sleep(Duration::from_millis(5));
        }
        if thread.is_finished() && thread.join().is_err() {
            log::error!("the thread that watches the computer broke down; report it with the log");
        }
    }
}

fn watch(
    zones: &[PathBuf],
    limit_c: f64,
    reporter: &Reporter,
    clock_set: &Sender<WallTime>,
    stop: &AtomicBool,
) {
    let mut heat = Heat { limit_c, hot: false };
    let mut wall = Wall::guessed(guess(Path::new(GUESS)));
    loop {
        if let Some(celsius) = zones.iter().filter_map(|z| celsius(z)).reduce(f64::max) {
            match heat.take(celsius) {
                Some(true) => reporter.raised(
                    Fault::Thermal,
                    format!("the computer is at {celsius:.0} C, above {limit_c:.0} C: reflections are left out; shade or cool it"),
                ),
                Some(false) => reporter.cleared(Fault::Thermal),
                None => {}
            }
        }
        let at = now();
        let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let wall_ns = i64::try_from(since_1970.as_nanos()).unwrap_or(i64::MAX);
        for told in wall.take(WallTime { wall_ns, at }) {
            match told {
                ClockNews::Unset => reporter.raised(
                    Fault::ClockUnset,
                    "the wall clock was not set since power-on (no clock battery?): times count from the start, dates are filled in once it is set",
                ),
                ClockNews::Set(time) => {
                    reporter.cleared(Fault::ClockUnset);
                    // One place: who has not fetched the last one gets that.
                    let _ = clock_set.try_send(time);
                }
                ClockNews::Stepped { by_s } => {
                    reporter.noted(Fault::ClockStep, format!("the wall clock stepped by {by_s:.1} s; nothing here follows it"));
                }
            }
        }
        for _ in 0..EVERY.as_millis() / BEAT.as_millis() {
            reporter.beat();
            if stop.load(Ordering::Relaxed) {
                return;
            }
            thread::sleep(BEAT);
        }
    }
}

/// The temperature files of all zones.
fn thermal_zones() -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir("/sys/class/thermal") else { return Vec::new() };
    entries
        .filter_map(|e| e.ok().map(|e| e.path()))
        .filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with("thermal_zone")))
        .map(|p| p.join("temp"))
        .collect()
}

/// Seconds that a guessed wall clock is ahead of the monotonic one, where the time was guessed.
fn guess(path: &Path) -> Option<i64> {
    fs::read_to_string(path).ok()?.trim().parse().ok()
}

fn celsius(path: &Path) -> Option<f64> {
    let thousandths: f64 = fs::read_to_string(path).ok()?.trim().parse().ok()?;
    // Sensors that are not there say 0 or nonsense.
    (1_000.0..200_000.0).contains(&thousandths).then_some(thousandths / 1000.0)
}

#[derive(Clone, Copy, Debug)]
struct Heat {
    limit_c: f64,
    hot: bool,
}

impl Heat {
    /// Whether it became hot (`true`) or cool again; `None` where nothing changed.
    fn take(&mut self, celsius: f64) -> Option<bool> {
        let hot = celsius > if self.hot { self.limit_c - HYSTERESIS_C } else { self.limit_c };
        (std::mem::replace(&mut self.hot, hot) != hot).then_some(hot)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum ClockNews {
    Unset,
    Set(WallTime),
    Stepped { by_s: f64 },
}

#[derive(Clone, Copy, Debug, Default)]
struct Wall {
    last: Option<WallTime>,
    set: Option<bool>,
    /// How far the wall clock is ahead of the monotonic one when it is only guessed.
    guess_ns: Option<i64>,
}

impl Wall {
    fn guessed(ahead_s: Option<i64>) -> Self {
        Self { guess_ns: ahead_s.map(|s| s.saturating_mul(NS_PER_S)), ..Self::default() }
    }

    fn take(&mut self, time: WallTime) -> impl Iterator<Item = ClockNews> + use<> {
        let ahead_ns = time.wall_ns.saturating_sub(time.at.ns());
        let guessed = self.guess_ns.is_some_and(|ns| ahead_ns.abs_diff(ns) < GUESS_NS.unsigned_abs());
        let set = time.wall_ns >= SET_AFTER_NS && !guessed;
        let changed = self.set.replace(set) != Some(set);
        let news = changed.then_some(if set { ClockNews::Set(time) } else { ClockNews::Unset });
        let stepped = self.last.replace(time).and_then(|last| {
            let by_ns = time.wall_ns.saturating_sub(last.wall_ns).saturating_sub(time.at.ns_since(last.at));
            (by_ns.abs() > STEP_NS).then_some(ClockNews::Stepped { by_s: by_ns as f64 * 1e-9 })
        });
        stepped.into_iter().chain(news)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(wall: &mut Wall, wall_s: i64, at_s: i64) -> Vec<ClockNews> {
        wall.take(WallTime { wall_ns: wall_s * NS_PER_S, at: Time::from_ns(at_s * NS_PER_S) }).collect()
    }

    #[test]
    fn heat_has_a_hysteresis() {
        let mut heat = Heat { limit_c: 80.0, hot: false };
        let said: Vec<_> = [79.0, 80.5, 79.0, 76.0, 74.9, 79.0, 81.0].map(|c| heat.take(c)).into();
        assert_eq!(said, [None, Some(true), None, None, Some(false), None, Some(true)]);
    }

    #[test]
    fn a_clock_that_was_never_set_is_told_and_so_is_its_setting() {
        let mut wall = Wall::default();
        assert_eq!(told(&mut wall, 100, 10), [ClockNews::Unset]);
        assert_eq!(told(&mut wall, 101, 11), []);
        let set = told(&mut wall, 1_800_000_000, 12);
        assert!(matches!(set[..], [ClockNews::Stepped { .. }, ClockNews::Set(_)]), "{set:?}");
        assert_eq!(told(&mut wall, 1_800_000_001, 13), []);
        let back = told(&mut wall, 1_799_996_402, 14);
        assert!(matches!(back[..], [ClockNews::Stepped { by_s }] if (by_s + 3600.0).abs() < 0.1), "{back:?}");
    }

    #[test]
    fn a_guessed_clock_counts_as_unset_until_somebody_moves_it() {
        let mut wall = Wall::guessed(Some(1_800_000_000));
        assert_eq!(told(&mut wall, 1_800_000_011, 10), [ClockNews::Unset]);
        assert_eq!(told(&mut wall, 1_800_000_012, 11), []);
        let set = told(&mut wall, 1_800_090_000, 12);
        assert!(matches!(set[..], [ClockNews::Stepped { .. }, ClockNews::Set(_)]), "{set:?}");
        // A start of the trainer after that: the mark is still there.
        let mut wall = Wall::guessed(Some(1_800_000_000));
        assert!(matches!(told(&mut wall, 1_800_090_010, 22)[..], [ClockNews::Set(_)]));
    }

    #[test]
    fn a_zone_without_a_sensor_says_nothing() {
        let path = std::env::temp_dir().join(format!("bowwave-temp-{}", std::process::id()));
        for (text, read) in [("45123\n", Some(45.123)), ("0\n", None), ("-274000", None), ("hot", None)] {
            fs::write(&path, text).unwrap();
            assert_eq!(celsius(&path), read);
        }
        fs::remove_file(&path).unwrap();
        assert_eq!(celsius(&path), None);
    }
}
