//! Lamps on the gun mount that tell the sailor how the trainer does.
//!
//! **Lamps only tell the sailor. Nothing may be wired from them to a firing circuit**, to an interlock or to anything else
//! that acts: they are plain outputs of a training computer, they flicker when it starts and keep their last state when it
//! is killed. A line that is an input of the trainer (trigger, interlock, power-fail) is refused as a lamp.

mod bank;
mod chips;

use std::{io, sync::Arc};

use self::{
    bank::{LampBank, RETRY_NS},
    chips::{KernelChips, KnownLine, LampChips},
};
use crate::{
    clock,
    gpio::{GpioError, InputLine},
    worker::{PortLink, PortWorker},
};

/// Which lines light which lamps. Lamps that are not wired are left out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LampSettings {
    /// The chip: a node such as `/dev/gpiochip0`, or its label or name.
    pub chip: String,
    /// Line of the lamp READY: its name or its number.
    pub ready: Option<String>,
    /// Line of the lamp HIT.
    pub hit: Option<String>,
    /// Line of the lamp FAULT.
    pub fault: Option<String>,
    /// A low level lights them.
    pub active_low: bool,
}

/// Which lamps are lit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LampState {
    /// The trainer is ready.
    pub ready: bool,
    /// The last round hit.
    pub hit: bool,
    /// The trainer cannot train.
    pub fault: bool,
}

/// Reasons why there is no light.
#[derive(Debug, thiserror::Error)]
pub enum LampError {
    /// A lamp on an input.
    #[error(
        "line {line} of {chip} is the {input} input and cannot be the lamp {lamp}: an output there could fire or arm; wire the \
         lamp to another line"
    )]
    Input {
        /// The lamp.
        lamp: &'static str,
        /// The input.
        input: String,
        /// The chip.
        chip: String,
        /// The line.
        line: String,
    },
    /// Two lamps on one line.
    #[error("the lamps {lamp} and {other} are both line {line} of {chip}: give each its own")]
    SameLine {
        /// The one.
        lamp: &'static str,
        /// The other.
        other: &'static str,
        /// The chip.
        chip: String,
        /// The line.
        line: String,
    },
    /// The line is not there or not free.
    #[error("lamp {lamp}: {source}")]
    Line {
        /// The lamp.
        lamp: &'static str,
        /// The reason.
        source: GpioError,
    },
    /// The lamp cannot be switched.
    #[error("cannot switch the lamp {lamp}: {source}; is its chip still there?")]
    Switch {
        /// The lamp.
        lamp: &'static str,
        /// The GPIO layer's answer.
        source: gpio_cdev::Error,
    },
    /// The thread could not be started.
    #[error("cannot start the thread that lights the lamps: {0}; are too many processes running?")]
    Thread(#[source] io::Error),
    /// The thread panicked: a defect of this program.
    #[error("the thread that lights the lamps broke down: report it with the log")]
    BrokeDown,
    /// A kernel call of the thread does not return.
    #[error(
        "a kernel call on the lamps' chip does not return: they may stay lit; look at the kernel's log (dmesg)"
    )]
    Blocked,
}

crate::worker::tells_of_threads!(LampError);

impl LampSettings {
    fn wired(&self) -> impl Iterator<Item = (&'static str, &str)> {
        [("READY", &self.ready), ("HIT", &self.hit), ("FAULT", &self.fault)]
            .into_iter()
            .filter_map(|(lamp, line)| line.as_deref().map(|line| (lamp, line)))
    }

    /// Refuses a lamp on one of `inputs` (name and line), and two lamps on one line, also where both are called by different
    /// names. What is not there now is compared as it is written.
    pub fn check<'a>(
        &self,
        inputs: impl IntoIterator<Item = (&'static str, &'a InputLine)>,
    ) -> Result<(), LampError> {
        chips::check(&KernelChips, self, &mut KnownLine::inputs(inputs))
    }
}

/// The lamps, lit by a thread of their own: a chip on a slow bus may keep a call for seconds. All go dark at the end; where the
/// program is killed they keep their last state.
#[derive(Debug)]
pub struct Lamps {
    /// The status is the state to be shown. `None` once they are dark.
    worker: Option<PortWorker<LampState>>,
}

impl Lamps {
    /// Makes sure that none of `inputs` (name and line, as of
    /// [`TriggerSettings::inputs`](crate::trigger::TriggerSettings::inputs)) is a lamp, and begins to take the lines, all
    /// dark. Lines that are not there yet, or no more, are tried again once a second, each time after the same check:
    /// training does not depend on them.
    pub fn start<'a>(
        settings: LampSettings,
        inputs: impl IntoIterator<Item = (&'static str, &'a InputLine)>,
    ) -> Result<Self, LampError> {
        Self::start_on(KernelChips, settings, KnownLine::inputs(inputs))
    }

    fn start_on<C>(chips: C, settings: LampSettings, inputs: Vec<KnownLine>) -> Result<Self, LampError>
    where
        C: LampChips<Handle: Send> + Send + 'static,
    {
        let bank = LampBank::new(chips, settings, inputs)?;
        let link = PortLink::new(LampState::default()).map_err(LampError::Thread)?;
        let worker = PortWorker::start("lamps", Arc::clone(&link), move || light(bank, &link));
        Ok(Self { worker: Some(worker.map_err(LampError::Thread)?) })
    }

    /// Shows `state` soon. Never waits; the newest wins.
    pub fn set(&mut self, state: LampState) {
        let Some(worker) = &self.worker else { return };
        let link = worker.link();
        if std::mem::replace(&mut *link.status(), state) != state {
            link.waker().notify();
        }
    }

    /// Switches the lamps off and gives their lines back, within 200 ms.
    pub fn stop(mut self) -> Result<(), LampError> {
        self.end()
    }

    fn end(&mut self) -> Result<(), LampError> {
        let Some(worker) = self.worker.take() else { return Ok(()) };
        Ok(worker.stop_in_time()?)
    }
}

