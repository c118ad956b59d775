//! One line: an input with its edges, or an output.

use std::{
    error::Error as _,
    io,
    os::fd::{AsFd, BorrowedFd},
    path::{Path, PathBuf},
};

use bowwave_core::time::Time;
use gpio_cdev::{EventRequestFlags, EventType, LineEventHandle, LineHandle, LineRequestFlags};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};

use super::chip::{self, GpioError, PlacedLine, place_again};
use crate::clock;

/// Name under which the kernel lists the user of a line.
pub(super) const CONSUMER: &str = "bowwave";

/// Bias of an input where nothing drives it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LineBias {
    /// As it is set up: by the board, or outside.
    #[default]
    AsIs,
    /// The chip pulls it up.
    PullUp,
    /// The chip pulls it down.
    PullDown,
    /// Nothing of the chip's.
    Disabled,
    /// A resistor outside of the chip pulls it up; the chip does nothing.
    ExternalPullUp,
    /// A resistor outside of the chip pulls it down; the chip does nothing.
    ExternalPullDown,
}

impl LineBias {
    /// Whether a line that nothing drives is high; `None` where nothing says so.
    pub const fn pulls_high(self) -> Option<bool> {
        match self {
            Self::PullUp | Self::ExternalPullUp => Some(true),
            Self::PullDown | Self::ExternalPullDown => Some(false),
            Self::AsIs | Self::Disabled => None,
        }
    }
}

/// An input line and how it is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputLine {
    /// The chip: its label or name, or a node such as `/dev/gpiochip0`. A chip that was lost is known by its label, because
    /// it may come back as another node, and another chip as its node.
    pub chip: String,
    /// The line: its name or its number on the chip.
    pub line: String,
    /// Active is low, as with a switch to ground.
    pub active_low: bool,
    /// Its bias.
    pub bias: LineBias,
}

impl InputLine {
    /// Whether the line is active while its wire is open; `None` where nothing pulls it either way.
    pub const fn open_wire_is_active(&self) -> Option<bool> {
        match self.bias.pulls_high() {
            Some(high) => Some(high != self.active_low),
            None => None,
        }
    }

    fn flags(&self) -> LineRequestFlags {
        // GPIOHANDLE_REQUEST_BIAS_* of linux/gpio.h (Linux 5.5 and newer), which the crate does not name.
        let bias = match self.bias {
            LineBias::AsIs | LineBias::ExternalPullUp | LineBias::ExternalPullDown => 0,
            LineBias::PullUp => 1 << 5,
            LineBias::PullDown => 1 << 6,
            LineBias::Disabled => 1 << 7,
        };
        LineRequestFlags::INPUT | polarity(self.active_low) | LineRequestFlags::from_bits_retain(bias)
    }
}

/// An edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct GpioEdge {
    /// The kernel's time.
    pub time: Time,
    /// The level that it brought.
    pub active: bool,
}

/// An open input line.
#[derive(Debug)]
pub(crate) struct InputHandle {
    handle: LineEventHandle,
    node: PathBuf,
    label: String,
    offset: u32,
    asked: Time,
}

impl InputHandle {
    /// Opens the line for both edges. Where its chip is `known` by its label from before, it is on that one or nowhere.
    pub(crate) fn open(dev: &Path, wanted: &InputLine, known: Option<&str>) -> Result<Self, GpioError> {
        let placed = place_again(dev, &wanted.chip, &wanted.line, known)?;
        let (node, offset) = (placed.node.clone(), placed.offset);
        let failed = |source| chip::request_error(&placed, source);
        let asked = clock::now();
        let handle = placed
            .line()
            .and_then(|line| line.events(wanted.flags(), EventRequestFlags::BOTH_EDGES, CONSUMER))
            .map_err(failed)?;
        let flags = fcntl_getfl(&handle).unwrap_or(OFlags::empty()) | OFlags::NONBLOCK;
        fcntl_setfl(&handle, flags)
            .map_err(|e| GpioError::Io { node: node.clone(), source: io::Error::from(e) })?;
        Ok(Self { handle, node, label: placed.chip.label().to_owned(), offset, asked })
    }

    /// When the line was asked for: no edge of it is older.
    pub(crate) const fn asked(&self) -> Time {
        self.asked
    }

    /// The label of its chip.
    pub(crate) fn label(&self) -> &str {
        &self.label
    }

    /// The next edge that waits, if one does.
    pub(crate) fn edge(&mut self) -> Result<Option<GpioEdge>, GpioError> {
        match self.handle.next() {
            Some(Ok(event)) => Ok(Some(GpioEdge {
                // A time beyond 292 years is no time since start-up: the check of the clock refuses it.
                time: Time::from_ns(i64::try_from(event.timestamp()).unwrap_or(i64::MAX)),
                active: event.event_type() == EventType::RisingEdge,
            })),
            Some(Err(e)) if would_block(&e) => Ok(None),
            Some(Err(source)) => Err(self.lost(source)),
            None => Err(GpioError::Io {
                node: self.node.clone(),
                source: io::Error::new(io::ErrorKind::UnexpectedEof, "half an edge"),
            }),
        }
    }

    /// The line's level, and when it was read.
    pub(crate) fn level(&self) -> Result<(Time, bool), GpioError> {
        match self.handle.get_value() {
            Ok(value) => Ok((clock::now(), value != 0)),
            Err(source) => Err(self.lost(source)),
        }
    }

    fn lost(&self, source: gpio_cdev::Error) -> GpioError {
        GpioError::Line { node: self.node.clone(), offset: self.offset, source }
    }
}

impl AsFd for InputHandle {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.handle.as_fd()
    }
}

/// An output line.
#[derive(Debug)]
pub(crate) struct OutputHandle(LineHandle);

impl OutputHandle {
    /// Asks for the line as an output, not active: the default is a logical value.
    pub(crate) fn open(placed: &PlacedLine, active_low: bool, consumer: &str) -> Result<Self, GpioError> {
        let flags = LineRequestFlags::OUTPUT | polarity(active_low);
        let handle = placed.line().and_then(|line| line.request(flags, 0, consumer));
        handle.map(Self).map_err(|e| chip::request_error(placed, e))
    }

    /// Sets whether it is active.
    pub(crate) fn set(&self, active: bool) -> Result<(), gpio_cdev::Error> {
        self.0.set_value(active.into())
    }
}

fn polarity(active_low: bool) -> LineRequestFlags {
    if active_low { LineRequestFlags::ACTIVE_LOW } else { LineRequestFlags::empty() }
}

fn would_block(error: &gpio_cdev::Error) -> bool {
    let io = error.source().and_then(|source| source.downcast_ref::<io::Error>());
    io.is_some_and(|e| matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_to_read_is_no_loss() {
        assert!(would_block(&io::Error::from(io::ErrorKind::WouldBlock).into()));
        assert!(!would_block(&io::Error::from_raw_os_error(19).into()), "ENODEV");
    }

    #[test]
    fn an_input_is_never_asked_to_be_an_output() {
        for bias in [LineBias::AsIs, LineBias::PullUp, LineBias::PullDown, LineBias::Disabled] {
            for active_low in [false, true] {
                let line = InputLine { chip: String::new(), line: String::new(), active_low, bias };
                let flags = line.flags();
                assert!(flags.contains(LineRequestFlags::INPUT) && !flags.contains(LineRequestFlags::OUTPUT));
                assert_eq!(flags.contains(LineRequestFlags::ACTIVE_LOW), active_low);
            }
        }
    }
}
