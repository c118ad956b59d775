//! The LCD as seen from outside the machine.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};
use serde_json::json;
use sha2::{Digest, Sha256};

use super::qmp::Qmp;

/// Between two looks.
const LOOK: Duration = Duration::from_millis(40);
/// Pixels of a colour that make a shape: the state's is 24 pixels wide on 800x480, and at least 9 anywhere.
const SHAPE_PIXELS: usize = 30;

/// A picture of the LCD.
#[derive(Clone)]
pub struct Dump {
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// Rows from the top.
    pub rgb: Vec<u8>,
}

/// State that the plate shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plate {
    /// Green.
    Ready,
    /// Cyan.
    Hit,
    /// Amber, and no other state's colour.
    NotScored,
    /// Red.
    Fault,
    /// A picture without any of these: MISS, whose word is white, or no head-up display.
    Plain,
    /// Nothing at all.
    Black,
}

/// Something that was seen.
#[derive(Clone, Copy, Debug)]
pub struct LcdSight {
    /// When.
    pub at: Instant,
    /// State.
    pub plate: Plate,
    /// Whether a warning's amber stands beside another state's colour.
    pub warning: bool,
}

impl Dump {
    /// Reads a binary PPM.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = fs::read(path).with_context(|| path.display().to_string())?;
        Self::parse(&bytes).with_context(|| path.display().to_string())
    }

    fn parse(bytes: &[u8]) -> Result<Self> {
        let (mut at, mut fields) = (0, Vec::new());
        while fields.len() < 4 {
            let rest = bytes.get(at..).unwrap_or_default();
            let end = rest.iter().position(u8::is_ascii_whitespace).context("a short PPM")?;
            fields.push(std::str::from_utf8(&rest[..end])?);
            at += end + 1;
        }
        ensure!(fields[0] == "P6" && fields[3] == "255", "no PPM: {fields:?}");
        let (width, height): (usize, usize) = (fields[1].parse()?, fields[2].parse()?);
        let rgb = bytes.get(at..).unwrap_or_default().to_vec();
        ensure!(rgb.len() == width * height * 3, "{width}x{height} with {} bytes", rgb.len());
        Ok(Self { width, height, rgb })
    }

    /// As `run --frame-hashes` writes it.
    pub fn hash(&self) -> String {
        Sha256::digest(&self.rgb).iter().map(|b| format!("{b:02x}")).collect()
    }

    /// State's colour in the lower left, where its plate stands, and whether a warning stands above it.
    pub fn plate(&self) -> (Plate, bool) {
        let mut counts = [0usize; 4];
        let mut brightest = 0u8;
        for y in 0..self.height {
            for x in 0..self.width {
                let i = (y * self.width + x) * 3;
                let pixel = [self.rgb[i], self.rgb[i + 1], self.rgb[i + 2]];
                brightest = brightest.max(pixel[0]).max(pixel[1]).max(pixel[2]);
                if y < self.height / 2 || x > self.width * 3 / 4 {
                    continue;
                }
                for (count, colour) in counts.iter_mut().zip(COLOURS) {
                    *count += usize::from(near(pixel, colour));
                }
            }
        }
        if brightest < 12 {
            return (Plate::Black, false);
        }
        let there = counts.map(|c| c >= SHAPE_PIXELS);
        match there {
            [_, _, true, amber] => (Plate::Fault, amber),
            [true, _, _, amber] => (Plate::Ready, amber),
            [_, true, _, amber] => (Plate::Hit, amber),
            [_, _, _, true] => (Plate::NotScored, false),
            _ => (Plate::Plain, false),
        }
    }

    /// Keeps it for people.
    pub fn save(&self, path: &Path) -> Result<()> {
        let picture = image::RgbImage::from_raw(self.width as u32, self.height as u32, self.rgb.clone());
        picture.context("a picture")?.save(path).with_context(|| path.display().to_string())
    }
}

/// READY's green, HIT's cyan, FAULT's red, the amber of NOT SCORED and of warnings, as sRGB (`render/src/hud_layout.rs`).
const COLOURS: [[u8; 3]; 4] = [[89, 225, 111], [97, 211, 237], [255, 105, 89], [255, 180, 39]];

fn near(pixel: [u8; 3], colour: [u8; 3]) -> bool {
    pixel.iter().zip(colour).all(|(a, b)| a.abs_diff(b) <= 10)
}

