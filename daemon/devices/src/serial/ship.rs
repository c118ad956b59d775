//! The ship's own instruments on a serial line: heading and attitude, place and time as lines of NMEA 0183.

use std::{path::Path, time::Duration};

use bowwave_core::{
    ephemeris::{Place, Utc},
    event::{Event, ShipSample},
    fault::Fault,
    time::Time,
};
use crossbeam_channel::Receiver;

use super::{
    LineSettings, SerialError, SerialStatus,
    feed::{LineFeed, LineKind, SHIP},
    port::LinePort,
};
use crate::{
    framing::LineCounters,
    nmea::{NmeaSentence, ShipParser, ShipSaid},
    queue::NewestSender,
    report::{Reporter, reporting},
};

/// Lines that wait to be drained: ten seconds of the fastest feed.
const QUEUE_LINES: usize = 512;

/// The rates of ships' instruments, that of the standard first (NMEA 0183: 4800; its high-speed variant: 38400).
pub(super) const RATES: [u32; 6] = [4_800, 38_400, 9_600, 19_200, 57_600, 115_200];

/// Lines without a valid heading for so long mean that there is none.
const INVALID_NS: i64 = 3_000_000_000;

/// A beat is the mean over about so many lines.
const BEATS: f64 = 16.0;

/// Report of what the ship's lines said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShipReport {
    /// The newest line that said something of heading or attitude.
    pub newest: Option<(NmeaSentence, ShipSample)>,
    /// The newest place.
    pub place: Option<Place>,
    /// The newest time, and when its line arrived.
    pub utc: Option<(Time, Utc)>,
    /// Mean time between headings, seconds; nothing before enough came.
    pub period_s: Option<f64>,
    /// Lines with a valid heading.
    pub headings: u64,
    /// Lines of all kinds, damaged ones and bytes of none.
    pub lines: LineCounters,
}

impl ShipReport {
    /// Takes in when a heading and the one before it came.
    fn beat(&mut self, before: Option<Time>, arrival: Time) {
        let Some(before) = before else { return };
        let gap_s = arrival.secs_since(before);
        let mean_s = self.period_s.unwrap_or(gap_s);
        self.period_s = Some(mean_s + (gap_s - mean_s) / BEATS);
    }
}

/// Status of the ship feed.
pub type ShipStatus = SerialStatus<ShipReport>;

/// The ship's instruments, read by a thread of its own into a bounded queue.
#[derive(Debug)]
pub struct ShipPort {
    port: LinePort<ShipFeed>,
}

impl ShipPort {
    /// Begins to look for the feed, to read it, and to look for it again whenever it is lost. That it is not there is told by
    /// `reporter`, as all that happens later.
    pub fn start(settings: LineSettings, reporter: Reporter) -> Result<Self, SerialError> {
        Ok(Self { port: LinePort::start(settings, ShipFeed::default(), reporter, QUEUE_LINES)? })
    }

    /// Like [`Self::start`] for a port that must be there, without reports: for replays and checks.
    pub fn open(node: &Path, baud: u32) -> Result<Self, SerialError> {
        Ok(Self { port: LinePort::open(node, baud, ShipFeed::default(), QUEUE_LINES)? })
    }

    /// Measurements not yet drained, [`Event::Ship`] and [`Event::ShipFix`] in the order of arrival; the oldest give way.
    pub fn events(&self) -> &Receiver<Event> {
        self.port.events()
    }

    /// How the feed does.
    pub fn status(&self) -> ShipStatus {
        self.port.status()
    }

    /// Ends the reading and closes the port, within 200 ms. What was not drained is lost.
    pub fn stop(self) -> Result<ShipStatus, SerialError> {
        self.port.stop()
    }
}

/// Reads the feed for `time` and tells how it does: for a check by hand.
pub fn check_ship(settings: LineSettings, time: Duration) -> Result<super::Checked<ShipStatus>, SerialError> {
    let (reporter, reports) = reporting();
    let port = ShipPort::start(settings, reporter)?;
    super::listen(time, || port.events().try_iter().for_each(drop));
    let status = port.status();
    port.stop()?;
    Ok(super::Checked { status, faults: reports.left(), clock: None })
}

/// The codec, and what its lines told.
#[derive(Debug, Default)]
pub(super) struct ShipFeed {
    parser: ShipParser,
    said: ShipReport,
    /// When the last heading came, and since when lines come without one.
    last: Option<Time>,
    without: Option<Time>,
    invalid: bool,
}

impl LineFeed for ShipFeed {
    type Report = ShipReport;

    const KIND: &'static LineKind = &SHIP;

    fn take(&mut self, bytes: &[u8], arrival: Time, queue: &mut NewestSender<Event>) -> u64 {
        let before = self.parser.counters().packets;
        let Self { parser, said, last, without, .. } = self;
        for line in parser.lines(bytes, arrival) {
            match line.said {
                ShipSaid::Attitude(sample) => {
                    said.newest = Some((line.sentence, sample));
                    if sample.heading.is_some() {
                        said.headings += 1;
                        *without = None;
                        said.beat(last.replace(arrival), arrival);
                    }
                }
                ShipSaid::Fix(fix) => {
                    said.place = fix.place.or(said.place);
                    said.utc = fix.utc.map(|utc| (arrival, utc)).or(said.utc);
                }
            }
            queue.send(line.said.into());
        }
        let lines = self.parser.counters();
        self.said.lines = lines;
        if lines.packets > before && self.last.is_none_or(|last| last < arrival) {
            self.without.get_or_insert(arrival);
        }
        lines.packets - before
    }

    fn restart(&mut self) {
        self.parser.restart();
    }

    fn forget(&mut self) {
        (self.last, self.without) = (None, None);
    }

    fn judge(&mut self, path: &Path, now: Time, reporter: &Reporter) {
        let invalid = self.without.is_some_and(|since| now.ns_since(since) >= INVALID_NS);
        reporter.follow(now, Fault::ShipInvalid, &mut self.invalid, invalid, || {
            format!(
                "lines come on {} and none tells a valid heading (HDT, PASHR or PSXN,23): is the compass settled, and is one of these \
                 switched on?",
                path.display()
            )
        });
    }

    fn report(&self) -> ShipReport {
        self.said
    }
}
