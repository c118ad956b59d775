//! The tick between simulated cameras and displays.

use super::{FRAMES_PER_S, FrameClock};
use crate::time::Time;

struct World {
    camera_fps: f64,
    /// Arrivals are late by up to this, and by half of it on average.
    jitter_ms: f64,
    display_hz: Option<f64>,
    seconds: f64,
}

#[derive(Debug)]
struct Seen {
    frames: u64,
    /// From arrival to flip (without a display: to completion), ms, sorted.
    waits_ms: Vec<f64>,
    /// Flips with the picture of the one before.
    doubled: u64,
    /// Pictures never shown.
    dropped: u64,
    /// Longest rendering, ms.
    render_ms: f64,
    missed: u64,
}

impl Seen {
    fn p99(&self) -> f64 {
        self.waits_ms[self.waits_ms.len() * 99 / 100]
    }
}

/// Even, repeatable, between 0 and 1.
fn even(i: u64, k: f64) -> f64 {
    (i as f64 * k).fract()
}

fn ns(s: f64) -> Time {
    Time::from_ns((s * 1e9) as i64)
}

/// Runs `world` and leaves the first five seconds out: camera and display must first be known.
fn watch(world: &World) -> Seen {
    let mut clock = FrameClock::new();
    let arrival =
        |i: u64| ns(0.003 + i as f64 / world.camera_fps + world.jitter_ms * 1e-3 * even(i, 0.618_033_988_75));
    let blank_s = world.display_hz.map(|hz| 1.0 / hz);
    // Odd phase, so that nothing falls together at 0.
    let blank = |after: Time| {
        blank_s.map_or(after, |p| ns(((after.ns() as f64 * 1e-9 - 0.0042) / p).ceil() * p + 0.0042))
    };
    let (mut next_arrival, mut newest) = (0u64, None::<u64>);
    let mut flips: Vec<Time> = Vec::new();
    let (mut told, mut last_flip) = (0, Time::from_ns(0));
    let mut now = Time::from_ns(0);
    let mut seen = Seen { frames: 0, waits_ms: vec![], doubled: 0, dropped: 0, render_ms: 0.0, missed: 0 };
    let mut renders = Vec::new();
    let mut shown = None;
    let mut n = 0u64;
    while now < ns(world.seconds) {
        while told < flips.len() && flips[told] <= now {
            clock.flipped(flips[told], (1e9 * blank_s.unwrap_or(1.0)) as i64);
            told += 1;
        }
        let start = clock.plan(now).start.max(now);
        while arrival(next_arrival) <= start {
            clock.picture_arrived(arrival(next_arrival));
            newest = Some(next_arrival);
            next_arrival += 1;
        }
        let render_ms = 6.0 + 4.0 * even(n, 0.754_877_666) + if n.is_multiple_of(97) { 3.0 } else { 0.0 };
        let complete = start.plus_ns((render_ms * 1e6) as i64);
        clock.rendered((render_ms * 1e6) as i64);
        // Two flips cannot share a blank.
        let flip = blank(complete.max(last_flip.plus_ns(if blank_s.is_some() { 1000 } else { 0 })));
        last_flip = flip;
        if world.display_hz.is_some() {
            flips.push(flip);
        }
        if start > ns(5.0)
            && let Some(picture) = newest
        {
            seen.frames += 1;
            renders.push(render_ms);
            if shown != Some(picture) {
                seen.waits_ms.push(flip.secs_since(arrival(picture)) * 1e3);
            }
            match shown {
                Some(last) if last == picture => seen.doubled += 1,
                Some(last) => seen.dropped += picture - last - 1,
                None => {}
            }
        }
        shown = newest;
        now = start.plus_ns(1_500_000);
        n += 1;
    }
    seen.waits_ms.sort_by(f64::total_cmp);
    renders.sort_by(f64::total_cmp);
    seen.render_ms = renders.last().copied().unwrap_or(0.0);
    seen.missed = clock.missed();
    seen
}

const CAMERAS: [f64; 5] = [25.0, 29.97, 30.0, 30.03, 60.0];

#[test]
fn a_picture_waits_a_period_and_the_rendering_at_most_and_nothing_beats() {
    for display_hz in [Some(60.0), Some(59.94), Some(60.06), Some(30.0), None] {
        for camera_fps in CAMERAS {
            for jitter_ms in [0.0, 0.8] {
                let world = World { camera_fps, jitter_ms, display_hz, seconds: 125.0 };
                let seen = watch(&world);
                let tick_fps = display_hz.map_or(FRAMES_PER_S as f64, |hz| hz / (hz / 30.0).round());
                let what =
                    format!("camera {camera_fps}, jitter {jitter_ms}, display {display_hz:?}: {seen:?}");
                let what = &what[..what.len().min(300)];
                // The hand-over to the display and the guard around arrivals come on top; a tick that follows the camera
                // needs neither, for its pictures wait half a period at most.
                let follows = camera_fps != 25.0 && display_hz.is_some_and(|hz| hz > 50.0);
                let limit_ms = 1e3 / tick_fps + seen.render_ms + if follows { 0.0 } else { 3.0 };
                assert!(seen.p99() <= limit_ms, "p99 {} ms, {what}", seen.p99());
                assert_eq!(seen.missed, 0, "{what}");
                // Pictures beyond the tick's rate cannot be shown, ticks beyond the camera's have no new one; a tick that
                // follows the camera has neither. Nothing else is dropped or doubled, but for one at the ends.
                let surplus = (camera_fps - tick_fps).max(0.0) * 120.0;
                let lack = (tick_fps - camera_fps).max(0.0) * 120.0;
                assert!(seen.dropped as f64 <= surplus + 2.0, "dropped {}, {what}", seen.dropped);
                assert!(seen.doubled as f64 <= lack + 2.0, "doubled {}, {what}", seen.doubled);
            }
        }
    }
}

#[test]
fn a_display_of_60_hz_lets_the_tick_follow_the_camera() {
    for camera_fps in [29.97, 30.03] {
        let seen = watch(&World { camera_fps, jitter_ms: 0.8, display_hz: Some(60.0), seconds: 305.0 });
        assert_eq!((seen.dropped, seen.doubled), (0, 0), "{camera_fps}");
    }
}

#[test]
fn a_caller_that_comes_too_late_is_told() {
    let mut clock = FrameClock::new();
    let first = clock.plan(Time::from_ns(0));
    let second = clock.plan(first.start.plus_ns(1_000_000));
    assert_eq!(second.start.ns_since(first.start) / 1_000_000, 33);
    clock.plan(second.start.plus_ns(200_000_000));
    assert_eq!(clock.missed(), 5);
}
