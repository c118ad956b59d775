//! Lamps on the gun mount that tell the sailor how the trainer does.
//!
//! **Lamps only tell the sailor. Nothing may be wired from them to a firing circuit**, to an interlock or to anything else
//! that acts: they are plain outputs of a training computer, they flicker when it starts and keep their last state when it
//! is killed. A line that is an input of the trainer (trigger, interlock, power-fail) is refused as a lamp.

use std::path::Path;

use bowwave_core::time::{NS_PER_S, Time};
use gpio_cdev::{LineHandle, LineRequestFlags};

use crate::trigger::{InputLine, TriggerError, place, request_error};

/// How often lamps that went dark are looked for.
const RETRY_NS: i64 = NS_PER_S;

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

/// Why there is no light.
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
        /// What is wrong.
        source: TriggerError,
    },
    /// The lamp cannot be switched.
    #[error("cannot switch the lamp {lamp}: {source}; is its chip still there?")]
    Switch {
        /// The lamp.
        lamp: &'static str,
        /// What the GPIO layer says.
        source: gpio_cdev::Error,
    },
}

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
        self.check_in(Path::new("/dev"), inputs)
    }

    fn check_in<'a>(
        &self,
        dev: &Path,
        inputs: impl IntoIterator<Item = (&'static str, &'a InputLine)>,
    ) -> Result<(), LampError> {
        let inputs: Vec<_> =
            inputs.into_iter().map(|(name, input)| (name, Spot::of(dev, &input.chip, &input.line))).collect();
        let mut lamps: Vec<(&'static str, Spot)> = Vec::new();
        for (lamp, line) in self.wired() {
            let spot = Spot::of(dev, &self.chip, line);
            let chip = self.chip.clone();
            if let Some((input, _)) = inputs.iter().find(|(_, s)| s.meets(&spot)) {
                return Err(LampError::Input {
                    lamp,
                    input: (*input).to_owned(),
                    chip,
                    line: line.to_owned(),
                });
            }
            if let Some((other, _)) = lamps.iter().find(|(_, s)| s.meets(&spot)) {
                return Err(LampError::SameLine { lamp, other, chip, line: line.to_owned() });
            }
            lamps.push((lamp, spot));
        }
        Ok(())
    }
}

/// A line as it is written, and where it is if it is there.
struct Spot {
    written: (String, String),
    found: Option<(String, u32)>,
}

impl Spot {
    fn of(dev: &Path, chip: &str, line: &str) -> Self {
        let found = place(dev, chip, line).ok().map(|p| (p.chip.name().to_owned(), p.offset));
        Self { written: (chip.to_owned(), line.to_owned()), found }
    }

    fn meets(&self, other: &Self) -> bool {
        self.written == other.written || (self.found.is_some() && self.found == other.found)
    }
}

/// One lamp's line.
struct Lamp {
    name: &'static str,
    line: String,
    handle: Option<LineHandle>,
    /// Told as broken.
    told: bool,
}

/// The lamps. All go dark when this is dropped; where the program is killed they keep their last state.
pub struct Lamps {
    settings: LampSettings,
    lamps: Vec<Lamp>,
    shown: Option<LampState>,
    retry: Time,
}

impl std::fmt::Debug for Lamps {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Lamps")
            .field("settings", &self.settings)
            .field("shown", &self.shown)
            .finish_non_exhaustive()
    }
}

