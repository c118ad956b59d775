//! The camera's picture on the whole screen. The shader reads its bytes as words (see [`super::pictures`]); conversion, scaling
//! and cropping happen there. A fragment writes as many pixels as a word of the target holds.

pub(crate) mod pictures;

use pictures::{PictureCounts, PicturePath, PictureShape, Pictures};
use std::sync::Arc;

use ash::vk;
use bowwave_core::{
    event::{Picture, PixelFormat},
    frame::scene::PixelRect,
};
use shaders_spirv::{SCREEN_VERT, VIDEO_FRAG, VIDEO_OVERLAID_FRAG, interface::VideoBlock};

use crate::{
    encoder::CommandEncoder,
    error::RenderError,
    gpu::Gpu,
    passes::PassContext,
    pipeline::{Blend, DepthUse, Pipeline, PipelineShape, SetLayout},
    rects::around_all,
    target::{DrawTarget, Words},
};

/// How the shader reads pictures.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Reading {
    format: PixelFormat,
    /// Picture and screen differ in size.
    scaled: bool,
    /// Four neighbours of a row at once.
    in_fours: bool,
}

/// The video pass.
pub(crate) struct VideoPass {
    gpu: Arc<Gpu>,
    size: (u32, u32),
    slots: usize,
    /// What a fragment writes.
    words: Words,
    layout: SetLayout,
    pictures: Option<Pictures>,
    path: PicturePath,
    counts: PictureCounts,
    /// What lies over the picture.
    overlay: Arc<SetLayout>,
    /// Without and with what lies over it, of each way to read pictures that was needed yet.
    pipelines: Vec<(Reading, [Pipeline; 2])>,
    /// The pipelines of the current shape.
    current: usize,
}

impl VideoPass {
    /// `overlay` is the layout of what lies over the picture.
    pub(crate) fn new(
        context: &PassContext<'_>,
        expected: Option<PictureShape>,
        overlay: &Arc<SetLayout>,
    ) -> Result<Self, RenderError> {
        let kinds = [vk::DescriptorType::UNIFORM_TEXEL_BUFFER; 2];
        let layout = SetLayout::new(context.gpu, &kinds, vk::ShaderStageFlags::FRAGMENT)?;
        let mut pass = Self {
            words: context.words,
            gpu: context.gpu.clone(),
            size: context.size,
            slots: context.slots,
            layout,
            overlay: overlay.clone(),
            pictures: None,
            path: PicturePath::Copied,
            counts: PictureCounts::default(),
            pipelines: Vec::new(),
            current: 0,
        };
        if let Some(shape) = expected {
            pass.reshape(shape)?;
        }
        Ok(pass)
    }

    /// Makes the ring and the pipelines for pictures of `shape`. The GPU must be idle if there was another shape before.
    fn reshape(&mut self, shape: PictureShape) -> Result<(), RenderError> {
        self.pictures = None;
        let scaled = (shape.width, shape.height) != self.size;
        let enlarged = covering(shape, self.size).scale[0] <= 1.0;
        let in_fours = self.words.run == 4
            && shape.width.is_multiple_of(4)
            && enlarged
            && self.gpu.reads_texels(four_pixels(shape.format));
        let texels = if in_fours { four_pixels(shape.format) } else { vk::Format::R32_UINT };
        self.pictures = Some(Pictures::new(&self.gpu, &self.layout, shape, texels, self.slots)?);
        let reading = Reading { format: shape.format, scaled, in_fours };
        self.current = match self.pipelines.iter().position(|(made, _)| *made == reading) {
            Some(i) => i,
            None => {
                let made = self.make_pipelines(reading)?;
                self.pipelines.push((reading, made));
                self.pipelines.len() - 1
            }
        };
        Ok(())
    }

    /// Makes the pipelines of one way to read pictures, without and with what lies over them.
    fn make_pipelines(&self, reading: Reading) -> Result<[Pipeline; 2], RenderError> {
        let sets: [&SetLayout; 2] = [&self.layout, &self.overlay];
        let format = match reading.format {
            PixelFormat::Yuyv => 0,
            PixelFormat::Nv12 => 1,
            PixelFormat::Rgb => 2,
        };
        let constants = [format, u32::from(reading.scaled), self.words.run, u32::from(reading.in_fours)];
        let make = |fragment, sets: &[&SetLayout]| {
            Pipeline::new(
                &self.gpu,
                &PipelineShape {
                    vertex: SCREEN_VERT,
                    fragment,
                    vertex_constants: &[],
                    constants: &constants,
                    sets,
                    push: size_of::<VideoBlock>(),
                    vertices: None,
                    topology: vk::PrimitiveTopology::TRIANGLE_LIST,
                    colour: self.words.format,
                    targets: 1,
                    blend: Blend::Replace,
                    cull: None,
                    depth: DepthUse::None,
                    samples: vk::SampleCountFlags::TYPE_1,
                },
            )
        };
        Ok([make(Some(VIDEO_FRAG), &sets[..1])?, make(Some(VIDEO_OVERLAID_FRAG), &sets)?])
    }

