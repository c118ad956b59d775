//! Phase of a wave far away and late.

use std::f64::consts::TAU;

use anyhow::Result;
use bowwave_core::{
    sea::BeaufortForce,
    world::waves::{Spectrum, Wave, WaveField, WaveSpec},
};
use glam::DVec2;
use rustfft::num_traits::Float as _;

use super::{About, even, worst};
use crate::bench::{PartBench, PartMethod};

/// Description of this part.
pub const ABOUT: About = About {
    part: "wavefield",
    what: "Height of one wave at a place and time: thousands of cycles away, of which only the fraction counts.",
    truth: "cycles of the stored numbers by integer arithmetic of 106 bits, free of rounding",
    rivals: "f32 throughout, f32 with the cycles' whole part taken off, f32 around an anchor whose phase f64 takes each frame, f64 \
             without reduction, f64 with the cosine in f32, f64 with the products' rounding errors (two-product)",
    why: "f64 with whole cycles taken off each product: nanoradians at kilometres and days. It is asked for at boats, rounds and \
          strikes, some hundred times a frame, so that f32 would save nothing; a shader that needs it a million times should take \
          the anchor's way",
};

/// A place and a time.
type WaveEvent = (DVec2, f64);
/// Height over amplitude.
type WaveHeight = fn(&Wave, DVec2, f64) -> f64;

const METHODS: [PartMethod<WaveHeight>; 7] = [
    PartMethod::rival("f32", "as written", |w, p, t| {
        let k = (w.cycles_per_m * TAU).as_vec2();
        let phase = k.dot(p.as_vec2()) - (TAU * w.hz) as f32 * t as f32 + (TAU * w.phase) as f32;
        f64::from(phase.cos())
    }),
    PartMethod::rival("f32", "whole cycles off", |w, p, t| {
        let (c, p) = (w.cycles_per_m.as_vec2(), p.as_vec2());
        let cycles = (c.x * p.x).fract() + (c.y * p.y).fract() - (w.hz as f32 * t as f32).fract();
        f64::from(((cycles + w.phase as f32).fract() * std::f32::consts::TAU).cos())
    }),
    PartMethod::rival("f32", "anchor of 64 m", |w, p, t| {
        // As a shader would: the phase at the anchor comes from f64, once a frame; only the way from there is f32.
        let anchor = (p / 64.0).round() * 64.0;
        let start = w.phase(anchor, t) as f32;
        let way = (w.cycles_per_m * TAU).as_vec2().dot((p - anchor).as_vec2());
        f64::from((start + way).cos())
    }),
    PartMethod::rival("f64", "as written", |w, p, t| {
        (TAU * (w.cycles_per_m.dot(p) - w.hz * t + w.phase)).cos()
    }),
    PartMethod::rival("f64", "cosine in f32", |w, p, t| f64::from((w.phase(p, t) as f32).cos())),
    PartMethod::product("f64", "whole cycles off", |w, p, t| w.phase(p, t).cos()),
    PartMethod::rival("f64", "two-product", |w, p, t| {
        let part = |a: f64, b: f64| {
            let product = a * b;
            (product - product.floor()) + a.mul_add(b, -product)
        };
        let cycles = part(w.cycles_per_m.x, p.x) + part(w.cycles_per_m.y, p.y) - part(w.hz, t) + w.phase;
        (TAU * (cycles - cycles.floor())).cos()
    }),
];

/// Fraction of a * b, exact: the product of two mantissas is an integer of 106 bits.
fn exact_fraction(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 {
        return 0.0;
    }
    let parts = |v: f64| {
        let (mantissa, exponent, sign) = v.integer_decode();
        (i128::from(mantissa) * i128::from(sign), i32::from(exponent))
    };
    let ((ma, ea), (mb, eb)) = (parts(a), parts(b));
    let (product, exponent) = (ma * mb, ea + eb);
    match exponent {
        0.. => 0.0,
        // Far below one: the product has no whole part, only a sign.
        ..-120 => (a * b).rem_euclid(1.0),
        _ => {
            let one = 1_i128 << -exponent;
            product.rem_euclid(one) as f64 / one as f64
        }
    }
}

