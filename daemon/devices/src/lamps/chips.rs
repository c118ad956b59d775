//! Where lines are: whether a lamp and an input are one line, now that chips may come, go and change their names.

use std::path::Path;

use super::{LampError, LampSettings};
use crate::gpio::{GpioError, InputLine, OutputHandle, PlacedLine, place_again};

/// The GPIO chips: the kernel's, or a test's.
pub(super) trait LampChips {
    /// A line to be asked for.
    type Place;
    /// A line that is held.
    type Handle;

    /// Finds `line` of `chip`; where that chip's label is `known` from before, on that one only.
    fn find(&self, chip: &str, line: &str, known: Option<&str>)
    -> Result<(LineSpot, Self::Place), GpioError>;

    /// Asks for the line as an output, dark.
    fn take(&self, place: &Self::Place, active_low: bool) -> Result<Self::Handle, GpioError>;

    /// Lights the lamp, or switches it off.
    fn set(&self, handle: &Self::Handle, lit: bool) -> Result<(), gpio_cdev::Error>;
}

/// Where a line is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LineSpot {
    /// The kernel's name of its chip, which is one chip's as long as that is there.
    pub(super) chip: String,
    /// The label of its chip.
    pub(super) label: String,
    /// Its number there.
    pub(super) offset: u32,
}

/// The kernel's chips.
#[derive(Clone, Copy, Debug)]
pub(super) struct KernelChips;

impl LampChips for KernelChips {
    type Place = PlacedLine;
    type Handle = OutputHandle;

    fn find(&self, chip: &str, line: &str, known: Option<&str>) -> Result<(LineSpot, PlacedLine), GpioError> {
        let placed = place_again(Path::new("/dev"), chip, line, known)?;
        let (chip, label) = (placed.chip.name().to_owned(), placed.chip.label().to_owned());
        Ok((LineSpot { chip, label, offset: placed.offset }, placed))
    }

    fn take(&self, place: &PlacedLine, active_low: bool) -> Result<OutputHandle, GpioError> {
        OutputHandle::open(place, active_low, "bowwave-lamp")
    }

    fn set(&self, handle: &OutputHandle, lit: bool) -> Result<(), gpio_cdev::Error> {
        handle.set(lit)
    }
}

/// A line by what it is called, with what was learnt of its chip.
#[derive(Clone, Debug)]
pub(super) struct KnownLine {
    pub(super) name: &'static str,
    chip: String,
    pub(super) line: String,
    /// Of its chip, once that was seen: the trigger's port follows an input to wherever this chip comes back.
    label: Option<String>,
}

impl KnownLine {
    pub(super) fn new(name: &'static str, chip: &str, line: &str) -> Self {
        Self { name, chip: chip.to_owned(), line: line.to_owned(), label: None }
    }

    /// Inputs, with their names.
    pub(super) fn inputs<'a>(inputs: impl IntoIterator<Item = (&'static str, &'a InputLine)>) -> Vec<Self> {
        inputs.into_iter().map(|(name, input)| Self::new(name, &input.chip, &input.line)).collect()
    }

    /// Where it is now.
    pub(super) fn find<C: LampChips>(&mut self, chips: &C) -> Result<(LineSpot, C::Place), GpioError> {
        let found = chips.find(&self.chip, &self.line, self.label.as_deref())?;
        if self.label.is_none() {
            self.label = Some(found.0.label.clone()).filter(|label| !label.is_empty());
        }
        Ok(found)
    }

    /// Whether it is the line `other`, which is at `spot`. What is not there now is compared as it is written.
    fn is(&mut self, chips: &impl LampChips, other: &Self, spot: Option<&LineSpot>) -> bool {
        let is_there = spot.is_some_and(|spot| {
            self.find(chips).is_ok_and(|(own, _)| (&own.chip, own.offset) == (&spot.chip, spot.offset))
        });
        is_there || (&self.chip, &self.line) == (&other.chip, &other.line)
    }
}

/// The lamp's own error where it is at `spot` and that is one of `inputs`.
pub(super) fn no_input(
    chips: &impl LampChips,
    lamp: &KnownLine,
    spot: Option<&LineSpot>,
    inputs: &mut [KnownLine],
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
    chips: &impl LampChips,
    settings: &LampSettings,
    inputs: &mut [KnownLine],
) -> Result<(), LampError> {
    let mut seen: Vec<KnownLine> = Vec::new();
    for (name, line) in settings.wired() {
        let mut lamp = KnownLine::new(name, &settings.chip, line);
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
