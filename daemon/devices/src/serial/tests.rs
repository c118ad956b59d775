//! The serial line against a real pseudo-terminal.

use std::{
    fs::File,
    io::Write,
    os::unix::{ffi::OsStringExt, fs::symlink},
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use bowwave_core::{
    event::{Event, ImuSample, ShipSample},
    fault::{Change, Fault, FaultChange},
    time::Time,
};
use rustix::{
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    time::{ClockId, clock_gettime},
};

use super::{
    Baud, ImuPort, ImuSettings, LineSettings, LineStatus, QUEUE_SAMPLES, SerialError, SerialStatus, ShipPort,
    feed::IMU,
    health::{LineAction, LineHealth},
    imu_feed::{ImuFeed, ImuReport},
    reader::{BLOCKED_NS, LineReader, LineWatcher, ReaderEnds},
};
use crate::{
    clock,
    imu::{ImuDecoder, ImuFormat, streams::encode},
    nmea::line_of,
    queue,
    report::{Reports, reporting},
    vectornav::CommonOutput,
    worker::{PortLink, ThreadLife},
};

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
    wait_for(|| port.status().line.status == LineStatus::Streaming);
    let SerialStatus { line, said } = port.stop().expect("stops");
    assert_eq!((said.counters.samples, said.counters.skipped_bytes, line.overflow), (50, 50 * 8, 0));
}

#[test]
fn every_format_comes_through_the_port() {
    for format in ImuFormat::ALL {
        let (mut master, slave) = terminal();
        let port = ImuPort::open(&slave, 115_200).expect("opens");
        for n in 0..60 {
            master.write_all(&encode(format, n)).expect("written");
            std::thread::sleep(Duration::from_millis(2));
        }
        let samples = receive(&port, 59);
        assert!(samples.len() >= 59, "{format}: {}", samples.len());
        assert!(samples.is_sorted_by_key(|s| s.arrival));
        wait_for(|| port.status().line.status == LineStatus::Streaming);
        let status = port.status().said;
        assert_eq!((status.format, status.fields.accel), (Some(format), true));
        assert_eq!(port.stop().expect("stops").said.counters.skipped_bytes, 0, "{format}");
    }
}

/// Units of all formats at a rate that is tried last: health and decoder together find it, as the reader joins them.
#[test]
fn the_scan_of_rates_finds_every_format() {
    for format in ImuFormat::ALL {
        let Baud::Scan(rates) = Baud::default() else { panic!("several rates") };
        let right = rates[rates.len() - 1];
        let mut health = LineHealth::new(&Baud::default(), &IMU);
        let mut decoder = ImuDecoder::new();
        health.opened(Time::from_ns(0));
        let mut noise = 7u32;
        let mut found_ms = None;
        // What the slowest of those rates can carry: a group each 50 ms.
        for n in 0..200 {
            let now = Time::from_ns(n * 50_000_000);
            let mut bytes = encode(format, n);
            if health.baud() != right {
                for byte in &mut bytes {
                    noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    *byte = (noise >> 24) as u8;
                }
            }
            let before = decoder.counters().packets;
            decoder.samples(&bytes, now).for_each(drop);
            health.received(now, bytes.len(), decoder.counters().packets - before);
            if let LineAction::SetBaud(_) = health.tick(now, false) {
                decoder.restart();
            }
            if health.status() == LineStatus::Streaming {
                found_ms.get_or_insert(n * 50);
            }
        }
        assert_eq!((health.baud(), decoder.format()), (right, Some(format)));
        assert!(found_ms.is_some_and(|ms| ms < 4_000), "{format}: {found_ms:?} ms");
    }
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
    assert_eq!(port.stop().expect("stops").said.counters.not_finite, 2);
}

fn settings(device: &Path) -> ImuSettings {
    let line = LineSettings { device: Some(device.to_owned()), ..LineSettings::default() };
    ImuSettings { line, ..ImuSettings::default() }
}

/// Codes of what has been reported: `+` raised, `-` cleared, `!` noted.
fn codes(reports: &Reports) -> Vec<String> {
    let code = |c: FaultChange| {
        let sign = match c.change {
            Change::Raised { .. } => '+',
            Change::Cleared => '-',
            Change::Noted { .. } => '!',
        };
        format!("{sign}{}", c.fault.code())
    };
    reports.changes().map(code).collect()
}

/// Waits until the port has settled on `line`.
fn settle(port: &ImuPort, line: LineStatus) {
    wait_for(|| port.status().line.status == line);
}