fn truth(w: &Wave, p: DVec2, t: f64) -> f64 {
    let cycles = exact_fraction(w.cycles_per_m.x, p.x) + exact_fraction(w.cycles_per_m.y, p.y)
        - exact_fraction(w.hz, t)
        + w.phase;
    (TAU * cycles).cos()
}

fn events(reach_m: f64, from_s: f64, to_s: f64) -> Vec<WaveEvent> {
    (0..512)
        .map(|i| {
            let at = DVec2::new(even(3 * i) * 2.0 - 1.0, even(3 * i + 1) * 2.0 - 1.0) * reach_m;
            (at, from_s + even(3 * i + 2) * (to_s - from_s))
        })
        .collect()
}

fn error(height: WaveHeight, waves: &[Wave], events: &[WaveEvent]) -> f64 {
    let of = |w: &Wave| worst(events.iter().map(|(p, t)| (height(w, *p, *t) - truth(w, *p, *t)).abs()));
    worst(waves.iter().map(of))
}

fn sea(force: u8) -> Vec<Wave> {
    let force = BeaufortForce::new(force).unwrap_or(BeaufortForce::of_wind(0.0));
    let spec = WaveSpec { spectrum: Spectrum::of_force(force), wind_from: 0.7 };
    WaveField::new(&spec, 5).waves().to_vec()
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let waves = &sea(2);
    for (scene, events) in [
        ("force 2, within 200 m, first minute", events(200.0, 0.0, 60.0)),
        ("force 2, within 5 km, after a day", events(5e3, 86_400.0, 90_000.0)),
    ] {
        let events = &events;
        let ways = METHODS
            .iter()
            .map(|m| {
                let work = move || events.iter().map(|(p, t)| (m.run)(&waves[7], *p, *t)).sum::<f64>();
                m.way(error(m.run, waves, events), events.len(), work)
            })
            .collect();
        bench.scene(scene, "amplitudes", 1e-15, ways);
    }
    let ripple = Wave { amplitude_m: 1e-3, cycles_per_m: DVec2::new(60.0, 80.0), hz: 23.1, phase: 0.25 };
    let steady = |t: f64| (0..512).map(move |i| (DVec2::new(1e5, -1e5) * even(i), t)).collect();
    let cases: [(&str, Vec<Wave>, Vec<WaveEvent>); 5] = [
        ("force 1, within 100 km, after 30 days", sea(1), events(1e5, 2.592e6, 2.6e6)),
        ("force 8, within 100 km, after 30 days", sea(8), events(1e5, 2.592e6, 2.6e6)),
        ("ripple of 1 cm at 2 km, after an hour", vec![ripple], events(2e3, 3600.0, 3700.0)),
        ("origin at time 0", sea(4), vec![(DVec2::ZERO, 0.0)]),
        ("force 2, 141 km off, at time -1 day", sea(2), steady(-86_400.0)),
    ];
    for (case, waves, events) in cases {
        bench.extreme(case, "amplitudes", METHODS.map(|m| m.tried(error(m.run, &waves, &events))).into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exact_fraction_is_exact() {
        assert_eq!(exact_fraction(0.5, 3.0), 0.5);
        assert_eq!(exact_fraction(-0.25, 1.0), 0.75);
        assert_eq!(exact_fraction(4.0, 1e9), 0.0);
        // (1 + 2^-52) * 2^30 and a half, beyond what an f64 product holds.
        let (a, b) = (1.0 + f64::EPSILON, 1_073_741_824.5);
        let (whole, fraction) = (1_073_741_824.0, 0.5);
        assert_eq!(exact_fraction(a, b), fraction + (whole + fraction) * f64::EPSILON);
        assert_eq!(exact_fraction(2f64.powi(-100), 2f64.powi(-50)), 2f64.powi(-150));
    }
}