    /// Makes what pictures of the shape of `picture` need. The GPU is idle.
    pub(crate) fn prepare(&mut self, picture: &Picture) -> Result<(), RenderError> {
        let shape = PictureShape::of(picture);
        if self.pictures.is_some() {
            log::warn!("pictures are {}x{} {:?} from now on", shape.width, shape.height, shape.format);
        }
        self.reshape(shape)
    }

    /// Whether pictures of the shape of `picture` can be taken.
    pub(crate) fn is_prepared_for(&self, picture: &Picture) -> bool {
        self.pictures.as_ref().is_some_and(|p| p.shape == PictureShape::of(picture))
    }

    /// Whether the last picture is still there and `picture` means that one, so that a frame need not take it over again.
    pub(crate) fn still_has(&self, picture: &Picture) -> bool {
        self.pictures.as_ref().is_some_and(|p| p.still_has(picture))
    }

    /// Frame `frame` (counted from 1) shows the last picture where it is `kept` (see [`VideoPass::still_has`]), else takes over
    /// `picture`; the GPU has finished `finished` frames. Where the answer is [`PicturePath::Imported`], the caller keeps the
    /// picture until the frame is finished.
    pub(crate) fn take(&mut self, picture: &Picture, kept: bool, frame: u64, finished: u64) -> PicturePath {
        let Some(pictures) = &mut self.pictures else { return PicturePath::Copied };
        // A kept import is held by `picture` itself, so it is not let go of here.
        pictures.release(finished);
        if kept {
            return pictures.read_by(frame);
        }
        let path = pictures.take(picture, frame);
        match path {
            PicturePath::Copied => self.counts.copied += 1,
            PicturePath::Imported => self.counts.imported += 1,
        }
        self.path = path;
        path
    }

    /// How the last new picture came, and how many came which way.
    pub(crate) fn path(&self) -> (PicturePath, PictureCounts) {
        (self.path, self.counts)
    }

    /// The screen as rectangles of words: those that hold some of `overlaid`, and all others.
    pub(crate) fn divide(
        &self,
        overlaid: impl Iterator<Item = PixelRect>,
        over: &mut Vec<PixelRect>,
        rest: &mut Vec<PixelRect>,
    ) {
        let (run, width, height) = (self.words.run, self.size.0 / self.words.run, self.size.1);
        over.clear();
        over.extend(overlaid.map(|r| {
            let (first, end) = (r.x / run, (r.x + r.width).div_ceil(run).min(width));
            PixelRect { x: first, width: end - first, ..r }
        }));
        around_all(PixelRect { x: 0, y: 0, width, height }, over, rest);
    }

    /// Draws the current picture over all of `target`, divided by [`VideoPass::divide`], with `overlay` over it where it is wanted.
    pub(crate) fn record(
        &self,
        to: CommandEncoder<'_>,
        target: &DrawTarget,
        overlay: vk::DescriptorSet,
        overlaid: &[PixelRect],
        rest: &[PixelRect],
    ) {
        let Some(pictures) = &self.pictures else { return };
        let (Some((_, [alone, both])), Some(set)) = (self.pipelines.get(self.current), pictures.set()) else {
            return;
        };
        target.begin_words(to);
        let block = covering(pictures.shape, self.size);
        to.bind(alone, &[set]);
        to.push(alone, &block);
        for r in rest {
            to.scissor(*r);
            to.draw(3, 1);
        }
        if !overlaid.is_empty() {
            to.bind(both, &[set, overlay]);
            to.push(both, &block);
        }
        for r in overlaid {
            to.scissor(*r);
            to.draw(3, 1);
        }
        to.end();
    }
}

/// The texel that holds four neighbours of a row of `format`; of NV12 their luma.
fn four_pixels(format: PixelFormat) -> vk::Format {
    match format {
        PixelFormat::Yuyv => vk::Format::R32G32_UINT,
        PixelFormat::Nv12 => vk::Format::R32_UINT,
        PixelFormat::Rgb => vk::Format::R32G32B32_UINT,
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
