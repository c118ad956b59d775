//! Rotation, time offset, bias, lens and read-out time at once, from clouds that keep their directions in the world.
//!
//! Each cloud's direction is the mean of where the gyro's path and the lens put it (its own unknown, eliminated); what is left is by how
//! many pixels it was seen elsewhere. Gauss and Newton with Huber's weights; the covariance is that of groups (Liang & Zeger 1986), a
//! cloud being a group, because a cloud that changes its shape errs the same way in all of its pictures; and so is a second, in which all
//! clouds share what the gyro errs by.

use std::collections::BTreeMap;

use bowwave_core::{
    event::ImuSample,
    geometry::{Distortion, Lens},
    time::{NS_PER_S, Time},
};
use bowwave_import::gyro::GyroPath;
use glam::{DQuat, DVec2, DVec3};
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

use super::clip::CloudTrack;

/// Rotation (3), offset, bias (3), logarithm of the focal length, k1, k2, read-out time, growth of the bias (3).
pub const UNKNOWNS: usize = 14;
/// Places among them.
pub const OFFSET: usize = 3;
const BIAS: usize = 4;
/// Of the logarithm of the focal length.
pub const FOCAL: usize = 7;
/// Of k1; k2 comes next.
pub const RADIAL: usize = 8;
/// Of the read-out time.
pub const READOUT: usize = 10;
const GROWTH: usize = 11;

/// What is assumed of each before anything is seen, standard deviations: axes within 3 degrees, clocks within half a second, 3 deg/s, a
/// third of the focal length, any usual lens, a read-out within 20 ms of the one begun with, a bias that grows by .05 deg/s in ten seconds.
const ASSUMED: [f64; UNKNOWNS] =
    [0.05, 0.05, 0.05, 0.5, 0.05, 0.05, 0.05, 0.3, 0.3, 0.2, 0.02, 1e-4, 1e-4, 1e-4];

type KarmaVector = SVector<f64, UNKNOWNS>;
type KarmaMatrix = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// Unknowns of the fit.
#[derive(Clone, Copy, Debug)]
pub struct KarmaUnknowns {
    /// Rotation from the unit's axes to the camera's.
    pub camera_from_imu: DQuat,
    /// Added to a picture's time for the unit's time of its middle row, seconds.
    pub offset_s: f64,
    /// Gyro bias at the first sample, rad/s.
    pub bias: DVec3,
    /// Its growth, rad/s^2.
    pub growth: DVec3,
    /// The lens.
    pub lens: Lens,
    /// From the first row to the last, seconds.
    pub readout_s: f64,
}

impl KarmaUnknowns {
    /// The lens's k1 and k2.
    pub fn radial(&self) -> DVec2 {
        match self.lens.distortion {
            Distortion::RadialTangential(d) => d.radial(),
            _ => DVec2::ZERO,
        }
    }

    fn plus(&self, step: &KarmaVector) -> Self {
        let three = |i: usize| DVec3::new(step[i], step[i + 1], step[i + 2]);
        let lens = Lens {
            focal: self.lens.focal * step[FOCAL].exp(),
            distortion: Distortion::radial_tangential(
                self.radial() + DVec2::new(step[RADIAL], step[RADIAL + 1]),
                DVec2::ZERO,
            ),
            ..self.lens
        };
        Self {
            camera_from_imu: (DQuat::from_scaled_axis(three(0)) * self.camera_from_imu).normalize(),
            offset_s: self.offset_s + step[OFFSET],
            bias: self.bias + three(BIAS),
            growth: self.growth + three(GROWTH),
            lens,
            readout_s: self.readout_s + step[READOUT],
        }
    }
}

/// Result of the fit.
#[derive(Clone, Debug)]
pub struct KarmaFit {
    /// The unknowns.
    pub at: KarmaUnknowns,
    /// Their covariance.
    pub covariance: KarmaMatrix,
    /// Root mean square of the residuals on an axis, pixels of the picture, outliers bounded.
    pub rms_px: f64,
}

