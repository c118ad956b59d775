//! The built-in boats: sizes, parts, closed and outward surfaces, after writing and loading.

#![allow(clippy::expect_used, reason = "a test helper, too, stops at the first thing that is wrong")]

use std::collections::HashMap;

use bowwave_core::model::{Model, Zone};
use bowwave_models::{Boat, build_glb, load_glb};
use glam::Vec3;

fn boats() -> Vec<(Boat, Model)> {
    Boat::ALL.into_iter().map(|b| (b, load_glb(&build_glb(b), b.name()).expect("loads"))).collect()
}

fn triangles(m: &Model) -> impl Iterator<Item = [Vec3; 3]> {
    m.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|k| m.vertices[t[k] as usize].position))
}

/// Length over all, beam, height, depth below water, length and beam on the water, each with its tolerance; most triangles.
struct Dimensions {
    over_all: [(f64, f64); 4],
    on_water: [(f64, f64); 2],
    triangles_max: usize,
}

fn dimensions(boat: Boat) -> Dimensions {
    match boat {
        Boat::Skiff => Dimensions {
            over_all: [(7.65, 0.1), (2.0, 0.1), (1.42, 0.1), (0.49, 0.06)],
            on_water: [(6.5, 0.25), (1.56, 0.1)],
            triangles_max: 4000,
        },
        Boat::Rhib => Dimensions {
            over_all: [(7.55, 0.1), (2.85, 0.1), (3.9, 0.1), (0.57, 0.06)],
            on_water: [(6.0, 0.25), (1.9, 0.1)],
            triangles_max: 4600,
        },
        Boat::Dhow => Dimensions {
            over_all: [(18.5, 0.3), (5.2, 0.2), (9.4, 0.2), (1.42, 0.1)],
            on_water: [(14.5, 0.5), (4.7, 0.2)],
            triangles_max: 5000,
        },
        Boat::Frigate => Dimensions {
            over_all: [(130.3, 0.6), (15.6, 1.0), (36.6, 0.5), (4.95, 0.1)],
            on_water: [(121.8, 0.6), (14.9, 0.2)],
            triangles_max: 6000,
        },
    }
}

#[test]
fn sizes_are_those_of_the_real_thing() {
    for (boat, m) in boats() {
        let want = dimensions(boat);
        let got = [m.length_m(), m.beam_m(), m.height_m(), -f64::from(m.min.z)];
        for (got, (want, tolerance)) in got.into_iter().zip(want.over_all) {
            assert!((got - want).abs() <= tolerance, "{boat:?}: {got} instead of {want}");
        }
        let extent = |f: fn(&glam::DVec2) -> f64| {
            let all = m.waterline.iter().map(f);
            all.clone().fold(f64::MIN, f64::max) - all.fold(f64::MAX, f64::min)
        };
        for (got, (want, tolerance)) in [extent(|p| p.x), extent(|p| p.y)].into_iter().zip(want.on_water) {
            assert!((got - want).abs() <= tolerance, "{boat:?}: {got} instead of {want} on the water");
        }
        assert!(m.indices.len() / 3 <= want.triangles_max, "{boat:?}: {} triangles", m.indices.len() / 3);
        assert_eq!(m.name, boat.name());
    }
}

#[test]
fn parts_cover_all_triangles_once() {
    for (boat, m) in boats() {
        let mut next = 0;
        for part in &m.parts {
            assert_eq!(part.indices.start, next, "{boat:?}");
            assert!(part.indices.end > next && part.indices.end.is_multiple_of(3), "{boat:?}");
            next = part.indices.end;
        }
        assert_eq!(next as usize, m.indices.len(), "{boat:?}");
        assert_eq!(m.parts.iter().map(|p| p.zone).collect::<Vec<_>>(), Zone::ALL, "{boat:?}");
        assert!(m.indices.iter().all(|&i| (i as usize) < m.vertices.len()));
    }
}

#[test]
fn the_outline_on_the_water_is_convex_and_within_the_box() {
    for (boat, m) in boats() {
        let n = m.waterline.len();
        assert!(n >= 6, "{boat:?}: {n} corners");
        for i in 0..n {
            let [a, b, c] = [0, 1, 2].map(|k| m.waterline[(i + k) % n]);
            assert!((b - a).perp_dot(c - b) > 0.0, "{boat:?}: not convex at {b}");
            assert!(b.x >= f64::from(m.min.x) && b.x <= f64::from(m.max.x), "{boat:?}");
        }
        // As wide to port as to starboard.
        let (port, star) = m.waterline.iter().fold((0.0_f64, 0.0_f64), |a, p| (a.0.max(p.y), a.1.min(p.y)));
        assert!((port + star).abs() < 1e-3, "{boat:?}: {port} {star}");
    }
}

#[test]
fn corners_are_finite_and_lit_from_outside() {
    for (boat, m) in boats() {
        for v in &m.vertices {
            assert!(v.position.is_finite() && (v.normal.length() - 1.0).abs() < 1e-3, "{boat:?} {v:?}");
            assert!(v.albedo.min_element() > 0.0 && v.albedo.max_element() < 0.9, "{boat:?} {v:?}");
        }
        for t in m.indices.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|k| m.vertices[t[k] as usize]);
            let face = (b.position - a.position).cross(c.position - a.position);
            assert!(face.length() > 1e-8, "{boat:?}: triangle without area at {}", a.position);
            for v in [a, b, c] {
                let cos = v.normal.dot(face.normalize());
                assert!(
                    cos > 0.05,
                    "{boat:?}: normal {} against its face at {} ({cos})",
                    v.normal,
                    v.position
                );
            }
        }
    }
}

