//! Which mode to run: a pure function of what the camera offers and what is wanted.

use std::cmp::Reverse;

use super::{Coding, Rate, Size, WantedMode, settings::usable_size};

/// Rates at which a camera offers a size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Rates {
    /// The driver does not list them.
    Unknown,
    /// These.
    Listed(Vec<Rate>),
    /// Any between the two.
    Range {
        /// Slowest.
        least: Rate,
        /// Fastest.
        most: Rate,
    },
}

/// One coding of a camera with its sizes and their rates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Offer {
    /// The driver's code.
    pub fourcc: [u8; 4],
    /// Sizes; empty where the driver does not list them.
    pub sizes: Vec<(Size, Rates)>,
}

/// A mode to ask the driver for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ModeCandidate {
    /// The driver's code of the coding.
    pub fourcc: [u8; 4],
    /// The mode.
    pub mode: WantedMode,
}

impl ModeCandidate {
    /// Load of the bus, bits a second; a JPEG is taken for an eighth of its YUYV picture.
    fn bits_per_second(&self) -> f64 {
        let bits = match self.mode.coding {
            Coding::Yuyv => 16.0,
            Coding::Nv12 => 12.0,
            Coding::Mjpeg | Coding::Other(_) => 2.0,
        };
        bits * f64::from(self.mode.width) * f64::from(self.mode.height) * self.mode.rate.per_second()
    }
}

/// Modes to try, best first: the wanted ones that the camera offers exactly; the wanted ones at the nearest rate; other
/// codings and rates of the calibrated (or first wanted) size; other sizes, the next smaller first, larger ones last.
pub(super) fn candidates(
    offers: &[Offer],
    wanted: &[WantedMode],
    calibrated: Option<(u32, u32)>,
) -> Vec<ModeCandidate> {
    let Some(first) = wanted.first() else { return Vec::new() };
    let mut list = List::default();
    for exact in [true, false] {
        for mode in wanted {
            for offer in offers.iter().filter(|o| Coding::from_fourcc(o.fourcc) == mode.coding) {
                list.push_size(offer, *mode, exact);
            }
        }
    }
    let size = calibrated.unwrap_or((first.width, first.height));
    for rate in [Some(first.rate), Rate::hz(25), Rate::hz(20), Rate::hz(15)].into_iter().flatten() {
        for offer in offers {
            let coding = Coding::from_fourcc(offer.fourcc);
            list.push_size(offer, WantedMode { coding, width: size.0, height: size.1, rate }, false);
        }
    }
    let mut others = Vec::new();
    for offer in offers {
        let coding = Coding::from_fourcc(offer.fourcc);
        for (width, height) in offer.sizes.iter().filter_map(|(s, _)| fixed(*s)) {
            others.push((offer, WantedMode { coding, width, height, rate: first.rate }));
        }
    }
    let area = |m: &WantedMode| u64::from(m.width) * u64::from(m.height);
    let wanted_area = u64::from(size.0) * u64::from(size.1);
    others.sort_by_key(|(_, m)| {
        let larger = area(m) > wanted_area;
        (larger, if larger { Reverse(u64::MAX - area(m)) } else { Reverse(area(m)) })
    });
    others.into_iter().for_each(|(offer, mode)| list.push_size(offer, mode, false));
    list.0
}

/// The next candidate after `failed` that takes less of the bus.
pub(super) fn next_smaller(list: &[ModeCandidate], failed: usize) -> Option<usize> {
    let limit = list.get(failed)?.bits_per_second();
    (0..list.len()).find(|i| *i != failed && list[*i].bits_per_second() < limit)
}

#[derive(Default)]
struct List(Vec<ModeCandidate>);

impl List {
    /// Adds `mode` if `offer` has its size and, where `exact`, its rate; else at the nearest rate.
    fn push_size(&mut self, offer: &Offer, mode: WantedMode, exact: bool) {
        if !usable_size(mode.coding, mode.width, mode.height) {
            return;
        }
        let mut best: Option<Rate> = None;
        for rates in rates_of(offer, mode.width, mode.height) {
            let near = nearest(rates, mode.rate);
            if best.is_none_or(|b| distance(near, mode.rate) < distance(b, mode.rate)) {
                best = Some(near);
            }
        }
        let Some(rate) = best.filter(|r| !exact || r.same(mode.rate)) else { return };
        let candidate = ModeCandidate { fourcc: offer.fourcc, mode: WantedMode { rate, ..mode } };
        if !self.0.contains(&candidate) {
            self.0.push(candidate);
        }
    }
}

