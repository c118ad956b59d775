//! The live picture: asked for at a pace, encoded once for all.

use std::{
    sync::{
        Arc, Condvar, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use axum::body::Bytes;
use bowwave_link::Picture;
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
use rustix::time::{ClockId, clock_gettime};
use tokio::sync::watch;

use crate::locked;

/// A picture that was asked for and has not come after this time will not come.
const LOST_AFTER: Duration = Duration::from_secs(1);

/// A picture as browsers get it.
#[derive(Debug)]
pub(crate) struct Frame {
    pub(crate) number: u64,
    complete_ns: i64,
    jpeg: Vec<u8>,
}

impl Frame {
    /// Age in microseconds and number (u64 each, little-endian), then the JPEG.
    pub(crate) fn message(&self, now_ns: i64) -> Bytes {
        let age_us = u64::try_from(now_ns.saturating_sub(self.complete_ns) / 1000).unwrap_or(0);
        [&age_us.to_le_bytes()[..], &self.number.to_le_bytes(), &self.jpeg].concat().into()
    }
}

/// `CLOCK_MONOTONIC`, nanoseconds.
pub(crate) fn monotonic_ns() -> i64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec.saturating_mul(1_000_000_000).saturating_add(now.tv_nsec)
}

#[derive(Default)]
struct Slot {
    /// The newest picture that is not encoded yet.
    picture: Option<Picture>,
    asked: Option<Instant>,
    stops: bool,
}

/// The way of pictures from the trainer to browsers.
pub(crate) struct Frames {
    slot: Mutex<Slot>,
    filled: Condvar,
    newest: watch::Sender<Option<Arc<Frame>>>,
    /// Browsers that have drawn their last picture and want another.
    waiting: AtomicUsize,
    quality: u8,
    width_max: u32,
}

impl Frames {
    pub(crate) fn new(quality: u8, width_max: u32) -> Self {
        Self {
            slot: Mutex::default(),
            filled: Condvar::new(),
            newest: watch::Sender::new(None),
            waiting: AtomicUsize::new(0),
            quality,
            width_max,
        }
    }

    pub(crate) fn newest(&self) -> watch::Receiver<Option<Arc<Frame>>> {
        self.newest.subscribe()
    }

    /// Tests whether the next picture is to be asked for now, and takes it as asked for.
    pub(crate) fn asks(&self, now: Instant) -> bool {
        let mut slot = locked(&self.slot);
        let is_on_its_way = slot.asked.is_some_and(|asked| now.saturating_duration_since(asked) < LOST_AFTER);
        // Where the encoder does not keep up it gets no more to do.
        let asks = self.waiting.load(Ordering::Relaxed) > 0 && !is_on_its_way && slot.picture.is_none();
        if asks {
            slot.asked = Some(now);
        }
        asks
    }

    /// A picture that came. One that is not encoded yet gives way.
    pub(crate) fn came(&self, picture: Picture) {
        let mut slot = locked(&self.slot);
        slot.asked = None;
        slot.picture = Some(picture);
        self.filled.notify_one();
    }

    /// The trainer is gone: nothing that was asked for comes.
    pub(crate) fn forget(&self) {
        locked(&self.slot).asked = None;
        self.newest.send_replace(None);
    }

    pub(crate) fn stop(&self) {
        locked(&self.slot).stops = true;
        self.filled.notify_all();
    }

    /// Encodes what comes until it is stopped. The trainer's own threads come first, but on a computer that others keep busy a picture must
    /// not wait for them: at a niceness of 19 it was 20 s old, at 5 it is 30 ms.
    pub(crate) fn encode(&self) {
        be_nice(5);
        let mut rgb = Vec::new();
        loop {
            let picture = {
                let mut slot = locked(&self.slot);
                loop {
                    if slot.stops {
                        return;
                    }
                    if let Some(picture) = slot.picture.take() {
                        break picture;
                    }
                    slot = self.filled.wait(slot).unwrap_or_else(std::sync::PoisonError::into_inner);
                }
            };
            match jpeg(&picture, self.quality, self.width_max, &mut rgb) {
                Ok(jpeg) => {
                    let Picture { frame: number, complete_ns, .. } = picture;
                    self.newest.send_replace(Some(Arc::new(Frame { number, complete_ns, jpeg })));
                }
                Err(error) => log::warn!("picture {} cannot be encoded: {error}", picture.frame),
            }
        }
    }
}

/// The wish of one browser for the next picture: dropped with it.
pub(crate) struct Wish<'a> {
    frames: &'a Frames,
    stands: bool,
}

