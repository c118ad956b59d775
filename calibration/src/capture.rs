//! From what devices report to what the solvers take: readings on the host's clock, and what pictures tell of the camera's orientation.
//!
//! Without a target only the horizon is looked for; a board, where one is expected, by whoever can find it ([`FindBoard`]). Nothing is
//! predicted from a calibration: what is to be found must not guide the search.

use bowwave_core::{
    calibration::Calibration,
    estimate::{
        clock::ClockMap,
        horizon::{HorizonFinder, HorizonView, NoHorizon},
    },
    event::{CameraFrame, Event, ImuSample, Picture, TriggerEdge},
    geometry::{Lens, horizon_dip},
    own_ship::Mask,
    time::Time,
};
use glam::{DQuat, DVec2, DVec3};

use crate::{
    alignment::{
        self, Alignment, AlignmentError, BySight, Compared, Comparison, ImuReading, Observation, Options,
    },
    lens::{self, BoardView, Corner},
    rolling_shutter::{RollingMeasurements, RollingShutter},
};

/// Most readings and observations that are taken: half an hour at 1000 readings and 60 pictures a second.
const READINGS_MOST: usize = 1_800_000;
const OBSERVATIONS_MOST: usize = 108_000;

/// How long the camera reads a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Readout {
    /// Nobody has said.
    Unknown,
    /// Seconds from the first row to the last.
    Known(f64),
}

/// A board seen in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardSeen {
    /// Rotation from the camera's axes to the board's.
    pub board_from_camera: DQuat,
    /// Its standard deviation about each axis, radians.
    pub sigma: f64,
    /// Its middle, pixels.
    pub pixel: DVec2,
    /// Corners that were found.
    pub corners: Vec<Corner>,
}

/// Finds the board in a picture.
pub trait FindBoard {
    /// The board, or `None` where it is not to be seen well enough.
    fn find(&mut self, picture: &Picture, lens: &Lens) -> Option<BoardSeen>;
}

/// Where in the picture an observation was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// The picture's mid-exposure by the camera's stamp.
    pub stamp: Time,
    /// Where the horizon crosses the picture's middle, or the middle of the board, pixels.
    pub pixel: DVec2,
}

/// Counts of what was captured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CaptureCounts {
    /// Readings of the inertial unit.
    pub readings: usize,
    /// Pictures of the calibrated size.
    pub pictures: usize,
    /// Pictures of another size, which were left out.
    pub other_size: usize,
    /// Pictures with a horizon.
    pub horizons: usize,
    /// Pictures whose horizon, or what looked like it, was smeared by motion or fog.
    pub blurred: usize,
    /// Pictures with a board.
    pub boards: usize,
    /// Restarts of the unit's clock.
    pub restarts: u32,
}

/// The horizon seen in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HorizonSeen {
    /// Where up is, camera's axes.
    pub up_in_camera: DVec3,
    /// Its standard deviation about each axis, radians.
    pub sigma: f64,
    /// Where it crosses the picture's middle, pixels.
    pub pixel: DVec2,
}

/// Horizon and board found in one picture.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureSeen {
    /// The picture's mid-exposure by the camera's stamp.
    pub stamp: Time,
    /// Whether it has the calibrated size; nothing is looked for in others.
    pub fits: bool,
    /// The horizon.
    pub horizon: Option<HorizonSeen>,
    /// Whether the horizon, or what looked like it, was smeared by motion or fog.
    pub is_blurred: bool,
    /// The board.
    pub board: Option<BoardSeen>,
}

/// Looks for horizon and board in pictures. Holds none of them.
pub struct Watcher {
    lens: Lens,
    eye_height_m: f64,
    finder: HorizonFinder,
    board: Option<Box<dyn FindBoard + Send>>,
}

impl Watcher {
    /// Looks through that lens, `eye_height_m` above the sea.
    pub fn new(lens: Lens, eye_height_m: f64) -> Self {
        Self { lens, eye_height_m, finder: HorizonFinder::new(), board: None }
    }

    /// Looks for a board as well.
    #[must_use]
    pub fn with_board(mut self, board: Box<dyn FindBoard + Send>) -> Self {
        self.board = Some(board);
        self
    }

    /// Looks at nothing that the mask hides: the own ship.
    #[must_use]
    pub fn with_mask(mut self, mask: Option<Mask>) -> Self {
        self.finder.set_mask(mask);
        self
    }

