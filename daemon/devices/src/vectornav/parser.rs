//! Binary packets in a byte stream that may hold anything.

use super::{
    Packet,
    crc::crc16,
    layout::{Header, Layout, MAX_PACKET, SYNC},
};
use crate::framing::{Found, Framing, LineCounters, Look, Scanner};

/// The framing of VectorNav's binary output.
#[derive(Debug)]
pub(crate) struct Binary;

impl Framing for Binary {
    type Head = Layout;
    const SYNC: u8 = SYNC;
    const MAX_BYTES: usize = MAX_PACKET;
    const WEAK: bool = false;

    fn look(bytes: &[u8]) -> Look<Layout> {
        match Layout::parse(bytes) {
            Header::Incomplete => Look::Incomplete,
            Header::Invalid => Look::Invalid,
            Header::Valid(layout) => Look::Packet { head: layout, bytes: layout.packet_bytes() },
        }
    }

    fn intact(packet: &[u8]) -> bool {
        packet.get(1..).is_some_and(|body| crc16(body) == 0)
    }
}

impl Packet {
    /// The packet that was found.
    pub(crate) fn of(found: &Found<'_, Layout>) -> Self {
        Self::decode(found.bytes, &found.head)
    }
}

/// Takes bytes in pieces of any size and reports the packets in them. Memory is bounded.
#[derive(Debug)]
pub struct Parser {
    pub(super) scanner: Scanner<Binary>,
}

impl Default for Parser {
    fn default() -> Self {
        Self::new()
    }
}

impl Parser {
    /// A parser that has met nothing.
    pub fn new() -> Self {
        Self { scanner: Scanner::new() }
    }

    /// What has been met so far. Bytes of a packet still incomplete are not counted yet.
    pub const fn counters(&self) -> LineCounters {
        self.scanner.counters()
    }

    /// Takes the next bytes of the stream and calls `sink` with each packet that they complete, in order.
    pub fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(&Packet)) {
        self.scanner.push(bytes, |found| sink(&Packet::of(&found)));
    }
}
