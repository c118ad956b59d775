//! The mirrored layer distorted by the video and blended onto the sea, and the boats' shadows: one quad for each boat, farthest
//! first, within the rectangle that its reflection can reach.

pub(crate) mod baked;
pub(crate) mod block;
pub(crate) mod full;
pub(crate) mod line;
pub(crate) mod mirror;
pub(crate) mod physics;

use ash::vk;
use block::{method_constant, shadow_constant};
use bowwave_core::{
    frame::scene::PixelRect,
    water::{ReflectionMethod, ShadowLevel, Water},
};
use shaders_spirv::{FIELD_FRAG, RECT_VERT, WATER_FRAG, interface::DrawBlock};

use crate::{
    encoder::{Begin, Colour, CommandEncoder, Step},
    error::RenderError,
    memory::{Image, ImageShape},
    passes::{COPIED_TO, DRAWN, FORGET_READ, PassContext, SAMPLED, mirror::MirrorPass},
    pipeline::{Blend, Bound, Pipeline, PipelineShape, Sampler, SetLayout, UNORM},
    rects::joined,
};

/// A boat's rectangle of water.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WaterDraw {
    /// Index of its block.
    pub(crate) index: u32,
    /// Around all of its rectangles.
    pub(crate) rect: PixelRect,
    /// First of its rectangles in the frame's list, and how many there are.
    pub(crate) first: u32,
    pub(crate) count: u32,
}

/// One compiled way to mirror.
struct Variant {
    method: ReflectionMethod,
    shadow: ShadowLevel,
    pipeline: Pipeline,
}

/// How the video's brightness changes downwards, at a fraction of the screen's size.
struct Field {
    pipeline: Pipeline,
    image: Image,
    set: vk::DescriptorSet,
    _set_layout: SetLayout,
}

/// The sea's mean in the picture stands for a line of sight so far below the horizontal, tangent.
pub(crate) const SEEN_DOWN: f64 = 0.12;

/// Screen pixels to a cell of the field, as `field.frag` and `water.frag` have it.
const FIELD_CELL: (u32, u32) = (4, 2);

/// The water pass.
pub(crate) struct WaterPass {
    size: (u32, u32),
    variants: Vec<Variant>,
    field: Option<Field>,
    /// The video beneath the reflections, as codes: what the shader compares, while it draws to the screen.
    pub(crate) backdrop: Image,
    /// With the mirror layer as it is, and softened.
    set: vk::DescriptorSet,
    soft: Option<vk::DescriptorSet>,
    _sampler: Sampler,
    _set_layout: SetLayout,
}

impl WaterPass {
    /// `mirror` is there unless only shadows are wanted.
    pub(crate) fn new(
        context: &PassContext<'_>,
        mirror: Option<&MirrorPass>,
        waters: &[(ReflectionMethod, ShadowLevel)],
    ) -> Result<Self, RenderError> {
        let gpu = context.gpu;
        let compares = waters.iter().any(|(method, _)| Self::reads_video(*method));
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
        let size = if compares { context.size } else { (1, 1) };
        let backdrop = Image::new(gpu, "video beneath reflections", ImageShape::new(size, UNORM, usage))?;
        let linear = Sampler::new(gpu, vk::Filter::LINEAR, false)?;
        let bound = |view: vk::ImageView| Bound::Texture { view, sampler: linear.raw, layout: SAMPLED.2 };
        let field = waters
            .iter()
            .any(|(method, _)| has_field(*method))
            .then(|| Field::new(context, bound(backdrop.view)))
            .transpose()?;
        let kinds = [vk::DescriptorType::COMBINED_IMAGE_SAMPLER; 3];
        let set_layout = SetLayout::new(gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        // Variants that read no mirror layer or no field still name one.
        let plain = mirror.map_or(backdrop.view, |m| m.colour.view);
        let field_view = field.as_ref().map_or(backdrop.view, |f| f.image.view);
        let set = context.pool.set(&set_layout, &[backdrop.view, plain, field_view].map(bound))?;
        let soft = match mirror.and_then(MirrorPass::soft_view) {
            Some(soft) => Some(context.pool.set(&set_layout, &[backdrop.view, soft, field_view].map(bound))?),
            None => None,
        };
        let mut variants = Vec::with_capacity(waters.len());
        for (method, shadow) in waters.iter().filter_map(|(m, s)| drawn(*m, *s)) {
            let pipeline = Pipeline::new(
                gpu,
                &PipelineShape {
                    vertex_constants: &[],
                    constants: &[method_constant(method), shadow_constant(shadow)],
                    ..PipelineShape::over_screen(RECT_VERT, WATER_FRAG, &[context.frame_set, &set_layout])
                },
            )?;
            variants.push(Variant { method, shadow, pipeline });
        }
        Ok(Self {
            size: context.size,
            variants,
            field,
            backdrop,
            set,
            soft,
            _sampler: linear,
            _set_layout: set_layout,
        })
    }

    /// Whether a method compares colours of the video.
    pub(crate) fn reads_video(method: ReflectionMethod) -> bool {
        !matches!(method, ReflectionMethod::Off | ReflectionMethod::Mirror)
    }

    /// Whether this way to mirror was compiled.
    pub(crate) fn has(&self, water: Water) -> bool {
        drawn(water.method, water.shadow).is_none() || self.variant(water).is_some()
    }

    fn variant(&self, water: Water) -> Option<&Variant> {
        let wanted = drawn(water.method, water.shadow)?;
        self.variants.iter().find(|v| (v.method, v.shadow) == wanted)
    }

    /// Steps from what the frame before did: of the backdrop to being copied to, and of the field to being drawn.
    pub(crate) fn before(&self, water: Water) -> [Option<Step<'_>>; 2] {
        let was = (FORGET_READ.0 | COPIED_TO.0, COPIED_TO.1, vk::ImageLayout::UNDEFINED);
        let was_drawn = (FORGET_READ.0 | DRAWN.0, DRAWN.1, vk::ImageLayout::UNDEFINED);
        let field = self.field.as_ref().filter(|_| has_field(water.method));
        [
            Some(Step { image: &self.backdrop, from: was, to: COPIED_TO }),
            field.map(|f| Step { image: &f.image, from: was_drawn, to: DRAWN }),
        ]
    }

    /// Step of the backdrop to being sampled.
    pub(crate) fn copied(&self) -> Step<'_> {
        Step { image: &self.backdrop, from: COPIED_TO, to: SAMPLED }
    }

