//! The file of a panorama: a header in JSON, tiles as JPEG, and an index at the end.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
    ops::Range,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
};

use bowwave_core::event::PictureError;
use bowwave_devices::camera::jpeg::{Decoder, JpegError};
use serde::{Deserialize, Serialize};

use super::PanoramaRecipe;
use crate::make::MakeError;

/// First bytes of a file, and the last ones of a whole one.
const MAGIC: &[u8; 8] = b"BWPANO1\n";
/// Columns of a tile.
const TILE: usize = 128;
/// Longest header, bytes.
const HEADER_MAX: u32 = 64 << 10;
/// Most columns and rows, and frames, of a panorama, and most pixels: a gigabyte for each thread that draws it.
const SIDE_MAX: usize = 8192;
const PIXELS_MAX: usize = 60_000_000;
const FRAMES_MAX: usize = 20_000;
/// Longest tile, bytes.
const TILE_MAX: u64 = 8 << 20;
/// Share of the picture's height above the horizon that waves may cover, in pixels: as in the pictures of recordings.
const MARGIN_PX: f64 = 4.0;

/// Why a panorama cannot be made or read.
#[derive(Debug, thiserror::Error)]
pub enum PanoramaError {
    /// Its recipe cannot be drawn.
    #[error(transparent)]
    Make(#[from] MakeError),
    /// Its camera sees too finely, or too far up and down.
    #[error(
        "the sea around such a camera has {columns}x{rows} pixels, of which 8192 a side and 60 million in all can be had: give a smaller \
         camera, wider than high"
    )]
    Large {
        /// Columns of the panorama.
        columns: usize,
        /// Its rows.
        rows: usize,
    },
    /// The file cannot be read or written.
    #[error("{}: cannot {what}: {source}", path.display())]
    File {
        /// What was tried.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// The file is no panorama of this version, or not a whole one.
    #[error("{}: {why}; remove it, and it is made again", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// A tile or a picture could not be encoded.
    #[error("a picture of the sea could not be encoded as JPEG: {0}")]
    Encode(image::ImageError),
    /// A picture that was encoded could not be decoded.
    #[error("a picture of the sea could not be decoded: {0}")]
    Decode(JpegError),
    /// A picture has no size that pictures can have.
    #[error("no picture can be cut from the sea: {0}")]
    Picture(PictureError),
}

/// Layout of a panorama.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PanoramaHeader {
    pub columns: usize,
    /// Rows above those of the sea.
    pub sky_rows: usize,
    pub sea_rows: usize,
    /// Row of the horizontal within those of the sea.
    pub level_row: f64,
    /// Pixels per radian of azimuth and per tangent of elevation.
    pub focal: f64,
    /// Azimuth of the left edge, radians.
    pub azimuth_left: f64,
    pub frames: usize,
    /// The recipe that it was made by, for people.
    pub recipe: String,
}

impl PanoramaHeader {
    pub fn of(panorama: &PanoramaRecipe) -> Self {
        let focal = panorama.focal();
        let [left, right] = panorama.azimuths();
        let [up, down] = panorama.tangents();
        // Crests of high seas may stand above the level of a low eye.
        let level_row = (MARGIN_PX + focal * (0.5 / panorama.recipe.eye_height_m).min(0.2)).floor();
        let whole = |pixels: f64| (pixels.ceil() as usize).next_multiple_of(8);
        Self {
            columns: (((right - left) * focal).ceil() as usize).next_multiple_of(TILE),
            sky_rows: whole((up * focal - level_row).max(8.0)),
            sea_rows: whole(level_row - down * focal),
            level_row,
            focal,
            azimuth_left: left,
            frames: panorama.frames() as usize,
            recipe: format!("{panorama:?}"),
        }
    }

    pub const fn tiles(&self) -> usize {
        self.columns.div_ceil(TILE)
    }

    pub fn tile_columns(&self, tile: usize) -> Range<usize> {
        tile * TILE..((tile + 1) * TILE).min(self.columns)
    }

    /// Azimuth and tangent of the elevation of a pixel's middle.
    pub fn direction(&self, row: usize, column: usize) -> [f64; 2] {
        let level = self.sky_rows as f64 + self.level_row;
        [self.azimuth_left + (column as f64 + 0.5) / self.focal, (level - row as f64 - 0.5) / self.focal]
    }

