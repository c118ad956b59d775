//! Pictures of the board, from a folder or a recording.

use std::{io::Cursor, path::Path};

use anyhow::{Context, Result, bail};
use bowwave_calibration::{
    lens::BoardView,
    target::{Grey, Target, detect, view},
};
use bowwave_files::picture_bytes;
use bowwave_import::picture_names;
use bowwave_record::{Entry, RecordingReader};
use image::{GrayImage, ImageFormat, ImageReader, Limits};

use super::input::{progress, read};

/// Most pictures of a recording that are looked at, evenly over its length.
const LOOKED_MOST: u64 = 240;

/// Boards found in pictures of one camera.
#[derive(Clone, Debug, Default)]
pub struct BoardPictures {
    /// Their width and height, pixels.
    pub size: (u32, u32),
    /// Each with the board's corners in it, none where it shows no board.
    pub views: Vec<(String, BoardView)>,
    /// The recording's own calibration, where it has one.
    pub calibration_toml: Option<String>,
}

impl BoardPictures {
    fn take(&mut self, name: String, picture: &GrayImage, target: &Target) -> Result<()> {
        let size = picture.dimensions();
        if self.views.is_empty() {
            self.size = size;
        } else if size != self.size {
            bail!(
                "{name} has {}x{} pixels, those before it {}x{}; keep pictures of one camera and one mode in a folder",
                size.0,
                size.1,
                self.size.0,
                self.size.1
            );
        }
        let grey = Grey::new(size.0 as usize, size.1 as usize, picture.as_raw()).with_context(|| {
            format!("{name} has {}x{} pixels; at most {} a side", size.0, size.1, Grey::SIDE_MAX)
        })?;
        self.views.push((name, view(target, &detect(target, &grey))));
        Ok(())
    }
}

/// Looks for the board in all pictures of a folder, or in many of a recording.
pub fn look(source: &Path, target: &Target) -> Result<BoardPictures> {
    if !source.exists() {
        bail!(
            "no file or folder {}; name a folder of pictures of the board, or a recording",
            source.display()
        );
    }
    let mut looked = BoardPictures::default();
    if source.is_dir() {
        folder(source, target, &mut looked)?;
    } else {
        recording(source, target, &mut looked)?;
    }
    Ok(looked)
}

/// Reads a picture as it lies in the file: that is how the trainer gets it from the camera.
pub fn read_picture(path: &Path) -> Result<GrayImage> {
    let bytes = picture_bytes(path)?;
    let mut reader = ImageReader::new(Cursor::new(&bytes)).with_guessed_format()?;
    let mut limits = Limits::default();
    let side = u32::try_from(Grey::SIDE_MAX).unwrap_or(u32::MAX);
    (limits.max_image_width, limits.max_image_height) = (Some(side), Some(side));
    reader.limits(limits);
    Ok(reader.decode()?.into_luma8())
}

fn folder(source: &Path, target: &Target, looked: &mut BoardPictures) -> Result<()> {
    let names = picture_names(source)?;
    if names.is_empty() {
        bail!("{} has no JPEG or PNG pictures; put those of the board into it", source.display());
    }
    let bar = progress(names.len() as u64);
    for path in names {
        bar.inc(1);
        let said = || format!("cannot read the picture {}; take it out of the folder", path.display());
        let picture = read_picture(&path).with_context(said)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        looked.take(name, &picture, target)?;
    }
    bar.finish_and_clear();
    Ok(())
}

fn recording(source: &Path, target: &Target, looked: &mut BoardPictures) -> Result<()> {
    let reader = RecordingReader::open(source)?;
    looked.calibration_toml = Some(reader.properties().calibration_toml.clone());
    let frames = reader.counts().frames;
    let step = frames.div_ceil(LOOKED_MOST).max(1);
    let bar = progress(frames);
    let mut number = 0_u64;
    read(&reader, |entry| {
        let Entry::Frame(frame) = entry else { return Ok(()) };
        bar.inc(1);
        number += 1;
        if !(number - 1).is_multiple_of(step) {
            return Ok(());
        }
        match image::load_from_memory_with_format(&frame.jpeg, ImageFormat::Jpeg) {
            Ok(picture) => looked.take(format!("picture {number}"), &picture.into_luma8(), target)?,
            Err(why) => log::warn!("picture {number} is no whole JPEG ({why}): left out"),
        }
        Ok(())
    })?;
    bar.finish_and_clear();
    Ok(())
}
