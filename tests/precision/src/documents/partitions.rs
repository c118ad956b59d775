//! What plain maps, filtered ones, cascades and Z-GaF maps make of the objects of Table 1.

use anyhow::{Context as _, Result};
use image::RgbImage;

use super::{Exhibit, Figure, Line, Table, Workshop};
use crate::{metric::flip_map, parts::shadow::table::pictures};

const SIZE: (u32, u32) = (480, 270);

/// Errors and pictures side by side.
pub fn exhibits(_: &Workshop) -> Result<Vec<Exhibit>> {
    let wants = ["one map of the scene", "one map, PCF", "cascaded maps", "Z-GaF maps"];
    let is_wanted = |method: &str, setting: &str| wants.contains(&method) && setting.contains("1024");
    let made = pictures(SIZE, |named| is_wanted(named.method, named.setting))?;
    let truth = made.first().map(|(_, picture)| picture.clone()).context("no truth")?;
    let (mut lines, mut figures) = (Vec::new(), Vec::new());
    for (way, picture) in made {
        let map = flip_map(&truth, &picture, SIZE)?;
        let mean = map.iter().map(|e| f64::from(*e)).sum::<f64>() / map.len() as f64;
        let worst = map.iter().copied().fold(0.0, f32::max);
        lines.push(Line::new([way.as_str().into(), mean.into(), f64::from(worst).into()]));
        let picture = RgbImage::from_raw(SIZE.0, SIZE.1, picture).context("a picture of another size")?;
        figures.push(Figure::new(way, "boats and boxes on a plane with their shadows", &picture)?);
    }
    Ok(vec![
        Exhibit::Table(Table {
            caption: "Shadows of seven objects on a plane against rays".into(),
            titles: vec!["way", "FLIP, mean", "worst pixel"],
            lines,
        }),
        Exhibit::Figures(figures),
    ])
}
