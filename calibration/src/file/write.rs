//! From checked numbers to TOML text.

use std::fmt::Write as _;

use bowwave_core::geometry::Distortion;
use glam::DVec2;

use super::parse::radians_from_mrad;
use crate::{CalibrationFile, Provenance};

/// The file's text, with its units as comments. [`crate::parse`] gives the same [`CalibrationFile`] back.
pub fn to_toml(file: &CalibrationFile) -> String {
    let mut out = String::with_capacity(2048);
    // Writing to a String cannot fail; `let _` keeps that out of the signature.
    let _ = header(&mut out, file);
    let _ = lens(&mut out, file);
    let _ = alignment(&mut out, file);
    let _ = shutter(&mut out, file);
    let _ = boresight(&mut out, file);
    let _ = trigger(&mut out, file);
    let _ = gyro_bias(&mut out, file);
    let _ = own_ship(&mut out, file);
    out
}

fn header(out: &mut String, file: &CalibrationFile) -> std::fmt::Result {
    writeln!(out, "# Bowwave calibration: every sigma is one standard deviation.")?;
    writeln!(out, "made = {}", file.made)?;
    for (key, value) in [
        ("source", &file.source),
        ("camera_name", &file.camera_name),
        ("camera_serial", &file.camera_serial),
        ("imu_name", &file.imu_name),
        ("imu_serial", &file.imu_serial),
    ] {
        writeln!(out, "{key} = {}", quoted(value))?;
    }
    Ok(())
}

fn lens(out: &mut String, file: &CalibrationFile) -> std::fmt::Result {
    let c = &file.calibration;
    section(
        out,
        "lens",
        match c.lens.distortion {
            Distortion::Fisheye(_) => "Kannala-Brandt: the radius by the angle from the axis.",
            _ => "Brown-Conrady, from undistorted to distorted; barrel distortion has a negative k1.",
        },
    )?;
    writeln!(out, "size_px = [{}, {}]", c.lens.width, c.lens.height)?;
    writeln!(out, "focal_px = {:?}", c.lens.focal.to_array())?;
    writeln!(out, "focal_sigma_px = {:?}", c.focal_sigma_px)?;
    writeln!(out, "centre_px = {:?}", c.lens.centre.to_array())?;
    let (radial, tangential) = match c.lens.distortion {
        Distortion::Fisheye(fisheye) => {
            writeln!(out, "fisheye = {:?}", fisheye.k())?;
            return provenance(out, &file.lens);
        }
        Distortion::RadialTangential(d) => (d.radial(), d.tangential()),
        Distortion::None => (DVec2::ZERO, DVec2::ZERO),
    };
    writeln!(out, "radial = {:?}", radial.to_array())?;
    writeln!(out, "tangential = {:?}", tangential.to_array())?;
    provenance(out, &file.lens)
}

fn alignment(out: &mut String, file: &CalibrationFile) -> std::fmt::Result {
    let c = &file.calibration;
    section(out, "camera_from_imu", "v_camera = q v_imu q*; camera: x right, y down, z forward.")?;
    let q = c.camera_from_imu;
    writeln!(out, "rotation_wxyz = {:?}", [q.w, q.x, q.y, q.z])?;
    writeln!(out, "sigma_mrad = {:?}", c.camera_from_imu_sigma.to_array().map(mrad))?;
    provenance(out, &file.camera_from_imu)?;
    section(
        out,
        "time_offset",
        "Add it to a frame's mid-exposure stamp to get the time on the unit's clock.",
    )?;
    writeln!(out, "offset_ms = {:?}", ms(c.time_offset_ns))?;
    writeln!(out, "sigma_ms = {:?}", ms(c.time_offset_sigma_ns))?;
    provenance(out, &file.time_offset)
}

fn shutter(out: &mut String, file: &CalibrationFile) -> std::fmt::Result {
    let Some(shutter) = &file.shutter else { return Ok(()) };
    section(
        out,
        "shutter",
        "From reading the picture's first row to its last; negative where the last is read first.",
    )?;
    writeln!(out, "readout_ms = {:?}", ms(file.calibration.readout_ns))?;
    writeln!(out, "sigma_ms = {:?}", ms(file.calibration.readout_sigma_ns))?;
    provenance(out, shutter)
}

