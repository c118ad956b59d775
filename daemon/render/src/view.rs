//! From the scene's f64 world to the f32 blocks that the shaders read. Everything is relative to camera or boat before it is
//! rounded, so nothing loses digits with distance from the mount.

use bowwave_core::{
    estimate::light::{Light, SeenNoise},
    frame::{
        lamps::{LAMPS_MAX, LampView},
        scene::{BoatView, Scene},
        view::NEAR_M,
    },
    geometry::{CameraPose, Distortion, Lens, RigidPose, horizon_dip},
    model::ModelKind,
};
use glam::{DMat3, DQuat, DVec3, DVec4, Vec3};
use shaders_spirv::interface::{BOAT_LAMPS, BoatBlock, FrameBlock};

/// Lens and light.
pub(crate) fn frame_block(scene: &Scene) -> FrameBlock {
    let lens = &scene.lens;
    let pair = |v: glam::DVec2| v.as_vec2().to_array();
    let light = |v: Vec3| v.extend(0.0).to_array();
    let Light { sun, sky, horizon, sea, .. } = scene.light;
    let (lamp, beam) = scene.searchlight.map_or_else(Default::default, |light| {
        let matt = light.strength * std::f64::consts::FRAC_1_PI;
        (light.lamp.extend(light.sharpness).as_vec4(), light.axis.extend(matt).as_vec4())
    });
    let noise = scene.noise.map_or_else(Default::default, |seen| noise_rows(&seen, lens.width));
    FrameBlock {
        noise,
        focal: pair(lens.focal),
        centre: pair(lens.centre),
        bend: bend(&lens.distortion),
        size: [lens.width as f32, lens.height as f32],
        near: NEAR_M as f32,
        r2_max: r2_max(lens) as f32,
        sun: light(sun),
        sky: light(sky),
        sea: light(sea),
        horizon: light(horizon),
        lamp: lamp.to_array(),
        beam: beam.to_array(),
        row_turn: lens.row_turn.extend(0.0).as_vec4().to_array(),
    }
}

/// The camera's noise as its shader draws it on a screen of that width.
fn noise_rows(seen: &SeenNoise, width: u32) -> [[f32; 4]; 4] {
    /// Whole numbers up to here are exact in single precision; after so many pictures noise comes again.
    const PICTURES: u32 = 1 << 24;
    let noise = &seen.noise;
    let [with_red, with_blue, red_blue] = noise.together.to_array();
    // Green is drawn first, then what red has beyond it, then what blue has beyond both (Cholesky).
    let own = (1.0 - with_red * with_red).max(0.0).sqrt();
    let blue_of_red = if own > 0.05 { (red_blue - with_red * with_blue) / own } else { 0.0 };
    let most = (1.0 - with_blue * with_blue).max(0.0).sqrt();
    // Where the picture is drawn larger, its grain is; where it is drawn smaller, pixels are left out of it.
    let picture_pixels = (seen.width as f32 / width as f32).min(1.0);
    [
        noise.read.extend(0.0).to_array(),
        noise.shot.extend(0.0).to_array(),
        [with_red, own, with_blue, blue_of_red.clamp(-most, most)],
        [(seen.picture % PICTURES) as f32, picture_pixels, f32::from(u8::from(noise.is_paired())), 0.0],
    ]
}

/// A fisheye is followed up to this angle from its axis, radians: what is drawn lies before the camera's plane.
const FISHEYE_MAX: f64 = 85f64.to_radians();

/// Squared angle tangent at which the lens stops being trusted: just short of where its radius folds back, as
/// [`Lens::project`] has it.
fn r2_max(lens: &Lens) -> f64 {
    let unlimited = 1e6;
    match lens.distortion {
        Distortion::None => unlimited,
        Distortion::RadialTangential(d) => (0.98 * d.reach2()).min(unlimited),
        Distortion::Fisheye(d) => (0.99 * d.reach()).min(FISHEYE_MAX).tan().powi(2),
    }
}

