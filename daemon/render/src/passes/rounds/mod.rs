//! Tracers, splashes and strikes over the boats: one quad each.

pub(crate) mod plan;

use shaders_spirv::{ROUND_FRAG, ROUND_HIDDEN_FRAG, ROUND_VERT};

use crate::passes::behind_hulls::Shaders;

/// Shaders of the rounds' pass.
pub(crate) const SHADERS: Shaders =
    Shaders { vertex: ROUND_VERT, open: ROUND_FRAG, hidden: ROUND_HIDDEN_FRAG };
