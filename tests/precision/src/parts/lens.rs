//! The lens: directions of pixels, and what one model makes of another.

use anyhow::Result;
use bowwave_core::geometry::{Distortion, Lens};
use glam::{DVec2, DVec3};

use super::{About, worst};
use crate::bench::{ExtremeResult, PartBench, PartMethod, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "lens",
    what: "Finds the direction that a pixel sees: the inverse of the lens's distortion.",
    truth: "known directions projected by the forward model; the inverse must lead back to them. Models that are fitted to another one are \
            held against that one, over all that its picture sees",
    rivals: "no distortion at all, five steps of a fixed-point iteration (cheaper), the same until it stands still (which it need not), \
             Newton's method with a numerical derivative, a table of 33 x 19 directions",
    why: "Newton's method in a bracket that the model's fold closes: it finds what the model can show at all, to the last digits, where \
          the fixed point diverges or stops short (strong barrel, pincushion, fisheye). Cameras differ in what they need: a fisheye of 100 deg \
          is no Brown-Conrady lens to a tenth of a pixel, so the file, core and shaders have both models",
};

fn lens(hfov_deg: f64, k1: f64, k2: f64) -> Lens {
    let distortion = Distortion::radial_tangential(DVec2::new(k1, k2), DVec2::ZERO);
    Lens { distortion, ..Lens::pinhole(1280, 720, hfov_deg.to_radians()) }
}

/// Directions that fall on 17 x 17 pixels all over the picture, and those by the forward model.
fn directions(lens: &Lens) -> Vec<(DVec3, DVec2)> {
    let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
    // Angles up to the corner's, which need no inverse to be found.
    (0..33 * 24)
        .filter_map(|i| {
            let (off, around) =
                (f64::from(i / 24) / 32.0 * 1.9, f64::from(i % 24) / 24.0 * std::f64::consts::TAU);
            let direction = DVec3::new(off.sin() * around.cos(), off.sin() * around.sin(), off.cos());
            let pixel = lens.project(direction)?;
            (pixel.cmpge(DVec2::ZERO).all() && pixel.cmple(size).all()).then_some((direction, pixel))
        })
        .collect()
}

/// The model's image of undistorted normalised coordinates, before the focal length.
fn bend(lens: &Lens, n: DVec2) -> DVec2 {
    lens.project(n.extend(1.0)).map_or(DVec2::NAN, |pixel| (pixel - lens.centre) / lens.focal)
}

/// A fixed-point iteration of so many steps at most.
fn steps(lens: &Lens, pixel: DVec2, count: usize) -> DVec3 {
    let distorted = (pixel - lens.centre) / lens.focal;
    let mut n = distorted;
    for _ in 0..count {
        let step = distorted - bend(lens, n);
        n += step;
        if step.length_squared() < 1e-24 {
            break;
        }
    }
    n.extend(1.0).normalize()
}

/// Newton's method with a numerical derivative.
fn newton(lens: &Lens, pixel: DVec2) -> DVec3 {
    let distorted = (pixel - lens.centre) / lens.focal;
    let mut n = distorted;
    for _ in 0..6 {
        let f = bend(lens, n) - distorted;
        let h = 1e-7;
        let dx = (bend(lens, n + DVec2::X * h) - bend(lens, n - DVec2::X * h)) / (2.0 * h);
        let dy = (bend(lens, n + DVec2::Y * h) - bend(lens, n - DVec2::Y * h)) / (2.0 * h);
        n -= glam::DMat2::from_cols(dx, dy).inverse() * f;
    }
    n.extend(1.0).normalize()
}

const TABLE: (usize, usize) = (33, 19);

fn table(lens: &Lens) -> Vec<DVec3> {
    let last = DVec2::new((TABLE.0 - 1) as f64, (TABLE.1 - 1) as f64);
    let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
    (0..TABLE.0 * TABLE.1)
        .map(|i| lens.unproject(DVec2::new((i % TABLE.0) as f64, (i / TABLE.0) as f64) / last * size))
        .collect()
}

fn looked_up(lens: &Lens, table: &[DVec3], pixel: DVec2) -> DVec3 {
    let last = DVec2::new((TABLE.0 - 1) as f64, (TABLE.1 - 1) as f64);
    let at = pixel / DVec2::new(f64::from(lens.width), f64::from(lens.height)) * last;
    let cell = at.floor().clamp(DVec2::ZERO, last - 1.0);
    let (share, i) = (at - cell, cell.y as usize * TABLE.0 + cell.x as usize);
    let upper = table[i].lerp(table[i + 1], share.x);
    upper.lerp(table[i + TABLE.0].lerp(table[i + TABLE.0 + 1], share.x), share.y).normalize()
}

fn worst_px(lens: &Lens, invert: &dyn Fn(&Lens, DVec2) -> DVec3) -> f64 {
    // The chord, not the arc cosine, which rounds small angles away. What gives no number at all is half the world off.
    let off = |d: &DVec3, p: &DVec2| (invert(lens, *p) - *d).length();
    let px = |chord: f64| if chord.is_nan() { 2.0 } else { chord } * lens.focal.x;
    worst(directions(lens).iter().map(|(d, p)| px(off(d, p))))
}

/// One way to invert, of that lens.
type Inverse<'a> = Box<dyn Fn(&Lens, DVec2) -> DVec3 + 'a>;

