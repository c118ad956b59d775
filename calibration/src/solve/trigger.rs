//! From the trigger's edge to the jolt that it causes, by dry shots with the gun held still.
//!
//! The contact closes before the sear lets go, or after; rounds leave with the jolt. Each press is followed in the specific force: the jolt
//! is where its change first stands out of what the gun did before the press. The median of all presses and their spread are robust
//! against a press that did nothing and against a knock on the mount.

use bowwave_core::{event::TriggerEdge, statistics::quantile, time::Time};
use glam::DVec3;

use crate::alignment::ImuReading;

/// A jolt is looked for this long before and after the edge, seconds: lines and units are late by as much.
const BEFORE_S: f64 = 0.05;
const AFTER_S: f64 = 0.25;
/// Span before that in which the gun's usual motion is measured, seconds.
const QUIET_S: f64 = 0.4;
/// A jolt is so many times what is usual, and at least this, m/s^2.
const STANDS_OUT: f64 = 6.0;
const JOLT_LEAST: f64 = 1.5;
/// Fewest jolts: fewer tell nothing of their spread.
const JOLTS_LEAST: usize = 4;
/// Most spread of one press, seconds.
const SPREAD_MOST_S: f64 = 0.02;

/// Why there is no latency.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LatencyError {
    /// Nobody pulled the trigger often enough.
    #[error(
        "the trigger was pressed {count} times, at least {least} are needed, a second apart, with the gun held still"
    )]
    TooFew {
        /// Presses with readings around them.
        count: usize,
        /// The least.
        least: usize,
    },
    /// Nothing is felt.
    #[error(
        "a jolt stands out after {jolts} of {presses} presses only: cock the gun, hold it still, let it rest for a second between presses; \
         check that the unit sends raw acceleration"
    )]
    NoJolt {
        /// Presses with one.
        jolts: usize,
        /// All presses.
        presses: usize,
    },
    /// They do not agree.
    #[error(
        "the jolts come {spread_ms:.0} ms apart from press to press, more than {most_ms:.0}: something else shakes the gun"
    )]
    Spread {
        /// Robust standard deviation of one press, milliseconds.
        spread_ms: f64,
        /// The most that is taken.
        most_ms: f64,
    },
}

/// How late the round is.
#[derive(Clone, Debug, PartialEq)]
pub struct Latency {
    /// From the edge to the jolt, seconds: the median. Negative where the line is the later one.
    pub latency_s: f64,
    /// Its standard deviation, seconds, the readings' spacing included.
    pub sigma_s: f64,
    /// Standard deviation of one press, seconds.
    pub spread_s: f64,
    /// Each jolt's own, seconds, in order of time.
    pub jolts: Vec<(Time, f64)>,
    /// Presses after which none stood out.
    pub without: usize,
}

/// Finds the latency from readings on the host's clock and the line's edges. Releases do not count.
///
/// # Errors
/// Where there are too few presses, no jolts, or they do not agree.
pub fn solve(readings: &[ImuReading], edges: &[TriggerEdge]) -> Result<Latency, LatencyError> {
    let felt: Vec<(Time, DVec3)> =
        readings.iter().filter_map(|r| Some((r.time, r.specific_force.filter(|f| f.is_finite())?))).collect();
    let felt: Vec<(Time, DVec3)> = in_order(felt);
    let presses: Vec<Time> = edges.iter().filter(|e| e.pressed).map(|e| e.time).collect();
    let looked: Vec<(Time, Option<f64>)> =
        presses.iter().filter_map(|press| Some((*press, jolt(&felt, *press)?))).collect();
    let jolts: Vec<(Time, f64)> =
        looked.iter().filter_map(|(press, after)| Some((*press, (*after)?))).collect();
    if looked.len() < JOLTS_LEAST {
        return Err(LatencyError::TooFew { count: looked.len(), least: JOLTS_LEAST });
    }
    if jolts.len() < JOLTS_LEAST.max(looked.len().div_ceil(2)) {
        return Err(LatencyError::NoJolt { jolts: jolts.len(), presses: looked.len() });
    }
    let latency_s = middle(jolts.iter().map(|j| j.1));
    // Of normal errors the median deviation is 0.6745 standard deviations, and the median itself errs 1.2533 times as much as the mean.
    let spread_s = middle(jolts.iter().map(|j| (j.1 - latency_s).abs())) / 0.6745;
    if spread_s > SPREAD_MOST_S {
        return Err(LatencyError::Spread { spread_ms: spread_s * 1e3, most_ms: SPREAD_MOST_S * 1e3 });
    }
    let step_s = middle(felt.windows(2).map(|w| w[1].0.secs_since(w[0].0)));
    // Where between two readings it came is not known, and the same each time where both keep one beat.
    let sigma_s = (1.2533 * spread_s / (jolts.len() as f64).sqrt()).hypot(step_s / 12f64.sqrt());
    Ok(Latency { latency_s, sigma_s, spread_s, without: looked.len() - jolts.len(), jolts })
}

fn middle(values: impl Iterator<Item = f64>) -> f64 {
    quantile(values, 0.5)
}

/// Readings whose times go forward.
fn in_order(all: Vec<(Time, DVec3)>) -> Vec<(Time, DVec3)> {
    let mut last = Time::MIN;
    let mut goes_on = |time: Time| {
        let later = time > last;
        last = last.max(time);
        later
    };
    all.into_iter().filter(|(time, _)| goes_on(*time)).collect()
}

