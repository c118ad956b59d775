//! The sea from the video: watched beside the frames, a small piece of work with each picture, and steadied for what is drawn.

use glam::DVec2;

use crate::{
    colour::{LUMINANCE, srgb_to_linear},
    estimate::sea::{
        SeaConditions, SeaEstimate, SeaFollower, SeaFrame, SeaInUse, SeaMeter, SeaSource, Unknown,
    },
    event::Picture,
    geometry::{CameraPose, Lens, ahead},
    sea::BeaufortForce,
    time::Time,
};

/// State of the sea in the video.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeaReport {
    /// The sea that is drawn, and where it comes from.
    pub in_use: SeaInUse,
    /// The wind that reflections are drawn with, m/s.
    pub wind_m_s: f64,
    /// The newest estimate, or why there is none.
    pub newest: Result<SeaEstimate, Unknown>,
    /// Estimates so far.
    pub estimates: u64,
    /// Analyses that ended without one.
    pub refused: u64,
}

/// Watches the sea and says what to draw.
pub struct SeaStateTracker {
    meter: SeaMeter,
    follower: SeaFollower,
    newest: Result<SeaEstimate, Unknown>,
    estimates: u64,
    refused: u64,
    wind: DVec2,
    force: BeaufortForce,
    windy_since: Option<Time>,
}

impl std::fmt::Debug for SeaStateTracker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SeaStateTracker").field("report", &self.report()).finish_non_exhaustive()
    }
}

impl SeaStateTracker {
    /// A tracker that has seen nothing: the sea and the wind are those assumed.
    pub fn new(assumed: SeaConditions, wind: DVec2, force: BeaufortForce) -> Self {
        let meter = SeaMeter::new();
        Self {
            newest: meter.estimate(),
            meter,
            follower: SeaFollower::new(assumed),
            estimates: 0,
            refused: 0,
            wind,
            force,
            windy_since: None,
        }
    }

    /// Takes a picture in and does one piece of work.
    pub fn observe(&mut self, time: Time, picture: &Picture, lens: &Lens, camera: &CameraPose) {
        let (width, height) = (f64::from(lens.width), f64::from(lens.height));
        let scale = DVec2::new(f64::from(picture.width()) / width, f64::from(picture.height()) / height);
        let luminance = |pixel: DVec2| {
            let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < width && pixel.y < height;
            inside.then(|| {
                let place = pixel * scale;
                let coded = picture.srgb_at(place.x as u32, place.y as u32);
                glam::Vec3::from(coded.map(srgb_to_linear)).dot(LUMINANCE)
            })
        };
        self.meter.observe(&SeaFrame { time, camera: *camera, lens, luminance: &luminance });
        let outcome = self.meter.estimate();
        if outcome != self.newest {
            match outcome {
                Ok(_) => self.estimates += 1,
                Err(Unknown::TooShort { .. }) => {}
                Err(_) => self.refused += 1,
            }
            self.newest = outcome;
            self.follower.update(&outcome);
        }
        self.blow(time);
    }

    /// Lets the wind follow the sea.
    fn blow(&mut self, time: Time) {
        /// The wind that reflections are drawn with follows the measured one with this time constant, seconds.
        const WIND_FOLLOWS_S: f64 = 5.0;
        /// The force goes over to the next where the wind is this share beyond the border.
        const FORCE_BEYOND: f64 = 0.08;
        let SeaInUse { conditions, source, .. } = self.follower.in_use();
        let since = self.windy_since.replace(time).unwrap_or(time);
        if source == SeaSource::Assumed {
            return;
        }
        let wanted = -ahead(conditions.from_rad) * conditions.wind_m_s();
        let share = 1.0 - (-time.secs_since(since).max(0.0) / WIND_FOLLOWS_S).exp();
        self.wind = self.wind.lerp(wanted, share);
        let speed = self.wind.length();
        let (low, high) = self.force.wind_range_m_s();
        if speed < low * (1.0 - FORCE_BEYOND) || speed > high * (1.0 + FORCE_BEYOND) {
            self.force = BeaufortForce::of_wind(speed);
        }
    }

    /// The sea as it was measured; `None` while it is only assumed.
    pub fn measured(&self) -> Option<SeaConditions> {
        let SeaInUse { conditions, source, .. } = self.follower.in_use();
        (source != SeaSource::Assumed).then_some(conditions)
    }

    /// Velocity of the air over the water (world x, y), m/s, and its force.
    pub fn wind(&self) -> (DVec2, BeaufortForce) {
        (self.wind, self.force)
    }

    /// The report.
    pub fn report(&self) -> SeaReport {
        SeaReport {
            in_use: self.follower.in_use(),
            wind_m_s: self.wind.length(),
            newest: self.newest,
            estimates: self.estimates,
            refused: self.refused,
        }
    }
}
