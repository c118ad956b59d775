//! The photographs: outlines and estimated cameras, as text.

use anyhow::{Context, Result, ensure};
use serde::Deserialize;

/// A polygon in pixels, closed by itself.
pub type Polygon = Vec<[f64; 2]>;

/// One boat before one camera, in one picture or several.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhotographView {
    /// Folder of the pictures.
    pub series: String,
    /// Horizontal field of view, degrees.
    pub hfov_deg: f64,
    /// The camera above the water, metres.
    pub eye_height_m: f64,
    /// Row of the sea's horizon.
    pub horizon_row: f64,
    /// Row of the boat's water line.
    pub waterline_row: f64,
    /// Wind force.
    pub beaufort: u8,
    /// Where the wind comes from, degrees clockwise from where the camera looks.
    pub wind_from_deg: f64,
    /// How far left and right of the reflection the water is like it was under it, pixels.
    pub source_px: u32,
    /// Outlines of everything above the water; several polygons are one boat.
    pub boat: Vec<Polygon>,
    /// Where the real reflection is.
    pub reflection: Polygon,
    /// From the reflection to water without one, pixels.
    pub control_shift: [f64; 2],
    /// The pictures.
    pub picture: Vec<PlacedBoat>,
}

/// How the outlines lie in a picture: scaled about `PlacedBoat::ORIGIN`, then moved.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlacedBoat {
    /// File name.
    pub file: String,
    /// Scale.
    pub scale: f64,
    /// Move, pixels.
    pub shift: [f64; 2],
}

impl PlacedBoat {
    /// Point about which outlines are scaled.
    const ORIGIN: [f64; 2] = [600.0, 700.0];

    /// A point of the outlines in this picture.
    pub fn place(&self, p: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|i| Self::ORIGIN[i] + (p[i] - Self::ORIGIN[i]) * self.scale + self.shift[i])
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PhotographFile {
    view: Vec<PhotographView>,
}

/// All photographs.
pub fn views() -> Result<Vec<PhotographView>> {
    let file: PhotographFile =
        toml::from_str(include_str!("photographs.toml")).context("photographs.toml cannot be read")?;
    for view in &file.view {
        ensure!(!view.picture.is_empty(), "{} has no picture", view.series);
        let long = |p: &Polygon| p.len() >= 3 && p.iter().flatten().all(|c| c.is_finite());
        ensure!(view.boat.iter().all(long) && long(&view.reflection), "{}: a polygon is none", view.series);
    }
    Ok(file.view)
}

impl PhotographView {
    /// The boat's polygons and the reflection's in picture number `index`.
    pub fn outlines(&self, index: usize) -> (Vec<Polygon>, Polygon) {
        let placed = &self.picture[index];
        let place = |p: &Polygon| p.iter().map(|&c| placed.place(c)).collect::<Polygon>();
        (self.boat.iter().map(place).collect(), place(&self.reflection))
    }

    /// The reflection's polygon moved to water that mirrors no boat.
    pub fn control(&self, index: usize) -> Polygon {
        let [dx, dy] = self.control_shift;
        self.outlines(index).1.into_iter().map(|[x, y]| [x + dx, y + dy]).collect()
    }

    /// Row of the horizon in picture number `index`.
    pub fn horizon(&self, index: usize) -> f64 {
        // The camera turns from picture to picture; the boat's water line is as far below the horizon as the boat is large.
        let placed = &self.picture[index];
        self.waterline(index) - (self.waterline_row - self.horizon_row) * placed.scale
    }

    /// Row of the boat's water line in picture number `index`.
    pub fn waterline(&self, index: usize) -> f64 {
        self.picture[index].place([0.0, self.waterline_row])[1]
    }
}

/// What is assumed of a camera that nobody measured: the estimate, or an error of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assumed {
    /// Its name in reports.
    pub name: &'static str,
    /// Factor on the field of view.
    pub hfov: f64,
    /// Factor on the eye's height, and on the rows between horizon and water line with it.
    pub height: f64,
    /// Added to the wind force.
    pub force: u8,
}

impl Assumed {
    /// Name of the estimate.
    pub const ESTIMATE: &'static str = "as estimated";

    /// The estimate first, then its errors; the estimate alone for a quick look.
    pub fn all(quick: bool) -> Vec<Self> {
        let estimate = Self { name: Self::ESTIMATE, hfov: 1.0, height: 1.0, force: 0 };
        let mut all = vec![estimate];
        if !quick {
            all.extend([
                Self { name: "field of view x 0.67", hfov: 0.67, ..estimate },
                Self { name: "field of view x 1.33", hfov: 1.33, ..estimate },
                Self { name: "eye height x 0.85", height: 0.85, ..estimate },
                Self { name: "eye height x 1.15", height: 1.15, ..estimate },
                Self { name: "wind force + 1", force: 1, ..estimate },
            ]);
        }
        all
    }

    /// Whether this is the estimate itself.
    pub fn is_estimate(&self) -> bool {
        self.name == Self::ESTIMATE
    }
}
