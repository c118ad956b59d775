//! The whole table of the real frames and drawn pictures, in words.
//!
//! These pictures served to set the finder's constants: every other marked frame (the first, third, ...), every fourth of the boat
//! before a shore, all stills, the pieces cut from all marked frames, and drawn pictures of seeds below [`SET_WITH`]. The
//! other frames and seeds were held out.

use std::path::{Path, PathBuf};

use anyhow::Result;
use bowwave_core::estimate::horizon::{Horizon, HorizonFinder, LineQuality, NoHorizon, Prior};
use glam::DVec3;
use rayon::prelude::*;

use super::{
    cases::{SET_WITH, with_horizon, without_horizon},
    frames::{self, SeaFrame},
    overlay,
    score::{DrawnHorizon, Miss, PRIOR_SIGMA, find, miss, predicted},
    stills::StillsStudy,
    video,
};
use crate::front::quantile;

/// What the finder answers.
pub type HorizonAnswer = std::result::Result<Horizon, NoHorizon>;

/// Shows pictures to the horizon finder and lists what it makes of them.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct HorizonStudy {
    #[command(subcommand)]
    of: Option<HorizonSubject>,
    /// Folder for the marked frames, and those taken wrongly, with what was found drawn over them
    #[arg(long, value_name = "DIR")]
    overlays: Option<PathBuf>,
    /// Drawn pictures with a horizon, and as many without
    #[arg(long, default_value_t = 400)]
    drawn: u64,
    /// Draw those pictures that served to set the finder's constants
    #[arg(long)]
    set: bool,
}

#[derive(Debug, clap::Subcommand)]
enum HorizonSubject {
    /// Stills of strangers' cameras: found, errors, shores taken for the horizon
    Stills(StillsStudy),
}

impl HorizonStudy {
    /// Prints all of it.
    pub fn run(&self) -> Result<()> {
        if let Some(HorizonSubject::Stills(study)) = &self.of {
            return study.run();
        }
        cost()?;
        marked(self.overlays.as_deref())?;
        jitter()?;
        without(self.overlays.as_deref())?;
        drawn(self.drawn, self.set)?;
        coarse(self.drawn / 8, self.set)
    }
}

/// The qualities of the line that was found or refused; `None` without any.
pub fn qualities(answer: &HorizonAnswer) -> Option<LineQuality> {
    match answer {
        Ok(found) => Some(found.quality),
        Err(
            NoHorizon::Unclear(q) | NoHorizon::Blurred(q) | NoHorizon::Textured(q) | NoHorizon::Elsewhere(q),
        ) => Some(*q),
        Err(NoHorizon::TooSmall | NoHorizon::OutOfView | NoHorizon::Featureless) => None,
    }
}

/// These in words.
pub fn described(answer: &HorizonAnswer) -> String {
    let why = answer.as_ref().err().map(|e| format!(" ({e})")).unwrap_or_default();
    let numbers = |q: LineQuality| {
        format!(
            "score {:.2}, free {:.2} of {:.2}, land {:.2}, past {:.2}, above {:.2}, open {:.2}, step {:.1}, peak {:.1}, texture {:.2}/{:.2}, sharp {:.2}, scatter {:.2}",
            q.score,
            q.solid_share,
            q.visible_share,
            q.land_share,
            q.past_share,
            q.above_share,
            q.open_share,
            q.contrast,
            q.peak_ratio,
            q.texture,
            q.noise,
            q.sharpness,
            q.scatter_px
        )
    };
    qualities(answer).map(numbers).unwrap_or_default() + &why
}

/// One line of what was missed by how much.
fn summary(what: &str, misses: &[Option<Miss>]) -> String {
    let found: Vec<Miss> = misses.iter().copied().flatten().collect();
    let of = |value: fn(&Miss) -> f64| found.iter().map(value).collect::<Vec<f64>>();
    let (px, deg) = (of(|m| m.px), of(|m| m.deg));
    format!(
        "{what:32} found {:3} of {:3}, failures {}; px median {:.2}, p95 {:.2}, worst {:.2}; deg median {:.3}, p95 {:.3}, worst {:.3}",
        found.len(),
        misses.len(),
        found.iter().filter(|m| m.is_failure()).count(),
        quantile(&px, 0.5),
        quantile(&px, 0.95),
        quantile(&px, 1.0),
        quantile(&deg, 0.5),
        quantile(&deg, 0.95),
        quantile(&deg, 1.0),
    )
}

