//! One frame after the other: what a scene holds goes to the GPU in one command buffer.

use std::sync::Arc;

use ash::vk;
use bowwave_core::{
    event::Picture,
    model::{Model, ModelKind},
    scene::{Pass, PixelRect, ReflectionMethod, Scene, ShadowLevel},
};
use shaders_spirv::interface::BoatBlock;

use crate::{
    error::{Named, RenderError},
    frame_data::{Capacity, FrameData, frame_set_layout},
    gpu::{DeviceInfo, Gpu},
    memory::{Image, ImageShape},
    meshes::Meshes,
    passes::{
        COPIED_FROM, DRAWN, Making,
        boats::{BoatDraw, BoatsPass},
        hud::HudPass,
        video::{PictureShape, VideoPass},
    },
    pipeline::{Begin, Recorder, SRGB, SetLayout, SetPool, Step, UNORM, cut, disjoint},
    ring::{Completions, FRAME_QUERY, QUERIES, SLOTS_MAX, Shared, Span},
    view,
};

/// What can ever be asked of a renderer. The rest is neither compiled nor allocated.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// Most boats in one frame.
    pub boats_max: usize,
    /// Most tracers, splashes and strikes in one frame.
    pub rounds_max: usize,
    /// How the sea may have to mirror.
    pub waters: Vec<(ReflectionMethod, ShadowLevel)>,
}

/// How a renderer is made.
#[derive(Clone, Debug)]
pub struct RenderConfig {
    /// Screen width in pixels.
    pub width: u32,
    /// Screen height in pixels.
    pub height: u32,
    /// Index of the device, or a part of its name; `None`: the first GPU, or the first device of any kind.
    pub device: Option<String>,
    /// Whether Vulkan's validation layer watches. Slow; for tests.
    pub validation: bool,
    /// Frames that may be with the GPU or the reader at once, 1 to 8; 3 keeps both busy.
    pub frames_in_flight: usize,
    /// What can ever be asked.
    pub needs: Needs,
    /// The pictures that will come, so that the first frame need not prepare for them.
    pub picture: Option<PictureShape>,
}

/// Smallest screen, pixels each way.
const SIZE_MIN: u32 = 16;

/// One slot's commands and data.
struct Slot {
    gpu: Arc<Gpu>,
    pool: vk::CommandPool,
    cmd: vk::CommandBuffer,
    data: FrameData,
}

/// What a frame is made of, kept from frame to frame for its memory.
#[derive(Default)]
struct Scratch {
    blocks: Vec<BoatBlock>,
    boats: Vec<BoatDraw>,
    pieces: Vec<PixelRect>,
}

/// Draws frames. Belongs to one thread; finished frames come out of [`Completions`], usually on another.
pub struct Renderer {
    gpu: Arc<Gpu>,
    shared: Arc<Shared>,
    needs: Needs,
    kinds: Vec<ModelKind>,
    slots: Vec<Slot>,
    target: Image,
    meshes: Meshes,
    video: VideoPass,
    boats: Option<BoatsPass>,
    hud: HudPass,
    scratch: Scratch,
    _frame_set: SetLayout,
    _sets: SetPool,
}

