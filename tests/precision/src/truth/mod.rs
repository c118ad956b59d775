//! The truth: a CPU ray tracer of a boat on a sea, which shares no code with the trainer's reflections.
//!
//! * **Sea** ([`spectrum`], [`waves`], [`micro`]): Gaussian heights of a directional Elfouhaily or JONSWAP spectrum, in tiles made by
//!   Fourier transform, down to waves about two pixels wide; below that slopes drawn from a Gaussian with Smith's masking, so that
//!   resolved and unresolved slopes together have the variance of Cox & Munk. Where Elfouhaily's spectrum alone holds more (winds below
//!   4 m/s) its short waves are damped to that total. Waves run with the wind by the dispersion relation.
//! * **Light** ([`sky`], [`trace`]): Hosek-Wilkie or CIE overcast sky, sun with glitter, exact Fresnel with n = 1.34 at every facet, paths
//!   of several bounces over resolved and unresolved water, light out of the water that scattered once at a depth and misses what the boat
//!   takes from it. The boat is shaded by the trainer's formula.
//! * **Cells** ([`cell`], [`grid`], [`files`], [`masks`]): pictures without and with the boat from the same paths; [`study`] says what noise
//!   and resolution do to them; [`video`] films the sea alone.
//!
//! Its own error (`precision truth study` with 48, 96 and 192 paths a pixel at 60, 150 and 400 m, a quarter to an eighth of the grid's; mean FLIP in
//! the reflection's region, and the change that the boat makes there relative to the unrefined one):
//!
//! | | 60 m, state 2, overcast | 150 m, state 2, overcast | 400 m, state 3, high sun |
//! |---|---|---|---|
//! | other paths, as many | .0215, .999 | .0174, .998 | .0166, 1.048 |
//! | other paths, four times as many | .0188, .999 | .0165, .998 | .0140, 1.003 |
//! | steps along rays half as long | .0044, 1.000 | .0064, 1.002 | .0131, 1.015 |
//! | cells half as wide | .0190, .998 | .0125, 1.009 | .0165, 1.006 |
//! | waves down to half the length | .0207, .998 | .0185, 1.006 | .0247, 1.044 |
//! | waves only down to twice the length | .0256, 1.004 | .0237, .983 | .0303, 1.102 |
//! | other waves | .1089, .959 | .0716, 1.031 | .1210, 1.424 |
//!
//! So what is left is noise, but at 400 m, where waves below half a metre are not traced.
//!
//! Not in it: foam, sharpened crests and wave groups beyond linear waves, the boat's own bow wave and wake, haze, the curvature of the Earth,
//! polarisation, textures, a boat's shadow on itself, and inertia of the boat (it follows the plane that fits the water under it).

#[cfg(doc)]
use hw_sim::ocean::{micro, sky, spectrum, trace, waves};

pub mod boat;
pub mod cell;
pub mod commands;
pub mod files;
pub mod grid;
pub mod masks;
pub mod study;
pub mod video;
