//! Simulated hardware: replays recordings and makes ones with known truth.
