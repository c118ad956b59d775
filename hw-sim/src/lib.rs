//! Simulated hardware: replays recordings and makes ones with known truth.

#![forbid(unsafe_code)]

pub mod fault;
mod jpeg;
pub mod live;
pub mod make;
pub mod ocean;
mod pace;
pub mod panorama;
pub mod pty;
pub mod replay;
pub mod set_up;
