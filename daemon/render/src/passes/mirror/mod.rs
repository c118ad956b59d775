//! The boats mirrored in the sea, into a layer of their own: what lies above the water, seen by the camera mirrored in the plane of
//! the boat's mean water. Each boat has its own place in the layer.

use ash::vk;
use bowwave_core::frame::scene::PixelRect;
use shaders_spirv::{SCREEN_VERT, SOFTEN_FRAG, interface::LightBlock};

use crate::{
    encoder::{Begin, Colour, CommandEncoder, Step, Steps},
    error::RenderError,
    memory::{Image, ImageShape},
    passes::{
        DEPTH_TESTED, DRAWN, FORGET_READ, PassContext, SAMPLED, TextureSet,
        atlas::{Placed, SOFT},
        boats::{BoatDraw, BoatPipelines, meshes::Meshes},
        lights,
    },
    pipeline::{Blend, DEPTH, DepthUse, LIGHT, Pipeline, PipelineShape},
    rects::joined,
};

/// The mirror pass.
pub(crate) struct MirrorPass {
    size: (u32, u32),
    /// Premultiplied light, transparent where no boat is.
    pub(crate) colour: Image,
    depth: Image,
    pipelines: BoatPipelines,
    /// Adds navigation lights.
    lights: Option<Pipeline>,
    soft: Option<Soft>,
}

/// The layer at a third of its size, softened.
struct Soft {
    image: Image,
    pipeline: Pipeline,
    layer: TextureSet,
}

impl MirrorPass {
    /// `softens` if a method that needs it may be asked for, `any_light` if boats may show lights.
    pub(crate) fn new(
        context: &PassContext<'_>,
        meshes: &Meshes,
        any_textured: bool,
        [softens, any_light]: [bool; 2],
    ) -> Result<Self, RenderError> {
        let size = Self::layer_size(context.size);
        let sampled = vk::ImageUsageFlags::SAMPLED;
        let colour = ImageShape::new(size, LIGHT, vk::ImageUsageFlags::COLOR_ATTACHMENT | sampled);
        let depth = ImageShape::new(size, DEPTH, vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT);
        let colour = Image::new(context.gpu, "mirror layer", colour)?;
        let soft = softens.then(|| Soft::new(context, &colour)).transpose()?;
        Ok(Self {
            size: context.size,
            soft,
            lights: any_light.then(|| lights::mirrored(context)).transpose()?,
            colour,
            depth: Image::new(context.gpu, "mirror depth", depth)?,
            pipelines: BoatPipelines::new(
                context,
                (meshes, None),
                vk::SampleCountFlags::TYPE_1,
                vk::FrontFace::CLOCKWISE,
                LIGHT,
                any_textured,
            )?,
        })
    }

    /// Texels of the layer for a screen of `size`: no reflection covers more than the half below the horizon at full detail.
    pub(crate) fn layer_size(size: (u32, u32)) -> (u32, u32) {
        ((size.0 + 24).next_multiple_of(SOFT), (size.1 / 2 + 24).next_multiple_of(SOFT))
    }

    /// Steps of the layer's images from what the frame before did to being drawn.
    pub(crate) fn before(&self) -> [Option<Step<'_>>; 3] {
        let was_read = (FORGET_READ.0 | DRAWN.0, DRAWN.1, vk::ImageLayout::UNDEFINED);
        let was_depth = (DEPTH_TESTED.0, DEPTH_TESTED.1, vk::ImageLayout::UNDEFINED);
        [
            Some(Step { image: &self.colour, from: was_read, to: DRAWN }),
            Some(Step { image: &self.depth, from: was_depth, to: DEPTH_TESTED }),
            self.soft.as_ref().map(|s| Step { image: &s.image, from: was_read, to: DRAWN }),
        ]
    }

