//! Sensor data of the devices: orientation over time, the newest picture, and whether they can be trusted.

use glam::{DQuat, DVec3};

use super::{
    heading_aiding::{HeadingAiding, HeadingCounts, HeadingSettings},
    horizon_aiding::{HorizonAiding, HorizonCounts},
    visual_compass::{SkylineCounts, VisualCompass},
};
use crate::{
    calibration::Calibration,
    estimate::{
        attitude::{Attitude, AttitudeSettings, Source},
        clock::{ClockMap, ClockReport},
        plausibility::{Plausibility, is_possible},
        pose::{NoPose, OrientationAt, STALE_NS},
        registration::{Misfit, Registration, RegistrationChecks, StampedPicture},
    },
    event::{CameraFrame, ImuSample, Mark, ShipSample},
    fault::Fault,
    geometry::Lens,
    own_ship::Mask,
    time::Time,
};

/// Counters of what was not used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SensorCounts {
    /// Samples taken in.
    pub imu: u64,
    /// Samples with a number that is not finite or not possible.
    pub imu_implausible: u64,
    /// Samples while the unit was stuck.
    pub imu_frozen: u64,
    /// Restarts of the unit's clock.
    pub imu_restarts: u32,
    /// Falls back to plain VQF's inclination, since orientation erred by more than it said.
    pub imu_fallbacks: u32,
    /// Pictures taken in.
    pub frames: u64,
    /// Pictures whose time stamp was not after the one before.
    pub frames_backward: u64,
    /// Pictures of another size than the calibrated one.
    pub frames_wrong_size: u64,
    /// Headings from outside.
    pub headings: HeadingCounts,
    /// Horizons seen.
    pub horizons: HorizonCounts,
    /// Headings by the sky.
    pub skyline: SkylineCounts,
}

/// Sensors of one session.
#[derive(Debug)]
pub struct Sensors {
    gyro_bias: DVec3,
    time_offset_ns: i64,
    readout_ns: i64,
    lens: Lens,
    level: HorizonAiding,
    steady: VisualCompass,
    registration: Registration,
    aid: HeadingAiding,
    clock: ClockMap,
    attitude: Attitude,
    plausibility: Plausibility,
    frame: Option<CameraFrame>,
    counts: SensorCounts,
}

impl Sensors {
    /// Sensors with that calibration, `eye_height_m` above the sea, in haze that leaves `visibility_m` metres, that have reported nothing; orientation is
    /// found from `source`, `mask` hides the own ship in the pictures.
    pub fn new(
        calibration: &Calibration,
        source: Source,
        heading: &HeadingSettings,
        mask: Option<&Mask>,
        eye_height_m: f64,
        visibility_m: f64,
    ) -> Self {
        let mut settings = AttitudeSettings::new(source, calibration);
        settings.own_growth = heading.own_growth.unwrap_or(settings.own_growth);
        Self {
            gyro_bias: calibration.gyro_bias,
            time_offset_ns: calibration.time_offset_ns,
            readout_ns: calibration.readout_ns,
            lens: calibration.lens,
            level: HorizonAiding::new(&calibration.lens, eye_height_m, visibility_m, mask.cloned()),
            steady: VisualCompass::new(
                eye_height_m,
                calibration.time_offset_sigma_ns as f64 * 1e-9,
                heading.sky_drift,
                mask.cloned(),
            ),
            registration: Registration::new(calibration.camera_from_imu, mask.cloned()),
            aid: HeadingAiding::new(heading.clone()),
            clock: ClockMap::new(),
            attitude: Attitude::new(settings, calibration.gyro_bias, calibration.camera_from_imu),
            plausibility: Plausibility::default(),
            frame: None,
            counts: SensorCounts::default(),
        }
    }

    /// Takes in a sample of the inertial unit.
    pub fn imu(&mut self, sample: &ImuSample) {
        self.counts.imu += 1;
        if !is_possible(sample) {
            self.counts.imu_implausible += 1;
            return;
        }
        self.plausibility.sample(sample);
        if self.plausibility.is_stuck() {
            self.counts.imu_frozen += 1;
            return;
        }
        let time = self.clock.observe(sample.device_time_ns, sample.arrival);
        if self.clock.restarts() != self.counts.imu_restarts {
            self.counts.imu_restarts = self.clock.restarts();
            self.attitude.restart();
            self.registration.restart();
            self.steady.forget();
            self.aid.forget();
        }
        self.registration.sample(time, sample, sample.rate - self.gyro_bias);
        let falls = self.attitude.falls();
        self.attitude.observe(time, sample);
        // A filter that is levelled anew counts from nothing.
        self.counts.imu_fallbacks += self.attitude.falls().saturating_sub(falls);
    }

    /// Takes in what the ship's instruments said.
    pub fn ship(&mut self, sample: &ShipSample) {
        self.aid.ship(sample, &mut self.attitude);
        self.counts.headings = self.aid.counts();
    }

    /// Takes in the operator's press.
    pub fn mark(&mut self, mark: &Mark) {
        self.aid.mark(mark.kind, mark.time, &mut self.attitude);
        // Its anchor holds another heading than the one that is now known.
        self.steady.forget();
        self.counts.headings = self.aid.counts();
    }

