//! Pictures that are read row by row: what they show is put where a picture read at once, in the middle of the read-out, would show it.
//!
//! Each corner of a board and each end of a horizon was seen by a camera that stood as the gyro has it at its row's time. A board is near, so
//! that a camera in the hand moves past it as well; how fast follows from its poses in the pictures before and after. How long the read-out
//! takes is told by the boards' shape: corners in their places leave least (Hedborg et al. 2012 bend a whole reconstruction by it).

use std::collections::BTreeMap;

use bowwave_core::{geometry::Lens, time::Time};
use glam::{DQuat, DVec3};

use crate::{
    alignment::{BySight, ImuReading, Observation},
    capture::row,
    lens::{BoardPose, BoardView, Corner},
    sight::{ChangedLenses, of_board},
    solve::so3::exp,
    target::{OFF_MOST_PX, Oriented, SHEARED_MOST_PX, orient},
};

/// Observations with the known alignment of camera and unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RollingMeasurements<'a> {
    pub lens: Lens,
    /// Of the horizon, radians.
    pub dip: f64,
    pub readings: &'a [ImuReading],
    pub observations: &'a [Observation],
    /// Corners, by the observation's number.
    pub boards: &'a [(usize, Vec<Corner>)],
    pub camera_from_imu: DQuat,
    pub offset_s: f64,
    pub bias: DVec3,
}

/// The same with the rates in order of time.
#[derive(Clone, Debug)]
pub(crate) struct RollingShutter<'a> {
    seen: RollingMeasurements<'a>,
    /// Times and rates of the camera, its own axes, rad/s.
    rates: Vec<(Time, DVec3)>,
}

/// How the camera turns while a picture is read, its own axes.
#[derive(Clone, Copy, Debug)]
struct Turning {
    /// Rate at the middle row, rad/s.
    rate: DVec3,
    /// How that changes, rad/s^2: a hand that begins to turn changes it by a tenth within a long read-out.
    spin: DVec3,
}

impl Turning {
    /// From the camera's axes so many seconds after the middle row to those of the middle row.
    fn until(&self, seconds: f64) -> DQuat {
        exp((self.rate + self.spin * (0.5 * seconds)) * seconds)
    }
}

/// A board as if its picture had been read at once.
struct FlatBoard {
    /// Of the observation.
    number: usize,
    corners: Vec<Corner>,
    pose: BoardPose,
    /// How fast the camera turned, its own axes, rad/s, and how fast the board moved past beside that, m/s.
    rate: DVec3,
    past: DVec3,
}

/// Corrected boards by number and round.
type CorrectedBoards = BTreeMap<(usize, usize), Option<Oriented>>;

impl<'a> RollingShutter<'a> {
    pub(crate) fn new(seen: RollingMeasurements<'a>) -> Self {
        let camera = |r: &ImuReading| (r.time, seen.camera_from_imu * (r.rate - seen.bias));
        let mut rates: Vec<(Time, DVec3)> =
            seen.readings.iter().filter(|r| r.rate.is_finite()).map(camera).collect();
        rates.sort_by_key(|r| r.0);
        Self { seen, rates }
    }

    /// How the camera turns while a picture of that stamp is read: a line through the rates; `None` beyond the readings.
    fn turning(&self, stamp: Time, readout_s: f64) -> Option<Turning> {
        /// Readings so far before and after the read-out count as well, seconds.
        const BESIDE_S: f64 = 6e-3;
        let middle = stamp.plus_secs(self.seen.offset_s);
        let reach = 0.5 * readout_s.abs() + BESIDE_S;
        let first = self.rates.partition_point(|r| r.0 < middle.plus_secs(-reach));
        let last = self.rates.partition_point(|r| r.0 <= middle.plus_secs(reach));
        let around = self.rates.get(first..last)?;
        let count = around.len() as f64;
        let seconds = |r: &(Time, DVec3)| r.0.secs_since(middle);
        let (sum, mean) =
            around.iter().fold((0.0, DVec3::ZERO), |(t, m), r| (t + seconds(r), m + r.1 / count));
        let centre = sum / count;
        let (spread, along) = around.iter().fold((0.0, DVec3::ZERO), |(s, a), r| {
            let off = seconds(r) - centre;
            (s + off * off, a + (r.1 - mean) * off)
        });
        let spin = along / spread;
        (around.len() > 2 && spin.is_finite()).then(|| Turning { rate: mean - spin * centre, spin })
    }

