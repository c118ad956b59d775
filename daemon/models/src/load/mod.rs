//! Reads boats from glTF 2.0.

mod accessor;
mod atlas;
mod mesh;
mod parts;
mod source;
mod surface;

use std::path::Path;

use bowwave_core::model::{Model, Zone};

pub use self::parts::{PartMesh, load_parts};
pub(crate) use self::{source::read_bounded, surface::decode_bounded as decode_picture};
use crate::{error::ModelError, finish::zone_index};

/// Largest file and largest sum of buffers, bytes.
pub(crate) const FILE_BYTES_MAX: u64 = 64 << 20;
/// Most vertices.
pub(crate) const VERTICES_MAX: u64 = 1_000_000;
/// Most triangles.
pub(crate) const TRIANGLES_MAX: u64 = 2_000_000;
/// Largest width and height of a texture, pixels.
pub(crate) const TEXTURE_SIDE_MAX: u32 = 4096;
/// Most names that an error lists.
pub(crate) const NAMES_MAX: usize = 20;

/// Loads a `.glb` or `.gltf` file: metres, y up, +z forward, the waterline at height 0. Buffers and pictures that it names are
/// looked for in its folder and below.
///
/// Contents that are read: all triangles of the default scene with their nodes' transforms, normals (flat where there are none),
/// colours and base-colour textures. Part names: a node, its mesh or the nearest named ancestor called `engine` or `helm`
/// (any case, a suffix such as `.001` or `_left` is fine) gives its triangles to that part; all else is hull.
///
/// Result: materials' base-colour factors and vertex colours go into the vertices. A model has one texture at
/// most: one picture is kept as it is; more than one, or one beside materials without, are put into one atlas. A texture
/// that repeats over a surface has no place in an atlas: its mean colour is taken. Skins and animations stay in the rest
/// pose; points and lines are left out; see-through materials are drawn opaque.
pub fn load(path: &Path) -> Result<Model, ModelError> {
    let bytes = source::read_bounded(path)?;
    let name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let folder = path.parent().unwrap_or(Path::new(""));
    from_bytes(&bytes, &path.display().to_string(), &name, Some(folder))
}

/// Loads a glTF file from memory (binary, or JSON with embedded buffers); it may refer to no other files.
pub fn load_glb(bytes: &[u8], name: &str) -> Result<Model, ModelError> {
    from_bytes(bytes, name, name, None)
}

fn from_bytes(bytes: &[u8], file: &str, name: &str, folder: Option<&Path>) -> Result<Model, ModelError> {
    let source = source::ModelSource::open(bytes, file, folder)?;
    let gathered = mesh::gather(&source)?;
    let needed: Vec<&'static str> = [Zone::Engine, Zone::Helm]
        .into_iter()
        .filter(|&zone| gathered.mesh.triangles[zone_index(zone)].is_empty())
        .map(Zone::name)
        .collect();
    if !needed.is_empty() {
        return Err(ModelError::MissingPart { file: file.to_owned(), needed, found: gathered.names });
    }
    gathered.mesh.finish(file, name, gathered.texture)
}
