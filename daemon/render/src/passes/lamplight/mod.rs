//! The light of searchlight, flares and fires on the real sea and air, added over the screen: cell by cell of a grid, and, where low lamps light
//! the sea about their feet, as pools. Boats are laid over it.

pub(crate) mod plan;

use ash::vk;
use shaders_spirv::{
    LAMPLIGHT_FRAG, LAMPLIGHT_VERT, POOL_VERT, Shader,
    interface::{LamplightBlock, POOL_RINGS, POOL_SECTORS, PoolBlock},
};

use self::plan::{CellRow, LamplightPlan, Pool};
use crate::{
    encoder::CommandEncoder,
    error::RenderError,
    passes::PassContext,
    pipeline::{Pipeline, PipelineShape},
};

/// The pass.
pub(crate) struct LamplightPass {
    cells: Pipeline,
    pools: Pipeline,
}

impl LamplightPass {
    pub(crate) fn new(context: &PassContext<'_>) -> Result<Self, RenderError> {
        let lens = context.vertex_constants();
        let sets = [context.frame_set];
        let pipeline = |vertex: Shader, push: usize| {
            let shape = PipelineShape::over_screen(vertex, LAMPLIGHT_FRAG, &sets);
            Pipeline::new(context.gpu, &PipelineShape { vertex_constants: &lens, push, ..shape })
        };
        Ok(Self {
            cells: pipeline(LAMPLIGHT_VERT, size_of::<LamplightBlock>())?,
            pools: pipeline(POOL_VERT, size_of::<PoolBlock>())?,
        })
    }

    /// Draws, within a rendering to the screen that has no boats yet: these have the air's light in their own.
    pub(crate) fn record(&self, to: CommandEncoder<'_>, frame: vk::DescriptorSet, plan: &LamplightPlan) {
        to.bind(&self.cells, &[frame]);
        for CellRow { rect, block } in &plan.cells {
            to.scissor(*rect);
            to.push(&self.cells, block);
            to.draw(4, block.cells[2] as u32);
        }
        to.bind(&self.pools, &[frame]);
        for Pool { rect, block } in &plan.pools {
            to.scissor(*rect);
            to.push(&self.pools, block);
            to.draw(4, POOL_RINGS * POOL_SECTORS);
        }
    }
}
