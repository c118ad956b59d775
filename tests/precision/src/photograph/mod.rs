//! Real photographs: a real boat's reflection is taken out of its picture, drawn again by each of the product's methods, and held
//! against the real one.
//!
//! For each picture ([`spec`], outlines as text): the water under the boat is filled with the water beside it ([`fill`]); the boat,
//! cut out above its water line, becomes a picture boat of the product ([`billboard`]); `bowwave compose`'s own code draws it with
//! each method; [`compare`] holds the result against the photograph where the real reflection is.

pub mod billboard;
pub mod compare;
pub mod fill;
pub mod mask;
pub mod sheet;
pub mod spec;

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};
use bowwave_core::water::ReflectionMethod;
use image::RgbImage;

use compare::Difference;
use mask::OutlineMask;
use spec::{Assumed, PhotographView};

use crate::table::{self, TextTable};

/// One figure.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotographRow {
    /// The picture.
    pub picture: String,
    /// The method, or what else was held against the photograph.
    pub method: String,
    /// Assumption about the camera.
    pub setting: String,
    /// How far off it is.
    pub difference: Difference,
}

/// The picture that is held against the photograph besides those of the methods: the filling, where no reflection is.
pub const CONTROL: &str = "filling";

/// Draws the reflections of photographed boats anew and holds them against the real ones.
#[derive(Debug, clap::Args)]
pub struct PhotographStudy {
    /// Folder with davis_boat_1080p and wasr_stills
    #[arg(long, value_name = "DIR", default_value = "../shared/data/sea")]
    data: PathBuf,
    /// Folder for photographs.csv and the pictures side by side
    #[arg(long, value_name = "DIR", default_value = "target/precision/photographs")]
    out: PathBuf,
    /// One picture of each view, and no errors of the estimated cameras
    #[arg(long)]
    quick: bool,
}

impl PhotographStudy {
    /// Prints the figures under the estimated cameras; nothing without the photographs.
    pub fn run(&self) -> Result<()> {
        if !self.data.is_dir() {
            println!("skipped: no folder {} with photographs; name one with --data", self.data.display());
            return Ok(());
        }
        let rows = run(&self.data, &self.out, self.quick)?;
        let mut table = TextTable::new(2, [("picture", 26), ("method", 16), ("FLIP", 6), ("spectrum", 9)]);
        let mut add = |picture: &str, method: &str, d: Difference| {
            table.row([
                picture.to_owned(),
                method.to_owned(),
                format!("{:.3}", d.flip),
                format!("{:.2}", d.spectrum),
            ]);
        };
        for row in rows.iter().filter(|r| r.setting == Assumed::ESTIMATE || r.method == CONTROL) {
            add(&row.picture, &row.method, row.difference);
        }
        for method in ReflectionMethod::ALL {
            if let Some(mean) = mean_of(&rows, method.name()) {
                add("mean", method.name(), mean);
            }
        }
        print!("{}", table.take());
        println!("{}", self.out.join("photographs.csv").display());
        Ok(())
    }
}

/// Measures every picture that is there and writes `photographs.csv` and a picture of all methods side by side for each.
/// `data` is the folder that holds the series' folders.
pub fn run(data: &Path, out: &Path, quick: bool) -> Result<Vec<PhotographRow>> {
    fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let mut rows = Vec::new();
    for view in spec::views()? {
        let pictures = if quick { &view.picture[..1] } else { &view.picture[..] };
        for index in 0..pictures.len() {
            rows.extend(measure(data, out, &view, index, quick)?);
        }
    }
    write_csv(&out.join("photographs.csv"), &rows)?;
    Ok(rows)
}

