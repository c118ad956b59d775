//! Where formulas break: each case drawn by every method, held against the truth where it can be rendered, and searched for pixels
//! that are no light at all.
//!
//! A frame of eight bits holds no NaN. A driver writes zero for one, so that zeros where neither sea nor boat is black are counted, and the
//! greatest difference of one pixel's change from its neighbours' is listed.

use anyhow::{Context, Result};
use bowwave_core::{sea::BeaufortForce, water::ReflectionMethod};
use bowwave_render::SOFTWARE;
use hw_sim::ocean::sky::{SkySpec, SkyWeather};
use image::{Rgb, RgbImage};

use super::{
    cell::TruthCell,
    draw::{Beliefs, DrawingStudio, Painter, forced_scene, picture, tones},
    grid::METHODS,
    methods_table,
    scenes::{self, Afloats},
};
use crate::{
    metric::flip_map,
    table::TextTable,
    truth::{cell::CellSpec, grid},
};

/// Result of one method in one case.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SingularOutcome {
    /// Mean and greatest FLIP of a pixel where the reflection is; `None` without a truth.
    pub flip: Option<(f64, f64)>,
    /// Pixels with a channel of nothing that the sea alone does not have.
    pub zeros: usize,
    /// Greatest difference between what a pixel and what the middle one of its neighbours changes, codes.
    pub speck: f64,
}

/// A case with a truth.
pub struct TrueCase {
    /// Its name.
    pub name: &'static str,
    /// The truth.
    pub cell: TruthCell,
}

/// The cell of a case, rendered with `paths` times the grid's paths.
fn cell(
    paths: f64,
    range_m: f64,
    state: u8,
    eye_m: f64,
    edit: impl FnOnce(&mut CellSpec),
) -> Result<TruthCell> {
    let mut spec =
        grid::cell(range_m, state, eye_m, "overcast", grid::HEADINGS_DEG[0]).context("no such cell")?;
    spec.samples = ((f64::from(spec.samples) * paths) as u32).max(1);
    edit(&mut spec);
    TruthCell::render(&spec)
}

/// The far and steep cases, which are small pictures.
pub fn far_cases(paths: f64) -> Result<Vec<TrueCase>> {
    let case = |name, cell| TrueCase { name, cell };
    // 1.0 m over the water sees a boat 1146 m off under 0.05 degrees.
    let grazing = 1.0 / 0.05_f64.to_radians().tan();
    Ok(vec![
        case("grazing 0.05 deg, state 0", cell(paths, grazing, 0, 1.0, |_| ())?),
        case("grazing 0.05 deg, state 1", cell(paths, grazing, 1, 1.0, |_| ())?),
        case("5 km, state 0", cell(paths, 5000.0, 0, 8.0, |_| ())?),
        case("5 km, state 2", cell(paths, 5000.0, 2, 8.0, |_| ())?),
        case("state 5, 400 m", cell(paths, 400.0, 5, 8.0, |_| ())?),
        case("state 7, 400 m", cell(paths, 400.0, 7, 8.0, |_| ())?),
    ])
}

/// The near ones.
pub fn near_cases(paths: f64) -> Result<Vec<TrueCase>> {
    let case = |name, cell| TrueCase { name, cell };
    let sun = SkySpec {
        weather: SkyWeather::Clear,
        sun_elevation_deg: (8.0_f64 / 60.0).atan().to_degrees(),
        sun_azimuth_deg: 0.0,
    };
    let calm = cell(paths, 60.0, 0, 8.0, |_| ())?;
    let rough = cell(paths, 60.0, 2, 8.0, |_| ())?;
    let (width, height) = rough.size();
    Ok(vec![
        case("state 0, 60 m", calm),
        case("crests and troughs: state 4, 30 m", cell(paths, 30.0, 4, 8.0, |_| ())?),
        case("state 5, 60 m", cell(paths, 60.0, 5, 8.0, |_| ())?),
        case("sun in the mirror direction", cell(paths, 60.0, 1, 8.0, |s| s.sky = sun)?),
        case("boat at the left edge", rough.cropped(width / 2, 0, width / 2, height)),
        case("boat at the right edge", rough.cropped(0, 0, width / 2, height)),
        case("picture ends in the reflection", rough.cropped(0, 0, width, height * 3 / 5)),
        case("picture begins below the hull", rough.cropped(0, height * 3 / 5, width, height * 2 / 5)),
    ])
}

