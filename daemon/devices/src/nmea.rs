//! The ship's own instruments, told as lines of NMEA 0183, sans-io: her heading and attitude, a second input beside the unit on
//! the gun, which cannot tell the ship's motion from the gun's and has no heading of its own; and place and time, which say where sun and
//! moon stand.
//!
//! Read are `$--HDT` (true heading: NMEA 0183, IEC 61162-1), `$PASHR` (attitude as Applanix, NovAtel and Oxford units send
//! it), `$PSXN,23` with its quality `$PSXN,20` (Kongsberg Seapath), `$--RMC` (place and time), `$--GGA` (place) and `$--ZDA` (time).
//! Heading is clockwise from true north; roll is positive with starboard down, pitch with the bow up; all in radians.

use std::f64::consts::TAU;

use bowwave_core::{
    ephemeris::{Place, Utc},
    event::{Event, ShipFix, ShipSample},
    time::Time,
};

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
    /// `$--RMC`.
    Rmc,
    /// `$--GGA`.
    Gga,
    /// `$--ZDA`.
    Zda,
}

impl NmeaSentence {
    /// Its name for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hdt => "HDT",
            Self::Pashr => "PASHR",
            Self::Psxn => "PSXN",
            Self::Rmc => "RMC",
            Self::Gga => "GGA",
            Self::Zda => "ZDA",
        }
    }
}

/// Measurement in one line of the ship's instruments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShipLine {
    /// The line.
    pub sentence: NmeaSentence,
    /// The measurement.
    pub said: ShipSaid,
}

/// What a line tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShipSaid {
    /// Heading and attitude.
    Attitude(ShipSample),
    /// Place and time.
    Fix(ShipFix),
}

impl From<ShipSaid> for Event {
    fn from(said: ShipSaid) -> Self {
        match said {
            ShipSaid::Attitude(sample) => Self::Ship(sample),
            ShipSaid::Fix(fix) => Self::ShipFix(fix),
        }
    }
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
    pub fn next_line(&mut self, input: &mut &[u8], arrival: Time) -> Option<ShipLine> {
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
    ) -> impl Iterator<Item = ShipLine> + 'a {
        std::iter::from_fn(move || self.next_line(&mut bytes, arrival))
    }
}

/// The measurement in a line without `$` and check sum; `None` for other lines and those without one.
fn read(body: &str, quality: &mut PsxnQuality, arrival: Time) -> Option<ShipLine> {
    let mut fields = body.split(',');
    let address = fields.next()?;
    let fields: [&str; 11] = std::array::from_fn(|_| fields.next().unwrap_or_default());
    let attitude = attitude(address, &fields, quality, arrival);
    let (sentence, said) = attitude
        .map(|(sentence, sample)| (sentence, ShipSaid::Attitude(sample)))
        .or_else(|| fix(address, &fields, arrival).map(|(sentence, fix)| (sentence, ShipSaid::Fix(fix))))?;
    Some(ShipLine { sentence, said })
}

fn attitude(
    address: &str,
    fields: &[&str; 11],
    quality: &mut PsxnQuality,
    arrival: Time,
) -> Option<(NmeaSentence, ShipSample)> {
    let nothing =
        ShipSample { arrival, heading: None, roll: None, pitch: None, heading_sigma: None, reduced: false };
    let (sentence, sample) = match (address, *fields) {
        (address, [degrees, "T", ..]) if is_of(address, "HDT") => {
            (NmeaSentence::Hdt, ShipSample { heading: heading(degrees), ..nothing })
        }
        ("PASHR", [_, degrees, "T", roll, pitch, _, _, _, sigma, _, aligned]) => {
            let sample = ShipSample {
                heading: heading(degrees),
                roll: angle(roll, 180.0),
                pitch: angle(pitch, 90.0),
                heading_sigma: angle(sigma, 180.0).filter(|s| *s >= 0.0),
                reduced: aligned == "0",
                ..nothing
            };
            (NmeaSentence::Pashr, sample)
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
            (NmeaSentence::Psxn, sample)
        }
        _ => return None,
    };
    let says = sample.heading.is_some() || sample.roll.is_some() || sample.pitch.is_some();
    says.then_some((sentence, sample))
}

