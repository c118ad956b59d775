//! The life of the camera: a state machine over a [`CameraDriver`], with time as an argument.

mod pictures;

use std::{collections::BTreeSet, io, sync::Arc};

use bowwave_core::{
    event::CameraFrame,
    fault::{Fault, FaultChange},
    time::Time,
};

use super::{
    CameraCounters, CameraLife, CameraSettings, CameraStatus, InUse,
    driver::{CameraDriver, OpenedCamera, Ready, SetFormat},
    identity::{CameraChoice, FoundCamera, choose},
    jpeg,
    judge::{PictureDamage, Stillness},
    negotiate::{candidates, next_smaller},
    pool::Pool,
    trouble::Trouble,
};

const MS: i64 = 1_000_000;
/// Between looks for an absent camera.
const SEARCH_NS: i64 = 100 * MS;
/// Between looks while another camera than the calibrated one is there.
const MISMATCH_NS: i64 = 250 * MS;
/// Between tries while another program holds the camera.
const BUSY_NS: i64 = 1000 * MS;
/// Before a camera is opened again whose queue or link failed.
const AGAIN_NS: i64 = 200 * MS;
/// Time that a camera needs to appear again after a reset.
const RESET_NS: i64 = 500 * MS;
/// Failures of the link in a row before the device is reset.
const PROTOCOL_FAILURES: u32 = 3;
/// No frame for this time is a stall, unless the camera is slow.
const STALL_NS: i64 = 100 * MS;
/// From the stall to the first attempt to end it: frames may come by themselves.
const STALL_GRACE_NS: i64 = 150 * MS;
/// How long a started stream may take for its first frame, at first and at most.
const FIRST_FRAME_NS: i64 = 1200 * MS;
const FIRST_FRAME_MAX_NS: i64 = 6000 * MS;
/// Modes that are tried before a camera is given up for this time.
const MODES_TRIED_MAX: usize = 24;
/// Frames after which a stream is taken to be sound.
const SOUND_FRAMES: u64 = 10;
/// Faults that frames prove gone.
const GONE_WITH_FRAMES: [Fault; 6] = [
    Fault::CamLost,
    Fault::CamStall,
    Fault::CamProtocol,
    Fault::CamQueue,
    Fault::CamBusy,
    Fault::CalMismatch,
];

/// Faults of a camera that is there, for which no pictures come.
const WRONG_WITH_IT: [Fault; 5] =
    [Fault::CamStall, Fault::CamProtocol, Fault::CamQueue, Fault::CamBusy, Fault::CalMismatch];
/// Faults of its pictures. That it is over cannot be seen once there are none.
const WRONG_WITH_PICTURES: [Fault; 3] = [Fault::CamFormat, Fault::CamStatic, Fault::CamCorrupt];

/// Results of a step.
#[derive(Default)]
pub(super) struct CameraOutput {
    /// Pictures, oldest first.
    pub frames: Vec<CameraFrame>,
    /// Faults that came and went, in their order.
    pub faults: Vec<FaultChange>,
}

enum MachineState {
    /// Nothing is open; the next try is at `next`.
    Away {
        life: CameraLife,
        next: Time,
    },
    Streaming(Box<CameraStream>),
    Stopped,
}

/// State of a stream that runs.
struct CameraStream {
    found: FoundCamera,
    format: SetFormat,
    /// Period of the mode, nanoseconds.
    nominal_ns: i64,
    /// That or the mean of late, whichever is longer, nanoseconds.
    period_ns: i64,
    /// When it was started (again).
    begun: Time,
    /// Undamaged buffers since then, and the last one's arrival.
    frames: u64,
    last_frame: Time,
    last_sequence: Option<u32>,
    exposure_ns: Option<i64>,
    /// When the exposure was last asked for.
    exposure_asked: Time,
    /// Whether a time stamp could be believed, and how many since then could not.
    stamped: bool,
    odd_stamps: u32,
    /// Pictures in a row that were of another size.
    other_sizes: u32,
    /// When the driver's format was last compared.
    format_asked: Time,
    /// Since a stall was seen: when to do something about it.
    act_at: Option<Time>,
}

impl CameraStream {
    /// The time at which the absence of frames is a stall.
    fn stalls_at(&self, first_frame_ns: i64) -> Time {
        if self.frames == 0 {
            return self.begun.plus_ns(first_frame_ns);
        }
        self.last_frame.plus_ns(STALL_NS.max(self.period_ns * 5 / 2))
    }
}

