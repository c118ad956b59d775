//! Walks the scene and gathers its triangles in boat axes.

use bowwave_core::model::{Texture, Vertex, Zone};
use glam::{Mat3, Mat4, Vec2, Vec3};
use gltf::{Semantic, json::accessor::Type, mesh::Mode};

use super::{
    NAMES_MAX, TRIANGLES_MAX, VERTICES_MAX,
    atlas::{self, AtlasPlace},
    source::{ModelSource, limit},
    surface::{TexturePicture, TexturePictures},
};
use crate::{
    error::ModelError,
    finish::{FinishedMesh, zone_index},
};

/// Deepest tree of nodes.
pub(super) const DEPTH_MAX: usize = 64;
/// glTF (y up, +z forward, +x to port) to boat (x forward, y to port, z up): a rotation, x <- z, y <- x, z <- y.
const BOAT_FROM_GLTF: Mat3 = Mat3::from_cols(Vec3::Y, Vec3::Z, Vec3::X);

/// Everything that a scene holds.
pub(crate) struct GatheredMesh {
    pub(crate) mesh: FinishedMesh,
    pub(crate) texture: Option<Texture>,
    /// Names of nodes and meshes with triangles, each once.
    pub(crate) names: Vec<String>,
}

/// One primitive in boat axes; `uv` still belongs to its own picture.
struct MeshPiece {
    zone: Zone,
    vertices: Vec<Vertex>,
    triangles: Vec<[u32; 3]>,
    picture: Option<usize>,
}

/// Nodes of the default scene; of the first where none is the default; all that are nobody's child where there is none.
pub(super) fn scene_roots(document: &gltf::Document) -> Vec<gltf::Node<'_>> {
    if let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) {
        return scene.nodes().collect();
    }
    let mut is_child = vec![false; document.nodes().len()];
    for child in document.nodes().flat_map(|n| n.children()) {
        if let Some(is_child) = is_child.get_mut(child.index()) {
            *is_child = true;
        }
    }
    document.nodes().filter(|n| is_child.get(n.index()) == Some(&false)).collect()
}

/// Reads all that the default scene holds.
pub(crate) fn gather(source: &ModelSource<'_>) -> Result<GatheredMesh, ModelError> {
    let mut walk = NodeWalk {
        source,
        pictures: TexturePictures::default(),
        pieces: Vec::new(),
        names: Vec::new(),
        vertices: 0,
        triangles: 0,
        seen: vec![false; source.root().nodes.len()],
    };
    for node in scene_roots(&source.document) {
        walk.node(&node, Mat4::IDENTITY, Zone::Hull, 0)?;
    }
    walk.finish()
}

struct NodeWalk<'a, 'b> {
    source: &'a ModelSource<'b>,
    pictures: TexturePictures,
    pieces: Vec<MeshPiece>,
    names: Vec<String>,
    vertices: u64,
    triangles: u64,
    seen: Vec<bool>,
}

impl NodeWalk<'_, '_> {
    fn node(
        &mut self,
        node: &gltf::Node<'_>,
        parent: Mat4,
        inherited: Zone,
        depth: usize,
    ) -> Result<(), ModelError> {
        let seen = self.seen.get_mut(node.index());
        if depth > DEPTH_MAX || seen.is_none_or(|s| std::mem::replace(s, true)) {
            let i = node.index();
            return Err(self
                .source
                .error(format!("node {i} is reached twice or lies deeper than {DEPTH_MAX} levels")));
        }
        let transform = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        let mesh_name = node.mesh().and_then(|m| m.name().and_then(zone_of));
        let zone = node.name().and_then(zone_of).or(mesh_name).unwrap_or(inherited);
        if let Some(mesh) = node.mesh() {
            for name in [node.name(), mesh.name()].into_iter().flatten() {
                // An error lists no more; a hostile file may have a million.
                if self.names.len() < NAMES_MAX && !self.names.iter().any(|n| n == name) {
                    self.names.push(name.to_owned());
                }
            }
            for primitive in mesh.primitives() {
                self.primitive(&primitive, transform, zone)?;
            }
        }
        for child in node.children() {
            self.node(&child, transform, zone, depth + 1)?;
        }
        Ok(())
    }

