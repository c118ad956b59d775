//! The boats: meshes into a multisampled layer of their own, within the rectangles that their hulls can cover, then the mean of
//! each pixel's samples over the video in linear light.

mod casters;
pub(crate) mod coverage;
pub(crate) mod meshes;
mod parts;
mod simplify;
mod split;
mod transfer;

use ash::vk;
use bowwave_core::{frame::scene::PixelRect, model::ModelId};
use meshes::Meshes;
use shaders_spirv::{
    BOAT_FRAG, BOAT_MIRRORED_FRAG, BOAT_MIRRORED_VERT, BOAT_TEXTURED_FRAG, BOAT_TEXTURED_MIRRORED_FRAG,
    BOAT_TEXTURED_MIRRORED_VERT, BOAT_TEXTURED_VERT, BOAT_VERT, COMPOSITE_FRAG, COMPOSITE_NOISY_FRAG,
    RECT_VERT,
    interface::{DrawBlock, MeshVertex},
};

use crate::{
    encoder::{Begin, Colour, CommandEncoder, Step},
    error::RenderError,
    memory::{Image, ImageShape},
    passes::{DEPTH_TESTED, DRAWN, FORGET_READ, PassContext, SAMPLED, TextureSet},
    pipeline::{Blend, DEPTH, DepthUse, Pipeline, PipelineShape, SAMPLES, UNORM},
    rects::joined,
};

/// A boat as the passes draw it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoatDraw {
    pub(crate) model: ModelId,
    /// Index of its block.
    pub(crate) index: u32,
    /// The pixels that it can cover; its place in the mirror layer where it is mirrored.
    pub(crate) rect: PixelRect,
    /// By how much it may be simplified unseen, metres.
    pub(crate) detail_m: f64,
}

/// Pipelines that draw meshes without back faces: open shells have a side of their own for each way. Textured ones are drawn with their texture.
pub(crate) struct BoatPipelines {
    plain: Pipeline,
    textured: Option<Pipeline>,
    /// Set of the shadow map, where shadows are drawn.
    shadow: Option<vk::DescriptorSet>,
}

impl BoatPipelines {
    /// `front` is the way round in which the corners of a front face are seen: mirrored, it is the other one. Without a shadow map, boats are
    /// drawn as the sea mirrors them.
    pub(crate) fn new(
        context: &PassContext<'_>,
        (meshes, shadow): (&Meshes, Option<&TextureSet>),
        samples: vk::SampleCountFlags,
        front: vk::FrontFace,
        colour: vk::Format,
        any_textured: bool,
    ) -> Result<Self, RenderError> {
        let attributes = [
            (vk::Format::R32G32B32_SFLOAT, 0),
            (vk::Format::R32G32B32_SFLOAT, 12),
            (vk::Format::R32G32_SFLOAT, 24),
            (vk::Format::R32G32B32_SFLOAT, 32),
            (vk::Format::R32G32B32A32_SFLOAT, 44),
            (vk::Format::R32G32B32A32_SFLOAT, 60),
            (vk::Format::R32G32_SFLOAT, 76),
            (vk::Format::R32G32B32A32_SFLOAT, 84),
        ];
        // A layer of codes holds roots, one of light is filtered as it is.
        let constants = [u32::from(colour == UNORM), samples.as_raw()];
        let lens = context.vertex_constants();
        let mut sets = vec![context.frame_set];
        sets.extend(shadow.map(|shadow| &*shadow.layout));
        let plain_sets = sets.len();
        sets.push(&meshes.skin_layout);
        let make = |textured: bool| {
            let (vertex, fragment) = match (shadow, textured) {
                (Some(_), false) => (BOAT_VERT, BOAT_FRAG),
                (Some(_), true) => (BOAT_TEXTURED_VERT, BOAT_TEXTURED_FRAG),
                (None, false) => (BOAT_MIRRORED_VERT, BOAT_MIRRORED_FRAG),
                (None, true) => (BOAT_TEXTURED_MIRRORED_VERT, BOAT_TEXTURED_MIRRORED_FRAG),
            };
            Pipeline::new(
                context.gpu,
                &PipelineShape {
                    vertex,
                    fragment: Some(fragment),
                    vertex_constants: &lens,
                    constants: if textured { &constants } else { &constants[..1] },
                    sets: if textured { &sets } else { &sets[..plain_sets] },
                    push: size_of::<DrawBlock>(),
                    vertices: Some((size_of::<MeshVertex>() as u32, &attributes)),
                    topology: vk::PrimitiveTopology::TRIANGLE_LIST,
                    colour,
                    targets: 1,
                    blend: Blend::Replace,
                    cull: Some(front),
                    depth: DepthUse::Write,
                    samples,
                },
            )
        };
        let textured = any_textured.then(|| make(true)).transpose()?;
        Ok(Self { plain: make(false)?, textured, shadow: shadow.map(|shadow| shadow.set) })
    }

