//! Counters and clocks of units that begin again at 0.

/// Makes a counter of `BITS` bits go on where it wraps.
///
/// A step of up to half the range is one forward, a longer one is one backward: the unit began anew. Only the direction of a
/// break longer than half the range is uncertain then; that it is one is seen by those who compare it with arrivals.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Unwrap<const BITS: u32> {
    last: Option<(u64, i64)>,
}

impl<const BITS: u32> Unwrap<BITS> {
    const RANGE: i64 = 1 << BITS;

    /// The unwrapped value of `raw`, never negative.
    pub(crate) fn next(&mut self, raw: u64) -> i64 {
        let raw = raw & (Self::RANGE as u64 - 1);
        let value = match self.last {
            None => raw as i64,
            Some((last, value)) => {
                let forward = (raw.wrapping_sub(last) & (Self::RANGE as u64 - 1)) as i64;
                let step = if forward <= Self::RANGE / 2 { forward } else { forward - Self::RANGE };
                let next = value.saturating_add(step);
                if next < 0 { next + Self::RANGE } else { next }
            }
        };
        self.last = Some((raw, value));
        value
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn steps_up<const BITS: u32>(first: u64, step: u64) {
        let mut unwrap = Unwrap::<BITS>::default();
        let mut expected = first as i64;
        for n in 0..1000 {
            let raw = (first + n * step) % (1 << BITS);
            assert_eq!(unwrap.next(raw), expected, "{BITS} bits, step {n}");
            expected += step as i64;
        }
    }

    #[test]
    fn counters_go_on_where_they_wrap() {
        steps_up::<8>(250, 1);
        steps_up::<8>(0, 100);
        steps_up::<16>(65_000, 7);
        steps_up::<32>(u64::from(u32::MAX) - 5_000, 5_000);
        // The microseconds of an hour and a half in steps of five minutes.
        steps_up::<32>(0, 300_000_000);
    }

    #[test]
    fn a_unit_that_begins_anew_goes_back() {
        let mut unwrap = Unwrap::<32>::default();
        unwrap.next(1_800_000_000);
        assert_eq!(unwrap.next(40_000), 40_000);
        let mut wrapped = Unwrap::<32>::default();
        wrapped.next(u64::from(u32::MAX));
        assert_eq!(wrapped.next(0), 1 << 32);
        assert_eq!(wrapped.next(1_500_000_000), (1 << 32) + 1_500_000_000);
        assert_eq!(wrapped.next(5), (1 << 32) + 5, "back to after the wrap: a break as well");
        let mut first = Unwrap::<32>::default();
        first.next(10);
        assert!(first.next(u64::from(u32::MAX)) >= 0, "never negative");
    }

    proptest! {
        #[test]
        fn small_steps_either_way_are_kept(first in 1u64 << 20..1 << 24, steps in prop::collection::vec(-5000i64..5000, 1..200)) {
            let mut unwrap = Unwrap::<24>::default();
            let start = unwrap.next(first);
            let mut sum = 0;
            for step in steps {
                sum += step;
                let raw = (first as i64 + sum).rem_euclid(1 << 24) as u64;
                let got = unwrap.next(raw);
                prop_assert!((got - start - sum) % (1 << 24) == 0 && got >= 0);
                if start + sum >= 0 { prop_assert_eq!(got, start + sum); }
            }
        }
    }
}