    /// For how long the ship's heading has been the very same though the ship moves, seconds; `None` where it is not stuck.
    pub fn ship_frozen_s(&self, now: Time) -> Option<f64> {
        self.aid.frozen_s(now)
    }

    /// How the unit's clock does; `None` before that can be told.
    pub fn clock(&self) -> Option<ClockReport> {
        self.clock.report()
    }

    /// Standard deviation of the heading since it was set or began, radians; `None` before there is one.
    pub fn heading_sigma(&self) -> Option<f64> {
        self.attitude.heading_sigma()
    }

    /// The same in tenths of a degree where the sailor is to know it.
    pub fn heading_shown(&self) -> Option<u16> {
        let sigma = self.heading_sigma().filter(|sigma| *sigma > self.aid.settings().shown_above)?;
        Some((sigma.to_degrees() * 10.0).round().min(1800.0) as u16)
    }

    /// Takes in a picture; the newest wins. One from the past or of a size that the lens was not calibrated for is left out.
    pub fn frame(&mut self, frame: &CameraFrame) -> bool {
        self.counts.frames += 1;
        if (frame.picture.width(), frame.picture.height()) != (self.lens.width, self.lens.height) {
            self.counts.frames_wrong_size += 1;
            return false;
        }
        if self.frame.as_ref().is_some_and(|f| frame.mid_exposure <= f.mid_exposure) {
            self.counts.frames_backward += 1;
            return false;
        }
        self.frame = Some(frame.clone());
        true
    }

    /// Looks for horizon and sky in the newest picture and corrects the orientation by them.
    pub fn sight(&mut self) {
        if let (Some(frame), Some(time)) = (&self.frame, self.video_time()) {
            // How a rolling shutter bent the picture is not known of the first one: an anchor in it would be wrong for as long as it holds.
            let Some(lens) = self.lens_read(time) else { return };
            let is_shared = self.level.is_due(time) || self.steady.is_due(time);
            let up = self.level.look(time, &frame.picture, &lens, &mut self.attitude);
            if let Some(up) = up {
                self.registration.up(time, &up, |time| self.attitude.up_alone(time));
            }
            let stamped = StampedPicture { time, picture: &frame.picture, lens: &lens, is_shared };
            self.registration.look(&stamped, &self.attitude);
            self.steady.look(time, &frame.picture, &lens, &mut self.attitude);
            self.counts.horizons = self.level.counts();
            self.counts.skyline = self.steady.counts();
        }
    }

    /// Rotation from the camera's axes to the world's for what is drawn, with the unit as in `world_from_imu`.
    pub fn world_from_camera(&self, world_from_imu: DQuat) -> DQuat {
        self.attitude.world_from_camera(world_from_imu)
    }

    /// The lens of a picture exposed at `time`: with how the camera turned while a rolling shutter read it, where that is known.
    pub fn lens_at(&self, time: Time) -> Lens {
        self.lens_read(time).unwrap_or(self.lens)
    }

    fn lens_read(&self, time: Time) -> Option<Lens> {
        if self.readout_ns == 0 {
            return Some(self.lens);
        }
        self.attitude.camera_turn(time, self.readout_ns).map(|turn| self.lens.read_while(turn))
    }

    /// The newest picture.
    pub fn newest_frame(&self) -> Option<&CameraFrame> {
        self.frame.as_ref()
    }

    /// When the newest picture was exposed (middle), on the inertial unit's clock.
    pub fn video_time(&self) -> Option<Time> {
        self.frame.as_ref().map(|f| f.mid_exposure.plus_ns(self.time_offset_ns))
    }

    /// The orientation at `time`.
    pub fn orientation(&self, time: Time) -> Result<OrientationAt, NoPose> {
        self.attitude.at(time)
    }

    /// Tests whether the newest picture was young enough at `time`, by the camera's own stamps: their offset against the unit's clock says
    /// nothing of whether pictures come.
    pub fn frame_fresh(&self, time: Time) -> bool {
        self.frame.as_ref().is_some_and(|frame| time.ns_since(frame.mid_exposure) <= STALE_NS)
    }

    /// Time of the newest orientation.
    pub fn newest_orientation(&self) -> Option<Time> {
        self.attitude.newest()
    }

    /// How this is set up wrongly, where the pictures say so.
    pub fn misfit(&self) -> Option<Misfit> {
        self.registration.wrong()
    }

    /// Confirmation of the orientation by the pictures.
    pub fn checks(&self, now: Time) -> RegistrationChecks {
        self.registration.checks(now)
    }

    /// Counters.
    pub const fn counts(&self) -> SensorCounts {
        self.counts
    }

