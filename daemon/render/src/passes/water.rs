//! The mirrored layer distorted by the video and blended onto the sea, and the boats' shadows: one quad for each boat, farthest
//! first, within the rectangle that its reflection can reach.

use ash::vk;
use bowwave_core::scene::{PixelRect, ReflectionMethod, ShadowLevel, Water};
use shaders_spirv::{RECT_VERT, WATER_FRAG, interface::DrawBlock};

use crate::{
    error::RenderError,
    memory::{Image, ImageShape},
    passes::{COPIED_TO, FORGET_READ, Making, SAMPLED, mirror::MirrorPass},
    pipeline::{
        Blend, Bound, Pipeline, PipelineShape, Recorder, SRGB, Sampler, SetLayout, Step, UNORM, corners,
    },
};

/// A boat's rectangle of water.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WaterDraw {
    /// Index of its block.
    pub(crate) index: u32,
    pub(crate) rect: PixelRect,
}

/// One compiled way to mirror.
struct Variant {
    method: ReflectionMethod,
    shadow: ShadowLevel,
    pipeline: Pipeline,
}

/// The water pass.
pub(crate) struct WaterPass {
    variants: Vec<Variant>,
    /// The video beneath the reflections, as codes: what the shader compares, while it draws to the screen.
    pub(crate) backdrop: Image,
    set: vk::DescriptorSet,
    _samplers: [Sampler; 2],
    _set_layout: SetLayout,
}

impl WaterPass {
    /// `mirror` is there unless only shadows are wanted.
    pub(crate) fn new(
        making: &Making<'_>,
        mirror: Option<&MirrorPass>,
        waters: &[(ReflectionMethod, ShadowLevel)],
    ) -> Result<Self, RenderError> {
        let gpu = making.gpu;
        let compares = waters.iter().any(|(method, _)| Self::reads_video(*method));
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
        let size = if compares { making.size } else { (1, 1) };
        let backdrop = Image::new(gpu, "video beneath reflections", ImageShape::new(size, UNORM, usage))?;
        let samplers =
            [Sampler::new(gpu, vk::Filter::NEAREST, false)?, Sampler::new(gpu, vk::Filter::LINEAR, false)?];
        let kinds = [vk::DescriptorType::COMBINED_IMAGE_SAMPLER; 2];
        let set_layout = SetLayout::new(gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        let layout = SAMPLED.2;
        // Variants that read no mirror layer still name one.
        let mirror_view = mirror.map_or(backdrop.view, |m| m.colour.view);
        let bound = [
            Bound::Texture { view: backdrop.view, sampler: samplers[0].raw, layout },
            Bound::Texture { view: mirror_view, sampler: samplers[1].raw, layout },
        ];
        let set = making.pool.set(&set_layout, &bound)?;
        let mut variants = Vec::with_capacity(waters.len());
        for (method, shadow) in waters {
            let pipeline = Pipeline::new(
                gpu,
                &PipelineShape {
                    vertex: RECT_VERT,
                    fragment: WATER_FRAG,
                    constants: &[method_constant(*method), shadow_constant(*shadow)],
                    sets: &[making.frame_set, &set_layout],
                    push: size_of::<DrawBlock>(),
                    vertices: None,
                    topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
                    colour: SRGB,
                    blend: Blend::Over,
                    depth: false,
                    samples: vk::SampleCountFlags::TYPE_1,
                },
            )?;
            variants.push(Variant { method: *method, shadow: *shadow, pipeline });
        }
        Ok(Self { variants, backdrop, set, _samplers: samplers, _set_layout: set_layout })
    }

    /// Whether a method compares colours of the video.
    pub(crate) fn reads_video(method: ReflectionMethod) -> bool {
        matches!(method, ReflectionMethod::Full | ReflectionMethod::FullAsPrinted)
    }

    /// Whether this way to mirror was compiled.
    pub(crate) fn has(&self, water: Water) -> bool {
        self.variant(water).is_some()
    }

    fn variant(&self, water: Water) -> Option<&Variant> {
        self.variants.iter().find(|v| (v.method, v.shadow) == (water.method, water.shadow))
    }

    /// Step of the backdrop from what the frame before did to being copied to.
    pub(crate) fn before(&self) -> Step<'_> {
        let was = (FORGET_READ.0 | COPIED_TO.0, COPIED_TO.1, vk::ImageLayout::UNDEFINED);
        Step { image: &self.backdrop, from: was, to: COPIED_TO }
    }

    /// Step of the backdrop to being sampled.
    pub(crate) fn between(&self) -> Step<'_> {
        Step { image: &self.backdrop, from: COPIED_TO, to: SAMPLED }
    }

    /// Draws, within a rendering to the screen.
    pub(crate) fn record(
        &self,
        to: Recorder<'_>,
        frame: vk::DescriptorSet,
        water: Water,
        boats: &[WaterDraw],
    ) {
        let Some(variant) = self.variant(water) else { return };
        to.bind(&variant.pipeline, &[frame, self.set]);
        for boat in boats {
            to.scissor(boat.rect);
            to.push(&variant.pipeline, &DrawBlock { rect: corners(boat.rect), index: boat.index });
            to.draw(4, 1);
        }
    }
}

fn method_constant(method: ReflectionMethod) -> u32 {
    match method {
        ReflectionMethod::Off => 0,
        ReflectionMethod::Mirror => 1,
        ReflectionMethod::FullAsPrinted => 2,
        ReflectionMethod::Full => 3,
    }
}

fn shadow_constant(shadow: ShadowLevel) -> u32 {
    match shadow {
        ShadowLevel::None => 0,
        ShadowLevel::Gradual => 1,
        ShadowLevel::Strong => 2,
    }
}
