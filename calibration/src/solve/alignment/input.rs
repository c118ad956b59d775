//! Measurements, and how they are cleaned before the solution.

use bowwave_core::{event::ImuSample, time::Time};
use glam::{DQuat, DVec3};

use crate::solve::so3::exp;

/// One reading of the inertial unit, in the unit's own axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuReading {
    /// When it was measured, on the host's clock (as the device clock's map gives it).
    pub time: Time,
    /// Angular rate, rad/s, bias included.
    pub rate: DVec3,
    /// Specific force, m/s^2 (+g upwards at rest), where the unit has accelerometers. Only used together with [`Observation::Up`].
    pub specific_force: Option<DVec3>,
}

impl ImuReading {
    /// The device's sample, measured at `time`.
    pub fn new(time: Time, sample: &ImuSample) -> Self {
        Self { time, rate: sample.rate, specific_force: Some(sample.accel) }
    }
}

/// Observation of the camera's orientation at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Observation {
    /// The whole orientation, from a target board or a chain of visual increments.
    Orientation {
        /// The picture's mid-exposure by the camera's stamp.
        stamp: Time,
        /// Rotation from the camera's axes to the board's (or to those of the chain's first picture).
        reference_from_camera: DQuat,
        /// Standard deviation about each axis, radians. Only its size relative to other observations matters.
        sigma: f64,
        /// Mean row of what was measured, off the picture's middle, in picture heights (-0.5 top, 0.5 bottom).
        row: f64,
        /// Orientations of different chains have different references.
        chain: u32,
    },
    /// Only where up is: from the horizon.
    Up {
        /// The picture's mid-exposure by the camera's stamp.
        stamp: Time,
        /// Up in the camera's axes (any length).
        up_in_camera: DVec3,
        /// Standard deviation about each axis across it, radians.
        sigma: f64,
        /// As for orientations.
        row: f64,
    },
}

impl Observation {
    /// The camera's stamp.
    pub fn stamp(&self) -> Time {
        match self {
            Self::Orientation { stamp, .. } | Self::Up { stamp, .. } => *stamp,
        }
    }

    pub(super) fn row(&self) -> f64 {
        match self {
            Self::Orientation { row, .. } | Self::Up { row, .. } => *row,
        }
    }

    pub(super) fn sigma(&self) -> f64 {
        match self {
            Self::Orientation { sigma, .. } | Self::Up { sigma, .. } => *sigma,
        }
    }

    fn is_sound(&self) -> bool {
        let (sigma, row, rest) = match self {
            Self::Orientation { reference_from_camera: q, sigma, row, .. } => {
                (sigma, row, q.is_finite() && (0.5..2.0).contains(&q.length()))
            }
            Self::Up { up_in_camera: u, sigma, row, .. } => {
                (sigma, row, u.is_finite() && (1e-3..1e6).contains(&u.length()))
            }
        };
        rest && (1e-7..1.0).contains(sigma) && (-2.0..=2.0).contains(row)
    }
}

/// How far the camera turned from one picture to another, seen in far-off points without a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increment {
    /// Stamp of the earlier picture.
    pub from: Time,
    /// Stamp of the later picture.
    pub to: Time,
    /// Rotation from the later picture's camera axes to the earlier one's.
    pub from_from_to: DQuat,
    /// Standard deviation about each axis, radians.
    pub sigma: f64,
}

/// Increments strung together to orientations. A new chain begins wherever one does not start with the picture that the one before
/// ended with, or is no number. The growing error of a chain is what [`super::solve`] takes for the gyro's drift.
pub fn chained(increments: &[Increment]) -> Vec<Observation> {
    let mut out = Vec::with_capacity(increments.len() + 1);
    let mut chain = 0;
    let mut last: Option<(Time, DQuat)> = None;
    for i in increments {
        let sound = i.from_from_to.is_finite() && (0.5..2.0).contains(&i.from_from_to.length());
        if !sound || i.to <= i.from {
            last = None;
            continue;
        }
        let at = |stamp, q, chain| Observation::Orientation {
            stamp,
            reference_from_camera: q,
            sigma: i.sigma,
            row: 0.0,
            chain,
        };
        let before = match last {
            Some((stamp, q)) if stamp == i.from => q,
            _ => {
                chain += 1;
                out.push(at(i.from, DQuat::IDENTITY, chain));
                DQuat::IDENTITY
            }
        };
        let q = (before * i.from_from_to.normalize()).normalize();
        out.push(at(i.to, q, chain));
        last = Some((i.to, q));
    }
    out
}

