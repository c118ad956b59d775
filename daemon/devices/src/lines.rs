//! Lines of text in the style of NMEA 0183: `$`, an address, fields between commas, `*`, a check sum, the end of the line.

use crate::framing::{Framing, PacketLook};

/// The longest line that is taken: NMEA 0183 allows 82, makers' own lines have up to 200, bytes.
pub(crate) const LINE_MAX_BYTES: usize = 256;

/// Lines whose address begins alike.
pub(crate) trait LineFraming {
    /// What it begins with; empty for any line.
    const PREFIX: &'static [u8];

    /// The text between `$` and `*` of a line that is intact.
    fn intact_text(line: &[u8]) -> Option<&str> {
        checked(line)
    }
}

impl<T: LineFraming> Framing for T {
    type Head = ();
    const SYNC: u8 = b'$';
    const MAX_BYTES: usize = LINE_MAX_BYTES;
    // A '$' within a line ends it, so that no false beginning can swallow one.
    const WEAK: bool = false;

    fn look(bytes: &[u8]) -> PacketLook<()> {
        look(bytes, T::PREFIX)
    }

    fn intact(packet: &[u8]) -> bool {
        T::intact_text(packet).is_some()
    }
}

/// Looks at what a `$` begins; the address behind it begins with `prefix`.
pub(crate) fn look(bytes: &[u8], prefix: &[u8]) -> PacketLook<()> {
    let Some(body) = bytes.get(1..) else { return PacketLook::Incomplete };
    let shared = body.len().min(prefix.len());
    if body[..shared] != prefix[..shared] {
        return PacketLook::Invalid;
    }
    for (i, &byte) in bytes.iter().enumerate().skip(1) {
        match byte {
            _ if i >= LINE_MAX_BYTES => return PacketLook::Invalid,
            b'\n' => return PacketLook::Packet { head: (), bytes: i + 1 },
            b'\r' => {
                return match bytes.get(i + 1) {
                    Some(b'\n') => PacketLook::Packet { head: (), bytes: i + 2 },
                    Some(_) => PacketLook::Packet { head: (), bytes: i + 1 },
                    None => PacketLook::Incomplete,
                };
            }
            b'$' => return PacketLook::Invalid,
            b' '..=b'~' => {}
            _ => return PacketLook::Invalid,
        }
    }
    if bytes.len() >= LINE_MAX_BYTES { PacketLook::Invalid } else { PacketLook::Incomplete }
}

/// The text between `$` and `*`, where the two digits behind are its bytes' exclusive or.
pub(crate) fn checked(line: &[u8]) -> Option<&str> {
    let (body, sum) = parts(line)?;
    (sum.len() == 2 && hex(sum)? == u32::from(xor(body.as_bytes()))).then_some(body)
}

/// The line whose bytes between `$` and `*` are `body`, with its check sum.
pub(crate) fn seal(body: &[u8]) -> Vec<u8> {
    [b"$", body, format!("*{:02X}\r\n", xor(body)).as_bytes()].concat()
}

/// The check sum: the bytes' exclusive or.
pub(crate) fn xor(body: &[u8]) -> u8 {
    body.iter().fold(0, |sum, byte| sum ^ byte)
}

/// The text between `$` and `*`, and the check sum behind, unchecked.
pub(crate) fn parts(line: &[u8]) -> Option<(&str, &str)> {
    let text = std::str::from_utf8(line).ok()?.trim_end_matches(['\r', '\n']);
    text.strip_prefix('$')?.rsplit_once('*')
}

/// `from_str_radix` alone would take a sign.
pub(crate) fn hex(digits: &str) -> Option<u32> {
    let all = digits.bytes().all(|b| b.is_ascii_hexdigit());
    if all { u32::from_str_radix(digits, 16).ok() } else { None }
}

/// An angle or another number of a field; `None` where it is empty or none.
pub(crate) fn number(field: &str) -> Option<f64> {
    // Words such as "nan" and "inf" are no numbers of an instrument.
    let digits = field.bytes().all(|b| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.' | b'e' | b'E'));
    if digits { field.parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_lines_have_one_sum_only() {
        assert_eq!(checked(b"$INHDT,235.18,T*18\r\n"), Some("INHDT,235.18,T"));
        assert_eq!(checked(b"$INHDT,235.18,T*XX\r\n"), None);
    }

    #[test]
    fn a_line_ends_where_it_ends() {
        let bytes = |b: &[u8]| look(b, b"VN");
        assert_eq!(bytes(b"$VN"), PacketLook::Incomplete);
        assert_eq!(bytes(b"$"), PacketLook::Incomplete);
        assert_eq!(bytes(b"$G"), PacketLook::Invalid);
        assert_eq!(bytes(b"$VNA*00\r\n$V"), PacketLook::Packet { head: (), bytes: 9 });
        assert_eq!(bytes(b"$VNA*00\r"), PacketLook::Incomplete);
        assert_eq!(bytes(b"$VNA*00\r$"), PacketLook::Packet { head: (), bytes: 8 });
        assert_eq!(bytes(b"$VNA*0$VN"), PacketLook::Invalid);
        assert_eq!(bytes(b"$VNA\xfa"), PacketLook::Invalid);
        let endless = [&b"$VN"[..], &[b'1'; LINE_MAX_BYTES]].concat();
        assert_eq!(bytes(&endless), PacketLook::Invalid);
        assert_eq!(bytes(&endless[..LINE_MAX_BYTES - 1]), PacketLook::Incomplete);
    }

    #[test]
    fn numbers_are_digits() {
        assert_eq!(number("-004.328"), Some(-4.328));
        assert_eq!(number("+00.001373"), Some(0.001373));
        for none in ["", "nan", "inf", "1,2", "abc", "--1", "e"] {
            assert_eq!(number(none), None, "{none}");
        }
    }
}
