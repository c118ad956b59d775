//! A video file of what was shown, through ffmpeg.

use std::{
    io::Write,
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
    thread::{self, JoinHandle},
};

use anyhow::{Context, Result, anyhow, bail};
use crossbeam_channel::{Receiver, Sender, bounded};

/// Frames that wait for ffmpeg: it takes half a second to begin, and drawing must not wait for that.
const QUEUE: usize = 20;

/// Frames on their way into an H.264 file.
#[derive(Debug)]
pub struct VideoWriter {
    child: Child,
    frames: Option<Sender<Vec<u8>>>,
    /// Buffers to fill again.
    empty: Receiver<Vec<u8>>,
    feeder: Option<JoinHandle<std::io::Result<()>>>,
    path: PathBuf,
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
        Ok(Self { child, frames: Some(frames), empty, feeder: Some(feeder), path: path.to_path_buf() })
    }

    /// Adds a frame, sRGB RGBA bytes from the upper left.
    pub fn frame(&mut self, rgba: &[u8]) -> Result<()> {
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

    /// Ends the file.
    pub fn finish(mut self) -> Result<()> {
        self.finish_inner()
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
