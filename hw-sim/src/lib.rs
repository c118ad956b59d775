//! Simulated hardware: replays recordings and makes ones with known truth.

#![forbid(unsafe_code)]

pub mod fault;
pub mod make;
pub mod ocean;
pub mod pty;
pub mod replay;
pub mod set_up;