fn methods(of: &Lens) -> [PartMethod<Inverse<'_>>; 6] {
    let rays = table(of);
    [
        PartMethod::rival("ignore distortion", "", Box::new(|l, p| steps(l, p, 0))),
        PartMethod::rival("fixed point", "5 steps", Box::new(|l, p| steps(l, p, 5))),
        PartMethod::rival("fixed point", "60 steps at most", Box::new(|l, p| steps(l, p, 60))),
        PartMethod::rival("Newton", "6 steps, numerical", Box::new(newton)),
        PartMethod::rival("table", "33 x 19", Box::new(move |l, p| looked_up(l, &rays, p))),
        PartMethod::product("Newton", "bracketed", Box::new(|l, p| l.unproject(p))),
    ]
}

fn fisheye(hfov_deg: f64) -> Lens {
    Lens::fisheye(1280, 720, hfov_deg.to_radians(), [-0.02, 0.004, -0.002, 0.0003])
}

/// Largest distance in pixels between a lens and the best fit of `terms` to it, over the angles from the axis that its picture has.
fn fitted_px(truth: &Lens, terms: &dyn Fn(f64) -> Vec<f64>) -> f64 {
    const ANGLES: usize = 200;
    let reach = truth.half_diagonal().min(1.5);
    let radius = |angle: f64| {
        let seen = truth.project(DVec3::new(angle.sin(), 0.0, angle.cos()));
        seen.map_or(f64::NAN, |p| p.x - truth.centre.x)
    };
    let angles: Vec<f64> = (1..=ANGLES).map(|i| reach * i as f64 / ANGLES as f64).collect();
    let rows: Vec<Vec<f64>> = angles.iter().map(|a| terms(*a)).collect();
    let count = rows.first().map_or(0, Vec::len);
    // Orthogonal columns (modified Gram-Schmidt, twice) stay apart where normal equations would not.
    let mut columns: Vec<Vec<f64>> = (0..count).map(|c| rows.iter().map(|r| r[c]).collect()).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut left: Vec<f64> = angles.iter().map(|a| radius(*a)).collect();
    for c in 0..count {
        let (before, rest) = columns.split_at_mut(c);
        let own = &mut rest[0];
        for _ in 0..2 {
            for other in before.iter() {
                let share = dot(own, other);
                own.iter_mut().zip(other).for_each(|(own, other)| *own -= share * other);
            }
        }
        let length = dot(own, own).sqrt().max(f64::MIN_POSITIVE);
        own.iter_mut().for_each(|v| *v /= length);
        let share = dot(&left, own);
        left.iter_mut().zip(own.iter()).for_each(|(left, own)| *left -= share * own);
    }
    worst(left.into_iter().map(f64::abs))
}

/// Measures scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let scenes =
        [("k1 -0.12, k2 0.02, 70 deg", lens(70.0, -0.12, 0.02)), ("fisheye, 120 deg", fisheye(120.0))];
    for (scene, lens) in &scenes {
        let points = &directions(lens);
        let ways = methods(lens).map(|m| {
            let way = Way::new(m.method, m.setting, worst_px(lens, &m.run), points.len(), move || {
                points.iter().map(|(_, p)| (m.run)(lens, *p)).sum::<DVec3>()
            });
            way.default_if(m.default)
        });
        bench.scene(scene, "px", 1e-9, ways.into());
    }
    for (case, lens) in [
        ("barrel to the fold, k1 -0.2, 100 deg", lens(100.0, -0.2, 0.0)),
        ("strong barrel, k1 -0.35, k2 0.15, 120 deg", lens(120.0, -0.35, 0.15)),
        ("pincushion, k1 0.3", lens(70.0, 0.3, 0.05)),
        ("telephoto, 20 deg, k1 -0.4", lens(20.0, -0.4, 0.2)),
        ("fisheye, 190 deg", fisheye(190.0)),
        ("no distortion", lens(70.0, 0.0, 0.0)),
    ] {
        let tried = methods(&lens).map(|m| m.tried(worst_px(&lens, &m.run)));
        bench.extreme(case, "px", tried.into());
    }
    for (case, truth) in [
        ("models fitted to a fisheye of 60 deg", fisheye(60.0)),
        ("models fitted to a fisheye of 100 deg", fisheye(100.0)),
        ("models fitted to a fisheye of 140 deg", fisheye(140.0)),
        ("models fitted to k1 -0.12, k2 0.02 of 70 deg", lens(70.0, -0.12, 0.02)),
        ("models fitted to k1 -0.25, k2 0.06 of 100 deg", lens(100.0, -0.25, 0.06)),
    ] {
        let odd = |x: f64, count: i32| (0..count).map(|i| x.powi(2 * i + 1)).collect::<Vec<_>>();
        let tried = vec![
            ExtremeResult::rival("pinhole", "focal length", fitted_px(&truth, &|a| odd(a.tan(), 1))),
            ExtremeResult::rival("Brown-Conrady", "k1, k2", fitted_px(&truth, &|a| odd(a.tan(), 3))),
            ExtremeResult::rival("Kannala-Brandt", "k1 to k4", fitted_px(&truth, &|a| odd(a, 5))),
        ];
        bench.extreme(case, "px", tried);
    }
    Ok(())
}