/// The camera's life.
pub(super) struct CameraMachine {
    settings: CameraSettings,
    state: MachineState,
    /// The camera that was last in use, and since when it has been away.
    known: Option<FoundCamera>,
    lost_at: Option<Time>,
    raised: BTreeSet<Fault>,
    /// Failures of the link, and stalls, in a row.
    protocol_failures: u32,
    stalls: u32,
    first_frame_ns: i64,
    /// The last picture's time: none may be older.
    last_mid: Time,
    decoder: jpeg::Decoder,
    packed: Pool,
    damage: PictureDamage,
    stillness: Stillness,
    counters: CameraCounters,
    in_use: Option<Arc<InUse>>,
}

impl CameraMachine {
    /// A camera that is looked for from `now` on.
    pub fn new(settings: CameraSettings, now: Time) -> Self {
        Self {
            settings,
            state: MachineState::Away { life: CameraLife::Searching, next: now },
            known: None,
            lost_at: None,
            raised: BTreeSet::new(),
            protocol_failures: 0,
            stalls: 0,
            first_frame_ns: FIRST_FRAME_NS,
            last_mid: Time::MIN,
            decoder: jpeg::Decoder::for_camera(),
            packed: Pool::default(),
            damage: PictureDamage::default(),
            stillness: Stillness::default(),
            counters: CameraCounters::default(),
            in_use: None,
        }
    }

    /// How it stands.
    pub fn status(&self) -> CameraStatus {
        let life = match &self.state {
            MachineState::Away { life, .. } => *life,
            MachineState::Stopped => CameraLife::Stopped,
            MachineState::Streaming(s) if s.act_at.is_some() => CameraLife::Stalled,
            MachineState::Streaming(s) if s.frames == 0 => CameraLife::Opening,
            MachineState::Streaming(_) => CameraLife::Streaming,
        };
        CameraStatus { life, in_use: self.in_use.clone(), counters: self.counters }
    }

    /// Does what is due at `now`, after the thread was woken by `ready`. Answers when it has to be called again at the
    /// latest.
    pub fn step(
        &mut self,
        now: Time,
        ready: Ready,
        driver: &mut impl CameraDriver,
        out: &mut CameraOutput,
    ) -> Time {
        match std::mem::replace(&mut self.state, MachineState::Stopped) {
            MachineState::Stopped => return Time::from_ns(i64::MAX),
            MachineState::Away { life, next } if now < next => self.state = MachineState::Away { life, next },
            MachineState::Away { .. } => self.look(now, driver, out),
            MachineState::Streaming(mut stream) => match self.stream(&mut stream, now, ready, driver, out) {
                Ok(true) => self.state = MachineState::Streaming(stream),
                // Something decided on another state already.
                Ok(false) => {}
                Err((what, error)) => self.fail(now, &stream.found, what, &error, driver, out),
            },
        }
        match &self.state {
            MachineState::Stopped => Time::from_ns(i64::MAX),
            MachineState::Away { next, .. } => *next,
            MachineState::Streaming(s) => s.act_at.unwrap_or_else(|| s.stalls_at(self.first_frame_ns)),
        }
    }

    /// Ends for good.
    pub fn stop(&mut self, driver: &mut impl CameraDriver) {
        driver.close();
        self.in_use = None;
        self.state = MachineState::Stopped;
    }

    fn raise(&mut self, now: Time, fault: Fault, cause: String, out: &mut CameraOutput) {
        let over: Vec<Fault> = self.raised.iter().copied().filter(|old| replaces(fault, *old)).collect();
        for old in over {
            self.clear(now, old, out);
        }
        if self.raised.insert(fault) {
            out.faults.push(FaultChange::raised(now, fault, cause));
        }
    }

    fn clear(&mut self, now: Time, fault: Fault, out: &mut CameraOutput) {
        if self.raised.remove(&fault) {
            out.faults.push(FaultChange::cleared(now, fault));
        }
    }

    fn away(&mut self, life: CameraLife, next: Time) {
        self.in_use = None;
        self.state = MachineState::Away { life, next };
    }

