//! Solids gathered into parts; shading normals; triangles indexed for drawing.

use std::collections::{BTreeMap, HashMap};

use bowwave_core::model::Zone;
use glam::Vec3;

use super::{
    paint::Paint,
    solid::{Solid, Tri, key},
};

/// A boat under construction.
#[derive(Default)]
pub(crate) struct Assembly {
    faces: BTreeMap<(Zone, Paint), Vec<Face>>,
}

/// A triangle with its shading normals.
struct Face {
    p: [Vec3; 3],
    n: [Vec3; 3],
}

/// One glTF primitive.
pub(crate) struct Primitive {
    /// Part that it belongs to.
    pub(crate) zone: Zone,
    /// Its material.
    pub(crate) paint: Paint,
    /// Corner positions, boat axes.
    pub(crate) positions: Vec<Vec3>,
    /// Unit normals.
    pub(crate) normals: Vec<Vec3>,
    /// Triangles.
    pub(crate) indices: Vec<u32>,
}

impl Assembly {
    /// Adds a solid to a part.
    pub(crate) fn add(&mut self, zone: Zone, solid: Solid) {
        self.add_by(solid, |_| zone);
    }

    /// Adds solids to a part.
    pub(crate) fn add_all(&mut self, zone: Zone, solids: impl IntoIterator<Item = Solid>) {
        solids.into_iter().for_each(|s| self.add(zone, s));
    }

    /// Adds a solid whose triangles belong to parts by where their middle lies; shading is not broken between parts.
    pub(crate) fn add_by(&mut self, solid: Solid, zone: impl Fn(Vec3) -> Zone) {
        for (tri, n) in solid.tris.iter().zip(shading_normals(&solid)) {
            let middle = tri.p.iter().sum::<Vec3>() / 3.0;
            self.faces.entry((zone(middle), tri.paint)).or_default().push(Face { p: tri.p, n });
        }
    }

    /// Indexed triangles, one primitive for each part and paint.
    pub(crate) fn primitives(&self) -> Vec<Primitive> {
        self.faces.iter().map(|(&(zone, paint), faces)| index(zone, paint, faces)).collect()
    }
}

/// Normals of each triangle's corners: the mean, weighted by angle, of the faces about the corner that meet this one at
/// less than the crease angle.
fn shading_normals(solid: &Solid) -> Vec<[Vec3; 3]> {
    let flat: Vec<Vec3> = solid.tris.iter().map(|t| t.area_vector().normalize_or_zero()).collect();
    let mut about: HashMap<[i32; 3], Vec<(usize, f32)>> = HashMap::new();
    for (i, t) in solid.tris.iter().enumerate() {
        for corner in 0..3 {
            about.entry(key(t.p[corner])).or_default().push((i, angle(t, corner)));
        }
    }
    let cos_crease = solid.crease.cos();
    let corner_normal = |i: usize, corner: usize| {
        let near = about.get(&key(solid.tris[i].p[corner])).map_or(&[][..], Vec::as_slice);
        let sum: Vec3 =
            near.iter().filter(|(j, _)| flat[*j].dot(flat[i]) > cos_crease).map(|&(j, w)| flat[j] * w).sum();
        sum.normalize_or(flat[i])
    };
    (0..solid.tris.len()).map(|i| [0, 1, 2].map(|corner| corner_normal(i, corner))).collect()
}

/// Angle of a triangle at one of its corners, radians.
fn angle(t: &Tri, corner: usize) -> f32 {
    let at = t.p[corner];
    (t.p[(corner + 1) % 3] - at).angle_between(t.p[(corner + 2) % 3] - at)
}

fn index(zone: Zone, paint: Paint, faces: &[Face]) -> Primitive {
    let mut primitive =
        Primitive { zone, paint, positions: Vec::new(), normals: Vec::new(), indices: Vec::new() };
    let mut known: HashMap<([i32; 3], [i32; 3]), u32> = HashMap::new();
    for face in faces {
        for (p, n) in face.p.iter().zip(&face.n) {
            let next = primitive.positions.len() as u32;
            let id = *known.entry((key(*p), key(*n))).or_insert(next);
            if id == next {
                primitive.positions.push(*p);
                primitive.normals.push(*n);
            }
            primitive.indices.push(id);
        }
    }
    primitive
}
