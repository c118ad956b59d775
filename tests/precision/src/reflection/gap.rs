//! Whether a reflection hangs together with its hull: bare water between them at the water line, in the drawn pictures.

use anyhow::{Context, Result};
use bowwave_core::{sea::BeaufortForce, water::ReflectionMethod};
use bowwave_render::SOFTWARE;
use image::{RgbImage, imageops};

use super::{
    cell::luminance,
    draw::{Painter, picture, tones},
    methods_table,
    scenes::{self, Afloats},
};

/// Distances, metres.
pub const RANGES_M: [f64; 10] = [30.0, 60.0, 100.0, 150.0, 250.0, 400.0, 700.0, 1000.0, 1500.0, 2000.0];

/// A way to lie in the water.
pub struct GapCase {
    /// Its name.
    pub name: &'static str,
    /// Force of the wind.
    pub force: u8,
    /// The boat, at any range.
    pub afloat: Afloats,
}

/// All of them.
pub fn cases() -> Vec<GapCase> {
    let level = Afloats::at(60.0);
    let case = |name, force, afloat| GapCase { name, force, afloat };
    vec![
        case("level", 0, level),
        case("on a crest, 0.5 m", 0, Afloats { water_level: 0.5, ..level }),
        case("in a trough, 0.5 m", 0, Afloats { water_level: -0.5, ..level }),
        case("0.2 m out of the water", 0, Afloats { lifted_m: 0.2, ..level }),
        case("pitch 3, roll 6 deg", 0, Afloats { pitch_deg: 3.0, roll_deg: 6.0, ..level }),
        case("three quarters, force 2, crest", 2, Afloats { heading_deg: 215.0, water_level: 0.3, ..level }),
    ]
}

/// ReflectionGap by columns of one picture, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReflectionGap {
    /// The middle one.
    pub median: f64,
    /// The widest but for one column in twenty.
    pub most: f64,
    /// Share of the hull's columns that have a reflection at all.
    pub seen: f64,
}

/// Measures the gap under a black boat. `off` has the hull alone over `sea`, `drawn` its reflection too. `None` without a hull.
pub fn measure(sea: &RgbImage, off: &RgbImage, drawn: &RgbImage, reach_px: u32) -> Option<ReflectionGap> {
    /// Pixels that the hull covers by more than this are hull.
    const HULL: f64 = 0.5;
    /// Of pixels that it covers by more than this the water's share is too small to be told.
    const COVERED: f64 = 0.75;
    /// A reflection begins where it takes this share of what it takes at its strongest in that column.
    const BEGINS: f64 = 0.5;
    /// A column whose light it changes nowhere by more than this share has no reflection: two or three codes.
    const SEEN: f64 = 0.03;
    let (width, height) = sea.dimensions();
    let light = |of: &RgbImage, x: u32, y: u32| luminance(of.get_pixel(x, y));
    let covered = |x, y| 1.0 - light(off, x, y) / light(sea, x, y).max(1e-6);
    let foot = |x| (0..height).rev().find(|&y| covered(x, y) > HULL);
    let feet: Vec<(u32, u32)> = (0..width).filter_map(|x| Some((x, foot(x)?))).collect();
    // At its very ends a hull covers parts of pixels.
    let inner = if feet.len() > 4 { &feet[1..feet.len() - 1] } else { &feet[..] };
    let mut gaps = Vec::new();
    for &(x, foot) in inner {
        let below = foot..(foot + reach_px.max(4) + 1).min(height);
        let taken = |y| 1.0 - light(drawn, x, y) / light(off, x, y).max(1e-6);
        let open = |y: &u32| covered(x, *y) < COVERED;
        let strongest = below.clone().filter(open).map(taken).fold(0.0, f64::max);
        if strongest < SEEN {
            continue;
        }
        let bare = below.filter(open).take_while(|y| taken(*y) < BEGINS * strongest);
        gaps.push(bare.map(|y| 1.0 - covered(x, y).max(0.0)).fold(0.0, |sum, y| sum + y));
    }
    gaps.sort_by(f64::total_cmp);
    let seen = gaps.len() as f64 / inner.len() as f64;
    let at = |share: f64| gaps.get(((gaps.len() as f64 * share) as usize).min(gaps.len().saturating_sub(1)));
    (!inner.is_empty()).then(|| ReflectionGap {
        median: at(0.5).copied().unwrap_or(f64::NAN),
        most: at(0.95).copied().unwrap_or(f64::NAN),
        seen,
    })
}

