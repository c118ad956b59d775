//! The passes, one folder each, run as a plain ordered list by the renderer.

pub(crate) mod all;
pub(crate) mod atlas;
pub(crate) mod behind_hulls;
pub(crate) mod boats;
pub(crate) mod hud;
pub(crate) mod lamplight;
pub(crate) mod lights;
pub(crate) mod mirror;
pub(crate) mod phantoms;
pub(crate) mod rounds;
pub(crate) mod shadow;
pub(crate) mod video;
pub(crate) mod wake;
pub(crate) mod water;

use std::sync::Arc;

use ash::vk;
use bowwave_core::geometry::{Bend, Optics};

use crate::{
    error::RenderError,
    gpu::Gpu,
    pipeline::{Bound, Sampler, SetLayout, SetPool},
    target::Words,
};

/// What every pass is made from.
pub(crate) struct PassContext<'a> {
    pub(crate) gpu: &'a Arc<Gpu>,
    /// Layout of set 0.
    pub(crate) frame_set: &'a SetLayout,
    /// Sets that live as long as the renderer.
    pub(crate) pool: &'a SetPool,
    /// The screen, pixels.
    pub(crate) size: (u32, u32),
    /// How the video pass sees what frames are drawn to.
    pub(crate) words: Words,
    /// Frames in flight.
    pub(crate) slots: usize,
    /// What lens and shutter of the camera do.
    pub(crate) optics: Optics,
    /// Lamps may be asked for: a searchlight, flares, fires.
    pub(crate) lamps: bool,
}

/// A set with one texture that is read as it is stored, and what it lives on.
pub(crate) struct TextureSet {
    pub(crate) set: vk::DescriptorSet,
    pub(crate) layout: Arc<SetLayout>,
    _sampler: Sampler,
}

impl PassContext<'_> {
    /// The set by which fragment shaders read `view`, texel by texel.
    pub(crate) fn texture_set(&self, view: vk::ImageView) -> Result<TextureSet, RenderError> {
        let sampler = Sampler::new(self.gpu, vk::Filter::NEAREST, false)?;
        let kinds = [vk::DescriptorType::COMBINED_IMAGE_SAMPLER];
        let layout = Arc::new(SetLayout::new(self.gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?);
        let bound = Bound::Texture { view, sampler: sampler.raw, layout: SAMPLED.2 };
        let set = self.pool.set(&layout, &[bound])?;
        Ok(TextureSet { set, layout, _sampler: sampler })
    }

    /// Specialisation constants of vertex shaders that draw through the lens (`lens.glsl`), and of boats' (`boat_body.glsl`).
    pub(crate) fn vertex_constants(&self) -> [u32; 3] {
        let bend = match self.optics.bend {
            Bend::None => 0,
            Bend::RadialTangential => 1,
            Bend::Fisheye => 2,
        };
        [bend, u32::from(self.optics.rolling), u32::from(self.lamps)]
    }
}

/// A stage, an access and a layout of an image.
pub(crate) type Use = (vk::PipelineStageFlags2, vk::AccessFlags2, vk::ImageLayout);

/// Before an image's first use.
pub(crate) const NOTHING: Use =
    (vk::PipelineStageFlags2::NONE, vk::AccessFlags2::NONE, vk::ImageLayout::UNDEFINED);
/// Contents do not matter, but what came before must be over.
pub(crate) const FORGET_READ: Use =
    (vk::PipelineStageFlags2::FRAGMENT_SHADER, vk::AccessFlags2::NONE, vk::ImageLayout::UNDEFINED);
/// Drawn to.
pub(crate) const DRAWN: Use = (
    vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
    vk::AccessFlags2::from_raw(
        vk::AccessFlags2::COLOR_ATTACHMENT_WRITE.as_raw() | vk::AccessFlags2::COLOR_ATTACHMENT_READ.as_raw(),
    ),
    vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
);
/// Depth tested and written.
pub(crate) const DEPTH_TESTED: Use = (
    vk::PipelineStageFlags2::from_raw(
        vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS.as_raw()
            | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS.as_raw(),
    ),
    vk::AccessFlags2::from_raw(
        vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ.as_raw()
            | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE.as_raw(),
    ),
    vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL,
);
/// Read by a fragment shader.
pub(crate) const SAMPLED: Use = (
    vk::PipelineStageFlags2::FRAGMENT_SHADER,
    vk::AccessFlags2::SHADER_SAMPLED_READ,
    vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
);
/// Target of a copy.
pub(crate) const COPIED_TO: Use =
    (vk::PipelineStageFlags2::COPY, vk::AccessFlags2::TRANSFER_WRITE, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
