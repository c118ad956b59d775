//! Real pictures: those whose horizon was marked by hand, and those that show none.

use std::{fs, path::Path};

use anyhow::{Context as _, Result};
use bowwave_core::{
    event::{Picture, PixelFormat},
    geometry::{Lens, horizon_dip},
};
use glam::{DVec2, DVec3};

use super::{video, ways::up_through};
use crate::recorded;

/// A grey picture and what is known of its camera.
#[derive(Clone, Debug)]
pub struct SeaFrame {
    /// Which one it is.
    pub name: String,
    /// Width and height, pixels.
    pub size: (usize, usize),
    /// Luma codes, row by row.
    pub luma: Vec<u8>,
    /// The lens.
    pub lens: Lens,
    /// Height of the eye, metres: assumed.
    pub eye_m: f64,
    /// Two points of the horizon, pixels (the centre of the first pixel is 0.5).
    pub mark: Option<[DVec2; 2]>,
}

impl SeaFrame {
    /// The picture as a camera would deliver it.
    pub fn picture(&self) -> Result<Picture> {
        // A column or row is left out where chroma needs an even number.
        let (w, h) = (self.size.0 & !1, self.size.1 & !1);
        let mut bytes: Vec<u8> = Vec::with_capacity(w * h * 3 / 2);
        for row in self.luma.chunks_exact(self.size.0).take(h) {
            bytes.extend(row.iter().take(w));
        }
        bytes.resize(w * h * 3 / 2, 128);
        Picture::new(PixelFormat::Nv12, w as u32, h as u32, bytes.into()).context(self.name.clone())
    }

    /// The lens of [`SeaFrame::picture`].
    pub fn picture_lens(&self) -> Lens {
        Lens { width: self.lens.width & !1, height: self.lens.height & !1, ..self.lens }
    }

    /// Row at which `x` sees the horizon where `up` is up, pixels: by halving.
    pub fn horizon_row(&self, up: DVec3, x: f64) -> f64 {
        let sin_dip = horizon_dip(self.eye_m).sin();
        let height = |y: f64| self.lens.unproject(DVec2::new(x, y)).dot(up) + sin_dip;
        let (mut above, mut below) = (-0.5 * self.size.1 as f64, 1.5 * self.size.1 as f64);
        for _ in 0..50 {
            let y = 0.5 * (above + below);
            if height(y) >= 0.0 { above = y } else { below = y }
        }
        0.5 * (above + below)
    }

    /// Up as the mark has it.
    pub fn marked_up(&self) -> Option<DVec3> {
        self.mark.map(|ends| up_through(&self.lens, ends, self.eye_m))
    }
}

/// All pictures whose horizon was marked.
pub fn marked() -> Result<Vec<SeaFrame>> {
    let Some(marks) = recorded::find_reference("horizon_marks.csv") else { return Ok(Vec::new()) };
    let text = fs::read_to_string(&marks).with_context(|| format!("cannot read {}", marks.display()))?;
    let mut sources = Sources::default();
    let mut frames = Vec::new();
    for line in text.lines().filter(|l| !l.starts_with('#')).skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells.get(i).and_then(|c| c.trim().parse::<f64>().ok()).unwrap_or(f64::NAN);
        let Some(mut frame) = sources.frame(cells.first().copied().unwrap_or_default())? else { continue };
        // The marks count from the centre of the first pixel.
        frame.mark = Some([
            DVec2::new(number(1) + MARK_ORIGIN, number(2) + MARK_ORIGIN),
            DVec2::new(number(3) + MARK_ORIGIN, number(4) + MARK_ORIGIN),
        ]);
        frames.push(frame);
    }
    Ok(frames)
}

/// Place of the marks' origin.
const MARK_ORIGIN: f64 = 0.5;

#[derive(Default)]
struct Sources {
    ship: Option<Vec<SeaFrame>>,
    drone: Option<Vec<SeaFrame>>,
}

