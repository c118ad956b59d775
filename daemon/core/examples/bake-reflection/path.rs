//! Where light comes from that one ray of sight meets on the water.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_pcg::Pcg64;

use crate::sea::BakedSea;

/// Refractive index of sea water.
const SEA_INDEX: f64 = 1.34;
/// Times that light is followed from facet to facet.
const BOUNCES: usize = 5;

/// A straight piece of a path, backwards from the eye.
#[derive(Clone, Copy, Debug)]
pub struct PathSegment {
    /// Where it begins, on the water.
    pub from: [f64; 3],
    /// Where it goes.
    pub dir: [f64; 3],
    /// Metres to the next water; infinite for the last.
    pub end: f64,
    /// Share of the light along it that reaches the eye.
    pub share: f64,
}

/// Follows the ray of sight that goes down by `down` (sine) away from the eye and meets the mean water at (x, y). `path` gets the
/// pieces after each facet; the last is open unless the light was lost.
pub fn follow(sea: &BakedSea, at: [f64; 2], down: f64, rng: &mut Pcg64, path: &mut Vec<PathSegment>) {
    path.clear();
    let across = (1.0 - down * down).sqrt();
    let mut dir = [0.0, across, -down];
    let back = (sea.reach_m + 1e-3) / down;
    let mut from = [at[0], at[1] - back * across, back * down];
    let Some(t) = sea.hit(from, dir, 0.0) else { return };
    step(&mut from, dir, t);
    let mut share = 1.0;
    for _ in 0..BOUNCES {
        let [height, sx, sy] = sea.at(from[0], from[1]);
        // On the water, not where rounding left it: below, the path would meet the same water again.
        from[2] = height;
        let (normal, cos) = facet(sea, [sx, sy], dir, rng);
        share *= fresnel(cos);
        for (d, n) in dir.iter_mut().zip(normal) {
            *d += 2.0 * cos * n;
        }
        // Hidden by other fine facets: the path goes on from here to one of them.
        let open = unhidden(sea, [sx, sy], dir);
        if share < 1e-4 {
            return;
        }
        if rng.random::<f64>() > open {
            path.push(PathSegment { from, dir, end: 0.0, share });
            continue;
        }
        let start = [from[0], from[1], from[2] + 1e-4];
        let hit = sea.hit(start, dir, 1e-3);
        path.push(PathSegment { from, dir, end: hit.unwrap_or(f64::INFINITY), share });
        let Some(t) = hit else { return };
        step(&mut from, dir, t);
    }
    path.clear();
}

fn step(from: &mut [f64; 3], dir: [f64; 3], t: f64) {
    for (f, d) in from.iter_mut().zip(dir) {
        *f += t * d;
    }
}

/// Reflectance of the sea for unpolarised light whose angle from the normal has the cosine `cos`.
pub fn fresnel(cos: f64) -> f64 {
    let cos = cos.clamp(0.0, 1.0);
    let inner = (1.0 - (1.0 - cos * cos) / (SEA_INDEX * SEA_INDEX)).sqrt();
    let s = (cos - SEA_INDEX * inner) / (cos + SEA_INDEX * inner);
    let p = (inner - SEA_INDEX * cos) / (inner + SEA_INDEX * cos);
    0.5 * (s * s + p * p)
}

/// A facet that light coming along `dir` sees, and the cosine under which it does: fine slopes are normally distributed about the
/// resolved one, and are seen in proportion to their projection (Ross and Dion 2007; Heitz 2014 calls it the distribution of visible normals).
fn facet(sea: &BakedSea, slope: [f64; 2], dir: [f64; 3], rng: &mut Pcg64) -> ([f64; 3], f64) {
    let flat = dir[0].hypot(dir[1]).max(1e-9);
    let (ux, uy) = (dir[0] / flat, dir[1] / flat);
    // Slopes along the ray and across it.
    let [vxx, vyy, vxy] = sea.fine;
    let along = ux * ux * vxx + uy * uy * vyy + 2.0 * ux * uy * vxy;
    let mixed = (vyy - vxx) * ux * uy + vxy * (ux * ux - uy * uy);
    let across = uy * uy * vxx + ux * ux * vyy - 2.0 * ux * uy * vxy;
    let sigma = along.sqrt().max(1e-6);
    // Rising along the ray by u, a facet shows u * flat - dir.z of itself.
    let mean = slope[0] * ux + slope[1] * uy;
    let w = visible_normal((mean * flat - dir[2]) / (flat * sigma), rng);
    let u = mean + sigma * w;
    let rest = (across - mixed * mixed / along.max(1e-12)).max(0.0).sqrt();
    // (-uy, ux) points across.
    let v = -slope[0] * uy + slope[1] * ux + mixed / sigma * w + rest * gauss(rng);
    let (sx, sy) = (u * ux - v * uy, u * uy + v * ux);
    let length = (1.0 + sx * sx + sy * sy).sqrt();
    let normal = [-sx / length, -sy / length, 1.0 / length];
    let cos = -(normal[0] * dir[0] + normal[1] * dir[1] + normal[2] * dir[2]);
    (normal, cos.max(0.0))
}

fn gauss(rng: &mut Pcg64) -> f64 {
    (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt() * (TAU * rng.random::<f64>()).cos()
}

/// A number w with the density (a + w) phi(w) for w > -a, not normalised.
fn visible_normal(a: f64, rng: &mut Pcg64) -> f64 {
    if a < 0.0 {
        // y = a + w with the density y exp(-y^2 / 2) exp(a y).
        for _ in 0..1000 {
            let (y, keep) = if a > -1.0 {
                let y = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
                (y, (a * y).exp())
            } else {
                let y = ((1.0 - rng.random::<f64>()) * (1.0 - rng.random::<f64>())).ln() / a;
                (y, (-0.5 * y * y).exp())
            };
            if rng.random::<f64>() < keep {
                return y - a;
            }
        }
        return -a;
    }
    // Right of 0: a phi + w phi; left of 0: at most a phi.
    let phi0 = TAU.sqrt().recip();
    loop {
        let pick = rng.random::<f64>() * (a + phi0);
        if pick < phi0 {
            return (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
        }
        let w = gauss(rng);
        if w >= 0.0 || rng.random::<f64>() * a < a + w {
            return w;
        }
    }
}

/// Share of the fine facets about a place from which light leaves along `dir` unhidden by others: Smith 1967 for normally distributed
/// slopes.
fn unhidden(sea: &BakedSea, slope: [f64; 2], dir: [f64; 3]) -> f64 {
    let flat = dir[0].hypot(dir[1]);
    if flat < 1e-6 {
        return 1.0;
    }
    let (ux, uy) = (dir[0] / flat, dir[1] / flat);
    let [vxx, vyy, vxy] = sea.fine;
    let sigma = (ux * ux * vxx + uy * uy * vyy + 2.0 * ux * uy * vxy).sqrt().max(1e-6);
    let rise = dir[2] - flat * (slope[0] * ux + slope[1] * uy);
    let a = rise / (flat * sigma);
    if a <= 0.0 {
        return 0.0;
    }
    let phi = (-0.5 * a * a).exp() / TAU.sqrt();
    1.0 / (1.0 + (phi / a - upper_tail(a)))
}

/// Share of a standard normal distribution beyond `a` >= 0 (Abramowitz and Stegun 26.2.17, error below 1e-7).
fn upper_tail(a: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * a);
    let poly = t
        * (0.319_381_53
            + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    poly * (-0.5 * a * a).exp() / TAU.sqrt()
}
