//! The Vulkan renderer.
