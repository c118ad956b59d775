//! The port's thread, and what it shares with the callers.

use std::{
    io,
    os::fd::AsFd,
    sync::{Arc, Condvar, PoisonError},
    time::Instant,
};

use bowwave_core::{fault::Fault, time::Time};
use drm::control::{Device as _, Event, PageFlipEvent};
use rustix::io::Errno;

use super::{
    Flip, Given, LcdCounters, LcdError, LcdMode, LcdSettings, LcdState, LcdStatus, Vblanks,
    canvas::ScanoutBuffer,
    card::{self, Card},
    life::{DisplayChange, LcdDue, LcdLife},
    pixels,
    screen::{LcdScreen, Saved, Started},
    slot::ScanoutSlot,
};
use crate::{
    clock,
    queue::NewestSender,
    report::Reporter,
    worker::{Calls, PortLink},
};

/// State that the callers and the thread both see.
#[derive(Debug)]
pub(super) struct LcdShared {
    pub(super) link: Arc<PortLink<Scanout>>,
    changed: Condvar,
}

/// The buffers of the display, and the port's status.
#[derive(Debug)]
pub(super) struct Scanout {
    slot: ScanoutSlot<ScanoutBuffer>,
    status: LcdStatus,
}

impl LcdShared {
    pub(super) fn new() -> io::Result<Self> {
        let status = LcdStatus {
            state: LcdState::Searching,
            choice: None,
            is_atomic: false,
            vblanks: None,
            fit: None,
            trouble: None,
            counters: LcdCounters::default(),
        };
        let link = PortLink::new(Scanout { slot: ScanoutSlot::default(), status })?;
        Ok(Self { link, changed: Condvar::new() })
    }

    pub(super) fn show(&self, rgba: &[u8], size: (u32, u32), frame: u64) -> Given {
        let given = clock::now();
        let is_whole = rgba.len() as u64 == u64::from(size.0) * u64::from(size.1) * pixels::PIXEL as u64;
        let mut inner = self.link.status();
        inner.status.counters.given += 1;
        if !is_whole || rgba.is_empty() {
            inner.status.counters.malformed += 1;
            return Given::Malformed;
        }
        let LcdState::Showing(mode) = inner.status.state else {
            inner.status.counters.without_screen += 1;
            return Given::NoScreen;
        };
        inner.status.fit = Some(pixels::fit(size, (mode.width, mode.height)));
        let Some(mut lent) = inner.slot.lend() else {
            inner.status.counters.without_screen += 1;
            return Given::NoScreen;
        };
        drop(inner);
        // Without the lock: the thread goes on flipping meanwhile.
        lent.buffer.draw(rgba, size);
        let copy_ns = clock::now().ns_since(given);
        let mut inner = self.link.status();
        let counters = &mut inner.status.counters;
        counters.copy_ns_max = counters.copy_ns_max.max(copy_ns);
        match inner.slot.give_back(lent, frame, given) {
            Ok(gave_way) => inner.status.counters.replaced += gave_way,
            Err(lost) => {
                inner.status.counters.lost += lost;
                return Given::NoScreen;
            }
        }
        drop(inner);
        self.link.waker().notify();
        Given::Taken
    }

