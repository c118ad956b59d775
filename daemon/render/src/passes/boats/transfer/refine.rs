//! More corners where a triangle's own hold too little of the light on it: where one part of a boat meets another, or keeps the sky off it.

use std::collections::{HashMap, HashSet};

use bowwave_core::model::{Model, ModelKind, Vertex};
use glam::Vec3;

use super::{
    DARK, SEA, Transfer,
    fit::Seat,
    fit_side,
    lighting::Lighting,
    places::{Place, area_shares, weigh},
};
use crate::passes::boats::parts::{WELD_M, spot, triangles};

/// More triangles of the finer surface at most: a share of the model's, but so many for a simple model, and no more for one that is large.
const MORE: f32 = 0.5;
const MORE_OF_FEW: usize = 400;
const MORE_OF_MANY: usize = 8000;
/// Times that triangles are cut; each time as many as a share of what may still come.
const ROUNDS: u32 = 12;
const ROUND_SHARE: f32 = 0.35;
/// What corners may err by unpunished: the uncertainty of a place's own light.
const UNSEEN: f32 = 0.03;
/// Edges shorter than the boat's extent over this stay whole.
const SHORTEST: f32 = 500.0;
/// Places on a triangle at least: so many, but not denser than that would be on the whole boat.
const PLACES: usize = 4;
const DENSITY: f32 = 20_000.0;

/// An edge by where it ends, so that triangles on both sides of a seam share it.
type Edge = [[i32; 3]; 2];

/// A boat's surface in triangles that hold its light.
pub(super) struct Surface {
    pub(super) vertices: Vec<Vertex>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// The model's triangles of which these are pieces.
    faces: Vec<u32>,
    /// What corners hold, by side.
    pub(super) held: [Vec<Transfer>; 2],
}

impl Surface {
    /// Cuts the triangles of `model` at their longest edges where corners err most against `places`, to which more are added.
    pub(super) fn finer(model: &Model, lighting: &Lighting, places: &mut Vec<Place>) -> Self {
        let triangles = triangles(&model.indices);
        let dark = vec![DARK; model.vertices.len()];
        let faces = (0..triangles.len() as u32).collect();
        let mut made =
            Self { vertices: model.vertices.clone(), triangles, faces, held: [dark.clone(), dark] };
        let more = (MORE * made.triangles.len() as f32) as usize;
        let most = made.triangles.len() + more.clamp(MORE_OF_FEW, MORE_OF_MANY);
        // Halves of an edge must not be welded into one.
        let shortest_m = ((model.max - model.min).max_element() / SHORTEST).max(10.0 * WELD_M);
        let rounds = if model.kind == ModelKind::Mesh { ROUNDS } else { 0 };
        for _ in 0..rounds {
            let marked = made.worst(places, most, shortest_m);
            if marked.is_empty() {
                break;
            }
            made.cut(&marked, places);
            made.add_places(lighting, places);
        }
        made
    }

    /// The longest edges of the triangles whose corners err most.
    fn worst(&mut self, places: &[Place], most: usize, shortest_m: f32) -> HashSet<Edge> {
        let mut errors = vec![0.0_f32; self.triangles.len()];
        for side in 0..2 {
            let held = &mut self.held[side];
            fit_side(places.iter().map(|place| (place.at, place.weight, place)), side, held);
            for place in places.iter().filter(|place| !place.hidden[side]) {
                let off = apart(&place.at.mix(held), &place.light[side]);
                errors[place.piece as usize] += place.weight * (off - UNSEEN).max(0.0);
            }
        }
        let mut worst: Vec<usize> = (0..errors.len()).filter(|i| errors[*i] > 0.0).collect();
        worst.sort_by(|a, b| errors[*b].total_cmp(&errors[*a]));
        // Each edge has two triangles as a rule, and is worth cutting for some.
        let room = most.saturating_sub(self.triangles.len()) as f32;
        worst.truncate((0.5 * ROUND_SHARE * room).ceil() as usize);
        let longest = worst.into_iter().filter_map(|triangle| {
            let [a, b, c] = self.triangles[triangle];
            let length = |(a, b): (u32, u32)| self.at(a).distance(self.at(b));
            let edges = [(a, b), (b, c), (c, a)];
            let longest = edges.into_iter().max_by(|a, b| length(*a).total_cmp(&length(*b)))?;
            (length(longest) >= shortest_m).then(|| self.edge(longest))
        });
        longest.collect()
    }

    fn at(&self, corner: u32) -> Vec3 {
        self.vertices[corner as usize].position
    }

    fn edge(&self, (a, b): (u32, u32)) -> Edge {
        let mut ends = [a, b].map(|i| spot(self.at(i)).to_array());
        ends.sort_unstable();
        ends
    }