/// Draws a case with every method, above force 4 too, where a session leaves reflections out.
pub fn outcomes(studio: &mut DrawingStudio, case: &TrueCase) -> Result<[SingularOutcome; METHODS]> {
    let cell = &case.cell;
    let beliefs = Beliefs::right(cell);
    let off =
        studio.draw_scene(cell, |models| forced_scene(cell, ReflectionMethod::Off, &beliefs, models))?;
    let mut out = Vec::with_capacity(METHODS);
    for method in ReflectionMethod::ALL {
        let drawn = studio.draw_scene(cell, |models| forced_scene(cell, method, &beliefs, models))?;
        let shown = cell.with_hull(&drawn);
        let map = flip_map(cell.with.as_raw(), shown.as_raw(), cell.size())?;
        let judged = map.iter().zip(&cell.region).filter(|(_, judged)| **judged);
        let (mut sum, mut count, mut most) = (0.0, 0.0, 0.0_f64);
        for (value, _) in judged {
            (sum, count, most) = (sum + f64::from(*value), count + 1.0, most.max(f64::from(*value)));
        }
        let flip = (count > 0.0).then(|| (sum / count, most));
        out.push(SingularOutcome { flip, ..searched(&cell.without, &off, &drawn) });
    }
    out.try_into().ok().context("a method is missing")
}

/// Looks for pixels that are no light in the water of `drawn`: `off` has the hull alone over `sea`.
fn searched(sea: &RgbImage, off: &RgbImage, drawn: &RgbImage) -> SingularOutcome {
    let (width, height) = sea.dimensions();
    let water = |x: u32, y: u32| sea.get_pixel(x, y) == off.get_pixel(x, y);
    let luma = |p: &Rgb<u8>| p.0.iter().map(|c| f64::from(*c)).sum::<f64>() / 3.0;
    let change = |x: u32, y: u32| luma(drawn.get_pixel(x, y)) - luma(off.get_pixel(x, y));
    let (mut zeros, mut speck) = (0, 0.0_f64);
    for y in 0..height {
        for x in 0..width {
            if !water(x, y) {
                continue;
            }
            let (got, was) = (drawn.get_pixel(x, y).0, off.get_pixel(x, y).0);
            zeros += usize::from((0..3).any(|c| got[c] == 0 && was[c] != 0));
            let mut near: Vec<f64> = Vec::with_capacity(9);
            for j in y.saturating_sub(1)..(y + 2).min(height) {
                near.extend(
                    (x.saturating_sub(1)..(x + 2).min(width)).filter(|&i| water(i, j)).map(|i| change(i, j)),
                );
            }
            near.sort_by(f64::total_cmp);
            speck = speck.max((change(x, y) - near[near.len() / 2]).abs());
        }
    }
    SingularOutcome { flip: None, zeros, speck }
}

