//! Distances that the depth buffer tells apart.

use anyhow::Result;
use bowwave_core::frame::view::NEAR_M;

use super::{About, worst};
use crate::bench::{PartBench, PartMethod};

/// Description of this part.
pub const ABOUT: About = About {
    part: "depth",
    what: "Turns the distance of a point into the number by which the depth buffer orders points.",
    truth: "the order of the distances themselves; the error is the least step in distance that the stored numbers still order \
            rightly, found by bisection. Two steps of the view's own f32 distance are the truth's own error",
    rivals: "conventional depth with near and far plane in f32 and 24 bits, reversed depth in 24 bits and with a far plane, \
             logarithmic depth in f32 and 24 bits, linear depth in 24 bits",
    why: "near over distance in f32: one division, no far plane, and steps that grow with the distance as the rounding of the \
          distance itself does. Linear depth in 24 bits is as fine at 20 km, but ends at a far plane, is coarser nearby and must be \
          written by each fragment; logarithmic depth costs a logarithm and is coarser",
};

const FAR_M: f32 = 30_000.0;
const NEAR: f32 = NEAR_M as f32;
const LEVELS_24: f32 = 16_777_215.0;

/// 24 bits of a share 0 to 1, as a driver rounds it. Beyond the far plane is the far plane, as everywhere below.
fn bits24(share: f32) -> f32 {
    (share.clamp(0.0, 1.0) * LEVELS_24).round()
}

fn conventional(z: f32) -> f32 {
    // As the matrix and the division by w compute it.
    ((z * (FAR_M / (FAR_M - NEAR)) - FAR_M * NEAR / (FAR_M - NEAR)) / z).min(1.0)
}

fn reversed_to_far(z: f32) -> f32 {
    ((NEAR * FAR_M / (FAR_M - NEAR) - z * (NEAR / (FAR_M - NEAR))) / z).max(0.0)
}

fn logarithmic(z: f32) -> f32 {
    ((z / NEAR).log2() * (1.0 / (FAR_M / NEAR).log2())).min(1.0)
}

/// The stored number by the distance, and whether it grows with the distance.
type DepthCode = (fn(f32) -> f32, bool);

const METHODS: [PartMethod<DepthCode>; 8] = [
    PartMethod::rival("conventional", "24 bits", (|z| bits24(conventional(z)), true)),
    PartMethod::rival("conventional", "f32", (conventional, true)),
    PartMethod::rival("linear", "24 bits", (|z| bits24(z / FAR_M), true)),
    PartMethod::rival("reversed", "24 bits", (|z| bits24(NEAR / z), false)),
    PartMethod::rival("reversed, far plane", "f32", (reversed_to_far, false)),
    PartMethod::product("reversed, infinite", "f32", (|z| NEAR / z, false)),
    PartMethod::rival("logarithmic", "24 bits", (|z| bits24(logarithmic(z)), true)),
    PartMethod::rival("logarithmic", "f32", (logarithmic, true)),
];

/// Whether what is `step` behind `z` is stored as behind it, there and a little farther.
fn ordered((code, grows): DepthCode, z: f64, step: f64) -> bool {
    let (here, sign) = (code(z as f32), if grows { 1.0 } else { -1.0 });
    (0..4).all(|i| (code((z + step * (1.0 + 0.07 * f64::from(i))) as f32) - here) * sign > 0.0)
}

/// Least step behind `z` that is told apart, metres.
fn resolved(method: DepthCode, z: f64) -> f64 {
    let mut high = z * 1e-9;
    while !ordered(method, z, high) {
        high *= 2.0;
        if high > 1e6 {
            return f64::INFINITY;
        }
    }
    let mut low = high / 2.0;
    for _ in 0..30 {
        let mid = 0.5 * (low + high);
        if ordered(method, z, mid) { high = mid } else { low = mid }
    }
    high
}

/// Distances in equal ratios, off the round numbers.
fn distances(from: f64, to: f64) -> impl Iterator<Item = f64> {
    (0..400).map(move |i| from * (to / from).powf((f64::from(i) + 0.37) / 400.0))
}

fn coarsest(method: DepthCode, from: f64, to: f64) -> f64 {
    worst(distances(from, to).map(|z| resolved(method, z)))
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let used: Vec<f32> = distances(0.5, 20_000.0).map(|z| z as f32).collect();
    let used = &used;
    for (scene, from, to) in [
        ("least step told apart, 0.5 to 200 m", 0.5, 200.0),
        ("least step told apart, 0.5 m to 2 km", 0.5, 2000.0),
        ("least step told apart, 0.5 m to 20 km", 0.5, 20_000.0),
    ] {
        let way = |m: &PartMethod<DepthCode>| {
            let (f, _) = m.run;
            let work = move || used.iter().map(|z| f(*z)).sum::<f32>();
            m.way(coarsest(m.run, from, to), used.len(), work).holds(size_of::<f32>())
        };
        // The distance itself is an f32: nothing finer than two of its steps can be asked for.
        let own = 2.0 * (f64::from((to as f32).next_up()) - to);
        bench.scene(scene, "m", own, METHODS.iter().map(way).collect());
    }
    for (case, from, to) in [
        ("at the near plane, 0.1 to 0.11 m", NEAR_M, NEAR_M * 1.1),
        ("a boat's far side, 19.9 to 20 km", 19_900.0, 20_000.0),
        ("beyond a far plane of 30 km, 40 to 100 km", 40_000.0, 100_000.0),
    ] {
        bench.extreme(case, "m", METHODS.map(|m| m.tried(coarsest(m.run, from, to))).into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_24_bits_are_those_of_the_textbook() {
        // Conventional depth: z^2 / (near * 2^24) far from the near plane, within a step's rounding.
        let step = resolved(METHODS[0].run, 1000.0);
        let textbook = 1e6 / (0.1 * 16_777_216.0);
        assert!((0.4..1.6).contains(&(step / textbook)), "{step} m, {textbook} m");
        // Linear depth: the same everywhere.
        let step = resolved(METHODS[2].run, 1000.0);
        assert!((0.3..1.3).contains(&(step / (30_000.0 / 16_777_216.0))), "{step} m");
    }
}
