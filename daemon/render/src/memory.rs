//! Buffers and images, each with memory of its own: there are few and they live as long as the renderer.

use std::{ptr::NonNull, sync::Arc};

use ash::vk;

use crate::{
    error::{Named, RenderError},
    gpu::Gpu,
};

/// Who touches a buffer's bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    /// The host writes through the mapping, the GPU reads.
    Upload,
    /// The GPU writes, the host reads through the mapping.
    Download,
}

impl Access {
    /// Memory kinds in order of preference. All are coherent: no flush is ever needed.
    fn kinds(self) -> &'static [vk::MemoryPropertyFlags] {
        const MAPPED: vk::MemoryPropertyFlags = vk::MemoryPropertyFlags::from_raw(
            vk::MemoryPropertyFlags::HOST_VISIBLE.as_raw() | vk::MemoryPropertyFlags::HOST_COHERENT.as_raw(),
        );
        const LOCAL: vk::MemoryPropertyFlags = vk::MemoryPropertyFlags::from_raw(
            MAPPED.as_raw() | vk::MemoryPropertyFlags::DEVICE_LOCAL.as_raw(),
        );
        const CACHED: vk::MemoryPropertyFlags = vk::MemoryPropertyFlags::from_raw(
            MAPPED.as_raw() | vk::MemoryPropertyFlags::HOST_CACHED.as_raw(),
        );
        match self {
            Self::Upload => &[LOCAL, MAPPED],
            Self::Download => &[CACHED, MAPPED],
        }
    }
}

/// A mapped buffer.
pub(crate) struct Buffer {
    gpu: Arc<Gpu>,
    pub(crate) raw: vk::Buffer,
    memory: vk::DeviceMemory,
    mapped: NonNull<u8>,
    pub(crate) size: u64,
    allocated: u64,
    what: &'static str,
}

// SAFETY: the mapping is plain memory that stays where it is; all access goes through `&self` / `&mut self` methods whose
// callers keep host and GPU apart by the frame ring.
unsafe impl Send for Buffer {}
// SAFETY: as above; shared access only reads.
unsafe impl Sync for Buffer {}

impl Buffer {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        what: &'static str,
        size: u64,
        usage: vk::BufferUsageFlags,
        access: Access,
    ) -> Result<Self, RenderError> {
        let info = vk::BufferCreateInfo::default().size(size.max(16)).usage(usage);
        // SAFETY: `info` is complete; the device is live.
        let raw = unsafe { gpu.device.create_buffer(&info, None) }.named_for("vkCreateBuffer", what)?;
        // SAFETY: `raw` was just made from this device.
        let needs = unsafe { gpu.device.get_buffer_memory_requirements(raw) };
        let memory = match gpu.allocate(what, needs, access.kinds()) {
            Ok(memory) => memory,
            Err(error) => {
                // SAFETY: nothing uses the buffer yet.
                unsafe { gpu.device.destroy_buffer(raw, None) };
                return Err(error);
            }
        };
        // SAFETY: the memory was made for this buffer and is mapped once, whole.
        let mapped = unsafe {
            gpu.device
                .bind_buffer_memory(raw, memory, 0)
                .and_then(|()| gpu.device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty()))
        };
        let mapped = mapped.named_for("vkMapMemory", what).and_then(|p| {
            NonNull::new(p.cast::<u8>()).ok_or(RenderError::OutOfMemory { call: "vkMapMemory", what })
        });
        match mapped {
            Ok(mapped) => Ok(Self {
                gpu: gpu.clone(),
                raw,
                memory,
                mapped,
                size: info.size,
                allocated: needs.size,
                what,
            }),
            Err(error) => {
                // SAFETY: nothing uses the buffer or its memory yet.
                unsafe {
                    gpu.device.destroy_buffer(raw, None);
                    gpu.free(what, needs.size, memory);
                }
                Err(error)
            }
        }
    }

    /// Copies `bytes` to `offset`, where the caller has made room for them: as with a slice, what would go beyond the end is a
    /// mistake of this crate's and ends the program.
    pub(crate) fn write(&mut self, offset: u64, bytes: &[u8]) {
        let room = usize::try_from(self.size.saturating_sub(offset)).unwrap_or(usize::MAX);
        assert!(bytes.len() <= room, "{} bytes at {offset} of {}", bytes.len(), self.size);
        if !bytes.is_empty() {
            // SAFETY: `offset + bytes.len()` lies within the mapping, source and target do not overlap, and the ring sees to it that
            // the GPU does not read this buffer now.
            unsafe {
                let target = self.mapped.as_ptr().add(usize::try_from(offset).unwrap_or(usize::MAX));
                std::ptr::copy_nonoverlapping(bytes.as_ptr(), target, bytes.len());
            }
        }
    }

    /// All bytes.
    ///
    /// # Safety
    /// The GPU has finished writing and does not write again while the slice lives.
    pub(crate) unsafe fn bytes(&self) -> &[u8] {
        // SAFETY: the mapping is `size` bytes of initialised memory (Vulkan memory has some value always); the rest is promised.
        unsafe { std::slice::from_raw_parts(self.mapped.as_ptr(), usize::try_from(self.size).unwrap_or(0)) }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if self.gpu.is_abandoned() {
            return;
        }
        // SAFETY: owners drop buffers only once the GPU is idle (see `Renderer::drop` and `Shared`).
        unsafe {
            self.gpu.device.destroy_buffer(self.raw, None);
            self.gpu.free(self.what, self.allocated, self.memory);
        }
    }
}

