//! Simulated hardware: replays recordings and makes ones with known truth.

pub mod fault;
pub mod make;
pub mod ocean;
pub mod pty;
pub mod replay;
