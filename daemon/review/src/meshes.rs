//! Meshes of the boats for the view that is moved: the trainer's own models.

use std::{collections::BTreeMap, path::Path};

use base64::{Engine as _, engine::general_purpose::STANDARD};
use bowwave_core::{
    colour::linear_to_srgb,
    model::{Model, ModelKind},
};
use bowwave_models::resolve;
use bowwave_record::BoatDetails;
use serde::Serialize;

/// A mesh, its arrays in base64 of little-endian numbers.
#[derive(Debug, Serialize)]
pub struct Mesh {
    /// Corners, f32 metres: x forward, y to port, z up.
    positions: String,
    /// Colours, three u8 of sRGB a corner.
    colours: String,
    /// Three u32 a triangle.
    indices: String,
}

/// The meshes of boats by the names of their models, and what there is to say of those that could not be loaded. Files are named from `base`.
pub fn of_boats<'a>(boats: &'a [BoatDetails], base: &Path) -> (BTreeMap<&'a str, Mesh>, Vec<String>) {
    let (mut meshes, mut notes) = (BTreeMap::new(), Vec::new());
    for boat in boats {
        if meshes.contains_key(boat.model.as_str()) {
            continue;
        }
        let loaded = resolve(&boat.model, base);
        match loaded.as_ref().ok().filter(|model| is_same_size(model, boat)) {
            Some(model) => drop(meshes.insert(boat.model.as_str(), Mesh::of(model))),
            None => {
                let note = format!(
                    "{}: its model {} is not found as it was; it is drawn as a box of its size",
                    boat.name, boat.model
                );
                notes.push(note);
            }
        }
    }
    (meshes, notes)
}

/// A file may have been changed since.
fn is_same_size(model: &Model, boat: &BoatDetails) -> bool {
    const SAME_M: f32 = 0.01;
    let far = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > SAME_M);
    !far(model.min.to_array(), boat.low_m)
        && !far(model.max.to_array(), boat.high_m)
        && model.kind == ModelKind::Mesh
}

impl Mesh {
    fn of(model: &Model) -> Self {
        let positions: Vec<[f32; 3]> = model.vertices.iter().map(|v| v.position.to_array()).collect();
        let code = |linear: f32| (linear_to_srgb(linear.clamp(0.0, 1.0)) * 255.0).round() as u8;
        let colours: Vec<[u8; 3]> = model.vertices.iter().map(|v| v.albedo.to_array().map(code)).collect();
        Self {
            positions: base64_of(&positions),
            colours: base64_of(&colours),
            indices: base64_of(&model.indices),
        }
    }
}

/// Numbers in base64, as they lie in memory: little-endian on every machine that the trainer runs on.
pub fn base64_of<T: bytemuck::NoUninit>(numbers: &[T]) -> String {
    STANDARD.encode(bytemuck::cast_slice::<T, u8>(numbers))
}
