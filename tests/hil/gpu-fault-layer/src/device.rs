//! Devices: submissions and waits fail, or never end, once the control file has said so.

use std::{
    collections::BTreeMap,
    ffi::{CStr, c_char},
    fs,
    mem::transmute,
    os::unix::fs::MetadataExt,
    sync::{Mutex, MutexGuard, PoisonError},
    thread,
    time::Duration,
};

use ash::vk;

use crate::{
    instance,
    link::{DeviceLink, GetDeviceProcAddr, erase, find_link, key},
};

/// Names the control file.
const VARIABLE: &str = "BOWWAVE_GPU_FAULT";

/// Condition of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GpuHealth {
    Well,
    Lost,
    Hung,
}

/// A device and the way to the functions below.
#[derive(Clone, Copy)]
struct DeviceBelow {
    device: vk::Device,
    get: GetDeviceProcAddr,
    health: GpuHealth,
}

static DEVICES: Mutex<BTreeMap<usize, DeviceBelow>> = Mutex::new(BTreeMap::new());
/// The control file that was carried out last and could not be deleted: inode and time of change.
static DONE: Mutex<Option<(u64, i64, i64)>> = Mutex::new(None);

fn devices() -> MutexGuard<'static, BTreeMap<usize, DeviceBelow>> {
    DEVICES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The layer's own functions of a device, and the one that makes it.
pub(crate) fn own(name: &CStr) -> vk::PFN_vkVoidFunction {
    let function = match name.to_bytes() {
        b"vkCreateDevice" => create_device as *const (),
        b"vkDestroyDevice" => destroy_device as *const (),
        b"vkQueueSubmit" => queue_submit as *const (),
        b"vkQueueSubmit2" => queue_submit2 as *const (),
        b"vkWaitSemaphores" => wait_semaphores as *const (),
        b"vkGetSemaphoreCounterValue" => get_semaphore_counter_value as *const (),
        b"vkWaitForFences" => wait_for_fences as *const (),
        b"vkGetFenceStatus" => get_fence_status as *const (),
        b"vkQueueWaitIdle" => queue_wait_idle as *const (),
        b"vkDeviceWaitIdle" => device_wait_idle as *const (),
        _ => return None,
    };
    // SAFETY: each has the type of its name.
    Some(unsafe { erase(function) })
}

/// The function below.
///
/// # Safety
/// As for `vkGetDeviceProcAddr`.
pub(crate) unsafe fn below(device: vk::Device, name: *const c_char) -> vk::PFN_vkVoidFunction {
    // SAFETY: the device is live.
    let below = devices().get(&unsafe { key(device) }).copied()?;
    // SAFETY: the caller's promises are passed on.
    unsafe { (below.get)(below.device, name) }
}

unsafe extern "system" fn create_device(
    physical: vk::PhysicalDevice,
    info: *const vk::DeviceCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    device: *mut vk::Device,
) -> vk::Result {
    const FAILED: vk::Result = vk::Result::ERROR_INITIALIZATION_FAILED;
    // SAFETY: the loader passes a valid chain with its link in it, and wants the link moved on before the next layer is called;
    // the function below has the type of its name.
    unsafe {
        let kind = vk::StructureType::LOADER_DEVICE_CREATE_INFO;
        let Some(link) = find_link::<DeviceLink>((*info).p_next, kind) else { return FAILED };
        let (get_instance, get) =
            ((*(*link).link).get_instance_proc_addr, (*(*link).link).get_device_proc_addr);
        (*link).link = (*(*link).link).next;
        let Some(instance) = instance::of(physical) else { return FAILED };
        let Some(create) = get_instance(instance, c"vkCreateDevice".as_ptr()) else { return FAILED };
        let create = transmute::<unsafe extern "system" fn(), vk::PFN_vkCreateDevice>(create);
        let result = create(physical, info, allocator, device);
        if result == vk::Result::SUCCESS {
            let below = DeviceBelow { device: *device, get, health: GpuHealth::Well };
            devices().insert(key(*device), below);
        }
        result
    }
}

unsafe extern "system" fn destroy_device(device: vk::Device, allocator: *const vk::AllocationCallbacks<'_>) {
    if device == vk::Device::null() {
        return;
    }
    // SAFETY: the device is live until the function below has destroyed it; that function has the type of its name.
    unsafe {
        let Some(below) = devices().remove(&key(device)) else { return };
        if below.health == GpuHealth::Hung {
            forever();
        }
        if let Some(destroy) = (below.get)(device, c"vkDestroyDevice".as_ptr()) {
            transmute::<unsafe extern "system" fn(), vk::PFN_vkDestroyDevice>(destroy)(device, allocator);
        }
    }
}

/// Command of the control file, if it is there and new; it is used up then.
fn command() -> Option<GpuHealth> {
    let path = std::env::var_os(VARIABLE)?;
    let text = fs::read_to_string(&path).ok()?;
    let about = fs::metadata(&path).ok()?;
    let stamp = (about.ino(), about.mtime(), about.mtime_nsec());
    let mut done = DONE.lock().unwrap_or_else(PoisonError::into_inner);
    if *done == Some(stamp) {
        return None;
    }
    let health = match text.trim() {
        "lost" => GpuHealth::Lost,
        "hang" => GpuHealth::Hung,
        other => {
            eprintln!("{VARIABLE}: {other:?} in {} is neither lost nor hang", path.display());
            GpuHealth::Well
        }
    };
    if fs::remove_file(&path).is_err() {
        *done = Some(stamp);
    }
    Some(health)
}

