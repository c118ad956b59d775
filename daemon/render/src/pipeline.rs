//! Graphics pipelines, descriptor layouts and command recording, as far as the passes have them in common.

use std::sync::Arc;

use ash::vk;
use bowwave_core::scene::PixelRect;
use shaders_spirv::Shader;

use crate::{
    error::{Named, RenderError},
    gpu::Gpu,
    memory::{Buffer, Image},
};

/// Format of the screen image as blending and sampling see it: codes in memory, linear light in the shader.
pub(crate) const SRGB: vk::Format = vk::Format::R8G8B8A8_SRGB;
/// The same memory as codes.
pub(crate) const UNORM: vk::Format = vk::Format::R8G8B8A8_UNORM;
/// Linear light in memory: a driver that runs on the processor samples it several times as fast as codes.
pub(crate) const LIGHT: vk::Format = vk::Format::R16G16B16A16_SFLOAT;
/// Depth, reverse-Z.
pub(crate) const DEPTH: vk::Format = vk::Format::D32_SFLOAT;
/// Samples a pixel of the boats' layer.
pub(crate) const SAMPLES: vk::SampleCountFlags = vk::SampleCountFlags::TYPE_4;

/// A descriptor set layout.
pub(crate) struct SetLayout {
    gpu: Arc<Gpu>,
    pub(crate) raw: vk::DescriptorSetLayout,
}

impl SetLayout {
    /// One descriptor for each of `kinds`, bound from 0 on, seen by `stages`.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        kinds: &[vk::DescriptorType],
        stages: vk::ShaderStageFlags,
    ) -> Result<Self, RenderError> {
        let bindings: Vec<_> = kinds
            .iter()
            .zip(0..)
            .map(|(kind, i)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(i)
                    .descriptor_type(*kind)
                    .descriptor_count(1)
                    .stage_flags(stages)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: `info` and what it points to outlive the call.
        let raw = unsafe { gpu.device.create_descriptor_set_layout(&info, None) }
            .named("vkCreateDescriptorSetLayout")?;
        Ok(Self { gpu: gpu.clone(), raw })
    }
}

impl Drop for SetLayout {
    fn drop(&mut self) {
        // SAFETY: pipelines and sets made from the layout do not need it any more.
        unsafe { self.gpu.device.destroy_descriptor_set_layout(self.raw, None) };
    }
}

/// What a descriptor points at.
#[derive(Clone, Copy)]
pub(crate) enum Bound {
    Uniform { buffer: vk::Buffer, offset: u64, size: u64 },
    Storage { buffer: vk::Buffer, offset: u64, size: u64 },
    Texels(vk::BufferView),
    Texture { view: vk::ImageView, sampler: vk::Sampler, layout: vk::ImageLayout },
}

/// A pool of sets that live as long as the pool.
pub(crate) struct SetPool {
    gpu: Arc<Gpu>,
    raw: vk::DescriptorPool,
}

impl SetPool {
    /// Room for `sets` sets of at most `each` descriptors of each kind.
    pub(crate) fn new(gpu: &Arc<Gpu>, sets: u32, each: u32) -> Result<Self, RenderError> {
        let size =
            |ty| vk::DescriptorPoolSize::default().ty(ty).descriptor_count(sets.saturating_mul(each).max(1));
        let sizes = [
            size(vk::DescriptorType::UNIFORM_BUFFER),
            size(vk::DescriptorType::STORAGE_BUFFER),
            size(vk::DescriptorType::UNIFORM_TEXEL_BUFFER),
            size(vk::DescriptorType::COMBINED_IMAGE_SAMPLER),
        ];
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(sets.max(1)).pool_sizes(&sizes);
        // SAFETY: `info` and what it points to outlive the call.
        let raw =
            unsafe { gpu.device.create_descriptor_pool(&info, None) }.named("vkCreateDescriptorPool")?;
        Ok(Self { gpu: gpu.clone(), raw })
    }

    /// A set with its descriptors.
    pub(crate) fn set(&self, layout: &SetLayout, bound: &[Bound]) -> Result<vk::DescriptorSet, RenderError> {
        let layouts = [layout.raw];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(self.raw).set_layouts(&layouts);
        // SAFETY: pool and layout are live.
        let sets = unsafe { self.gpu.device.allocate_descriptor_sets(&info) }
            .named_for("vkAllocateDescriptorSets", "descriptors")?;
        let set = sets.first().copied().unwrap_or_default();
        for (bound, binding) in bound.iter().zip(0..) {
            self.write(set, binding, *bound);
        }
        Ok(set)
    }

