//! Where the video pass finds a picture's bytes: in the camera driver's own memory where the device can import it, otherwise in
//! a mapped ring that they are copied into once.
//!
//! An import is made once for each of the driver's buffers and kept with what holds the mapping in place, so that no other
//! memory can come to lie at its address. It goes when the driver has let go of the mapping, or when pictures of another shape
//! come, and never before the last frame that reads it is finished.

use std::sync::Arc;

use ash::vk;
use bowwave_core::event::{Picture, PixelFormat};

use crate::{
    error::{Named, RenderError},
    gpu::Gpu,
    import::{Hold, Imported},
    memory::{Access, Buffer},
    pipeline::{Bound, SetLayout, SetPool},
};

/// Most buffers of a driver that are imported at once; drivers have four to eight.
const IMPORTS_MAX: usize = 16;

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

    fn byte_len(self) -> u64 {
        self.format.byte_len(self.width, self.height) as u64
    }

    /// Where the second plane begins in the picture's own bytes; 0 where there is none.
    fn chroma(self) -> u64 {
        self.format.chroma_offset(self.width, self.height).unwrap_or(0) as u64
    }

    /// Bytes from the first on that the shader may read as `texels`: whole ones, and of RGB word by word one beyond the last
    /// pixel's.
    fn reach(self, texels: vk::Format) -> u64 {
        match (self.format, texels) {
            (PixelFormat::Rgb, vk::Format::R32G32B32_UINT) => self.byte_len().next_multiple_of(12),
            (PixelFormat::Rgb, _) => self.byte_len().next_multiple_of(8) + 8,
            (PixelFormat::Yuyv | PixelFormat::Nv12, _) => self.byte_len().next_multiple_of(8),
        }
    }
}

/// How a picture's bytes came to the GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PicturePath {
    /// Copied once, into memory of the renderer.
    Copied,
    /// Read where the camera's driver put them.
    Imported,
}

impl PicturePath {
    /// The name used in summaries.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Copied => "copied",
            Self::Imported => "imported",
        }
    }
}

/// How many pictures came which way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PictureCounts {
    /// Copied once.
    pub copied: u64,
    /// Read where the camera's driver put them.
    pub imported: u64,
}

/// What the shader reads a picture through.
struct Views {
    gpu: Arc<Gpu>,
    raw: [vk::BufferView; 2],
}

impl Views {
    /// Views of the `reach` bytes of `buffer` from 0 and from `chroma` on, as words of `format`.
    fn new(
        gpu: &Arc<Gpu>,
        buffer: vk::Buffer,
        format: vk::Format,
        chroma: u64,
        reach: u64,
    ) -> Result<Self, RenderError> {
        let mut views = Self { gpu: gpu.clone(), raw: [vk::BufferView::null(); 2] };
        for (view, offset) in views.raw.iter_mut().zip([0, chroma]) {
            let info = vk::BufferViewCreateInfo::default()
                .buffer(buffer)
                .format(format)
                .offset(offset)
                .range(reach - offset);
            // SAFETY: the buffer is live, has this usage and is at least `reach` long; offset and range are aligned.
            *view = unsafe { gpu.device.create_buffer_view(&info, None) }
                .named_for("vkCreateBufferView", "camera pictures")?;
        }
        Ok(views)
    }
}

impl Drop for Views {
    fn drop(&mut self) {
        // SAFETY: owners drop views only once no frame in flight reads through them; null views are allowed.
        self.gpu.destroy(|device| unsafe {
            for view in self.raw {
                device.destroy_buffer_view(view, None);
            }
        });
    }
}

/// One entry of the ring that is copied into.
struct Entry {
    // Views before what they are views of.
    _views: Views,
    buffer: Buffer,
    set: vk::DescriptorSet,
}

/// What became of one of the driver's buffers.
enum Tried {
    Imported {
        // Views before what they are views of.
        _views: Views,
        buffer: Imported,
    },
    /// The driver of the GPU refuses this memory.
    Refused { hold: Hold },
}

/// One of the driver's buffers.
struct Import {
    address: usize,
    len: usize,
    tried: Tried,
    /// The last frame that reads it, counted from 1.
    used: u64,
}

