//! Memory of the host that the GPU reads where it lies (VK_EXT_external_memory_host): a camera driver's buffers.

use std::{any::Any, ffi::c_void, mem::ManuallyDrop, sync::Arc};

use ash::{ext, vk};

use crate::{
    error::{Named, RenderError},
    gpu::Gpu,
};

/// What keeps a mapping in place; see [`bowwave_core::event::Lent::hold`].
pub(crate) type Hold = Arc<dyn Any + Send + Sync>;

const HANDLE: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::HOST_ALLOCATION_EXT;

/// The device's way to import memory of the host.
pub(crate) struct HostImport {
    pub(crate) calls: ext::external_memory_host::Device,
    /// Address and length must be multiples of this.
    pub(crate) alignment: u64,
}

/// A buffer over memory of the host.
pub(crate) struct Imported {
    gpu: Arc<Gpu>,
    pub(crate) raw: vk::Buffer,
    memory: vk::DeviceMemory,
    // Given back last, and never where the GPU may still read: see `drop`.
    hold: ManuallyDrop<Hold>,
}

impl Imported {
    /// Makes a buffer of `usage` over `mapping`. Fails where the driver refuses this kind of memory, which it may (pages of a
    /// device, pages shared with another process): the caller copies then.
    ///
    /// `hold` keeps the mapping where it is; the buffer holds it for as long as it lives.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        mapping: &[u8],
        hold: Hold,
        usage: vk::BufferUsageFlags,
    ) -> Result<Self, RenderError> {
        const WHAT: &str = "the camera driver's memory";
        let lacks = |lacks: &str| RenderError::Unsuitable {
            device: gpu.info().name.clone(),
            lacks: lacks.to_owned(),
        };
        let Some(import) = &gpu.host_import else { return Err(lacks("VK_EXT_external_memory_host")) };
        let size = mapping.len() as u64;
        let address = mapping.as_ptr().cast_mut().cast::<c_void>();
        if size == 0
            || !size.is_multiple_of(import.alignment)
            || !(address.addr() as u64).is_multiple_of(import.alignment)
        {
            return Err(lacks("a use for memory that is not whole pages"));
        }
        let mut properties = vk::MemoryHostPointerPropertiesEXT::default();
        // SAFETY: `address` is the start of a live mapping of `size` bytes.
        unsafe {
            (import.calls.fp().get_memory_host_pointer_properties_ext)(
                gpu.device.handle(),
                HANDLE,
                address,
                &mut properties,
            )
        }
        .result()
        .named_for("vkGetMemoryHostPointerPropertiesEXT", WHAT)?;
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(HANDLE);
        let info = vk::BufferCreateInfo::default().size(size).usage(usage).push_next(&mut external);
        // SAFETY: `info` is complete; the device is live.
        let raw = unsafe { gpu.device.create_buffer(&info, None) }.named_for("vkCreateBuffer", WHAT)?;
        // From here on dropping `buffer` cleans up; a null handle is allowed there.
        let mut buffer =
            Self { gpu: gpu.clone(), raw, memory: vk::DeviceMemory::null(), hold: ManuallyDrop::new(hold) };
        // SAFETY: `raw` was just made from this device.
        let needs = unsafe { gpu.device.get_buffer_memory_requirements(raw) };
        if needs.size > size {
            return Err(lacks("buffers without padding"));
        }
        // Coherent, as the driver's writes are never flushed by hand.
        let coherent = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let Some(kind) = gpu.memory_type(needs.memory_type_bits & properties.memory_type_bits, coherent)
        else {
            return Err(lacks("a memory type for the camera driver's memory"));
        };
        let mut pointer =
            vk::ImportMemoryHostPointerInfoEXT::default().handle_type(HANDLE).host_pointer(address);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(size)
            .memory_type_index(kind)
            .push_next(&mut pointer);
        // SAFETY: address and size are multiples of the alignment; `hold` keeps the range mapped until `drop` has freed this
        // memory object; the GPU only reads it, and the holder of the picture keeps the driver from writing meanwhile.
        buffer.memory =
            unsafe { gpu.device.allocate_memory(&info, None) }.named_for("vkAllocateMemory", WHAT)?;
        // SAFETY: the memory was made for this buffer and covers it.
        unsafe { gpu.device.bind_buffer_memory(raw, buffer.memory, 0) }
            .named_for("vkBindBufferMemory", WHAT)?;
        Ok(buffer)
    }

    /// What keeps the mapping in place.
    pub(crate) fn hold(&self) -> &Hold {
        &self.hold
    }
}

impl Drop for Imported {
    fn drop(&mut self) {
        // Where the device was given up, the GPU may still read the pages: they stay mapped until the process ends.
        // SAFETY: owners drop imports only once no frame in flight reads them; the hold is dropped once, here, after the
        // memory object that needs the mapping.
        self.gpu.destroy(|device| unsafe {
            device.destroy_buffer(self.raw, None);
            device.free_memory(self.memory, None);
            ManuallyDrop::drop(&mut self.hold);
        });
    }
}
