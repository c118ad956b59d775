//! How it goes at this moment: whether devices deliver, whether pictures are sharp, how the gun turns.

use std::collections::VecDeque;

use bowwave_core::{event::ImuSample, time::Time};
use glam::{DQuat, DVec3};

use super::Detection;
use crate::alignment::Movement;

/// A device that says nothing for so long is gone, seconds.
const SILENT_S: f64 = 1.0;
/// Span of the newest pictures, seconds, and the fewest that a share is told from.
const LATELY_S: f64 = 2.0;
const LATELY_LEAST: usize = 5;
/// More than this share of smeared pictures is too fast.
const BLURRED_MOST: f64 = 0.3;
/// Less than this share of pictures that tell something is too little.
const SEEN_LEAST: f64 = 0.2;
/// A gun that turns more than this is not held still, rad/s.
const STILL_RATE: f64 = 0.03;
/// How slowly the gun's present rate follows, seconds.
const FOLLOW_S: f64 = 0.2;
/// One movement is the only one where it makes up so much of the turning...
const ONLY: f64 = 0.9;
/// ...and there was so much of it (rad/s, rms).
const TURNED_LEAST: f64 = 0.02;

/// A picture: when, whether it told something, whether it was smeared, whether it has the right size.
type PictureState = (Time, bool, bool, bool);

#[derive(Clone, Debug)]
pub(super) struct Live {
    camera_from_imu: DQuat,
    last_sample: Option<Time>,
    last_picture: Option<Time>,
    lately: VecDeque<PictureState>,
    /// Squared rate of late.
    present: f64,
    /// Squares of rates about the camera's axes, and how many.
    turned: DVec3,
    mean: DVec3,
    samples: f64,
}

impl Live {
    pub(super) const fn new(camera_from_imu: DQuat) -> Self {
        Self {
            camera_from_imu,
            last_sample: None,
            last_picture: None,
            lately: VecDeque::new(),
            present: 0.0,
            turned: DVec3::ZERO,
            mean: DVec3::ZERO,
            samples: 0.0,
        }
    }

    pub(super) fn sample(&mut self, sample: &ImuSample) {
        if !sample.is_finite() {
            return;
        }
        let step = self.last_sample.map_or(0.0, |last| sample.arrival.secs_since(last)).clamp(0.0, FOLLOW_S);
        self.last_sample = Some(sample.arrival);
        let rate = self.camera_from_imu * sample.rate;
        self.samples += 1.0;
        let off = rate - self.mean;
        self.mean += off / self.samples;
        // Welford 1962.
        self.turned += off * (rate - self.mean);
        // A bias is slow, and no movement.
        self.present += ((rate - self.mean).length_squared() - self.present) * (step / FOLLOW_S);
    }

    pub(super) fn picture(&mut self, arrival: Time, finding: &Detection) {
        self.last_picture = Some(arrival);
        if let Detection::Orientation(seen) = finding {
            let told = seen.horizon.is_some() || seen.board.is_some();
            self.lately.push_back((arrival, told, seen.is_blurred, seen.fits));
        }
        while self.lately.front().is_some_and(|p| arrival.secs_since(p.0) > LATELY_S) {
            self.lately.pop_front();
        }
    }

    /// Whether the camera has been silent since `since` for too long.
    pub(super) fn no_pictures(&self, since: Time, now: Time) -> bool {
        silent(self.last_picture, since, now)
    }

    /// Whether the inertial unit has.
    pub(super) fn no_samples(&self, since: Time, now: Time) -> bool {
        silent(self.last_sample, since, now)
    }

    /// Share of the pictures of late for which `is` holds; `None` where there are too few.
    fn share(&self, is: impl Fn(&PictureState) -> bool) -> Option<f64> {
        let count = self.lately.len();
        (count >= LATELY_LEAST).then(|| self.lately.iter().filter(|p| is(p)).count() as f64 / count as f64)
    }

    pub(super) fn is_blurred(&self) -> bool {
        self.share(|p| p.2).is_some_and(|share| share > BLURRED_MOST)
    }

    pub(super) fn is_blind(&self) -> bool {
        self.share(|p| p.1).is_some_and(|share| share < SEEN_LEAST)
    }

    pub(super) fn is_other_size(&self) -> bool {
        self.share(|p| !p.3).is_some_and(|share| share > 0.5)
    }

    /// Whether any picture came.
    pub(super) const fn picture_came(&self) -> bool {
        self.last_picture.is_some()
    }

    pub(super) fn is_still(&self) -> bool {
        self.present < STILL_RATE * STILL_RATE
    }

    /// The only movement there was, by the mounting as it is known so far.
    pub(super) fn only(&self) -> Option<Movement> {
        let total = self.turned.element_sum();
        if !(self.samples > 0.0 && total > TURNED_LEAST * TURNED_LEAST * self.samples) {
            return None;
        }
        let axis = (0..3).find(|i| self.turned[*i] > ONLY * total)?;
        [Movement::Elevation, Movement::Traverse, Movement::Roll].get(axis).copied()
    }
}

fn silent(last: Option<Time>, since: Time, now: Time) -> bool {
    now.secs_since(last.map_or(since, |last| last.max(since))) > SILENT_S
}
