//! The recording while it grows, and what it says about itself.

use std::{
    collections::BTreeMap,
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
};

use bowwave_calibration::{CalibrationFile, Provenance, to_toml};
use bowwave_core::{calibration::Calibration, geometry::Lens, time::Time};
use bowwave_record::{CameraInfo, Entry, Properties, RecordingWriter, WrittenSummary};
use glam::{DQuat, DVec2, DVec3};

use crate::{BiasSource, GyroBias, ImportError, ImportOptions};

/// A recording under construction, beside its final place. Dropped before [`RecordingOutput::finish`], it goes away.
pub(crate) struct RecordingOutput {
    path: PathBuf,
    partial: PathBuf,
    replace: bool,
    writer: Option<RecordingWriter>,
}

impl RecordingOutput {
    /// Begins a recording that will be called `path`.
    pub(crate) fn create(path: &Path, replace: bool, properties: &Properties) -> Result<Self, ImportError> {
        refuse_existing(path, replace)?;
        let mut partial = OsString::from(path);
        partial.push(".partial");
        let partial = PathBuf::from(partial);
        // What an import that was killed left behind is of no use to anyone.
        let mut output = Self { path: path.to_owned(), partial, replace, writer: None };
        output.writer = Some(RecordingWriter::replace(&output.partial, properties)?);
        Ok(output)
    }

    /// Appends an entry.
    pub(crate) fn write(&mut self, entry: &Entry) -> Result<(), ImportError> {
        match &mut self.writer {
            Some(writer) => Ok(writer.write(entry)?),
            None => Ok(()),
        }
    }

    /// Makes the recording whole and gives it its name.
    pub(crate) fn finish(mut self) -> Result<WrittenSummary, ImportError> {
        let fail = |source| ImportError::RecordingOutput { path: self.path.clone(), source };
        let Some(writer) = self.writer.take() else {
            return Err(fail(io::Error::other("the recording was never begun")));
        };
        let summary = writer.finish()?;
        refuse_existing(&self.path, self.replace)?;
        fs::rename(&self.partial, &self.path).map_err(fail)?;
        Ok(WrittenSummary { path: self.path.clone(), ..summary })
    }
}

impl Drop for RecordingOutput {
    fn drop(&mut self) {
        // Closed first: its last bytes need not be written any more.
        drop(self.writer.take());
        if let Err(e) = fs::remove_file(&self.partial)
            && e.kind() != io::ErrorKind::NotFound
        {
            log::warn!("the unfinished {} cannot be removed: {e}", self.partial.display());
        }
    }
}

/// Refuses to write over a recording that is not to be replaced.
pub(crate) fn refuse_existing(path: &Path, replace: bool) -> Result<(), ImportError> {
    if !replace && path.exists() { Err(ImportError::Exists { path: path.to_owned() }) } else { Ok(()) }
}

/// The calibration that a recording of such pictures carries: the one given, or assumptions that say so.
pub(crate) fn calibration_for(
    picture: (u32, u32),
    options: &ImportOptions,
) -> Result<CalibrationFile, ImportError> {
    let Some(file) = &options.calibration else { return Ok(assumed(picture, options)) };
    let lens = &file.calibration.lens;
    if (lens.width, lens.height) != picture {
        return Err(ImportError::CalibrationSize { calibration: (lens.width, lens.height), picture });
    }
    Ok(file.clone())
}

/// A calibration of pictures of that size in which nothing was measured: it says so, with uncertainties to match.
pub fn assumed((width, height): (u32, u32), options: &ImportOptions) -> CalibrationFile {
    let degrees = options.assumed_hfov_deg;
    let lens = Lens::pinhole(width, height, degrees.clamp(1.0, 150.0).to_radians());
    let calibration = Calibration {
        lens,
        focal_sigma_px: lens.focal.x * 0.2,
        camera_from_imu: DQuat::IDENTITY,
        camera_from_imu_sigma: DVec3::splat(1.0),
        time_offset_ns: 0,
        time_offset_sigma_ns: 50_000_000,
        readout_ns: 0,
        readout_sigma_ns: 0,
        boresight: DVec2::ZERO,
        boresight_sigma: 0.1,
        muzzle_in_camera: DVec3::ZERO,
        trigger: None,
        gyro_bias: DVec3::ZERO,
        gyro_bias_sigma: DVec3::splat(0.05),
    };
    let how = format!("assumed: a lens of {degrees} deg, the unit's axes those of the camera");
    CalibrationFile::new(options.today, "import without a calibration", how, calibration)
}

/// Puts the bias that was just measured in place of the file's.
pub(crate) fn set_bias(file: &mut CalibrationFile, bias: &GyroBias, options: &ImportOptions) {
    file.calibration.gyro_bias = bias.rate;
    file.calibration.gyro_bias_sigma = bias.sigma;
    let how = match bias.source {
        BiasSource::Pictures { patches } => {
            format!(
                "first {:.1} s of the video, against {patches} distant patches of its pictures",
                bias.seconds
            )
        }
        BiasSource::Rest => format!("mean of the first {:.1} s of the video, taken for rest", bias.seconds),
    };
    file.gyro_bias = Provenance::new(options.today, how);
}

/// Properties of a recording of such pictures.
pub(crate) fn properties(
    file: &CalibrationFile,
    start: Time,
    source: String,
    picture: (u32, u32),
    extra: BTreeMap<String, String>,
    options: &ImportOptions,
) -> Properties {
    Properties {
        calibration_toml: to_toml(file),
        scenario_toml: options.scenario_toml.clone(),
        loop_ns: None,
        start,
        source,
        picture,
        camera_info: Some(CameraInfo::from_lens(&file.calibration.lens)),
        extra,
    }
}

/// A camera of 854x480 with a unit mounted as a GoPro's, for tests.
#[cfg(test)]
pub(crate) fn tests_calibration() -> Calibration {
    let options = ImportOptions::new(bowwave_calibration::Date::new(2026, 11, 21).unwrap());
    let mut calibration = assumed((854, 480), &options).calibration;
    calibration.camera_from_imu = DQuat::from_xyzw(0.0, 1.0, -1.0, 0.0).normalize();
    calibration.time_offset_ns = -30_000_000;
    calibration
}