    /// Halves edges, and all triangles that have one of them: none keeps a corner of others in the middle of an edge.
    fn cut(&mut self, marked: &HashSet<Edge>, places: &mut [Place]) {
        let mut on_them: Vec<Vec<&mut Place>> = self.triangles.iter().map(|_| Vec::new()).collect();
        for place in places {
            on_them[place.piece as usize].push(place);
        }
        let mut middles = HashMap::new();
        let (triangles, faces) = (std::mem::take(&mut self.triangles), std::mem::take(&mut self.faces));
        let mut left: Vec<_> = triangles.into_iter().zip(faces).zip(on_them).rev().collect();
        while let Some(((triangle, face), on_it)) = left.pop() {
            let [a, b, c] = triangle;
            let turned = [[a, b, c], [b, c, a], [c, a, b]];
            let length = |t: &[u32; 3]| self.at(t[0]).distance(self.at(t[1]));
            let cut = turned.into_iter().filter(|t| marked.contains(&self.edge((t[0], t[1]))));
            let Some([a, b, c]) = cut.max_by(|s, t| length(s).total_cmp(&length(t))) else {
                let piece = self.triangles.len() as u32;
                on_it.into_iter().for_each(|place| place.piece = piece);
                self.triangles.push(triangle);
                self.faces.push(face);
                continue;
            };
            let middle = *middles.entry((a.min(b), a.max(b))).or_insert_with(|| self.add_middle(a, b));
            let (mut first, mut second) = (Vec::new(), Vec::new());
            for place in on_it {
                let (seat, is_first) = half(&place.at, [a, b, c], middle);
                place.at = seat;
                if is_first { first.push(place) } else { second.push(place) }
            }
            left.push((([middle, b, c], face), second));
            left.push((([a, middle, c], face), first));
        }
    }

    /// A corner half way between two, with half of each one's light.
    fn add_middle(&mut self, a: u32, b: u32) -> u32 {
        // The same from both sides of the edge, to the last bit.
        let (a, b) = (a.min(b) as usize, a.max(b) as usize);
        let (one, other) = (&self.vertices[a], &self.vertices[b]);
        let middle = Vertex {
            position: one.position.midpoint(other.position),
            normal: one.normal.midpoint(other.normal).normalize_or(one.normal),
            uv: one.uv.midpoint(other.uv),
            albedo: one.albedo.midpoint(other.albedo),
        };
        self.vertices.push(middle);
        for held in &mut self.held {
            held.push(std::array::from_fn(|i| 0.5 * (held[a][i] + held[b][i])));
        }
        self.vertices.len() as u32 - 1
    }

    /// Adds places to triangles that have few for their size.
    fn add_places(&self, lighting: &Lighting, places: &mut Vec<Place>) {
        let shares = area_shares(&self.vertices, &self.triangles);
        let mut counts = vec![0; self.triangles.len()];
        places.iter().for_each(|place| counts[place.piece as usize] += 1);
        let mut added = Vec::new();
        for (piece, triangle) in self.triangles.iter().enumerate() {
            let wanted = ((shares[piece] * DENSITY).ceil() as usize).clamp(1, PLACES);
            for number in counts[piece]..wanted {
                // From elsewhere in the sequence than what the triangle was before it was cut.
                let place = Place::of(&self.vertices, *triangle, number + 7 * piece);
                added.extend(place.map(|place| Place {
                    piece: piece as u32,
                    face: self.faces[piece],
                    ..place
                }));
            }
        }
        lighting.light(&mut added);
        places.append(&mut added);
        weigh(&self.vertices, &self.triangles, places);
    }
}

/// Where a place sits when the edge between the first two corners of its triangle is halved, and whether that is the first corner's half.
fn half(seat: &Seat, [a, b, c]: [u32; 3], middle: u32) -> (Seat, bool) {
    let share = |corner: u32| {
        let shares = seat.corners.iter().zip(seat.shares);
        shares.filter(|(at, _)| **at == corner as usize).map(|(_, share)| share).sum::<f32>()
    };
    let (of_a, of_b, of_c) = (share(a), share(b), share(c));
    let [a, b, c, middle] = [a, b, c, middle].map(|i| i as usize);
    if of_a >= of_b {
        (Seat { corners: [a, middle, c], shares: [of_a - of_b, 2.0 * of_b, of_c] }, true)
    } else {
        (Seat { corners: [middle, b, c], shares: [2.0 * of_a, of_b - of_a, of_c] }, false)
    }
}

