//! Boats' navigation lights: points of light, and their mirror images among the boats' own.

pub(crate) mod plan;

use ash::vk;
use bowwave_core::frame::scene::PixelRect;
use shaders_spirv::{LIGHT_FRAG, LIGHT_HIDDEN_FRAG, LIGHT_VERT, interface::LightBlock};

use crate::{
    encoder::CommandEncoder,
    error::RenderError,
    passes::{
        PassContext,
        behind_hulls::{BehindHulls, Shaders},
        boats::BoatsPass,
    },
    pipeline::{DepthUse, LIGHT, Pipeline, PipelineShape},
};

/// A piece of what a light reaches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightDraw {
    pub(crate) block: LightBlock,
    pub(crate) rect: PixelRect,
    /// Whether a hull may stand before it here.
    pub(crate) hidden: bool,
}

/// The lights' pass.
pub(crate) struct LightsPass(BehindHulls);

impl LightsPass {
    /// `boats` is there if there can be any to hide lights.
    pub(crate) fn new(context: &PassContext<'_>, boats: Option<&BoatsPass>) -> Result<Self, RenderError> {
        let shaders = Shaders {
            vertex: LIGHT_VERT,
            open: LIGHT_FRAG,
            hidden: LIGHT_HIDDEN_FRAG,
            push: size_of::<LightBlock>(),
        };
        Ok(Self(BehindHulls::new(context, &shaders, boats)?))
    }

    /// Draws, within a rendering to the screen.
    pub(crate) fn record(&self, to: CommandEncoder<'_>, frame: vk::DescriptorSet, draws: &[LightDraw]) {
        for draw in draws {
            let pipeline = self.0.bind(to, frame, draw.hidden);
            to.scissor(draw.rect);
            to.push(pipeline, &draw.block);
            to.draw(4, 1);
        }
    }
}

/// The pipeline that adds lights to the layer of mirrored boats, where these do not hide them.
pub(crate) fn mirrored(context: &PassContext<'_>) -> Result<Pipeline, RenderError> {
    let sets = [context.frame_set];
    let shape = PipelineShape::over_screen(LIGHT_VERT, LIGHT_FRAG, &sets);
    Pipeline::new(
        context.gpu,
        &PipelineShape { push: size_of::<LightBlock>(), colour: LIGHT, depth: DepthUse::Test, ..shape },
    )
}