    /// Horizon and board in a picture.
    pub fn look(&mut self, frame: &CameraFrame) -> PictureSeen {
        let (picture, lens) = (&frame.picture, &self.lens);
        let fits = (picture.width(), picture.height()) == (lens.width, lens.height);
        let mut seen =
            PictureSeen { stamp: frame.mid_exposure, fits, horizon: None, is_blurred: false, board: None };
        if !fits {
            return seen;
        }
        let view = HorizonView { lens: *lens, eye_height_m: self.eye_height_m, prior: None };
        match self.finder.find(picture, &view) {
            Ok(horizon) => {
                let covariance = horizon.up_covariance();
                let trace = covariance.x_axis.x + covariance.y_axis.y + covariance.z_axis.z;
                seen.horizon = Some(HorizonSeen {
                    up_in_camera: horizon.up,
                    sigma: (0.5 * trace).sqrt(),
                    pixel: horizon_pixel(lens, horizon.up, self.eye_height_m),
                });
            }
            Err(NoHorizon::Blurred(_)) => seen.is_blurred = true,
            Err(_) => {}
        }
        seen.board = self.board.as_mut().and_then(|b| b.find(picture, lens));
        seen
    }
}

impl std::fmt::Debug for Watcher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Watcher").field("eye_height_m", &self.eye_height_m).finish_non_exhaustive()
    }
}

/// Collects what a calibration is solved from.
#[derive(Clone, Debug)]
pub struct Capture {
    lens: Lens,
    eye_height_m: f64,
    clock: ClockMap,
    readings: Vec<ImuReading>,
    observations: Vec<Observation>,
    sightings: Vec<Sighting>,
    /// Corners of the boards, by the observation.
    boards: Vec<(usize, Vec<Corner>)>,
    corners: usize,
    readout: Readout,
    edges: Vec<TriggerEdge>,
    counts: CaptureCounts,
}

impl Capture {
    /// Nothing so far, of a camera with that lens, `eye_height_m` above the sea.
    pub fn new(lens: Lens, eye_height_m: f64) -> Self {
        Self {
            lens,
            eye_height_m,
            clock: ClockMap::new(),
            readings: Vec::new(),
            observations: Vec::new(),
            sightings: Vec::new(),
            boards: Vec::new(),
            corners: 0,
            readout: Readout::Unknown,
            edges: Vec::new(),
            counts: CaptureCounts::default(),
        }
    }

    /// The camera reads its rows one after another, over that many seconds from first to last (negative where the last comes first); zero
    /// where it exposes all at once. Where nothing is said, boards tell it.
    #[must_use]
    pub const fn with_readout(mut self, seconds: f64) -> Self {
        self.readout = Readout::Known(seconds);
        self
    }

    /// Takes in what a device reported. What a picture tells is [`Self::see`]n.
    pub fn take(&mut self, event: &Event) {
        match event {
            Event::Imu(sample) => self.sample(sample),
            Event::Trigger(edge) if self.edges.len() < OBSERVATIONS_MOST => self.edges.push(*edge),
            Event::Frame(_)
            | Event::Trigger(_)
            | Event::Fault(_)
            | Event::Ship(_)
            | Event::ShipFix(_)
            | Event::Mark(_)
            | Event::Act(_)
            | Event::Order(_) => {}
        }
    }

    fn sample(&mut self, sample: &ImuSample) {
        if !sample.is_finite() || self.readings.len() >= READINGS_MOST {
            return;
        }
        let time = self.clock.observe(sample.device_time_ns, sample.arrival);
        self.readings.push(ImuReading::new(time, sample));
        self.counts.readings += 1;
        self.counts.restarts = self.clock.restarts();
    }

