//! Bytes from somebody who means harm, for as long as they like: through a terminal of the kernel into the port's own threads.
//! `BOWWAVE_HOSTILE_BYTES` says how many; an hour at 921600 baud is 331776000.

#![allow(clippy::expect_used, reason = "a test that cannot go on has failed")]

use std::{
    env,
    ffi::OsString,
    fs::{self, File},
    io::Write,
    os::unix::ffi::OsStringExt,
    path::PathBuf,
    time::{Duration, Instant},
};

use bowwave_core::event::Event;
use bowwave_devices::{report::reporting, serial::*, vectornav::CommonOutput};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

/// Bytes where nobody asks for more: as of half a minute.
const USUAL: u64 = 3_000_000;

fn terminal() -> (File, PathBuf) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
    grantpt(&master).expect("granted");
    unlockpt(&master).expect("unlocked");
    let slave = ptsname(&master, Vec::new()).expect("named").into_bytes();
    (File::from(master), PathBuf::from(OsString::from_vec(slave)))
}

fn packet(n: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    CommonOutput {
        time_startup_ns: n * 5_000_000,
        quaternion: Some([0.0, 0.0, 0.0, 1.0]),
        angular_rate: [0.0, 0.1, (n % 100) as f32 * 1e-3],
        accel: [0.0, 0.0, -9.81],
    }
    .encode(&mut bytes);
    bytes
}

/// SplitMix64 (Steele, Lea, Flood 2014).
struct HostileRandom(u64);

impl HostileRandom {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

/// Noise, headers with any groups and fields, packets with a wrong byte, cut ones, and whole ones with rates that no body turns at.
fn attack(random: &mut HostileRandom, n: u64) -> Vec<u8> {
    let noise =
        |random: &mut HostileRandom, count: u64| (0..count).map(|_| random.next() as u8).collect::<Vec<_>>();
    match random.next() % 6 {
        0 => {
            let count = random.next() % 512;
            noise(random, count)
        }
        1 => [vec![0xfa], noise(random, 5)].concat(),
        2 => vec![0xfa; (random.next() % 64) as usize],
        3 => {
            let mut bytes = packet(n);
            let at = random.next() as usize % bytes.len();
            bytes[at] ^= 1 << (random.next() % 8);
            bytes
        }
        4 => {
            let mut bytes = packet(n);
            bytes.truncate(random.next() as usize % bytes.len());
            bytes
        }
        _ => {
            let any = |random: &mut HostileRandom| f32::from_bits(random.next() as u32);
            let mut bytes = Vec::new();
            CommonOutput {
                time_startup_ns: random.next(),
                quaternion: Some([any(random), any(random), any(random), any(random)]),
                angular_rate: [any(random), any(random), any(random)],
                accel: [any(random), any(random), any(random)],
            }
            .encode(&mut bytes);
            bytes
        }
    }
}

fn resident_bytes() -> u64 {
    let statm = fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages: u64 = statm.split(' ').nth(1).and_then(|p| p.parse().ok()).unwrap_or(0);
    pages * rustix::param::page_size() as u64
}

#[test]
fn an_hour_of_hostile_bytes_costs_nothing_but_time() {
    let bytes = env::var("BOWWAVE_HOSTILE_BYTES").ok().and_then(|b| b.parse().ok()).unwrap_or(USUAL);
    let (mut master, slave) = terminal();
    let (reporter, reports) = reporting();
    let line = LineSettings { device: Some(slave), baud: Baud::Fixed(921_600), ..LineSettings::default() };
    let settings = ImuSettings { line, ..ImuSettings::default() };
    let port = ImuPort::start(settings, reporter).expect("starts");
    // Until the port is open, the terminal would answer.
    let opened = Instant::now() + Duration::from_secs(10);
    while port.status().line.status != LineStatus::Listening {
        assert!(Instant::now() < opened, "not opened: {:?}", port.status());
        std::thread::sleep(Duration::from_millis(5));
    }
    let (mut random, mut sent, mut n, mut told) = (HostileRandom(7), 0, 0, 0usize);
    let mut before = None;
    while sent < bytes {
        let some = attack(&mut random, n);
        master.write_all(&some).expect("written");
        (sent, n) = (sent + some.len() as u64, n + 1);
        if n.is_multiple_of(512) {
            port.events().try_iter().for_each(drop);
            told += reports.changes().count();
        }
        // What is allocated once is there by now.
        if before.is_none() && sent > bytes / 10 {
            before = Some(resident_bytes());
        }
    }
    let grown = resident_bytes().saturating_sub(before.unwrap_or(0));
    assert!(grown < 8 << 20, "{grown} bytes more after {sent} hostile ones");

    // The unit is itself again, and is heard.
    let until = Instant::now() + Duration::from_secs(20);
    let mut heard = 0;
    let mut number = 0;
    while heard < 50 {
        assert!(Instant::now() < until, "not heard again: {:?}", port.status());
        master.write_all(&packet(number)).expect("written");
        number += 1;
        std::thread::sleep(Duration::from_millis(5));
        let sound = |e: &Event| matches!(e, Event::Imu(s) if s.rate.length() < 1.0 && s.device_time_ns % 5_000_000 == 0);
        heard += port.events().try_iter().filter(sound).count();
    }
    let counters = port.stop().expect("stops").said.counters;
    println!("{sent} bytes: {counters:?}, {told} changes of faults");
    assert!(counters.skipped_bytes > sent / 4, "{counters:?}");
}