/// The model's coefficients: k1, k2, p1, p2 or k1 to k4.
fn bend(distortion: &Distortion) -> [f32; 4] {
    match distortion {
        Distortion::None => [0.0; 4],
        Distortion::RadialTangential(d) => {
            let (k, p) = (d.radial().as_vec2(), d.tangential().as_vec2());
            [k.x, k.y, p.x, p.y]
        }
        Distortion::Fisheye(d) => d.k().map(|k| k as f32),
    }
}

/// The pose in which a boat is drawn: its own, or, for a picture, upright and turned about z towards the camera, its bow on the
/// side to which the boat heads.
pub(crate) fn drawn_pose(camera: &CameraPose, boat: &BoatView, kind: ModelKind) -> RigidPose {
    if kind == ModelKind::Mesh {
        return boat.pose;
    }
    let away = (boat.pose.position - camera.position).with_z(0.0);
    let Some(away) = away.try_normalize() else { return boat.pose };
    let right = away.cross(DVec3::Z);
    let heads_right = (boat.pose.world_from_body * DVec3::X).dot(right) >= 0.0;
    let x = if heads_right { right } else { -right };
    let world_from_body = DQuat::from_mat3(&DMat3::from_cols(x, DVec3::Z.cross(x), DVec3::Z));
    RigidPose { world_from_body, position: boat.pose.position }
}

/// A boat's place in the shadow map, as its shader looks it up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shade {
    /// Rows of the matrix from the boat's space to texels and nearness to the sun.
    pub(crate) from_boat: [[f32; 4]; 3],
    /// Lowest and highest place, texels, at which the map is looked up.
    pub(crate) texels: [f32; 4],
    /// Distance off the surface at which it is looked up, metres.
    pub(crate) off_m: f32,
}

impl Shade {
    /// Nothing shades it.
    pub(crate) const NONE: Self =
        Self { from_boat: [[0.0; 4], [0.0; 4], [0.0, 0.0, 0.0, 2.0]], texels: [0.0; 4], off_m: 0.0 };
}

/// Boats are drawn simplified by no more than this, pixels.
pub(crate) const DETAIL_PX: f64 = 0.4;

/// Metres that a pixel spans at a boat.
pub(crate) fn pixel_m(scene: &Scene, boat: &BoatView) -> f64 {
    boat.range_m / scene.lens.focal.max_element().max(1.0)
}

/// By how much a boat may be simplified unseen, metres.
pub(crate) fn detail_m(scene: &Scene, boat: &BoatView) -> f64 {
    DETAIL_PX * pixel_m(scene, boat)
}

/// A boat as the camera sees it, or, with `mirrored`, its mirror image in the plane of its mean water.
pub(crate) fn boat_block(
    scene: &Scene,
    boat: &BoatView,
    pose: &RigidPose,
    shade: &Shade,
    mirrored: bool,
) -> BoatBlock {
    let camera = &scene.camera;
    let flip = if mirrored { DVec3::new(1.0, 1.0, -1.0) } else { DVec3::ONE };
    let lift = if mirrored { DVec3::new(0.0, 0.0, 2.0 * boat.water_level) } else { DVec3::ZERO };
    let camera_from_world = DMat3::from_quat(camera.world_from_camera.inverse());
    let world_from_boat = DMat3::from_quat(pose.world_from_body);
    let turn = camera_from_world * DMat3::from_diagonal(flip) * world_from_boat;
    let shift = camera_from_world * (pose.position * flip + lift - camera.position);
    // The mirrored boat seen by the camera is the boat seen by the mirrored camera.
    let eye = camera.position * flip + lift;
    let boat_from_world = world_from_boat.transpose();
    let row = |r: usize| turn.row(r).extend(shift[r]).as_vec4().to_array();
    let plane = |normal: DVec3, through: DVec3| -> [f32; 4] {
        let value: DVec4 = (boat_from_world * normal).extend(normal.dot(pose.position - through));
        value.as_vec4().to_array()
    };
    let water_plane = plane(DVec3::Z, DVec3::new(0.0, 0.0, boat.water_level));
    let horizon_plane = match sight_normal(camera, pose.position) {
        Some(normal) if boat.beyond_horizon && !mirrored => plane(normal, camera.position),
        _ => [0.0, 0.0, 0.0, 1.0],
    };
    let lobes = scene.light.dome.turned(pose.world_from_body).terms;
    let (lamps, lamp_lights) = lamps_on(scene, pose);
    BoatBlock {
        lamps,
        lamp_lights,
        air: [0.0; 4],
        lobes: lobes.map(|light| light.extend(0.0).to_array()),
        camera_from_boat: [row(0), row(1), row(2)],
        water_plane,
        horizon_plane,
        sun: (boat_from_world * scene.light.sun_direction)
            .extend(f64::from(shade.off_m))
            .as_vec4()
            .to_array(),
        shadow_from_boat: shade.from_boat,
        shadow_box: shade.texels,
        eye: (boat_from_world * (eye - pose.position)).extend(f64::from(boat.haze)).as_vec4().to_array(),
    }
}