    /// Takes in what a picture told.
    pub fn see(&mut self, seen: &PictureSeen) {
        /// Corners of boards that are kept at most: half an hour of the usual board, 128 MB.
        const CORNERS_MOST: usize = 4_000_000;
        if !seen.fits {
            self.counts.other_size += 1;
            return;
        }
        self.counts.pictures += 1;
        if self.observations.len() + 1 >= OBSERVATIONS_MOST {
            return;
        }
        let stamp = seen.stamp;
        if let Some(HorizonSeen { up_in_camera, sigma, pixel }) = seen.horizon {
            self.counts.horizons += 1;
            let row = row(&self.lens, pixel);
            self.observations.push(Observation::Up { stamp, up_in_camera, sigma, row });
            self.sightings.push(Sighting { stamp, pixel });
        }
        self.counts.blurred += usize::from(seen.is_blurred);
        if let Some(board) = seen.board.as_ref().filter(|_| self.corners < CORNERS_MOST) {
            self.counts.boards += 1;
            self.observations.push(Observation::Orientation {
                stamp,
                reference_from_camera: board.board_from_camera,
                sigma: board.sigma,
                row: row(&self.lens, board.pixel),
                chain: 0,
            });
            self.sightings.push(Sighting { stamp, pixel: board.pixel });
            self.corners += board.corners.len();
            self.boards.push((self.observations.len() - 1, board.corners.clone()));
        }
    }

    /// The camera's lens.
    pub const fn lens(&self) -> &Lens {
        &self.lens
    }

    /// Counts of what was captured.
    pub const fn counts(&self) -> CaptureCounts {
        self.counts
    }

    /// The inertial unit's readings on the host's clock.
    pub fn readings(&self) -> &[ImuReading] {
        &self.readings
    }

    /// Observations of the camera's orientation.
    pub fn observations(&self) -> &[Observation] {
        &self.observations
    }

    /// Where in the picture each of the observations was made, in the same order.
    pub fn sightings(&self) -> &[Sighting] {
        &self.sightings
    }

    /// The trigger's edges.
    pub fn edges(&self) -> &[TriggerEdge] {
        &self.edges
    }

    /// From the first reading or picture to the last, seconds.
    pub fn seconds(&self) -> f64 {
        let readings = self.readings.first().zip(self.readings.last());
        readings.map_or(0.0, |(first, last)| last.time.secs_since(first.time))
    }

    /// Standard deviation of the error of elevation that all horizons share, radians: no recording tells it.
    pub fn horizon_sigma(&self) -> f64 {
        /// Errors that all horizons of a recording share, one standard deviation: refraction, by 0.08 to 0.12 deg in daytime, radians...
        const REFRACTION: f64 = 0.1f64.to_radians();
        /// ...and where in its haze the edge is found, pixels.
        const EDGE_PX: f64 = 0.5;
        REFRACTION.hypot(EDGE_PX / self.lens.focal.y)
    }

    /// The error that all observations share, where nothing but horizons tells the rotation, radians.
    pub fn shared_sigma(&self) -> Option<f64> {
        self.is_by_horizon().then(|| self.horizon_sigma())
    }

    /// Description of the measurements behind an alignment.
    pub fn how(&self, found: &Alignment) -> String {
        let by = if self.is_by_horizon() { "horizon" } else { "board" };
        format!("{:.0} s of movement, {by}, {}", self.seconds(), found.grade)
    }

    fn options(&self) -> Options {
        Options { horizon_sigma: self.horizon_sigma(), ..Options::default() }
    }

    /// Whether there is nothing, or too little, but horizons.
    pub const fn is_by_horizon(&self) -> bool {
        /// Pictures with a board from which on horizons are not needed to tell the rotation.
        const BOARDS_ENOUGH: usize = 30;
        self.counts.boards < BOARDS_ENOUGH
    }

    /// The observations that tell most: of a board alone where it was seen often, because horizons share the error of refraction.
    fn best(&self, all: &[Observation]) -> Vec<Observation> {
        self.best_numbers(all).into_iter().map(|i| all[i]).collect()
    }

    /// Their numbers.
    fn best_numbers(&self, all: &[Observation]) -> Vec<usize> {
        let enough = !self.is_by_horizon();
        let wanted = |i: &usize| !enough || matches!(all[*i], Observation::Orientation { .. });
        (0..all.len()).filter(wanted).collect()
    }

