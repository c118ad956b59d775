//! Rectangles over the screen that hulls may hide: cut apart where one may stand before them, so that the boats' depth is read only where this
//! frame wrote it.

use std::marker::PhantomData;

use ash::vk;
use bowwave_core::frame::scene::PixelRect;
use bytemuck::Pod;
use shaders_spirv::Shader;

use crate::{
    encoder::CommandEncoder,
    error::RenderError,
    passes::{PassContext, TextureSet, boats::BoatsPass},
    pipeline::{Pipeline, PipelineShape, SetLayout},
    rects::{around_all, overlap},
};

/// Shaders of something that hulls may hide.
pub(crate) struct Shaders {
    pub(crate) vertex: Shader,
    /// For pieces that no hull can hide...
    pub(crate) open: Shader,
    /// ...and for those that one may: it compares the boats' depth.
    pub(crate) hidden: Shader,
}

/// A piece of a rectangle, with its push constants.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HullPiece<T> {
    pub(crate) rect: PixelRect,
    /// A hull may stand before it.
    pub(crate) hidden: bool,
    pub(crate) block: T,
}

/// A pass of such rectangles, whose push constants are a `T`.
pub(crate) struct BehindHulls<T> {
    open: Pipeline,
    hidden: Option<Hidden>,
    push: PhantomData<T>,
}

struct Hidden {
    pipeline: Pipeline,
    depth: TextureSet,
}

impl<T: Pod> BehindHulls<T> {
    /// `boats` is there if there can be any to hide what is drawn.
    pub(crate) fn new(
        context: &PassContext<'_>,
        shaders: &Shaders,
        boats: Option<&BoatsPass>,
    ) -> Result<Self, RenderError> {
        let pipeline = |fragment: Shader, sets: &[&SetLayout]| {
            let shape = PipelineShape::over_screen(shaders.vertex, fragment, sets);
            Pipeline::new(context.gpu, &PipelineShape { push: size_of::<T>(), ..shape })
        };
        let open = pipeline(shaders.open, &[context.frame_set])?;
        let hidden = |boats: &BoatsPass| -> Result<Hidden, RenderError> {
            let depth = boats.hull_depth(context)?;
            let pipeline = pipeline(shaders.hidden, &[context.frame_set, &depth.layout])?;
            Ok(Hidden { pipeline, depth })
        };
        Ok(Self { open, hidden: boats.map(hidden).transpose()?, push: PhantomData })
    }

    /// The same, where it is needed at all.
    pub(crate) fn when(
        is_needed: bool,
        context: &PassContext<'_>,
        shaders: &Shaders,
        boats: Option<&BoatsPass>,
    ) -> Result<Option<Self>, RenderError> {
        is_needed.then(|| Self::new(context, shaders, boats)).transpose()
    }

    /// Draws, within a rendering to the screen.
    pub(crate) fn record(&self, to: CommandEncoder<'_>, frame: vk::DescriptorSet, pieces: &[HullPiece<T>]) {
        for piece in pieces {
            let pipeline = self.bind(to, frame, piece.hidden);
            to.scissor(piece.rect);
            to.push(pipeline, &piece.block);
            to.draw(4, 1);
        }
    }

    fn bind(&self, to: CommandEncoder<'_>, frame: vk::DescriptorSet, hidden: bool) -> &Pipeline {
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
