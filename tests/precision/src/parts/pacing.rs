//! The 30 Hz tick between a camera's clock and a display's.

use anyhow::Result;
use bowwave_core::{
    pacing::{FrameClock, Pacer},
    time::Time,
};

use super::{About, even};
use crate::bench::{PartBench, PartMethod};

/// Description of this part.
pub const ABOUT: About = About {
    part: "pacing",
    what: "Decides when the next frame begins, between the camera's clock and the display's.",
    truth: "simulated cameras and displays whose clocks are exact, arrivals late by up to 0.8 ms, rendering of 6 to 13 ms, two \
            minutes; the error is the 99th percentile from a picture's arrival to the blank that shows it first, plus 33 ms for \
            each picture a second by which frames go on unevenly (dropped, doubled) beyond the difference of the rates",
    rivals: "a clock of its own (cheapest), a fixed time before every second blank",
    why: "a tick of its own beats against both clocks; a late begin alone waits least but drops and doubles where the camera's \
          phase meets the begin; the locked tick has neither for a fraction of a microsecond a frame",
};

const SECONDS: f64 = 120.0;
/// Camera and display must first be known.
const SETTLE_S: f64 = 5.0;

fn at(s: f64) -> Time {
    Time::from_ns((s * 1e9) as i64)
}

/// Decides when frames begin. Told of what has happened before it is asked.
trait TickRule {
    fn arrived(&mut self, _at: Time) {}
    fn flipped(&mut self, _at: Time, _period_ns: i64) {}
    fn rendered(&mut self, _ns: i64) {}
    /// Begin of the next frame.
    fn next(&mut self, now: Time) -> Time;
}

impl TickRule for FrameClock {
    fn arrived(&mut self, at: Time) {
        self.picture_arrived(at);
    }

    fn flipped(&mut self, at: Time, period_ns: i64) {
        Self::flipped(self, at, period_ns);
    }

    fn rendered(&mut self, ns: i64) {
        Self::rendered(self, ns);
    }

    fn next(&mut self, now: Time) -> Time {
        self.plan(now).start
    }
}

/// A clock of its own at exactly 30 Hz.
impl TickRule for Pacer {
    fn next(&mut self, now: Time) -> Time {
        let next = self.next_time().max(now);
        self.tick(next).map_or(next, |t| t.time)
    }
}

/// Begins a fixed time before every second blank, whatever the camera does.
#[derive(Default)]
struct LateTick {
    flip: Option<(Time, i64)>,
    longest_ns: i64,
    last: Option<Time>,
}

impl TickRule for LateTick {
    fn flipped(&mut self, at: Time, period_ns: i64) {
        self.flip = Some((at, period_ns));
    }

    fn rendered(&mut self, ns: i64) {
        self.longest_ns = self.longest_ns.max(ns);
    }

    fn next(&mut self, now: Time) -> Time {
        let Some((flip, period_ns)) = self.flip else { return now.plus_ns(33_333_333) };
        let blanks_ns = (33_333_333.0 / period_ns as f64).round() as i64 * period_ns;
        // Of the begins that meet a blank, the one nearest to a tick after the last.
        let begin = flip.plus_ns(-self.longest_ns - 1_500_000);
        let due = self.last.map_or(now, |last| last.plus_ns(blanks_ns));
        let blanks = (due.ns_since(begin) as f64 / period_ns as f64).round() as i64;
        let start = begin.plus_ns(blanks * period_ns);
        self.last = Some(start);
        start
    }
}

struct ShownPictures {
    p99_ms: f64,
    dropped: u64,
    doubled: u64,
    /// Pictures by which each frame went on.
    steps: Vec<u64>,
}

impl ShownPictures {
    /// Pictures dropped or doubled beyond the difference of the rates: by how much frames went on unevenly.
    fn beats(&self, camera_fps: f64, tick_fps: f64) -> f64 {
        let even = (camera_fps / tick_fps).round();
        let uneven: f64 = self.steps.iter().map(|s| (*s as f64 - even).abs()).sum();
        (uneven - (camera_fps - even * tick_fps).abs() * SECONDS).max(0.0)
    }
}

