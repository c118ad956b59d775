//! Photographs: read as they are meant to be looked at, with the focal length that they tell.

use std::{io::Cursor, path::Path, sync::Arc};

use anyhow::{Context, Result, bail};
use bowwave_core::event::{Picture, PixelFormat};
use bowwave_files::picture_bytes;
use image::{DynamicImage, ImageDecoder, ImageReader, Limits, RgbImage, metadata::Orientation};

use crate::still::{SIZE_RANGE, film_focal_px};

/// A photograph.
#[derive(Clone, Debug)]
pub struct Photo {
    /// Its pixels, upright.
    pub picture: Picture,
    /// The focal length that it tells, pixels.
    pub focal_px: Option<f64>,
}

impl Photo {
    /// Reads a JPEG or PNG file, turned as its camera says that it was held.
    pub fn read(path: &Path) -> Result<Self> {
        let said = || format!("cannot read the picture {}; name a JPEG or PNG file", path.display());
        let bytes = picture_bytes(path).with_context(said)?;
        let mut reader = ImageReader::new(Cursor::new(&bytes)).with_guessed_format().with_context(said)?;
        let mut limits = Limits::default();
        (limits.max_image_width, limits.max_image_height) =
            (Some(*SIZE_RANGE.end()), Some(*SIZE_RANGE.end()));
        reader.limits(limits);
        let mut decoder = reader.into_decoder().with_context(said)?;
        let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
        let told = decoder.exif_metadata().ok().flatten().and_then(|exif| film_focal_mm(&exif));
        let mut image = DynamicImage::from_decoder(decoder).with_context(said)?;
        image.apply_orientation(orientation);
        Self::new(image.into_rgb8(), &path.display().to_string(), told)
    }

    /// Wraps pixels. `name` is what errors call them, `film_mm` the 35 mm equivalent focal length, where it is known.
    pub fn new(image: RgbImage, name: &str, film_mm: Option<f64>) -> Result<Self> {
        let (width, height) = image.dimensions();
        if !SIZE_RANGE.contains(&width) || !SIZE_RANGE.contains(&height) {
            let (least, most) = SIZE_RANGE.into_inner();
            bail!("{name} has {width}x{height} pixels; each side must have {least} to {most}");
        }
        let picture = Picture::new(PixelFormat::Rgb, width, height, Arc::from(image.into_raw()))
            .with_context(|| format!("cannot use {name}"))?;
        Ok(Self { picture, focal_px: film_mm.map(|mm| film_focal_px(mm, (width, height))) })
    }
}

/// The tag FocalLengthIn35mmFilm, millimetres; `None` where it is missing, 0 (unknown) or nonsense.
fn film_focal_mm(exif: &[u8]) -> Option<f64> {
    let read = exif::Reader::new().read_raw(exif.to_vec()).ok()?;
    let field = read.get_field(exif::Tag::FocalLengthIn35mmFilm, exif::In::PRIMARY)?;
    let mm = f64::from(field.value.get_uint(0)?);
    (5.0..=5000.0).contains(&mm).then_some(mm)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A TIFF structure with an Exif folder of one SHORT.
    fn exif_with(tag: u16, value: u16) -> Vec<u8> {
        let mut bytes = b"II*\0\x08\0\0\0".to_vec();
        // IFD0: one entry, the pointer to the Exif folder at 26.
        bytes.extend([1, 0]);
        bytes.extend([0x69, 0x87, 4, 0, 1, 0, 0, 0, 26, 0, 0, 0]);
        bytes.extend([0, 0, 0, 0]);
        bytes.extend([1, 0]);
        bytes.extend(tag.to_le_bytes());
        bytes.extend([3, 0, 1, 0, 0, 0]);
        bytes.extend(value.to_le_bytes());
        bytes.extend([0, 0, 0, 0, 0, 0]);
        bytes
    }

    #[test]
    fn the_focal_length_of_the_camera_is_read() {
        assert_eq!(film_focal_mm(&exif_with(0xA405, 26)), Some(26.0));
        assert_eq!(film_focal_mm(&exif_with(0xA405, 0)), None);
        assert_eq!(film_focal_mm(&exif_with(0xA406, 26)), None);
        assert_eq!(film_focal_mm(b"nonsense"), None);
        let photo = Photo::new(RgbImage::new(640, 480), "x", Some(26.0)).expect("a photo");
        assert!((photo.focal_px.expect("a focal length") - 480.74).abs() < 0.01);
    }

    #[test]
    fn a_jpeg_that_ends_in_the_middle_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sea.jpg");
        RgbImage::from_pixel(64, 48, image::Rgb([90, 120, 150])).save(&path).unwrap();
        assert!(Photo::read(&path).is_ok());
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() * 3 / 4]).unwrap();
        let error = format!("{:#}", Photo::read(&path).unwrap_err());
        assert!(error.ends_with("ends in the middle; copy it again"), "{error}");
    }

    #[test]
    fn sizes_that_cannot_be_drawn_are_refused() {
        for (width, height) in [(1, 1), (15, 400), (400, 1), (8193, 20)] {
            let said = Photo::new(RgbImage::new(width, height), "x.png", None).unwrap_err().to_string();
            assert!(said.contains(&format!("{width}x{height}")), "{said}");
        }
    }
}
