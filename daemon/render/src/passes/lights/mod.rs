//! Boats' navigation lights: points of light, and their mirror images among the boats' own.

pub(crate) mod plan;

use shaders_spirv::{LIGHT_FRAG, LIGHT_HIDDEN_FRAG, LIGHT_VERT, interface::LightBlock};

use crate::{
    error::RenderError,
    passes::{PassContext, behind_hulls::Shaders},
    pipeline::{DepthUse, LIGHT, Pipeline, PipelineShape},
};

/// Shaders of the lights' pass.
pub(crate) const SHADERS: Shaders =
    Shaders { vertex: LIGHT_VERT, open: LIGHT_FRAG, hidden: LIGHT_HIDDEN_FRAG };

/// The pipeline that adds lights to the layer of mirrored boats, where these do not hide them.
pub(crate) fn mirrored(context: &PassContext<'_>) -> Result<Pipeline, RenderError> {
    let sets = [context.frame_set];
    let shape = PipelineShape::over_screen(LIGHT_VERT, LIGHT_FRAG, &sets);
    Pipeline::new(
        context.gpu,
        &PipelineShape { push: size_of::<LightBlock>(), colour: LIGHT, depth: DepthUse::Test, ..shape },
    )
}
