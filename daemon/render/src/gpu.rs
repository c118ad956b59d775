//! The Vulkan instance and device: which one is chosen, what it must be able to do, and what its validation layer says.

use std::{
    ffi::{CStr, c_void},
    sync::{
        Arc, Mutex, Once, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use ash::{ext, vk};

use crate::{
    error::{Named, RenderError},
    import::HostImport,
    rasterisers,
};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// A device that Vulkan offers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Position in the list; chooses the device as well as its name does.
    pub index: usize,
    /// The device's name.
    pub name: String,
    /// The driver's name and version.
    pub driver: String,
    /// Highest Vulkan version, as major and minor.
    pub vulkan: (u32, u32),
    /// Whether it is a program on the processor and no GPU.
    pub software: bool,
}

/// The devices that are there.
pub fn devices() -> Result<Vec<DeviceInfo>, RenderError> {
    let instance = Instance::new(false)?;
    Ok(instance.devices()?.into_iter().map(|(_, info)| info).collect())
}

/// As a device's name: the first that is a program on the processor, whatever it is called. What safe mode draws with.
pub const SOFTWARE: &str = "software";

/// The device that `wanted` names: its index, [`SOFTWARE`], or a part of its name; an error that lists those that are there.
pub fn find_device(wanted: &str) -> Result<DeviceInfo, RenderError> {
    let devices = devices()?;
    let index = choose(Some(wanted), &devices.iter().collect::<Vec<_>>())?;
    devices.into_iter().nth(index).ok_or(RenderError::NoDevice)
}

/// Loader and instance, destroyed together.
struct Instance {
    // Field order: the instance's functions live in the loader's library.
    raw: ash::Instance,
    entry: ash::Entry,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    messages: Box<Mutex<Vec<String>>>,
}

impl Instance {
    fn new(validation: bool) -> Result<Self, RenderError> {
        // SAFETY: the system's Vulkan loader is trusted to initialise as its interface states.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| RenderError::NoLoader(e.to_string()))?;
        let app =
            vk::ApplicationInfo::default().application_name(c"bowwave").api_version(vk::API_VERSION_1_3);
        let mut layers = Vec::new();
        let mut extensions = Vec::new();
        if validation {
            // SAFETY: plain enumeration on a loaded entry.
            let present = unsafe { entry.enumerate_instance_layer_properties() }
                .named("vkEnumerateInstanceLayerProperties")?;
            if !present.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
                return Err(RenderError::NoValidationLayer);
            }
            layers.push(VALIDATION_LAYER.as_ptr());
            extensions.push(ext::debug_utils::NAME.as_ptr());
        }
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&app)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&extensions);
        if validation {
            info = info.push_next(&mut features);
        }
        // SAFETY: `info` and all it points to outlive the call.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => RenderError::NoDevice,
            result => RenderError::Vulkan { call: "vkCreateInstance", result },
        })?;
        let mut instance = Self { raw, entry, messenger: None, messages: Box::default() };
        keep_drivers_loaded(&instance.entry, &app);
        if validation {
            let utils = ext::debug_utils::Instance::new(&instance.entry, &instance.raw);
            let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(
                    vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                        | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                )
                // Advice on speed is not asked for, since each message counts as an error: the frame stays in the general layout on purpose,
                // so that two formats may see it (`target`).
                .message_type(
                    vk::DebugUtilsMessageTypeFlagsEXT::GENERAL
                        | vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION,
                )
                .pfn_user_callback(Some(on_message))
                .user_data((&raw const *instance.messages).cast_mut().cast());
            // SAFETY: the callback has the required signature; its user data is boxed and outlives the messenger.
            let messenger = unsafe { utils.create_debug_utils_messenger(&info, None) }
                .named("vkCreateDebugUtilsMessengerEXT")?;
            instance.messenger = Some((utils, messenger));
        }
        Ok(instance)
    }

    fn devices(&self) -> Result<Vec<(vk::PhysicalDevice, DeviceInfo)>, RenderError> {
        // SAFETY: plain enumeration on a live instance.
        let raw = unsafe { self.raw.enumerate_physical_devices() }.named("vkEnumeratePhysicalDevices")?;
        Ok(raw
            .into_iter()
            .enumerate()
            .map(|(index, device)| (device, self.describe(index, device)))
            .collect())
    }

    fn describe(&self, index: usize, device: vk::PhysicalDevice) -> DeviceInfo {
        // SAFETY: `device` comes from this instance.
        let version = unsafe { self.raw.get_physical_device_properties(device) };
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default();
        if version.api_version >= vk::API_VERSION_1_2 {
            properties = properties.push_next(&mut driver);
        }
        // SAFETY: as above; the chained struct is known to devices of Vulkan 1.2 and later.
        unsafe { self.raw.get_physical_device_properties2(device, &mut properties) };
        let p = properties.properties;
        let text = |s: Result<&CStr, _>| s.map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        DeviceInfo {
            index,
            name: text(p.device_name_as_c_str()),
            driver: format!(
                "{} {}",
                text(driver.driver_name_as_c_str()),
                text(driver.driver_info_as_c_str())
            ),
            vulkan: (vk::api_version_major(p.api_version), vk::api_version_minor(p.api_version)),
            software: p.device_type == vk::PhysicalDeviceType::CPU,
        }
    }
}