/// Looks at the LCD again and again.
pub struct LcdWatch {
    sights: Arc<Mutex<Vec<LcdSight>>>,
    newest: Arc<Mutex<Option<Dump>>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl LcdWatch {
    /// Begins to look.
    pub fn start(mut qmp: Qmp, folder: &Path, size: (u32, u32)) -> Result<Self> {
        let sights = Arc::new(Mutex::new(Vec::new()));
        let newest = Arc::new(Mutex::new(None));
        let stop = Arc::new(AtomicBool::new(false));
        let path: PathBuf = folder.join("lcd.ppm");
        let shared = (Arc::clone(&sights), Arc::clone(&newest), Arc::clone(&stop));
        let thread = thread::Builder::new().name("lcd".into()).spawn(move || {
            let (sights, newest, stop) = shared;
            while !stop.load(Ordering::Relaxed) {
                let at = Instant::now();
                if let Ok(dump) = take(&mut qmp, &path) {
                    // Before the machine has set a mode, QEMU shows a text of its own.
                    let own = (dump.width as u32, dump.height as u32) == size;
                    let (plate, warning) = if own { dump.plate() } else { (Plate::Black, false) };
                    locked(&sights).push(LcdSight { at, plate, warning });
                    *locked(&newest) = Some(dump);
                }
                thread::sleep(LOOK);
            }
        });
        Ok(Self { sights, newest, stop, thread: Some(thread.context("a thread")?) })
    }

    /// The first sight after `since` for which `wanted` holds.
    pub fn first(&self, since: Instant, wanted: impl Fn(&LcdSight) -> bool) -> Option<LcdSight> {
        locked(&self.sights).iter().find(|s| s.at >= since && wanted(s)).copied()
    }

    /// The last sight.
    pub fn last(&self) -> Option<LcdSight> {
        locked(&self.sights).last().copied()
    }

    /// The newest picture.
    pub fn newest(&self) -> Option<Dump> {
        locked(&self.newest).clone()
    }
}

impl Drop for LcdWatch {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

fn take(qmp: &mut Qmp, path: &Path) -> Result<Dump> {
    qmp.execute("screendump", json!({ "filename": path, "device": "lcd" }))?;
    Dump::read(path)
}

fn locked<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dump(paint: impl Fn(usize, usize) -> [u8; 3]) -> Dump {
        let rgb = (0..96).flat_map(|y| (0..160).map(move |x| (x, y))).flat_map(|(x, y)| paint(x, y));
        Dump { width: 160, height: 96, rgb: rgb.collect() }
    }

    #[test]
    fn states_are_told_by_their_colours() {
        let icon = |x: usize, y: usize| (4..14).contains(&x) && (80..90).contains(&y);
        let warning = |x: usize, y: usize| (4..14).contains(&x) && (60..70).contains(&y);
        let sea = [90, 110, 120];
        let with = |colour: [u8; 3]| dump(move |x, y| if icon(x, y) { colour } else { sea });
        assert_eq!(with(COLOURS[0]).plate(), (Plate::Ready, false));
        assert_eq!(with(COLOURS[1]).plate(), (Plate::Hit, false));
        assert_eq!(with(COLOURS[2]).plate(), (Plate::Fault, false));
        assert_eq!(with(COLOURS[3]).plate(), (Plate::NotScored, false));
        assert_eq!(with(sea).plate(), (Plate::Plain, false));
        assert_eq!(dump(|_, _| [0, 0, 0]).plate(), (Plate::Black, false));
        let both = dump(|x, y| {
            if icon(x, y) {
                COLOURS[0]
            } else if warning(x, y) {
                COLOURS[3]
            } else {
                sea
            }
        });
        assert_eq!(both.plate(), (Plate::Ready, true));
    }

    #[test]
    fn a_ppm_is_read() {
        let dump = Dump::parse(b"P6\n2 1\n255\nabcdef").unwrap();
        assert_eq!((dump.width, dump.height, &dump.rgb[..]), (2, 1, &b"abcdef"[..]));
        for bad in [&b"P6\n2 1\n255\nabc"[..], b"P5\n2 1\n255\nabcdef", b"", b"P6\nx"] {
            assert!(Dump::parse(bad).is_err());
        }
    }
}
