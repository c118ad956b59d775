//! A recording made ready for playing: pictures decoded, everything else in memory.
//!
//! On the disk: magic, length of the header in eight bytes little-endian, header as JSON, the pictures as YUYV one after the other,
//! then as JPEG.

use std::{
    fs::File,
    io::{self, Read, Write},
    path::Path,
};

use anyhow::{Context, Result, bail, ensure};
use bowwave_core::event::bt601_to_srgb;
use bowwave_record::{Entry, RecordingReader};
use serde::{Deserialize, Serialize};

const MAGIC: &[u8; 8] = b"HILTAPE1";
const HEADER_MAX: u64 = 64 << 20;

/// A picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TapeFrame {
    /// Middle of the exposure, nanoseconds since the tape's beginning; may be before it.
    pub exposed_ns: i64,
    /// When the host has it.
    pub arrival_ns: i64,
    /// Length as JPEG.
    pub jpeg_bytes: usize,
}

/// A measurement of the unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TapePacket {
    /// When its last byte reaches the host, nanoseconds since the tape's beginning.
    pub arrival_ns: i64,
    /// The unit's own clock.
    pub device_ns: i64,
    /// rad/s.
    pub rate: [f64; 3],
    /// m/s^2.
    pub accel: [f64; 3],
    /// x, y, z, w of `world_from_imu`.
    pub attitude: Option<[f64; 4]>,
}

/// Where the camera really was.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TapeTruth {
    /// The exposure that it belongs to, nanoseconds since the tape's beginning.
    pub exposed_ns: i64,
    /// x, y, z, w of `world_from_camera`.
    pub attitude: [f64; 4],
}

/// All but the pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TapeHeader {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// After so long it begins again without a seam.
    pub period_ns: i64,
    /// How far the unit's clock gets in that time.
    pub device_period_ns: i64,
    /// Pictures by arrival.
    pub frames: Vec<TapeFrame>,
    /// Measurements by arrival.
    pub samples: Vec<TapePacket>,
    /// Pulls of the trigger: time, pressed.
    pub triggers: Vec<(i64, bool)>,
    /// True attitudes by exposure.
    pub truth: Vec<TapeTruth>,
    /// Its calibration file.
    pub calibration_toml: String,
}

/// A tape in memory.
pub struct Tape {
    /// All but the pictures.
    pub header: TapeHeader,
    yuyv: Vec<u8>,
    jpeg: Vec<u8>,
    jpeg_at: Vec<usize>,
}

impl Tape {
    /// Decodes a recording that loops.
    pub fn from_recording(path: &Path) -> Result<Self> {
        let reader = RecordingReader::open(path)?;
        let properties = reader.properties().clone();
        let start = properties.start;
        let (width, height) = properties.picture;
        let key = hw_sim::make::DEVICE_LOOP_KEY;
        let device_period_ns = properties.extra.get(key).and_then(|v| v.parse().ok());
        let mut tape = Self {
            header: TapeHeader {
                width,
                height,
                period_ns: properties.loop_ns.context("the recording does not loop")?,
                device_period_ns: device_period_ns.context("the recording does not say the unit's clock")?,
                frames: Vec::new(),
                samples: Vec::new(),
                triggers: Vec::new(),
                truth: Vec::new(),
                calibration_toml: properties.calibration_toml,
            },
            yuyv: Vec::new(),
            jpeg: Vec::new(),
            jpeg_at: Vec::new(),
        };
        for entry in reader.entries()? {
            match entry? {
                Entry::Frame(frame) => {
                    tape.header.frames.push(TapeFrame {
                        exposed_ns: frame.mid_exposure.ns_since(start),
                        arrival_ns: frame.arrival.ns_since(start),
                        jpeg_bytes: frame.jpeg.len(),
                    });
                    tape.yuyv.extend(yuyv_of(&frame.jpeg, width, height)?);
                    tape.jpeg.extend_from_slice(&frame.jpeg);
                }
                Entry::Imu(s) => tape.header.samples.push(TapePacket {
                    arrival_ns: s.arrival.ns_since(start),
                    device_ns: s.device_time_ns,
                    rate: s.rate.to_array(),
                    accel: s.accel.to_array(),
                    attitude: s.world_from_imu.map(|q| q.to_array()),
                }),
                Entry::Trigger(edge) => {
                    tape.header.triggers.push((edge.time.ns_since(start), edge.pressed));
                }
                Entry::Truth(pose) => tape.header.truth.push(TapeTruth {
                    exposed_ns: pose.time.ns_since(start),
                    attitude: pose.pose.world_from_camera.to_array(),
                }),
                // A made recording has nothing else that the bench could play: no ship, nobody who presses, no session.
                Entry::Pose(_)
                | Entry::Ship(_)
                | Entry::ShipValues(_)
                | Entry::ShipFix(_)
                | Entry::Mark(_)
                | Entry::Act(_)
                | Entry::Order(_)
                | Entry::Picture(_)
                | Entry::Fault(_)
                | Entry::Tick(_) => {}
            }
        }
        tape.index();
        Ok(tape)
    }

