//! The camera's picture on the whole screen. Its bytes are copied once, into a mapped ring that the shader reads as words;
//! conversion, scaling and cropping happen there. A fragment makes up to four pixels and writes them as one packed texel: on a
//! driver that runs on the processor that takes 0.4 times the time of a pixel each.

use std::sync::Arc;

use ash::vk;
use bowwave_core::{
    event::{Picture, PixelFormat},
    scene::PixelRect,
};
use shaders_spirv::{SCREEN_VERT, VIDEO_FRAG, interface::VideoBlock};

use crate::{
    error::{Named, RenderError},
    gpu::Gpu,
    memory::{Access, Buffer, Image, ImageShape},
    passes::{COPIED_FROM, DRAWN, Making},
    pipeline::{Blend, Bound, Pipeline, PipelineShape, SetLayout, SetPool},
    recorder::{Begin, Recorder, Step},
};

/// Layout and size of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureShape {
    /// Byte layout.
    pub format: PixelFormat,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
}

impl PictureShape {
    /// The shape of `picture`.
    pub fn of(picture: &Picture) -> Self {
        Self { format: picture.format(), width: picture.width(), height: picture.height() }
    }

    /// Where the second plane begins, aligned as texel buffers need it; 0 where there is none.
    fn chroma_offset(self, align: u64) -> u64 {
        match self.format {
            PixelFormat::Nv12 => (u64::from(self.width) * u64::from(self.height)).next_multiple_of(align),
            PixelFormat::Yuyv | PixelFormat::Rgb => 0,
        }
    }
}

/// One entry of the staging ring.
struct Entry {
    gpu: Arc<Gpu>,
    buffer: Buffer,
    views: [vk::BufferView; 2],
    set: vk::DescriptorSet,
}

impl Drop for Entry {
    fn drop(&mut self) {
        // SAFETY: the ring is replaced or dropped only once the GPU is idle.
        unsafe {
            for view in self.views {
                self.gpu.device.destroy_buffer_view(view, None);
            }
        }
    }
}

/// The staging ring of one picture shape.
struct Staging {
    shape: PictureShape,
    entries: Vec<Entry>,
    current: usize,
    // After the entries: their sets live in it.
    _pool: SetPool,
}

/// The video pass.
pub(crate) struct VideoPass {
    gpu: Arc<Gpu>,
    size: (u32, u32),
    slots: usize,
    /// Pixels a fragment.
    run: u32,
    /// The screen as texels of `run` pixels.
    packed: Image,
    layout: SetLayout,
    staging: Option<Staging>,
    /// By format and whether it is scaled; made when first needed.
    pipelines: [Option<Pipeline>; 6],
}

