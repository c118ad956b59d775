//! Buffers and images: there are few and they live as long as the renderer, so that each has memory of its own.

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
        // SAFETY: owners drop buffers only once the GPU is idle (see `Renderer::drop` and `Shared`).
        self.gpu.destroy(|device| unsafe {
            device.destroy_buffer(self.raw, None);
            self.gpu.free(self.what, self.allocated, self.memory);
        });
    }
}

/// Size, format and use of an image.
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
    /// Rows of texels one after the other, as the host has them, or what suits the device.
    pub(crate) tiling: vk::ImageTiling,
}

impl ImageShape {
    pub(crate) fn new(size: (u32, u32), format: vk::Format, usage: vk::ImageUsageFlags) -> Self {
        Self {
            width: size.0,
            height: size.1,
            format,
            second: None,
            usage,
            samples: vk::SampleCountFlags::TYPE_1,
            levels: 1,
            tiling: vk::ImageTiling::OPTIMAL,
        }
    }
}

/// Memory of one image, or of several that lie at the same place.
struct ImageMemory {
    gpu: Arc<Gpu>,
    raw: vk::DeviceMemory,
    size: u64,
    what: &'static str,
}

impl ImageMemory {
    fn new(
        gpu: &Arc<Gpu>,
        what: &'static str,
        needs: vk::MemoryRequirements,
        kinds: &[vk::MemoryPropertyFlags],
    ) -> Result<Self, RenderError> {
        let raw = gpu.allocate(what, needs, kinds)?;
        Ok(Self { gpu: gpu.clone(), raw, size: needs.size, what })
    }
}

impl Drop for ImageMemory {
    fn drop(&mut self) {
        // SAFETY: the images, which are dropped first, were its only users; freeing ends its mapping.
        self.gpu.destroy(|_| unsafe { self.gpu.free(self.what, self.size, self.raw) });
    }
}

/// An image.
pub(crate) struct Image {
    gpu: Arc<Gpu>,
    pub(crate) raw: vk::Image,
    /// All of it, in its own format.
    pub(crate) view: vk::ImageView,
    /// All of it, in the second format; the same as `view` where there is none.
    pub(crate) second_view: vk::ImageView,
    pub(crate) shape: ImageShape,
    what: &'static str,
    memory: Option<Arc<ImageMemory>>,
}

impl Image {
    /// An image in memory of the device's own.
    pub(crate) fn new(gpu: &Arc<Gpu>, what: &'static str, shape: ImageShape) -> Result<Self, RenderError> {
        let mut image = Self::without_memory(gpu, what, shape)?;
        let kinds = [vk::MemoryPropertyFlags::DEVICE_LOCAL, vk::MemoryPropertyFlags::empty()];
        image.bind(Arc::new(ImageMemory::new(gpu, what, image.needs(), &kinds)?))?;
        Ok(image)
    }

    fn without_memory(gpu: &Arc<Gpu>, what: &'static str, shape: ImageShape) -> Result<Self, RenderError> {
        let formats = [shape.format, shape.second.unwrap_or(shape.format)];
        let mut list = vk::ImageFormatListCreateInfo::default().view_formats(&formats);
        let mut info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(shape.format)
            .extent(vk::Extent3D { width: shape.width, height: shape.height, depth: 1 })
            .mip_levels(shape.levels)
            .array_layers(1)
            .samples(shape.samples)
            .tiling(shape.tiling)
            .usage(shape.usage);
        if shape.second.is_some() {
            info = info.flags(vk::ImageCreateFlags::MUTABLE_FORMAT).push_next(&mut list);
        }
        // SAFETY: `info` is complete and what it points to outlives the call.
        let raw = unsafe { gpu.device.create_image(&info, None) }.named_for("vkCreateImage", what)?;
        let none = vk::ImageView::null();
        // From here on dropping the image cleans up.
        Ok(Self { gpu: gpu.clone(), raw, view: none, second_view: none, shape, what, memory: None })
    }

    fn needs(&self) -> vk::MemoryRequirements {
        // SAFETY: `raw` was made from this device.
        unsafe { self.gpu.device.get_image_memory_requirements(self.raw) }
    }