    /// All observations as if each picture had been read at once. What the gyro was not there for stays as it is.
    pub(crate) fn straightened(&self, readout_s: f64) -> Vec<Observation> {
        let mut out: Vec<Observation> =
            self.seen.observations.iter().map(|o| self.horizon(o, readout_s).unwrap_or(*o)).collect();
        for (number, found) in self.boards(readout_s, 1, OFF_MOST_PX) {
            if let Some(Observation::Orientation { reference_from_camera, sigma, row, .. }) =
                out.get_mut(number)
            {
                *reference_from_camera = found.pose.camera_from_board.inverse();
                (*sigma, *row) = (found.sigma, 0.0);
            }
        }
        out
    }

    /// The horizon through its two ends, each turned to the middle row's time.
    fn horizon(&self, observation: &Observation, readout_s: f64) -> Option<Observation> {
        /// How far from the picture's middle the horizon's ends are taken, share of its width.
        const END: f64 = 0.4;
        let Observation::Up { stamp, up_in_camera: up, sigma, .. } = *observation else { return None };
        let still = self.seen.lens;
        let turning = self.turning(stamp, readout_s)?;
        let (sin, cos) = self.seen.dip.sin_cos();
        let ahead = (DVec3::Z - up * up.z).try_normalize()?;
        let half = (END * f64::from(still.width) / still.focal.x).atan();
        let end = |by: f64| -> Option<DVec3> {
            let pixel = still.project((DQuat::from_axis_angle(up, by) * ahead) * cos - up * sin)?;
            Some(turning.until(row(&still, pixel) * readout_s) * still.unproject(pixel))
        };
        let (a, b) = (end(half)?, end(-half)?);
        let up_in_camera = plane(a, b, self.seen.dip, up)?;
        Some(Observation::Up { stamp, up_in_camera, sigma, row: 0.0 })
    }

    /// Poses of every `stride`-th board as if each picture had been read at once, by the observation's number.
    fn boards(&self, readout_s: f64, stride: usize, most_px: f64) -> Vec<(usize, Oriented)> {
        /// Sweeps over the boards: each puts how fast they go past right, which a picture that is not straight shows wrong.
        const SWEEPS: usize = 3;
        let mut made = CorrectedBoards::new();
        let one = |i: usize| Some((self.seen.boards.get(i)?.0, self.board(i, readout_s, SWEEPS, &mut made)?));
        let all = (0..self.seen.boards.len()).step_by(stride.max(1)).filter_map(one);
        all.filter(|(_, found)| found.squares < most_px * most_px * found.freedom).collect()
    }

    /// One of them after so many sweeps: how fast it goes past is told by those beside it, after one sweep less.
    fn board(&self, i: usize, readout_s: f64, sweeps: usize, made: &mut CorrectedBoards) -> Option<Oriented> {
        if let Some(known) = made.get(&(i, sweeps)) {
            return *known;
        }
        let found = self.board_anew(i, readout_s, sweeps, made);
        made.insert((i, sweeps), found);
        found
    }

