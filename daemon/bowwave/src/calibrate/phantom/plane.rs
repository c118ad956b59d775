//! A flat part of the gun as a model, from its outline in the picture.

use anyhow::{Context, Result};
use bowwave_calibration::{
    CalibrationFile,
    gun::GunFrame,
    plane::{PlaneFrame, PlaneView},
    polygon,
};
use bowwave_core::geometry::{Lens, distance_squared_to_segment};
use bowwave_models::{PartMesh, parts_glb};
use glam::DVec2;
use serde_json::json;

use super::model::gun_frame;
use crate::{
    cli::{CalibratePhantom, TracedOutline},
    outcome::Outcome,
    stdout,
};

/// An edge that is straight in the picture is followed on the plane to this many pixels...
const FOLLOWED_PX: f64 = 0.02;
/// ...by halving it no more often than this.
const HALVED_MOST: u32 = 6;
/// A model that misses its own outline by more is warned of, pixels.
const OFF_MOST_PX: f64 = 0.5;

/// A part on the plane.
struct PlanePart {
    mesh: PartMesh,
    /// Smallest and largest coordinates on the plane, metres.
    extent: DVec2,
    /// By how much the model misses the outline in the picture.
    off_px: f64,
}

/// Writes the traced outlines as a model.
pub fn run(arguments: &CalibratePhantom, file: &CalibrationFile) -> Result<Outcome> {
    let (Some(points), Some(out)) = (&arguments.plane, &arguments.glb) else { return Ok(Outcome::Failed) };
    let lens = &file.calibration.lens;
    let view = PlaneView::new(lens, &points.0)?;
    let gun = gun_frame(arguments, file)?;
    let frame = match arguments.plane_axes {
        Some(frame) => frame,
        None => in_gun(&view, &gun).context("the points contradict each other: measure them again")?,
    };
    let parts: Vec<PlanePart> = (1..)
        .zip(&arguments.outline)
        .map(|(number, traced)| {
            let name = if traced.name.is_empty() { format!("part {number}") } else { traced.name.clone() };
            part(traced, &name, lens, &view, (&frame, &gun)).with_context(|| format!("the outline '{name}'"))
        })
        .collect::<Result<_>>()?;
    tell(arguments, &view, &parts)?;
    let meshes: Vec<PartMesh> = parts.into_iter().map(|part| part.mesh).collect();
    std::fs::write(out, parts_glb(&meshes))
        .with_context(|| format!("cannot write {}; check the folder and its permissions", out.display()))?;
    eprintln!("{} written; --model takes it", out.display());
    Ok(Outcome::Done)
}

/// The plane in the gun's frame, as its points tell.
fn in_gun(view: &PlaneView, gun: &GunFrame) -> Option<PlaneFrame> {
    let seen = view.in_camera()?;
    let along = |axis| gun.to_gun(seen.origin + axis) - gun.to_gun(seen.origin);
    Some(PlaneFrame { origin: gun.to_gun(seen.origin), right: along(seen.right), up: along(seen.up) })
}

fn part(
    traced: &TracedOutline,
    name: &str,
    lens: &Lens,
    view: &PlaneView,
    (frame, gun): (&PlaneFrame, &GunFrame),
) -> Result<PlanePart> {
    // Crossings are told by the corners as they were given.
    polygon::triangles(&view.places(&traced.corners)?)?;
    let pixels = followed(&traced.corners, view)?;
    let places = view.places(&pixels)?;
    let triangles = polygon::triangles(&places)?
        .into_iter()
        .map(|triangle| triangle.map(|i| frame.at(places[i])))
        .collect();
    let off = |(place, pixel): (&DVec2, &DVec2)| {
        lens.project(gun.to_camera(frame.at(*place))).map_or(f64::INFINITY, |seen| seen.distance(*pixel))
    };
    let off_px = places.iter().zip(&pixels).map(off).fold(0.0, f64::max);
    let none = [DVec2::INFINITY, DVec2::NEG_INFINITY];
    let [low, high] = places.iter().fold(none, |[low, high], p| [low.min(*p), high.max(*p)]);
    Ok(PlanePart { mesh: PartMesh { name: name.to_owned(), triangles }, extent: high - low, off_px })
}

/// Corners with further ones between them where the lens bends the plane's straight lines: an edge is straight in the picture.
fn followed(corners: &[DVec2], view: &PlaneView) -> Result<Vec<DVec2>> {
    let mut all = Vec::with_capacity(2 * corners.len());
    for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        let mut edges = vec![(*from, *to, 0)];
        while let Some((a, b, halved)) = edges.pop() {
            let middle = a.midpoint(b);
            let [on_a, on_b, on_middle] = view.places(&[a, b, middle])?[..] else { continue };
            // The place on the plane's straight line that is nearest to the middle's, in pixels.
            let along = on_b - on_a;
            let share = (on_middle - on_a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
            let seen = view.pixel(on_a + along * share).unwrap_or(middle);
            let is_straight = distance_squared_to_segment(seen, a, b) < FOLLOWED_PX * FOLLOWED_PX;
            if is_straight || halved >= HALVED_MOST {
                all.push(a);
            } else {
                // The half that comes first is looked at first.
                edges.extend([(middle, b, halved + 1), (a, middle, halved + 1)]);
            }
        }
    }
    Ok(all)
}

fn tell(arguments: &CalibratePhantom, view: &PlaneView, parts: &[PlanePart]) -> Result<()> {
    let [condition, most] = view.condition();
    let mut notes = Vec::new();
    if parts.iter().any(|part| part.off_px > OFF_MOST_PX) {
        notes.push(
            "the model misses its own outlines by more than half a pixel: the plane's axes, its points and the camera's place do not fit together"
                .to_owned(),
        );
    }
    if arguments.json {
        return stdout::print_json(&json!({
            "condition": condition,
            "condition_most": most,
            "points_off_px": view.rms_px(),
            "parts": parts.iter().map(|part| json!({
                "name": part.mesh.name,
                "triangles": part.mesh.triangles.len(),
                "extent_m": part.extent.to_array(),
                "off_px": part.off_px,
            })).collect::<Vec<_>>(),
            "notes": notes,
        }));
    }
    let mut text = format!(
        "condition number {condition:.1} (at most {most:.0}), the points miss their pixels by {:.2} px rms\n",
        view.rms_px()
    );
    for part in parts {
        text += &format!(
            "  {:<12} {:>3} triangles, {:.3} by {:.3} m, seen {:.3} px from its outline at most\n",
            part.mesh.name,
            part.mesh.triangles.len(),
            part.extent.x,
            part.extent.y,
            part.off_px
        );
    }
    for note in notes {
        text += &format!("note: {note}\n");
    }
    stdout::print(text)
}
