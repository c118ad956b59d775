//! Who is let in: tokens, sessions, and tries that failed.

use std::{
    collections::{HashMap, VecDeque},
    fs,
    net::{IpAddr, Ipv6Addr},
    os::unix::fs::MetadataExt as _,
    sync::Mutex,
    time::{Duration, Instant},
};

use tokio::sync::watch;

use crate::{
    locked,
    token::{self, KnownToken, TokenFile},
};

/// Most sessions at one time. The one that ends first makes room.
const SESSIONS_MAX: usize = 64;
/// Failed tries a minute from one address, and in all.
const TRIES_MAX: (usize, usize) = (5, 30);
/// The minute that tries are counted over.
const TRIES_OVER: Duration = Duration::from_secs(60);
/// Longest token that is looked at, bytes.
const TOKEN_BYTES_MAX: usize = 200;

/// Key of a session: the hash of its cookie.
pub(crate) type SessionKey = [u8; 32];

/// A session as a request has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Visitor {
    pub(crate) key: SessionKey,
    pub(crate) name: String,
}

/// Why nobody is let in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum LoginError {
    #[error("this token is not known: check it, or ask for another (`bowwave instructor token add NAME`)")]
    Wrong,
    #[error("too many wrong tokens: wait {after_s} s and try again")]
    TooMany { after_s: u64 },
    #[error("no session can be made now: try again")]
    NoRandom,
}

struct Session {
    name: String,
    /// Hash of the token that it was begun with; `None` where none was asked for.
    token: Option<[u8; 32]>,
    ends: Instant,
}

#[derive(Default)]
struct Known {
    tokens: Vec<KnownToken>,
    /// Length, inode and time of the file's last change: what tells another file from this.
    stamp: Option<(u64, u64, i64, i64)>,
    /// It could not be read; that was logged.
    failed: bool,
}

/// Who is let in.
pub(crate) struct Access {
    file: Option<TokenFile>,
    /// Whoever comes may take control while there are no tokens.
    open: bool,
    lasts: Duration,
    known: Mutex<Known>,
    sessions: Mutex<HashMap<SessionKey, Session>>,
    failed: Mutex<Failed>,
    /// Counts times at which sessions ended.
    ended: watch::Sender<u64>,
}

impl Access {
    pub(crate) fn new(file: Option<TokenFile>, open: bool, lasts: Duration) -> Self {
        let access = Self {
            file,
            open,
            lasts,
            known: Mutex::default(),
            sessions: Mutex::default(),
            failed: Mutex::default(),
            ended: watch::Sender::new(0),
        };
        access.tick(Instant::now());
        access
    }

    /// Rises whenever sessions end.
    pub(crate) fn ended(&self) -> watch::Receiver<u64> {
        self.ended.subscribe()
    }

    /// Tests whether a token is asked for.
    pub(crate) fn asks_for_token(&self) -> bool {
        !self.open || !locked(&self.known).tokens.is_empty()
    }

    pub(crate) fn tokens(&self) -> usize {
        locked(&self.known).tokens.len()
    }

    /// Begins a session: its cookie, and who it is.
    pub(crate) fn login(
        &self,
        token: &str,
        from: IpAddr,
        now: Instant,
    ) -> Result<(String, Visitor), LoginError> {
        let (name, token) = if self.asks_for_token() {
            let mut failed = locked(&self.failed);
            failed.check(from, now)?;
            let hash = token::hash(token.get(..TOKEN_BYTES_MAX).unwrap_or(token));
            let name = token::find(&locked(&self.known).tokens, &hash).map(|known| known.name.clone());
            let Some(name) = name else {
                failed.add(from, now);
                return Err(LoginError::Wrong);
            };
            (name, Some(hash))
        } else {
            (format!("somebody at {from}"), None)
        };
        let cookie = token::random_text().map_err(|e| {
            log::error!("{e}");
            LoginError::NoRandom
        })?;
        let visitor = Visitor { key: token::hash(&cookie), name: name.clone() };
        let mut sessions = locked(&self.sessions);
        if sessions.len() >= SESSIONS_MAX
            && let Some(first) = sessions.iter().min_by_key(|(_, session)| session.ends).map(|(key, _)| *key)
        {
            sessions.remove(&first);
            self.ended.send_modify(|times| *times += 1);
        }
        sessions.insert(visitor.key, Session { name, token, ends: now + self.lasts });
        Ok((cookie, visitor))
    }

