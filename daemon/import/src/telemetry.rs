//! Gyro and accelerometer of a GoPro video, from its GPMF track.
//!
//! The camera stamps the first sample of each block of about a second: with microseconds (`STMP`), milliseconds (`TICK`,
//! HERO5) or, failing both, through the container. The samples' times come from a straight line through those stamps, so that
//! their rate is the camera's own. Where the line begins is the container's word: the first payload begins when the pictures
//! do. What is constant in the difference of the two is left to the calibration's time offset.

use std::{
    fs::File,
    io::{self, Read as _, Seek as _, SeekFrom},
    path::Path,
};

use bowwave_core::event::ImuSample;
use bowwave_files::plain_file;
use glam::DVec3;

use crate::{
    ImportError, START,
    clock_fit::ClockFit,
    ffmpeg::{GpmfPacket, gpmf_packets},
    gpmf::{self, SensorBlock},
};

/// A camera's gyro and accelerometer.
#[derive(Clone, Debug, PartialEq)]
pub struct Telemetry {
    /// The camera's own name; may be empty.
    pub camera: String,
    /// Gyro samples a second by the camera's clock.
    pub rate_hz: f64,
    /// In the order of their time, the accelerometer interpolated to the gyro's times. `device_time_ns` is the camera's own
    /// clock, `arrival` the recording's, on which the first picture was taken at [`START`]. Axes are the track's channels,
    /// turned where the camera says how its sensor is.
    pub samples: Vec<ImuSample>,
}

/// Stamps farther than this off the line through them belong to no one clock.
const STAMP_WORST_MS: f64 = 100.0;
/// One payload holds about a second: tens of kilobytes.
const PAYLOAD_MAX_BYTES: u64 = 512 << 10;

/// The gyro and accelerometer of a video; `None` where it has no GPMF track. `ffmpeg` is the program beside which `ffprobe` lies.
///
/// # Errors
/// Where the file cannot be read, `ffprobe` cannot be run, or the track's content makes no sense.
pub fn read_telemetry(ffmpeg: &Path, path: &Path) -> Result<Option<Telemetry>, ImportError> {
    let read = |source| ImportError::Read { path: path.to_owned(), source };
    let fail = |what: String| ImportError::Telemetry { path: path.to_owned(), what };
    let mut file = plain_file(path).map_err(read)?;
    let Some(packets) = gpmf_packets(ffmpeg, path)? else { return Ok(None) };
    log::debug!("{}: {} payloads in the gyro track", path.display(), packets.len());
    let model = gpmf::camera_model(&ends(&mut file).map_err(read)?).unwrap_or_default();
    let mut blocks = Vec::with_capacity(packets.len());
    for packet in &packets {
        if packet.bytes > PAYLOAD_MAX_BYTES {
            let what = format!("a payload of it has {} bytes, more than any camera writes", packet.bytes);
            return Err(fail(what));
        }
        let payload = read_payload(&mut file, packet).map_err(read)?;
        blocks.extend(PayloadBlock::of(&payload, packet, &model).map_err(fail)?);
    }
    let camera = if model.is_empty() { model } else { format!("GoPro {model}") };
    assemble(camera, &blocks).map(Some).map_err(fail)
}

/// The first and last bytes of a file, in which its camera is named: the larger the file, the larger its index.
fn ends(file: &mut File) -> io::Result<Vec<u8>> {
    let length = file.seek(SeekFrom::End(0))?;
    let reach = match length >> 30 {
        0..5 => 2 << 20,
        5..30 => 10 << 20,
        _ => 30 << 20,
    };
    let mut out = Vec::new();
    file.rewind()?;
    file.by_ref().take(if length > 2 * reach { reach } else { length }).read_to_end(&mut out)?;
    if length > 2 * reach {
        file.seek(SeekFrom::Start(length - reach))?;
        file.by_ref().take(reach).read_to_end(&mut out)?;
    }
    Ok(out)
}

fn read_payload(file: &mut File, packet: &GpmfPacket) -> io::Result<Vec<u8>> {
    let mut out = Vec::new();
    file.seek(SeekFrom::Start(packet.offset))?;
    file.by_ref().take(packet.bytes).read_to_end(&mut out)?;
    Ok(out)
}

/// Gyro and accelerometer of one payload.
#[derive(Clone, Debug, Default)]
struct PayloadBlock {
    start_ms: f64,
    duration_ms: f64,
    gyro: SensorBlock,
    accel: SensorBlock,
}