/// CPU time that this process has used, nanoseconds.
fn cpu_ns() -> i64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec * 1_000_000_000 + t.tv_nsec
}

#[test]
fn an_unplugged_unit_is_found_again_under_another_name() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let link = folder.path().join("usb-FTDI-if00-port0");
    let (mut master, slave) = terminal();
    symlink(&slave, &link).expect("link");
    let (reporter, reports) = reporting();
    let port = ImuPort::start(settings(&link), reporter).expect("starts");
    settle(&port, LineStatus::Listening);
    (0..3).for_each(|n| master.write_all(&packet(n)).expect("written"));
    settle(&port, LineStatus::Streaming);
    assert_eq!(port.status().line.open.as_ref().map(|open| open.node.as_path()), Some(slave.as_path()));
    assert!(codes(&reports).is_empty(), "nothing wrong so far");
    // What the line still holds when it is pulled is lost with it.
    assert_eq!(receive(&port, 3).len(), 3);

    let (unplugged, cpu_before) = (clock::now(), cpu_ns());
    // The new terminal first: the kernel would give it the old one's name.
    let (mut master2, slave2) = terminal();
    drop(master);
    settle(&port, LineStatus::Searching);
    std::fs::remove_file(&link).expect("gone");
    wait_for(|| clock::now().ns_since(unplugged) > 400_000_000);
    let lost = reports.changes().next().expect("reported");
    assert_eq!(lost.fault, Fault::ImuLost);
    assert!(lost.time.ns_since(unplugged) < 100_000_000, "noticed at once");
    let waiting_ns = clock::now().ns_since(unplugged);
    // All tests of this process together: a busy loop alone would take all of one processor.
    eprintln!("CPU while it is gone: {:.1} %", (cpu_ns() - cpu_before) as f64 / waiting_ns as f64 * 100.0);

    symlink(&slave2, &link).expect("link");
    let plugged = clock::now();
    settle(&port, LineStatus::Listening);
    (0..3).for_each(|n| master2.write_all(&packet(n)).expect("written"));
    settle(&port, LineStatus::Streaming);
    assert!(clock::now().ns_since(plugged) < 1_000_000_000, "back within a second");
    assert_eq!(receive(&port, 3).len(), 3);
    wait_for(|| port.status().line.open.as_ref().map(|open| open.node.as_path()) == Some(slave2.as_path()));
    let codes = codes(&reports);
    assert!(codes.contains(&"-IMU_LOST".to_owned()) && codes.contains(&"!IMU_RENUM".to_owned()), "{codes:?}");
    assert_eq!(port.stop().expect("stops").line.opened, 2);
}

#[test]
fn a_port_that_is_not_there_yet_is_waited_for_without_a_busy_loop() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let link = folder.path().join("imu");
    let (reporter, reports) = reporting();
    let port = ImuPort::start(settings(&link), reporter).expect("absence is no error of the start");
    wait_for(|| reports.changes().any(|c| c.fault == Fault::ImuLost));
    assert_eq!(port.status().line.status, LineStatus::Searching);
    let (mut master, slave) = terminal();
    symlink(&slave, &link).expect("link");
    settle(&port, LineStatus::Listening);
    master.write_all(&packet(1)).expect("written");
    master.write_all(&packet(2)).expect("written");
    settle(&port, LineStatus::Streaming);
    wait_for(|| codes(&reports).contains(&"-IMU_LOST".to_owned()));
    let before = clock::now();
    port.stop().expect("stops");
    assert!(clock::now().ns_since(before) < 200_000_000);
}

#[test]
fn the_thread_lives_in_every_state() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (reporter, reports) = reporting();
    let port = ImuPort::start(settings(&folder.path().join("imu")), reporter).expect("starts");
    let begin = clock::now();
    while clock::now().ns_since(begin) < 500_000_000 {
        std::thread::sleep(Duration::from_millis(10));
        assert!(clock::now().ns_since(reports.last_beat()) < 250_000_000);
    }
    port.stop().expect("stops");
}

type ImuLink = Arc<PortLink<SerialStatus<ImuReport>>>;

fn link() -> ImuLink {
    PortLink::new(SerialStatus::default()).expect("a link")
}

