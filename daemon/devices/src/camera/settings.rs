//! Settings of the camera.

use std::{fmt, path::PathBuf};

use super::{CameraError, Coding};

/// Frames per second as a fraction, as cameras give it: 30000/1001 is 29.97.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rate {
    frames: u32,
    seconds: u32,
}

impl Rate {
    /// `frames` in `seconds`; `None` where either is zero.
    pub const fn new(frames: u32, seconds: u32) -> Option<Self> {
        if frames == 0 || seconds == 0 { None } else { Some(Self { frames, seconds }) }
    }

    /// `frames` a second; `None` for zero.
    pub const fn hz(frames: u32) -> Option<Self> {
        Self::new(frames, 1)
    }

    /// Numerator: frames.
    pub const fn frames(self) -> u32 {
        self.frames
    }

    /// Denominator: seconds.
    pub const fn seconds(self) -> u32 {
        self.seconds
    }

    /// Frames per second.
    pub fn per_second(self) -> f64 {
        f64::from(self.frames) / f64::from(self.seconds)
    }

    /// Time from frame to frame, nanoseconds, rounded down.
    pub const fn period_ns(self) -> i64 {
        1_000_000_000 * self.seconds as i64 / self.frames as i64
    }

    /// Whether both are the same number of frames in the same time.
    pub const fn same(self, other: Self) -> bool {
        self.frames as u64 * other.seconds as u64 == other.frames as u64 * self.seconds as u64
    }
}

impl fmt::Display for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.seconds == 1 {
            write!(f, "{} Hz", self.frames)
        } else {
            write!(f, "{:.3} Hz ({}/{})", self.per_second(), self.frames, self.seconds)
        }
    }
}

/// A mode that the trainer would like to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WantedMode {
    /// How pictures are coded; a usable one.
    pub coding: Coding,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// How often.
    pub rate: Rate,
}

impl fmt::Display for WantedMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}x{} at {}", self.coding, self.width, self.height, self.rate)
    }
}

/// Who sets the exposure time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Exposure {
    /// As the camera has it.
    #[default]
    Leave,
    /// The camera, by itself, but never so long that the frame rate drops.
    Auto,
    /// Locked to this time, microseconds (V4L2 counts in steps of 100).
    Locked {
        /// Exposure time, microseconds.
        time_us: u32,
    },
}

/// Who sets the white balance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WhiteBalance {
    /// As the camera has it.
    #[default]
    Leave,
    /// The camera, by itself.
    Auto,
    /// Locked to this colour temperature, kelvin.
    Locked {
        /// Colour temperature, kelvin.
        kelvin: u32,
    },
}

/// Who sets the focus. A lens that moves is another lens than the calibrated one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Focus {
    /// Automatic focus is switched off where the camera has it; the lens stays where it is.
    #[default]
    Still,
    /// Locked to this position, in the camera's own steps.
    Locked {
        /// Position of the lens, camera's steps.
        position: u32,
    },
}

/// Controls that are locked so that the picture stays the calibrated one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Controls {
    /// Exposure time.
    pub exposure: Exposure,
    /// White balance.
    pub white_balance: WhiteBalance,
    /// Focus.
    pub focus: Focus,
    /// Gain, in the camera's own steps, automatic gain off; `None` leaves it.
    pub gain: Option<u32>,
}

/// Settings of the camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraSettings {
    /// A node or a link to one (best in `/dev/v4l/by-id`); `None` for the first camera that fits.
    pub device: Option<PathBuf>,
    /// The USB serial number of the calibrated camera, or its card name where it has no serial number. Any other camera is
    /// refused.
    pub serial: Option<String>,
    /// The picture size that the calibration is for, pixels.
    pub calibrated_size: Option<(u32, u32)>,
    /// Modes by preference; where empty, the calibrated size (or 1280x720) at 30 Hz in any coding.
    pub modes: Vec<WantedMode>,
    /// The controls that are locked.
    pub controls: Controls,
    /// Buffers to ask for: two that the driver fills, and as many as the trainer holds at once; 3 to 32.
    pub buffers: u32,
    /// From the end of the middle row's exposure to the end of the frame, microseconds: used where the camera stamps the end
    /// of the frame. `None` takes half a period, right for a sensor that reads out during the whole of it.
    pub readout_us: Option<u32>,
}

