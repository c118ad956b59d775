//! A scripted driver and a clock of numbers, for the tests of the machine.

use std::{collections::VecDeque, path::Path};

use bowwave_core::{event::Lent, fault::Change};
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
use rustix::io::Errno;

use super::super::*;
use crate::camera::{
    Coding, Rate, Size,
    driver::FilledBuffer,
    negotiate::{ModeCandidate, Offer, Rates},
    settings::Controls,
    timing::BufferStamp,
};

pub(super) const PERIOD_NS: i64 = 33_333_333;
pub(super) const SIZE: (u32, u32) = (64, 48);

pub(super) fn error(errno: Errno) -> io::Error {
    io::Error::from_raw_os_error(errno.raw_os_error())
}

pub(super) struct Memory(Vec<u8>, crossbeam_channel::Sender<u32>, u32);

impl Lent for Memory {
    fn mapping(&self) -> &[u8] {
        &self.0
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        let _ = self.1.send(self.2);
    }
}

/// A camera that does what the test says.
pub(super) struct Fake {
    pub(super) found: Vec<FoundCamera>,
    pub(super) offers: Vec<Offer>,
    /// Answers of the next calls, where they are not good.
    pub(super) open_fails: VecDeque<Errno>,
    pub(super) start_fails: fn(&ModeCandidate) -> Option<Errno>,
    pub(super) restart_fails: Option<Errno>,
    pub(super) dequeue_fails: Option<Errno>,
    pub(super) reset_works: bool,
    /// The mode that the driver sets instead of the one asked for.
    pub(super) format_set: Option<SetFormat>,
    /// The mode that it tells later.
    pub(super) format_now: Option<SetFormat>,
    pub(super) mode: Option<ModeCandidate>,
    pub(super) exposure_ns: i64,
    pub(super) filled: VecDeque<(FilledBuffer, Vec<u8>)>,
    pub(super) here: Vec<Option<Vec<u8>>>,
    pub(super) at_driver: usize,
    pub(super) back: (crossbeam_channel::Sender<u32>, crossbeam_channel::Receiver<u32>),
    pub(super) changed: bool,
    pub(super) log: Vec<&'static str>,
}

impl Fake {
    pub(super) fn new(coding: &[u8; 4]) -> Self {
        let rates = Rates::Listed(vec![Rate::hz(30).unwrap()]);
        let size = |(width, height)| (Size::Fixed { width, height }, rates.clone());
        Self {
            found: vec![camera("/dev/video0", "A")],
            offers: vec![Offer { fourcc: *coding, sizes: vec![size(SIZE), size((32, 24))] }],
            open_fails: VecDeque::new(),
            start_fails: |_| None,
            restart_fails: None,
            dequeue_fails: None,
            reset_works: true,
            format_set: None,
            format_now: None,
            mode: None,
            exposure_ns: 4 * MS,
            filled: VecDeque::new(),
            here: Vec::new(),
            at_driver: 0,
            back: crossbeam_channel::unbounded(),
            changed: false,
            log: Vec::new(),
        }
    }

    pub(super) fn agreed(&self) -> SetFormat {
        let mode = self.mode.unwrap().mode;
        let bytes_per_line = if mode.coding == Coding::Yuyv { mode.width * 2 } else { mode.width };
        SetFormat {
            coding: mode.coding,
            width: mode.width,
            height: mode.height,
            bytes_per_line,
            size_image: mode.width * mode.height * 2,
        }
    }
}

pub(super) fn camera(node: &str, serial: &str) -> FoundCamera {
    FoundCamera {
        node: node.into(),
        links: vec![format!("/dev/v4l/by-id/usb-{serial}").into()],
        serial: Some(serial.to_owned()),
        name: "Cam".to_owned(),
        usb: Some("/dev/bus/usb/001/002".into()),
        named: false,
    }
}

impl CameraDriver for Fake {
    fn find(&mut self, _: &CameraSettings) -> Vec<FoundCamera> {
        self.found.clone()
    }

