//! Copying pictures and meshes to the device when the renderer is made.

use std::sync::Arc;

use ash::vk;

use crate::{
    encoder::{CommandEncoder, Step},
    error::{Named, RenderError},
    gpu::Gpu,
    memory::{Access, Buffer, Image},
    passes::{COPIED_TO, NOTHING, SAMPLED},
};

/// How long copying one picture or mesh may take; a driver on a busy processor needs a while.
const UPLOAD_MS: u64 = 60_000;

/// A command pool and a fence that are gone after one use.
struct Once {
    gpu: Arc<Gpu>,
    pool: vk::CommandPool,
    fence: vk::Fence,
}

impl Drop for Once {
    fn drop(&mut self) {
        // SAFETY: `run_once` waits for the fence before it returns, or gives the device up; null handles are allowed.
        self.gpu.destroy(|device| unsafe {
            device.destroy_command_pool(self.pool, None);
            device.destroy_fence(self.fence, None);
        });
    }
}

/// Runs what `record` records, and waits for it.
pub(crate) fn run_once(gpu: &Arc<Gpu>, record: impl FnOnce(CommandEncoder<'_>)) -> Result<(), RenderError> {
    let device = &gpu.device;
    let info = vk::CommandPoolCreateInfo::default().queue_family_index(gpu.family);
    // SAFETY: `info` is complete.
    let pool = unsafe { device.create_command_pool(&info, None) }.named("vkCreateCommandPool")?;
    let mut once = Once { gpu: gpu.clone(), pool, fence: vk::Fence::null() };
    // SAFETY: the info is complete.
    once.fence =
        unsafe { device.create_fence(&vk::FenceCreateInfo::default(), None) }.named("vkCreateFence")?;
    let info = vk::CommandBufferAllocateInfo::default().command_pool(once.pool).command_buffer_count(1);
    // SAFETY: the pool is live.
    let cmds = unsafe { device.allocate_command_buffers(&info) }.named("vkAllocateCommandBuffers")?;
    let cmd = cmds.first().copied().unwrap_or_default();
    // SAFETY: a fresh command buffer; what is recorded outlives the wait below.
    unsafe {
        device
            .begin_command_buffer(cmd, &vk::CommandBufferBeginInfo::default())
            .named("vkBeginCommandBuffer")?;
        record(CommandEncoder { gpu, cmd });
        device.end_command_buffer(cmd).named("vkEndCommandBuffer")?;
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(cmd)];
        let submit = vk::SubmitInfo2::default().command_buffer_infos(&commands);
        device.queue_submit2(gpu.queue, &[submit], once.fence).named("vkQueueSubmit2")?;
    }
    // SAFETY: the fence is live and was submitted above.
    match unsafe { device.wait_for_fences(&[once.fence], true, UPLOAD_MS * 1_000_000) } {
        Err(vk::Result::TIMEOUT) => {
            gpu.abandon();
            Err(RenderError::Hung { what: "an upload", after_ms: UPLOAD_MS })
        }
        result => result.named("vkWaitForFences"),
    }
}

/// Fills an image, level by level from the largest, and makes it ready for sampling. Waits for the GPU.
pub(crate) fn upload_image(gpu: &Arc<Gpu>, image: &Image, levels: &[&[u8]]) -> Result<(), RenderError> {
    let total: usize = levels.iter().map(|l| l.len().next_multiple_of(16)).sum();
    let usage = vk::BufferUsageFlags::TRANSFER_SRC;
    let mut staging = Buffer::new(gpu, "upload", total as u64, usage, Access::Upload)?;
    let mut regions = Vec::with_capacity(levels.len());
    let mut offset = 0;
    for (bytes, level) in levels.iter().zip(0..) {
        staging.write(offset, bytes);
        let extent = vk::Extent3D {
            width: (image.shape.width >> level).max(1),
            height: (image.shape.height >> level).max(1),
            depth: 1,
        };
        let subresource = vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: level,
            base_array_layer: 0,
            layer_count: 1,
        };
        regions.push(vk::BufferImageCopy {
            buffer_offset: offset,
            image_extent: extent,
            image_subresource: subresource,
            ..vk::BufferImageCopy::default()
        });
        offset += bytes.len().next_multiple_of(16) as u64;
    }
    run_once(gpu, |to| {
        to.barrier([Step { image, from: NOTHING, to: COPIED_TO }]);
        to.copy_to_image(&staging, image, &regions);
        to.barrier([Step { image, from: COPIED_TO, to: SAMPLED }]);
    })
}
