//! The own gun and ship before everything that is drawn. What the camera sees of them is kept before the first boat is blended onto it, and
//! laid back over the boats within the phantoms' outlines.

mod matte;

use ash::vk;
use bowwave_core::{
    colour::LUMINANCE,
    frame::scene::{PixelRect, Scene},
    own_ship::Phantoms,
};
use glam::Vec3;
use matte::Matte;
use shaders_spirv::{PHANTOM_FRAG, SCREEN_VERT, interface::PhantomBlock};

use crate::{
    encoder::{CommandEncoder, Step},
    error::RenderError,
    memory::{Image, ImageShape},
    passes::{COPIED_TO, FORGET_READ, PassContext, SAMPLED},
    pipeline::{Bound, Pipeline, PipelineShape, SRGB, Sampler, SetLayout},
    rects::overlap,
    target::{DrawTarget, copied_from},
    upload::upload_image,
};

/// The look of phantoms in a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PhantomLook {
    /// Recoil factor about the bore's vanishing point.
    recoil: f32,
    /// Light of lamps on a white matt thing; the last is the luminance that the picture shows of one, lit as it is.
    lit: [f32; 4],
}

impl PhantomLook {
    /// The look in `scene`, where lamps give a white matt thing that much light.
    pub(crate) fn of(scene: &Scene, lit: Vec3) -> Self {
        let white = scene.light.on_level().dot(LUMINANCE);
        Self { recoil: scene.recoil as f32, lit: lit.extend(white).to_array() }
    }
}

/// The phantoms' pass.
pub(crate) struct PhantomPass {
    pipeline: Pipeline,
    set: vk::DescriptorSet,
    block: PhantomBlock,
    /// The camera's picture of them, as it came.
    kept: Image,
    /// Pixels that they hide, each once, and where those come from.
    rects: Vec<PixelRect>,
    regions: Vec<vk::ImageCopy>,
    _distances: Image,
    _sampler: Sampler,
    _set_layout: SetLayout,
}

impl PhantomPass {
    /// For `phantoms` on the screen; `None` where nothing of them lies on it.
    pub(crate) fn new(context: &PassContext<'_>, phantoms: &Phantoms) -> Result<Option<Self>, RenderError> {
        let gpu = context.gpu;
        let Some(matte) = Matte::new(phantoms, context.size) else { return Ok(None) };
        let size = (matte.area.width, matte.area.height);
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
        let shape = ImageShape::new(size, vk::Format::R8G8_UNORM, usage);
        let distances = Image::new(gpu, "phantoms", shape)?;
        upload_image(gpu, &distances, &[matte.distances.as_flattened()])?;
        let kept = Image::new(gpu, "picture of phantoms", ImageShape::new(size, SRGB, usage))?;
        let sampler = Sampler::new(gpu, vk::Filter::LINEAR, false)?;
        let kinds = [vk::DescriptorType::COMBINED_IMAGE_SAMPLER; 2];
        let set_layout = SetLayout::new(gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        let bound = |view| Bound::Texture { view, sampler: sampler.raw, layout: SAMPLED.2 };
        let set = context.pool.set(&set_layout, &[distances.view, kept.view].map(bound))?;
        let pipeline = Pipeline::new(
            gpu,
            &PipelineShape {
                topology: vk::PrimitiveTopology::TRIANGLE_LIST,
                push: size_of::<PhantomBlock>(),
                ..PipelineShape::over_screen(SCREEN_VERT, PHANTOM_FRAG, &[&set_layout])
            },
        )?;
        let origin = (matte.area.x, matte.area.y);
        Ok(Some(Self {
            pipeline,
            set,
            block: PhantomBlock {
                origin: [origin.0 as f32, origin.1 as f32],
                size: [size.0 as f32, size.1 as f32],
                bore: phantoms.bore.as_vec2().to_array(),
                soft: matte.soft_px,
                ..PhantomBlock::default()
            },
            kept,
            regions: matte.rects.iter().map(|r| copied_from(*r, origin)).collect(),
            rects: matte.rects,
            _distances: distances,
            _sampler: sampler,
            _set_layout: set_layout,
        }))
    }

    /// Pixels that they hide, each once.
    pub(crate) fn rects(&self) -> &[PixelRect] {
        &self.rects
    }

    /// Whether anything is drawn where they are.
    pub(crate) fn hide(&self, drawn: &[PixelRect]) -> bool {
        self.rects.iter().any(|r| drawn.iter().any(|d| overlap(*r, *d).is_some()))
    }

    /// Keeps what the camera sees of them; nothing but that has been drawn.
    pub(crate) fn record_copy(&self, to: CommandEncoder<'_>, target: &DrawTarget) {
        let was = (FORGET_READ.0 | COPIED_TO.0, COPIED_TO.1, vk::ImageLayout::UNDEFINED);
        to.barrier([Step { image: &self.kept, from: was, to: COPIED_TO }]);
        target.record_copy_of(to, &self.kept, &self.regions);
    }

    /// Step of what was kept to being sampled.
    pub(crate) fn copied(&self) -> Step<'_> {
        Step { image: &self.kept, from: COPIED_TO, to: SAMPLED }
    }

    /// Lays it over all of `drawn` with that look, within a rendering to the screen.
    pub(crate) fn record(&self, to: CommandEncoder<'_>, drawn: &[PixelRect], look: &PhantomLook) {
        to.bind(&self.pipeline, &[self.set]);
        to.push(&self.pipeline, &PhantomBlock { recoil: look.recoil, lit: look.lit, ..self.block });
        for piece in self.rects.iter().flat_map(|r| drawn.iter().filter_map(|d| overlap(*r, *d))) {
            to.scissor(piece);
            to.draw(3, 1);
        }
    }
}
