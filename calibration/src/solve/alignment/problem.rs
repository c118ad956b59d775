//! The measurements as residuals, and how these depend on what is solved for.

use std::collections::BTreeMap;

use glam::{DMat3, DQuat, DVec3};
use nalgebra::Vector3;

use super::{
    Options,
    filter::{Jacobian, ResidualKind, ResidualRow, UnknownsStep, place},
    input::{GyroTrace, LeftOutCounts, Observation},
    start::AlignmentStart,
    track::{GyroTrack, TrackState},
};
use crate::solve::so3::{dvec, exp, log, matrix, vector};

/// Cleaned measurements.
#[derive(Clone, Debug)]
pub(super) struct AlignmentProblem {
    pub gyro: GyroTrace,
    pub observations: Vec<Observation>,
    /// Where up is in the unit's axes, at which second.
    pub levels: Vec<(f64, DVec3)>,
    pub options: Options,
    pub left: LeftOutCounts,
    /// Weak prior ([`known`]).
    pub known: Option<AlignmentStart>,
    /// How each observation turns with what the camera is taken for; empty where nobody asks.
    pub sight: Vec<BySight>,
}

/// Unknowns of the least-squares problem.
#[derive(Clone, Debug)]
pub(super) struct AlignmentUnknowns {
    pub camera_from_imu: DQuat,
    pub offset_s: f64,
    pub bias: DVec3,
    pub readout_s: f64,
    /// Share by which the gyro reads too little, each axis.
    pub scale: DVec3,
    /// Lens and dip ([`BySight`]) against what they were taken for.
    pub lens: [f64; LENS_AND_DIP],
    /// Up in the reference.
    pub up: DVec3,
    /// Rotation from the first reading's frame to the reference, for each segment.
    pub anchors: BTreeMap<TrackSegment, DQuat>,
}

/// Breaks of the gyro before, and the chain of orientations.
type TrackSegment = (usize, u32);

/// Standard deviation of a level by half a second of specific force, radians: a start, the scatter tells the rest.
const LEVEL_SIGMA: f64 = 0.02;
/// Standard deviation of the error that all levels share, radians: data sheets of units of the class (VN-100, MTi) state 5 mg of bias.
const LEVEL_COMMON: f64 = 5e-3;

impl AlignmentProblem {
    pub(super) fn has_orientations(&self) -> bool {
        self.observations.iter().any(|o| matches!(o, Observation::Orientation { .. }))
    }

    pub(super) fn has_ups(&self) -> bool {
        self.observations.iter().any(|o| matches!(o, Observation::Up { .. }))
    }

    /// Of several chains, the one with most orientations: up in the reference is that in its own.
    fn main_chain(&self) -> u32 {
        let mut count = BTreeMap::<u32, usize>::new();
        for o in &self.observations {
            if let Observation::Orientation { chain, .. } = o {
                *count.entry(*chain).or_default() += 1;
            }
        }
        count.into_iter().max_by_key(|(_, n)| *n).map_or(0, |(chain, _)| chain)
    }

    /// Which parameters are solved for.
    pub(super) fn active(&self) -> Vec<usize> {
        let mut out: Vec<usize> = (0..7).collect();
        if self.options.estimate_readout || self.known.is_some() {
            out.push(place::READOUT);
        }
        if self.known.is_some() {
            out.extend(place::SCALE..place::UP);
            out.extend(place::LENS..place::LENS + LENS_AND_DIP);
        }
        if self.has_ups() && self.has_orientations() {
            out.extend([place::UP, place::UP + 1]);
        }
        out
    }

    /// Unknowns from a start: references are set by what was seen.
    pub(super) fn unknowns(&self, start: &AlignmentStart) -> AlignmentUnknowns {
        let mut unknowns = AlignmentUnknowns {
            camera_from_imu: start.camera_from_imu,
            offset_s: start.offset_s,
            bias: start.bias,
            readout_s: 0.0,
            scale: DVec3::ZERO,
            lens: [0.0; LENS_AND_DIP],
            up: DVec3::Z,
            anchors: BTreeMap::new(),
        };
        self.set_references(&mut unknowns);
        unknowns
    }

