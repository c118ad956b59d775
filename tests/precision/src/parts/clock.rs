//! Device clock to host clock.

use bowwave_core::{clock::ClockMap, time::Time};

use anyhow::Result;

use super::{About, even};
use crate::bench::{Bench, Tried, Way};

/// What is said of this part.
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
type Packet = (i64, Time, i64);

fn packets(ppm: f64, seconds: i64, delay_ms: impl Fn(i64, f64) -> f64) -> Vec<Packet> {
    drifting(|_| ppm, seconds, delay_ms)
}

/// The device's clock is fast by `ppm` of the seconds since the start.
fn drifting(ppm: impl Fn(f64) -> f64, seconds: i64, delay_ms: impl Fn(i64, f64) -> f64) -> Vec<Packet> {
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

/// From `from` to `to` ppm after five minutes, as when a unit that lay in the sun is hosed down: all but a thirtieth within a minute and
/// a half.
fn temperature(from: f64, to: f64) -> impl Fn(f64) -> f64 {
    move |s| to + (from - to) * (-(s - 300.0).max(0.0) / 25.0).exp()
}

/// The same from one packet to the next.
fn jump(from: f64, to: f64) -> impl Fn(f64) -> f64 {
    move |s| if s < 300.0 { from } else { to }
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

/// Root mean square error in milliseconds after ten seconds, least constant removed.
fn rms_ms(packets: &[Packet], map: &mut dyn FnMut(i64, Time) -> i64) -> (f64, f64) {
    let errors: Vec<f64> = packets
        .iter()
        .map(|(device, arrival, truth)| (map(*device, *arrival) - truth) as f64 * 1e-6)
        .skip(2000)
        .collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let square = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / errors.len() as f64;
    (square.sqrt(), errors.iter().map(|e| (e - mean).abs()).fold(0.0, f64::max))
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

type Map = Box<dyn FnMut(i64, Time) -> i64>;

/// One way: method, setting, bytes held, maker.
type Method = (&'static str, &'static str, usize, fn() -> Map);

const METHODS: [Method; 5] = [
    ("raw arrival", "", 0, || Box::new(|_, arrival: Time| arrival.ns())),
    ("moving average", "10 s", 16_000, || Box::new(moving_average(2000))),
    ("moving average", "60 s", 96_000, || Box::new(moving_average(12_000))),
    ("least lag", "10 s", 0, || Box::new(least_lag(2000))),
    ("lower hull", "30-60 s", size_of::<ClockMap>(), || Box::new(hull())),
];

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut Bench) -> Result<()> {
    for (scene, delay) in
        [("USB, exponential delay 0.5 ms", usb as fn(i64, f64) -> f64), ("16 ms timer, 80 ms bursts", timer)]
    {
        let packets = packets(35.0, 600, delay);
        let packets = &packets;
        let ways = METHODS.map(|(method, setting, bytes, make)| {
            let (rms, worst) = rms_ms(packets, &mut make());
            Way::new(method, setting, rms, packets.len(), move || {
                let mut map = make();
                packets.iter().map(|(d, a, _)| map(*d, *a)).fold(0i64, i64::wrapping_add)
            })
            .holds(bytes)
            .note(format!("worst {worst:.3} ms"))
            .default_if(method == "lower hull")
        });
        bench.scene(scene, "ms rms", 0.0, ways.into());
    }
    let burst = |i: i64, u: f64| if i % 4000 < 16 { 80.0 } else { usb(i, u) };
    for (case, packets) in [
        ("device clock 499 ppm fast", packets(499.0, 600, usb)),
        ("device clock 100 ppm slow", packets(-100.0, 600, usb)),
        ("80 ms bursts every 20 s", packets(35.0, 600, burst)),
        ("no delay at all", packets(35.0, 600, |_, _| 0.0)),
        ("temperature: 100 ppm slow to 100 fast", drifting(temperature(-100.0, 100.0), 600, usb)),
        ("temperature: 100 ppm fast to 100 slow", drifting(temperature(100.0, -100.0), 600, usb)),
        ("100 ppm slow to 100 fast at once", drifting(jump(-100.0, 100.0), 600, usb)),
        ("100 ppm fast to 100 slow at once, 16 ms timer", drifting(jump(100.0, -100.0), 600, timer)),
    ] {
        let tried = METHODS.map(|(method, setting, _, make)| {
            let (rms, worst) = rms_ms(&packets, &mut make());
            let tried = Tried { default: method == "lower hull", ..Tried::rival(method, setting, worst) };
            tried.note(format!("{rms:.4} ms rms"))
        });
        bench.extreme(case, "ms", tried.into());
    }
    Ok(())
}
