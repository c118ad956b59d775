//! What loader and layers pass to each other (vk_layer.h, interface version 2).

use std::ffi::{c_char, c_void};

use ash::vk::{self, Handle};

/// vkGetInstanceProcAddr.
pub type GetInstanceProcAddr =
    unsafe extern "system" fn(vk::Instance, *const c_char) -> vk::PFN_vkVoidFunction;
/// vkGetDeviceProcAddr.
pub type GetDeviceProcAddr = unsafe extern "system" fn(vk::Device, *const c_char) -> vk::PFN_vkVoidFunction;

/// `VkNegotiateLayerInterface`.
#[repr(C)]
#[derive(Debug)]
pub struct NegotiateLayerInterface {
    kind: i32,
    next: *mut c_void,
    pub(crate) version: u32,
    pub(crate) get_instance_proc_addr: Option<GetInstanceProcAddr>,
    pub(crate) get_device_proc_addr: Option<GetDeviceProcAddr>,
    pub(crate) get_physical_device_proc_addr: Option<GetInstanceProcAddr>,
}

/// `VkLayerInstanceLink`.
#[repr(C)]
pub(crate) struct InstanceLink {
    pub(crate) next: *mut Self,
    pub(crate) get_instance_proc_addr: GetInstanceProcAddr,
    get_physical_device_proc_addr: Option<GetInstanceProcAddr>,
}

/// `VkLayerDeviceLink`.
#[repr(C)]
pub(crate) struct DeviceLink {
    pub(crate) next: *mut Self,
    pub(crate) get_instance_proc_addr: GetInstanceProcAddr,
    pub(crate) get_device_proc_addr: GetDeviceProcAddr,
}

/// `VkLayerInstanceCreateInfo` and `VkLayerDeviceCreateInfo`, of which only the link is used here.
#[repr(C)]
pub(crate) struct LinkInfo<L> {
    kind: vk::StructureType,
    next: *const c_void,
    function: i32,
    pub(crate) link: *mut L,
}

/// `VK_LAYER_LINK_INFO`.
const LINK_INFO: i32 = 0;

/// The loader's link in the chain of structures that begins at `next`.
///
/// # Safety
/// `next` is null or the first of a valid chain of Vulkan structures, and structures of `kind` in it are a `LinkInfo<L>`.
pub(crate) unsafe fn find_link<L>(next: *const c_void, kind: vk::StructureType) -> Option<*mut LinkInfo<L>> {
    let mut at = next.cast::<LinkInfo<L>>().cast_mut();
    while !at.is_null() {
        // SAFETY: every structure of a chain begins with its type and the next one; the link's own fields are read only
        // where the type says that they are there.
        unsafe {
            if (*at).kind == kind && (*at).function == LINK_INFO {
                return Some(at);
            }
            at = (*at).next.cast::<LinkInfo<L>>().cast_mut();
        }
    }
    None
}

/// What instance and physical devices, or device and queues, have in common: the loader's dispatch table, whose address is the
/// first word of what such a handle points to.
///
/// # Safety
/// `handle` is a live dispatchable handle.
pub(crate) unsafe fn key(handle: impl Handle) -> usize {
    let address = usize::try_from(handle.as_raw()).unwrap_or(0) as *const usize;
    // SAFETY: the loader keeps its table's address there.
    unsafe { address.read() }
}

/// A function as Vulkan hands it out.
///
/// # Safety
/// `function` is a function that has the type which belongs to the name that it is given out for.
pub(crate) unsafe fn erase(function: *const ()) -> unsafe extern "system" fn() {
    // SAFETY: the size is that of any function's address; the caller turns it back into its own type.
    unsafe { std::mem::transmute(function) }
}
