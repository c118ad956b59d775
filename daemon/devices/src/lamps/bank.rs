//! The lamps' lines: taken, lost, and taken again.

use bowwave_core::time::{NS_PER_S, Time};

use super::{
    LampError, LampSettings, LampState,
    chips::{self, KnownLine, LampChips},
};

/// How often lamps that are dark for want of a line are looked for.
pub(super) const RETRY_NS: i64 = NS_PER_S;

/// One lamp.
struct Lamp<H> {
    line: KnownLine,
    handle: Option<H>,
    /// Told as broken.
    told: bool,
}

/// The lamps. All go dark when this is dropped.
pub(super) struct LampBank<C: LampChips> {
    chips: C,
    active_low: bool,
    lamps: Vec<Lamp<C::Handle>>,
    inputs: Vec<KnownLine>,
    shown: Option<LampState>,
    retry: Time,
}

impl<C: LampChips> LampBank<C> {
    /// Fails only where a lamp is one of `inputs`, or two are one line. Takes no line yet.
    pub(super) fn new(
        chips: C,
        settings: LampSettings,
        mut inputs: Vec<KnownLine>,
    ) -> Result<Self, LampError> {
        chips::check(&chips, &settings, &mut inputs)?;
        let lamp = |(name, line)| Lamp {
            line: KnownLine::new(name, &settings.chip, line),
            handle: None,
            told: false,
        };
        let lamps = settings.wired().map(lamp).collect();
        Ok(Self { chips, active_low: settings.active_low, lamps, inputs, shown: None, retry: Time::MIN })
    }

    /// Shows `state`: one kernel call a lamp, and none where nothing changes. A lamp that cannot be switched is told once,
    /// and tried again once a second.
    pub(super) fn show(&mut self, now: Time, state: LampState) -> Vec<LampError> {
        let is_broken = self.lamps.iter().any(|l| l.handle.is_none());
        let again = is_broken && now >= self.retry;
        if self.shown == Some(state) && !again {
            return Vec::new();
        }
        if again {
            self.retry = now.plus_ns(RETRY_NS);
        }
        self.shown = Some(state);
        let Self { chips, active_low, lamps, inputs, .. } = self;
        let mut errors = Vec::new();
        for lamp in lamps {
            let taken = if again { lamp.take(chips, *active_low, inputs) } else { Ok(()) };
            if let Err(e) = taken.and_then(|()| lamp.show(chips, state))
                && !std::mem::replace(&mut lamp.told, true)
            {
                errors.push(e);
            }
        }
        errors
    }
}

impl<H> Lamp<H> {
    /// Takes the line where it is not held. That it is no input is looked at each time, on the very chip that it is taken
    /// from: neither need have been there before.
    fn take(
        &mut self,
        chips: &impl LampChips<Handle = H>,
        active_low: bool,
        inputs: &mut [KnownLine],
    ) -> Result<(), LampError> {
        if self.handle.is_some() {
            return Ok(());
        }
        let lamp = self.line.name;
        let failed = |source| LampError::Line { lamp, source };
        let (spot, place) = self.line.find(chips).map_err(failed)?;
        chips::no_input(chips, &self.line, Some(&spot), inputs)?;
        self.handle = Some(chips.take(&place, active_low).map_err(failed)?);
        Ok(())
    }

    fn show(&mut self, chips: &impl LampChips<Handle = H>, state: LampState) -> Result<(), LampError> {
        let Some(handle) = &self.handle else { return Ok(()) };
        let lamp = self.line.name;
        let lit = match lamp {
            "READY" => state.ready,
            "HIT" => state.hit,
            _ => state.fault,
        };
        match chips.set(handle, lit) {
            Ok(()) => {
                self.told = false;
                Ok(())
            }
            Err(source) => {
                self.handle = None;
                Err(LampError::Switch { lamp, source })
            }
        }
    }
}