    fn index(&mut self) {
        let mut at = 0;
        self.jpeg_at = self
            .header
            .frames
            .iter()
            .map(|f| {
                let begin = at;
                at += f.jpeg_bytes;
                begin
            })
            .collect();
    }

    /// Writes it.
    pub fn write(&self, path: &Path) -> Result<()> {
        let header = serde_json::to_vec(&self.header).context("the tape's header")?;
        let mut file = io::BufWriter::new(File::create(path).with_context(|| path.display().to_string())?);
        file.write_all(MAGIC)?;
        file.write_all(&(header.len() as u64).to_le_bytes())?;
        for part in [&header, &self.yuyv, &self.jpeg] {
            file.write_all(part)?;
        }
        // A disk has whole sectors.
        let length = 16 + header.len() + self.yuyv.len() + self.jpeg.len();
        file.write_all(&vec![0; length.next_multiple_of(512) - length])?;
        file.flush().with_context(|| path.display().to_string())
    }

    /// Reads it.
    pub fn read(path: &Path) -> Result<Self> {
        let mut file =
            File::open(path).with_context(|| format!("cannot open the tape {}", path.display()))?;
        let mut head = [0; 16];
        file.read_exact(&mut head)?;
        ensure!(head.starts_with(MAGIC), "{} is no tape", path.display());
        let length = u64::from_le_bytes([
            head[8], head[9], head[10], head[11], head[12], head[13], head[14], head[15],
        ]);
        ensure!(length <= HEADER_MAX, "{}: a header of {length} bytes", path.display());
        let mut bytes = |count: usize| -> Result<Vec<u8>> {
            let mut bytes = vec![0; count];
            file.read_exact(&mut bytes).with_context(|| format!("{} ends early", path.display()))?;
            Ok(bytes)
        };
        let header: TapeHeader = serde_json::from_slice(&bytes(length as usize)?)?;
        let yuyv = bytes(header.frames.len() * (header.width * header.height * 2) as usize)?;
        let jpeg = bytes(header.frames.iter().map(|f| f.jpeg_bytes).sum())?;
        if header.frames.is_empty() || header.samples.is_empty() || header.period_ns <= 0 {
            bail!("{} is empty", path.display());
        }
        let mut tape = Self { header, yuyv, jpeg, jpeg_at: Vec::new() };
        tape.index();
        Ok(tape)
    }

    /// A picture as YUYV.
    pub fn yuyv(&self, frame: usize) -> &[u8] {
        let bytes = (self.header.width * self.header.height * 2) as usize;
        self.yuyv.get(frame * bytes..(frame + 1) * bytes).unwrap_or_default()
    }

    /// A picture as JPEG.
    pub fn jpeg(&self, frame: usize) -> &[u8] {
        let at = self.jpeg_at.get(frame).copied().unwrap_or_default();
        let bytes = self.header.frames.get(frame).map_or(0, |f| f.jpeg_bytes);
        self.jpeg.get(at..at + bytes).unwrap_or_default()
    }
}

fn yuyv_of(jpeg: &[u8], width: u32, height: u32) -> Result<Vec<u8>> {
    let picture = image::load_from_memory_with_format(jpeg, image::ImageFormat::Jpeg)?.into_rgb8();
    ensure!(picture.dimensions() == (width, height) && width.is_multiple_of(2), "a picture of another size");
    Ok(rgb_to_yuyv(picture.as_raw()))
}

/// Limited-range BT.601, the inverse of [`bt601_to_srgb`]; the chroma of two pixels is their mean.
fn rgb_to_yuyv(rgb: &[u8]) -> Vec<u8> {
    let code = |v: f32, base: f32, scale: f32| (base + scale * v).round().clamp(0.0, 255.0) as u8;
    let mut out = Vec::with_capacity(rgb.len() / 3 * 2);
    for pair in rgb.chunks_exact(6) {
        let pixel = |i: usize| [0, 1, 2].map(|c| f32::from(pair[3 * i + c]) / 255.0);
        let luma = |[r, g, b]: [f32; 3]| 0.299 * r + 0.587 * g + 0.114 * b;
        let (a, b) = (pixel(0), pixel(1));
        let (ya, yb) = (luma(a), luma(b));
        let u = ((a[2] - ya) + (b[2] - yb)) / 2.0 / 1.772;
        let v = ((a[0] - ya) + (b[0] - yb)) / 2.0 / 1.402;
        out.extend([
            code(ya, 16.0, 219.0),
            code(u, 128.0, 224.0),
            code(yb, 16.0, 219.0),
            code(v, 128.0, 224.0),
        ]);
    }
    out
}

