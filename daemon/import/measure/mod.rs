//! How far a thing that is fixed in the world drifts in the picture when a recording's own gyro carries it: compared with
//! clouds that are tracked in the pictures alone.
//!
//! The clouds' tracker knows nothing of the gyro, and the gyro's prediction nothing of the pictures. Clouds are the farthest
//! thing there is, but they do drift and grow with the wind and the camera's way, so that what is measured here is an upper
//! bound of what a boat would drift.

use anyhow::{Context as _, ensure};
use bowwave_core::{calibration::Calibration, event::ImuSample, time::Time};
use bowwave_import::{
    gyro::GyroPath,
    track::{Gray, Tracker},
};
use bowwave_record::{Entry, RecordingReader};
use glam::DVec2;
use std::path::Path;

/// Drift is stated for a picture of this width, as the trainer's screen has.
pub const SCREEN_WIDTH: f64 = 1280.0;

/// A recording in memory, pictures in grey.
pub struct DriftClip {
    /// Calibration of camera and gyro in the recording.
    pub calibration: Calibration,
    /// Samples in the order of their arrival.
    pub samples: Vec<ImuSample>,
    /// Pictures with the time of their mid-exposure.
    pub frames: Vec<(Time, Gray)>,
}

impl DriftClip {
    /// Reads a recording whole.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let reader = RecordingReader::open(path)?;
        let text = reader.properties().calibration_toml.clone();
        let calibration = bowwave_calibration::parse(&text, "calibration of the recording")?.calibration;
        let (mut samples, mut frames) = (Vec::new(), Vec::new());
        for entry in reader.entries()? {
            match entry? {
                Entry::Imu(sample) => samples.push(sample),
                Entry::Frame(frame) => frames.push((frame.mid_exposure, Gray::from_jpeg(&frame.jpeg)?)),
                _ => {}
            }
        }
        ensure!(!samples.is_empty(), "the recording has no gyro");
        ensure!(!frames.is_empty(), "the recording has no pictures");
        Ok(Self { calibration, samples, frames })
    }
}

/// Where the patches were seen in each picture: `None` once a patch is lost.
pub struct Tracks {
    /// Mid-exposure of each picture.
    pub times: Vec<Time>,
    /// For each picture, each patch.
    pub seen: Vec<Vec<Option<DVec2>>>,
}

impl Tracks {
    /// Follows patches of the sky above `row_max` through the clip.
    pub fn follow(clip: &DriftClip, row_max: usize) -> anyhow::Result<Self> {
        let (_, first) = clip.frames.first().context("no pictures")?;
        let mut tracker = Tracker::start(first, row_max);
        let mut seen = vec![tracker.places()];
        for (_, frame) in clip.frames.iter().skip(1) {
            seen.push(tracker.next(frame));
        }
        Ok(Self { times: clip.frames.iter().map(|f| f.0).collect(), seen })
    }
}

/// Drift over a part of the clip, pixels at [`SCREEN_WIDTH`].
#[derive(Clone, Copy, Debug)]
pub struct OverlayDrift {
    /// Root mean square over pictures of the mean shift of all patches: how far the overlay as a whole is off.
    pub overlay_rms: f64,
    /// The largest such shift.
    pub overlay_max: f64,
    /// The shift in the last picture.
    pub at_end: DVec2,
    /// Root mean square over all patches of all pictures: the clouds' own motion and the lens included.
    pub patch_rms: f64,
    /// Patches that were followed to the end.
    pub patches: usize,
    /// Pictures.
    pub pictures: usize,
}

impl std::fmt::Display for OverlayDrift {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { overlay_rms, overlay_max, at_end, patch_rms, patches, pictures } = self;
        write!(
            f,
            "overlay {overlay_rms:.2} rms, {overlay_max:.2} max, ({:.2}, {:.2}) at the end; patches {patch_rms:.2} rms \
             ({patches} patches, {pictures} pictures)",
            at_end.x, at_end.y
        )
    }
}

/// Where the gyro says that what was seen first at `first` is seen at each time.
pub fn predict(clip: &DriftClip, times: &[Time], first: DVec2) -> Vec<Option<DVec2>> {
    let c = &clip.calibration;
    let attitude = GyroPath::integrate(&clip.samples, c.gyro_bias);
    let at = |t: Time| attitude.world_from_imu(t.plus_ns(c.time_offset_ns)) * c.camera_from_imu.inverse();
    let Some(start) = times.first() else { return Vec::new() };
    let world = at(*start) * c.lens.unproject(first);
    times.iter().map(|t| c.lens.project(at(*t).inverse() * world)).collect()
}

/// Compares gyro and tracks over the pictures `from_s..=to_s` after the first one; the overlay is put in place at the first
/// picture of that span.
pub fn drift(clip: &DriftClip, tracks: &Tracks, from_s: f64, to_s: f64) -> anyhow::Result<OverlayDrift> {
    let zero = *tracks.times.first().context("no pictures")?;
    let inside = |t: &Time| (from_s..=to_s).contains(&t.secs_since(zero));
    let span: Vec<usize> = (0..tracks.times.len()).filter(|i| inside(&tracks.times[*i])).collect();
    let (first, last) = (*span.first().context("empty span")?, *span.last().context("empty span")?);
    let times: Vec<Time> = span.iter().map(|i| tracks.times[*i]).collect();
    let whole: Vec<usize> =
        (0..tracks.seen[last].len()).filter(|p| tracks.seen[last][*p].is_some()).collect();
    ensure!(whole.len() >= 8, "only {} patches could be followed", whole.len());
    let scale = SCREEN_WIDTH / f64::from(clip.calibration.lens.width);

    let mut shift = vec![DVec2::ZERO; span.len()];
    let mut squares = 0.0;
    for patch in &whole {
        let begin = tracks.seen[first][*patch].context("a patch came back")?;
        for (k, expected) in predict(clip, &times, begin).into_iter().enumerate() {
            let seen = tracks.seen[span[k]][*patch].context("a patch came back")?;
            let off = (expected.context("the gyro turns a patch out of sight")? - seen) * scale;
            shift[k] += off / whole.len() as f64;
            squares += off.length_squared();
        }
    }
    let pictures = span.len();
    let mean_square = shift.iter().map(|s| s.length_squared()).sum::<f64>() / pictures as f64;
    Ok(OverlayDrift {
        overlay_rms: mean_square.sqrt(),
        overlay_max: shift.iter().map(|s| s.length()).fold(0.0, f64::max),
        at_end: shift[pictures - 1],
        patch_rms: (squares / (pictures * whole.len()) as f64).sqrt(),
        patches: whole.len(),
        pictures,
    })
}
