//! Recording into a command buffer, as far as the passes have it in common.

use ash::vk;
use bowwave_core::frame::scene::PixelRect;

use crate::{
    gpu::Gpu,
    memory::{Buffer, Image},
    pipeline::{PUSH_STAGES, Pipeline},
    rects::rect,
};

/// Most image steps of one barrier.
const STEPS_MAX: usize = 16;

/// Recording into one command buffer.
#[derive(Clone, Copy)]
pub(crate) struct CommandEncoder<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) cmd: vk::CommandBuffer,
}

/// What happens to an attachment's contents where a rendering begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Begin {
    /// They are wanted.
    Keep,
    /// Every pixel is drawn.
    Forget,
    /// They become zero: no light, no coverage, infinitely far.
    Zero,
}

impl Begin {
    fn op(self) -> vk::AttachmentLoadOp {
        match self {
            Self::Keep => vk::AttachmentLoadOp::LOAD,
            Self::Forget => vk::AttachmentLoadOp::DONT_CARE,
            Self::Zero => vk::AttachmentLoadOp::CLEAR,
        }
    }
}

/// An image of colours that is drawn to.
#[derive(Clone, Copy)]
pub(crate) struct Colour {
    pub(crate) view: vk::ImageView,
    pub(crate) layout: vk::ImageLayout,
    pub(crate) begin: Begin,
}

impl Colour {
    /// In the layout of what is drawn to.
    pub(crate) fn new(view: vk::ImageView, begin: Begin) -> Self {
        Self { view, layout: vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL, begin }
    }
}

/// A stage and what it does with memory.
pub(crate) type Reach = (vk::PipelineStageFlags2, vk::AccessFlags2);

/// A few image steps, and a dependency of all other memory, for one barrier.
#[derive(Default)]
pub(crate) struct Steps<'a> {
    steps: [Option<Step<'a>>; STEPS_MAX],
    count: usize,
    memory: vk::MemoryBarrier2<'static>,
}

impl<'a> Steps<'a> {
    pub(crate) fn add(&mut self, steps: impl IntoIterator<Item = Step<'a>>) {
        for step in steps {
            if let Some(place) = self.steps.get_mut(self.count) {
                *place = Some(step);
                self.count += 1;
            }
        }
    }

    /// What was done to any memory comes before what is done to any.
    pub(crate) fn add_memory(&mut self, from: Reach, to: Reach) {
        self.memory.src_stage_mask |= from.0;
        self.memory.src_access_mask |= from.1;
        self.memory.dst_stage_mask |= to.0;
        self.memory.dst_access_mask |= to.1;
    }

    /// Records the barrier, where there is anything in it.
    pub(crate) fn record(&self, to: CommandEncoder<'_>) {
        to.barrier_with(self.steps.iter().flatten().copied(), self.memory);
    }
}

/// One step of an image from one use to the next.
#[derive(Clone, Copy)]
pub(crate) struct Step<'a> {
    pub(crate) image: &'a Image,
    pub(crate) from: (vk::PipelineStageFlags2, vk::AccessFlags2, vk::ImageLayout),
    pub(crate) to: (vk::PipelineStageFlags2, vk::AccessFlags2, vk::ImageLayout),
}

