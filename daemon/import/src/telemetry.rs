//! Gyro and accelerometer of a GoPro video, from its GPMF track.
//!
//! The camera stamps the first sample of each block of about a second: with microseconds (`STMP`), milliseconds (`TICK`,
//! HERO5) or, failing both, through the container. The samples' times come from a straight line through those stamps, so that
//! their rate is the camera's own. Where the line begins is the container's word: the first payload begins when the pictures
//! do. What is constant in the difference of the two is left to the calibration's time offset.

use std::{
    fs::File,
    panic::{self, PanicHookInfo},
    path::Path,
    sync::Once,
};

use bowwave_core::event::ImuSample;
use glam::DVec3;
use telemetry_parser::tags_impl::{
    GetWithType as _, GroupId, GroupedTagMap, TagId, TagMap, TagValue, Vector3,
};

use crate::{ImportError, START, clock_fit::ClockFit, mp4};

/// A camera's gyro and accelerometer.
#[derive(Clone, Debug, PartialEq)]
pub struct Telemetry {
    /// What the camera calls itself; may be empty.
    pub camera: String,
    /// Gyro samples a second by the camera's clock.
    pub rate_hz: f64,
    /// In the order of their time, the accelerometer interpolated to the gyro's times. `device_time_ns` is the camera's own
    /// clock, `arrival` the recording's, on which the first picture was taken at [`START`]. Axes are the track's channels,
    /// put in the library's order where the camera says how it is turned.
    pub samples: Vec<ImuSample>,
}

/// The name of the thread that runs the reader, by which its panics are known.
const THREAD: &str = "telemetry";
/// Containers nest, and the reader follows them on the stack. The largest payload that is let through, full of nothing else,
/// takes less than a quarter of this; what is not used is not there.
const STACK_BYTES: usize = 256 << 20;
/// Stamps farther than this off the line through them belong to no one clock.
const STAMP_WORST_MS: f64 = 100.0;

/// The gyro and accelerometer of a video; `None` where it has no GPMF track.
pub fn read_telemetry(path: &Path) -> Result<Option<Telemetry>, ImportError> {
    let read = |source| ImportError::Read { path: path.to_owned(), source };
    let fail = |what: String| ImportError::Telemetry { path: path.to_owned(), what };
    let mut file = File::open(path).map_err(read)?;
    let file_bytes = file.metadata().map_err(read)?.len();
    let Some(index) = mp4::read_index(&mut file).map_err(read)?.filter(|i| mp4::mentions_gpmf(i)) else {
        return Ok(None);
    };
    keep_reader_panics_quiet();
    let owned = path.to_owned();
    let reader = std::thread::Builder::new()
        .name(THREAD.to_owned())
        .stack_size(STACK_BYTES)
        .spawn(move || read_blocks(file, &owned, &index, file_bytes))
        .map_err(read)?;
    let blocks = match reader.join() {
        Ok(result) => result.map_err(fail)?,
        Err(_) => return Err(fail("its content makes no sense".to_owned())),
    };
    assemble(&blocks).map(Some).map_err(fail)
}

/// The reader panics on some damaged files. That is caught where it is joined and becomes an error of one line; the
/// hook keeps the default report of a panic off the user's screen, for that thread only.
fn keep_reader_panics_quiet() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let usual = panic::take_hook();
        panic::set_hook(Box::new(move |info: &PanicHookInfo<'_>| {
            if std::thread::current().name() != Some(THREAD) {
                usual(info);
            }
        }));
    });
}

/// What one payload holds.
#[derive(Clone, Debug, Default)]
struct Block {
    start_ms: f64,
    duration_ms: f64,
    gyro: Stream,
    accel: Stream,
}

/// A stream's share of a payload.
#[derive(Clone, Debug, Default)]
struct Stream {
    /// In SI units, oriented.
    values: Vec<DVec3>,
    /// The camera's clock at the first sample, milliseconds.
    stamp_ms: Option<f64>,
    /// Samples since the camera began, up to and with this payload.
    total: Option<u32>,
}

#[derive(Debug)]
struct Blocks {
    camera: String,
    blocks: Vec<Block>,
}

