//! Inverse of the lens distortion.

use anyhow::Result;
use bowwave_core::geometry::Lens;
use glam::{DVec2, DVec3};

use super::{About, worst};
use crate::bench::{Bench, Tried, Way};

/// What is said of this part.
pub const ABOUT: About = About {
    part: "lens",
    what: "Finds the direction that a pixel sees: the inverse of the lens's distortion.",
    truth: "known directions projected by the forward model; the inverse must lead back to them",
    rivals: "no distortion at all, five steps of the same iteration (cheaper), Newton's method with a numerical derivative",
    why: "fixed-point iteration until it stands still: it is used a few hundred times a frame at most, so that its time does not \
          count, and it needs no derivative that could be singular",
};

fn lens(k1: f64, k2: f64) -> Lens {
    Lens { radial: DVec2::new(k1, k2), ..Lens::pinhole(1280, 720, 70f64.to_radians()) }
}

fn directions(lens: &Lens) -> Vec<(DVec3, DVec2)> {
    (0..17 * 17)
        .filter_map(|i| {
            let share = DVec2::new(f64::from(i % 17), f64::from(i / 17)) / 16.0 - 0.5;
            let direction = DVec3::new(share.x * 1.4, share.y * 0.8, 1.0).normalize();
            lens.project(direction).map(|pixel| (direction, pixel))
        })
        .collect()
}

/// A fixed number of steps of the same iteration.
fn steps(lens: &Lens, pixel: DVec2, count: usize) -> DVec3 {
    let distorted = (pixel - lens.centre) / lens.focal;
    let n = (0..count).fold(distorted, |n, _| n + distorted - lens.distort(n));
    n.extend(1.0).normalize()
}

/// Newton's method with a numerical derivative.
fn newton(lens: &Lens, pixel: DVec2) -> DVec3 {
    let distorted = (pixel - lens.centre) / lens.focal;
    let mut n = distorted;
    for _ in 0..6 {
        let f = lens.distort(n) - distorted;
        let h = 1e-7;
        let dx = (lens.distort(n + DVec2::X * h) - lens.distort(n - DVec2::X * h)) / (2.0 * h);
        let dy = (lens.distort(n + DVec2::Y * h) - lens.distort(n - DVec2::Y * h)) / (2.0 * h);
        let determinant = dx.x * dy.y - dy.x * dx.y;
        n -= DVec2::new(dy.y * f.x - dy.x * f.y, dx.x * f.y - dx.y * f.x) / determinant;
    }
    n.extend(1.0).normalize()
}

fn worst_px(lens: &Lens, invert: &dyn Fn(&Lens, DVec2) -> DVec3) -> f64 {
    // The chord, not the arc cosine, which rounds small angles away.
    worst(directions(lens).iter().map(|(d, p)| (invert(lens, *p) - *d).length() * lens.focal.x))
}

/// One way to invert.
type Method = (&'static str, &'static str, fn(&Lens, DVec2) -> DVec3);

const METHODS: [Method; 4] = [
    ("ignore distortion", "", |l, p| steps(l, p, 0)),
    ("fixed point", "5 steps", |l, p| steps(l, p, 5)),
    ("fixed point", "until still", |l, p| l.unproject(p)),
    ("Newton", "6 steps", newton),
];

/// Measures the scene and extreme cases.
pub fn measure(bench: &mut Bench) -> Result<()> {
    let usual = lens(-0.12, 0.02);
    let usual = &usual;
    let points = directions(usual);
    let points = &points;
    let ways = METHODS.map(|(method, setting, invert)| {
        Way::new(method, setting, worst_px(usual, &invert), points.len(), move || {
            points.iter().map(|(_, p)| invert(usual, *p)).sum::<DVec3>()
        })
        .default_if(setting == "until still")
    });
    bench.scene("k1 -0.12, k2 0.02, 70 deg", "px", 1e-9, ways.into());
    for (case, lens) in [
        ("barrel to the fold, k1 -0.2", lens(-0.2, 0.0)),
        ("pincushion, k1 0.3", lens(0.3, 0.05)),
        ("no distortion", lens(0.0, 0.0)),
    ] {
        let tried = METHODS.map(|(method, setting, invert)| Tried {
            default: setting == "until still",
            ..Tried::rival(method, setting, worst_px(&lens, &invert))
        });
        bench.extreme(case, "px", tried.into());
    }
    Ok(())
}