/// Makes an instance, once in the life of the process, that nobody destroys. The loader unloads a driver with its last instance. NVIDIA's driver
/// registers a thread-local destructor with each thread that called it; a thread that ends after the unloading would call code that is gone.
fn keep_drivers_loaded(entry: &ash::Entry, app: &vk::ApplicationInfo<'_>) {
    static KEPT: Once = Once::new();
    KEPT.call_once(|| {
        let info = vk::InstanceCreateInfo::default().application_info(app);
        // SAFETY: `info` and all it points to outlive the call.
        match unsafe { entry.create_instance(&info, None) } {
            Ok(instance) => std::mem::forget((entry.clone(), instance)),
            Err(e) => log::debug!("drivers are not kept loaded: {e}"),
        }
    });
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: whoever holds devices of this instance destroys them first (see `Gpu`).
        unsafe {
            if let Some((utils, messenger)) = self.messenger.take() {
                utils.destroy_debug_utils_messenger(messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

/// Keeps what the validation layer says.
unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan passes a valid struct, and the user data given at creation: a live `Mutex<Vec<String>>`.
    let (text, messages) = unsafe {
        let text = (*data).message_as_c_str().map_or_else(Default::default, CStr::to_string_lossy);
        (text, &*user.cast::<Mutex<Vec<String>>>())
    };
    let text = text.into_owned();
    if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) {
        log::error!("Vulkan: {text}");
    } else {
        log::warn!("Vulkan: {text}");
    }
    messages.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    vk::FALSE
}

/// The chosen device with its one queue. Everything made from it holds an `Arc` of it.
pub struct Gpu {
    /// Calls on the device.
    pub(crate) device: ash::Device,
    instance: Instance,
    physical: vk::PhysicalDevice,
    /// The queue; only the renderer's thread submits to it.
    pub(crate) queue: vk::Queue,
    /// The queue's family.
    pub(crate) family: u32,
    /// Nanoseconds a timestamp's step, or `None` where the queue has no timestamps.
    pub(crate) timestamp_ns: Option<f64>,
    /// What the device can do at most.
    pub(crate) limits: vk::PhysicalDeviceLimits,
    /// How memory of the host is imported, where the device can.
    pub(crate) host_import: Option<HostImport>,
    memory: vk::PhysicalDeviceMemoryProperties,
    info: DeviceInfo,
    ledger: Mutex<Vec<(&'static str, u64)>>,
    abandoned: AtomicBool,
}

impl Gpu {
    /// Opens the device that `wanted` names (see [`find_device`]); without one, the first GPU, or the first device of any kind.
    pub(crate) fn open(wanted: Option<&str>, validation: bool) -> Result<Self, RenderError> {
        let instance = Instance::new(validation)?;
        let devices = instance.devices()?;
        let infos: Vec<&DeviceInfo> = devices.iter().map(|(_, info)| info).collect();
        let index = choose(wanted, &infos)?;
        let Some((physical, info)) = devices.into_iter().nth(index) else {
            return Err(RenderError::NoDevice);
        };
        let lacks =
            |what: &str| RenderError::Unsuitable { device: info.name.clone(), lacks: what.to_owned() };
        if info.vulkan < (1, 3) {
            return Err(lacks("Vulkan 1.3"));
        }
        check_features(&instance, physical).map_err(|what| lacks(&what))?;
        // SAFETY: `physical` comes from this instance.
        let families = unsafe { instance.raw.get_physical_device_queue_family_properties(physical) };
        let family = families
            .iter()
            .position(|f| f.queue_flags.contains(vk::QueueFlags::GRAPHICS))
            .ok_or_else(|| lacks("a graphics queue"))?;
        let timestamps = families.get(family).is_some_and(|f| f.timestamp_valid_bits > 0);
        let family = u32::try_from(family).map_err(|_| lacks("a usable queue"))?;
        let imports = can_import(&instance, physical)?;
        let device = create_device(&instance, physical, family, imports)?;
        if info.software {
            rasterisers::keep_to_cores();
        }
        // SAFETY: the family and its first queue were asked for at creation; `physical` comes from this instance.
        let (queue, properties, memory) = unsafe {
            (
                device.get_device_queue(family, 0),
                instance.raw.get_physical_device_properties(physical),
                instance.raw.get_physical_device_memory_properties(physical),
            )
        };
        let host_import = imports.then(|| HostImport {
            calls: ext::external_memory_host::Device::new(&instance.raw, &device),
            alignment: import_alignment(&instance, physical),
        });
        let limits = properties.limits;
        let timestamp_ns = timestamps.then(|| f64::from(limits.timestamp_period));
        Ok(Self {
            device,
            instance,
            physical,
            queue,
            family,
            timestamp_ns,
            limits,
            host_import,
            memory,
            info,
            ledger: Mutex::default(),
            abandoned: AtomicBool::new(false),
        })
    }

    /// Which device this is.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// What the validation layer has said, from severity "warning" on.
    pub fn messages(&self) -> Vec<String> {
        self.instance.messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Everything that is allocated on the device now, by purpose.
    pub fn memory(&self) -> Vec<(&'static str, u64)> {
        self.ledger.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Allocates memory of its own for one resource: there are few of them and all are big.
    pub(crate) fn allocate(
        &self,
        what: &'static str,
        needs: vk::MemoryRequirements,
        kinds: &[vk::MemoryPropertyFlags],
    ) -> Result<vk::DeviceMemory, RenderError> {
        let fits = |kind: &vk::MemoryPropertyFlags| self.memory_type(needs.memory_type_bits, *kind);
        let Some(index) = kinds.iter().find_map(fits) else {
            return Err(RenderError::Unsuitable {
                device: self.info.name.clone(),
                lacks: format!("a memory type for {what}"),
            });
        };
        let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index);
        // SAFETY: size and type come from the device itself.
        let memory =
            unsafe { self.device.allocate_memory(&info, None) }.named_for("vkAllocateMemory", what)?;
        self.ledger.lock().unwrap_or_else(PoisonError::into_inner).push((what, needs.size));
        Ok(memory)
    }

    /// Whether images of `format` can be drawn to and copied from that lie row by row, as the host has them.
    pub(crate) fn draws_linear(&self, format: vk::Format) -> bool {
        // SAFETY: `physical` comes from this instance.
        let has = unsafe { self.instance.raw.get_physical_device_format_properties(self.physical, format) };
        has.linear_tiling_features
            .contains(vk::FormatFeatureFlags::COLOR_ATTACHMENT | vk::FormatFeatureFlags::TRANSFER_SRC)
    }

    /// Whether shaders can read texels of `format` from a buffer.
    pub(crate) fn reads_texels(&self, format: vk::Format) -> bool {
        // SAFETY: `physical` comes from this instance.
        let has = unsafe { self.instance.raw.get_physical_device_format_properties(self.physical, format) };
        has.buffer_features.contains(vk::FormatFeatureFlags::UNIFORM_TEXEL_BUFFER)
    }

    /// The first memory type of those in `bits` that has all of `flags`.
    pub(crate) fn memory_type(&self, bits: u32, flags: vk::MemoryPropertyFlags) -> Option<u32> {
        self.memory
            .memory_types_as_slice()
            .iter()
            .zip(0_u32..)
            .find_map(|(ty, i)| (bits & (1 << i) != 0 && ty.property_flags.contains(flags)).then_some(i))
    }

    /// Takes back what [`Gpu::allocate`] gave.
    ///
    /// # Safety
    /// Neither the GPU nor a mapping uses the memory any more.
    pub(crate) unsafe fn free(&self, what: &'static str, size: u64, memory: vk::DeviceMemory) {
        // SAFETY: promised by the caller.
        unsafe { self.device.free_memory(memory, None) };
        let mut ledger = self.ledger.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(i) = ledger.iter().position(|entry| *entry == (what, size)) {
            ledger.swap_remove(i);
        }
    }

    /// Gives the device up because it hangs: nothing made from it is destroyed any more, for the device may still use it and
    /// destroying may wait for ever. Everything stays until the process ends, the driver's library included.
    pub(crate) fn abandon(self: &Arc<Self>) {
        if !self.abandoned.swap(true, Ordering::AcqRel) {
            std::mem::forget(self.clone());
        }
    }

    /// Has `destroy` destroy what was made from the device; a device that was given up leaves it as it is.
    pub(crate) fn destroy(&self, destroy: impl FnOnce(&ash::Device)) {
        if !self.is_abandoned() {
            destroy(&self.device);
        }
    }

    /// Whether the device was given up: then whoever drops what was made from it must leave it as it is.
    pub(crate) fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::Acquire)
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // SAFETY: everything made from the device holds an `Arc` of `self`, so it is gone by now.
        unsafe { self.device.destroy_device(None) };
    }
}

/// Index of the device that `wanted` means.
fn choose(wanted: Option<&str>, devices: &[&DeviceInfo]) -> Result<usize, RenderError> {
    if devices.is_empty() {
        return Err(RenderError::NoDevice);
    }
    let Some(wanted) = wanted else {
        return Ok(devices.iter().position(|d| !d.software).unwrap_or(0));
    };
    let by_index = wanted.parse::<usize>().ok().filter(|i| *i < devices.len());
    let lower = wanted.to_lowercase();
    let by_kind = || if lower == SOFTWARE { devices.iter().position(|d| d.software) } else { None };
    let by_name = || devices.iter().position(|d| d.name.to_lowercase().contains(&lower));
    by_index.or_else(by_kind).or_else(by_name).ok_or_else(|| {
        let list: Vec<String> = devices.iter().map(|d| format!("{} {}", d.index, d.name)).collect();
        RenderError::NoSuchDevice { wanted: wanted.to_owned(), present: list.join(", ") }
    })
}

/// Refuses a device without a feature that the passes use.
fn check_features(instance: &Instance, physical: vk::PhysicalDevice) -> Result<(), String> {
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut v12).push_next(&mut v13);
    // SAFETY: `physical` comes from this instance and knows Vulkan 1.3.
    unsafe { instance.raw.get_physical_device_features2(physical, &mut features) };
    let clip = features.features.shader_clip_distance;
    let needed = [
        (clip, "shaderClipDistance"),
        (v12.timeline_semaphore, "timelineSemaphore"),
        (v13.dynamic_rendering, "dynamicRendering"),
        (v13.synchronization2, "synchronization2"),
    ];
    match needed.iter().find(|(has, _)| *has == vk::FALSE) {
        Some((_, name)) => Err(format!("the feature {name}")),
        None => Ok(()),
    }
}

/// Whether the device can import memory of the host.
fn can_import(instance: &Instance, physical: vk::PhysicalDevice) -> Result<bool, RenderError> {
    // SAFETY: `physical` comes from this instance.
    let extensions = unsafe { instance.raw.enumerate_device_extension_properties(physical) }
        .named("vkEnumerateDeviceExtensionProperties")?;
    let wanted = Ok(ext::external_memory_host::NAME);
    Ok(extensions.iter().any(|e| e.extension_name_as_c_str() == wanted))
}

/// What address and length of imported memory must be multiples of. Only for devices that can import.
fn import_alignment(instance: &Instance, physical: vk::PhysicalDevice) -> u64 {
    let mut import = vk::PhysicalDeviceExternalMemoryHostPropertiesEXT::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut import);
    // SAFETY: `physical` comes from this instance and has the extension that the chained struct belongs to.
    unsafe { instance.raw.get_physical_device_properties2(physical, &mut properties) };
    import.min_imported_host_pointer_alignment.max(1)
}

