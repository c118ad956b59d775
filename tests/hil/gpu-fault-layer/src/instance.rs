//! Instances: the layer passes everything on and remembers what lies below.

use std::{
    collections::BTreeMap,
    ffi::{CStr, c_char},
    mem::transmute,
    sync::{Mutex, MutexGuard, PoisonError},
};

use ash::vk;

use crate::link::{GetInstanceProcAddr, InstanceLink, erase, find_link, key};

/// An instance and the way to the functions below.
#[derive(Clone, Copy)]
struct InstanceBelow {
    instance: vk::Instance,
    get: GetInstanceProcAddr,
    /// Looked up when the instance was made: later the loader answers with the whole chain's, which layers above are part of.
    destroy: vk::PFN_vkDestroyInstance,
}

static INSTANCES: Mutex<BTreeMap<usize, InstanceBelow>> = Mutex::new(BTreeMap::new());

fn instances() -> MutexGuard<'static, BTreeMap<usize, InstanceBelow>> {
    INSTANCES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The layer's own functions of an instance.
pub(crate) fn own(name: &CStr) -> vk::PFN_vkVoidFunction {
    let function = match name.to_bytes() {
        b"vkCreateInstance" => create_instance as *const (),
        b"vkDestroyInstance" => destroy_instance as *const (),
        _ => return None,
    };
    // SAFETY: each has the type of its name.
    Some(unsafe { erase(function) })
}

/// The function below.
///
/// # Safety
/// As for `vkGetInstanceProcAddr`.
pub(crate) unsafe fn below(instance: vk::Instance, name: *const c_char) -> vk::PFN_vkVoidFunction {
    if instance == vk::Instance::null() {
        return None;
    }
    // SAFETY: the instance is live.
    let below = instances().get(&unsafe { key(instance) }).copied()?;
    // SAFETY: the caller's promises are passed on.
    unsafe { (below.get)(below.instance, name) }
}

/// The instance that a physical device belongs to.
///
/// # Safety
/// `physical` is live.
pub(crate) unsafe fn of(physical: vk::PhysicalDevice) -> Option<vk::Instance> {
    // SAFETY: passed on.
    instances().get(&unsafe { key(physical) }).map(|below| below.instance)
}

unsafe extern "system" fn create_instance(
    info: *const vk::InstanceCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    instance: *mut vk::Instance,
) -> vk::Result {
    const FAILED: vk::Result = vk::Result::ERROR_INITIALIZATION_FAILED;
    // SAFETY: the loader passes a valid chain with its link in it, and wants the link moved on before the next layer is called;
    // the function below has the type of its name.
    unsafe {
        let kind = vk::StructureType::LOADER_INSTANCE_CREATE_INFO;
        let Some(link) = find_link::<InstanceLink>((*info).p_next, kind) else { return FAILED };
        let get = (*(*link).link).get_instance_proc_addr;
        (*link).link = (*(*link).link).next;
        let Some(create) = get(vk::Instance::null(), c"vkCreateInstance".as_ptr()) else { return FAILED };
        let create = transmute::<unsafe extern "system" fn(), vk::PFN_vkCreateInstance>(create);
        let result = create(info, allocator, instance);
        if result == vk::Result::SUCCESS {
            let Some(destroy) = get(*instance, c"vkDestroyInstance".as_ptr()) else { return FAILED };
            let destroy = transmute::<unsafe extern "system" fn(), vk::PFN_vkDestroyInstance>(destroy);
            instances().insert(key(*instance), InstanceBelow { instance: *instance, get, destroy });
        }
        result
    }
}

unsafe extern "system" fn destroy_instance(
    instance: vk::Instance,
    allocator: *const vk::AllocationCallbacks<'_>,
) {
    if instance == vk::Instance::null() {
        return;
    }
    // SAFETY: the instance is live until the function below has destroyed it.
    unsafe {
        let Some(below) = instances().remove(&key(instance)) else { return };
        (below.destroy)(instance, allocator);
    }
}