impl KarmaFit {
    /// Standard deviation of an unknown.
    pub fn sigma(&self, unknown: usize) -> f64 {
        self.covariance[(unknown, unknown)].max(0.0).sqrt()
    }
}

/// Measurements of the fit.
pub struct KarmaMeasured<'a> {
    /// Time of each picture.
    pub times: &'a [Time],
    /// The gyro.
    pub samples: &'a [ImuSample],
    /// Clouds.
    pub tracks: Vec<&'a CloudTrack>,
}

/// Residuals beyond this pull no harder, pixels (Huber 1964).
const ROBUST_PX: f64 = 1.0;
const ITERATIONS: usize = 25;

impl KarmaMeasured<'_> {
    /// The orientation at which a place of picture `i` was exposed, and where in the world it looks.
    fn world(&self, at: &KarmaUnknowns, path: &GyroPath, i: usize, place: DVec2) -> Option<(DQuat, DVec3)> {
        let row = place.y / f64::from(at.lens.height) - 0.5;
        let time = self.times.get(i)?.plus_secs(at.offset_s + row * at.readout_s);
        let world_from_camera = path.world_from_imu(time) * at.camera_from_imu.inverse();
        Some((world_from_camera, world_from_camera * at.lens.unproject(place)))
    }

    /// By how much a cloud that stands in direction `world` was seen elsewhere, pixels, picture by picture.
    pub fn misses(
        &self,
        at: &KarmaUnknowns,
        path: &GyroPath,
        track: &CloudTrack,
        world: DVec3,
    ) -> Vec<DVec2> {
        let miss = |(i, place): &(usize, DVec2)| {
            let (world_from_camera, _) = self.world(at, path, *i, *place)?;
            Some(at.lens.project(world_from_camera.inverse() * world)? - *place)
        };
        let far = DVec2::splat(1e3);
        track.seen.iter().map(|s| miss(s).filter(|m| m.is_finite()).unwrap_or(far)).collect()
    }

    /// The mean direction of a cloud over its first `count` pictures.
    pub fn direction(&self, at: &KarmaUnknowns, path: &GyroPath, track: &CloudTrack, count: usize) -> DVec3 {
        let all = track.seen.iter().take(count).filter_map(|(i, place)| self.world(at, path, *i, *place));
        all.map(|(_, d)| d).sum::<DVec3>().normalize_or_zero()
    }

    /// The gyro's path with that bias.
    pub fn path(&self, at: &KarmaUnknowns) -> GyroPath {
        let first = self.samples.first().map_or(Time::MIN, |s| s.arrival);
        let grown =
            |s: &ImuSample| ImuSample { rate: s.rate - at.growth * s.arrival.secs_since(first), ..*s };
        GyroPath::integrate(&self.samples.iter().map(grown).collect::<Vec<_>>(), at.bias)
    }

    fn residuals(&self, at: &KarmaUnknowns) -> Vec<Vec<DVec2>> {
        let path = self.path(at);
        let of = |track: &&CloudTrack| {
            let mean = self.direction(at, &path, track, usize::MAX);
            self.misses(at, &path, track, mean)
        };
        self.tracks.iter().map(of).collect()
    }

    /// The unknowns that leave least, from `start`, which also stands for what is assumed.
    pub fn solve(&self, start: &KarmaUnknowns) -> Option<KarmaFit> {
        let assumed = KarmaMatrix::from_diagonal(&KarmaVector::from_fn(|i, _| ASSUMED[i].powi(-2)));
        let mut total = KarmaVector::zeros();
        let mut damping = 1e-3;
        let mut now = self.normal(start, &total, &assumed);
        for _ in 0..ITERATIONS {
            let mut better = None;
            for _ in 0..8 {
                let damped = now.matrix + KarmaMatrix::from_diagonal(&(now.matrix.diagonal() * damping));
                let step = -damped.try_inverse()? * now.gradient;
                let next = total + step;
                if self.cost(start, &next, &assumed) < now.cost {
                    better = Some((next, step));
                    break;
                }
                damping *= 10.0;
            }
            let Some((next, step)) = better else { break };
            total = next;
            damping = (damping * 0.1).max(1e-9);
            now = self.normal(start, &total, &assumed);
            if (0..UNKNOWNS).all(|i| step[i].abs() < 1e-4 * ASSUMED[i]) {
                break;
            }
        }
        let inverse = now.matrix.try_inverse()?;
        let covariance = inverse * (now.groups + assumed) * inverse;
        let rms_px = (now.squares / now.count.max(1.0)).sqrt();
        Some(KarmaFit { at: start.plus(&total), covariance, rms_px })
    }

    fn cost(&self, start: &KarmaUnknowns, total: &KarmaVector, assumed: &KarmaMatrix) -> f64 {
        let huber = |r: f64| if r < ROBUST_PX { r * r } else { ROBUST_PX * (2.0 * r - ROBUST_PX) };
        let seen: f64 = self.residuals(&start.plus(total)).iter().flatten().map(|r| huber(r.length())).sum();
        seen / SIGMA_PX.powi(2) + (total.transpose() * assumed * total)[(0, 0)]
    }

    fn normal(&self, start: &KarmaUnknowns, total: &KarmaVector, assumed: &KarmaMatrix) -> KarmaNormal {
        let step = KarmaVector::from_fn(|i, _| ASSUMED[i] * 1e-4);
        let side = |i: usize, sign: f64| {
            let mut moved = *total;
            moved[i] += sign * step[i];
            self.residuals(&start.plus(&moved))
        };
        let sides: Vec<_> = (0..UNKNOWNS).into_par_iter().map(|i| (side(i, 1.0), side(i, -1.0))).collect();
        let now = self.residuals(&start.plus(total));
        let mut out = KarmaNormal {
            matrix: *assumed,
            gradient: assumed * total,
            groups: KarmaMatrix::zeros(),
            cost: self.cost(start, total, assumed),
            squares: 0.0,
            count: 0.0,
        };
        let mut seconds: BTreeMap<i64, KarmaVector> = BTreeMap::new();
        for (t, residuals) in now.iter().enumerate() {
            let mut group = KarmaVector::zeros();
            for (s, r) in residuals.iter().enumerate() {
                let weight = ROBUST_PX / r.length().max(ROBUST_PX);
                let slope = |u: usize| (sides[u].0[t][s] - sides[u].1[t][s]) / (2.0 * step[u]);
                let slopes: [DVec2; UNKNOWNS] = std::array::from_fn(slope);
                for axis in 0..2 {
                    let j = KarmaVector::from_fn(|u, _| slopes[u][axis]) / SIGMA_PX;
                    out.matrix += j * j.transpose() * weight;
                    let pull = j * (r[axis] / SIGMA_PX * weight);
                    group += pull;
                    let time = self.tracks[t].seen.get(s).and_then(|(i, _)| self.times.get(*i));
                    let second = time.map_or(0, |time| time.ns() / NS_PER_S);
                    *seconds.entry(second).or_insert_with(KarmaVector::zeros) += pull;
                    out.squares += r[axis] * r[axis] * weight;
                    out.count += 1.0;
                }
            }
            out.groups += group * group.transpose();
            out.gradient += group;
        }
        for second in seconds.values() {
            out.groups += second * second.transpose();
        }
        out
    }
}

/// Assumed error of a sight, pixels: it weighs sights against the prior.
const SIGMA_PX: f64 = 0.5;

struct KarmaNormal {
    matrix: KarmaMatrix,
    gradient: KarmaVector,
    groups: KarmaMatrix,
    cost: f64,
    squares: f64,
    count: f64,
}
