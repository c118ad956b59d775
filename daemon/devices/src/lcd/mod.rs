//! The LCD, over the kernel's mode setting (DRM/KMS): pictures rendered off screen are copied once and flipped on vblank.
//!
//! A thread of its own finds the card and the connector, sets the mode, flips, notices when the display goes and sets the
//! mode anew when it comes back. [`LcdPort::show`] copies the picture, in the **caller's** thread, into a free buffer of the
//! display: it borrows the picture, so that no second copy is needed to hand it over, and takes as long as the copy (below
//! a millisecond at 800x480). It waits for nothing: of pictures that come faster than vblanks the newest wins.
//!
//! Every flip is told with the kernel's time of its vblank ([`LcdPort::flips`]), so that the caller can lock its tick to the
//! display. A picture stays until the next one: at 60 Hz and 30 pictures a second for two vblanks.
//!
//! Who opens a card first is its master, without being root (group `video`). Nobody else may be: no desktop, no boot
//! screen. Virtual terminals are not switched: while the trainer runs the display is its own, and a switch by hand
//! (Ctrl-Alt-F2) changes nothing on it. At the end, by [`LcdPort::stop`] or `Drop`, what was shown before is put back; if the
//! process is killed, the kernel does so.

mod canvas;
mod card;
mod error;
mod life;
mod mode;
mod pixels;
mod screen;
mod slot;
mod thread;

use std::{
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};

use bowwave_core::time::{NS_PER_S, Time};
use crossbeam_channel::Receiver;

pub use error::LcdError;
pub use mode::{LcdMode, ModeWish};

use crate::{queue, report::Reporter, worker::PortWorker};
use thread::{LcdShared, LcdThread, Scanout};

/// Flips that may wait for the caller: two seconds at 30 Hz.
const FLIPS: usize = 64;
/// The longest that a call into the kernel may take; after it the thread counts as hung. A display that is probed may take
/// seconds to answer, and a change of the mode waits 10 s for each earlier flip of the screen and of its plane that was lost,
/// and as long for its own.
const CALL_MAX_NS: i64 = 45 * NS_PER_S;

/// Which display is used, and how.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LcdSettings {
    /// The card, such as `/dev/dri/card1` or a link in `/dev/dri/by-path`; the first with a display where absent.
    pub card: Option<PathBuf>,
    /// The connector, such as `HDMI-A-1`; the first with a display where absent.
    pub connector: Option<String>,
    /// Size and rate.
    pub mode: ModeWish,
    /// Uses the kernel's older interface even where the driver has the newer, atomic one: for drivers in which that is
    /// broken.
    pub legacy: bool,
}

/// The life of the display's connection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LcdState {
    /// No display has been found yet, or the first picture is not yet on it. Looks for one twice a second.
    Searching,
    /// Pictures show, in this mode.
    Showing(LcdMode),
    /// The display was there and is gone. Looks for it twice a second.
    Lost {
        /// When that was noticed.
        since: Time,
    },
    /// Ended; what was shown before is back.
    Stopped,
}

/// The display that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct LcdChoice {
    /// The card's node.
    pub card: PathBuf,
    /// The card's driver.
    pub driver: String,
    /// The connector.
    pub connector: String,
    /// The mode.
    pub mode: LcdMode,
    /// Why this is not the mode that was asked for, where it is not.
    pub remark: Option<String>,
}

/// How the caller's picture lies on the screen. Sizes are width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LcdFit {
    /// Pixel for pixel.
    Exact,
    /// The picture is smaller: in the middle, black around.
    Bordered {
        /// Size of the picture.
        picture: (u32, u32),
        /// Size of the screen.
        screen: (u32, u32),
    },
    /// The picture is wider or higher: its middle shows.
    Cropped {
        /// Size of the picture.
        picture: (u32, u32),
        /// Size of the screen.
        screen: (u32, u32),
    },
}

/// Where the times of flips come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vblanks {
    /// The driver counts vblanks: flips happen on them, and their times are those of the vblanks.
    Counted,
    /// It knows none (virtual displays): pictures show at once, and times are those of the hand-over. Nothing to lock to.
    Absent,
}

/// Counts of what the port did so far. Each picture given is in exactly one of `shown`, `replaced`, `without_screen`, `lost`,
/// `malformed`, or still under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LcdCounters {
    /// Pictures given.
    pub given: u64,
    /// Pictures that came on the screen.
    pub shown: u64,
    /// Pictures that gave way to a newer one before they came on the screen.
    pub replaced: u64,
    /// Pictures dropped because there was no screen.
    pub without_screen: u64,
    /// Pictures under way when the screen was lost.
    pub lost: u64,
    /// Pictures refused because bytes and size did not agree.
    pub malformed: u64,
    /// Times that a mode was set.
    pub mode_sets: u64,
    /// Times that a display that showed pictures was lost.
    pub losses: u64,
    /// Longest copy of a picture, nanoseconds.
    pub copy_ns_max: i64,
}

/// A snapshot of the port.
#[derive(Clone, Debug, PartialEq)]
pub struct LcdStatus {
    /// Where its life is.
    pub state: LcdState,
    /// The display in use, or used last.
    pub choice: Option<LcdChoice>,
    /// Whether the kernel's atomic interface is used. `false` also while nothing shows.
    pub is_atomic: bool,
    /// Where the times of flips come from, once that is known: with the first or second flip.
    pub vblanks: Option<Vblanks>,
    /// How the last picture given lies on the screen.
    pub fit: Option<LcdFit>,
    /// Why nothing shows, and what to do; `None` while something does.
    pub trouble: Option<String>,
    /// Counts so far.
    pub counters: LcdCounters,
}