    fn write(&self, set: vk::DescriptorSet, binding: u32, bound: Bound) {
        let buffer = |buffer, offset, range| vk::DescriptorBufferInfo { buffer, offset, range };
        let (mut buffers, mut images, mut texels) = (Vec::new(), Vec::new(), Vec::new());
        let kind = match bound {
            Bound::Uniform { buffer: b, offset, size } => {
                buffers.push(buffer(b, offset, size));
                vk::DescriptorType::UNIFORM_BUFFER
            }
            Bound::Storage { buffer: b, offset, size } => {
                buffers.push(buffer(b, offset, size));
                vk::DescriptorType::STORAGE_BUFFER
            }
            Bound::Texels(view) => {
                texels.push(view);
                vk::DescriptorType::UNIFORM_TEXEL_BUFFER
            }
            Bound::Texture { view, sampler, layout } => {
                images.push(vk::DescriptorImageInfo { sampler, image_view: view, image_layout: layout });
                vk::DescriptorType::COMBINED_IMAGE_SAMPLER
            }
        };
        let write = vk::WriteDescriptorSet {
            descriptor_count: 1,
            ..vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(binding)
                .descriptor_type(kind)
                .buffer_info(&buffers)
                .image_info(&images)
                .texel_buffer_view(&texels)
        };
        // SAFETY: the set is not in use yet, and what it points to outlives it.
        unsafe { self.gpu.device.update_descriptor_sets(&[write], &[]) };
    }
}

impl Drop for SetPool {
    fn drop(&mut self) {
        // SAFETY: owners drop pools only once the GPU is idle.
        unsafe { self.gpu.device.destroy_descriptor_pool(self.raw, None) };
    }
}

/// A sampler.
pub(crate) struct Sampler {
    gpu: Arc<Gpu>,
    pub(crate) raw: vk::Sampler,
}

impl Sampler {
    /// Clamped to the edge, bilinear or nearest, between levels as well where `levels` is set.
    pub(crate) fn new(gpu: &Arc<Gpu>, filter: vk::Filter, levels: bool) -> Result<Self, RenderError> {
        let mode = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        let mut info = vk::SamplerCreateInfo::default()
            .mag_filter(filter)
            .min_filter(filter)
            .address_mode_u(mode)
            .address_mode_v(mode)
            .address_mode_w(mode);
        if levels {
            info = info.mipmap_mode(vk::SamplerMipmapMode::LINEAR).max_lod(vk::LOD_CLAMP_NONE);
        }
        // SAFETY: `info` is complete.
        let raw = unsafe { gpu.device.create_sampler(&info, None) }.named("vkCreateSampler")?;
        Ok(Self { gpu: gpu.clone(), raw })
    }
}

impl Drop for Sampler {
    fn drop(&mut self) {
        // SAFETY: owners drop samplers only once the GPU is idle.
        unsafe { self.gpu.device.destroy_sampler(self.raw, None) };
    }
}

/// How a pipeline's colour meets what is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Blend {
    /// It replaces it.
    Replace,
    /// Premultiplied light over it.
    Over,
}

/// What tells one pipeline from another.
pub(crate) struct PipelineShape<'a> {
    pub(crate) vertex: Shader,
    pub(crate) fragment: Shader,
    /// Fragment shader's specialisation constants, from 0 on.
    pub(crate) constants: &'a [u32],
    pub(crate) sets: &'a [&'a SetLayout],
    /// Bytes of push constants, seen by both stages.
    pub(crate) push: usize,
    /// Stride, and format and offset of each attribute.
    pub(crate) vertices: Option<(u32, &'a [(vk::Format, u32)])>,
    pub(crate) topology: vk::PrimitiveTopology,
    pub(crate) colour: vk::Format,
    pub(crate) blend: Blend,
    /// Leaves out back faces, front ones being seen this way round.
    pub(crate) cull: Option<vk::FrontFace>,
    /// Test and write reverse-Z depth.
    pub(crate) depth: bool,
    pub(crate) samples: vk::SampleCountFlags,
}

/// A pipeline with its layout.
pub(crate) struct Pipeline {
    gpu: Arc<Gpu>,
    pub(crate) raw: vk::Pipeline,
    pub(crate) layout: vk::PipelineLayout,
}

/// Stages that see push constants: one range for both, so that one push serves both.
pub(crate) const PUSH_STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::VERTEX.as_raw() | vk::ShaderStageFlags::FRAGMENT.as_raw(),
);

