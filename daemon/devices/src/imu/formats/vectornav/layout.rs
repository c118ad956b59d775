//! Which fields a binary packet carries and how long they are.

/// First byte of every binary packet.
pub const SYNC: u8 = 0xfa;

/// The longest packet that a unit sends, bytes.
pub const MAX_PACKET: usize = 600;

/// Groups 1 to 7: common, time, IMU, GNSS 1, attitude, INS, GNSS 2.
pub const GROUPS: usize = 7;

/// Bytes of each field by group and bit (VectorNav interface control documents of VN-100 and VN-300, "binary output
/// types"; fields that the documents reserve take the lengths of the maker's own library). 0: no such field, or one of
/// variable length (satellites and raw measurements of the GNSS groups), which no inertial unit of ours sends.
const FIELD_BYTES: [[u8; 16]; GROUPS] = [
    [8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8, 0],
    [8, 8, 8, 2, 8, 8, 8, 4, 4, 1, 0, 0, 0, 0, 0, 0],
    [2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 40, 0, 0, 0],
    [8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28, 0, 0],
    [2, 12, 16, 36, 12, 12, 12, 12, 12, 12, 28, 24, 12, 0, 0, 0],
    [2, 24, 24, 12, 12, 12, 12, 12, 12, 4, 4, 68, 64, 0, 0, 0],
    [8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28, 0, 0],
];

/// The fields of a packet, as its header states them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PacketLayout {
    masks: [u16; GROUPS],
    header_bytes: usize,
    packet_bytes: usize,
}

/// Reading of the first bytes after a sync byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PacketHeader {
    /// More bytes are needed to tell.
    Incomplete,
    /// No header that a unit sends.
    Invalid,
    /// A header.
    Valid(PacketLayout),
}

/// One field's place in a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PacketField {
    /// Group, 1 to 7.
    pub group: usize,
    /// Bit in the group's mask.
    pub bit: usize,
    /// Where it begins, counted from the sync byte.
    pub offset: usize,
    /// Its length in bytes.
    pub bytes: usize,
}

impl PacketLayout {
    /// Reads the header at the start of `bytes` (sync byte included).
    pub fn parse(bytes: &[u8]) -> PacketHeader {
        let (Some(&sync), Some(&groups)) = (bytes.first(), bytes.get(1)) else {
            return PacketHeader::Incomplete;
        };
        // Bit 7 announces a second group byte, which no supported unit sends.
        if sync != SYNC || groups == 0 || groups & 0x80 != 0 {
            return PacketHeader::Invalid;
        }
        let mut masks = [0; GROUPS];
        let mut header_bytes = 2;
        let mut payload_bytes = 0;
        for (group, mask) in masks.iter_mut().enumerate() {
            if groups & 1 << group == 0 {
                continue;
            }
            let Some(&[low, high]) = bytes.get(header_bytes..header_bytes + 2) else {
                return PacketHeader::Incomplete;
            };
            *mask = u16::from_le_bytes([low, high]);
            header_bytes += 2;
            match group_bytes(group, *mask) {
                Some(bytes) => payload_bytes += bytes,
                None => return PacketHeader::Invalid,
            }
        }
        let packet_bytes = header_bytes + payload_bytes + 2;
        if packet_bytes > MAX_PACKET {
            return PacketHeader::Invalid;
        }
        PacketHeader::Valid(Self { masks, header_bytes, packet_bytes })
    }

    /// Length of the whole packet, sync byte and CRC included.
    pub const fn packet_bytes(&self) -> usize {
        self.packet_bytes
    }

    /// The packet's fields in the order of the wire.
    pub fn fields(&self) -> impl Iterator<Item = PacketField> + '_ {
        let mut offset = self.header_bytes;
        (0..GROUPS * 16).filter_map(move |i| {
            let (group, bit) = (i / 16, i % 16);
            if self.masks[group] & 1 << bit == 0 {
                return None;
            }
            let bytes = usize::from(FIELD_BYTES[group][bit]);
            let field = PacketField { group: group + 1, bit, offset, bytes };
            offset += bytes;
            Some(field)
        })
    }
}

/// Payload bytes of one group; `None` where the mask is empty or names a field without a known length.
fn group_bytes(group: usize, mask: u16) -> Option<usize> {
    if mask == 0 {
        return None;
    }
    (0..16).filter(|bit| mask & 1 << bit != 0).try_fold(0, |sum, bit: usize| match FIELD_BYTES[group][bit] {
        0 => None,
        bytes => Some(sum + usize::from(bytes)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The header that the wave logger of the recorded stream documents, and its stated length of 124 bytes.
    #[test]
    fn length_of_a_documented_header() {
        let PacketHeader::Valid(layout) = PacketLayout::parse(&[0xfa, 0x14, 0x3e, 0x00, 0x3a, 0x00]) else {
            panic!("a valid header")
        };
        assert_eq!(layout.packet_bytes(), 124);
        let fields: Vec<_> = layout.fields().map(|f| (f.group, f.bit, f.offset)).collect();
        assert_eq!(
            fields,
            [
                (3, 1, 6),
                (3, 2, 18),
                (3, 3, 30),
                (3, 4, 42),
                (3, 5, 46),
                (5, 1, 50),
                (5, 3, 62),
                (5, 4, 98),
                (5, 5, 110)
            ]
        );
    }

    #[test]
    fn cut_headers_wait_and_impossible_ones_are_refused() {
        assert_eq!(PacketLayout::parse(&[0xfa]), PacketHeader::Incomplete);
        assert_eq!(PacketLayout::parse(&[0xfa, 0x01, 0x08]), PacketHeader::Incomplete);
        assert!(
            matches!(PacketLayout::parse(&[0xfa, 0x01, 0x08, 0x00]), PacketHeader::Valid(l) if l.packet_bytes() == 18)
        );
        for invalid in [
            &[0x24, 0x01, 0x08, 0x00][..],
            &[0xfa, 0x00],
            &[0xfa, 0x81],
            &[0xfa, 0x01, 0x00, 0x00],
            &[0xfa, 0x01, 0x00, 0x80],
            &[0xfa, 0x08, 0x00, 0x40],
        ] {
            assert_eq!(PacketLayout::parse(invalid), PacketHeader::Invalid, "{invalid:02x?}");
        }
        let everything = [0xfa, 0x3f, 0xff, 0x7f, 0xff, 0x03, 0xff, 0x1f, 0xff, 0x3f, 0xff, 0x1f, 0xff, 0x1f];
        assert_eq!(
            PacketLayout::parse(&everything),
            PacketHeader::Invalid,
            "1039 bytes exceed what a unit sends"
        );
    }
}
