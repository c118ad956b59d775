//! A boat's picture by paths of light: what a matt mesh in a given sky looks like, whatever a renderer does. Nothing of the product's shading is in it; the
//! sky is the one that the product was given to draw in, looked at by direction and not as the nine polynomials that the product makes of it.

mod light;
mod picture;
mod tracer;

pub use light::{Kind, TracedLight};
pub use picture::{Component, TracedPicture, View};