/// A case without a truth: its name, the eye's height in metres, mean code of the sea and height of its waves in codes, the boat, and
/// the force of the wind.
type MadeCase = (&'static str, f64, (f64, f64), Afloats, u8);

fn made_cases() -> Vec<MadeCase> {
    let at = Afloats::at;
    let usual = (150.0, 15.0);
    vec![
        ("flat patch", 8.0, (150.0, 0.0), at(60.0), 1),
        ("white crests, black troughs", 8.0, (128.0, 2000.0), at(60.0), 3),
        ("all white", 8.0, (255.0, 0.0), at(60.0), 1),
        ("all but black", 8.0, (6.0, 0.0), at(60.0), 1),
        ("crests and troughs, 15 m", 6.0, usual, at(15.0), 4),
        ("camera below a wave", 0.5, usual, Afloats { water_level: 1.5, ..at(20.0) }, 4),
        ("camera in the water's plane", 1.0, usual, Afloats { water_level: 1.0, ..at(40.0) }, 2),
        ("half beyond the left edge", 8.0, usual, Afloats { right_m: -24.8, ..at(60.0) }, 2),
        ("half beyond the right edge", 8.0, usual, Afloats { right_m: 24.8, ..at(60.0) }, 2),
        ("only its reflection is seen", 30.0, usual, Afloats { water_level: 14.0, ..at(30.0) }, 1),
        ("force 8", 8.0, usual, at(60.0), 8),
        ("force 12", 8.0, usual, at(400.0), 12),
        ("20 km", 8.0, usual, at(20_000.0), 0),
    ]
}

/// Every case by every method.
pub fn table(paths: f64) -> Result<String> {
    let mut table = methods_table("case", 34, &[]);
    let mut studio = DrawingStudio::default();
    for case in near_cases(paths)?.iter().chain(&far_cases(paths)?) {
        add_row(&mut table, case.name, &outcomes(&mut studio, case)?);
    }
    let lens = scenes::lens();
    let model = scenes::grey_boat(0.5);
    let size = (lens.width, lens.height);
    let models = std::slice::from_ref(&model);
    let mut painter = Painter::new(size, models, &ReflectionMethod::ALL, (1, Some(SOFTWARE)))?;
    for (name, eye_m, (mean, waves), afloat, force) in made_cases() {
        let camera = scenes::camera(eye_m, afloat.range_m);
        let sea = scenes::sea(&lens, &camera, mean, waves);
        let (video, tones) = (picture(&sea)?, tones(&sea, &lens, &camera));
        let force = BeaufortForce::new(force).context("no such force")?;
        let mut paint = |method| {
            let how = (method, force);
            painter.paint(&scenes::scene((camera, lens), tones, &model, &[afloat], how), &video)
        };
        let off = paint(ReflectionMethod::Off)?;
        let mut found = Vec::with_capacity(METHODS);
        for method in ReflectionMethod::ALL {
            found.push(searched(&sea, &off, &paint(method)?));
        }
        add_row(&mut table, name, &found);
    }
    Ok(format!(
        "mean FLIP, worst pixel's FLIP / pixels of nothing / greatest difference of a pixel's change from its neighbours', codes\n{}",
        table.take()
    ))
}

fn add_row(table: &mut TextTable, name: &str, found: &[SingularOutcome]) {
    let cells = found.iter().map(|SingularOutcome { flip, zeros, speck }| {
        let flip = flip.map_or("-".to_owned(), |(mean, most)| format!("{mean:.3} {most:.2}"));
        format!("{flip}/{zeros}/{speck:.0}")
    });
    table.row([name.to_owned()].into_iter().chain(cells));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_of_nothing_is_found_in_the_water_and_not_in_the_hull() {
        let sea = RgbImage::from_pixel(20, 20, Rgb([90; 3]));
        let mut off = sea.clone();
        (0..20).for_each(|x| off.put_pixel(x, 0, Rgb([0; 3])));
        assert_eq!(searched(&sea, &off, &off), SingularOutcome { flip: None, zeros: 0, speck: 0.0 });
        let mut drawn = off.clone();
        drawn.put_pixel(7, 9, Rgb([90, 0, 90]));
        assert_eq!(searched(&sea, &off, &drawn), SingularOutcome { flip: None, zeros: 1, speck: 30.0 });
        // A reflection with an edge is no speck.
        let mut drawn = off.clone();
        (5..20).for_each(|y| (0..20).for_each(|x| drawn.put_pixel(x, y, Rgb([40; 3]))));
        assert_eq!(searched(&sea, &off, &drawn).speck, 0.0);
    }

    #[test]
    fn the_grazing_case_is_seen_under_its_angle() {
        let range = 1.0 / 0.05_f64.to_radians().tan();
        assert!(((1.0 / range).atan().to_degrees() - 0.05).abs() < 1e-12);
    }
}