/// Fate of a picture that was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Given {
    /// It shows from the next vblank on, unless a newer one comes before.
    Taken,
    /// There is no screen: dropped.
    NoScreen,
    /// Bytes and size do not agree: dropped.
    Malformed,
}

/// A picture came on the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flip {
    /// The caller's number of it.
    pub frame: u64,
    /// When the caller gave it.
    pub given: Time,
    /// The vblank with which it came on the screen, on `CLOCK_MONOTONIC`, to the microsecond; where the driver knows no
    /// vblanks, when it was handed over.
    pub time: Time,
    /// The driver's count of that vblank, where it counts.
    pub sequence: Option<u32>,
    /// Vblanks since the flip before (for a mode's first picture: since it was set): how long the last picture stayed.
    /// `None` where the driver does not count.
    pub waited_vblanks: Option<u32>,
}

/// Whether a display is plugged in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Connection {
    /// A display is there.
    Connected,
    /// None is.
    Disconnected,
    /// The connector cannot tell.
    Unknown,
}

/// A connector of a card.
#[derive(Clone, Debug, PartialEq)]
pub struct ConnectorInfo {
    /// Its name, such as `HDMI-A-1`.
    pub name: String,
    /// Whether a display is plugged in.
    pub connection: Connection,
    /// The display's modes.
    pub modes: Vec<LcdMode>,
}

/// A display card.
#[derive(Clone, Debug, PartialEq)]
pub struct CardInfo {
    /// Its node, such as `/dev/dri/card0`.
    pub node: PathBuf,
    /// Its driver.
    pub driver: String,
    /// Whether the driver sets modes atomically.
    pub is_atomic: bool,
    /// Its connectors.
    pub connectors: Vec<ConnectorInfo>,
}

/// Every display card of this computer, or why it cannot be used.
pub fn list() -> Vec<Result<CardInfo, LcdError>> {
    card::list()
}

/// Whether there is the display that `settings` mean, and which mode would be set. Sets none.
pub fn check(settings: &LcdSettings) -> Result<LcdChoice, LcdError> {
    card::search(settings, None).1.map(|target| target.choice)
}

/// The display. See the [module](self).
#[derive(Debug)]
pub struct LcdPort {
    shared: Arc<LcdShared>,
    flips: Receiver<Flip>,
    /// `None` once it is stopped.
    worker: Option<PortWorker<Scanout, Result<(), LcdError>>>,
}

impl LcdPort {
    /// Starts the threads, which look for the display for ever. Fails only where no thread can be made.
    pub fn start(settings: LcdSettings, reporter: Reporter) -> Result<Self, LcdError> {
        let shared = Arc::new(LcdShared::new().map_err(LcdError::Thread)?);
        let (sender, flips) = queue::newest(FLIPS);
        let thread = LcdThread::new(settings, reporter.clone(), Arc::clone(&shared), sender);
        let mut worker = PortWorker::start("lcd", Arc::clone(&shared.link), move || thread.run())
            .map_err(LcdError::Thread)?;
        worker.beat_during_calls("lcd-pulse", reporter, CALL_MAX_NS).map_err(LcdError::Thread)?;
        Ok(Self { shared, flips, worker: Some(worker) })
    }

    /// Gives a picture: `rgba` are sRGB bytes R, G, B, A from the top left, without padding; `size` its width and height in
    /// pixels; `frame` the caller's number, told again with its flip. Copies it and returns; waits for nothing.
    pub fn show(&self, rgba: &[u8], size: (u32, u32), frame: u64) -> Given {
        self.shared.show(rgba, size, frame)
    }

    /// Waits until a display shows (black at first), at most `timeout`: its mode, for a picture of the right size.
    pub fn await_mode(&self, timeout: Duration) -> Option<LcdMode> {
        self.shared.await_mode(Instant::now() + timeout)
    }

    /// Flips, oldest first. Of those that nobody takes the newest remain.
    pub const fn flips(&self) -> &Receiver<Flip> {
        &self.flips
    }

    /// How the display fares: cheap.
    pub fn status(&self) -> LcdStatus {
        self.shared.status()
    }

    /// Puts back what was shown before the start and gives the card free. Takes a few vblanks, and longer only where the
    /// former mode was another one that the display is slow to take.
    pub fn stop(mut self) -> Result<LcdCounters, LcdError> {
        self.end()?;
        Ok(self.shared.status().counters)
    }

    fn end(&mut self) -> Result<(), LcdError> {
        let Some(worker) = self.worker.take() else { return Ok(()) };
        worker.stop().map_err(|_| LcdError::ThreadDied)?
    }
}

impl Drop for LcdPort {
    fn drop(&mut self) {
        if let Err(e) = self.end() {
            log::debug!("the display: {e}");
        }
    }
}

#[cfg(test)]
mod tests {
    use bowwave_core::fault::Fault;

    use super::*;
    use crate::{clock, report::reporting};

    #[test]
    fn without_a_display_the_port_says_so_lives_and_ends() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let (reporter, reports) = reporting();
        let settings = LcdSettings { card: Some(folder.path().join("card7")), ..LcdSettings::default() };
        let port = LcdPort::start(settings, reporter).expect("absence is no error of the start");
        clock::sleep_until(clock::now().plus_ns(400_000_000));
        assert!(clock::now().ns_since(reports.last_beat()) < 250_000_000);
        let changes: Vec<_> = reports.changes().map(|c| c.fault).collect();
        assert_eq!(changes, [Fault::DisplayLost]);
        assert_eq!(port.show(&[0; 4], (1, 1), 1), Given::NoScreen);
        let begin = clock::now();
        assert_eq!(port.stop().expect("ends").without_screen, 1);
        assert!(clock::now().ns_since(begin) < 250_000_000);
    }
}
