//! Boats that are pictures: a cut-out side view on an upright quad (Nelson 2009, the textured ship quads).
//!
//! The quad lies in the plane y = 0 and is seen from starboard (from -y): the bow is on the right, the normal is -y.

use std::path::Path;

use bowwave_core::model::{Model, ModelKind, Part, Texture, Vertex, Zone};
use glam::{DVec2, Mat4, Vec2, Vec3};
use image::{RgbaImage, imageops};

use crate::{
    build::{Boat, build_glb},
    error::ModelError,
    load::{decode_picture, load_glb, read_bounded},
    raster::SideCanvas,
    sidecar,
};

/// Name of the built-in picture model.
pub const FRIGATE_QUAD: &str = "frigate-quad";

/// Pixels at least this opaque belong to the boat.
const OPAQUE: u8 = 128;
/// Half thickness of a picture's outline on the water, as a share of its length: a picture has no beam.
const HALF_BEAM: f64 = 0.01;

/// Which side of the picture the bow is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bow {
    /// To the left; the picture is mirrored on loading.
    Left,
    /// To the right.
    Right,
}

/// A rectangle in pixels of the picture as it lies in its file, the picture's upper left is (0, 0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Right edge.
    pub right: f64,
    /// Lower edge.
    pub bottom: f64,
}

/// Facts that a picture does not hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadSpec {
    /// Length over all, metres: from the first to the last column that has an opaque pixel.
    pub length_m: f64,
    /// Row of the picture, from the top, at whose upper edge the sea begins.
    pub waterline_row: f64,
    /// Which side the bow is on.
    pub bow: Bow,
    /// Where hits count for the engine; `None`: 30 to 50 % of the length from the stern, up to 25 % of the height above
    /// the water.
    pub engine: Option<Rect>,
    /// Where hits count for the helm, and before the engine; `None`: 55 to 72 % of the length, 40 to 70 % of the height.
    pub helm: Option<Rect>,
}

/// Loads a PNG with transparency and the file of the same name with `.toml` beside it:
///
/// ```toml
/// length_m = 120.0         # metres over all, from the first to the last opaque column
/// waterline_row = 212      # row of the picture at which the sea begins
/// bow = "right"            # or "left"; may be left out: "right"
///
/// [engine]                 # pixels; may be left out, as may [helm]
/// left = 300
/// top = 150
/// right = 480
/// bottom = 230
/// ```
pub fn load_quad(path: &Path) -> Result<Model, ModelError> {
    let file = path.display().to_string();
    let picture = decode_picture(&read_bounded(path)?, &file)?;
    let spec = sidecar::read(&path.with_extension("toml"), picture.dimensions())?;
    let name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    quad(&file, &name, picture, &spec)
}

/// Makes a model of a picture. `file` is what errors name.
pub fn quad(file: &str, name: &str, picture: RgbaImage, spec: &QuadSpec) -> Result<Model, ModelError> {
    let bad = |problem: &str| ModelError::Picture { file: file.to_owned(), problem: problem.to_owned() };
    let frame = QuadFrame::new(&picture, spec).map_err(bad)?;
    let cut = imageops::crop_imm(&picture, frame.left, frame.top, frame.width, frame.height).to_image();
    let cut = if spec.bow == Bow::Left { imageops::flip_horizontal(&cut) } else { cut };
    let (vertices, cells) = frame.grid(spec);
    let mut indices = Vec::new();
    let mut parts = Vec::new();
    for zone in Zone::ALL {
        let start = indices.len() as u32;
        let of_zone = cells.iter().filter(|c| c.0 == zone);
        indices.extend(of_zone.flat_map(|&(_, [a, b, c, d])| [a, b, c, a, c, d]));
        if indices.len() as u32 > start {
            parts.push(Part { zone, indices: start..indices.len() as u32 });
        }
    }
    let waterline = frame
        .waterline(&cut, spec)
        .ok_or_else(|| bad("nothing is opaque at waterline_row; correct the row"))?;
    let (min, max) = crate::finish::bounds(&vertices);
    Ok(Model {
        name: name.to_owned(),
        kind: ModelKind::Quad,
        vertices,
        indices,
        parts,
        texture: Some(Texture { width: cut.width(), height: cut.height(), rgba: cut.into_raw() }),
        waterline,
        min,
        max,
    })
}

/// The opaque part of a picture and how it lies in metres.
struct QuadFrame {
    left: u32,
    top: u32,
    width: u32,
    height: u32,
    metres_per_px: f64,
}

