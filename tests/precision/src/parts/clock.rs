//! Device clock to host clock.

use bowwave_core::{clock::ClockMap, time::Time};

use super::row;
use crate::{page::About, table::Row, timing::time_ns};

/// What is said of this part.
pub const ABOUT: About = About {
    part: "clock",
    truth: "the simulated device's own times, 200 Hz for ten minutes, one-sided delays added; the constant least delay counts as \
            no error, since the calibrated offset absorbs it",
    why: "the lower convex hull is the only one whose error does not grow with the delays' spread; it costs tens of nanoseconds \
          a packet",
};

/// One packet: device time, arrival, truth.
type Packet = (i64, Time, i64);

fn packets(ppm: f64, seconds: i64, delay_ms: impl Fn(i64, f64) -> f64) -> Vec<Packet> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    (0..seconds * 200)
        .map(|i| {
            // splitmix64: this truth shares nothing with the simulator's noise.
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            let uniform = ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64;
            let host = 5_000_000_000 + i * 5_000_000;
            let device = ((i * 5_000_000) as f64 * (1.0 + ppm * 1e-6)) as i64;
            (device, Time::from_ns(host).plus_secs(delay_ms(i, uniform) * 1e-3), host)
        })
        .collect()
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

/// The rows.
pub fn rows(repeats: usize) -> Vec<Row> {
    let mut rows = Vec::new();
    for (scene, delay) in
        [("USB, exponential delay 0.5 ms", usb as fn(i64, f64) -> f64), ("16 ms timer, 80 ms bursts", timer)]
    {
        let packets = packets(35.0, 600, delay);
        let mut add = |method: &str,
                       setting: &str,
                       bytes: usize,
                       make: &dyn Fn() -> Box<dyn FnMut(i64, Time) -> i64>| {
            let (rms, worst) = rms_ms(&packets, &mut make());
            let time = time_ns(repeats.min(9), || {
                let mut map = make();
                packets.iter().map(|(d, a, _)| map(*d, *a)).fold(0i64, i64::wrapping_add)
            }) / packets.len() as f64;
            let mut r = row("clock", scene, method, setting, rms, "ms rms", time);
            r.memory_bytes = bytes;
            r.note = format!("worst {worst:.3} ms");
            r.default = method == "lower hull";
            rows.push(r);
        };
        add("raw arrival", "", 0, &|| Box::new(|_, arrival: Time| arrival.ns()));
        add("moving average", "10 s", 16_000, &|| Box::new(moving_average(2000)));
        add("lower hull", "30-60 s", size_of::<ClockMap>() + 1024, &|| Box::new(hull()));
    }
    for (scene, ppm) in [("+500 ppm", 499.0), ("-100 ppm", -100.0)] {
        let (rms, worst) = rms_ms(&packets(ppm, 600, usb), &mut hull());
        let mut r = row("clock", scene, "lower hull", "30-60 s", rms, "ms rms", 0.0);
        (r.extreme, r.note) = (true, format!("worst {worst:.3} ms"));
        rows.push(r);
    }
    let burst = packets(35.0, 600, |i, u| if i % 4000 < 16 { 80.0 } else { usb(i, u) });
    let (rms, worst) = rms_ms(&burst, &mut hull());
    let mut r = row("clock", "80 ms bursts every 20 s", "lower hull", "30-60 s", rms, "ms rms", 0.0);
    (r.extreme, r.note) = (true, format!("worst {worst:.3} ms"));
    rows.push(r);
    rows
}
