//! Device clock to host clock.

use bowwave_core::{estimate::clock::ClockMap, time::Time};

use anyhow::Result;

use super::{About, even, rms, worst};
use crate::bench::{PartBench, PartMethod};

/// Description of this part.
pub const ABOUT: About = About {
    part: "clock",
    what: "Tells when, on the host's clock, a packet's device time was, from arrivals that are late by unknown delays.",
    truth: "the simulated device's own times, 200 Hz for ten minutes, one-sided delays added; the constant least delay counts as \
            no error, since the calibrated offset absorbs it",
    rivals: "the arrival itself (cheaper), a moving average of the lag over 10 s and over 60 s (dearer in memory), the least lag \
             of 10 s without a drift",
    why: "the lower convex hull is the only one whose error does not grow with the delays' spread; it costs tens of nanoseconds \
          a packet",
};

/// One packet: device time, arrival, truth.
type TimedPacket = (i64, Time, i64);

fn packets(ppm: f64, seconds: i64, delay_ms: impl Fn(i64, f64) -> f64) -> Vec<TimedPacket> {
    drifting(|_| ppm, seconds, delay_ms)
}

/// The device's clock is fast by `ppm` of the seconds since the start.
fn drifting(ppm: impl Fn(f64) -> f64, seconds: i64, delay_ms: impl Fn(i64, f64) -> f64) -> Vec<TimedPacket> {
    const STEP_NS: f64 = 5e6;
    let mut ahead_ns = 0.0;
    (0..seconds * 200)
        .map(|i| {
            let uniform = even(i as u64);
            let since_ns = i * STEP_NS as i64;
            let host = 5_000_000_000 + since_ns;
            let device = since_ns + f64::round(ahead_ns) as i64;
            ahead_ns += STEP_NS * 1e-6 * ppm(since_ns as f64 * 1e-9);
            (device, Time::from_ns(host).plus_secs(delay_ms(i, uniform) * 1e-3), host)
        })
        .collect()
}

/// When the rate changes, seconds.
const CHANGE_S: f64 = 300.0;

/// From `from` to `to` ppm, as when a unit that lay in the sun is hosed down: all but a thirtieth within a minute and a half.
fn temperature(from: f64, to: f64) -> impl Fn(f64) -> f64 {
    move |s| to + (from - to) * (-(s - CHANGE_S).max(0.0) / 25.0).exp()
}

/// The same evenly within `over_s`; from one packet to the next where that is 0.
fn ramp(from: f64, to: f64, over_s: f64) -> impl Fn(f64) -> f64 {
    move |s| if s < CHANGE_S { from } else { from + (to - from) * ((s - CHANGE_S) / over_s).min(1.0) }
}

fn usb(_: i64, u: f64) -> f64 {
    0.1 - (1.0 - u * 0.9999).ln() * 0.5
}

fn timer(i: i64, u: f64) -> f64 {
    // An adapter that empties its buffer every 16 ms by a clock of its own, and a host that is busy now and then.
    let waits = 16.0 - (i as f64 * 5.003).rem_euclid(16.0);
    let busy = if i % 4000 < 16 { 80.0 } else { 0.0 };
    waits + 0.3 * u + busy
}

/// MapErrors after ten seconds in milliseconds, least constant removed.
struct MapErrors(Vec<f64>);

impl MapErrors {
    fn of(packets: &[TimedPacket], map: &mut dyn FnMut(i64, Time) -> i64) -> Self {
        let of = |(device, arrival, truth): &TimedPacket| (map(*device, *arrival) - truth) as f64 * 1e-6;
        let mut errors: Vec<f64> = packets.iter().map(of).skip(2000).collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        errors.iter_mut().for_each(|e| *e -= mean);
        Self(errors)
    }

    fn rms(&self) -> f64 {
        rms(self.0.iter().copied())
    }

    fn worst(&self) -> f64 {
        worst(self.0.iter().map(|e| e.abs()))
    }

    /// The worst from five seconds after the change on, and for how many seconds the error is beyond half a millisecond.
    fn after_change(&self) -> (f64, f64) {
        let later = self.0.get((CHANGE_S as usize - 5) * 200..).unwrap_or_default();
        (worst(later.iter().map(|e| e.abs())), self.0.iter().filter(|e| e.abs() > 0.5).count() as f64 / 200.0)
    }
}

fn hull() -> impl FnMut(i64, Time) -> i64 {
    let mut map = ClockMap::new();
    move |device, arrival| map.observe(device, arrival).ns()
}

fn moving_average(window: usize) -> impl FnMut(i64, Time) -> i64 {
    let mut lags: std::collections::VecDeque<i64> = std::collections::VecDeque::new();
    let mut sum = 0;
    move |device, arrival| {
        let lag = arrival.ns() - device;
        lags.push_back(lag);
        sum += lag;
        if lags.len() > window {
            sum -= lags.pop_front().unwrap_or(0);
        }
        device + sum / lags.len() as i64
    }
}

