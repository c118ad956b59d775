//! Outlines of a model of the gun.

use std::path::Path;

use anyhow::{Result, bail};
use bowwave_calibration::{
    CalibrationFile, POLYGONS_MOST,
    gun::GunFrame,
    outline::{FoundOutlines, outlines_of},
};
use bowwave_core::text::one_line;
use bowwave_models::load_parts;
use glam::DVec3;

use crate::cli::CalibratePhantom;

/// The camera in the gun's frame, as the calibration and the arguments tell.
pub fn gun_frame(arguments: &CalibratePhantom, file: &CalibrationFile) -> Result<GunFrame> {
    let at = arguments.camera_at.map(|place| place.0);
    if at.is_none() && file.calibration.muzzle_in_camera == DVec3::ZERO {
        bail!(
            "nothing says where the camera stands in the model: say it with --camera-at X,Y,Z (left, up, forward, metres), or measure \
             [boresight] muzzle_m, which then is the model's origin"
        );
    }
    Ok(GunFrame::new(&file.calibration, at, arguments.camera_roll.to_radians()))
}

/// Outlines of the model's parts, and what there is to say about them.
pub fn outlines(
    path: &Path,
    arguments: &CalibratePhantom,
    file: &CalibrationFile,
) -> Result<(FoundOutlines, Vec<String>)> {
    let frame = gun_frame(arguments, file)?;
    let (mut found, mut unseen) = (FoundOutlines::default(), Vec::new());
    for part in load_parts(path)? {
        let triangles = part.triangles.iter().map(|triangle| triangle.map(|p| frame.to_camera(p)));
        let name = one_line(&part.name);
        let of_part = outlines_of(&file.calibration.lens, &name, triangles);
        if of_part.phantoms.is_empty() {
            unseen.push(name);
        }
        found.phantoms.extend(of_part.phantoms);
        found.openings.extend(of_part.openings);
    }
    if found.phantoms.len() > POLYGONS_MOST {
        bail!(
            "the model is seen as {} outlines, and a calibration takes {POLYGONS_MOST}: give nodes that belong together one name, and leave out \
             what the camera does not see",
            found.phantoms.len()
        );
    }
    let at = frame.camera_at();
    let mut notes = vec![format!("the camera stands at {:.3},{:.3},{:.3} m in the model", at.x, at.y, at.z)];
    if !unseen.is_empty() {
        notes.push(format!("not in the picture, or too small there: {}", unseen.join(", ")));
    }
    Ok((found, notes))
}