/// How far light of two kinds is apart where the sky is as bright as it is, a third brighter on one side, and the sea a third as bright.
fn apart(a: &Transfer, b: &Transfer) -> f32 {
    const PARTS: [(usize, f32); 5] = [(0, 1.0), (1, 0.3), (2, 0.3), (3, 0.3), (SEA, 0.3)];
    PARTS.iter().map(|(i, times)| times * (a[*i] - b[*i]).abs()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::passes::boats::transfer::places::places;
    use crate::testing;

    fn finer(model: &Model) -> (Surface, Vec<Place>) {
        let mut places = places(model);
        let lighting = Lighting::of(model, vec![false; model.indices.len() / 3], &mut places);
        (Surface::finer(model, &lighting, &mut places), places)
    }

    /// A plate with a box that stands on its middle.
    fn plate_and_box() -> Model {
        let mut model = testing::box_model("box", [1.0, 1.0, 1.5], [0.0; 3]);
        let plate = testing::box_model("plate", [8.0, 8.0, 0.2], [0.0; 3]);
        let shift = model.min.z - plate.max.z;
        let first = model.vertices.len() as u32;
        model
            .vertices
            .extend(plate.vertices.iter().map(|v| Vertex { position: v.position + shift * Vec3::Z, ..*v }));
        model.indices.extend(plate.indices.iter().map(|i| i + first));
        (model.min, model.max) =
            (plate.min + shift * Vec3::Z, Vec3::new(plate.max.x, plate.max.y, model.max.z));
        model
    }

    #[test]
    fn triangles_get_small_where_light_changes_and_corners_then_hold_it() {
        let model = plate_and_box();
        let off = |places: &[Place], held: &mut [Transfer]| {
            fit_side(places.iter().map(|place| (place.at, place.weight, place)), 0, held);
            let seen = places.iter().filter(|p| !p.hidden[0]);
            let sums = seen.fold([0.0, 0.0], |[off, all], p| {
                [off + p.weight * apart(&p.at.mix(held), &p.light[0]), all + p.weight]
            });
            sums[0] / sums[1]
        };
        let mut coarse = places(&model);
        Lighting::of(&model, vec![false; model.indices.len() / 3], &mut coarse);
        let before = off(&coarse, &mut vec![DARK; model.vertices.len()]);
        let (mut surface, places) = finer(&model);
        let after = off(&places, &mut surface.held[0]);
        println!(
            "{before} with {} triangles, {after} with {}",
            model.indices.len() / 3,
            surface.triangles.len()
        );
        assert!(after < 0.5 * before, "{after} of {before}");
        // None of them far from the box.
        let near = |t: &[u32; 3]| t.iter().any(|i| surface.at(*i).truncate().abs().max_element() < 2.0);
        let near = surface.triangles.iter().filter(|t| near(t)).count();
        assert!(near > surface.triangles.len() * 2 / 3, "{near} of {}", surface.triangles.len());
    }

    #[test]
    fn where_light_is_even_a_surface_stays_as_it_is() {
        let model = testing::box_model("box", [4.0, 2.0, 1.5], [0.5; 3]);
        let (surface, _) = finer(&model);
        assert_eq!((surface.triangles.len(), surface.vertices.len()), (12, 24));
    }

    #[test]
    fn a_surface_stays_whole() {
        for name in ["skiff", "dhow"] {
            let model = bowwave_models::resolve(name, std::path::Path::new(".")).unwrap();
            let (surface, places) = finer(&model);
            let times = surface.triangles.len() as f32 / (model.indices.len() / 3) as f32;
            assert!(times > 1.3 && times < 1.0 + MORE + 0.1, "{name}: {times}");
            // Each edge of the finer surface lies as often one way as the other, or not, as on the model.
            let open = |vertices: &[Vertex], triangles: &[[u32; 3]]| {
                let key = |i: u32| spot(vertices[i as usize].position).to_array();
                let mut edges: HashMap<Edge, i32> = HashMap::new();
                for [a, b, c] in triangles {
                    for (from, to) in [(a, b), (b, c), (c, a)] {
                        let (from, to) = (key(*from), key(*to));
                        *edges.entry([from.min(to), from.max(to)]).or_default() +=
                            if from < to { 1 } else { -1 };
                    }
                }
                let length = |edge: &Edge| {
                    let [a, b] = edge.map(|end| Vec3::from(end.map(|x| x as f32)));
                    a.distance(b) * WELD_M
                };
                edges.iter().map(|(edge, sum)| sum.unsigned_abs() as f32 * length(edge)).sum::<f32>()
            };
            let (before, after) = (
                open(&model.vertices, &triangles(&model.indices)),
                open(&surface.vertices, &surface.triangles),
            );
            assert!(
                (before - after).abs() < 1e-3 * before.max(1.0),
                "{name}: {before} m of edges of one triangle, {after}"
            );
            // Places are where their seats are.
            for place in &places {
                let there: Vec3 = (place.at.corners.iter().zip(place.at.shares))
                    .map(|(at, share)| surface.vertices[*at].position * share)
                    .sum();
                assert!(there.distance(place.position) < 1e-3, "{there} {}", place.position);
                let corners = surface.triangles[place.piece as usize].map(|i| i as usize);
                assert!(place.at.corners.iter().all(|at| corners.contains(at)));
            }
        }
    }
}
