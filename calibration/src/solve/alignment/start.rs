//! A first estimate without a guess: turns over four tenths of a second, seen by both, correlated over all offsets.

use glam::{DQuat, DVec3};
use nalgebra::Matrix3;

use super::{error::AlignmentError, input::Observation, problem::AlignmentProblem, track::GyroTrack};
use crate::solve::so3::{log, nearest_rotation, vector};

/// Rotation, offset and bias to start from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignmentStart {
    /// Rotation from the unit's axes to the camera's.
    pub camera_from_imu: DQuat,
    /// Add to the camera's stamps to get times of the unit, seconds.
    pub offset_s: f64,
    /// Gyro bias, rad/s.
    pub bias: DVec3,
}

/// A turn of the camera between two stamps: rotation vector in the camera's axes.
#[derive(Clone, Copy, Debug)]
struct Turn {
    from: f64,
    to: f64,
    camera: DVec3,
    weight: f64,
}

fn turns(problem: &AlignmentProblem) -> Vec<Turn> {
    /// Length of a turn, seconds, and how many of them are looked at.
    const TURN_S: f64 = 0.4;
    /// Where pictures are rare, a turn may take this long.
    const LONGEST_S: f64 = 5.0;
    const TURNS: usize = 400;
    let seen: Vec<(f64, DQuat, u32)> = problem
        .observations
        .iter()
        .filter_map(|o| match o {
            Observation::Orientation { stamp, reference_from_camera, chain, .. } => {
                Some((stamp.secs_since(problem.gyro.epoch), *reference_from_camera, *chain))
            }
            Observation::Up { .. } => None,
        })
        .collect();
    let stride = (seen.len() / TURNS).max(1);
    let mut out = Vec::new();
    for (i, (from, q, chain)) in seen.iter().enumerate().step_by(stride) {
        let j = i + seen[i..].partition_point(|(t, ..)| t - from < TURN_S);
        let Some((to, later, other)) = seen.get(j) else { break };
        let camera = log(q.inverse() * *later);
        // Turns near half a circle could as well have gone the other way.
        if chain == other && to - from < LONGEST_S && camera.length() < 2.6 {
            out.push(Turn { from: *from, to: *to, camera, weight: 1.0 });
        }
    }
    // A pose that was found wrong turns far: it must not outweigh all others before it is known.
    let mut sizes: Vec<f64> = out.iter().map(|t| t.camera.length()).collect();
    sizes.sort_by(f64::total_cmp);
    let usual = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0).max(1e-4);
    out.iter_mut().for_each(|t| t.weight = 1.0 / (1.0 + (t.camera.length() / (4.0 * usual)).powi(4)));
    out
}

/// One turn as both saw it.
#[derive(Clone, Copy, Debug)]
struct TurnPair {
    camera: DVec3,
    imu: DVec3,
    weight: f64,
    seconds: f64,
}

/// How well turns of both agree at one offset.
#[derive(Clone, Copy, Debug)]
struct StartFit {
    camera_from_imu: DQuat,
    /// 1 where a rotation or a mirrored one takes all turns of one into the other's.
    score: f64,
    /// The same without mirrored ones.
    proper: f64,
    pairs: usize,
}

fn pairs(turns: &[Turn], track: &GyroTrack<'_>, offset: f64, bias: DVec3) -> Vec<TurnPair> {
    turns
        .iter()
        .filter_map(|t| {
            let (a, b) = (track.at(t.from + offset)?, track.at(t.to + offset)?);
            let whole = a.segment == b.segment;
            let turn = log(a.start_from_imu.inverse() * b.start_from_imu) - bias * (t.to - t.from);
            let seconds = t.to - t.from;
            whole.then_some(TurnPair { camera: t.camera, imu: turn, weight: t.weight, seconds })
        })
        .collect()
}

fn fit(pairs: &[TurnPair], centred: bool) -> Option<StartFit> {
    let total: f64 = pairs.iter().map(|p| p.weight).sum();
    let mean = |f: fn(&TurnPair) -> DVec3| {
        if centred { pairs.iter().map(|p| f(p) * p.weight).sum::<DVec3>() / total } else { DVec3::ZERO }
    };
    let (camera, imu) = (mean(|p| p.camera), mean(|p| p.imu));
    let (mut m, mut energy) = (Matrix3::zeros(), 0.0);
    for p in pairs {
        let (c, i) = (p.camera - camera, p.imu - imu);
        m += vector(c) * vector(i).transpose() * p.weight;
        energy += p.weight * (c.length_squared() + i.length_squared());
    }
    let (camera_from_imu, s, mirrored) = nearest_rotation(&m)?;
    let all = 2.0 * (s[0] + s[1] + s[2]) / energy;
    let less = if mirrored { 4.0 * s[2] / energy } else { 0.0 };
    all.is_finite().then_some(StartFit {
        camera_from_imu,
        score: all,
        proper: all - less,
        pairs: pairs.len(),
    })
}

