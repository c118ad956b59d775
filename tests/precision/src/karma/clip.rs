//! The clip: its pictures, its gyro, and clouds followed through it.

use anyhow::{Context as _, Result};
use bowwave_core::{event::ImuSample, time::Time};
use bowwave_import::{
    read_telemetry,
    track::{Gray, Tracker},
};
use glam::DVec2;

use crate::{horizon::video, recorded};

/// Pictures and gyro on one clock, the container's.
pub struct KarmaClip {
    /// Time and JPEG of each picture.
    pub pictures: Vec<(Time, Vec<u8>)>,
    /// The gyro's samples by `arrival`, bias included.
    pub samples: Vec<ImuSample>,
}

/// A cloud as it was followed.
#[derive(Clone, Debug)]
pub struct CloudTrack {
    /// Picture and place, pixels.
    pub seen: Vec<(usize, DVec2)>,
    /// Whether no fit sees it.
    pub held_out: bool,
}

/// Share of the picture's height, from the top, in which nothing is nearer than a cloud.
const CLOUDS: f64 = 0.36;
/// Stripes of the picture that are turn about used and held out.
const STRIPES: f64 = 9.0;

impl KarmaClip {
    /// The clip; `None`, with a word of it, where it or ffmpeg is absent.
    pub fn load() -> Result<Option<Self>> {
        let Some(path) = recorded::find(video::KARMA) else { return Ok(None) };
        let Some(pictures) = video::karma_pictures()? else { return Ok(None) };
        let telemetry =
            read_telemetry(std::path::Path::new("ffmpeg"), &path)?.context("the clip has no gyro")?;
        Ok(Some(Self { pictures, samples: telemetry.samples }))
    }

    /// Clouds of picture `first`, followed up to picture `end`; those in the odd stripes (`held` 1) or in the even ones (0) are
    /// held out.
    pub fn follow(&self, first: usize, end: usize, held: usize) -> Result<Vec<CloudTrack>> {
        let mut tracker: Option<Tracker> = None;
        let mut tracks: Vec<CloudTrack> = Vec::new();
        for (i, (_, jpeg)) in self.pictures.iter().enumerate().take(end).skip(first) {
            let picture = Gray::from_jpeg(jpeg)?;
            let places = match &mut tracker {
                Some(tracker) => tracker.next(&picture),
                slot => {
                    let rows = (picture.height() as f64 * CLOUDS) as usize;
                    slot.insert(Tracker::start(&picture, rows)).places()
                }
            };
            if tracks.is_empty() {
                let stripe = |at: &DVec2| (at.x / picture.width() as f64 * STRIPES) as usize;
                let track = |p: &Option<DVec2>| CloudTrack {
                    seen: Vec::new(),
                    held_out: p.is_some_and(|at| stripe(&at) % 2 == held),
                };
                tracks = places.iter().map(track).collect();
            }
            for (track, place) in tracks.iter_mut().zip(places) {
                track.seen.extend(place.map(|at| (i, at)));
            }
        }
        Ok(tracks)
    }
}