/// Frames whose horizon was marked, one by one, without and with predictions.
fn marked(overlays: Option<&Path>) -> Result<()> {
    let frames = frames::marked()?;
    let mut finder = HorizonFinder::new();
    // Without and with prediction; of frames that set constants, and held out.
    let mut misses = [const { Vec::new() }; 4];
    for (i, frame) in frames.iter().enumerate() {
        let held_out = i % 2 == 1;
        let answer = find(&mut finder, frame, None)?;
        let off = answer.as_ref().ok().and_then(|h| miss(frame, h.up));
        let told = off.map_or("none".into(), |m| format!("{:.2} px {:.3} deg", m.px, m.deg));
        println!(
            "{:18} {} {told:20} {}",
            frame.name,
            if held_out { "held" } else { "set " },
            described(&answer)
        );
        misses[usize::from(held_out)].push(off);
        if let Some(folder) = overlays {
            overlay::write(folder, frame, answer.ok().map(|h| h.up))?;
        }
        let Some(up) = frame.marked_up() else { continue };
        for draw in 0..8 {
            let answer = find(&mut finder, frame, Some(predicted(up, i as u64 * 8 + draw)))?;
            misses[2 + usize::from(held_out)].push(answer.ok().and_then(|h| miss(frame, h.up)));
        }
    }
    let names = ["no prediction, set", "no prediction, held out", "prediction, set", "prediction, held out"];
    names.iter().zip(&misses).for_each(|(name, misses)| println!("{}", summary(name, misses)));
    let [alone, alone_held, told, told_held] = misses;
    for (name, misses) in [
        ("no prediction, all", [alone, alone_held].concat()),
        ("prediction, all", [told, told_held].concat()),
    ] {
        println!("{}", summary(name, &misses));
    }
    Ok(())
}

/// Turning from frame to frame of the clip from the drone, whose gimbal hardly turns before its last half second.
fn jitter() -> Result<()> {
    let frames = video::karma()?;
    let mut finder = HorizonFinder::new();
    let mut ups = Vec::new();
    for frame in &frames {
        ups.push(find(&mut finder, frame, None)?.ok().map(|h| h.up));
    }
    let found = ups.iter().flatten().count();
    // What a frame differs from the mean of its neighbours: the gimbal's own slow turning falls out.
    let bends: Vec<f64> = ups
        .windows(3)
        .filter_map(|w| Some(w[1]?.angle_between((w[0]? + w[2]?).normalize()).to_degrees()))
        .collect();
    println!(
        "clip from a drone: found in {found} of {} frames; a frame differs from the mean of its neighbours by {:.4} deg (median), {:.4} (p95), \
         {:.4} (worst)",
        frames.len(),
        quantile(&bends, 0.5),
        quantile(&bends, 0.95),
        quantile(&bends, 1.0)
    );
    Ok(())
}

/// Predictions laid all over a frame: twelve heights, five rolls.
pub fn laid(frame: &SeaFrame) -> Vec<Prior> {
    let lens = frame.picture_lens();
    let prior = |i: usize| {
        let row = ((i / 5) as f64 + 0.5) / 12.0 * f64::from(lens.height);
        let ray = lens.unproject(glam::DVec2::new(lens.centre.x, row));
        let (elevation, roll) = ((ray.y / ray.z).atan(), ((i % 5) as f64 * 2.0 - 4.0).to_radians());
        let up = DVec3::new(-roll.sin() * elevation.cos(), -roll.cos() * elevation.cos(), elevation.sin());
        Prior { up, sigma: PRIOR_SIGMA }
    };
    (0..60).map(prior).collect()
}

/// Real pictures that show none: shores, harbours, pieces of sky and water.
fn without(overlays: Option<&Path>) -> Result<()> {
    let mut frames = frames::without_horizon()?;
    frames.extend(frames::crops(&frames::marked()?));
    let mut finder = HorizonFinder::new();
    let (mut taken, mut with_any, mut tries, mut wrong) = (0, 0, 0, 0);
    for frame in &frames {
        let answer = find(&mut finder, frame, None)?;
        let mut accepted = 0;
        for prior in laid(frame) {
            tries += 1;
            accepted += usize::from(find(&mut finder, frame, Some(prior))?.is_ok());
        }
        wrong += accepted;
        with_any += usize::from(accepted > 0);
        if answer.is_ok() || accepted > 0 {
            taken += usize::from(answer.is_ok());
            println!("{:18} {accepted} of 60 predictions; without: {}", frame.name, described(&answer));
            if let Some(folder) = overlays {
                overlay::write(folder, frame, answer.ok().map(|h| h.up))?;
            }
        }
    }
    println!(
        "no horizon to be seen: {taken} of {} taken for one without a prediction; {wrong} of {tries} with one laid on them, in {with_any} frames",
        frames.len()
    );
    Ok(())
}