    fn open(&mut self, node: &Path, _: &CameraSettings) -> io::Result<OpenedCamera> {
        self.log.push("open");
        if let Some(errno) = self.open_fails.pop_front() {
            return Err(error(errno));
        }
        let there = self.found.iter().any(|f| f.node == node);
        if !there {
            return Err(error(Errno::NODEV));
        }
        Ok(OpenedCamera { card: "Cam".to_owned(), captures: true, offers: self.offers.clone() })
    }

    fn set_mode(&mut self, wanted: &ModeCandidate) -> io::Result<(SetFormat, Option<Rate>)> {
        self.mode = Some(*wanted);
        Ok((self.format_set.unwrap_or_else(|| self.agreed()), Some(wanted.mode.rate)))
    }

    fn format(&mut self) -> io::Result<SetFormat> {
        Ok(self.format_now.or(self.format_set).unwrap_or_else(|| self.agreed()))
    }

    fn set_controls(&mut self, _: &Controls) -> Vec<&'static str> {
        vec!["exposure time"]
    }

    fn exposure_ns(&mut self) -> Option<i64> {
        Some(self.exposure_ns)
    }

    fn start(&mut self, buffers: u32) -> io::Result<u32> {
        self.log.push("start");
        if let Some(errno) = (self.start_fails)(&self.mode.unwrap()) {
            return Err(error(errno));
        }
        // What was lent by an earlier stream does not come back into this one.
        self.back = crossbeam_channel::unbounded();
        self.here = vec![None; buffers as usize];
        self.at_driver = buffers as usize;
        self.filled.clear();
        Ok(buffers)
    }

    fn restart(&mut self) -> io::Result<()> {
        self.log.push("restart");
        self.restart_fails.map_or(Ok(()), |errno| Err(error(errno)))
    }

    fn stop(&mut self) {
        self.log.push("stop");
        self.at_driver = 0;
    }

    fn dequeue(&mut self) -> io::Result<Option<FilledBuffer>> {
        if let Some(errno) = self.dequeue_fails {
            return Err(error(errno));
        }
        let Some((mut filled, bytes)) = self.filled.pop_front() else { return Ok(None) };
        assert!(self.at_driver > 0, "the driver has no buffer to fill");
        self.at_driver -= 1;
        let free = self.here.iter().position(Option::is_none).unwrap();
        filled.index = free as u32;
        self.here[free] = Some(bytes);
        Ok(Some(filled))
    }

    fn bytes(&self, index: u32) -> &[u8] {
        self.here[index as usize].as_deref().unwrap_or_default()
    }

    fn queue(&mut self, index: u32) -> io::Result<()> {
        self.here[index as usize].take().expect("a buffer that is here");
        self.at_driver += 1;
        Ok(())
    }

    fn lend(&mut self, index: u32) -> Option<Arc<dyn Lent>> {
        // It is neither here nor at the driver, but its place stays taken.
        let bytes = self.here[index as usize].replace(Vec::new())?;
        Some(Arc::new(Memory(bytes, self.back.0.clone(), index)))
    }

    fn reclaim(&mut self) -> io::Result<()> {
        while let Ok(index) = self.back.1.try_recv() {
            self.queue(index)?;
        }
        Ok(())
    }

    fn queued(&self) -> usize {
        self.at_driver
    }

    fn source_changed(&mut self) -> bool {
        std::mem::take(&mut self.changed)
    }

    fn close(&mut self) {
        self.log.push("close");
        self.at_driver = 0;
        self.filled.clear();
    }

    fn reset(&mut self, _: &FoundCamera) -> io::Result<()> {
        self.log.push("reset");
        if self.reset_works { Ok(()) } else { Err(error(Errno::ACCESS)) }
    }
}

/// A machine with its driver and its clock.
pub(super) struct CameraBench {
    pub(super) fake: Fake,
    pub(super) machine: CameraMachine,
    pub(super) now: Time,
    pub(super) sequence: u32,
    pub(super) frames: Vec<CameraFrame>,
    pub(super) faults: Vec<FaultChange>,
}

impl CameraBench {
    pub(super) fn new(coding: &[u8; 4], settings: CameraSettings) -> Self {
        settings.check().unwrap();
        let now = Time::from_ns(10_000_000_000);
        Self {
            fake: Fake::new(coding),
            machine: CameraMachine::new(settings, now),
            now,
            sequence: 0,
            frames: Vec::new(),
            faults: Vec::new(),
        }
    }