impl Pipeline {
    pub(crate) fn new(gpu: &Arc<Gpu>, shape: &PipelineShape<'_>) -> Result<Self, RenderError> {
        let sets: Vec<_> = shape.sets.iter().map(|s| s.raw).collect();
        let push = [vk::PushConstantRange {
            stage_flags: PUSH_STAGES,
            offset: 0,
            size: u32::try_from(shape.push).unwrap_or(0),
        }];
        let ranges = if shape.push == 0 { &push[..0] } else { &push[..] };
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(ranges);
        // SAFETY: `info` and what it points to outlive the call.
        let layout =
            unsafe { gpu.device.create_pipeline_layout(&info, None) }.named("vkCreatePipelineLayout")?;
        let mut pipeline = Self { gpu: gpu.clone(), raw: vk::Pipeline::null(), layout };
        let vertex = Module::new(gpu, shape.vertex)?;
        let fragment = Module::new(gpu, shape.fragment)?;
        pipeline.raw = pipeline.build(shape, &vertex, &fragment)?;
        Ok(pipeline)
    }

    fn build(
        &self,
        shape: &PipelineShape<'_>,
        vertex: &Module,
        fragment: &Module,
    ) -> Result<vk::Pipeline, RenderError> {
        let entries = entries(shape.constants);
        let special = vk::SpecializationInfo::default()
            .map_entries(&entries)
            .data(bytemuck::cast_slice(shape.constants));
        let stages = [
            vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::VERTEX)
                .module(vertex.raw)
                .name(c"main"),
            vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::FRAGMENT)
                .module(fragment.raw)
                .name(c"main")
                .specialization_info(&special),
        ];
        let (stride, attributes) = shape.vertices.unwrap_or((0, &[]));
        let bindings = [vk::VertexInputBindingDescription::default().stride(stride)];
        let attributes: Vec<_> = attributes
            .iter()
            .zip(0..)
            .map(|(&(format, offset), location)| vk::VertexInputAttributeDescription {
                location,
                binding: 0,
                format,
                offset,
            })
            .collect();
        let input = vk::PipelineVertexInputStateCreateInfo::default()
            .vertex_binding_descriptions(if stride == 0 { &[] } else { &bindings })
            .vertex_attribute_descriptions(&attributes);
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default().topology(shape.topology);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let mut raster = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
        if let Some(front) = shape.cull {
            raster = raster.cull_mode(vk::CullModeFlags::BACK).front_face(front);
        }
        let samples = vk::PipelineMultisampleStateCreateInfo::default().rasterization_samples(shape.samples);
        let depth = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(shape.depth)
            .depth_write_enable(shape.depth)
            .depth_compare_op(vk::CompareOp::GREATER);
        let blends = [blend_state(shape.blend)];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
        let dynamic_states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic_states);
        let formats = [shape.colour];
        let mut rendering = vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&formats);
        if shape.depth {
            rendering = rendering.depth_attachment_format(DEPTH);
        }
        let info = vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(self.layout)
            .push_next(&mut rendering);
        // SAFETY: `info` and all it points to outlive the call.
        let made =
            unsafe { self.gpu.device.create_graphics_pipelines(vk::PipelineCache::null(), &[info], None) };
        let made = made.map_err(|(_, result)| result).named_for("vkCreateGraphicsPipelines", "a pipeline")?;
        Ok(made.first().copied().unwrap_or_default())
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // SAFETY: owners drop pipelines only once the GPU is idle; a null pipeline is allowed.
        unsafe {
            self.gpu.device.destroy_pipeline(self.raw, None);
            self.gpu.device.destroy_pipeline_layout(self.layout, None);
        }
    }
}

/// A shader module, needed only while a pipeline is made.
struct Module {
    gpu: Arc<Gpu>,
    raw: vk::ShaderModule,
}

impl Module {
    fn new(gpu: &Arc<Gpu>, shader: Shader) -> Result<Self, RenderError> {
        let words = shader.words();
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the words are valid SPIR-V, held so by a test.
        let raw = unsafe { gpu.device.create_shader_module(&info, None) }.named("vkCreateShaderModule")?;
        Ok(Self { gpu: gpu.clone(), raw })
    }
}

impl Drop for Module {
    fn drop(&mut self) {
        // SAFETY: pipelines keep what they need of a module.
        unsafe { self.gpu.device.destroy_shader_module(self.raw, None) };
    }
}

/// Specialisation constants from 0 on, four bytes each.
fn entries(constants: &[u32]) -> Vec<vk::SpecializationMapEntry> {
    let ids = 0..u32::try_from(constants.len()).unwrap_or(0);
    ids.map(|id| vk::SpecializationMapEntry { constant_id: id, offset: 4 * id, size: 4 }).collect()
}

