//! Pictures of a video, with their times, through the programs `ffprobe` and `ffmpeg`.

use std::{
    collections::{HashMap, VecDeque},
    ffi::OsString,
    io::{self, BufRead, BufReader, Read as _},
    path::{Path, PathBuf},
    process::{Child, ChildStdout, Command, Stdio},
    sync::mpsc::{Receiver, SyncSender, sync_channel},
    thread::JoinHandle,
};

use crate::{ImportError, mpjpeg};

/// Quality of the JPEG pictures on ffmpeg's scale from 1 (best) to 31.
const JPEG_QUALITY: &str = "2";
/// Complaints that are kept for the report; the last ones of the reader.
const COMPLAINTS_MAX: usize = 5;
/// Times that may be known before their pictures; the reader is never more than a few dozen ahead.
const TIMES_AHEAD_MAX: usize = 65_536;

/// Containers and streams that hold the pictures themselves, by ffmpeg's names. A playlist would have it read other files of this computer.
const CONTAINERS: &str = "mov,matroska,avi,mpegts,mpeg,mpegvideo,m4v,h264,hevc,mjpeg,mpjpeg,flv,asf,ogg,mxf,nut,dv,gif,ivf,yuv4mpegpipe";
/// Largest side of a picture, pixels: that of what a camera sends.
const SIDE_MAX: u64 = 8192;

/// Properties of a video by `ffprobe`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct VideoInfo {
    /// Pictures, where the container knows.
    pub frames: Option<u64>,
    /// Average time between pictures, nanoseconds.
    pub interval_ns: i64,
}

/// Asks `ffprobe`, which lies beside `ffmpeg`, about the first video track.
pub(crate) fn probe(ffmpeg: &Path, video: &Path) -> Result<VideoInfo, ImportError> {
    let program = ffprobe_beside(ffmpeg);
    let output = Command::new(&program)
        .args(["-v", "error", "-protocol_whitelist", "file", "-format_whitelist", CONTAINERS])
        .args(["-select_streams", "v:0"])
        .args([
            "-show_entries",
            "stream=codec_name,width,height,avg_frame_rate,nb_frames,duration:stream_disposition=attached_pic",
        ])
        .args(["-of", "default=noprint_wrappers=1"])
        .arg(file_url(video))
        .stdin(Stdio::null())
        .output()
        .map_err(|e| start_error(&program, e))?;
    let complaint = || {
        let text = String::from_utf8_lossy(&output.stderr);
        if text.contains("not on whitelist") {
            return "it is no container with pictures in it (MP4, Matroska, AVI and their like); a playlist or a text would name other files"
                .to_owned();
        }
        text.lines().next_back().map_or_else(|| "no video track".to_owned(), |l| plain(l, video))
    };
    let not_video = |what| ImportError::NotVideo { path: video.to_owned(), what };
    if !output.status.success() {
        return Err(not_video(complaint()));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let fields: HashMap<_, _> = text.lines().filter_map(|l| l.split_once('=')).collect();
    if !fields.contains_key("codec_name") {
        return Err(not_video("it has no video track".to_owned()));
    }
    if fields.get("DISPOSITION:attached_pic") == Some(&"1") {
        return Err(not_video("it is sound with a cover picture".to_owned()));
    }
    let side = |name: &str| fields.get(name).and_then(|side| side.parse::<u64>().ok()).unwrap_or(0);
    if let Some(large) = [side("width"), side("height")].into_iter().find(|side| *side > SIDE_MAX) {
        return Err(not_video(format!(
            "its pictures have a side of {large} pixels, and the most is {SIDE_MAX}"
        )));
    }
    let seconds_per_frame = fields.get("avg_frame_rate").and_then(|rate| {
        let (count, seconds) = rate.split_once('/')?;
        Some(seconds.parse::<f64>().ok()? / count.parse::<f64>().ok()?)
    });
    let interval =
        seconds_per_frame.filter(|s| s.is_finite() && (1e-4..=100.0).contains(s)).unwrap_or(1.0 / 30.0);
    Ok(VideoInfo {
        frames: fields.get("nb_frames").and_then(|n| n.parse().ok()).filter(|n| *n > 0),
        interval_ns: (interval * 1e9).round() as i64,
    })
}

/// Place and time of a payload of a GPMF track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GpmfPacket {
    /// First byte in the file.
    pub offset: u64,
    /// Length in bytes.
    pub bytes: u64,
    /// When it begins, milliseconds on the container's clock.
    pub start_ms: f64,
    /// How long it lasts, milliseconds; zero where the container does not say.
    pub duration_ms: f64,
}

