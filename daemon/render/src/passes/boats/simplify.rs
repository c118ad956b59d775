//! What a mesh does not need for the size at which it is drawn. Small triangles cost by their number and not by their area, so far
//! boats are drawn from levels that lie within a part of a pixel of the whole model; and the back faces of closed parts, which
//! nobody sees, are told apart from open shells, which are seen from both sides and get a second one for the other.

use std::{collections::HashMap, ops::Range};

use bowwave_core::model::{Model, ModelKind, Vertex};
use bytemuck::Zeroable as _;
use meshopt::{SimplifyOptions, VertexDataAdapter, simplify_with_attributes_and_locks};
use shaders_spirv::interface::MeshVertex;

use crate::{
    passes::boats::casters::casters,
    passes::boats::parts::{Parts, triangles},
    passes::boats::split::{EDGE_PX, split},
    passes::boats::transfer::{BakedLight, CornerLight, SEA, baked_light},
    view::DETAIL_PX,
};

/// Error of the model that is drawn whole, metres: what is within it is nothing but triangles.
const ERROR_WHOLE_M: f32 = 0.004;
/// Error of the finest simplified level, metres; each level has twice the error of the one before.
const ERROR_MIN_M: f32 = 0.008;
/// No model is simplified to fewer triangles.
const TRIANGLES_MIN: usize = 40;
/// What a whole change of normal and of colour weighs, in parts of the level's error.
const NORMAL_WEIGHT: f32 = 0.5;
const FAR_NORMAL_WEIGHT: f32 = 1.5;
const ALBEDO_WEIGHT: f32 = 6.0;

/// As how many metres of distance a whole change of light counts: of what it gets of the sky's first lobes and of the sea, all of the first and
/// a part of the rest.
const LIGHT_M: f32 = 0.8;
/// Up to this error, metres, levels are made of the finer surface that holds light; farther off the model's own triangles hold enough.
const FINE_M: f32 = 0.02;
const LIGHT_TERMS: [(usize, f32); 4] = [(0, 1.0), (1, 0.4), (2, 0.4), (SEA, 0.4)];

/// Up to this error, metres, triangles on either side of an edge between two colours or of a sharp edge stay apart: stripes and gunwales are pixels wide
/// there, and boats that near are few. Farther off a boat has half as many triangles without.
const SEAMS_M: f32 = 0.1;

/// A model at one level of detail, as ranges of indices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Level {
    /// Distance of the surface from the model's, tenths of millimetres; 0 for the whole, which is within [`ERROR_WHOLE_M`].
    error_tenth_mm: u32,
    /// Triangles of closed parts: back faces can be left out.
    pub(crate) closed: Range<u32>,
    /// Triangles of open shells, each of their sides by itself.
    pub(crate) open: Range<u32>,
}

impl Level {
    /// Adds the triangles of closed parts and of open shells to `indices`.
    fn of(
        error_m: f32,
        indices: &mut Vec<u32>,
        (closed, open): (impl Iterator<Item = [u32; 3]>, impl Iterator<Item = [u32; 3]>),
    ) -> Self {
        let from = indices.len() as u32;
        indices.extend(closed.flatten());
        let between = indices.len() as u32;
        indices.extend(open.flatten());
        Self {
            error_tenth_mm: (error_m * 1e4).round() as u32,
            closed: from..between,
            open: between..indices.len() as u32,
        }
    }

    /// Distance of the surface from the model's, metres.
    pub(crate) fn error_m(&self) -> f64 {
        f64::from(self.error_tenth_mm) * 1e-4
    }
}

/// A model ready for drawing.
#[derive(Clone, Debug, Default)]
pub(crate) struct Simplified {
    pub(crate) vertices: Vec<MeshVertex>,
    pub(crate) indices: Vec<u32>,
    /// From the finest to the coarsest; never empty.
    pub(crate) levels: Vec<Level>,
    /// The same of the shape alone, which throws shadows; never empty.
    pub(crate) casters: Vec<Level>,
    /// Long edges are cut.
    bent: bool,
    /// Largest extent of the model, metres.
    size_m: f32,
}

