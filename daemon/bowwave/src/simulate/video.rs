//! A video file of what was shown, through ffmpeg.

use std::{
    io::Write,
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
};

use anyhow::{Context, Result, bail};

/// Frames on their way into an H.264 file.
#[derive(Debug)]
pub struct VideoWriter {
    child: Child,
    stdin: Option<ChildStdin>,
    path: PathBuf,
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
        let stdin = child.stdin.take();
        Ok(Self { child, stdin, path: path.to_path_buf() })
    }

    /// Adds a frame, sRGB RGBA bytes from the upper left.
    pub fn frame(&mut self, rgba: &[u8]) -> Result<()> {
        let stdin = self.stdin.as_mut().context("the video is already finished")?;
        if stdin.write_all(rgba).is_err() {
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
        drop(self.stdin.take());
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
        Ok(())
    }
}

impl Drop for VideoWriter {
    fn drop(&mut self) {
        if self.stdin.take().is_some() {
            log::warn!("the video {} was not finished; ffmpeg ends it as it is", self.path.display());
            if let Err(e) = self.child.wait() {
                log::warn!("cannot wait for ffmpeg: {e}");
            }
        }
    }
}
