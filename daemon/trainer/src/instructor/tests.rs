#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::{
    io::{Read, Write},
    os::unix::net::UnixStream,
    time::{Duration, Instant},
};

use bowwave_core::{engagement::Engagement, side::Side};
use bowwave_devices::clock::now;
use bowwave_link::{FromDaemon, Hello, LinkError, ToDaemon, read_from_daemon, write_to_daemon};

use super::*;

/// A port in a folder of its own, whose scenarios are good where their text is "good".
fn port(folder: &tempfile::TempDir) -> InstructorPort {
    let check = |asked: &AskedScenario| match asked.text.as_str() {
        "bad" => Err(format!("{}: line 1 is bad", asked.origin)),
        _ => Ok(()),
    };
    let socket = folder.path().join("instructor.sock");
    InstructorPort::listen(InstructorOptions { socket, check: Some(Arc::new(check)) }).unwrap()
}

fn connect(folder: &tempfile::TempDir) -> UnixStream {
    let mut stream = UnixStream::connect(folder.path().join("instructor.sock")).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    write_to_daemon(&mut stream, &ToDaemon::Hello { hello: Hello::new("test") }).unwrap();
    assert!(matches!(read_from_daemon(&mut stream).unwrap(), FromDaemon::Hello(_)));
    stream
}

/// Calls `what` until it gives something.
fn wait<T>(mut what: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = what() {
            return found;
        }
        assert!(begun.elapsed() < Duration::from_secs(5), "nothing comes");
        thread::sleep(Duration::from_millis(5));
    }
}

fn ask(stream: &mut UnixStream, message: &ToDaemon) {
    write_to_daemon(stream, message).unwrap();
}

fn refusal(stream: &mut UnixStream) -> String {
    loop {
        if let FromDaemon::Refused(why) = read_from_daemon(stream).unwrap() {
            return why;
        }
    }
}

#[test]
fn requests_reach_the_loop_and_what_is_none_is_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let mut port = port(&folder);
    let mut stream = connect(&folder);
    let next = |port: &InstructorPort| wait(|| port.requests().next());
    ask(&mut stream, &ToDaemon::Act { act: Act::Identify(Side::Hostile) });
    assert_eq!(next(&port), Request::Act(Act::Identify(Side::Hostile)));
    ask(&mut stream, &ToDaemon::Order { order: Order::Rules { rules: Engagement::Hold } });
    assert_eq!(next(&port), Request::Order(Order::Rules { rules: Engagement::Hold }));
    ask(&mut stream, &ToDaemon::Order { order: Order::Message { text: "two\nlines".to_owned() } });
    assert!(refusal(&mut stream).contains("control characters"));
    let load = |text: &str| ToDaemon::Load { origin: "a\u{1b}[2J".to_owned(), scenario: text.to_owned() };
    ask(&mut stream, &load("bad"));
    let why = refusal(&mut stream);
    assert!(why.contains("line 1 is bad") && !why.contains('\u{1b}'), "{why}");
    ask(&mut stream, &load("good"));
    assert!(matches!(next(&port), Request::Load(asked) if asked.text == "good" && !asked.is_stand_by));
    ask(&mut stream, &ToDaemon::StandBy);
    assert!(matches!(next(&port), Request::Load(asked) if asked.is_stand_by));
    port.refuse("not now");
    assert_eq!(refusal(&mut stream), "not now");
    // Nobody fetches: the queue is full, and that is said.
    (0..REQUESTS + 1).for_each(|_| ask(&mut stream, &ToDaemon::Act { act: Act::Report }));
    assert!(refusal(&mut stream).contains("too much"));
    assert_eq!(port.requests().count(), REQUESTS);
    port.begin_session(Some(Path::new("/data/hits.sqlite")), false);
    wait(|| port.mail.is_read().then_some(()));
    port.tell(now(), || Status { scenario: "x".to_owned(), ..Status::default() });
    let status = loop {
        if let FromDaemon::Status(status) = read_from_daemon(&mut stream).unwrap() {
            break status;
        }
    };
    assert_eq!((status.scenario.as_str(), status.session, status.number), ("x", 1, 1));
    assert!(status.can_load && status.journal.as_deref() == Some("/data/hits.sqlite"));
}

