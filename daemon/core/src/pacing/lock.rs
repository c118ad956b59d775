//! The 30 Hz tick between two clocks that are not its own: the camera delivers when it likes, the display scans out when it
//! likes.
//!
//! A frame is begun so late that it is complete just before the vertical blank at which it is to be shown, so that the picture
//! in it is the newest possible. Left at that, a camera of nearly the display's rate would sooner or later deliver right
//! around the begin of each frame, and its jitter would have pictures dropped and doubled in turn. Two means prevent that:
//! a display of 60 Hz can show a frame one blank sooner or later, so the tick slips by single blanks and follows the camera's
//! rate; and where a picture is expected around the begin, the frame begins so much sooner that it is left to the next one,
//! decided by the smooth prediction and not by the single arrival.

use super::{FRAMES_PER_S, Train};
use crate::time::{NS_PER_S, Time};

/// Time between two ticks, nanoseconds.
const PERIOD_NS: f64 = NS_PER_S as f64 / FRAMES_PER_S as f64;
/// Vertical blanks and camera periods count as a whole part of the tick within this share.
const ALIKE: f64 = 0.05;
/// Least guard between an expected arrival and the begin of a frame, nanoseconds.
const GUARD_MIN_NS: f64 = 500_000.0;
/// The guard in mean deviations of the arrivals: beyond it lie fewer than one in a thousand.
const GUARD_JITTERS: f64 = 4.0;
const GUARD_MAX_NS: f64 = 4_000_000.0;
/// Time from a frame's completion to the blank that shows it, for the flip to be handed over, nanoseconds.
const FLIP_LEAD_NS: i64 = 1_500_000;
/// Budget before anything was measured, and its bounds, nanoseconds.
const BUDGET_FIRST_NS: i64 = 16_000_000;
const BUDGET_MIN_NS: i64 = 2_000_000;
const BUDGET_MAX_NS: i64 = 60_000_000;
/// A camera that has not delivered for this long has no phase to follow, nanoseconds.
const CAMERA_GONE_NS: i64 = 500_000_000;

/// When to begin a frame and when it is to be seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Begin: fetch what has arrived, draw the newest picture.
    pub start: Time,
    /// The vertical blank at which it is to be seen; without a display, the next tick.
    pub shown: Time,
}

/// Chooses when frames begin.
#[derive(Clone, Debug)]
pub struct FrameClock {
    camera: Train,
    display: Option<Train>,
    budget_ns: i64,
    last: Option<Plan>,
    /// Whether the last frame left a picture that came around its begin to the next.
    leaves: bool,
    missed: u64,
    slips: u64,
}

impl Default for FrameClock {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameClock {
    /// A clock that knows neither camera nor display.
    pub fn new() -> Self {
        Self {
            camera: Train::new(),
            display: None,
            budget_ns: BUDGET_FIRST_NS,
            last: None,
            leaves: false,
            missed: 0,
            slips: 0,
        }
    }

    /// A picture has arrived.
    pub fn picture_arrived(&mut self, time: Time) {
        self.camera.observe(time);
    }

    /// A frame was taken to the display at the vertical blank `time`; blanks come every `period_ns`.
    pub fn flipped(&mut self, time: Time, period_ns: i64) {
        let period = period_ns.max(1) as f64;
        let display = self.display.get_or_insert_with(|| Train::with_period(period));
        if display.period_ns().is_some_and(|p| (p - period).abs() > ALIKE * period) {
            *display = Train::with_period(period);
        }
        display.observe(time);
    }

    /// The display is gone, or there is none.
    pub fn display_lost(&mut self) {
        self.display = None;
    }

    /// A frame took this long from its begin until it was complete. The budget rises at once and sinks by an eighth of a thousandth a
    /// frame: it stays near the longest of the last minutes, and hardly moves the begin meanwhile.
    pub fn rendered(&mut self, ns: i64) {
        let sunk = self.budget_ns - self.budget_ns / 8192;
        self.budget_ns = (ns + FLIP_LEAD_NS).max(sunk).clamp(BUDGET_MIN_NS, BUDGET_MAX_NS);
    }

    /// Time that a frame is given from its begin to the blank, nanoseconds.
    pub const fn budget_ns(&self) -> i64 {
        self.budget_ns
    }

    /// Ticks that could not be kept because the caller came too late.
    pub const fn missed(&self) -> u64 {
        self.missed
    }

    /// Times that the tick slipped by a blank to follow the camera.
    pub const fn slips(&self) -> u64 {
        self.slips
    }

    /// When the next frame begins. To be asked once for each frame, when the last one has been handed over.
    pub fn plan(&mut self, now: Time) -> Plan {
        let blank_ns = self.display.as_ref().and_then(Train::period_ns).filter(|b| blanks_of(*b).is_some());
        let plan = match blank_ns {
            Some(blank_ns) => self.plan_for_display(now, blank_ns),
            None => self.plan_freely(now),
        };
        self.last = Some(plan);
        plan
    }

