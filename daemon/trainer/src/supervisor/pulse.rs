//! Signs of life for systemd while the main loop does not turn: starting, ending and making the renderer anew take long calls
//! into drivers, and a watchdog that ends them would only make them begin again.

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use anyhow::{Context, Result};
use bowwave_core::time::{NS_PER_S, Time};
use bowwave_devices::clock::now;

use super::{CrashLoopGuard, notify};
use crate::Signals;

/// How often systemd hears that something goes on. Its watchdog waits for seconds.
const EVERY: Duration = Duration::from_millis(200);
/// What takes longer hangs, and the watchdog may have it. A software driver on a slow computer compiles for minutes.
const LONGEST_NS: i64 = 300 * NS_PER_S;
/// How long a start that is to end has for it by itself.
const GRACE_NS: i64 = NS_PER_S / 5;

#[derive(Debug, Default)]
struct PulseState {
    /// Since when something goes on that is not to be interrupted.
    since: Option<Time>,
    /// Whether nothing is recorded yet, so that the process may end at any time.
    may_end: bool,
}

/// The thread that gives them.
#[derive(Debug)]
pub struct Pulse {
    state: Arc<Mutex<PulseState>>,
}

/// Until it is dropped, systemd hears that the trainer lives.
#[derive(Debug)]
pub struct Pulsing<'a>(&'a Pulse);

impl Pulse {
    /// Starts the thread. It lives as long as the process.
    pub fn start(signals: Arc<Signals>, starts: Arc<CrashLoopGuard>) -> Result<Self> {
        let state = Arc::new(Mutex::new(PulseState::default()));
        let seen = Arc::clone(&state);
        thread::Builder::new()
            .name("pulse".to_owned())
            .spawn(move || {
                let mut asked = None;
                loop {
                    thread::sleep(EVERY);
                    let at = now();
                    let state = locked(&seen);
                    if state.since.is_some_and(|since| at.ns_since(since) < LONGEST_NS) {
                        notify::still_starting();
                    }
                    if state.may_end && ends(&signals.stop, &mut asked, at) {
                        log::warn!("STOP asked to stop during the start");
                        starts.ended_well();
                        // Nothing is open that the kernel does not close; a driver's own clean-up may wait for its compiler.
                        signal_hook::low_level::exit(0);
                    }
                }
            })
            .context(
                "cannot start the thread that tells systemd of long starts; are too many processes running?",
            )?;
        Ok(Self { state })
    }

    /// Something begins that takes long.
    pub fn during(&self) -> Pulsing<'_> {
        notify::still_starting();
        locked(&self.state).since = Some(now());
        Pulsing(self)
    }

    /// The first start begins: a request to stop ends it at once.
    pub fn during_start(&self) -> Pulsing<'_> {
        let pulsing = self.during();
        locked(&self.state).may_end = true;
        pulsing
    }
}

impl Drop for Pulsing<'_> {
    fn drop(&mut self) {
        *locked(&self.0.state) = PulseState::default();
        notify::still_starting();
    }
}

/// Whether a stop was asked for some time ago.
fn ends(stop: &AtomicBool, asked: &mut Option<Time>, at: Time) -> bool {
    stop.load(Ordering::Relaxed) && at.ns_since(*asked.get_or_insert(at)) >= GRACE_NS
}

fn locked(state: &Mutex<PulseState>) -> MutexGuard<'_, PulseState> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_ends_a_start_after_its_grace() {
        let stop = AtomicBool::new(false);
        let mut asked = None;
        let at = |ms: i64| Time::from_ns(ms * 1_000_000);
        assert!(!ends(&stop, &mut asked, at(0)));
        stop.store(true, Ordering::Relaxed);
        assert!(!ends(&stop, &mut asked, at(1000)));
        assert!(!ends(&stop, &mut asked, at(1199)));
        assert!(ends(&stop, &mut asked, at(1200)));
    }
}