    /// Puts the image at the beginning of `memory` and makes its views.
    fn bind(&mut self, memory: Arc<ImageMemory>) -> Result<(), RenderError> {
        // SAFETY: the memory fits this image, which has none yet.
        unsafe { self.gpu.device.bind_image_memory(self.raw, memory.raw, 0) }
            .named_for("vkBindImageMemory", self.what)?;
        self.memory = Some(memory);
        self.view = self.make_view(self.shape.format)?;
        self.second_view = match self.shape.second {
            Some(format) => self.make_view(format)?,
            None => self.view,
        };
        Ok(())
    }

    /// Bytes from one row to the next, where rows lie one after the other from the memory's beginning on.
    fn pitch(&self) -> Option<u64> {
        let subresource = vk::ImageSubresource { aspect_mask: self.aspect(), mip_level: 0, array_layer: 0 };
        // SAFETY: the image is live and of linear tiling, or nothing is asked.
        let layout = (self.shape.tiling == vk::ImageTiling::LINEAR)
            .then(|| unsafe { self.gpu.device.get_image_subresource_layout(self.raw, subresource) })?;
        (layout.offset == 0).then_some(layout.row_pitch)
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
        // SAFETY: owners drop images only once the GPU is idle; null views are allowed. Its memory goes after it.
        self.gpu.destroy(|device| unsafe {
            if self.second_view != self.view {
                device.destroy_image_view(self.second_view, None);
            }
            device.destroy_image_view(self.view, None);
            device.destroy_image(self.raw, None);
        });
    }
}

/// Two images of the same pixels in memory that the host sees as well, row by row.
pub(crate) struct MappedImages {
    pub(crate) images: [Image; 2],
    /// Bytes from one row to the next.
    pub(crate) pitch: u64,
    mapped: NonNull<u8>,
}

// SAFETY: the mapping is plain memory that stays where it is; it is only read, by callers that the frame ring keeps apart from the GPU.
unsafe impl Send for MappedImages {}
// SAFETY: as above.
unsafe impl Sync for MappedImages {}

impl MappedImages {
    /// Makes both images; `None` where their rows do not lie alike or the device has no such memory.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        what: &'static str,
        shapes: [ImageShape; 2],
    ) -> Result<Option<Self>, RenderError> {
        if !shapes.iter().all(|shape| gpu.draws_linear(shape.format)) {
            return Ok(None);
        }
        let [first, second] = shapes.map(|shape| {
            Image::without_memory(gpu, what, ImageShape { tiling: vk::ImageTiling::LINEAR, ..shape })
        });
        let mut images = [first?, second?];
        let [one, other] = images.each_ref().map(Image::needs);
        let needs = vk::MemoryRequirements {
            size: one.size.max(other.size),
            alignment: one.alignment.max(other.alignment),
            memory_type_bits: one.memory_type_bits & other.memory_type_bits,
        };
        let kinds = Access::Download.kinds();
        let pitches = images.each_ref().map(Image::pitch);
        let (Some(pitch), true) = (pitches[0], pitches[0] == pitches[1]) else { return Ok(None) };
        if !kinds.iter().any(|kind| gpu.memory_type(needs.memory_type_bits, *kind).is_some()) {
            return Ok(None);
        }
        let memory = Arc::new(ImageMemory::new(gpu, what, needs, kinds)?);
        for image in &mut images {
            image.bind(memory.clone())?;
        }
        // SAFETY: the memory can be mapped and is mapped once, whole.
        let mapped =
            unsafe { gpu.device.map_memory(memory.raw, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty()) };
        let mapped = mapped.named_for("vkMapMemory", what)?.cast::<u8>();
        let mapped = NonNull::new(mapped).ok_or(RenderError::OutOfMemory { call: "vkMapMemory", what })?;
        Ok(Some(Self { images, pitch, mapped }))
    }

    /// All rows, `pitch` bytes each.
    ///
    /// # Safety
    /// The GPU has finished writing and does not write again while the slice lives.
    pub(crate) unsafe fn bytes(&self) -> &[u8] {
        let len = self.pitch * u64::from(self.images[0].shape.height);
        // SAFETY: rows of this pitch lie within the mapping, which is initialised memory (Vulkan memory has some value always); the
        // rest is promised.
        unsafe { std::slice::from_raw_parts(self.mapped.as_ptr(), usize::try_from(len).unwrap_or(0)) }
    }
}