    /// Finds rotation, time offset and bias: from the board where there is one, with the help of the horizon where the movement alone does
    /// not tell, else from the horizon. A picture that is read row by row while the camera turns is put right by the gyro, for which rotation
    /// and offset must be known: what was found from the picture as it is, and then once more.
    ///
    /// # Errors
    /// As [`alignment::solve`].
    pub fn solve(&self) -> Result<Alignment, AlignmentError> {
        /// Rounds of putting pictures right that are read row by row and solving anew.
        const ROUNDS: usize = 2;
        let mut found = self.solve_from(&self.observations)?;
        let readout = match self.readout {
            Readout::Known(seconds) => (seconds != 0.0).then_some((seconds, None)),
            Readout::Unknown => self.rows(&found).readout().map(|(seconds, sigma)| (seconds, Some(sigma))),
        };
        let Some((seconds, sigma)) = readout else { return Ok(found) };
        for _ in 0..ROUNDS {
            found = self.solve_from(&self.rows(&found).straightened(seconds))?;
        }
        found.readout_s = sigma.map(|sigma| (seconds, sigma));
        Ok(found)
    }

    fn solve_from(&self, all: &[Observation]) -> Result<Alignment, AlignmentError> {
        let (best, options) = (self.best(all), self.options());
        let found = alignment::solve(&self.readings, &best, &options);
        match found {
            Err(AlignmentError::NotObservable { .. }) if best.len() < all.len() => {
                alignment::solve(&self.readings, all, &options)
            }
            other => other,
        }
    }

    fn rows(&self, found: &Alignment) -> RollingShutter<'_> {
        self.rows_by(found.camera_from_imu, found.offset_s, found.gyro_bias)
    }

    fn rows_by(&self, camera_from_imu: DQuat, offset_s: f64, bias: DVec3) -> RollingShutter<'_> {
        RollingShutter::new(RollingMeasurements {
            lens: self.lens,
            dip: horizon_dip(self.eye_height_m),
            readings: &self.readings,
            observations: &self.observations,
            boards: &self.boards,
            camera_from_imu,
            offset_s,
            bias,
        })
    }

    /// Holds a calibration against what was seen.
    ///
    /// # Errors
    /// As [`alignment::compare`].
    pub fn compare(&self, calibration: &Calibration) -> Result<Comparison, AlignmentError> {
        /// Boards that the lens is told by: enough for hundredths of a pixel.
        const BOARDS: usize = 60;
        let readout_s = calibration.readout_ns as f64 * 1e-9;
        let offset_s = calibration.time_offset_ns as f64 * 1e-9;
        let rows = self.rows_by(calibration.camera_from_imu, offset_s, calibration.gyro_bias);
        let all = if readout_s == 0.0 { self.observations.clone() } else { rows.straightened(readout_s) };
        let seen = Compared { readings: &self.readings, observations: &all, sight: &[], lens: None };
        let ups = (self.counts.horizons > 0)
            .then(|| alignment::expected_ups(&seen, calibration, &self.options()))
            .flatten()
            .unwrap_or_default();
        let sight = rows.by_sight(readout_s, &ups);
        let boards = rows.straight_boards(readout_s);
        let few: Vec<BoardView> =
            boards.iter().step_by(boards.len().div_ceil(BOARDS).max(1)).cloned().collect();
        let best = self.best_numbers(&all);
        let (observations, sight): (Vec<Observation>, Vec<BySight>) =
            best.into_iter().filter_map(|i| Some((*all.get(i)?, (*sight.get(i)?)?))).unzip();
        let compared = Compared {
            readings: &self.readings,
            observations: &observations,
            sight: &sight,
            lens: lens::evidence(&few, &self.lens),
        };
        alignment::compare(&compared, calibration, &self.options())
    }
}

/// Where the sea's horizon is straight ahead; the picture's middle where that is outside of it.
fn horizon_pixel(lens: &Lens, up: DVec3, eye_height_m: f64) -> DVec2 {
    let (sin, cos) = horizon_dip(eye_height_m).sin_cos();
    let ahead = (DVec3::Z - up * up.z).normalize_or_zero();
    let middle = DVec2::new(f64::from(lens.width), f64::from(lens.height)) / 2.0;
    lens.project(ahead * cos - up * sin).unwrap_or(middle)
}