impl<C: LampChips> Drop for LampBank<C> {
    fn drop(&mut self) {
        for lamp in &self.lamps {
            if let Some(handle) = &lamp.handle
                && let Err(e) = self.chips.set(handle, false)
            {
                log::warn!("cannot switch off the lamp {}: {e}", lamp.line.name);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{cell::RefCell, collections::BTreeMap, io, rc::Rc};

    use super::*;
    use crate::{gpio::GpioError, lamps::chips::LineSpot};

    /// LampChips by the number of their node, with their labels, and the lines that are driven, by chip and number.
    #[derive(Clone, Default)]
    struct Board {
        chips: Rc<RefCell<BTreeMap<u32, &'static str>>>,
        driven: Rc<RefCell<BTreeMap<(String, u32), bool>>>,
    }

    impl Board {
        fn new(chips: &[(u32, &'static str)]) -> Self {
            let board = Self::default();
            board.rewire(chips);
            board
        }

        /// Lines are lost with their chips.
        fn rewire(&self, chips: &[(u32, &'static str)]) {
            *self.chips.borrow_mut() = chips.iter().copied().collect();
            self.driven.borrow_mut().clear();
        }

        /// Lines that are driven, with their chips' labels, and whether they are lit.
        fn driven(&self) -> Vec<(String, u32, bool)> {
            self.driven.borrow().iter().map(|((label, offset), lit)| (label.clone(), *offset, *lit)).collect()
        }
    }

    impl LampChips for Board {
        type Place = (String, u32);
        type Handle = (String, u32);

        fn find(
            &self,
            chip: &str,
            line: &str,
            known: Option<&str>,
        ) -> Result<(LineSpot, Self::Place), GpioError> {
            let chips = self.chips.borrow();
            let named = |wanted: &str| {
                let is = |n: &u32, label: &str| label == wanted || format!("/dev/gpiochip{n}") == wanted;
                chips.iter().find(|(n, label)| is(n, label) && known.is_none_or(|k| k == **label))
            };
            let gone = || GpioError::NoChip { chip: chip.to_owned(), present: String::new() };
            let (n, label) = named(chip).or_else(|| named(known?)).ok_or_else(gone)?;
            let offset = line.parse().expect("a number");
            let spot = LineSpot { chip: format!("gpiochip{n}"), label: (*label).to_owned(), offset };
            Ok((spot, ((*label).to_owned(), offset)))
        }

        fn take(&self, place: &Self::Place, _: bool) -> Result<Self::Handle, GpioError> {
            self.driven.borrow_mut().insert(place.clone(), false);
            Ok(place.clone())
        }

        fn set(&self, handle: &Self::Handle, lit: bool) -> Result<(), gpio_cdev::Error> {
            match self.driven.borrow_mut().get_mut(handle) {
                Some(lamp) => *lamp = lit,
                None => return Err(io::Error::from_raw_os_error(19).into()),
            }
            Ok(())
        }
    }

    const LIT: LampState = LampState { ready: true, hit: false, fault: false };

    fn at(ms: i64) -> Time {
        Time::from_ns(ms * 1_000_000)
    }

    fn lamp(chip: &str, ready: &str) -> LampSettings {
        let ready = Some(ready.to_owned());
        LampSettings { chip: chip.to_owned(), ready, hit: None, fault: None, active_low: false }
    }

    fn trigger(chip: &str, line: &str) -> Vec<KnownLine> {
        vec![KnownLine::new("trigger", chip, line)]
    }

    #[test]
    fn lamps_whose_chip_comes_late_are_lit_a_second_later() {
        let board = Board::new(&[]);
        let mut bank =
            LampBank::new(board.clone(), lamp("pinctrl", "5"), trigger("pinctrl", "17")).expect("may come");
        let told: Vec<_> = [0, 500, 1000].iter().flat_map(|ms| bank.show(at(*ms), LIT)).collect();
        assert!(matches!(told.as_slice(), [LampError::Line { lamp: "READY", .. }]), "once: {told:?}");
        board.rewire(&[(0, "pinctrl")]);
        assert!(bank.show(at(1999), LIT).is_empty() && board.driven().is_empty());
        assert!(bank.show(at(2000), LIT).is_empty());
        assert_eq!(board.driven(), [("pinctrl".into(), 5, true)]);
        // Gone and back as another node: told once more, and lit in the state asked for last.
        board.rewire(&[(3, "pinctrl")]);
        assert!(matches!(bank.show(at(2100), LampState::default()).as_slice(), [LampError::Switch { .. }]));
        assert!(bank.show(at(3000), LIT).is_empty());
        assert_eq!(board.driven(), [("pinctrl".into(), 5, true)]);
        drop(bank);
        assert_eq!(board.driven(), [("pinctrl".into(), 5, false)], "dark at the end");
    }

    /// LampChips that come late are compared when they come: by then a lamp may prove to be an input.
    #[test]
    fn no_input_is_driven_whenever_its_chip_comes() {
        let board = Board::new(&[]);
        let inputs = trigger("/dev/gpiochip0", "17");
        let mut bank =
            LampBank::new(board.clone(), lamp("pinctrl", "17"), inputs).expect("two chips, as written");
        bank.show(at(0), LIT);
        board.rewire(&[(0, "pinctrl")]);
        bank.show(at(1000), LIT);
        assert!(board.driven().is_empty(), "it is the trigger");
        // It moves, and the trigger is followed there.
        board.rewire(&[(0, "expander"), (3, "pinctrl")]);
        bank.show(at(2000), LIT);
        assert!(board.driven().is_empty(), "it still is");
    }

    /// The lamps' node goes to the trigger's chip.
    #[test]
    fn a_lamp_does_not_follow_its_node_to_another_chip() {
        let board = Board::new(&[(0, "pinctrl"), (1, "lamps")]);
        let inputs = trigger("/dev/gpiochip0", "17");
        let mut bank = LampBank::new(board.clone(), lamp("/dev/gpiochip1", "17"), inputs).expect("two chips");
        bank.show(at(0), LIT);
        assert_eq!(board.driven(), [("lamps".into(), 17, true)]);
        board.rewire(&[(1, "pinctrl")]);
        for ms in [100, 1100, 2100] {
            bank.show(at(ms), LampState { hit: ms == 100, ..LIT });
            assert!(board.driven().is_empty());
        }
        board.rewire(&[(1, "pinctrl"), (2, "lamps")]);
        bank.show(at(3100), LIT);
        assert_eq!(board.driven(), [("lamps".into(), 17, true)]);
    }
}