impl Drop for Lamps {
    fn drop(&mut self) {
        if let Err(e) = self.end() {
            log::warn!("{e}");
        }
    }
}

/// Until the lamps are to go dark.
fn light(mut bank: LampBank<impl LampChips>, link: &PortLink<LampState>) {
    let mut state = LampState::default();
    while !link.is_stopping() {
        bank.show(clock::now(), state).iter().for_each(|e| log::warn!("{e}"));
        link.pause(RETRY_NS);
        state = *link.status();
    }
}

#[cfg(test)]
mod tests {
    use super::{chips::LineSpot, *};
    use crate::{
        gpio::LineBias,
        trigger::{InterlockWiring, TriggerSettings},
    };

    /// A chip that keeps each call for a while, as one on a bus that is stuck, and tells of each.
    struct Slow(crossbeam_channel::Sender<bool>);

    impl LampChips for Slow {
        type Place = u32;
        type Handle = ();

        fn find(&self, _: &str, line: &str, _: Option<&str>) -> Result<(LineSpot, u32), GpioError> {
            let offset = line.parse().expect("a number");
            Ok((LineSpot { chip: "gpiochip0".into(), label: "pinctrl".into(), offset }, offset))
        }

        fn take(&self, _: &u32, _: bool) -> Result<(), GpioError> {
            Ok(())
        }

        fn set(&self, (): &(), lit: bool) -> Result<(), gpio_cdev::Error> {
            clock::sleep_until(clock::now().plus_ns(150_000_000));
            let _ = self.0.send(lit);
            Ok(())
        }
    }

    fn input(line: &str) -> InputLine {
        InputLine { chip: "pinctrl".into(), line: line.into(), active_low: true, bias: LineBias::AsIs }
    }

    fn lamps(ready: &str, hit: &str) -> LampSettings {
        LampSettings {
            chip: "pinctrl".into(),
            ready: Some(ready.into()),
            hit: Some(hit.into()),
            fault: None,
            active_low: false,
        }
    }

    #[test]
    fn a_lamp_on_an_input_is_refused_even_where_the_chip_is_absent() {
        let inputs = TriggerSettings {
            interlock: Some(InterlockWiring::single(input("27"))),
            power_fail: Some(input("PFAIL")),
            ..TriggerSettings::new(input("17"))
        };
        for (line, name) in [("17", "trigger"), ("27", "interlock"), ("PFAIL", "power-fail")] {
            let e = lamps("5", line).check(inputs.inputs()).expect_err("an input");
            assert!(matches!(&e, LampError::Input { lamp: "HIT", input, .. } if input == name), "{e}");
            assert!(matches!(Lamps::start(lamps(line, "6"), inputs.inputs()), Err(LampError::Input { .. })));
        }
        lamps("5", "6").check(inputs.inputs()).expect("lines of their own");
        assert!(matches!(lamps("5", "5").check(inputs.inputs()), Err(LampError::SameLine { .. })));
    }

    #[test]
    fn lamps_without_a_chip_are_no_error_and_end_in_time() {
        let mut lamps = Lamps::start(lamps("5", "6"), []).expect("it may come");
        (0..100).for_each(|n| lamps.set(LampState { hit: n % 2 == 0, ..LampState::default() }));
        let begin = clock::now();
        lamps.stop().expect("ends");
        assert!(clock::now().ns_since(begin) < 200_000_000);
    }

    #[test]
    fn nobody_waits_for_a_slow_chip_and_the_newest_state_wins() {
        let (sender, seen) = crossbeam_channel::unbounded();
        let one = LampSettings { hit: None, ..lamps("5", "") };
        let mut lamps = Lamps::start_on(Slow(sender), one, Vec::new()).expect("starts");
        let begin = clock::now();
        (1..=101).for_each(|n| lamps.set(LampState { ready: n % 2 == 1, ..LampState::default() }));
        assert!(clock::now().ns_since(begin) < 100_000_000);
        assert_eq!(seen.recv(), Ok(false), "dark at first");
        assert_eq!(seen.recv(), Ok(true));
        lamps.set(LampState::default());
        // It is in that call, and goes dark after it.
        let stopped = lamps.stop();
        assert!(clock::now().ns_since(begin) < 3_000_000_000);
        assert!(matches!(stopped, Ok(()) | Err(LampError::Blocked)), "{stopped:?}");
        assert_eq!(seen.iter().last(), Some(false));
    }
}