fn blend_state(blend: Blend) -> vk::PipelineColorBlendAttachmentState {
    let state =
        vk::PipelineColorBlendAttachmentState::default().color_write_mask(vk::ColorComponentFlags::RGBA);
    match blend {
        Blend::Replace => state,
        Blend::Over => {
            let (one, rest) = (vk::BlendFactor::ONE, vk::BlendFactor::ONE_MINUS_SRC_ALPHA);
            state
                .blend_enable(true)
                .src_color_blend_factor(one)
                .dst_color_blend_factor(rest)
                .src_alpha_blend_factor(one)
                .dst_alpha_blend_factor(rest)
        }
    }
}

/// A rectangle as Vulkan has it.
pub(crate) fn rect(r: PixelRect) -> vk::Rect2D {
    vk::Rect2D {
        offset: vk::Offset2D { x: i32::try_from(r.x).unwrap_or(0), y: i32::try_from(r.y).unwrap_or(0) },
        extent: vk::Extent2D { width: r.width, height: r.height },
    }
}

/// The corners x0, y0, x1, y1 of a rectangle.
pub(crate) fn corners(r: PixelRect) -> [f32; 4] {
    [r.x as f32, r.y as f32, (r.x + r.width) as f32, (r.y + r.height) as f32]
}

/// `r` cut to a screen of `size`; `None` where nothing is left. What a scene says is not trusted to lie on the screen.
pub(crate) fn cut(r: PixelRect, size: (u32, u32)) -> Option<PixelRect> {
    let right = r.x.saturating_add(r.width).min(size.0);
    let lower = r.y.saturating_add(r.height).min(size.1);
    (r.x < right && r.y < lower).then(|| PixelRect {
        x: r.x,
        y: r.y,
        width: right - r.x,
        height: lower - r.y,
    })
}

/// The parts of `whole` that none of `cutters` covers. `rest` keeps its memory.
pub(crate) fn around_all(whole: PixelRect, cutters: &[PixelRect], rest: &mut Vec<PixelRect>) {
    rest.clear();
    rest.push(whole);
    for cutter in cutters {
        cut_from(*cutter, rest);
    }
}

/// Takes `cutter` out of the pieces.
fn cut_from(cutter: PixelRect, pieces: &mut Vec<PixelRect>) {
    let mut i = 0;
    while i < pieces.len() {
        if overlap(pieces[i], cutter).is_none() {
            i += 1;
        } else {
            let whole = pieces.swap_remove(i);
            pieces.extend(around(whole, cutter).into_iter().flatten());
        }
    }
}

/// The pixels that both hold.
pub(crate) fn overlap(a: PixelRect, b: PixelRect) -> Option<PixelRect> {
    let (x, y) = (a.x.max(b.x), a.y.max(b.y));
    let (right, lower) = ((a.x + a.width).min(b.x + b.width), (a.y + a.height).min(b.y + b.height));
    (x < right && y < lower).then(|| PixelRect { x, y, width: right - x, height: lower - y })
}

/// The up to four parts of `a` around `b`.
fn around(a: PixelRect, b: PixelRect) -> [Option<PixelRect>; 4] {
    let Some(o) = overlap(a, b) else { return [Some(a), None, None, None] };
    let part = |x: u32, y: u32, right: u32, lower: u32| {
        (x < right && y < lower).then(|| PixelRect { x, y, width: right - x, height: lower - y })
    };
    let (right, lower) = (a.x + a.width, a.y + a.height);
    let (o_right, o_lower) = (o.x + o.width, o.y + o.height);
    [
        part(a.x, a.y, right, o.y),
        part(a.x, o_lower, right, lower),
        part(a.x, o.y, o.x, o_lower),
        part(o_right, o.y, right, o_lower),
    ]
}

/// The smallest rectangle that holds both.
pub(crate) fn joined(a: PixelRect, b: PixelRect) -> PixelRect {
    let (x, y) = (a.x.min(b.x), a.y.min(b.y));
    let (right, lower) = ((a.x + a.width).max(b.x + b.width), (a.y + a.height).max(b.y + b.height));
    PixelRect { x, y, width: right - x, height: lower - y }
}

/// Recording into one command buffer.
#[derive(Clone, Copy)]
pub(crate) struct Recorder<'a> {
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

/// One step of an image from one use to the next.
#[derive(Clone, Copy)]
pub(crate) struct Step<'a> {
    pub(crate) image: &'a Image,
    pub(crate) from: (vk::PipelineStageFlags2, vk::AccessFlags2, vk::ImageLayout),
    pub(crate) to: (vk::PipelineStageFlags2, vk::AccessFlags2, vk::ImageLayout),
}

