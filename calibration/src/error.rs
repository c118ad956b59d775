//! What can be wrong with a calibration file.

use std::{io, path::PathBuf};

/// Why there is no calibration, or why it could not be kept.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// No TOML, an unknown or a missing key, or a value of another kind.
    #[error("{origin}:{line}:{column}: {message}; mend the calibration file there")]
    Syntax {
        /// File name, or what stands for one.
        origin: String,
        /// Line, from 1.
        line: usize,
        /// Column in characters, from 1.
        column: usize,
        /// What is wrong.
        message: String,
    },
    /// A value that cannot be right.
    #[error("{origin}:{line}:{column}: {key} {problem}; measure it again or mend the calibration file there")]
    Value {
        /// File name, or what stands for one.
        origin: String,
        /// Line, from 1.
        line: usize,
        /// Column in characters, from 1.
        column: usize,
        /// Section and key.
        key: &'static str,
        /// What it is and what it must be.
        problem: String,
    },
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
        "cannot write the calibration {path}: {source}; the former one is kept, check the folder's permissions and space"
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