/// Counts of measurements that were left out, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOutCounts {
    /// Readings or observations that are no numbers, or of no possible size.
    pub not_finite: usize,
    /// Readings or observations whose stamps repeat or go backwards.
    pub out_of_order: usize,
    /// Readings at the gyro's limit.
    pub clipped: usize,
    /// Observations at times without gyro readings.
    pub without_gyro: usize,
}

/// Readings in order, seconds since `epoch`.
#[derive(Clone, Debug)]
pub(super) struct GyroTrace {
    pub epoch: Time,
    pub time: Vec<f64>,
    pub rate: Vec<DVec3>,
    pub force: Vec<Option<DVec3>>,
    /// Whether the way from this reading to the next is not known: a gap or a clipped rate.
    pub broken: Vec<bool>,
}

/// Longest increasing subsequence of `keys` (Fredman 1975): what is left when the fewest stamps that repeat or jump are dropped.
fn increasing(keys: &[i64]) -> Vec<usize> {
    let mut tails: Vec<usize> = Vec::new();
    let mut before = vec![usize::MAX; keys.len()];
    for (i, key) in keys.iter().enumerate() {
        let place = tails.partition_point(|&t| keys[t] < *key);
        // Of several with one stamp the first stays.
        if tails.get(place).is_some_and(|&t| keys[t] == *key) {
            continue;
        }
        if place > 0 {
            before[i] = tails[place - 1];
        }
        if place == tails.len() { tails.push(i) } else { tails[place] = i }
    }
    let mut out = Vec::with_capacity(tails.len());
    let mut at = tails.last().copied().unwrap_or(usize::MAX);
    while at != usize::MAX {
        out.push(at);
        at = before[at];
    }
    out.reverse();
    out
}

/// Readings fit to be integrated. `range` is the gyro's limit, rad/s.
pub(super) fn clean_gyro(readings: &[ImuReading], range: Option<f64>, left: &mut LeftOutCounts) -> GyroTrace {
    let sound: Vec<&ImuReading> =
        readings.iter().filter(|r| r.rate.is_finite() && r.rate.length() < 1e3).collect();
    left.not_finite += readings.len() - sound.len();
    let stamps: Vec<i64> = sound.iter().map(|r| r.time.ns()).collect();
    let kept: Vec<&ImuReading> = increasing(&stamps).into_iter().map(|i| sound[i]).collect();
    left.out_of_order += sound.len() - kept.len();
    let epoch = kept.first().map_or(Time::from_ns(0), |r| r.time);
    let time: Vec<f64> = kept.iter().map(|r| r.time.secs_since(epoch)).collect();
    let rate: Vec<DVec3> = kept.iter().map(|r| r.rate).collect();
    let clipped = clipped(&rate, range);
    left.clipped += clipped.iter().filter(|c| **c).count();
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    let longest = steps.get(steps.len() / 2).map_or(0.0, |median| (4.0 * median).max(0.012));
    let broken = (0..time.len())
        .map(|i| i + 1 < time.len() && (clipped[i] || clipped[i + 1] || time[i + 1] - time[i] > longest))
        .collect();
    let force = kept.iter().map(|r| r.specific_force.filter(|f| f.is_finite())).collect();
    GyroTrace { epoch, time, rate, force, broken }
}

/// Rates at the limit. Without a known limit, runs of equal largest readings tell it: noise never repeats itself so.
fn clipped(rate: &[DVec3], range: Option<f64>) -> Vec<bool> {
    const RUN: usize = 3;
    let mut out = vec![false; rate.len()];
    for axis in 0..3 {
        let largest = rate.iter().map(|r| r[axis].abs()).fold(0.0, f64::max);
        let limit = match range {
            Some(range) => range * 0.999,
            None => {
                let runs = rate
                    .windows(RUN)
                    .any(|w| w.iter().all(|r| r[axis].abs() >= largest * (1.0 - 1e-9)) && largest > 0.5);
                if runs { largest * (1.0 - 1e-9) } else { f64::INFINITY }
            }
        };
        for (flag, r) in out.iter_mut().zip(rate) {
            *flag |= r[axis].abs() >= limit;
        }
    }
    out
}