impl Renderer {
    /// Opens the device and makes everything that `config.needs`. `models` are what [`bowwave_core::model::ModelId`] counts.
    pub fn new(config: &RenderConfig, models: &[Model]) -> Result<(Self, Completions), RenderError> {
        let gpu = Arc::new(Gpu::open(config.device.as_deref(), config.validation)?);
        let max = gpu.limits.max_image_dimension2_d.min(gpu.limits.max_framebuffer_width);
        let size = (config.width, config.height);
        if size.0.min(size.1) < SIZE_MIN || size.0.max(size.1) > max {
            return Err(RenderError::Size { width: size.0, height: size.1, max });
        }
        let count = config.frames_in_flight.clamp(1, SLOTS_MAX);
        let shared = Arc::new(Shared::new(&gpu, size, count)?);
        let textured = models.iter().filter(|m| m.texture.is_some()).count();
        let sets = SetPool::new(&gpu, u32::try_from(count + textured + 8).unwrap_or(u32::MAX), 4)?;
        let frame_set = frame_set_layout(&gpu)?;
        let making = Making { gpu: &gpu, frame_set: &frame_set, pool: &sets, size, slots: count };
        let needs = config.needs.clone();
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC;
        let shape = ImageShape { second: Some(SRGB), ..ImageShape::new(size, UNORM, usage) };
        let target = Image::new(&gpu, "screen", shape)?;
        let drawn_models = if needs.boats_max > 0 { models } else { &[] };
        let meshes = Meshes::new(&making, drawn_models)?;
        let boats = match needs.boats_max {
            0 => None,
            _ => Some(BoatsPass::new(&making, &meshes, textured > 0)?),
        };
        let video = VideoPass::new(&making, config.picture)?;
        let hud = HudPass::new(&making)?;
        let capacity = Capacity { boats: needs.boats_max, rounds: needs.rounds_max };
        let scratch = Scratch {
            blocks: Vec::with_capacity(needs.boats_max * 2),
            boats: Vec::with_capacity(needs.boats_max),
            pieces: Vec::with_capacity(needs.boats_max * 8),
        };
        let mut renderer = Self {
            gpu: gpu.clone(),
            shared: shared.clone(),
            kinds: models.iter().map(|m| m.kind).collect(),
            slots: Vec::with_capacity(count),
            target,
            meshes,
            video,
            boats,
            hud,
            scratch,
            needs,
            _frame_set: frame_set,
            _sets: sets,
        };
        for _ in 0..count {
            let data = FrameData::new(&gpu, &renderer._sets, &renderer._frame_set, capacity)?;
            let slot = Slot::new(&gpu, data)?;
            renderer.slots.push(slot);
        }
        Ok((renderer, Completions::new(shared)))
    }

    /// The device that draws.
    pub fn device(&self) -> &DeviceInfo {
        self.gpu.info()
    }

    /// What is allocated on the device, in bytes by purpose.
    pub fn memory(&self) -> Vec<(&'static str, u64)> {
        self.gpu.memory()
    }

