//! Watchers of an instructor's page, to measure what they cost: each opens the page's WebSocket, acknowledges every picture, and notes how old
//! it was. `watchers URL N SECONDS`, the URL as `bowwave instructor` prints it (without TLS).

#![allow(clippy::print_stdout, reason = "an example prints what it measured")]

use std::{
    error::Error,
    thread,
    time::{Duration, Instant},
};

use tungstenite::{Message, connect};

/// Ages of pictures as they arrived, ms, after a second.
fn watch(url: &str, length: Duration) -> Result<Vec<f64>, Box<dyn Error + Send + Sync>> {
    let host = url.trim_start_matches("http://").trim_end_matches('/');
    let request = tungstenite::http::Request::builder()
        .uri(format!("ws://{host}/ws"))
        .header("Host", host)
        .header("Origin", format!("http://{host}"))
        .header("Connection", "Upgrade")
        .header("Upgrade", "websocket")
        .header("Sec-WebSocket-Version", "13")
        .header("Sec-WebSocket-Key", tungstenite::handshake::client::generate_key())
        .body(())?;
    let (mut socket, _) = connect(request)?;
    socket.send(Message::text(r#"{"kind":"pictures","on":true}"#))?;
    let (begun, mut ages_ms) = (Instant::now(), Vec::new());
    while begun.elapsed() < length {
        let Message::Binary(picture) = socket.read()? else { continue };
        let number = |at: usize| -> Option<u64> {
            Some(u64::from_le_bytes(picture.get(at..at + 8)?.try_into().ok()?))
        };
        let (Some(age_us), Some(frame)) = (number(0), number(8)) else { continue };
        if begun.elapsed() > Duration::from_secs(1) {
            ages_ms.push(age_us as f64 / 1000.0);
        }
        socket.send(Message::text(format!(r#"{{"kind":"drawn","frame":{frame}}}"#)))?;
    }
    Ok(ages_ms)
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [url, watchers, seconds] = &arguments[..] else {
        return Err("usage: watchers URL N SECONDS".into());
    };
    let (watchers, seconds): (usize, u64) = (watchers.parse()?, seconds.parse()?);
    let length = Duration::from_secs(seconds);
    let threads: Vec<_> = (0..watchers)
        .map(|_| {
            let url = url.clone();
            thread::spawn(move || watch(&url, length))
        })
        .collect();
    let mut ages_ms = Vec::new();
    for thread in threads {
        ages_ms.extend(thread.join().map_err(|_| "a watcher broke down")??);
    }
    ages_ms.sort_by(f64::total_cmp);
    let at = |share: f64| ages_ms.get((share * ages_ms.len() as f64) as usize).copied().unwrap_or(f64::NAN);
    let rate = ages_ms.len() as f64 / (watchers.max(1) as f64 * (seconds.max(2) - 1) as f64);
    println!(
        "{watchers} watchers, {rate:.1} pictures a second each; age as sent: median {:.0} ms, p95 {:.0} ms, most {:.0} ms",
        at(0.5),
        at(0.95),
        ages_ms.last().copied().unwrap_or(f64::NAN)
    );
    Ok(())
}