    fn board_anew(
        &self,
        i: usize,
        readout_s: f64,
        sweeps: usize,
        made: &mut CorrectedBoards,
    ) -> Option<Oriented> {
        let (number, corners) = self.seen.boards.get(i)?;
        let Some(before) = sweeps.checked_sub(1) else {
            return orient(&self.seen.lens, corners, SHEARED_MOST_PX);
        };
        let stamp = |i: usize| Some(self.seen.observations.get(self.seen.boards.get(i)?.0)?.stamp());
        let turning = self.turning(self.seen.observations.get(*number)?.stamp(), readout_s)?;
        let pose = self.board(i, readout_s, before, made)?.pose;
        let mut place = |i: usize| Some((stamp(i)?, self.board(i, readout_s, before, made)?.pose.place));
        let around = [i.checked_sub(1).and_then(&mut place), place(i + 1)];
        let past = past(turning.rate, pose.place, stamp(i)?, around);
        let straight = self.straight(corners, readout_s, &pose, &turning, past);
        orient(&self.seen.lens, &straight, SHEARED_MOST_PX)
    }

    /// Corners where a picture read at once would show them.
    fn straight(
        &self,
        corners: &[Corner],
        readout_s: f64,
        pose: &BoardPose,
        turning: &Turning,
        past: DVec3,
    ) -> Vec<Corner> {
        let still = self.seen.lens;
        let straight = |corner: &Corner| {
            let far = (pose.camera_from_board * corner.board.extend(0.0) + pose.place).length();
            let late_s = row(&still, corner.pixel) * readout_s;
            let at = turning.until(late_s) * still.unproject(corner.pixel) * far - past * late_s;
            Some(Corner { pixel: still.project(at)?, ..*corner })
        };
        corners.iter().filter_map(straight).collect()
    }

    /// How each observation turns with the lens, the read-out and the dip; `None` where that cannot be told, or where a board was sheared by so
    /// much that it cannot be put straight to the last tenth of a pixel.
    /// `ups` are where up is expected.
    pub(crate) fn by_sight(&self, readout_s: f64, ups: &[Option<DVec3>]) -> Vec<Option<BySight>> {
        let lenses = ChangedLenses::of(&self.seen.lens);
        let of_horizon = |(i, observation): (usize, &Observation)| {
            let Observation::Up { stamp, up_in_camera, .. } = *observation else { return None };
            let up = ups.get(i).copied().flatten().unwrap_or(up_in_camera).try_normalize()?;
            let turning = self.turning(stamp, readout_s);
            let turned = |row: f64, s: f64| turning.as_ref().map_or(DQuat::IDENTITY, |t| t.until(row * s));
            lenses.of_horizon(up, self.seen.dip, readout_s, turned)
        };
        let mut out: Vec<Option<BySight>> =
            self.seen.observations.iter().enumerate().map(of_horizon).collect();
        for FlatBoard { number, corners, pose, rate, past } in self.flat_boards(readout_s) {
            if let Some(by) = out.get_mut(number) {
                *by = of_board(&self.seen.lens, &corners, &pose, rate, past);
            }
        }
        out
    }

    /// Corners of every board as if each picture had been read at once, for the solver of the lens.
    pub(crate) fn straight_boards(&self, readout_s: f64) -> Vec<BoardView> {
        let view = |board: FlatBoard| BoardView { corners: board.corners };
        self.flat_boards(readout_s).into_iter().map(view).collect()
    }

    fn flat_boards(&self, readout_s: f64) -> Vec<FlatBoard> {
        /// Corners of the picture's edge that move by more than this while it is read cannot be put straight to tenths of a pixel, pixels.
        const SHEAR_MOST_PX: f64 = 1.0;
        let shear = |rate: DVec3| 0.5 * rate.length() * readout_s.abs() * self.seen.lens.focal.x;
        let all = self.boards(readout_s, 1, OFF_MOST_PX);
        let corners: BTreeMap<usize, &Vec<Corner>> = self.seen.boards.iter().map(|b| (b.0, &b.1)).collect();
        let stamp = |number: usize| Some(self.seen.observations.get(number)?.stamp());
        let place = |i: usize| {
            let (number, found) = all.get(i)?;
            Some((stamp(*number)?, found.pose.place))
        };
        let one = |i: usize| {
            let (number, Oriented { pose, .. }) = *all.get(i)?;
            let turning =
                self.turning(stamp(number)?, readout_s).filter(|t| shear(t.rate) < SHEAR_MOST_PX)?;
            let around = [i.checked_sub(1).and_then(place), place(i + 1)];
            let past = past(turning.rate, pose.place, stamp(number)?, around);
            let corners = self.straight(corners.get(&number)?, readout_s, &pose, &turning, past);
            Some(FlatBoard { number, corners, pose, rate: turning.rate, past })
        };
        (0..all.len()).filter_map(one).collect()
    }

