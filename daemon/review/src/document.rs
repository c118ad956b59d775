//! A page that is ready to be written.

use std::{
    fs::File,
    io::{self, BufWriter, Write as _},
    path::{Path, PathBuf},
};

use base64::{engine::general_purpose::STANDARD, write::EncoderWriter};
use bowwave_files::plain_file;

/// The element that holds a video's bytes.
pub const VIDEO_ELEMENT: &str = "<script type=\"text/plain\" id=\"video-data\">";

/// A page, with a video that is put into it as it is written: a run's may be larger than memory is to be.
#[derive(Debug)]
pub struct Document {
    text: String,
    video: Option<PathBuf>,
}

impl Document {
    /// A page whose video element, where it has one, is to hold the file at `video`.
    pub const fn new(text: String, video: Option<PathBuf>) -> Self {
        Self { text, video }
    }

    /// The page without its video's bytes.
    pub fn into_text(self) -> String {
        self.text
    }

    /// Writes the page to a new file at `path`.
    ///
    /// # Errors
    /// Where it cannot be written, or its video not be read.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        let mut file = BufWriter::new(File::create(path)?);
        let place = self.text.find(VIDEO_ELEMENT).map(|at| at + VIDEO_ELEMENT.len());
        match (&self.video, place) {
            (Some(video), Some(place)) => {
                let (before, after) = self.text.split_at(place);
                file.write_all(before.as_bytes())?;
                let mut coder = EncoderWriter::new(&mut file, &STANDARD);
                io::copy(&mut plain_file(video)?, &mut coder)?;
                coder.finish()?;
                drop(coder);
                file.write_all(after.as_bytes())?;
            }
            _ => file.write_all(self.text.as_bytes())?,
        }
        file.flush()
    }
}