impl<'a> Wish<'a> {
    pub(crate) fn new(frames: &'a Frames) -> Self {
        Self { frames, stands: false }
    }

    pub(crate) fn stands(&self) -> bool {
        self.stands
    }

    pub(crate) fn set(&mut self, stands: bool) {
        match (self.stands, stands) {
            (false, true) => self.frames.waiting.fetch_add(1, Ordering::Relaxed),
            (true, false) => self.frames.waiting.fetch_sub(1, Ordering::Relaxed),
            _ => 0,
        };
        self.stands = stands;
    }
}

impl Drop for Wish<'_> {
    fn drop(&mut self) {
        self.set(false);
    }
}

/// Lets other threads of the computer go first: 0 is the usual niceness, 19 the greatest.
pub(crate) fn be_nice(niceness: i32) {
    // On Linux that of the calling thread alone. Threads that it starts begin with it.
    if let Err(error) = rustix::process::setpriority_process(None, niceness) {
        log::debug!("a thread keeps its priority: {error}");
    }
}

/// The picture as JPEG, made smaller by a whole number where it is too wide.
fn jpeg(picture: &Picture, quality: u8, width_max: u32, rgb: &mut Vec<u8>) -> image::ImageResult<Vec<u8>> {
    let by = picture.width.div_ceil(width_max.max(1)).max(1);
    let (width, height) = ((picture.width / by).max(1), (picture.height / by).max(1));
    rgb.clear();
    rgb.reserve((width * height * 3) as usize);
    if by == 1 {
        rgb.extend(picture.rgba.chunks_exact(4).flat_map(|pixel| match pixel {
            [r, g, b, ..] => [*r, *g, *b],
            _ => [0; 3],
        }));
    } else {
        smaller(picture, by as usize, (width as usize, height as usize), rgb);
    }
    let mut jpeg = Vec::with_capacity(rgb.len() / 8);
    let mut encoder = JpegEncoder::new_with_quality(&mut jpeg, quality);
    encoder.encode(rgb, width, height, ExtendedColorType::Rgb8)?;
    Ok(jpeg)
}

