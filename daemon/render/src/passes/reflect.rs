//! What waves throw back of the boats (`core::reflection`). Each boat's mirror image is collapsed to bands of height with running sums;
//! from these, cells of a few pixels get what they throw back for three brightnesses of a pixel; and each pixel takes what belongs to
//! its own brightness. Only the last step is done for every pixel.

use ash::vk;
use bowwave_core::scene::PixelRect;
use shaders_spirv::{
    BANDS_FRAG, LAYERS_FRAG, RECT_VERT, REFLECT_FRAG, SCREEN_VERT, SUMS_FRAG,
    interface::{DrawBlock, LOBE_BANDS, LOBE_COLUMNS, ReflectBlock},
};

use crate::{
    error::RenderError,
    memory::{Image, ImageShape},
    passes::{DRAWN, FORGET_READ, Making, SAMPLED, mirror::MirrorPass, water::WaterDraw},
    pipeline::{Blend, Bound, LIGHT, Pipeline, PipelineShape, SRGB, SUMS, Sampler, SetLayout},
    recorder::{Begin, Recorder, Step},
    rects::joined,
};

/// Screen pixels to a cell, as the shaders have it.
const CELL: (u32, u32) = (4, 2);

/// Pixels that belong to no boat alone, drawn at once.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ReflectDraw {
    /// First of the rectangles in the frame's list, and how many there are.
    pub(crate) first: u32,
    pub(crate) count: u32,
}

/// The pass.
pub(crate) struct ReflectPass {
    size: (u32, u32),
    bands: Image,
    sums: Image,
    /// For dark, middling and bright pixels; and the colour of what is taken away.
    layers: [Image; 4],
    to_bands: Stage,
    to_sums: Stage,
    to_layers: Stage,
    to_screen: Stage,
    _samplers: [Sampler; 2],
}

/// A pipeline with what it samples.
struct Stage {
    pipeline: Pipeline,
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
    fn new(making: &Making<'_>, shape: &StageShape<'_>) -> Result<Self, RenderError> {
        let kinds = vec![vk::DescriptorType::COMBINED_IMAGE_SAMPLER; shape.sampled.len()];
        let layout = SetLayout::new(making.gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        let set = making.pool.set(&layout, shape.sampled)?;
        let sets = [making.frame_set, &layout];
        let pipeline = Pipeline::new(
            making.gpu,
            &PipelineShape {
                vertex: shape.vertex,
                fragment: shape.fragment,
                constants: &[],
                sets: if shape.framed { &sets } else { &sets[1..] },
                push: shape.push,
                vertices: None,
                topology: if shape.vertex == RECT_VERT {
                    vk::PrimitiveTopology::TRIANGLE_STRIP
                } else {
                    vk::PrimitiveTopology::TRIANGLE_LIST
                },
                colour: shape.colour,
                targets: shape.targets,
                blend: shape.blend,
                cull: None,
                depth: false,
                samples: vk::SampleCountFlags::TYPE_1,
            },
        )?;
        Ok(Self { pipeline, set, _layout: layout })
    }
}

impl ReflectPass {
    /// `backdrop` holds the video beneath; `boats` is how many there can be.
    pub(crate) fn new(
        making: &Making<'_>,
        mirror: &MirrorPass,
        backdrop: &Image,
        boats: usize,
    ) -> Result<Self, RenderError> {
        let gpu = making.gpu;
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::SAMPLED;
        let image = |what, size, format| Image::new(gpu, what, ImageShape::new(size, format, usage));
        let rows = u32::try_from(boats.max(1) * LOBE_BANDS).unwrap_or(u32::MAX);
        let bands = image("bands of mirrored boats", (LOBE_COLUMNS, rows), LIGHT)?;
        let sums = image("sums of mirrored boats", (LOBE_COLUMNS + 1, rows), SUMS)?;
        let cells = (making.size.0.div_ceil(CELL.0), making.size.1.div_ceil(CELL.1));
        let layer = || image("layers of reflection", cells, LIGHT);
        let layers = [layer()?, layer()?, layer()?, layer()?];
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
        let to_bands = Stage::new(making, &replace)?;
        let to_sums = Stage::new(
            making,
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
            making,
            &StageShape {
                vertex: RECT_VERT,
                fragment: LAYERS_FRAG,
                sampled: &[bound(&sums, &nearest)],
                targets: layers.len(),
                blend: Blend::Add,
                ..replace
            },
        )?;
        let [dark, middle, bright, coloured] = layers.each_ref().map(|layer| bound(layer, &linear));
        let sampled = [bound(backdrop, &nearest), dark, middle, bright, coloured];
        let to_screen = Stage::new(
            making,
            &StageShape {
                vertex: RECT_VERT,
                fragment: REFLECT_FRAG,
                sampled: &sampled,
                push: size_of::<ReflectBlock>(),
                colour: SRGB,
                blend: Blend::Over,
                ..replace
            },
        )?;
        let samplers = [linear, nearest];
        let size = making.size;
        Ok(Self { size, bands, sums, layers, to_bands, to_sums, to_layers, to_screen, _samplers: samplers })
    }