/// Place and time in a line, where its receiver calls them valid.
fn fix(address: &str, fields: &[&str; 11], arrival: Time) -> Option<(NmeaSentence, ShipFix)> {
    /// Kinds of a fix: by itself, differential, military, real-time kinematic fixed and floating; not estimated, typed or simulated.
    const VALID: [&str; 5] = ["1", "2", "3", "4", "5"];
    let (sentence, place, utc) = match *fields {
        [time, "A", latitude, north, longitude, east, _, _, date, ..] if is_of(address, "RMC") => {
            let utc = digit_pairs(date)
                .and_then(|[day, month, year]| utc(time, day, month, 2000 + i32::from(year)));
            (NmeaSentence::Rmc, place([latitude, north, longitude, east]), utc)
        }
        [_, latitude, north, longitude, east, kind, ..] if is_of(address, "GGA") && VALID.contains(&kind) => {
            (NmeaSentence::Gga, place([latitude, north, longitude, east]), None)
        }
        [time, day, month, year, ..] if is_of(address, "ZDA") => {
            // Receivers that have heard nothing yet count from the beginning of GPS or of their firmware.
            let year = year.parse().ok().filter(|year| *year >= 2000)?;
            (NmeaSentence::Zda, None, utc(time, day.parse().ok()?, month.parse().ok()?, year))
        }
        _ => return None,
    };
    (place.is_some() || utc.is_some()).then_some((sentence, ShipFix { arrival, place, utc }))
}

/// Tests whether an address is that of a talker's sentence of that name.
fn is_of(address: &str, name: &str) -> bool {
    address.len() == 5 && address.ends_with(name)
}

/// Latitude `ddmm.mmm`, `N` or `S`, longitude `dddmm.mmm`, `E` or `W`.
fn place([latitude, north, longitude, east]: [&str; 4]) -> Option<Place> {
    let degrees = |field: &str, half: &str, [positive, negative]: [&str; 2]| {
        let value = number(field).filter(|v| (0.0..=18_000.0).contains(v))?;
        let whole = (value / 100.0).floor();
        let minutes = value - 100.0 * whole;
        let degrees = whole + minutes / 60.0;
        let sign = if half == positive { 1.0 } else { -1.0 };
        (minutes < 60.0 && (half == positive || half == negative)).then_some(sign * degrees)
    };
    Place::new(degrees(latitude, north, ["N", "S"])?, degrees(longitude, east, ["E", "W"])?)
}

fn utc(time: &str, day: u8, month: u8, year: i32) -> Option<Utc> {
    Utc::of_day(year, month, day, utc_day_s(time)?)
}

/// Three numbers of two digits each, at the front of a field.
fn digit_pairs(field: &str) -> Option<[u8; 3]> {
    let digits = field.get(..6).filter(|d| d.bytes().all(|b| b.is_ascii_digit()))?;
    let two = |at: usize| digits.get(at..at + 2).and_then(|d| d.parse().ok());
    Some([two(0)?, two(2)?, two(4)?])
}