    fn primitive(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        transform: Mat4,
        zone: Zone,
    ) -> Result<(), ModelError> {
        let source = self.source;
        if !is_surface(primitive) {
            return Ok(());
        }
        let surface = self.pictures.surface(source, &primitive.material())?;
        let attributes =
            Attributes::read(source, primitive, surface.picture.map(|m| m.set), &mut self.vertices)?;
        let triangles = triangles(source, primitive, attributes.positions.len())?;
        self.triangles += triangles.len() as u64;
        limit(source.file, "the number of triangles", self.triangles, TRIANGLES_MAX)?;

        let to_boat = Mat4::from_mat3(BOAT_FROM_GLTF) * transform;
        let linear = Mat3::from_mat4(to_boat);
        if !to_boat.is_finite() || linear.determinant() == 0.0 {
            return Err(source.error("a node's transform flattens its mesh or is not finite"));
        }
        let vertices = attributes
            .vertices(to_boat, surface.albedo, |uv| surface.picture.map_or(Vec2::ZERO, |m| m.apply(uv)));
        if !vertices.iter().all(|v| v.position.is_finite() && v.uv.is_finite() && v.albedo.is_finite()) {
            return Err(source.error(format!("mesh {} has a corner that is not finite", primitive.index())));
        }
        let mirrored = linear.determinant() < 0.0;
        let picture = surface.picture.map(|m| m.picture).filter(|_| attributes.has_uv);
        let mut piece = MeshPiece { zone, vertices, triangles, picture };
        piece.shade(mirrored, attributes.normals.is_some());
        self.pieces.push(piece);
        Ok(())
    }

    /// Puts pieces and pictures together.
    fn finish(mut self) -> Result<GatheredMesh, ModelError> {
        let means: Vec<Vec3> = self.pictures.all.iter().map(TexturePicture::mean).collect();
        for piece in &mut self.pieces {
            if let Some(picture) = piece.picture
                && !piece.fits_unit_square()
            {
                // A picture that repeats cannot be in an atlas.
                piece.vertices.iter_mut().for_each(|v| v.albedo *= means[picture]);
                piece.picture = None;
            }
        }
        let texture = self.join_pictures();
        let mut mesh = FinishedMesh::default();
        for piece in self.pieces {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(piece.vertices);
            let triangles = &mut mesh.triangles[zone_index(piece.zone)];
            triangles.extend(piece.triangles.iter().map(|t| t.map(|i| i + first)));
        }
        if mesh.triangles.iter().all(Vec::is_empty) {
            return Err(self.source.error("its scene has no triangles"));
        }
        Ok(GatheredMesh { mesh, texture, names: self.names })
    }

    /// One texture for all pieces, and their coordinates in it.
    fn join_pictures(&mut self) -> Option<Texture> {
        let mut used: Vec<usize> = self.pieces.iter().filter_map(|p| p.picture).collect();
        used.sort_unstable();
        used.dedup();
        let everywhere = self.pieces.iter().all(|p| p.picture.is_some());
        let (texture, places, white) = match used[..] {
            [] => return None,
            [only] if everywhere => {
                (atlas::texture(self.pictures.all[only].rgba.clone()), vec![AtlasPlace::WHOLE], Vec2::ZERO)
            }
            _ => atlas::pack(&used.iter().map(|&i| &self.pictures.all[i]).collect::<Vec<_>>()),
        };
        for piece in &mut self.pieces {
            let place = piece.picture.and_then(|p| used.binary_search(&p).ok()).map(|i| places[i]);
            for vertex in &mut piece.vertices {
                vertex.uv = place.map_or(white, |p| p.apply(vertex.uv));
            }
        }
        Some(texture)
    }
}

