//! The drawn reflections of every method held against the ray-traced truth, as the table of the reflection's targets has it.
//!
//! A method gets the picture without the boat, camera, boat, light and wind, as the trainer has them ([`cell`], [`draw`]), and draws with
//! the renderer. [`grid`] says how far from the truth that is, [`wrong`] what wrong estimates of sea and sky do to it, [`time`] how it
//! moves, [`gap`] whether it hangs together with the hull, [`singular`] what becomes of it where formulas break, and [`cost`] what it takes.

pub mod cell;
pub mod commands;
pub mod cost;
pub mod draw;
pub mod gap;
pub mod grid;
pub mod scenes;
pub mod singular;
pub mod time;
pub mod wrong;

use bowwave_core::water::ReflectionMethod;

use crate::table::TextTable;

/// The thesis's shaders: mended ones first.
pub const THESIS: [ReflectionMethod; 4] = [
    ReflectionMethod::Full,
    ReflectionMethod::Physics,
    ReflectionMethod::FullAsPublished,
    ReflectionMethod::PhysicsAsPublished,
];

/// Where a method stands in [`ReflectionMethod::ALL`].
pub fn index(method: ReflectionMethod) -> usize {
    ReflectionMethod::ALL.iter().position(|m| *m == method).unwrap_or(0)
}

/// Mean; no number of none.
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    sum / count
}

/// A table whose columns are the methods, after one of names of `width` letters and before some more.
pub fn methods_table(title: &str, width: usize, more: &[(&str, usize)]) -> TextTable {
    let methods = ReflectionMethod::ALL.map(|m| (m.name(), 19));
    TextTable::new(1, [(title, width)].into_iter().chain(methods).chain(more.iter().copied()))
}
