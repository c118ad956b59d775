//! Finds the packets of a format in a byte stream that may hold anything: the part that all formats share.
//!
//! A format says how a packet begins, how long it is and whether it is intact ([`Framing`]); [`Scanner`] does the rest. No
//! byte is thrown away before it is clear that no packet begins there, so a false preamble costs no packet behind it, and a
//! claimed length never makes memory grow beyond the longest packet that the format knows.

use std::ops::Range;

/// Bytes taken in at a time; with one unfinished packet they bound the buffer.
pub(crate) const CHUNK: usize = 1024;
/// Kinds of packets remembered. Units send a handful.
const KNOWN: usize = 8;

/// Takes the next piece from the front of `input`; `None` where it is used up.
pub(crate) fn chunk<'a>(input: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (piece, rest) = input.split_at(input.len().min(CHUNK));
    *input = rest;
    (!piece.is_empty()).then_some(piece)
}

/// Counts of what a scanner has met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineCounters {
    /// Packets with a right check sum.
    pub packets: u64,
    /// Places that looked like a packet and had a wrong check sum: damaged packets and false preambles.
    pub bad_crc: u64,
    /// Bytes that belonged to no packet.
    pub skipped_bytes: u64,
}

/// Reading of bytes where a packet may begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PacketLook<Head> {
    /// More bytes are needed to tell.
    Incomplete,
    /// No packet of this format.
    Invalid,
    /// A packet that claims this many bytes, from its first to its last.
    Packet {
        /// Its head, of its first bytes.
        head: Head,
        /// Its length; never above [`Framing::MAX_BYTES`].
        bytes: usize,
    },
}

/// The sum of bytes, modulo 256: the check sum of several formats.
pub(crate) fn byte_sum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0u8, |sum, &byte| sum.wrapping_add(byte))
}

/// How a format's packets are told from other bytes.
pub(crate) trait Framing {
    /// Head of a packet: it tells one kind from another, its length included.
    type Head: Copy + PartialEq + std::fmt::Debug;
    /// The first byte of every packet.
    const SYNC: u8;
    /// The longest packet, bytes.
    const MAX_BYTES: usize;
    /// The check sum has eight bits only: one of 256 false preambles passes it.
    const WEAK: bool;

    /// Looks at bytes that begin with [`Self::SYNC`] and go on beyond the packet, or end before it does.
    fn look(bytes: &[u8]) -> PacketLook<Self::Head>;

    /// Whether a packet of the length that it claims has the right check sum.
    fn intact(packet: &[u8]) -> bool;
}

/// A packet in the stream.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FoundPacket<'a, Head> {
    /// Its head, of its first bytes.
    pub(crate) head: Head,
    /// The whole packet.
    pub(crate) bytes: &'a [u8],
    /// Bytes skipped before it since the stream began.
    pub(crate) skipped_bytes: u64,
}

#[cfg(test)]
impl<F: Framing> Scanner<F> {
    /// What `parse` makes of all packets in a stream, and the line's counters after it.
    pub(crate) fn parsed<P>(
        mut stream: &[u8],
        parse: impl Fn(&[u8], F::Head) -> Option<P>,
    ) -> (Vec<P>, LineCounters) {
        let mut scanner = Self::new();
        let mut parsed = Vec::new();
        while let Some(found) = scanner.next_of(&mut stream) {
            parsed.extend(parse(found.bytes, found.head));
        }
        (parsed, scanner.counters())
    }
}

/// A pull decoder: bytes of any pieces in, packets out, one at a time. Memory is bounded.
#[derive(Debug)]
pub(crate) struct Scanner<F: Framing> {
    buffer: Vec<u8>,
    /// Where in the buffer what has not been looked through begins.
    start: usize,
    /// The newest kinds of good packets.
    known: [Option<F::Head>; KNOWN],
    /// The last thing met was a packet: what follows begins where one may.
    in_step: bool,
    counters: LineCounters,
}

impl<F: Framing> Scanner<F> {
    /// A scanner that has met nothing.
    pub(crate) fn new() -> Self {
        Self {
            buffer: Vec::new(),
            start: 0,
            known: [None; KNOWN],
            in_step: false,
            counters: LineCounters::default(),
        }
    }

    /// Counts so far. Bytes of a packet still incomplete are not counted yet.
    pub(crate) const fn counters(&self) -> LineCounters {
        self.counters
    }

    /// Bytes of a packet still incomplete, and bytes of memory for them.
    #[cfg(test)]
    pub(crate) fn held(&self) -> (usize, usize) {
        (self.buffer.len() - self.start, self.buffer.capacity())
    }

    /// Takes bytes in. To be called where [`Self::next_packet`] has no more: at most [`CHUNK`] at a time keep the memory bounded.
    pub(crate) fn insert(&mut self, bytes: &[u8]) {
        self.buffer.drain(..self.start);
        self.start = 0;
        self.buffer.extend_from_slice(bytes);
    }