    /// Refuses what could not be read again.
    pub fn check(&self) -> Result<(), PanoramaError> {
        let (columns, rows) = (self.columns, self.sky_rows + self.sea_rows);
        if self.is_bounded() { Ok(()) } else { Err(PanoramaError::Large { columns, rows }) }
    }

    fn is_bounded(&self) -> bool {
        let side = |n: usize| (8..=SIDE_MAX).contains(&n);
        let is_whole = [self.level_row, self.focal, self.azimuth_left].iter().all(|x| x.is_finite());
        let is_tiled = self.columns.is_multiple_of(TILE);
        side(self.columns)
            && side(self.sky_rows)
            && side(self.sea_rows)
            && is_whole
            && is_tiled
            && self.columns * (self.sky_rows + self.sea_rows) <= PIXELS_MAX
            && self.focal > 1.0
            && (1..=FRAMES_MAX).contains(&self.frames)
    }
}

/// Writes a panorama.
pub(super) struct PanoramaWriter {
    path: PathBuf,
    file: BufWriter<File>,
    at: u64,
    ends: Vec<u64>,
}

impl PanoramaWriter {
    pub fn create(path: &Path, header: &PanoramaHeader) -> Result<Self, PanoramaError> {
        let error = |what| move |source| PanoramaError::File { what, path: path.to_owned(), source };
        let file = File::create_new(path).map_err(error("create it"))?;
        let mut writer = Self { path: path.to_owned(), file: BufWriter::new(file), at: 0, ends: Vec::new() };
        let json = serde_json::to_vec(header).map_err(|e| error("write its header")(e.into()))?;
        writer.put(MAGIC)?;
        writer.put(&(json.len() as u32).to_le_bytes())?;
        writer.put(&json)?;
        Ok(writer)
    }

    /// A row of tiles: the sky's first, then those of each frame.
    pub fn tiles(&mut self, tiles: &[Vec<u8>]) -> Result<(), PanoramaError> {
        for tile in tiles {
            self.ends.push(self.at);
            self.put(tile)?;
        }
        Ok(())
    }

    pub fn finish(mut self) -> Result<(), PanoramaError> {
        let index = self.at;
        let mut places = std::mem::take(&mut self.ends);
        places.push(index);
        for place in places {
            self.put(&place.to_le_bytes())?;
        }
        self.put(&index.to_le_bytes())?;
        self.put(MAGIC)?;
        self.file.flush().map_err(|source| PanoramaError::File { what: "write it", path: self.path, source })
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), PanoramaError> {
        self.at += bytes.len() as u64;
        self.file.write_all(bytes).map_err(|source| PanoramaError::File {
            what: "write it",
            path: self.path.clone(),
            source,
        })
    }
}

/// A panorama that is read. Its picture holds the newest tiles that were asked for.
pub struct Panorama {
    path: PathBuf,
    file: File,
    header: PanoramaHeader,
    /// Where each tile begins, and where the last one ends.
    places: Vec<u64>,
    decoder: Decoder,
    /// Frame that each tile of the picture shows.
    shown: Vec<Option<usize>>,
    /// Red, green, blue and nothing, rows from the top.
    pixels: Vec<[u8; 4]>,
    coded: Vec<u8>,
}

impl Panorama {
    /// Opens a file and decodes its sky.
    pub fn open(path: &Path) -> Result<Self, PanoramaError> {
        let file = File::open(path).map_err(|source| PanoramaError::File {
            what: "open it",
            path: path.to_owned(),
            source,
        })?;
        let damaged = |why: &str| PanoramaError::Damaged { path: path.to_owned(), why: why.to_owned() };
        let read = |at: u64, count: usize| -> Result<Vec<u8>, PanoramaError> {
            let mut bytes = vec![0; count];
            file.read_exact_at(&mut bytes, at).map_err(|_| damaged("it ends before it should"))?;
            Ok(bytes)
        };
        let length = file
            .metadata()
            .map_err(|source| PanoramaError::File { what: "read it", path: path.to_owned(), source })?
            .len();
        let begin = read(0, 12)?;
        if !begin.starts_with(MAGIC) {
            return Err(damaged("it is no panorama of this version"));
        }
        let json_length = u32_at(&begin, 8);
        if json_length > HEADER_MAX {
            return Err(damaged("its header is too long"));
        }
        let header: PanoramaHeader = serde_json::from_slice(&read(12, json_length as usize)?)
            .map_err(|e| damaged(&format!("its header cannot be read ({e})")))?;
        if !header.is_bounded() {
            return Err(damaged("its header's numbers are out of range"));
        }
        let end = read(length.saturating_sub(16), 16)?;
        if !end.ends_with(MAGIC) {
            return Err(damaged("it was not written to its end"));
        }
        let count = (header.frames + 1) * header.tiles() + 1;
        let index = read(u64_at(&end, 0), 8 * count)?;
        let places: Vec<u64> = (0..count).map(|i| u64_at(&index, 8 * i)).collect();
        let is_rising = places.windows(2).all(|pair| pair[0] <= pair[1] && pair[1] - pair[0] <= TILE_MAX);
        if !is_rising || places.last().is_some_and(|last| *last > length) {
            return Err(damaged("its index is wrong"));
        }
        let pixels = vec![[0; 4]; header.columns * (header.sky_rows + header.sea_rows)];
        let shown = vec![None; header.tiles()];
        let mut panorama = Self {
            path: path.to_owned(),
            file,
            header,
            places,
            decoder: Decoder::for_recordings(),
            shown,
            pixels,
            coded: Vec::new(),
        };
        for tile in 0..panorama.header.tiles() {
            panorama.decode(tile, tile, 0, panorama.header.sky_rows)?;
        }
        Ok(panorama)
    }