/// Sound observations in the order of their stamps, each with its number among `all`. One of a kind remains of several with one stamp.
pub(super) fn clean_observations(
    all: &[Observation],
    left: &mut LeftOutCounts,
) -> (Vec<Observation>, Vec<usize>) {
    let sound = all.iter().enumerate().filter(|(_, o)| o.is_sound());
    let (ups, orientations): (Vec<usize>, Vec<usize>) =
        sound.map(|(i, _)| i).partition(|i| matches!(all[*i], Observation::Up { .. }));
    left.not_finite += all.len() - ups.len() - orientations.len();
    let (mut out, mut numbers) = (Vec::with_capacity(all.len()), Vec::with_capacity(all.len()));
    for kind in [orientations, ups] {
        let stamps: Vec<i64> = kind.iter().map(|i| all[*i].stamp().ns()).collect();
        let kept = increasing(&stamps);
        left.out_of_order += kind.len() - kept.len();
        for number in kept.into_iter().map(|i| kind[i]) {
            numbers.push(number);
            out.push(match all[number] {
                Observation::Orientation { stamp, reference_from_camera: q, sigma, row, chain } => {
                    Observation::Orientation {
                        stamp,
                        reference_from_camera: q.normalize(),
                        sigma,
                        row,
                        chain,
                    }
                }
                Observation::Up { stamp, up_in_camera, sigma, row } => {
                    Observation::Up { stamp, up_in_camera: up_in_camera.normalize(), sigma, row }
                }
            });
        }
    }
    (out, numbers)
}

/// Where up is in the unit's axes, by specific force averaged over half seconds in the frame of their middle: what a hand or a ship adds
/// is not known, but has no mean. Pairs of seconds and unit vector.
pub(super) fn levels(gyro: &GyroTrace) -> Vec<(f64, DVec3)> {
    const WINDOW_S: f64 = 0.5;
    let mut out = Vec::new();
    let mut start = 0;
    while start < gyro.time.len() {
        let begin = gyro.time[start];
        let end = start + gyro.time[start..].partition_point(|t| t - begin < WINDOW_S);
        if !gyro.broken[start..end].iter().any(|b| *b) {
            let mut turn = DQuat::IDENTITY;
            let mut sum = DVec3::ZERO;
            for i in start..end {
                sum += gyro.force[i].map_or(DVec3::ZERO, |f| turn * f);
                if i + 1 < end {
                    let h = gyro.time[i + 1] - gyro.time[i];
                    turn = (turn * exp((gyro.rate[i] + gyro.rate[i + 1]) * (0.5 * h))).normalize();
                }
            }
            if let Some(up) = sum.try_normalize() {
                out.push((begin, up));
            }
        }
        start = end.max(start + 1);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fewest_stamps_are_dropped() {
        assert_eq!(increasing(&[1, 2, 900, 3, 3, 4, 2, 5]), [0, 1, 3, 5, 7]);
        assert_eq!(increasing(&[]), [0usize; 0]);
        assert_eq!(increasing(&[i64::MAX, i64::MIN, 0]), [1, 2]);
    }

    #[test]
    fn a_plateau_is_a_limit_and_a_single_peak_is_none() {
        let rates = |v: &[f64]| v.iter().map(|x| DVec3::X * *x).collect::<Vec<_>>();
        let flags = clipped(&rates(&[0.1, 2.0, 2.0, 2.0, 0.3, -2.0]), None);
        assert_eq!(flags, [false, true, true, true, false, true]);
        assert!(clipped(&rates(&[0.1, 2.0, 1.9, 0.2]), None).iter().all(|f| !f));
        assert_eq!(clipped(&rates(&[0.1, 2.0]), Some(2.0)), [false, true]);
    }

    #[test]
    fn increments_form_chains() {
        let turn = exp(DVec3::X * 0.1);
        let inc = |a, b| Increment {
            from: Time::from_ns(a),
            to: Time::from_ns(b),
            from_from_to: turn,
            sigma: 1e-3,
        };
        let all = chained(&[inc(0, 1), inc(1, 2), inc(5, 6), inc(6, 6)]);
        let chains: Vec<u32> = all
            .iter()
            .map(|o| match o {
                Observation::Orientation { chain, .. } => *chain,
                Observation::Up { .. } => 0,
            })
            .collect();
        assert_eq!(chains, [1, 1, 1, 2, 2]);
    }
}