impl VideoPass {
    pub(crate) fn new(making: &Making<'_>, expected: Option<PictureShape>) -> Result<Self, RenderError> {
        let kinds = [vk::DescriptorType::UNIFORM_TEXEL_BUFFER; 2];
        let layout = SetLayout::new(making.gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        let (run, format) = run_of(making.size.0);
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC;
        let shape = ImageShape::new((making.size.0 / run, making.size.1), format, usage);
        let mut pass = Self {
            run,
            packed: Image::new(making.gpu, "video", shape)?,
            gpu: making.gpu.clone(),
            size: making.size,
            slots: making.slots,
            layout,
            staging: None,
            pipelines: [const { None }; 6],
        };
        if let Some(shape) = expected {
            pass.reshape(shape)?;
        }
        Ok(pass)
    }

    /// Makes the ring and the pipeline for pictures of `shape`. The GPU must be idle if there was another shape before.
    fn reshape(&mut self, shape: PictureShape) -> Result<(), RenderError> {
        self.staging = None;
        let align = self.gpu.limits.min_texel_buffer_offset_alignment.max(16);
        let bytes = shape.format.byte_len(shape.width, shape.height) as u64;
        let chroma = shape.chroma_offset(align);
        // A run's last word may reach beyond the last pixel.
        let size = (bytes + 2 * align).next_multiple_of(align);
        if size / 4 > u64::from(self.gpu.limits.max_texel_buffer_elements) {
            return Err(RenderError::Unsuitable {
                device: self.gpu.info().name.clone(),
                lacks: format!("texel buffers of {size} bytes for {}x{} pictures", shape.width, shape.height),
            });
        }
        let pool = SetPool::new(&self.gpu, u32::try_from(self.slots).unwrap_or(1), 2)?;
        let mut entries = Vec::with_capacity(self.slots);
        for _ in 0..self.slots {
            entries.push(self.entry(&pool, shape, size, chroma)?);
        }
        self.staging = Some(Staging { shape, entries, current: 0, _pool: pool });
        self.make_pipeline(shape)?;
        Ok(())
    }

    fn entry(
        &self,
        pool: &SetPool,
        shape: PictureShape,
        size: u64,
        chroma: u64,
    ) -> Result<Entry, RenderError> {
        let usage = vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER;
        let buffer = Buffer::new(&self.gpu, "camera pictures", size, usage, Access::Upload)?;
        // The shader takes words, and where it can, pairs of them.
        let in_pairs = shape.format == PixelFormat::Yuyv && self.run == 4 && !self.is_scaled(shape);
        let format = if in_pairs { vk::Format::R32G32_UINT } else { vk::Format::R32_UINT };
        let mut entry = Entry {
            gpu: self.gpu.clone(),
            buffer,
            views: [vk::BufferView::null(); 2],
            set: vk::DescriptorSet::null(),
        };
        for (i, offset) in [0, chroma].into_iter().enumerate() {
            let info = vk::BufferViewCreateInfo::default()
                .buffer(entry.buffer.raw)
                .format(format)
                .offset(offset)
                .range(entry.buffer.size - offset);
            // SAFETY: the buffer is live and has this usage; offset and range are aligned.
            entry.views[i] = unsafe { self.gpu.device.create_buffer_view(&info, None) }
                .named_for("vkCreateBufferView", "camera pictures")?;
        }
        entry.set = pool.set(&self.layout, &entry.views.map(Bound::Texels))?;
        Ok(entry)
    }

    /// Whether `shape` needs scaling to the screen.
    fn is_scaled(&self, shape: PictureShape) -> bool {
        (shape.width, shape.height) != self.size
    }

    /// Makes the pipeline of a shape; one for each format and for scaled and unscaled, kept once made.
    fn make_pipeline(&mut self, shape: PictureShape) -> Result<(), RenderError> {
        let scaled = self.is_scaled(shape);
        let index = pipeline_index(shape.format, scaled);
        if self.pipelines[index].is_none() {
            self.pipelines[index] = Some(Pipeline::new(
                &self.gpu,
                &PipelineShape {
                    vertex: SCREEN_VERT,
                    fragment: VIDEO_FRAG,
                    constants: &[format_constant(shape.format), u32::from(scaled), self.run],
                    sets: &[&self.layout],
                    push: size_of::<VideoBlock>(),
                    vertices: None,
                    topology: vk::PrimitiveTopology::TRIANGLE_LIST,
                    colour: self.packed.shape.format,
                    blend: Blend::Replace,
                    cull: None,
                    depth: false,
                    samples: vk::SampleCountFlags::TYPE_1,
                },
            )?);
        }
        Ok(())
    }

    /// Takes over a new picture. The ring's next entry is free: it was last read by a frame at least as many frames ago as there
    /// are slots, and the caller holds one. A picture of another shape makes a new ring, once, with the GPU idle.
    pub(crate) fn take(&mut self, picture: &Picture) -> Result<(), RenderError> {
        let shape = PictureShape::of(picture);
        if self.staging.as_ref().is_none_or(|s| s.shape != shape) {
            if self.staging.is_some() {
                log::warn!("pictures are {}x{} {:?} from now on", shape.width, shape.height, shape.format);
            }
            self.gpu.wait_idle()?;
            self.reshape(shape)?;
        }
        let align = self.gpu.limits.min_texel_buffer_offset_alignment.max(16);
        let Some(staging) = &mut self.staging else { return Ok(()) };
        staging.current = (staging.current + 1) % staging.entries.len();
        let Some(entry) = staging.entries.get_mut(staging.current) else { return Ok(()) };
        let bytes = picture.bytes();
        match shape.chroma_offset(align) {
            0 => entry.buffer.write(0, bytes),
            offset => {
                let (luma, chroma) = bytes.split_at((shape.width * shape.height) as usize);
                entry.buffer.write(0, luma);
                entry.buffer.write(offset, chroma);
            }
        }
        Ok(())
    }

    /// Whether a picture was ever taken.
    pub(crate) fn has_picture(&self) -> bool {
        self.staging.is_some()
    }

    /// Step of the packed pixels from the frame before to being drawn.
    pub(crate) fn before(&self) -> Step<'_> {
        let was = (COPIED_FROM.0, vk::AccessFlags2::NONE, vk::ImageLayout::UNDEFINED);
        Step { image: &self.packed, from: was, to: DRAWN }
    }

