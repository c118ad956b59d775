//! Graphics pipelines and descriptors, as far as the passes have them in common.

use std::sync::Arc;

use ash::vk;
use shaders_spirv::{Shader, interface::DrawBlock};

use crate::{
    error::{Named, RenderError},
    gpu::Gpu,
};

/// Format of the screen image as blending and sampling see it: codes in memory, linear light in the shader.
pub(crate) const SRGB: vk::Format = vk::Format::R8G8B8A8_SRGB;
/// The same memory as codes.
pub(crate) const UNORM: vk::Format = vk::Format::R8G8B8A8_UNORM;
/// Linear light in memory: a driver that runs on the processor samples it several times as fast as codes.
pub(crate) const LIGHT: vk::Format = vk::Format::R16G16B16A16_SFLOAT;
/// Sums of light.
pub(crate) const SUMS: vk::Format = vk::Format::R32G32B32A32_SFLOAT;
/// Most images that a pass draws to at once.
pub(crate) const TARGETS_MAX: usize = 4;
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
        self.gpu.destroy(|device| unsafe { device.destroy_descriptor_set_layout(self.raw, None) });
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

    /// Points a binding to something. No frame in flight uses the set.
    pub(crate) fn write(&self, set: vk::DescriptorSet, binding: u32, bound: Bound) {
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
        self.gpu.destroy(|device| unsafe { device.destroy_descriptor_pool(self.raw, None) });
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
        self.gpu.destroy(|device| unsafe { device.destroy_sampler(self.raw, None) });
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

/// What a pipeline does with reverse-Z depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DepthUse {
    /// There is none.
    None,
    /// What is nearer hides what is drawn.
    Test,
    /// And what is drawn hides what is farther.
    Write,
}

/// What tells one pipeline from another.
pub(crate) struct PipelineShape<'a> {
    pub(crate) vertex: Shader,
    /// None where depth alone is drawn.
    pub(crate) fragment: Option<Shader>,
    /// Vertex shader's specialisation constants, from 0 on.
    pub(crate) vertex_constants: &'a [u32],
    /// Fragment shader's specialisation constants, from 0 on.
    pub(crate) constants: &'a [u32],
    pub(crate) sets: &'a [&'a SetLayout],
    /// Bytes of push constants, seen by both stages.
    pub(crate) push: usize,
    /// Stride, and format and offset of each attribute.
    pub(crate) vertices: Option<(u32, &'a [(vk::Format, u32)])>,
    pub(crate) topology: vk::PrimitiveTopology,
    pub(crate) colour: vk::Format,
    /// Images of that format that are drawn to at once, up to [`TARGETS_MAX`].
    pub(crate) targets: usize,
    pub(crate) blend: Blend,
    /// Leaves out back faces, front ones being seen this way round.
    pub(crate) cull: Option<vk::FrontFace>,
    pub(crate) depth: DepthUse,
    pub(crate) samples: vk::SampleCountFlags,
}

impl<'a> PipelineShape<'a> {
    /// Depth alone, without constants, attributes and sets.
    pub(crate) fn of_depth(vertex: Shader) -> Self {
        Self {
            vertex,
            fragment: None,
            vertex_constants: &[],
            constants: &[],
            sets: &[],
            push: 0,
            vertices: None,
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            colour: SRGB,
            targets: 0,
            blend: Blend::Replace,
            cull: None,
            depth: DepthUse::Write,
            samples: vk::SampleCountFlags::TYPE_1,
        }
    }

    /// Strips of triangles, told apart by a [`DrawBlock`], laid over the screen by their coverage.
    pub(crate) fn over_screen(vertex: Shader, fragment: Shader, sets: &'a [&'a SetLayout]) -> Self {
        Self {
            vertex,
            fragment: Some(fragment),
            vertex_constants: &[],
            constants: &[],
            sets,
            push: size_of::<DrawBlock>(),
            vertices: None,
            topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
            colour: SRGB,
            targets: 1,
            blend: Blend::Over,
            cull: None,
            depth: DepthUse::None,
            samples: vk::SampleCountFlags::TYPE_1,
        }
    }
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
        let fragment = shape.fragment.map(|shader| Module::new(gpu, shader)).transpose()?;
        pipeline.raw = pipeline.build(shape, &vertex, fragment.as_ref())?;
        Ok(pipeline)
    }

    fn build(
        &self,
        shape: &PipelineShape<'_>,
        vertex: &Module,
        fragment: Option<&Module>,
    ) -> Result<vk::Pipeline, RenderError> {
        let [for_vertices, for_fragments] = [shape.vertex_constants, shape.constants].map(entries);
        let vertex_special = vk::SpecializationInfo::default()
            .map_entries(&for_vertices)
            .data(bytemuck::cast_slice(shape.vertex_constants));
        let special = vk::SpecializationInfo::default()
            .map_entries(&for_fragments)
            .data(bytemuck::cast_slice(shape.constants));
        let stages = [
            vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::VERTEX)
                .module(vertex.raw)
                .name(c"main")
                .specialization_info(&vertex_special),
            vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::FRAGMENT)
                .module(fragment.map_or(vk::ShaderModule::null(), |f| f.raw))
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
            .depth_test_enable(shape.depth != DepthUse::None)
            .depth_write_enable(shape.depth == DepthUse::Write)
            .depth_compare_op(vk::CompareOp::GREATER);
        let targets = shape.targets.min(TARGETS_MAX);
        let blends = [blend_state(shape.blend); TARGETS_MAX];
        let blends = &blends[..targets];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(blends);
        let dynamic_states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic_states);
        let formats = [shape.colour; TARGETS_MAX];
        let mut rendering =
            vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&formats[..targets]);
        if shape.depth != DepthUse::None {
            rendering = rendering.depth_attachment_format(DEPTH);
        }
        let info = vk::GraphicsPipelineCreateInfo::default()
            .stages(if fragment.is_some() { &stages } else { &stages[..1] })
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
        self.gpu.destroy(|device| unsafe {
            device.destroy_pipeline(self.raw, None);
            device.destroy_pipeline_layout(self.layout, None);
        });
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
