//! Everything that requests and threads share.

use std::{
    path::PathBuf,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use axum::extract::ws::Utf8Bytes;
use bowwave_core::text::one_line;
use bowwave_link::{Picture, Status, ToDaemon};
use serde_json::{Value, json};
use tokio::sync::{Semaphore, broadcast, watch};

use crate::{
    access::{Access, SessionKey, Visitor},
    command::Command,
    control::Control,
    frames::Frames,
    library::Library,
    link::{Link, LinkNews, Listener},
    locked,
    options::InstructorOptions,
    score,
    token::TokenFile,
};

/// Words for all that wait for a slow browser; it misses older ones.
const NOTICES_MAX: usize = 32;
/// Reviews that are made or sent at one time: each holds its page.
const REVIEWS_MAX: usize = 2;
/// Texts of scenarios that are worked on at one time.
const TEXTS_MAX: usize = 2;

/// The scenario that was begun last from here.
type Begun = (String, String);

/// Everything that requests and threads share.
pub(crate) struct Hub {
    pub(crate) options: InstructorOptions,
    pub(crate) access: Access,
    pub(crate) control: Control,
    pub(crate) frames: Frames,
    pub(crate) library: Library,
    pub(crate) link: Arc<Link>,
    pub(crate) link_news: watch::Sender<LinkNews>,
    /// The newest status, as its message.
    pub(crate) status: watch::Sender<Option<Utf8Bytes>>,
    pub(crate) score: watch::Sender<Option<Utf8Bytes>>,
    pub(crate) notices: broadcast::Sender<Utf8Bytes>,
    pub(crate) reviews: Arc<Semaphore>,
    pub(crate) texts: Arc<Semaphore>,
    journal: Mutex<Option<PathBuf>>,
    /// The scenario that was handed to the trainer last, which may refuse it.
    asked: Mutex<Option<Begun>>,
    begun: Mutex<Option<Begun>>,
    /// The trainer's session as it was said last.
    session: AtomicU64,
    watchers: AtomicUsize,
    /// Pages of the holder of control that are open, by session.
    pages: Mutex<Vec<SessionKey>>,
}

impl Hub {
    pub(crate) fn new(options: InstructorOptions) -> Self {
        let tokens = options.tokens.clone().map(TokenFile::new);
        let news = LinkNews { joined: false, words: "the trainer is not reached yet".to_owned() };
        Self {
            access: Access::new(tokens, options.allow_without_token, options.limits.session),
            control: Control::new(),
            frames: Frames::new(options.jpeg_quality, options.picture_width_max),
            library: Library::new(options.library.clone()),
            link: Arc::new(Link::new(options.socket.clone(), &options.limits)),
            link_news: watch::Sender::new(news),
            status: watch::Sender::new(None),
            score: watch::Sender::new(None),
            notices: broadcast::Sender::new(NOTICES_MAX),
            reviews: Arc::new(Semaphore::new(REVIEWS_MAX)),
            texts: Arc::new(Semaphore::new(TEXTS_MAX)),
            journal: Mutex::default(),
            asked: Mutex::default(),
            begun: Mutex::default(),
            session: AtomicU64::new(0),
            watchers: AtomicUsize::new(0),
            pages: Mutex::default(),
            options,
        }
    }

    /// Shows words to everybody.
    pub(crate) fn notice(&self, words: &str) {
        log::info!("{}", one_line(words));
        // Nobody may be there.
        let _ = self.notices.send(text(&json!({"kind": "notice", "words": words})));
    }

    /// The journal that the trainer writes, or in words why there is none.
    pub(crate) fn journal(&self) -> Result<PathBuf, String> {
        let journal = locked(&self.journal).clone();
        journal.ok_or_else(|| {
            "the trainer keeps no journal, or is not reached: there are no runs to show".to_owned()
        })
    }

    /// Does what a browser orders.
    pub(crate) fn command(&self, command: &Command, visitor: Option<&Visitor>) -> Result<(), String> {
        if command.needs_control() {
            self.control.check(visitor)?;
        }
        match command {
            Command::TakeControl {} => {
                let visitor = visitor.ok_or("log in with a token first")?;
                if let Some(words) = self.control.take(visitor) {
                    self.notice(&words);
                }
                Ok(())
            }
            Command::HandBack {} => {
                if let Some(words) = visitor.and_then(|visitor| self.control.hand_back(&visitor.key)) {
                    self.notice(&words);
                }
                Ok(())
            }
            Command::Order { order } => self.link.send(ToDaemon::Order { order: order.clone() }),
            Command::Act { act } => self.link.send(ToDaemon::Act { act: *act }),
            Command::StandBy {} => self.link.send(ToDaemon::StandBy),
            Command::Reset {} => {
                let begun = locked(&self.begun).clone();
                let (origin, scenario) =
                    begun.ok_or("no scenario was started from here yet: start one from the list")?;
                self.link.send(ToDaemon::Load { origin, scenario })
            }
            Command::Drawn { .. } | Command::Pictures { .. } | Command::Ping { .. } => Ok(()),
        }
    }

    /// Begins a scenario.
    pub(crate) fn begin(&self, origin: String, scenario: String) -> Result<(), String> {
        self.link.send(ToDaemon::Load { origin: origin.clone(), scenario: scenario.clone() })?;
        *locked(&self.asked) = Some((origin, scenario));
        Ok(())
    }

    /// Notes that a page was opened, until the guard is dropped.
    pub(crate) fn page(self: &Arc<Self>, key: Option<SessionKey>) -> PageGuard {
        self.watchers.fetch_add(1, Ordering::Relaxed);
        locked(&self.pages).extend(key);
        PageGuard { hub: Arc::clone(self), key }
    }

    fn has_page(&self, key: &SessionKey) -> bool {
        locked(&self.pages).contains(key)
    }

    /// Looks at tokens and sessions each second, and at whoever has control.
    pub(crate) async fn keep_access(self: Arc<Self>) {
        let mut second = tokio::time::interval(Duration::from_secs(1));
        let mut seen = Instant::now();
        loop {
            second.tick().await;
            let hub = Arc::clone(&self);
            // The file may lie on something slow.
            let _ = tokio::task::spawn_blocking(move || hub.access.tick(Instant::now())).await;
            let now = Instant::now();
            let lapsed = self.control.lapse(|key| {
                if self.has_page(key) {
                    seen = now;
                }
                self.access.holds(key, now) && now.duration_since(seen) < self.options.limits.control_lapses
            });
            if let Some(words) = lapsed {
                self.notice(&words);
            }
            if self.control.news().borrow().holder.is_none() {
                seen = now;
            }
        }
    }

    /// Asks for pictures while somebody waits for one.
    pub(crate) async fn ask_for_pictures(self: Arc<Self>) {
        let mut pace = tokio::time::interval(Duration::from_secs_f64(1.0 / self.options.picture_rate));
        pace.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        loop {
            pace.tick().await;
            if self.link_news.borrow().joined && self.frames.asks(Instant::now()) {
                // It is asked again where this one does not come.
                let _ = self.link.send(ToDaemon::Picture);
            }
        }
    }

    /// Keeps the score while somebody watches: read once a second, and at most a tenth of the time.
    pub(crate) async fn keep_score(self: Arc<Self>) {
        let mut pause = Duration::from_secs(1);
        loop {
            tokio::time::sleep(pause).await;
            if self.watchers.load(Ordering::Relaxed) == 0 {
                continue;
            }
            let begun = Instant::now();
            let news = match self.journal() {
                Ok(journal) => tokio::task::spawn_blocking(move || score::of_newest(&journal)).await.ok(),
                Err(error) => Some(json!({"kind": "score", "error": error})),
            };
            let Some(news) = news.map(|news| text(&news)) else { continue };
            self.score.send_if_modified(|before| {
                let is_new = before.as_ref() != Some(&news);
                *before = Some(news);
                is_new
            });
            pause = Duration::from_secs(1).max(10 * begun.elapsed());
        }
    }
}

impl Listener for Hub {
    fn link(&self, news: LinkNews) {
        if !news.joined {
            self.frames.forget();
        }
        self.link_news.send_if_modified(|before| {
            let is_new = *before != news;
            *before = news;
            is_new
        });
    }

    fn status(&self, mut status: Status) {
        // Where files lie is nothing for everybody who looks on.
        *locked(&self.journal) = status.journal.take().map(PathBuf::from);
        if status.session != 0 && self.session.swap(status.session, Ordering::Relaxed) != status.session {
            // It has begun now, and was not refused.
            let asked = locked(&self.asked).take().filter(|_| !status.stands_by);
            if asked.is_some() {
                *locked(&self.begun) = asked;
            }
        }
        let shown = json!({"kind": "status", "status": status});
        self.status.send_replace(Some(text(&shown)));
    }

    fn refused(&self, why: String) {
        *locked(&self.asked) = None;
        self.notice(&format!("the trainer refuses: {why}"));
    }

    fn picture(&self, picture: Picture) {
        self.frames.came(picture);
    }
}

/// A page that is open.
pub(crate) struct PageGuard {
    hub: Arc<Hub>,
    key: Option<SessionKey>,
}

impl Drop for PageGuard {
    fn drop(&mut self) {
        self.hub.watchers.fetch_sub(1, Ordering::Relaxed);
        if let Some(key) = self.key {
            let mut pages = locked(&self.hub.pages);
            if let Some(at) = pages.iter().position(|other| *other == key) {
                pages.swap_remove(at);
            }
        }
    }
}

/// A message as it goes out.
pub(crate) fn text(message: &Value) -> Utf8Bytes {
    Utf8Bytes::from(message.to_string())
}
