//! The head-up display: one instanced draw of quads with one small texture.

use ash::vk;
use bowwave_core::scene::{Hud, PixelRect};
use shaders_spirv::{HUD_FRAG, HUD_VERT};

use crate::{
    error::RenderError,
    frame_data::FrameData,
    glyphs::Glyphs,
    hud_layout::{HudLayout, KINDS, text_px},
    memory::{Image, ImageShape},
    passes::Making,
    pipeline::{Blend, Bound, Pipeline, PipelineShape, SRGB, Sampler, SetLayout},
    recorder::Recorder,
    upload::upload_image,
};

/// The head-up display's pass.
pub(crate) struct HudPass {
    size: (u32, u32),
    glyphs: Glyphs,
    layout: HudLayout,
    /// Plates, shapes, glyphs.
    pipelines: [Pipeline; KINDS],
    set: vk::DescriptorSet,
    _atlas: Image,
    _sampler: Sampler,
    _set_layout: SetLayout,
}

impl HudPass {
    pub(crate) fn new(making: &Making<'_>) -> Result<Self, RenderError> {
        let gpu = making.gpu;
        let (large, small) = text_px(making.size);
        let mut glyphs = Glyphs::new(large, small)?;
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
        let shape = ImageShape::new((glyphs.width, glyphs.height), vk::Format::R8_UNORM, usage);
        let atlas = Image::new(gpu, "glyphs", shape)?;
        upload_image(gpu, &atlas, &[&glyphs.coverage])?;
        glyphs.coverage = Vec::new();
        let sampler = Sampler::new(gpu, vk::Filter::NEAREST, false)?;
        let kinds = [vk::DescriptorType::COMBINED_IMAGE_SAMPLER];
        let set_layout = SetLayout::new(gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        let layout = vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL;
        let bound = Bound::Texture { view: atlas.view, sampler: sampler.raw, layout };
        let set = making.pool.set(&set_layout, &[bound])?;
        let pipeline = |kind: u32| {
            Pipeline::new(
                gpu,
                &PipelineShape {
                    vertex: HUD_VERT,
                    fragment: HUD_FRAG,
                    constants: &[kind],
                    sets: &[making.frame_set, &set_layout],
                    push: 0,
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
        let pipelines = [pipeline(0)?, pipeline(1)?, pipeline(2)?];
        Ok(Self {
            size: making.size,
            glyphs,
            layout: HudLayout::new(making.size),
            pipelines,
            set,
            _atlas: atlas,
            _sampler: sampler,
            _set_layout: set_layout,
        })
    }

    /// Writes this frame's quads; returns how many plates, shapes and glyphs there are.
    pub(crate) fn prepare(&mut self, data: &mut FrameData, hud: &Hud) -> [u32; KINDS] {
        data.write_quads(self.layout.lay_out(&self.glyphs, hud));
        self.layout.counts_by_kind()
    }

    /// The pixels that they cover.
    pub(crate) fn rects(&self) -> impl Iterator<Item = PixelRect> {
        self.layout.plates()
    }

    /// Draws them, within a rendering to the screen.
    pub(crate) fn record(&self, to: Recorder<'_>, frame: vk::DescriptorSet, counts: [u32; KINDS]) {
        let (width, height) = self.size;
        to.scissor(PixelRect { x: 0, y: 0, width, height });
        let mut first = 0;
        for (pipeline, count) in self.pipelines.iter().zip(counts) {
            to.bind(pipeline, &[frame, self.set]);
            to.draw_from(4, first, count);
            first += count;
        }
    }
}
