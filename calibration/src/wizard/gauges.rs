//! How far quantities have come, by what the solvers say of them, and what to do about those that lag.

use bowwave_core::guide::{Gauge, Rating};

use crate::{
    alignment::{Alignment, Grade, Movement},
    boresight::Boresight,
    lens::{LensCalibration, enough},
    report::{AXES, RANGE_M},
    trigger::Latency,
};

pub(super) const ENOUGH: &str = "Press Enter: nothing is to be gained by more";
pub(super) const HORIZON_ENOUGH: &str = "Press Enter: of elevation the horizon tells no more (a board would)";
pub(super) const AIM: &str = "Aim the bore at the mark anew, hold still, pull the trigger";
pub(super) const DRY: &str = "Cock the gun, hold it still for a second, pull the trigger";

/// A standard deviation this many times that of the grade good is nothing known: an empty gauge.
const NOTHING: f64 = 100.0;

/// The movement, as an order.
pub(super) const fn do_more(movement: Movement) -> &'static str {
    match movement {
        Movement::Traverse => "Traverse the gun left and right",
        Movement::Elevation => "Elevate the gun up and down",
        Movement::Roll => "Roll camera and unit about the line of sight (by hand, or let the ship roll)",
        Movement::Any => "Swing the gun left and right, up and down",
    }
}

/// The gauge of a standard deviation, by what is enough for the grades good and usable.
fn gauge(name: &'static str, value: String, sigma: f64, [good, usable]: [f64; 2]) -> Gauge {
    let rating = if sigma <= good {
        Rating::Good
    } else if sigma <= usable {
        Rating::Usable
    } else {
        Rating::Poor
    };
    // By its logarithm: each halving is as long in coming as the one before.
    let share = 1.0 - (sigma / good).max(1.0).ln() / NOTHING.ln();
    let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
    Gauge { name, value, share, rating: Some(rating) }
}

fn angle(name: &'static str, sigma: f64) -> Gauge {
    let value = format!("{:.1} mrad, {:.1} m at {RANGE_M:.0} m", sigma * 1e3, sigma * RANGE_M);
    gauge(name, value, sigma, Grade::ROTATION)
}

/// Gauges of the alignment before the first solution.
pub(super) fn of_nothing() -> Vec<Gauge> {
    let names = AXES.into_iter().chain(["time offset"]);
    names.map(|name| Gauge { name, value: "not known yet".to_owned(), share: 0.0, rating: None }).collect()
}

pub(super) fn of_alignment(a: &Alignment) -> Vec<Gauge> {
    let sigma = a.rotation_sigma();
    let mut gauges: Vec<Gauge> = AXES.into_iter().zip(sigma.to_array()).map(|(n, s)| angle(n, s)).collect();
    let value = format!("{:.2} ms", a.offset_sigma_s * 1e3);
    gauges.push(gauge("time offset", value, a.offset_sigma_s, Grade::OFFSET_S));
    gauges
}

pub(super) fn of_lens(camera: &LensCalibration) -> Vec<Gauge> {
    let tilt = camera.coverage.tilt[1];
    let mut gauges = vec![angle("picture's edge", camera.edge_sigma())];
    gauges.extend([
        of_share("parts seen", camera.coverage.share, enough::SHARE, |s| format!("{:.0} %", s * 100.0)),
        of_share("tilt", tilt, enough::TILT, |t| format!("{:.0} deg", t.to_degrees())),
        of_share("pictures", camera.poses.len() as f64, enough::PICTURES as f64, |n| format!("{n:.0}")),
    ]);
    gauges
}

/// The gauge of something of which there must be so much.
pub(super) fn of_share(name: &'static str, is: f64, wanted: f64, say: impl Fn(f64) -> String) -> Gauge {
    let share = (is / wanted).clamp(0.0, 1.0);
    let rating = (is >= wanted).then_some(Rating::Good);
    Gauge { name, value: format!("{} of {}", say(is), say(wanted)), share, rating }
}

pub(super) fn of_boresight(b: &Boresight) -> Vec<Gauge> {
    vec![angle("barrel", b.sigma()), angle("scatter of a pull", b.scatter)]
}

pub(super) fn of_trigger(t: &Latency) -> Vec<Gauge> {
    let value = format!("{:.1} +- {:.1} ms", t.latency_s * 1e3, t.sigma_s * 1e3);
    vec![gauge("latency", value, t.sigma_s, [2e-3, 5e-3])]
}
