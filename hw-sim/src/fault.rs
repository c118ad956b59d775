//! Seeded faults of the simulated hardware, to be ridden out.

use bowwave_core::{event::ImuSample, time::NS_PER_S};
use glam::DVec3;
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Kind of the fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FaultKind {
    /// The inertial unit sends nothing.
    ImuDropOut,
    /// The inertial unit sends the same rate, acceleration and attitude again and again; its clock runs on.
    ImuFreeze,
    /// The inertial unit sends a rate that is not a number.
    ImuNan,
    /// Up to 40 bytes of anything, false preambles among them, before each packet.
    LineGarbage,
    /// The camera delivers nothing.
    FrameDropOut,
    /// The camera delivers pictures of half the width and height.
    FrameOtherSize,
    /// The camera delivers JPEGs that are cut short or have no readable header.
    FrameCorrupt,
}

impl FaultKind {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::ImuDropOut,
        Self::ImuFreeze,
        Self::ImuNan,
        Self::LineGarbage,
        Self::FrameDropOut,
        Self::FrameOtherSize,
        Self::FrameCorrupt,
    ];
}

/// One fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// When it begins, nanoseconds after the replay's origin; later rounds of a loop count on.
    pub from_ns: i64,
    /// How long it lasts, nanoseconds.
    pub for_ns: i64,
}

/// The faults of a replay. The same plan on the same recording alters the same bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FaultPlan {
    /// Decides which bytes are altered and how.
    pub seed: u64,
    /// The faults; they may overlap.
    pub faults: Vec<Fault>,
}

impl FaultPlan {
    /// No fault yet.
    pub const fn new(seed: u64) -> Self {
        Self { seed, faults: Vec::new() }
    }

    /// This plan and a fault of a random kind in each `period_ns` up to `until_ns`, half a second into it at the earliest, for
    /// 0.3 to 2 s. Bounds outside of 5 s to a day for the period give none.
    #[must_use]
    pub fn with_one_every(mut self, period_ns: i64, until_ns: i64) -> Self {
        if !(5 * NS_PER_S..=86_400 * NS_PER_S).contains(&period_ns) {
            return self;
        }
        let mut random = Pcg64Mcg::seed_from_u64(self.seed ^ 0x5eed);
        let mut begin = period_ns;
        while begin + period_ns <= until_ns {
            let kind = FaultKind::ALL[random.random_range(0..FaultKind::ALL.len())];
            let from_ns = begin + random.random_range(NS_PER_S / 2..NS_PER_S);
            self.faults.push(Fault {
                kind,
                from_ns,
                for_ns: random.random_range(3 * NS_PER_S / 10..2 * NS_PER_S),
            });
            begin += period_ns;
        }
        self
    }

    /// This plan and one fault more, from `from_ns` after the replay's origin for `for_ns`.
    #[must_use]
    pub fn with(mut self, kind: FaultKind, from_ns: i64, for_ns: i64) -> Self {
        self.faults.push(Fault { kind, from_ns, for_ns });
        self
    }
}

/// Applies a plan.
pub(crate) struct Injector {
    faults: Vec<Fault>,
    random: Pcg64Mcg,
    /// The last sample that was not frozen.
    last: Option<ImuSample>,
    small: Option<Vec<u8>>,
    altered: u64,
}

impl Injector {
    pub(crate) fn new(plan: FaultPlan) -> Self {
        let random = Pcg64Mcg::seed_from_u64(plan.seed);
        Self { faults: plan.faults, random, last: None, small: None, altered: 0 }
    }

    /// How many samples and pictures were altered or left out, and packets preceded by garbage.
    pub(crate) const fn altered(&self) -> u64 {
        self.altered
    }

    fn active(&self, kind: FaultKind, since_origin_ns: i64) -> bool {
        self.faults.iter().any(|f| {
            let since = since_origin_ns.saturating_sub(f.from_ns);
            f.kind == kind && since >= 0 && since < f.for_ns
        })
    }

    /// The bytes of noise that precede a packet.
    pub(crate) fn garbage(&mut self, since_origin_ns: i64, out: &mut Vec<u8>) {
        if !self.active(FaultKind::LineGarbage, since_origin_ns) {
            return;
        }
        self.altered += 1;
        for _ in 0..self.random.random_range(1..=40) {
            // One byte in four begins like a packet.
            let byte = if self.random.random_ratio(1, 4) { 0xfa } else { self.random.random() };
            out.push(byte);
        }
    }

    /// Sample that the unit sends in place of `sample`; `None` for nothing.
    pub(crate) fn sample(&mut self, sample: ImuSample, since_origin_ns: i64) -> Option<ImuSample> {
        let active = |kind| self.active(kind, since_origin_ns);
        let (drop_out, nan) = (active(FaultKind::ImuDropOut), active(FaultKind::ImuNan));
        let frozen = active(FaultKind::ImuFreeze).then_some(self.last).flatten();
        if frozen.is_none() {
            self.last = Some(sample);
        }
        self.altered += u64::from(drop_out || nan || frozen.is_some());
        if drop_out {
            return None;
        }
        let mut sent = match frozen {
            Some(last) => {
                ImuSample { arrival: sample.arrival, device_time_ns: sample.device_time_ns, ..last }
            }
            None => sample,
        };
        if nan {
            sent.rate = DVec3::new(f64::NAN, sent.rate.y, sent.rate.z);
        }
        Some(sent)
    }

    /// Bytes that the camera delivers in place of `jpeg`, whose picture has `size`.
    pub(crate) fn picture(&mut self, jpeg: &[u8], size: (u32, u32), since_origin_ns: i64) -> Picture {
        let active = |kind| self.active(kind, since_origin_ns);
        let fate = if active(FaultKind::FrameDropOut) {
            Picture::None
        } else if active(FaultKind::FrameOtherSize) {
            Picture::Other(self.small.get_or_insert_with(|| grey_jpeg(size.0 / 2, size.1 / 2)).clone())
        } else if active(FaultKind::FrameCorrupt) {
            Picture::Other(self.corrupt(jpeg))
        } else {
            return Picture::Same;
        };
        self.altered += 1;
        fate
    }

    fn corrupt(&mut self, jpeg: &[u8]) -> Vec<u8> {
        let mut bytes = jpeg.to_vec();
        if self.random.random() {
            bytes.truncate(self.random.random_range(0..=jpeg.len() * 3 / 4));
        } else {
            let header = bytes.len().min(600);
            self.random.fill(&mut bytes[..header]);
        }
        bytes
    }
}

/// Fate of a picture.
pub(crate) enum Picture {
    /// It is as it was.
    Same,
    /// It is not delivered.
    None,
    /// Other bytes are delivered.
    Other(Vec<u8>),
}

/// A grey picture; empty bytes where it cannot be encoded, which no decoder takes either.
fn grey_jpeg(width: u32, height: u32) -> Vec<u8> {
    let (width, height) = (width.clamp(1, 4096), height.clamp(1, 4096));
    let mut bytes = Vec::new();
    let grey = vec![128; width as usize * height as usize];
    match JpegEncoder::new_with_quality(&mut bytes, 50).encode(&grey, width, height, ExtendedColorType::L8) {
        Ok(()) => bytes,
        Err(_) => Vec::new(),
    }
}