fn least_lag(window: usize) -> impl FnMut(i64, Time) -> i64 {
    // Lags that no later one undercuts, oldest and least first.
    let mut lags: std::collections::VecDeque<(usize, i64)> = std::collections::VecDeque::new();
    let mut count = 0;
    move |device, arrival| {
        let lag = arrival.ns() - device;
        while lags.back().is_some_and(|(_, l)| *l >= lag) {
            lags.pop_back();
        }
        lags.push_back((count, lag));
        while lags.front().is_some_and(|(i, _)| i + window <= count) {
            lags.pop_front();
        }
        count += 1;
        device + lags.front().map_or(lag, |l| l.1)
    }
}

type TimeMap = Box<dyn FnMut(i64, Time) -> i64>;

/// Bytes held, and the maker.
type MapMaker = (usize, fn() -> TimeMap);

const METHODS: [PartMethod<MapMaker>; 5] = [
    PartMethod::rival("raw arrival", "", (0, || Box::new(|_, arrival: Time| arrival.ns()))),
    PartMethod::rival("moving average", "10 s", (16_000, || Box::new(moving_average(2000)))),
    PartMethod::rival("moving average", "60 s", (96_000, || Box::new(moving_average(12_000)))),
    PartMethod::rival("least lag", "10 s", (0, || Box::new(least_lag(2000)))),
    PartMethod::product("lower hull", "30-60 s", (size_of::<ClockMap>(), || Box::new(hull()))),
];

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    for (scene, delay) in
        [("USB, exponential delay 0.5 ms", usb as fn(i64, f64) -> f64), ("16 ms timer, 80 ms bursts", timer)]
    {
        let packets = packets(35.0, 600, delay);
        let packets = &packets;
        let ways = METHODS.map(|candidate| {
            let (bytes, make) = candidate.run;
            let errors = MapErrors::of(packets, &mut make());
            candidate
                .way(errors.rms(), packets.len(), move || {
                    let mut map = make();
                    packets.iter().map(|(d, a, _)| map(*d, *a)).fold(0i64, i64::wrapping_add)
                })
                .holds(bytes)
                .note(format!("worst {:.3} ms", errors.worst()))
        });
        bench.scene(scene, "ms rms", 0.0, ways.into());
    }
    let burst = |i: i64, u: f64| if i % 4000 < 16 { 80.0 } else { usb(i, u) };
    for (case, packets) in [
        ("device clock 499 ppm fast", packets(499.0, 600, usb)),
        ("device clock 100 ppm slow", packets(-100.0, 600, usb)),
        ("80 ms bursts every 20 s", packets(35.0, 600, burst)),
        ("no delay at all", packets(35.0, 600, |_, _| 0.0)),
    ] {
        extreme(bench, case, &packets, |errors| format!("{:.4} ms rms", errors.rms()));
    }
    let slow_down = |over_s| ramp(100.0, -100.0, over_s);
    let speed_up = |over_s| ramp(-100.0, 100.0, over_s);
    for (case, packets) in [
        ("100 ppm slow to 100 fast at once", drifting(speed_up(0.0), 600, usb)),
        ("100 ppm fast to 100 slow at once", drifting(slow_down(0.0), 600, usb)),
        ("25 ppm fast to 25 slow at once", drifting(ramp(25.0, -25.0, 0.0), 600, usb)),
        ("temperature: 100 ppm slow to 100 fast", drifting(temperature(-100.0, 100.0), 600, usb)),
        ("temperature: 100 ppm fast to 100 slow", drifting(temperature(100.0, -100.0), 600, usb)),
        ("100 ppm slow to 100 fast within 60 s", drifting(speed_up(60.0), 600, usb)),
        ("100 ppm fast to 100 slow within 60 s", drifting(slow_down(60.0), 600, usb)),
        ("100 ppm fast to 100 slow within 200 s", drifting(slow_down(200.0), 600, usb)),
        ("100 ppm slow to 100 fast at once, 16 ms timer", drifting(speed_up(0.0), 600, timer)),
        ("100 ppm fast to 100 slow at once, 16 ms timer", drifting(slow_down(0.0), 600, timer)),
        (
            "temperature: 100 ppm fast to 100 slow, 16 ms timer",
            drifting(temperature(100.0, -100.0), 600, timer),
        ),
    ] {
        extreme(bench, case, &packets, |errors| {
            let (later, long_s) = errors.after_change();
            format!("{later:.3} ms from 5 s after the change on, {long_s:.1} s beyond 0.5 ms")
        });
    }
    Ok(())
}

/// The worst errors of all methods.
fn extreme(bench: &mut PartBench, case: &str, packets: &[TimedPacket], note: impl Fn(&MapErrors) -> String) {
    let tried = METHODS.map(|candidate| {
        let errors = MapErrors::of(packets, &mut candidate.run.1());
        candidate.tried(errors.worst()).note(note(&errors))
    });
    bench.extreme(case, "ms", tried.into());
}
