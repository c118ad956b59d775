//! Waves and foam of boats under way: one ribbon along each boat's track, drawn over the sea and its reflections, beneath the boats; and
//! the foam that stands up beside a hull, after them, where no hull hides it.

use ash::vk;
use shaders_spirv::{SPRAY_FRAG, SPRAY_VERT, Shader, WAKE_FRAG, WAKE_VERT, interface::DrawBlock};

use crate::{
    error::RenderError,
    passes::{Making, SAMPLED, boats::BoatsPass},
    pipeline::{Blend, Bound, Pipeline, PipelineShape, SRGB, Sampler, SetLayout},
    recorder::Recorder,
};

/// Corners of a strip: two for each of the nine columns of `wake.vert`.
const CORNERS: u32 = 18;
/// Corners of a sheet of spray: two at each end of the sixteen steps of `spray.vert`.
const SHEET_CORNERS: u32 = 34;
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
    depth: vk::DescriptorSet,
    _sampler: Sampler,
    _set_layout: SetLayout,
}

impl WakePass {
    pub(crate) fn new(making: &Making<'_>, boats: &BoatsPass) -> Result<Self, RenderError> {
        let sampler = Sampler::new(making.gpu, vk::Filter::NEAREST, false)?;
        let kinds = [vk::DescriptorType::COMBINED_IMAGE_SAMPLER];
        let set_layout = SetLayout::new(making.gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        let bound = Bound::Texture { view: boats.depth().view, sampler: sampler.raw, layout: SAMPLED.2 };
        let depth = making.pool.set(&set_layout, &[bound])?;
        let pipeline = |vertex: Shader, fragment: Shader, sets: &[&SetLayout]| {
            Pipeline::new(
                making.gpu,
                &PipelineShape {
                    vertex,
                    fragment,
                    constants: &[],
                    sets,
                    push: size_of::<DrawBlock>(),
                    vertices: None,
                    topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
                    colour: SRGB,
                    targets: 1,
                    blend: Blend::Over,
                    cull: None,
                    depth: false,
                    samples: vk::SampleCountFlags::TYPE_1,
                },
            )
        };
        Ok(Self {
            pipeline: pipeline(WAKE_VERT, WAKE_FRAG, &[making.frame_set])?,
            spray: pipeline(SPRAY_VERT, SPRAY_FRAG, &[making.frame_set, &set_layout])?,
            depth,
            _sampler: sampler,
            _set_layout: set_layout,
        })
    }

    /// Draws, within a rendering to the screen.
    pub(crate) fn record(&self, to: Recorder<'_>, frame: vk::DescriptorSet, wakes: &[WakeDraw]) {
        to.bind(&self.pipeline, &[frame]);
        for wake in wakes.iter().filter(|w| w.strips > 0) {
            to.push(&self.pipeline, &DrawBlock { index: wake.index, ..DrawBlock::default() });
            to.draw(CORNERS, wake.strips);
        }
    }

    /// Draws what stands up beside the hulls, within a rendering to the screen. The boats' depth is ready to be sampled.
    pub(crate) fn record_spray(&self, to: Recorder<'_>, frame: vk::DescriptorSet, wakes: &[WakeDraw]) {
        to.bind(&self.spray, &[frame, self.depth]);
        for wake in wakes.iter().filter(|w| w.spray) {
            to.push(&self.spray, &DrawBlock { index: wake.index, ..DrawBlock::default() });
            to.draw(SHEET_CORNERS, SHEETS);
        }
    }
}
