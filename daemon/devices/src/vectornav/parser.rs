//! Finds packets in a byte stream that may hold anything.

use super::{
    Packet,
    crc::crc16,
    layout::{Header, Layout, MAX_PACKET, SYNC},
};

/// Bytes taken in at a time; with one unfinished packet they bound the buffer.
pub(super) const CHUNK: usize = 1024;

/// What a parser has met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ParserCounters {
    /// Packets with a right check sum.
    pub packets: u64,
    /// Places that looked like a packet and had a wrong check sum: damaged packets and false preambles.
    pub bad_crc: u64,
    /// Bytes that belonged to no packet.
    pub skipped_bytes: u64,
}

/// Takes bytes in pieces of any size and reports the packets in them. No byte is thrown away before it is clear that no
/// packet begins there, so a false preamble costs no packet behind it. Memory is bounded.
#[derive(Debug)]
pub struct Parser {
    pub(super) buffer: Vec<u8>,
    /// The newest layouts of good packets. A unit has three binary outputs.
    known: [Option<Layout>; 3],
    counters: ParserCounters,
}

impl Default for Parser {
    fn default() -> Self {
        Self::new()
    }
}

impl Parser {
    /// A parser that has met nothing.
    pub fn new() -> Self {
        Self {
            buffer: Vec::with_capacity(MAX_PACKET + CHUNK),
            known: [None; 3],
            counters: ParserCounters::default(),
        }
    }

    /// What has been met so far. Bytes of a packet still incomplete are not counted yet.
    pub const fn counters(&self) -> ParserCounters {
        self.counters
    }

    /// Takes the next bytes of the stream and calls `sink` with each packet that they complete, in order.
    pub fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(&Packet)) {
        for chunk in bytes.chunks(CHUNK) {
            self.buffer.extend_from_slice(chunk);
            self.advance(&mut sink);
        }
    }

    /// Reports every complete packet in the buffer and keeps the unfinished rest.
    fn advance(&mut self, sink: &mut impl FnMut(&Packet)) {
        let mut at = 0;
        while let Some(rest) = self.buffer.get(at..).filter(|rest| !rest.is_empty()) {
            let Some(sync) = rest.iter().position(|&b| b == SYNC) else {
                at = self.skip(at, self.buffer.len());
                break;
            };
            at = self.skip(at, at + sync);
            let candidate = &self.buffer[at..];
            let layout = match Layout::parse(candidate) {
                Header::Incomplete => break,
                Header::Invalid => {
                    at = self.skip(at, at + 1);
                    continue;
                }
                Header::Valid(layout) => layout,
            };
            match candidate.get(..layout.packet_bytes()) {
                Some(packet) if crc16(&packet[1..]) == 0 => {
                    sink(&Packet::decode(packet, &layout));
                    self.counters.packets += 1;
                    self.learn(layout);
                    at += layout.packet_bytes();
                }
                Some(_) => {
                    self.counters.bad_crc += 1;
                    at = self.skip(at, at + 1);
                }
                None => match self.packet_within(at, &layout) {
                    Some(found) => at = self.skip(at, found),
                    None => break,
                },
            }
        }
        self.buffer.drain(..at);
    }

    /// Counts the bytes from `from` to `to` as skipped; `to`.
    fn skip(&mut self, from: usize, to: usize) -> usize {
        self.counters.skipped_bytes += (to - from) as u64;
        to
    }

    /// A candidate of a layout that the line has not sent before and that lacks bytes may be a false preamble that claims up
    /// to 600 of them. If a whole packet lies behind its first byte, it is one: two packets never overlap.
    fn packet_within(&self, at: usize, layout: &Layout) -> Option<usize> {
        if self.known.contains(&Some(*layout)) {
            return None;
        }
        (at + 1..self.buffer.len()).find(|&place| {
            let rest = &self.buffer[place..];
            match Layout::parse(rest) {
                Header::Valid(inner) => {
                    rest.get(1..inner.packet_bytes()).is_some_and(|body| crc16(body) == 0)
                }
                Header::Incomplete | Header::Invalid => false,
            }
        })
    }

    /// Remembers that the line sends packets of `layout`.
    fn learn(&mut self, layout: Layout) {
        if self.known.contains(&Some(layout)) {
            return;
        }
        self.known.rotate_right(1);
        self.known[0] = Some(layout);
    }
}