/// The offset at which turns agree best, by steps and then by a parabola through the best three.
fn best_offset(
    turns: &[Turn],
    track: &GyroTrack<'_>,
    centre: f64,
    range: f64,
    step: f64,
    centred: bool,
) -> Option<f64> {
    let count = (range / step).ceil() as i64;
    let fits: Vec<(usize, f64)> = (-count..=count)
        .map(|i| {
            let pairs = pairs(turns, track, centre + i as f64 * step, DVec3::ZERO);
            (pairs.len(), fit(&pairs, centred).map_or(0.0, |f| f.score))
        })
        .collect();
    // At an offset that pushes most turns out of the recording, the few that are left agree by chance.
    let most = fits.iter().map(|f| f.0).max().filter(|most| *most >= 4)?;
    let scores: Vec<f64> = fits.iter().map(|(n, score)| if n * 2 >= most { *score } else { 0.0 }).collect();
    let best = (0..scores.len()).max_by(|a, b| scores[*a].total_cmp(&scores[*b]))?;
    let mut shift = 0.0;
    if best > 0 && best + 1 < scores.len() {
        let (a, b, c) = (scores[best - 1], scores[best], scores[best + 1]);
        let bend = a - 2.0 * b + c;
        if bend < 0.0 {
            shift = (0.5 * (a - c) / bend).clamp(-0.5, 0.5);
        }
    }
    Some(centre + ((best as i64 - count) as f64 + shift) * step)
}

/// Closed form from whole orientations: offset by correlation, rotation by singular values, bias by the mean difference.
pub(super) fn from_orientations(problem: &AlignmentProblem) -> Result<AlignmentStart, AlignmentError> {
    /// Of the first search over offsets, seconds.
    const STEP_S: f64 = 0.01;
    let track = GyroTrack::new(&problem.gyro, DVec3::ZERO, DVec3::ZERO);
    let mut turns = turns(problem);
    let count = turns.len();
    let too_few = || AlignmentError::TooFew { what: "turns over 0.4 s seen by both", count, least: 6 };
    if turns.len() < 6 {
        return Err(too_few());
    }
    let range = problem.options.offset_range_s;
    // A slow motion drowns in the bias, which differences from the mean do not have; a steady traverse is nothing but mean.
    let spread =
        |about: DVec3| turns.iter().map(|t| (t.camera - about).length_squared() * t.weight).sum::<f64>();
    let weight: f64 = turns.iter().map(|t| t.weight).sum();
    let mean = turns.iter().map(|t| t.camera * t.weight).sum::<DVec3>() / weight;
    let centred = spread(mean) > 0.3 * spread(DVec3::ZERO);
    let coarse = best_offset(&turns, &track, 0.0, range, STEP_S, centred).ok_or_else(too_few)?;
    drop_outliers(&mut turns, &track, coarse, centred);
    let offset =
        best_offset(&turns, &track, coarse, 3.0 * STEP_S, STEP_S / 4.0, centred).ok_or_else(too_few)?;
    let mut start = AlignmentStart { camera_from_imu: DQuat::IDENTITY, offset_s: offset, bias: DVec3::ZERO };
    let mut last = fit(&pairs(&turns, &track, offset, DVec3::ZERO), centred).ok_or_else(too_few)?;
    for _ in 0..6 {
        start.camera_from_imu = last.camera_from_imu;
        let raw = pairs(&turns, &track, offset, DVec3::ZERO);
        let sum = raw.iter().fold((DVec3::ZERO, 0.0), |(s, n), p| {
            let off = p.imu - start.camera_from_imu.inverse() * p.camera;
            (s + off * p.weight, n + p.weight * p.seconds)
        });
        start.bias = (sum.0 / sum.1).clamp_length_max(0.2);
        last = fit(&pairs(&turns, &track, offset, start.bias), false).ok_or_else(too_few)?;
    }
    let (left, left_mirrored) = (1.0 - last.proper, 1.0 - last.score);
    if left > 0.05 && left_mirrored < 0.3 * left && last.pairs >= 12 {
        return Err(AlignmentError::Mirrored { left, left_mirrored });
    }
    start.camera_from_imu = last.camera_from_imu;
    Ok(start)
}