    /// The next packet of the bytes that were taken in; `None`: more are needed.
    pub(crate) fn next_packet(&mut self) -> Option<FoundPacket<'_, F::Head>> {
        let (head, packet) = self.advance()?;
        Some(FoundPacket {
            head,
            bytes: self.buffer.get(packet)?,
            skipped_bytes: self.counters.skipped_bytes,
        })
    }

    /// The next packet, for which bytes are taken from the front of `input` as far as they are needed; `None`: `input` is used up.
    pub(crate) fn next_of(&mut self, input: &mut &[u8]) -> Option<FoundPacket<'_, F::Head>> {
        let (head, packet) = loop {
            match self.advance() {
                Some(found) => break found,
                None => self.insert(chunk(input)?),
            }
        };
        Some(FoundPacket {
            head,
            bytes: self.buffer.get(packet)?,
            skipped_bytes: self.counters.skipped_bytes,
        })
    }

    /// Goes on to behind the next packet; its head and where it lies in the buffer.
    fn advance(&mut self) -> Option<(F::Head, Range<usize>)> {
        loop {
            let rest = self.buffer.get(self.start..).filter(|rest| !rest.is_empty())?;
            let Some(sync) = rest.iter().position(|&b| b == F::SYNC) else {
                let left = rest.len();
                self.skip(left);
                return None;
            };
            self.skip(sync);
            let at = self.start;
            let candidate = &self.buffer[at..];
            let (head, bytes) = match F::look(candidate) {
                PacketLook::Incomplete => return None,
                PacketLook::Packet { head, bytes } if bytes <= F::MAX_BYTES => (head, bytes),
                PacketLook::Packet { .. } | PacketLook::Invalid => {
                    self.skip(1);
                    continue;
                }
            };
            match candidate.get(..bytes) {
                Some(packet) if F::intact(packet) => match self.rival(at, bytes, head) {
                    Rival::None => {
                        self.counters.packets += 1;
                        self.in_step = true;
                        self.learn(head);
                        self.start = at + bytes;
                        return Some((head, at..self.start));
                    }
                    Rival::Perhaps => return None,
                    Rival::At(place) => {
                        self.counters.bad_crc += 1;
                        self.skip(place - at);
                    }
                },
                Some(_) => {
                    self.counters.bad_crc += 1;
                    self.skip(1);
                }
                None => {
                    let place = self.packet_within(at, bytes, head)?;
                    self.skip(place - at);
                }
            }
        }
    }

    /// Leaves out the next `bytes` bytes.
    fn skip(&mut self, bytes: usize) {
        self.in_step &= bytes == 0;
        self.counters.skipped_bytes += bytes as u64;
        self.start += bytes;
    }

    /// Whether another packet claims bytes of the intact one at `at`. A check sum of eight bits is right by chance too often
    /// to take the first that is, unless it stands directly behind a packet or before one. Of longer ones only a kind that the line
    /// has not sent before is doubted: had its bytes come one by one, a packet within it would have been taken before its end.
    fn rival(&self, at: usize, bytes: usize, head: F::Head) -> Rival {
        if !F::WEAK {
            return self.packet_within(at, bytes, head).map_or(Rival::None, Rival::At);
        }
        if self.in_step {
            return Rival::None;
        }
        let behind = &self.buffer[at + bytes..];
        if behind.first() == Some(&F::SYNC) && F::look(behind) != PacketLook::Invalid {
            return Rival::None;
        }
        for place in at + 1..at + bytes {
            let rest = &self.buffer[place..];
            if rest.first() != Some(&F::SYNC) {
                continue;
            }
            match F::look(rest) {
                PacketLook::Invalid => {}
                PacketLook::Incomplete => return Rival::Perhaps,
                PacketLook::Packet { bytes, .. } => match rest.get(..bytes) {
                    None => return Rival::Perhaps,
                    Some(packet) if F::intact(packet) => return Rival::At(place),
                    Some(_) => {}
                },
            }
        }
        Rival::None
    }

    /// The packet that ends first within a candidate of a kind that the line has not sent before. Such a candidate is a false preamble
    /// that claims many bytes: two packets never overlap, and what it claims may not be there yet.
    fn packet_within(&self, at: usize, bytes: usize, head: F::Head) -> Option<usize> {
        if self.known.contains(&Some(head)) {
            return None;
        }
        let end = self.buffer.len().min(at + bytes - 1);
        let places = (at + 1..end).filter(|&place| self.buffer[place] == F::SYNC);
        let ends = places.filter_map(|place| {
            let PacketLook::Packet { bytes, .. } = F::look(&self.buffer[place..]) else { return None };
            let packet = self.buffer[..end].get(place..place + bytes)?;
            F::intact(packet).then_some((place + bytes, place))
        });
        ends.min().map(|(_, place)| place)
    }

    /// Remembers that the line sends packets of this kind.
    fn learn(&mut self, head: F::Head) {
        if self.known.contains(&Some(head)) {
            return;
        }
        self.known.rotate_right(1);
        self.known[0] = Some(head);
    }
}

/// Where something with a right check sum begins, real packet or chance.
#[cfg(test)]
pub(crate) fn intact_places<F: Framing>(bytes: &[u8]) -> Vec<usize> {
    let is_packet = |&at: &usize| match F::look(&bytes[at..]) {
        PacketLook::Packet { bytes: length, .. } => bytes.get(at..at + length).is_some_and(F::intact),
        _ => false,
    };
    (0..bytes.len()).filter(|&at| bytes[at] == F::SYNC).filter(is_packet).collect()
}

/// Whether an intact packet may be none.
enum Rival {
    /// It is one.
    None,
    /// That needs more bytes.
    Perhaps,
    /// The one that begins here is intact as well and begins later.
    At(usize),
}
