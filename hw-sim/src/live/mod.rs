//! A gun that somebody aims: the closed loop of the simulated hardware.
//!
//! A [`Live`] is a camera, an inertial unit and a trigger on a gun on a ship. [`Hands`] move it: a mouse, a [`Script`], or a simulated gunner.
//! The gun has inertia, friction and stops, the ship rolls, and what the hands want is followed as arms would. Pictures are cut from a
//! [`Panorama`] through the lens, with the sensor's noise; samples become the unit's bytes. Without a clock all of
//! it follows from the script; in real time the same bytes go through a pseudo-terminal, and pictures through a queue in which the newest wins.

mod bench;
mod camera;
mod fast;
mod gun;
mod hands;
mod realtime;
mod script;
mod sensor;
mod sight;

use std::{collections::VecDeque, path::Path};

use bowwave_calibration::CalibrationFile;
use bowwave_core::{event::Event, geometry::CameraPose, time::Time};
use bowwave_devices::{clock, imu::ImuCounters};
use bowwave_record::Properties;

pub use camera::CutCamera;
pub use gun::{Gun, MountModel, Wish};
pub use hands::Hands;
pub use script::Script;

use crate::{
    make::{self, START},
    panorama::{Panorama, PanoramaRecipe},
    replay::{ReplayError, STAMP_TOLERANCE_NS},
};
use bench::Bench;
use sensor::Sensor;

/// True poses that are kept: a second of them.
const POSES: usize = 30;

/// A perfect calibration of the simulated gun, with the uncertainties of a good one. Barrel and front sight are its own ship's part.
pub fn calibration(recipe: &PanoramaRecipe) -> CalibrationFile {
    let mut file = make::calibration(&recipe.recipe);
    file.phantoms = sight::phantoms(&file.calibration.lens);
    file
}

/// Properties of a recording of the simulated gun; `aimed_by` is who moves it.
pub fn properties(recipe: &PanoramaRecipe, calibration: &CalibrationFile, aimed_by: &str) -> Properties {
    let mut properties = make::properties(&recipe.recipe, calibration);
    properties.loop_ns = None;
    properties.extra.insert("sun_elevation_deg".to_owned(), recipe.sun_elevation.to_degrees().to_string());
    properties.source = format!("simulated gun, aimed by {aimed_by}");
    properties
}

/// Settings of a simulated gun.
#[derive(Clone, Debug)]
pub struct LiveOptions<'a> {
    /// Recipe of the panorama.
    pub recipe: &'a PanoramaRecipe,
    /// The panorama's file.
    pub panorama: &'a Path,
    /// Hands that move it.
    pub hands: Hands,
    /// A script that moves the hands.
    pub script: Option<Script>,
    /// It runs on the host's clock.
    pub realtime: bool,
    /// The camera sends JPEG, which takes time and makes recordings of it a tenth as long.
    pub is_coded: bool,
}

/// Counts of what a simulated gun delivered and left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LiveStats {
    /// Pictures delivered.
    pub frames: u64,
    /// Pictures that gave way to newer ones before they were fetched.
    pub frames_overwritten: u64,
    /// Pictures left out because the computer was too slow to cut them in time.
    pub frames_late: u64,
    /// Counts of the decoder of the inertial unit's line.
    pub imu: ImuCounters,
    /// Samples dropped, oldest first, because nobody drained the queue.
    pub imu_overflow: u64,
    /// Bytes that the unit's line lost because they were not read in time.
    pub line_lost_bytes: u64,
}

/// A simulated gun that somebody aims.
pub struct Live {
    origin: Time,
    hands: Hands,
    way: Way,
}

enum Way {
    /// In real time, before anybody asked for events.
    Waiting(Option<Box<(Bench, Sensor)>>),
    Fast(Box<fast::FastLive>),
    Realtime(Box<realtime::RealtimeLive>),
}

