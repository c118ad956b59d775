//! A boat's light on the sea by every method, against the ray tracer.

use anyhow::{Context, Result};
use bowwave_core::water::ReflectionMethod;
use bowwave_lab::still::{EXAMPLE, Still};
use bowwave_render::SOFTWARE;

use super::About;
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    reflection::{
        cell::TruthCell,
        cost::process_ms,
        draw::{Beliefs, DrawnModels, Painter, forced_scene, picture},
        singular::{self, TrueCase},
    },
    truth::{cell::CellSpec, grid},
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "reflection",
    what: "Puts a boat's light onto the filmed sea: mean FLIP where the reflection is, against the time of the whole frame on software \
           Vulkan (processor time of the driver's threads).",
    truth: "a ray tracer of a boat on a directional sea (precision::truth), which shares no code with the renderer; its cells are \
            rendered here with a few paths and fixed seeds. Its own error is that of the change along other paths, put onto the same picture",
    rivals: "nothing, the plain mirror, the source thesis's Full Reflection and Physics shaders as printed and mended, and what waves \
             of that wind throw back by a baked table. The whole grid is measured by `precision reflection grid`",
    why: "the closest to the truth in every sea and at every range, of those that a frame has time for",
};

/// Why a shader of the thesis is the default though another one is closer.
const EXCUSE: &str = "beaten: the table of waves is closer, and beyond 100 m in waves nothing at all is; it stays while the table's \
                      method takes more than twice its time (`precision reflection cost`)";

/// Range in metres, sea state, light, and paths over the grid's.
type CellScene = (f64, u8, &'static str, f64);

const QUICK: [CellScene; 3] =
    [(150.0, 0, "overcast", 0.06), (150.0, 2, "overcast", 0.06), (400.0, 1, "high", 0.06)];
const FULL: [CellScene; 7] = [
    (60.0, 0, "overcast", 0.25),
    (60.0, 1, "overcast", 0.25),
    (60.0, 3, "high", 0.25),
    (150.0, 0, "overcast", 0.25),
    (150.0, 2, "overcast", 0.25),
    (150.0, 4, "low", 0.25),
    (400.0, 1, "high", 0.25),
];

/// The method of a scenario that names none.
fn default_method() -> Result<ReflectionMethod> {
    let silent: Vec<&str> = EXAMPLE.lines().filter(|line| !line.starts_with("method")).collect();
    Ok(Still::parse(&silent.join("\n"), "example")?.water.method)
}

fn spec((range_m, state, light, paths): CellScene) -> Result<CellSpec> {
    let (eye_m, heading_deg) = (grid::EYES_M[0], grid::HEADINGS_DEG[0]);
    let mut spec = grid::cell(range_m, state, eye_m, light, heading_deg).context("no such cell")?;
    spec.samples = ((f64::from(spec.samples) * paths) as u32).max(1);
    Ok(spec)
}

/// One method in one scene: its error, and a frame of it as work.
fn way(cell: &TruthCell, method: ReflectionMethod, default: ReflectionMethod) -> Result<Way<'static>> {
    let models = DrawnModels::named(&cell.boat)?;
    let scene = forced_scene(cell, method, &Beliefs::right(cell), &models);
    let video = picture(&cell.without)?;
    let mut painter = Painter::new(cell.size(), models.list(), &[method], (1, Some(SOFTWARE)))?;
    let error = cell.errors(&painter.paint(&scene, &video)?)?.flip;
    let held = painter.bytes();
    let frame = move || {
        let (process, thread) = (process_ms(), crate::bench::thread_ns());
        // A frame that fails is as slow as can be.
        if painter.frame(&scene, &video).is_err() {
            return f64::INFINITY;
        }
        (1e6 * (process_ms() - process) - (crate::bench::thread_ns() - thread)).max(0.0)
    };
    let way = Way::telling(method.name(), "one boat", error, 1, frame).holds(held);
    let excused = method == default && method != ReflectionMethod::Baked;
    Ok(if excused { way.default_although(EXCUSE) } else { way.default_if(method == default) })
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let default = default_method()?;
    let scenes: &[CellScene] = if bench.is_quick() { &QUICK } else { &FULL };
    for scene in scenes {
        let cell = TruthCell::render(&spec(*scene)?)?;
        let ways =
            ReflectionMethod::ALL.iter().map(|m| way(&cell, *m, default)).collect::<Result<Vec<_>>>()?;
        let (range_m, state, light, _) = scene;
        bench.scene(&format!("{range_m} m, sea state {state}, {light}"), "FLIP", cell.noise()?, ways);
    }
    let mut cases = singular::far_cases(if bench.is_quick() { 0.02 } else { 0.25 })?;
    if !bench.is_quick() {
        cases.extend(singular::near_cases(0.25)?);
    }
    let mut studio = Default::default();
    for case in &cases {
        bench.extreme(case.name, "FLIP", tried(&mut studio, case, default)?);
    }
    Ok(())
}

fn tried(
    studio: &mut crate::reflection::draw::DrawingStudio,
    case: &TrueCase,
    default: ReflectionMethod,
) -> Result<Vec<ExtremeResult>> {
    let found = singular::outcomes(studio, case)?;
    let one = |(method, outcome): (&ReflectionMethod, &singular::SingularOutcome)| {
        // What writes pixels of nothing has an error that is no number.
        let mean = outcome.flip.filter(|_| outcome.zeros == 0).map_or(f64::NAN, |f| f.0);
        let note = match outcome.flip {
            Some((_, most)) => format!("worst pixel {most:.2}, {} pixels of nothing", outcome.zeros),
            None => "no reflection in the picture".to_owned(),
        };
        let t = ExtremeResult::rival(method.name(), "one boat", mean).note(note);
        ExtremeResult { default: *method == default, ..t }
    };
    Ok(ReflectionMethod::ALL.iter().zip(&found).map(one).collect())
}
