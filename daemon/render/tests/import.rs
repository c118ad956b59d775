//! Pictures in a driver's own memory: read where they lie, they look as if copied, and the driver gets its buffers back.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod common;

use std::{
    any::Any,
    ptr,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use bowwave_core::{
    event::{Lent, Picture, PixelFormat},
    frame::scene::Scene,
};
use bowwave_render::{Completions, DrawRequest, PictureCounts, PicturePath, Renderer};
use common::{assert_clean, config, open, submit, testing::empty_scene};
use rustix::mm::{MapFlags, MprotectFlags, ProtFlags, mmap_anonymous, mprotect, munmap};

const PAGE: usize = 4096;

/// Pages of this process, as a driver's buffer. Nobody may touch what lies before and behind them.
struct Pages {
    start: *mut u8,
    len: usize,
    alive: Arc<AtomicUsize>,
}

// SAFETY: plain memory, written before it is shared and only read from then on.
unsafe impl Send for Pages {}
// SAFETY: as above.
unsafe impl Sync for Pages {}

impl Pages {
    fn new(bytes: &[u8], alive: &Arc<AtomicUsize>) -> Arc<Self> {
        let len = bytes.len().next_multiple_of(PAGE);
        // SAFETY: a new mapping; protection and copy stay within it.
        let start = unsafe {
            let around =
                mmap_anonymous(ptr::null_mut(), len + 2 * PAGE, ProtFlags::empty(), MapFlags::PRIVATE)
                    .unwrap()
                    .cast::<u8>();
            let start = around.add(PAGE);
            mprotect(start.cast(), len, MprotectFlags::READ | MprotectFlags::WRITE).unwrap();
            ptr::copy_nonoverlapping(bytes.as_ptr(), start, bytes.len());
            start
        };
        alive.fetch_add(1, Ordering::SeqCst);
        Arc::new(Self { start, len, alive: alive.clone() })
    }
}

impl Drop for Pages {
    fn drop(&mut self) {
        // SAFETY: nobody holds the mapping any more.
        unsafe { munmap(self.start.sub(PAGE).cast(), self.len + 2 * PAGE) }.unwrap();
        self.alive.fetch_sub(1, Ordering::SeqCst);
    }
}

/// A buffer while it is lent.
struct Loan {
    pages: Arc<Pages>,
    /// Bytes left off the front, to spoil the alignment.
    skip: usize,
    holds: bool,
    lent: Arc<AtomicUsize>,
}

impl Lent for Loan {
    fn mapping(&self) -> &[u8] {
        // SAFETY: the mapping is `len` bytes and lives as long as `pages`; nobody writes it.
        let all = unsafe { std::slice::from_raw_parts(self.pages.start, self.pages.len) };
        &all[self.skip..]
    }

    fn hold(&self) -> Option<Arc<dyn Any + Send + Sync>> {
        self.holds.then(|| self.pages.clone() as Arc<dyn Any + Send + Sync>)
    }
}

impl Drop for Loan {
    fn drop(&mut self) {
        self.lent.fetch_sub(1, Ordering::SeqCst);
    }
}

/// A camera's driver: how many buffers are lent and how many mappings live.
#[derive(Default)]
struct Driver {
    lent: Arc<AtomicUsize>,
    alive: Arc<AtomicUsize>,
}

impl Driver {
    fn lend(&self, shape: (PixelFormat, u32, u32), pages: &Arc<Pages>, skip: usize, holds: bool) -> Picture {
        self.lent.fetch_add(1, Ordering::SeqCst);
        let loan = Loan { pages: pages.clone(), skip, holds, lent: self.lent.clone() };
        Picture::lent(shape.0, shape.1, shape.2, Arc::new(loan)).unwrap()
    }

    fn lent(&self) -> usize {
        self.lent.load(Ordering::SeqCst)
    }

    fn alive(&self) -> usize {
        self.alive.load(Ordering::SeqCst)
    }
}

fn bytes(format: PixelFormat, width: u32, height: u32, seed: u64) -> Vec<u8> {
    let mut state = seed;
    (0..format.byte_len(width, height))
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 56) as u8
        })
        .collect()
}

/// These tests are about devices that import; the software driver they run on does. Without that they prove nothing, and say so.
fn assert_imports(renderer: &Renderer) {
    assert_eq!(
        renderer.picture_path(),
        PicturePath::Imported,
        "{} {} does not import memory of the host (VK_EXT_external_memory_host): these tests need a device that does",
        renderer.device().name,
        renderer.device().driver
    );
}

/// A renderer that draws pictures over an empty scene.
struct Player {
    renderer: Renderer,
    completions: Completions,
    scene: Scene,
}

impl Player {
    fn new(width: u32, height: u32) -> Self {
        let scene = empty_scene(width, height);
        let (renderer, completions) = open(&config(&scene), &[]);
        Self { renderer, completions, scene }
    }

    /// The pixels of the next frame, over `picture`.
    fn draw(&mut self, picture: &Picture) -> Vec<u8> {
        let pixels = submit(&mut self.renderer, &mut self.completions, &self.scene, picture);
        self.scene.frame += 1;
        pixels
    }

    /// How many pictures were copied and imported, with nothing to blame the renderer for.
    fn counts(&self) -> PictureCounts {
        assert_clean(&self.renderer);
        self.renderer.picture_counts()
    }
}

