//! Writes an assembly as binary glTF.
//!
//! glTF has y up and +z forward, so that boat (x forward, y to port, z up) becomes glTF (y, z, x): a rotation.

use std::{
    borrow::Cow,
    collections::{BTreeMap, HashMap},
};

use bowwave_core::model::Zone;
use glam::Vec3;
use gltf::{
    Glb,
    json::{
        self, Index,
        accessor::{Accessor, ComponentType, GenericComponentType, Type},
        buffer::{Target, View},
        material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor},
        mesh::{Mode, Semantic},
        validation::Checked::Valid,
    },
};

use super::assembly::{Assembly, Primitive};
use crate::load::PartMesh;

/// From boat axes to glTF's.
fn to_gltf(p: Vec3) -> [f32; 3] {
    [p.y, p.z, p.x]
}

/// The bytes of a GLB file: a root node with one child node for each part, named after it.
pub(crate) fn write(name: &str, assembly: &Assembly) -> Vec<u8> {
    let mut writer = Writer::default();
    let mut meshes: BTreeMap<Zone, Vec<json::mesh::Primitive>> = BTreeMap::new();
    for primitive in assembly.primitives() {
        let zone = primitive.zone;
        let written = writer.primitive(&primitive);
        meshes.entry(zone).or_default().push(written);
    }
    for (zone, primitives) in meshes {
        writer.part(zone.name(), primitives);
    }
    writer.finish(name)
}

/// The bytes of a GLB file of plain triangles: a node for each part, named after it, corners in glTF's axes as they are given (to the
/// nearest f32). Without normals: each triangle is flat.
pub fn parts_glb(parts: &[PartMesh]) -> Vec<u8> {
    let mut writer = Writer::default();
    for part in parts.iter().filter(|part| !part.triangles.is_empty()) {
        let (mut positions, mut places): (Vec<[f32; 3]>, HashMap<[u32; 3], u32>) = Default::default();
        let mut indices = Vec::with_capacity(3 * part.triangles.len());
        for corner in part.triangles.iter().flatten() {
            let corner = corner.as_vec3().to_array();
            indices.push(*places.entry(corner.map(f32::to_bits)).or_insert_with(|| {
                positions.push(corner);
                positions.len() as u32 - 1
            }));
        }
        let attributes = BTreeMap::from([(Valid(Semantic::Positions), writer.positions(&positions))]);
        let indices = writer.indices(&indices);
        writer.part(&part.name, vec![primitive(attributes, indices, None)]);
    }
    writer.finish("parts")
}

/// A primitive of triangles.
fn primitive(
    attributes: BTreeMap<json::validation::Checked<Semantic>, Index<Accessor>>,
    indices: Index<Accessor>,
    material: Option<Index<json::Material>>,
) -> json::mesh::Primitive {
    json::mesh::Primitive {
        attributes,
        extensions: None,
        extras: None,
        indices: Some(indices),
        material,
        mode: Valid(Mode::Triangles),
        targets: None,
    }
}

#[derive(Default)]
struct Writer {
    root: json::Root,
    bin: Vec<u8>,
    parts: Vec<Index<json::Node>>,
}

impl Writer {
    fn primitive(&mut self, p: &Primitive) -> json::mesh::Primitive {
        let positions: Vec<[f32; 3]> = p.positions.iter().map(|&v| to_gltf(v)).collect();
        let normals: Vec<[f32; 3]> = p.normals.iter().map(|&v| to_gltf(v)).collect();
        let position = self.positions(&positions);
        let normal = self.accessor(
            normals.iter().flatten().flat_map(|v| v.to_le_bytes()),
            (normals.len(), Type::Vec3, ComponentType::F32),
            Target::ArrayBuffer,
        );
        let indices = self.indices(&p.indices);
        let material = self.material(p);
        let attributes =
            BTreeMap::from([(Valid(Semantic::Positions), position), (Valid(Semantic::Normals), normal)]);
        primitive(attributes, indices, Some(material))
    }

