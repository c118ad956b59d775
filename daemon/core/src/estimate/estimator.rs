//! Stage one as a whole: devices' reports in, orientation, camera, light and sea out.

use glam::{DVec2, DVec3};

use super::{
    attitude::Source,
    clock::ClockReport,
    heading_aiding::HeadingSettings,
    light::{Light, LightMeter, Luminaries, SeaTones, SeenNoise, SkyAgreement, SkyLight},
    pose::NoPose,
    recoil::RecoilFinder,
    registration::{Misfit, RegistrationChecks},
    sea::SeaConditions,
    sea_state::{SeaReport, SeaStateTracker},
    sensors::{SensorCounts, Sensors},
};
use crate::{
    calibration::Calibration,
    daylight::Daylight,
    event::{CameraFrame, ImuSample, Mark, ShipFix, ShipSample},
    fault::{Fault, NotScored},
    geometry::{CameraPose, Lens},
    own_ship::OwnShip,
    sea::BeaufortForce,
    time::Time,
};

/// Settings of an estimator.
#[derive(Clone, Copy, Debug)]
pub struct EstimatorSettings<'a> {
    /// The calibration of camera and inertial unit.
    pub calibration: &'a Calibration,
    /// Whose estimate of the orientation is used.
    pub orientation: Source,
    /// Settings of heading aiding.
    pub heading: &'a HeadingSettings,
    /// The own gun and ship in the pictures.
    pub own_ship: &'a OwnShip,
    /// Height of the camera over the mean sea, metres.
    pub eye_height_m: f64,
    /// Sun and visibility.
    pub daylight: Daylight,
    /// Whether the brightness of the sea is measured.
    pub measures_tones: bool,
    /// Velocity of the wind that is assumed, world x and y, m/s.
    pub wind: DVec2,
    /// Its force.
    pub force: BeaufortForce,
    /// The sea that is assumed until one is measured in the video; `None` where none is to be measured.
    pub sea: Option<SeaConditions>,
}

/// Where the camera was at some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraEstimate {
    /// Its pose.
    pub pose: CameraPose,
    /// Age of the newest measurement at that time, nanoseconds; negative where the pose is interpolated.
    pub age_ns: i64,
}

/// The light that boats are drawn with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneLight {
    /// Light on the boats.
    pub boats: Light,
    /// The sky that boats hide from the sea.
    pub sky: SkyLight,
    /// How bright the sea is in the picture.
    pub tones: SeaTones,
    /// Luminance that the camera shows as white, cd/m^2.
    pub white_cd_m2: f64,
    /// The camera's noise, where it is seen on boats.
    pub noise: Option<SeenNoise>,
}

/// All that is estimated from devices' reports.
#[derive(Debug)]
pub struct Estimator {
    sensors: Sensors,
    light: LightMeter,
    recoil: Option<RecoilFinder>,
    sea: Option<SeaStateTracker>,
    assumed_wind: (DVec2, BeaufortForce),
    eye_height_m: f64,
    picture_is_new: bool,
}

impl Estimator {
    /// An estimator to which nothing has been reported.
    pub fn new(settings: &EstimatorSettings<'_>) -> Self {
        let EstimatorSettings { wind, force, eye_height_m, .. } = *settings;
        Self {
            sensors: Sensors::new(
                settings.calibration,
                settings.orientation,
                settings.heading,
                settings.own_ship.mask.as_ref(),
                eye_height_m,
                settings.daylight.visibility_m,
            ),
            light: LightMeter::new(&settings.daylight, settings.measures_tones),
            recoil: RecoilFinder::new(&settings.own_ship.phantoms),
            sea: settings.sea.map(|assumed| SeaStateTracker::new(assumed, wind, force)),
            assumed_wind: (wind, force),
            eye_height_m,
            picture_is_new: false,
        }
    }

    /// Takes in a sample of the inertial unit.
    pub fn imu(&mut self, sample: &ImuSample) {
        self.sensors.imu(sample);
    }

    /// Takes in a picture; the newest wins.
    pub fn frame(&mut self, frame: &CameraFrame) {
        self.picture_is_new |= self.sensors.frame(frame);
    }

    /// Takes in what the ship's instruments said.
    pub fn ship(&mut self, sample: &ShipSample) {
        self.sensors.ship(sample);
    }

    /// Takes in where the ship is, or what time it is.
    pub fn ship_fix(&mut self, fix: &ShipFix) {
        self.light.fix(fix);
    }

    /// Takes in the operator's press.
    pub fn mark(&mut self, mark: &Mark) {
        self.sensors.mark(mark);
    }