/// Draws all cases at all ranges with all methods: a table of median / 95 % of the columns (share of columns with a reflection).
pub fn table() -> Result<String> {
    /// Height of the eye, metres.
    const EYE_M: f64 = 8.0;
    let lens = scenes::lens();
    let model = scenes::grey_boat(0.0);
    let models = std::slice::from_ref(&model);
    let mut painter =
        Painter::new((lens.width, lens.height), models, &ReflectionMethod::ALL, (1, Some(SOFTWARE)))?;
    let mut text = String::from(
        "pixels of bare water between hull and reflection: median / 95 % of the columns (columns with a reflection)\n",
    );
    let mut worst = [0.0_f64; ReflectionMethod::ALL.len()];
    for case in cases() {
        let mut table = methods_table(case.name, 32, &[]);
        for range_m in RANGES_M {
            let camera = scenes::camera(EYE_M, range_m);
            let sea = scenes::sea(&lens, &camera, 150.0, 12.0);
            let (video, tones) = (picture(&sea)?, tones(&sea, &lens, &camera));
            let afloat = Afloats { range_m, ..case.afloat };
            let force = BeaufortForce::new(case.force).context("no such force")?;
            let reach_px = (model.height_m() / range_m * lens.focal.y).ceil() as u32;
            let mut scene =
                scenes::scene((camera, lens), tones, &model, &[afloat], (ReflectionMethod::Off, force));
            let hull = scene.boats.first().and_then(|b| b.hull).context("the boat is not in the picture")?;
            let cut = |p: &RgbImage| {
                imageops::crop_imm(p, hull.x, hull.y, hull.width, hull.height + reach_px + 4).to_image()
            };
            let mut paint = |method| {
                scene.water.method = method;
                painter.paint(&scene, &video).map(|drawn| cut(&drawn))
            };
            let (sea, off) = (cut(&sea), paint(ReflectionMethod::Off)?);
            let mut cells = vec![format!("  {range_m} m")];
            for (method, worst) in ReflectionMethod::ALL.into_iter().zip(&mut worst) {
                let gap = measure(&sea, &off, &paint(method)?, reach_px)
                    .context("the hull is not in the picture")?;
                *worst = worst.max(gap.most);
                cells.push(if gap.seen > 0.0 {
                    format!("{:.2} / {:.2} ({:3.0} %)", gap.median, gap.most, 100.0 * gap.seen)
                } else {
                    "none".to_owned()
                });
            }
            table.row(cells);
        }
        text += &table.take();
    }
    let mut table = methods_table("all", 32, &[]);
    table.row(["worst 95 %".to_owned()].into_iter().chain(worst.map(|w| format!("{w:.2}"))));
    Ok(text + &table.take())
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    /// A hull from row 10 to 19 and a reflection from `from` on, in columns 20 to 39.
    fn drawn(from: u32) -> [RgbImage; 3] {
        let sea = RgbImage::from_pixel(60, 60, Rgb([150; 3]));
        let paint = |rows: &[(std::ops::Range<u32>, u8)]| {
            let mut out = sea.clone();
            for (rows, code) in rows {
                rows.clone().for_each(|y| (20..40).for_each(|x| out.put_pixel(x, y, Rgb([*code; 3]))));
            }
            out
        };
        let hull = (10..20, 0);
        [sea.clone(), paint(std::slice::from_ref(&hull)), paint(&[(from..30, 60), hull])]
    }

    #[test]
    fn a_gap_is_the_rows_of_bare_water() {
        for gap in [0, 1, 3] {
            let [sea, off, drawn] = drawn(20 + gap);
            let found = measure(&sea, &off, &drawn, 12).unwrap();
            assert_eq!(found, ReflectionGap { median: f64::from(gap), most: f64::from(gap), seen: 1.0 });
        }
        let [sea, off, _] = drawn(20);
        assert_eq!(measure(&sea, &off, &off, 12).unwrap().seen, 0.0);
        assert_eq!(measure(&sea, &sea, &sea, 12), None);
    }

    #[test]
    fn a_row_that_the_hull_covers_in_part_counts_in_part() {
        let [sea, mut off, mut drawn] = drawn(21);
        // Row 20: a third hull, its water bare.
        for x in 20..40 {
            let code = Rgb([125; 3]);
            off.put_pixel(x, 20, code);
            drawn.put_pixel(x, 20, code);
        }
        let want = luminance(&Rgb([125; 3])) / luminance(&Rgb([150; 3]));
        let found = measure(&sea, &off, &drawn, 12).unwrap();
        assert!((found.median - want).abs() < 1e-9 && found.median < 0.75, "{found:?}");
    }
}