/// The lines that tell place and time: `$GPGGA` and `$GPZDA`. Read again they are the same to a billionth of a minute of arc and to a
/// millisecond.
pub fn fix_lines(fix: &ShipFix) -> String {
    let place = fix.place.map_or_else(String::new, |place| {
        let field = |degrees: f64, digits: usize, [positive, negative]: [char; 2]| {
            let (whole, half) = (degrees.abs().floor(), if degrees < 0.0 { negative } else { positive });
            let minutes = (degrees.abs() - whole) * 60.0;
            // A minute that rounds up to the next degree is written as its last billionth.
            format!("{whole:0digits$.0}{:012.9},{half}", minutes.min(59.999_999_999))
        };
        let (latitude, longitude) = (place.latitude_deg(), place.longitude_deg());
        let (north, east) = (field(latitude, 2, ['N', 'S']), field(longitude, 3, ['E', 'W']));
        line(&format!("GPGGA,,{north},{east},1,,,,,,,,"))
    });
    let time = fix.utc.map_or_else(String::new, |utc| {
        let (year, month, day, of_day) = utc.day();
        let (minutes, seconds) = ((of_day / 60.0) as u32, of_day % 60.0);
        let (hour, minute) = (minutes / 60, minutes % 60);
        line(&format!("GPZDA,{hour:02}{minute:02}{seconds:06.3},{day:02},{month:02},{year:04},,"))
    });
    place + &time
}

