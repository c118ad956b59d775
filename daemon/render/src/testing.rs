//! Scenes and models that tests are made of.

use bowwave_core::{
    estimate::light::{Light, SeaTones, SkyLight},
    frame::{
        scene::{Hud, LeftOut, Pass, PassDecision, Scene, Status},
        view::ViewFrustum,
        wake::Wake,
    },
    geometry::{CameraPose, Lens, RigidPose, look},
    model::{Model, ModelId, ModelKind, Part, Vertex, Zone},
    sea::BeaufortForce,
    sky::SkyLobes,
    water::{ReflectionMethod, ShadowLevel, Water},
    world::{
        boats::{CourseState, Hull},
        fleet::Afloat,
    },
};
use glam::{DQuat, DVec2, DVec3, Vec2, Vec3};

/// A scene without boats, seen from 8 m above the sea to the north.
pub fn empty_scene(width: u32, height: u32) -> Scene {
    let mut passes = [PassDecision::LeftOut(LeftOut::NoBoats); Pass::COUNT];
    passes[Pass::Video as usize] = PassDecision::Run;
    passes[Pass::Hud as usize] = PassDecision::Run;
    Scene {
        frame: 0,
        time_s: 0.0,
        camera: CameraPose { world_from_camera: look(0.0, -0.03, 0.0), position: DVec3::new(0.0, 0.0, 8.0) },
        lens: Lens::pinhole(width, height, 0.9),
        passes,
        boats: Vec::new(),
        rounds: Vec::new(),
        lights: Vec::new(),
        lamps: Vec::new(),
        flash: None,
        searchlight: None,
        recoil: 1.0,
        light: Light {
            sun_direction: DVec3::new(0.5, -0.5, 0.7).normalize(),
            sun: Vec3::new(0.8, 0.76, 0.68),
            sky: Vec3::new(0.35, 0.42, 0.52),
            dome: SkyLobes::even(Vec3::new(0.35, 0.42, 0.52)),
            horizon: Vec3::new(0.6, 0.66, 0.72),
            sea: Vec3::new(0.08, 0.13, 0.15),
        },
        water: Water {
            method: ReflectionMethod::Full,
            force: BeaufortForce::new(1).unwrap(),
            shadow: ShadowLevel::Gradual,
        },
        wind: DVec2::new(0.6, 0.6),
        sky: SkyLight::of_bands(Vec3::new(0.6, 0.66, 0.72), Vec3::new(0.35, 0.42, 0.52)),
        tones: SeaTones::default(),
        noise: None,
        hud: Hud {
            status: Status::Ready,
            warning: None,
            rounds_left: 120,
            shots: 14,
            hits: 3,
            neutral_hits: 0,
            clock_s: 83.0,
            sea: None,
            heading_tenths_deg: None,
            ..Hud::READY
        },
        guide: None,
    }
}

/// A box with its bottom `draught` below the waterline; x forward.
pub fn box_model(name: &str, [length, beam, height]: [f32; 3], albedo: [f32; 3]) -> Model {
    let draught = 0.4;
    let (min, max) =
        (Vec3::new(-length / 2.0, -beam / 2.0, -draught), Vec3::new(length / 2.0, beam / 2.0, height));
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for sign in [-1.0_f32, 1.0] {
            let mut normal = Vec3::ZERO;
            normal[axis] = sign;
            let (u, v) =
                if sign > 0.0 { ((axis + 1) % 3, (axis + 2) % 3) } else { ((axis + 2) % 3, (axis + 1) % 3) };
            let first = u32::try_from(vertices.len()).unwrap();
            for (a, b) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                let mut position = Vec3::ZERO;
                position[axis] = if sign > 0.0 { max[axis] } else { min[axis] };
                position[u] = min[u] + a * (max[u] - min[u]);
                position[v] = min[v] + b * (max[v] - min[v]);
                vertices.push(Vertex { position, normal, uv: Vec2::new(a, b), albedo: Vec3::from(albedo) });
            }
            indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        }
    }
    let end = u32::try_from(indices.len()).unwrap();
    let (x, y) = (f64::from(length) / 2.0, f64::from(beam) / 2.0);
    Model {
        name: name.to_owned(),
        kind: ModelKind::Mesh,
        vertices,
        indices,
        parts: vec![Part { zone: Zone::Hull, indices: 0..end }],
        texture: None,
        waterline: vec![DVec2::new(x, y), DVec2::new(-x, y), DVec2::new(-x, -y), DVec2::new(x, -y)],
        min,
        max,
    }
}

/// Adds a boat at `range` metres, `bearing` right of north, heading turned by `yaw`, and switches the boats' passes on.
pub fn add_boat(scene: &mut Scene, models: &[Model], model: usize, range: f64, bearing: f64, yaw: f64) {
    let position = DVec3::new(range * bearing.sin(), range * bearing.cos(), 0.0);
    let pose = RigidPose { world_from_body: DQuat::from_rotation_z(yaw), position };
    add_boat_in(scene, models, model, pose);
}

/// The same under way for a minute, at `speed_m_s` and turning by `turn_rate` (rad/s clockwise).
pub fn add_moving_boat(
    scene: &mut Scene,
    models: &[Model],
    model: usize,
    place: [f64; 3],
    [speed_m_s, turn_rate]: [f64; 2],
) {
    let [range, bearing, yaw] = place;
    add_boat(scene, models, model, range, bearing, yaw);
    let position = DVec2::new(range * bearing.sin(), range * bearing.cos());
    let heading = std::f64::consts::FRAC_PI_2 - yaw;
    let now = 60.0;
    let state = |t: f64| {
        let heading_then = heading + turn_rate * (t - now);
        let went = if turn_rate.abs() < 1e-6 {
            DVec2::new(heading.sin(), heading.cos()) * (speed_m_s * (t - now))
        } else {
            let side = |h: f64| DVec2::new(-h.cos(), h.sin()) * (speed_m_s / turn_rate);
            side(heading_then) - side(heading)
        };
        CourseState { position: position + went, heading: heading_then, speed_m_s, sway_m_s: 0.0, turn_rate }
    };
    let hull = Hull::of(&models[model]);
    let wake = Wake::of(hull, f64::from(-models[model].min.z), now, state, |_| 0.0);
    let range_m = position.extend(-scene.camera.position.z).length();
    if let Some(boat) = scene
        .boats
        .iter_mut()
        .min_by(|a, b| (a.range_m - range_m).abs().total_cmp(&(b.range_m - range_m).abs()))
    {
        boat.wake = wake;
    }
    scene.passes[Pass::Wake as usize] = PassDecision::Run;
}

/// The same with any pose; the mean water is the world's z = 0. A boat that is not seen is not added.
pub fn add_boat_in(scene: &mut Scene, models: &[Model], model: usize, pose: RigidPose) {
    let eye = ViewFrustum {
        camera: &scene.camera,
        lens: &scene.lens,
        visibility_m: 20_000.0,
        wind: scene.wind,
        reflections: true,
        wakes: true,
        water_within_m: f64::INFINITY,
    };
    let model_id = ModelId(u16::try_from(model).unwrap());
    let boat = scene.boats.len();
    let seen = eye.see(&Afloat { boat, model_id, model: &models[model], pose, water_level: 0.0 });
    scene.boats.extend(seen);
    scene.boats.sort_by(|a, b| b.range_m.total_cmp(&a.range_m));
    for pass in [Pass::Shadow, Pass::Mirror, Pass::Water, Pass::Boats] {
        scene.passes[pass as usize] = PassDecision::Run;
    }
}