impl CommandEncoder<'_> {
    /// A barrier for up to [`STEPS_MAX`] images at once.
    pub(crate) fn barrier<'a>(&self, steps: impl IntoIterator<Item = Step<'a>>) {
        self.barrier_with(steps, vk::MemoryBarrier2::default());
    }

    /// The same with a dependency of all other memory. On a driver that runs on the processor each barrier waits for all that was drawn
    /// before, so that there should be few.
    fn barrier_with<'a>(
        &self,
        steps: impl IntoIterator<Item = Step<'a>>,
        memory: vk::MemoryBarrier2<'static>,
    ) {
        let mut barriers = [vk::ImageMemoryBarrier2::default(); STEPS_MAX];
        let mut count = 0;
        for (barrier, step) in barriers.iter_mut().zip(steps) {
            count += 1;
            *barrier = vk::ImageMemoryBarrier2::default()
                .src_stage_mask(step.from.0)
                .src_access_mask(step.from.1)
                .old_layout(step.from.2)
                .dst_stage_mask(step.to.0)
                .dst_access_mask(step.to.1)
                .new_layout(step.to.2)
                .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .image(step.image.raw)
                .subresource_range(vk::ImageSubresourceRange {
                    aspect_mask: step.image.aspect(),
                    base_mip_level: 0,
                    level_count: vk::REMAINING_MIP_LEVELS,
                    base_array_layer: 0,
                    layer_count: 1,
                });
        }
        let memories = [memory];
        let memories = if memory.dst_stage_mask.is_empty() { &memories[..0] } else { &memories[..] };
        if count == 0 && memories.is_empty() {
            return;
        }
        let info =
            vk::DependencyInfo::default().image_memory_barriers(&barriers[..count]).memory_barriers(memories);
        // SAFETY: the command buffer is being recorded, outside of a rendering; the images are live.
        unsafe { self.gpu.device.cmd_pipeline_barrier2(self.cmd, &info) };
    }

    /// Begins drawing to one colour image and, maybe, a depth image, within `area`.
    pub(crate) fn begin(&self, area: PixelRect, colour: Colour, depth: Option<(vk::ImageView, Begin)>) {
        self.begin_all(area, [colour], depth);
    }

    /// The same to several colour images.
    pub(crate) fn begin_all<const N: usize>(
        &self,
        area: PixelRect,
        colours: [Colour; N],
        depth: Option<(vk::ImageView, Begin)>,
    ) {
        let colours = colours.map(|colour| {
            vk::RenderingAttachmentInfo::default()
                .image_view(colour.view)
                .image_layout(colour.layout)
                .load_op(colour.begin.op())
                .store_op(vk::AttachmentStoreOp::STORE)
        });
        let mut info =
            vk::RenderingInfo::default().render_area(rect(area)).layer_count(1).color_attachments(&colours);
        let depth = depth.map(|(view, begin)| {
            vk::RenderingAttachmentInfo::default()
                .image_view(view)
                .image_layout(vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL)
                .load_op(begin.op())
                .store_op(vk::AttachmentStoreOp::STORE)
        });
        if let Some(depth) = &depth {
            info = info.depth_attachment(depth);
        }
        // SAFETY: the command buffer is being recorded; the views are live and in the stated layouts.
        unsafe { self.gpu.device.cmd_begin_rendering(self.cmd, &info) };
    }

    /// Sets attachments to zero (no light, no coverage, infinitely far) in some rectangles, within a rendering.
    pub(crate) fn clear<const N: usize>(&self, aspects: [vk::ImageAspectFlags; N], areas: &[vk::ClearRect]) {
        if areas.is_empty() {
            return;
        }
        let zero = |aspect_mask| vk::ClearAttachment { aspect_mask, ..vk::ClearAttachment::default() };
        let what = aspects.map(zero);
        // SAFETY: a rendering with such attachments was begun; the rectangles lie in its area.
        unsafe { self.gpu.device.cmd_clear_attachments(self.cmd, &what, areas) };
    }

    /// Copies parts of a buffer to an image.
    pub(crate) fn copy_to_image(&self, from: &Buffer, image: &Image, regions: &[vk::BufferImageCopy]) {
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        // SAFETY: both are live and the regions lie within them; the image is in this layout.
        unsafe { self.gpu.device.cmd_copy_buffer_to_image(self.cmd, from.raw, image.raw, layout, regions) };
    }

    /// Copies parts of an image to another, which is in the layout for that.
    pub(crate) fn copy_image(
        &self,
        (from, layout): (&Image, vk::ImageLayout),
        image: &Image,
        regions: &[vk::ImageCopy],
    ) {
        let target = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        // SAFETY: both are live, of texels of the same size, in these layouts, and the regions lie within them.
        unsafe { self.gpu.device.cmd_copy_image(self.cmd, from.raw, layout, image.raw, target, regions) };
    }

    /// Copies parts of an image to a buffer.
    pub(crate) fn copy_from_image(
        &self,
        (image, layout): (&Image, vk::ImageLayout),
        buffer: &Buffer,
        regions: &[vk::BufferImageCopy],
    ) {
        // SAFETY: both are live and the regions lie within them; the image is in this layout.
        unsafe { self.gpu.device.cmd_copy_image_to_buffer(self.cmd, image.raw, layout, buffer.raw, regions) };
    }

    /// Ends drawing.
    pub(crate) fn end(&self) {
        // SAFETY: a rendering was begun.
        unsafe { self.gpu.device.cmd_end_rendering(self.cmd) };
    }

    /// Maps clip space onto `viewport` (x, y, width, height) and lets only `scissor` through.
    pub(crate) fn window(&self, viewport: [f32; 4], scissor: PixelRect) {
        let [x, y, width, height] = viewport;
        let viewport = vk::Viewport { x, y, width, height, min_depth: 0.0, max_depth: 1.0 };
        // SAFETY: the command buffer is being recorded.
        unsafe { self.gpu.device.cmd_set_viewport(self.cmd, 0, &[viewport]) };
        self.scissor(scissor);
    }

    /// Lets only `scissor` through.
    pub(crate) fn scissor(&self, scissor: PixelRect) {
        // SAFETY: the command buffer is being recorded.
        unsafe { self.gpu.device.cmd_set_scissor(self.cmd, 0, &[rect(scissor)]) };
    }

    /// Binds a pipeline and its sets.
    pub(crate) fn bind(&self, pipeline: &Pipeline, sets: &[vk::DescriptorSet]) {
        let point = vk::PipelineBindPoint::GRAPHICS;
        // SAFETY: pipeline and sets are live and fit each other.
        unsafe {
            self.gpu.device.cmd_bind_pipeline(self.cmd, point, pipeline.raw);
            if !sets.is_empty() {
                self.gpu.device.cmd_bind_descriptor_sets(self.cmd, point, pipeline.layout, 0, sets, &[]);
            }
        }
    }

    /// Sets the push constants.
    pub(crate) fn push<T: bytemuck::Pod>(&self, pipeline: &Pipeline, value: &T) {
        let bytes = bytemuck::bytes_of(value);
        // SAFETY: the pipeline's layout has room for `T`.
        unsafe { self.gpu.device.cmd_push_constants(self.cmd, pipeline.layout, PUSH_STAGES, 0, bytes) };
    }

    /// Draws.
    pub(crate) fn draw(&self, vertices: u32, instances: u32) {
        self.draw_from(vertices, 0, instances);
    }

    /// Draws, counting instances from `first`.
    pub(crate) fn draw_from(&self, vertices: u32, first: u32, instances: u32) {
        // SAFETY: a rendering was begun and everything that the pipeline needs is bound.
        unsafe { self.gpu.device.cmd_draw(self.cmd, vertices, instances, 0, first) };
    }
}