/// Drawn pictures by kind, and whether the stated covariance is right.
fn drawn(count: u64, set: bool) -> Result<()> {
    let seed = if set { 0 } else { SET_WITH };
    let show = |drawn: &DrawnHorizon, prior: Option<Prior>| drawn.find(&mut HorizonFinder::new(), prior);
    for (told, is_told) in [("no prediction", false), ("prediction", true)] {
        let rows: Vec<_> = (0..count)
            .into_par_iter()
            .map(|i| {
                let drawn = DrawnHorizon::new(with_horizon(seed, i))?;
                let up = DVec3::from(drawn.shown.up());
                let found = show(&drawn, is_told.then(|| predicted(up, seed + i))).ok();
                let off = found.map(|h| (drawn.miss(h.up), drawn.normalised(&h)));
                Ok((drawn.shown.kind, off))
            })
            .collect::<Result<_>>()?;
        for kind in KINDS {
            let of_kind = || rows.iter().filter(|r| kind == "all" || r.0 == kind);
            let misses: Vec<Option<Miss>> = of_kind().map(|r| r.1.map(|o| o.0)).collect();
            let squares: Vec<f64> = of_kind().filter_map(|r| r.1.map(|o| o.1)).collect();
            let mean = squares.iter().sum::<f64>() / squares.len() as f64;
            println!("{}; normalised square {mean:.2}", summary(&format!("{kind}, {told}"), &misses));
        }
        let none: Vec<_> = (0..count)
            .into_par_iter()
            .map(|i| {
                let drawn = DrawnHorizon::new(without_horizon(seed, i))?;
                let up = DVec3::from(drawn.shown.up());
                Ok(show(&drawn, is_told.then(|| predicted(up, seed + i))).is_ok().then_some(drawn.shown.kind))
            })
            .collect::<Result<_>>()?;
        let taken: Vec<&str> = none.iter().copied().flatten().collect();
        println!("none drawn, {told}: {} of {} taken for one {taken:?}", taken.len(), none.len());
    }
    Ok(())
}

/// The same seen by cameras with fewer pixels, down to 160 across as thermal cameras have.
fn coarse(count: u64, set: bool) -> Result<()> {
    let seed = if set { 0 } else { SET_WITH };
    for (by, is_told) in [2, 4, 8].into_iter().flat_map(|by| [(by, false), (by, true)]) {
        let told = |up: [f64; 3], i: u64| is_told.then(|| predicted(DVec3::from(up), seed + i));
        let rows: Vec<_> = (0..count)
            .into_par_iter()
            .map(|i| {
                let drawn = DrawnHorizon::coarse(with_horizon(seed, i), by)?;
                let found = drawn.find(&mut HorizonFinder::new(), told(drawn.shown.up(), i)).ok();
                let none = DrawnHorizon::coarse(without_horizon(seed, i), by)?;
                // Smear of a few coarse pixels leaves a horizon that may be used, where it is one.
                let taken = none.find(&mut HorizonFinder::new(), told(none.shown.up(), i)).ok();
                let wrong = taken.filter(|h| none.shown.smear < 2 || none.miss(h.up).is_failure());
                Ok((found.map(|h| (drawn.miss(h.up), drawn.normalised(&h))), wrong.map(|_| none.shown.kind)))
            })
            .collect::<Result<_>>()?;
        let misses: Vec<_> = rows.iter().map(|r| r.0.map(|found| found.0)).collect();
        let squares: Vec<f64> = rows.iter().filter_map(|r| r.0.map(|found| found.1)).collect();
        let what = format!("{} wide, {}", 1280 / by, if is_told { "prediction" } else { "no prediction" });
        println!(
            "{}; normalised square {:.2}; of as many without one taken {:?}",
            summary(&what, &misses),
            squares.iter().sum::<f64>() / squares.len() as f64,
            rows.iter().filter_map(|r| r.1).collect::<Vec<&str>>()
        );
    }
    Ok(())
}

const KINDS: [&str; 9] =
    ["fair", "lens bow", "glitter", "ships, barrel", "steep", "edge", "part", "haze", "all"];

/// Time of a picture of 1280 x 720, milliseconds of this thread: least, median. One that is clear, and one of water only, on which all
/// that could be a line is tried.
fn cost() -> Result<()> {
    for (what, shown) in
        [("horizon", with_horizon(SET_WITH, 0)), ("water only", without_horizon(SET_WITH, 1))]
    {
        let drawn = DrawnHorizon::new(shown)?;
        let up = if what == "horizon" { DVec3::from(drawn.shown.up()) } else { DVec3::NEG_Y };
        for (told, prior) in [("no prediction", None), ("prediction", Some(predicted(up, 3)))] {
            let mut finder = HorizonFinder::new();
            let mut times = Vec::new();
            for _ in 0..300 {
                let start = crate::bench::thread_ns();
                std::hint::black_box(drawn.find(&mut finder, prior).ok());
                times.push((crate::bench::thread_ns() - start) * 1e-6);
            }
            let (least, median) = (quantile(&times, 0.0), quantile(&times, 0.5));
            println!("{what}, {told}: {least:.2} ms at least, {median:.2} in the median");
        }
    }
    Ok(())
}