    /// Step of the packed pixels to being copied.
    pub(crate) fn between(&self) -> Step<'_> {
        Step { image: &self.packed, from: DRAWN, to: COPIED_FROM }
    }

    /// Draws the current picture over the whole screen, as packed pixels.
    pub(crate) fn record(&self, to: Recorder<'_>) {
        let Some(staging) = &self.staging else { return };
        let index = pipeline_index(staging.shape.format, self.is_scaled(staging.shape));
        let (Some(pipeline), Some(entry)) = (&self.pipelines[index], staging.entries.get(staging.current))
        else {
            return;
        };
        let (width, height) = (self.packed.shape.width, self.packed.shape.height);
        let area = PixelRect { x: 0, y: 0, width, height };
        to.begin(area, (self.packed.view, Begin::Forget), None);
        to.window([0.0, 0.0, width as f32, height as f32], area);
        to.bind(pipeline, &[entry.set]);
        to.push(pipeline, &covering(staging.shape, self.size));
        to.draw(3, 1);
        to.end();
    }

    /// Copies the whole screen to a frame's buffer.
    pub(crate) fn record_copy(&self, to: Recorder<'_>, buffer: &Buffer) {
        let region = vk::BufferImageCopy {
            image_subresource: vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            },
            image_extent: vk::Extent3D {
                width: self.packed.shape.width,
                height: self.packed.shape.height,
                depth: 1,
            },
            ..vk::BufferImageCopy::default()
        };
        to.copy_from_image(&self.packed, buffer, &[region]);
    }
}

/// The shader's number of a format.
fn format_constant(format: PixelFormat) -> u32 {
    match format {
        PixelFormat::Yuyv => 0,
        PixelFormat::Nv12 => 1,
        PixelFormat::Rgb => 2,
    }
}

fn pipeline_index(format: PixelFormat, scaled: bool) -> usize {
    format_constant(format) as usize * 2 + usize::from(scaled)
}

/// Pixels a fragment, and the format of a texel that holds them.
fn run_of(width: u32) -> (u32, vk::Format) {
    match width {
        w if w.is_multiple_of(4) => (4, vk::Format::R32G32B32A32_UINT),
        w if w.is_multiple_of(2) => (2, vk::Format::R32G32_UINT),
        _ => (1, vk::Format::R32_UINT),
    }
}

/// How a picture of `shape` covers a screen of `size`: as `Lens::covering`, scaled to leave nothing free, centred.
fn covering(shape: PictureShape, size: (u32, u32)) -> VideoBlock {
    let from = [f64::from(shape.width), f64::from(shape.height)];
    let to = [f64::from(size.0), f64::from(size.1)];
    let scale = (to[0] / from[0]).max(to[1] / from[1]);
    let offset = |i: usize| (from[i] / 2.0 - to[i] / 2.0 / scale) as f32;
    VideoBlock {
        scale: [(1.0 / scale) as f32; 2],
        offset: [offset(0), offset(1)],
        size: [shape.width as i32, shape.height as i32],
    }
}

#[cfg(test)]
mod tests {
    use bowwave_core::geometry::Lens;
    use glam::DVec3;

    use super::*;

    #[test]
    fn picture_and_lens_cover_the_screen_alike() {
        let lens = Lens::pinhole(854, 480, 1.2);
        let shape = PictureShape { format: PixelFormat::Nv12, width: 854, height: 480 };
        for size in [(1280, 720), (800, 480), (640, 640), (854, 480)] {
            let block = covering(shape, size);
            let screen = lens.covering(size.0, size.1);
            let ray = DVec3::new(0.1, -0.05, 1.0);
            let (on_picture, on_screen) = (lens.project(ray).unwrap(), screen.project(ray).unwrap());
            let x = on_screen.x * f64::from(block.scale[0]) + f64::from(block.offset[0]);
            let y = on_screen.y * f64::from(block.scale[1]) + f64::from(block.offset[1]);
            assert!((x - on_picture.x).abs() < 1e-3 && (y - on_picture.y).abs() < 1e-3, "{size:?}");
        }
    }
}