/// The device behind `key`, after the control file was looked at.
///
/// # Safety
/// The device is live, and its queues are the caller's as in `vkQueueSubmit`.
unsafe fn before_submission(key: usize) -> Option<DeviceBelow> {
    let below = devices().get(&key).copied()?;
    let Some(health) = command().filter(|_| below.health == GpuHealth::Well) else { return Some(below) };
    eprintln!("{VARIABLE}: the device is {health:?} from now on");
    if health == GpuHealth::Lost {
        // On a lost device nothing runs any more.
        // SAFETY: the function has the type of its name.
        unsafe {
            if let Some(wait) = (below.get)(below.device, c"vkDeviceWaitIdle".as_ptr()) {
                let _ =
                    transmute::<unsafe extern "system" fn(), vk::PFN_vkDeviceWaitIdle>(wait)(below.device);
            }
        }
    }
    let mut devices = devices();
    let entry = devices.get_mut(&key)?;
    entry.health = health;
    Some(*entry)
}

/// Never returns.
fn forever() -> ! {
    loop {
        thread::sleep(Duration::from_secs(3600));
    }
}

/// A function of the same type below, or the error of a device that is gone.
macro_rules! pass_on {
    ($below:expr, $name:literal, $kind:ty, ($($argument:expr),*)) => {
        match ($below.get)($below.device, $name.as_ptr()) {
            Some(function) => transmute::<unsafe extern "system" fn(), $kind>(function)($($argument),*),
            None => vk::Result::ERROR_DEVICE_LOST,
        }
    };
}

/// A submission: carried out, refused or swallowed.
macro_rules! submission {
    ($function:ident, $name:literal, $kind:ty, $info:ty) => {
        unsafe extern "system" fn $function(
            queue: vk::Queue,
            count: u32,
            submits: *const $info,
            fence: vk::Fence,
        ) -> vk::Result {
            // SAFETY: the caller's promises are passed on; the function below has the type of its name.
            unsafe {
                let Some(below) = before_submission(key(queue)) else {
                    return vk::Result::ERROR_DEVICE_LOST;
                };
                match below.health {
                    GpuHealth::Lost => vk::Result::ERROR_DEVICE_LOST,
                    GpuHealth::Hung => vk::Result::SUCCESS,
                    GpuHealth::Well => pass_on!(below, $name, $kind, (queue, count, submits, fence)),
                }
            }
        }
    };
}

submission!(queue_submit, c"vkQueueSubmit", vk::PFN_vkQueueSubmit, vk::SubmitInfo<'_>);
submission!(queue_submit2, c"vkQueueSubmit2", vk::PFN_vkQueueSubmit2, vk::SubmitInfo2<'_>);

/// A wait with a time-out, or a question: on a lost device the answer is that it is lost. On a hung one nothing need be done:
/// what was swallowed is never signalled.
macro_rules! wait {
    ($function:ident, $name:literal, $kind:ty, ($($argument:ident: $argument_kind:ty),*)) => {
        unsafe extern "system" fn $function(device: vk::Device, $($argument: $argument_kind),*) -> vk::Result {
            // SAFETY: the caller's promises are passed on; the function below has the type of its name.
            unsafe {
                let below = devices().get(&key(device)).copied();
                match below {
                    Some(below) if below.health != GpuHealth::Lost => {
                        pass_on!(below, $name, $kind, (device, $($argument),*))
                    }
                    _ => vk::Result::ERROR_DEVICE_LOST,
                }
            }
        }
    };
}

wait!(wait_semaphores, c"vkWaitSemaphores", vk::PFN_vkWaitSemaphores, (info: *const vk::SemaphoreWaitInfo<'_>, timeout: u64));
wait!(
    get_semaphore_counter_value,
    c"vkGetSemaphoreCounterValue",
    vk::PFN_vkGetSemaphoreCounterValue,
    (semaphore: vk::Semaphore, value: *mut u64)
);
wait!(
    wait_for_fences,
    c"vkWaitForFences",
    vk::PFN_vkWaitForFences,
    (count: u32, fences: *const vk::Fence, all: vk::Bool32, timeout: u64)
);
wait!(get_fence_status, c"vkGetFenceStatus", vk::PFN_vkGetFenceStatus, (fence: vk::Fence));

/// A wait without a time-out: on a hung device it never ends.
macro_rules! wait_idle {
    ($function:ident, $name:literal, $kind:ty, $handle:ty) => {
        unsafe extern "system" fn $function(handle: $handle) -> vk::Result {
            // SAFETY: the caller's promises are passed on; the function below has the type of its name.
            unsafe {
                let below = devices().get(&key(handle)).copied();
                match below.map(|below| (below, below.health)) {
                    None | Some((_, GpuHealth::Lost)) => vk::Result::ERROR_DEVICE_LOST,
                    Some((_, GpuHealth::Hung)) => forever(),
                    Some((below, GpuHealth::Well)) => pass_on!(below, $name, $kind, (handle)),
                }
            }
        }
    };
}

wait_idle!(queue_wait_idle, c"vkQueueWaitIdle", vk::PFN_vkQueueWaitIdle, vk::Queue);
wait_idle!(device_wait_idle, c"vkDeviceWaitIdle", vk::PFN_vkDeviceWaitIdle, vk::Device);
