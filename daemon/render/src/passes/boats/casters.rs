//! The shape of a mesh alone, which throws its shadow. Levels that keep colours, light and sharp edges spend half of their triangles on those, and
//! a shadow map that shows a gunwale would pay for them.

use std::collections::HashMap;

use bowwave_core::model::Model;
use meshopt::{SimplifyOptions, VertexDataAdapter, simplify};

use super::parts::{Parts, spot, triangles};

/// Error of the finest level, metres; each has twice the error of the one before.
const ERROR_MIN_M: f32 = 0.004;
/// No model is simplified to fewer triangles.
const TRIANGLES_MIN: usize = 24;

/// One level: how far its shape is from the model's, metres, and its triangles as the model's corners.
pub(super) struct Caster {
    pub(super) error_m: f32,
    /// Of closed parts.
    pub(super) closed: Vec<[u32; 3]>,
    /// Of open shells, both ways round.
    pub(super) open: Vec<[u32; 3]>,
}

/// The levels of `model`'s shape from the finest to the coarsest.
pub(super) fn casters(model: &Model) -> Vec<Caster> {
    let parts = Parts::of(model);
    let indices = welded(model);
    let positions: Vec<[f32; 3]> = model.vertices.iter().map(|v| v.position.to_array()).collect();
    let size_m = (model.max - model.min).max_element();
    let (mut levels, mut error_m) = (Vec::new(), ERROR_MIN_M);
    while error_m < size_m / 8.0 {
        let made = with_error(&positions, &indices, error_m);
        if made.is_empty() {
            break;
        }
        let made_of = triangles(&made).into_iter();
        let (closed, open): (Vec<_>, Vec<_>) = made_of.partition(|t| parts.closed(t[0]));
        let open = open.into_iter().flat_map(|[a, b, c]| [[a, b, c], [a, c, b]]).collect();
        levels.push(Caster { error_m, closed, open });
        if made.len() <= 3 * TRIANGLES_MIN {
            break;
        }
        error_m *= 2.0;
    }
    levels
}

/// The model's triangles with one corner for all that stand at the same place, so that no seam is left between them.
fn welded(model: &Model) -> Vec<u32> {
    let mut first = HashMap::new();
    model
        .indices
        .iter()
        .map(|i| *first.entry(spot(model.vertices[*i as usize].position)).or_insert(*i))
        .collect()
}

/// The triangles that keep the shape within `error_m` metres.
fn with_error(positions: &[[f32; 3]], indices: &[u32], error_m: f32) -> Vec<u32> {
    let adapter = VertexDataAdapter::new(bytemuck::cast_slice(positions), size_of::<[f32; 3]>(), 0);
    let options = SimplifyOptions::ErrorAbsolute | SimplifyOptions::Prune | SimplifyOptions::Permissive;
    adapter.map_or_else(
        |_| Vec::new(),
        |adapter| simplify(indices, &adapter, 3 * TRIANGLES_MIN, error_m, options, None),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shape_needs_fewer_triangles_than_what_is_seen_of_it() {
        for name in ["skiff", "rhib", "dhow", "frigate"] {
            let model = bowwave_models::resolve(name, std::path::Path::new(".")).unwrap();
            let levels = casters(&model);
            assert!(levels.len() > 3, "{name}: {} levels", levels.len());
            let whole = model.indices.len() / 3;
            let mut last = 2 * whole;
            for level in &levels {
                let count = level.closed.len() + level.open.len();
                assert!(count > 0 && count <= last, "{name}, {} m: {count} triangles", level.error_m);
                last = count;
                let (mut low, mut high) = (model.max, model.min);
                for i in level.closed.iter().chain(&level.open).flatten() {
                    let at = model.vertices[*i as usize].position;
                    (low, high) = (low.min(at), high.max(at));
                }
                let off = (low - model.min).max(model.max - high);
                // Aerials may vanish, a hull does not.
                let room = 2.0 * level.error_m + 0.12 * model.max.x;
                assert!(off.truncate().max_element() < room, "{name}, {} m: {off}", level.error_m);
            }
            println!(
                "{name}: {whole} triangles, by level {:?}",
                levels.iter().map(|l| l.closed.len() + l.open.len()).collect::<Vec<_>>()
            );
        }
    }
}
