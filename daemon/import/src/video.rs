//! A recording from a video, with its gyro where it has one.

use std::{collections::BTreeMap, ops::ControlFlow, path::Path, sync::Arc};

use bowwave_core::{event::ImuSample, geometry::look, time::Time};
use bowwave_files::plain_file;
use bowwave_record::{Entry, FrameEntry};
use glam::{DQuat, DVec3};

use crate::{
    GyroBias, ImportError, ImportOptions, ImportReport, Level, Progress, START, Telemetry, TelemetryReport,
    bias,
    ffmpeg::{VideoFrame, VideoInfo, VideoReader, probe},
    gyro::GyroPath,
    output::{RecordingOutput, calibration_for, properties, refuse_existing, set_bias},
    pictures::jpeg_size,
    sight::{self, PatchWatch},
    telemetry::read_telemetry,
    track::Gray,
};

/// Makes the recording `out` from a video: its pictures with the times that the container gives them, and the samples of
/// the gyro that the camera put into it. `progress` is called after each picture and may stop the import.
pub fn import_video(
    video: &Path,
    out: &Path,
    options: &ImportOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<ImportReport, ImportError> {
    refuse_existing(out, options.replace)?;
    // The system's own reason is better than what a program makes of it.
    plain_file(video).map_err(|source| ImportError::Read { path: video.to_owned(), source })?;
    let info = probe(&options.ffmpeg, video)?;
    let gyro = VideoGyro::read(video, options)?;
    let mut reader = VideoReader::start(&options.ffmpeg, video, None)?;
    let Some(first) = reader.next_frame()? else {
        reader.finish()?;
        return Err(ImportError::NoFrames { path: video.to_owned(), what: "the track is empty".to_owned() });
    };
    let mut import = VideoImport::begin(video, out, options, info, &gyro, first)?;
    loop {
        if progress(Progress { frames: import.frames.into(), frames_total: info.frames }).is_break() {
            return Err(ImportError::Stopped);
        }
        let Some(frame) = reader.next_frame()? else { break };
        import.add(&frame)?;
    }
    let mut warnings = reader.finish()?;
    if gyro.telemetry.is_some() && options.calibration.is_none() {
        warnings.push(
            "without a calibration nobody knows how the gyro is turned; its axes are taken for the camera's"
                .to_owned(),
        );
    }
    import.finish(&gyro, warnings)
}

/// The video's gyro and what became of it.
struct VideoGyro {
    telemetry: Option<Telemetry>,
    bias: Option<GyroBias>,
    report: TelemetryReport,
}

impl VideoGyro {
    fn read(video: &Path, options: &ImportOptions) -> Result<Self, ImportError> {
        if options.without_gyro {
            return Ok(Self { telemetry: None, bias: None, report: TelemetryReport::LeftOut });
        }
        let Some(mut telemetry) = read_telemetry(&options.ffmpeg, video)? else {
            return Ok(Self { telemetry: None, bias: None, report: TelemetryReport::Absent });
        };
        let bias =
            options.bias_from_s.map(|s| find_bias(video, &telemetry.samples, s, options)).transpose()?;
        if let Some(level) = options.level {
            orient(&mut telemetry.samples, options, bias.as_ref(), level);
        }
        let report =
            TelemetryReport::Used { camera: telemetry.camera.clone(), rate_hz: telemetry.rate_hz, bias };
        Ok(Self { telemetry: Some(telemetry), bias, report })
    }

    fn samples(&self) -> &[ImuSample] {
        self.telemetry.as_ref().map_or(&[], |t| t.samples.as_slice())
    }
}

/// Gives every sample the attitude that the gyro leads to from a camera that was held like `level` at the first picture.
fn orient(samples: &mut [ImuSample], options: &ImportOptions, bias: Option<&GyroBias>, level: Level) {
    let calibration = options.calibration.as_ref().map(|file| &file.calibration);
    let rate = bias.map_or_else(|| calibration.map_or(DVec3::ZERO, |c| c.gyro_bias), |b| b.rate);
    let camera_from_imu = calibration.map_or(DQuat::IDENTITY, |c| c.camera_from_imu);
    let offset_ns = calibration.map_or(0, |c| c.time_offset_ns);
    let path = GyroPath::integrate(samples, rate);
    let first = path.world_from_imu(START.plus_ns(offset_ns));
    let world_from_path = look(0.0, level.elevation, level.roll) * camera_from_imu * first.inverse();
    for sample in samples {
        sample.world_from_imu = Some((world_from_path * path.world_from_imu(sample.arrival)).normalize());
    }
}

/// The bias from the first seconds: against the pictures where there is a calibration to look at them with and something in
/// them to hold on to, else from rest.
fn find_bias(
    video: &Path,
    samples: &[ImuSample],
    seconds: f64,
    options: &ImportOptions,
) -> Result<GyroBias, ImportError> {
    let rest = bias::at_rest(samples, seconds);
    let Some(file) = &options.calibration else { return rest };
    if let Err(ImportError::Bias { what, .. }) = &rest {
        log::debug!("no bias from rest: {what}");
    }
    if !(2.0..=60.0).contains(&seconds) {
        return rest;
    }
    let mut watch = PatchWatch::new();
    let mut reader = VideoReader::start(&options.ffmpeg, video, Some(seconds))?;
    while let Some(frame) = reader.next_frame()? {
        let unreadable =
            |e: image::ImageError| ImportError::NoFrames { path: video.to_owned(), what: e.to_string() };
        let gray = Gray::from_jpeg(&frame.jpeg).map_err(unreadable)?;
        let lens = &file.calibration.lens;
        let picture = (gray.width() as u32, gray.height() as u32);
        if (lens.width, lens.height) != picture {
            return Err(ImportError::CalibrationSize { calibration: (lens.width, lens.height), picture });
        }
        watch.see(START.plus_ns(frame.time_ns), &gray);
    }
    reader.finish()?;
    match sight::bias(samples, &file.calibration, &watch.finish()) {
        Some(bias) => Ok(bias),
        None => rest,
    }
}

/// An import under way.
struct VideoImport<'a> {
    output: RecordingOutput,
    /// Samples that are not yet written.
    samples: &'a [ImuSample],
    picture: (u32, u32),
    interval_ns: i64,
    frames: u32,
}

