//! What waves throw back of the boats (`core::reflection`). Each boat's mirror image is collapsed to bands of height with running sums;
//! from these a small grid of places across the hull and away from it gets what water there throws back and how that changes with a
//! pixel's brightness; and each pixel takes what belongs to its place and its own brightness. Only the last step is done for every pixel.

pub(crate) mod contact;
pub(crate) mod lobes;

use ash::vk;
use bowwave_core::frame::scene::PixelRect;
use shaders_spirv::{
    BANDS_FRAG, LAYERS_FRAG, REFLECT_FRAG, REFLECT_VERT, SCREEN_VERT, SUMS_FRAG,
    interface::{DrawBlock, LAYER_COLUMNS, LOBE_BANDS, LOBE_COLUMNS, LOBE_STEPS, LobeBlock, ReflectBlock},
};

use crate::{
    encoder::{Begin, Colour, CommandEncoder, Step},
    error::RenderError,
    memory::{Image, ImageShape},
    passes::{DRAWN, FORGET_READ, PassContext, SAMPLED, mirror::MirrorPass, water::WaterDraw},
    pipeline::{
        Blend, Bound, DepthUse, LIGHT, Pipeline, PipelineShape, SRGB, SUMS, Sampler, SetLayout, UNORM,
    },
};

/// A boat's strips of water, and what is thrown back there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReflectDraw {
    pub(crate) block: ReflectBlock,
    pub(crate) strips: u32,
}

/// The pass.
pub(crate) struct ReflectPass {
    bands: Image,
    sums: Image,
    /// What is thrown back, and what is taken away.
    layers: [Image; 2],
    to_bands: Stage,
    to_sums: Stage,
    to_layers: Stage,
    to_screen: Stage,
    _samplers: [Sampler; 2],
}

/// The boats of a frame whose lobes are drawn.
pub(crate) struct LobeDraws<'a> {
    /// The frame's set.
    pub(crate) frame: vk::DescriptorSet,
    pub(crate) boats: &'a [WaterDraw],
    /// One for each boat.
    pub(crate) lobes: &'a [LobeBlock],
}

impl LobeDraws<'_> {
    /// Bands, steps, columns of its picture and columns of its layers, of each boat.
    fn sizes(&self) -> impl Iterator<Item = [u32; 4]> {
        self.lobes.iter().map(|l| l.sizes.map(i32::unsigned_abs))
    }
}

/// A pipeline with what it samples.
struct Stage {
    pipeline: Pipeline,
    /// Whether it reads the frame's blocks, and which boat's.
    framed: bool,
    set: vk::DescriptorSet,
    _layout: SetLayout,
}

/// What tells the stages apart.
struct StageShape<'a> {
    vertex: shaders_spirv::Shader,
    fragment: shaders_spirv::Shader,
    sampled: &'a [Bound],
    framed: bool,
    push: usize,
    colour: vk::Format,
    targets: usize,
    blend: Blend,
}

