//! A short number for all that a session gave: two sessions with the same inputs have the same one.

use std::fmt::{self, Debug, Write};

/// A running hash of 64 bits over the debug text of values (FNV-1a, Fowler, Noll & Vo 1991).
///
/// The text holds every field with the shortest digits that give back its bits, so a field that is added later is part of it. This is a
/// comparison of two runs, not a protection against forgery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digest(u64);

impl Default for Digest {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Digest {
    /// Takes in a value.
    pub fn take(&mut self, value: &impl Debug) {
        // Writing to a hash cannot fail.
        let _ = writeln!(self, "{value:?}");
    }

    /// The hash.
    pub const fn get(self) -> u64 {
        self.0
    }
}

impl Write for Digest {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
        Ok(())
    }
}

/// Digest of a session's output so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SessionDigest {
    /// Over the records of all rounds.
    pub records: Digest,
    /// Over the scenes of all frames.
    pub scenes: Digest,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_values_are_met() {
        // Test vectors of the authors' page: the empty text and "a".
        assert_eq!(Digest::default().get(), 0xcbf2_9ce4_8422_2325);
        let mut a = Digest::default();
        a.write_str("a").unwrap();
        assert_eq!(a.get(), 0xaf63_dc4c_8601_ec8c);
    }

    #[test]
    fn the_last_bit_of_a_number_counts() {
        let of = |v: f64| {
            let mut digest = Digest::default();
            digest.take(&v);
            digest
        };
        assert_eq!(of(0.1), of(0.1));
        assert_ne!(of(0.1), of(f64::from_bits(0.1f64.to_bits() + 1)));
    }
}
