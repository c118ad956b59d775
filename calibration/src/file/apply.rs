//! Applying a solver's result to a calibration file.

use bowwave_core::{calibration::TriggerLatency, time::secs_to_ns};
use glam::DVec3;

use crate::{
    CalibrationFile, Date, Provenance, alignment::Alignment, boresight::Boresight, lens::LensCalibration,
    trigger::Latency,
};

/// A file says of nothing that it is known exactly.
const SIGMA_LEAST: f64 = 1e-9;

impl CalibrationFile {
    /// Takes over a lens that was found on that day.
    pub fn set_lens(&mut self, found: &LensCalibration, measured: Date) {
        self.calibration.lens = found.lens();
        self.calibration.focal_sigma_px = found.focal_sigma_px();
        self.made = measured;
        let how = format!(
            "{} pictures of a board, {:.2} px left, {} % of the picture covered, {:.2} mrad at its edge: {}",
            found.poses.len(),
            found.sigma_px,
            (found.coverage.share * 100.0).round(),
            found.edge_sigma() * 1e3,
            found.grade()
        );
        self.lens = Provenance::new(measured, how);
    }

    /// Takes over what an alignment found on that day in that way.
    pub fn set_alignment(&mut self, found: &Alignment, measured: Date, how: &str) {
        let c = &mut self.calibration;
        let some = |v: DVec3| v.max(DVec3::splat(SIGMA_LEAST));
        c.camera_from_imu = found.camera_from_imu;
        c.camera_from_imu_sigma = some(found.rotation_sigma());
        c.time_offset_ns = secs_to_ns(found.offset_s);
        c.time_offset_sigma_ns = secs_to_ns(found.offset_sigma_s).max(1);
        c.gyro_bias = found.gyro_bias;
        c.gyro_bias_sigma = some(found.gyro_bias_sigma);
        self.made = measured;
        for part in [&mut self.camera_from_imu, &mut self.time_offset, &mut self.gyro_bias] {
            *part = Provenance::new(measured, how);
        }
        if let Some((seconds, sigma)) = found.readout_s {
            c.readout_ns = secs_to_ns(seconds);
            c.readout_sigma_ns = secs_to_ns(sigma).max(1);
            self.shutter = Some(Provenance::new(measured, how));
        }
    }

    /// Takes over where the barrel points, found on that day by pulls at a mark `range_m` away.
    pub fn set_boresight(&mut self, found: &Boresight, range_m: f64, measured: Date) {
        self.calibration.boresight = found.angles;
        self.calibration.boresight_sigma = found.sigma().max(SIGMA_LEAST);
        self.made = measured;
        let how = format!("{} pulls at a mark {range_m} m away", found.residuals.len());
        self.boresight = Provenance::new(measured, how);
    }

    /// Takes over the trigger's latency that was found on that day.
    pub fn set_trigger(&mut self, found: &Latency, measured: Date) {
        self.calibration.trigger = Some(TriggerLatency {
            latency_ns: secs_to_ns(found.latency_s),
            sigma_ns: secs_to_ns(found.sigma_s).max(1),
        });
        self.made = measured;
        let how =
            format!("{} dry shots, {:.1} ms apart from each other", found.jolts.len(), found.spread_s * 1e3);
        self.trigger = Some(Provenance::new(measured, how));
    }
}
