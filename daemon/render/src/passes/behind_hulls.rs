//! What is drawn over the screen and may stand behind hulls: cut apart where one may stand before it, so that the boats' depth is read only
//! where this frame wrote it.

use ash::vk;
use bowwave_core::frame::scene::PixelRect;
use shaders_spirv::Shader;

use crate::{
    encoder::CommandEncoder,
    error::RenderError,
    passes::{PassContext, TextureSet, boats::BoatsPass},
    pipeline::{Pipeline, PipelineShape, SetLayout},
    rects::{around_all, overlap},
};

/// Shaders of something that may stand behind hulls.
pub(crate) struct Shaders {
    pub(crate) vertex: Shader,
    /// Where no hull can stand before it...
    pub(crate) open: Shader,
    /// ...and where one may: it compares the boats' depth.
    pub(crate) hidden: Shader,
    /// Bytes of push constants.
    pub(crate) push: usize,
}

/// The pipelines for both.
pub(crate) struct BehindHulls {
    open: Pipeline,
    hidden: Option<Hidden>,
}

struct Hidden {
    pipeline: Pipeline,
    depth: TextureSet,
}

impl BehindHulls {
    /// `boats` is there if there can be any to hide what is drawn.
    pub(crate) fn new(
        context: &PassContext<'_>,
        shaders: &Shaders,
        boats: Option<&BoatsPass>,
    ) -> Result<Self, RenderError> {
        let pipeline = |fragment: Shader, sets: &[&SetLayout]| {
            let shape = PipelineShape::over_screen(shaders.vertex, fragment, sets);
            Pipeline::new(context.gpu, &PipelineShape { push: shaders.push, ..shape })
        };
        let open = pipeline(shaders.open, &[context.frame_set])?;
        let hidden = |boats: &BoatsPass| -> Result<Hidden, RenderError> {
            let depth = boats.hull_depth(context)?;
            let pipeline = pipeline(shaders.hidden, &[context.frame_set, &depth.layout])?;
            Ok(Hidden { pipeline, depth })
        };
        Ok(Self { open, hidden: boats.map(hidden).transpose()? })
    }

    /// Binds the pipeline for a piece that a hull may stand before, or may not.
    pub(crate) fn bind(&self, to: CommandEncoder<'_>, frame: vk::DescriptorSet, hidden: bool) -> &Pipeline {
        match self.hidden.as_ref().filter(|_| hidden) {
            Some(hidden) => {
                to.bind(&hidden.pipeline, &[frame, hidden.depth.set]);
                &hidden.pipeline
            }
            None => {
                to.bind(&self.open, &[frame]);
                &self.open
            }
        }
    }
}

/// Cuts a rectangle by the pieces that hulls cover; `piece` gets each with whether a hull may stand there. `rest` is for its own use and
/// keeps its memory.
pub(crate) fn pieces(
    rect: PixelRect,
    hulls: &[PixelRect],
    rest: &mut Vec<PixelRect>,
    mut piece: impl FnMut(PixelRect, bool),
) {
    hulls.iter().filter_map(|h| overlap(rect, *h)).for_each(|rect| piece(rect, true));
    around_all(rect, hulls, rest);
    rest.iter().for_each(|rect| piece(*rect, false));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_is_drawn_once_and_reads_depth_only_under_hulls() {
        let r = |x, y, width, height| PixelRect { x, y, width, height };
        let whole = r(5, 5, 30, 20);
        let hulls = [r(0, 0, 10, 10), r(20, 8, 10, 30), r(50, 0, 5, 5)];
        let (mut rest, mut drawn) = (Vec::new(), Vec::new());
        pieces(whole, &hulls, &mut rest, |rect, hidden| drawn.push((rect, hidden)));
        for y in 0..40 {
            for x in 0..60 {
                let holds =
                    |q: &PixelRect| (q.x..q.x + q.width).contains(&x) && (q.y..q.y + q.height).contains(&y);
                let at: Vec<_> = drawn.iter().filter(|(rect, _)| holds(rect)).collect();
                assert_eq!(at.len(), usize::from(holds(&whole)), "pixel {x} {y}");
                assert!(at.iter().all(|(_, hidden)| *hidden == hulls.iter().any(holds)));
            }
        }
    }
}
