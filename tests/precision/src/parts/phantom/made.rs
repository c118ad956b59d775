//! Outlines of models whose silhouette is known, and planes of measured points.

use std::f64::consts::TAU;

use bowwave_calibration::{
    outline::outlines_of,
    plane::{MARKED_PX, PlaneError, PlaneFrame, PlaneView, SeenPoint},
};
use bowwave_core::{
    geometry::{Distortion, Lens},
    own_ship::Phantom,
};
use glam::{DMat3, DQuat, DVec2, DVec3};
use hw_sim::ocean::random::gauss_pair;
use nalgebra::{DMatrix, SMatrix};

use super::super::rms;
use crate::bench::{ExtremeResult, PartBench};

/// Facets of the tube.
const FACETS: u32 = 256;
/// Times that points of a plane are marked.
const MARKED: u64 = 200;

fn bent() -> Lens {
    let distortion = Distortion::radial_tangential(DVec2::new(-0.25, 0.06), DVec2::new(1e-3, -5e-4));
    Lens { distortion, ..Lens::pinhole(1280, 720, 1.2) }
}

/// A solid before the camera.
struct Solid {
    name: &'static str,
    triangles: Vec<[DVec3; 3]>,
    /// Points whose hull, as seen from the camera, is the silhouette.
    extremes: Vec<DVec3>,
}

fn block() -> Solid {
    let turn = DQuat::from_rotation_y(0.5) * DQuat::from_rotation_x(0.3);
    let corner = |i: usize| {
        let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        DVec3::new(0.05, 0.08, 1.1)
            + turn * (DVec3::new(0.28, 0.12, 0.2) * DVec3::new(sign(0), sign(1), sign(2)))
    };
    let sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let triangles =
        sides.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).map(|t| t.map(corner));
    Solid { name: "box", triangles: triangles.collect(), extremes: (0..8).map(corner).collect() }
}

fn tube() -> Solid {
    let on = |share: f64, z: f64| {
        let (sin, cos) = (TAU * share).sin_cos();
        DVec3::new(0.04 * cos, 0.16 + 0.04 * sin, z)
    };
    let facet = |i: u32| f64::from(i % FACETS) / f64::from(FACETS);
    let triangles = (0..FACETS).flat_map(|i| {
        let [a, b, c, d] =
            [on(facet(i), 0.7), on(facet(i + 1), 0.7), on(facet(i + 1), 1.8), on(facet(i), 1.8)];
        let [near, far] = [DVec3::new(0.0, 0.16, 0.7), DVec3::new(0.0, 0.16, 1.8)];
        [[a, b, c], [a, c, d], [a, b, near], [d, c, far]]
    });
    let circle = |z: f64| (0..20_000).map(move |i| on(f64::from(i) / 20_000.0, z));
    Solid { name: "tube", triangles: triangles.collect(), extremes: circle(0.7).chain(circle(1.8)).collect() }
}