    /// Anchors by the median of what was seen; up in the reference by the mean of the horizons.
    fn set_references(&self, unknowns: &mut AlignmentUnknowns) {
        let track = GyroTrack::new(&self.gyro, unknowns.bias, unknowns.scale);
        let mut seen: BTreeMap<TrackSegment, Vec<DQuat>> = BTreeMap::new();
        let mut ups: BTreeMap<TrackSegment, Vec<DVec3>> = BTreeMap::new();
        let main = self.main_chain();
        for o in &self.observations {
            let Some(state) = self.state(&track, unknowns, o) else { continue };
            let start_from_camera = state.start_from_imu * unknowns.camera_from_imu.inverse();
            match o {
                Observation::Orientation { reference_from_camera, chain, .. } => seen
                    .entry((state.segment, *chain))
                    .or_default()
                    .push(*reference_from_camera * start_from_camera.inverse()),
                Observation::Up { up_in_camera, .. } => {
                    ups.entry((state.segment, main)).or_default().push(start_from_camera * *up_in_camera);
                }
            }
        }
        unknowns.anchors = seen.into_iter().map(|(k, all)| (k, median(&all))).collect();
        let in_reference: DVec3 = ups
            .iter()
            .filter_map(|(k, all)| unknowns.anchors.get(k).map(|a| *a * all.iter().sum::<DVec3>()))
            .sum();
        unknowns.up = in_reference.try_normalize().unwrap_or(DVec3::Z);
        for (key, all) in ups {
            let level = all.iter().sum::<DVec3>().try_normalize().unwrap_or(DVec3::Z);
            unknowns.anchors.entry(key).or_insert_with(|| DQuat::from_rotation_arc(level, unknowns.up));
        }
    }

    fn state(
        &self,
        track: &GyroTrack<'_>,
        unknowns: &AlignmentUnknowns,
        o: &Observation,
    ) -> Option<TrackState> {
        let row = if self.sight.is_empty() { o.row() } else { 0.0 };
        track.at(o.stamp().secs_since(self.gyro.epoch) + unknowns.offset_s + row * unknowns.readout_s)
    }

    /// Residuals in order of time.
    pub(super) fn rows(&self, unknowns: &AlignmentUnknowns, weights: &Weights) -> Vec<ResidualRow> {
        let track = GyroTrack::new(&self.gyro, unknowns.bias, unknowns.scale);
        let main = self.main_chain();
        let mut keys: BTreeMap<TrackSegment, usize> = BTreeMap::new();
        for key in unknowns.anchors.keys() {
            let number = keys.len();
            keys.insert(*key, number);
        }
        let place = |state: &TrackState, chain: u32| {
            let key = (state.segment, chain);
            Some((*unknowns.anchors.get(&key)?, *keys.get(&key)?))
        };
        let mut rows = Vec::with_capacity(self.observations.len() + self.levels.len());
        for (index, o) in self.observations.iter().enumerate() {
            let Some(state) = self.state(&track, unknowns, o) else { continue };
            let chain = match o {
                Observation::Orientation { chain, .. } => *chain,
                Observation::Up { .. } => main,
            };
            if let Some((anchor, segment)) = place(&state, chain) {
                let weight = weights.observations.get(index).copied().unwrap_or(1.0);
                let row = begun(state.time, index, &state, (anchor, segment), weight);
                rows.push(observed(row, o, self.sight.get(index), unknowns, &state, anchor));
            }
        }
        for (index, (time, up)) in self.levels.iter().enumerate() {
            let Some(state) = track.at(*time) else { continue };
            if let Some((anchor, segment)) = place(&state, main) {
                let weight = weights.levels.get(index).copied().unwrap_or(1.0);
                let row = begun(*time, index, &state, (anchor, segment), weight);
                let mut row = levelled(row, *up, unknowns, &state, anchor);
                row.common = LEVEL_COMMON * (self.levels.len() as f64).sqrt();
                rows.push(row);
            }
        }
        if let Some(start) = &self.known {
            rows.extend(known(start, unknowns, self.options.horizon_sigma));
        }
        rows.sort_by(|a, b| a.time.total_cmp(&b.time));
        rows
    }
}