/// What a pixel spans at a boat that is drawn from the level of that error, at least: the error hides in a part of it, and no boat is
/// looked at from nearer than where it fills the picture.
fn least_pixel_m(error_m: f32, size_m: f32) -> f32 {
    /// A boat that is longer than so many pixels is not seen whole.
    const FILLED_PX: f32 = 1600.0;
    (error_m.max(ERROR_MIN_M / 2.0) / DETAIL_PX as f32).max(size_m / FILLED_PX)
}

/// Makes the levels of `model`, whose indices are known to lie within its vertices; without long edges where a lens is `bent`.
pub(crate) fn simplify(model: &Model, bent: bool) -> Simplified {
    /// A level is kept if it has at most this share of the triangles of the one before.
    const WORTHWHILE: f64 = 0.85;
    let light = baked_light(model);
    let surface = &light.surface;
    let parts = Parts::of(surface);
    let size_m = (model.max - model.min).max_element();
    let mut all = Simplified { bent, size_m, ..Simplified::default() };
    let mut push = |error: f32, triangles: &[[u32; 3]], corners: &[CornerLight]| {
        let closed: Vec<bool> = triangles.iter().map(|t| parts.closed(t[0])).collect();
        all.push(error, triangles, &closed, Corners::new(surface, corners));
    };
    // A texture's seams would tear, and a picture has few triangles anyway.
    let whole = if model.texture.is_some() || model.kind == ModelKind::Quad {
        Vec::new()
    } else {
        triangles(&with_error(&light, model, &parts, ERROR_WHOLE_M))
    };
    if whole.is_empty() {
        push(0.0, &triangles(&surface.indices), &light.corners);
        all.casters = all.levels.clone();
        return all;
    }
    let mut last = whole.len();
    push(0.0, &whole, &light.on_level(&whole, ERROR_WHOLE_M));
    let mut error = ERROR_MIN_M;
    while error < size_m / 8.0 && last > TRIANGLES_MIN {
        let fewer = triangles(&with_error(&light, model, &parts, error));
        if !fewer.is_empty() && fewer.len() as f64 <= WORTHWHILE * last as f64 {
            last = fewer.len();
            push(error, &fewer, &light.on_level(&fewer, error));
        }
        error *= 2.0;
    }
    all.push_casters(model);
    all
}

/// The corners of one level: those of open shells are seen and lit from both sides, and each side has its own.
struct Corners<'a> {
    model: &'a Model,
    light: &'a [CornerLight],
    /// The drawn corner of a corner's side: 0 on that of its normal, 1 on the other.
    drawn: HashMap<(u32, usize), u32>,
}

impl<'a> Corners<'a> {
    fn new(model: &'a Model, light: &'a [CornerLight]) -> Self {
        Self { model, light, drawn: HashMap::new() }
    }

    fn drawn(&mut self, vertices: &mut Vec<MeshVertex>, corner: u32, side: usize) -> u32 {
        let (model, light) = (self.model, self.light);
        *self.drawn.entry((corner, side)).or_insert_with(|| {
            let (v, light) = (&model.vertices[corner as usize], &light[corner as usize]);
            vertices.push(lit_corner(v, light, side));
            vertices.len() as u32 - 1
        })
    }

    /// A triangle of the corners on the sides of their normals.
    fn front(&mut self, vertices: &mut Vec<MeshVertex>, triangle: [u32; 3]) -> [u32; 3] {
        triangle.map(|i| self.drawn(vertices, i, 0))
    }

    /// A triangle of the corners whose normals are on the side from which it is seen this way round.
    fn facing(&mut self, vertices: &mut Vec<MeshVertex>, triangle: [u32; 3]) -> [u32; 3] {
        let [a, b, c] = triangle.map(|i| self.model.vertices[i as usize].position);
        let face = (b - a).cross(c - a);
        triangle.map(|i| {
            let side = usize::from(face.dot(self.model.vertices[i as usize].normal) < 0.0);
            self.drawn(vertices, i, side)
        })
    }
}

/// A corner as it is drawn on one of its sides.
fn lit_corner(v: &Vertex, light: &CornerLight, side: usize) -> MeshVertex {
    let [a, b, c, d, e, f, g, h, i, sea, thrown @ ..] = light[side];
    MeshVertex {
        position: v.position.to_array(),
        normal: (if side == 0 { v.normal } else { -v.normal }).to_array(),
        uv: v.uv.to_array(),
        albedo: v.albedo.to_array(),
        sky0: [a, b, c, d],
        sky1: [e, f, g, h],
        sky2: [i, sea],
        thrown,
    }
}