impl Live {
    /// One that begins with the first call of [`Self::collect`], or without a clock at the time at which made recordings begin.
    pub fn start(options: LiveOptions<'_>) -> Result<Self, ReplayError> {
        let LiveOptions { recipe, panorama, hands, script, realtime, is_coded } = options;
        let camera = CutCamera::new(&recipe.recipe).with_sight(&recipe.recipe);
        let quality = is_coded.then_some(recipe.recipe.camera.jpeg_quality);
        let sensor = Sensor::new(camera, Panorama::open(panorama)?, quality);
        let bench = Bench::new(recipe, hands.clone(), script);
        let (origin, way) = if realtime {
            (clock::now(), Way::Waiting(Some(Box::new((bench, sensor)))))
        } else {
            (START, Way::Fast(Box::new(fast::FastLive::new(bench.begun(START), sensor))))
        };
        Ok(Self { origin, hands, way })
    }

    /// Begin, on the clock of its events; in real time, before that, the time at which it was made.
    pub const fn origin(&self) -> Time {
        self.origin
    }

    /// The hands that move it.
    pub const fn hands(&self) -> &Hands {
        &self.hands
    }

    /// Appends the events that have arrived and were not yet fetched, by arrival: those up to and with `until`, or in real time those that
    /// there are.
    pub fn collect(&mut self, until: Time, out: &mut Vec<Event>) -> Result<(), ReplayError> {
        if let Way::Waiting(parts) = &mut self.way
            && let Some(parts) = parts.take()
        {
            let (bench, sensor) = *parts;
            self.origin = clock::now().plus_ns(realtime::PREROLL_NS);
            self.way =
                Way::Realtime(Box::new(realtime::RealtimeLive::start(bench.begun(self.origin), sensor)?));
        }
        match &mut self.way {
            Way::Waiting(_) => Ok(()),
            Way::Fast(live) => live.collect(until, out),
            Way::Realtime(live) => live.drain(out),
        }
    }

    /// True pose of the camera at a frame's mid-exposure, no longer ago than a second.
    pub fn truth_at(&self, mid_exposure: Time) -> Option<CameraPose> {
        self.exposed_at(mid_exposure).map(|(pose, _)| pose)
    }

    /// How many times as far from where the bore vanishes the muzzle was seen in such a frame as at rest.
    pub fn recoil_at(&self, mid_exposure: Time) -> Option<f64> {
        self.exposed_at(mid_exposure).map(|(_, recoil)| recoil)
    }

    fn exposed_at(&self, mid_exposure: Time) -> Option<(CameraPose, f64)> {
        match &self.way {
            Way::Waiting(_) => None,
            Way::Fast(live) => live.truth_at(mid_exposure),
            Way::Realtime(live) => live.truth_at(mid_exposure),
        }
    }

    /// Counts so far.
    pub fn stats(&self) -> LiveStats {
        match &self.way {
            Way::Waiting(_) => LiveStats::default(),
            Way::Fast(live) => live.stats(),
            Way::Realtime(live) => live.stats(),
        }
    }

    /// Ends it and its threads.
    pub fn stop(self) -> Result<(), ReplayError> {
        match self.way {
            Way::Waiting(_) | Way::Fast(_) => Ok(()),
            Way::Realtime(live) => live.stop(),
        }
    }
}

/// The newest true poses, and the muzzle's factor by recoil.
#[derive(Debug, Default)]
struct TruePoses(VecDeque<(Time, CameraPose, f64)>);

impl TruePoses {
    fn push(&mut self, stamp: Time, pose: CameraPose, recoil: f64) {
        self.0.push_back((stamp, pose, recoil));
        while self.0.len() > POSES {
            self.0.pop_front();
        }
    }

    fn at(&self, stamp: Time) -> Option<(CameraPose, f64)> {
        let near = |time: &Time| time.ns_since(stamp).saturating_abs() <= STAMP_TOLERANCE_NS;
        self.0.iter().find(|(time, ..)| near(time)).map(|(_, pose, recoil)| (*pose, *recoil))
    }
}