    /// Measures horizon, sky, light and, where it `measures_sea`, the sea in the newest picture, where it is another than at the last call;
    /// says whether it is.
    pub fn look(&mut self, measures_sea: bool) -> bool {
        let is_new = std::mem::take(&mut self.picture_is_new);
        if is_new && let Some(time) = self.sensors.video_time() {
            self.sensors.sight();
            let camera = self.camera(time).ok();
            let lens = self.sensors.lens_at(time);
            if let (Some(recoil), Some(frame)) = (&mut self.recoil, self.sensors.newest_frame()) {
                recoil.observe(&frame.picture);
            }
            if let (Some(camera), Some(frame)) = (camera, self.sensors.newest_frame()) {
                self.light.observe(time, &frame.picture, &lens, &camera.pose);
                if let Some(sea) = self.sea.as_mut().filter(|_| measures_sea) {
                    sea.observe(time, &frame.picture, &lens, &camera.pose);
                }
            }
        }
        is_new
    }

    /// Recoil factor of the newest picture: distance from the bore's vanishing point over that at rest, from 1.
    pub fn recoil(&self) -> f64 {
        self.recoil.as_ref().map_or(1.0, RecoilFinder::factor)
    }

    /// The newest picture.
    pub fn newest_frame(&self) -> Option<&CameraFrame> {
        self.sensors.newest_frame()
    }

    /// When the newest picture was exposed (middle), on the inertial unit's clock.
    pub fn video_time(&self) -> Option<Time> {
        self.sensors.video_time()
    }

    /// Time of the newest orientation.
    pub fn newest_orientation(&self) -> Option<Time> {
        self.sensors.newest_orientation()
    }

    /// Where the camera was at `time`.
    pub fn camera(&self, time: Time) -> Result<CameraEstimate, NoPose> {
        let orientation = self.sensors.orientation(time)?;
        let pose = CameraPose {
            world_from_camera: self.sensors.world_from_camera(orientation.world_from_imu),
            position: DVec3::Z * self.eye_height_m,
        };
        Ok(CameraEstimate { pose, age_ns: orientation.provenance.age_ns() })
    }

    /// The lens of a picture exposed at `time`, with how the camera turned while its rows were read.
    pub fn lens_at(&self, time: Time) -> Lens {
        self.sensors.lens_at(time)
    }

    /// Why a round fired at `time` could not be scored: orientation or picture are too old. `None` where both are young enough.
    pub fn stale_at(&self, time: Time) -> Option<NotScored> {
        match self.sensors.orientation(time) {
            Err(_) => Some(NotScored::ImuStale),
            Ok(_) if !self.sensors.frame_fresh(time) => Some(NotScored::CameraStale),
            Ok(_) => None,
        }
    }

    /// The fault of the sensors at `now` that the sailor must know of; `None` where all is well.
    pub fn trouble(&self, now: Time) -> Option<Fault> {
        self.sensors.trouble(now)
    }

    /// How this is set up wrongly, where the pictures say so.
    pub fn misfit(&self) -> Option<Misfit> {
        self.sensors.misfit()
    }

    /// Confirmation of the orientation by the pictures.
    pub fn checks(&self, now: Time) -> RegistrationChecks {
        self.sensors.checks(now)
    }

    /// The light that boats are drawn with.
    pub fn light(&self) -> SceneLight {
        let (wind, _) = self.wind();
        let (boats, tones) = (self.light.light(), self.light.tones());
        let white_cd_m2 = self.light.white_cd_m2();
        let noise = self.light.noise();
        SceneLight { boats, sky: self.light.sky(wind.length()), tones, white_cd_m2, noise }
    }

    /// Sun and moon at the newest picture.
    pub const fn luminaries(&self) -> &Luminaries {
        self.light.luminaries()
    }

    /// Agreement of the sky in the pictures with the scenario's sun; `None` before a sky was seen.
    pub fn sky_agreement(&self) -> Option<SkyAgreement> {
        self.light.agreement()
    }

    /// Velocity of the air over the water (world x, y), m/s, and its force.
    pub fn wind(&self) -> (DVec2, BeaufortForce) {
        self.sea.as_ref().map_or(self.assumed_wind, SeaStateTracker::wind)
    }

    /// The sea that was measured; `None` before that, and where none is to be measured.
    pub fn sea_measured(&self) -> Option<SeaConditions> {
        self.sea.as_ref().and_then(SeaStateTracker::measured)
    }

    /// The state of the sea, where it is to be measured in the video.
    pub fn sea(&self) -> Option<SeaReport> {
        self.sea.as_ref().map(SeaStateTracker::report)
    }

    /// Counts of sensor data that were not used so far.
    pub fn counts(&self) -> SensorCounts {
        self.sensors.counts()
    }

    /// How the inertial unit's clock does; `None` before that can be told.
    pub fn unit_clock(&self) -> Option<ClockReport> {
        self.sensors.clock()
    }

    /// Standard deviation of the heading since it was set or began, radians; `None` before there is one.
    pub fn heading_sigma(&self) -> Option<f64> {
        self.sensors.heading_sigma()
    }

    /// The same in tenths of a degree where the sailor is to know it.
    pub fn heading_shown(&self) -> Option<u16> {
        self.sensors.heading_shown()
    }

    /// For how long the ship's heading has been the very same though the ship moves, seconds; `None` where it is not stuck.
    pub fn ship_frozen_s(&self, now: Time) -> Option<f64> {
        self.sensors.ship_frozen_s(now)
    }
}
