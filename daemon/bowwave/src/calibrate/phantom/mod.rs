//! `bowwave calibrate phantom`: what the camera sees of the gun itself, by its outlines.

mod live;
mod model;
mod plane;
mod source;
mod trace;

use std::path::Path;

use anyhow::{Context, Result, bail};
use bowwave_calibration::{
    CalibrationFile,
    outline::{FoundOutlines, OutlineFinder},
};
use bowwave_core::own_ship::{OwnShip, Phantom};
use glam::DVec2;
use image::{Rgb, RgbImage};
use serde_json::json;

use super::input::write;
use crate::{
    cli::{CalibratePhantom, TracedOutline},
    outcome::Outcome,
    stdout,
    today::today,
};
use source::Seen;

/// Half the width of an outline in the picture that shows it, pixels.
const LINE_PX: f64 = 0.8;
const LINE: [u8; 3] = [255, 40, 40];

/// Finds or takes the outlines, tells them and writes.
pub fn run(arguments: &CalibratePhantom) -> Result<Outcome> {
    let seen = Seen::open(arguments)?;
    let ended = work(arguments, &seen);
    let closed = seen.close();
    let outcome = ended?;
    closed?;
    Ok(outcome)
}

fn work(arguments: &CalibratePhantom, seen: &Seen) -> Result<Outcome> {
    if arguments.plane.is_some() {
        return plane::run(arguments, seen.file());
    }
    let lens = &seen.file().calibration.lens;
    let size = (lens.width, lens.height);
    let mut finder = OutlineFinder::new(size);
    let are_known = !arguments.outline.is_empty() || arguments.model.is_some();
    let is_cut = if are_known && arguments.picture.is_none() { false } else { seen.show(&mut finder)? };
    if arguments.trace {
        return traced(arguments, seen, finder, is_cut);
    }
    let (found, mut notes) = if let Some(path) = &arguments.model {
        model::outlines(path, arguments, seen.file())?
    } else if are_known {
        let part = |t: &TracedOutline| Phantom::new(t.name.as_str(), t.corners.clone(), size);
        let phantoms = arguments.outline.iter().map(part).collect();
        (FoundOutlines { phantoms, ..FoundOutlines::default() }, Vec::new())
    } else if let Seen::Recording(_) | Seen::Live(_) = seen {
        (finder.find()?, Vec::new())
    } else {
        bail!(
            "one picture does not tell what keeps still: trace the gun on it with --trace or --outline, or give a recording or --live"
        );
    };
    notes.extend(notes_on(&found, arguments.model.is_some()));
    let parts = found.phantoms.iter().map(|part| part.clone().recoiling(arguments.recoils));
    let found = FoundOutlines { phantoms: parts.collect(), ..found };
    ended(arguments, seen, &finder, Answer { found, notes, is_cut })
}

/// Lets somebody trace in a window.
fn traced(
    arguments: &CalibratePhantom,
    seen: &Seen,
    mut finder: OutlineFinder,
    is_cut: bool,
) -> Result<Outcome> {
    let lens = &seen.file().calibration.lens;
    let size = (lens.width, lens.height);
    let told = match seen {
        Seen::Recording(_) | Seen::Live(_) => finder.find().unwrap_or_else(|why| {
            eprintln!("the pictures themselves tell no outline: {why}");
            FoundOutlines::default()
        }),
        _ => FoundOutlines::default(),
    };
    let picture = seen.picture(&finder);
    let newer = || seen.refresh(&mut finder).then(|| finder.mean());
    let Some(phantoms) = trace::trace(&picture, size, [&seen.file().phantoms, &told.phantoms], newer)? else {
        eprintln!("ended without saving; nothing is written");
        return Ok(Outcome::Done);
    };
    let found = FoundOutlines { phantoms, ..FoundOutlines::default() };
    ended(arguments, seen, &finder, Answer { found, notes: Vec::new(), is_cut })
}

/// Outlines, and what there is to say about them.
struct Answer {
    found: FoundOutlines,
    notes: Vec<String>,
    is_cut: bool,
}

