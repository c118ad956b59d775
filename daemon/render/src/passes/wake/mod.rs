//! Waves and foam of boats under way: one ribbon along each boat's track, drawn over the sea and its reflections, beneath the boats; and
//! the foam that stands up beside a hull, after them, where no hull hides it. On both falls the boat's own shadow.

pub(crate) mod plan;

use ash::vk;
use shaders_spirv::{SPRAY_FRAG, SPRAY_VERT, Shader, WAKE_FRAG, WAKE_VERT, interface::DrawBlock};

use crate::{
    encoder::CommandEncoder,
    error::RenderError,
    passes::{PassContext, TextureSet, boats},
    pipeline::{Pipeline, PipelineShape, SetLayout},
};

/// Corners of a strip: two for each of the five columns of `wake.vert`.
const CORNERS: u32 = 10;
/// Corners of a sheet of spray: two at each end of the ten steps of `spray.vert`.
const SHEET_CORNERS: u32 = 22;
/// Sheets of spray: to port, to starboard, behind.
const SHEETS: u32 = 3;

/// One boat's wake.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WakeDraw {
    /// Index of its block.
    pub(crate) index: u32,
    /// Strips from one point of the track to the next.
    pub(crate) strips: u32,
    /// Whether foam stands beside its hull, whose depth is known there.
    pub(crate) spray: bool,
}

/// The pass.
pub(crate) struct WakePass {
    pipeline: Pipeline,
    spray: Pipeline,
    depth: TextureSet,
    shadow: vk::DescriptorSet,
}

impl WakePass {
    pub(crate) fn new(
        context: &PassContext<'_>,
        (boats, shadow): (&boats::BoatsPass, &TextureSet),
    ) -> Result<Self, RenderError> {
        let depth = boats.hull_depth(context)?;
        let lens = context.vertex_constants();
        let pipeline = |vertex: Shader, fragment: Shader, sets: &[&SetLayout]| {
            let shape = PipelineShape::over_screen(vertex, fragment, sets);
            Pipeline::new(context.gpu, &PipelineShape { vertex_constants: &lens, ..shape })
        };
        Ok(Self {
            pipeline: pipeline(WAKE_VERT, WAKE_FRAG, &[context.frame_set, &shadow.layout])?,
            spray: pipeline(SPRAY_VERT, SPRAY_FRAG, &[context.frame_set, &depth.layout, &shadow.layout])?,
            depth,
            shadow: shadow.set,
        })
    }

    /// Draws, within a rendering to the screen.
    pub(crate) fn record(&self, to: CommandEncoder<'_>, frame: vk::DescriptorSet, wakes: &[WakeDraw]) {
        to.bind(&self.pipeline, &[frame, self.shadow]);
        for wake in wakes.iter().filter(|w| w.strips > 0) {
            to.push(&self.pipeline, &DrawBlock { index: wake.index, ..DrawBlock::default() });
            to.draw(CORNERS, wake.strips);
        }
    }

    /// Draws what stands up beside the hulls, within a rendering to the screen. The boats' depth is ready to be sampled.
    pub(crate) fn record_spray(&self, to: CommandEncoder<'_>, frame: vk::DescriptorSet, wakes: &[WakeDraw]) {
        to.bind(&self.spray, &[frame, self.depth.set, self.shadow]);
        for wake in wakes.iter().filter(|w| w.spray) {
            to.push(&self.spray, &DrawBlock { index: wake.index, ..DrawBlock::default() });
            to.draw(SHEET_CORNERS, SHEETS);
        }
    }
}