fn own_ship(out: &mut String, file: &CalibrationFile) -> std::fmt::Result {
    let corners = |polygon: &[DVec2]| polygon.iter().map(|c| c.to_array()).collect::<Vec<_>>();
    if !file.hidden.is_empty() {
        let what =
            "Where the sea is not looked for: polygons of [x, y] in pixels from the upper left corner.";
        section(out, "own_ship", what)?;
        writeln!(out, "hidden_px = {:?}", file.hidden.iter().map(|p| corners(p)).collect::<Vec<_>>())?;
    }
    for phantom in &file.phantoms {
        let what = "The own gun or ship, traced along its edges: it hides what is drawn.";
        write!(out, "\n[[own_ship.phantom]]\n# {what}\n")?;
        writeln!(out, "name = {}", quoted(&phantom.name))?;
        writeln!(out, "outline_px = {:?}", corners(phantom.outline()))?;
        writeln!(out, "recoils = {}", phantom.recoils)?;
    }
    Ok(())
}

fn boresight(out: &mut String, file: &CalibrationFile) -> std::fmt::Result {
    let c = &file.calibration;
    section(
        out,
        "boresight",
        "Where the barrel points, off the optical axis; muzzle: right, down, forward.",
    )?;
    writeln!(out, "right_deg = {:?}", degrees(c.boresight.x))?;
    writeln!(out, "down_deg = {:?}", degrees(c.boresight.y))?;
    writeln!(out, "sigma_mrad = {:?}", mrad(c.boresight_sigma))?;
    writeln!(out, "muzzle_m = {:?}", c.muzzle_in_camera.to_array())?;
    provenance(out, &file.boresight)
}

fn trigger(out: &mut String, file: &CalibrationFile) -> std::fmt::Result {
    let (Some(latency), Some(measured)) = (file.calibration.trigger, &file.trigger) else { return Ok(()) };
    section(out, "trigger", "From the line's edge to the round; negative where the line is the later one.")?;
    writeln!(out, "latency_ms = {:?}", ms(latency.latency_ns))?;
    writeln!(out, "sigma_ms = {:?}", ms(latency.sigma_ns))?;
    provenance(out, measured)
}

fn gyro_bias(out: &mut String, file: &CalibrationFile) -> std::fmt::Result {
    let c = &file.calibration;
    section(out, "gyro_bias", "Subtracted from the rates; the unit's own axes.")?;
    writeln!(out, "bias_deg_per_s = {:?}", c.gyro_bias.to_array().map(degrees))?;
    writeln!(out, "sigma_deg_per_s = {:?}", c.gyro_bias_sigma.to_array().map(degrees))?;
    provenance(out, &file.gyro_bias)
}

fn section(out: &mut String, name: &str, comment: &str) -> std::fmt::Result {
    write!(out, "\n[{name}]\n# {comment}\n")
}

fn provenance(out: &mut String, provenance: &Provenance) -> std::fmt::Result {
    writeln!(out, "measured = {}", provenance.measured)?;
    if provenance.how.is_empty() { Ok(()) } else { writeln!(out, "how = {}", quoted(&provenance.how)) }
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

fn ms(ns: i64) -> f64 {
    ns as f64 / 1e6
}

fn mrad(radians: f64) -> f64 {
    preimage(radians * 1000.0, radians, radians_from_mrad)
}

fn degrees(radians: f64) -> f64 {
    preimage(radians.to_degrees(), radians, f64::to_radians)
}

/// The number near `guess` that `forward` takes to exactly `wanted`, the shortest to write where there are several. Where
/// there is none (`forward` widens the gaps between neighbouring numbers there), `guess` itself.
fn preimage(guess: f64, wanted: f64, forward: fn(f64) -> f64) -> f64 {
    let neighbours =
        [guess.next_down().next_down(), guess.next_down(), guess, guess.next_up(), guess.next_up().next_up()];
    neighbours
        .into_iter()
        .filter(|candidate| forward(*candidate) == wanted)
        .min_by_key(|candidate| format!("{candidate:?}").len())
        .unwrap_or(guess)
}