/// The convex hull of places (Andrew 1979).
fn hull(mut places: Vec<DVec2>) -> Vec<DVec2> {
    fn chain(places: impl Iterator<Item = DVec2>) -> Vec<DVec2> {
        let mut chain: Vec<DVec2> = Vec::new();
        for p in places {
            while let [.., a, b] = chain[..]
                && (b - a).perp_dot(p - b) <= 0.0
            {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    }
    places.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut hull = chain(places.iter().copied());
    hull.extend(chain(places.iter().rev().copied()));
    hull
}

/// Outlines of models: the product's, and the hull of the corners joined by straight lines, as a drawing of polygons in pixels has it.
pub fn models(bench: &mut PartBench) {
    for solid in [block(), tube()] {
        for (kind, lens) in [("no distortion", Lens::pinhole(1280, 720, 1.2)), ("k1 = -0.25", bent())] {
            // Straight lines of the undistorted view are the silhouette's; the lens bends places along them.
            let edge = hull(solid.extremes.iter().map(|p| p.truncate() / p.z).collect());
            let truth: Vec<DVec2> = edge
                .iter()
                .zip(edge.iter().cycle().skip(1))
                .flat_map(|(a, b)| {
                    let steps = (a.distance(*b) * lens.focal.x).ceil().max(1.0) as u32;
                    (0..steps).map(move |i| a.lerp(*b, f64::from(i) / f64::from(steps)))
                })
                .filter_map(|p| lens.project(p.extend(1.0)))
                .collect();
            let off = |outlines: &[Phantom]| {
                let nearest =
                    |at: &DVec2| outlines.iter().map(|p| p.distance(*at).abs()).fold(f64::INFINITY, f64::min);
                rms(truth.iter().map(nearest))
            };
            let found = outlines_of(&lens, solid.name, solid.triangles.iter().copied());
            let corners = solid.triangles.iter().flatten().filter_map(|p| lens.project(*p)).collect();
            let straight = Phantom::new("straight", hull(corners), (1280, 720));
            let count = found.phantoms.first().map_or(0, |p| p.outline().len());
            bench.extreme(
                &format!("outline of a {}, {kind}", solid.name),
                "px rms",
                vec![
                    ExtremeResult::product("sides followed through the lens", "", off(&found.phantoms))
                        .note(format!("{count} corners")),
                    ExtremeResult::rival("corners joined by straight lines", "", off(&[straight])),
                ],
            );
        }
    }
}

/// Measured points of a plate, metres: its corners and two more.
const PLATE: [[f64; 2]; 6] =
    [[-0.2, -0.15], [0.2, -0.15], [0.2, 0.15], [-0.2, 0.15], [-0.05, 0.02], [0.1, -0.06]];

/// The direct linear transform as printed, in pixels and metres (Hughes, Konttinen and Pattanaik 2004, section 5, solves the inverse of the same
/// equations): homography and condition number.
fn as_printed(pairs: &[(DVec2, DVec2)]) -> (DMat3, f64) {
    let rows = pairs.iter().flat_map(|(a, b)| {
        [
            [a.x, a.y, 1.0, 0.0, 0.0, 0.0, -b.x * a.x, -b.x * a.y, -b.x],
            [0.0, 0.0, 0.0, a.x, a.y, 1.0, -b.y * a.x, -b.y * a.y, -b.y],
        ]
    });
    let equations = DMatrix::from_row_iterator(2 * pairs.len(), 9, rows.flatten());
    let decomposed = equations.svd(false, true);
    let mut order: Vec<usize> = (0..decomposed.singular_values.len()).collect();
    order.sort_by(|a, b| decomposed.singular_values[*b].total_cmp(&decomposed.singular_values[*a]));
    let least = order[order.len() - 1];
    let condition = decomposed.singular_values[order[0]] / decomposed.singular_values[order[order.len() - 2]];
    let h = decomposed.v_t.map_or([f64::NAN; 9], |v| std::array::from_fn(|i| v[(least, i)]));
    let h = SMatrix::<f64, 3, 3>::from_row_slice(&h);
    (DMat3::from_cols_array(&std::array::from_fn(|i| h[(i % 3, i / 3)])), condition)
}

/// Planes from facing the camera to edge-on, their points marked with an error of half a pixel.
pub fn planes(bench: &mut PartBench) {
    let lens = bent();
    for tilt in [0.0, 30.0, 60.0, 75.0, 80.0, 85.0, 88.0, 89.0, 89.5, 89.9_f64] {
        let (sin, cos) = tilt.to_radians().sin_cos();
        let frame = PlaneFrame { origin: DVec3::Z, right: DVec3::X, up: DVec3::new(0.0, -cos, sin) };
        let truth: Vec<SeenPoint> = PLATE
            .iter()
            .map(|p| DVec2::from_array(*p))
            .filter_map(|plane| Some(SeenPoint { pixel: lens.project(frame.at(plane))?, plane }))
            .collect();
        let pixels: Vec<DVec2> = truth.iter().map(|p| p.pixel).collect();
        // Undistorted pixels about the principal point, as a lens without distortion would show them.
        let straight = |pixel: DVec2| {
            let ray = lens.unproject(pixel);
            ray.truncate() / ray.z * lens.focal + lens.centre
        };
        let exact: Vec<(DVec2, DVec2)> = truth.iter().map(|p| (p.plane, straight(p.pixel))).collect();
        let (_, printed_condition) = as_printed(&exact);
        let (mut own, mut printed, mut taken) = (Vec::new(), Vec::new(), 0_u64);
        for run in 0..MARKED {
            let noise = |i: usize| DVec2::from_array(gauss_pair(run, &[i as i64])) * MARKED_PX;
            let marked: Vec<SeenPoint> = truth
                .iter()
                .enumerate()
                .map(|(i, p)| SeenPoint { pixel: p.pixel + noise(i), ..*p })
                .collect();
            let pairs: Vec<_> = marked.iter().map(|p| (p.plane, straight(p.pixel))).collect();
            let plane_from_seen = as_printed(&pairs).0.inverse();
            let back = |pixel: &DVec2| {
                let place = plane_from_seen * straight(*pixel).extend(1.0);
                place.truncate() / place.z
            };
            printed
                .extend(pixels.iter().zip(&truth).map(|(pixel, t)| 1000.0 * back(pixel).distance(t.plane)));
            if let Ok(places) = PlaneView::new(&lens, &marked).and_then(|view| view.places(&pixels)) {
                taken += 1;
                own.extend(places.iter().zip(&truth).map(|(place, t)| 1000.0 * place.distance(t.plane)));
            }
        }
        let printed = ExtremeResult::rival("direct linear transform as printed", "", rms(printed))
            .note(format!("condition {printed_condition:.0}"));
        match PlaneView::new(&lens, &truth) {
            Ok(view) => {
                let [condition, most] = view.condition();
                let own = ExtremeResult::product("normalised, bounded", "", rms(own))
                    .note(format!("condition {condition:.1}, at most {most:.0}"));
                bench.extreme(
                    &format!("plate of .4 by .3 m turned by {tilt} deg"),
                    "mm rms",
                    vec![own, printed],
                );
            }
            Err(error) => {
                let words = match &error {
                    PlaneError::Condition { condition, most, .. } => {
                        format!("refused: condition {condition:.1}, at most {most:.0}")
                    }
                    other => format!("refused: {other}"),
                };
                let share = taken as f64 / MARKED as f64;
                bench.extreme(
                    &format!("plate of .4 by .3 m turned by {tilt} deg must be refused"),
                    "share that is not",
                    vec![ExtremeResult::product("normalised, bounded", "", share).note(words)],
                );
                bench.extreme(
                    &format!("plate of .4 by .3 m turned by {tilt} deg, not refused"),
                    "mm rms",
                    vec![printed],
                );
            }
        }
    }
}
