//! Damage to files.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;

/// What an attacker writes into texts: terminal escapes, lines that look like the program's, formulas, and numbers that nobody expects.
const TEXTS: &[&str] = &[
    "\\u001b[2J",
    "\u{1b}]0;title\u{7}",
    "x\\nFORGED: all is well",
    "x\nFORGED: all is well",
    "=cmd|' /C calc'!A0",
    "\u{202e}txt.exe",
    "nan",
    "-inf",
    "1e308",
    "-1e-320",
    "99999999999999999999999999",
    "-9223372036854775808",
    "18446744073709551615",
    "4294967296",
    "0",
    "../../../../etc/passwd",
    "/dev/zero",
    "[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[",
    "\"\"\"",
    "'",
    "\0",
];
/// Numbers that lengths and offsets are not prepared for.
const NUMBERS: &[u64] = &[0, 1, 0x7f, 0xff, 0x7fff, 0xffff, 0x7fff_ffff, 0xffff_ffff, 1 << 40, u64::MAX];

/// Chance, the same for the same file each time.
pub struct Mutator(Pcg64);

impl Mutator {
    pub fn new(target: &str, number: u64) -> Self {
        let name =
            target.bytes().fold(7u64, |hash, byte| hash.wrapping_mul(131).wrapping_add(u64::from(byte)));
        Self(Pcg64::seed_from_u64(name ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
    }

    fn below(&mut self, end: usize) -> usize {
        self.0.random_range(0..end.max(1))
    }

    fn pick<'a, T: ?Sized>(&mut self, of: &[&'a T]) -> &'a T {
        of[self.below(of.len())]
    }
}

/// One of the good files, damaged once to six times.
pub fn mutated(seeds: &[Vec<u8>], chance: &mut Mutator) -> Vec<u8> {
    let mut bytes = seeds[chance.below(seeds.len())].clone();
    for _ in 0..=chance.below(6) {
        damage(&mut bytes, seeds, chance);
    }
    bytes
}

fn damage(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], chance: &mut Mutator) {
    let length = bytes.len();
    let (at, span) = (chance.below(length), 1 + chance.below(64));
    let end = (at + span).min(length);
    match chance.below(11) {
        0 => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << chance.below(8);
            }
        }
        1 => (at..end).for_each(|i| bytes[i] = chance.below(256) as u8),
        2 => bytes.truncate(at),
        3 => drop(bytes.drain(at..end)),
        4 => {
            let copy = bytes[at..end].to_vec();
            let to = chance.below(length);
            bytes.splice(to..to, copy);
        }
        5 => {
            let number = NUMBERS[chance.below(NUMBERS.len())];
            let size = [1, 2, 4, 8][chance.below(4)];
            let little = chance.below(2) == 0;
            let all = if little { number.to_le_bytes() } else { number.to_be_bytes() };
            let part = if little { &all[..size] } else { &all[8 - size..] };
            let end = (at + size).min(length);
            bytes.splice(at..end, part.iter().copied());
        }
        6 => {
            let text = chance.pick(TEXTS).as_bytes().to_vec();
            bytes.splice(at..at, text);
        }
        7 => number_to_text(bytes, at, chance),
        8 => lines(bytes, chance),
        9 => {
            let other = &seeds[chance.below(seeds.len())];
            let from = chance.below(other.len());
            bytes.truncate(at);
            bytes.extend_from_slice(&other[from..]);
        }
        _ => {
            let text = chance.pick(TEXTS).repeat(1 + chance.below(2000));
            bytes.splice(at..at, text.into_bytes());
        }
    }
}

/// Puts something else in the place of the next number or word of a text.
fn number_to_text(bytes: &mut Vec<u8>, at: usize, chance: &mut Mutator) {
    let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'-' | b'_');
    let Some(begin) = bytes[at.min(bytes.len())..].iter().position(is_word).map(|i| at + i) else { return };
    let end = bytes[begin..].iter().position(|byte| !is_word(byte)).map_or(bytes.len(), |i| begin + i);
    let text = chance.pick(TEXTS).as_bytes().to_vec();
    bytes.splice(begin..end, text);
}

/// Doubles, swaps or removes lines.
fn lines(bytes: &mut Vec<u8>, chance: &mut Mutator) {
    let mut lines: Vec<Vec<u8>> = bytes.split(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect();
    let (a, b) = (chance.below(lines.len()), chance.below(lines.len()));
    match chance.below(3) {
        0 => lines.swap(a, b),
        1 => drop(lines.remove(a)),
        _ => {
            /// A line of a binary file may be most of it.
            const ADDED_MOST: usize = 4 << 20;
            let line = lines[a].clone();
            let most = ADDED_MOST / line.len().max(1);
            let copies = 1 + chance.below(300).min(most);
            lines.splice(b..b, std::iter::repeat_n(line, copies));
        }
    }
    *bytes = lines.join(&b'\n');
}