impl Import {
    fn hold(&self) -> &Hold {
        match &self.tried {
            Tried::Imported { buffer, .. } => buffer.hold(),
            Tried::Refused { hold } => hold,
        }
    }
}

/// A place for an import, with a descriptor set that lives as long as the ring.
struct Place {
    set: vk::DescriptorSet,
    import: Option<Import>,
}

/// Where the current picture is.
#[derive(Clone, Copy)]
enum Current {
    None,
    Copied(usize),
    Imported(usize),
}

/// Pictures of one shape.
pub(crate) struct Pictures {
    gpu: Arc<Gpu>,
    pub(crate) shape: PictureShape,
    /// Where the second plane begins in the ring's entries.
    chroma: u64,
    /// What the shader reads at once.
    texels: vk::Format,
    entries: Vec<Entry>,
    next: usize,
    places: Vec<Place>,
    current: Current,
    /// Whether the log was told why pictures are copied.
    told: bool,
    // After what its sets point to.
    pool: SetPool,
}

impl Pictures {
    /// A ring of `slots` entries for pictures of `shape`, which the shader reads through `layout` as `texels` of one to three words.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        layout: &SetLayout,
        shape: PictureShape,
        texels: vk::Format,
        slots: usize,
    ) -> Result<Self, RenderError> {
        let align = texel_align(gpu);
        let chroma = shape.chroma().next_multiple_of(align);
        let size = (chroma - shape.chroma() + shape.reach(texels)).next_multiple_of(align);
        // Of three words a texel, a whole number of them.
        let reach = if texels == vk::Format::R32G32B32_UINT { size - size % 12 } else { size };
        if size / 4 > u64::from(gpu.limits.max_texel_buffer_elements) {
            return Err(RenderError::Unsuitable {
                device: gpu.info().name.clone(),
                lacks: format!("texel buffers of {size} bytes for {}x{} pictures", shape.width, shape.height),
            });
        }
        let imports = if gpu.host_import.is_some() { IMPORTS_MAX } else { 0 };
        let pool = SetPool::new(gpu, u32::try_from(slots + imports).unwrap_or(1), 2)?;
        let mut entries = Vec::with_capacity(slots);
        for _ in 0..slots {
            let usage = vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER;
            let buffer = Buffer::new(gpu, "camera pictures", size, usage, Access::Upload)?;
            let views = Views::new(gpu, buffer.raw, texels, chroma, reach)?;
            let set = pool.set(layout, &views.raw.map(Bound::Texels))?;
            entries.push(Entry { _views: views, buffer, set });
        }
        let mut places = Vec::with_capacity(imports);
        for _ in 0..imports {
            places.push(Place { set: pool.set(layout, &[])?, import: None });
        }
        Ok(Self {
            gpu: gpu.clone(),
            shape,
            chroma,
            texels,
            entries,
            next: 0,
            places,
            current: Current::None,
            told: false,
            pool,
        })
    }

    /// Takes over a new picture for frame `frame` (counted from 1). The ring's next entry is free: it was last read by a frame
    /// at least as many frames ago as there are slots, and the caller holds one. Where the answer is
    /// [`PicturePath::Imported`], the caller keeps the picture until the frame is finished.
    pub(crate) fn take(&mut self, picture: &Picture, frame: u64) -> PicturePath {
        if let Some(place) = self.import(picture) {
            self.current = Current::Imported(place);
            self.read_by(frame);
            return PicturePath::Imported;
        }
        self.next = (self.next + 1) % self.entries.len().max(1);
        if let Some(entry) = self.entries.get_mut(self.next) {
            let bytes = picture.bytes();
            let luma = usize::try_from(self.shape.chroma()).unwrap_or(0);
            let (luma, rest) = bytes.split_at(luma.min(bytes.len()));
            entry.buffer.write(0, luma);
            entry.buffer.write(self.chroma, rest);
            self.current = Current::Copied(self.next);
        }
        PicturePath::Copied
    }

    /// Whether the current picture is `picture`, so that another frame can read it where it is.
    pub(crate) fn still_has(&self, picture: &Picture) -> bool {
        match self.current {
            Current::None => false,
            // What was copied stays, whatever has become of the original.
            Current::Copied(_) => true,
            Current::Imported(place) => self.find(picture) == Some(place),
        }
    }

    /// Frame `frame` reads the current picture. Says where it is.
    pub(crate) fn read_by(&mut self, frame: u64) -> PicturePath {
        let Current::Imported(place) = self.current else { return PicturePath::Copied };
        if let Some(import) = self.places.get_mut(place).and_then(|p| p.import.as_mut()) {
            import.used = frame;
        }
        PicturePath::Imported
    }

    /// What the shader reads the current picture through.
    pub(crate) fn set(&self) -> Option<vk::DescriptorSet> {
        match self.current {
            Current::None => None,
            Current::Copied(entry) => self.entries.get(entry).map(|e| e.set),
            Current::Imported(place) => self.places.get(place).map(|p| p.set),
        }
    }

    /// Lets go of mappings that only this ring still holds, once the GPU has finished `finished` frames.
    pub(crate) fn release(&mut self, finished: u64) {
        for (i, place) in self.places.iter_mut().enumerate() {
            let gone = |import: &mut Import| Arc::strong_count(import.hold()) == 1 && import.used <= finished;
            if place.import.take_if(gone).is_some()
                && matches!(self.current, Current::Imported(current) if current == i)
            {
                self.current = Current::None;
            }
        }
    }

    /// The place of `picture`'s mapping.
    fn find(&self, picture: &Picture) -> Option<usize> {
        let (mapping, hold) = (picture.mapping()?, picture.hold()?);
        self.places.iter().position(|place| {
            place.import.as_ref().is_some_and(|import| {
                (import.address, import.len) == (mapping.as_ptr().addr(), mapping.len())
                    && std::ptr::addr_eq(Arc::as_ptr(import.hold()), Arc::as_ptr(&hold))
            })
        })
    }

    /// The place where `picture`'s memory is imported; `None` where it is not lent or cannot be imported.
    fn import(&mut self, picture: &Picture) -> Option<usize> {
        let (mapping, hold) = (picture.mapping()?, picture.hold()?);
        let i = match self.find(picture) {
            Some(i) => i,
            None => {
                let free = self.places.iter().position(|p| p.import.is_none())?;
                let tried = self.try_import(free, mapping, hold);
                let (address, len) = (mapping.as_ptr().addr(), mapping.len());
                self.places.get_mut(free)?.import = Some(Import { address, len, tried, used: 0 });
                free
            }
        };
        let imported = self.places.get(i)?.import.as_ref();
        imported.filter(|import| matches!(import.tried, Tried::Imported { .. })).map(|_| i)
    }

    /// Imports `mapping` and points the set of `place` to it.
    fn try_import(&mut self, place: usize, mapping: &[u8], hold: Hold) -> Tried {
        match self.views_of(mapping, hold.clone()) {
            Ok((buffer, views)) => {
                if let Some(place) = self.places.get(place) {
                    for (view, binding) in views.raw.into_iter().zip(0..) {
                        self.pool.write(place.set, binding, Bound::Texels(view));
                    }
                }
                Tried::Imported { _views: views, buffer }
            }
            Err(error) => {
                if !std::mem::replace(&mut self.told, true) {
                    log::info!(
                        "pictures are copied to the GPU, not read where the camera's driver puts them: {error}"
                    );
                }
                Tried::Refused { hold }
            }
        }
    }

    fn views_of(&self, mapping: &[u8], hold: Hold) -> Result<(Imported, Views), RenderError> {
        let (chroma, reach) = (self.shape.chroma(), self.shape.reach(self.texels));
        if (mapping.len() as u64) < reach || !chroma.is_multiple_of(texel_align(&self.gpu)) {
            return Err(RenderError::Unsuitable {
                device: self.gpu.info().name.clone(),
                lacks: format!(
                    "a way to read {:?} pictures of {}x{} in a buffer of {} bytes",
                    self.shape.format,
                    self.shape.width,
                    self.shape.height,
                    mapping.len()
                ),
            });
        }
        let buffer = Imported::new(&self.gpu, mapping, hold, vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER)?;
        let views = Views::new(&self.gpu, buffer.raw, self.texels, chroma, reach)?;
        Ok((buffer, views))
    }
}

/// What offsets of texel buffers must be multiples of; enough for words and pairs of words too.
fn texel_align(gpu: &Gpu) -> u64 {
    gpu.limits.min_texel_buffer_offset_alignment.max(16)
}