    /// The read-out that leaves least of the boards' corners, and its standard deviation, seconds; `None` where it is not to be told from
    /// nothing, or not told well.
    pub(crate) fn readout(&self) -> Option<(f64, f64)> {
        /// Boards that are asked for the read-out: enough to tell it to some hundredths of a millisecond.
        const ASKED: usize = 150;
        /// Between the read-outs that are tried first, seconds, and the longest that is believed.
        const TRIED_S: f64 = 0.01;
        const LONGEST_S: f64 = 0.05;
        /// Fewer numbers than that tell none.
        const FREEDOM_LEAST: f64 = 400.0;
        /// A read-out counts from so many standard deviations and so many seconds on; known to less than this it is not known.
        const CERTAIN: f64 = 5.0;
        const LEAST_S: f64 = 0.5e-3;
        const SIGMA_MOST_S: f64 = 2e-3;
        /// Corners tell more than their model deserves: speeds are lines between pictures.
        const SIGMA_LEAST_S: f64 = 0.2e-3;
        let stride = (self.seen.boards.len() / ASKED).max(1);
        let left = |seconds: f64| {
            let (squares, freedom) = self.left(seconds, stride);
            (squares / freedom.max(1.0), freedom)
        };
        let count = (LONGEST_S / TRIED_S) as i32;
        let tried = (-count..=count).map(|i| f64::from(i) * TRIED_S);
        let mut at = tried.min_by(|a, b| left(*a).0.total_cmp(&left(*b).0))?;
        let mut sigma = f64::INFINITY;
        for step in [0.5 * TRIED_S, 0.2 * TRIED_S, 0.1 * TRIED_S] {
            let (low, (middle, freedom), high) = (left(at - step), left(at), left(at + step));
            let bend = (low.0 - 2.0 * middle + high.0) / (step * step);
            if bend <= 0.0 || freedom < FREEDOM_LEAST {
                return None;
            }
            at -= ((high.0 - low.0) / (2.0 * step * bend)).clamp(-step, step);
            // Chi-squared grows by one where the mean square grows by its share of one number.
            sigma = (2.0 * middle / (freedom * bend)).sqrt();
        }
        let known = sigma < SIGMA_MOST_S && at.abs() < LONGEST_S;
        (known && at.abs() > CERTAIN * sigma && at.abs() > LEAST_S).then_some((at, sigma.max(SIGMA_LEAST_S)))
    }

    /// Sum of squares of what is left of the corners, pixels, and how many numbers are left for it.
    fn left(&self, readout_s: f64, stride: usize) -> (f64, f64) {
        let all = self.boards(readout_s, stride, SHEARED_MOST_PX);
        all.iter().fold((0.0, 0.0), |(s, n), (_, o)| (s + o.squares, n + o.freedom))
    }
}

/// Up of a horizon that goes through two directions, on the side of `up`; both lie below the horizontal by the `dip`.
fn plane(a: DVec3, b: DVec3, dip: f64, up: DVec3) -> Option<DVec3> {
    let (across, middle) = (a.cross(b).try_normalize()?, (a + b).try_normalize()?);
    let across = if across.dot(up) < 0.0 { -across } else { across };
    let down = -dip.sin() / middle.dot(a);
    Some(across * (1.0 - down * down).max(0.0).sqrt() + middle * down)
}

