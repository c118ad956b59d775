//! Whether pictures are worth anything: how many are damaged, and whether they change.

use std::collections::VecDeque;

use bowwave_core::time::{NS_PER_S, Time};

/// Damaged pictures count over this time.
const WINDOW_NS: i64 = 2 * NS_PER_S;
/// Fewer pictures than this say nothing about a share.
const PICTURES_MIN: usize = 15;
/// Pictures kept at most: 2 s at 120 Hz.
const PICTURES_MAX: usize = 240;

/// Share of damaged pictures over the last two seconds, with hysteresis.
#[derive(Clone, Debug, Default)]
pub(super) struct PictureDamage {
    seen: VecDeque<(Time, bool)>,
    raised: bool,
}

impl PictureDamage {
    /// Takes in one picture. Whether too many are damaged: above 30 % until below 10 %.
    pub fn push(&mut self, now: Time, damaged: bool) -> bool {
        self.seen.push_back((now, damaged));
        while self.seen.len() > PICTURES_MAX
            || self.seen.front().is_some_and(|(time, _)| now.ns_since(*time) > WINDOW_NS)
        {
            self.seen.pop_front();
        }
        let (bad, all) = self.share();
        if all >= PICTURES_MIN {
            self.raised = if self.raised { bad * 10 >= all } else { bad * 10 > all * 3 };
        }
        self.raised
    }

    /// Damaged pictures and all pictures of the window.
    pub fn share(&self) -> (usize, usize) {
        (self.seen.iter().filter(|(_, damaged)| *damaged).count(), self.seen.len())
    }

    /// Forgets what was seen, not what was found: a share of another stream says nothing about this one.
    pub fn restart(&mut self) {
        self.seen.clear();
    }
}

/// Samples compared.
const SAMPLES: usize = 4096;
/// A picture with fewer changed samples than this (0.1 %) is the same picture: a sensor's noise changes far more.
const CHANGED_MIN: usize = 4;
/// How long a picture may stay the same.
const STATIC_NS: i64 = NS_PER_S;

/// Notices pictures that do not change.
#[derive(Clone, Debug, Default)]
pub(super) struct Stillness {
    last: Vec<u8>,
    since: Option<Time>,
}

impl Stillness {
    /// Takes in the bytes of one picture. Whether it has been the same for a second.
    pub fn push(&mut self, now: Time, picture: &[u8]) -> bool {
        // An odd step meets luma and chroma, and all columns, whatever the width.
        let step = (picture.len() / SAMPLES) | 1;
        let samples = picture.iter().step_by(step).copied();
        let same_layout = self.last.len() == picture.len().div_ceil(step);
        let changed = if same_layout {
            self.last.iter().zip(samples.clone()).filter(|(a, b)| **a != *b).count()
        } else {
            usize::MAX
        };
        self.last.clear();
        self.last.extend(samples);
        if changed >= CHANGED_MIN {
            self.since = Some(now);
        }
        let since = *self.since.get_or_insert(now);
        now.ns_since(since) >= STATIC_NS
    }

    /// Forgets the last picture: the next one is of another stream.
    pub fn restart(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(frame: i64) -> Time {
        Time::from_ns(frame * 33_333_333)
    }

    #[test]
    fn damage_is_raised_above_thirty_percent_and_cleared_below_ten() {
        let mut damage = PictureDamage::default();
        assert!((0..60).all(|n| !damage.push(at(n), n % 4 == 0)), "25 %");
        assert!((60..120).any(|n| damage.push(at(n), n % 2 == 0)), "50 %");
        assert!((120..180).all(|n| damage.push(at(n), n % 5 == 0)), "20 % is not better yet");
        let end: Vec<_> = (180..260).map(|n| damage.push(at(n), n % 20 == 0)).collect();
        assert_eq!(end.last(), Some(&false), "5 %");
    }

    #[test]
    fn one_damaged_picture_of_few_says_nothing() {
        let mut damage = PictureDamage::default();
        assert!(!damage.push(at(0), true) && !damage.push(at(1), true));
        damage.restart();
        assert_eq!(damage.share(), (0, 0));
    }

    #[test]
    fn a_frozen_picture_is_seen_after_a_second_and_a_noisy_one_never() {
        let still = vec![16; 640 * 480 * 2];
        let mut noisy = still.clone();
        let mut judge = Stillness::default();
        let seen = (0..60).find(|n| judge.push(at(*n), &still)).unwrap();
        assert_eq!(seen, 31, "one second");
        let mut state = 1u32;
        for n in 60..160 {
            for value in noisy.iter_mut().step_by(3) {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *value = 16 + (state >> 31) as u8;
            }
            assert!(!judge.push(at(n), &noisy), "{n}");
        }
    }

    #[test]
    fn another_size_is_a_change_and_no_bytes_are_no_error() {
        let mut judge = Stillness::default();
        assert!(!judge.push(at(0), &[]));
        assert!(!judge.push(at(60), &[1; 100]));
        assert!(!judge.push(at(61), &[1; 200]));
        assert!(judge.push(at(120), &[1; 200]));
    }
}