    /// The session of a cookie.
    pub(crate) fn visitor(&self, cookie: &str, now: Instant) -> Option<Visitor> {
        let key = token::hash(cookie);
        let sessions = locked(&self.sessions);
        let session = sessions.get(&key).filter(|session| session.ends > now)?;
        Some(Visitor { key, name: session.name.clone() })
    }

    /// Tests whether a session still is one.
    pub(crate) fn holds(&self, key: &SessionKey, now: Instant) -> bool {
        locked(&self.sessions).get(key).is_some_and(|session| session.ends > now)
    }

    /// Ends a session.
    pub(crate) fn logout(&self, key: &SessionKey) {
        if locked(&self.sessions).remove(key).is_some() {
            self.ended.send_modify(|times| *times += 1);
        }
    }

    /// Looks at the file again, and ends the sessions that are over or whose token is gone. To be called about once a second.
    pub(crate) fn tick(&self, now: Instant) {
        self.look_at_file();
        let known = locked(&self.known);
        let asks = !self.open || !known.tokens.is_empty();
        let mut sessions = locked(&self.sessions);
        let before = sessions.len();
        sessions.retain(|_, session| {
            let is_known = match &session.token {
                Some(hash) => token::find(&known.tokens, hash).is_some(),
                None => !asks,
            };
            is_known && session.ends > now
        });
        if sessions.len() != before {
            self.ended.send_modify(|times| *times += 1);
        }
    }

    fn look_at_file(&self) {
        let Some(file) = &self.file else { return };
        let stamp = fs::metadata(file.path()).ok().map(|m| (m.len(), m.ino(), m.mtime(), m.mtime_nsec()));
        let mut known = locked(&self.known);
        if stamp == known.stamp && (stamp.is_some() || known.tokens.is_empty()) {
            return;
        }
        let read = file.known();
        if let Some(error) = read.as_ref().err().filter(|_| !known.failed) {
            log::error!("{error}; until then nobody is let in");
        }
        // One that could not be read is read again.
        known.failed = read.is_err();
        known.stamp = if known.failed { None } else { stamp };
        // Whoever cannot be known is not let in.
        known.tokens = read.unwrap_or_default();
        if let Some(warning) = file.warning().filter(|_| !known.failed) {
            log::warn!("{warning}");
        }
    }
}

/// Tries that failed in the last minute.
#[derive(Default)]
struct Failed {
    tries: VecDeque<(Instant, IpAddr)>,
    /// That they are too many was logged.
    is_logged: bool,
}

impl Failed {
    fn check(&mut self, from: IpAddr, now: Instant) -> Result<(), LoginError> {
        self.tries.retain(|(time, _)| now.saturating_duration_since(*time) < TRIES_OVER);
        if self.tries.is_empty() {
            self.is_logged = false;
        }
        let from = neighbourhood(from);
        let mut own = self.tries.iter().filter(|(_, other)| *other == from);
        let (oldest, own) = (own.next(), 1 + own.count());
        let oldest = match (oldest, self.tries.front()) {
            (Some(oldest), _) if own >= TRIES_MAX.0 => oldest,
            (_, Some(oldest)) if self.tries.len() >= TRIES_MAX.1 => oldest,
            _ => return Ok(()),
        };
        let after = TRIES_OVER.saturating_sub(now.saturating_duration_since(oldest.0));
        if !self.is_logged {
            self.is_logged = true;
            log::warn!("too many wrong tokens, the last from {from}: further ones are refused for a while");
        }
        Err(LoginError::TooMany { after_s: after.as_secs() + 1 })
    }

    fn add(&mut self, from: IpAddr, now: Instant) {
        if self.tries.is_empty() {
            log::warn!("a wrong token from {from}");
        }
        if self.tries.len() < TRIES_MAX.1 {
            self.tries.push_back((now, neighbourhood(from)));
        }
    }
}