/// Asks `ffprobe`, which lies beside `ffmpeg`, for the payloads of the first GPMF track; `None` where there is none.
pub(crate) fn gpmf_packets(ffmpeg: &Path, video: &Path) -> Result<Option<Vec<GpmfPacket>>, ImportError> {
    let tracks = ffprobe(ffmpeg, video, "d", "stream=index,codec_tag_string,nb_frames")?;
    let tracks = tracks.lines().map(compact);
    let Some(track) = tracks.into_iter().find(|t| t.get("codec_tag_string") == Some(&"gpmd")) else {
        return Ok(None);
    };
    let fail = |what: String| ImportError::Telemetry { path: video.to_owned(), what };
    let index = track.get("index").copied().unwrap_or_default();
    let listed = ffprobe(ffmpeg, video, index, "packet=pts_time,duration_time,pos,size")?;
    let packets: Vec<GpmfPacket> = listed.lines().filter_map(|line| gpmf_packet(&compact(line))).collect();
    let expected = track.get("nb_frames").and_then(|n| n.parse().ok()).unwrap_or(packets.len());
    if packets.is_empty() || packets.len() < expected {
        let what = format!(
            "of its {expected} payloads {} can be read, because the index is damaged or the file is cut short",
            packets.len()
        );
        return Err(fail(what));
    }
    Ok(Some(packets))
}

/// Output of `ffprobe` for the chosen tracks, an entry a line, fields as `name=value` with bars between.
fn ffprobe(ffmpeg: &Path, video: &Path, tracks: &str, entries: &str) -> Result<String, ImportError> {
    let program = ffprobe_beside(ffmpeg);
    let output = Command::new(&program)
        .args(["-v", "error", "-protocol_whitelist", "file", "-format_whitelist", CONTAINERS])
        .args(["-select_streams", tracks])
        .args(["-show_entries", entries, "-of", "compact=p=0"])
        .arg(file_url(video))
        .stdin(Stdio::null())
        .output()
        .map_err(|e| start_error(&program, e))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        let what =
            text.lines().next_back().map_or_else(|| "no reason was given".to_owned(), |l| plain(l, video));
        return Err(ImportError::NotVideo { path: video.to_owned(), what });
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn compact(line: &str) -> HashMap<&str, &str> {
    line.split('|').filter_map(|field| field.split_once('=')).collect()
}

fn gpmf_packet(fields: &HashMap<&str, &str>) -> Option<GpmfPacket> {
    let ms = |name: &str| Some(fields.get(name)?.parse::<f64>().ok()? * 1000.0);
    Some(GpmfPacket {
        offset: fields.get("pos")?.parse().ok()?,
        bytes: fields.get("size")?.parse().ok()?,
        start_ms: ms("pts_time")?,
        duration_ms: ms("duration_time").unwrap_or(0.0),
    })
}

/// A picture with its time on the container's clock.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct VideoFrame {
    /// Nanoseconds.
    pub time_ns: i64,
    /// The JPEG file's bytes.
    pub jpeg: Vec<u8>,
}

/// A running `ffmpeg` that hands out a video's pictures. Dropped, it ends the program.
pub(crate) struct VideoReader {
    video: PathBuf,
    child: Child,
    pictures: BufReader<ChildStdout>,
    times: Receiver<Option<i64>>,
    listener: Option<JoinHandle<Complaints>>,
    frames: u64,
}

/// The last complaints of the reader.
type Complaints = VecDeque<String>;

