//! Heading and attitude of the ship from its own instruments, as lines of NMEA 0183, sans-io: a second input beside the unit
//! on the gun, which cannot tell the ship's motion from the gun's and has no heading of its own.
//!
//! Read are `$--HDT` (true heading: NMEA 0183, IEC 61162-1), `$PASHR` (attitude as Applanix, NovAtel and Oxford units send
//! it) and `$PSXN,23` with its quality `$PSXN,20` (Kongsberg Seapath). Heading is clockwise from true north; roll is positive
//! with starboard down, pitch with the bow up; all in radians.

use std::f64::consts::TAU;

use bowwave_core::{event::ShipSample, time::Time};

pub use crate::framing::LineCounters;
use crate::{
    framing::Scanner,
    lines::{self, LineFraming, number},
};

/// The framing of any line.
#[derive(Debug)]
struct AnyLine;

impl LineFraming for AnyLine {
    const PREFIX: &'static [u8] = b"";
}

/// Which line a measurement came in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NmeaSentence {
    /// `$--HDT`.
    Hdt,
    /// `$PASHR`.
    Pashr,
    /// `$PSXN,23`.
    Psxn,
}

impl NmeaSentence {
    /// Its name for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hdt => "HDT",
            Self::Pashr => "PASHR",
            Self::Psxn => "PSXN",
        }
    }
}

/// Measurement in one line of the ship's instruments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShipAttitude {
    /// The line.
    pub sentence: NmeaSentence,
    /// Time of the measurement, seconds of the UTC day, where the line tells it.
    pub utc_day_s: Option<f64>,
    /// The measurement.
    pub sample: ShipSample,
}

/// PsxnQuality of `$PSXN,20`: 0 normal, 1 reduced, 2 invalid.
#[derive(Clone, Copy, Debug, Default)]
struct PsxnQuality {
    heading: u8,
    roll_pitch: u8,
}

/// Takes bytes in pieces of any size and reports what the ship's instruments say in them. Memory is bounded.
#[derive(Debug)]
pub struct ShipParser {
    scanner: Scanner<AnyLine>,
    quality: PsxnQuality,
}

impl Default for ShipParser {
    fn default() -> Self {
        Self::new()
    }
}

impl ShipParser {
    /// A parser that has met nothing.
    pub fn new() -> Self {
        Self { scanner: Scanner::new(), quality: PsxnQuality::default() }
    }

    /// Lines with a right check sum (of all kinds), damaged ones, and bytes that belonged to none.
    pub const fn counters(&self) -> LineCounters {
        self.scanner.counters()
    }

    /// The line was interrupted: what an instrument said of its quality before may no longer hold.
    pub fn restart(&mut self) {
        self.quality = PsxnQuality::default();
    }

    /// The measurement in the next line that has one, of bytes that arrived together at `arrival`. Bytes are taken from the front of
    /// `input` as far as they are needed; `None`: they are used up.
    pub fn next_line(&mut self, input: &mut &[u8], arrival: Time) -> Option<ShipAttitude> {
        let Self { scanner, quality } = self;
        while let Some(found) = scanner.next_of(input) {
            let said = lines::checked(found.bytes).and_then(|body| read(body, quality, arrival));
            if said.is_some() {
                return said;
            }
        }
        None
    }

    /// The measurements in all lines that bytes complete which arrived together at `arrival`. The bytes are taken as those are.
    pub fn lines<'a>(
        &'a mut self,
        mut bytes: &'a [u8],
        arrival: Time,
    ) -> impl Iterator<Item = ShipAttitude> + 'a {
        std::iter::from_fn(move || self.next_line(&mut bytes, arrival))
    }
}

/// The measurement in a line without `$` and check sum; `None` for other lines and those without one.
fn read(body: &str, quality: &mut PsxnQuality, arrival: Time) -> Option<ShipAttitude> {
    let mut fields = body.split(',');
    let address = fields.next()?;
    let fields: [&str; 11] = std::array::from_fn(|_| fields.next().unwrap_or_default());
    let nothing =
        ShipSample { arrival, heading: None, roll: None, pitch: None, heading_sigma: None, reduced: false };
    let (sentence, utc_day_s, sample) = match (address, fields) {
        (address, [degrees, "T", ..]) if address.len() == 5 && address.ends_with("HDT") => {
            (NmeaSentence::Hdt, None, ShipSample { heading: heading(degrees), ..nothing })
        }
        ("PASHR", [time, degrees, "T", roll, pitch, _, _, _, sigma, _, aligned]) => {
            let sample = ShipSample {
                heading: heading(degrees),
                roll: angle(roll, 180.0),
                pitch: angle(pitch, 90.0),
                heading_sigma: angle(sigma, 180.0).filter(|s| *s >= 0.0),
                reduced: aligned == "0",
                ..nothing
            };
            (NmeaSentence::Pashr, utc_day_s(time), sample)
        }
        ("PSXN", ["20", _, _, heading, roll_pitch, ..]) => {
            // What is no number is as good as invalid.
            let of = |field: &str| field.parse().unwrap_or(2);
            *quality = PsxnQuality { heading: of(heading), roll_pitch: of(roll_pitch) };
            return None;
        }
        ("PSXN", ["23", roll, pitch, degrees, ..]) => {
            let sample = ShipSample {
                heading: heading(degrees).filter(|_| quality.heading < 2),
                roll: angle(roll, 180.0).filter(|_| quality.roll_pitch < 2),
                pitch: angle(pitch, 90.0).filter(|_| quality.roll_pitch < 2),
                reduced: quality.heading.max(quality.roll_pitch) > 0,
                ..nothing
            };
            (NmeaSentence::Psxn, None, sample)
        }
        _ => return None,
    };
    let says = sample.heading.is_some() || sample.roll.is_some() || sample.pitch.is_some();
    says.then_some(ShipAttitude { sentence, utc_day_s, sample })
}

