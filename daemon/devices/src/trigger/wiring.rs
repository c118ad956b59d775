//! How the inert interlock is wired, and whether a broken wire could pass for an inert gun.

use std::{path::Path, time::Duration};

use crate::gpio::{GpioError, InputHandle, InputLine};

/// Wiring of the inert interlock. Active means that the gun is inert.
///
/// One contact tells an open wire, where a resistor pulls the line to "not inert". It does not tell a short circuit to the other side: that
/// takes a second contact with the opposite level, as category 3 of ISO 13849-1 has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InterlockWiring {
    /// The contact.
    pub contact: InputLine,
    /// Another contact of the same plug, with the opposite level; active means inert, too.
    pub second: Option<InputLine>,
    /// How long the two may differ, while the plug is being moved.
    pub discrepancy: Duration,
}

/// Reasons why a wiring could arm a gun that is not inert.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WiringError {
    /// The resistor pulls the open wire to "inert".
    #[error(
        "a broken wire of interlock line {line} would read as inert: with active_low = {active_low} give bias = \"{bias}\" (or \
         \"external-{bias}\" for a resistor on the board)"
    )]
    OpenIsInert {
        /// The line.
        line: String,
        /// Its polarity.
        active_low: bool,
        /// The bias that it needs.
        bias: &'static str,
    },
    /// Nothing says what an open wire reads.
    #[error(
        "nothing says what a broken wire of interlock line {line} reads: give bias = \"{bias}\", or \"external-{bias}\" where a resistor \
         on the board does it"
    )]
    NoBias {
        /// The line.
        line: String,
        /// The bias that it needs.
        bias: &'static str,
    },
    /// One short circuit between the wires would leave both active.
    #[error(
        "both contacts of the interlock have active_low = {active_low}: a short circuit would reach both; wire the second one the other \
         way round and set its active_low = {}", !active_low
    )]
    SameLevel {
        /// Their polarity.
        active_low: bool,
    },
}

impl InterlockWiring {
    /// How long two contacts may differ where nobody says so: a plug that is turned takes a few tenths of a second.
    pub const DISCREPANCY: Duration = Duration::from_millis(500);

    /// A single contact.
    pub const fn single(contact: InputLine) -> Self {
        Self { contact, second: None, discrepancy: Self::DISCREPANCY }
    }

    /// Its contacts.
    pub fn contacts(&self) -> impl Iterator<Item = &InputLine> {
        [Some(&self.contact), self.second.as_ref()].into_iter().flatten()
    }

    /// Whether no single broken wire makes the gun look inert.
    pub fn check(&self) -> Result<(), WiringError> {
        for contact in self.contacts() {
            let bias = if contact.active_low { "pull-up" } else { "pull-down" };
            let line = contact.line.clone();
            match contact.open_wire_is_active() {
                Some(false) => {}
                Some(true) => {
                    return Err(WiringError::OpenIsInert { line, active_low: contact.active_low, bias });
                }
                None => return Err(WiringError::NoBias { line, bias }),
            }
        }
        match &self.second {
            Some(second) if second.active_low == self.contact.active_low => {
                Err(WiringError::SameLevel { active_low: second.active_low })
            }
            _ => Ok(()),
        }
    }
}

/// The interlock's contacts, open for reading by whoever tests them while the trainer does not run.
#[derive(Debug)]
pub struct InterlockProbe(Vec<InputHandle>);

impl InterlockProbe {
    /// Asks for the lines.
    pub fn open(wiring: &InterlockWiring) -> Result<Self, GpioError> {
        let open = |line| InputHandle::open(Path::new("/dev"), line, None);
        wiring.contacts().map(open).collect::<Result<_, _>>().map(Self)
    }

    /// Whether each contact is active: says that the gun is inert.
    pub fn levels(&self) -> Result<Vec<bool>, GpioError> {
        self.0.iter().map(|line| line.level().map(|(_, active)| active)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpio::LineBias;

    const BIASES: [LineBias; 6] = [
        LineBias::AsIs,
        LineBias::PullUp,
        LineBias::PullDown,
        LineBias::Disabled,
        LineBias::ExternalPullUp,
        LineBias::ExternalPullDown,
    ];

    fn line(name: &str, active_low: bool, bias: LineBias) -> InputLine {
        InputLine { chip: "chip".to_owned(), line: name.to_owned(), active_low, bias }
    }

    /// The level of a wire: driven by its contact, open, or shorted to one side.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Wire {
        Whole,
        Open,
        Low,
        High,
    }

    const WIRES: [Wire; 4] = [Wire::Whole, Wire::Open, Wire::Low, Wire::High];

    /// What the line reads; `None` where that is left to chance.
    fn reads(line: &InputLine, wire: Wire, inert: bool) -> Option<bool> {
        match wire {
            Wire::Whole => Some(inert),
            Wire::Open => line.open_wire_is_active(),
            Wire::Low => Some(line.active_low),
            Wire::High => Some(!line.active_low),
        }
    }

    #[test]
    fn what_is_accepted_never_reads_a_broken_wire_as_inert() {
        let mut accepted = 0;
        for active_low in [false, true] {
            for bias in BIASES {
                let wiring = InterlockWiring::single(line("a", active_low, bias));
                let fails_safe = reads(&wiring.contact, Wire::Open, false) == Some(false);
                assert_eq!(wiring.check().is_ok(), fails_safe, "{wiring:?}");
                accepted += usize::from(fails_safe);
            }
        }
        assert_eq!(accepted, 4);
    }

    #[test]
    fn with_two_contacts_no_single_broken_or_shorted_wire_reads_as_inert() {
        let mut accepted = 0;
        for (first_low, second_low) in [(false, false), (false, true), (true, false), (true, true)] {
            for (first_bias, second_bias) in BIASES.iter().flat_map(|a| BIASES.iter().map(move |b| (*a, *b)))
            {
                let wiring = InterlockWiring {
                    second: Some(line("b", second_low, second_bias)),
                    ..InterlockWiring::single(line("a", first_low, first_bias))
                };
                if wiring.check().is_err() {
                    continue;
                }
                accepted += 1;
                let contacts: Vec<_> = wiring.contacts().collect();
                let single = WIRES.iter().flat_map(|w| [[*w, Wire::Whole], [Wire::Whole, *w]]);
                // One cause for both wires: cut together, or shorted to each other and to one side.
                let both = [Wire::Open, Wire::Low, Wire::High].map(|w| [w; 2]);
                for wires in single.chain(both) {
                    let inert = contacts.iter().zip(wires).all(|(c, w)| reads(c, w, false) != Some(false));
                    assert!(!inert, "{wiring:?} {wires:?}");
                }
            }
        }
        assert_eq!(accepted, 8);
    }

    #[test]
    fn a_refusal_says_what_to_write() {
        let said = |wiring: &InterlockWiring| wiring.check().unwrap_err().to_string();
        let low = said(&InterlockWiring::single(line("inert", true, LineBias::PullDown)));
        assert!(
            low.contains("line inert would read as inert") && low.contains("bias = \"pull-up\""),
            "{low}"
        );
        let none = said(&InterlockWiring::single(line("inert", false, LineBias::AsIs)));
        assert!(none.contains("bias = \"pull-down\""), "{none}");
        let same = said(&InterlockWiring {
            second: Some(line("b", true, LineBias::PullUp)),
            ..InterlockWiring::single(line("a", true, LineBias::PullUp))
        });
        assert!(same.contains("set its active_low = false"), "{same}");
    }
}
