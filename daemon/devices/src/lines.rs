//! Lines of text in the style of NMEA 0183: `$`, an address, fields between commas, `*`, a check sum, the end of the line.

use crate::{framing::Look, vectornav::crc16};

/// The longest line that is taken: NMEA 0183 allows 82, makers' own lines have up to 200, bytes.
pub(crate) const LINE_MAX_BYTES: usize = 256;

/// Looks at what a `$` begins; the address behind it begins with `prefix`.
pub(crate) fn look(bytes: &[u8], prefix: &[u8]) -> Look<()> {
    let Some(body) = bytes.get(1..) else { return Look::Incomplete };
    let shared = body.len().min(prefix.len());
    if body[..shared] != prefix[..shared] {
        return Look::Invalid;
    }
    for (i, &byte) in bytes.iter().enumerate().skip(1) {
        match byte {
            _ if i >= LINE_MAX_BYTES => return Look::Invalid,
            b'\n' => return Look::Packet { head: (), bytes: i + 1 },
            b'\r' => {
                return match bytes.get(i + 1) {
                    Some(b'\n') => Look::Packet { head: (), bytes: i + 2 },
                    Some(_) => Look::Packet { head: (), bytes: i + 1 },
                    None => Look::Incomplete,
                };
            }
            b'$' => return Look::Invalid,
            b' '..=b'~' => {}
            _ => return Look::Invalid,
        }
    }
    if bytes.len() >= LINE_MAX_BYTES { Look::Invalid } else { Look::Incomplete }
}

/// What stands between `$` and `*`, where the two digits behind are its bytes' exclusive or.
pub(crate) fn checked(line: &[u8]) -> Option<&str> {
    let (body, sum) = parts(line)?;
    (sum.len() == 2 && hex(sum)? == xor(body)).then_some(body)
}

/// The same for VectorNav's lines, whose check sum may also be a CRC of four digits, or left unchecked.
pub(crate) fn checked_vectornav(line: &[u8]) -> Option<&str> {
    let (body, sum) = parts(line)?;
    let right = match sum.len() {
        // A unit whose check sums are off writes the letters themselves.
        2 if sum == "XX" => true,
        2 => hex(sum)? == xor(body),
        4 => hex(sum)? == u32::from(crc16(body.as_bytes())),
        _ => false,
    };
    right.then_some(body)
}

fn xor(body: &str) -> u32 {
    body.bytes().fold(0, |sum, byte| sum ^ u32::from(byte))
}

fn parts(line: &[u8]) -> Option<(&str, &str)> {
    let text = std::str::from_utf8(line).ok()?.trim_end_matches(['\r', '\n']);
    text.strip_prefix('$')?.rsplit_once('*')
}

/// `from_str_radix` alone would take a sign.
fn hex(digits: &str) -> Option<u32> {
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
    fn check_sums_of_two_and_four_digits_and_none() {
        let checked = checked_vectornav;
        // A real line with its own sum.
        let line = b"$VNYMR,-165.918,-008.770,+000.198*7D\r\n";
        assert_eq!(checked(line), Some("VNYMR,-165.918,-008.770,+000.198"));
        let crc = format!("$VNRRG,05*{:04X}\r\n", crc16(b"VNRRG,05"));
        assert_eq!(checked(crc.as_bytes()), Some("VNRRG,05"));
        assert_eq!(checked(b"$VNRRG,05*XX\n"), Some("VNRRG,05"));
        for wrong in [
            &b"$VNRRG,05*77\r\n"[..],
            b"$VNRRG,05*+6\r\n",
            b"$VNRRG,05*761\r\n",
            b"$VNRRG,05\r\n",
            b"$VNRRG,05*0000\r\n",
        ] {
            assert_eq!(checked(wrong), None, "{}", String::from_utf8_lossy(wrong));
        }
    }

    #[test]
    fn other_lines_have_one_sum_only() {
        assert_eq!(checked(b"$INHDT,235.18,T*18\r\n"), Some("INHDT,235.18,T"));
        assert_eq!(checked(b"$INHDT,235.18,T*XX\r\n"), None);
    }

    #[test]
    fn a_line_ends_where_it_ends() {
        let bytes = |b: &[u8]| look(b, b"VN");
        assert_eq!(bytes(b"$VN"), Look::Incomplete);
        assert_eq!(bytes(b"$"), Look::Incomplete);
        assert_eq!(bytes(b"$G"), Look::Invalid);
        assert_eq!(bytes(b"$VNA*00\r\n$V"), Look::Packet { head: (), bytes: 9 });
        assert_eq!(bytes(b"$VNA*00\r"), Look::Incomplete);
        assert_eq!(bytes(b"$VNA*00\r$"), Look::Packet { head: (), bytes: 8 });
        assert_eq!(bytes(b"$VNA*0$VN"), Look::Invalid);
        assert_eq!(bytes(b"$VNA\xfa"), Look::Invalid);
        let endless = [&b"$VN"[..], &[b'1'; LINE_MAX_BYTES]].concat();
        assert_eq!(bytes(&endless), Look::Invalid);
        assert_eq!(bytes(&endless[..LINE_MAX_BYTES - 1]), Look::Incomplete);
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