/// The line that says `sample`: `$HEHDT` where it tells nothing but a heading, else `$PASHR` without a time of day. Read again it is
/// the same to a billionth of a degree, and to the bit where its numbers came from a line with as many digits.
pub fn line_of(sample: &ShipSample) -> String {
    let plain =
        sample.roll.is_none() && sample.pitch.is_none() && sample.heading_sigma.is_none() && !sample.reduced;
    let degrees = |angle: Option<f64>| {
        // A billionth of a degree has no more digits than what is read here.
        angle.map_or_else(String::new, |a| format!("{:.9}", a.to_degrees()))
    };
    let heading = degrees(sample.heading.map(|h| h.rem_euclid(TAU)));
    let body = if plain {
        format!("HEHDT,{heading},T")
    } else {
        let (roll, pitch, sigma) =
            (degrees(sample.roll), degrees(sample.pitch), degrees(sample.heading_sigma));
        let aligned = u8::from(!sample.reduced);
        format!("PASHR,,{heading},T,{roll},{pitch},,,,{sigma},1,{aligned}")
    };
    let sum = lines::xor(body.as_bytes());
    format!("${body}*{sum:02X}\r\n")
}

/// Degrees within `limit` either way, as radians.
fn angle(field: &str, limit: f64) -> Option<f64> {
    number(field).filter(|v| v.abs() <= limit).map(f64::to_radians)
}

/// Degrees from 0 to 360, as radians below a turn.
fn heading(field: &str) -> Option<f64> {
    number(field).filter(|v| (0.0..=360.0).contains(v)).map(|v| (v % 360.0).to_radians())
}