fn line(body: &str) -> String {
    format!("${body}*{:02X}\r\n", lines::xor(body.as_bytes()))
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
    line(&body)
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
    let [hours, minutes, seconds] = digit_pairs(field)?.map(f64::from);
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

    fn parse(bytes: &[u8], piece: usize) -> (Vec<ShipLine>, LineCounters) {
        let mut parser = ShipParser::new();
        let mut said = Vec::new();
        for piece in bytes.chunks(piece) {
            said.extend(parser.lines(piece, Time::from_ns(3)));
        }
        (said, parser.counters())
    }

    /// Heading and attitude in what was said.
    fn samples(said: &[ShipLine]) -> Vec<ShipSample> {
        let sample = |line: &ShipLine| match line.said {
            ShipSaid::Attitude(sample) => Some(sample),
            ShipSaid::Fix(_) => None,
        };
        said.iter().filter_map(sample).collect()
    }

    /// Place and time in what was said.
    fn fixes(said: &[ShipLine]) -> Vec<ShipFix> {
        let fix = |line: &ShipLine| match line.said {
            ShipSaid::Fix(fix) => Some(fix),
            ShipSaid::Attitude(_) => None,
        };
        said.iter().filter_map(fix).collect()
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
            let sentences: Vec<NmeaSentence> = said.iter().map(|line| line.sentence).collect();
            assert_eq!(
                sentences,
                [NmeaSentence::Zda, NmeaSentence::Hdt, NmeaSentence::Psxn, NmeaSentence::Pashr]
            );
            let [hdt, psxn, pashr] = samples(&said)[..] else { panic!("{said:?}") };
            assert_eq!((degrees(hdt.heading), hdt.roll), (Some(235.18), None));
            assert_eq!(
                [psxn.roll, psxn.pitch, psxn.heading].map(degrees),
                [Some(-2.82), Some(1.0), Some(235.18)]
            );
            assert!(!psxn.reduced);
            assert_eq!(
                [pashr.roll, pashr.pitch, pashr.heading].map(degrees),
                [Some(32.56), Some(48.49), Some(138.24)]
            );
            assert_eq!(degrees(pashr.heading_sigma), Some(35.0));
            assert!(pashr.reduced, "its inertial part is not aligned");
            let utc = Utc::of_day(2019, 9, 10, 16.0 * 3600.0 + 36.0 * 60.0 + 11.11);
            assert_eq!(fixes(&said), [ShipFix { arrival: Time::from_ns(3), place: None, utc }]);
        }
    }

    /// Lines of receivers as their makers' manuals print them.
    #[test]
    fn place_and_time_are_read() {
        let lines = "$GPRMC,092725.00,A,4717.11437,N,00833.91522,E,0.004,77.52,091202,,,A*5E\r\n\
                     $GPGGA,092725.00,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,*5B\r\n";
        let (said, counters) = parse(lines.as_bytes(), 13);
        assert_eq!((counters.packets, counters.bad_crc), (2, 0));
        let [rmc, gga] = fixes(&said)[..] else { panic!("{said:?}") };
        let place = rmc.place.expect("told");
        assert!((place.latitude_deg() - 47.285_239_5).abs() < 1e-9, "{place}");
        assert!((place.longitude_deg() - 8.565_253_666_7).abs() < 1e-9, "{place}");
        assert_eq!(rmc.utc, Utc::of_day(2002, 12, 9, 9.0 * 3600.0 + 27.0 * 60.0 + 25.0));
        assert_eq!((gga.utc, gga.place.is_some()), (None, true));
        let south_west =
            fixes(&parse(line("GNRMC,000000,A,3351.0,S,07040.5,W,,,311226,,,D").as_bytes(), 9).0);
        let place = south_west[0].place.expect("told");
        assert_eq!((place.latitude_deg(), place.longitude_deg()), (-33.85, -70.675));
    }

    #[test]
    fn a_receiver_without_a_fix_tells_nothing() {
        let none = [
            "GPRMC,092725.00,V,4717.11437,N,00833.91522,E,0.004,77.52,091202,,,N",
            "GPRMC,,V,,,,,,,,,,N",
            "GPRMC,,A,,,,,,,,,,A",
            "GPRMC,256100,A,4717.1,N,00833.9,X,,,310226,,,A",
            "GPRMC,092725,A,4760.1,N,00833.9,E,,,,,,A",
            "GPRMC,092725,A,9100.0,N,00833.9,E,,,,,,A",
            "GPGGA,092725.00,4717.11399,N,00833.91590,E,0,08,1.01,499.6,M,48.0,M,,",
            "GPGGA,092725.00,4717.11399,N,00833.91590,E,8,08,1.01,499.6,M,48.0,M,,",
            "GPZDA,000012.00,06,01,1980,00,00",
            "GPZDA,000012.00,31,02,2026,00,00",
            "GPZDA,,,,,,",
            "ZDA,163611.11,10,09,2019,,",
        ];
        for body in none {
            assert_eq!(parse(line(body).as_bytes(), 5).0, [], "{body}");
        }
    }

    #[test]
    fn what_an_instrument_calls_invalid_is_absent() {
        let bad = [line("PSXN,20,0,0,2,1"), line("PSXN,23,1.5,-0.5,10.0,0.1")].concat();
        let (said, _) = parse(bad.as_bytes(), 7);
        let bad = samples(&said)[0];
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
        assert_eq!(samples(&north)[0].heading, Some(0.0));
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
            prop_assert_eq!(samples(&said), if says { vec![sample] } else { vec![] });
        }

        #[test]
        fn lines_tell_the_place_and_time_that_were_read(
            latitude in -5_400_000i32..=5_400_000,
            longitude in -10_800_000i32..=10_800_000,
            ms in 946_684_800_000i64..32_503_679_000_000,
        ) {
            // Thousandths of a minute, as receivers write them.
            let degrees = |thousandths: i32| f64::from(thousandths) / 60_000.0;
            let (place, utc) = (Place::new(degrees(latitude), degrees(longitude)), Utc::from_ms(ms));
            let fix = ShipFix { arrival: Time::from_ns(3), place, utc };
            let (said, counters) = parse(fix_lines(&fix).as_bytes(), 11);
            prop_assert_eq!(counters, LineCounters { packets: 2, ..LineCounters::default() });
            let [there, then] = fixes(&said)[..] else { panic!("{said:?}") };
            prop_assert_eq!((there.utc, then.place, then.utc), (None, None, utc));
            let (found, place) = (there.place.expect("told"), place.expect("in range"));
            prop_assert!((found.latitude_deg() - place.latitude_deg()).abs() < 1e-10);
            prop_assert!((found.longitude_deg() - place.longitude_deg()).abs() < 1e-10);
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
            let said: Vec<_> = samples(&said).iter().map(|a| degrees(a.heading)).collect();
            prop_assert_eq!(said, (0..gaps.len()).map(|n| Some(n as f64 + 0.5)).collect::<Vec<_>>());
        }
    }
}