    pub(super) fn await_mode(&self, until: Instant) -> Option<LcdMode> {
        let mut inner = self.link.status();
        loop {
            match inner.status.state {
                LcdState::Showing(mode) => return Some(mode),
                LcdState::Stopped => return None,
                LcdState::Searching | LcdState::Lost { .. } => {}
            }
            let left = until.checked_duration_since(Instant::now())?;
            inner = self.changed.wait_timeout(inner, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    pub(super) fn status(&self) -> LcdStatus {
        self.link.status().status.clone()
    }

    fn update(&self, life: &LcdLife, change: impl FnOnce(&mut Scanout)) {
        let mut inner = self.link.status();
        change(&mut inner);
        inner.status.state = life.state();
        inner.status.counters.losses = life.losses();
        drop(inner);
        self.changed.notify_all();
    }
}

/// The thread.
pub(super) struct LcdThread {
    settings: LcdSettings,
    reporter: Reporter,
    shared: Arc<LcdShared>,
    flips: NewestSender<Flip>,
    life: LcdLife,
    card: Option<Card>,
    saved: Vec<Saved>,
    screen: Option<LcdScreen>,
    vblanks: Option<Vblanks>,
    last_sequence: Option<u32>,
}

impl LcdThread {
    pub(super) fn new(
        settings: LcdSettings,
        reporter: Reporter,
        shared: Arc<LcdShared>,
        flips: NewestSender<Flip>,
    ) -> Self {
        Self {
            settings,
            reporter,
            shared,
            flips,
            life: LcdLife::new(clock::now()),
            card: None,
            saved: Vec::new(),
            screen: None,
            vblanks: None,
            last_sequence: None,
        }
    }

    /// Until asked to stop. Fails only in putting back what was shown before.
    pub(super) fn run(mut self) -> Result<(), LcdError> {
        while !self.shared.link.is_stopping() {
            self.reporter.beat();
            if let Err(e) = self.turn() {
                self.lose(&e);
            }
        }
        self.finish()
    }

    /// One turn: what is due, then a flip, then sleep until something happens.
    fn turn(&mut self) -> Result<(), LcdError> {
        match self.life.due(clock::now()) {
            LcdDue::Nothing => {}
            LcdDue::Look if self.screen.is_some() => self.look()?,
            LcdDue::Look => self.search()?,
            LcdDue::FlipOverdue => {
                let node = self.card.as_ref().map(|c| c.node().to_owned()).unwrap_or_default();
                return Err(LcdError::FlipOverdue { node });
            }
        }
        self.flip()?;
        self.sleep();
        self.take_events()
    }

    /// Looks for a display and sets its mode.
    fn search(&mut self) -> Result<(), LcdError> {
        let calls = &self.shared.link.calls;
        let (card, target) = calls.during(|| card::search(&self.settings, self.card.take()));
        if card.is_none() {
            self.saved.clear();
        }
        self.card = card;
        let target = target?;
        let Some(card) = &self.card else { return Err(LcdError::NoCard) };
        if self.saved.iter().all(|s| s.crtc() != target.crtc) {
            self.saved.push(calls.during(|| Saved::of(card, target.crtc))?);
        }
        let choice = target.choice.clone();
        let (screen, canvases) = calls.during(|| LcdScreen::make(card, target, !self.settings.legacy))?;
        let is_atomic = screen.is_atomic();
        let screen = self.screen.insert(screen);
        let now = clock::now();
        self.life.flip_begun(now);
        let mut first = None;
        self.shared.update(&self.life, |inner| {
            inner.slot.open(canvases);
            inner.status.choice = Some(choice);
            inner.status.is_atomic = is_atomic;
            first = inner.slot.hand_over_blank(now).map(|f| f.buffer.framebuffer());
        });
        // Without the lock: a mode may take long to set, and no caller is to wait for it.
        match first.map(|first| calls.during(|| screen.start(card, first))).transpose()? {
            Some(Started::Shown) => self.flipped(None),
            Some(Started::Pending) | None => {}
        }
        Ok(())
    }

    /// Looks whether the display is still there.
    fn look(&self) -> Result<(), LcdError> {
        let (Some(card), Some(screen)) = (&self.card, &self.screen) else { return Ok(()) };
        let target = screen.target();
        // The kernel may be probing it for another program.
        if self.shared.link.calls.during(|| card.is_connected(target.connector))? {
            return Ok(());
        }
        let names = target.choice.connector.clone();
        Err(LcdError::NotConnected { node: card.node().to_owned(), names })
    }

    /// Hands the newest picture to the kernel, unless it still holds one back.
    fn flip(&mut self) -> Result<(), LcdError> {
        let (Some(card), Some(screen)) = (&self.card, &self.screen) else { return Ok(()) };
        let next = self.shared.link.status().slot.hand_over().map(|f| f.buffer.framebuffer());
        let Some(next) = next else { return Ok(()) };
        match self.shared.link.calls.during(|| screen.flip(card, next)) {
            Ok(true) => self.life.flip_begun(clock::now()),
            // Whether that lasts, the next look tells.
            Ok(false) => {
                let mut inner = self.shared.link.status();
                inner.status.counters.replaced += u64::from(inner.slot.take_back());
            }
            Err(e) => return Err(e),
        }
        Ok(())
    }

    fn sleep(&self) {
        let files: Vec<_> = self.card.iter().map(AsFd::as_fd).collect();
        // An interrupted or failed wait only makes the turn shorter.
        let _ = self.shared.link.wait(&files, self.life.sleep_ns(clock::now()));
    }

    /// Takes what the kernel tells of flips.
    fn take_events(&mut self) -> Result<(), LcdError> {
        let (Some(card), Some(screen)) = (&self.card, &self.screen) else { return Ok(()) };
        let crtc = screen.target().crtc;
        let events = match card.receive_events() {
            Ok(events) => events,
            Err(e) if matches!(Errno::from_io_error(&e), Some(Errno::AGAIN | Errno::INTR)) => return Ok(()),
            Err(e) => return Err(LcdError::of(card.node(), "read its events", e)),
        };
        for event in events {
            match event {
                Event::PageFlip(flip) if flip.crtc == crtc => self.flipped(Some(&flip)),
                Event::PageFlip(_) | Event::Vblank(_) | Event::Unknown(_) => {}
            }
        }
        Ok(())
    }

    /// The pending picture is on the screen.
    fn flipped(&mut self, event: Option<&PageFlipEvent>) {
        let (Some(card), Some(screen)) = (&self.card, &self.screen) else { return };
        self.vblanks = self.vblanks.or_else(|| screen.vblanks(card));
        let vblanks = self.vblanks;
        let sequence = event.map(|e| e.frame).filter(|_| vblanks == Some(Vblanks::Counted));
        let time = event.map_or_else(clock::now, |e| {
            Time::from_ns(i64::try_from(e.duration.as_nanos()).unwrap_or(i64::MAX))
        });
        let waited_vblanks = sequence.zip(self.last_sequence).map(|(now, last)| now.wrapping_sub(last));
        self.last_sequence = sequence;
        let told = self.life.flipped(screen.target().choice.mode);
        let mut shown = None;
        self.shared.update(&self.life, |inner| {
            shown = inner.slot.flipped();
            inner.status.vblanks = vblanks;
            inner.status.trouble = None;
            inner.status.counters.shown += u64::from(matches!(shown, Some((Some(_), _))));
            inner.status.counters.mode_sets += u64::from(matches!(shown, Some((None, _))));
        });
        if let Some((Some(frame), given)) = shown {
            self.flips.send(Flip { frame, given, time, sequence, waited_vblanks });
        }
        self.tell(told);
    }

    /// There is no display any more, or still none.
    fn lose(&mut self, why: &LcdError) {
        let told = self.life.missing(clock::now(), why.to_string());
        self.shared.update(&self.life, |inner| {
            inner.status.counters.lost += inner.slot.close();
            inner.status.is_atomic = false;
            inner.status.vblanks = None;
            inner.status.trouble = Some(why.to_string());
        });
        // Now: the kernel may wait long for what the screen has lost.
        self.tell(told);
        (self.vblanks, self.last_sequence) = (None, None);
        if let (Some(card), Some(screen)) = (&self.card, self.screen.take()) {
            self.shared.link.calls.during(|| screen.switch_off(card));
            self.shared.link.calls.during(|| screen.free(card));
            // What is still told of this screen is not of the next one.
            while card.receive_events().is_ok_and(|events| events.count() > 0) {}
        }
        // An unplugged display leaves the card usable: it is kept, and with it the mastery over it. Whatever else went wrong
        // is tried from the beginning.
        if !matches!(why, LcdError::NotConnected { .. } | LcdError::NoMode { .. })
            && let Err(e) = self.restore()
        {
            log::debug!("{e}");
        }
    }

    fn tell(&self, told: Option<DisplayChange>) {
        match told {
            Some(DisplayChange::Raised(cause)) => self.reporter.raised(Fault::DisplayLost, cause),
            Some(DisplayChange::Cleared) => self.reporter.cleared(Fault::DisplayLost),
            None => {}
        }
    }

    /// Puts back what was shown before, and closes the card.
    fn restore(&mut self) -> Result<(), LcdError> {
        let Some(card) = self.card.take() else { return Ok(()) };
        let result = put_back(&self.shared.link.calls, &mut self.saved, &card);
        // The card is closed within the call too: its last user's screens are switched off.
        self.shared.link.calls.during(|| drop(card));
        result
    }

    fn finish(mut self) -> Result<(), LcdError> {
        self.life.stop();
        self.shared.update(&self.life, |inner| {
            inner.status.counters.lost += inner.slot.close();
        });
        let Some(card) = self.card.take() else { return Ok(()) };
        let result = put_back(&self.shared.link.calls, &mut self.saved, &card);
        // Only now: a buffer that is shown must not be freed.
        if let Some(screen) = self.screen.take() {
            self.shared.link.calls.during(|| screen.free(&card));
        }
        self.shared.link.calls.during(|| drop(card));
        result
    }
}

/// Puts back all that was shown before, also where one of it fails.
fn put_back(calls: &Calls, saved: &mut Vec<Saved>, card: &Card) -> Result<(), LcdError> {
    let restored: Vec<_> = saved.drain(..).map(|saved| calls.during(|| saved.restore(card))).collect();
    restored.into_iter().collect()
}