/// How an observation turns with what the camera is taken for: a rotation vector in the camera's axes by each unit. What a picture shows to
/// be `v` would be shown to be `exp(turn) v`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BySight {
    /// By the read-out time of the picture, rad/s.
    pub readout: DVec3,
    /// By the share of the focal length, the principal point right and down in focal lengths, the first coefficient of distortion, and by the
    /// horizon's dip.
    pub lens: [DVec3; LENS_AND_DIP],
}

/// Numbers of the lens that are asked for, and the dip.
pub const LENS_AND_DIP: usize = 5;

/// How roughly a start is known, for those of its numbers that the recording does not tell: 0.1 rad, 0.1 s, 0.01 rad/s (by as much biases
/// change from day to day), 20 ms of read-out, shares of 0.01 of the gyro's scale, 0.05 of the lens. That the filter lets every segment begin
/// anywhere adds a twentieth to these. A gyro that reads nothing and a lens of any length would explain every horizon: scale and lens are held
/// near to what is sold.
const KNOWN_SIGMA: f64 = 0.1;
const KNOWN_BIAS: f64 = 0.01;
const KNOWN_READOUT_S: f64 = 0.02;
const KNOWN_SCALE: f64 = 0.01;
const KNOWN_LENS: f64 = 0.05;

/// All numbers as if each had been seen once, three by three, each three in a segment of their own that no observation has.
fn known(start: &AlignmentStart, unknowns: &AlignmentUnknowns, dip_sigma: f64) -> Vec<ResidualRow> {
    let turn = log(unknowns.camera_from_imu * start.camera_from_imu.inverse());
    let [focal, right, down, bend, dip] = unknowns.lens;
    let (rotation, bias, scale, lens) = (place::ROTATION, place::BIAS, place::SCALE, place::LENS);
    let single = [unknowns.offset_s - start.offset_s, unknowns.readout_s, dip];
    let of_single = [KNOWN_SIGMA, KNOWN_READOUT_S, dip_sigma.max(1e-6)];
    [
        ([rotation, rotation + 1, rotation + 2], turn.to_array(), [KNOWN_SIGMA; 3]),
        ([place::OFFSET, place::READOUT, place::DIP], single, of_single),
        ([bias, bias + 1, bias + 2], (unknowns.bias - start.bias).to_array(), [KNOWN_BIAS; 3]),
        ([scale, scale + 1, scale + 2], unknowns.scale.to_array(), [KNOWN_SCALE; 3]),
        ([lens, lens + 1, lens + 2], [focal, right, down], [KNOWN_LENS; 3]),
        ([lens + 3; 3], [bend, 0.0, 0.0], [KNOWN_LENS, f64::INFINITY, f64::INFINITY]),
    ]
    .into_iter()
    .enumerate()
    .map(|(number, (places, off, sigma))| {
        let mut jacobian = Jacobian::zeros();
        for i in 0..3 {
            jacobian[(i, places[i])] += KNOWN_SIGMA / sigma[i];
        }
        ResidualRow {
            time: f64::MIN,
            kind: ResidualKind::Known,
            index: number,
            residual: Vector3::from_fn(|i, _| off[i] * KNOWN_SIGMA / sigma[i]),
            jacobian,
            speed: Vector3::zeros(),
            blind: None,
            sigma: KNOWN_SIGMA,
            common: 0.0,
            weight: 1.0,
            segment: usize::MAX - number,
        }
    })
    .collect()
}

/// Of each observation and level.
#[derive(Clone, Debug, Default)]
pub(super) struct Weights {
    pub observations: Vec<f64>,
    pub levels: Vec<f64>,
}

