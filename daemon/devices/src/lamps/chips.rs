//! Where lines are: whether a lamp and an input are one line, now that chips may come, go and change their names.

use std::path::Path;

use gpio_cdev::{LineHandle, LineRequestFlags};

use super::{LampError, LampSettings};
use crate::trigger::{InputLine, PlacedLine, TriggerError, place_again, request_error};

/// The GPIO chips: the kernel's, or a test's.
pub(super) trait Chips {
    /// A line to be asked for.
    type Place;
    /// A line that is held.
    type Handle;

    /// Finds `line` of `chip`; where that chip's label is `known` from before, on that one only.
    fn find(&self, chip: &str, line: &str, known: Option<&str>) -> Result<(Spot, Self::Place), TriggerError>;

    /// Asks for the line as an output, dark.
    fn take(&self, place: &Self::Place, active_low: bool) -> Result<Self::Handle, TriggerError>;

    /// Lights the lamp, or switches it off.
    fn set(&self, handle: &Self::Handle, lit: bool) -> Result<(), gpio_cdev::Error>;
}

/// Where a line is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Spot {
    /// The kernel's name of its chip, which is one chip's as long as that is there.
    pub(super) chip: String,
    /// What the maker calls its chip.
    pub(super) label: String,
    /// Its number there.
    pub(super) offset: u32,
}

/// The kernel's chips.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kernel;

impl Chips for Kernel {
    type Place = PlacedLine;
    type Handle = LineHandle;

    fn find(&self, chip: &str, line: &str, known: Option<&str>) -> Result<(Spot, PlacedLine), TriggerError> {
        let placed = place_again(Path::new("/dev"), chip, line, known)?;
        let (chip, label) = (placed.chip.name().to_owned(), placed.chip.label().to_owned());
        Ok((Spot { chip, label, offset: placed.offset }, placed))
    }

    fn take(&self, place: &PlacedLine, active_low: bool) -> Result<LineHandle, TriggerError> {
        let level = if active_low { LineRequestFlags::ACTIVE_LOW } else { LineRequestFlags::empty() };
        // The default is a logical value: dark.
        place
            .line()
            .and_then(|line| line.request(LineRequestFlags::OUTPUT | level, 0, "bowwave-lamp"))
            .map_err(|e| request_error(place, e))
    }

    fn set(&self, handle: &LineHandle, lit: bool) -> Result<(), gpio_cdev::Error> {
        handle.set_value(lit.into())
    }
}

/// A line by what it is called, with what was learnt of its chip.
#[derive(Clone, Debug)]
pub(super) struct Known {
    pub(super) name: &'static str,
    chip: String,
    pub(super) line: String,
    /// Of its chip, once that was seen: the trigger's port follows an input to wherever this chip comes back.
    label: Option<String>,
}

impl Known {
    pub(super) fn new(name: &'static str, chip: &str, line: &str) -> Self {
        Self { name, chip: chip.to_owned(), line: line.to_owned(), label: None }
    }

    /// Inputs, with their names.
    pub(super) fn inputs<'a>(inputs: impl IntoIterator<Item = (&'static str, &'a InputLine)>) -> Vec<Self> {
        inputs.into_iter().map(|(name, input)| Self::new(name, &input.chip, &input.line)).collect()
    }

    /// Where it is now.
    pub(super) fn find<C: Chips>(&mut self, chips: &C) -> Result<(Spot, C::Place), TriggerError> {
        let found = chips.find(&self.chip, &self.line, self.label.as_deref())?;
        if self.label.is_none() {
            self.label = Some(found.0.label.clone()).filter(|label| !label.is_empty());
        }
        Ok(found)
    }

    /// Whether it is the line `other`, which is at `spot`. What is not there now is compared as it is written.
    fn is(&mut self, chips: &impl Chips, other: &Self, spot: Option<&Spot>) -> bool {
        let is_there = spot.is_some_and(|spot| {
            self.find(chips).is_ok_and(|(own, _)| (&own.chip, own.offset) == (&spot.chip, spot.offset))
        });
        is_there || (&self.chip, &self.line) == (&other.chip, &other.line)
    }
}

/// The lamp's own error where it is at `spot` and that is one of `inputs`.
pub(super) fn no_input(
    chips: &impl Chips,
    lamp: &Known,
    spot: Option<&Spot>,
    inputs: &mut [Known],
) -> Result<(), LampError> {
    let met = inputs.iter_mut().find_map(|input| input.is(chips, lamp, spot).then_some(input.name));
    met.map_or(Ok(()), |input| {
        Err(LampError::Input {
            lamp: lamp.name,
            input: input.to_owned(),
            chip: lamp.chip.clone(),
            line: lamp.line.clone(),
        })
    })
}

/// Refuses a lamp on one of `inputs`, and two lamps on one line.
pub(super) fn check(
    chips: &impl Chips,
    settings: &LampSettings,
    inputs: &mut [Known],
) -> Result<(), LampError> {
    let mut seen: Vec<Known> = Vec::new();
    for (name, line) in settings.wired() {
        let mut lamp = Known::new(name, &settings.chip, line);
        let spot = lamp.find(chips).ok().map(|(spot, _)| spot);
        no_input(chips, &lamp, spot.as_ref(), inputs)?;
        let other = seen.iter_mut().find_map(|o| o.is(chips, &lamp, spot.as_ref()).then_some(o.name));
        if let Some(other) = other {
            let (chip, line) = (settings.chip.clone(), line.to_owned());
            return Err(LampError::SameLine { lamp: name, other, chip, line });
        }
        seen.push(lamp);
    }
    Ok(())
}