    /// Frames of the loop.
    pub const fn frames(&self) -> usize {
        self.header.frames
    }

    /// Decodes the tiles of a frame between two azimuths, radians, where they are not there yet.
    pub fn show(&mut self, frame: usize, azimuths: [f64; 2]) -> Result<(), PanoramaError> {
        let tile = |azimuth: f64| {
            let column = (azimuth - self.header.azimuth_left) * self.header.focal;
            (column.max(0.0) as usize / TILE).min(self.header.tiles() - 1)
        };
        let frame = frame % self.header.frames;
        for tile in tile(azimuths[0])..=tile(azimuths[1]) {
            if self.shown[tile] != Some(frame) {
                let place = (frame + 1) * self.header.tiles() + tile;
                self.decode(place, tile, self.header.sky_rows, self.header.sea_rows)?;
                self.shown[tile] = Some(frame);
            }
        }
        Ok(())
    }

    /// The picture as it is decoded now.
    pub fn view(&self) -> PanoramaView<'_> {
        let PanoramaHeader { columns, sky_rows, sea_rows, level_row, focal, azimuth_left, .. } = self.header;
        PanoramaView {
            pixels: &self.pixels,
            columns,
            rows: sky_rows + sea_rows,
            focal: focal as f32,
            centre: (-azimuth_left * focal) as f32,
            level_row: (sky_rows as f64 + level_row) as f32,
        }
    }

    /// Decodes the tile at a place of the index into the picture.
    fn decode(
        &mut self,
        place: usize,
        tile: usize,
        first_row: usize,
        rows: usize,
    ) -> Result<(), PanoramaError> {
        let damaged = |why: String| PanoramaError::Damaged { path: self.path.clone(), why };
        let (from, to) = (self.places[place], self.places[place + 1]);
        self.coded.resize((to - from) as usize, 0);
        self.file
            .read_exact_at(&mut self.coded, from)
            .map_err(|e| damaged(format!("a tile cannot be read ({e})")))?;
        let columns = self.header.tile_columns(tile);
        let size = (columns.len() as u32, rows as u32);
        let picture = self
            .decoder
            .decode(&self.coded, Some(size))
            .map_err(|e: JpegError| damaged(format!("tile {place} is damaged ({e})")))?;
        for (row, line) in picture.bytes().chunks_exact(3 * columns.len()).enumerate() {
            let at = (first_row + row) * self.header.columns + columns.start;
            let target = &mut self.pixels[at..at + columns.len()];
            for (pixel, rgb) in target.iter_mut().zip(line.chunks_exact(3)) {
                *pixel = [rgb[0], rgb[1], rgb[2], 0];
            }
        }
        Ok(())
    }
}

/// A panorama's picture.
#[derive(Clone, Copy)]
pub struct PanoramaView<'a> {
    /// Red, green, blue and nothing, rows from the top.
    pub pixels: &'a [[u8; 4]],
    /// Columns.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// Columns per radian of azimuth, and rows per tangent of elevation.
    pub focal: f32,
    /// Column of azimuth 0.
    pub centre: f32,
    /// Row of the horizontal.
    pub level_row: f32,
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(u32::MAX, u32::from_le_bytes)
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    bytes.get(at..at + 8).and_then(|b| b.try_into().ok()).map_or(u64::MAX, u64::from_le_bytes)
}