/// `hhmmss.sss`, or `hhmmssfff` as one maker writes it, as seconds of the day.
fn utc_day_s(field: &str) -> Option<f64> {
    let digits = field.get(..6).filter(|d| d.bytes().all(|b| b.is_ascii_digit()))?;
    let two = |at: usize| digits.get(at..at + 2).and_then(|d| d.parse::<f64>().ok());
    let (hours, minutes, seconds) = (two(0)?, two(2)?, two(4)?);
    let rest = field.get(6..)?;
    let fraction = match rest.strip_prefix('.').unwrap_or(rest) {
        "" => 0.0,
        digits if digits.len() <= 9 && digits.bytes().all(|b| b.is_ascii_digit()) => {
            digits.parse::<f64>().ok()? / 10f64.powi(digits.len() as i32)
        }
        _ => return None,
    };
    // A leap second is 60.
    (hours < 24.0 && minutes < 60.0 && seconds <= 60.0)
        .then_some(hours * 3600.0 + minutes * 60.0 + seconds + fraction)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::lines::LINE_MAX_BYTES;

    fn parse(bytes: &[u8], piece: usize) -> (Vec<ShipAttitude>, LineCounters) {
        let mut parser = ShipParser::new();
        let mut said = Vec::new();
        for piece in bytes.chunks(piece) {
            said.extend(parser.lines(piece, Time::from_ns(3)));
        }
        (said, parser.counters())
    }

    fn line(body: &str) -> String {
        format!("${body}*{:02X}\r\n", lines::xor(body.as_bytes()))
    }

    /// Lines as ships' loggers have published them, check sums included.
    const LOGGED: &str = "$INZDA,163611.11,10,09,2019,,*76\r\n$INHDT,235.18,T*18\r\n$PSXN,20,1,0,0,0*3A\r\n\
                          $PSXN,22,-0.05,-0.68*32\r\n$PSXN,23,-2.82,1.00,235.18,-1.66*3D\r\n\
                          $PASHR,164100190,138.24,T,+32.56,+48.49,+00.00,3.141,3.141,35.000,1,0*17\r\n";

    fn degrees(value: Option<f64>) -> Option<f64> {
        value.map(|v| (v.to_degrees() * 1e6).round() / 1e6)
    }

    #[test]
    fn logged_lines_are_read() {
        for piece in 1..LOGGED.len() {
            let (said, counters) = parse(LOGGED.as_bytes(), piece);
            assert_eq!((counters.packets, counters.bad_crc, counters.skipped_bytes), (6, 0, 0));
            let [hdt, psxn, pashr] = said[..] else { panic!("{said:?}") };
            assert_eq!(
                (hdt.sentence, degrees(hdt.sample.heading), hdt.sample.roll),
                (NmeaSentence::Hdt, Some(235.18), None)
            );
            assert_eq!(psxn.sentence, NmeaSentence::Psxn);
            assert_eq!(
                [psxn.sample.roll, psxn.sample.pitch, psxn.sample.heading].map(degrees),
                [Some(-2.82), Some(1.0), Some(235.18)]
            );
            assert!(!psxn.sample.reduced);
            assert_eq!(
                [pashr.sample.roll, pashr.sample.pitch, pashr.sample.heading].map(degrees),
                [Some(32.56), Some(48.49), Some(138.24)]
            );
            assert_eq!(degrees(pashr.sample.heading_sigma), Some(35.0));
            assert!(pashr.sample.reduced, "its inertial part is not aligned");
            let utc = pashr.utc_day_s.expect("given");
            assert!((utc - 60_060.19).abs() < 1e-9, "{utc}");
        }
    }

    #[test]
    fn what_an_instrument_calls_invalid_is_absent() {
        let bad = [line("PSXN,20,0,0,2,1"), line("PSXN,23,1.5,-0.5,10.0,0.1")].concat();
        let (said, _) = parse(bad.as_bytes(), 7);
        let bad = said[0].sample;
        assert_eq!((bad.heading, degrees(bad.roll), bad.reduced), (None, Some(1.5), true));
        let nothing = [
            line("PSXN,20,0,0,2,2"),
            line("PSXN,23,1.5,-0.5,10.0,0.1"),
            line("HEHDT,,T"),
            line("HEHDT,361.0,T"),
            line("HEHDT,10.0,M"),
            line("GPHDT,nan,T"),
            line("PASHR,POS,1,2"),
        ]
        .concat();
        assert_eq!(
            parse(nothing.as_bytes(), 9),
            (Vec::new(), LineCounters { packets: 7, ..LineCounters::default() })
        );
        let north = parse(line("HEHDT,360.0,T").as_bytes(), 3).0;
        assert_eq!(north[0].sample.heading, Some(0.0));
    }

    #[test]
    fn times_of_day() {
        assert_eq!(utc_day_s("000000"), Some(0.0));
        assert_eq!(utc_day_s("235960.500"), Some(86_400.5));
        for none in ["", "1234", "246000", "12:00:00", "120000.1.2", "120000,5", "ab0000"] {
            assert_eq!(utc_day_s(none), None, "{none}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_survived_in_bounded_memory(bytes in prop::collection::vec(any::<u8>(), 0..4000), piece in 1usize..2000) {
            let mut parser = ShipParser::new();
            for piece in bytes.chunks(piece) {
                parser.lines(piece, Time::MIN).for_each(drop);
            }
            prop_assert!(parser.scanner.held().0 <= LINE_MAX_BYTES);
        }

        /// A line written is read again as the same measurement.
        #[test]
        fn a_line_says_what_was_read(
            heading in prop::option::of(0i64..360_000),
            roll in prop::option::of(-180_000i64..180_000),
            sigma in prop::option::of(0i64..10_000),
            reduced in any::<bool>(),
        ) {
            let angle = |v: Option<i64>| v.map(|v| (v as f64 / 1000.0).to_radians());
            let sample = ShipSample {
                arrival: Time::from_ns(3),
                heading: angle(heading),
                roll: angle(roll),
                pitch: angle(roll.map(|r| r / 2)),
                heading_sigma: angle(sigma),
                reduced,
            };
            let (said, counters) = parse(line_of(&sample).as_bytes(), 11);
            prop_assert_eq!(counters, LineCounters { packets: 1, ..LineCounters::default() });
            let says = heading.is_some() || roll.is_some();
            prop_assert_eq!(said.iter().map(|a| a.sample).collect::<Vec<_>>(), if says { vec![sample] } else { vec![] });
        }

        /// Whatever lies between them, every line is found, in order and once.
        #[test]
        fn garbage_between_lines_loses_none(
            gaps in prop::collection::vec(prop::collection::vec(prop_oneof![any::<u8>(), Just(b'$'), Just(b'*')], 0..90), 1..20),
            piece in 1usize..100,
        ) {
            let mut bytes = Vec::new();
            for (n, gap) in gaps.iter().enumerate() {
                bytes.extend(gap);
                bytes.extend(line(&format!("HEHDT,{n}.5,T")).bytes());
            }
            let (said, _) = parse(&bytes, piece);
            let said: Vec<_> = said.iter().map(|a| degrees(a.sample.heading)).collect();
            prop_assert_eq!(said, (0..gaps.len()).map(|n| Some(n as f64 + 0.5)).collect::<Vec<_>>());
        }
    }
}