    /// The fault of the sensors at `now` that the sailor must know of; `None` where all is well.
    pub fn trouble(&self, now: Time) -> Option<Fault> {
        if self.frame.is_none() {
            let wrong_size = self.counts.frames_wrong_size > 0;
            return Some(if wrong_size { Fault::CamFormat } else { Fault::CamAwaited });
        }
        if !self.frame_fresh(now) {
            return Some(Fault::CamLost);
        }
        match self.attitude.newest() {
            None => Some(Fault::ImuAwaited),
            Some(t) if now.ns_since(t) <= STALE_NS => None,
            Some(_) if self.counts.imu_frozen > 0 => Some(Fault::ImuSanity),
            Some(_) => Some(Fault::ImuLost),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{Picture, PixelFormat};
    use glam::{DVec2, DVec3};

    fn sensors() -> Sensors {
        sensors_read_in(0)
    }

    fn sensors_read_in(readout_ns: i64) -> Sensors {
        let calibration = Calibration {
            lens: Lens::pinhole(4, 2, 1.0),
            focal_sigma_px: 1.0,
            camera_from_imu: DQuat::IDENTITY,
            camera_from_imu_sigma: DVec3::ONE,
            time_offset_ns: 2_000_000,
            time_offset_sigma_ns: 1,
            readout_ns,
            readout_sigma_ns: 0,
            boresight: DVec2::ZERO,
            boresight_sigma: 0.001,
            muzzle_in_camera: DVec3::ZERO,
            trigger: None,
            gyro_bias: DVec3::ZERO,
            gyro_bias_sigma: DVec3::ONE,
        };
        Sensors::new(&calibration, Source::Auto, &HeadingSettings::default(), None, 5.0, 20_000.0)
    }

    fn sample(i: i64) -> ImuSample {
        ImuSample {
            arrival: Time::from_ns(i * 5_000_000),
            device_time_ns: i * 5_000_000,
            rate: DVec3::X * (i as f64 * 1e-6),
            accel: DVec3::Z,
            world_from_imu: Some(DQuat::IDENTITY),
        }
    }

    fn frame(ms: i64, width: u32) -> CameraFrame {
        let bytes = vec![0; width as usize * 6].into();
        CameraFrame {
            arrival: Time::from_ns(ms * 1_000_000 + 10_000_000),
            mid_exposure: Time::from_ns(ms * 1_000_000),
            sequence: 0,
            picture: Picture::new(PixelFormat::Rgb, width, 2, bytes).unwrap(),
            jpeg: None,
        }
    }

    #[test]
    fn not_a_number_and_impossible_rates_are_left_out() {
        let mut s = sensors();
        s.imu(&ImuSample { rate: DVec3::NAN, ..sample(0) });
        s.imu(&ImuSample { rate: DVec3::X * 100.0, ..sample(1) });
        s.imu(&ImuSample { world_from_imu: Some(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)), ..sample(2) });
        assert_eq!(s.counts().imu_implausible, 3);
        assert!(s.newest_orientation().is_none());
    }

    #[test]
    fn nothing_is_sought_in_a_picture_whose_first_rows_were_read_before_the_unit_spoke() {
        for (readout_ns, looked_at) in [(0, 2), (30_000_000, 1)] {
            let mut s = sensors_read_in(readout_ns);
            (0..40).for_each(|i| s.imu(&sample(i)));
            for ms in [10, 150] {
                assert!(s.frame(&frame(ms, 4)));
                s.sight();
            }
            assert_eq!(s.counts().skyline.none, looked_at, "{readout_ns}");
        }
    }

    #[test]
    fn a_stuck_unit_goes_stale_and_recovers() {
        let mut s = sensors();
        s.frame(&frame(990, 4));
        (0..200).for_each(|i| s.imu(&sample(i)));
        let now = |i: i64| Time::from_ns(i * 5_000_000);
        assert_eq!(s.trouble(now(200)), None);
        for i in 200..300 {
            s.imu(&ImuSample { rate: sample(199).rate, ..sample(i) });
        }
        s.frame(&frame(1490, 4));
        let said = s.trouble(now(300));
        assert_eq!(said, Some(Fault::ImuSanity));
        assert_eq!(said.map(Fault::cause), Some("IMU STUCK"));
        s.imu(&sample(301));
        assert_eq!(s.trouble(now(301)), None);
    }

    #[test]
    fn a_camera_whose_stamps_are_late_is_not_lost() {
        let mut s = sensors();
        s.time_offset_ns = -60_000_000;
        (0..200).for_each(|i| s.imu(&sample(i)));
        s.frame(&frame(920, 4));
        let now = |ms: i64| Time::from_ns(ms * 1_000_000);
        assert_eq!(s.trouble(now(990)), None, "a picture 70 ms old by its own stamp");
        assert_eq!(s.trouble(now(1021)), Some(Fault::CamLost));
    }

    #[test]
    fn pictures_out_of_order_or_of_another_size_are_left_out() {
        let mut s = sensors();
        assert!(s.frame(&frame(100, 4)));
        assert!(!s.frame(&frame(100, 4)));
        assert!(!s.frame(&frame(90, 4)));
        assert!(!s.frame(&frame(133, 6)));
        assert!(s.frame(&frame(166, 4)));
        let counts = s.counts();
        assert_eq!((counts.frames, counts.frames_backward, counts.frames_wrong_size), (5, 2, 1));
        assert_eq!(s.video_time(), Some(Time::from_ns(168_000_000)));
    }
}
