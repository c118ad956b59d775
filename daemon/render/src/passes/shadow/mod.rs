//! The sun's shadows on boats, their own and each other's: a map of what the sun sees (Williams 1978, "Casting curved shadows on curved
//! surfaces"), which the boats' shaders look up.

pub(crate) mod plan;

use ash::vk;
use plan::{MAP, ShadowPlan};
use shaders_spirv::{
    SHADOW_VERT,
    interface::{MeshVertex, ShadowBlock},
};

use crate::{
    encoder::{Begin, CommandEncoder, Step},
    error::RenderError,
    memory::{Image, ImageShape},
    passes::{DEPTH_TESTED, FORGET_READ, PassContext, SAMPLED, TextureSet, boats::meshes::Meshes},
    pipeline::{DEPTH, Pipeline, PipelineShape},
    rects::joined,
};

/// The shadow map's pass.
pub(crate) struct ShadowPass {
    depth: Image,
    pipeline: Pipeline,
    /// The map as boats look it up.
    pub(crate) map: TextureSet,
}

impl ShadowPass {
    pub(crate) fn new(context: &PassContext<'_>) -> Result<Self, RenderError> {
        let usage = vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | vk::ImageUsageFlags::SAMPLED;
        let depth = Image::new(context.gpu, "shadow map", ImageShape::new(MAP, DEPTH, usage))?;
        let map = context.texture_set(depth.view)?;
        let pipeline = Pipeline::new(
            context.gpu,
            &PipelineShape {
                push: size_of::<ShadowBlock>(),
                vertices: Some((size_of::<MeshVertex>() as u32, &[(vk::Format::R32G32B32_SFLOAT, 0)])),
                // Faces that the sun lights are seen clockwise in the map. It holds the others: what is lit then never shades itself.
                cull: Some(vk::FrontFace::COUNTER_CLOCKWISE),
                ..PipelineShape::of_depth(SHADOW_VERT)
            },
        )?;
        Ok(Self { depth, pipeline, map })
    }

    /// Step of the map from what the frame before did to being drawn.
    pub(crate) fn before(&self) -> Step<'_> {
        let was_read = (FORGET_READ.0 | DEPTH_TESTED.0, DEPTH_TESTED.1, vk::ImageLayout::UNDEFINED);
        Step { image: &self.depth, from: was_read, to: DEPTH_TESTED }
    }

    /// Step of the map from being drawn to being looked up.
    pub(crate) fn between(&self) -> Step<'_> {
        Step { image: &self.depth, from: DEPTH_TESTED, to: SAMPLED }
    }

    /// Draws the boats as the sun sees them, each onto the places of those that it may shade.
    pub(crate) fn record(&self, to: CommandEncoder<'_>, meshes: &Meshes, plan: &ShadowPlan) {
        let Some(area) = plan.draws.iter().map(|d| d.place).reduce(joined) else { return };
        to.begin_all(area, [], Some((self.depth.view, Begin::Keep)));
        to.window([0.0, 0.0, MAP.0 as f32, MAP.1 as f32], area);
        to.clear([vk::ImageAspectFlags::DEPTH], &plan.clears);
        meshes.bind(to);
        to.bind(&self.pipeline, &[]);
        let coarser =
            meshes.coarser(Meshes::caster, plan.draws.iter().map(|draw| (draw.model, draw.detail_m)));
        for draw in &plan.draws {
            let Some(level) = meshes.caster(draw.model, coarser * draw.detail_m) else { continue };
            to.scissor(draw.place);
            to.push(&self.pipeline, &draw.block);
            meshes.draw(to, draw.model, &(level.closed.start..level.open.end));
        }
        to.end();
    }
}
