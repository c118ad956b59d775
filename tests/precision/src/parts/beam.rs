//! The light that air in a searchlight's beam throws back.

use anyhow::Result;
use bowwave_core::{frame::searchlight::SearchlightView, world::searchlight::SearchlightSpec};
use glam::DVec3;

use super::{About, worst};
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "beam",
    what: "Adds the light of a virtual searchlight to the air before the camera.",
    truth: "single scattering straight back, summed over 400,000 equal steps of the logarithm of the distance with the true angle at the lamp, \
            which the product nowhere computes",
    rivals: "equal steps of the distance; the same angle at the lamp in fewer steps, and without what the air takes on the way",
    why: "the lamp's inverse square is gone from the integral over the angle at the lamp, and what is left is as smooth as the beam: sixteen \
          steps err by less than a code where the beam is white. It is found once for each node of a grid and kept",
};

/// Distance at which the integral ends, metres.
const FAR_M: f64 = 2e4;

/// A node's light by some way.
type Rule = fn(&SearchlightView, DVec3) -> f64;

fn view(beam_deg: f64, visibility_m: f64) -> SearchlightView {
    let spec = SearchlightSpec { candela: 1.0, beam: beam_deg.to_radians(), is_on: true };
    SearchlightView::new(&spec, DVec3::Z, 1.0, visibility_m)
}

/// What is scattered at a distance along a ray into one metre of it.
fn scattered(view: &SearchlightView, ray: DVec3, s: f64) -> f64 {
    let from_lamp = ray * s - view.lamp;
    let r = from_lamp.length();
    let off = from_lamp.angle_between(view.axis);
    (-view.sharpness * off * off - view.extinction_per_m * (s + r)).exp() / (r * r)
}

fn truth(view: &SearchlightView, ray: DVec3) -> f64 {
    const STEPS: u32 = 400_000;
    let (low, high) = (1e-3f64.ln(), FAR_M.ln());
    let step = (high - low) / f64::from(STEPS);
    let of_step = |i: u32| {
        let s = (low + step * (f64::from(i) + 0.5)).exp();
        scattered(view, ray, s) * s * step
    };
    (0..STEPS).map(of_step).sum()
}

/// Equal steps up to the distance at which a hundredth of the light is left that comes from 30 m.
fn by_distance<const STEPS: u32>(view: &SearchlightView, ray: DVec3) -> f64 {
    const END_M: f64 = 300.0;
    let step = END_M / f64::from(STEPS);
    (0..STEPS).map(|i| scattered(view, ray, step * (f64::from(i) + 0.5)) * step).sum()
}

/// Equal steps of the angle at the lamp.
fn by_angle<const STEPS: u32, const AIR: bool>(view: &SearchlightView, ray: DVec3) -> f64 {
    let along = view.lamp.dot(ray);
    let aside = view.lamp - ray * along;
    let off_m = aside.length();
    let aside = aside / off_m;
    let nearest = ray.dot(view.axis).atan2(-aside.dot(view.axis));
    let reach = 3.3 * (0.5 / view.sharpness).sqrt();
    let low = (nearest - reach).max((-along / off_m).atan());
    let high = (nearest + reach).min(((FAR_M - along) / off_m).atan());
    let step = (high - low).max(0.0) / f64::from(STEPS);
    let of_step = |i: u32| {
        let angle = low + step * (f64::from(i) + 0.5);
        let ahead = ray * angle.sin() - aside * angle.cos();
        let off = ahead.angle_between(view.axis);
        let air_m = off_m / angle.cos() + along + off_m * angle.tan();
        (-view.sharpness * off * off - if AIR { view.extinction_per_m * air_m } else { 0.0 }).exp()
    };
    (0..STEPS).map(of_step).sum::<f64>() * step / off_m
}

/// The product's, without the share that comes straight back.
fn product(view: &SearchlightView, ray: DVec3) -> f64 {
    view.haze(ray, FAR_M) / view.scattered_per_m()
}

const RULES: [(&str, &str, Rule); 6] = [
    ("the angle at the lamp", "16 steps", product),
    ("the angle at the lamp", "4 steps", by_angle::<4, true>),
    ("the angle at the lamp", "8 steps", by_angle::<8, true>),
    ("the angle at the lamp", "16 steps, clear air", by_angle::<16, false>),
    ("the distance", "64 steps", by_distance::<64>),
    ("the distance", "1024 steps", by_distance::<1024>),
];

/// Rays over a picture of 60 by 34 degrees.
fn rays() -> impl Iterator<Item = DVec3> {
    let at = |i: u32, n: u32, half: f64| half * (2.0 * f64::from(i) / f64::from(n - 1) - 1.0);
    (0..7u32).flat_map(move |y| {
        (0..9u32).map(move |x| DVec3::new(at(x, 9, 0.57), at(y, 7, 0.32), 1.0).normalize())
    })
}

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    for (beam_deg, visibility_m) in [(8.0, 2e4), (8.0, 1000.0), (2.0, 5000.0), (25.0, 2e4)] {
        let view = view(beam_deg, visibility_m);
        let truths: Vec<(DVec3, f64)> = rays().map(|ray| (ray, truth(&view, ray))).collect();
        let peak = truths.iter().map(|(_, truth)| *truth).fold(0.0, f64::max);
        let error = |rule: Rule| {
            100.0 * worst(truths.iter().map(|(ray, truth)| (rule(&view, *ray) - truth).abs() / peak))
        };
        let ways = RULES.iter().enumerate().map(|(i, (method, setting, rule))| {
            let work = || truths.iter().map(|(ray, _)| rule(&view, *ray)).sum::<f64>();
            Way::new(method, setting, error(*rule), truths.len(), work).default_if(i == 0)
        });
        let case = format!("beam {beam_deg} deg, visibility {} km", visibility_m / 1000.0);
        bench.scene(&case, "% of the peak", 0.5, ways.collect());
    }
    for (case, view, ray) in [
        ("a beam of half a degree in fog of 50 m", view(0.5, 50.0), DVec3::Z),
        ("a ray through the lamp", view(8.0, 2e4), view(8.0, 2e4).lamp.normalize() + DVec3::Z * 1e-9),
        ("a beam as wide as half the sky", view(60.0, 2e5), DVec3::new(0.3, -0.2, 1.0).normalize()),
    ] {
        let truth = truth(&view, ray);
        let results = RULES.iter().enumerate().map(|(i, (method, setting, rule))| {
            let error = 100.0 * (rule(&view, ray) - truth).abs() / truth.max(1e-12);
            ExtremeResult { default: i == 0, ..ExtremeResult::rival(method, setting, error) }
        });
        bench.extreme(case, "%", results.collect());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_products_way_is_near_the_truth_and_coarse_steps_of_the_distance_are_not() {
        let view = view(8.0, 2e4);
        let ray = DVec3::new(0.02, -0.05, 1.0).normalize();
        let truth = truth(&view, ray);
        assert!((product(&view, ray) / truth - 1.0).abs() < 0.02);
        assert!((by_distance::<64>(&view, ray) / truth - 1.0).abs() > 0.02);
    }
}