impl Default for CameraSettings {
    fn default() -> Self {
        Self {
            device: None,
            serial: None,
            calibrated_size: None,
            modes: Vec::new(),
            controls: Controls::default(),
            buffers: 6,
            readout_us: None,
        }
    }
}

/// Where nothing else is known.
const USUAL_SIZE: (u32, u32) = (1280, 720);

impl CameraSettings {
    /// Refuses what no camera can do, so that later nothing but the hardware can be wrong.
    pub fn check(&self) -> Result<(), CameraError> {
        let refuse = |what: String| Err(CameraError::Settings { what });
        if !(3..=32).contains(&self.buffers) {
            return refuse(format!("{} buffers: give 3 to 32", self.buffers));
        }
        if let Some(mode) = self.modes.iter().find(|m| !usable_size(m.coding, m.width, m.height)) {
            return refuse(format!(
                "mode {mode}: give YUYV, NV12 or MJPEG and an even size of 16 to 8192 pixels a side"
            ));
        }
        if let Some((width, height)) = self.calibrated_size
            && !usable_size(Coding::Mjpeg, width, height)
        {
            return refuse(format!(
                "calibrated size {width}x{height}: 16 to 8192 pixels a side are possible"
            ));
        }
        if self.device.as_ref().is_some_and(|d| d.as_os_str().as_encoded_bytes().contains(&0)) {
            return refuse("a device name with a zero in it: correct it".to_owned());
        }
        Ok(())
    }

    /// The modes by preference, never empty.
    pub(super) fn wanted(&self) -> Vec<WantedMode> {
        if !self.modes.is_empty() {
            return self.modes.clone();
        }
        let (width, height) = self.calibrated_size.unwrap_or(USUAL_SIZE);
        let rate = Rate { frames: 30, seconds: 1 };
        [Coding::Yuyv, Coding::Nv12, Coding::Mjpeg]
            .map(|coding| WantedMode { coding, width, height, rate })
            .into()
    }
}

/// Whether a picture of that coding and size can be handled.
pub(super) fn usable_size(coding: Coding, width: u32, height: u32) -> bool {
    let in_range = (16..=8192).contains(&width) && (16..=8192).contains(&height);
    let even = match coding {
        Coding::Yuyv => width.is_multiple_of(2),
        Coding::Nv12 => width.is_multiple_of(2) && height.is_multiple_of(2),
        Coding::Mjpeg => true,
        Coding::Other(_) => false,
    };
    in_range && even
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_camera_can_do_is_refused_in_words() {
        assert!(CameraSettings::default().check().is_ok());
        let mode = |coding, width| WantedMode { coding, width, height: 480, rate: Rate::hz(30).unwrap() };
        let wrong = [
            CameraSettings { buffers: 2, ..CameraSettings::default() },
            CameraSettings { modes: vec![mode(Coding::Yuyv, 641)], ..CameraSettings::default() },
            CameraSettings { modes: vec![mode(Coding::Other(*b"H264"), 640)], ..CameraSettings::default() },
            CameraSettings { calibrated_size: Some((0, 480)), ..CameraSettings::default() },
            CameraSettings { device: Some("/dev/video\0".into()), ..CameraSettings::default() },
        ];
        for settings in wrong {
            let message = settings.check().unwrap_err().to_string();
            assert!(message.starts_with("camera settings: "), "{message}");
        }
    }

    #[test]
    fn rates_are_fractions() {
        let ntsc = Rate::new(30_000, 1001).unwrap();
        assert_eq!(ntsc.period_ns(), 33_366_666);
        assert_eq!(ntsc.to_string(), "29.970 Hz (30000/1001)");
        assert!(Rate::new(60, 2).unwrap().same(Rate::hz(30).unwrap()) && !ntsc.same(Rate::hz(30).unwrap()));
        assert_eq!((Rate::new(0, 1), Rate::new(1, 0)), (None, None));
    }

    #[test]
    fn without_a_list_the_calibrated_size_is_wanted() {
        let settings = CameraSettings { calibrated_size: Some((640, 480)), ..CameraSettings::default() };
        assert!(settings.wanted().iter().all(|m| (m.width, m.height) == (640, 480) && m.coding.usable()));
    }
}
