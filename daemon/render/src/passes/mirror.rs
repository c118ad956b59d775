//! The boats mirrored in the sea, into a layer of their own: what lies above the water, seen by the camera mirrored in the plane of
//! the boat's mean water. Each boat has its own place in the layer.

use ash::vk;

use crate::{
    atlas::Placed,
    error::RenderError,
    memory::{Image, ImageShape},
    meshes::Meshes,
    passes::{
        DEPTH_TESTED, DRAWN, FORGET_READ, Making, SAMPLED,
        boats::{BoatDraw, BoatPipelines},
    },
    pipeline::{Begin, DEPTH, LIGHT, Recorder, Step, joined},
};

/// The mirror pass.
pub(crate) struct MirrorPass {
    size: (u32, u32),
    /// Premultiplied light, transparent where no boat is.
    pub(crate) colour: Image,
    depth: Image,
    pipelines: BoatPipelines,
}

impl MirrorPass {
    pub(crate) fn new(making: &Making<'_>, meshes: &Meshes, any_textured: bool) -> Result<Self, RenderError> {
        let size = Self::layer_size(making.size);
        let sampled = vk::ImageUsageFlags::SAMPLED;
        let colour = ImageShape::new(size, LIGHT, vk::ImageUsageFlags::COLOR_ATTACHMENT | sampled);
        let depth = ImageShape::new(size, DEPTH, vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT);
        Ok(Self {
            size: making.size,
            colour: Image::new(making.gpu, "mirror layer", colour)?,
            depth: Image::new(making.gpu, "mirror depth", depth)?,
            pipelines: BoatPipelines::new(
                making,
                meshes,
                vk::SampleCountFlags::TYPE_1,
                vk::FrontFace::CLOCKWISE,
                LIGHT,
                any_textured,
            )?,
        })
    }

    /// Texels of the layer for a screen of `size`: no reflection covers more than the half below the horizon at full detail.
    pub(crate) fn layer_size(size: (u32, u32)) -> (u32, u32) {
        (size.0 + 8, size.1 / 2 + 8)
    }

    /// Steps of the layer's images from what the frame before did to being drawn.
    pub(crate) fn before(&self) -> [Step<'_>; 2] {
        let was_read = (FORGET_READ.0 | DRAWN.0, DRAWN.1, vk::ImageLayout::UNDEFINED);
        let was_depth = (DEPTH_TESTED.0, DEPTH_TESTED.1, vk::ImageLayout::UNDEFINED);
        [
            Step { image: &self.colour, from: was_read, to: DRAWN },
            Step { image: &self.depth, from: was_depth, to: DEPTH_TESTED },
        ]
    }

    /// Step of the layer from being drawn to being sampled.
    pub(crate) fn between(&self) -> Step<'_> {
        Step { image: &self.colour, from: DRAWN, to: SAMPLED }
    }

    /// Draws the mirrored boats, each onto its place.
    pub(crate) fn record(
        &self,
        to: Recorder<'_>,
        frame: vk::DescriptorSet,
        meshes: &Meshes,
        boats: &[BoatDraw],
        places: &[Placed],
    ) {
        let Some(area) = places.iter().map(|p| p.place).reduce(joined) else { return };
        to.begin(area, (self.colour.view, Begin::Zero), Some((self.depth.view, Begin::Zero)));
        meshes.bind(to);
        for (boat, placed) in boats.iter().zip(places) {
            to.window(placed.viewport(self.size), placed.place);
            self.pipelines.draw(to, frame, meshes, boat);
        }
        to.end();
    }
}
