//! The horizon in pictures.

use anyhow::Result;
use bowwave_core::estimate::horizon::HorizonFinder;

use super::{About, worst};
use crate::{
    bench::{PartBench, PartMethod},
    front::quantile,
    horizon::{
        cases::{SET_WITH, all_glare, with_glare, with_horizon, without_horizon},
        frames::{self, SeaFrame},
        score::{DrawnHorizon, miss},
        stills::{self, HorizonKind, Still},
        ways::{HorizonMethod, METHODS, in_drawn, in_frame, px},
    },
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "horizon",
    what: "Finds the sea's horizon in a picture, or says that there is none: roll and pitch of the camera.",
    truth: "drawn seas of known attitude (seeds that set no constant), by a renderer of its own with haze, waves, clouds, glitter, \
            ships and a bowed lens; frames of a ship and a drone with two to four points marked by hand, good to .2 to .6 px; stills of \
            some thirty other cameras with marks and kinds",
    rivals: "Canny's edges and Hough's lines; Otsu's two brightnesses over angle and offset; the strongest step of each column and \
             the line that most of them agree with. They answer where any edge is, so that a scene without a horizon is lost on them",
    why: "it errs a third of plain column steps on drawn seas, and an eighth on marked frames, where half of the columns show a coast \
          and the other two are off by a hundred pixels; and it says no where there is none. A prediction by the gyro halves its \
          time. Errors are the 95th percentile in pixels at 1280 wide; nothing found counts as the whole width",
};

/// Drawn pictures of one kind of eight.
fn drawn(quick: bool) -> Result<Vec<DrawnHorizon>> {
    let count = if quick { 24 } else { 96 };
    (0..count).map(|i| DrawnHorizon::new(with_horizon(SET_WITH, i))).collect()
}

fn drawn_errors(method: HorizonMethod, pictures: &[DrawnHorizon]) -> Vec<f64> {
    let mut finder = HorizonFinder::new();
    pictures.iter().map(|d| px(in_drawn(method, &mut finder, d).map(|up| d.miss(up)))).collect()
}

fn drawn_scene(bench: &mut PartBench, pictures: &[DrawnHorizon]) {
    let Some(first) = pictures.first() else { return };
    let ways = METHODS.map(|m| {
        let errors = drawn_errors(m.run, pictures);
        let mut finder = HorizonFinder::new();
        m.way(quantile(&errors, 0.95), 1, move || in_drawn(m.run, &mut finder, first))
            .note(format!("median {:.2} px", quantile(&errors, 0.5)))
    });
    bench.scene("drawn seas, 1280x720", "px", 0.02, ways.into());
}

fn real_scene(bench: &mut PartBench, marked: &[SeaFrame]) -> Result<()> {
    let Some(first) = marked.first() else { return Ok(()) };
    let mut ways = Vec::new();
    for m in METHODS {
        let mut finder = HorizonFinder::new();
        let mut errors = Vec::new();
        for (i, frame) in marked.iter().enumerate() {
            let found = in_frame(m.run, &mut finder, frame, i as u64)?;
            errors.push(px(found.and_then(|up| miss(frame, up))));
        }
        let way = m
            .way(quantile(&errors, 0.95), 1, move || in_frame(m.run, &mut finder, first, 0).ok())
            .note(format!("median {:.2} px; timed with the copy of a frame", quantile(&errors, 0.5)));
        ways.push(way);
    }
    bench.scene("marked frames", "px", 0.4, ways);
    Ok(())
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let pictures = drawn(bench.is_quick())?;
    drawn_scene(bench, &pictures);
    real_scene(bench, &frames::marked()?)?;
    for kind in ["lens bow", "glitter", "ships, barrel", "steep", "edge", "part", "haze"] {
        let of_kind: Vec<&DrawnHorizon> = pictures.iter().filter(|d| d.shown.kind == kind).collect();
        worst_of(bench, kind, &of_kind, px(None));
    }
    let few = if bench.is_quick() { 8 } else { 32 };
    let glare: Vec<DrawnHorizon> =
        (0..few).map(|i| DrawnHorizon::new(with_glare(SET_WITH, i))).collect::<Result<_>>()?;
    // To say nothing is right where the sun has taken too much of it.
    worst_of(bench, "glare: sun over it, flare, a part washed out", &glare.iter().collect::<Vec<_>>(), 0.0);
    let washed: Vec<DrawnHorizon> =
        (0..few).map(|i| DrawnHorizon::new(all_glare(SET_WITH, i))).collect::<Result<_>>()?;
    taken_for_one(bench, "none seen: glare has washed out all of it", &washed);
    let count = if bench.is_quick() { 21 } else { 84 };
    let without: Vec<DrawnHorizon> =
        (0..count).map(|i| DrawnHorizon::new(without_horizon(SET_WITH, i))).collect::<Result<_>>()?;
    taken_for_one(bench, "none there: sky, water, fog, night, noise, smear, blank", &without);
    strangers(bench)
}