impl<'a> VideoImport<'a> {
    fn begin(
        video: &Path,
        out: &Path,
        options: &ImportOptions,
        info: VideoInfo,
        gyro: &'a VideoGyro,
        first: VideoFrame,
    ) -> Result<Self, ImportError> {
        let jpeg: Arc<[u8]> = first.jpeg.as_slice().into();
        let picture = jpeg_size(&jpeg).ok_or_else(|| ImportError::NoFrames {
            path: video.to_owned(),
            what: "the first one is broken".to_owned(),
        })?;
        let mut file = calibration_for(picture, options)?;
        let mut extra = BTreeMap::new();
        if let Some(telemetry) = &gyro.telemetry {
            extra.insert("camera".to_owned(), telemetry.camera.clone());
            extra.insert("gyro_rate_hz".to_owned(), telemetry.rate_hz.to_string());
        }
        if let Some(bias) = &gyro.bias {
            set_bias(&mut file, bias, options);
        }
        let samples = gyro.samples();
        let start = samples.first().map_or(START, |s| s.arrival.min(START));
        let source = format!("video {}", video.display());
        let output = RecordingOutput::create(
            out,
            options.replace,
            &properties(&file, start, source, picture, extra, options),
        )?;
        let mut import = Self { output, samples, picture, interval_ns: info.interval_ns, frames: 0 };
        import.add(&first)?;
        Ok(import)
    }

    fn add(&mut self, frame: &VideoFrame) -> Result<(), ImportError> {
        let mid_exposure = START.plus_ns(frame.time_ns);
        // A camera hands a picture over about when it begins the next.
        let arrival = mid_exposure.plus_ns(self.interval_ns);
        self.write_samples_before(arrival)?;
        let jpeg = frame.jpeg.as_slice().into();
        self.output.write(&Entry::Frame(FrameEntry {
            arrival,
            mid_exposure,
            sequence: self.frames,
            jpeg,
            is_recoded: false,
        }))?;
        self.frames = self.frames.wrapping_add(1);
        Ok(())
    }

    fn write_samples_before(&mut self, time: Time) -> Result<(), ImportError> {
        let count = self.samples.partition_point(|s| s.arrival < time);
        let (now, later) = self.samples.split_at(count);
        for sample in now {
            self.output.write(&Entry::Imu(*sample))?;
        }
        self.samples = later;
        Ok(())
    }

    fn finish(mut self, gyro: &VideoGyro, warnings: Vec<String>) -> Result<ImportReport, ImportError> {
        // What came after the last picture is of no use, but for the few samples that its pose needs.
        let written = self.output.finish()?;
        self.samples = &[];
        Ok(ImportReport {
            path: written.path,
            frames: self.frames.into(),
            imu_samples: written.counts.imu,
            duration_ns: written.duration_ns,
            bytes: written.bytes,
            picture: self.picture,
            telemetry: gyro.report.clone(),
            warnings,
        })
    }
}