impl MeshPiece {
    /// Drops triangles without area, turns mirrored ones over, and gives flat normals where there are none.
    fn shade(&mut self, mirrored: bool, has_normals: bool) {
        let at = |v: &[Vertex], i: u32| v[i as usize].position;
        let face = |v: &[Vertex], t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| at(v, i));
            (b - a).cross(c - a)
        };
        if mirrored {
            self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let vertices = &self.vertices;
        self.triangles.retain(|t| face(vertices, t).length_squared() > 1e-18);
        if !has_normals {
            // glTF 2.0, 3.7.2.1: "When normals are not specified, client implementations MUST calculate flat normals".
            let corners = self.triangles.iter().flatten().map(|&i| vertices[i as usize]).collect();
            self.vertices = corners;
            self.triangles =
                (0..self.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        }
        for t in &self.triangles {
            let normal = face(&self.vertices, t).normalize_or(Vec3::Z);
            for &i in t {
                let vertex = &mut self.vertices[i as usize];
                if vertex.normal == Vec3::ZERO {
                    vertex.normal = normal;
                }
            }
        }
        // Corners of no triangle.
        self.vertices.iter_mut().filter(|v| v.normal == Vec3::ZERO).for_each(|v| v.normal = Vec3::Z);
    }

    /// Shifts texture coordinates by whole pictures into the first one; `false` where they span more than one.
    fn fits_unit_square(&mut self) -> bool {
        const SLACK: f32 = 1e-3;
        let low = self.vertices.iter().map(|v| v.uv).reduce(Vec2::min).unwrap_or(Vec2::ZERO);
        let high = self.vertices.iter().map(|v| v.uv).reduce(Vec2::max).unwrap_or(Vec2::ZERO);
        let shift = (low + SLACK).floor();
        if (high - shift).max_element() > 1.0 + SLACK {
            return false;
        }
        self.vertices.iter_mut().for_each(|v| v.uv = (v.uv - shift).clamp(Vec2::ZERO, Vec2::ONE));
        true
    }
}

/// A primitive's attributes as they are stored.
struct Attributes {
    positions: Vec<[f32; 4]>,
    normals: Option<Vec<[f32; 4]>>,
    colours: Option<Vec<[f32; 4]>>,
    uvs: Vec<[f32; 4]>,
    has_uv: bool,
}

impl Attributes {
    fn read(
        source: &ModelSource<'_>,
        primitive: &gltf::Primitive<'_>,
        uv_set: Option<u32>,
        total: &mut u64,
    ) -> Result<Self, ModelError> {
        let positions = positions(source, primitive, total)?;
        let optional = |semantic: Semantic, types: &[Type]| -> Result<Option<Vec<[f32; 4]>>, ModelError> {
            let Some(index) = attribute(primitive, &semantic) else { return Ok(None) };
            let values = source.floats(index, types)?;
            if values.len() != positions.len() {
                let (a, b) = (values.len(), positions.len());
                return Err(source.error(format!("a mesh has {b} positions but {a} of another attribute")));
            }
            Ok(Some(values))
        };
        let normals = optional(Semantic::Normals, &[Type::Vec3])?;
        let colours = optional(Semantic::Colors(0), &[Type::Vec3, Type::Vec4])?;
        let uvs = match uv_set {
            Some(set) => optional(Semantic::TexCoords(set), &[Type::Vec2])?,
            None => None,
        };
        let has_uv = uvs.is_some();
        let uvs = uvs.unwrap_or_else(|| vec![[0.0; 4]; positions.len()]);
        Ok(Self { positions, normals, colours, uvs, has_uv })
    }