    pub(super) fn step(&mut self, ready: Ready) -> Time {
        let mut out = CameraOutput::default();
        let due = self.machine.step(self.now, ready, &mut self.fake, &mut out);
        self.frames.extend(out.frames);
        self.faults.extend(out.faults);
        due
    }

    /// Lets `ms` pass without a picture, waking only when the machine asks for it.
    pub(super) fn pass(&mut self, ms: i64) {
        let end = self.now.plus_ns(ms * MS);
        let mut steps = 0;
        loop {
            let due = self.step(Ready::default());
            steps += 1;
            assert!(steps < 10 + ms / 20, "a busy loop");
            if due > end {
                break;
            }
            self.now = due.max(self.now);
        }
        self.now = end;
        self.step(Ready::default());
    }

    pub(super) fn fill(&mut self, bytes: Vec<u8>, damaged: bool) {
        self.sequence += 1;
        let stamp =
            BufferStamp { time: self.now.plus_ns(-10 * MS), monotonic: true, start_of_exposure: true };
        let filled =
            FilledBuffer { index: 0, bytes_used: bytes.len(), damaged, sequence: self.sequence, stamp };
        self.fake.filled.push_back((filled, bytes));
    }

    /// A picture unlike the last one.
    pub(super) fn picture(&self) -> Vec<u8> {
        let ModeCandidate { mode, .. } = self.fake.mode.unwrap();
        let value = (self.sequence % 200) as u8;
        if mode.coding == Coding::Mjpeg {
            jpeg(mode.width, value)
        } else {
            vec![value; (mode.width * mode.height * 2) as usize]
        }
    }

    /// `count` frames, one a period, each in its turn.
    pub(super) fn frames(&mut self, count: u32) {
        for _ in 0..count {
            let picture = self.picture();
            self.send(picture);
        }
    }

    /// A frame a period later, whatever its bytes are.
    pub(super) fn send(&mut self, bytes: Vec<u8>) {
        self.now = self.now.plus_ns(PERIOD_NS);
        self.fill(bytes, false);
        self.step(Ready { filled: true, ..Ready::default() });
    }

    /// Looks for the camera, opens it and streams.
    pub(super) fn streaming(mut self) -> Self {
        self.step(Ready::default());
        self.frames(20);
        assert_eq!(self.machine.status().life, CameraLife::Streaming);
        self.frames.clear();
        self.faults.clear();
        self.fake.log.clear();
        self
    }

    /// The reports since the last call, and when, milliseconds from `since`.
    pub(super) fn told(&mut self, since: Time) -> Vec<(Fault, &'static str, i64)> {
        let told = |c: FaultChange| {
            let kind = match c.change {
                Change::Raised { cause } => {
                    assert!(cause.len() > 20 && !cause.contains('\n'), "{cause}");
                    "raised"
                }
                Change::Cleared => "cleared",
                Change::Noted { .. } => "noted",
            };
            (c.fault, kind, c.time.ns_since(since) / MS)
        };
        self.faults.drain(..).map(told).collect()
    }

    pub(super) fn life(&self) -> CameraLife {
        self.machine.status().life
    }

    pub(super) fn counters(&self) -> CameraCounters {
        self.machine.status().counters
    }
}

pub(super) fn jpeg(width: u32, value: u8) -> Vec<u8> {
    let height = width * 3 / 4;
    let mut bytes = Vec::new();
    let mut encoder = JpegEncoder::new_with_quality(&mut bytes, 90);
    encoder
        .encode(&vec![value; (width * height * 3) as usize], width, height, ExtendedColorType::Rgb8)
        .unwrap();
    bytes
}

pub(super) fn yuyv() -> CameraBench {
    CameraBench::new(b"YUYV", CameraSettings { calibrated_size: Some(SIZE), ..CameraSettings::default() })
}

pub(super) fn mjpeg() -> CameraBench {
    CameraBench::new(b"MJPG", CameraSettings { calibrated_size: Some(SIZE), ..CameraSettings::default() })
}
