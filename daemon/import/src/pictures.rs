//! A recording from a folder of pictures.

use std::{
    collections::BTreeMap,
    fs,
    io::{Cursor, ErrorKind},
    ops::ControlFlow,
    os::unix::ffi::OsStrExt as _,
    path::{Path, PathBuf},
    sync::Arc,
};

use bowwave_core::{text::one_line, time::NS_PER_S};
use bowwave_files::picture_bytes;
use bowwave_record::{Entry, FrameEntry, recording::JPEG_MAX_BYTES};
use image::{ImageFormat, ImageReader, codecs::jpeg::JpegEncoder};

use crate::{
    ImportError, ImportOptions, ImportReport, Progress, START, TelemetryReport, natural,
    output::{RecordingOutput, calibration_for, properties, refuse_existing},
};

/// Quality of pictures that were not JPEG, on the encoder's scale to 100.
const JPEG_QUALITY: u8 = 95;

/// Makes the recording `out` from the JPEG and PNG pictures in `folder`, in the order of their names (numbers by value),
/// `rate_hz` of them a second. JPEG files are taken over byte for byte. `progress` is called after each picture and may
/// stop the import.
pub fn import_pictures(
    folder: &Path,
    rate_hz: f64,
    out: &Path,
    options: &ImportOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<ImportReport, ImportError> {
    if !(0.1..=1000.0).contains(&rate_hz) {
        return Err(ImportError::Rate { rate_hz });
    }
    refuse_existing(out, options.replace)?;
    let names = picture_names(folder)?;
    let Some(first) = names.first() else {
        return Err(ImportError::NoPictures { folder: folder.to_owned() });
    };
    let (_, picture) = read_picture(first)?;
    let calibration = calibration_for(picture, options)?;
    let source = format!("pictures of {}", folder.display());
    let extra = BTreeMap::from([("rate_hz".to_owned(), rate_hz.to_string())]);
    let mut output = RecordingOutput::create(
        out,
        options.replace,
        &properties(&calibration, START, source, picture, extra, options),
    )?;

    let frames_total = Some(names.len() as u64);
    let interval_ns = NS_PER_S as f64 / rate_hz;
    let mut frames = 0_u32;
    for name in &names {
        let (jpeg, size) = read_picture(name)?;
        if size != picture {
            return Err(ImportError::PictureSize { path: name.clone(), found: size, expected: picture });
        }
        let mid_exposure = START.plus_ns((f64::from(frames) * interval_ns).round() as i64);
        // A camera hands a picture over about when it begins the next.
        let arrival = mid_exposure.plus_ns(interval_ns.round() as i64);
        output.write(&Entry::Frame(FrameEntry {
            arrival,
            mid_exposure,
            sequence: frames,
            jpeg: jpeg.into(),
            is_recoded: false,
        }))?;
        frames += 1;
        if progress(Progress { frames: frames.into(), frames_total }).is_break() {
            return Err(ImportError::Stopped);
        }
    }
    let written = output.finish()?;
    Ok(ImportReport {
        path: written.path,
        frames: frames.into(),
        imu_samples: 0,
        duration_ns: written.duration_ns,
        bytes: written.bytes,
        picture,
        telemetry: TelemetryReport::None,
        warnings: Vec::new(),
    })
}

/// The JPEG and PNG files of a folder in the order that people expect: `frame2` before `frame10`.
pub fn picture_names(folder: &Path) -> Result<Vec<PathBuf>, ImportError> {
    let fail = |source| ImportError::Read { path: folder.to_owned(), source };
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        // Names that begin with a dot are other programs' by-products.
        let hidden = path.file_name().is_some_and(|n| n.as_bytes().starts_with(b"."));
        if !hidden && format_of(&path).is_some() && path.is_file() {
            names.push(path);
        }
    }
    names.sort_by(|a, b| natural::compare(a.as_os_str().as_bytes(), b.as_os_str().as_bytes()));
    Ok(names)
}

fn format_of(path: &Path) -> Option<ImageFormat> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    match extension.as_str() {
        "jpg" | "jpeg" => Some(ImageFormat::Jpeg),
        "png" => Some(ImageFormat::Png),
        _ => None,
    }
}

/// A picture as JPEG, with its width and height.
fn read_picture(path: &Path) -> Result<(Vec<u8>, (u32, u32)), ImportError> {
    let unusable = |what: String| ImportError::Picture { path: path.to_owned(), what };
    let bytes = picture_bytes(path).map_err(|source| match source.kind() {
        ErrorKind::UnexpectedEof | ErrorKind::FileTooLarge => unusable(source.to_string()),
        _ => ImportError::Read { path: path.to_owned(), source },
    })?;
    // The content says what it is; a name may be wrong.
    let format =
        image::guess_format(&bytes).map_err(|_| unusable("it is neither JPEG nor PNG".to_owned()))?;
    let reader = || ImageReader::with_format(Cursor::new(bytes.as_slice()), format);
    let size = reader().into_dimensions().map_err(|e| unusable(one_line(&e.to_string())))?;
    if size.0 > 8192 || size.1 > 8192 {
        return Err(unusable(format!("it is {}x{}, and the largest is 8192x8192", size.0, size.1)));
    }
    let jpeg = match format {
        ImageFormat::Jpeg => bytes,
        ImageFormat::Png => {
            let colours = reader().decode().map_err(|e| unusable(one_line(&e.to_string())))?.to_rgb8();
            let mut jpeg = Vec::new();
            JpegEncoder::new_with_quality(&mut jpeg, JPEG_QUALITY)
                .encode_image(&colours)
                .map_err(|e| unusable(one_line(&e.to_string())))?;
            jpeg
        }
        other => return Err(unusable(format!("it is {other:?}, not JPEG or PNG"))),
    };
    if jpeg.len() > JPEG_MAX_BYTES {
        return Err(unusable(format!("it has {} bytes, and the most is {JPEG_MAX_BYTES}", jpeg.len())));
    }
    Ok((jpeg, size))
}

/// Width and height that a JPEG states; kept with the reader of pictures so that both importers agree.
pub(crate) fn jpeg_size(jpeg: &Arc<[u8]>) -> Option<(u32, u32)> {
    ImageReader::with_format(Cursor::new(&**jpeg), ImageFormat::Jpeg).into_dimensions().ok()
}