    fn vertices(&self, to_boat: Mat4, albedo: Vec3, map_uv: impl Fn(Vec2) -> Vec2) -> Vec<Vertex> {
        let normal_matrix = Mat3::from_mat4(to_boat).inverse().transpose();
        let xyz = |v: &[f32; 4]| Vec3::new(v[0], v[1], v[2]);
        let one = |(i, p): (usize, &[f32; 4])| Vertex {
            position: to_boat.transform_point3(xyz(p)),
            normal: self
                .normals
                .as_ref()
                .map_or(Vec3::ZERO, |n| (normal_matrix * xyz(&n[i])).normalize_or_zero()),
            uv: map_uv(Vec2::new(self.uvs[i][0], self.uvs[i][1])),
            albedo: self
                .colours
                .as_ref()
                .map_or(albedo, |c| albedo * xyz(&c[i]).clamp(Vec3::ZERO, Vec3::ONE)),
        };
        self.positions.iter().enumerate().map(one).collect()
    }
}

/// The accessor of an attribute.
fn attribute(
    primitive: &gltf::Primitive<'_>,
    semantic: &Semantic,
) -> Option<gltf::json::Index<gltf::json::Accessor>> {
    let (_, accessor) = primitive.attributes().find(|(s, _)| s == semantic)?;
    Some(gltf::json::Index::new(accessor.index() as u32))
}

/// Corners of a primitive in its own axes; `total` counts those of the file.
pub(super) fn positions(
    source: &ModelSource<'_>,
    primitive: &gltf::Primitive<'_>,
    total: &mut u64,
) -> Result<Vec<[f32; 4]>, ModelError> {
    let at =
        attribute(primitive, &Semantic::Positions).ok_or_else(|| source.error("a mesh has no positions"))?;
    *total = total.saturating_add(source.count(at));
    limit(source.file, "the number of vertices", *total, VERTICES_MAX)?;
    source.floats(at, &[Type::Vec3])
}

/// Whether a primitive has triangles; points and lines are left out.
pub(super) fn is_surface(primitive: &gltf::Primitive<'_>) -> bool {
    !matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip)
}

/// The triangles of a list, strip or fan.
pub(super) fn triangles(
    source: &ModelSource<'_>,
    primitive: &gltf::Primitive<'_>,
    vertices: usize,
) -> Result<Vec<[u32; 3]>, ModelError> {
    let order: Vec<u32> = match primitive.indices() {
        Some(accessor) => {
            let index = gltf::json::Index::new(accessor.index() as u32);
            limit(source.file, "the number of triangles", source.count(index) / 3, TRIANGLES_MAX)?;
            source.indices(index)?
        }
        None => (0..vertices as u32).collect(),
    };
    if let Some(bad) = order.iter().find(|&&i| i as usize >= vertices) {
        return Err(source.error(format!("a triangle uses corner {bad} of {vertices}")));
    }
    Ok(match primitive.mode() {
        Mode::TriangleStrip => order
            .windows(3)
            .enumerate()
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] })
            .collect(),
        Mode::TriangleFan => {
            let first = order.first().copied().unwrap_or(0);
            order.get(1..).unwrap_or(&[]).windows(2).map(|w| [first, w[0], w[1]]).collect()
        }
        _ => order.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    })
}

/// The part that a name stands for: the part's own name, alone or before something that is no letter.
fn zone_of(name: &str) -> Option<Zone> {
    let lower = name.trim().to_ascii_lowercase();
    Zone::ALL.into_iter().find(|zone| {
        lower.strip_prefix(zone.name()).is_some_and(|rest| !rest.starts_with(char::is_alphabetic))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stand_for_parts() {
        for (name, zone) in [
            ("engine", Some(Zone::Engine)),
            ("Engine.001", Some(Zone::Engine)),
            ("HELM_seat", Some(Zone::Helm)),
            ("helm 2", Some(Zone::Helm)),
            ("helmet", None),
            ("engineer", None),
            ("hull", Some(Zone::Hull)),
            ("my engine", None),
            ("", None),
        ] {
            assert_eq!(zone_of(name), zone, "{name:?}");
        }
    }
}