fn measure(
    data: &Path,
    out: &Path,
    view: &PhotographView,
    index: usize,
    quick: bool,
) -> Result<Vec<PhotographRow>> {
    let path = data.join(&view.series).join(&view.picture[index].file);
    let photo = image::open(&path).with_context(|| format!("cannot read {}", path.display()))?.into_rgb8();
    let name = format!("{}-{}", view.series, path.file_stem().unwrap_or_default().to_string_lossy());
    let (boat, reflection) = view.outlines(index);
    let region = OutlineMask::of_polygon(photo.dimensions(), &reflection);
    let cleaned = fill::without(&photo, &region, &region.clone().and(&boat), view.source_px);
    let mut rows = Vec::new();
    let mut add = |method: &str, setting: &str, difference| {
        rows.push(PhotographRow {
            picture: name.clone(),
            method: method.into(),
            setting: setting.into(),
            difference,
        });
    };
    let control = OutlineMask::of_polygon(photo.dimensions(), &view.control(index));
    if control.count() * 10 >= region.count() * 6 {
        let filled = fill::without(&photo, &control, &control, view.source_px);
        add(CONTROL, "water without a boat", compare::compare(&photo, &filled, &control)?);
    }
    let cut = billboard::CutOut::new(&photo, &boat);
    let mut pictures = vec![("photograph", photo.clone())];
    for assumed in Assumed::all(quick) {
        for method in ReflectionMethod::ALL {
            let drawn = billboard::draw((view, index), &assumed, method, &cleaned, &cut)?;
            add(method.name(), assumed.name, compare::compare(&photo, &drawn, &region)?);
            if assumed.is_estimate() {
                pictures.push((method.name(), drawn));
            }
        }
    }
    write_sheet(&out.join(format!("{name}.png")), &pictures, &boat, &region)?;
    write_scene(&out.join("scenes").join(&name), &pictures, &region)?;
    Ok(rows)
}

/// The region of each picture alone, for the detector: `METHOD.png`, and `region.png`, white where the reflection is.
fn write_scene(folder: &Path, pictures: &[(&str, RgbImage)], region: &OutlineMask) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let [left, top, right, bottom] = region.bounds().context("the region lies outside the picture")?;
    let (width, height) = (right - left + 1, bottom - top + 1);
    let inside = RgbImage::from_fn(width, height, |x, y| {
        image::Rgb([if region.has(left + x, top + y) { 255 } else { 0 }; 3])
    });
    let crop = |p: &RgbImage| image::imageops::crop_imm(p, left, top, width, height).to_image();
    let parts = pictures.iter().map(|(name, p)| (*name, crop(p))).chain([("region", inside)]);
    for (name, part) in parts {
        let path = folder.join(format!("{name}.png"));
        part.save(&path).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

fn write_sheet(
    path: &Path,
    pictures: &[(&str, RgbImage)],
    boat: &[Vec<[f64; 2]>],
    region: &OutlineMask,
) -> Result<()> {
    let sheet = sheet::side_by_side(pictures, sheet::around(boat, region));
    sheet.save(path).with_context(|| format!("cannot write {}", path.display()))
}

fn write_csv(path: &Path, rows: &[PhotographRow]) -> Result<()> {
    let cells = rows.iter().map(|PhotographRow { picture, method, setting, difference: d }| {
        vec![
            picture.clone(),
            method.clone(),
            setting.clone(),
            format!("{:.4}", d.flip),
            format!("{:.3}", d.spectrum),
        ]
    });
    let text = table::csv(&["picture", "method", "setting", "flip", "spectrum_octaves"], cells)?;
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

/// Mean of a method's figures over all pictures, under the estimated camera.
pub fn mean_of(rows: &[PhotographRow], method: &str) -> Option<Difference> {
    let of_method: Vec<_> =
        rows.iter().filter(|r| r.method == method && r.setting == Assumed::ESTIMATE).collect();
    let n = of_method.len() as f64;
    (n > 0.0).then(|| Difference {
        flip: of_method.iter().map(|r| r.difference.flip).sum::<f64>() / n,
        spectrum: of_method.iter().map(|r| r.difference.spectrum).sum::<f64>() / n,
    })
}
