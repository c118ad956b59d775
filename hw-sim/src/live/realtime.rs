//! The simulated gun on the host's clock: bytes through a pseudo-terminal, pictures through a bounded queue in which the newest wins.

use std::{
    sync::{Arc, Mutex},
    thread::JoinHandle,
};

use bowwave_core::{
    event::{CameraFrame, Event},
    geometry::CameraPose,
    time::Time,
};
use bowwave_devices::{
    clock,
    queue::{NewestSender, newest},
    serial::ImuPort,
};
use crossbeam_channel::{Receiver, Sender, bounded};

use super::{
    LiveStats, TruePoses,
    bench::{Bench, DueFrame},
    sensor::Sensor,
};
use crate::{
    pace::{StopFlag, StopOnDrop},
    pty::Terminal,
    replay::{ReplayError, Shared, locked, spawn},
};

/// From opening to the first sample.
pub(super) const PREROLL_NS: i64 = 60_000_000;
/// How long before its exposure a picture's tiles are decoded.
const DECODE_LEAD_NS: i64 = 10_000_000;
/// Angle beside the middle of the view that is decoded ahead, radians: half a wide lens's view, and what a gun turns in that time.
const AHEAD: f64 = 0.6;
/// Pictures that would be later than this are left out.
const LATE_MAX_NS: i64 = 60_000_000;
/// Delivered and not yet fetched: pictures, and other events.
const QUEUE_FRAMES: usize = 4;
const QUEUE_EVENTS: usize = 256;
/// The baud rate is a matter of form on a pseudo-terminal.
const BAUD: u32 = 921_600;

/// A simulated gun on the host's clock.
pub(super) struct RealtimeLive {
    port: ImuPort,
    frames: Receiver<Event>,
    events: Receiver<Event>,
    errors: Receiver<ReplayError>,
    truth: Shared<TruePoses>,
    stats: Shared<LiveStats>,
    stop: StopOnDrop,
    line: JoinHandle<Terminal>,
    camera: JoinHandle<()>,
}

impl RealtimeLive {
    pub fn start(bench: Bench, sensor: Sensor) -> Result<Self, ReplayError> {
        let terminal = Terminal::open().map_err(|source| ReplayError::Terminal { what: "open", source })?;
        let port = ImuPort::open(terminal.slave(), BAUD)?;
        let stop = StopFlag::default();
        let bench = Arc::new(Mutex::new(bench));
        let (truth, stats) = (Shared::<TruePoses>::default(), Shared::<LiveStats>::default());
        let (errors_in, errors) = bounded(2);
        let (frames_in, frames) = newest(QUEUE_FRAMES);
        let (events_in, events) = newest(QUEUE_EVENTS);
        let line = Line {
            stop: stop.clone(),
            bench: Arc::clone(&bench),
            terminal,
            events: events_in,
            errors: errors_in.clone(),
            stats: Arc::clone(&stats),
        };
        let exposer = Exposer {
            stop: stop.clone(),
            bench,
            sensor,
            frames: frames_in,
            errors: errors_in,
            truth: Arc::clone(&truth),
            stats: Arc::clone(&stats),
        };
        let line = spawn("sim-gun", move || line.run())?;
        let camera = spawn("sim-camera", move || exposer.run())?;
        Ok(Self { port, frames, events, errors, truth, stats, stop: StopOnDrop(stop), line, camera })
    }

    /// Appends what has been delivered since the last call, by arrival.
    pub fn drain(&mut self, out: &mut Vec<Event>) -> Result<(), ReplayError> {
        let before = out.len();
        out.extend(self.port.events().try_iter());
        out.extend(self.frames.try_iter());
        out.extend(self.events.try_iter());
        if let Some(fetched) = out.get_mut(before..) {
            fetched.sort_by_key(Event::arrival);
        }
        self.errors.try_recv().map_or(Ok(()), Err)
    }

    pub fn truth_at(&self, stamp: Time) -> Option<(CameraPose, f64)> {
        locked(&self.truth).at(stamp)
    }

    pub fn stats(&self) -> LiveStats {
        let status = self.port.status();
        LiveStats { imu: status.said.counters, imu_overflow: status.line.overflow, ..*locked(&self.stats) }
    }

    /// Ends the threads and closes the line.
    pub fn stop(self) -> Result<(), ReplayError> {
        self.stop.0.stop();
        let broke_down = |name| move |_| ReplayError::BrokeDown { name };
        // All are asked to end before any failure is reported; the line hangs up after its port is closed.
        let line = self.line.join().map_err(broke_down("sim-gun"));
        let camera = self.camera.join().map_err(broke_down("sim-camera"));
        self.port.stop()?;
        drop(line?);
        camera
    }
}

