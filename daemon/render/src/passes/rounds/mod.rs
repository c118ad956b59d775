//! Tracers, splashes and strikes over the boats: one quad each, cut apart where a hull may stand before it, so that the boats'
//! depth is read only where this frame wrote it.

pub(crate) mod plan;

use ash::vk;
use bowwave_core::frame::scene::PixelRect;
use shaders_spirv::{ROUND_FRAG, ROUND_HIDDEN_FRAG, ROUND_VERT, Shader, interface::DrawBlock};

use crate::{
    encoder::CommandEncoder,
    error::RenderError,
    passes::{PassContext, TextureSet, boats::BoatsPass},
    pipeline::{Pipeline, PipelineShape, SetLayout},
    rects::{around_all, corners, overlap},
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

/// Cuts one round's rectangle by the pieces that hulls cover. `rest` is for its own use and keeps its memory.
pub(crate) fn pieces(
    index: u32,
    rect: PixelRect,
    hulls: &[PixelRect],
    rest: &mut Vec<PixelRect>,
    draws: &mut Vec<RoundDraw>,
) {
    draws.extend(hulls.iter().filter_map(|h| overlap(rect, *h)).map(|rect| RoundDraw {
        index,
        rect,
        hidden: true,
    }));
    around_all(rect, hulls, rest);
    draws.extend(rest.iter().map(|rect| RoundDraw { index, rect: *rect, hidden: false }));
}

/// What draws where hulls may stand before rounds.
struct Hidden {
    pipeline: Pipeline,
    depth: TextureSet,
}

/// The rounds' pass.
pub(crate) struct RoundsPass {
    open: Pipeline,
    hidden: Option<Hidden>,
}

impl RoundsPass {
    /// `boats` is there if there can be any to hide rounds.
    pub(crate) fn new(context: &PassContext<'_>, boats: Option<&BoatsPass>) -> Result<Self, RenderError> {
        let open = pipeline(context, ROUND_FRAG, &[context.frame_set])?;
        let hidden = boats.map(|boats| Hidden::new(context, boats)).transpose()?;
        Ok(Self { open, hidden })
    }

    /// Draws, within a rendering to the screen.
    pub(crate) fn record(&self, to: CommandEncoder<'_>, frame: vk::DescriptorSet, draws: &[RoundDraw]) {
        for draw in draws {
            let pipeline = match self.hidden.as_ref().filter(|_| draw.hidden) {
                Some(hidden) => {
                    to.bind(&hidden.pipeline, &[frame, hidden.depth.set]);
                    &hidden.pipeline
                }
                None => {
                    to.bind(&self.open, &[frame]);
                    &self.open
                }
            };
            to.scissor(draw.rect);
            to.push(pipeline, &DrawBlock { rect: corners(draw.rect), index: draw.index, first: 0 });
            to.draw(4, 1);
        }
    }
}

impl Hidden {
    fn new(context: &PassContext<'_>, boats: &BoatsPass) -> Result<Self, RenderError> {
        let depth = boats.hull_depth(context)?;
        let pipeline = pipeline(context, ROUND_HIDDEN_FRAG, &[context.frame_set, &depth.layout])?;
        Ok(Self { pipeline, depth })
    }
}

fn pipeline(
    context: &PassContext<'_>,
    fragment: Shader,
    sets: &[&SetLayout],
) -> Result<Pipeline, RenderError> {
    Pipeline::new(context.gpu, &PipelineShape::over_screen(ROUND_VERT, fragment, sets))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_of_a_round_is_drawn_once_and_reads_depth_only_under_hulls() {
        let r = |x, y, width, height| PixelRect { x, y, width, height };
        let round = r(5, 5, 30, 20);
        let hulls = [r(0, 0, 10, 10), r(20, 8, 10, 30), r(50, 0, 5, 5)];
        let (mut rest, mut draws) = (Vec::new(), Vec::new());
        pieces(3, round, &hulls, &mut rest, &mut draws);
        for y in 0..40 {
            for x in 0..60 {
                let holds =
                    |q: &PixelRect| (q.x..q.x + q.width).contains(&x) && (q.y..q.y + q.height).contains(&y);
                let at: Vec<_> = draws.iter().filter(|d| holds(&d.rect)).collect();
                assert_eq!(at.len(), usize::from(holds(&round)), "pixel {x} {y}");
                assert!(at.iter().all(|d| d.index == 3 && d.hidden == hulls.iter().any(holds)));
            }
        }
    }
}