/// The triangles that keep the surface within `error` metres, its shading, colours and light likewise.
fn with_error(light: &BakedLight, model: &Model, parts: &Parts, error: f32) -> Vec<u32> {
    let surface = &light.surface;
    let positions: Vec<[f32; 3]> = surface.vertices.iter().map(|v| v.position.to_array()).collect();
    let Ok(adapter) = VertexDataAdapter::new(bytemuck::cast_slice(&positions), size_of::<[f32; 3]>(), 0)
    else {
        return Vec::new();
    };
    let far = error > SEAMS_M;
    let normal = if far { FAR_NORMAL_WEIGHT } else { NORMAL_WEIGHT } * error;
    let albedo = ALBEDO_WEIGHT * error;
    let mut weights = vec![normal, normal, normal, albedo, albedo, albedo];
    // Weights are in parts of the extent.
    let light_weight = LIGHT_M / (model.max - model.min).max_element().max(0.1);
    weights.extend(LIGHT_TERMS.iter().chain(&LIGHT_TERMS).map(|(_, part)| part * light_weight));
    let mut attributes: Vec<f32> = Vec::with_capacity(weights.len() * surface.vertices.len());
    for (v, held) in surface.vertices.iter().zip(&light.corners) {
        attributes.extend(v.normal.to_array().into_iter().chain(v.albedo.to_array()));
        attributes.extend(held.iter().flat_map(|held| LIGHT_TERMS.map(|(term, _)| held[term])));
    }
    let locks: Vec<bool> = (0..surface.vertices.len() as u32).map(|v| parts.is_panel(v, error)).collect();
    let seams = if far { SimplifyOptions::Permissive } else { SimplifyOptions::None };
    simplify_with_attributes_and_locks(
        if error > FINE_M { &model.indices } else { &surface.indices },
        &adapter,
        &attributes,
        &weights,
        size_of_val(&weights[..]),
        &locks,
        TRIANGLES_MIN * 3,
        error,
        SimplifyOptions::ErrorAbsolute | SimplifyOptions::Prune | seams,
        None,
    )
}

impl Simplified {
    fn push(&mut self, error_m: f32, triangles: &[[u32; 3]], closed: &[bool], mut corners: Corners<'_>) {
        let mut drawn = Vec::with_capacity(2 * triangles.len());
        for (t, closed) in triangles.iter().zip(closed) {
            let [a, b, c] = *t;
            if *closed {
                drawn.push((corners.front(&mut self.vertices, *t), true));
            } else {
                drawn.push((corners.facing(&mut self.vertices, [a, b, c]), false));
                drawn.push((corners.facing(&mut self.vertices, [a, c, b]), false));
            }
        }
        let mut triangles = drawn;
        if self.bent {
            triangles = split(&mut self.vertices, triangles, EDGE_PX * least_pixel_m(error_m, self.size_m));
        }
        let of =
            |wanted: bool| triangles.iter().filter(move |(_, closed)| *closed == wanted).map(|(t, _)| *t);
        let level = Level::of(error_m, &mut self.indices, (of(true), of(false)));
        self.levels.push(level);
    }

