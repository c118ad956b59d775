//! The video that goes into a page: the one that is named, or the one beside the journal.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, ensure};
use bowwave_review::{ReviewedRun, RunVideo, VIDEO, VideoPlace, VideoTimes};

use super::address::{address, same_file};
use crate::cli::ReviewArgs;

/// The video for the page at `page`, where there is one. A run is the journal's newest, or it is not.
pub fn video_for(
    arguments: &ReviewArgs,
    (journal, run, is_newest): (&Path, &ReviewedRun, bool),
    page: &Path,
) -> Result<Option<RunVideo>> {
    let beside = journal.with_file_name(VIDEO);
    let found = match &arguments.video {
        Some(named) => Some(RunVideo::open(named, run)?),
        None if !beside.is_file() => {
            hint(journal, run);
            None
        }
        None if !is_newest => {
            eprintln!(
                "{} is of the journal's newest run and is left out; --video FILE names another",
                beside.display()
            );
            None
        }
        None => RunVideo::open(&beside, run).map_err(|e| log::warn!("{e}; the page goes without it")).ok(),
    };
    let Some(mut video) = found else { return Ok(None) };
    ensure!(
        !same_file(&video.path, page),
        "the page would replace its video {}; name another file with --out",
        page.display()
    );
    if let Some(from_s) = arguments.video_at {
        video.times = VideoTimes::Given(from_s);
    }
    if video.bytes > arguments.embed_mb.saturating_mul(1_000_000) {
        let near = address(page, &video.path);
        let near =
            near.with_context(|| format!("no page finds {}; copy it beside the page", video.path.display()))?;
        video.place = VideoPlace::Beside(near);
    }
    Ok(Some(video))
}

/// A line on the video for whoever made the page.
pub fn words(video: &RunVideo) -> String {
    let mb = video.bytes as f64 * 1e-6;
    let place = match &video.place {
        VideoPlace::Embedded => "is in the page".to_owned(),
        VideoPlace::Beside(address) => format!("stays beside the page, which plays it from {address}"),
    };
    let times = match &video.times {
        VideoTimes::Kept(_) => "",
        VideoTimes::Given(_) => "; it begins as --video-at says",
        VideoTimes::Assumed => {
            "; when its frames were shown is not known: it is assumed to begin with the run (--video-at S says where)"
        }
    };
    format!("{} ({mb:.1} MB) {place}{times}", video.path.display())
}

/// Says how a recording beside the journal becomes a video.
fn hint(journal: &Path, run: &ReviewedRun) {
    let folder = journal.parent().unwrap_or(Path::new(""));
    let Some(recording) = newest_recording(folder) else { return };
    let made = recording.with_extension("");
    eprintln!(
        "no video, but a recording: to see what the display showed, make one and add it:\n  \
         bowwave simulate {} --seed {} --headless --video --out {}\n  bowwave review {} --video {}",
        quoted(&recording),
        run.stored.run.seed,
        quoted(&made),
        quoted(journal),
        quoted(&made.join(VIDEO))
    );
}

/// The recording in `folder` that was written to last.
fn newest_recording(folder: &Path) -> Option<PathBuf> {
    let folder = if folder == Path::new("") { Path::new(".") } else { folder };
    let files = fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    let recordings = files.filter(|path| path.extension().is_some_and(|end| end == "mcap"));
    recordings.max_by_key(|path| (path.metadata().and_then(|about| about.modified()).ok(), path.clone()))
}

/// A path as a shell takes it.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:@".contains(c);
    if text.chars().all(is_plain) { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shells_take_paths_as_they_are() {
        assert_eq!(quoted(Path::new("out/run-1.mcap")), "out/run-1.mcap");
        assert_eq!(quoted(Path::new("o'clock run")), "'o'\\''clock run'");
    }
}
