//! Inverse of the lens distortion.

use bowwave_core::geometry::Lens;
use glam::{DVec2, DVec3};

use super::row;
use crate::{page::About, table::Row, timing::time_ns};

/// What is said of this part.
pub const ABOUT: About = About {
    part: "lens",
    truth: "known directions projected by the forward model; the inverse must lead back to them",
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
    directions(lens)
        .iter()
        .map(|(d, p)| invert(lens, *p).angle_between(*d) * lens.focal.x)
        .fold(0.0, f64::max)
}

/// One way to invert.
type Method = (&'static str, &'static str, Box<dyn Fn(&Lens, DVec2) -> DVec3>);

/// The rows.
pub fn rows(repeats: usize) -> Vec<Row> {
    let methods: [Method; 4] = [
        ("ignore distortion", "", Box::new(|l, p| steps(l, p, 0))),
        ("fixed point", "5 steps", Box::new(|l, p| steps(l, p, 5))),
        ("fixed point", "until still", Box::new(|l, p| l.unproject(p))),
        ("Newton", "6 steps", Box::new(newton)),
    ];
    let usual = lens(-0.12, 0.02);
    let points = directions(&usual);
    let mut rows: Vec<Row> = methods
        .iter()
        .map(|(method, setting, invert)| {
            let time = time_ns(repeats, || points.iter().map(|(_, p)| invert(&usual, *p)).sum::<DVec3>())
                / points.len() as f64;
            let mut r = row(
                "lens",
                "k1 -0.12, k2 0.02, 70 deg",
                method,
                setting,
                worst_px(&usual, invert),
                "px",
                time,
            );
            r.default = *setting == "until still";
            r
        })
        .collect();
    for (scene, lens) in
        [("barrel to the fold, k1 -0.2", lens(-0.2, 0.0)), ("pincushion, k1 0.3", lens(0.3, 0.05))]
    {
        let mut r = row(
            "lens",
            scene,
            "fixed point",
            "until still",
            worst_px(&lens, &|l, p| l.unproject(p)),
            "px",
            0.0,
        );
        r.extreme = true;
        rows.push(r);
    }
    rows
}
