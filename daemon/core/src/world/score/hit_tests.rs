use glam::{DQuat, Vec2, Vec3};
use proptest::prelude::*;

use super::*;
use crate::model::Part;

/// A box from `min` to `max`: its aft third is the engine, the rest the hull.
pub(crate) fn boxed(min: Vec3, max: Vec3) -> Model {
    let mut model = Model {
        name: "box".into(),
        kind: ModelKind::Mesh,
        vertices: Vec::new(),
        indices: Vec::new(),
        parts: Vec::new(),
        texture: None,
        waterline: Vec::new(),
        min,
        max,
    };
    let split = min.x + (max.x - min.x) / 3.0;
    for (zone, from, to) in [(Zone::Engine, min.x, split), (Zone::Hull, split, max.x)] {
        let start = model.indices.len() as u32;
        let first = model.vertices.len() as u32;
        for i in 0..8 {
            let pick = |bit: u32, low: f32, high: f32| if i & bit == 0 { low } else { high };
            let position = Vec3::new(pick(1, from, to), pick(2, min.y, max.y), pick(4, min.z, max.z));
            model.vertices.push(Vertex { position, normal: Vec3::Z, uv: Vec2::ZERO, albedo: Vec3::ONE });
        }
        for [a, b, c, d] in
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
        {
            model.indices.extend([a, b, c, a, c, d].map(|i: u32| i + first));
        }
        model.parts.push(Part { zone, indices: start..model.indices.len() as u32 });
    }
    model
}

pub(in crate::world::score) fn vector(reach: f64) -> impl Strategy<Value = DVec3> {
    (-reach..reach, -reach..reach, -reach..reach).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

fn depth(model: &Model, p: DVec3) -> f64 {
    (p - model.min.as_dvec3()).min(model.max.as_dvec3() - p).min_element()
}

/// A picture 4 m wide and 2 m high, its left half opaque.
pub(in crate::world::score) fn picture() -> Model {
    let corner = |x: f32, z: f32, u: f32, v: f32| Vertex {
        position: Vec3::new(x, 0.0, z),
        normal: Vec3::NEG_Y,
        uv: Vec2::new(u, v),
        albedo: Vec3::ONE,
    };
    Model {
        name: "picture".into(),
        kind: ModelKind::Quad,
        vertices: vec![
            corner(-2.0, 0.0, 0.0, 1.0),
            corner(2.0, 0.0, 1.0, 1.0),
            corner(2.0, 2.0, 1.0, 0.0),
            corner(-2.0, 2.0, 0.0, 0.0),
        ],
        indices: vec![0, 1, 2, 0, 2, 3],
        parts: vec![Part { zone: Zone::Hull, indices: 0..6 }],
        texture: Some(Texture { width: 2, height: 1, rgba: vec![9, 9, 9, 255, 9, 9, 9, 0] }),
        waterline: Vec::new(),
        min: Vec3::new(-2.0, 0.0, 0.0),
        max: Vec3::new(2.0, 0.0, 2.0),
    }
}

#[test]
fn a_round_passes_the_transparent_part_of_a_picture() {
    let model = picture();
    let hit = |x: f64, z: f64| strike(&model, DVec3::new(x, -10.0, z), DVec3::new(x, 10.0, z));
    assert!(hit(-1.0, 1.0).is_some() && hit(-2.0, 2.0).is_some() && hit(-2.0, 0.0).is_some());
    assert_eq!(hit(1.0, 1.0), None);
    assert_eq!(hit(2.0, 0.0), None);
}

#[test]
fn the_nearest_part_wins() {
    let model = boxed(Vec3::new(-3.0, -1.0, 0.0), Vec3::new(3.0, 1.0, 1.0));
    let along =
        strike(&model, DVec3::new(-20.0, 0.2, 0.4), DVec3::new(20.0, 0.2, 0.4)).expect("through both");
    assert_eq!(along.zone, Zone::Engine);
    assert!((along.point - DVec3::new(-3.0, 0.2, 0.4)).length() < 1e-9);
    let back = strike(&model, DVec3::new(20.0, 0.2, 0.4), DVec3::new(-20.0, 0.2, 0.4)).expect("through both");
    assert_eq!(back.zone, Zone::Hull);
}

#[test]
fn a_round_through_a_seam_or_corner_is_a_hit() {
    let model = boxed(Vec3::splat(-1.0), Vec3::ONE);
    // Down the diagonal that two triangles of a face share, through an edge of the box, and through a corner.
    for (x, y) in [(0.5, 0.5), (1.0, 0.3), (1.0, 1.0), (-1.0, -1.0)] {
        assert!(strike(&model, DVec3::new(x, y, 9.0), DVec3::new(x, y, -9.0)).is_some(), "({x}, {y})");
    }
}

#[test]
fn a_broken_model_is_ridden_out() {
    let mut model = boxed(Vec3::splat(-1.0), Vec3::ONE);
    model.indices[0] = 77;
    model.parts.push(Part { zone: Zone::Helm, indices: 500..900 });
    assert!(strike(&model, DVec3::Z * 5.0, DVec3::Z * -5.0).is_some());
    for bad in [DVec3::NAN, DVec3::INFINITY] {
        assert_eq!(strike(&model, bad, DVec3::ZERO), None);
    }
}

proptest! {
    #[test]
    fn strikes_what_dense_sampling_finds(
        low in vector(4.0), size in vector(4.0), a in vector(12.0), b in vector(12.0),
    ) {
        let low = low.as_vec3();
        let model = boxed(low, low + size.abs().as_vec3() + Vec3::splat(0.05));
        prop_assume!(depth(&model, a) < 0.0);
        let n = 5000;
        let at = |i: i32| a.lerp(b, f64::from(i) / f64::from(n));
        let deepest = (0..=n).map(|i| depth(&model, at(i))).fold(f64::NEG_INFINITY, f64::max);
        let entered = (0..=n).find(|&i| depth(&model, at(i)) > 0.0);
        match strike(&model, a, b) {
            Some(hit) => {
                // Never beside the box, and never behind where sampling is already inside.
                prop_assert!(deepest > -0.01, "hit {hit:?} but {deepest} m outside");
                prop_assert!(depth(&model, hit.point).abs() < 1e-4, "not on the surface: {hit:?}");
                if let Some(i) = entered {
                    prop_assert!(hit.fraction <= f64::from(i) / f64::from(n) + 1e-9);
                    prop_assert!(hit.fraction >= f64::from(i - 1) / f64::from(n) - 1e-9 || deepest < 0.01);
                }
            }
            None => prop_assert!(deepest <= 1e-9, "missed by {deepest} m inside"),
        }
    }

    #[test]
    fn poses_between_the_ends_move_steadily(
        t in 0.0..1.0_f64, turn in -0.3..0.3_f64, moved in vector(3.0),
    ) {
        let model = boxed(Vec3::splat(-1.0), Vec3::ONE);
        let from = RigidPose { world_from_body: DQuat::from_rotation_z(1.0), position: DVec3::Y * 100.0 };
        let to = RigidPose { world_from_body: DQuat::from_rotation_z(1.0 + turn), position: from.position + moved };
        let boat = Moving { model: &model, from_s: 5.0, from, to_s: 5.1, to };
        let pose = boat.pose_at(5.0 + 0.1 * t, DVec3::ZERO);
        prop_assert!((pose.position - (from.position + moved * t)).length() < 1e-9);
        let exact = DQuat::from_rotation_z(1.0 + turn * t);
        prop_assert!(pose.world_from_body.angle_between(exact) < 2e-3);
    }
}