/// How fast a board at `place` moves past the camera beyond what its turn makes, camera's axes, m/s: by its places in the pictures before and
/// after; nothing where these are too far off.
fn past(turn: DVec3, place: DVec3, stamp: Time, around: [Option<(Time, DVec3)>; 2]) -> DVec3 {
    /// Pictures farther apart do not tell how fast the camera moves past the board, seconds.
    const APART_MOST_S: f64 = 0.15;
    let near = around.map(|b| b.filter(|b| b.0.secs_since(stamp).abs() < APART_MOST_S));
    let (from, to) = (near[0].unwrap_or((stamp, place)), near[1].unwrap_or((stamp, place)));
    let span = to.0.secs_since(from.0);
    if span < 1e-4 { DVec3::ZERO } else { (to.1 - from.1) / span + turn.cross(place) }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::{
        lens::BoardPose,
        simulated::{Motion, Random, Recipe},
        solve::so3::log,
        target::Target,
    };

    fn recipe(readout_s: f64) -> Recipe {
        Recipe { seconds: 8.0, readout_s, ..Recipe::minute(Motion::ByHand, 1e-3, 0.0, 4) }
    }

    /// The board in the camera's space at some instants: the camera turns and goes round it.
    fn poses(recipe: &Recipe, seconds: &[f64]) -> Vec<BoardPose> {
        let world_from_board = DQuat::from_rotation_x(0.5 * std::f64::consts::PI);
        let middle = (Target::A4.size_m() / 2.0).extend(0.0);
        let pose = |(world_from_camera, _): &(DQuat, DVec3)| {
            let camera_from_world = world_from_camera.inverse();
            let camera = (DVec3::Y - *world_from_camera * DVec3::Z) * 0.3;
            let camera_from_board = camera_from_world * world_from_board;
            BoardPose {
                camera_from_board,
                place: camera_from_world * (DVec3::Y * 0.45 - camera) - camera_from_board * middle,
            }
        };
        recipe.poses(seconds).iter().map(pose).collect()
    }

    /// Corners of a board of a picture at `seconds`, each where its own row sees it, off by a twentieth of a pixel.
    fn corners(recipe: &Recipe, lens: &Lens, seconds: f64, random: &mut Random) -> Vec<Corner> {
        let all = (0..Target::A4.tags()).flat_map(|id| Target::A4.corners(id));
        let seen = |board: DVec2| {
            let mut pixel = DVec2::new(0.0, f64::from(lens.height) / 2.0);
            for _ in 0..6 {
                let pose = poses(recipe, &[seconds + row(lens, pixel) * recipe.readout_s])[0];
                pixel = lens.project(pose.camera_from_board * board.extend(0.0) + pose.place)?;
            }
            let inside = (0.0..f64::from(lens.width)).contains(&pixel.x)
                && (0.0..f64::from(lens.height)).contains(&pixel.y);
            inside.then(|| Corner { board, pixel: pixel + DVec2::new(random.gauss(), random.gauss()) * 0.05 })
        };
        all.step_by(5).filter_map(seen).collect()
    }

    struct MadeBoards {
        recipe: Recipe,
        readings: Vec<ImuReading>,
        observations: Vec<Observation>,
        boards: Vec<(usize, Vec<Corner>)>,
        truth: Vec<DQuat>,
    }

    fn made(readout_s: f64) -> MadeBoards {
        let (recipe, mut random) = (recipe(readout_s), Random::new(8));
        let lens = Lens::pinhole(1280, 720, 1.2);
        let (mut observations, mut boards, mut truth) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..180 {
            let at = 0.7 + f64::from(i) / 30.0;
            let corners = corners(&recipe, &lens, at, &mut random);
            let Some(found) = orient(&lens, &corners, SHEARED_MOST_PX) else { continue };
            boards.push((observations.len(), corners));
            observations.push(Observation::Orientation {
                stamp: Recipe::EPOCH.plus_secs(at - recipe.offset_s),
                reference_from_camera: found.pose.camera_from_board.inverse(),
                sigma: found.sigma,
                row: 0.0,
                chain: 0,
            });
            truth.push(poses(&recipe, &[at])[0].camera_from_board.inverse());
        }
        MadeBoards { recipe, readings: recipe.record().readings, observations, boards, truth }
    }

    impl MadeBoards {
        fn rows(&self) -> RollingShutter<'_> {
            RollingShutter::new(RollingMeasurements {
                lens: Lens::pinhole(1280, 720, 1.2),
                dip: 1e-3,
                readings: &self.readings,
                observations: &self.observations,
                boards: &self.boards,
                camera_from_imu: self.recipe.camera_from_imu,
                offset_s: self.recipe.offset_s,
                bias: self.recipe.gyro_bias,
            })
        }

        /// Root mean square of the orientations' errors, radians.
        fn off(&self, observations: &[Observation]) -> f64 {
            let error = |(o, truth): (&Observation, &DQuat)| match o {
                Observation::Orientation { reference_from_camera, .. } => {
                    log(*reference_from_camera * truth.inverse()).length_squared()
                }
                Observation::Up { .. } => 0.0,
            };
            let sum: f64 = observations.iter().zip(&self.truth).map(error).sum();
            (sum / self.truth.len() as f64).sqrt()
        }
    }

    #[test]
    fn boards_are_straightened_and_tell_how_long_a_picture_is_read() {
        for readout_s in [0.01, 0.03, -0.02] {
            let made = made(readout_s);
            assert!(made.boards.len() > 120, "{}", made.boards.len());
            let (found, sigma) = made.rows().readout().unwrap();
            assert!(
                (found - readout_s).abs() < 2.0 * sigma && sigma < 0.5e-3,
                "{found} +- {sigma}, {readout_s}"
            );
            let (before, after) =
                (made.off(&made.observations), made.off(&made.rows().straightened(readout_s)));
            assert!(after < 1.2e-3 && before > 5.0 * after, "{before} {after} at {readout_s}");
        }
        assert_eq!(made(0.0).rows().readout(), None);
    }

    #[test]
    fn a_horizon_that_spans_rows_is_straightened() {
        let lens = Lens::pinhole(1280, 720, 1.2);
        let (recipe, dip, readout_s) = (recipe(0.0), 2e-3f64, 0.03);
        let readings = recipe.record().readings;
        let mut compared = 0;
        for at in (0..60).map(|i| 0.8 + 0.1 * f64::from(i)) {
            let (world_from_camera, rate) = recipe.poses(&[at])[0];
            let up = world_from_camera.inverse() * DVec3::Z;
            let rolling = lens.read_while(rate * readout_s);
            // What a line through both ends of the rolling picture would be taken for.
            let ahead = (DVec3::Z - up * up.z).normalize();
            let ends = [0.5, -0.5].map(|by: f64| {
                let on = (DQuat::from_axis_angle(up, by) * ahead) * dip.cos() - up * dip.sin();
                rolling.project(on).unwrap()
            });
            if ends.iter().any(|end| !(0.0..720.0).contains(&end.y)) {
                continue;
            }
            let ends = ends.map(|end| lens.unproject(end));
            let seen = plane(ends[0], ends[1], dip, up).unwrap();
            let observation = Observation::Up {
                stamp: Recipe::EPOCH.plus_secs(at - recipe.offset_s),
                up_in_camera: seen,
                sigma: 1e-3,
                row: 0.1,
            };
            let observations = [observation];
            let rows = RollingShutter::new(RollingMeasurements {
                lens,
                dip,
                readings: &readings,
                observations: &observations,
                boards: &[],
                camera_from_imu: recipe.camera_from_imu,
                offset_s: recipe.offset_s,
                bias: recipe.gyro_bias,
            });
            let [Observation::Up { up_in_camera, row, .. }] = rows.straightened(readout_s)[..] else {
                panic!()
            };
            let (before, after) = (seen.angle_between(up), up_in_camera.angle_between(up));
            assert!(row == 0.0 && after < 1.5e-3 && after < 0.5 * before + 5e-4, "{before} {after} at {at}");
            assert_eq!(rows.readout(), None);
            compared += 1;
        }
        assert!(compared > 15, "{compared}");
    }
}
