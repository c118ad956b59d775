//! The clock of the exercise: the host's clock without the time for which the exercise stood still.

use crate::time::Time;

/// Pauses that are kept; no exercise has more.
const PAUSES_MAX: usize = 10_000;

/// Maps times of the host to times of the exercise and back. The same as long as there was no pause.
#[derive(Clone, Debug, Default)]
pub struct ExerciseClock {
    pauses: Vec<Pause>,
    /// Since when it stands still, host.
    stands_since: Option<Time>,
    /// Newest time of the host that the exercise was followed to.
    newest: Option<Time>,
}

/// A pause that is over.
#[derive(Clone, Copy, Debug)]
struct Pause {
    /// When it began, host.
    from: Time,
    /// When it ended, host.
    until: Time,
    /// Nanoseconds of all pauses up to its end.
    total_ns: i64,
}

impl ExerciseClock {
    /// Tests whether the exercise stands still.
    pub const fn is_paused(&self) -> bool {
        self.stands_since.is_some()
    }

    /// Tests whether it has ever stood still.
    pub const fn has_paused(&self) -> bool {
        !self.pauses.is_empty() || self.is_paused()
    }

    /// Stands still from `at` on, or from where it was followed to already. Gives that time of the host; `None` where it stood before.
    pub fn pause(&mut self, at: Time) -> Option<Time> {
        if self.is_paused() || self.pauses.len() >= PAUSES_MAX {
            return None;
        }
        self.stands_since = Some(self.newest.map_or(at, |newest| at.max(newest)));
        self.stands_since
    }

    /// Goes on from `at` on, or from where it was followed to already. Gives that time of the host; `None` where it went before.
    pub fn resume(&mut self, at: Time) -> Option<Time> {
        let from = self.stands_since.take()?;
        let until = self.newest.map_or(at, |newest| at.max(newest)).max(from);
        let total_ns = self.total_ns().saturating_add(until.ns_since(from));
        self.pauses.push(Pause { from, until, total_ns });
        Some(until)
    }

    /// The exercise is followed to `host`.
    pub fn follow(&mut self, host: Time) {
        self.newest = Some(self.newest.map_or(host, |newest| newest.max(host)));
    }

    fn total_ns(&self) -> i64 {
        self.pauses.last().map_or(0, |pause| pause.total_ns)
    }

    /// The exercise's time at a time of the host.
    pub fn of_host(&self, host: Time) -> Time {
        let host = self.stands_since.map_or(host, |since| host.min(since));
        let begun = self.pauses.partition_point(|pause| pause.from <= host);
        let Some(pause) = begun.checked_sub(1).and_then(|last| self.pauses.get(last)) else { return host };
        host.max(pause.until).plus_ns(-pause.total_ns)
    }

    /// Tests whether the exercise stands, or stood, at a time of the host.
    pub fn stands_at(&self, host: Time) -> bool {
        let began = self.pauses.partition_point(|pause| pause.from <= host);
        let last = began.checked_sub(1).and_then(|last| self.pauses.get(last));
        self.stands_since.is_some_and(|since| host >= since) || last.is_some_and(|pause| host < pause.until)
    }

    /// The host's time at a time of the exercise: now while it stands, and the end of a pause at whose time it stood.
    pub fn to_host(&self, exercise: Time) -> Time {
        // A pause lies at the exercise's time at which it began. What is of that very time and comes afterwards belongs behind it: until the next
        // picture the exercise is not followed any further.
        let before = self.pauses.partition_point(|pause| pause.until.plus_ns(-pause.total_ns) <= exercise);
        let shift = before.checked_sub(1).and_then(|last| self.pauses.get(last)).map_or(0, |p| p.total_ns);
        let host = exercise.plus_ns(shift);
        match (self.stands_since, self.newest) {
            (Some(since), Some(newest)) if host >= since => newest,
            _ => host,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(ms: i64) -> Time {
        Time::from_ns(ms * 1_000_000)
    }

    #[test]
    fn a_pause_takes_its_time_out_of_the_exercise() {
        let mut clock = ExerciseClock::default();
        clock.follow(at(1000));
        assert_eq!(clock.pause(at(900)), Some(at(1000)), "what was followed already stays");
        assert_eq!(clock.pause(at(1500)), None);
        assert_eq!(clock.of_host(at(500)), at(500));
        assert_eq!(clock.of_host(at(1700)), at(1000));
        clock.follow(at(1700));
        assert_eq!(clock.to_host(at(1000)), at(1700), "now, while it stands");
        assert_eq!(clock.to_host(at(999)), at(999));
        assert_eq!((clock.resume(at(2000)), clock.resume(at(2100))), (Some(at(2000)), None));
        assert_eq!(clock.of_host(at(2500)), at(1500));
        assert_eq!(clock.of_host(at(1200)), at(1000));
        assert_eq!((clock.to_host(at(1500)), clock.to_host(at(1000))), (at(2500), at(2000)));
        assert_eq!(clock.to_host(at(999)), at(999));
        let stands = [999, 1000, 1999, 2000].map(|ms| clock.stands_at(at(ms)));
        assert_eq!(stands, [false, true, true, false]);
    }

    #[test]
    fn an_exercise_that_is_paused_before_it_begins_begins_when_it_goes_on() {
        let mut clock = ExerciseClock::default();
        assert_eq!(clock.pause(at(100)), Some(at(100)));
        clock.follow(at(5000));
        assert_eq!(clock.of_host(at(5000)), at(100));
        assert_eq!(clock.resume(at(6000)), Some(at(6000)));
        assert_eq!(clock.of_host(at(7000)), at(1100));
    }

    proptest! {
        /// However it is paused, the exercise's time never goes back, never goes faster than the host's, and leads back to it.
        #[test]
        fn time_goes_on_and_comes_back(
            steps in proptest::collection::vec((1i64..400, 0u8..4), 1..60),
        ) {
            let (mut clock, mut host, mut last) = (ExerciseClock::default(), at(0), at(0));
            for (ms, what) in steps {
                let before = host;
                host = host.plus_ns(ms * 1_000_000);
                match what {
                    0 => assert!(clock.pause(host).is_none_or(|at| at == host)),
                    1 => assert!(clock.resume(host).is_none_or(|at| at == host)),
                    _ => {}
                }
                clock.follow(host);
                let now = clock.of_host(host);
                prop_assert!(now >= last && now.ns_since(last) <= host.ns_since(before));
                if !clock.is_paused() {
                    prop_assert_eq!(clock.of_host(clock.to_host(now)), now);
                }
                last = now;
            }
        }
    }
}
