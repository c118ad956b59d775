//! The serial line against a real pseudo-terminal.

use std::{
    fs::File,
    io::Write,
    os::unix::ffi::OsStringExt,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use bowwave_core::event::{Event, ImuSample};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::{ImuPort, LineStatus, QUEUE_SAMPLES, SerialError};
use crate::{clock, vectornav::CommonOutput};

/// A pseudo-terminal's master and the path of its slave.
fn terminal() -> (File, PathBuf) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
    grantpt(&master).expect("granted");
    unlockpt(&master).expect("unlocked");
    let slave = ptsname(&master, Vec::new()).expect("named").into_bytes();
    (File::from(master), PathBuf::from(std::ffi::OsString::from_vec(slave)))
}

fn packet(n: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let output = CommonOutput {
        time_startup_ns: u64::from(n) * 5_000_000,
        quaternion: Some([0.0, 0.0, 0.0, 1.0]),
        angular_rate: [0.0, 0.0, n as f32],
        accel: [0.0, 0.0, -9.81],
    };
    output.encode(&mut bytes);
    bytes
}

/// Samples until there are `count` or two seconds have passed.
fn receive(port: &ImuPort, count: usize) -> Vec<ImuSample> {
    let end = Instant::now() + Duration::from_secs(2);
    let mut samples = Vec::new();
    while samples.len() < count {
        match port.events().recv_deadline(end) {
            Ok(Event::Imu(sample)) => samples.push(sample),
            Ok(other) => panic!("not a sample: {other:?}"),
            Err(_) => break,
        }
    }
    samples
}

fn wait_for(mut done: impl FnMut() -> bool) {
    let end = Instant::now() + Duration::from_secs(10);
    while !done() {
        assert!(Instant::now() < end, "did not happen within 10 s");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn bytes_become_stamped_samples() {
    let (mut master, slave) = terminal();
    let port = ImuPort::open(&slave, 921_600).expect("opens");
    let before = clock::now();
    for n in 0..50 {
        master.write_all(b"\x0a\xfa$GPRMC").expect("written");
        master.write_all(&packet(n)).expect("written");
    }
    let samples = receive(&port, 50);
    let after = clock::now();
    assert_eq!(samples.len(), 50);
    for (n, sample) in samples.iter().enumerate() {
        assert_eq!(sample.device_time_ns, n as i64 * 5_000_000);
        assert!((before..=after).contains(&sample.arrival));
    }
    assert!(samples.is_sorted_by_key(|s| s.arrival));
    assert_eq!(port.status(), LineStatus::Open);
    let counters = port.stop().expect("stops");
    assert_eq!((counters.imu.samples, counters.imu.skipped_bytes, counters.overflow), (50, 50 * 8, 0));
}

#[test]
fn numbers_that_are_not_finite_are_dropped_and_counted() {
    let (mut master, slave) = terminal();
    let port = ImuPort::open(&slave, 115_200).expect("opens");
    let bad = CommonOutput {
        time_startup_ns: 1,
        quaternion: Some([0.0; 4]),
        angular_rate: [f32::NAN, 0.0, 0.0],
        accel: [0.0, 0.0, f32::INFINITY],
    };
    let mut bytes = Vec::new();
    bad.encode(&mut bytes);
    CommonOutput { angular_rate: [0.0; 3], accel: [0.0; 3], ..bad }.encode(&mut bytes);
    bytes.extend(packet(7));
    master.write_all(&bytes).expect("written");
    assert_eq!(receive(&port, 1).iter().map(|s| s.device_time_ns).collect::<Vec<_>>(), [35_000_000]);
    assert_eq!(port.stop().expect("stops").imu.not_finite, 2);
}

#[test]
fn a_hang_up_is_a_status_and_no_busy_loop() {
    let (mut master, slave) = terminal();
    let port = ImuPort::open(&slave, 115_200).expect("opens");
    master.write_all(&packet(1)).expect("written");
    assert_eq!(receive(&port, 1).len(), 1);
    drop(master);
    wait_for(|| port.status() != LineStatus::Open);
    assert_eq!(port.status(), LineStatus::HungUp);
    port.stop().expect("a line that hung up still stops");
}

/// Nobody drains: memory stays bounded, the newest samples remain.
#[test]
fn the_oldest_samples_give_way() {
    let (mut master, slave) = terminal();
    let port = ImuPort::open(&slave, 921_600).expect("opens");
    let count = QUEUE_SAMPLES as u32 + 500;
    for n in 0..count {
        master.write_all(&packet(n)).expect("written");
    }
    wait_for(|| port.counters().imu.samples == u64::from(count));
    assert_eq!(port.counters().overflow, 500);
    let samples = receive(&port, QUEUE_SAMPLES);
    assert_eq!(samples.first().map(|s| s.device_time_ns), Some(500 * 5_000_000));
    assert_eq!(samples.last().map(|s| s.device_time_ns), Some(i64::from(count - 1) * 5_000_000));
    port.stop().expect("stops");
}

#[test]
fn what_cannot_be_opened_is_refused_in_words() {
    let refused = |node: &Path, baud| match ImuPort::open(node, baud) {
        Ok(_) => panic!("{} opened", node.display()),
        Err(e) => e,
    };
    let absent = refused(Path::new("/dev/ttyUSB-not-there"), 115_200);
    assert!(matches!(absent, SerialError::NotFound { .. }), "{absent}");
    assert!(absent.to_string().starts_with("no serial port /dev/ttyUSB-not-there: ports here: "), "{absent}");
    let none = refused(Path::new("/dev/null"), 115_200);
    assert!(matches!(none, SerialError::Open { .. }), "{none}");
    let (_master, slave) = terminal();
    assert!(matches!(refused(&slave, 0), SerialError::Baud { baud: 0 }));
}

#[test]
fn the_ports_of_this_machine_are_listed() {
    for port in super::list().expect("listed") {
        assert!(port.node.starts_with("/dev") && !port.kind.is_empty(), "{port:?}");
    }
}
