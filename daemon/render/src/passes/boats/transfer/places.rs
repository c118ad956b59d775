//! Places all over a boat's surface.

use bowwave_core::model::{Model, Vertex};
use glam::Vec3;

use super::{DARK, Transfer, fit::Seat};
use crate::passes::boats::parts::triangles;

/// A place on the surface: what it sees is seen about its triangle's corners by their shares.
#[derive(Clone)]
pub(super) struct Place {
    pub(super) at: Seat,
    /// Area that it stands for, over that of the mean place.
    pub(super) weight: f32,
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    /// The model's triangle on which it lies, and the piece of it.
    pub(super) face: u32,
    pub(super) piece: u32,
    /// On the side of the normal and on the other: the light that it gets...
    pub(super) light: [Transfer; 2],
    /// ...and whether nobody sees it: it lies within another part of the boat, or on the inside of a closed one.
    pub(super) hidden: [bool; 2],
}

impl Place {
    /// The `number`th place of a triangle, in Roberts' sequence: evenly spread for any count.
    pub(super) fn of(vertices: &[Vertex], triangle: [u32; 3], number: usize) -> Option<Self> {
        let fraction = |step: f64| (0.5 + step * number as f64).fract() as f32;
        let (u, v) = (fraction(0.754_877_666_246_692_8).sqrt(), fraction(0.569_840_290_998_053_3));
        let shares = [1.0 - u, u * (1.0 - v), u * v];
        let [a, b, c] = triangle.map(|i| vertices.get(i as usize));
        let corners = [a?, b?, c?];
        let mix = |of: fn(&Vertex) -> Vec3| (0..3).map(|k| of(corners[k]) * shares[k]).sum::<Vec3>();
        Some(Self {
            at: Seat { corners: triangle.map(|i| i as usize), shares },
            weight: 1.0,
            position: mix(|v| v.position),
            normal: mix(|v| v.normal).normalize_or(corners[0].normal),
            face: 0,
            piece: 0,
            light: [DARK; 2],
            hidden: [false; 2],
        })
    }
}

/// Areas of triangles over that of them all.
pub(super) fn area_shares(vertices: &[Vertex], triangles: &[[u32; 3]]) -> Vec<f32> {
    let at = |i: u32| vertices.get(i as usize).map_or(Vec3::ZERO, |v| v.position);
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(at);
        (b - a).cross(c - a).length()
    };
    let mut areas: Vec<f32> = triangles.iter().map(area).collect();
    let whole = areas.iter().sum::<f32>().max(f32::MIN_POSITIVE);
    areas.iter_mut().for_each(|area| *area /= whole);
    areas
}

/// Gives each place the weight of its share of its triangle.
pub(super) fn weigh(vertices: &[Vertex], triangles: &[[u32; 3]], places: &mut [Place]) {
    let shares = area_shares(vertices, triangles);
    let mut counts = vec![0.0_f32; triangles.len()];
    places.iter().for_each(|place| counts[place.piece as usize] += 1.0);
    let all = places.len() as f32;
    for place in places {
        let piece = place.piece as usize;
        place.weight = all * shares[piece] / counts[piece];
    }
}

/// Places all over the surface: more on large triangles, one on each at least.
pub(super) fn places(model: &Model) -> Vec<Place> {
    /// About so many on the whole, and at most so many on a triangle.
    const ALL: f32 = 6000.0;
    const MOST: f32 = 16.0;
    let triangles = triangles(&model.indices);
    let mut found = Vec::new();
    for ((piece, triangle), share) in (0..).zip(&triangles).zip(area_shares(&model.vertices, &triangles)) {
        let count = (share * ALL).clamp(1.0, MOST) as usize;
        let on_it = (0..count).filter_map(|number| Place::of(&model.vertices, *triangle, number));
        found.extend(on_it.map(|place| Place { face: piece, piece, ..place }));
    }
    weigh(&model.vertices, &triangles, &mut found);
    found
}