impl QuadFrame {
    fn new(picture: &RgbaImage, spec: &QuadSpec) -> Result<Self, &'static str> {
        let opaque =
            || picture.enumerate_pixels().filter(|(_, _, p)| p.0[3] >= OPAQUE).map(|(x, y, _)| (x, y));
        let count = opaque().count();
        if count == 0 {
            return Err("no pixel is opaque; draw the boat with an alpha channel");
        }
        if count as u64 == u64::from(picture.width()) * u64::from(picture.height()) {
            return Err("no pixel is see-through; cut the boat out and save it as PNG with an alpha channel");
        }
        let (x0, y0) = opaque().fold((u32::MAX, u32::MAX), |a, p| (a.0.min(p.0), a.1.min(p.1)));
        let (x1, y1) = opaque().fold((0, 0), |a, p| (a.0.max(p.0), a.1.max(p.1)));
        if spec.waterline_row <= f64::from(y0) || spec.waterline_row > f64::from(y1) + 1.0 {
            return Err("waterline_row lies outside the boat's opaque pixels; correct the row");
        }
        let width = x1 - x0 + 1;
        let metres_per_px = spec.length_m / f64::from(width);
        Ok(Self { left: x0, top: y0, width, height: y1 - y0 + 1, metres_per_px })
    }

    /// Metres from the middle, forward, of a column edge of the file's picture.
    fn x(&self, column: f64, bow: Bow) -> f64 {
        let from_middle = (column - f64::from(self.left) - f64::from(self.width) / 2.0) * self.metres_per_px;
        if bow == Bow::Right { from_middle } else { -from_middle }
    }

    /// Metres above the water of a row edge of the file's picture.
    fn z(&self, row: f64, spec: &QuadSpec) -> f64 {
        (spec.waterline_row - row) * self.metres_per_px
    }

    /// Extent in metres: aft, fore, low, high.
    fn extent(&self, spec: &QuadSpec) -> [f64; 4] {
        let half = f64::from(self.width) / 2.0 * self.metres_per_px;
        let top = f64::from(self.top);
        [-half, half, self.z(top + f64::from(self.height), spec), self.z(top, spec)]
    }

    /// Engine and helm in metres: aft, fore, low, high.
    fn zones(&self, spec: &QuadSpec) -> [(Zone, [f64; 4]); 2] {
        let [aft, fore, low, high] = self.extent(spec);
        let share = |from: f64, to: f64| [aft + (fore - aft) * from, aft + (fore - aft) * to];
        let metres = |r: Rect| {
            let (a, b) = (self.x(r.left, spec.bow), self.x(r.right, spec.bow));
            [a.min(b), a.max(b), self.z(r.bottom, spec), self.z(r.top, spec)]
        };
        let [ea, ef] = share(0.30, 0.50);
        let [ha, hf] = share(0.55, 0.72);
        [
            (Zone::Helm, spec.helm.map_or([ha, hf, high * 0.40, high * 0.70], metres)),
            (Zone::Engine, spec.engine.map_or([ea, ef, low, high * 0.25], metres)),
        ]
    }

    /// The quad cut along the zones' edges: corners, and four of them for each cell.
    fn grid(&self, spec: &QuadSpec) -> (Vec<Vertex>, Vec<(Zone, [u32; 4])>) {
        let [aft, fore, low, high] = self.extent(spec);
        let zones = self.zones(spec);
        let lines = |from: f64, to: f64, at: [usize; 2]| {
            let mut all: Vec<f64> = zones.iter().flat_map(|z| at.map(|i| z.1[i].clamp(from, to))).collect();
            all.extend([from, to]);
            all.sort_by(f64::total_cmp);
            all.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
            all
        };
        let (xs, zs) = (lines(aft, fore, [0, 1]), lines(low, high, [2, 3]));
        let mut vertices = Vec::with_capacity(xs.len() * zs.len());
        for &z in &zs {
            vertices.extend(xs.iter().map(|&x| Vertex {
                position: Vec3::new(x as f32, 0.0, z as f32),
                normal: Vec3::NEG_Y,
                uv: Vec2::new(((x - aft) / (fore - aft)) as f32, ((high - z) / (high - low)) as f32),
                albedo: Vec3::ONE,
            }));
        }
        let mut cells = Vec::new();
        for (row, z) in zs.windows(2).enumerate() {
            for (column, x) in xs.windows(2).enumerate() {
                let (mx, mz) = ((x[0] + x[1]) / 2.0, (z[0] + z[1]) / 2.0);
                let inside = |r: &[f64; 4]| mx > r[0] && mx < r[1] && mz > r[2] && mz < r[3];
                let zone = zones.iter().find(|(_, r)| inside(r)).map_or(Zone::Hull, |z| z.0);
                let a = (row * xs.len() + column) as u32;
                let above = a + xs.len() as u32;
                cells.push((zone, [a, a + 1, above + 1, above]));
            }
        }
        (vertices, cells)
    }

    /// A thin rectangle under what is opaque at the water; `cut` has its bow to the right.
    fn waterline(&self, cut: &RgbaImage, spec: &QuadSpec) -> Option<Vec<DVec2>> {
        let row =
            (spec.waterline_row.ceil() as i64 - 1 - i64::from(self.top)).clamp(0, i64::from(self.height) - 1);
        let opaque = |x: &u32| cut.get_pixel(*x, row as u32).0[3] >= OPAQUE;
        let first = (0..self.width).find(opaque)?;
        let last = (0..self.width).rev().find(opaque)?;
        let x = |column: u32| (f64::from(column) - f64::from(self.width) / 2.0) * self.metres_per_px;
        let (aft, fore, half) = (x(first), x(last + 1), HALF_BEAM * spec.length_m);
        Some(vec![
            DVec2::new(aft, -half),
            DVec2::new(fore, -half),
            DVec2::new(fore, half),
            DVec2::new(aft, half),
        ])
    }
}

