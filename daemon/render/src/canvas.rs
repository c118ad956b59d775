//! The screen. The video pass writes packed pixels that are copied to the frame's buffer at once; only the rectangles that
//! something is blended into are copied on to an image, drawn to, and copied back. A frame without boats thus costs the video
//! pass, one copy, and the few pixels of the head-up display.

use ash::vk;
use bowwave_core::frame::scene::PixelRect;

use crate::{
    error::RenderError,
    memory::{Buffer, Image, ImageShape},
    passes::{COPIED_FROM, COPIED_TO, DRAWN, Making},
    pipeline::{SRGB, UNORM},
    recorder::{Begin, Recorder, Step},
    rects::{joined, rect},
};

/// The image that is blended into.
pub(crate) struct Canvas {
    size: (u32, u32),
    /// Codes in its first view, linear light in its second.
    image: Image,
}

impl Canvas {
    pub(crate) fn new(making: &Making<'_>) -> Result<Self, RenderError> {
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT
            | vk::ImageUsageFlags::TRANSFER_SRC
            | vk::ImageUsageFlags::TRANSFER_DST;
        let shape = ImageShape { second: Some(SRGB), ..ImageShape::new(making.size, UNORM, usage) };
        Ok(Self { size: making.size, image: Image::new(making.gpu, "screen", shape)? })
    }

    /// Where `r` lies in a frame's buffer and in an image of the screen's size.
    pub(crate) fn region(&self, r: PixelRect) -> vk::BufferImageCopy {
        let vk::Rect2D { offset, extent } = rect(r);
        vk::BufferImageCopy {
            buffer_offset: (u64::from(r.y) * u64::from(self.size.0) + u64::from(r.x)) * 4,
            buffer_row_length: self.size.0,
            buffer_image_height: 0,
            image_subresource: vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            },
            image_offset: vk::Offset3D { x: offset.x, y: offset.y, z: 0 },
            image_extent: vk::Extent3D { width: extent.width, height: extent.height, depth: 1 },
        }
    }

    /// Step from the frame before to being copied to.
    pub(crate) fn before(&self) -> Step<'_> {
        let was = (COPIED_FROM.0, vk::AccessFlags2::NONE, vk::ImageLayout::UNDEFINED);
        Step { image: &self.image, from: was, to: COPIED_TO }
    }

    /// Step to being drawn.
    pub(crate) fn between(&self) -> Step<'_> {
        Step { image: &self.image, from: COPIED_TO, to: DRAWN }
    }

    /// Copies the rectangles in.
    pub(crate) fn record_in(&self, to: Recorder<'_>, buffer: &Buffer, regions: &[vk::BufferImageCopy]) {
        to.copy_to_image(buffer, &self.image, regions);
    }

    /// Begins blending linear light within the rectangles; `false` where there are none.
    pub(crate) fn begin(&self, to: Recorder<'_>, rects: &[PixelRect]) -> bool {
        let Some(area) = rects.iter().copied().reduce(joined) else { return false };
        to.begin(area, (self.image.second_view, Begin::Keep), None);
        to.window([0.0, 0.0, self.size.0 as f32, self.size.1 as f32], area);
        true
    }

    /// Copies the rectangles back.
    pub(crate) fn record_out(&self, to: Recorder<'_>, buffer: &Buffer, regions: &[vk::BufferImageCopy]) {
        let writes = (vk::PipelineStageFlags2::COPY, vk::AccessFlags2::TRANSFER_WRITE);
        to.copied(buffer, vk::AccessFlags2::NONE, writes);
        to.barrier([Step { image: &self.image, from: DRAWN, to: COPIED_FROM }]);
        to.copy_from_image(&self.image, buffer, regions);
    }
}
