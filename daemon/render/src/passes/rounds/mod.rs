//! Tracers, splashes and strikes over the boats: one quad each, cut apart where a hull may stand before it.

pub(crate) mod plan;

use ash::vk;
use bowwave_core::frame::scene::PixelRect;
use shaders_spirv::{ROUND_FRAG, ROUND_HIDDEN_FRAG, ROUND_VERT, interface::DrawBlock};

use crate::{
    encoder::CommandEncoder,
    error::RenderError,
    passes::{
        PassContext,
        behind_hulls::{BehindHulls, Shaders},
        boats::BoatsPass,
    },
    rects::corners,
};

/// A piece of a round's rectangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoundDraw {
    /// Index of its block.
    pub(crate) index: u32,
    pub(crate) rect: PixelRect,
    /// Whether a hull may stand before it here.
    pub(crate) hidden: bool,
}

/// The rounds' pass.
pub(crate) struct RoundsPass(BehindHulls);

impl RoundsPass {
    /// `boats` is there if there can be any to hide rounds.
    pub(crate) fn new(context: &PassContext<'_>, boats: Option<&BoatsPass>) -> Result<Self, RenderError> {
        let shaders = Shaders {
            vertex: ROUND_VERT,
            open: ROUND_FRAG,
            hidden: ROUND_HIDDEN_FRAG,
            push: size_of::<DrawBlock>(),
        };
        Ok(Self(BehindHulls::new(context, &shaders, boats)?))
    }

    /// Draws, within a rendering to the screen.
    pub(crate) fn record(&self, to: CommandEncoder<'_>, frame: vk::DescriptorSet, draws: &[RoundDraw]) {
        for draw in draws {
            let pipeline = self.0.bind(to, frame, draw.hidden);
            to.scissor(draw.rect);
            to.push(pipeline, &DrawBlock { rect: corners(draw.rect), index: draw.index, first: 0 });
            to.draw(4, 1);
        }
    }
}
