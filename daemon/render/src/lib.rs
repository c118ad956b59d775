//! The Vulkan renderer: takes a frame's [`Scene`](bowwave_core::frame::scene::Scene) and the camera's picture, gives back sRGB pixels.
//!
//! One thread submits frames to a [`Renderer`]; another takes the finished ones from [`Completions`]. Between them lies a ring
//! of a few frames; nobody waits for the GPU within a frame. Light is linear inside, sRGB at the edges: the screen image is
//! seen as codes by the video pass and as linear light by everything that blends.

mod config;
mod encoder;
mod error;
mod frame_data;
mod gpu;
mod import;
mod lettering;
mod memory;
mod passes;
mod pipeline;
mod plan;
mod rasterisers;
mod rects;
mod renderer;
mod ring;
mod stamps;
mod target;
#[cfg(test)]
mod testing;
mod upload;
mod view;

pub use config::{Needs, RenderConfig};
pub use error::RenderError;
pub use gpu::{DeviceInfo, SOFTWARE, devices, find_device};
pub use lettering::Lettering;
pub use passes::video::pictures::{PictureCounts, PicturePath, PictureShape};
pub use renderer::{DrawRequest, Renderer, TIMED_EVERY};
pub use ring::{Completions, FinishedFrame, TimeOuts};
