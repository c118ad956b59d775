//! The video of a run, as the display showed it, and the times that its frames show.

use std::{
    io::{ErrorKind, Read as _},
    path::{Path, PathBuf},
};

use bowwave_files::{plain_file, plain_text};
use serde::{Deserialize, Serialize};

use crate::run::ReviewedRun;

/// Name of the video that a run makes in its folder.
pub const VIDEO: &str = "video.mp4";

/// A video that cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum VideoError {
    /// The file cannot be read.
    #[error("cannot read the video {path}; check its name and permissions")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is something else.
    #[error(
        "{path} is no MP4 file, or is not complete; name the video.mp4 that --video made, once its run has ended"
    )]
    NoVideo {
        /// The file.
        path: PathBuf,
    },
}

/// Place of the video's bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum VideoPlace {
    /// In the page.
    Embedded,
    /// In a file that the page finds at this address.
    Beside(String),
}

/// Source of the times that the video's frames show.
#[derive(Clone, Debug, PartialEq)]
pub enum VideoTimes {
    /// The run's summary: numbers of frames, each with the time that it shows, nanoseconds of the session's clock. From there on there are
    /// thirty a second.
    Kept(Vec<(u64, i64)>),
    /// Whoever made the page: the first frame shows this time of the run, seconds.
    Given(f64),
    /// Nobody: the first frame is taken to show the run's beginning.
    Assumed,
}

/// A video for the page.
#[derive(Clone, Debug, PartialEq)]
pub struct RunVideo {
    /// The file.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// Place of its bytes.
    pub place: VideoPlace,
    /// Times of its frames.
    pub times: VideoTimes,
}

/// The video as the page's scripts know it.
#[derive(Debug, Serialize)]
pub struct PageVideo<'a> {
    /// Address; `None` where it is in the page.
    address: Option<&'a str>,
    /// Numbers of frames with the times that they show, seconds of the run.
    marks: Vec<(u64, f64)>,
    /// Frames a second from each mark on.
    frames_per_s: i64,
}

/// The part of a run's summary that says when the video's frames were shown.
#[derive(Debug, Deserialize)]
struct VideoSummary {
    scenario: String,
    seed: u64,
    video_frames: Option<Vec<(u64, i64)>>,
}

impl RunVideo {
    /// Looks at the video at `path`. Its times are taken from the summary that its own run left beside it, if that is of `run`.
    ///
    /// # Errors
    /// Where there is no MP4 file that can be read.
    pub fn open(path: &Path, run: &ReviewedRun) -> Result<Self, VideoError> {
        let unreadable = |source| VideoError::Unreadable { path: path.into(), source };
        let mut file = plain_file(path).map_err(unreadable)?;
        let bytes = file.metadata().map_err(unreadable)?.len();
        let mut head = [0; 12];
        let is_video = match file.read_exact(&mut head) {
            // The first box of every MP4 file says what it is.
            Ok(()) => &head[4..8] == b"ftyp",
            Err(e) if e.kind() == ErrorKind::UnexpectedEof => false,
            Err(e) => return Err(unreadable(e)),
        };
        if !is_video {
            return Err(VideoError::NoVideo { path: path.into() });
        }
        let times = kept(path, run).map_or(VideoTimes::Assumed, VideoTimes::Kept);
        Ok(Self { path: path.to_owned(), bytes, place: VideoPlace::Embedded, times })
    }

    /// The video for the page's scripts.
    pub fn for_page(&self, run: &ReviewedRun) -> PageVideo<'_> {
        let marks = match &self.times {
            VideoTimes::Kept(marks) => {
                marks.iter().map(|(frame, time_ns)| (*frame, run.seconds(*time_ns))).collect()
            }
            VideoTimes::Given(from_s) => vec![(0, *from_s)],
            VideoTimes::Assumed => vec![(0, 0.0)],
        };
        let address = match &self.place {
            VideoPlace::Embedded => None,
            VideoPlace::Beside(address) => Some(address.as_str()),
        };
        PageVideo { address, marks, frames_per_s: bowwave_core::pacing::FRAMES_PER_S }
    }

    /// Notes for the page.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let VideoPlace::Beside(address) = &self.place {
            let mb = self.bytes as f64 * 1e-6;
            notes.push(format!(
                "the video has {mb:.0} MB and is not in this page: it is played from {address}, as seen from here; keep both together"
            ));
        }
        if self.times == VideoTimes::Assumed {
            notes.push(
                "when the video's frames were shown is not known: it is assumed to begin with the run, and may be seconds off \
                 (--video-at S says where it begins)"
                    .to_owned(),
            );
        }
        notes
    }
}

/// Times of a video's frames that the summary beside it keeps, where it is of `run`: a folder's summary is that of the last run there.
fn kept(video: &Path, run: &ReviewedRun) -> Option<Vec<(u64, i64)>> {
    /// A video begins and ends within this of its run's tracks and events.
    const NEAR_NS: i64 = 5_000_000_000;
    /// No summary is larger.
    const BYTES_MOST: usize = 64 << 20;
    // A summary is that of the video that its run made, and of no other in the folder.
    if video.file_name()? != VIDEO {
        return None;
    }
    let text = plain_text(&video.with_file_name("summary.json"), BYTES_MOST).ok()?;
    let VideoSummary { scenario, seed, video_frames } = serde_json::from_str(&text).ok()?;
    let marks = video_frames.filter(|marks| !marks.is_empty())?;
    let span = run.begin_ns().saturating_sub(NEAR_NS)..=run.end_ns().saturating_add(NEAR_NS);
    let in_order = marks.windows(2).all(|pair| pair[0].0 < pair[1].0);
    let is_of_run = scenario == run.stored.run.scenario && seed == run.stored.run.seed;
    (is_of_run && in_order && marks.iter().all(|(_, time_ns)| span.contains(time_ns))).then_some(marks)
}