    /// Looks for the camera and starts it.
    fn look(&mut self, now: Time, driver: &mut impl CameraDriver, out: &mut CameraOutput) {
        let found = driver.find(&self.settings);
        let lost_ns = self.lost_at.map_or(0, |at| now.ns_since(at));
        match choose(&found, &self.settings, self.known.as_ref(), lost_ns) {
            CameraChoice::Absent => {
                let cause = match (&self.settings.device, &self.settings.serial) {
                    (Some(device), _) => format!("no camera at {}: plug it in", device.display()),
                    (None, Some(serial)) => format!("no camera with serial number {serial}: plug it in"),
                    (None, None) => "no camera: plug one in".to_owned(),
                };
                self.raise(now, Fault::CamLost, cause, out);
                self.lost_at.get_or_insert(now);
                self.away(CameraLife::Searching, now.plus_ns(SEARCH_NS));
            }
            CameraChoice::Mismatch(other) => {
                let cause = format!(
                    "{} is {}, the calibration is for {}: fit that camera, or calibrate this one",
                    other.node.display(),
                    other.identity(),
                    self.settings.serial.as_deref().unwrap_or_default()
                );
                self.raise(now, Fault::CalMismatch, cause, out);
                self.away(CameraLife::Mismatched, now.plus_ns(MISMATCH_NS));
            }
            CameraChoice::Try(list) => self.try_each(now, &list, driver, out),
        }
    }

    fn try_each(
        &mut self,
        now: Time,
        list: &[FoundCamera],
        driver: &mut impl CameraDriver,
        out: &mut CameraOutput,
    ) {
        for found in list {
            match self.begin(now, found, driver, out) {
                Ok(Some(stream)) => return self.begun(now, stream, driver, out),
                // A node that delivers no pictures: the next may.
                Ok(None) => driver.close(),
                // The first that fits and fails is the camera, and its failure is what there is to tell.
                Err((what, error)) => return self.fail(now, found, what, &error, driver, out),
            }
        }
        let names: Vec<_> = list.iter().map(|f| f.node.display().to_string()).collect();
        let cause = format!(
            "{} delivers no pictures that the trainer can use (YUYV, NV12 or MJPEG): name another camera",
            names.join(", ")
        );
        self.raise(now, Fault::CamLost, cause, out);
        self.away(CameraLife::Searching, now.plus_ns(MISMATCH_NS));
    }

    /// Opens `found` and starts it in the best mode that works; `None` where it delivers nothing usable.
    fn begin(
        &mut self,
        now: Time,
        found: &FoundCamera,
        driver: &mut impl CameraDriver,
        out: &mut CameraOutput,
    ) -> Result<Option<CameraStream>, Failure> {
        let opened = driver.open(&found.node, &self.settings).map_err(during("open it"))?;
        if !opened.captures {
            return Ok(None);
        }
        let list = candidates(&opened.offers, &self.settings.wanted(), self.settings.calibrated_size);
        let (mut at, mut tried, mut no_room) = (0, 0, false);
        while let Some(candidate) = list.get(at).filter(|_| tried < MODES_TRIED_MAX) {
            tried += 1;
            let set = driver.set_mode(candidate);
            let Ok((format, rate)) = set.as_ref().copied() else {
                let error = set.err().unwrap_or_else(|| io::Error::from_raw_os_error(0));
                // EINVAL: the driver lists what it cannot do.
                if error.kind() != io::ErrorKind::InvalidInput {
                    return Err(("set its format", error));
                }
                at += 1;
                continue;
            };
            let last = at + 1 >= list.len();
            if !pictures::plausible(&format) || (!last && !format.is(candidate)) {
                at += 1;
                continue;
            }
            let refused = driver.set_controls(&self.settings.controls);
            match driver.start(self.settings.buffers) {
                Ok(_) => {}
                Err(error) if Trouble::of(&error) == Trouble::Bandwidth => {
                    driver.stop();
                    no_room = true;
                    let cause = format!(
                        "{}: the bus has no room for {} ({error}); {}",
                        found.best_name().display(),
                        candidate.mode,
                        Trouble::Bandwidth.advice()
                    );
                    self.raise(now, Fault::CamBandwidth, cause, out);
                    let Some(next) = next_smaller(&list, at) else { return Err(("start it", error)) };
                    at = next;
                    continue;
                }
                Err(error) => return Err(("start it", error)),
            }
            if !no_room {
                self.clear(now, Fault::CamBandwidth, out);
            }
            let rate = rate.unwrap_or(candidate.mode.rate);
            self.in_use = Some(Arc::new(in_use(found, &opened, &format, rate, refused)));
            let nominal_ns = rate.period_ns().clamp(MS, 1000 * MS);
            return Ok(Some(CameraStream {
                found: found.clone(),
                format,
                nominal_ns,
                period_ns: nominal_ns,
                begun: now,
                frames: 0,
                last_frame: now,
                last_sequence: None,
                exposure_ns: driver.exposure_ns(),
                exposure_asked: now,
                stamped: false,
                odd_stamps: 0,
                other_sizes: 0,
                format_asked: now,
                act_at: None,
            }));
        }
        Ok(None)
    }