    /// Draws one boat's mesh, within a rendering with depth, simplified so many times more than goes unseen. The shared buffers are bound.
    pub(crate) fn draw(
        &self,
        to: CommandEncoder<'_>,
        frame: vk::DescriptorSet,
        (meshes, coarser): (&Meshes, f64),
        boat: &BoatDraw,
    ) {
        let Some(level) = meshes.level(boat.model, coarser * boat.detail_m) else { return };
        let block = DrawBlock { index: boat.index, ..DrawBlock::default() };
        let skinned = meshes.skin(boat.model).zip(self.textured.as_ref());
        let pipeline = skinned.map_or(&self.plain, |(_, textured)| textured);
        match (self.shadow, skinned) {
            (Some(shadow), Some((skin, _))) => to.bind(pipeline, &[frame, shadow, skin]),
            (Some(shadow), None) => to.bind(pipeline, &[frame, shadow]),
            (None, Some((skin, _))) => to.bind(pipeline, &[frame, skin]),
            (None, None) => to.bind(pipeline, &[frame]),
        }
        to.push(pipeline, &block);
        meshes.draw(to, boat.model, &(level.closed.start..level.open.end));
    }
}

/// The boats' pass.
pub(crate) struct BoatsPass {
    size: (u32, u32),
    colour: Image,
    depth: Image,
    pipelines: BoatPipelines,
    composite: Pipeline,
    /// The same with the camera's noise.
    noisy: Option<Pipeline>,
    layer: TextureSet,
}

impl BoatsPass {
    pub(crate) fn new(
        context: &PassContext<'_>,
        (meshes, shadow): (&Meshes, &TextureSet),
        [any_textured, noisy]: [bool; 2],
    ) -> Result<Self, RenderError> {
        let gpu = context.gpu;
        let layer =
            |format, usage| ImageShape { samples: SAMPLES, ..ImageShape::new(context.size, format, usage) };
        let sampled = vk::ImageUsageFlags::SAMPLED;
        let colour =
            Image::new(gpu, "boats' layer", layer(UNORM, vk::ImageUsageFlags::COLOR_ATTACHMENT | sampled))?;
        let depth = Image::new(
            gpu,
            "boats' depth",
            layer(DEPTH, vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | sampled),
        )?;
        let front = vk::FrontFace::COUNTER_CLOCKWISE;
        let pipelines =
            BoatPipelines::new(context, (meshes, Some(shadow)), SAMPLES, front, UNORM, any_textured)?;
        let layer = context.texture_set(colour.view)?;
        let composite = |fragment| {
            let sets = [context.frame_set, &*layer.layout];
            let shape = PipelineShape::over_screen(RECT_VERT, fragment, &sets);
            let constants = [SAMPLES.as_raw()];
            Pipeline::new(gpu, &PipelineShape { vertex_constants: &[], constants: &constants, ..shape })
        };
        let noisy = noisy.then(|| composite(COMPOSITE_NOISY_FRAG)).transpose()?;
        let composite = composite(COMPOSITE_FRAG)?;
        Ok(Self { size: context.size, colour, depth, pipelines, composite, noisy, layer })
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

    /// What lets another pass hide behind hulls: the layer's depth, valid within the hulls' rectangles.
    pub(crate) fn hull_depth(&self, context: &PassContext<'_>) -> Result<TextureSet, RenderError> {
        context.texture_set(self.depth.view)
    }

    /// Draws the boats into the layer. Only the pixels that they can cover are cleared.
    pub(crate) fn record_layer(
        &self,
        to: CommandEncoder<'_>,
        frame: vk::DescriptorSet,
        meshes: &Meshes,
        boats: &[BoatDraw],
        (clears, depth_clears): (&[vk::ClearRect], &[vk::ClearRect]),
    ) {
        let Some(area) = boats.iter().map(|b| b.rect).reduce(joined) else { return };
        to.begin(area, Colour::new(self.colour.view, Begin::Keep), Some((self.depth.view, Begin::Keep)));
        let (width, height) = self.size;
        to.window([0.0, 0.0, width as f32, height as f32], area);
        to.clear([vk::ImageAspectFlags::COLOR, vk::ImageAspectFlags::DEPTH], clears);
        to.clear([vk::ImageAspectFlags::DEPTH], depth_clears);
        meshes.bind(to);
        let coarser = meshes.coarser(Meshes::level, boats.iter().map(|boat| (boat.model, boat.detail_m)));
        for boat in boats {
            to.scissor(boat.rect);
            self.pipelines.draw(to, frame, (meshes, coarser), boat);
        }
        to.end();
    }

    /// Puts the layer onto the screen, within a rendering to it: the first `pieces` rectangles of the frame's list, which do not
    /// overlap. With the camera's noise where they are `noisy`, which was prepared for.
    pub(crate) fn record_composite(
        &self,
        to: CommandEncoder<'_>,
        frame: vk::DescriptorSet,
        (pieces, noisy): (u32, bool),
    ) {
        let composite = self.noisy.as_ref().filter(|_| noisy).unwrap_or(&self.composite);
        to.bind(composite, &[frame, self.layer.set]);
        to.push(composite, &DrawBlock::default());
        to.draw(4, pieces);
    }
}