/// What an image is made of.
#[derive(Clone, Copy)]
pub(crate) struct ImageShape {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) format: vk::Format,
    /// A second format that the image can be viewed in.
    pub(crate) second: Option<vk::Format>,
    pub(crate) usage: vk::ImageUsageFlags,
    pub(crate) samples: vk::SampleCountFlags,
    pub(crate) levels: u32,
}

impl ImageShape {
    pub(crate) fn new(size: (u32, u32), format: vk::Format, usage: vk::ImageUsageFlags) -> Self {
        let samples = vk::SampleCountFlags::TYPE_1;
        Self { width: size.0, height: size.1, format, second: None, usage, samples, levels: 1 }
    }
}

/// An image of the device's own memory.
pub(crate) struct Image {
    gpu: Arc<Gpu>,
    pub(crate) raw: vk::Image,
    memory: vk::DeviceMemory,
    /// All of it, in its own format.
    pub(crate) view: vk::ImageView,
    /// All of it, in the second format; the same as `view` where there is none.
    pub(crate) second_view: vk::ImageView,
    pub(crate) shape: ImageShape,
    allocated: u64,
    what: &'static str,
}

impl Image {
    pub(crate) fn new(gpu: &Arc<Gpu>, what: &'static str, shape: ImageShape) -> Result<Self, RenderError> {
        let formats = [shape.format, shape.second.unwrap_or(shape.format)];
        let mut list = vk::ImageFormatListCreateInfo::default().view_formats(&formats);
        let mut info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(shape.format)
            .extent(vk::Extent3D { width: shape.width, height: shape.height, depth: 1 })
            .mip_levels(shape.levels)
            .array_layers(1)
            .samples(shape.samples)
            .usage(shape.usage);
        if shape.second.is_some() {
            info = info.flags(vk::ImageCreateFlags::MUTABLE_FORMAT).push_next(&mut list);
        }
        // SAFETY: `info` is complete and what it points to outlives the call.
        let raw = unsafe { gpu.device.create_image(&info, None) }.named_for("vkCreateImage", what)?;
        // SAFETY: `raw` was just made from this device.
        let needs = unsafe { gpu.device.get_image_memory_requirements(raw) };
        let kinds = [vk::MemoryPropertyFlags::DEVICE_LOCAL, vk::MemoryPropertyFlags::empty()];
        let memory = match gpu.allocate(what, needs, &kinds) {
            Ok(memory) => memory,
            Err(error) => {
                // SAFETY: nothing uses the image yet.
                unsafe { gpu.device.destroy_image(raw, None) };
                return Err(error);
            }
        };
        let none = vk::ImageView::null();
        let mut image = Self {
            gpu: gpu.clone(),
            raw,
            memory,
            view: none,
            second_view: none,
            shape,
            allocated: needs.size,
            what,
        };
        // From here on dropping `image` cleans up.
        // SAFETY: the memory was made for this image.
        unsafe { gpu.device.bind_image_memory(raw, memory, 0) }.named_for("vkBindImageMemory", what)?;
        image.view = image.make_view(shape.format)?;
        image.second_view = match shape.second {
            Some(format) => image.make_view(format)?,
            None => image.view,
        };
        Ok(image)
    }

    /// Colour or depth.
    pub(crate) fn aspect(&self) -> vk::ImageAspectFlags {
        if self.shape.format == vk::Format::D32_SFLOAT {
            vk::ImageAspectFlags::DEPTH
        } else {
            vk::ImageAspectFlags::COLOR
        }
    }

    fn make_view(&self, format: vk::Format) -> Result<vk::ImageView, RenderError> {
        let range = vk::ImageSubresourceRange {
            aspect_mask: self.aspect(),
            base_mip_level: 0,
            level_count: self.shape.levels,
            base_array_layer: 0,
            layer_count: 1,
        };
        let info = vk::ImageViewCreateInfo::default()
            .image(self.raw)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format)
            .subresource_range(range);
        // SAFETY: the image is live and bound; the format is one of those it was made for.
        unsafe { self.gpu.device.create_image_view(&info, None) }.named_for("vkCreateImageView", self.what)
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        if self.gpu.is_abandoned() {
            return;
        }
        // SAFETY: owners drop images only once the GPU is idle; null views are allowed.
        unsafe {
            if self.second_view != self.view {
                self.gpu.device.destroy_image_view(self.second_view, None);
            }
            self.gpu.device.destroy_image_view(self.view, None);
            self.gpu.device.destroy_image(self.raw, None);
            self.gpu.free(self.what, self.allocated, self.memory);
        }
    }
}