/// Tells the outlines, shows them and writes them. None at all are only written where somebody left all of them out.
fn ended(
    arguments: &CalibratePhantom,
    seen: &Seen,
    finder: &OutlineFinder,
    Answer { found, mut notes, is_cut }: Answer,
) -> Result<Outcome> {
    let lens = &seen.file().calibration.lens;
    let size = (lens.width, lens.height);
    let share =
        OwnShip::new(found.phantoms.clone(), DVec2::ZERO, &[], size).mask.map_or(0.0, |mask| mask.share());
    if is_cut {
        notes.push("the recording was cut short; what there is of it was used".to_owned());
    }
    if arguments.json {
        stdout::print_json(&as_json(&found, share, &notes))?;
    } else {
        stdout::print(text_of(&found, share, &notes))?;
    }
    if let Some(path) = &arguments.picture {
        draw(path, &seen.picture(finder), size, &found.phantoms)?;
        eprintln!("{} shows them", path.display());
    }
    if found.phantoms.is_empty() && !arguments.trace {
        return Ok(Outcome::Failed);
    }
    let files = match seen {
        Seen::Live(camera) => camera.files(&arguments.files),
        _ => arguments.files.clone(),
    };
    let file = CalibrationFile { phantoms: found.phantoms, ..seen.file().clone() };
    write(file, today()?, &files)?;
    Ok(Outcome::Done)
}

/// Notes on outlines that were not taken.
fn notes_on(found: &FoundOutlines, is_model: bool) -> Vec<String> {
    let percent = |shares: &[f64]| {
        let shares: Vec<_> = shares.iter().map(|s| format!("{:.1} %", s * 100.0)).collect();
        shares.join(", ")
    };
    let mut notes = Vec::new();
    if !found.faded.is_empty() {
        notes.push(format!(
            "{} of the picture kept still but has no edge, as a sky does: if the gun reaches into it, tilt the gun further while recording",
            percent(&found.faded)
        ));
    }
    if !found.openings.is_empty() {
        let remedy = if is_model {
            "cut the model's part through there into nodes of different names"
        } else {
            "trace the parts around one by hand, with --outline"
        };
        notes.push(format!(
            "the sea is seen through openings of {} of the picture, and nothing is drawn in them: {remedy}",
            percent(&found.openings)
        ));
    }
    if found.phantoms.is_empty() {
        notes.push(if is_model {
            "nothing of the model is in the picture: check --camera-at, the axes (x left, y up, z along the bore) and metres".to_owned()
        } else {
            "nothing of the gun is in the picture, or it is smaller than 0.03 % of it".to_owned()
        });
    }
    notes
}

fn text_of(found: &FoundOutlines, share: f64, notes: &[String]) -> String {
    let count = found.phantoms.len();
    let outlines = if count == 1 { "outline" } else { "outlines" };
    let mut text = format!("{count} {outlines}, {:.1} % of the picture\n", share * 100.0);
    for phantom in &found.phantoms {
        let [low, high] = phantom.bounds();
        text += &format!(
            "  {:<12} {:>3} corners, from {:.0},{:.0} to {:.0},{:.0}\n",
            phantom.name,
            phantom.outline().len(),
            low.x,
            low.y,
            high.x,
            high.y
        );
    }
    for note in notes {
        text += &format!("note: {note}\n");
    }
    text
}

fn as_json(found: &FoundOutlines, share: f64, notes: &[String]) -> serde_json::Value {
    let corners = |p: &Phantom| p.outline().iter().map(|c| c.to_array()).collect::<Vec<_>>();
    json!({
        "outlines": found.phantoms.iter()
            .map(|p| json!({ "name": p.name, "outline_px": corners(p) }))
            .collect::<Vec<_>>(),
        "share_of_picture": share,
        "faded": found.faded,
        "openings": found.openings,
        "notes": notes,
    })
}

/// Writes the picture with the outlines on it.
fn draw(path: &Path, mean: &[u8], size: (u32, u32), phantoms: &[Phantom]) -> Result<()> {
    let mut picture = RgbImage::from_fn(size.0, size.1, |x, y| {
        Rgb([mean.get((y * size.0 + x) as usize).copied().unwrap_or(0); 3])
    });
    for phantom in phantoms {
        let [low, high] = phantom.bounds();
        let (low, high) = ((low - 1.0).max(DVec2::ZERO), high + 1.0);
        for y in low.y as u32..(high.y as u32 + 1).min(size.1) {
            for x in low.x as u32..(high.x as u32 + 1).min(size.0) {
                let distance = phantom.distance(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                if distance.abs() <= LINE_PX {
                    picture.put_pixel(x, y, Rgb(LINE));
                }
            }
        }
    }
    let said = || {
        format!("cannot write {}; check the folder, its permissions and that it ends in .png", path.display())
    };
    picture.save(path).with_context(said)
}
