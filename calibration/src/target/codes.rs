//! The codes of the tag family 36h11.
//!
//! `tag36h11.bin` holds them in five bytes each, big-endian. Source: the table `t36h11` in `Tag36h11.h` of Kalibr and of the AprilTags C++
//! library (BSD licence), from which this makes it:
//!
//! ```sh
//! grep -oiE '0x[0-9a-f]+' Tag36h11.h | sed 's/^0x/0000000000/; s/.*\(..........\)$/\1/' | xxd -r -p > tag36h11.bin
//! ```

/// Tags of the family.
const COUNT: usize = 587;
const CODE_BYTES: usize = 5;

/// Codes of the family (Olson 2011) by id: 36 modules row by row from the upper left, the first in the highest bit, 1 is white. Any two
/// differ in 11 modules at least, however they are turned.
pub(super) const TAG36H11: [u64; COUNT] = unpacked(include_bytes!("tag36h11.bin"));

const fn unpacked(bytes: &[u8; COUNT * CODE_BYTES]) -> [u64; COUNT] {
    let mut codes = [0; COUNT];
    let mut i = 0;
    while i < bytes.len() {
        codes[i / CODE_BYTES] = codes[i / CODE_BYTES] << 8 | bytes[i] as u64;
        i += 1;
    }
    codes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The family's search went on by a prime from code to code (Olson 2011, sec. IV.A; AprilTag's `TagFamilyGenerator`).
    const PRIME: u64 = 982_451_653;
    const SPACE: u64 = 1 << 36;

    #[test]
    fn the_table_is_what_the_familys_search_gives() {
        // The prime's inverse among odd numbers of 36 bits, by Newton's method: each step doubles the bits that are right.
        let inverse = (0..6).fold(1u64, |x, _| x.wrapping_mul(2u64.wrapping_sub(PRIME.wrapping_mul(x))));
        let tries = |code: u64| code.wrapping_sub(TAG36H11[0]).wrapping_mul(inverse) % SPACE;
        assert!(TAG36H11.iter().all(|code| *code < SPACE));
        assert!(TAG36H11.is_sorted_by_key(|code| tries(*code)));
        // The first ones that were taken, and some that Kalibr prints.
        assert_eq!([0, 1, 2, 3, 4, 5, 6].map(|id| tries(TAG36H11[id])), [0, 1, 2, 4, 6, 8, 13]);
        let some = [0, 100, 586].map(|id| TAG36H11[id]);
        assert_eq!(some, [0xd_5d62_8584, 0x5_0f1d_3251, 0xe_83be_4b73]);
    }
}
