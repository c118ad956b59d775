//! One browser's WebSocket.

use std::{sync::Arc, time::Instant};

use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket};
use serde_json::json;
use tokio::sync::{broadcast::error::RecvError, watch};

use crate::{
    access::Visitor,
    command::{Command, parse_command},
    control::ControlNews,
    frames::{Frame, Wish, monotonic_ns},
    hub::{Hub, text},
};

/// Most messages a second: pictures that are drawn, and what hands can press.
const MESSAGES_MAX: u32 = 60;
/// Closes because of what the other side did (RFC 6455, 7.4.1).
const POLICY: u16 = 1008;

/// The WebSocket is closed.
struct Closed;

impl From<axum::Error> for Closed {
    fn from(_: axum::Error) -> Self {
        Self
    }
}

/// Serves a browser until one of both sides ends it. Each has a task of its own: a slow one holds nobody else up.
pub(crate) async fn serve(socket: WebSocket, hub: Arc<Hub>, visitor: Option<Visitor>) {
    let _page = hub.page(visitor.as_ref().map(|visitor| visitor.key));
    let mut client = Client { socket, hub: &hub, visitor, wish: Wish::new(&hub.frames), rate: Rate::new() };
    // Whatever ends it, the socket is closed as it is dropped.
    let _ = client.serve().await;
}

struct Client<'a> {
    socket: WebSocket,
    hub: &'a Arc<Hub>,
    visitor: Option<Visitor>,
    /// It wants the next picture.
    wish: Wish<'a>,
    rate: Rate,
}

impl Client<'_> {
    async fn serve(&mut self) -> Result<(), Closed> {
        let hub = Arc::clone(self.hub);
        let mut link = hub.link_news.subscribe();
        let mut status = hub.status.subscribe();
        let mut score = hub.score.subscribe();
        let mut control = hub.control.news();
        let mut notices = hub.notices.subscribe();
        let mut frames = hub.frames.newest();
        let mut ended = hub.access.ended();
        link.mark_changed();
        status.mark_changed();
        score.mark_changed();
        control.mark_changed();
        self.greet().await?;
        let silence_max = hub.options.limits.silence_max;
        let mut heard = Instant::now();
        loop {
            tokio::select! {
                message = self.socket.recv() => {
                    heard = Instant::now();
                    let message = message.ok_or(Closed)??;
                    self.heard(message, &mut frames).await?;
                }
                Ok(()) = frames.changed(), if self.wish.stands() => {
                    let frame = frames.borrow_and_update().clone();
                    self.picture(frame).await?;
                }
                Ok(()) = link.changed() => {
                    let news = link.borrow_and_update().clone();
                    self.say(text(&json!({"kind": "link", "joined": news.joined, "words": news.words}))).await?;
                }
                Ok(()) = status.changed() => self.newest(&mut status).await?,
                Ok(()) = score.changed() => self.newest(&mut score).await?,
                Ok(()) = control.changed() => {
                    let news = control.borrow_and_update().clone();
                    self.control(&news).await?;
                }
                notice = notices.recv() => match notice {
                    Ok(notice) => self.say(notice).await?,
                    Err(RecvError::Lagged(_)) => {}
                    Err(RecvError::Closed) => return Err(Closed),
                },
                Ok(()) = ended.changed() => {
                    ended.borrow_and_update();
                    self.check_session().await?;
                }
                () = tokio::time::sleep_until((heard + silence_max).into()) => return Err(Closed),
            }
        }
    }

    async fn say(&mut self, text: Utf8Bytes) -> Result<(), Closed> {
        Ok(self.socket.send(Message::Text(text)).await?)
    }

    async fn greet(&mut self) -> Result<(), Closed> {
        let name = self.visitor.as_ref().map(|visitor| visitor.name.as_str());
        let asks = self.hub.access.asks_for_token();
        self.say(text(&json!({"kind": "you", "name": name, "asks_for_token": asks}))).await
    }

    async fn newest(&mut self, news: &mut watch::Receiver<Option<Utf8Bytes>>) -> Result<(), Closed> {
        let newest = news.borrow_and_update().clone();
        match newest {
            Some(newest) => self.say(newest).await,
            None => Ok(()),
        }
    }

    async fn control(&mut self, news: &ControlNews) -> Result<(), Closed> {
        let is_own = self.visitor.as_ref().is_some_and(|visitor| self.hub.control.is_held_by(&visitor.key));
        self.say(text(&json!({"kind": "control", "holder": news.holder, "is_own": is_own}))).await
    }

    async fn picture(&mut self, frame: Option<Arc<Frame>>) -> Result<(), Closed> {
        let Some(frame) = frame else { return Ok(()) };
        self.wish.set(false);
        Ok(self.socket.send(Message::Binary(frame.message(monotonic_ns()))).await?)
    }

    /// Ends the socket of a session that is over: it may neither steer nor look on as somebody that it is not.
    async fn check_session(&mut self) -> Result<(), Closed> {
        let Some(visitor) = &self.visitor else { return Ok(()) };
        if self.hub.access.holds(&visitor.key, Instant::now()) {
            return Ok(());
        }
        self.say(text(&json!({"kind": "ended", "words": "your session is over: log in again"}))).await?;
        self.close("the session is over").await
    }

    async fn close(&mut self, reason: &'static str) -> Result<(), Closed> {
        let frame = CloseFrame { code: POLICY, reason: Utf8Bytes::from_static(reason) };
        self.socket.send(Message::Close(Some(frame))).await?;
        Err(Closed)
    }

    async fn heard(
        &mut self,
        message: Message,
        frames: &mut watch::Receiver<Option<Arc<Frame>>>,
    ) -> Result<(), Closed> {
        if !self.rate.lets(Instant::now()) {
            return self.close("too many messages").await;
        }
        let command = match message {
            Message::Text(text) => parse_command(text.as_bytes()),
            Message::Binary(_) => return self.close("the page sends text").await,
            Message::Ping(_) | Message::Pong(_) => return Ok(()),
            Message::Close(_) => return Err(Closed),
        };
        match command {
            Ok(Command::Ping { t }) => self.say(text(&json!({"kind": "pong", "t": t}))).await,
            Ok(Command::Drawn { .. }) => {
                self.wish.set(true);
                Ok(())
            }
            Ok(Command::Pictures { on }) => {
                // What was not taken meanwhile is old.
                frames.mark_unchanged();
                self.wish.set(on);
                Ok(())
            }
            Ok(command) => match self.commanded(&command) {
                Ok(()) => Ok(()),
                Err(why) => self.refuse(&why).await,
            },
            Err(error) => self.refuse(&error.to_string()).await,
        }
    }

    /// Does what is ordered, where the session still is one.
    fn commanded(&self, command: &Command) -> Result<(), String> {
        let is_over = |visitor: &&Visitor| !self.hub.access.holds(&visitor.key, Instant::now());
        if self.visitor.as_ref().filter(is_over).is_some() {
            return Err("your session is over: log in again".to_owned());
        }
        self.hub.command(command, self.visitor.as_ref())
    }

    async fn refuse(&mut self, why: &str) -> Result<(), Closed> {
        self.say(text(&json!({"kind": "refused", "words": why}))).await
    }
}

/// Messages of the running second.
struct Rate {
    since: Instant,
    count: u32,
}

impl Rate {
    fn new() -> Self {
        Self { since: Instant::now(), count: 0 }
    }

    fn lets(&mut self, now: Instant) -> bool {
        if now.duration_since(self.since).as_secs() >= 1 {
            *self = Self { since: now, count: 0 };
        }
        self.count += 1;
        self.count <= MESSAGES_MAX
    }
}
