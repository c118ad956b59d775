//! From filled buffers to pictures: the newest wins, what is damaged is counted, and what is sound is lent or copied.

use std::sync::Arc;

use bowwave_core::{
    event::{CameraFrame, Picture, PixelFormat},
    fault::{Fault, FaultChange},
    time::Time,
};

use super::{CameraMachine, CameraOutput, CameraStream, Failure, MS, during};
use crate::camera::{
    Coding, Exposure,
    driver::{CameraDriver, FilledBuffer, SetFormat},
    jpeg::JpegError,
    negotiate::ModeCandidate,
    settings::usable_size,
    timing::{Sensor, mid_exposure},
};

/// Buffers that the driver must keep: one to fill while the other waits.
const DRIVER_KEEPS: usize = 2;
/// Between questions whether the driver's format is still the same.
const FORMAT_NS: i64 = 500 * MS;
/// Between questions how long the camera exposes: one that sees to that by itself takes some pictures from dark to bright.
const EXPOSURE_NS: i64 = 100 * MS;

/// How the rows of an uncompressed picture lie.
pub(super) struct PictureLayout {
    pub pixels: PixelFormat,
    /// Bytes of a row that are pixels.
    row: usize,
    /// Bytes from row to row.
    stride: usize,
    /// Rows, those of the chroma plane included.
    rows: usize,
    /// Bytes that a picture needs in the buffer.
    pub bytes: usize,
}

/// The layout, where the format is uncompressed. A row can be no shorter than its pixels, whatever the driver says.
pub(super) fn layout(format: &SetFormat) -> Option<PictureLayout> {
    let pixels = match format.coding {
        Coding::Yuyv => PixelFormat::Yuyv,
        Coding::Nv12 => PixelFormat::Nv12,
        Coding::Mjpeg | Coding::Other(_) => return None,
    };
    let (row, rows) = (pixels.row_bytes(format.width), pixels.rows(format.height));
    let stride = (format.bytes_per_line as usize).max(row);
    // The last row need not be padded.
    Some(PictureLayout { pixels, row, stride, rows, bytes: stride * rows.saturating_sub(1) + row })
}

/// So many pictures in a row may be left out because of their time stamps: fewer than 100 ms of video at 30 Hz.
const ODD_STAMPS: u32 = 2;

/// So many pictures in a row are of another size until that is believed.
const OTHER_SIZES: u32 = 3;

/// Fate of a buffer.
enum TakenPicture {
    Picture(Picture, Option<Arc<[u8]>>),
    /// Damaged, or of another size.
    Damaged,
    OtherSize,
}

impl CameraStream {
    /// An undamaged buffer came.
    pub(super) fn live(&mut self, now: Time) {
        if self.frames > 0 {
            // A camera may be slower than it says (long exposures); one late frame is not yet that.
            let interval = now.ns_since(self.last_frame).clamp(0, self.period_ns * 2);
            self.period_ns = ((self.period_ns * 7 + interval) / 8).max(self.nominal_ns);
        }
        self.frames += 1;
        self.last_frame = now;
    }

    /// Whether a picture whose stamp was `believed` or not is one of a few odd ones. Where they stay odd the camera is one
    /// without a useful clock, and the arrival counts: pictures that are all left out would be worth nothing.
    fn oddly_stamped(&mut self, believed: bool) -> bool {
        self.stamped |= believed;
        self.odd_stamps = if believed { 0 } else { self.odd_stamps.saturating_add(1) };
        self.stamped && (1..=ODD_STAMPS).contains(&self.odd_stamps)
    }
}

impl CameraMachine {
    /// Takes every filled buffer and gives all but the newest sound one back.
    pub(super) fn drain(
        &mut self,
        stream: &mut CameraStream,
        now: Time,
        driver: &mut impl CameraDriver,
        out: &mut CameraOutput,
    ) -> Result<Option<FilledBuffer>, Failure> {
        let mut newest: Option<FilledBuffer> = None;
        // Bounded: a driver may fill faster than this gives back.
        for _ in 0..=self.settings.buffers {
            let Some(filled) = driver.dequeue().map_err(during("get a picture"))? else { break };
            self.counters.buffers += 1;
            let step = stream.last_sequence.map_or(1, |last| filled.sequence.wrapping_sub(last));
            // Backwards is a counter that started anew.
            if (2..1 << 31).contains(&step) {
                self.counters.sequence_gaps += u64::from(step - 1);
            }
            stream.last_sequence = Some(filled.sequence);
            let unused = if filled.damaged {
                self.counters.damaged_buffers += 1;
                self.tell_damage(now, true, stream, out);
                Some(filled)
            } else {
                let older = newest.replace(filled);
                self.counters.skipped += u64::from(older.is_some());
                older
            };
            if let Some(unused) = unused {
                driver.queue(unused.index).map_err(during("give a buffer back"))?;
            }
        }
        Ok(newest)
    }

