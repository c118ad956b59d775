//! The soft contact shadow of section 4.5 on the quay.

use anyhow::Result;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    Exhibit, Figure, Line, Table, Workshop,
    quay::{Quay, picture_of},
};
use crate::{
    parts::ambient::{ContactRatio, Receiver, Stored, Surroundings, dot, kept_share},
    path_traced::{Kind, TracedLight},
};

/// Vertices of the phantom across and along, and the rectangle that they cover, metres.
const ACROSS: usize = 26;
const ALONG: usize = 18;
const LOW: [f64; 2] = [-6.5, 9.0];
const HIGH: [f64; 2] = [6.0, 18.0];

/// What the plane keeps of its light at each vertex.
type Kept = Vec<f64>;

/// That between vertices; 1 beyond them.
fn between(kept: &Kept, at: DVec3) -> f64 {
    let place = |v: f64, i: usize, count: usize| (v - LOW[i]) / (HIGH[i] - LOW[i]) * (count - 1) as f64;
    let (u, v) = (place(at.x, 0, ACROSS), place(at.y, 1, ALONG));
    if u < 0.0 || v < 0.0 || u >= (ACROSS - 1) as f64 || v >= (ALONG - 1) as f64 {
        return 1.0;
    }
    let (i, j) = (u as usize, v as usize);
    let (a, b) = (u.fract(), v.fract());
    let of = |i: usize, j: usize| kept[j * ACROSS + i];
    let row = |j: usize| of(i, j) * (1.0 - a) + of(i + 1, j) * a;
    row(j) * (1.0 - b) + row(j + 1) * b
}

fn vertices() -> Vec<(DVec3, DVec3)> {
    let at = |i: usize, k: usize, count: usize| LOW[k] + (HIGH[k] - LOW[k]) * i as f64 / (count - 1) as f64;
    (0..ACROSS * ALONG)
        .map(|i| (DVec3::new(at(i % ACROSS, 0, ACROSS), at(i / ACROSS, 1, ALONG), 2e-3), DVec3::Z))
        .collect()
}

/// Errors over the plane by order, and pictures.
pub fn exhibits(_: &Workshop) -> Result<Vec<Exhibit>> {
    let quay = Quay::new(true);
    let Some(boat) = quay.things.iter().find(|t| !t.is_real) else { return Ok(Vec::new()) };
    let sky = TracedLight::new(Kind::Clear, DVec3::new(0.8, 0.3, 0.45).normalize(), 0.9)?;
    // The sun's aureole stays in the sky, its disc does not: shadows of the disc are another row's.
    let around = [Surroundings::new(|d| if d.z > 0.0 { sky.sky(d) } else { Vec3::ZERO })];
    let places = vertices();
    let receiver = |boat, at| Receiver { boat, at };
    let bare = receiver(None, (DVec3::Z * 2e-3, DVec3::Z));
    let whole = bare.truth(&around)[0];
    let truth: Kept =
        places.par_iter().map(|at| receiver(Some(&boat.rays), *at).truth(&around)[0] / whole).collect();
    let none: Kept = vec![1.0; places.len()];
    let mut ways: Vec<(String, Kept)> = vec![("no contact shadow".into(), none)];
    for (order, is_windowed) in [(2, false), (4, false), (4, true)] {
        for (ratio, words) in
            [(ContactRatio::Each, "ratio of coefficients, as printed"), (ContactRatio::Sums, "ratio of sums")]
        {
            let stored = Stored::Harmonics(order, is_windowed);
            let (without, light) = (bare.stored(stored), around[0].coefficients(stored));
            let kept = places
                .par_iter()
                .map(|at| {
                    kept_share(&receiver(Some(&boat.rays), *at).stored(stored), &without, &light, ratio)
                })
                .collect();
            ways.push((
                format!("{words}, {order} bands{}", if is_windowed { ", windowed" } else { "" }),
                kept,
            ));
        }
    }
    let lines = ways.iter().map(|(way, kept)| {
        let off: Vec<f64> = kept.iter().zip(&truth).map(|(a, b)| a - b).collect();
        let rms = (off.iter().map(|v| v * v).sum::<f64>() / off.len() as f64).sqrt();
        let worst = off.iter().map(|v| v.abs()).fold(0.0, f64::max);
        Line::new([way.as_str().into(), rms.into(), worst.into()])
    });
    let table = Exhibit::Table(Table {
        caption: "Share of its light that the quay keeps with the virtual boat on it, against rays: clear sky, the sun's disc aside".into(),
        titles: vec!["way", "error, rms", "worst"],
        lines: lines.collect(),
    });
    let surfaces = quay.look(|_| true);
    let patches = Stored::Patches(96);
    let light = around[0].coefficients(patches);
    let own: Vec<f32> = surfaces
        .par_iter()
        .map(|s| match s {
            Some(s) if s.thing.is_some_and(|t| !quay.things[t].is_real) => {
                (dot(&receiver(Some(&boat.rays), (s.at + s.normal * 1e-3, s.normal)).stored(patches), &light)
                    / whole) as f32
            }
            Some(s) => 0.5 + 0.5 * s.normal.z as f32,
            None => 1.0,
        })
        .collect();
    let drawn = |kept: &Kept| {
        picture_of(|i| match surfaces[i] {
            None => Vec3::new(0.45, 0.56, 0.72),
            Some(s) if s.thing.is_none() => s.albedo * 1.4 * between(kept, s.at) as f32,
            Some(s) => s.albedo * 1.4 * own[i],
        })
    };
    let mut figures = vec![Figure::new(
        "Rays at each vertex",
        "a boat on a quay with a soft dark rim below it",
        &drawn(&truth),
    )?];
    for wanted in [
        "no contact shadow",
        "ratio of coefficients, as printed, 4 bands",
        "ratio of sums, 2 bands",
        "ratio of sums, 4 bands",
    ] {
        if let Some((way, kept)) = ways.iter().find(|(way, _)| way == wanted) {
            figures.push(Figure::new(
                way.clone(),
                "the same boat, its contact shadow by that way",
                &drawn(kept),
            )?);
        }
    }
    Ok(vec![table, Exhibit::Figures(figures)])
}
