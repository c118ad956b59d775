//! The calibration file: one codec that reads ([`parse`]) and writes ([`to_toml`]) it, how results are applied to it, and the copies of
//! those that were replaced ([`history`]).

mod apply;
mod date;
mod error;
pub mod history;
mod parse;
mod write;

pub use date::Date;
pub use error::CalibrationError;
pub use parse::{POLYGONS_MOST, parse};
pub use write::to_toml;

use std::path::Path;

use bowwave_core::{
    calibration::Calibration,
    own_ship::{OwnShip, Phantom},
    text::toml::TEXT_BYTES_MAX,
};
use bowwave_files::plain_text;
use glam::DVec2;

/// Source of the calibrations of simulated hardware, which are exact and do not age.
pub const SIMULATED: &str = "hw-sim";

/// When and how something was measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provenance {
    /// The day of the measurement.
    pub measured: Date,
    /// How it was measured; may be empty.
    pub how: String,
}

impl Provenance {
    /// Measured on that day in that way.
    pub fn new(measured: Date, how: impl Into<String>) -> Self {
        Self { measured, how: how.into() }
    }
}

/// All that a calibration file says.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationFile {
    /// The day on which the file was put together.
    pub made: Date,
    /// Program or person that made it.
    pub source: String,
    /// Make and model of the camera; may be empty.
    pub camera_name: String,
    /// Its serial number; may be empty.
    pub camera_serial: String,
    /// Make and model of the inertial unit; may be empty.
    pub imu_name: String,
    /// Its serial number; may be empty.
    pub imu_serial: String,
    /// Where the lens comes from.
    pub lens: Provenance,
    /// Where the rotation from the inertial unit to the camera comes from.
    pub camera_from_imu: Provenance,
    /// Where the time offset comes from.
    pub time_offset: Provenance,
    /// Where the shutter's readout time comes from; `None` where all rows are exposed at once.
    pub shutter: Option<Provenance>,
    /// Where the boresight comes from.
    pub boresight: Provenance,
    /// Where the trigger's latency comes from; `None` where it was not measured.
    pub trigger: Option<Provenance>,
    /// Where the gyro's bias comes from.
    pub gyro_bias: Provenance,
    /// Parts of the picture in which the sea is not to be looked for: polygons with corners in pixels, x right, y down, from the upper left
    /// corner.
    pub hidden: Vec<Vec<DVec2>>,
    /// The own gun and ship by their outlines: what hides boats, and is no sea either.
    pub phantoms: Vec<Phantom>,
    /// The checked numbers.
    pub calibration: Calibration,
}

impl CalibrationFile {
    /// A file whose values were all measured on the same day in the same way.
    pub fn new(
        made: Date,
        source: impl Into<String>,
        how: impl Into<String>,
        calibration: Calibration,
    ) -> Self {
        let provenance = Provenance::new(made, how);
        let rolling = calibration.readout_ns != 0;
        Self {
            made,
            source: source.into(),
            camera_name: String::new(),
            camera_serial: String::new(),
            imu_name: String::new(),
            imu_serial: String::new(),
            lens: provenance.clone(),
            camera_from_imu: provenance.clone(),
            time_offset: provenance.clone(),
            shutter: rolling.then(|| provenance.clone()),
            boresight: provenance.clone(),
            trigger: calibration.trigger.map(|_| provenance.clone()),
            gyro_bias: provenance,
            hidden: Vec::new(),
            phantoms: Vec::new(),
            calibration,
        }
    }

    /// The own gun and ship in the pictures: for the finders of horizon and sky line, and for what they hide.
    pub fn own_ship(&self) -> OwnShip {
        let lens = &self.calibration.lens;
        let bore = lens.project(self.calibration.bore_in_camera()).unwrap_or(lens.centre);
        OwnShip::new(self.phantoms.clone(), bore, &self.hidden, (lens.width, lens.height))
    }

    /// Reads and checks a file.
    pub fn read(path: &Path) -> Result<Self, CalibrationError> {
        let text = plain_text(path, TEXT_BYTES_MAX)
            .map_err(|source| CalibrationError::Read { path: path.to_owned(), source })?;
        parse(&text, &path.display().to_string())
    }

    /// Writes the file so that at every moment either the old or the new one is whole: to a temporary file beside it, synced,
    /// renamed over it. What was there before is kept ([`history`]).
    pub fn write(&self, path: &Path) -> Result<(), CalibrationError> {
        let text = to_toml(self);
        parse(&text, &path.display().to_string()).map_err(|e| CalibrationError::Unreadable(Box::new(e)))?;
        history::replace(path, text.as_bytes())
            .map_err(|source| CalibrationError::Write { path: path.to_owned(), source })
    }
}