#[test]
fn a_frame_is_copied_only_where_one_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let port = port(&folder);
    let tap = port.tap();
    let pixels = vec![7u8; 4 * 3 * 4];
    tap.offer(1, now(), &pixels, (4, 3));
    let mut stream = connect(&folder);
    ask(&mut stream, &ToDaemon::Picture);
    wait(|| tap.is_wanted().then_some(()));
    tap.offer(2, now(), &pixels[1..], (4, 3));
    tap.offer(3, now(), &pixels, (4, 3));
    tap.offer(4, now(), &pixels, (4, 3));
    let picture = loop {
        if let FromDaemon::Picture(picture) = read_from_daemon(&mut stream).unwrap() {
            break picture;
        }
    };
    assert_eq!((picture.frame, picture.width, picture.height, picture.rgba), (3, 4, 3, pixels));
}

#[test]
fn the_newest_process_is_served_and_one_that_does_not_read_holds_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let mut port = port(&folder);
    let mut first = connect(&folder);
    let mut second = connect(&folder);
    assert!(matches!(read_from_daemon(&mut first), Err(LinkError::Closed | LinkError::Io(_))));
    ask(&mut second, &ToDaemon::Act { act: Act::Warn });
    assert_eq!(wait(|| port.requests().next()), Request::Act(Act::Warn));
    // It asks for pictures and reads none: the loop and the output thread go on at once.
    let (tap, pixels) = (port.tap(), vec![0u8; 1280 * 720 * 4]);
    let begun = Instant::now();
    for frame in 0..50 {
        if write_to_daemon(&mut second, &ToDaemon::Picture).is_err() {
            break;
        }
        thread::sleep(Duration::from_millis(2));
        tap.offer(frame, now(), &pixels, (1280, 720));
        port.told = None;
        port.tell(now(), Status::default);
    }
    assert!(begun.elapsed() < Duration::from_secs(2), "{:?}", begun.elapsed());
    drop(second);
    connect(&folder);
}

#[test]
fn other_versions_garbage_and_silence_end_the_connection_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let port = port(&folder);
    let raw = || UnixStream::connect(folder.path().join("instructor.sock")).unwrap();
    let mut other = raw();
    let hello = Hello { version: 99, program: "9.9".to_owned() };
    ask(&mut other, &ToDaemon::Hello { hello });
    assert!(matches!(read_from_daemon(&mut other).unwrap(), FromDaemon::Hello(_)));
    let why = refusal(&mut other);
    assert!(why.contains("version 99") && why.contains("programs of one version"), "{why}");
    let mut garbage = raw();
    garbage.write_all(&[0xff; 64]).unwrap();
    let mut rest = Vec::new();
    garbage.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    // The greeting, then the end.
    drop(garbage.read_to_end(&mut rest));
    let mut early = raw();
    ask(&mut early, &ToDaemon::Act { act: Act::Report });
    drop(early.read_to_end(&mut rest));
    assert_eq!(port.requests().count(), 0);
    connect(&folder);
}

#[test]
fn a_socket_that_was_left_is_replaced_and_nothing_else_is() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("instructor.sock");
    // As a process that was killed leaves it.
    drop(std::os::unix::net::UnixListener::bind(&socket).unwrap());
    let first = port(&folder);
    let again = |path: &Path| {
        let options = InstructorOptions { socket: path.to_owned(), check: None };
        InstructorPort::listen(options).map(drop).map_err(|e| format!("{e:#}"))
    };
    assert!(again(&socket).unwrap_err().contains("another trainer listens"));
    let file = folder.path().join("file");
    std::fs::write(&file, "kept").unwrap();
    assert!(again(&file).unwrap_err().contains("no socket"));
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "kept");
    assert!(again(&folder.path().join("none/x.sock")).unwrap_err().contains("is its folder there"));
    drop(first);
    assert!(!socket.exists());
}

#[test]
fn whoever_joins_before_a_session_begins_is_shown_what_is_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let mut port = port(&folder);
    port.prepare("THE SEA IS MADE");
    let mut stream = connect(&folder);
    let mut next = || loop {
        if let FromDaemon::Status(status) = read_from_daemon(&mut stream).unwrap() {
            return status;
        }
    };
    let (first, second) = (next(), next());
    assert_eq!((first.word.as_str(), first.cause.as_str()), ("GETTING READY", "THE SEA IS MADE"));
    assert!(second.number > first.number);
    port.begin_session(None, false);
    port.tell(now(), || Status { word: "READY".to_owned(), ..Status::default() });
    let third = next();
    assert!(third.word == "READY" && third.number > second.number, "{third:?}");
}
