//! One frame after the other: what a scene holds goes to the GPU in one command buffer.

use std::sync::Arc;

use ash::vk;
use bowwave_core::{
    event::Picture,
    frame::scene::{Pass, Scene},
    model::Model,
    water::{ReflectionMethod, Water},
};
use glam::Vec3;

use crate::{
    config::{Needs, RenderConfig},
    encoder::{CommandEncoder, Reach, Steps},
    error::{Named, RenderError},
    frame_data::{Capacity, FrameData, frame_set_layout},
    gpu::{DeviceInfo, Gpu},
    passes::{
        PassContext,
        all::Passes,
        lamplight::plan::on_own_ship,
        mirror::MirrorPass,
        phantoms::{PhantomLook, PhantomPass},
        shadow::ShadowPass,
        video::pictures::{PictureCounts, PicturePath},
        water::{WaterPass, baked::LobeDraws},
    },
    pipeline::{SetLayout, SetPool},
    plan::{Outline, Plan, with_gradients},
    rects::overlap,
    ring::{Completions, FRAME_QUERY, InFlight, QUERIES, SLOTS_MAX, Shared, Span},
    stamps::Stamps,
    target::{DrawTarget, same_place},
    view,
};

/// One frame in this many is timed unless [`Renderer::time_every`] says otherwise: a driver that runs on the processor finishes all work
/// before it writes a timestamp, so that the passes no longer overlap and the frame takes up to a millisecond longer. Fewer than one in a
/// hundred leave the frames' 99th percentile as it is.
pub const TIMED_EVERY: u64 = 120;

/// Smallest screen, pixels each way.
const SIZE_MIN: u32 = 16;

/// One slot's commands and data.
struct Slot {
    gpu: Arc<Gpu>,
    pool: vk::CommandPool,
    cmd: vk::CommandBuffer,
    data: FrameData,
}

/// One frame to be drawn.
pub struct DrawRequest<'a, T = ()> {
    /// What is drawn over the picture.
    pub scene: &'a Scene,
    /// The camera's picture.
    pub picture: &'a Picture,
    /// Whether the picture is another than that of the request before. If not, and if that one is still there, its bytes are not taken
    /// over again.
    pub picture_is_new: bool,
    /// Comes out again with the finished frame: what its reader must know of it.
    pub ticket: T,
}

/// Draws frames. Belongs to one thread; finished frames come out of [`Completions`], usually on another, each with the ticket of type
/// `T` that it was submitted with.
pub struct Renderer<T = ()> {
    gpu: Arc<Gpu>,
    shared: Arc<Shared<T>>,
    needs: Needs,
    models: Vec<Outline>,
    slots: Vec<Slot>,
    passes: Passes,
    plan: Plan,
    timed_every: u64,
    _frame_set: SetLayout,
    _sets: SetPool,
}

impl Renderer {
    /// Opens the device and makes everything that `config.needs`. `models` are what [`bowwave_core::model::ModelId`] counts. Frames have
    /// no tickets.
    pub fn new(config: &RenderConfig, models: &[Model]) -> Result<(Self, Completions), RenderError> {
        Self::with_tickets(config, models)
    }
}

impl<T> Renderer<T> {
    /// The same where each frame has a ticket.
    pub fn with_tickets(
        config: &RenderConfig,
        models: &[Model],
    ) -> Result<(Self, Completions<T>), RenderError> {
        let gpu = Arc::new(Gpu::open(config.device.as_deref(), config.validation)?);
        let max = gpu.limits.max_image_dimension2_d.min(gpu.limits.max_framebuffer_width);
        let size = (config.width, config.height);
        if size.0.min(size.1) < SIZE_MIN || size.0.max(size.1) > max {
            return Err(RenderError::Size { width: size.0, height: size.1, max });
        }
        let count = config.frames_in_flight.clamp(1, SLOTS_MAX);
        let shared = Arc::new(Shared::new(&gpu, size, count, config.time_outs)?);
        let textured = models.iter().filter(|m| m.texture.is_some()).count();
        let sets = SetPool::new(&gpu, u32::try_from(count + textured + 16).unwrap_or(u32::MAX), 4)?;
        let frame_set = frame_set_layout(&gpu)?;
        let context = PassContext {
            gpu: &gpu,
            frame_set: &frame_set,
            pool: &sets,
            size,
            words: shared.target(0).words,
            slots: count,
            optics: config.needs.optics,
            lamps: config.needs.lamps,
        };
        let passes = Passes::new(&context, config, models)?;
        let needs = config.needs.clone();
        let capacity = Capacity {
            boats: needs.boats_max,
            lights: needs.lights_max,
            lamps: needs.lamps,
            rounds: needs.rounds_max,
            lobes: needs.lobes(),
            wakes: needs.wakes_max,
        };
        let mut slots = Vec::with_capacity(count);
        for _ in 0..count {
            let data = FrameData::new(&gpu, &sets, &frame_set, capacity)?;
            slots.push(Slot::new(&gpu, data)?);
        }
        let renderer = Self {
            gpu,
            shared: shared.clone(),
            models: models.iter().map(Outline::of).collect(),
            slots,
            passes,
            plan: Plan::with_capacity(capacity, size),
            timed_every: TIMED_EVERY,
            needs,
            _frame_set: frame_set,
            _sets: sets,
        };
        Ok((renderer, Completions::new(shared)))
    }

