//! Boats: parametric models built here, glTF and pictures read from anywhere.
//!
//! Every model reaches the trainer the same way: the built-in boats are written as binary glTF by [`build_glb`] and read by
//! the loader that reads a user's own file. [`resolve`] turns what a scenario names into a model. [`load_parts`] and [`parts_glb`] read and
//! write plain triangles by their parts' names, as models of the own gun are.

#![forbid(unsafe_code)]

mod boats;
mod build;
mod error;
mod finish;
mod load;
mod quad;
pub mod raster;
mod sidecar;

use std::path::Path;

use bowwave_core::model::Model;

pub use crate::{
    boats::BoatModels,
    build::{Boat, build_glb, parts_glb},
    error::ModelError,
    load::{PartMesh, load, load_glb, load_parts},
    quad::{Bow, FRIGATE_QUAD, QuadSpec, Rect, frigate_quad, load_quad, quad, side_view},
};

/// Names that [`resolve`] knows without a file.
pub fn built_in_names() -> Vec<&'static str> {
    Boat::ALL.into_iter().map(Boat::name).chain([FRIGATE_QUAD]).collect()
}

/// The model that a scenario calls `name`: a built-in one, or a file (`.glb`, `.gltf`, `.png`), relative to `base`.
pub fn resolve(name: &str, base: &Path) -> Result<Model, ModelError> {
    if let Some(boat) = Boat::ALL.into_iter().find(|b| b.name() == name) {
        return load_glb(&build_glb(boat), boat.name());
    }
    if name == FRIGATE_QUAD {
        return frigate_quad();
    }
    let path = base.join(name);
    match Path::new(name).extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).as_deref() {
        Some("glb" | "gltf") => load(&path),
        Some("png") => load_quad(&path),
        _ => Err(ModelError::Unknown { name: name.to_owned(), known: built_in_names() }),
    }
}