/// Turns that do not fit the best rotation weigh nothing from here on.
fn drop_outliers(turns: &mut [Turn], track: &GyroTrack<'_>, offset: f64, centred: bool) {
    let Some(fit) = fit(&pairs(turns, track, offset, DVec3::ZERO), centred) else { return };
    let off = |t: &Turn| -> Option<f64> {
        let (a, b) = (track.at(t.from + offset)?, track.at(t.to + offset)?);
        let turn = log(a.start_from_imu.inverse() * b.start_from_imu);
        // Sizes only: the rotation may be mirrored, which is found out later.
        let size = (t.camera.length() - turn.length()).abs();
        let whole = (t.camera - fit.camera_from_imu * turn).length();
        Some(if fit.score - fit.proper > 0.05 { size } else { whole })
    };
    let all: Vec<Option<f64>> = turns.iter().map(off).collect();
    let mut sorted: Vec<f64> = all.iter().flatten().copied().collect();
    sorted.sort_by(f64::total_cmp);
    let limit = sorted.get(sorted.len() / 2).map_or(f64::INFINITY, |m| 5.0 * m + 1e-4);
    for (t, off) in turns.iter_mut().zip(all) {
        t.weight = if off.is_some_and(|o| o <= limit) { 1.0 } else { 0.0 };
    }
}

/// From the horizon alone: for each offset the rotation and the first level that explain the ups best, in turns from several levels.
pub(super) fn from_ups(problem: &AlignmentProblem) -> Result<AlignmentStart, AlignmentError> {
    let track = GyroTrack::new(&problem.gyro, DVec3::ZERO, DVec3::ZERO);
    let all: Vec<(f64, DVec3)> = problem
        .observations
        .iter()
        .filter_map(|o| match o {
            Observation::Up { stamp, up_in_camera, .. } => {
                Some((stamp.secs_since(problem.gyro.epoch), *up_in_camera))
            }
            Observation::Orientation { .. } => None,
        })
        .collect();
    if all.len() < 6 {
        return Err(AlignmentError::TooFew { what: "pictures with a horizon", count: all.len(), least: 6 });
    }
    let stride = (all.len() / 60).max(1);
    let few: Vec<(f64, DVec3)> = all.iter().step_by(stride).copied().collect();
    let known = level_at_start(problem, &track);
    let range = problem.options.offset_range_s;
    let search = |centre: f64, range: f64, step: f64| {
        let count = (range / step).ceil() as i64;
        (-count..=count)
            .map(|i| centre + i as f64 * step)
            .filter_map(|offset| wahba(&few, &track, offset, known).map(|(score, q)| (score, q, offset)))
            .max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let found = search(0.0, range, 0.02).and_then(|(_, _, offset)| search(offset, 0.03, 0.003));
    found
        .map(|(_, camera_from_imu, offset_s)| AlignmentStart { camera_from_imu, offset_s, bias: DVec3::ZERO })
        .ok_or(AlignmentError::NoOverlap {
            camera_s: all.last().map_or(0.0, |l| l.0 - all[0].0),
            gyro_s: problem.gyro.time.last().copied().unwrap_or(0.0),
        })
}

/// Mean up in the first reading's frame, by the accelerometers.
fn level_at_start(problem: &AlignmentProblem, track: &GyroTrack<'_>) -> Option<DVec3> {
    let sum: DVec3 =
        problem.levels.iter().filter_map(|(t, up)| track.at(*t).map(|s| s.start_from_imu * *up)).sum();
    sum.try_normalize().filter(|_| problem.levels.len() >= 4)
}

/// Best rotation from unit to camera at one offset, and its score (mean cosine).
fn wahba(
    ups: &[(f64, DVec3)],
    track: &GyroTrack<'_>,
    offset: f64,
    known: Option<DVec3>,
) -> Option<(f64, DQuat)> {
    let seen: Vec<(DVec3, DQuat)> =
        ups.iter().filter_map(|(t, u)| track.at(t + offset).map(|s| (*u, s.start_from_imu))).collect();
    if seen.len() * 2 < ups.len() || seen.len() < 4 {
        return None;
    }
    let guesses: Vec<DVec3> = match known {
        Some(up) => vec![up],
        None => (0..27)
            .filter_map(|i| {
                DVec3::new(f64::from(i % 3) - 1.0, f64::from(i / 3 % 3) - 1.0, f64::from(i / 9) - 1.0)
                    .try_normalize()
            })
            .collect(),
    };
    let score = |q: DQuat, level: DVec3| {
        seen.iter().map(|(u, g)| u.dot(q * (g.inverse() * level))).sum::<f64>() / seen.len() as f64
    };
    let turn = |level: DVec3| {
        let m = seen
            .iter()
            .fold(Matrix3::zeros(), |m, (u, g)| m + vector(*u) * vector(g.inverse() * level).transpose());
        nearest_rotation(&m).map(|n| n.0)
    };
    let rounds = if known.is_some() { 1 } else { 8 };
    guesses
        .into_iter()
        .filter_map(|mut level| {
            let mut q = turn(level)?;
            for _ in 1..rounds {
                level = seen.iter().map(|(u, g)| *g * (q.inverse() * *u)).sum::<DVec3>().try_normalize()?;
                q = turn(level)?;
            }
            Some((score(q, level), q))
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))
}