/// Stills of other cameras: the worst error where one is answered, and the shores that are taken for a horizon.
fn strangers(bench: &mut PartBench) -> Result<()> {
    let (shores, marked): (Vec<Still>, Vec<Still>) =
        stills::listed()?.into_iter().partition(|s| s.kind == HorizonKind::Shore);
    if marked.is_empty() {
        return Ok(());
    }
    let found_in = |m: &PartMethod<HorizonMethod>, stills: &[Still]| {
        let mut finder = HorizonFinder::new();
        let mut find = |(i, s): (usize, &Still)| in_frame(m.run, &mut finder, &s.frame, i as u64);
        stills.iter().enumerate().map(&mut find).collect::<Result<Vec<_>>>()
    };
    let (mut off, mut taken) = (Vec::new(), Vec::new());
    for m in &METHODS {
        let found = found_in(m, &marked)?;
        let errors: Vec<f64> = marked
            .iter()
            .zip(&found)
            .filter_map(|(s, up)| Some(px(miss(&s.frame, (*up)?)) - s.uncertainty_px))
            .collect();
        let note = format!("{} of {} answered", errors.len(), marked.len());
        off.push(m.tried(worst(errors)).note(note));
        // No prediction of a shore's horizon is right, so that none is told.
        let shown = found_in(m, &shores)?.iter().flatten().count();
        taken.push(m.tried(100.0 * shown as f64 / shores.len().max(1) as f64));
    }
    bench.extreme("other cameras, beyond the mark's uncertainty", "px", off);
    bench.extreme("other cameras: shores, harbours, rivers", "% taken for one", taken);
    Ok(())
}

/// The worst error on pictures with a horizon; one that is not answered counts as `unanswered_px`.
fn worst_of(bench: &mut PartBench, case: &str, pictures: &[&DrawnHorizon], unanswered_px: f64) {
    let tried = METHODS.map(|m| {
        let mut finder = HorizonFinder::new();
        let mut find = |d: &&DrawnHorizon| in_drawn(m.run, &mut finder, d).map(|up| px(Some(d.miss(up))));
        let found: Vec<Option<f64>> = pictures.iter().map(&mut find).collect();
        let answered = found.iter().flatten().count();
        let error = worst(found.iter().map(|px| px.unwrap_or(unanswered_px)));
        m.tried(error).note(format!("{answered} of {} answered", pictures.len()))
    });
    bench.extreme(case, "px", tried.into());
}

/// The share of pictures without one in which a horizon is found.
fn taken_for_one(bench: &mut PartBench, case: &str, pictures: &[DrawnHorizon]) {
    let tried = METHODS.map(|m| {
        let mut finder = HorizonFinder::new();
        let taken = pictures.iter().filter(|d| in_drawn(m.run, &mut finder, d).is_some()).count();
        m.tried(100.0 * taken as f64 / pictures.len().max(1) as f64)
    });
    bench.extreme(case, "% taken for one", tried.into());
}
