//! Plain triangles by the names of their nodes, in glTF's own axes.

use std::path::Path;

use glam::{DVec3, Mat4, Vec3};

use super::{
    TRIANGLES_MAX,
    mesh::{DEPTH_MAX, is_surface, positions, scene_roots, triangles},
    source::{ModelSource, limit, read_bounded},
};
use crate::error::ModelError;

/// Triangles that have one name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PartMesh {
    /// Name of their node, of its mesh where the node has none, of the nearest named node above where neither has; may be empty.
    pub name: String,
    /// Corners in glTF's axes, metres.
    pub triangles: Vec<[DVec3; 3]>,
}

/// Reads the triangles of a `.glb` or `.gltf` file's default scene, nodes' transforms applied: those of one name together, in the order in
/// which the names are met. Nothing is asked of shape, size or place; points and lines are left out, skins stay in the rest pose.
///
/// # Errors
/// A file that cannot be read, is no glTF or contradicts itself, holds more than the trainer takes, or has no triangle.
pub fn load_parts(path: &Path) -> Result<Vec<PartMesh>, ModelError> {
    let bytes = read_bounded(path)?;
    let file = path.display().to_string();
    let source = ModelSource::open(&bytes, &file, Some(path.parent().unwrap_or(Path::new(""))))?;
    let seen = vec![false; source.root().nodes.len()];
    let mut walk = PartWalk { source: &source, parts: Vec::new(), vertices: 0, triangles: 0, seen };
    for node in scene_roots(&source.document) {
        walk.node(&node, Mat4::IDENTITY, "", 0)?;
    }
    if walk.parts.is_empty() {
        return Err(source.error("its scene has no triangles"));
    }
    Ok(walk.parts)
}

struct PartWalk<'a, 'b> {
    source: &'a ModelSource<'b>,
    parts: Vec<PartMesh>,
    vertices: u64,
    triangles: u64,
    seen: Vec<bool>,
}

impl PartWalk<'_, '_> {
    fn node(
        &mut self,
        node: &gltf::Node<'_>,
        parent: Mat4,
        inherited: &str,
        depth: usize,
    ) -> Result<(), ModelError> {
        let i = node.index();
        let seen = self.seen.get_mut(i);
        if depth > DEPTH_MAX || seen.is_none_or(|s| std::mem::replace(s, true)) {
            let problem = format!("node {i} is reached twice or lies deeper than {DEPTH_MAX} levels");
            return Err(self.source.error(problem));
        }
        let transform = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        if !transform.is_finite() {
            return Err(self.source.error(format!("the transform of node {i} is not finite")));
        }
        if let Some(mesh) = node.mesh() {
            let name = node.name().or(mesh.name()).unwrap_or(inherited);
            for primitive in mesh.primitives().filter(is_surface) {
                self.primitive(&primitive, transform, name)?;
            }
        }
        let name = node.name().unwrap_or(inherited).to_owned();
        for child in node.children() {
            self.node(&child, transform, &name, depth + 1)?;
        }
        Ok(())
    }

    fn primitive(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        transform: Mat4,
        name: &str,
    ) -> Result<(), ModelError> {
        let corners: Vec<DVec3> = positions(self.source, primitive, &mut self.vertices)?
            .iter()
            .map(|p| transform.transform_point3(Vec3::new(p[0], p[1], p[2])).as_dvec3())
            .collect();
        if !corners.iter().all(|p| p.is_finite()) {
            let problem = format!("a mesh of the node {name:?} has a corner that is not finite");
            return Err(self.source.error(problem));
        }
        let order = triangles(self.source, primitive, corners.len())?;
        self.triangles += order.len() as u64;
        limit(self.source.file, "the number of triangles", self.triangles, TRIANGLES_MAX)?;
        // Each index was checked to be one of the corners.
        let corner = |i: u32| corners.get(i as usize).copied().unwrap_or_default();
        let new = order.into_iter().map(|triangle| triangle.map(corner));
        match self.parts.iter_mut().find(|part| part.name == name) {
            Some(part) => part.triangles.extend(new),
            None => self.parts.push(PartMesh { name: name.to_owned(), triangles: new.collect() }),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Boat, build_glb, parts_glb};

    fn written(bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("gun.glb");
        std::fs::write(&path, bytes).unwrap();
        (folder, path)
    }

    #[test]
    fn what_is_written_is_read_by_its_names() {
        let a = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let b = [DVec3::X, DVec3::new(1.0, 1.0, 0.25), DVec3::Y];
        let parts = [("shield", vec![a, b]), ("barrel", vec![b])]
            .map(|(name, triangles)| PartMesh { name: name.to_owned(), triangles });
        let (_folder, path) = written(&parts_glb(&parts));
        assert_eq!(load_parts(&path).unwrap(), parts);
    }

    #[test]
    fn parts_of_a_boat_stand_for_a_file_of_another_program() {
        let (_folder, path) = written(&build_glb(Boat::ALL[0]));
        let parts = load_parts(&path).unwrap();
        assert!(parts.iter().any(|part| part.name == "hull"), "{:?}", parts.iter().map(|p| &p.name));
        assert!(parts.iter().all(|part| !part.triangles.is_empty()));
    }

    #[test]
    fn a_file_without_triangles_says_so() {
        let (_folder, path) = written(&parts_glb(&[]));
        let error = load_parts(&path).unwrap_err().to_string();
        assert!(error.contains("no triangles"), "{error}");
        let (_folder, path) = written(b"solid of another format");
        assert!(load_parts(&path).unwrap_err().to_string().contains("gun.glb"));
    }
}