/// Places and lights of the lamps that light a boat most, in its space.
fn lamps_on(scene: &Scene, pose: &RigidPose) -> ([[f32; 4]; BOAT_LAMPS], [[f32; 4]; BOAT_LAMPS]) {
    let (mut places, mut lights) = ([[0.0; 4]; BOAT_LAMPS], [[0.0; 4]; BOAT_LAMPS]);
    let mut brightest: [Option<&LampView>; LAMPS_MAX] = [None; LAMPS_MAX];
    brightest.iter_mut().zip(&scene.lamps).for_each(|(slot, lamp)| *slot = Some(lamp));
    let brightness =
        |lamp: &Option<&LampView>| lamp.map_or(-1.0, |lamp| lamp.matt_at(pose.position).max_element());
    brightest.sort_unstable_by(|a, b| brightness(b).total_cmp(&brightness(a)));
    for ((place, light), lamp) in places.iter_mut().zip(&mut lights).zip(brightest.iter().flatten()) {
        let lamp_in_boat = pose.world_from_body.inverse() * (lamp.at - pose.position);
        let air = (-lamp.extinction_per_m * lamp_in_boat.length()).exp() as f32;
        *place = lamp_in_boat.extend(0.0).as_vec4().to_array();
        *light = (lamp.strength * (std::f32::consts::FRAC_1_PI * air)).extend(0.0).to_array();
    }
    (places, lights)
}

/// Upward normal of the plane that holds the eye and the stretch of sea horizon before `target`.
fn sight_normal(camera: &CameraPose, target: DVec3) -> Option<DVec3> {
    let ahead = (target - camera.position).with_z(0.0).try_normalize()?;
    let dip = horizon_dip(camera.position.z);
    Some(DVec3::Z * dip.cos() + ahead * dip.sin())
}

#[cfg(test)]
mod tests {
    use bowwave_core::{
        geometry::{curvature_drop, look},
        model::ModelId,
    };
    use glam::DVec2;

    use super::*;
    use crate::testing;

    fn boat(pose: RigidPose, water_level: f64) -> BoatView {
        let range_m = pose.position.length();
        BoatView {
            boat: 0,
            model: ModelId(0),
            pose,
            water_level,
            hidden_m: 0.0,
            hull: None,
            reflection: None,
            wake: None,
            range_m,
            haze: 0.25,
            beyond_horizon: false,
        }
    }

    fn apply(block: &BoatBlock, p: DVec3) -> DVec3 {
        let v = p.extend(1.0).as_vec4();
        let row = |i: usize| f64::from(glam::Vec4::from_array(block.camera_from_boat[i]).dot(v));
        DVec3::new(row(0), row(1), row(2))
    }