/// A corner in steps of 0.1 mm.
type CornerKey = (i64, i64, i64);

/// Triangles by the closed piece that they belong to: pieces share no corner.
fn pieces(m: &Model) -> HashMap<usize, Vec<[CornerKey; 3]>> {
    let key = |p: Vec3| {
        let k = |v: f32| (f64::from(v) * 1e4).round() as i64;
        (k(p.x), k(p.y), k(p.z))
    };
    let mut id = HashMap::new();
    let mut parent: Vec<usize> = Vec::new();
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    for t in triangles(m) {
        let ids = t.map(|p| {
            *id.entry(key(p)).or_insert_with(|| {
                parent.push(parent.len());
                parent.len() - 1
            })
        });
        let r = ids.map(|i| root(&mut parent, i));
        parent[r[1]] = r[0];
        let r2 = root(&mut parent, ids[2]);
        parent[r2] = root(&mut parent, ids[0]);
    }
    let mut out: HashMap<usize, Vec<_>> = HashMap::new();
    for t in triangles(m) {
        let piece = root(&mut parent, id[&key(t[0])]);
        out.entry(piece).or_default().push(t.map(key));
    }
    out
}

#[test]
fn every_piece_is_closed_and_holds_a_volume() {
    for (boat, m) in boats() {
        let pieces = pieces(&m);
        assert!(pieces.len() > 20, "{boat:?}: {} pieces", pieces.len());
        for piece in pieces.values() {
            let mut edges: HashMap<_, i32> = HashMap::new();
            for t in piece {
                for k in 0..3 {
                    let (a, b) = (t[k], t[(k + 1) % 3]);
                    *edges.entry(if a < b { (a, b) } else { (b, a) }).or_default() +=
                        if a < b { 1 } else { -1 };
                }
            }
            let open: Vec<_> = edges.iter().filter(|(_, n)| **n != 0).collect();
            assert!(
                open.is_empty(),
                "{boat:?}: {} open edges of {}, such as {:?}",
                open.len(),
                edges.len(),
                open[0]
            );
            let at = |(x, y, z): CornerKey| glam::DVec3::new(x as f64, y as f64, z as f64) * 1e-4;
            let origin = at(piece[0][0]);
            let volume: f64 = piece
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|k| at(k) - origin);
                    a.dot(b.cross(c)) / 6.0
                })
                .sum();
            assert!(volume > 1e-7, "{boat:?}: piece at {origin} holds {volume} m3");
        }
    }
}

/// Distance along a ray to a triangle and whether its front is struck.
fn strike(from: Vec3, along: Vec3, t: [Vec3; 3]) -> Option<(f32, bool)> {
    let (e1, e2) = (t[1] - t[0], t[2] - t[0]);
    let p = along.cross(e2);
    let det = e1.dot(p);
    if det.abs() < 1e-9 {
        return None;
    }
    let s = from - t[0];
    let (u, q) = (s.dot(p) / det, s.cross(e1));
    let v = along.dot(q) / det;
    let d = e2.dot(q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && d > 0.0).then_some((d, det > 0.0))
}

#[test]
fn a_shot_from_outside_strikes_a_front() {
    for (boat, m) in boats() {
        let (size, middle) = (m.max - m.min, (m.max + m.min) / 2.0);
        let mut struck = 0;
        for i in 0..240 {
            // Points spread over the box by two irrational steps, from all around.
            let share = |step: f32| (i as f32 * step).fract() - 0.5;
            let at =
                middle + size * Vec3::new(share(0.618_034), share(0.754_878) * 0.8, share(0.569_84) * 0.5);
            let (sin, cos) = (i as f32 * 2.399_963).sin_cos();
            let from = at + Vec3::new(cos, sin, 0.3 + share(0.31)) * 3.0 * size.x;
            let along = (at - from).normalize();
            let nearest =
                triangles(&m).filter_map(|t| strike(from, along, t)).min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, front)) = nearest {
                assert!(front, "{boat:?}: a back is seen from {from} towards {at}");
                struck += 1;
            }
        }
        assert!(struck > 60, "{boat:?}: {struck} of 240 rays struck");
    }
}

#[test]
fn parts_lie_where_they_belong() {
    let middle = |m: &Model, zone: Zone| {
        let part = m.parts.iter().find(|p| p.zone == zone).expect("part");
        let used = &m.indices[part.indices.start as usize..part.indices.end as usize];
        used.iter().map(|&i| m.vertices[i as usize].position).sum::<Vec3>() / used.len() as f32
    };
    for (boat, m) in boats() {
        let (engine, helm) = (middle(&m, Zone::Engine), middle(&m, Zone::Helm));
        assert!(engine.x < 0.0 && engine.y.abs() < 0.2 * m.beam_m() as f32, "{boat:?}: engine at {engine}");
        assert!(helm.z > 0.5 && helm.z > engine.z, "{boat:?}: helm at {helm}, engine at {engine}");
        // The bow is pointed and ahead: the foremost hull point lies near the centre line.
        let foremost =
            m.vertices.iter().max_by(|a, b| a.position.x.total_cmp(&b.position.x)).expect("vertices");
        assert!(foremost.position.y.abs() < 0.12 * m.beam_m() as f32, "{boat:?}: {}", foremost.position);
    }
}

#[test]
fn the_same_bytes_every_time() {
    for boat in Boat::ALL {
        let bytes = build_glb(boat);
        assert_eq!(bytes, build_glb(boat));
        assert_eq!(&bytes[..4], b"glTF");
        assert!(bytes.len().is_multiple_of(4) && bytes.len() < 1 << 20, "{boat:?}: {} bytes", bytes.len());
    }
}
