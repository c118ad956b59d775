//! A server with a trainer that is none, and clients that speak to it.

#![allow(dead_code, reason = "each test file uses some of it")]

use std::{
    io::{Read as _, Write as _},
    net::{SocketAddr, TcpStream},
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bowwave_instructor::{Instructor, InstructorOptions, TokenFile};
use serde_json::Value;
use tungstenite::{Message, WebSocket, client::IntoClientRequest as _, protocol::WebSocketConfig};

#[path = "../../examples/fake/trainer.rs"]
pub mod trainer;

use trainer::FakeTrainer;

/// A server with a trainer that is none.
pub struct Server {
    pub address: SocketAddr,
    pub tokens: TokenFile,
    /// The token of anna.
    pub anna: String,
    pub trainer: Option<FakeTrainer>,
    pub socket: PathBuf,
    pub folder: tempfile::TempDir,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// With a trainer.
    pub fn start() -> Self {
        Self::with(true, |_| {})
    }

    /// With other options.
    pub fn with(has_trainer: bool, change: impl FnOnce(&mut InstructorOptions)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("socket");
        let mut options = InstructorOptions::new(&socket);
        options.bind = "127.0.0.1:0".parse().unwrap();
        options.library = Some(folder.path().join("library"));
        let tokens = TokenFile::new(folder.path().join("tokens"));
        let anna = tokens.add("anna").unwrap();
        options.tokens = Some(tokens.path().to_owned());
        change(&mut options);
        let trainer = has_trainer.then(|| FakeTrainer::start(&socket, None).unwrap());
        let instructor = Instructor::bind(options).unwrap();
        let address = instructor.address();
        let stop = Arc::new(AtomicBool::new(false));
        let thread = thread::spawn({
            let stop = Arc::clone(&stop);
            move || instructor.serve(|| stop.load(Ordering::Relaxed)).unwrap()
        });
        Self { address, tokens, anna, trainer, socket, folder, stop, thread: Some(thread) }
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream.set_write_timeout(Some(Duration::from_secs(20))).unwrap();
        stream
    }

    /// Sends bytes and reads until the server ends the connection.
    pub fn raw(&self, bytes: &[u8]) -> String {
        let mut stream = self.connect();
        // The server may have ended it already.
        let _ = stream.write_all(bytes);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// A request of the page itself, with the cookie of a session: status, head and body.
    pub fn ask(&self, method: &str, path: &str, cookie: Option<&str>, body: &str) -> Answer {
        let host = self.address;
        let cookie = cookie.map_or_else(String::new, |cookie| format!("Cookie: {cookie}\r\n"));
        let origin = if method == "GET" { String::new() } else { format!("Origin: http://{host}\r\n") };
        let head =
            format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{origin}{cookie}");
        Answer::of(&self.raw(format!("{head}Content-Length: {}\r\n\r\n{body}", body.len()).as_bytes()))
    }

    /// The cookie of a session that a token begins.
    pub fn login(&self, token: &str) -> String {
        let answer = self.ask("POST", "/login", None, token);
        assert_eq!(answer.status, 200, "{}", answer.body);
        answer.cookie().unwrap()
    }

    /// A WebSocket as the page opens it.
    pub fn page(&self, cookie: Option<&str>) -> Page {
        self.page_from(cookie, &format!("http://{}", self.address)).unwrap()
    }

    pub fn page_from(&self, cookie: Option<&str>, origin: &str) -> Result<Page, String> {
        let mut request = format!("ws://{}/ws", self.address).into_client_request().unwrap();
        request.headers_mut().insert("origin", origin.parse().unwrap());
        if let Some(cookie) = cookie {
            request.headers_mut().insert("cookie", cookie.parse().unwrap());
        }
        let config =
            WebSocketConfig::default().max_message_size(Some(64 << 20)).max_frame_size(Some(64 << 20));
        let (socket, _) = tungstenite::client::client_with_config(request, self.connect(), Some(config))
            .map_err(|error| error.to_string())?;
        Ok(Page { socket, passed: Vec::new() })
    }

    /// Tests whether it still serves whoever comes.
    pub fn serves(&self) {
        assert_eq!(self.ask("GET", "/", None, "").status, 200);
        self.page(None).wait("you");
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// An answer of HTTP.
pub struct Answer {
    pub status: u16,
    /// In lower case.
    pub head: String,
    pub body: String,
    cookie: Option<String>,
}

impl Answer {
    pub fn of(text: &str) -> Self {
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or((text, ""));
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
        let set = head.lines().find_map(|line| line.strip_prefix("set-cookie: "));
        let cookie = set.and_then(|set| set.split(';').next()).map(str::to_owned);
        Self { status, head: head.to_ascii_lowercase(), body: body.to_owned(), cookie }
    }

    /// The cookie that it sets.
    pub fn cookie(&self) -> Option<String> {
        self.cookie.clone()
    }
}

/// A WebSocket of a page.
pub struct Page {
    pub socket: WebSocket<TcpStream>,
    /// Messages that were passed over while others were waited for.
    passed: Vec<Value>,
}

impl Page {
    pub fn say(&mut self, text: &str) {
        self.socket.send(Message::text(text)).unwrap();
    }

    /// The next message that is text; `None` where the server has ended the WebSocket.
    pub fn text(&mut self) -> Option<Value> {
        loop {
            match self.socket.read() {
                Ok(Message::Text(text)) => return Some(serde_json::from_str(&text).unwrap()),
                Ok(Message::Close(_)) | Err(_) => return None,
                Ok(_) => {}
            }
        }
    }

    /// The next message of a kind.
    pub fn wait(&mut self, kind: &str) -> Value {
        self.wait_for(kind, |_| true)
    }

    /// The next message of a kind that passes a test. Kinds come in any order.
    pub fn wait_for(&mut self, kind: &str, test: impl Fn(&Value) -> bool) -> Value {
        let is_it = |message: &Value| message["kind"] == kind && test(message);
        if let Some(at) = self.passed.iter().position(is_it) {
            return self.passed.remove(at);
        }
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(20) {
            let message = self.text().unwrap_or_else(|| panic!("ended before {kind}"));
            if is_it(&message) {
                return message;
            }
            self.passed.push(message);
        }
        panic!("no {kind} came: {:?}", self.passed);
    }

    /// The next picture: age in microseconds, number, JPEG.
    pub fn picture(&mut self) -> (u64, u64, Vec<u8>) {
        loop {
            if let Message::Binary(bytes) = self.socket.read().unwrap() {
                let (age, rest) = bytes.split_first_chunk().unwrap();
                let (frame, jpeg) = rest.split_first_chunk().unwrap();
                return (u64::from_le_bytes(*age), u64::from_le_bytes(*frame), jpeg.to_vec());
            }
        }
    }

    /// Tests whether the server has ended it, or does so soon.
    pub fn ends(mut self) {
        let begun = Instant::now();
        while self.text().is_some() {
            assert!(begun.elapsed() < Duration::from_secs(20), "the WebSocket goes on");
        }
    }
}

/// Memory of this process, MB.
pub fn memory_mb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() / 1024
}