    /// Step of the layer from being drawn to being sampled.
    pub(crate) fn between(&self) -> Step<'_> {
        Step { image: &self.colour, from: DRAWN, to: SAMPLED }
    }

    /// The softened layer, where there is one.
    pub(crate) fn soft_view(&self) -> Option<vk::ImageView> {
        self.soft.as_ref().map(|s| s.image.view)
    }

    /// Softens what was drawn on `places`; returns the step that makes it ready to be sampled.
    pub(crate) fn record_soft(&self, to: CommandEncoder<'_>, places: &[Placed]) -> Option<Step<'_>> {
        let soft = self.soft.as_ref()?;
        let used = places.iter().map(|p| p.place).reduce(joined)?;
        let third = |v: u32| v / SOFT;
        let area = PixelRect {
            x: third(used.x),
            y: third(used.y),
            width: third(used.width),
            height: third(used.height),
        };
        let (width, height) = (soft.image.shape.width, soft.image.shape.height);
        to.begin(area, Colour::new(soft.image.view, Begin::Forget), None);
        to.window([0.0, 0.0, width as f32, height as f32], area);
        to.bind(&soft.pipeline, &[soft.layer.set]);
        to.draw(3, 1);
        to.end();
        Some(Step { image: &soft.image, from: DRAWN, to: SAMPLED })
    }

    /// Adds the mirrored lights, each onto the place of the boat with that number.
    pub(crate) fn record_lights(
        &self,
        to: CommandEncoder<'_>,
        frame: vk::DescriptorSet,
        lights: &[(usize, LightBlock)],
        places: &[Placed],
    ) {
        let Some(pipeline) = self.lights.as_ref().filter(|_| !lights.is_empty()) else { return };
        let Some(area) = places.iter().map(|p| p.place).reduce(joined) else { return };
        let mut steps = Steps::default();
        steps.add([
            Step { image: &self.colour, from: DRAWN, to: DRAWN },
            Step { image: &self.depth, from: DEPTH_TESTED, to: DEPTH_TESTED },
        ]);
        steps.record(to);
        to.begin(area, Colour::new(self.colour.view, Begin::Keep), Some((self.depth.view, Begin::Keep)));
        to.bind(pipeline, &[frame]);
        for (number, light) in lights {
            let Some(placed) = places.get(*number) else { continue };
            to.window(placed.viewport(self.size), placed.place);
            to.push(pipeline, light);
            to.draw(4, 1);
        }
        to.end();
    }

    /// Draws the mirrored boats, each onto its place.
    pub(crate) fn record(
        &self,
        to: CommandEncoder<'_>,
        frame: vk::DescriptorSet,
        meshes: &Meshes,
        boats: &[BoatDraw],
        places: &[Placed],
    ) {
        let Some(area) = places.iter().map(|p| p.place).reduce(joined) else { return };
        to.begin(area, Colour::new(self.colour.view, Begin::Zero), Some((self.depth.view, Begin::Zero)));
        meshes.bind(to);
        let coarser = meshes.coarser(Meshes::level, boats.iter().map(|boat| (boat.model, boat.detail_m)));
        for (boat, placed) in boats.iter().zip(places) {
            to.window(placed.viewport(self.size), placed.place);
            self.pipelines.draw(to, frame, (meshes, coarser), boat);
        }
        to.end();
    }
}

impl Soft {
    fn new(context: &PassContext<'_>, layer: &Image) -> Result<Self, RenderError> {
        let gpu = context.gpu;
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::SAMPLED;
        let size = (layer.shape.width / SOFT, layer.shape.height / SOFT);
        let image = Image::new(gpu, "mirror layer, softened", ImageShape::new(size, LIGHT, usage))?;
        let layer = context.texture_set(layer.view)?;
        let pipeline = Pipeline::new(
            gpu,
            &PipelineShape {
                vertex: SCREEN_VERT,
                fragment: Some(SOFTEN_FRAG),
                vertex_constants: &[],
                constants: &[],
                sets: &[&layer.layout],
                push: 0,
                vertices: None,
                topology: vk::PrimitiveTopology::TRIANGLE_LIST,
                colour: LIGHT,
                targets: 1,
                blend: Blend::Replace,
                cull: None,
                depth: DepthUse::None,
                samples: vk::SampleCountFlags::TYPE_1,
            },
        )?;
        Ok(Self { image, pipeline, layer })
    }
}