    /// Makes a picture of the newest buffer and hands it on. `false` where the format has changed.
    pub(super) fn take(
        &mut self,
        stream: &mut CameraStream,
        filled: FilledBuffer,
        now: Time,
        driver: &mut impl CameraDriver,
        out: &mut CameraOutput,
    ) -> Result<bool, Failure> {
        let locked = matches!(self.settings.controls.exposure, Exposure::Locked { .. });
        if !locked && now.ns_since(stream.exposure_asked) >= EXPOSURE_NS {
            (stream.exposure_ns, stream.exposure_asked) = (driver.exposure_ns(), now);
        }
        let sensor = Sensor {
            exposure_ns: stream.exposure_ns,
            readout_ns: self.settings.readout_us.map_or(stream.nominal_ns / 2, |us| i64::from(us) * 1000),
            period_ns: stream.nominal_ns,
        };
        let (mid, believed) = mid_exposure(filled.stamp, now, sensor);
        self.counters.stamps_not_believed += u64::from(!believed);
        let odd = stream.oddly_stamped(believed);
        if odd || mid <= self.last_mid {
            let name = stream.found.best_name();
            let what = if odd {
                let behind_ms = now.secs_since(filled.stamp.time) * 1e3;
                format!("a picture's time is {behind_ms:.0} ms before its arrival, unlike the others'")
            } else {
                let back_ms = self.last_mid.secs_since(mid) * 1e3;
                format!("a picture's time is {back_ms:.3} ms before the last one's")
            };
            let cause = format!("{}: {what}: left out; if it stays so, use another camera", name.display());
            out.faults.push(FaultChange::noted(now, Fault::CamTimestamp, cause));
            self.counters.out_of_order += 1;
            driver.queue(filled.index).map_err(during("give a buffer back"))?;
            return Ok(true);
        }
        let taken = match layout(&stream.format) {
            Some(layout) => self.raw(&layout, stream, filled, driver)?,
            None => self.jpeg(stream, filled, driver)?,
        };
        let TakenPicture::Picture(picture, jpeg) = taken else {
            return self.refuse(&taken, stream, now, driver, out);
        };
        self.last_mid = mid;
        stream.other_sizes = 0;
        self.judge(now, &picture, stream, out);
        self.counters.frames += 1;
        out.frames.push(CameraFrame {
            arrival: now,
            mid_exposure: mid,
            sequence: filled.sequence,
            picture,
            jpeg,
        });
        Ok(true)
    }

    /// A buffer that is no picture. `false` where that is because the format has changed.
    fn refuse(
        &mut self,
        taken: &TakenPicture,
        stream: &mut CameraStream,
        now: Time,
        driver: &mut impl CameraDriver,
        out: &mut CameraOutput,
    ) -> Result<bool, Failure> {
        self.counters.damaged_pictures += 1;
        stream.other_sizes =
            if matches!(taken, TakenPicture::OtherSize) { stream.other_sizes + 1 } else { 0 };
        // A damaged header says any size.
        if stream.other_sizes >= OTHER_SIZES {
            let cause = format!(
                "{} sends pictures of another size than the {}x{} agreed: calibrate it anew, or use another camera",
                stream.found.best_name().display(),
                stream.format.width,
                stream.format.height
            );
            self.raise(now, Fault::CamFormat, cause, out);
        }
        self.tell_damage(now, true, stream, out);
        if now.ns_since(stream.format_asked) >= FORMAT_NS {
            stream.format_asked = now;
            return Ok(driver.format().map_err(during("ask for its format"))? == stream.format);
        }
        Ok(true)
    }

    /// Takes in that a picture was sound.
    fn judge(&mut self, now: Time, picture: &Picture, stream: &CameraStream, out: &mut CameraOutput) {
        for fault in super::GONE_WITH_FRAMES {
            self.clear(now, fault, out);
        }
        if self.check_size(now, (picture.width(), picture.height()), &stream.found, out) {
            self.clear(now, Fault::CamFormat, out);
        }
        self.tell_damage(now, false, stream, out);
        let still = self.stillness.push(now, picture.bytes()).then(|| {
            format!(
                "the pictures of {} have not changed for a second: uncover the lens, or replug the camera",
                stream.found.best_name().display()
            )
        });
        self.tell(now, Fault::CamStatic, still, out);
    }