/// An address as tries and connections are counted: whoever has an IPv6 address has 2^64 of them.
pub(crate) fn neighbourhood(address: IpAddr) -> IpAddr {
    match address {
        IpAddr::V6(v6) => match v6.to_ipv4_mapped() {
            Some(v4) => IpAddr::V4(v4),
            None => IpAddr::V6(Ipv6Addr::from_bits(v6.to_bits() & !u128::from(u64::MAX))),
        },
        v4 @ IpAddr::V4(_) => v4,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    fn access() -> (tempfile::TempDir, TokenFile, Access) {
        let folder = tempfile::tempdir().unwrap();
        let file = TokenFile::new(folder.path().join("tokens"));
        let access = Access::new(Some(file.clone()), false, Duration::from_secs(100));
        (folder, file, access)
    }

    #[test]
    fn a_session_lasts_until_it_is_over_or_its_token_is_revoked() {
        let (_folder, file, access) = access();
        let now = Instant::now();
        let token = file.add("anna").unwrap();
        assert_eq!(access.login(&token, HERE, now).unwrap_err(), LoginError::Wrong, "not looked at yet");
        access.tick(now);
        let (cookie, visitor) = access.login(&token, HERE, now).unwrap();
        assert_eq!(access.visitor(&cookie, now), Some(visitor.clone()));
        assert_eq!(access.visitor(&token, now), None, "a token is no cookie");
        let later = now + Duration::from_secs(100);
        assert_eq!((access.visitor(&cookie, later), access.holds(&visitor.key, later)), (None, false));
        let ended = access.ended();
        file.revoke("anna").unwrap();
        access.tick(now);
        assert!(ended.has_changed().unwrap() && !access.holds(&visitor.key, now));
        assert!(access.login(&token, HERE, now).is_err());
    }

    #[test]
    fn sessions_are_bounded_and_the_file_may_go() {
        let (folder, file, access) = access();
        let now = Instant::now();
        let token = file.add("anna").unwrap();
        access.tick(now);
        let (first, _) = access.login(&token, HERE, now).unwrap();
        for i in 0..SESSIONS_MAX {
            access.login(&token, HERE, now + Duration::from_millis(1 + i as u64)).unwrap();
        }
        assert_eq!(access.visitor(&first, now), None);
        assert_eq!(locked(&access.sessions).len(), SESSIONS_MAX);
        let path = folder.path().join("tokens");
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, "nothing of a token").unwrap();
        access.tick(now);
        assert!(locked(&access.sessions).is_empty() && access.asks_for_token());
        std::fs::write(&path, text).unwrap();
        access.tick(now);
        assert!(access.login(&token, HERE, now).is_ok());
        std::fs::remove_file(path).unwrap();
        access.tick(now);
        assert!(locked(&access.sessions).is_empty() && access.asks_for_token());
    }

    #[test]
    fn wrong_tokens_are_limited_by_address_and_in_all() {
        let (_folder, file, access) = access();
        let now = Instant::now();
        let token = file.add("anna").unwrap();
        access.tick(now);
        for _ in 0..TRIES_MAX.0 {
            assert_eq!(access.login("bowwave_x", HERE, now).unwrap_err(), LoginError::Wrong);
        }
        let refused = access.login(&token, HERE, now).unwrap_err();
        assert!(matches!(refused, LoginError::TooMany { after_s: 1..=61 }), "{refused}");
        let other = |i: u8| IpAddr::from([10, 0, 0, i]);
        assert!(access.login(&token, other(1), now).is_ok(), "others are let in");
        assert!(access.login(&token, HERE, now + TRIES_OVER).is_ok());
        for i in 0..100 {
            let _ = access.login("bowwave_x", other(i), now);
        }
        assert!(matches!(access.login(&token, other(200), now), Err(LoginError::TooMany { .. })));
        assert_eq!(locked(&access.failed).tries.len(), TRIES_MAX.1);
    }

    #[test]
    fn without_tokens_everybody_is_let_in_only_where_that_is_allowed() {
        let now = Instant::now();
        let closed = Access::new(None, false, TRIES_OVER);
        assert!(closed.asks_for_token() && closed.login("", HERE, now).is_err());
        let open = Access::new(None, true, TRIES_OVER);
        let (_, visitor) = open.login("", HERE, now).unwrap();
        assert_eq!(visitor.name, "somebody at 127.0.0.1");
        open.tick(now);
        assert!(open.holds(&visitor.key, now));
    }

    #[test]
    fn a_network_of_ipv6_counts_as_one_address() {
        let near = |text: &str| neighbourhood(text.parse().unwrap());
        assert_eq!(near("2001:db8::1"), near("2001:db8::ffff"));
        assert_ne!(near("2001:db8::1"), near("2001:db8:0:1::1"));
        assert_eq!(near("::ffff:10.0.0.1"), near("10.0.0.1"));
    }
}
