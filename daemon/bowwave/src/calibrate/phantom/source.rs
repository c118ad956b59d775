//! Sources of outlines: a recording, the camera, a picture, or nothing but the calibration.

use std::path::Path;

use anyhow::{Context, Result, bail};
use bowwave_calibration::{CalibrationFile, outline::OutlineFinder};
use bowwave_core::event::Event;

use super::{
    super::{
        input::{OpenedRecording, open},
        pictures::read_picture,
    },
    live::LiveCamera,
};
use crate::cli::CalibratePhantom;

/// What the gun is seen in, with the calibration that goes with it.
pub enum Seen {
    /// Pictures in which the gun turns.
    Recording(Box<OpenedRecording>),
    /// The camera's pictures as they come.
    Live(Box<LiveCamera>),
    /// One picture: codes, rows from the top.
    Picture(Box<CalibrationFile>, Vec<u8>),
    /// None: outlines are known without one.
    Nothing(Box<CalibrationFile>),
}

impl Seen {
    /// Opens what the arguments name.
    pub fn open(arguments: &CalibratePhantom) -> Result<Self> {
        if arguments.live {
            return Ok(Self::Live(Box::new(LiveCamera::open(arguments)?)));
        }
        Self::open_file(arguments.recording.as_deref(), arguments.files.calibration.as_deref())
    }

    /// Opens a recording or a picture.
    fn open_file(path: Option<&Path>, calibration: Option<&Path>) -> Result<Self> {
        let named = || {
            let said = "name the calibration with --calibration: the lens decides where the gun is seen";
            CalibrationFile::read(calibration.context(said)?).map_err(anyhow::Error::from)
        };
        let Some(path) = path else { return Ok(Self::Nothing(Box::new(named()?))) };
        if !is_picture(path) {
            return Ok(Self::Recording(Box::new(open(path, calibration)?)));
        }
        let file = named()?;
        let picture = read_picture(path).with_context(|| {
            format!("cannot read the picture {}; give one as the camera took it", path.display())
        })?;
        let (lens, size) = (&file.calibration.lens, picture.dimensions());
        if size != (lens.width, lens.height) {
            bail!(
                "{} has {}x{} pixels, the calibrated lens makes pictures of {}x{}; take it with that camera and mode, unscaled",
                path.display(),
                size.0,
                size.1,
                lens.width,
                lens.height
            );
        }
        Ok(Self::Picture(Box::new(file), picture.into_raw()))
    }

    /// The calibration.
    pub fn file(&self) -> &CalibrationFile {
        match self {
            Self::Recording(opened) => &opened.file,
            Self::Live(camera) => camera.file(),
            Self::Picture(file, _) | Self::Nothing(file) => file,
        }
    }

    /// Closes the camera, where there is one.
    pub fn close(self) -> Result<()> {
        match self {
            Self::Live(camera) => Ok(camera.close()?),
            Self::Recording(_) | Self::Picture(..) | Self::Nothing(_) => Ok(()),
        }
    }

    /// Shows the pictures of a recording or of the camera to the finder; tells whether a recording was cut short.
    pub fn show(&self, finder: &mut OutlineFinder) -> Result<bool> {
        let opened = match self {
            Self::Recording(opened) => opened,
            Self::Live(camera) => return camera.show(finder).map(|()| false),
            Self::Picture(..) | Self::Nothing(_) => return Ok(false),
        };
        opened.play(true, |event| {
            if let Event::Frame(frame) = event {
                finder.see(&frame.picture);
            }
        })
    }

    /// Shows the camera's pictures that came meanwhile to the finder; tells whether there is a new picture to trace on.
    pub fn refresh(&self, finder: &mut OutlineFinder) -> bool {
        matches!(self, Self::Live(camera) if camera.refresh(finder))
    }

    /// The picture that outlines are drawn on: the mean of those that `finder` saw, the one picture, or black.
    pub fn picture(&self, finder: &OutlineFinder) -> Vec<u8> {
        match self {
            Self::Picture(_, codes) => codes.clone(),
            _ => finder.mean(),
        }
    }
}

/// Whether a file's name is that of a picture.
fn is_picture(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    matches!(ending.as_deref(), Some("png" | "jpg" | "jpeg"))
}