    fn tell_damage(&mut self, now: Time, damaged: bool, stream: &CameraStream, out: &mut CameraOutput) {
        let damaged = self.damage.push(now, damaged).then(|| {
            let (bad, all) = self.damage.share();
            format!(
                "{bad} of {all} pictures of {} are damaged: check its cable",
                stream.found.best_name().display()
            )
        });
        self.tell(now, Fault::CamCorrupt, damaged, out);
    }

    /// `fault` is there for that cause, or is not.
    fn tell(&mut self, now: Time, fault: Fault, cause: Option<String>, out: &mut CameraOutput) {
        match cause {
            Some(cause) => self.raise(now, fault, cause, out),
            None => self.clear(now, fault, out),
        }
    }

    /// An uncompressed picture: lent where it lies packed and the driver can spare the buffer, else copied.
    fn raw(
        &mut self,
        layout: &PictureLayout,
        stream: &CameraStream,
        filled: FilledBuffer,
        driver: &mut impl CameraDriver,
    ) -> Result<TakenPicture, Failure> {
        let SetFormat { width, height, .. } = stream.format;
        let back = during("give a buffer back");
        let memory = driver.bytes(filled.index);
        // `bytes_used` is the driver's word; the mapping is what there is.
        if filled.bytes_used < layout.bytes || memory.len() < layout.bytes {
            driver.queue(filled.index).map_err(back)?;
            return Ok(TakenPicture::Damaged);
        }
        if layout.stride == layout.row
            && driver.queued() >= DRIVER_KEEPS
            && let Some(memory) = driver.lend(filled.index)
        {
            self.counters.lent += 1;
            // Its size was checked; a picture that is none gives the buffer back by itself.
            return Ok(Picture::lent(layout.pixels, width, height, memory)
                .map_or(TakenPicture::Damaged, |picture| TakenPicture::Picture(picture, None)));
        }
        let memory = driver.bytes(filled.index);
        let packed = self.packed.filled(layout.row * layout.rows, |target| {
            let rows = memory.chunks(layout.stride).take(layout.rows);
            for (to, from) in target.chunks_exact_mut(layout.row).zip(rows) {
                to.copy_from_slice(from.get(..layout.row).ok_or(())?);
            }
            Ok::<_, ()>(())
        });
        self.counters.copied += 1;
        driver.queue(filled.index).map_err(back)?;
        let picture = packed.ok().and_then(|bytes| Picture::new(layout.pixels, width, height, bytes).ok());
        Ok(picture.map_or(TakenPicture::Damaged, |picture| TakenPicture::Picture(picture, None)))
    }

    fn jpeg(
        &mut self,
        stream: &CameraStream,
        filled: FilledBuffer,
        driver: &mut impl CameraDriver,
    ) -> Result<TakenPicture, Failure> {
        let memory = driver.bytes(filled.index);
        let bytes: Option<Arc<[u8]>> = memory.get(..filled.bytes_used).map(Arc::from);
        // The copy is small; the buffer need not wait for the decoder.
        driver.queue(filled.index).map_err(during("give a buffer back"))?;
        let Some(bytes) = bytes else { return Ok(TakenPicture::Damaged) };
        let SetFormat { width, height, .. } = stream.format;
        Ok(match self.decoder.decode(&bytes, Some((width, height))) {
            Ok(picture) => TakenPicture::Picture(picture, Some(bytes)),
            Err(JpegError::Size { .. }) => TakenPicture::OtherSize,
            Err(e) => {
                log::debug!("{}: {e}", stream.found.node.display());
                TakenPicture::Damaged
            }
        })
    }
}

impl SetFormat {
    pub(super) fn is(&self, candidate: &ModeCandidate) -> bool {
        let mode = &candidate.mode;
        (self.coding, self.width, self.height) == (mode.coding, mode.width, mode.height)
    }
}

/// Whether a picture of that format can be what the driver says.
pub(super) fn plausible(format: &SetFormat) -> bool {
    usable_size(format.coding, format.width, format.height)
        && layout(format).is_none_or(|layout| layout.bytes <= format.size_image as usize)
}
