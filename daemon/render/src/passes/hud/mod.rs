//! The head-up display: one instanced draw of quads with one small texture. It changes about once a second: until then a layer holds it,
//! and where nothing else is drawn over the video beneath it, the video pass takes it from there while it writes the pixels. That saves
//! the frame two copies and a rendering. Otherwise it is drawn over the frame as everything else.

pub(crate) mod glyphs;
pub(crate) mod layout;

use ash::vk;
use bowwave_core::frame::scene::{PixelRect, Scene};
use glyphs::Glyphs;
use layout::{HudLayout, KINDS, text_px};
use shaders_spirv::{HUD_FRAG, HUD_VERT, interface::HudQuad};

use crate::{
    encoder::{Begin, Colour, CommandEncoder, Step},
    error::RenderError,
    frame_data::{FrameData, QUADS_MAX},
    memory::{Image, ImageShape},
    passes::{DRAWN, FORGET_READ, PassContext, SAMPLED, TextureSet},
    pipeline::{Pipeline, PipelineShape, SRGB},
    upload::upload_image,
};

/// The head-up display's pass.
pub(crate) struct HudPass {
    size: (u32, u32),
    glyphs: Glyphs,
    layout: HudLayout,
    /// Plates, shapes, glyphs.
    pipelines: [Pipeline; KINDS],
    /// What was last drawn into the layer.
    held: Vec<HudQuad>,
    layer: Image,
    /// The layer, for the video pass.
    pub(crate) overlay: TextureSet,
    atlas: TextureSet,
    _atlas: Image,
}

impl HudPass {
    pub(crate) fn new(context: &PassContext<'_>) -> Result<Self, RenderError> {
        let gpu = context.gpu;
        let (large, small) = text_px(context.size);
        let mut glyphs = Glyphs::new(large, small)?;
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
        let shape = ImageShape::new((glyphs.width, glyphs.height), vk::Format::R8_UNORM, usage);
        let atlas = Image::new(gpu, "glyphs", shape)?;
        upload_image(gpu, &atlas, &[&glyphs.coverage])?;
        glyphs.coverage = Vec::new();
        let glyphs_set = context.texture_set(atlas.view)?;
        let pipeline = |kind: u32| {
            Pipeline::new(
                gpu,
                &PipelineShape {
                    vertex_constants: &[],
                    constants: &[kind],
                    push: 0,
                    ..PipelineShape::over_screen(HUD_VERT, HUD_FRAG, &[context.frame_set, &glyphs_set.layout])
                },
            )
        };
        let pipelines = [pipeline(0)?, pipeline(1)?, pipeline(2)?];
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::SAMPLED;
        // The video pass takes its codes as whole words: a driver that runs on the processor converts slowly.
        let shape =
            ImageShape { second: Some(vk::Format::R32_UINT), ..ImageShape::new(context.size, SRGB, usage) };
        let layer = Image::new(gpu, "head-up display", shape)?;
        Ok(Self {
            held: Vec::with_capacity(QUADS_MAX),
            overlay: context.texture_set(layer.second_view)?,
            layer,
            size: context.size,
            glyphs,
            layout: HudLayout::new(context.size),
            pipelines,
            atlas: glyphs_set,
            _atlas: atlas,
        })
    }

    /// Writes this frame's quads; returns how many plates, shapes and glyphs there are.
    pub(crate) fn prepare(&mut self, data: &mut FrameData, scene: &Scene) -> [u32; KINDS] {
        data.write_quads(match &scene.guide {
            Some(guide) => self.layout.lay_out_guide(&self.glyphs, guide),
            None => self.layout.lay_out(&self.glyphs, &scene.hud),
        });
        self.layout.counts_by_kind()
    }

    /// Whether the layer holds something else than what was prepared last; from then on it counts as holding that.
    pub(crate) fn renew(&mut self) -> bool {
        let quads = self.layout.quads();
        let stale = self.held != quads;
        if stale {
            self.held.clear();
            self.held.extend_from_slice(quads);
        }
        stale
    }

    /// Draws them into the layer.
    pub(crate) fn record_layer(
        &self,
        to: CommandEncoder<'_>,
        frame: vk::DescriptorSet,
        counts: [u32; KINDS],
    ) {
        let (width, height) = self.size;
        let area = PixelRect { x: 0, y: 0, width, height };
        let was = (FORGET_READ.0 | DRAWN.0, DRAWN.1, vk::ImageLayout::UNDEFINED);
        to.barrier([Step { image: &self.layer, from: was, to: DRAWN }]);
        to.begin(area, Colour::new(self.layer.view, Begin::Zero), None);
        to.window([0.0, 0.0, width as f32, height as f32], area);
        self.record(to, frame, counts);
        to.end();
        to.barrier([Step { image: &self.layer, from: DRAWN, to: SAMPLED }]);
    }

    /// The pixels that they cover.
    pub(crate) fn rects(&self) -> impl Iterator<Item = PixelRect> {
        self.layout.plates()
    }

    /// Draws them, within a rendering to the screen.
    pub(crate) fn record(&self, to: CommandEncoder<'_>, frame: vk::DescriptorSet, counts: [u32; KINDS]) {
        let (width, height) = self.size;
        to.scissor(PixelRect { x: 0, y: 0, width, height });
        let mut first = 0;
        for (pipeline, count) in self.pipelines.iter().zip(counts) {
            to.bind(pipeline, &[frame, self.atlas.set]);
            to.draw_from(4, first, count);
            first += count;
        }
    }
}
