//! The camera's thread.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use bowwave_core::event::Event;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};

use super::{
    CameraCounters, CameraError, CameraSettings, CameraStatus,
    driver::Ready,
    machine::{Machine, Output},
    mapping::Wake,
    v4l2::V4l2,
};
use crate::{
    clock,
    pulse::Calls,
    queue::{self, NewestSender},
    report::Reporter,
};

/// Pictures that wait to be drained. The main loop looks thirty times a second and wants the newest; more would keep the
/// driver's buffers from it.
pub const QUEUE_FRAMES: usize = 2;
/// The thread's longest sleep.
const SLEEP_MAX_NS: i64 = 50_000_000;
/// The longest that a call into the kernel may take: a USB control transfer ends after 5 s. After it the thread counts as hung.
const CALL_MAX_NS: i64 = 8_000_000_000;
/// Sleep after a wake-up that brought nothing: a driver that says "ready" for ever must not take a core.
const IDLE: Duration = Duration::from_millis(2);
/// How long [`CameraPort::stop`] waits.
const STOP: Duration = Duration::from_millis(200);

/// The camera, wherever and whenever it is there.
#[derive(Debug)]
pub struct CameraPort {
    events: Receiver<Event>,
    shared: Arc<Shared>,
    ended: Receiver<()>,
    threads: Vec<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    stop: AtomicBool,
    wake: Arc<Wake>,
    status: Mutex<CameraStatus>,
    /// Opening, setting and starting a USB camera take hundreds of milliseconds, which is no hang.
    calls: Calls,
}

impl CameraPort {
    /// Starts the thread that looks for the camera, opens it, hands its pictures on, and does so again for ever. Fails only
    /// where the settings cannot be right or no thread can be had; a camera that is absent is a fault, not an error.
    pub fn start(settings: CameraSettings, reporter: Reporter) -> Result<Self, CameraError> {
        settings.check()?;
        let thread_error = |source| CameraError::Thread { source };
        let wake = Arc::new(Wake::new().map_err(thread_error)?);
        let status = Mutex::new(CameraStatus::default());
        let shared = Arc::new(Shared { stop: AtomicBool::new(false), wake, status, calls: Calls::default() });
        let (sender, events) = queue::newest(QUEUE_FRAMES);
        let (ending, ended) = bounded(1);
        let pulse = {
            let (shared, reporter) = (Arc::clone(&shared), reporter.clone());
            spawn("camera-pulse", move || shared.calls.beat(&reporter, CALL_MAX_NS)).map_err(thread_error)?
        };
        let work = {
            let shared = Arc::clone(&shared);
            spawn("camera", move || run(settings, &shared, &reporter, sender, &ending))
        };
        match work {
            Ok(work) => Ok(Self { events, shared, ended, threads: vec![work, pulse] }),
            Err(source) => {
                shared.calls.end();
                Err(CameraError::Thread { source })
            }
        }
    }

    /// Pictures ([`Event::Frame`]), the newest few.
    pub const fn events(&self) -> &Receiver<Event> {
        &self.events
    }

    /// How the camera stands.
    pub fn status(&self) -> CameraStatus {
        self.shared.status.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Stops the stream, closes the camera and ends the thread. An error where a call into the kernel does not return in
    /// 200 ms (the thread ends when it does), or the thread broke down.
    pub fn stop(mut self) -> Result<CameraCounters, CameraError> {
        self.end();
        match self.ended.recv_timeout(STOP) {
            Err(RecvTimeoutError::Timeout) => return Err(CameraError::Blocked),
            // Disconnected: it broke down, which joining it will tell.
            Ok(()) | Err(RecvTimeoutError::Disconnected) => {}
        }
        for thread in self.threads.drain(..) {
            thread.join().map_err(|_| CameraError::BrokeDown)?;
        }
        Ok(self.status().counters)
    }
}

impl CameraPort {
    fn end(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.shared.wake.signal();
        self.shared.calls.end();
        self.threads.iter().for_each(|t| t.thread().unpark());
    }
}

impl Drop for CameraPort {
    fn drop(&mut self) {
        self.end();
    }
}

fn spawn(name: &str, body: impl FnOnce() + Send + 'static) -> std::io::Result<JoinHandle<()>> {
    thread::Builder::new().name(name.to_owned()).spawn(body)
}

fn run(
    settings: CameraSettings,
    shared: &Shared,
    reporter: &Reporter,
    mut events: NewestSender<Event>,
    ending: &Sender<()>,
) {
    let mut driver = V4l2::new(Arc::clone(&shared.wake));
    let mut machine = Machine::new(settings, clock::now());
    let mut ready = Ready::default();
    let mut out = Output::default();
    while !shared.stop.load(Ordering::Relaxed) {
        reporter.beat();
        let now = clock::now();
        let due = shared.calls.during(|| machine.step(now, ready, &mut driver, &mut out));
        let idle = ready.filled && out.frames.is_empty();
        out.faults.drain(..).for_each(|change| reporter.send(change));
        out.frames.drain(..).for_each(|frame| events.send(Event::Frame(frame)));
        publish(shared, &machine, &events);
        if idle {
            thread::sleep(IDLE);
        }
        ready = driver.wait(due.min(clock::now().plus_ns(SLEEP_MAX_NS)));
    }
    machine.stop(&mut driver);
    publish(shared, &machine, &events);
    // Nobody may be waiting any more.
    let _ = ending.try_send(());
}

fn publish(shared: &Shared, machine: &Machine, events: &NewestSender<Event>) {
    let mut status = machine.status();
    status.counters.dropped = events.dropped();
    *shared.status.lock().unwrap_or_else(PoisonError::into_inner) = status;
}

#[cfg(test)]
mod tests {
    use bowwave_core::fault::{Change, Fault};

    use super::*;
    use crate::{camera::Life, report::reporting};

    fn absent() -> CameraSettings {
        CameraSettings {
            device: Some("/dev/v4l/by-id/usb-No_Such_Camera".into()),
            ..CameraSettings::default()
        }
    }

    #[test]
    fn an_absent_camera_is_a_fault_and_the_thread_lives_and_ends() {
        let (reporter, reports) = reporting();
        let port = CameraPort::start(absent(), reporter).unwrap();
        let begun = clock::now();
        clock::sleep_until(begun.plus_ns(300_000_000));
        assert!(clock::now().ns_since(reports.last_beat()) < 250_000_000);
        let changes: Vec<_> = reports.changes().collect();
        assert_eq!(changes.len(), 1, "told once, looked for many times: {changes:?}");
        assert_eq!(changes[0].fault, Fault::CamLost);
        assert!(matches!(&changes[0].change, Change::Raised { cause } if cause.contains("No_Such_Camera")));
        assert_eq!(port.status().life, Life::Searching);
        let asked = clock::now();
        assert_eq!(port.stop().unwrap(), CameraCounters::default());
        assert!(clock::now().ns_since(asked) < 200_000_000);
    }

    #[test]
    fn wrong_settings_are_an_error_at_once() {
        let (reporter, _reports) = reporting();
        let settings = CameraSettings { buffers: 0, ..absent() };
        assert!(matches!(CameraPort::start(settings, reporter), Err(CameraError::Settings { .. })));
    }
}