/// Lets the trainer's threads go before this one: a real camera takes none of their time. Where that is not allowed, it goes without.
fn give_way() {
    /// The lowest: a thread gets a fiftieth of a core that another one wants.
    const NICE: i32 = 19;
    if let Err(error) = rustix::process::setpriority_process(None, NICE) {
        log::debug!("the simulated camera keeps its priority: {error}");
    }
}

/// The gun with its unit and trigger.
struct Line {
    stop: StopFlag,
    bench: Shared<Bench>,
    terminal: Terminal,
    events: NewestSender<Event>,
    errors: Sender<ReplayError>,
    stats: Shared<LiveStats>,
}

impl Line {
    fn run(mut self) -> Terminal {
        let (mut packet, mut events) = (Vec::new(), Vec::new());
        loop {
            let due = locked(&self.bench).next_sample();
            if !self.stop.wait(due) {
                return self.terminal;
            }
            let arrival = locked(&self.bench).sample(&mut packet, &mut events);
            for event in events.drain(..) {
                self.events.send(event);
            }
            if !self.stop.wait(arrival) {
                return self.terminal;
            }
            match self.terminal.send(&packet) {
                Ok(0) => {}
                Ok(lost) => locked(&self.stats).line_lost_bytes += lost as u64,
                Err(source) => {
                    // Room for one from each thread; the first report is enough.
                    drop(self.errors.try_send(ReplayError::Terminal { what: "write to", source }));
                    return self.terminal;
                }
            }
        }
    }
}

/// The camera.
struct Exposer {
    stop: StopFlag,
    bench: Shared<Bench>,
    sensor: Sensor,
    frames: NewestSender<Event>,
    errors: Sender<ReplayError>,
    truth: Shared<TruePoses>,
    stats: Shared<LiveStats>,
}

impl Exposer {
    fn run(mut self) {
        give_way();
        loop {
            match self.frame() {
                Ok(true) => {}
                Ok(false) => return,
                Err(error) => {
                    drop(self.errors.try_send(error));
                    return;
                }
            }
        }
    }

    /// Exposes and delivers the next picture; `false` where it is asked to end.
    fn frame(&mut self) -> Result<bool, ReplayError> {
        let (frame, exposed, ended) = {
            let bench = locked(&self.bench);
            let frame = bench.next_frame();
            (frame, bench.time_of(frame.exposed_s), bench.time_of(bench.exposure_end_s(&frame)))
        };
        if !self.stop.wait(exposed.plus_ns(-DECODE_LEAD_NS)) {
            return Ok(false);
        }
        if clock::now().ns_since(ended) > LATE_MAX_NS {
            locked(&self.bench).frame_taken();
            locked(&self.stats).frames_late += 1;
            return Ok(true);
        }
        self.decode_ahead(&frame)?;
        let Some(turned) = self.await_exposure(&frame, ended) else { return Ok(false) };
        let (pose, recoil, due) = {
            let mut bench = locked(&self.bench);
            (bench.pose(frame.exposed_s), bench.recoil(frame.exposed_s), bench.frame_taken())
        };
        locked(&self.truth).push(frame.stamp, pose, recoil);
        let picture = self.sensor.expose(&frame, turned, recoil, due)?;
        if !self.stop.wait(due) {
            return Ok(false);
        }
        self.frames.send(Event::Frame(CameraFrame { arrival: clock::now(), ..picture }));
        let mut stats = locked(&self.stats);
        stats.frames += 1;
        stats.frames_overwritten = self.frames.dropped();
        Ok(true)
    }

    /// Decodes what the picture will show if the gun does not turn far until then.
    fn decode_ahead(&mut self, frame: &DueFrame) -> Result<(), ReplayError> {
        let forward = {
            let bench = locked(&self.bench);
            bench.pose(bench.gun.time_s()).world_from_camera * glam::DVec3::Z
        };
        let middle = forward.x.atan2(forward.y);
        self.sensor.prepare(frame, [middle - AHEAD, middle + AHEAD])
    }

    /// Waits until the gun has moved through the exposure; how it was turned as each row of the mesh was exposed. `None` where it is asked to end.
    fn await_exposure(&self, frame: &DueFrame, ended: Time) -> Option<Vec<glam::DQuat>> {
        let mut until = ended.plus_ns(1_000_000);
        loop {
            if !self.stop.wait(until) {
                return None;
            }
            let bench = locked(&self.bench);
            if bench.gun.time_s() >= bench.exposure_end_s(frame) {
                let rows =
                    self.sensor.rows_s().map(|row_s| bench.pose(frame.exposed_s + row_s).world_from_camera);
                return Some(rows.collect());
            }
            until = clock::now().plus_ns(500_000);
        }
    }
}
