//! What the sea does to the light of a boat. [`Table`] says, for a sea and a line of sight, how much of what stands how high at
//! which distance a pixel of water throws towards the eye, and how much of the sky's light the boat takes from it; [`Lobes`] is that for one
//! boat; [`compose`] draws with it, as the GPU's shaders do.
//!
//! The table was made by following rays over patches of sea (`examples/bake-reflection`).

mod compose;
pub mod grid;
mod lobes;
mod table;
mod tones;

pub use compose::{Billboard, HALF_WIDTH_MIN_PX, Place, compose};
pub use lobes::{BANDS, Lobe, Lobes, STEPS, Seen, water_light};
pub use table::{SKY_SINES, SeaLobes, SkyLight, Table, encode};
pub use tones::{Sample, SeaTones};
