//! The formats of inertial units: one file a format, and one list of them all, [`ImuFormat`].
//!
//! To add one: write its file with a codec (and, for the tests, a unit that it simulates), name both below, and name its key in the
//! documentation. Configuration, detection, `bowwave doctor`, the tests of all formats and the fuzz targets follow from the list.

mod bno08x;
mod microstrain;
mod sbg;
pub mod vectornav;
mod witmotion;
mod xsens;

use std::fmt;

use super::reading::Reading;
use crate::framing::{FoundPacket, Framing, LineCounters, Scanner};

/// Packets without a sample that a unit may send whose packets are samples...
const PATIENCE_WHOLE: u32 = 4;
/// ...and one that sends a sample in parts, among packets about other things.
const PATIENCE_PARTS: u32 = 24;

/// One format: how its packets are told from other bytes ([`Framing`]) and what they say. A value is what a decoder remembers
/// between packets.
pub(super) trait ImuCodec: Framing + Default {
    /// Name in the configuration.
    const KEY: &'static str;
    /// Name for people.
    const NAME: &'static str;
    /// Advice on what to set on a unit whose output lacks something.
    const REMEDY: &'static str;
    /// Packets that prove the format. Chance makes a packet of random bytes with a check sum of sixteen bits (and a preamble) less
    /// than once in 10^8 bytes, one of eight bits about once in 10^6: as many close together never.
    const PROOF_PACKETS: usize;
    /// So many packets may come that complete no sample; with more the unit's output must lack something.
    const PATIENCE: u32 = PATIENCE_WHOLE;
    /// Time from one packet to the next of a unit without a clock, nanoseconds, where the format fixes it.
    const PERIOD_NS: Option<u32> = None;