/// Half the picture's size by leaving out: for cameras that offer a smaller mode.
pub fn halved(yuyv: &[u8], width: u32, height: u32) -> Vec<u8> {
    let (stride, groups) = (width as usize * 2, width as usize / 4);
    let mut out = Vec::with_capacity(yuyv.len() / 4);
    for y in (0..height as usize / 2 * 2).step_by(2) {
        let row = yuyv.get(y * stride..(y + 1) * stride).unwrap_or_default();
        for pair in row.chunks_exact(8).take(groups) {
            out.extend([pair[0], pair[1], pair[4], pair[3]]);
        }
    }
    out
}

/// A picture whose columns, rows come in reverse order.
pub fn flipped(yuyv: &[u8], width: u32, [columns, rows]: [bool; 2]) -> Vec<u8> {
    let mut all: Vec<&[u8]> = yuyv.chunks_exact(width as usize * 2).collect();
    if rows {
        all.reverse();
    }
    if !columns {
        return all.concat();
    }
    // Two pixels share their chroma.
    all.into_iter().flat_map(|row| row.rchunks_exact(4).flat_map(|p| [p[2], p[1], p[0], p[3]])).collect()
}

/// Mean luma of a YUYV picture as sRGB grey, 0 to 1.
pub fn mean_grey(yuyv: &[u8]) -> f32 {
    let sum: u64 = yuyv.iter().step_by(2).map(|v| u64::from(*v)).sum();
    let mean = sum / (yuyv.len() as u64 / 2).max(1);
    bt601_to_srgb(mean as u8, 128, 128)[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_survive_the_way_to_yuyv() {
        for colour in [[0u8, 0, 0], [255, 255, 255], [200, 30, 60], [10, 90, 220]] {
            let yuyv = rgb_to_yuyv(&[colour, colour].concat());
            let back = bt601_to_srgb(yuyv[0], yuyv[1], yuyv[3]).map(|c| (c * 255.0).round() as i32);
            for (a, b) in back.iter().zip(colour) {
                assert!((a - i32::from(b)).abs() <= 3, "{colour:?} {back:?}");
            }
        }
    }

    #[test]
    fn a_flipped_picture_has_its_first_pixels_last() {
        // Two rows of four pixels.
        let picture: Vec<u8> = (0..16).collect();
        assert_eq!(flipped(&picture, 4, [false, true])[..8], picture[8..]);
        assert_eq!(flipped(&picture, 4, [true, false])[..8], [6, 5, 4, 7, 2, 1, 0, 3]);
        let back = flipped(&flipped(&picture, 4, [true, true]), 4, [true, true]);
        assert_eq!(back, picture);
    }

    #[test]
    fn half_a_picture_has_a_quarter_of_the_bytes() {
        let picture: Vec<u8> = (0..16 * 8 * 2).map(|i| i as u8).collect();
        let half = halved(&picture, 16, 8);
        assert_eq!(half.len(), 8 * 4 * 2);
        assert_eq!(half[..4], [0, 1, 4, 3]);
    }

    #[test]
    fn a_tape_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join("a.mcap");
        let recipe = hw_sim::make::Recipe {
            width: 64,
            height: 32,
            duration_s: 1.0,
            trigger: vec![hw_sim::make::Burst { start_s: 0.2, length_s: 0.3 }],
            ..hw_sim::make::Recipe::default()
        };
        hw_sim::make::make(&recipe, &recording, &mut |_, _| {}).unwrap();
        let tape = Tape::from_recording(&recording).unwrap();
        let path = folder.path().join("tape");
        tape.write(&path).unwrap();
        let back = Tape::read(&path).unwrap();
        // Numbers with a fraction come back to the last digit but one, so the rest is compared exactly.
        let exact = |h: &TapeHeader| {
            (h.width, h.height, h.period_ns, h.device_period_ns, h.frames.clone(), h.calibration_toml.clone())
        };
        assert_eq!(exact(&tape.header), exact(&back.header));
        assert_eq!(tape.header.samples.len(), back.header.samples.len());
        assert_eq!((back.header.frames.len(), back.header.samples.len()), (30, 200));
        assert_eq!((tape.yuyv(29), tape.jpeg(29)), (back.yuyv(29), back.jpeg(29)));
        assert!(!back.jpeg(29).is_empty() && back.yuyv(29).len() == 64 * 32 * 2 && back.yuyv(30).is_empty());
        assert!((0.1..0.9).contains(&mean_grey(back.yuyv(3))));
        std::fs::write(&path, b"something else than a tape").unwrap();
        assert!(Tape::read(&path).is_err());
    }
}
