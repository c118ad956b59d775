//! Why an import failed.

use std::{io, path::PathBuf};

use bowwave_calibration::CalibrationError;
use bowwave_record::RecordError;

/// Why an import failed. Nothing is left under the recording's name.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The folder or a file in it cannot be read.
    #[error("cannot read {path}: {source}; check that it exists and may be read")]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// No pictures in the folder.
    #[error("{folder} holds no pictures; put .jpg, .jpeg or .png files straight into it")]
    NoPictures {
        /// The folder.
        folder: PathBuf,
    },
    /// A file that is called a picture but is none.
    #[error("{path} is no picture that can be used: {what}; take it out of the folder or save it anew")]
    Picture {
        /// The file.
        path: PathBuf,
        /// Description of the error.
        what: String,
    },
    /// A picture of another size than those before it.
    #[error(
        "{path} is {}x{}, but the pictures before it are {}x{}; all must have one size",
        found.0, found.1, expected.0, expected.1
    )]
    PictureSize {
        /// The file.
        path: PathBuf,
        /// Its width and height.
        found: (u32, u32),
        /// Width and height of the first picture.
        expected: (u32, u32),
    },
    /// Not a rate at which pictures can follow each other.
    #[error("{rate_hz} pictures a second cannot be; give a rate from 0.1 to 1000")]
    Rate {
        /// The rate given.
        rate_hz: f64,
    },
    /// A program is not there.
    #[error("the program {program} is not installed, which reads videos; on Debian: apt-get install ffmpeg")]
    ProgramMissing {
        /// The program.
        program: String,
    },
    /// A program could not be run.
    #[error("the program {program} cannot be run: {source}; check its installation")]
    ProgramStart {
        /// The program.
        program: String,
        /// The system's reason.
        source: io::Error,
    },
    /// The file is no video.
    #[error("{path} is no video: {what}; give a file that a video player opens")]
    NotVideo {
        /// The file.
        path: PathBuf,
        /// Content that was found instead.
        what: String,
    },
    /// The video has no pictures.
    #[error(
        "{path} has a video track, but no picture in it could be read ({what}); the file is damaged, copy it again"
    )]
    NoFrames {
        /// The file.
        path: PathBuf,
        /// The reader's message.
        what: String,
    },
    /// The reader ended before the video did.
    #[error(
        "reading {path} stopped after {frames} pictures: {what}; copy the file again, or cut it before that place"
    )]
    Interrupted {
        /// The file.
        path: PathBuf,
        /// Pictures that were read.
        frames: u64,
        /// The reader's message.
        what: String,
    },
    /// There is a gyro track, but it cannot be understood.
    #[error("the gyro track of {path} cannot be used: {what}; import without it, or copy the file again")]
    Telemetry {
        /// The file.
        path: PathBuf,
        /// Description of the error.
        what: String,
    },
    /// The bias cannot be taken from the first seconds.
    #[error(
        "no gyro bias from the first {seconds} s: {what}; hold the camera still at the start, or use the calibration's bias"
    )]
    Bias {
        /// The span asked for.
        seconds: f64,
        /// Why not.
        what: String,
    },
    /// The calibration is that of another picture.
    #[error(
        "the calibration is for pictures of {}x{}, but these are {}x{}; give the calibration of this camera mode",
        calibration.0, calibration.1, picture.0, picture.1
    )]
    CalibrationSize {
        /// Width and height in the calibration.
        calibration: (u32, u32),
        /// Width and height of the pictures.
        picture: (u32, u32),
    },
    /// The calibration that the recording would carry is not acceptable.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// There is a file of that name already.
    #[error("{path} exists already; choose another name, or say that it may be replaced")]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The recording cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The finished recording could not be given its name.
    #[error("cannot write {path}: {source}; check the folder's permissions and space")]
    RecordingOutput {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The caller stopped it.
    #[error("the import was stopped; nothing was kept")]
    Stopped,
}
