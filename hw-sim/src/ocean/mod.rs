//! The ocean of whatever must not share code with the product: the maker of recordings and the truths that the precision studies
//! and tests hold the product against.
//!
//! **Rule: nothing here uses `bowwave-core`, the renderer or any other crate of the product, and neither of those two uses this.** No
//! test would see a mistake that both shared. `tests/ocean.rs` keeps the first half of the rule, the crates' ranks the second.
//!
//! * [`spectrum`]: dispersion, JONSWAP and Elfouhaily spectra, slopes of Cox and Munk, swell. [`random`]: hashes, streams, normal
//!   numbers. [`lattice`]: the Fourier transform that makes a tile of waves.
//! * Three surfaces of that spectrum. [`waves`]: tiles of Gaussian heights that rays are traced to; [`systems`]: nested tiles of
//!   several JONSWAP systems, moved on from picture to picture; [`looped`]: tiles whose waves all have a whole number of cycles in
//!   a recording, with sharpened crests, drawn by columns.
//! * Light. [`fresnel`]: reflectance. [`sky`]: clear or overcast, in physical units; [`cloudy`]: a clear sky with clouds that stand
//!   still. [`micro`]: slopes below the resolved waves; [`mesh`]: a boat's triangles; [`trace`]: paths of light between them.

#[cfg(test)]
pub(crate) mod table;

pub mod cloudy;
pub mod fresnel;
pub mod lattice;
pub mod looped;
pub mod mesh;
pub mod micro;
pub mod noise;
pub mod random;
pub mod sky;
pub mod spectrum;
pub mod systems;
pub mod trace;
pub mod waves;