/// Means of squares of `by` times `by` pixels.
fn smaller(picture: &Picture, by: usize, (width, height): (usize, usize), rgb: &mut Vec<u8>) {
    let row_bytes = picture.width as usize * 4;
    let mut sums = vec![[0u32; 3]; width];
    let count = u32::try_from(by * by).unwrap_or(1);
    for rows in picture.rgba.chunks(row_bytes * by).take(height) {
        sums.fill([0; 3]);
        for row in rows.chunks_exact(row_bytes) {
            for (sum, square) in sums.iter_mut().zip(row.chunks_exact(4 * by)) {
                for pixel in square.chunks_exact(4) {
                    sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += u32::from(*value));
                }
            }
        }
        // A mean of bytes is one.
        rgb.extend(sums.iter().flatten().map(|sum| (sum / count) as u8));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sea under a sky, with the noise of a camera.
    fn picture(frame: u64, width: u32, height: u32) -> Picture {
        let mut noise = 1u32;
        let rgba = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .flat_map(|(x, y)| {
                noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let grain = (noise >> 28) as u8;
                let wave = if y > height / 2 { ((x * 3 + y * y / 9) % 50) as u8 } else { 90 };
                [wave + grain, 90 + wave / 2 + grain, 120 + wave / 2 + grain, 255]
            })
            .collect();
        Picture { frame, complete_ns: 0, width, height, rgba }
    }

    #[test]
    fn a_picture_is_encoded_in_time() {
        let picture = picture(1, 1280, 720);
        let mut rgb = Vec::new();
        let begun = Instant::now();
        let times = 20;
        let mut bytes = 0;
        for _ in 0..times {
            bytes = jpeg(&picture, 80, 1280, &mut rgb).unwrap().len();
        }
        let each = begun.elapsed() / times;
        println!("1280x720 at quality 80: {:.1} ms, {} kB", each.as_secs_f64() * 1e3, bytes / 1000);
        assert!(each < Duration::from_millis(300));
        let image = image::load_from_memory(&jpeg(&picture, 80, 1280, &mut rgb).unwrap()).unwrap().to_rgb8();
        assert_eq!(image.dimensions(), (1280, 720));
        let near = |a: u8, b: u8| a.abs_diff(b) < 40;
        assert!(near(image.get_pixel(0, 0).0[2], picture.rgba[2]));
    }

    #[test]
    fn a_picture_that_is_too_wide_is_made_smaller() {
        let picture = picture(1, 101, 61);
        let mut rgb = Vec::new();
        for (width_max, size) in [(101, (101, 61)), (100, (50, 30)), (40, (33, 20)), (1, (1, 1))] {
            let jpeg = jpeg(&picture, 90, width_max, &mut rgb).unwrap();
            assert_eq!(rgb.len(), size.0 * size.1 * 3);
            let image = image::load_from_memory(&jpeg).unwrap();
            assert_eq!((image.width() as usize, image.height() as usize), size);
        }
        let grey = Picture { rgba: vec![77; 8 * 6 * 4], width: 8, height: 6, frame: 1, complete_ns: 0 };
        jpeg(&grey, 90, 4, &mut rgb).unwrap();
        assert_eq!(rgb, [77; 4 * 3 * 3]);
        let low = Picture { rgba: vec![9; 5000 * 4], width: 5000, height: 1, frame: 1, complete_ns: 0 };
        assert!(jpeg(&low, 90, 1280, &mut rgb).is_ok(), "one row");
        let high = Picture { width: 1, height: 70_000, rgba: vec![9; 70_000 * 4], frame: 1, complete_ns: 0 };
        assert!(jpeg(&high, 90, 1280, &mut rgb).is_err(), "higher than a JPEG can be");
    }

    #[test]
    fn pictures_are_asked_for_while_somebody_waits_and_newest_wins() {
        let frames = Arc::new(Frames::new(80, 1280));
        let now = Instant::now();
        assert!(!frames.asks(now), "nobody watches");
        let mut wish = Wish::new(&frames);
        wish.set(true);
        wish.set(true);
        assert!(frames.asks(now) && !frames.asks(now), "once");
        assert!(frames.asks(now + LOST_AFTER), "the first did not come");
        frames.came(picture(1, 16, 8));
        frames.came(picture(2, 16, 8));
        assert!(!frames.asks(now + 2 * LOST_AFTER), "one is to be encoded yet");
        let mut newest = frames.newest();
        let encoder = std::thread::spawn({
            let frames = Arc::clone(&frames);
            move || frames.encode()
        });
        let begun = Instant::now();
        while newest.borrow_and_update().is_none() {
            assert!(begun.elapsed() < Duration::from_secs(20));
            std::thread::sleep(Duration::from_millis(1));
        }
        let frame = newest.borrow().clone().unwrap();
        let message = frame.message(5_000_000);
        assert_eq!(
            (frame.number, &message[..8], &message[16..18]),
            (2, &5000u64.to_le_bytes()[..], &[0xff, 0xd8][..])
        );
        frames.stop();
        encoder.join().unwrap();
        drop(wish);
        assert_eq!(frames.waiting.load(Ordering::Relaxed), 0);
    }
}