    /// A stream was started: notes what is other than before.
    fn begun(
        &mut self,
        now: Time,
        stream: CameraStream,
        driver: &mut impl CameraDriver,
        out: &mut CameraOutput,
    ) {
        if let Some(known) = self.known.replace(stream.found.clone())
            && known.node != stream.found.node
        {
            let cause = format!(
                "the camera {} is {} now, it was {}",
                stream.found.best_name().display(),
                stream.found.node.display(),
                known.node.display()
            );
            out.faults.push(FaultChange::noted(now, Fault::CamRenumbered, cause));
        }
        self.clear(now, Fault::CalMismatch, out);
        self.check_size(now, (stream.format.width, stream.format.height), &stream.found, out);
        self.damage.restart();
        self.stillness.restart();
        self.lost_at = None;
        self.counters.opened += 1;
        if driver.queued() == 0 {
            let error = io::Error::from_raw_os_error(rustix::io::Errno::NOMEM.raw_os_error());
            let found = stream.found;
            return self.fail(now, &found, "get buffers", &error, driver, out);
        }
        self.state = MachineState::Streaming(Box::new(stream));
    }

    /// Tells whether pictures have the calibrated size.
    fn check_size(
        &mut self,
        now: Time,
        size: (u32, u32),
        found: &FoundCamera,
        out: &mut CameraOutput,
    ) -> bool {
        match self.settings.calibrated_size {
            Some(wanted) if wanted != size => {
                let cause = format!(
                    "{} delivers {}x{}, the calibration is for {}x{}: set that mode, or calibrate this one",
                    found.best_name().display(),
                    size.0,
                    size.1,
                    wanted.0,
                    wanted.1
                );
                self.raise(now, Fault::CamFormat, cause, out);
                false
            }
            _ => true,
        }
    }

    /// One round of a running stream. `false` where another state was entered.
    fn stream(
        &mut self,
        stream: &mut CameraStream,
        now: Time,
        ready: Ready,
        driver: &mut impl CameraDriver,
        out: &mut CameraOutput,
    ) -> Result<bool, Failure> {
        if ready.event && driver.source_changed() {
            return Ok(self.reopen(now, driver));
        }
        driver.reclaim().map_err(during("give it buffers"))?;
        let newest = self.drain(stream, now, driver, out)?;
        if newest.is_none() && ready.failed {
            // The kernel says why only where it is asked.
            let error = driver
                .format()
                .err()
                .unwrap_or_else(|| io::Error::from_raw_os_error(rustix::io::Errno::IO.raw_os_error()));
            return Err(("wait for a picture", error));
        }
        if let Some(filled) = newest {
            stream.live(now);
            if !self.take(stream, filled, now, driver, out)? {
                return Ok(self.reopen(now, driver));
            }
            stream.act_at = None;
            if stream.frames >= SOUND_FRAMES {
                (self.protocol_failures, self.stalls) = (0, 0);
                self.first_frame_ns = FIRST_FRAME_NS;
            }
            return Ok(true);
        }
        self.stalled(stream, now, driver, out)
    }

    /// Looks for a stall and acts on it, more roughly each time.
    fn stalled(
        &mut self,
        stream: &mut CameraStream,
        now: Time,
        driver: &mut impl CameraDriver,
        out: &mut CameraOutput,
    ) -> Result<bool, Failure> {
        let Some(act_at) = stream.act_at else {
            if now >= stream.stalls_at(self.first_frame_ns) {
                let since = if stream.frames == 0 { stream.begun } else { stream.last_frame };
                let cause = format!(
                    "no picture from {} for {:.0} ms: restarting it; if it stays so, check its cable",
                    stream.found.best_name().display(),
                    now.secs_since(since) * 1e3
                );
                self.raise(now, Fault::CamStall, cause, out);
                self.counters.stalls += 1;
                // A stream that never began has waited long enough.
                stream.act_at = Some(if stream.frames == 0 { now } else { now.plus_ns(STALL_GRACE_NS) });
            }
            return Ok(true);
        };
        if now < act_at {
            return Ok(true);
        }
        self.stalls += 1;
        if self.stalls > 1 {
            self.first_frame_ns = (self.first_frame_ns * 2).min(FIRST_FRAME_MAX_NS);
            if self.stalls.is_multiple_of(PROTOCOL_FAILURES) {
                self.reset(now, &stream.found, driver);
                return Ok(false);
            }
            return Ok(self.reopen(now, driver));
        }
        driver.restart().map_err(during("restart it"))?;
        let format = driver.format().map_err(during("ask for its format"))?;
        if format != stream.format {
            return Ok(self.reopen(now, driver));
        }
        (stream.begun, stream.frames, stream.last_sequence) = (now, 0, None);
        stream.act_at = Some(now.plus_ns(self.first_frame_ns));
        self.counters.restarts += 1;
        Ok(true)
    }

