//! The sun's shadows of a boat on itself.

mod studio;
pub mod table;

use anyhow::Result;
use glam::DVec3;

use super::{
    About,
    drawn_boat::{towards, without_shadow},
};
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    reflection::{cost::process_ms, scenes::Afloats},
    shadows::{FIVE_STAGES, FOUR_STAGES, METHODS, NamedMethod, Stage},
};
use studio::{CaseErrors, RANGES_M, Studio, Sunlit};

/// Description of this part.
pub const ABOUT: About = About {
    part: "shadow",
    what: "Shades a boat where it stands in its own sunlight.",
    truth: "the same boat drawn without shadows, the sun's part of each pixel by the share of the sun's disc, .53 degrees wide, that rays from \
            four places of the pixel find free; the tracer shares no code with the renderer. Mean FLIP over the boat's pixels, over skiff, RHIB, dhow \
            and, five times as far, frigate at 60, 150 and 400 m, suns 3 to 60 degrees up, and headings all round",
    rivals: "on the processor, at the same places that the picture shows, with two more boats in it at the other ranges: a map of each boat's own, as the \
             product has it; one map of the scene, at one texel or by percentage closer filtering; cascaded maps; Kolivand and Sunar's Z-GaF maps, as printed \
             and fitted to the boats; variance and moment maps; shadow volumes, counted behind what is seen to infinity, or before it as printed; no shadow at \
             all. Their time is that of making them and of one look-up a pixel, and is none of the rest of a frame",
    why: "a map of each boat's own has its texels where the boat is seen, at any angle between sun and view, and no more of them than are seen",
};

const BOATS: [(&str, f64); 4] = [("skiff", 1.0), ("rhib", 1.0), ("dhow", 1.0), ("frigate", 5.0)];

/// Name of what is counted before each method of the list: the product's own picture, and the same without shadows.
const DRAWN: [&str; 2] = ["a map a boat", "no shadow"];

/// Studios of boats, by how much the ranges are multiplied for each, and the methods that are held against each other.
struct Fleet {
    studios: Vec<(Studio, f64)>,
    methods: Vec<&'static NamedMethod>,
}

impl Fleet {
    fn new(is_quick: bool) -> Result<Self> {
        let studio = |(boat, scale)| Ok((Studio::new(boat)?, scale));
        Ok(Self {
            studios: BOATS.into_iter().map(studio).collect::<Result<_>>()?,
            methods: METHODS.iter().filter(|named| !(is_quick && named.is_dear)).collect(),
        })
    }

    /// Mean of the errors of cases, those of a boat with few pixels counting as much as others: the product's two pictures, then each method.
    fn mean(&self, studio: &Studio, cases: &[Sunlit], more: &[Afloats]) -> Result<Vec<f64>> {
        let (mut sums, mut count) = (vec![0.0; 2 + self.methods.len()], 0.0);
        for case in cases {
            let CaseErrors { drawn, bare, methods, pixels } = studio.errors(case, more, &self.methods)?;
            if pixels > 0 {
                let errors = [drawn, bare].into_iter().chain(methods);
                sums.iter_mut().zip(errors).for_each(|(sum, error)| *sum += error);
                count += 1.0;
            }
        }
        Ok(sums.into_iter().map(|sum| sum / f64::max(count, 1.0)).collect())
    }
}

/// Cases of a boat at a range: suns low and high, all round, in an order of their own.
fn cases(range: usize, scale: f64, headings: u32) -> Vec<Sunlit> {
    let case = |n: u32| {
        let share = (f64::from(n) + 0.5) / f64::from(headings);
        let elevation = 3.0 + 57.0 * (share * 7.0).fract();
        let azimuth = 360.0 * (share * 3.0 + 0.21).fract();
        Sunlit { scale, range, heading_deg: 360.0 * share, sun: towards(elevation, azimuth) }
    };
    (0..headings).map(case).collect()
}

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let fleet = Fleet::new(bench.is_quick())?;
    // The short form judges one range.
    for range in if bench.is_quick() { 1..2 } else { 0..RANGES_M.len() } {
        measure_range(bench, &fleet, range)?;
    }
    measure_extremes(bench, &fleet)?;
    list_sequences(bench);
    table::measure(bench)
}

/// Lists what the sequences of Hughes, Konttinen and Pattanaik draw around their volumes.
fn list_sequences(bench: &mut PartBench) {
    let listed = |setting: &str, stages: &[Stage]| {
        let of = |i: usize| stages.iter().map(|stage| stage.drawn[i]).sum::<u32>();
        let tasks: Vec<&str> = stages.iter().map(|stage| stage.task).collect();
        let (meshes, volumes, pictures) = (of(0), of(1), of(2));
        let drawings = f64::from(meshes + volumes + pictures);
        ExtremeResult::rival("shadow volumes", setting, drawings).note(format!(
            "{}: meshes {meshes} times, volumes {volumes}, the whole picture {pictures}",
            tasks.join(", ")
        ))
    };
    let sequences = [
        listed("virtual on real, 4.4.4: five stages", &FIVE_STAGES),
        listed("on virtual, 4.4.5: four stages", &FOUR_STAGES),
    ];
    bench.extreme("what a frame draws for one light", "drawings", sequences.into());
}