impl Weights {
    /// One row's own.
    pub(super) fn set(&mut self, row: &ResidualRow, weight: f64) {
        let (list, index) = match row.kind {
            ResidualKind::Level => (&mut self.levels, row.index),
            ResidualKind::Orientation | ResidualKind::Up => (&mut self.observations, row.index),
            ResidualKind::Known => return,
        };
        if list.len() <= index {
            list.resize(index + 1, 1.0);
        }
        list[index] = weight;
    }
}

/// Derivatives that all residuals share: how the prediction `reference_from_imu` turns with the gyro's errors and time.
fn by_gyro(state: &TrackState, anchor: DQuat, jacobian: &mut Jacobian) -> Vector3<f64> {
    let turned = DMat3::from_quat(anchor);
    jacobian.fixed_columns_mut::<3>(place::BIAS).copy_from(&matrix(turned * state.by_bias));
    jacobian.fixed_columns_mut::<3>(place::SCALE).copy_from(&-matrix(turned * state.by_scale));
    -vector(anchor * (state.start_from_imu * state.rate))
}

/// Two directions across `up`.
fn across(up: DVec3) -> (Vector3<f64>, Vector3<f64>) {
    let a = up.any_orthonormal_vector();
    (vector(a), vector(up.cross(a)))
}

/// A residual about the directions across `up` only.
fn flatten(row: &mut ResidualRow, up: DVec3) {
    let blind = vector(up);
    let keep = nalgebra::Matrix3::identity() - blind * blind.transpose();
    row.residual = keep * row.residual;
    row.jacobian = keep * row.jacobian;
    row.speed = keep * row.speed;
    let (a, b) = across(up);
    row.jacobian.set_column(place::UP, &a);
    row.jacobian.set_column(place::UP + 1, &b);
    row.blind = Some(blind);
}

/// A row without its residual, with the derivatives that all share.
fn begun(
    time: f64,
    index: usize,
    state: &TrackState,
    (anchor, segment): (DQuat, usize),
    weight: f64,
) -> ResidualRow {
    let mut jacobian = Jacobian::zeros();
    let speed = by_gyro(state, anchor, &mut jacobian);
    ResidualRow {
        time,
        kind: ResidualKind::Level,
        index,
        residual: Vector3::zeros(),
        jacobian,
        speed,
        blind: None,
        sigma: LEVEL_SIGMA,
        common: 0.0,
        weight,
        segment,
    }
}

/// The row of an observation of the camera.
fn observed(
    mut row: ResidualRow,
    o: &Observation,
    sight: Option<&BySight>,
    unknowns: &AlignmentUnknowns,
    state: &TrackState,
    anchor: DQuat,
) -> ResidualRow {
    let predicted = anchor * state.start_from_imu * unknowns.camera_from_imu.inverse();
    let by_turn = matrix(DMat3::from_quat(predicted));
    row.jacobian.fixed_columns_mut::<3>(place::ROTATION).copy_from(&by_turn);
    row.jacobian.set_column(place::OFFSET, &row.speed);
    row.sigma = o.sigma();
    // What the camera shows, as it would be with the lens and the read-out that are tried.
    let mut as_seen = DQuat::IDENTITY;
    if let Some(sight) = sight {
        let all = sight.lens.iter().zip(unknowns.lens);
        as_seen =
            exp(sight.readout * unknowns.readout_s + all.clone().map(|(by, much)| *by * much).sum::<DVec3>());
        row.jacobian.set_column(place::READOUT, &-vector(predicted * sight.readout));
        for (i, (by, _)) in all.enumerate() {
            row.jacobian.set_column(place::LENS + i, &-vector(predicted * *by));
        }
    } else {
        row.jacobian.set_column(place::READOUT, &(row.speed * o.row()));
    }
    match o {
        Observation::Orientation { reference_from_camera, .. } => {
            row.kind = ResidualKind::Orientation;
            let seen = *reference_from_camera * as_seen.inverse();
            row.residual = vector(log(seen * predicted.inverse()));
        }
        Observation::Up { up_in_camera, .. } => {
            row.kind = ResidualKind::Up;
            row.residual = vector(arc(predicted * (as_seen * *up_in_camera), unknowns.up));
            flatten(&mut row, unknowns.up);
            // A longer lens makes all angles smaller, noise and all: what is left is counted in pixels, or the longest lens would fit best.
            let grown = 1.0 + unknowns.lens[0];
            row.residual *= grown;
            row.jacobian *= grown;
            row.speed *= grown;
        }
    }
    row
}

