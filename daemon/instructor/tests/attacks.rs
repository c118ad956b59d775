//! Whoever is on the network tries to get in, to steer, or to stop the server.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod support;

use std::{
    io::{Read as _, Write as _},
    net::TcpStream,
    os::unix::net::UnixListener,
    time::{Duration, Instant},
};

use bowwave_instructor::{InstructorOptions, Limits};
use support::{Answer, Server, memory_mb};
use tungstenite::Message;

fn hasty(options: &mut InstructorOptions) {
    let short = Duration::from_millis(600);
    options.limits =
        Limits { head_timeout: short, request_timeout: short, silence_max: short, ..Limits::default() };
}

#[test]
fn tokens_that_are_wrong_old_or_revoked_let_nobody_in() {
    let server = Server::with(true, |options| options.limits.session = Duration::from_secs(2));
    assert_eq!(server.ask("POST", "/login", None, "bowwave_wrong").status, 401);
    assert_eq!(server.ask("POST", "/login", None, "").status, 401);
    assert_eq!(server.ask("GET", "/api/scenarios", Some("bowwave=1"), "").status, 401);

    // Old: the session is over after two seconds, and so is its WebSocket.
    let cookie = server.login(&server.anna);
    let mut page = server.page(Some(&cookie));
    page.say(r#"{"kind":"take_control"}"#);
    page.wait_for("control", |news| news["is_own"] == true);
    page.wait("ended");
    page.ends();
    assert_eq!(server.ask("GET", "/api/scenarios", Some(&cookie), "").status, 401);
    let mut watcher = server.page(Some(&cookie));
    assert!(watcher.wait("you")["name"].is_null());
    watcher.wait_for("control", |news| news["holder"].is_null());
    server.serves();
}

#[test]
fn a_stolen_token_is_revoked_and_its_sessions_end_at_once() {
    let server = Server::start();
    let stolen = server.tokens.add("stolen").unwrap();
    std::thread::sleep(Duration::from_millis(1300));
    let cookie = server.login(&stolen);
    let mut thief = server.page(Some(&cookie));
    thief.say(r#"{"kind":"take_control"}"#);
    thief.wait_for("control", |news| news["is_own"] == true);
    let begun = Instant::now();
    server.tokens.revoke("stolen").unwrap();
    thief.wait("ended");
    thief.ends();
    assert!(begun.elapsed() < Duration::from_secs(3), "{:?}", begun.elapsed());
    assert_eq!(server.ask("GET", "/api/scenarios", Some(&cookie), "").status, 401);
    assert_eq!(server.ask("POST", "/login", None, &stolen).status, 401);
    let mut again = server.page(Some(&cookie));
    again.say(r#"{"kind":"take_control"}"#);
    again.wait("refused");
    let cookie = server.login(&server.anna);
    server.page(Some(&cookie)).wait("you");
}

#[test]
fn requests_for_other_hosts_or_from_other_pages_are_refused() {
    let server = Server::start();
    let own = server.address.to_string();
    let cookie = server.login(&server.anna);
    let ask = |method: &str, host: &str, more: &str| {
        let text = format!(
            "{method} /logout HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\nConnection: close\r\n{more}\r\n"
        );
        Answer::of(&server.raw(text.as_bytes())).status
    };
    let port = server.address.port();
    for host in [
        "evil.example",
        &format!("evil.example:{port}"),
        "127.0.0.1",
        &format!("127.0.0.1.evil.example:{port}"),
        "",
    ] {
        assert_eq!(ask("POST", host, &format!("Origin: http://{host}\r\n")), 421, "{host:?}");
        assert_eq!(ask("GET", host, ""), 421, "{host:?}");
    }
    for origin in
        ["http://evil.example", "null", &format!("https://{own}"), &format!("http://localhost:{port}"), ""]
    {
        assert_eq!(ask("POST", &own, &format!("Origin: {origin}\r\n")), 403, "{origin:?}");
        assert!(server.page_from(Some(&cookie), origin).is_err(), "{origin:?}");
    }
    assert_eq!(ask("POST", &own, ""), 403, "without an origin");
    // Twice a host, and another host in the request's own line.
    assert_eq!(ask("GET", &own, "Host: evil.example\r\n"), 400);
    let text = format!("GET http://evil.example/ HTTP/1.1\r\nHost: {own}\r\nConnection: close\r\n\r\n");
    assert_eq!(Answer::of(&server.raw(text.as_bytes())).status, 421);
    assert_eq!(server.ask("GET", "/api/scenarios", Some(&cookie), "").status, 200, "nobody was logged out");
    let answer = server.ask("GET", "/", None, "");
    for header in [
        "content-security-policy: default-src 'none'; script-src 'self';",
        "x-content-type-options: nosniff",
        "referrer-policy: no-referrer",
        "cross-origin-opener-policy: same-origin",
        "cross-origin-resource-policy: same-origin",
    ] {
        assert!(answer.head.contains(header), "{header} in {}", answer.head);
    }
    let missing = server.ask("GET", "/nowhere", None, "");
    assert!(missing.status == 404 && missing.head.contains("content-security-policy"), "{}", missing.head);
    let login = server.ask("POST", "/login", None, &server.anna);
    assert!(
        login.head.contains("httponly; samesite=strict") && login.head.contains("cache-control: no-store")
    );
}

#[test]
fn no_path_leads_to_a_file() {
    let server = Server::start();
    std::fs::create_dir_all(server.folder.path().join("library")).unwrap();
    std::fs::write(server.folder.path().join("library/x.toml"), "name = \"x\"").unwrap();
    std::fs::write(server.folder.path().join("secret.toml"), "secret").unwrap();
    let cookie = server.login(&server.anna);
    let mut page = server.page(Some(&cookie));
    page.say(r#"{"kind":"take_control"}"#);
    page.wait_for("control", |news| news["is_own"] == true);
    assert_eq!(server.ask("GET", "/api/scenarios/own/x", Some(&cookie), "").status, 200);
    for path in [
        "../secret",
        "..%2fsecret",
        "%2e%2e%2fsecret",
        "%252e%252e%252fsecret",
        "..%5csecret",
        "....//secret",
        "x%00",
        "%c0%ae%c0%ae/secret",
        "x.toml",
        "/etc/passwd",
        "%2fetc%2fpasswd",
        "..",
        ".",
        "x/../../secret",
        "%ff",
        &"a".repeat(65),
    ] {
        for base in ["/api/scenarios/own", "/assets", "/review", "/api/scenarios/built-in", ""] {
            let answer = server.ask("GET", &format!("{base}/{path}"), Some(&cookie), "");
            assert!((400..500).contains(&answer.status), "{base}/{path}: {}", answer.status);
            assert!(!answer.body.contains("root:") && answer.body != "secret", "{base}/{path}");
        }
        let put = server.ask("PUT", &format!("/api/scenarios/own/{path}"), Some(&cookie), "name = \"y\"");
        assert!((400..500).contains(&put.status), "PUT {path}: {}", put.status);
    }
    assert_eq!(std::fs::read_to_string(server.folder.path().join("secret.toml")).unwrap(), "secret");
    assert_eq!(std::fs::read_dir(server.folder.path().join("library")).unwrap().count(), 1);
    let names_a_file = "[[boat]]\nname = \"a\"\nmodel = \"../../etc/x.glb\"\ncourse = \"still\"\nrange_m = 500\nbearing_deg = 0\nheading_deg = 0\n";
    let start = server.ask("POST", "/api/start/written/x", Some(&cookie), names_a_file);
    assert!(start.status == 422 && start.body.contains("without folders"), "{} {}", start.status, start.body);
}

#[test]
fn what_is_too_large_is_refused_with_bounded_memory() {
    let server = Server::with(true, hasty);
    let own = server.address;
    let cookie = server.login(&server.anna);
    let before = memory_mb();
    let large = "x".repeat(3 << 20);
    assert_eq!(server.ask("POST", "/login", None, &large[..2000]).status, 413);
    let check = server.ask("POST", "/api/check", Some(&cookie), &large);
    assert!(matches!(check.status, 0 | 413), "{}", check.status);
    // A length that is a lie, and one that is none.
    let head = format!(
        "POST /api/check HTTP/1.1\r\nHost: {own}\r\nOrigin: http://{own}\r\nCookie: {cookie}\r\nConnection: close\r\n"
    );
    for length in ["99999999999", "18446744073709551616", "-1", "x"] {
        let answer = Answer::of(&server.raw(format!("{head}Content-Length: {length}\r\n\r\nabc").as_bytes()));
        assert!((400..500).contains(&answer.status), "{length}: {}", answer.status);
    }
    // Heads: one long line, many lines, a long path.
    let long = format!("GET / HTTP/1.1\r\nHost: {own}\r\nX: {}\r\n\r\n", "y".repeat(200_000));
    let many = format!("GET / HTTP/1.1\r\nHost: {own}\r\n{}\r\n", "X: y\r\n".repeat(5000));
    let path = format!("GET /{} HTTP/1.1\r\nHost: {own}\r\n\r\n", "z".repeat(200_000));
    for text in [long, many, path] {
        let status = Answer::of(&server.raw(text.as_bytes())).status;
        assert!(matches!(status, 0 | 400..500), "{status}");
    }
    // WebSocket messages: too long, in many parts, not of text, too many.
    for _ in 0..4 {
        let mut page = server.page(Some(&cookie));
        let _ = page.socket.send(Message::text(&large[..1 << 20]));
        page.ends();
    }
    let mut page = server.page(Some(&cookie));
    page.socket.send(Message::binary(vec![0; 100])).unwrap();
    page.ends();
    let mut page = server.page(Some(&cookie));
    for _ in 0..1000 {
        if page.socket.send(Message::text(r#"{"kind":"ping","t":1}"#)).is_err() {
            break;
        }
    }
    page.ends();
    let grown = memory_mb().saturating_sub(before);
    assert!(grown < 150, "{grown} MB more");
    server.serves();
}

#[test]
fn slow_and_many_connections_end_or_are_not_taken() {
    let server = Server::with(true, hasty);
    let ends = |mut stream: TcpStream, within: Duration| {
        let begun = Instant::now();
        let mut rest = Vec::new();
        let _ = stream.read_to_end(&mut rest);
        assert!(begun.elapsed() < within, "{:?}", begun.elapsed());
        String::from_utf8_lossy(&rest).into_owned()
    };
    let within = Duration::from_secs(5);
    // Nothing at all, half a head, a head a byte at a time, half a body, and nothing after an answer.
    ends(server.connect(), within);
    let mut half = server.connect();
    half.write_all(b"GET / HTTP/1.1\r\nHo").unwrap();
    ends(half, within);
    let mut slow = server.connect();
    let begun = Instant::now();
    while begun.elapsed() < within && slow.write_all(b"x").is_ok() {
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(begun.elapsed() < within, "a byte at a time goes on");
    let mut body = server.connect();
    let own = server.address;
    write!(
        body,
        "POST /login HTTP/1.1\r\nHost: {own}\r\nOrigin: http://{own}\r\nContent-Length: 100\r\n\r\nx"
    )
    .unwrap();
    assert!(ends(body, within).contains("408"));
    let mut idle = server.connect();
    write!(idle, "GET / HTTP/1.1\r\nHost: {own}\r\n\r\n").unwrap();
    assert!(ends(idle, within).contains("200"));
    // A silent WebSocket.
    let silent = server.page(None);
    let begun = Instant::now();
    silent.ends();
    assert!(begun.elapsed() < within);
}

#[test]
fn connections_are_bounded_by_address() {
    let server = Server::start();
    let open: Vec<TcpStream> = (0..40).map(|_| server.connect()).collect();
    std::thread::sleep(Duration::from_millis(300));
    let mut refused = 0;
    for mut stream in open {
        stream.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        refused += usize::from(matches!(stream.read(&mut [0]), Ok(0) | Err(_)) && is_closed(&mut stream));
    }
    assert!(refused >= 24, "{refused} of 40 were refused");
    std::thread::sleep(Duration::from_millis(300));
    server.serves();
}

fn is_closed(stream: &mut TcpStream) -> bool {
    match stream.read(&mut [0]) {
        Ok(read) => read == 0,
        Err(error) => !matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut),
    }
}

#[test]
fn garbage_ends_connections_and_nothing_else() {
    let server = Server::with(true, hasty);
    let mut noise = 7u32;
    let mut byte = || {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (noise >> 24) as u8
    };
    for length in [1usize, 10, 100, 1000, 100_000] {
        let bytes: Vec<u8> = (0..length).map(|_| byte()).collect();
        let status = Answer::of(&server.raw(&bytes)).status;
        assert!(matches!(status, 0 | 400..500), "{status}");
    }
    // A TLS greeting, HTTP/2, and a WebSocket that breaks its protocol.
    for bytes in [&b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"[..], b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"] {
        let status = Answer::of(&server.raw(bytes)).status;
        assert!(matches!(status, 0 | 400..=505), "{status}");
    }
    for _ in 0..10 {
        let mut page = server.page(None);
        let bytes: Vec<u8> = (0..300).map(|_| byte()).collect();
        page.socket.get_mut().write_all(&bytes).unwrap();
        page.ends();
    }
    let mut page = server.page(None);
    for text in ["", "null", "[", "{\"kind\":\"order\"}", "\u{0}", &"[".repeat(10_000)] {
        page.say(text);
        page.wait("refused");
    }
    server.serves();
}

#[test]
fn after_garbage_the_trainer_is_joined_again() {
    let mut server = Server::with(false, |_| {});
    let mut page = server.page(None);
    page.wait_for("link", |news| news["joined"] == false);
    let listener = UnixListener::bind(&server.socket).unwrap();
    let garbage: [&[u8]; 5] = [
        &[0xff; 4096],
        &[0, 0, 0, 0, 0],
        &[4, 0, 0, 0, 1, 1, 2, 3, 4],
        b"HTTP/1.1 200 OK\r\n\r\n",
        &[0xff, 0xff, 0x0f, 0, 0],
    ];
    for bytes in garbage {
        let (mut peer, _) = listener.accept().unwrap();
        let _ = peer.write_all(bytes);
    }
    drop(listener);
    server.trainer = Some(support::trainer::FakeTrainer::start(&server.socket, None).unwrap());
    page.say(r#"{"kind":"ping","t":1}"#);
    page.wait_for("link", |news| news["joined"] == true);
    page.wait("status");
    server.serves();
}

#[test]
fn wrong_tokens_are_slowed_down_in_words() {
    let server = Server::start();
    for _ in 0..5 {
        assert_eq!(server.ask("POST", "/login", None, "bowwave_guess").status, 401);
    }
    let answer = server.ask("POST", "/login", None, "bowwave_guess");
    assert!(answer.status == 429 && answer.body.contains("wait"), "{} {}", answer.status, answer.body);
    assert_eq!(server.ask("POST", "/login", None, &server.anna).status, 429, "not even the right one");
    server.serves();
}