/// Runs `tick` between a camera and a display.
fn watch(tick: &mut dyn TickRule, camera_fps: f64, display_hz: f64) -> ShownPictures {
    let arrival = |i: u64| at(0.003 + i as f64 / camera_fps + 0.8e-3 * even(i));
    let blank_after =
        |t: Time| at(((t.ns() as f64 * 1e-9 - 0.0042) * display_hz).ceil() / display_hz + 0.0042);
    let period_ns = (1e9 / display_hz) as i64;
    let (mut now, mut next, mut frame) = (at(0.0), 0u64, 0u64);
    let (mut waiting, mut last_flip) = (std::collections::VecDeque::new(), at(0.0));
    let (mut shown, mut waits) = (None::<u64>, Vec::new());
    let mut seen = ShownPictures { p99_ms: 0.0, dropped: 0, doubled: 0, steps: Vec::new() };
    while now < at(SECONDS + SETTLE_S) {
        while waiting.front().is_some_and(|flip| *flip <= now) {
            waiting.pop_front().into_iter().for_each(|flip| tick.flipped(flip, period_ns));
        }
        let start = tick.next(now).max(now);
        while arrival(next) <= start {
            tick.arrived(arrival(next));
            next += 1;
        }
        let render_ns =
            ((6.0 + 4.0 * even(!frame) + if frame.is_multiple_of(97) { 3.0 } else { 0.0 }) * 1e6) as i64;
        tick.rendered(render_ns);
        let flip = blank_after(start.plus_ns(render_ns).max(last_flip.plus_ns(1000)));
        last_flip = flip;
        waiting.push_back(flip);
        let newest = next.checked_sub(1);
        if let (Some(picture), true) = (newest, start > at(SETTLE_S)) {
            seen.steps.extend(shown.map(|last| picture - last));
            match shown {
                Some(last) if last == picture => seen.doubled += 1,
                _ => {
                    waits.push(flip.secs_since(arrival(picture)) * 1e3);
                    seen.dropped += shown.map_or(0, |last| picture - last - 1);
                }
            }
        }
        shown = newest;
        now = start.plus_ns(1_500_000);
        frame += 1;
    }
    waits.sort_by(f64::total_cmp);
    seen.p99_ms = waits.get(waits.len() * 99 / 100).copied().unwrap_or(f64::NAN);
    seen
}

/// Maker of a tick.
type TickMaker = fn() -> Box<dyn TickRule>;

const METHODS: [PartMethod<TickMaker>; 3] = [
    PartMethod::rival("free tick", "30 Hz", || Box::new(Pacer::new(at(0.0011)))),
    PartMethod::rival("late begin", "every second blank", || Box::new(LateTick::default())),
    PartMethod::product("locked tick", "camera and display", || Box::new(FrameClock::new())),
];

/// Error of a way and what is said of it.
fn judged(make: TickMaker, camera_fps: f64, display_hz: f64) -> (f64, String) {
    let seen = watch(make().as_mut(), camera_fps, display_hz);
    let tick_fps = if display_hz > 50.0 { display_hz / 2.0 } else { display_hz };
    let beats = seen.beats(camera_fps, tick_fps);
    let note = format!(
        "p99 {:.1} ms, dropped {}, doubled {}, beats {beats:.0}",
        seen.p99_ms, seen.dropped, seen.doubled
    );
    (seen.p99_ms + 1e3 / 30.0 * beats / SECONDS, note)
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    for (camera_fps, display_hz) in
        [(29.97, 60.0), (30.0, 59.94), (30.03, 60.0), (60.0, 59.94), (29.97, 30.0)]
    {
        let ways = METHODS.map(|m| {
            let (error, note) = judged(m.run, camera_fps, display_hz);
            m.way(error, FRAMES, move || decide((m.run)().as_mut())).note(note)
        });
        bench.scene(&format!("camera {camera_fps} Hz, display {display_hz} Hz"), "ms", 0.0, ways.into());
    }
    // A camera of another rate than the tick's cannot be followed: this shows what happens then.
    for (camera_fps, display_hz) in [(25.0, 60.0), (15.0, 60.0), (120.0, 59.94)] {
        let tried = METHODS.map(|m| {
            let (error, note) = judged(m.run, camera_fps, display_hz);
            m.tried(error).note(note)
        });
        bench.extreme(&format!("camera {camera_fps} Hz, display {display_hz} Hz"), "ms", tried.into());
    }
    Ok(())
}

const FRAMES: usize = 1000;

/// Plans that many frames.
fn decide(tick: &mut dyn TickRule) -> i64 {
    let mut sum = 0i64;
    for i in 0..FRAMES as i64 {
        let t = Time::from_ns(i * 33_333_333);
        tick.arrived(t);
        tick.flipped(t.plus_ns(20_000_000), 16_666_667);
        tick.rendered(9_000_000);
        sum = sum.wrapping_add(tick.next(t.plus_ns(21_000_000)).ns());
    }
    sum
}