fn measure_range(bench: &mut PartBench, fleet: &Fleet, range: usize) -> Result<()> {
    let headings = if bench.is_quick() { 2 } else { 20 };
    let mut all = vec![0.0; 2 + fleet.methods.len()];
    for (studio, scale) in &fleet.studios {
        let errors = fleet.mean(studio, &cases(range, *scale, headings), &[])?;
        all.iter_mut().zip(errors).for_each(|(all, error)| *all += error / fleet.studios.len() as f64);
    }
    let Some((studio, _)) = fleet.studios.first() else { return Ok(()) };
    let case = Sunlit { scale: 1.0, range, heading_deg: 70.0, sun: towards(30.0, 120.0) };
    let scene = studio.scene(&case)?;
    let range_m = RANGES_M[range];
    let pictures = [scene.clone(), without_shadow(&scene)].into_iter().zip(DRAWN).zip(&all);
    let drawn = pictures.enumerate().map(|(i, ((scene, name), error))| {
        let timed = move || {
            let before = process_ms();
            // A frame that fails has drawn nothing: it is counted as endless.
            if studio.paint(&scene).is_ok() { (process_ms() - before) * 1e6 } else { f64::INFINITY }
        };
        Way::telling(name, if i == 0 { "2 x 2 texels" } else { "" }, *error, 1, timed).default_if(i == 0)
    });
    bench.scene(&format!("a boat at {range_m:.0} m, whole frames"), "FLIP", 0.002, drawn.collect());

    let staged = studio.stage(&case, &scene, &[])?;
    let ways = fleet.methods.iter().zip(&all[2..]).enumerate().map(|(i, (named, error))| {
        let mut method = (named.make)();
        let seen = &staged.seen[usize::from(named.four_points)];
        method.prepare(&staged.frame(), seen);
        let (bytes, frame) = (method.bytes(), staged.frame());
        let work = move || {
            method.prepare(&frame, seen);
            seen.points.iter().map(|point| method.share(point)).sum::<f32>()
        };
        let way = Way::new(named.method, named.setting, *error, 1, work).holds(bytes);
        if i == 0 {
            way.default_if(true).note(format!("the renderer's own errs by {:.4}", all[0]))
        } else {
            way
        }
    });
    bench.scene(&format!("a boat at {range_m:.0} m, shadows alone"), "FLIP", 0.002, ways.collect());
    Ok(())
}

fn measure_extremes(bench: &mut PartBench, fleet: &Fleet) -> Result<()> {
    let is_quick = bench.is_quick();
    for (name, sun, range, is_eye_shaded) in [
        ("the sun behind the eye, light along the view, 60 m", towards(3.0, 180.0), 0, false),
        ("the sun behind the eye, light along the view, 400 m", towards(3.0, 180.0), 2, false),
        ("the sun ahead, light against the view", towards(3.0, 0.0), 0, false),
        ("the sun on the horizon, abeam", towards(0.05, 90.0), 0, false),
        ("the sun overhead", DVec3::Z, 0, false),
        ("the eye within another boat's shadow", towards(9.0, 150.0), 0, true),
    ] {
        let mut worst = vec![0.0_f64; 2 + fleet.methods.len()];
        // The short form judges by the skiff, whose shells are open, and by one heading.
        let (boats, headings) =
            if is_quick { (1, [20.0].as_slice()) } else { (BOATS.len(), [20.0, 100.0].as_slice()) };
        for (studio, scale) in fleet.studios.iter().take(boats) {
            let more = if is_eye_shaded { vec![studio.before_the_sun(sun)] } else { Vec::new() };
            let case = |heading_deg: &f64| Sunlit { scale: *scale, range, heading_deg: *heading_deg, sun };
            let cases: Vec<Sunlit> = headings.iter().map(case).collect();
            let errors = fleet.mean(studio, &cases, &more)?;
            worst.iter_mut().zip(errors).for_each(|(worst, error)| *worst = worst.max(error));
        }
        let drawn = [
            ExtremeResult::product(DRAWN[0], "the renderer's, 2 x 2 texels", worst[0]),
            ExtremeResult::rival(DRAWN[1], "the renderer's", worst[1]),
        ];
        let methods = fleet.methods.iter().zip(&worst[2..]).enumerate().map(|(i, (named, worst))| {
            ExtremeResult { default: i == 0, ..ExtremeResult::rival(named.method, named.setting, *worst) }
        });
        bench.extreme(name, "FLIP", drawn.into_iter().chain(methods).collect());
    }
    Ok(())
}