/// The built-in picture model: the built-in frigate seen from starboard.
pub fn frigate_quad() -> Result<Model, ModelError> {
    side_view_as(Boat::Frigate, FRIGATE_QUAD)
}

/// A picture of a built-in boat seen from starboard, drawn once under an even sky. It is called as the boat, with "-quad" added.
pub fn side_view(boat: Boat) -> Result<Model, ModelError> {
    side_view_as(boat, &format!("{}-quad", boat.name()))
}

fn side_view_as(boat: Boat, name: &str) -> Result<Model, ModelError> {
    const WIDTH: u32 = 1024;
    /// Most metres of hull below the waterline that the picture keeps; the sea hides them.
    const BELOW_MAX_M: f32 = 2.0;
    let ship = load_glb(&build_glb(boat), boat.name())?;
    let length = ship.max.x - ship.min.x;
    let m_per_px = length / (WIDTH - 4) as f32;
    let height = ((ship.max.z + BELOW_MAX_M.min(-ship.min.z).max(0.0)) / m_per_px).ceil() as u32 + 2;
    let (middle, top) = ((ship.max.x + ship.min.x) / 2.0, ship.max.z + 2.0 * m_per_px);
    let half = WIDTH as f32 / 2.0 * m_per_px;
    let bottom = top - height as f32 * m_per_px;
    // Seen from -y: x to the right, z up, distance along +y.
    let depth = 100.0;
    let clip = Mat4::from_cols_array_2d(&[
        [1.0 / half, 0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0 / depth, 0.0],
        [0.0, 2.0 / (top - bottom), 0.0, 0.0],
        [-middle / half, -(top + bottom) / (top - bottom), 0.0, 1.0],
    ]);
    // A bright sky with a weak sun high on the bow: the side that is seen comes out near its albedo.
    let sun = Vec3::new(0.45, -0.60, 0.66);
    let mut canvas = SideCanvas::new(WIDTH, height, 3);
    canvas.draw(&ship, clip, |_, normal, albedo| {
        Some(albedo * (0.42 + 0.18 * normal.z + 0.55 * normal.dot(sun).max(0.0)))
    });
    let spec = QuadSpec {
        length_m: f64::from(length),
        waterline_row: f64::from(top / m_per_px),
        bow: Bow::Right,
        engine: Some(region(&ship, Zone::Engine, middle - half, top, m_per_px)),
        helm: Some(region(&ship, Zone::Helm, middle - half, top, m_per_px)),
    };
    quad(name, name, canvas.finish(), &spec)
}

/// Where a part of `ship` lies in its side view.
fn region(ship: &Model, zone: Zone, x0: f32, z0: f32, m_per_px: f32) -> Rect {
    let ranges = ship.parts.iter().filter(|p| p.zone == zone).map(|p| p.indices.clone());
    let corners = ranges.flat_map(|r| ship.indices.get(r.start as usize..r.end as usize).unwrap_or(&[]));
    let places: Vec<Vec3> =
        corners.filter_map(|&i| ship.vertices.get(i as usize)).map(|v| v.position).collect();
    let low = places.iter().copied().reduce(Vec3::min).unwrap_or(Vec3::ZERO);
    let high = places.iter().copied().reduce(Vec3::max).unwrap_or(Vec3::ZERO);
    let px = |metres: f32| f64::from(metres / m_per_px);
    Rect { left: px(low.x - x0), top: px(z0 - high.z), right: px(high.x - x0), bottom: px(z0 - low.z) }
}
