//! A boat's hull as drawn, against its picture by paths of light in the same sky.

mod studio;

use anyhow::Result;

use super::About;
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    path_traced::Kind,
    reflection::cost::process_ms,
};
use studio::{Cell, HullErrors, HullStudio, Lit, WAYS};

/// Description of this part.
pub const ABOUT: About = About {
    part: "hull",
    what: "Draws a boat in the light of sun, sky and sea.",
    truth: "the same mesh in the same sky by paths of light: matt, up to five hulls a path, the sun's disc .53 degrees wide, the sky by direction, the sea at the \
            radiance that the product is given, with the hull's image in it; 256 paths a pixel at four places. Mean FLIP over the pixels that show the boat, \
            over skiff, RHIB, dhow and, five times as far, frigate at 60, 150 and 400 m",
    rivals: "the product's picture without shadows, and with a sky that is even; the sun without shadows and an even light that reaches all (Lambert and \
             ambient). Below that, what is left where one part of the product's light is replaced by the truth's",
    why: "what each corner gets of sky, sea and the other faces is found once, and a map a boat hides the sun: what is left are triangles that simplification left out, thin shadows, and edges",
};

const BOATS: [(&str, f64); 4] = [("skiff", 1.0), ("rhib", 1.0), ("dhow", 1.0), ("frigate", 5.0)];
const RANGES_M: [f64; 3] = [60.0, 150.0, 400.0];
/// The first so many of [`LIGHTS`] are by day.
const DAYS: usize = 3;

/// Lights by day, at dusk and at night; white that faces the sun is not clipped by day, and as dim as a camera shows it at dusk and by night.
const LIGHTS: [Lit; 5] = [
    Lit::clear("sun high", 0.9, [55.0, 140.0]),
    Lit::clear("sun low", 0.9, [8.0, 230.0]),
    Lit { kind: Kind::Overcast, ..Lit::clear("overcast", 0.6, [40.0, 140.0]) },
    Lit::clear("dusk", 0.35, [-3.0, 60.0]),
    Lit::clear("moonlit night", 0.06, [35.0, 220.0]),
];

/// Extreme lights.
const EXTREMES: [Lit; 4] = [
    Lit::clear("the sun on the horizon, abeam", 0.6, [0.3, 90.0]),
    Lit::clear("the sun behind the eye", 0.9, [10.0, 180.0]),
    Lit::clear("the sun ahead", 0.9, [10.0, 0.0]),
    Lit::clear("the sun overhead", 0.9, [90.0, 0.0]),
];

/// Headings of the boats, degrees: each is seen from the bow and from the stern in some light.
fn heading_deg(boat: usize, light: usize) -> f64 {
    (65.0 + 47.0 * boat as f64 + 97.0 * light as f64) % 360.0
}

/// Errors by range, light and boat.
struct Measured(Vec<(usize, usize, usize, HullErrors)>);

impl Measured {
    /// Mean over the cells that a test says yes to; nothing where there are none.
    fn mean(&self, of: impl Fn(usize, usize, usize) -> bool) -> Option<HullErrors> {
        let found = self.0.iter().filter(|(range, light, boat, _)| of(*range, *light, *boat));
        HullErrors::mean(found.map(|(_, _, _, errors)| errors))
    }
}

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let is_quick = bench.is_quick();
    // The short form looks at one boat, at one range, in two lights.
    let (boats, ranges, lights, paths) = if is_quick {
        (&BOATS[..1], &[1][..], &[0, 2][..], 32)
    } else {
        (&BOATS[..], &[0, 1, 2][..], &[0, 1, 2, 3, 4][..], 256)
    };
    let mut studios = Vec::new();
    for (name, _) in boats {
        studios.push(HullStudio::new(name)?);
    }
    let mut measured = Measured(Vec::new());
    for &light in lights {
        let traced = LIGHTS[light].traced()?;
        for (boat, (studio, (_, scale))) in studios.iter().zip(boats).enumerate() {
            for &range in ranges {
                let cell = Cell {
                    range_m: RANGES_M[range] * scale,
                    heading_deg: heading_deg(boat, light),
                    light: &traced,
                };
                measured.0.push((range, light, boat, studio.errors(&cell, paths)?));
            }
        }
    }
    let Some(studio) = studios.first() else { return Ok(()) };
    let traced = LIGHTS[0].traced()?;
    let near = Cell { range_m: RANGES_M[0], heading_deg: heading_deg(0, 0), light: &traced };
    let noise = studio.noise(&near, paths)?;
    for &range in ranges {
        let Some(day) = measured.mean(|r, light, _| r == range && light < DAYS) else { continue };
        let cell = Cell { range_m: RANGES_M[range], ..near };
        rank(bench, &format!("by day at {:.0} m", RANGES_M[range]), (studio, &cell), &day, noise)?;
    }
    list(bench, &measured, ranges, lights, boats);
    measure_extremes(bench, &studios, boats, if is_quick { 1 } else { EXTREMES.len() }, paths)
}

/// Ranks what the renderer draws by error and by the time of a frame.
fn rank(
    bench: &mut PartBench,
    scene: &str,
    (studio, cell): (&HullStudio, &Cell<'_>),
    errors: &HullErrors,
    noise: f64,
) -> Result<()> {
    let mut ways = Vec::new();
    for ((name, drawn), error) in WAYS.into_iter().zip(studio.scenes(cell)?).zip(errors.ways) {
        let timed = move || {
            let before = process_ms();
            // A frame that fails has drawn nothing: it is counted as endless.
            if studio.paint(&drawn).is_ok() { (process_ms() - before) * 1e6 } else { f64::INFINITY }
        };
        ways.push(Way::telling(name, "", error, 1, timed).default_if(ways.is_empty()));
    }
    bench.scene(scene, "FLIP", noise, ways);
    Ok(())
}

/// Lists each light at each range, each boat, and what would be left if one part of the light were the truth's.
fn list(
    bench: &mut PartBench,
    measured: &Measured,
    ranges: &[usize],
    lights: &[usize],
    boats: &[(&str, f64)],
) {
    for &range in ranges {
        for &light in lights {
            let Some(errors) = measured.mean(|r, l, _| (r, l) == (range, light)) else { continue };
            let case = format!("{}, {:.0} m", LIGHTS[light].name, RANGES_M[range]);
            let mut rows = errors.listed();
            for (boat, (name, _)) in boats.iter().enumerate() {
                if let Some(of_boat) = measured.mean(|r, l, b| (r, l, b) == (range, light, boat)) {
                    rows.push(ExtremeResult::product(WAYS[0], &format!("{name} alone"), of_boat.ways[0]));
                }
            }
            bench.extreme(&case, "FLIP", rows);
        }
    }
}

fn measure_extremes(
    bench: &mut PartBench,
    studios: &[HullStudio],
    boats: &[(&str, f64)],
    count: usize,
    paths: u32,
) -> Result<()> {
    for light in &EXTREMES[..count] {
        let traced = light.traced()?;
        let mut found = Vec::new();
        for (boat, (studio, (_, scale))) in studios.iter().zip(boats).enumerate() {
            let cell =
                Cell { range_m: RANGES_M[0] * scale, heading_deg: heading_deg(boat, 0), light: &traced };
            found.push(studio.errors(&cell, paths)?);
        }
        let Some(mean) = HullErrors::mean(found.iter()) else { continue };
        bench.extreme(&format!("{}, 60 m", light.name), "FLIP", mean.listed());
    }
    Ok(())
}