#[test]
fn imported_and_copied_pictures_look_the_same() {
    let sizes = [(PixelFormat::Yuyv, 640, 480), (PixelFormat::Nv12, 640, 360), (PixelFormat::Rgb, 320, 240)];
    for (format, width, height) in sizes {
        for screen in [(width, height), (320, 180)] {
            let driver = Driver::default();
            let bytes = bytes(format, width, height, 7);
            let pages = Pages::new(&bytes, &driver.alive);
            let mut player = Player::new(screen.0, screen.1);
            let copied = player.draw(&Picture::new(format, width, height, bytes.into()).unwrap());
            assert_eq!(player.renderer.picture_path(), PicturePath::Copied);
            let imported = player.draw(&driver.lend((format, width, height), &pages, 0, true));
            assert_imports(&player.renderer);
            assert!(copied == imported, "{format:?} {width}x{height} on {screen:?} differs");
            assert_eq!(player.counts(), PictureCounts { copied: 1, imported: 1 });
        }
    }
}

#[test]
fn memory_that_cannot_be_imported_is_copied() {
    let shape = (PixelFormat::Yuyv, 64, 48);
    let driver = Driver::default();
    let wanted = bytes(shape.0, shape.1, shape.2, 3);
    let mut shifted = vec![0; 64];
    shifted.extend(&wanted);
    let (aligned, odd) = (Pages::new(&wanted, &driver.alive), Pages::new(&shifted, &driver.alive));
    let mut player = Player::new(64, 48);
    let reference = player.draw(&Picture::new(shape.0, shape.1, shape.2, wanted.into()).unwrap());
    // One that may be unmapped at any time, one that begins within a page.
    for (pages, skip, holds) in [(&aligned, 0, false), (&odd, 64, true)] {
        let pixels = player.draw(&driver.lend(shape, pages, skip, holds));
        assert_eq!(player.renderer.picture_path(), PicturePath::Copied);
        assert!(pixels == reference, "the picture {skip} bytes behind a page's begin differs");
    }
    assert_eq!(driver.lent(), 0, "a copied picture goes back at once");
    assert_eq!(player.counts(), PictureCounts { copied: 3, imported: 0 });
}

#[test]
fn a_buffer_is_kept_while_a_frame_reads_it_and_no_longer() {
    let shape = (PixelFormat::Yuyv, 320, 240);
    let driver = Driver::default();
    let mut scene = empty_scene(320, 240);
    let mut config = config(&scene);
    config.frames_in_flight = 3;
    let (mut renderer, mut completions) = open(&config, &[]);
    let pages: Vec<_> = (0..4).map(|i| Pages::new(&bytes(shape.0, 320, 240, i), &driver.alive)).collect();
    let mut before = Vec::new();
    for n in 0..12_u64 {
        scene.frame = n;
        let picture = driver.lend(shape, &pages[n as usize % 4], 0, true);
        renderer.submit(DrawRequest::new(&scene, &picture, true)).unwrap();
        drop(picture);
        assert_eq!(driver.lent(), 1, "the frame in flight keeps its picture");
        let done = completions.wait_next(Duration::from_secs(20)).unwrap().unwrap();
        assert_eq!(driver.lent(), 0, "a finished frame gives its picture back");
        if n >= 8 {
            assert!(before[n as usize - 4] == done.rgba()[..4096], "the buffer's picture changed");
        }
        before.push(done.rgba()[..4096].to_vec());
    }
    assert_imports(&renderer);
    assert_eq!(renderer.picture_counts(), PictureCounts { copied: 0, imported: 12 });
    // The same picture once more, without being new.
    let again = driver.lend(shape, &pages[3], 0, true);
    scene.frame = 12;
    renderer.submit(DrawRequest::new(&scene, &again, false)).unwrap();
    assert_eq!(completions.wait_next(Duration::from_secs(20)).unwrap().unwrap().rgba()[..4096], before[11]);
    assert_eq!(renderer.picture_counts().imported, 12);
    drop(again);
    // The driver lets go of its buffers: the imports go with the next frame, whatever it shows.
    drop(pages);
    assert_eq!(driver.alive(), 4, "imported pages stay mapped");
    let owned = Picture::black(shape.0, 320, 240).unwrap();
    scene.frame = 13;
    submit(&mut renderer, &mut completions, &scene, &owned);
    assert_eq!(driver.alive(), 0, "pages that the driver let go of are still imported");
    assert_clean(&renderer);
}

#[test]
fn other_memory_at_the_same_address_is_not_mistaken_for_the_old() {
    let shape = (PixelFormat::Yuyv, 320, 240);
    let driver = Driver::default();
    let mut player = Player::new(320, 240);
    for n in 0..20 {
        // Each time mapped anew, often at the address that the former had.
        let bytes = bytes(shape.0, 320, 240, n + 50);
        let pages = Pages::new(&bytes, &driver.alive);
        let imported = player.draw(&driver.lend(shape, &pages, 0, true));
        let copied = player.draw(&Picture::new(shape.0, 320, 240, bytes.into()).unwrap());
        assert!(imported == copied, "picture {n} is an older one");
    }
    assert_eq!(player.counts(), PictureCounts { copied: 20, imported: 20 });
}

#[test]
fn more_buffers_than_places_are_copied_and_a_renderer_gives_all_back() {
    let shape = (PixelFormat::Yuyv, 64, 48);
    let driver = Driver::default();
    let mut player = Player::new(64, 48);
    let pages: Vec<_> = (0..40).map(|i| Pages::new(&bytes(shape.0, 64, 48, i), &driver.alive)).collect();
    for pages in &pages {
        player.draw(&driver.lend(shape, pages, 0, true));
    }
    let counts = player.counts();
    assert!(counts.imported >= 8 && counts.copied > 0 && counts.imported + counts.copied == 40, "{counts:?}");
    drop(pages);
    assert!(driver.alive() > 0);
    drop(player);
    assert_eq!((driver.lent(), driver.alive()), (0, 0));
}