impl Lamps {
    /// Takes the lines, all dark, after making sure that none of `inputs`
    /// ([`TriggerSettings::inputs`](crate::trigger::TriggerSettings::inputs)) is among them.
    pub fn open<'a>(
        settings: LampSettings,
        inputs: impl IntoIterator<Item = (&'static str, &'a InputLine)>,
    ) -> Result<Self, LampError> {
        settings.check(inputs)?;
        let lamps = settings
            .wired()
            .map(|(name, line)| {
                let handle = Some(take(&settings, name, line)?);
                Ok(Lamp { name, line: line.to_owned(), handle, told: false })
            })
            .collect::<Result<_, LampError>>()?;
        Ok(Self { settings, lamps, shown: None, retry: Time::MIN })
    }

    /// Shows `state`. One short kernel call a lamp, and none where nothing changes. A lamp that cannot be switched is told
    /// once, and tried again once a second; training does not depend on it.
    pub fn set(&mut self, now: Time, state: LampState) -> Result<(), LampError> {
        let broken = self.lamps.iter().any(|l| l.handle.is_none());
        if self.shown == Some(state) && !(broken && now >= self.retry) {
            return Ok(());
        }
        let again = now >= self.retry;
        if again {
            self.retry = now.plus_ns(RETRY_NS);
        }
        self.shown = Some(state);
        let mut result = Ok(());
        for lamp in &mut self.lamps {
            let lit = match lamp.name {
                "READY" => state.ready,
                "HIT" => state.hit,
                _ => state.fault,
            };
            if let Err(e) = lamp.show(&self.settings, lit, again)
                && !std::mem::replace(&mut lamp.told, true)
                && result.is_ok()
            {
                result = Err(e);
            }
        }
        result
    }

    /// What they were last asked to show.
    pub const fn shown(&self) -> Option<LampState> {
        self.shown
    }
}

impl Lamp {
    fn show(&mut self, settings: &LampSettings, lit: bool, again: bool) -> Result<(), LampError> {
        let handle = match &self.handle {
            Some(handle) => handle,
            None if again => self.handle.insert(take(settings, self.name, &self.line)?),
            None => return Ok(()),
        };
        match handle.set_value(lit.into()) {
            Ok(()) => {
                self.told = false;
                Ok(())
            }
            Err(source) => {
                self.handle = None;
                Err(LampError::Switch { lamp: self.name, source })
            }
        }
    }
}

impl Drop for Lamps {
    fn drop(&mut self) {
        for lamp in &self.lamps {
            if let Some(handle) = &lamp.handle
                && let Err(e) = handle.set_value(0)
            {
                log::warn!("cannot switch off the lamp {}: {e}", lamp.name);
            }
        }
    }
}

fn take(settings: &LampSettings, lamp: &'static str, line: &str) -> Result<LineHandle, LampError> {
    let failed = |source| LampError::Line { lamp, source };
    let placed = place(Path::new("/dev"), &settings.chip, line).map_err(failed)?;
    let level = if settings.active_low { LineRequestFlags::ACTIVE_LOW } else { LineRequestFlags::empty() };
    // The default is a logical value: dark.
    placed
        .line()
        .and_then(|line| line.request(LineRequestFlags::OUTPUT | level, 0, "bowwave-lamp"))
        .map_err(|e| failed(request_error(&placed, e)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trigger::{Bias, TriggerSettings};

    fn input(line: &str) -> InputLine {
        InputLine { chip: "pinctrl".into(), line: line.into(), active_low: true, bias: Bias::AsIs }
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
            interlock: Some(input("27")),
            power_fail: Some(input("PFAIL")),
            ..TriggerSettings::new(input("17"))
        };
        for (line, name) in [("17", "trigger"), ("27", "interlock"), ("PFAIL", "power-fail")] {
            let e = lamps("5", line).check(inputs.inputs()).expect_err("an input");
            assert!(matches!(&e, LampError::Input { lamp: "HIT", input, .. } if input == name), "{e}");
            assert!(matches!(Lamps::open(lamps(line, "6"), inputs.inputs()), Err(LampError::Input { .. })));
        }
        lamps("5", "6").check(inputs.inputs()).expect("lines of their own");
        assert!(matches!(lamps("5", "5").check(inputs.inputs()), Err(LampError::SameLine { .. })));
    }

    #[test]
    fn lamps_without_a_chip_are_told_in_words() {
        let message = Lamps::open(lamps("5", "6"), []).expect_err("no such chip").to_string();
        assert!(message.starts_with("lamp READY: no GPIO chip is called pinctrl"), "{message}");
    }
}
