//! The camera's thread.

use std::{sync::Arc, thread, time::Duration};

use bowwave_core::event::Event;
use crossbeam_channel::Receiver;

use super::{
    CameraCounters, CameraError, CameraSettings, CameraStatus,
    driver::Ready,
    machine::{CameraMachine, CameraOutput},
    v4l2::V4l2,
};
use crate::{
    clock,
    queue::{self, NewestSender},
    report::Reporter,
    worker::{PortLink, PortWorker},
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

/// The camera, wherever and whenever it is there.
#[derive(Debug)]
pub struct CameraPort {
    events: Receiver<Event>,
    worker: PortWorker<CameraStatus>,
}

impl CameraPort {
    /// Starts the thread that looks for the camera, opens it, hands its pictures on, and does so again for ever. Fails only
    /// where the settings cannot be right or no thread can be had; a camera that is absent is a fault, not an error.
    pub fn start(settings: CameraSettings, reporter: Reporter) -> Result<Self, CameraError> {
        settings.check()?;
        let (sender, events) = queue::newest(QUEUE_FRAMES);
        let worker = Self::spawn(settings, reporter, sender);
        Ok(Self { events, worker: worker.map_err(|source| CameraError::Thread { source })? })
    }

    fn spawn(
        settings: CameraSettings,
        reporter: Reporter,
        sender: NewestSender<Event>,
    ) -> std::io::Result<PortWorker<CameraStatus>> {
        let link = PortLink::new(CameraStatus::default())?;
        let mut worker = PortWorker::start("camera", Arc::clone(&link), {
            let reporter = reporter.clone();
            move || run(settings, &link, &reporter, sender)
        })?;
        // Opening, setting and starting a USB camera take hundreds of milliseconds, which is no hang.
        worker.beat_during_calls("camera-pulse", reporter, CALL_MAX_NS)?;
        Ok(worker)
    }

    /// Pictures ([`Event::Frame`]), the newest few.
    pub const fn events(&self) -> &Receiver<Event> {
        &self.events
    }

    /// How the camera stands.
    pub fn status(&self) -> CameraStatus {
        self.worker.link().status().clone()
    }

    /// Stops the stream, closes the camera and ends the thread. An error where a call into the kernel does not return in
    /// 200 ms (the thread ends when it does), or the thread broke down.
    pub fn stop(self) -> Result<CameraCounters, CameraError> {
        let link = Arc::clone(self.worker.link());
        self.worker.stop_in_time()?;
        Ok(link.status().counters)
    }
}

fn run(
    settings: CameraSettings,
    link: &PortLink<CameraStatus>,
    reporter: &Reporter,
    mut events: NewestSender<Event>,
) {
    let mut driver = V4l2::new(Arc::clone(link.waker()));
    let mut machine = CameraMachine::new(settings, clock::now());
    let mut ready = Ready::default();
    let mut out = CameraOutput::default();
    while !link.is_stopping() {
        reporter.beat();
        let now = clock::now();
        let due = link.calls.during(|| machine.step(now, ready, &mut driver, &mut out));
        let idle = ready.filled && out.frames.is_empty();
        out.faults.drain(..).for_each(|change| reporter.send(change));
        out.frames.drain(..).for_each(|frame| events.send(Event::Frame(frame)));
        publish(link, &machine, &events);
        if idle {
            thread::sleep(IDLE);
        }
        ready = driver.wait(due.min(clock::now().plus_ns(SLEEP_MAX_NS)));
    }
    machine.stop(&mut driver);
    publish(link, &machine, &events);
}

fn publish(link: &PortLink<CameraStatus>, machine: &CameraMachine, events: &NewestSender<Event>) {
    let mut status = machine.status();
    status.counters.dropped = events.dropped();
    *link.status() = status;
}

#[cfg(test)]
mod tests {
    use bowwave_core::fault::{Change, Fault};

    use super::*;
    use crate::{camera::CameraLife, report::reporting};

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
        assert_eq!(port.status().life, CameraLife::Searching);
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