impl Stage {
    fn new(context: &PassContext<'_>, shape: &StageShape<'_>) -> Result<Self, RenderError> {
        let kinds = vec![vk::DescriptorType::COMBINED_IMAGE_SAMPLER; shape.sampled.len()];
        let layout = SetLayout::new(context.gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        let set = context.pool.set(&layout, shape.sampled)?;
        let sets = [context.frame_set, &layout];
        let pipeline = Pipeline::new(
            context.gpu,
            &PipelineShape {
                vertex: shape.vertex,
                fragment: Some(shape.fragment),
                vertex_constants: &[],
                constants: &[],
                sets: if shape.framed { &sets } else { &sets[1..] },
                push: shape.push,
                vertices: None,
                topology: if shape.vertex == REFLECT_VERT {
                    vk::PrimitiveTopology::TRIANGLE_STRIP
                } else {
                    vk::PrimitiveTopology::TRIANGLE_LIST
                },
                colour: shape.colour,
                targets: shape.targets,
                blend: shape.blend,
                cull: None,
                depth: DepthUse::None,
                samples: vk::SampleCountFlags::TYPE_1,
            },
        )?;
        Ok(Self { pipeline, framed: shape.framed, set, _layout: layout })
    }

    /// Draws strips of `columns` by `rows` at most into `images`, of each boat as many columns and rows as `sizes` says.
    fn record_strips<'a, const N: usize>(
        &self,
        to: CommandEncoder<'_>,
        draws: &LobeDraws<'_>,
        images: [&'a Image; N],
        (columns, rows): (u32, usize),
        sizes: impl Iterator<Item = [u32; 2]>,
    ) -> Option<[Step<'a>; N]> {
        let height = draws.boats.iter().map(|b| (b.index + 1) * rows as u32).max()?;
        let area = PixelRect { x: 0, y: 0, width: columns, height };
        to.begin_all(area, images.map(|image| Colour::new(image.view, Begin::Forget)), None);
        let sets = [draws.frame, self.set];
        to.bind(&self.pipeline, if self.framed { &sets } else { &sets[1..] });
        let shape = &images.first()?.shape;
        let viewport = [0.0, 0.0, shape.width as f32, shape.height as f32];
        for (boat, [width, height]) in draws.boats.iter().zip(sizes) {
            to.window(viewport, PixelRect { x: 0, y: boat.index * rows as u32, width, height });
            if self.framed {
                to.push(&self.pipeline, &DrawBlock { rect: [0.0; 4], index: boat.index, first: 0 });
            }
            to.draw(3, 1);
        }
        to.end();
        Some(images.map(|image| Step { image, from: DRAWN, to: SAMPLED }))
    }
}

impl ReflectPass {
    /// `backdrop` holds the video beneath; `boats` is how many there can be.
    pub(crate) fn new(
        context: &PassContext<'_>,
        mirror: &MirrorPass,
        backdrop: &Image,
        boats: usize,
    ) -> Result<Self, RenderError> {
        let gpu = context.gpu;
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::SAMPLED;
        let image = |what, size, format| Image::new(gpu, what, ImageShape::new(size, format, usage));
        let rows = u32::try_from(boats.max(1) * LOBE_BANDS).unwrap_or(u32::MAX);
        let bands = image("bands of mirrored boats", (LOBE_COLUMNS, rows), LIGHT)?;
        let sums = image("sums of mirrored boats", (LOBE_COLUMNS + 1, rows), SUMS)?;
        let steps = u32::try_from(boats.max(1) * LOBE_STEPS).unwrap_or(u32::MAX);
        // Of eight bits: a driver that runs on the processor filters these several times as fast as others.
        let layer = || image("layers of reflection", (LAYER_COLUMNS, steps), UNORM);
        let layers = [layer()?, layer()?];
        let linear = Sampler::new(gpu, vk::Filter::LINEAR, false)?;
        let nearest = Sampler::new(gpu, vk::Filter::NEAREST, false)?;
        let bound = |image: &Image, sampler: &Sampler| Bound::Texture {
            view: image.view,
            sampler: sampler.raw,
            layout: SAMPLED.2,
        };
        let replace = StageShape {
            vertex: SCREEN_VERT,
            fragment: BANDS_FRAG,
            sampled: &[bound(&mirror.colour, &linear)],
            framed: true,
            push: size_of::<DrawBlock>(),
            colour: LIGHT,
            targets: 1,
            blend: Blend::Replace,
        };
        let to_bands = Stage::new(context, &replace)?;
        let to_sums = Stage::new(
            context,
            &StageShape {
                fragment: SUMS_FRAG,
                sampled: &[bound(&bands, &nearest)],
                framed: false,
                push: 0,
                colour: SUMS,
                ..replace
            },
        )?;
        let to_layers = Stage::new(
            context,
            &StageShape {
                fragment: LAYERS_FRAG,
                sampled: &[bound(&sums, &nearest)],
                colour: UNORM,
                targets: layers.len(),
                ..replace
            },
        )?;
        let [thrown, taken] = layers.each_ref().map(|layer| bound(layer, &linear));
        let sampled = [bound(backdrop, &nearest), thrown, taken];
        let to_screen = Stage::new(
            context,
            &StageShape {
                vertex: REFLECT_VERT,
                fragment: REFLECT_FRAG,
                sampled: &sampled,
                push: size_of::<ReflectBlock>(),
                colour: SRGB,
                blend: Blend::Over,
                ..replace
            },
        )?;
        let samplers = [linear, nearest];
        Ok(Self { bands, sums, layers, to_bands, to_sums, to_layers, to_screen, _samplers: samplers })
    }

    /// Steps from what the frame before did to being drawn.
    pub(crate) fn before(&self) -> [Step<'_>; 4] {
        let was = (FORGET_READ.0 | DRAWN.0, DRAWN.1, vk::ImageLayout::UNDEFINED);
        let [thrown, taken] = &self.layers;
        [&self.bands, &self.sums, thrown, taken].map(|image| Step { image, from: was, to: DRAWN })
    }

    /// Collapses the mirrored boats, whose layer is ready to be sampled, to bands.
    pub(crate) fn record_bands(
        &self,
        to: CommandEncoder<'_>,
        draws: &LobeDraws<'_>,
    ) -> Option<[Step<'_>; 1]> {
        let sizes = draws.sizes().map(|[bands, _, columns, _]| [columns, bands]);
        self.to_bands.record_strips(to, draws, [&self.bands], (LOBE_COLUMNS, LOBE_BANDS), sizes)
    }

    /// Sums the bands, which are ready to be sampled.
    pub(crate) fn record_sums(&self, to: CommandEncoder<'_>, draws: &LobeDraws<'_>) -> Option<[Step<'_>; 1]> {
        let sizes = draws.sizes().map(|[bands, _, columns, _]| [columns + 1, bands]);
        self.to_sums.record_strips(to, draws, [&self.sums], (LOBE_COLUMNS + 1, LOBE_BANDS), sizes)
    }

    /// Finds what water throws back from the sums, which are ready to be sampled.
    pub(crate) fn record_layers(
        &self,
        to: CommandEncoder<'_>,
        draws: &LobeDraws<'_>,
    ) -> Option<[Step<'_>; 2]> {
        let (layers, sizes) =
            (self.layers.each_ref(), draws.sizes().map(|[_, steps, _, columns]| [columns, steps]));
        self.to_layers.record_strips(to, draws, layers, (LAYER_COLUMNS, LOBE_STEPS), sizes)
    }

    /// Draws, within a rendering to the screen.
    pub(crate) fn record(&self, to: CommandEncoder<'_>, frame: vk::DescriptorSet, boats: &[ReflectDraw]) {
        to.bind(&self.to_screen.pipeline, &[frame, self.to_screen.set]);
        let shape = &self.layers[0].shape;
        let texel = [1.0 / shape.width as f32, 1.0 / shape.height as f32];
        for boat in boats {
            to.push(&self.to_screen.pipeline, &ReflectBlock { texel, ..boat.block });
            to.draw(4, boat.strips);
        }
    }
}
