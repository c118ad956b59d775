//! Errors of calibration files.

use std::{io, path::PathBuf};

use bowwave_core::text::toml::TomlError;

/// Why there is no calibration, or why it could not be kept.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// A text that is no calibration: no TOML, an unknown or a missing key, or a value that cannot be right.
    #[error("{0}; mend the calibration file there, or measure again")]
    Text(TomlError),
    /// The file could not be read.
    #[error("cannot read the calibration {path}: {source}; check that it exists and may be read")]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file could not be written; what was there before is untouched.
    #[error(
        "cannot write the calibration {path}: {source}; what stood there is untouched, check the folder's permissions and space"
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// There is no kept copy of that number.
    #[error(
        "no copy number {number} of {path} is kept; `bowwave calibrate restore --list` shows those that are"
    )]
    NotKept {
        /// The calibration file.
        path: PathBuf,
        /// The number.
        number: u32,
    },
    /// A calibration made in memory that a reader would refuse; nothing was written.
    #[error("the calibration is not written, because it could not be read back: {0}")]
    Unreadable(Box<CalibrationError>),
}

impl From<TomlError> for CalibrationError {
    fn from(error: TomlError) -> Self {
        Self::Text(error)
    }
}