/// Runs the library over the file. May panic on damaged files; it runs in a thread of its own.
fn read_blocks(mut file: File, path: &Path, index: &[u8], file_bytes: u64) -> Result<Blocks, String> {
    let places = mp4::payload_places(index, file_bytes)?;
    log::debug!("{}: {} payloads in the gyro track", path.display(), places.len());
    let size = usize::try_from(file_bytes).map_err(|e| e.to_string())?;
    let input = telemetry_parser::Input::from_stream(&mut file, size, path, |_| (), Default::default())
        .map_err(|e| e.to_string())?;
    if input.camera_type() != "GoPro" {
        return Err(format!("it was taken for that of a {} camera", input.camera_type()));
    }
    let samples = input.samples.as_deref().ok_or("it is cut short or damaged")?;
    let mut blocks = Vec::with_capacity(samples.len());
    for sample in samples {
        // The library puts settings without a time in front of the payloads.
        let Some(tags) = sample.tag_map.as_ref().filter(|_| sample.duration_ms > 0.0) else { continue };
        blocks.push(Block {
            start_ms: sample.timestamp_ms,
            duration_ms: sample.duration_ms,
            gyro: vectors(tags, &GroupId::Gyroscope)?,
            accel: vectors(tags, &GroupId::Accelerometer)?,
        });
    }
    let camera = input.camera_model().map_or_else(String::new, |m| format!("GoPro {m}"));
    Ok(Blocks { camera, blocks })
}

fn vectors(tags: &GroupedTagMap, group: &GroupId) -> Result<Stream, String> {
    let Some(map) = tags.get(group) else { return Ok(Stream::default()) };
    let Some(raw): Option<&Vec<Vector3<i16>>> = map.get_t(TagId::Data) else {
        return Err(format!("its {group:?} block is not made of three 16-bit numbers a sample"));
    };
    let scale = match map.get(&TagId::Scale).map(|t| &t.value) {
        None => 1.0,
        Some(TagValue::i16(v)) => f64::from(*v.get()),
        Some(TagValue::f32(v)) => f64::from(*v.get()),
        Some(_) => f64::NAN,
    };
    let unit: Option<&String> = map.get_t(TagId::Unit);
    let to_si = match unit.map_or("", String::as_str) {
        "" | "rad/s" | "m/s\u{b2}" | "m/s2" => 1.0,
        "deg/s" | "\u{b0}/s" => 1.0_f64.to_radians(),
        "g" => 9.80665,
        other => return Err(format!("its {group:?} block is in {other:?}, not in rad/s or m/s\u{b2}")),
    };
    if !(scale.is_finite() && scale != 0.0) {
        return Err(format!("its {group:?} block has no usable scale"));
    }
    let turned: Option<&String> = map.get_t(TagId::Orientation);
    let turned = turned.map_or("XYZ", String::as_str).as_bytes();
    let values = raw
        .iter()
        .map(|v| {
            let v = v.clone().into_scaled(&scale, &to_si).orient(turned);
            DVec3::new(v.x, v.y, v.z)
        })
        .collect();
    Ok(Stream { values, stamp_ms: stamp_ms(map), total: total(map) })
}

fn stamp_ms(map: &TagMap) -> Option<f64> {
    /// Four-character code `TICK`.
    const TICK: TagId = TagId::Unknown(u32::from_be_bytes(*b"TICK"));
    let micros: Option<&u64> = map.get_t(TagId::TimestampUs);
    let ticks: Option<&u32> = map.get_t(TICK);
    micros.map(|us| *us as f64 / 1000.0).or(ticks.map(|ms| f64::from(*ms)))
}

fn total(map: &TagMap) -> Option<u32> {
    (map.get_t(TagId::Count) as Option<&u32>).copied()
}

/// A stream's samples with the camera's count of the sample that each block begins with, and its clock.
struct Timed<'a> {
    runs: Vec<(f64, &'a [DVec3])>,
    clock: ClockFit,
}

fn timed<'a>(
    blocks: &'a [Block],
    stream: impl Fn(&'a Block) -> &'a Stream,
    by_container: bool,
) -> Option<Timed<'a>> {
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
    Some(Timed { runs, clock })
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

fn points(stream: &Timed<'_>) -> Vec<(f64, DVec3)> {
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

fn assemble(read: &Blocks) -> Result<Telemetry, String> {
    let blocks = &read.blocks;
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
    Ok(Telemetry { camera: read.camera.clone(), rate_hz: 1000.0 / gyro.clock.interval_ms, samples })
}
