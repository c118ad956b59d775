//! A Vulkan layer that loses or hangs the GPU on command. For tests only; nothing of the product depends on it.
//!
//! Put the library and `VkLayer_bowwave_gpu_fault.json` into one folder and start the program with
//!
//! ```text
//! VK_ADD_LAYER_PATH=FOLDER             (or VK_LAYER_PATH, which hides the system's own explicit layers)
//! VK_INSTANCE_LAYERS=VK_LAYER_BOWWAVE_gpu_fault
//! BOWWAVE_GPU_FAULT=FILE
//! ```
//!
//! Before each submission to a queue the layer looks for FILE. A file that begins with
//!
//! * `lost` loses the device: from then on every submission to and every wait on it answers `VK_ERROR_DEVICE_LOST`, as after a
//!   reset by the driver. A device made later works.
//! * `hang` hangs it: submissions are accepted and never carried out, so that nothing they would signal is ever signalled, and
//!   waiting for the device or a queue to be idle never returns.
//!
//! The file is one command: it is deleted when it is carried out. Where it cannot be deleted, this process ignores it until it
//! is written anew. Write it under another name and rename it, so that no half of it is read.
//!
//! What is intercepted is what a renderer on timeline semaphores and `vkQueueSubmit2` calls; `vkQueueSubmit` is too.

#![allow(
    clippy::missing_safety_doc,
    reason = "the Vulkan specification states what callers of its functions promise"
)]

mod device;
mod instance;
mod link;

use std::ffi::{CStr, c_char};

use ash::vk;

use link::NegotiateLayerInterface;

/// The version of the interface between loader and layers that this layer speaks.
const INTERFACE_VERSION: u32 = 2;

/// The loader's first question.
///
/// # Safety
/// `interface` is null or points to a valid structure, as the loader promises.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn vkNegotiateLoaderLayerInterfaceVersion(
    interface: *mut NegotiateLayerInterface,
) -> vk::Result {
    // SAFETY: promised by the loader.
    let Some(interface) = (unsafe { interface.as_mut() }) else {
        return vk::Result::ERROR_INITIALIZATION_FAILED;
    };
    if interface.version < INTERFACE_VERSION {
        return vk::Result::ERROR_INITIALIZATION_FAILED;
    }
    interface.version = INTERFACE_VERSION;
    interface.get_instance_proc_addr = Some(get_instance_proc_addr);
    interface.get_device_proc_addr = Some(get_device_proc_addr);
    interface.get_physical_device_proc_addr = None;
    vk::Result::SUCCESS
}

/// Functions of an instance: this layer's own, or those of the layer below.
unsafe extern "system" fn get_instance_proc_addr(
    instance: vk::Instance,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    // SAFETY: Vulkan passes a string.
    let text = unsafe { CStr::from_ptr(name) };
    if text == c"vkGetInstanceProcAddr" {
        // SAFETY: all Vulkan functions have this type to their name.
        return Some(unsafe { link::erase(get_instance_proc_addr as *const ()) });
    }
    // SAFETY: the caller's promises are passed on.
    own_of_device(text).or_else(|| instance::own(text)).or_else(|| unsafe { instance::below(instance, name) })
}

/// Functions of a device: this layer's own, or those of the layer below.
unsafe extern "system" fn get_device_proc_addr(
    device: vk::Device,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    // SAFETY: Vulkan passes a string.
    let text = unsafe { CStr::from_ptr(name) };
    // SAFETY: the caller's promises are passed on.
    own_of_device(text).or_else(|| unsafe { device::below(device, name) })
}

fn own_of_device(name: &CStr) -> vk::PFN_vkVoidFunction {
    if name == c"vkGetDeviceProcAddr" {
        // SAFETY: all Vulkan functions have this type to their name.
        return Some(unsafe { link::erase(get_device_proc_addr as *const ()) });
    }
    device::own(name)
}