/// The rates of every entry of `offer` that has the size.
fn rates_of(offer: &Offer, width: u32, height: u32) -> impl Iterator<Item = &Rates> {
    const UNKNOWN: Rates = Rates::Unknown;
    let unlisted = offer.sizes.is_empty().then_some(&UNKNOWN);
    let fits = move |size: Size| match size {
        Size::Fixed { width: w, height: h } => (w, h) == (width, height),
        Size::Range { least, most } => {
            (least.0..=most.0).contains(&width) && (least.1..=most.1).contains(&height)
        }
    };
    // A size of its own says more than the range that it lies in.
    let own = offer.sizes.iter().any(|(s, _)| fixed(*s) == Some((width, height)));
    let listed =
        offer.sizes.iter().filter(move |(s, _)| fits(*s) && (!own || fixed(*s).is_some())).map(|(_, r)| r);
    unlisted.into_iter().chain(listed)
}

const fn fixed(size: Size) -> Option<(u32, u32)> {
    match size {
        Size::Fixed { width, height } => Some((width, height)),
        Size::Range { .. } => None,
    }
}

fn nearest(rates: &Rates, wanted: Rate) -> Rate {
    match rates {
        Rates::Unknown => wanted,
        Rates::Listed(list) => list
            .iter()
            .copied()
            .min_by(|a, b| distance(*a, wanted).total_cmp(&distance(*b, wanted)))
            .unwrap_or(wanted),
        Rates::Range { least, most } if wanted.per_second() < least.per_second() => least.min_rate(*most),
        Rates::Range { least, most } if wanted.per_second() > most.per_second() => most.max_rate(*least),
        Rates::Range { .. } => wanted,
    }
}

/// How far apart two rates are; twice as fast is as far as half as fast.
fn distance(a: Rate, b: Rate) -> f64 {
    (a.per_second() / b.per_second()).ln().abs()
}

impl Rate {
    fn min_rate(self, other: Self) -> Self {
        if self.per_second() <= other.per_second() { self } else { other }
    }