    /// Step of the field from being drawn to being sampled, where the method needs it.
    pub(crate) fn found(&self, water: Water) -> Option<Step<'_>> {
        let field = self.field.as_ref().filter(|_| has_field(water.method));
        field.map(|f| Step { image: &f.image, from: DRAWN, to: SAMPLED })
    }

    /// Finds how the video changes beneath the boats' reflections, where the method needs it.
    pub(crate) fn record_field(
        &self,
        to: CommandEncoder<'_>,
        frame: vk::DescriptorSet,
        water: Water,
        boats: &[WaterDraw],
    ) {
        let Some(field) = self.field.as_ref().filter(|_| has_field(water.method)) else {
            return;
        };
        let Some(area) = boats.iter().map(|b| field.cells(b.rect)).reduce(joined) else { return };
        to.begin(area, Colour::new(field.image.view, Begin::Forget), None);
        let (width, height) = (self.size.0 as f32, self.size.1 as f32);
        to.window([0.0, 0.0, width / FIELD_CELL.0 as f32, height / FIELD_CELL.1 as f32], area);
        to.bind(&field.pipeline, &[frame, field.set]);
        for boat in boats {
            // Bilinear fetches take one cell more on each side.
            let (x, y) = (FIELD_CELL.0 as f32, FIELD_CELL.1 as f32);
            let block = DrawBlock { rect: [-x, -y, x, y], index: boat.index, first: boat.first };
            to.push(&field.pipeline, &block);
            to.draw(4, boat.count);
        }
        to.end();
    }

    /// Draws, within a rendering to the screen.
    pub(crate) fn record(
        &self,
        to: CommandEncoder<'_>,
        frame: vk::DescriptorSet,
        water: Water,
        boats: &[WaterDraw],
    ) {
        let Some(variant) = self.variant(water) else { return };
        let set =
            if water.method == ReflectionMethod::Full { self.soft.unwrap_or(self.set) } else { self.set };
        to.bind(&variant.pipeline, &[frame, set]);
        for boat in boats {
            let block = DrawBlock { rect: [0.0; 4], index: boat.index, first: boat.first };
            to.push(&variant.pipeline, &block);
            to.draw(4, boat.count);
        }
    }
}

impl Field {
    fn new(context: &PassContext<'_>, backdrop: Bound) -> Result<Self, RenderError> {
        let gpu = context.gpu;
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::SAMPLED;
        let size = (context.size.0.div_ceil(FIELD_CELL.0), context.size.1.div_ceil(FIELD_CELL.1));
        let format = vk::Format::R8G8_UNORM;
        let image = Image::new(gpu, "gradients of the video", ImageShape::new(size, format, usage))?;
        let kinds = [vk::DescriptorType::COMBINED_IMAGE_SAMPLER];
        let set_layout = SetLayout::new(gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        let set = context.pool.set(&set_layout, &[backdrop])?;
        let pipeline = Pipeline::new(
            gpu,
            &PipelineShape {
                colour: format,
                blend: Blend::Replace,
                ..PipelineShape::over_screen(RECT_VERT, FIELD_FRAG, &[context.frame_set, &set_layout])
            },
        )?;
        Ok(Self { pipeline, image, set, _set_layout: set_layout })
    }

    /// The cells whose light bilinear fetches within `r` take.
    fn cells(&self, r: PixelRect) -> PixelRect {
        let (width, height) = (self.image.shape.width, self.image.shape.height);
        let (x, y) = ((r.x / FIELD_CELL.0).saturating_sub(1), (r.y / FIELD_CELL.1).saturating_sub(1));
        let right = ((r.x + r.width).div_ceil(FIELD_CELL.0) + 1).min(width);
        let lower = ((r.y + r.height).div_ceil(FIELD_CELL.1) + 1).min(height);
        PixelRect { x, y, width: right - x, height: lower - y }
    }
}

/// Whether a method compares the video's gradients in cells.
fn has_field(method: ReflectionMethod) -> bool {
    matches!(method, ReflectionMethod::Full | ReflectionMethod::Physics)
}

/// The variant that a way to mirror needs: light thrown back by waves is drawn by a pass of its own, which leaves the shadow.
fn drawn(method: ReflectionMethod, shadow: ShadowLevel) -> Option<(ReflectionMethod, ShadowLevel)> {
    match (method, shadow) {
        (ReflectionMethod::Baked, ShadowLevel::None) => None,
        // Its shadow follows from the light: there are no levels of it.
        (ReflectionMethod::Baked, _) => Some((method, ShadowLevel::Gradual)),
        _ => Some((method, shadow)),
    }
}