/// The row of a level: where up is in the unit's axes.
fn levelled(
    mut row: ResidualRow,
    up: DVec3,
    unknowns: &AlignmentUnknowns,
    state: &TrackState,
    anchor: DQuat,
) -> ResidualRow {
    row.residual = vector(arc(anchor * (state.start_from_imu * up), unknowns.up));
    flatten(&mut row, unknowns.up);
    row
}

/// Rotation vector of the shortest way from one unit vector to another.
fn arc(from: DVec3, to: DVec3) -> DVec3 {
    let cross = from.cross(to);
    let sin = cross.length();
    if sin < 1e-12 { cross } else { cross * (sin.atan2(from.dot(to)) / sin) }
}

/// The rotation with the least sum of angles to all (Weiszfeld's iteration on rotations; Hartley, Aftab & Trumpf 2011), which a
/// minority of wild ones does not move.
fn median(all: &[DQuat]) -> DQuat {
    let spread = |q: DQuat| all.iter().map(|o| log(*o * q.inverse()).length()).sum::<f64>();
    let stride = (all.len() / 15).max(1);
    let best = all.iter().step_by(stride).min_by(|a, b| spread(**a).total_cmp(&spread(**b)));
    let mut q = best.copied().unwrap_or(DQuat::IDENTITY);
    for _ in 0..12 {
        let (sum, weight) = all.iter().fold((DVec3::ZERO, 0.0), |(s, n), o| {
            let off = log(*o * q.inverse());
            let w = 1.0 / off.length().max(1e-4);
            (s + off * w, n + w)
        });
        q = (exp(sum / weight) * q).normalize();
    }
    q
}

impl AlignmentUnknowns {
    /// The unknowns after a step of the parameters.
    pub(super) fn plus(&self, step: &UnknownsStep) -> Self {
        let three = |i: usize| DVec3::new(step[i], step[i + 1], step[i + 2]);
        let (a, b) = across(self.up);
        let tilt = dvec(&(a * step[place::UP] + b * step[place::UP + 1]));
        Self {
            camera_from_imu: (exp(three(place::ROTATION)) * self.camera_from_imu).normalize(),
            offset_s: self.offset_s + step[place::OFFSET],
            bias: self.bias + three(place::BIAS),
            readout_s: self.readout_s + step[place::READOUT],
            scale: self.scale + three(place::SCALE),
            lens: std::array::from_fn(|i| self.lens[i] + step[place::LENS + i]),
            // A residual takes the prediction to `up`: its growth by a turn of up is that turn.
            up: (exp(tilt) * self.up).normalize(),
            anchors: self.anchors.clone(),
        }
    }

    /// Turns each segment's reference by what is left of its residuals in the (weighted) mean, so that they stay small.
    pub(super) fn settle(&mut self, rows: &[ResidualRow]) {
        let mut sums: BTreeMap<usize, (Vector3<f64>, f64)> = BTreeMap::new();
        for row in rows.iter().filter(|r| r.kind.is_seen()) {
            let (sum, weight) = sums.entry(row.segment).or_insert((Vector3::zeros(), 0.0));
            // Residuals of half a turn are outliers that were not yet found out.
            let w = row.weight / row.residual.norm().max(0.05);
            *sum += row.residual * w;
            *weight += w;
        }
        for (number, anchor) in self.anchors.values_mut().enumerate() {
            if let Some((sum, weight)) = sums.get(&number) {
                *anchor = (exp(dvec(&(sum / *weight))) * *anchor).normalize();
            }
        }
    }
}
