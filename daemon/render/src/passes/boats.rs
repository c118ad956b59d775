//! The boats: meshes into a multisampled layer of their own, within the rectangles that their hulls can cover, then the mean of
//! each pixel's samples over the video in linear light.

use ash::vk;
use bowwave_core::{model::ModelId, scene::PixelRect};
use shaders_spirv::{
    BOAT_FRAG, BOAT_VERT, COMPOSITE_FRAG, RECT_VERT,
    interface::{DrawBlock, MeshVertex},
};

use crate::{
    error::RenderError,
    memory::{Image, ImageShape},
    meshes::Meshes,
    passes::{DEPTH_TESTED, DRAWN, FORGET_READ, Making, SAMPLED},
    pipeline::{
        Begin, Blend, Bound, DEPTH, Pipeline, PipelineShape, Recorder, SAMPLES, SRGB, Sampler, SetLayout,
        Step, corners, joined,
    },
};

/// A boat as the passes draw it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoatDraw {
    pub(crate) model: ModelId,
    /// Index of its block.
    pub(crate) index: u32,
    /// The pixels that it can cover.
    pub(crate) rect: PixelRect,
}

/// Pipelines for meshes with and without a texture, and what draws with them.
pub(crate) struct BoatPipelines {
    plain: Pipeline,
    textured: Option<Pipeline>,
}

impl BoatPipelines {
    pub(crate) fn new(
        making: &Making<'_>,
        meshes: &Meshes,
        samples: vk::SampleCountFlags,
        any_textured: bool,
    ) -> Result<Self, RenderError> {
        let attributes = [
            (vk::Format::R32G32B32_SFLOAT, 0),
            (vk::Format::R32G32B32_SFLOAT, 12),
            (vk::Format::R32G32_SFLOAT, 24),
            (vk::Format::R32G32B32_SFLOAT, 32),
        ];
        let make = |textured: bool| {
            Pipeline::new(
                making.gpu,
                &PipelineShape {
                    vertex: BOAT_VERT,
                    fragment: BOAT_FRAG,
                    constants: &[u32::from(textured), samples.as_raw()],
                    sets: &[making.frame_set, &meshes.skin_layout],
                    push: size_of::<DrawBlock>(),
                    vertices: Some((size_of::<MeshVertex>() as u32, &attributes)),
                    topology: vk::PrimitiveTopology::TRIANGLE_LIST,
                    colour: SRGB,
                    blend: Blend::Replace,
                    depth: true,
                    samples,
                },
            )
        };
        Ok(Self { plain: make(false)?, textured: any_textured.then(|| make(true)).transpose()? })
    }

    /// Draws one boat's mesh, within a rendering with depth. The shared buffers are bound.
    pub(crate) fn draw(
        &self,
        to: Recorder<'_>,
        frame: vk::DescriptorSet,
        meshes: &Meshes,
        model: ModelId,
        index: u32,
    ) {
        let block = DrawBlock { rect: [0.0; 4], index };
        let Some((skin, textured)) = meshes.skin(model) else { return };
        let pipeline = self.textured.as_ref().filter(|_| textured).unwrap_or(&self.plain);
        to.bind(pipeline, &[frame, skin]);
        to.push(pipeline, &block);
        meshes.draw(to, model);
    }
}

/// The boats' pass.
pub(crate) struct BoatsPass {
    size: (u32, u32),
    colour: Image,
    depth: Image,
    pipelines: BoatPipelines,
    composite: Pipeline,
    set: vk::DescriptorSet,
    _sampler: Sampler,
    _set_layout: SetLayout,
}

impl BoatsPass {
    pub(crate) fn new(making: &Making<'_>, meshes: &Meshes, any_textured: bool) -> Result<Self, RenderError> {
        let gpu = making.gpu;
        let layer =
            |format, usage| ImageShape { samples: SAMPLES, ..ImageShape::new(making.size, format, usage) };
        let sampled = vk::ImageUsageFlags::SAMPLED;
        let colour =
            Image::new(gpu, "boats' layer", layer(SRGB, vk::ImageUsageFlags::COLOR_ATTACHMENT | sampled))?;
        let depth = Image::new(
            gpu,
            "boats' depth",
            layer(DEPTH, vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | sampled),
        )?;
        let pipelines = BoatPipelines::new(making, meshes, SAMPLES, any_textured)?;
        let sampler = Sampler::new(gpu, vk::Filter::NEAREST, false)?;
        let kinds = [vk::DescriptorType::COMBINED_IMAGE_SAMPLER];
        let set_layout = SetLayout::new(gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        let bound = Bound::Texture { view: colour.view, sampler: sampler.raw, layout: SAMPLED.2 };
        let set = making.pool.set(&set_layout, &[bound])?;
        let composite = Pipeline::new(
            gpu,
            &PipelineShape {
                vertex: RECT_VERT,
                fragment: COMPOSITE_FRAG,
                constants: &[SAMPLES.as_raw()],
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
        Ok(Self {
            size: making.size,
            colour,
            depth,
            pipelines,
            composite,
            set,
            _sampler: sampler,
            _set_layout: set_layout,
        })
    }

    /// Steps of the layer's images from what the frame before did to being drawn.
    pub(crate) fn before(&self) -> [Step<'_>; 2] {
        let was_depth = (DEPTH_TESTED.0 | FORGET_READ.0, DEPTH_TESTED.1, vk::ImageLayout::UNDEFINED);
        let was_colour = (FORGET_READ.0 | DRAWN.0, DRAWN.1, vk::ImageLayout::UNDEFINED);
        [
            Step { image: &self.colour, from: was_colour, to: DRAWN },
            Step { image: &self.depth, from: was_depth, to: DEPTH_TESTED },
        ]
    }

    /// Steps of the layer from being drawn to being composited, and of its depth to being compared.
    pub(crate) fn between(&self) -> [Step<'_>; 2] {
        [
            Step { image: &self.colour, from: DRAWN, to: SAMPLED },
            Step { image: &self.depth, from: DEPTH_TESTED, to: SAMPLED },
        ]
    }

    /// Depth of the layer, valid within the hulls' rectangles.
    pub(crate) fn depth(&self) -> &Image {
        &self.depth
    }

    /// Draws the boats into the layer. Only their rectangles are cleared and drawn to.
    pub(crate) fn record_layer(
        &self,
        to: Recorder<'_>,
        frame: vk::DescriptorSet,
        meshes: &Meshes,
        boats: &[BoatDraw],
    ) {
        let Some(area) = boats.iter().map(|b| b.rect).reduce(joined) else { return };
        to.begin(area, (self.colour.view, Begin::Forget), Some((self.depth.view, Begin::Forget)));
        let (width, height) = self.size;
        to.window([0.0, 0.0, width as f32, height as f32], area);
        to.clear(boats.iter().map(|b| b.rect));
        meshes.bind(to);
        for boat in boats {
            to.scissor(boat.rect);
            self.pipelines.draw(to, frame, meshes, boat.model, boat.index);
        }
        to.end();
    }

    /// Puts the layer onto the screen, within a rendering to it. Rectangles that overlap are cut apart so that no pixel is
    /// composited twice.
    pub(crate) fn record_composite(&self, to: Recorder<'_>, frame: vk::DescriptorSet, pieces: &[PixelRect]) {
        to.bind(&self.composite, &[frame, self.set]);
        for piece in pieces {
            to.scissor(*piece);
            to.push(&self.composite, &DrawBlock { rect: corners(*piece), index: 0 });
            to.draw(4, 1);
        }
    }
}
