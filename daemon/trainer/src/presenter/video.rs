//! A video file of what was shown, through ffmpeg.

use std::{
    io::Write,
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
    thread::{self, JoinHandle},
};

use anyhow::{Context, Result, anyhow, bail};
use bowwave_core::{
    pacing::FRAMES_PER_S,
    time::{NS_PER_S, Time},
};
use crossbeam_channel::{Receiver, Sender, bounded};

/// Frames that wait for ffmpeg: it takes half a second to begin, and drawing must not wait for that.
const QUEUE: usize = 20;

/// Times that a video's frames show may be off by so much from thirty a second before that is kept: more than a picture's own trembling, less
/// than a frame.
const PACE_NS: i64 = 20_000_000;

/// The times that the frames of a video show, on the session's clock.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VideoTimes {
    frames: u64,
    marks: Vec<(u64, Time)>,
}

impl VideoTimes {
    /// Takes in the next frame.
    fn frame(&mut self, shows: Time) {
        let on_pace = |(from, time): &(u64, Time)| {
            let frames = i64::try_from(self.frames - from).unwrap_or(i64::MAX);
            time.plus_ns(frames.saturating_mul(NS_PER_S) / FRAMES_PER_S)
        };
        let expected = self.marks.last().map(on_pace);
        if expected.is_none_or(|time| shows.ns_since(time).abs() > PACE_NS) {
            self.marks.push((self.frames, shows));
        }
        self.frames += 1;
    }

    /// The first frame's number and time, and those of each from which thirty a second no longer hold. Times are nanoseconds.
    pub fn marks(&self) -> Vec<(u64, i64)> {
        self.marks.iter().map(|(frame, time)| (*frame, time.ns())).collect()
    }
}

/// Frames on their way into an H.264 file.
#[derive(Debug)]
pub struct VideoWriter {
    child: Child,
    frames: Option<Sender<Vec<u8>>>,
    /// Buffers to fill again.
    empty: Receiver<Vec<u8>>,
    feeder: Option<JoinHandle<std::io::Result<()>>>,
    path: PathBuf,
    times: VideoTimes,
}

/// Writes frames as they come and gives their buffers back.
fn feed(mut stdin: ChildStdin, frames: &Receiver<Vec<u8>>, empty: &Sender<Vec<u8>>) -> std::io::Result<()> {
    for frame in frames {
        stdin.write_all(&frame)?;
        // Nobody wants it back once the run has ended.
        if empty.try_send(frame).is_err() {
            log::debug!("a buffer of the video is let go");
        }
    }
    Ok(())
}

impl VideoWriter {
    /// Starts ffmpeg for frames of that size, 30 a second. At low priority: encoding must not delay drawing.
    pub fn create(path: &Path, (width, height): (u32, u32)) -> Result<Self> {
        let mut child = Command::new("nice")
            .args(["-n", "15", "ffmpeg", "-nostdin", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgba"])
            .args(["-s", &format!("{width}x{height}"), "-r", "30", "-i", "-"])
            // Players want even sizes and 4:2:0.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-preset", "ultrafast", "-crf", "18"])
            .args(["-threads", "1", "-pix_fmt", "yuv420p", "-movflags", "+faststart"])
            .arg(path)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .context("cannot start ffmpeg for the video; install it (Debian: apt-get install ffmpeg) or leave out --video")?;
        let stdin = child.stdin.take().context("ffmpeg has no standard input")?;
        let (frames, waiting) = bounded::<Vec<u8>>(QUEUE);
        let (used, empty) = bounded(QUEUE);
        let feeder = thread::Builder::new()
            .name("video".to_owned())
            .spawn(move || feed(stdin, &waiting, &used))
            .context("cannot start the video's thread; are too many processes running?")?;
        Ok(Self {
            child,
            frames: Some(frames),
            empty,
            feeder: Some(feeder),
            path: path.to_path_buf(),
            times: VideoTimes::default(),
        })
    }

    /// Adds a frame that shows that time, sRGB RGBA bytes from the upper left.
    pub fn frame(&mut self, rgba: &[u8], shows: Time) -> Result<()> {
        self.times.frame(shows);
        let mut buffer = self.empty.try_recv().unwrap_or_default();
        buffer.clear();
        buffer.extend_from_slice(rgba);
        let frames = self.frames.as_ref().context("the video is already finished")?;
        if frames.send(buffer).is_err() {
            // It has ended early: its own words say why.
            self.finish_inner()?;
            bail!("ffmpeg stopped taking frames for {}", self.path.display());
        }
        Ok(())
    }

    /// Ends the file, and gives the times of its frames.
    pub fn finish(mut self) -> Result<VideoTimes> {
        self.finish_inner()?;
        Ok(std::mem::take(&mut self.times))
    }

    fn finish_inner(&mut self) -> Result<()> {
        drop(self.frames.take());
        let fed = self.feeder.take().map(JoinHandle::join);
        let mut words = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            std::io::Read::read_to_string(&mut stderr, &mut words).context("cannot read what ffmpeg says")?;
        }
        let status = self.child.wait().context("cannot wait for ffmpeg")?;
        if !status.success() {
            let why = words.lines().last().unwrap_or("it gave no reason");
            bail!(
                "ffmpeg could not write {}: {why}; check the disk, or leave out --video",
                self.path.display()
            );
        }
        match fed {
            Some(Ok(Err(e))) => {
                Err(e).with_context(|| format!("cannot give frames to ffmpeg for {}", self.path.display()))
            }
            Some(Err(_)) => Err(anyhow!("the video's thread broke down; report it with the log")),
            Some(Ok(Ok(()))) | None => Ok(()),
        }
    }
}

impl Drop for VideoWriter {
    fn drop(&mut self) {
        if self.frames.take().is_some() {
            log::warn!("the video {} was not finished; ffmpeg ends it as it is", self.path.display());
            if let Err(e) = self.child.wait() {
                log::warn!("cannot wait for ffmpeg: {e}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_kept_from_where_the_pace_breaks() {
        let mut times = VideoTimes::default();
        let origin = Time::from_ns(5 * NS_PER_S);
        // Pictures tremble by a millisecond; two ticks are missed after the third frame.
        for (tick, trembling_ns) in [(0, 0), (1, 1_000_000), (2, -1_000_000), (5, 0), (6, 900_000)] {
            times.frame(origin.plus_ns(tick * NS_PER_S / FRAMES_PER_S + trembling_ns));
        }
        assert_eq!(times.marks(), [(0, 5_000_000_000), (3, 5_166_666_666)]);
    }
}