    /// Adds the levels of the shape alone, with corners of their own, of which nothing but the place is looked at. Rays of the sun are straight
    /// in any lens.
    fn push_casters(&mut self, model: &Model) {
        let mut drawn: HashMap<u32, u32> = HashMap::new();
        let vertices = &mut self.vertices;
        let mut corner = |i: u32| {
            *drawn.entry(i).or_insert_with(|| {
                let position = model.vertices[i as usize].position.to_array();
                vertices.push(MeshVertex { position, ..MeshVertex::zeroed() });
                vertices.len() as u32 - 1
            })
        };
        for caster in casters(model) {
            let [closed, open] = [caster.closed, caster.open]
                .map(|triangles| triangles.into_iter().map(|t| t.map(&mut corner)).collect::<Vec<_>>());
            let triangles = (closed.into_iter(), open.into_iter());
            self.casters.push(Level::of(caster.error_m, &mut self.indices, triangles));
        }
        if self.casters.is_empty() {
            self.casters.clone_from(&self.levels);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::testing;

    #[test]
    fn a_box_is_closed_and_a_box_without_a_lid_or_inside_out_is_not() {
        let model = testing::box_model("box", [4.0, 2.0, 1.5], [0.5; 3]);
        let level = &simplify(&model, false).levels[0];
        assert_eq!((level.closed.len(), level.open.len()), (36, 0));
        let mut open = model.clone();
        open.indices.truncate(30);
        let made = simplify(&open, false);
        let level = &made.levels[0];
        // Five sides, each drawn both ways round: their corners may be more, their area is not.
        assert!(level.closed.is_empty() && level.open.len() >= 60);
        let at = |i: &u32| Vec3::from(made.vertices[*i as usize].position);
        let area: f32 = (made.indices[level.open.start as usize..level.open.end as usize].chunks_exact(3))
            .map(|t| 0.5 * (at(&t[1]) - at(&t[0])).cross(at(&t[2]) - at(&t[0])).length())
            .sum();
        let [length, beam, height] = (model.max - model.min).to_array();
        let sides = 2.0 * (length + beam) * height + length * beam;
        assert!((area - 2.0 * sides).abs() < 0.001 * area, "{area}, not twice {sides}");
        let mut inverted = model;
        inverted.indices.chunks_exact_mut(3).for_each(|t| t.swap(0, 1));
        assert_eq!(simplify(&inverted, false).levels[0].closed.len(), 0);
    }

    #[test]
    fn a_bent_lens_gets_no_long_edges_and_few_more_triangles() {
        for name in ["skiff", "rhib", "dhow", "frigate"] {
            let model = bowwave_models::resolve(name, std::path::Path::new(".")).unwrap();
            let (plain, bent) = (simplify(&model, false), simplify(&model, true));
            assert_eq!(plain.levels.len(), bent.levels.len());
            for (plain, level) in plain.levels.iter().zip(&bent.levels) {
                let longest = EDGE_PX * least_pixel_m(level.error_m() as f32, bent.size_m);
                let indices = &bent.indices[level.closed.start as usize..level.open.end as usize];
                for t in indices.chunks_exact(3) {
                    let at = |i: u32| Vec3::from(bent.vertices[i as usize].position);
                    for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                        assert!(at(t[a]).distance(at(t[b])) <= longest + 1e-4);
                    }
                }
                let count = plain.closed.len() + plain.open.len();
                println!("{name}: {} triangles, {} cut", count / 3, indices.len() / 3);
                assert!(indices.len() <= 4 * count + 3000, "{name}: {} of {count}", indices.len());
            }
        }
    }

    #[test]
    fn levels_get_coarser_and_keep_the_shape() {
        for name in ["skiff", "rhib", "dhow", "frigate"] {
            let model = bowwave_models::resolve(name, std::path::Path::new(".")).unwrap();
            let made = simplify(&model, false);
            assert!(made.levels.len() > 3, "{name}: {} levels", made.levels.len());
            // The whole holds light with few triangles more than the model has.
            let whole = made.levels[0].closed.len() + made.levels[0].open.len();
            let parts = Parts::of(&model);
            let drawn = |t: &[u32]| if parts.closed(t[0]) { 3 } else { 6 };
            let of_model: usize = model.indices.chunks_exact(3).map(drawn).sum();
            assert!(whole as f64 <= 1.3 * of_model as f64, "{name}: {whole} of {of_model}");
            let mut last = u32::MAX;
            for level in &made.levels {
                let count = (level.closed.len() + level.open.len()) as u32;
                assert!(count < last && count > 0);
                last = count;
                assert_eq!(level.closed.end, level.open.start);
                let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
                for i in &made.indices[level.closed.start as usize..level.open.end as usize] {
                    let p = Vec3::from(made.vertices[*i as usize].position);
                    (low, high) = (low.min(p), high.max(p));
                }
                // Small parts and aerials vanish; the boat's extent stays.
                let room = level.error_m() as f32 * 2.0 + 0.12 * model.max.x;
                assert!((low - model.min).abs().max_element() < room, "{name} {low} {}", model.min);
                assert!(
                    (high - model.max).truncate().abs().max_element() < room,
                    "{name} {high} {}",
                    model.max
                );
                assert!(high.z > 0.3 * model.max.z, "{name} {high} {}", model.max);
            }
        }
    }
}