    /// Times one frame in so many; the first one always.
    pub fn time_every(&mut self, frames: u64) {
        self.timed_every = frames.max(1);
    }

    /// Frames that can be in flight at a time: slots of the ring.
    pub fn frames_in_flight(&self) -> usize {
        self.slots.len()
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

    /// How the last new picture came to the GPU.
    pub fn picture_path(&self) -> PicturePath {
        self.passes.video.path().0
    }

    /// How many pictures came to the GPU which way.
    pub fn picture_counts(&self) -> PictureCounts {
        self.passes.video.path().1
    }

    /// Hands one frame to the GPU, which takes over its picture's bytes. A picture that is read where its driver put it is kept until
    /// the frame is finished. Returns whether it had to wait for a slot of the ring; it waits for nothing else, unless the picture's
    /// shape changed.
    ///
    /// [`RenderError::DeviceLost`] and [`RenderError::Hung`] as from [`Completions::wait_next`].
    pub fn submit(&mut self, request: DrawRequest<'_, T>) -> Result<bool, RenderError> {
        self.check(request.scene)?;
        let shared = self.shared.clone();
        self.submit_checked(request).map_err(|error| shared.fail(error))
    }

    fn submit_checked(&mut self, request: DrawRequest<'_, T>) -> Result<bool, RenderError> {
        let DrawRequest { scene, picture, picture_is_new, ticket } = request;
        let (index, waited) = self.shared.acquire()?;
        let value = self.shared.next_value();
        let kept = !picture_is_new && self.passes.video.still_has(picture);
        let prepared = kept || self.passes.video.is_prepared_for(picture);
        if !prepared {
            self.shared.rest()?;
            self.passes.video.prepare(picture)?;
        }
        let finished = self.shared.finished()?;
        let path = self.passes.video.take(picture, kept, value, finished);
        self.prepare(index, scene);
        let cmd = self.record(index, scene.water)?;
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
        let held = (path == PicturePath::Imported).then(|| picture.clone());
        let warm_up = value == 1 || !prepared;
        self.shared.submitted(index, InFlight { frame: scene.frame, warm_up, picture: held, ticket });
        Ok(waited)
    }

    /// Refuses a scene that this renderer was not made for.
    fn check(&self, scene: &Scene) -> Result<(), RenderError> {
        let (width, height) = self.shared.size;
        if (scene.lens.width, scene.lens.height) != (width, height) {
            return Err(RenderError::NotPrepared { what: "a lens of another screen size" });
        }
        let missing = |what| Err(RenderError::NotPrepared { what });
        if scene.boats.len() > self.needs.boats_max {
            return missing("more boats");
        }
        if scene.rounds.len() > self.needs.rounds_max {
            return missing("more tracers and splashes");
        }
        if scene.lights.len() > self.needs.lights_max {
            return missing("more navigation lights");
        }
        if scene.runs(Pass::Lamplight) && !self.needs.lamps {
            return missing("lamps");
        }
        if scene.runs(Pass::Noise) && !self.needs.noise {
            return missing("the camera's noise");
        }
        if scene.runs(Pass::Wake)
            && scene.boats.iter().filter(|b| b.wake.is_some()).count() > self.needs.wakes_max
        {
            return missing("more wakes");
        }
        let water = &self.passes.water;
        if scene.runs(Pass::Water) && water.as_ref().is_none_or(|w| !w.has(scene.water)) {
            return missing("another way to mirror");
        }
        Ok(())
    }

    /// Decides what is drawn and writes the slot's data; the GPU no longer reads it.
    fn prepare(&mut self, index: usize, scene: &Scene) {
        let Some(slot) = self.slots.get_mut(index) else { return };
        let size = self.shared.size;
        let phantoms = self.passes.phantoms.as_ref().filter(|_| scene.runs(Pass::Phantoms));
        let lit = if scene.runs(Pass::Lamplight) { on_own_ship(scene) } else { Vec3::ZERO };
        let is_lit = lit != Vec3::ZERO;
        let lit_rects = phantoms.filter(|_| is_lit).map_or(&[][..], PhantomPass::rects);
        self.plan.make(scene, &self.models, (size, MirrorPass::layer_size(size)), lit_rects);
        let plan = &mut self.plan;
        slot.data.write_frame(&view::frame_block(scene));
        slot.data.write_boats(&plan.boat_blocks);
        slot.data.write_waters(&plan.water_blocks);
        slot.data.write_methods(&plan.method_blocks);
        slot.data.write_lobes(&plan.lobe_blocks);
        if let Some(waves) = &plan.physics {
            slot.data.write_waves(waves);
        }
        slot.data.write_wakes(&plan.wake_blocks);
        slot.data.write_rounds(&plan.round_blocks);
        slot.data.write_lamplight(&plan.lamplight.nodes);
        slot.data.write_rects(&plan.list);
        if self.shared.next_value() == 1 {
            // The first frame lets drivers finish compiling, whatever lies before the phantoms in it.
            plan.rects.extend(phantoms.and_then(|pass| pass.rects().first().copied()));
        }
        plan.phantoms = phantoms.filter(|pass| pass.hide(&plan.rects)).map(|_| PhantomLook::of(scene, lit));
        (plan.quads, plan.renewed) = Default::default();
        let mut covered = true;
        if scene.runs(Pass::Hud) {
            let hud = &mut self.passes.hud;
            let quads = hud.prepare(&mut slot.data, scene);
            covered = hud.rects().any(|h| plan.rects.iter().any(|r| overlap(h, *r).is_some()));
            if covered {
                plan.quads = quads;
                plan.rects.extend(hud.rects());
            } else {
                plan.renewed = if hud.renew() { quads } else { Default::default() };
            }
        }
        let overlaid = self.passes.hud.rects().filter(|_| !covered);
        self.passes.video.divide(overlaid, &mut plan.overlaid, &mut plan.bare);
        plan.backdrop_regions.clear();
        if WaterPass::reads_video(scene.water.method) {
            let compares = scene.water.method != ReflectionMethod::Baked;
            let below = |r| if compares { with_gradients(r, size) } else { r };
            let below = plan.waters.iter().map(|w| below(w.rect));
            plan.backdrop_regions.extend(below.map(same_place));
        }
    }

    /// Records the frame.
    fn record(&self, index: usize, water: Water) -> Result<vk::CommandBuffer, RenderError> {
        let device = &self.gpu.device;
        let (slot, out) = (&self.slots[index], &self.shared.slots[index]);
        let to = CommandEncoder { gpu: &self.gpu, cmd: slot.cmd };
        let on = self.gpu.timestamp_ns.is_some()
            && self.shared.next_value() % self.timed_every == 1 % self.timed_every;
        let stamps = Stamps { to, queries: out.queries, on };
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
        let target = self.shared.target(index);
        let recording = FrameRecording { to, stamps, frame: slot.data.set, target, how: water };
        self.record_layers(&recording);
        if !self.plan.rects.is_empty() {
            self.record_kept(&recording);
            self.record_water(&recording);
            self.record_blends(&recording);
        }
        let mut steps = Steps::default();
        match &out.download {
            None => steps.add_memory(PIXELS_DRAWN, PIXELS_READ),
            Some(_) => steps.add_memory(PIXELS_DRAWN, PIXELS_COPIED),
        }
        steps.record(to);
        if let Some(download) = &out.download {
            recording.stamps.around(Span::Download, || target.record_download(to, download));
            let mut steps = Steps::default();
            steps.add_memory((PIXELS_COPIED.0, vk::AccessFlags2::TRANSFER_WRITE), PIXELS_READ);
            steps.record(to);
        }
        recording.stamps.write(FRAME_QUERY + 1);
        // SAFETY: recording was begun above.
        unsafe { device.end_command_buffer(slot.cmd) }.named("vkEndCommandBuffer")?;
        Ok(slot.cmd)
    }

    /// Records what does not depend on what is on the screen: the video, the mirrored boats, the boats.
    fn record_layers(&self, &FrameRecording { to, ref stamps, frame, target, how }: &FrameRecording<'_>) {
        let Passes { video, meshes, hud, .. } = &self.passes;
        let plan = &self.plan;
        let mirror = self.passes.mirror.as_ref().filter(|_| !plan.mirrors.is_empty());
        let boats = self.passes.boats.as_ref().filter(|_| !plan.boats.is_empty());
        let water = self.passes.water.as_ref().filter(|_| !plan.waters.is_empty());
        let reflect = self.passes.reflect.as_ref().filter(|_| !plan.reflects.is_empty());
        let mut steps = Steps::default();
        steps.add_memory((PIXELS_DRAWN.0 | PIXELS_COPIED.0, vk::AccessFlags2::NONE), PIXELS_DRAWN);
        // Wakes look it up as well, though no hull be in view.
        let shaded = boats.is_some() || !plan.wakes.is_empty();
        let shadow = self.passes.shadow.as_ref().filter(|_| shaded);
        steps.add(shadow.map(ShadowPass::before));
        steps.add(mirror.iter().flat_map(|m| m.before()).flatten());
        steps.add(boats.iter().flat_map(|b| b.before()));
        steps.add(water.iter().flat_map(|w| w.before(how)).flatten());
        steps.add(reflect.iter().flat_map(|r| r.before()));
        steps.record(to);
        if plan.renewed != [0; 3] {
            stamps.around(Span::Hud, || hud.record_layer(to, frame, plan.renewed));
        }
        // No barrier between these: a driver that runs on the processor sorts one's triangles while it fills another.
        stamps.around(Span::Video, || video.record(to, target, hud.overlay.set, &plan.overlaid, &plan.bare));
        if let Some(pass) = shadow {
            stamps.around(Span::Shadow, || pass.record(to, meshes, &plan.shadows));
        }
        if let Some(pass) = mirror {
            stamps
                .around(Span::Mirror, || pass.record(to, frame, meshes, &plan.mirrors, &plan.mirror_places));
            pass.record_lights(to, frame, &plan.mirror_lights, &plan.mirror_places);
        }
        let mut steps = Steps::default();
        steps.add(shadow.map(ShadowPass::between));
        steps.record(to);
        if let Some(pass) = boats {
            let clears = (&plan.clears[..], &plan.depth_clears[..]);
            stamps.around(Span::BoatLayer, || pass.record_layer(to, frame, meshes, &plan.boats, clears));
        }
        if plan.rects.is_empty() {
            return;
        }
        let mut steps = Steps::default();
        steps.add_memory(PIXELS_DRAWN, PIXELS_DRAWN);
        steps.add_memory(PIXELS_DRAWN, PIXELS_COPIED);
        steps.add(mirror.map(MirrorPass::between));
        steps.add(boats.iter().flat_map(|b| b.between()));
        steps.record(to);
    }

    /// Records how what phantoms hide is kept.
    fn record_kept(&self, &FrameRecording { to, ref stamps, target, .. }: &FrameRecording<'_>) {
        let Some((pass, _)) = self.phantoms() else { return };
        stamps.around(Span::Kept, || pass.record_copy(to, target));
        let mut steps = Steps::default();
        steps.add([pass.copied()]);
        steps.add_memory((PIXELS_COPIED.0, vk::AccessFlags2::NONE), PIXELS_DRAWN);
        steps.record(to);
    }

    /// The phantoms' pass and their look, where they hide something or are lit.
    fn phantoms(&self) -> Option<(&PhantomPass, PhantomLook)> {
        self.passes.phantoms.as_ref().zip(self.plan.phantoms)
    }

    /// Records what the water needs before it is drawn, in as few steps that wait for each other as there can be.
    fn record_water(&self, &FrameRecording { to, ref stamps, frame, target, how }: &FrameRecording<'_>) {
        let plan = &self.plan;
        let Some(water) = self.passes.water.as_ref().filter(|_| !plan.waters.is_empty()) else { return };
        let soft = self.passes.mirror.as_ref().filter(|_| how.method == ReflectionMethod::Full);
        let reflect = self.passes.reflect.as_ref().filter(|_| !plan.reflects.is_empty());
        let waters = &plan.waters;
        let draws = LobeDraws { frame, boats: waters, lobes: &plan.lobe_blocks };
        let mut steps = Steps::default();
        stamps.around(Span::Soften, || {
            steps.add(soft.and_then(|pass| pass.record_soft(to, &plan.mirror_places)));
            steps.add(reflect.and_then(|pass| pass.record_bands(to, &draws)).into_iter().flatten());
        });
        if !plan.backdrop_regions.is_empty() {
            stamps.around(Span::Backdrop, || {
                target.record_copy_of(to, &water.backdrop, &plan.backdrop_regions);
            });
        }
        steps.add([water.copied()]);
        // Nothing is drawn over what is still being copied.
        steps.add_memory((PIXELS_COPIED.0, vk::AccessFlags2::NONE), PIXELS_DRAWN);
        steps.record(to);
        let mut steps = Steps::default();
        stamps.around(Span::Field, || {
            water.record_field(to, frame, how, waters);
            steps.add(water.found(how));
            steps.add(reflect.and_then(|pass| pass.record_sums(to, &draws)).into_iter().flatten());
        });
        steps.record(to);
        let mut steps = Steps::default();
        if let Some(pass) = reflect {
            stamps.around(Span::Layers, || {
                steps.add(pass.record_layers(to, &draws).into_iter().flatten());
            });
        }
        steps.record(to);
    }

    /// Records what blends onto the screen, in one rendering.
    fn record_blends(&self, &FrameRecording { to, ref stamps, frame, target, how }: &FrameRecording<'_>) {
        let plan = &self.plan;
        let water = self.passes.water.as_ref().filter(|_| !plan.waters.is_empty());
        let Some(area) = target.begin_light(to, &plan.rects) else { return };
        if let Some(pass) = water {
            stamps.around(Span::Water, || {
                pass.record(to, frame, how, &plan.waters);
                if let Some(pass) = self.passes.reflect.as_ref().filter(|_| !plan.reflects.is_empty()) {
                    pass.record(to, frame, &plan.reflects);
                }
            });
        }
        if let Some(pass) = self.passes.wake.as_ref().filter(|_| !plan.wakes.is_empty()) {
            stamps.around(Span::Wake, || pass.record(to, frame, &plan.wakes));
        }
        if let Some(pass) = self.passes.lamplight.as_ref().filter(|_| !plan.lamplight.cells.is_empty()) {
            stamps.around(Span::Lamplight, || pass.record(to, frame, &plan.lamplight));
            to.scissor(area);
        }
        if let Some(pass) = self.passes.boats.as_ref().filter(|_| !plan.boats.is_empty()) {
            let what = (plan.hulls.len() as u32, plan.noisy);
            stamps.around(Span::Composite, || pass.record_composite(to, frame, what));
        }
        if let Some(pass) = self.passes.wake.as_ref().filter(|_| plan.wakes.iter().any(|w| w.spray)) {
            stamps.around(Span::Spray, || pass.record_spray(to, frame, &plan.wakes));
        }
        if let Some(pass) = self.passes.lights.as_ref().filter(|_| !plan.lights.is_empty()) {
            stamps.around(Span::Lights, || pass.record(to, frame, &plan.lights));
        }
        if let Some(pass) = self.passes.rounds.as_ref().filter(|_| !plan.rounds.is_empty()) {
            stamps.around(Span::Rounds, || pass.record(to, frame, &plan.rounds));
        }
        if let Some((pass, look)) = self.phantoms() {
            stamps.around(Span::Phantoms, || pass.record(to, &plan.rects, &look));
        }
        if plan.quads != [0; 3] {
            stamps.around(Span::Hud, || self.passes.hud.record(to, frame, plan.quads));
        }
        to.end();
    }
}

/// What all parts of a frame are recorded with.
struct FrameRecording<'a> {
    to: CommandEncoder<'a>,
    stamps: Stamps<'a>,
    /// Set of the frame's own data.
    frame: vk::DescriptorSet,
    target: &'a DrawTarget,
    how: Water,
}

impl<T> Drop for Renderer<T> {
    fn drop(&mut self) {
        if let Err(error) = self.shared.rest() {
            log::error!("the GPU did not come to rest, what is on it stays: {error}");
            self.gpu.abandon();
        }
        self.shared.close();
    }
}

impl<'a> DrawRequest<'a> {
    /// A request without a ticket.
    pub fn new(scene: &'a Scene, picture: &'a Picture, picture_is_new: bool) -> Self {
        Self { scene, picture, picture_is_new, ticket: () }
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
        self.gpu.destroy(|device| unsafe { device.destroy_command_pool(self.pool, None) });
    }
}

/// Pixels of the target are written, or blended with what is there.
const PIXELS_DRAWN: Reach = (
    vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
    vk::AccessFlags2::from_raw(
        vk::AccessFlags2::COLOR_ATTACHMENT_READ.as_raw() | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE.as_raw(),
    ),
);
/// Pixels of the target are copied.
const PIXELS_COPIED: Reach = (vk::PipelineStageFlags2::COPY, vk::AccessFlags2::TRANSFER_READ);
/// A finished frame is read by the host.
const PIXELS_READ: Reach = (vk::PipelineStageFlags2::HOST, vk::AccessFlags2::HOST_READ);