    /// What the validation layer has said, from severity "warning" on; empty without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.gpu.messages()
    }

    /// Hands one frame to the GPU: `scene` over `picture`, whose bytes are copied unless `picture_is_new` is false and the last
    /// picture is still there. Returns whether it had to wait for a slot of the ring; it waits for nothing else.
    pub fn submit(
        &mut self,
        scene: &Scene,
        picture: &Picture,
        picture_is_new: bool,
    ) -> Result<bool, RenderError> {
        self.check(scene)?;
        let (index, waited) = self.shared.acquire()?;
        if picture_is_new || !self.video.has_picture() {
            self.video.take(picture)?;
        }
        let plan = self.prepare(index, scene);
        let cmd = self.record(index, &plan)?;
        let value = self.shared.next_value();
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(cmd)];
        let signals = [vk::SemaphoreSubmitInfo::default()
            .semaphore(self.shared.timeline)
            .value(value)
            .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
        let submit =
            vk::SubmitInfo2::default().command_buffer_infos(&commands).signal_semaphore_infos(&signals);
        // SAFETY: the command buffer is complete and its slot is free; only this thread submits.
        unsafe { self.gpu.device.queue_submit2(self.gpu.queue, &[submit], vk::Fence::null()) }
            .named("vkQueueSubmit2")?;
        self.shared.submitted(index, scene.frame);
        Ok(waited)
    }

    /// Refuses a scene that this renderer was not made for.
    fn check(&self, scene: &Scene) -> Result<(), RenderError> {
        let (width, height) = self.shared.size;
        if (scene.lens.width, scene.lens.height) != (width, height) {
            return Err(RenderError::NotPrepared { what: "a lens of another screen size" });
        }
        if scene.runs(Pass::Boats) && scene.boats.len() > self.needs.boats_max {
            return Err(RenderError::NotPrepared { what: "more boats" });
        }
        Ok(())
    }

    /// Writes the slot's data; the GPU no longer reads it.
    fn prepare(&mut self, index: usize, scene: &Scene) -> Plan {
        let size = self.shared.size;
        let Scratch { blocks, boats, pieces } = &mut self.scratch;
        blocks.clear();
        boats.clear();
        for boat in &scene.boats {
            let Some(kind) = self.kinds.get(usize::from(boat.model.0)) else { continue };
            let pose = view::drawn_pose(&scene.camera, boat, *kind);
            if let Some(rect) = boat.hull.and_then(|r| cut(r, size))
                && scene.runs(Pass::Boats)
            {
                boats.push(BoatDraw { model: boat.model, index: blocks.len() as u32, rect });
                blocks.push(view::boat_block(scene, boat, &pose, false));
            }
        }
        disjoint(boats.iter().map(|b| b.rect), pieces);
        let Some(slot) = self.slots.get_mut(index) else { return Plan::default() };
        slot.data.write_frame(&view::frame_block(scene));
        slot.data.write_boats(blocks);
        let quads = self.hud.prepare(&mut slot.data, &scene.hud);
        Plan { quads }
    }

    /// Records the frame.
    fn record(&self, index: usize, plan: &Plan) -> Result<vk::CommandBuffer, RenderError> {
        let device = &self.gpu.device;
        let (slot, out) = (&self.slots[index], &self.shared.slots[index]);
        let to = Recorder { gpu: &self.gpu, cmd: slot.cmd };
        let stamps = Stamps { to, queries: out.queries, on: self.gpu.timestamp_ns.is_some() };
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the slot is free, so the GPU uses neither pool nor buffer nor queries.
        unsafe {
            device
                .reset_command_pool(slot.pool, vk::CommandPoolResetFlags::empty())
                .named("vkResetCommandPool")?;
            device.begin_command_buffer(slot.cmd, &info).named("vkBeginCommandBuffer")?;
            device.cmd_reset_query_pool(slot.cmd, out.queries, 0, QUERIES);
        }
        stamps.write(FRAME_QUERY);
        self.record_passes(to, &stamps, slot.data.set, plan);
        self.record_download(to, out.download.raw);
        stamps.write(FRAME_QUERY + 1);
        // SAFETY: recording was begun above.
        unsafe { device.end_command_buffer(slot.cmd) }.named("vkEndCommandBuffer")?;
        Ok(slot.cmd)
    }

    /// The passes. What does not depend on the video is drawn before the first barrier, everything that blends onto the screen
    /// in one rendering after it.
    fn record_passes(&self, to: Recorder<'_>, stamps: &Stamps<'_>, frame: vk::DescriptorSet, plan: &Plan) {
        let boats = self.boats.as_ref().filter(|_| !self.scratch.boats.is_empty());
        let after_copy = (COPIED_FROM.0, vk::AccessFlags2::NONE, vk::ImageLayout::UNDEFINED);
        let mut steps = Steps::default();
        steps.add(Step { image: &self.target, from: after_copy, to: DRAWN });
        boats.iter().flat_map(|b| b.before()).for_each(|s| steps.add(s));
        steps.record(to);
        stamps.around(Span::Video, || self.video.record(to, self.target.view));
        let mut steps = Steps::default();
        steps.add(Step { image: &self.target, from: DRAWN, to: DRAWN });
        if let Some(pass) = boats {
            stamps
                .around(Span::BoatLayer, || pass.record_layer(to, frame, &self.meshes, &self.scratch.boats));
            steps.add(pass.between());
        }
        steps.record(to);
        let (width, height) = self.shared.size;
        let area = PixelRect { x: 0, y: 0, width, height };
        to.begin(area, (self.target.second_view, Begin::Keep), None);
        to.window([0.0, 0.0, width as f32, height as f32], area);
        if let Some(pass) = boats {
            stamps.around(Span::Composite, || pass.record_composite(to, frame, &self.scratch.pieces));
        }
        stamps.around(Span::Hud, || self.hud.record(to, frame, plan.quads));
        to.end();
    }

    /// The screen into the slot's buffer.
    fn record_download(&self, to: Recorder<'_>, buffer: vk::Buffer) {
        to.barrier([Step { image: &self.target, from: DRAWN, to: COPIED_FROM }]);
        let subresource = vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: 1,
        };
        let (width, height) = self.shared.size;
        let region = vk::BufferImageCopy {
            image_subresource: subresource,
            image_extent: vk::Extent3D { width, height, depth: 1 },
            ..vk::BufferImageCopy::default()
        };
        let host = [vk::MemoryBarrier2::default()
            .src_stage_mask(COPIED_TO_HOST.0)
            .src_access_mask(COPIED_TO_HOST.1)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let info = vk::DependencyInfo::default().memory_barriers(&host);
        // SAFETY: the buffer has room for the whole screen; its reader has given it back.
        unsafe {
            self.gpu.device.cmd_copy_image_to_buffer(
                to.cmd,
                self.target.raw,
                COPIED_FROM.2,
                buffer,
                &[region],
            );
            self.gpu.device.cmd_pipeline_barrier2(to.cmd, &info);
        }
    }
}

