//! What can go wrong, each with what to do about it.

use ash::vk;

/// An error of the renderer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RenderError {
    /// libvulkan could not be loaded.
    #[error(
        "no Vulkan loader ({0}); install libvulkan1 and a driver (mesa-vulkan-drivers has one that needs no GPU)"
    )]
    NoLoader(String),
    /// Validation was asked for and its layer is absent.
    #[error(
        "the Vulkan layer VK_LAYER_KHRONOS_validation is not installed; install vulkan-validationlayers or switch validation off"
    )]
    NoValidationLayer,
    /// The loader found no driver.
    #[error("no Vulkan device; install a driver (mesa-vulkan-drivers has one that needs no GPU)")]
    NoDevice,
    /// The device that was asked for is not there.
    #[error("no GPU matches {wanted:?}; there are: {present}")]
    NoSuchDevice {
        /// Name part or index that was asked for.
        wanted: String,
        /// Index and name of each device that is there.
        present: String,
    },
    /// The device cannot run the renderer.
    #[error("GPU {device} lacks {lacks}; choose another with --device, or update its driver")]
    Unsuitable {
        /// Its name.
        device: String,
        /// What it lacks.
        lacks: String,
    },
    /// The device was lost: unplugged, or reset by its driver. Every later call on this renderer says so as well; drop it and
    /// its [`Completions`](crate::Completions), and make new ones.
    #[error(
        "the GPU was lost in {call}; the renderer must be made anew, and if it comes back, power-cycle the computer"
    )]
    DeviceLost {
        /// The Vulkan call that said so.
        call: &'static str,
    },
    /// The device did not finish what it was given in time. No renderer of this process can be relied on any more: drop what
    /// there is, which does not wait for the device, and end the process.
    #[error(
        "the GPU did not finish {what} within {after_ms} ms; restart the trainer, and if it comes back, power-cycle the computer"
    )]
    Hung {
        /// What it was given.
        what: &'static str,
        /// How long was waited, milliseconds.
        after_ms: u64,
    },
    /// Memory of the device or of the host ran out.
    #[error("out of GPU memory in {call} for {what}; choose a smaller --size or close other programs")]
    OutOfMemory {
        /// The Vulkan call that said so.
        call: &'static str,
        /// What the memory was for.
        what: &'static str,
    },
    /// Any other failure of a Vulkan call.
    #[error("{call} failed: {result}")]
    Vulkan {
        /// The call.
        call: &'static str,
        /// Its result.
        result: vk::Result,
    },
    /// The reader of finished frames keeps them all.
    #[error("no frame slot became free within {seconds} s: finished frames are not taken, or not given back")]
    Stalled {
        /// How long was waited.
        seconds: u64,
    },
    /// The screen's size cannot be drawn.
    #[error("{width}x{height} is no usable screen size (16 to {max} pixels each way)")]
    Size {
        /// Width asked for.
        width: u32,
        /// Height asked for.
        height: u32,
        /// Largest possible.
        max: u32,
    },
    /// A model cannot be drawn.
    #[error("model {name}: {why}")]
    Model {
        /// Its name.
        name: String,
        /// What is wrong with it.
        why: String,
    },
    /// A scene asks for what the renderer was told is never needed.
    #[error("the scene needs {what}, which the renderer was not made for")]
    NotPrepared {
        /// What it asks for.
        what: &'static str,
    },
    /// The head-up display's font is unusable.
    #[error("the built-in font is unusable: {0}")]
    Font(String),
}

/// Names the call, and what memory was for, in an error.
pub(crate) trait Named<T> {
    /// Turns a Vulkan result into an error that names `call`.
    fn named(self, call: &'static str) -> Result<T, RenderError>
    where
        Self: Sized,
    {
        self.named_for(call, "a frame")
    }
    /// The same, and `what` the call was for.
    fn named_for(self, call: &'static str, what: &'static str) -> Result<T, RenderError>;
}

impl<T> Named<T> for Result<T, vk::Result> {
    fn named_for(self, call: &'static str, what: &'static str) -> Result<T, RenderError> {
        self.map_err(|result| match result {
            vk::Result::ERROR_DEVICE_LOST => RenderError::DeviceLost { call },
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
                RenderError::OutOfMemory { call, what }
            }
            result => RenderError::Vulkan { call, result },
        })
    }
}