fn create_device(
    instance: &Instance,
    physical: vk::PhysicalDevice,
    family: u32,
    imports: bool,
) -> Result<ash::Device, RenderError> {
    let extensions: &[_] = if imports { &[ext::external_memory_host::NAME.as_ptr()] } else { &[] };
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
    let features = vk::PhysicalDeviceFeatures::default().shader_clip_distance(true);
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
    let mut v13 =
        vk::PhysicalDeviceVulkan13Features::default().dynamic_rendering(true).synchronization2(true);
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(extensions)
        .enabled_features(&features)
        .push_next(&mut v12)
        .push_next(&mut v13);
    // SAFETY: `info` and all it points to outlive the call; the features were checked.
    unsafe { instance.raw.create_device(physical, &info, None) }.named("vkCreateDevice")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(index: usize, name: &str, software: bool) -> DeviceInfo {
        DeviceInfo { index, name: name.to_owned(), driver: String::new(), vulkan: (1, 3), software }
    }

    #[test]
    fn device_is_chosen_by_index_or_name_part_and_a_gpu_goes_first() {
        let (soft, hard) = (device(0, "llvmpipe (LLVM 15)", true), device(1, "NVIDIA T1000", false));
        let all = [&soft, &hard];
        assert_eq!(choose(None, &all), Ok(1));
        assert_eq!(choose(None, &all[..1]), Ok(0));
        assert_eq!(choose(Some("LLVM"), &all), Ok(0));
        assert_eq!(choose(Some("1"), &all), Ok(1));
        let (hard_first, soft_last) = (device(0, "Radeon", false), device(1, "SwiftShader", true));
        assert_eq!(choose(Some("Software"), &[&hard_first, &soft_last]), Ok(1));
        assert!(choose(Some(SOFTWARE), &[&hard_first]).is_err(), "a GPU is no software device");
        assert_eq!(choose(None, &[]), Err(RenderError::NoDevice));
        let error = choose(Some("radeon"), &all).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("0 llvmpipe (LLVM 15), 1 NVIDIA T1000"), "{text}");
        assert!(choose(Some("7"), &all).unwrap_err().to_string().contains("\"7\""));
    }
}