    fn plan_for_display(&mut self, now: Time, blank_ns: f64) -> Plan {
        let blanks = blanks_of(blank_ns).unwrap_or(1);
        let earliest = now.plus_ns(self.budget_ns);
        let shown = match self.last {
            None => self.blank_near(earliest.plus_ns(blank_ns as i64 / 2)),
            Some(last) => {
                let due = last.shown.plus_ns((f64::from(blanks) * blank_ns) as i64);
                let late_ns = earliest.ns_since(due);
                if late_ns > (PERIOD_NS / 2.0) as i64 {
                    let skipped = (late_ns as f64 / PERIOD_NS).ceil();
                    self.missed += skipped as u64;
                    self.blank_near(due.plus_ns((skipped * PERIOD_NS) as i64))
                } else {
                    let slip = self.slip(due, blank_ns, blanks);
                    self.blank_near(due.plus_ns((slip * blank_ns) as i64))
                }
            }
        };
        Plan { start: self.before_picture(shown.plus_ns(-self.budget_ns)), shown }
    }

    /// Whether the tick can follow the camera's rate by slipping single blanks: only a camera of the tick's own rate has a
    /// phase that stays, and one blank a tick leaves no choice.
    fn follows_camera(&self, blank_ns: f64, blanks: u32) -> bool {
        let tick_ns = f64::from(blanks) * blank_ns;
        blanks >= 2 && self.camera.period_ns().is_some_and(|p| (p - tick_ns).abs() <= ALIKE * tick_ns)
    }

    /// The blank nearest to `time`.
    fn blank_near(&self, time: Time) -> Time {
        let Some(display) = &self.display else { return time };
        let half = display.period_ns().unwrap_or(PERIOD_NS) / 2.0;
        display.next_after(time.plus_ns(-half as i64)).unwrap_or(time)
    }

    /// By how many blanks, -1, 0 or 1, to leave the frame that is due at the blank `due` early or late, so that pictures wait
    /// least and none arrives at the begin of a frame.
    fn slip(&mut self, due: Time, blank_ns: f64, blanks: u32) -> f64 {
        let start = due.plus_ns(-self.budget_ns);
        let Some((period, waited)) = self.waited(start) else { return 0.0 };
        if !self.follows_camera(blank_ns, blanks) {
            return 0.0;
        }
        let guard = self.guard_ns();
        // A picture that would wait less than the guard, or is only just coming: wait for it.
        let coming = period - waited < guard;
        let slip = if waited < guard || coming {
            1.0
        } else if waited > blank_ns + 2.0 * guard {
            -1.0
        } else {
            0.0
        };
        self.slips += u64::from(slip != 0.0);
        slip
    }

    /// The camera's period, and how long the newest picture will have waited at `start`, nanoseconds.
    fn waited(&self, start: Time) -> Option<(f64, f64)> {
        let period = self.camera.period_ns()?;
        if self.camera.last().is_none_or(|last| start.ns_since(last) > CAMERA_GONE_NS) {
            return None;
        }
        let next = self.camera.next_after(start)?;
        Some((period, period - next.ns_since(start) as f64))
    }

    fn guard_ns(&self) -> f64 {
        (GUARD_JITTERS * self.camera.jitter_ns()).clamp(GUARD_MIN_NS, GUARD_MAX_NS)
    }

    /// `start`, or a little sooner where a picture is expected around it: so soon that it cannot have arrived, and jitter
    /// does not decide whether it is in this frame or the next.
    fn before_picture(&mut self, start: Time) -> Time {
        let Some((period, waited)) = self.waited(start) else { return start };
        let guard = self.guard_ns();
        // Who has begun to leave pictures to the next frame goes on a little longer, or the prediction's own noise would
        // decide.
        let reach = if self.leaves { 1.5 * guard } else { guard };
        let coming = period - waited;
        self.leaves = waited < reach || coming < guard;
        let sooner = match (waited < reach, coming < guard) {
            (true, _) => waited + guard,
            (false, true) => guard - coming,
            (false, false) => 0.0,
        };
        start.plus_ns(-sooner as i64)
    }

    /// No display sets the time: 30 Hz, and where the camera has that rate, its own 30 Hz.
    fn plan_freely(&mut self, now: Time) -> Plan {
        let due = match self.last {
            None => now,
            Some(last) => {
                let due = last.start.plus_ns(PERIOD_NS as i64);
                let late = now.ns_since(due) as f64 / PERIOD_NS;
                if late >= 1.0 {
                    self.missed += late as u64;
                    due.plus_ns((late.floor() * PERIOD_NS) as i64)
                } else {
                    due
                }
            }
        };
        let own_rate = |period: f64| (period - PERIOD_NS).abs() <= ALIKE * PERIOD_NS;
        let start = match self.waited(due) {
            Some((period, waited)) if own_rate(period) => {
                // Towards a guard after the arrival, a tenth of a period at most at once.
                let guard = self.guard_ns();
                let ahead = if waited > period / 2.0 { waited - period } else { waited };
                due.plus_ns((guard - ahead).clamp(-PERIOD_NS / 10.0, PERIOD_NS / 10.0) as i64)
            }
            _ => self.before_picture(due),
        };
        Plan { start, shown: start.plus_ns(PERIOD_NS as i64) }
    }
}

/// Blanks in a tick, where that is a whole number.
fn blanks_of(blank_ns: f64) -> Option<u32> {
    let blanks = (PERIOD_NS / blank_ns).round();
    let alike = (blanks * blank_ns - PERIOD_NS).abs() <= ALIKE * PERIOD_NS;
    (alike && (1.0..=16.0).contains(&blanks)).then_some(blanks as u32)
}