    /// Finds what cells of water throw back. The mirror layer is ready to be sampled.
    pub(crate) fn record_layers(&self, to: Recorder<'_>, frame: vk::DescriptorSet, boats: &[WaterDraw]) {
        let Some(area) = boats.iter().map(|b| self.cells(b.rect)).reduce(joined) else { return };
        let was = (FORGET_READ.0 | DRAWN.0, DRAWN.1, vk::ImageLayout::UNDEFINED);
        let drawn = |image| Step { image, from: was, to: DRAWN };
        let sampled = |image| Step { image, from: DRAWN, to: SAMPLED };
        let rows = boats.iter().map(|b| (b.index + 1) * LOBE_BANDS as u32).max().unwrap_or(0);
        let layers = self.layers.each_ref();
        to.barrier([&self.bands, &self.sums].map(drawn));
        to.barrier(layers.map(drawn));
        let strip = |columns| PixelRect { x: 0, y: 0, width: columns, height: rows };
        to.begin(strip(LOBE_COLUMNS), (self.bands.view, Begin::Forget), None);
        to.bind(&self.to_bands.pipeline, &[frame, self.to_bands.set]);
        let viewport = |image: &Image| [0.0, 0.0, image.shape.width as f32, image.shape.height as f32];
        for boat in boats {
            let own = PixelRect {
                x: 0,
                y: boat.index * LOBE_BANDS as u32,
                width: LOBE_COLUMNS,
                height: LOBE_BANDS as u32,
            };
            to.window(viewport(&self.bands), own);
            to.push(&self.to_bands.pipeline, &DrawBlock { rect: [0.0; 4], index: boat.index, first: 0 });
            to.draw(3, 1);
        }
        to.end();
        to.barrier([sampled(&self.bands)]);
        to.begin(strip(LOBE_COLUMNS + 1), (self.sums.view, Begin::Forget), None);
        to.window(viewport(&self.sums), strip(LOBE_COLUMNS + 1));
        to.bind(&self.to_sums.pipeline, &[self.to_sums.set]);
        to.draw(3, 1);
        to.end();
        to.barrier([sampled(&self.sums)]);
        to.begin_all(area, layers.map(|l| (l.view, Begin::Zero)), None);
        let (width, height) = (self.size.0 as f32, self.size.1 as f32);
        to.window([0.0, 0.0, width / CELL.0 as f32, height / CELL.1 as f32], area);
        to.bind(&self.to_layers.pipeline, &[frame, self.to_layers.set]);
        for boat in boats {
            // Cells lie aligned to the rectangles, whose sides are multiples of eight pixels.
            let block = DrawBlock { rect: [0.0; 4], index: boat.index, first: boat.first };
            to.push(&self.to_layers.pipeline, &block);
            to.draw(4, boat.count);
        }
        to.end();
        to.barrier(layers.map(sampled));
    }

    /// Draws, within a rendering to the screen; `block` says how bright the sea is.
    pub(crate) fn record(
        &self,
        to: Recorder<'_>,
        frame: vk::DescriptorSet,
        draw: ReflectDraw,
        block: &ReflectBlock,
    ) {
        to.bind(&self.to_screen.pipeline, &[frame, self.to_screen.set]);
        to.push(&self.to_screen.pipeline, &ReflectBlock { first: draw.first, ..*block });
        to.draw(4, draw.count);
    }

    /// The cells that pixels of `r`, interpolated, can take from.
    fn cells(&self, r: PixelRect) -> PixelRect {
        let (width, height) = (self.layers[0].shape.width, self.layers[0].shape.height);
        let (x, y) = ((r.x / CELL.0).saturating_sub(1), (r.y / CELL.1).saturating_sub(1));
        let right = ((r.x + r.width).div_ceil(CELL.0) + 1).min(width);
        let lower = ((r.y + r.height).div_ceil(CELL.1) + 1).min(height);
        PixelRect { x, y, width: right - x, height: lower - y }
    }
}