/// The copy whose result the host reads.
const COPIED_TO_HOST: (vk::PipelineStageFlags2, vk::AccessFlags2) =
    (vk::PipelineStageFlags2::COPY, vk::AccessFlags2::TRANSFER_WRITE);

impl Drop for Renderer {
    fn drop(&mut self) {
        if let Err(error) = self.gpu.wait_idle() {
            log::error!("the GPU did not come to rest: {error}");
        }
        self.shared.close();
    }
}

impl Slot {
    fn new(gpu: &Arc<Gpu>, data: FrameData) -> Result<Self, RenderError> {
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(gpu.family);
        // SAFETY: `info` is complete.
        let pool = unsafe { gpu.device.create_command_pool(&info, None) }.named("vkCreateCommandPool")?;
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool is live.
        let cmds = unsafe { gpu.device.allocate_command_buffers(&info) }.named("vkAllocateCommandBuffers")?;
        Ok(Self { gpu: gpu.clone(), pool, cmd: cmds.first().copied().unwrap_or_default(), data })
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        // SAFETY: the renderer waits for the GPU before it lets go of its slots.
        unsafe { self.gpu.device.destroy_command_pool(self.pool, None) };
    }
}

/// What was decided while the data were written.
#[derive(Default)]
struct Plan {
    quads: u32,
}

/// Timestamps of one frame.
struct Stamps<'a> {
    to: Recorder<'a>,
    queries: vk::QueryPool,
    on: bool,
}

impl Stamps<'_> {
    fn write(&self, query: u32) {
        if self.on {
            let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
            // SAFETY: the command buffer is being recorded and the query was reset in it.
            unsafe { self.to.gpu.device.cmd_write_timestamp2(self.to.cmd, stage, self.queries, query) };
        }
    }

    fn around(&self, span: Span, record: impl FnOnce()) {
        self.write(span.first_query());
        record();
        self.write(span.first_query() + 1);
    }
}

/// A few image steps for one barrier.
#[derive(Default)]
struct Steps<'a> {
    steps: [Option<Step<'a>>; 8],
    count: usize,
}

impl<'a> Steps<'a> {
    fn add(&mut self, step: Step<'a>) {
        if let Some(place) = self.steps.get_mut(self.count) {
            *place = Some(step);
            self.count += 1;
        }
    }

    fn record(&self, to: Recorder<'_>) {
        let steps = self.steps.iter().flatten().copied();
        to.barrier(steps);
    }
}
