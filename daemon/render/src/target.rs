//! The image that a frame is drawn to.
//!
//! The video pass sees it as words of one to four pixels, which it writes as codes; all that blends sees it as linear light. It is always
//! in the general layout, so that both may.
//!
//! A driver that runs on the processor draws into memory of the host: each slot of the ring has a target, and the frame is finished
//! where its reader finds it. A GPU draws into memory of its own: there is one target, and the whole frame is copied once.

use std::sync::Arc;

use ash::vk;
use bowwave_core::frame::scene::PixelRect;

use crate::{
    encoder::{Begin, Colour, CommandEncoder, Step},
    error::RenderError,
    gpu::Gpu,
    memory::{Buffer, Image, ImageShape, MappedImages},
    passes::{NOTHING, Use},
    pipeline::SRGB,
    rects::{joined, rect},
    upload::run_once,
};

/// Drawn to, and copied from, without a change of the layout.
const GENERAL: Use = (
    vk::PipelineStageFlags2::ALL_COMMANDS,
    vk::AccessFlags2::from_raw(
        vk::AccessFlags2::COLOR_ATTACHMENT_READ.as_raw() | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE.as_raw(),
    ),
    vk::ImageLayout::GENERAL,
);

/// How the video pass sees a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Words {
    /// Pixels to a word.
    pub(crate) run: u32,
    /// Its format.
    pub(crate) format: vk::Format,
}

/// Where a target's pixels are.
enum Pixels {
    /// In memory of the device, seen in two formats.
    Device(Image),
    /// In memory of the host: words, and light.
    Host(MappedImages),
}

/// The image that a frame is drawn to.
pub(crate) struct DrawTarget {
    size: (u32, u32),
    pub(crate) words: Words,
    pixels: Pixels,
}

impl DrawTarget {
    pub(crate) fn new(gpu: &Arc<Gpu>, size: (u32, u32)) -> Result<Self, RenderError> {
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC;
        let what = "screen";
        let packed = words_of(size.0);
        let mut host = None;
        if gpu.info().software {
            let words = ImageShape::new((size.0 / packed.run, size.1), packed.format, usage);
            host = MappedImages::new(gpu, what, [words, ImageShape::new(size, SRGB, usage)])?;
        }
        let (words, pixels) = match host {
            Some(images) => (packed, Pixels::Host(images)),
            None => {
                let words = Words { run: 1, format: vk::Format::R32_UINT };
                let shape = ImageShape { second: Some(SRGB), ..ImageShape::new(size, words.format, usage) };
                (words, Pixels::Device(Image::new(gpu, what, shape)?))
            }
        };
        let target = Self { size, words, pixels };
        run_once(gpu, |to| {
            let step = |image| Step { image, from: NOTHING, to: GENERAL };
            match &target.pixels {
                Pixels::Device(image) => to.barrier([step(image)]),
                Pixels::Host(images) => to.barrier(images.images.each_ref().map(step)),
            }
        })?;
        Ok(target)
    }

    /// Whether its bytes are the frame's, without padding, in memory that the host reads.
    pub(crate) fn is_finished_in_place(&self) -> bool {
        matches!(&self.pixels, Pixels::Host(images) if images.pitch == u64::from(self.size.0) * 4)
    }

    /// The bytes that the host reads; none where they are on the device.
    ///
    /// # Safety
    /// The GPU has finished writing and does not write again while the slice lives.
    pub(crate) unsafe fn bytes(&self) -> &[u8] {
        match &self.pixels {
            // SAFETY: promised by the caller.
            Pixels::Host(images) => unsafe { images.bytes() },
            Pixels::Device(_) => &[],
        }
    }

    /// Its pixels.
    pub(crate) fn image(&self) -> &Image {
        match &self.pixels {
            Pixels::Device(image) => image,
            Pixels::Host(images) => &images.images[1],
        }
    }

    /// Begins to write words, all of them.
    pub(crate) fn begin_words(&self, to: CommandEncoder<'_>) {
        let view = match &self.pixels {
            Pixels::Device(image) => image.view,
            Pixels::Host(images) => images.images[0].view,
        };
        let (width, height) = self.size_in_words();
        let area = PixelRect { x: 0, y: 0, width, height };
        to.begin(area, Colour { layout: GENERAL.2, ..Colour::new(view, Begin::Forget) }, None);
        to.window([0.0, 0.0, width as f32, height as f32], area);
    }

    /// Width and height in words.
    pub(crate) fn size_in_words(&self) -> (u32, u32) {
        (self.size.0 / self.words.run, self.size.1)
    }

    /// Begins to blend linear light within the rectangles; the area that holds all of them, `None` where there are none.
    pub(crate) fn begin_light(&self, to: CommandEncoder<'_>, rects: &[PixelRect]) -> Option<PixelRect> {
        let area = rects.iter().copied().reduce(joined)?;
        let view = match &self.pixels {
            Pixels::Device(image) => image.second_view,
            Pixels::Host(images) => images.images[1].view,
        };
        to.begin(area, Colour { layout: GENERAL.2, ..Colour::new(view, Begin::Keep) }, None);
        to.window([0.0, 0.0, self.size.0 as f32, self.size.1 as f32], area);
        Some(area)
    }

    /// Copies parts of it to the same place of another image.
    pub(crate) fn record_copy_of(&self, to: CommandEncoder<'_>, image: &Image, regions: &[vk::ImageCopy]) {
        to.copy_image((self.image(), GENERAL.2), image, regions);
    }

    /// Copies all of it to a frame's buffer.
    pub(crate) fn record_download(&self, to: CommandEncoder<'_>, buffer: &Buffer) {
        let region = vk::BufferImageCopy {
            image_subresource: COLOUR_LAYER,
            image_extent: vk::Extent3D { width: self.size.0, height: self.size.1, depth: 1 },
            ..vk::BufferImageCopy::default()
        };
        to.copy_from_image((self.image(), GENERAL.2), buffer, &[region]);
    }
}

/// The only layer of an image of colours.
const COLOUR_LAYER: vk::ImageSubresourceLayers = vk::ImageSubresourceLayers {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    mip_level: 0,
    base_array_layer: 0,
    layer_count: 1,
};

/// `r` as a copy from one image to the same place of another.
pub(crate) fn same_place(r: PixelRect) -> vk::ImageCopy {
    copied_from(r, (0, 0))
}

/// `r` as a copy to an image that begins at `origin`, upper left of it.
pub(crate) fn copied_from(r: PixelRect, origin: (u32, u32)) -> vk::ImageCopy {
    let offset = |r: PixelRect| {
        let offset = rect(r).offset;
        vk::Offset3D { x: offset.x, y: offset.y, z: 0 }
    };
    vk::ImageCopy {
        src_subresource: COLOUR_LAYER,
        src_offset: offset(r),
        dst_subresource: COLOUR_LAYER,
        dst_offset: offset(PixelRect { x: r.x - origin.0, y: r.y - origin.1, ..r }),
        extent: vk::Extent3D { width: r.width, height: r.height, depth: 1 },
    }
}

/// The largest words that a screen of this width is made of. On a driver that runs on the processor, writing four pixels as one word
/// takes 0.4 times the time of a pixel each.
fn words_of(width: u32) -> Words {
    let (run, format) = match width {
        w if w.is_multiple_of(4) => (4, vk::Format::R32G32B32A32_UINT),
        w if w.is_multiple_of(2) => (2, vk::Format::R32G32_UINT),
        _ => (1, vk::Format::R32_UINT),
    };
    Words { run, format }
}