    /// Closes, to open again at once. Always `false`: the stream is over.
    fn reopen(&mut self, now: Time, driver: &mut impl CameraDriver) -> bool {
        driver.close();
        self.away(CameraLife::Opening, now);
        false
    }

    fn reset(&mut self, now: Time, found: &FoundCamera, driver: &mut impl CameraDriver) {
        driver.close();
        match driver.reset(found) {
            Ok(()) => self.counters.resets += 1,
            // Without the right to reset, opening it again is all that can be done; the log has the fault already.
            Err(e) => log::debug!("{}: cannot be reset: {e}", found.node.display()),
        }
        self.away(CameraLife::Resetting, now.plus_ns(RESET_NS));
    }

    /// Something failed: tells, and decides when to try again.
    fn fail(
        &mut self,
        now: Time,
        found: &FoundCamera,
        what: &'static str,
        error: &io::Error,
        driver: &mut impl CameraDriver,
        out: &mut CameraOutput,
    ) {
        let trouble = Trouble::of(error);
        let name = found.best_name().display();
        let cause = format!("{name}: cannot {what}: {error}; {}", trouble.advice());
        self.raise(now, trouble.fault(), cause, out);
        self.lost_at.get_or_insert(now);
        driver.close();
        match trouble {
            Trouble::Gone => self.away(CameraLife::Searching, now.plus_ns(SEARCH_NS / 2)),
            Trouble::Denied => self.away(CameraLife::Searching, now.plus_ns(SEARCH_NS)),
            Trouble::Busy => self.away(CameraLife::Busy, now.plus_ns(BUSY_NS)),
            Trouble::Bandwidth => self.away(CameraLife::Opening, now.plus_ns(BUSY_NS)),
            Trouble::Queue => self.away(CameraLife::Opening, now.plus_ns(AGAIN_NS)),
            Trouble::Protocol => {
                self.protocol_failures += 1;
                if self.protocol_failures >= PROTOCOL_FAILURES {
                    self.protocol_failures = 0;
                    self.reset(now, found, driver);
                } else {
                    self.away(CameraLife::Opening, now.plus_ns(AGAIN_NS));
                }
            }
        }
    }
}

/// Whether a camera with the fault `new` has the fault `old` no longer.
fn replaces(new: Fault, old: Fault) -> bool {
    let with_it = WRONG_WITH_IT.contains(&old);
    new != old
        && match new {
            // A camera that is gone does nothing else wrong, and what another camera had is not what the one has that is there.
            Fault::CamLost | Fault::CalMismatch => {
                with_it || WRONG_WITH_PICTURES.contains(&old) || old == Fault::CamLost
            }
            // Nothing else is known of a camera that another program holds, not even that its queue would fail again.
            Fault::CamBusy => with_it || old == Fault::CamLost,
            // One that does something wrong is there, and nobody holds it.
            _ if WRONG_WITH_IT.contains(&new) => matches!(old, Fault::CamLost | Fault::CamBusy),
            _ => false,
        }
}

/// The attempt that failed, and the kernel's answer.
type Failure = (&'static str, io::Error);

fn during(what: &'static str) -> impl FnOnce(io::Error) -> Failure {
    move |error| (what, error)
}

fn in_use(
    found: &FoundCamera,
    opened: &OpenedCamera,
    format: &SetFormat,
    rate: super::Rate,
    refused: Vec<&'static str>,
) -> InUse {
    InUse {
        node: found.node.clone(),
        by_id: found.links.first().cloned(),
        serial: found.serial.clone(),
        card: opened.card.clone(),
        mode: super::WantedMode { coding: format.coding, width: format.width, height: format.height, rate },
        refused_controls: refused,
    }
}

#[cfg(test)]
mod tests;
