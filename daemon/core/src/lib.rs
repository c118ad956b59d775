//! The trainer without hardware: no I/O, no clock, no threads, no `unsafe`.
//!
//! Three stages, each of which sees only those before it: [`estimate`] (where the camera points, what the sea and the light are),
//! [`world`] (boats, weapon, rounds, score) and [`frame`] (what is drawn, and why not). [`session`] steps them. [`gunner`] plays the world
//! without pictures. The other modules are the vocabulary that all of them share.

#![forbid(unsafe_code)]

pub mod act;
pub mod calibration;
mod chance;
pub mod colour;
pub mod daylight;
pub mod engagement;
pub mod ephemeris;
pub mod estimate;
pub mod event;
pub mod fault;
pub mod frame;
pub mod geometry;
pub mod guide;
pub mod gunner;
pub mod levenberg;
pub mod model;
pub mod order;
pub mod own_ship;
pub mod pacing;
pub mod physics;
pub mod sea;
pub mod session;
pub mod side;
pub mod sky;
pub mod statistics;
pub mod text;
pub mod time;
pub mod water;
pub mod world;

#[cfg(test)]
mod test_data;