    /// The measurement in one intact packet, in our axes and units; `None`: nothing that is used.
    fn reading(&mut self, packet: &FoundPacket<'_, Self::Head>) -> Option<Reading>;

    /// A packet around any `content`, with the right check sum: for simulated lines and fuzzers.
    fn wrap(content: &[u8]) -> Vec<u8>;
}

/// Where a packet lay, for the detection of formats.
#[derive(Clone, Copy, Debug)]
pub(super) struct PacketPlace {
    /// Its length, bytes.
    pub(super) bytes: usize,
    /// Bytes skipped before it since the line began.
    pub(super) skipped_bytes: u64,
}

/// The next packet's reading and place.
fn pull<C: ImuCodec>(scanner: &mut Scanner<C>, codec: &mut C) -> Option<(Option<Reading>, PacketPlace)> {
    let packet = scanner.next_packet()?;
    let place = PacketPlace { bytes: packet.bytes.len(), skipped_bytes: packet.skipped_bytes };
    Some((codec.reading(&packet), place))
}

/// Defines [`ImuFormat`] and [`PacketReader`] from the list of formats, each with its codec.
macro_rules! imu_formats {
    ($($(#[$doc:meta])* $format:ident: $codec:ty,)*) => {
        /// A format that is read.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum ImuFormat {
            $($(#[$doc])* $format,)*
        }

        impl ImuFormat {
            const COUNT: usize = [$(stringify!($format)),*].len();

            /// All of them.
            pub const ALL: [Self; Self::COUNT] = [$(Self::$format),*];

            /// Its name in the configuration.
            pub const fn key(self) -> &'static str {
                match self { $(Self::$format => <$codec>::KEY,)* }
            }

            /// The format of that name.
            pub fn from_key(key: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|format| format.key() == key)
            }

            /// A packet around any `content` (what stands between preamble and check sum; fields of a fixed length are cut or
            /// filled), with the right check sum: for simulated lines and fuzzers.
            pub fn wrap(self, content: &[u8]) -> Vec<u8> {
                match self { $(Self::$format => <$codec>::wrap(content),)* }
            }

            /// Advice on what to set on a unit whose output lacks something.
            pub(super) const fn remedy(self) -> &'static str {
                match self { $(Self::$format => <$codec>::REMEDY,)* }
            }

            /// Packets that prove it.
            pub(super) const fn proof_packets(self) -> usize {
                match self { $(Self::$format => <$codec>::PROOF_PACKETS,)* }
            }

            /// Packets that may come without completing a sample.
            pub(super) const fn patience(self) -> u32 {
                match self { $(Self::$format => <$codec>::PATIENCE,)* }
            }

            /// Time from one packet to the next of a unit without a clock, nanoseconds, where the format fixes it.
            pub(super) const fn period_ns(self) -> Option<u32> {
                match self { $(Self::$format => <$codec>::PERIOD_NS,)* }
            }
        }

        impl fmt::Display for ImuFormat {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(match self { $(Self::$format => <$codec>::NAME,)* })
            }
        }

        /// A pull decoder of one format: bytes in, readings out.
        #[derive(Debug)]
        pub(super) enum PacketReader {
            $(#[doc = stringify!($format)] $format(Scanner<$codec>, $codec),)*
        }

        impl PacketReader {
            pub(super) fn new(format: ImuFormat) -> Self {
                match format { $(ImuFormat::$format => Self::$format(Scanner::new(), <$codec>::default()),)* }
            }

            pub(super) const fn format(&self) -> ImuFormat {
                match self { $(Self::$format(..) => ImuFormat::$format,)* }
            }

            pub(super) const fn counters(&self) -> LineCounters {
                match self { $(Self::$format(scanner, _) => scanner.counters(),)* }
            }

            /// Takes bytes in, where [`Self::next_packet`] has no more.
            pub(super) fn insert(&mut self, bytes: &[u8]) {
                match self { $(Self::$format(scanner, _) => scanner.insert(bytes),)* }
            }

            /// The next packet: what it says and where it lay; `None`: more bytes are needed.
            pub(super) fn next_packet(&mut self) -> Option<(Option<Reading>, PacketPlace)> {
                match self { $(Self::$format(scanner, codec) => pull(scanner, codec),)* }
            }
        }

        #[cfg(test)]
        impl ImuFormat {
            /// Nanoseconds from one packet (or group of packets) of the unit that the tests simulate to the next.
            pub(crate) const fn simulated_period_ns(self) -> i64 {
                match self { $(Self::$format => <$codec as super::streams::SimulatedUnit>::PERIOD_NS,)* }
            }

            /// Packets of one of its samples.
            pub(crate) const fn simulated_packets(self) -> u64 {
                match self { $(Self::$format => <$codec as super::streams::SimulatedUnit>::PACKETS,)* }
            }

            /// How far the samples read may be from those sent.
            pub(crate) const fn tolerance(self) -> super::streams::FormatTolerance {
                match self { $(Self::$format => <$codec as super::streams::SimulatedUnit>::TOLERANCE,)* }
            }

            /// The bytes that such a unit sends for sample `n` of a motion.
            pub(crate) fn send(self, sample: &bowwave_core::event::ImuSample, n: i64, by_angles: bool) -> Vec<u8> {
                match self { $(Self::$format => <$codec as super::streams::SimulatedUnit>::send(sample, n, by_angles),)* }
            }

            /// Whether a byte sum is all that its packets have, which one of 256 false preambles passes.
            pub(super) const fn is_weak(self) -> bool {
                match self { $(Self::$format => <$codec as Framing>::WEAK,)* }
            }

            /// How many places of a stream begin something with a right check sum.
            pub(super) fn intact_places(self, bytes: &[u8]) -> usize {
                match self { $(Self::$format => crate::framing::intact_places::<$codec>(bytes).len(),)* }
            }
        }
    };
}

// Of two formats that are proven by the same bytes the first in this list is taken.
imu_formats! {
    /// VectorNav's binary output.
    VectorNav: vectornav::VectorNavCodec,
    /// VectorNav's lines of text.
    VectorNavAscii: vectornav::ascii::VectorNavLines,
    /// Xsens MTData2.
    Xsens: xsens::XsensCodec,
    /// MicroStrain MIP.
    MicroStrain: microstrain::MicroStrainCodec,
    /// SBG Systems' sbgECom.
    Sbg: sbg::SbgCodec,
    /// UART-RVC of the BNO08x.
    Bno08x: bno08x::Bno08xCodec,
    /// Witmotion's standard protocol.
    Witmotion: witmotion::WitmotionCodec,
}
