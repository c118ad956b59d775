//! Options, and what is refused before anything is served.

use std::{
    io,
    net::{IpAddr, Ipv4Addr, SocketAddr},
    path::PathBuf,
    time::Duration,
};

use crate::token::TokenError;

/// Certificate and key for TLS, both PEM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// The certificate, and those that lead to its authority.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
}

/// Bounds of what clients may take, and of what the trainer may.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Connections at one time.
    pub connections_max: usize,
    /// Connections at one time from one address.
    pub connections_of_peer_max: usize,
    /// Time for a TLS handshake, and for the head of each request; a connection without a request ends after it.
    pub head_timeout: Duration,
    /// Time for a request's body and its answer.
    pub request_timeout: Duration,
    /// Time that a client may take nothing of what is sent to it.
    pub write_timeout: Duration,
    /// Time that a WebSocket may be silent: the page says something each second.
    pub silence_max: Duration,
    /// Time that a session lasts.
    pub session: Duration,
    /// Time after which control lapses whose holder has no page open any longer.
    pub control_lapses: Duration,
    /// Time after which a trainer is gone that says nothing, or takes nothing.
    pub trainer_silence_max: Duration,
    /// Least and greatest time between tries to join the trainer.
    pub trainer_tries: (Duration, Duration),
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections_max: 64,
            connections_of_peer_max: 16,
            head_timeout: Duration::from_secs(10),
            request_timeout: Duration::from_secs(20),
            write_timeout: Duration::from_secs(10),
            silence_max: Duration::from_secs(30),
            session: Duration::from_secs(12 * 3600),
            control_lapses: Duration::from_secs(30),
            trainer_silence_max: Duration::from_secs(5),
            trainer_tries: (Duration::from_millis(100), Duration::from_secs(2)),
        }
    }
}

/// Options of the instructor's process.
#[derive(Clone, Debug, PartialEq)]
pub struct InstructorOptions {
    /// Address and port that the page is served at.
    pub bind: SocketAddr,
    /// The trainer's socket.
    pub socket: PathBuf,
    /// Names that the computer goes by, besides its addresses and localhost.
    pub names: Vec<String>,
    /// The file of tokens.
    pub tokens: Option<PathBuf>,
    /// Certificate and key; `None` for plain HTTP.
    pub tls: Option<TlsFiles>,
    /// Plain HTTP is served beyond this computer too (`--without-tls`).
    pub allow_plain_http: bool,
    /// While there are no tokens whoever comes may take control, and the page is served beyond this computer too (`--without-token`).
    pub allow_without_token: bool,
    /// Folder of the instructor's own scenarios.
    pub library: Option<PathBuf>,
    /// Most pictures a second, 1 to 30.
    pub picture_rate: f64,
    /// Greatest width of the pictures, pixels: wider ones are halved, or cut to a third and so on, before they are encoded.
    pub picture_width_max: u32,
    /// Quality of the pictures, 1 to 100.
    pub jpeg_quality: u8,
    /// Bounds of what clients may take.
    pub limits: Limits,
}

impl InstructorOptions {
    /// Port of the page where none is given.
    pub const PORT: u16 = 8370;

    /// On this computer alone, joined to the trainer at `socket`.
    pub fn new(socket: impl Into<PathBuf>) -> Self {
        Self {
            bind: SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), Self::PORT),
            socket: socket.into(),
            names: Vec::new(),
            tokens: None,
            tls: None,
            allow_plain_http: false,
            allow_without_token: false,
            library: None,
            picture_rate: 15.0,
            picture_width_max: 1280,
            jpeg_quality: 80,
            limits: Limits::default(),
        }
    }

    /// Refuses what would open the trainer to the network without being asked for in words. `tokens` are those that there are.
    pub(crate) fn check(&self, tokens: usize) -> Result<(), InstructorError> {
        if !(1.0..=30.0).contains(&self.picture_rate) {
            return Err(InstructorError::PictureRate(self.picture_rate));
        }
        if !(160..=4096).contains(&self.picture_width_max) {
            return Err(InstructorError::PictureWidth(self.picture_width_max));
        }
        if !(1..=100).contains(&self.jpeg_quality) {
            return Err(InstructorError::JpegQuality(self.jpeg_quality));
        }
        if let Some(name) = self.names.iter().find(|name| !is_host_name(name)) {
            return Err(InstructorError::HostName(name.clone()));
        }
        if self.bind.ip().to_canonical().is_loopback() {
            return Ok(());
        }
        if self.tls.is_none() && !self.allow_plain_http {
            return Err(InstructorError::WithoutTls(self.bind));
        }
        if tokens == 0 && !self.allow_without_token {
            return Err(InstructorError::WithoutToken(self.bind));
        }
        Ok(())
    }
}