/// A reader that is kept from running by others is not one that the port keeps.
#[test]
fn a_reader_without_a_processor_is_not_blocked() {
    let stop = Arc::new(AtomicBool::new(false));
    let life = Arc::new(ThreadLife::new(clock::now()));
    let (begun, begins) = std::sync::mpsc::channel();
    let busy = std::thread::spawn({
        let (stop, life) = (Arc::clone(&stop), Arc::clone(&life));
        move || {
            life.begin();
            life.alive(clock::now());
            begun.send(()).expect("is awaited");
            // Always ready to run, as a thread that waits for a processor.
            while !stop.load(Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        }
    });
    begins.recv().expect("runs");
    let link = link();
    let (reporter, reports) = reporting();
    let watcher = LineWatcher::new(Arc::clone(&link), life, reporter, &IMU);
    let watching = std::thread::spawn(move || watcher.run());
    std::thread::sleep(Duration::from_nanos(2 * BLOCKED_NS as u64));
    assert_eq!(codes(&reports), Vec::<String>::new());
    stop.store(true, Ordering::Relaxed);
    busy.join().expect("ends");
    // Its thread is gone without a word: now nobody reads.
    wait_for(|| codes(&reports).contains(&"+IMU_BLOCKED".to_owned()));
    link.ask_to_stop();
    watching.join().expect("ends");
}

/// A reader that does not move, as one that a driver has swallowed.
#[test]
fn a_call_that_does_not_return_is_told_within_200_ms() {
    let (link, life) = (link(), Arc::new(ThreadLife::new(clock::now())));
    let (reporter, reports) = reporting();
    let watcher = LineWatcher::new(Arc::clone(&link), Arc::clone(&life), reporter, &IMU);
    let begin = clock::now();
    let thread = std::thread::spawn(move || watcher.run());
    let raised = loop {
        if let Some(change) = reports.changes().next() {
            break change;
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    assert_eq!(raised.fault, Fault::ImuBlocked);
    assert!(raised.time.ns_since(begin) >= BLOCKED_NS);
    assert!(clock::now().ns_since(reports.last_beat()) < 250_000_000, "the port lives on");
    life.alive(clock::now());
    wait_for(|| codes(&reports).contains(&"-IMU_BLOCKED".to_owned()));
    link.ask_to_stop();
    thread.join().expect("ends");
}

/// Looking for a port and opening it may take long by themselves: the pause after them is no part of that, nor is what
/// follows an opening.
#[test]
fn a_reader_that_searches_gives_a_sign_of_life_before_it_pauses() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (_master, slave) = terminal();
    for device in [folder.path().join("not-there"), slave] {
        let (link, life) = (link(), Arc::new(ThreadLife::new(Time::from_ns(0))));
        // The pause ends at once.
        link.waker().notify();
        let (queue, _events) = queue::newest(1);
        let settings = settings(&device);
        let feed = ImuFeed::new(&settings);
        let ends = ReaderEnds { link, life: Arc::clone(&life), reporter: reporting().0, queue };
        let mut reader = LineReader::new(settings.line, feed, None, ends);
        let begin = clock::now();
        reader.search();
        assert!(life.last() >= begin, "{}", device.display());
    }
}

/// Hostile bytes as fast as the line takes them: no panic, bounded memory, and the unit is heard again at once.
#[test]
fn a_line_full_of_garbage_recovers() {
    let (mut master, slave) = terminal();
    let (reporter, reports) = reporting();
    let mut fixed = settings(&slave);
    fixed.line.baud = Baud::Fixed(115_200);
    let port = ImuPort::start(fixed, reporter).expect("starts");
    settle(&port, LineStatus::Listening);
    let mut seed = 1u32;
    let begin = clock::now();
    while clock::now().ns_since(begin) < 900_000_000 {
        let garbage: Vec<u8> = (0..512)
            .map(|_| {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                if seed >> 30 == 0 { 0xfa } else { (seed >> 16) as u8 }
            })
            .collect();
        master.write_all(&garbage).expect("written");
        std::thread::sleep(Duration::from_millis(1));
    }
    wait_for(|| port.status().line.status == LineStatus::Garbled);
    assert!(codes(&reports).contains(&"+IMU_BAUD".to_owned()));
    wait_for(|| {
        master.write_all(&packet(1)).expect("written");
        port.status().line.status == LineStatus::Streaming
    });
    assert!(codes(&reports).contains(&"-IMU_BAUD".to_owned()));
    port.stop().expect("stops");
}

#[test]
fn a_silent_unit_is_lost_after_100_ms_and_back_with_its_first_packet() {
    let (mut master, slave) = terminal();
    let (reporter, reports) = reporting();
    let port = ImuPort::start(settings(&slave), reporter).expect("starts");
    settle(&port, LineStatus::Listening);
    (0..5).for_each(|n| master.write_all(&packet(n)).expect("written"));
    let last = clock::now();
    settle(&port, LineStatus::Silent);
    let lost = reports.changes().find(|c| c.fault == Fault::ImuLost).expect("reported");
    assert!((100_000_000..250_000_000).contains(&lost.time.ns_since(last)), "{}", lost.time.ns_since(last));
    master.write_all(&packet(9)).expect("written");
    settle(&port, LineStatus::Streaming);
    port.stop().expect("stops");
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
    wait_for(|| port.status().said.counters.samples == u64::from(count));
    assert_eq!(port.status().line.overflow, 500);
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
    let _held = ImuPort::open(&slave, 115_200).expect("opens");
    // Locked for root, too, who may open what is exclusive.
    assert!(matches!(refused(&slave, 115_200), SerialError::Busy { .. }));
    let (reporter, _) = reporting();
    let mut none = ImuSettings::default();
    none.line.baud = Baud::Scan(Vec::new());
    assert!(matches!(ImuPort::start(none, reporter), Err(SerialError::NoRates)));
}

#[test]
fn the_ports_of_this_machine_are_listed() {
    for port in super::list().expect("listed") {
        assert!(port.node.starts_with("/dev") && !port.kind.is_empty(), "{port:?}");
    }
}

/// A line of the ship's instruments, as sent.
fn hdt(degrees: f64) -> Vec<u8> {
    let sample = ShipSample {
        arrival: Time::MIN,
        heading: Some(degrees.to_radians()),
        roll: None,
        pitch: None,
        heading_sigma: None,
        reduced: false,
    };
    line_of(&sample).into_bytes()
}

#[test]
fn a_ship_feed_is_found_by_its_pattern_lost_and_found_again() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (mut master, slave) = terminal();
    symlink(&slave, folder.path().join("usb-Moxa_A-port0")).expect("link");
    let (reporter, reports) = reporting();
    let port = ShipPort::start(LineSettings::ship(folder.path().join("usb-Moxa_*-port0")), reporter)
        .expect("starts");
    wait_for(|| port.status().line.status == LineStatus::Listening);
    master.write_all(b"$GPZDA,1,2*00\r\nnoise").expect("written");
    for n in 0..20 {
        master.write_all(&hdt(350.0 + f64::from(n))).expect("written");
        std::thread::sleep(Duration::from_millis(5));
    }
    wait_for(|| port.status().said.headings == 20);
    let headings: Vec<_> = port
        .events()
        .try_iter()
        .map(|event| match event {
            Event::Ship(sample) => sample.heading.expect("a heading").to_degrees().round(),
            other => panic!("not of a ship: {other:?}"),
        })
        .collect();
    assert_eq!(headings, (0..20).map(|n| f64::from((350 + n) % 360)).collect::<Vec<_>>());
    let status = port.status();
    assert!(status.said.period_s.is_some_and(|s| (0.003..0.1).contains(&s)), "{:?}", status.said);
    assert_eq!(status.line.status, LineStatus::Streaming);
    // Another terminal first: the kernel would give it the old one's name.
    let (mut master2, slave2) = terminal();
    drop(master);
    wait_for(|| port.status().line.status == LineStatus::Searching);
    std::fs::remove_file(folder.path().join("usb-Moxa_A-port0")).expect("gone");
    symlink(&slave2, folder.path().join("usb-Moxa_B-port0")).expect("link");
    wait_for(|| port.status().line.status == LineStatus::Listening);
    (0..3).for_each(|_| master2.write_all(&hdt(5.0)).expect("written"));
    wait_for(|| port.status().line.status == LineStatus::Streaming);
    let codes = codes(&reports);
    assert_eq!(codes, ["+SHIP_LOST", "!SHIP_RENUM", "-SHIP_LOST"]);
    assert_eq!(port.stop().expect("stops").line.opened, 2);
}

#[test]
fn a_ship_feed_without_a_valid_heading_is_told() {
    let (mut master, slave) = terminal();
    let (reporter, reports) = reporting();
    let settings = LineSettings { baud: Baud::Fixed(4_800), ..LineSettings::ship(slave) };
    let port = ShipPort::start(settings, reporter).expect("starts");
    wait_for(|| port.status().line.status == LineStatus::Listening);
    wait_for(|| {
        master.write_all(b"$HEHDT,,T*01\r\n").expect("written");
        std::thread::sleep(Duration::from_millis(50));
        codes(&reports).contains(&"+SHIP_INVALID".to_owned())
    });
    master.write_all(&hdt(5.0)).expect("written");
    wait_for(|| codes(&reports).contains(&"-SHIP_INVALID".to_owned()));
    port.stop().expect("stops");
}