    /// Corners, with the bounds that glTF asks for.
    fn positions(&mut self, positions: &[[f32; 3]]) -> Index<Accessor> {
        let low = positions.iter().fold([f32::MAX; 3], |a, b| [0, 1, 2].map(|i| f32::min(a[i], b[i])));
        let high = positions.iter().fold([f32::MIN; 3], |a, b| [0, 1, 2].map(|i| f32::max(a[i], b[i])));
        let position = self.accessor(
            positions.iter().flatten().flat_map(|v| v.to_le_bytes()),
            (positions.len(), Type::Vec3, ComponentType::F32),
            Target::ArrayBuffer,
        );
        if let Some(accessor) = self.root.accessors.last_mut() {
            accessor.min = Some(low.as_slice().into());
            accessor.max = Some(high.as_slice().into());
        }
        position
    }

    /// Two bytes an index where that is enough.
    fn indices(&mut self, indices: &[u32]) -> Index<Accessor> {
        let narrow: Result<Vec<u16>, _> = indices.iter().map(|&i| u16::try_from(i)).collect();
        match narrow {
            Ok(narrow) => self.accessor(
                narrow.iter().flat_map(|v| v.to_le_bytes()),
                (narrow.len(), Type::Scalar, ComponentType::U16),
                Target::ElementArrayBuffer,
            ),
            Err(_) => self.accessor(
                indices.iter().flat_map(|v| v.to_le_bytes()),
                (indices.len(), Type::Scalar, ComponentType::U32),
                Target::ElementArrayBuffer,
            ),
        }
    }

    fn accessor(
        &mut self,
        bytes: impl Iterator<Item = u8>,
        (count, type_, component): (usize, Type, ComponentType),
        target: Target,
    ) -> Index<Accessor> {
        let start = self.bin.len();
        self.bin.extend(bytes);
        let length = self.bin.len() - start;
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = self.root.push(View {
            buffer: Index::new(0),
            byte_length: length.into(),
            byte_offset: Some(start.into()),
            byte_stride: None,
            name: None,
            target: Some(Valid(target)),
            extensions: None,
            extras: None,
        });
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: count.into(),
            component_type: Valid(GenericComponentType(component)),
            extensions: None,
            extras: None,
            type_: Valid(type_),
            min: None,
            max: None,
            name: None,
            normalized: false,
            sparse: None,
        })
    }

    /// The material of a paint, made on its first use.
    fn material(&mut self, p: &Primitive) -> Index<json::Material> {
        let name = p.paint.name();
        if let Some(i) = self.root.materials.iter().position(|m| m.name.as_deref() == Some(&name)) {
            return Index::new(i as u32);
        }
        let [r, g, b] = p.paint.albedo().to_array();
        self.root.push(json::Material {
            name: Some(name),
            pbr_metallic_roughness: PbrMetallicRoughness {
                base_color_factor: PbrBaseColorFactor([r, g, b, 1.0]),
                metallic_factor: StrengthFactor(0.0),
                roughness_factor: StrengthFactor(p.paint.roughness()),
                ..Default::default()
            },
            ..Default::default()
        })
    }

    fn part(&mut self, name: &str, primitives: Vec<json::mesh::Primitive>) {
        let mesh = self.root.push(json::Mesh {
            extensions: None,
            extras: None,
            name: Some(name.to_owned()),
            primitives,
            weights: None,
        });
        let node = json::Node { mesh: Some(mesh), name: Some(name.to_owned()), ..json::Node::default() };
        let node = self.root.push(node);
        self.parts.push(node);
    }

    fn finish(mut self, name: &str) -> Vec<u8> {
        let children = Some(std::mem::take(&mut self.parts));
        let boat =
            self.root.push(json::Node { children, name: Some(name.to_owned()), ..json::Node::default() });
        let scene =
            self.root.push(json::Scene { extensions: None, extras: None, name: None, nodes: vec![boat] });
        self.root.scene = Some(scene);
        self.root.asset.generator = Some("Bowwave".to_owned());
        self.root.push(json::Buffer {
            byte_length: self.bin.len().into(),
            name: None,
            uri: None,
            extensions: None,
            extras: None,
        });
        // Plain numbers and strings: neither the JSON nor a write to memory can fail.
        let json = self.root.to_vec().unwrap_or_default();
        let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
        let glb = Glb { header, json: Cow::Owned(json), bin: Some(Cow::Owned(self.bin)) };
        glb.to_vec().unwrap_or_default()
    }
}
