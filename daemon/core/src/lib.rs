//! The trainer without hardware: no I/O, no clock, no threads, no `unsafe`.
//!
//! Events of the devices go in ([`event`]), what is to be drawn ([`scene`]) and recorded ([`score`]) comes out.

#![forbid(unsafe_code)]

pub mod attitude;
pub mod boats;
pub mod calibration;
pub mod clock;
pub mod event;
pub mod fault;
pub mod geometry;
pub mod guide;
pub mod gunnery;
pub mod horizon;
pub mod light;
pub mod model;
pub mod pacing;
pub mod plan;
pub mod pose;
pub mod reflection;
pub mod scenario;
pub mod scene;
pub mod score;
pub mod sea;
pub mod session;
pub mod skyline;
pub mod still;
pub mod text;
pub mod time;
pub mod view;
pub mod wake;
pub mod weapon;

#[cfg(test)]
mod test_data;
