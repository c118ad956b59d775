//! Boats of others: any bytes as binary glTF.

use bowwave_core::model::Model;
use bowwave_models::load_glb;

/// A texture of 4096 x 4096 pixels as it is decoded and as it is kept, and the vertices.
const MEMORY_BYTES: usize = 384 << 20;

/// A model is refused in words, or everything in it is finite and every index names a vertex.
pub fn run(input: &[u8]) {
    match super::memory::within(MEMORY_BYTES, || load_glb(input, "boat.glb")) {
        Err(error) => {
            let text = error.to_string();
            assert!(text.contains("boat.glb"), "an error that names no file: {text}");
        }
        Ok(model) => check(&model),
    }
}

fn check(model: &Model) {
    assert!(model.min.is_finite() && model.max.is_finite(), "{:?} to {:?}", model.min, model.max);
    assert!(model.min.z < 0.0 && model.max.z > 0.0, "it does not float: {:?} to {:?}", model.min, model.max);
    for vertex in &model.vertices {
        let finite = vertex.position.is_finite() && vertex.uv.is_finite() && vertex.albedo.is_finite();
        assert!(finite && (vertex.normal.length() - 1.0).abs() < 1e-3, "{vertex:?}");
    }
    assert!(
        model.waterline.len() >= 3 && model.waterline.iter().all(|p| p.is_finite()),
        "{:?}",
        model.waterline
    );
    assert!(
        model.indices.iter().all(|i| (*i as usize) < model.vertices.len()),
        "an index beyond the vertices"
    );
    let mut end = 0;
    for part in &model.parts {
        assert!(part.indices.start == end && part.indices.len().is_multiple_of(3), "{:?}", model.parts);
        end = part.indices.end;
    }
    assert_eq!(end as usize, model.indices.len(), "{:?}", model.parts);
    if let Some(texture) = &model.texture {
        assert_eq!(texture.rgba.len(), texture.width as usize * texture.height as usize * 4);
    }
}