/// Seconds from a press to the jolt; `None` in place of them where nothing stands out, and no answer at all where readings are missing.
fn jolt(felt: &[(Time, DVec3)], press: Time) -> Option<Option<f64>> {
    let from = felt.partition_point(|(t, _)| *t < press.plus_secs(-BEFORE_S - QUIET_S));
    let quiet = felt.partition_point(|(t, _)| *t < press.plus_secs(-BEFORE_S));
    let to = felt.partition_point(|(t, _)| *t <= press.plus_secs(AFTER_S));
    if quiet < from + 10 || to < quiet + 10 {
        return None;
    }
    let change = |i: usize| Some((felt.get(i)?.1 - felt.get(i.checked_sub(1)?)?.1).length());
    let usual = middle((from + 1..quiet).filter_map(change));
    let limit = (STANDS_OUT * usual).max(JOLT_LEAST);
    // The jolt began between this reading and the one before.
    let first = (quiet..to).find(|i| change(*i).is_some_and(|c| c > limit));
    Some(first.map(|i| 0.5 * (felt[i].0.secs_since(press) + felt[i - 1].0.secs_since(press))))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::simulated::Random;

    /// Presses 1.5 s apart, each followed by a jolt that rings out.
    fn recorded(
        count: usize,
        late_s: f64,
        jolt: f64,
        random: &mut Random,
    ) -> (Vec<ImuReading>, Vec<TriggerEdge>) {
        let start = Time::from_ns(7_000_000_000);
        let presses: Vec<f64> = (0..count).map(|i| 1.0 + 1.5 * i as f64 + 0.1 * random.unit()).collect();
        let released: Vec<f64> = presses.iter().map(|p| p + late_s + 0.8e-3 * random.gauss()).collect();
        let readings = (0..(1.5 * count as f64 + 2.0) as usize * 400)
            .map(|i| {
                let t = i as f64 / 400.0;
                let ring: f64 = released
                    .iter()
                    .filter(|r| t >= **r)
                    .map(|r| jolt * (-(t - r) / 0.03).exp() * (250.0 * (t - r)).cos())
                    .sum();
                let force = DVec3::new(ring, 0.3 * ring, 9.81) + random.vector() * 0.05;
                ImuReading { time: start.plus_secs(t), rate: DVec3::ZERO, specific_force: Some(force) }
            })
            .collect();
        let edge = |t: f64, pressed| TriggerEdge { time: start.plus_secs(t), pressed };
        let edges = presses.iter().flat_map(|p| [edge(*p, true), edge(p + 0.3, false)]).collect();
        (readings, edges)
    }

    #[test]
    fn the_latency_is_found_within_its_deviation() {
        let mut random = Random::new(5);
        for late_s in [-0.03, 0.0, 0.012, 0.09] {
            let (mut outside, runs) = (0, 60);
            for _ in 0..runs {
                let (readings, edges) = recorded(8, late_s, 30.0, &mut random);
                let found = solve(&readings, &edges).unwrap();
                assert_eq!((found.jolts.len(), found.without), (8, 0));
                assert!(found.sigma_s < 2e-3, "{found:?}");
                outside += u32::from((found.latency_s - late_s).abs() > 3.0 * found.sigma_s);
            }
            assert!(outside <= 2, "{outside} of {runs} at {late_s}");
        }
    }

    #[test]
    fn knocks_and_presses_that_do_nothing_do_not_matter() {
        let mut random = Random::new(6);
        let (mut readings, mut edges) = recorded(9, 0.02, 30.0, &mut random);
        // A knock before the third press, and a press long after all jolts.
        let knock = edges[4].time.plus_secs(-0.03);
        let at = readings.partition_point(|r| r.time < knock);
        readings[at].specific_force = Some(DVec3::splat(40.0));
        edges.push(TriggerEdge { time: readings[readings.len() - 1].time.plus_secs(-0.4), pressed: true });
        let found = solve(&readings, &edges).unwrap();
        assert_eq!(found.without, 1);
        assert!((found.latency_s - 0.02).abs() < 3.0 * found.sigma_s, "{found:?}");
    }

    #[test]
    fn what_tells_nothing_is_refused() {
        let mut random = Random::new(7);
        let (readings, edges) = recorded(3, 0.02, 30.0, &mut random);
        assert_eq!(solve(&readings, &edges), Err(LatencyError::TooFew { count: 3, least: 4 }));
        assert_eq!(solve(&[], &edges), Err(LatencyError::TooFew { count: 0, least: 4 }));
        let (readings, edges) = recorded(8, 0.02, 0.0, &mut random);
        assert_eq!(solve(&readings, &edges), Err(LatencyError::NoJolt { jolts: 0, presses: 8 }));
        let (readings, mut edges) = recorded(12, 0.02, 30.0, &mut random);
        for (i, edge) in edges.iter_mut().enumerate() {
            edge.time = edge.time.plus_secs(-0.012 * (i % 14) as f64);
        }
        assert!(matches!(solve(&readings, &edges), Err(LatencyError::Spread { .. })));
    }

    proptest! {
        #[test]
        fn nothing_from_outside_panics(times in proptest::collection::vec(any::<i64>(), 0..60), force in any::<f64>(), edge in any::<i64>()) {
            let readings: Vec<ImuReading> = times
                .iter()
                .map(|t| ImuReading { time: Time::from_ns(*t), rate: DVec3::ZERO, specific_force: Some(DVec3::splat(force)) })
                .collect();
            let edges = [TriggerEdge { time: Time::from_ns(edge), pressed: true }; 6];
            if let Ok(found) = solve(&readings, &edges) {
                prop_assert!(found.latency_s.is_finite() && found.sigma_s.is_finite());
            }
        }
    }
}
