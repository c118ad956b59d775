//! The truth: a CPU ray tracer of a boat on a sea, which shares no code with the trainer's reflections.
//!
//! * **Sea** ([`spectrum`], [`field`], [`micro`]): Gaussian heights of a directional Elfouhaily or JONSWAP spectrum, in tiles made by
//!   Fourier transform, down to waves about two pixels wide; below that slopes drawn from a Gaussian with Smith's masking, so that
//!   resolved and unresolved slopes together have the variance of Cox & Munk. Where Elfouhaily's spectrum alone holds more (winds below
//!   4 m/s) its short waves are damped to that total. Waves run with the wind by the dispersion relation.
//! * **Light** ([`sky`], [`trace`]): Hosek-Wilkie or CIE overcast sky, sun with glitter, exact Fresnel with n = 1.34 at every facet, paths
//!   of several bounces over resolved and unresolved water, light out of the water that scattered once at a depth and misses what the boat
//!   takes from it. The boat is shaded by the trainer's formula.
//! * **Cells** ([`cell`], [`grid`], [`files`], [`masks`]): pictures without and with the boat from the same paths; [`study`] says what noise
//!   and resolution do to them; [`video`] films the sea alone.
//!
//! Not in it: foam, sharpened crests and wave groups beyond linear waves, the boat's own bow wave and wake, haze, the curvature of the Earth,
//! polarisation, textures, a boat's shadow on itself, and inertia of the boat (it follows the plane that fits the water under it).

pub mod boat;
pub mod cell;
pub mod field;
pub mod files;
pub mod grid;
pub mod masks;
pub mod mesh;
pub mod micro;
pub mod rng;
pub mod sky;
pub mod spectrum;
pub mod study;
pub mod trace;
pub mod video;