/// Tests whether that is a name as a browser puts it before a port.
fn is_host_name(name: &str) -> bool {
    let is_part = |part: &str| {
        !part.is_empty() && part.len() <= 63 && part.chars().all(|c| c.is_ascii_alphanumeric() || c == '-')
    };
    name.len() <= 253 && name.split('.').all(is_part)
}

/// A failure that keeps the page from being served.
#[derive(Debug, thiserror::Error)]
pub enum InstructorError {
    /// It would be read and steered by whoever listens on the network.
    #[error(
        "{0} is reached from other computers, and without TLS everybody on the network can read tokens and pictures: give a certificate and \
         its key, or say --without-tls"
    )]
    WithoutTls(SocketAddr),
    /// It would be open to everybody on the network.
    #[error(
        "{0} is reached from other computers, and there is no token: make one (`bowwave instructor token add NAME`), or say --without-token \
         to let everybody on the network steer the trainer"
    )]
    WithoutToken(SocketAddr),
    /// A rate that is none.
    #[error("{0} pictures a second are not allowed: give 1 to 30")]
    PictureRate(f64),
    /// A width that is none.
    #[error("a picture's width of {0} is not allowed: give 160 to 4096")]
    PictureWidth(u32),
    /// A quality that is none.
    #[error("a quality of {0} is not allowed: give 1 to 100")]
    JpegQuality(u8),
    /// A name that no host can have.
    #[error("{0:?} is no name of a host: give it as in the browser, without scheme and port")]
    HostName(String),
    /// The tokens cannot be read.
    #[error(transparent)]
    Tokens(#[from] TokenError),
    /// The address cannot be had.
    #[error(
        "the page cannot be served at {address}: {error}; give an address of this computer and a free port"
    )]
    Bind {
        /// The address.
        address: SocketAddr,
        /// Why.
        error: io::Error,
    },
    /// Certificate or key cannot be used.
    #[error("TLS with {}: {error}; give certificate and key as PEM, and the key that belongs to the certificate", path.display())]
    Tls {
        /// The file.
        path: PathBuf,
        /// Why.
        error: String,
    },
    /// The system gave no threads.
    #[error("no threads: {0}")]
    Threads(io::Error),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_opened_to_the_network_without_being_asked_for() {
        let mut options = InstructorOptions::new("/run/bowwave/instructor");
        assert!(options.check(0).is_ok(), "on this computer alone");
        for address in ["0.0.0.0:1", "[::]:1", "192.168.1.2:1", "[::ffff:10.0.0.1]:1"] {
            options.bind = address.parse().unwrap();
            assert!(options.check(1).unwrap_err().to_string().contains("--without-tls"), "{address}");
            let plain = InstructorOptions { allow_plain_http: true, ..options.clone() };
            assert!(plain.check(0).unwrap_err().to_string().contains("token add"), "{address}");
            assert!(plain.check(1).is_ok());
            let open = InstructorOptions { allow_without_token: true, ..plain };
            assert!(open.check(0).is_ok());
            let files = TlsFiles { certificate: "c".into(), key: "k".into() };
            let secret = InstructorOptions { tls: Some(files), ..options.clone() };
            assert!(secret.check(1).is_ok() && secret.check(0).is_err());
        }
        options.bind = "[::ffff:127.0.0.1]:1".parse().unwrap();
        assert!(options.check(0).is_ok());
    }

    #[test]
    fn numbers_and_names_that_are_none_are_refused() {
        let options = InstructorOptions::new("/s");
        for rate in [0.0, f64::NAN, 31.0] {
            assert!(InstructorOptions { picture_rate: rate, ..options.clone() }.check(0).is_err());
        }
        assert!(InstructorOptions { picture_width_max: 0, ..options.clone() }.check(0).is_err());
        assert!(InstructorOptions { jpeg_quality: 0, ..options.clone() }.check(0).is_err());
        for name in ["", "a b", "http://a", "a:80", "a..b", "*"] {
            assert!(
                InstructorOptions { names: vec![name.into()], ..options.clone() }.check(0).is_err(),
                "{name}"
            );
        }
        assert!(InstructorOptions { names: vec!["gun-1.local".into()], ..options }.check(0).is_ok());
    }
}