impl Recorder<'_> {
    /// A barrier for up to eight images at once.
    pub(crate) fn barrier<'a>(&self, steps: impl IntoIterator<Item = Step<'a>>) {
        let mut barriers = [vk::ImageMemoryBarrier2::default(); 8];
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
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers[..count]);
        // SAFETY: the command buffer is being recorded, outside of a rendering; the images are live.
        unsafe { self.gpu.device.cmd_pipeline_barrier2(self.cmd, &info) };
    }

    /// Begins drawing to one colour image and, maybe, a depth image, within `area`.
    pub(crate) fn begin(
        &self,
        area: PixelRect,
        colour: (vk::ImageView, Begin),
        depth: Option<(vk::ImageView, Begin)>,
    ) {
        let colours = [vk::RenderingAttachmentInfo::default()
            .image_view(colour.0)
            .image_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
            .load_op(colour.1.op())
            .store_op(vk::AttachmentStoreOp::STORE)];
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

    /// Sets both attachments to zero (no light, no coverage, infinitely far) in some rectangles, within a rendering.
    pub(crate) fn clear(&self, areas: &[vk::ClearRect]) {
        let zero = |aspect_mask| vk::ClearAttachment { aspect_mask, ..vk::ClearAttachment::default() };
        let what = [zero(vk::ImageAspectFlags::COLOR), zero(vk::ImageAspectFlags::DEPTH)];
        // SAFETY: a rendering with a colour and a depth attachment was begun; the rectangles lie in its area.
        unsafe { self.gpu.device.cmd_clear_attachments(self.cmd, &what, areas) };
    }

    /// Copies parts of a buffer to an image.
    pub(crate) fn copy_to_image(&self, from: &Buffer, image: &Image, regions: &[vk::BufferImageCopy]) {
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        // SAFETY: both are live and the regions lie within them; the image is in this layout.
        unsafe { self.gpu.device.cmd_copy_buffer_to_image(self.cmd, from.raw, image.raw, layout, regions) };
    }

    /// Copies parts of an image to a buffer.
    pub(crate) fn copy_from_image(&self, image: &Image, buffer: &Buffer, regions: &[vk::BufferImageCopy]) {
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        // SAFETY: both are live and the regions lie within them; the image is in this layout.
        unsafe { self.gpu.device.cmd_copy_image_to_buffer(self.cmd, image.raw, layout, buffer.raw, regions) };
    }

    /// Makes what was copied to or from the buffer, with `was`, come before what `stage` does with `access`.
    pub(crate) fn copied(
        &self,
        buffer: &Buffer,
        was: vk::AccessFlags2,
        (stage, access): (vk::PipelineStageFlags2, vk::AccessFlags2),
    ) {
        let barriers = [vk::BufferMemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COPY)
            .src_access_mask(was)
            .dst_stage_mask(stage)
            .dst_access_mask(access)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .buffer(buffer.raw)
            .size(vk::WHOLE_SIZE)];
        let info = vk::DependencyInfo::default().buffer_memory_barriers(&barriers);
        // SAFETY: the command buffer is being recorded, outside of a rendering; the buffer is live.
        unsafe { self.gpu.device.cmd_pipeline_barrier2(self.cmd, &info) };
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

#[cfg(test)]
mod tests {
    use super::*;

    const fn r(x: u32, y: u32, width: u32, height: u32) -> PixelRect {
        PixelRect { x, y, width, height }
    }

    #[test]
    fn rectangles_are_cut_and_joined() {
        assert_eq!(cut(r(10, 10, 20, 20), (25, 100)), Some(r(10, 10, 15, 20)));
        assert_eq!(cut(r(30, 10, 20, 20), (25, 100)), None);
        assert_eq!(cut(r(u32::MAX, 10, 20, 20), (25, 100)), None);
        let mut rest = Vec::new();
        let (whole, cutters) = (r(0, 0, 50, 40), [r(10, 5, 40, 10), r(5, 0, 10, 40), r(20, 10, 25, 20)]);
        around_all(whole, &cutters, &mut rest);
        for y in 0..50 {
            for x in 0..60 {
                let holds =
                    |q: &PixelRect| (q.x..q.x + q.width).contains(&x) && (q.y..q.y + q.height).contains(&y);
                let wanted = usize::from(holds(&whole) && !cutters.iter().any(holds));
                assert_eq!(rest.iter().filter(|q| holds(q)).count(), wanted, "pixel {x} {y}");
            }
        }
        assert_eq!(joined(r(10, 40, 5, 5), r(20, 10, 5, 5)), r(10, 10, 15, 35));
    }
}