/// Off the picture's middle, in picture heights.
pub(crate) fn row(lens: &Lens, pixel: DVec2) -> f64 {
    (pixel.y / f64::from(lens.height) - 0.5).clamp(-0.5, 0.5)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bowwave_core::{event::PixelFormat, geometry::look};

    use super::*;

    /// A sky over a sea, seen from 10 m.
    fn picture(lens: &Lens, world_from_camera: DQuat) -> Picture {
        let sin_dip = -horizon_dip(10.0).sin();
        let mut bytes = Vec::new();
        for y in 0..lens.height {
            for x in 0..lens.width {
                let ray = lens.unproject(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                let above = (world_from_camera * ray).z - sin_dip;
                // As sharp as a pixel.
                let share = (above * lens.focal.y + 0.5).clamp(0.0, 1.0);
                bytes.extend([(70.0 + 110.0 * share) as u8; 3]);
            }
        }
        Picture::new(PixelFormat::Rgb, lens.width, lens.height, Arc::from(bytes)).unwrap()
    }

    fn frame(picture: Picture) -> CameraFrame {
        let time = Time::from_ns(5);
        CameraFrame { arrival: time, mid_exposure: time, sequence: 0, picture, jpeg: None }
    }

    #[test]
    fn a_horizon_becomes_an_up_with_its_place() {
        let lens = Lens::pinhole(320, 180, 1.0);
        let (mut watcher, mut capture) = (Watcher::new(lens, 10.0), Capture::new(lens, 10.0));
        let world_from_camera = look(0.3, 0.1, -0.05);
        capture.see(&watcher.look(&frame(picture(&lens, world_from_camera))));
        let [Observation::Up { up_in_camera, sigma, row, .. }] = *capture.observations() else {
            panic!("{:?}", capture.counts())
        };
        let off = up_in_camera.angle_between(world_from_camera.inverse() * DVec3::Z);
        assert!(off < 4.0 * sigma && sigma < 3e-3, "{off} {sigma}");
        let below = lens.focal.y * (0.1f64 + horizon_dip(10.0)).tan();
        assert!((capture.sightings()[0].pixel.y - 90.0 - below).abs() < 1.5, "{:?}", capture.sightings());
        assert!((row - below / 180.0).abs() < 0.01);
        // Nothing but sky, and another size.
        capture.see(&watcher.look(&frame(picture(&lens, look(0.3, 0.9, 0.0)))));
        capture.see(&watcher.look(&frame(picture(&Lens::pinhole(160, 90, 1.0), world_from_camera))));
        let counts = capture.counts();
        assert_eq!((counts.pictures, counts.horizons, counts.other_size), (2, 1, 1));
    }

    #[test]
    fn samples_come_on_the_hosts_clock_and_bad_ones_are_left_out() {
        let mut capture = Capture::new(Lens::pinhole(320, 180, 1.0), 10.0);
        for i in 0..100i64 {
            let sample = ImuSample {
                arrival: Time::from_ns(9_000_000_000 + i * 5_000_000 + i % 7 * 100_000),
                device_time_ns: i * 5_000_000,
                rate: if i == 40 { DVec3::NAN } else { DVec3::X },
                accel: DVec3::Z * 9.81,
                world_from_imu: None,
            };
            capture.take(&Event::Imu(sample));
        }
        assert_eq!(capture.counts().readings, 99);
        assert_eq!(capture.readings()[98].time.ns(), 9_000_000_000 + 99 * 5_000_000);
        assert!((capture.seconds() - 0.495).abs() < 1e-9);
    }

    #[test]
    fn a_board_that_was_seen_often_needs_no_horizon() {
        struct SteadyBoard;
        impl FindBoard for SteadyBoard {
            fn find(&mut self, _: &Picture, _: &Lens) -> Option<BoardSeen> {
                let pixel = DVec2::new(160.0, 45.0);
                Some(BoardSeen {
                    board_from_camera: DQuat::IDENTITY,
                    sigma: 1e-3,
                    pixel,
                    corners: Vec::new(),
                })
            }
        }
        let lens = Lens::pinhole(320, 180, 1.0);
        let mut capture = Capture::new(lens, 10.0);
        let seen = Watcher::new(lens, 10.0)
            .with_board(Box::new(SteadyBoard))
            .look(&frame(picture(&lens, look(0.0, 0.0, 0.0))));
        (0..29).for_each(|_| capture.see(&seen));
        assert_eq!(capture.best(capture.observations()).len(), 58);
        capture.see(&seen);
        assert_eq!(capture.best(capture.observations()).len(), 30);
        assert!(
            capture
                .best(capture.observations())
                .iter()
                .all(|o| matches!(o, Observation::Orientation { row, .. } if (row + 0.25).abs() < 1e-9))
        );
    }
}
