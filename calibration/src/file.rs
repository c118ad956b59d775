//! A calibration with where it comes from, and its way to and from the disk.

use std::{
    fs::{self, File},
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use bowwave_core::calibration::Calibration;

use crate::{CalibrationError, Date, parse, to_toml};

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
    /// What or who made it.
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
    /// Where the gyro's bias comes from.
    pub gyro_bias: Provenance,
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
            gyro_bias: provenance,
            calibration,
        }
    }

    /// Reads and checks a file.
    pub fn read(path: &Path) -> Result<Self, CalibrationError> {
        let text = fs::read_to_string(path)
            .map_err(|source| CalibrationError::Read { path: path.to_owned(), source })?;
        parse(&text, &path.display().to_string())
    }

    /// Writes the file so that at every moment either the old or the new one is whole: to a temporary file beside it, synced,
    /// renamed over it. What was there before is kept with `.bak` added to its name.
    pub fn write(&self, path: &Path) -> Result<(), CalibrationError> {
        let text = to_toml(self);
        parse(&text, &path.display().to_string()).map_err(|e| CalibrationError::Unreadable(Box::new(e)))?;
        replace(path, text.as_bytes())
            .map_err(|source| CalibrationError::Write { path: path.to_owned(), source })
    }
}

/// The name under which [`CalibrationFile::write`] keeps the former file.
fn backup_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".bak");
    PathBuf::from(name)
}

fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    match fs::read(path) {
        Ok(former) => write_whole(folder, &backup_path(path), &former)?,
        Err(e) if e.kind() == io::ErrorKind::NotFound => {}
        Err(e) => return Err(e),
    }
    write_whole(folder, path, bytes)?;
    // The rename itself lies in the folder, which has its own place in the disk's cache.
    File::open(folder)?.sync_all()
}

fn write_whole(folder: &Path, path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut temporary =
        tempfile::Builder::new().prefix(".calibration-").suffix(".tmp").tempfile_in(folder)?;
    temporary.write_all(bytes)?;
    temporary.as_file().sync_all()?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // Temporary files are private to their maker; the daemon's user must be able to read the result.
        temporary.as_file().set_permissions(fs::Permissions::from_mode(0o644))?;
    }
    temporary.persist(path).map_err(|e| e.error)?;
    Ok(())
}
