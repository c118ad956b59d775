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

use std::{fs, path::Path};

use anyhow::{Context, Result};
use bowwave_core::water::ReflectionMethod;
use image::RgbImage;

use compare::Difference;
use mask::Mask;
use spec::{Assumed, View};

/// One figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The picture.
    pub picture: String,
    /// The method, or what else was held against the photograph.
    pub method: String,
    /// What was assumed of the camera.
    pub setting: String,
    /// How far off it is.
    pub difference: Difference,
}

/// What is held against the photograph besides the methods: the filling, where no reflection is.
pub const CONTROL: &str = "filling";

/// Measures every picture that is there and writes `photographs.csv` and a picture of all methods side by side for each.
/// `data` is the folder that holds the series' folders.
pub fn run(data: &Path, out: &Path, quick: bool) -> Result<Vec<Row>> {
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

fn measure(data: &Path, out: &Path, view: &View, index: usize, quick: bool) -> Result<Vec<Row>> {
    let path = data.join(&view.series).join(&view.picture[index].file);
    let photo = image::open(&path).with_context(|| format!("cannot read {}", path.display()))?.into_rgb8();
    let name = format!("{}-{}", view.series, path.file_stem().unwrap_or_default().to_string_lossy());
    let (boat, reflection) = view.outlines(index);
    let region = Mask::of_polygon(photo.dimensions(), &reflection);
    let cleaned = fill::without(&photo, &region, &region.clone().and(&boat), view.source_px);
    let mut rows = Vec::new();
    let mut add = |method: &str, setting: &str, difference| {
        rows.push(Row { picture: name.clone(), method: method.into(), setting: setting.into(), difference });
    };
    let control = Mask::of_polygon(photo.dimensions(), &view.control(index));
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
fn write_scene(folder: &Path, pictures: &[(&str, RgbImage)], region: &Mask) -> Result<()> {
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
    region: &Mask,
) -> Result<()> {
    let sheet = sheet::side_by_side(pictures, sheet::around(boat, region));
    sheet.save(path).with_context(|| format!("cannot write {}", path.display()))
}

fn write_csv(path: &Path, rows: &[Row]) -> Result<()> {
    let mut text = String::from("picture,method,setting,flip,spectrum_octaves\n");
    for Row { picture, method, setting, difference } in rows {
        text += &format!("{picture},{method},{setting},{:.4},{:.3}\n", difference.flip, difference.spectrum);
    }
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

/// Mean of a method's figures over all pictures, under the estimated camera.
pub fn mean_of(rows: &[Row], method: &str) -> Option<Difference> {
    let of_method: Vec<_> =
        rows.iter().filter(|r| r.method == method && r.setting == Assumed::ESTIMATE).collect();
    let n = of_method.len() as f64;
    (n > 0.0).then(|| Difference {
        flip: of_method.iter().map(|r| r.difference.flip).sum::<f64>() / n,
        spectrum: of_method.iter().map(|r| r.difference.spectrum).sum::<f64>() / n,
    })
}