    fn max_rate(self, other: Self) -> Self {
        if self.per_second() >= other.per_second() { self } else { other }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn hz(rate: u32) -> Rate {
        Rate::hz(rate).unwrap()
    }

    fn mode(coding: Coding, width: u32, height: u32, rate: u32) -> WantedMode {
        WantedMode { coding, width, height, rate: hz(rate) }
    }

    fn offer(fourcc: &[u8; 4], sizes: &[(u32, u32, &[u32])]) -> Offer {
        let sizes = sizes
            .iter()
            .map(|(width, height, rates)| {
                let rates = Rates::Listed(rates.iter().map(|r| hz(*r)).collect());
                (Size::Fixed { width: *width, height: *height }, rates)
            })
            .collect();
        Offer { fourcc: *fourcc, sizes }
    }

    /// Modes of a usual USB 2 camera: raw pictures of full size only slowly.
    fn usual() -> Vec<Offer> {
        vec![
            offer(b"YUYV", &[(1280, 720, &[10]), (640, 480, &[30, 15])]),
            offer(b"MJPG", &[(1920, 1080, &[30]), (1280, 720, &[60, 30]), (640, 480, &[30])]),
            offer(b"H264", &[(1280, 720, &[30])]),
        ]
    }

    #[test]
    fn an_exact_second_choice_beats_a_first_choice_at_another_rate() {
        let wanted = [mode(Coding::Yuyv, 1280, 720, 30), mode(Coding::Mjpeg, 1280, 720, 30)];
        let list = candidates(&usual(), &wanted, Some((1280, 720)));
        assert_eq!(list[0].mode, wanted[1]);
        assert_eq!(list[1].mode, mode(Coding::Yuyv, 1280, 720, 10));
    }

    #[test]
    fn sizes_that_nobody_asked_for_come_last_smaller_ones_first() {
        let wanted = [mode(Coding::Yuyv, 1280, 720, 30)];
        let list = candidates(&usual(), &wanted, Some((1280, 720)));
        let sizes: Vec<_> = list.iter().map(|c| (c.mode.width, c.mode.height)).collect();
        let foreign = sizes.iter().position(|s| *s != (1280, 720)).unwrap();
        assert!(sizes[..foreign].iter().all(|s| *s == (1280, 720)) && foreign >= 2);
        assert_eq!((sizes[foreign], *sizes.last().unwrap()), ((640, 480), (1920, 1080)));
    }

    #[test]
    fn a_driver_that_lists_nothing_is_asked_for_what_is_wanted() {
        let wanted = [mode(Coding::Nv12, 640, 480, 30)];
        let offers = [Offer { fourcc: *b"NV12", sizes: Vec::new() }];
        assert_eq!(
            candidates(&offers, &wanted, None)[0],
            ModeCandidate { fourcc: *b"NV12", mode: wanted[0] }
        );
        assert!(candidates(&[], &wanted, None).is_empty());
        assert!(candidates(&offers, &[], None).is_empty());
    }

    #[test]
    fn a_size_within_a_range_is_taken_at_the_rates_of_its_own() {
        let range = Size::Range { least: (2, 2), most: (4096, 2160) };
        let own = Size::Fixed { width: 640, height: 480 };
        let sizes = vec![(range, Rates::Unknown), (own, Rates::Range { least: hz(1), most: hz(25) })];
        let list =
            candidates(&[Offer { fourcc: *b"YUYV", sizes }], &[mode(Coding::Yuyv, 640, 480, 30)], None);
        assert_eq!(list[0].mode, mode(Coding::Yuyv, 640, 480, 25));
    }

    #[test]
    fn without_bandwidth_the_same_size_compressed_comes_next() {
        let wanted = [mode(Coding::Yuyv, 640, 480, 30)];
        let list = candidates(&usual(), &wanted, Some((640, 480)));
        let next = next_smaller(&list, 0).unwrap();
        assert_eq!((list[next].mode.coding, list[next].mode.width), (Coding::Mjpeg, 640));
        assert_eq!(next_smaller(&list, list.len()), None);
    }

    fn any_rates() -> impl Strategy<Value = Rates> {
        let rate = || (1..=120_000u32, 1..=1001u32).prop_map(|(f, s)| Rate::new(f, s).unwrap());
        prop_oneof![
            Just(Rates::Unknown),
            prop::collection::vec(rate(), 0..4).prop_map(Rates::Listed),
            (rate(), rate()).prop_map(|(least, most)| Rates::Range { least, most }),
        ]
    }

    fn any_size() -> impl Strategy<Value = Size> {
        // Few values, so that wanted sizes are often offered; hostile ones too.
        let side =
            || prop_oneof![Just(0), Just(17), Just(480), Just(640), Just(720), Just(8192), any::<u32>()];
        prop_oneof![
            3 => (side(), side()).prop_map(|(width, height)| Size::Fixed { width, height }),
            1 => (side(), side(), side(), side())
                .prop_map(|(a, b, c, d)| Size::Range { least: (a, b), most: (c, d) }),
        ]
    }

    fn any_offer() -> impl Strategy<Value = Offer> {
        let code =
            prop_oneof![Just(*b"YUYV"), Just(*b"NV12"), Just(*b"MJPG"), Just(*b"H264"), any::<[u8; 4]>()];
        (code, prop::collection::vec((any_size(), any_rates()), 0..4))
            .prop_map(|(fourcc, sizes)| Offer { fourcc, sizes })
    }

    proptest! {
        #[test]
        fn only_what_is_offered_and_usable_is_asked_for(
            offers in prop::collection::vec(any_offer(), 0..5),
            coding in prop_oneof![Just(Coding::Yuyv), Just(Coding::Nv12), Just(Coding::Mjpeg)],
            side in prop_oneof![Just(480u32), Just(640), Just(720)],
        ) {
            let wanted = [mode(coding, 640, side, 30)];
            let list = candidates(&offers, &wanted, None);
            for (i, c) in list.iter().enumerate() {
                prop_assert!(usable_size(c.mode.coding, c.mode.width, c.mode.height));
                prop_assert!(!list[..i].contains(c));
                let offered = offers.iter().any(|o| {
                    o.fourcc == c.fourcc && rates_of(o, c.mode.width, c.mode.height).next().is_some()
                });
                prop_assert!(offered);
            }
            let exactly = |o: &Offer| Coding::from_fourcc(o.fourcc) == coding
                && rates_of(o, 640, side).any(|r| nearest(r, hz(30)).same(hz(30)));
            if offers.iter().any(exactly) {
                prop_assert!(list[0].mode.coding == coding && list[0].mode.rate.same(hz(30)));
                prop_assert_eq!((list[0].mode.width, list[0].mode.height), (640, side));
            }
            // Going down for bandwidth ends.
            let (mut at, mut steps) = (0, 0);
            while let Some(next) = next_smaller(&list, at) {
                at = next;
                steps += 1;
                prop_assert!(steps <= list.len());
            }
        }
    }
}
