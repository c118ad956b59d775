//! Lines of GPIO chips, over the character device (uAPI v1, by the gpio-cdev crate): found by their chip's label or node and by name
//! or number, read with the kernel's times of their edges, driven as outputs, and freed of the chatter of contacts.

mod chip;
mod debounce;
mod line;

pub(crate) use self::line::{GpioEdge, InputHandle, OutputHandle};
pub use self::{
    chip::{ChipInfo, GpioError, LineInfo, check, clock_is_monotonic, list},
    debounce::Debouncer,
    line::{InputLine, LineBias},
};
pub(crate) use chip::{PlacedLine, place_again};