impl VideoReader {
    /// Starts reading: the whole video, or its first seconds.
    pub(crate) fn start(ffmpeg: &Path, video: &Path, seconds: Option<f64>) -> Result<Self, ImportError> {
        let mut child = Command::new(ffmpeg)
            .args(["-hide_banner", "-nostdin", "-nostats", "-loglevel", "level+info"])
            .args(["-copyts", "-protocol_whitelist", "file,pipe", "-format_whitelist", CONTAINERS])
            .args(seconds.iter().flat_map(|s| ["-t".to_owned(), s.to_string()]))
            .arg("-i")
            .arg(file_url(video))
            // JPEG files are in full-range BT.601 by convention (JFIF 1.02), whatever the video is in.
            .args(["-map", "0:v:0", "-vf", "showinfo=checksum=0,scale=out_color_matrix=bt601:out_range=full"])
            .args(["-fps_mode", "passthrough", "-c:v", "mjpeg", "-q:v", JPEG_QUALITY, "-pix_fmt", "yuvj420p"])
            .args(["-f", "mpjpeg", "pipe:1"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| start_error(ffmpeg, e))?;
        let (sender, times) = sync_channel(TIMES_AHEAD_MAX);
        let (Some(pictures), Some(log)) = (child.stdout.take(), child.stderr.take()) else {
            return Err(start_error(ffmpeg, io::Error::other("its output cannot be read")));
        };
        let name = video.to_owned();
        let listener = std::thread::Builder::new()
            .name("ffmpeg-log".to_owned())
            .spawn(move || listen(BufReader::new(log), sender, &name))
            .map_err(|e| start_error(ffmpeg, e))?;
        let pictures = BufReader::with_capacity(1 << 16, pictures);
        Ok(Self { video: video.to_owned(), child, pictures, times, listener: Some(listener), frames: 0 })
    }

    /// The next picture; `None` at the end.
    pub(crate) fn next_frame(&mut self) -> Result<Option<VideoFrame>, ImportError> {
        let jpeg = match mpjpeg::next_jpeg(&mut self.pictures) {
            Ok(Some(jpeg)) => jpeg,
            Ok(None) => return Ok(None),
            Err(e) => {
                let _ = self.child.kill();
                let said = self.end().1;
                return Err(self.interrupted(said.last().cloned().unwrap_or_else(|| e.to_string())));
            }
        };
        match self.times.recv() {
            Ok(Some(time_ns)) => {
                self.frames += 1;
                Ok(Some(VideoFrame { time_ns, jpeg }))
            }
            Ok(None) | Err(_) => Err(self.interrupted("the next picture has no time".to_owned())),
        }
    }

    /// Call after [`VideoReader::next_frame`] gave `None`: whether the program ended well, and what it complained of.
    pub(crate) fn finish(mut self) -> Result<Vec<String>, ImportError> {
        let (success, complaints) = self.end();
        let said = || complaints.last().cloned().unwrap_or_else(|| "it gave no reason".to_owned());
        if self.frames == 0 {
            return Err(ImportError::NoFrames { path: self.video.clone(), what: said() });
        }
        if !success {
            return Err(self.interrupted(said()));
        }
        Ok(complaints)
    }

    fn interrupted(&self, what: String) -> ImportError {
        ImportError::Interrupted { path: self.video.clone(), frames: self.frames, what }
    }

    fn end(&mut self) -> (bool, Vec<String>) {
        let success = self.child.wait().is_ok_and(|status| status.success());
        let complaints = self.listener.take().and_then(|l| l.join().ok()).unwrap_or_default();
        (success, complaints.into())
    }
}

impl Drop for VideoReader {
    fn drop(&mut self) {
        if self.listener.is_some() {
            // It is wanted no more; that it may have ended already is no fault.
            let _ = self.child.kill();
            let _ = self.end();
        }
    }
}

/// Reads the program's log to its end: times of pictures to `times`, complaints kept.
fn listen(mut log: impl BufRead, times: SyncSender<Option<i64>>, video: &Path) -> Complaints {
    // Dropped where a time cannot be handed on, so that no picture gets the time of another; the log is read on, or the
    // program would wait for its reader.
    let mut times = Some(times);
    let mut complaints = Complaints::new();
    let mut base = None;
    let mut line = Vec::new();
    loop {
        line.clear();
        match log.by_ref().take(1 << 16).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return complaints,
            Ok(_) => {}
        }
        let text = String::from_utf8_lossy(&line);
        let text = text.trim();
        if text.contains("showinfo") {
            if let Some(found) = time_base(text) {
                base = Some(found);
            } else if let Some(pts) = picture_pts(text) {
                let time = pts.and_then(|pts| pts_ns(pts, base?));
                times = times.filter(|t| t.try_send(time).is_ok());
            }
        } else if ["[error]", "[fatal]", "[panic]"].iter().any(|level| text.contains(level)) {
            if complaints.len() == COMPLAINTS_MAX {
                complaints.pop_front();
            }
            complaints.push_back(plain(text, video));
        }
    }
}

/// `... config in time_base: 1/90000, ...`
fn time_base(line: &str) -> Option<(i64, i64)> {
    let rest = line.split_once("config in time_base:")?.1.trim_start();
    let (numerator, rest) = rest.split_once('/')?;
    let denominator = rest.split(|c: char| !c.is_ascii_digit()).next()?;
    let base = (numerator.trim().parse().ok()?, denominator.parse().ok()?);
    (base.0 > 0 && base.1 > 0).then_some(base)
}

