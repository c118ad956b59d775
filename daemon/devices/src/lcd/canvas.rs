//! Buffers that the display reads and a caller draws in.

use std::mem;

use drm::{
    buffer::{Buffer as _, DrmFourcc},
    control::{
        Device as _,
        dumbbuffer::{DumbBuffer, DumbMapping},
        framebuffer,
    },
};

use super::{
    LcdError,
    card::Card,
    pixels::{PIXEL, Placement},
};

/// Colour bits and all bits of a pixel, by which the kernel knows XRGB8888.
const DEPTH: u32 = 24;
const BITS: u32 = 32;

/// A buffer's memory. It may go to another thread, and may outlive the screen: the kernel keeps the memory until it is
/// unmapped.
pub(super) struct ScanoutBuffer {
    memory: DumbMapping<'static>,
    pitch: usize,
    size: (u32, u32),
    framebuffer: framebuffer::Handle,
    /// Where the last picture lay; `None` while all is black.
    last: Option<Placement>,
}

impl ScanoutBuffer {
    /// The kernel's number of it.
    pub(super) const fn framebuffer(&self) -> framebuffer::Handle {
        self.framebuffer
    }

    /// Draws the picture, `size` of which are its width and height.
    pub(super) fn draw(&mut self, rgba: &[u8], size: (u32, u32)) {
        let placement = Placement::new(size, self.size);
        if self.last.is_some_and(|last| last != placement) {
            self.memory.fill(0);
        }
        placement.copy(rgba, &mut self.memory, self.pitch);
        self.last = Some(placement);
    }
}

/// The kernel's side of the buffers, to be destroyed with the screen.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    made: Vec<(DumbBuffer, Option<framebuffer::Handle>)>,
}

impl Buffers {
    /// Makes `count` black buffers. Those made before a failure are in `self`, to be destroyed.
    pub(super) fn make(
        &mut self,
        card: &Card,
        size: (u32, u32),
        count: usize,
    ) -> Result<Vec<ScanoutBuffer>, LcdError> {
        (0..count).map(|_| self.make_one(card, size)).collect()
    }

    fn make_one(&mut self, card: &Card, size: (u32, u32)) -> Result<ScanoutBuffer, LcdError> {
        let made = card.create_dumb_buffer(size, DrmFourcc::Xrgb8888, BITS);
        let mut buffer = card.tried("make a buffer", made)?;
        self.made.push((buffer, None));
        let framebuffer = card.tried("use a buffer", card.add_framebuffer(&buffer, DEPTH, BITS))?;
        if let Some((_, slot)) = self.made.last_mut() {
            *slot = Some(framebuffer);
        }
        let mapping = card.tried("map a buffer", card.map_dumb_buffer(&mut buffer))?;
        // SAFETY: the lifetime is that of `buffer`, a plain copyable value to which the mapping holds no reference (its
        // field for it is a `PhantomData`). What it points to is memory that the kernel mapped into this process and keeps,
        // even beyond the buffer's and the card's end, until the mapping's `Drop` unmaps it.
        let mut memory = unsafe { mem::transmute::<DumbMapping<'_>, DumbMapping<'static>>(mapping) };
        // Black, and every page is there before the first picture needs it.
        memory.fill(0);
        let pitch = (buffer.pitch() as usize).max(size.0 as usize * PIXEL);
        Ok(ScanoutBuffer { memory, pitch, size, framebuffer, last: None })
    }

    /// Frees them all. Nothing may show them any more.
    pub(super) fn destroy(&mut self, card: &Card) {
        for (buffer, framebuffer) in self.made.drain(..) {
            // They go with the card's file anyway; where the card is gone, so are they.
            let freed = framebuffer.map_or(Ok(()), |f| card.destroy_framebuffer(f));
            if let Err(e) = freed.and(card.destroy_dumb_buffer(buffer)) {
                log::debug!("{}: a buffer was not freed: {e}", card.node().display());
            }
        }
    }
}

impl std::fmt::Debug for ScanoutBuffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ScanoutBuffer({}x{}, {:?})", self.size.0, self.size.1, self.framebuffer)
    }
}
