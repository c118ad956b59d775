//! Frigate, 130 m: flush-decked hull with a raked stem, sloped superstructure, mast, funnel, gun and flight deck.

use bowwave_core::model::Zone;
use glam::Vec3;

use super::{
    assembly::Assembly,
    frigate_top,
    loft::{LinesPlan, Offsets, offsets},
    paint::Paint,
    solid::{Solid, skin},
};

/// Keel, bilge, water, knuckle, sheer and centre line.
const OFFSETS: Offsets<6, 8> = offsets(include_str!("frigate.txt"));

/// The whole ship.
pub(crate) fn build() -> Assembly {
    let mut ship = Assembly::default();
    // Gas turbines and diesels lie under the funnel; low hits there stop the ship.
    let (aft, fore, top) = (-20.0, 2.0, 3.0);
    let hull = hull();
    let marks = pennant(&hull);
    let hull = hull.cut(Vec3::X, aft).cut(Vec3::X, fore).cut(Vec3::Z, top);
    ship.add_by(hull, |p| if p.x > aft && p.x < fore && p.z < top { Zone::Engine } else { Zone::Hull });
    ship.add_all(Zone::Hull, marks);
    ship.add_all(Zone::Hull, bulwark_and_rails());
    ship.add_all(Zone::Hull, frigate_top::superstructure());
    ship.add_all(Zone::Hull, frigate_top::masts());
    ship.add_all(Zone::Hull, frigate_top::weapons());
    ship.add_all(Zone::Hull, frigate_top::flight_deck());
    ship.add_all(Zone::Engine, frigate_top::funnel());
    ship.add_all(Zone::Helm, frigate_top::bridge());
    ship
}

fn hull() -> Solid {
    let [keel, bilge, water, knuckle, sheer, centre] = &OFFSETS;
    LinesPlan {
        lines: &[keel, bilge, water, knuckle, sheer, centre],
        round: &[1, 2],
        rows: &[2, 2, 2, 1, 1, 0],
        paints: &[(Paint::Haze, 4), (Paint::DeckGrey, 2)],
        steps: 4,
        crease: 14.0,
        transom: Paint::Haze,
    }
    .build()
    .paint_below(0.75, Paint::BootTop)
    .paint_below(-0.45, Paint::Antifouling)
}

/// Stanchions with two wires along the deck's edge, where men work: forecastle and quarterdeck.
fn bulwark_and_rails() -> Vec<Solid> {
    let [_, _, _, _, sheer, _] = &OFFSETS;
    let mut solids = Vec::new();
    for side in [1.0, -1.0] {
        let edge: Vec<Vec3> =
            sheer.iter().map(|&[x, y, z]| Vec3::new(x, (y - 0.12).max(0.0) * side, z)).collect();
        for pair in [[edge[4], edge[5]], [edge[5], edge[6]], [edge[6], Vec3::new(63.6, 0.3 * side, 9.58)]] {
            for height in [0.55, 1.05] {
                let up = Vec3::Z * height;
                solids.push(super::solid::bar(pair[0] + up, pair[1] + up, 0.03, Paint::Haze));
            }
            for k in 0..4 {
                let foot = pair[0].lerp(pair[1], k as f32 / 4.0);
                solids.push(super::solid::bar(foot, foot + Vec3::Z * 1.05, 0.035, Paint::Haze));
            }
        }
    }
    solids
}

/// Segments of the digits 0 to 9 as seven-segment figures: top, upper left, upper right, middle, lower left, lower
/// right, bottom.
const DIGITS: [[bool; 7]; 10] = {
    const T: bool = true;
    const F: bool = false;
    [
        [T, T, T, F, T, T, T],
        [F, F, T, F, F, T, F],
        [T, F, T, T, T, F, T],
        [T, F, T, T, F, T, T],
        [F, T, T, T, F, T, F],
        [T, T, F, T, F, T, T],
        [T, T, F, T, T, T, T],
        [T, F, T, F, F, T, F],
        [T, T, T, T, T, T, T],
        [T, T, T, T, F, T, T],
    ]
};

/// The number painted on both bows and laid onto the plating.
fn pennant(hull: &Solid) -> Vec<Solid> {
    const NUMBER: [usize; 3] = [2, 3, 6];
    let (width, height, stroke, pitch) = (1.5, 2.6, 0.42, 2.2);
    let mut solids = Vec::new();
    for side in [1.0, -1.0] {
        for (place, &digit) in NUMBER.iter().enumerate() {
            // Read from left to right: towards the bow to starboard, towards the stern to port.
            let left = 44.0 - side * (place as f32 - 1.0) * pitch;
            let plate = |u0: f32, v0: f32, u1: f32, v1: f32| {
                let corner = |u: f32, v: f32, out: f32| {
                    let (x, z) = (left - side * (u - width / 2.0), 2.0 + v);
                    Vec3::new(x, side * (half_breadth(hull, x, z) + out), z)
                };
                let ring = |out: f32| {
                    [(u0, v0), (u1, v0), (u1, v1), (u0, v1)].map(|(u, v)| corner(u, v, out)).to_vec()
                };
                skin(&[ring(-0.05), ring(0.04)], Paint::Marking, 25.0)
            };
            let half = height / 2.0;
            let bars = [
                (0.0, height - stroke, width, height),
                (0.0, half, stroke, height),
                (width - stroke, half, width, height),
                (0.0, half - stroke / 2.0, width, half + stroke / 2.0),
                (0.0, 0.0, stroke, half),
                (width - stroke, 0.0, width, half),
                (0.0, 0.0, width, stroke),
            ];
            let lit = bars.iter().zip(DIGITS[digit]).filter(|(_, on)| *on);
            solids.extend(lit.map(|(&(u0, v0, u1, v1), _)| plate(u0, v0, u1, v1)));
        }
    }
    solids
}

/// Half breadth of the hull at a point of its profile, metres; zero outside the profile.
fn half_breadth(hull: &Solid, x: f32, z: f32) -> f32 {
    let mut best: f32 = 0.0;
    for t in &hull.tris {
        let [a, b, c] = t.p;
        let area = (b.x - a.x) * (c.z - a.z) - (c.x - a.x) * (b.z - a.z);
        if area.abs() < 1e-6 {
            continue;
        }
        let u = ((x - a.x) * (c.z - a.z) - (c.x - a.x) * (z - a.z)) / area;
        let v = ((b.x - a.x) * (z - a.z) - (x - a.x) * (b.z - a.z)) / area;
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
            best = best.max(a.y + (b.y - a.y) * u + (c.y - a.y) * v);
        }
    }
    best
}