/// `... n:   1 pts:   3003 pts_time:...`; `Some(None)` where the picture has no time.
fn picture_pts(line: &str) -> Option<Option<i64>> {
    line.split_once("] n:")?;
    let rest = line.split_once(" pts:")?.1.trim_start();
    Some(rest.split_whitespace().next()?.parse().ok())
}

fn pts_ns(pts: i64, (numerator, denominator): (i64, i64)) -> Option<i64> {
    let scaled = i128::from(pts) * i128::from(numerator) * 1_000_000_000;
    // Rounded to nearest.
    let half = i128::from(denominator) / 2;
    i64::try_from((scaled + half).div_euclid(i128::from(denominator))).ok()
}

fn file_url(path: &Path) -> OsString {
    // A name is a name, even where it begins with a dash or looks like the address of something on the network.
    let mut url = OsString::from("file:");
    url.push(path);
    url
}

/// A line of the program without what only it understands.
fn plain(line: &str, video: &Path) -> String {
    let mut text = line.trim();
    while let Some((_, rest)) = text.strip_prefix('[').and_then(|t| t.split_once(']')) {
        text = rest.trim_start();
    }
    let name = format!("file:{}", video.display());
    text.strip_prefix(&name).map_or(text, |t| t.trim_start_matches(':').trim_start()).to_owned()
}

fn ffprobe_beside(ffmpeg: &Path) -> PathBuf {
    match ffmpeg.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.join("ffprobe"),
        _ => PathBuf::from("ffprobe"),
    }
}

fn start_error(program: &Path, source: io::Error) -> ImportError {
    let program = program.display().to_string();
    match source.kind() {
        io::ErrorKind::NotFound => ImportError::ProgramMissing { program },
        _ => ImportError::ProgramStart { program, source },
    }
}

#[cfg(test)]
mod tests {
    use super::{GpmfPacket, Path, compact, gpmf_packet, picture_pts, plain, pts_ns, time_base};

    #[test]
    fn a_payload_is_a_line() {
        let packet = |line| gpmf_packet(&compact(line));
        let (bytes, offset) = (7824, 691_944);
        let expected = GpmfPacket { offset, bytes, start_ms: 1001.0, duration_ms: 1001.0 };
        let line = "pts_time=1.001000|duration_time=1.001000|size=7824|pos=691944";
        assert_eq!(
            packet(line).map(|p| GpmfPacket {
                start_ms: p.start_ms.round(),
                duration_ms: p.duration_ms.round(),
                ..p
            }),
            Some(expected)
        );
        assert_eq!(packet("pts_time=N/A|duration_time=1.001000|size=7824|pos=691944"), None);
        assert_eq!(packet("pts_time=0|duration_time=N/A|size=1|pos=2").unwrap().duration_ms, 0.0);
        assert_eq!(packet("codec_tag_string=gpmd|nb_frames=13"), None);
    }

    #[test]
    fn the_log_is_understood() {
        let config = "[Parsed_showinfo_0 @ 0x55] [info] config in time_base: 1/90000, frame_rate: 30000/1001";
        assert_eq!(time_base(config), Some((1, 90_000)));
        assert_eq!(time_base("[x] [info] config out time_base: 0/0, frame_rate: 0/0"), None);
        assert_eq!(time_base("config in time_base: 1/0, x"), None);
        let picture =
            "[Parsed_showinfo_0 @ 0x55] [info] n:  21 pts:  63063 pts_time:0.7007  pos:  480 fmt:yuvj420p";
        assert_eq!(picture_pts(picture), Some(Some(63_063)));
        assert_eq!(picture_pts("[x] [info] n:   1 pts: NOPTS pts_time:NOPTS"), Some(None));
        assert_eq!(picture_pts("[x] [info] color_range:pc color_space:bt709"), None);
        assert_eq!(pts_ns(63_063, (1, 90_000)), Some(700_700_000));
        assert_eq!(pts_ns(3003, (1, 90_000)), Some(33_366_667));
        assert_eq!(pts_ns(-3003, (1, 90_000)), Some(-33_366_667));
        assert_eq!(pts_ns(i64::MAX, (1000, 1)), None);
    }

    #[test]
    fn complaints_lose_their_decoration() {
        let video = Path::new("/a b/c.mp4");
        assert_eq!(plain("[h264 @ 0x1] [error] no frame!", video), "no frame!");
        assert_eq!(plain("[error] file:/a b/c.mp4: Invalid data", video), "Invalid data");
    }
}