    #[test]
    fn boat_block_agrees_with_the_cameras_own_projection_at_any_distance() {
        let mut scene = testing::empty_scene(320, 180);
        scene.camera =
            CameraPose { world_from_camera: look(0.4, -0.02, 0.3), position: DVec3::new(0.0, 0.0, 8.0) };
        for range in [20.0, 500.0, 5000.0] {
            let position = DVec3::new(range * 0.4_f64.sin(), range * 0.4_f64.cos(), -0.3);
            let pose = RigidPose {
                world_from_body: DQuat::from_euler(glam::EulerRot::ZYX, 1.0, 0.1, 0.2),
                position,
            };
            let view = boat(pose, -0.5);
            let p = DVec3::new(3.0, -1.0, 2.0);
            let direct = apply(&boat_block(&scene, &view, &pose, &Shade::NONE, false), p);
            let want = scene.camera.to_camera(pose.to_world(p));
            assert!((direct - want).length() < 1e-6 * range.max(100.0), "{direct} {want}");
            let block = boat_block(&scene, &view, &pose, &Shade::NONE, true);
            let world = pose.to_world(p);
            let mirrored = DVec3::new(world.x, world.y, 2.0 * -0.5 - world.z);
            let want = scene.camera.to_camera(mirrored);
            assert!((apply(&block, p) - want).length() < 1e-6 * range.max(100.0));
            let height = f64::from(glam::Vec4::from_array(block.water_plane).dot(p.extend(1.0).as_vec4()));
            assert!((height - (world.z + 0.5)).abs() < 1e-5);
            assert!((block.eye[3] - 0.25).abs() < 1e-6);
        }
    }

    #[test]
    fn line_of_sight_over_the_horizon_hides_the_hull_but_not_the_mast() {
        let mut scene = testing::empty_scene(320, 180);
        scene.camera.position = DVec3::new(0.0, 0.0, 3.0);
        // The horizon of a 3 m eye lies at 6.6 km; at 15 km the sea hides the lowest 4.8 m.
        let range = 15_000.0;
        let drop = curvature_drop(range);
        let position = DVec3::new(0.0, range, -drop);
        let pose = RigidPose { world_from_body: DQuat::IDENTITY, position };
        let view = BoatView { beyond_horizon: true, ..boat(pose, -drop) };
        let block = boat_block(&scene, &view, &pose, &Shade::NONE, false);
        let above =
            |z: f64| glam::Vec4::from_array(block.horizon_plane).dot(DVec4::new(0.0, 0.0, z, 1.0).as_vec4());
        let hidden = (0..200).map(|i| f64::from(i) * 0.1).find(|z| above(*z) > 0.0).unwrap();
        let tangent = (2.0 * 3.0 * bowwave_core::geometry::EARTH_RADIUS_M
            / (1.0 - bowwave_core::geometry::REFRACTION))
            .sqrt();
        let want = curvature_drop(range - tangent);
        assert!((hidden - want).abs() < 0.2, "{hidden} {want}");
    }

    #[test]
    fn picture_is_turned_to_the_camera_with_its_bow_the_way_the_boat_heads() {
        let scene = testing::empty_scene(320, 180);
        let position = DVec3::new(0.0, 100.0, 0.0);
        for (heading, bow) in [(0.3, DVec3::X), (2.9, DVec3::NEG_X)] {
            let pose = RigidPose { world_from_body: DQuat::from_rotation_z(heading), position };
            let drawn = drawn_pose(&scene.camera, &boat(pose, 0.0), ModelKind::Quad);
            assert!((drawn.world_from_body * DVec3::X - bow).length() < 1e-9);
            assert!((drawn.world_from_body * DVec3::Z - DVec3::Z).length() < 1e-9);
            assert_eq!(drawn_pose(&scene.camera, &boat(pose, 0.0), ModelKind::Mesh), pose);
        }
    }

    #[test]
    fn distortion_is_trusted_up_to_the_fold_and_no_further() {
        let mut lens = Lens::pinhole(320, 180, 1.0);
        assert_eq!(r2_max(&lens), 1e6);
        lens.distortion = Distortion::radial_tangential(DVec2::new(-0.3, 0.01), DVec2::ZERO);
        let limit = r2_max(&lens);
        assert!(lens.project(DVec3::new(limit.sqrt() * 0.99, 0.0, 1.0)).is_some());
        assert!(lens.project(DVec3::new(limit.sqrt() * 1.02, 0.0, 1.0)).is_none());
        lens.distortion = Distortion::radial_tangential(DVec2::new(0.44, 0.0), DVec2::ZERO);
        assert_eq!(r2_max(&lens), 1e6);
    }
}