impl PayloadBlock {
    /// `None` for a payload that is none: what was lost of it leaves a gap, which the camera's count tells.
    fn of(payload: &[u8], packet: &GpmfPacket, model: &str) -> Result<Option<Self>, String> {
        let streams = match gpmf::streams(payload) {
            Ok(streams) => streams,
            Err(e) => {
                log::debug!("the payload at byte {} is left out: {e}", packet.offset);
                return Ok(None);
            }
        };
        let sensor = |key: &[u8; 4]| match streams.iter().rev().find(|s| s.key() == Some(*key)) {
            Some(stream) => stream
                .sensor(model)
                .map_err(|what| format!("its {} block {what}", String::from_utf8_lossy(key))),
            None => Ok(SensorBlock::default()),
        };
        let (gyro, accel) = (sensor(b"GYRO")?, sensor(b"ACCL")?);
        Ok(Some(Self { start_ms: packet.start_ms, duration_ms: packet.duration_ms, gyro, accel }))
    }
}

/// A stream's samples with the camera's count of the sample that each block begins with, and its clock.
struct TimedStream<'a> {
    runs: Vec<(f64, &'a [DVec3])>,
    clock: ClockFit,
}

fn timed<'a>(
    blocks: &'a [PayloadBlock],
    stream: impl Fn(&'a PayloadBlock) -> &'a SensorBlock,
    by_container: bool,
) -> Option<TimedStream<'a>> {
    let mut runs = Vec::new();
    let mut stamps = Vec::new();
    let mut counted = 0.0;
    for block in blocks {
        let part = stream(block);
        let count = part.values.len() as f64;
        if part.values.is_empty() {
            continue;
        }
        // The camera counts on through payloads that were lost.
        let first = part.total.map_or(counted, |t| f64::from(t) - count).max(counted);
        counted = first + count;
        runs.push((first, part.values.as_slice()));
        if by_container {
            stamps.push((first, block.start_ms));
        } else {
            stamps.push((first, part.stamp_ms?));
        }
    }
    if let ([only], Some(block)) = (runs.as_slice(), blocks.first()) {
        stamps.push((only.0 + only.1.len() as f64, stamps.first()?.1 + block.duration_ms));
    }
    let clock = ClockFit::through(&stamps)?;
    Some(TimedStream { runs, clock })
}

/// Value at `time_ms`, linear between samples, held at the ends.
fn value_at(points: &[(f64, DVec3)], time_ms: f64) -> DVec3 {
    let after = points.partition_point(|p| p.0 < time_ms);
    match (after.checked_sub(1).and_then(|i| points.get(i)), points.get(after)) {
        (Some(a), Some(b)) => a.1.lerp(b.1, (time_ms - a.0) / (b.0 - a.0)),
        (Some(end), None) | (None, Some(end)) => end.1,
        (None, None) => DVec3::ZERO,
    }
}

fn points(stream: &TimedStream<'_>) -> Vec<(f64, DVec3)> {
    let each = |(first, values): &(f64, &[DVec3])| {
        let first = *first;
        values
            .iter()
            .enumerate()
            .map(move |(i, v)| (stream.clock.at(first + i as f64), *v))
            .collect::<Vec<_>>()
    };
    stream.runs.iter().flat_map(each).collect()
}

fn assemble(camera: String, blocks: &[PayloadBlock]) -> Result<Telemetry, String> {
    let stamped = blocks
        .iter()
        .all(|b| [&b.gyro, &b.accel].iter().all(|s| s.values.is_empty() || s.stamp_ms.is_some()));
    let gyro =
        timed(blocks, |b| &b.gyro, !stamped).ok_or("it has no gyro samples, or their times do not run on")?;
    let accel = timed(blocks, |b| &b.accel, !stamped)
        .ok_or("it has no accelerometer samples, or their times do not run on")?;
    for (name, stream) in [("gyro", &gyro), ("accelerometer", &accel)] {
        if stream.clock.worst_ms > STAMP_WORST_MS {
            let worst = stream.clock.worst_ms;
            return Err(format!("a {name} stamp is {worst:.0} ms off the line through the others"));
        }
    }
    // The container says when the first payload with samples begins, the camera's clock how the samples follow each other.
    let (first, _) = gyro.runs.first().ok_or("it has no gyro samples")?;
    let begins_ms = blocks.iter().find(|b| !b.gyro.values.is_empty()).map_or(0.0, |b| b.start_ms);
    let video_zero_ms = gyro.clock.at(*first) - begins_ms;
    let accel = points(&accel);
    let ns = |ms: f64| (ms * 1e6).round() as i64;
    let samples = points(&gyro)
        .into_iter()
        .map(|(time_ms, rate)| ImuSample {
            arrival: START.plus_ns(ns(time_ms - video_zero_ms)),
            device_time_ns: ns(time_ms),
            rate,
            accel: value_at(&accel, time_ms),
            world_from_imu: None,
        })
        .filter(|s| s.arrival.ns() >= 0)
        .collect::<Vec<_>>();
    Ok(Telemetry { camera, rate_hz: 1000.0 / gyro.clock.interval_ms, samples })
}
