//! The light of the gun's searchlight on sea and air, added over the screen cell by cell of a grid.

pub(crate) mod plan;

use shaders_spirv::{BEAM_FRAG, BEAM_HIDDEN_FRAG, BEAM_VERT};

use crate::passes::behind_hulls::Shaders;

/// Shaders of the searchlight's pass.
pub(crate) const SHADERS: Shaders = Shaders { vertex: BEAM_VERT, open: BEAM_FRAG, hidden: BEAM_HIDDEN_FRAG };
