//! Writes two seconds of a made-up recording, to try viewers and other people's loaders with.
//!
//!     cargo run -p bowwave-record --example sample_recording -- OUT.mcap

use std::{error::Error, path::PathBuf, sync::Arc};

use bowwave_core::{
    event::{ImuSample, TriggerEdge},
    geometry::{CameraPose, Lens, look},
    time::Time,
};
use bowwave_record::{CameraInfo, Entry, FrameEntry, PoseEntry, Properties, RecordingWriter};
use glam::{DQuat, DVec3};
use image::{ImageFormat, Rgb, RgbImage};

const START_NS: i64 = 1_000_000_000;
const FRAMES: u32 = 60;
const FRAME_NS: i64 = 33_333_333;
const IMU_NS: i64 = 5_000_000;

fn main() -> Result<(), Box<dyn Error>> {
    let out = std::env::args_os().nth(1).map(PathBuf::from).ok_or("usage: sample_recording OUT.mcap")?;
    let lens = Lens::pinhole(320, 180, 1.0);
    let properties = Properties {
        calibration_toml: "# A sample without a calibration.\n".to_owned(),
        start: Time::from_ns(START_NS),
        source: "sample".to_owned(),
        picture: (lens.width, lens.height),
        camera_info: Some(CameraInfo::from_lens(&lens)),
        ..Properties::default()
    };
    let mut entries = Vec::new();
    for i in 0..FRAMES {
        let mid_exposure = Time::from_ns(START_NS + i64::from(i) * FRAME_NS);
        let pose = pose(i);
        entries.push(Entry::Truth(PoseEntry { time: mid_exposure, pose }));
        entries.push(Entry::Pose(PoseEntry { time: mid_exposure, pose }));
        let arrival = mid_exposure.plus_ns(20_000_000);
        entries.push(Entry::Frame(FrameEntry {
            arrival,
            mid_exposure,
            sequence: i,
            jpeg: picture(&lens, i)?,
            is_recoded: false,
        }));
        if i % 20 == 10 {
            entries.push(Entry::Trigger(TriggerEdge { time: arrival, pressed: i % 40 == 10 }));
        }
    }
    for i in 0..i64::from(FRAMES) * FRAME_NS / IMU_NS {
        entries.push(Entry::Imu(ImuSample {
            arrival: Time::from_ns(START_NS + i * IMU_NS + 1_000_000),
            device_time_ns: i * IMU_NS,
            rate: DVec3::new(0.0, 0.0, 0.1),
            accel: DVec3::new(0.0, 0.0, -9.81),
            world_from_imu: (i % 2 == 0).then(|| DQuat::from_rotation_x(std::f64::consts::PI)),
        }));
    }
    entries.sort_by_key(Entry::time);
    let mut writer = RecordingWriter::create(&out, &properties)?;
    for entry in &entries {
        writer.write(entry)?;
    }
    let summary = writer.finish()?;
    println!("{}: {} bytes, {:?}", out.display(), summary.bytes, summary.counts);
    Ok(())
}

fn pose(frame: u32) -> CameraPose {
    CameraPose {
        world_from_camera: look(0.003 * f64::from(frame), 0.0, 0.0),
        position: DVec3::new(0.0, 0.0, 4.0),
    }
}

/// A sky that darkens upwards over a sea, with a moving mark.
fn picture(lens: &Lens, frame: u32) -> Result<Arc<[u8]>, image::ImageError> {
    let picture = RgbImage::from_fn(lens.width, lens.height, |x, y| {
        match (x.abs_diff(frame * 5), y * 2 < lens.height) {
            (0..4, _) => Rgb([255, 60, 40]),
            (_, true) => Rgb([120 + y as u8, 150 + y as u8, 230]),
            (_, false) => Rgb([20, 60, 90]),
        }
    });
    let mut jpeg = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut jpeg, ImageFormat::Jpeg)?;
    Ok(Arc::from(jpeg.into_inner()))
}
