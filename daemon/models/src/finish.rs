//! What every model goes through last: parts in order, bounding box, outline on the water, sanity.

use std::ops::Range;

use bowwave_core::model::{Model, ModelKind, Part, Texture, Vertex, Zone};
use glam::{DVec2, Vec3};

use crate::error::ModelError;

/// Lengths of boats that are taken, metres.
const LENGTH_M: Range<f32> = 0.5..500.0;

/// Triangles with the part that they belong to.
#[derive(Default)]
pub(crate) struct FinishedMesh {
    /// Corners, boat axes.
    pub(crate) vertices: Vec<Vertex>,
    /// Triangles of each of [`Zone::ALL`].
    pub(crate) triangles: [Vec<[u32; 3]>; 3],
}

impl FinishedMesh {
    /// Checks the mesh and makes the model. `file` is what errors name.
    pub(crate) fn finish(
        self,
        file: &str,
        name: &str,
        texture: Option<Texture>,
    ) -> Result<Model, ModelError> {
        let (min, max) = bounds(&self.vertices);
        check_size(file, min, max)?;
        let position = |i: u32| self.vertices.get(i as usize).map_or(Vec3::ZERO, |v| v.position);
        let cut = |zones: &[Vec<[u32; 3]>]| -> Vec<DVec2> {
            let corners = zones.iter().flatten().map(|t| t.map(position));
            convex_outline(corners.flat_map(cut_at_water).collect())
        };
        // An outboard's leg is no hull; a hull without any hull part is all there is.
        let [hull, ..] = &self.triangles;
        let mut waterline = cut(std::slice::from_ref(hull));
        if waterline.len() < 3 {
            waterline = cut(&self.triangles);
        }
        if waterline.len() < 3 {
            return Err(ModelError::NoWaterline { file: file.to_owned() });
        }
        let (indices, parts) = self.parts();
        Ok(Model {
            name: name.to_owned(),
            kind: ModelKind::Mesh,
            vertices: self.vertices,
            indices,
            parts,
            texture,
            waterline,
            min,
            max,
        })
    }

    /// All triangles, part after part.
    fn parts(&self) -> (Vec<u32>, Vec<Part>) {
        let mut indices = Vec::new();
        let mut parts = Vec::new();
        for (zone, triangles) in Zone::ALL.into_iter().zip(&self.triangles) {
            let start = indices.len() as u32;
            indices.extend(triangles.iter().flatten());
            if !triangles.is_empty() {
                parts.push(Part { zone, indices: start..indices.len() as u32 });
            }
        }
        (indices, parts)
    }
}

/// Place of a zone in [`Zone::ALL`].
pub(crate) const fn zone_index(zone: Zone) -> usize {
    match zone {
        Zone::Hull => 0,
        Zone::Engine => 1,
        Zone::Helm => 2,
    }
}

/// Corners of the bounding box.
pub(crate) fn bounds(vertices: &[Vertex]) -> (Vec3, Vec3) {
    let low = vertices.iter().map(|v| v.position).reduce(Vec3::min).unwrap_or(Vec3::ZERO);
    let high = vertices.iter().map(|v| v.position).reduce(Vec3::max).unwrap_or(Vec3::ZERO);
    (low, high)
}

fn check_size(file: &str, min: Vec3, max: Vec3) -> Result<(), ModelError> {
    let file = || file.to_owned();
    let size = max - min;
    if !LENGTH_M.contains(&size.x.max(size.y)) {
        let (shortest_m, longest_m) = (LENGTH_M.start, LENGTH_M.end);
        return Err(ModelError::Size { file: file(), length_m: size.x.max(size.y), shortest_m, longest_m });
    }
    if size.y > size.x {
        return Err(ModelError::Across { file: file(), length_m: size.x, beam_m: size.y });
    }
    if min.z >= 0.0 {
        return Err(ModelError::Afloat { file: file(), lowest_m: min.z });
    }
    if max.z <= 0.0 {
        return Err(ModelError::Sunk { file: file(), highest_m: max.z });
    }
    Ok(())
}

/// The ends of the line that z = 0 cuts out of a triangle; none where it does not cross.
fn cut_at_water(t: [Vec3; 3]) -> impl Iterator<Item = DVec2> {
    [(0, 1), (1, 2), (2, 0)].into_iter().filter_map(move |(i, j)| {
        let (a, b) = (t[i].as_dvec3(), t[j].as_dvec3());
        let crosses = (a.z < 0.0) != (b.z < 0.0);
        crosses.then(|| a.lerp(b, a.z / (a.z - b.z)).truncate())
    })
}

/// Convex hull, counter-clockwise, without points on its sides (Andrew's monotone chain).
pub(crate) fn convex_outline(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.retain(|p| p.is_finite());
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup_by(|a, b| a.distance_squared(*b) < 1e-8);
    let mut chain = half_chain(points.iter().copied());
    let back = half_chain(points.iter().rev().copied());
    chain.pop();
    chain.extend(back.into_iter().rev().skip(1).rev());
    if area(&chain) < 1e-6 { Vec::new() } else { chain }
}

fn half_chain(points: impl Iterator<Item = DVec2>) -> Vec<DVec2> {
    let mut chain: Vec<DVec2> = Vec::new();
    for p in points {
        while let [.., a, b] = chain[..] {
            if (b - a).perp_dot(p - b) > 1e-9 {
                break;
            }
            chain.pop();
        }
        chain.push(p);
    }
    chain
}

/// Area of a polygon, square metres, positive where it runs counter-clockwise.
fn area(polygon: &[DVec2]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(a, b)| a.perp_dot(*b)).sum::<f64>() / 2.0
}