impl Sources {
    fn frame(&mut self, name: &str) -> Result<Option<SeaFrame>> {
        let index = |prefix: &str| name.strip_prefix(prefix).and_then(|n| n.parse::<usize>().ok());
        if let Some(i) = index("schw_") {
            if self.ship.is_none() {
                self.ship = Some(ship()?);
            }
            return Ok(self.ship.as_ref().and_then(|f| f.get(i)).cloned());
        }
        if let Some(i) = index("karma_") {
            if self.drone.is_none() {
                self.drone = Some(video::karma()?);
            }
            return Ok(self.drone.as_ref().and_then(|f| f.get(i)).cloned());
        }
        let path =
            name.strip_prefix("wasr_").and_then(|n| recorded::find(&format!("sea/wasr_stills/{n}.jpg")));
        path.map(|path| still(name, &path)).transpose()
    }
}

/// Thirteen frames from a rolling ship.
pub fn ship() -> Result<Vec<SeaFrame>> {
    let Some(path) = recorded::find("sea/schwendeman_ship_horizon/SampleVideoFrames.mat") else {
        return Ok(Vec::new());
    };
    let [video] = recorded::arrays(&path, ["VideoFrames"])?;
    let [height, width, count] = video.size[..] else { anyhow::bail!("frames of size {:?}", video.size) };
    let lens = Lens {
        focal: DVec2::new(673.37, 610.03),
        // The file counts from the centre of the first pixel, which it calls 1.
        centre: DVec2::new(339.23, 244.47) - 0.5,
        ..Lens::pinhole(width as u32, height as u32, 1.0)
    };
    let frame = |i: usize| {
        let at = |p: usize| video.values[(i * width + p % width) * height + p / width];
        let luma = (0..width * height).map(|p| at(p).clamp(0.0, 255.0) as u8).collect();
        SeaFrame { name: format!("schw_{i:02}"), size: (width, height), luma, lens, eye_m: 10.0, mark: None }
    };
    Ok((0..count).map(frame).collect())
}

/// A still of an unknown lens, taken to cover 70 degrees.
pub fn still(name: &str, path: &Path) -> Result<SeaFrame> {
    let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    decoded(name, &bytes)
}

/// A compressed picture of an unknown lens, taken to cover 70 degrees.
pub fn decoded(name: &str, bytes: &[u8]) -> Result<SeaFrame> {
    let picture = image::load_from_memory(bytes).with_context(|| name.to_owned())?.to_luma8();
    let size = (picture.width() as usize, picture.height() as usize);
    let lens = Lens::pinhole(picture.width(), picture.height(), 70f64.to_radians());
    Ok(SeaFrame { name: name.into(), size, luma: picture.into_raw(), lens, eye_m: 3.0, mark: None })
}

/// Pictures in which no horizon is to be seen: shores, harbours, canals.
pub fn without_horizon() -> Result<Vec<SeaFrame>> {
    let mut frames = Vec::new();
    for (folder, prefix) in [("sea/davis_boat_1080p", "davis"), ("sea/wasr_stills", "wasr")] {
        let Some(folder) = recorded::find(folder) else { continue };
        let mut paths: Vec<_> = fs::read_dir(&folder)?.filter_map(|e| Some(e.ok()?.path())).collect();
        paths.retain(|p| p.extension().is_some_and(|e| e == "jpg") && !p.ends_with("example_06.jpg"));
        paths.sort();
        for path in paths {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            frames.push(still(&format!("{prefix}_{stem}"), &path)?);
        }
    }
    Ok(frames)
}

/// Pieces of marked frames that show sky or water only, scaled to nothing: as they are.
pub fn crops(frames: &[SeaFrame]) -> Vec<SeaFrame> {
    let mut all = Vec::new();
    for frame in frames {
        let Some([a, b]) = frame.mark else { continue };
        let (w, h) = frame.size;
        let (high, low) = (a.y.min(b.y), a.y.max(b.y));
        // The mark's line, carried on to the picture's sides.
        let overhang = (b.y - a.y).abs() / (b.x - a.x).abs() * w as f64;
        let sky = (high - overhang - 12.0).max(0.0) as usize;
        let water = ((low + overhang + 12.0) as usize).min(h);
        for (kind, rows) in [("sky", 0..sky), ("water", water..h)] {
            if rows.len() >= 70 {
                let luma = frame.luma[rows.start * w..rows.end * w].to_vec();
                let lens = Lens::pinhole(w as u32, rows.len() as u32, 70f64.to_radians());
                let name = format!("{} {kind}", frame.name);
                all.push(SeaFrame { name, size: (w, rows.len()), luma, lens, eye_m: 3.0, mark: None });
            }
        }
    }
    all
}
