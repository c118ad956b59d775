use glam::DVec2;
use proptest::prelude::*;

use super::*;
use bowwave_core::{
    event::PixelFormat,
    geometry::{curvature_drop, horizon_dip, look},
    model::{ModelKind, Vertex},
    water::ReflectionMethod,
};

fn parse(text: &str) -> Result<Still, TomlError> {
    Still::parse(text, "scene.toml")
}

fn grey(width: u32, height: u32) -> Picture {
    Picture::new(PixelFormat::Rgb, width, height, vec![120; (width * height * 3) as usize].into()).unwrap()
}

fn block() -> Model {
    let corner = |p: [f32; 3]| Vertex {
        position: p.into(),
        normal: glam::Vec3::Z,
        uv: glam::Vec2::ZERO,
        albedo: glam::Vec3::ONE,
    };
    Model {
        name: "block".into(),
        kind: ModelKind::Mesh,
        vertices: vec![corner([-3.0, -1.0, -0.3]), corner([3.0, 1.0, 1.5])],
        indices: vec![],
        parts: vec![],
        texture: None,
        waterline: vec![],
        min: glam::Vec3::new(-3.0, -1.0, -0.3),
        max: glam::Vec3::new(3.0, 1.0, 1.5),
    }
}

const PLAIN: &str = "picture = \"a.png\"\n[camera]\neye_height_m = 4\nhfov_deg = 60\npitch_deg = -2\n";

#[test]
fn the_example_is_sound_and_its_boats_stand_in_the_picture() {
    let still = parse(EXAMPLE).unwrap();
    let (models, ids) = (vec![block()], vec![ModelId(0); 2]);
    let Composed { scene, plan } = still.compose(&grey(1280, 720), 0, (&models, &ids), None).unwrap();
    assert_eq!(scene.boats.len(), 2);
    assert!(scene.boats.iter().all(|b| b.hull.is_some()), "{:?}", scene.boats);
    assert!(scene.runs(Pass::Boats) && scene.runs(Pass::Water) && !scene.runs(Pass::Hud));
    assert_eq!(plan.size, (1280, 720));
}

#[test]
fn mistakes_are_named_by_line_and_column() {
    let boat = |line: &str| format!("{PLAIN}[[boat]]\nmodel = \"skiff\"\n{line}\n");
    let cases = [
        ("picture = \n".to_owned(), "1:11"),
        ("[camera]\neye_height_m = 4\nhfov_deg = 60\npitch_deg = 0\n".to_owned(), "picture: is missing"),
        (format!("{PLAIN}[boats]\n"), "6:2: boats: unknown key"),
        (
            PLAIN.replace("eye_height_m = 4", "eye_height_m = -4"),
            "3:16: camera.eye_height_m: -4 is not allowed",
        ),
        (
            PLAIN.replace("eye_height_m = 4", "eye_height_m = nan"),
            "3:16: camera.eye_height_m: nan is not allowed",
        ),
        (
            PLAIN.replace("hfov_deg = 60", "hfov_deg = 60\nfocal_px = 9"),
            "camera.hfov_deg: says the same as focal_px",
        ),
        (format!("{PLAIN}[sea]\nsource = \"video\"\n"), "7:1: sea.source: unknown key; known are beaufort"),
        (PLAIN.replace("pitch_deg", "pitsch_deg"), "5:1: camera.pitsch_deg: unknown key"),
        (PLAIN.replace("pitch_deg = -2", ""), "camera.horizon: is missing"),
        (
            PLAIN.replace("pitch_deg = -2", "horizon = [[1, 2]]"),
            "5:11: camera.horizon: [[1, 2]] is not allowed; give two points",
        ),
        (PLAIN.replace("pitch_deg = -2", "horizon = [[1, 2], [3]]"), "camera.horizon: [3] is not allowed"),
        (format!("{PLAIN}horizon = [[1, 2], [900, 4]]\n"), "camera.pitch_deg: follows from horizon"),
        (boat("heading_deg = 0"), "boat[1].waterline_px: is missing"),
        (
            boat("waterline_px = [1, 2, 3]\nheading_deg = 0"),
            "8:16: boat[1].waterline_px: [1, 2, 3] is not allowed; give a point of the water",
        ),
        (boat("waterline_px = [1, 2]\nrange_m = 9\nheading_deg = 0"), "9:11: boat[1].range_m: follows from"),
        (
            boat("range_m = 1e9\nbearing_deg = 0\nheading_deg = 0"),
            "8:11: boat[1].range_m: 1e9 is not allowed",
        ),
        (format!("{PLAIN}[reflection]\nmethod = \"magic\"\n"), "7:10: reflection.method: \"magic\""),
        (format!("{PLAIN}[light]\nsun_strength = 2\n"), "7:16: light.sun_strength: 2 is not allowed"),
    ];
    for (text, words) in cases {
        let said = parse(&text).unwrap_err().to_string();
        assert!(said.contains(words) && said.starts_with("scene.toml:"), "'{words}' not in: {said}");
        assert!(!said.contains('\n'), "{said}");
    }
}

#[test]
fn what_does_not_fit_the_picture_is_refused() {
    let boat = |place: &str| format!("{PLAIN}[[boat]]\nmodel = \"block\"\n{place}\nheading_deg = 0\n");
    let horizon = |points: &str| PLAIN.replace("pitch_deg = -2", &format!("horizon = {points}"));
    let cases = [
        (boat("waterline_px = [320, 10]"), "8:16: boat[1].waterline_px: [320, 10] lies above"),
        (boat("waterline_px = [700, 300]"), "lies outside the picture of 640x480"),
        (boat("range_m = 2\nbearing_deg = 0"), "8:11: boat[1].range_m: boat 1 lies 2.0 m off"),
        (horizon("[[10, 20], [30, 20]]"), "20 pixels apart"),
        (horizon("[[10, 20], [630, 500]]"), "5:11: camera.horizon: [630, 500] lies outside"),
        (PLAIN.replace("hfov_deg = 60", "focal_px = 1e6"), "4:12: camera.focal_px: makes a field of view"),
        (PLAIN.replace("hfov_deg = 60", ""), "focal_px: is missing, and the picture does not tell it"),
    ];
    for (text, words) in cases {
        let still = parse(&text).unwrap();
        let said =
            still.compose(&grey(640, 480), 0, (&[block()], &[ModelId(0)]), None).unwrap_err().to_string();
        assert!(said.contains(words), "'{words}' not in: {said}");
    }
}

#[test]
fn the_pictures_own_focal_length_is_used_where_the_text_has_none() {
    let still = parse(&PLAIN.replace("hfov_deg = 60", "")).unwrap();
    assert_eq!(still.sight((640, 480), Some(500.0)).unwrap().0.focal, DVec2::splat(500.0));
    // 26 mm on a 4:3 picture: a diagonal of 43.27 mm is 800 pixels.
    let film = parse(&PLAIN.replace("hfov_deg = 60", "focal_35mm_mm = 26")).unwrap();
    let focal = film.sight((640, 480), Some(500.0)).unwrap().0.focal.x;
    assert!((focal - 26.0 / 43.2666 * 800.0).abs() < 0.01, "{focal}");
}

#[test]
fn boats_of_a_series_move_and_methods_have_names() {
    let text = format!(
        "interval_s = 2.0\n{PLAIN}[[boat]]\nmodel = \"block\"\nrange_m = 60\nbearing_deg = 0\nheading_deg = 90\n\
         speed_kn = 10\n[sea]\nbeaufort = 0\n"
    );
    let still = parse(&text).unwrap();
    let at = |index| {
        let composed = still.compose(&grey(640, 480), index, (&[block()], &[ModelId(0)]), None).unwrap();
        composed.scene.boats[0].pose.position
    };
    let moved = at(3) - at(0);
    assert!((moved.x - 6.0 * 10.0 * 1852.0 / 3600.0).abs() < 1e-9 && moved.y.abs() < 1e-9, "{moved}");
    for method in ReflectionMethod::ALL {
        assert_eq!(ReflectionMethod::of_name(method.name()), Some(method));
    }
    assert_eq!(ReflectionMethod::of_name("full-as-published"), Some(ReflectionMethod::FullAsPublished));
    assert_eq!(ReflectionMethod::of_name("none"), Some(ReflectionMethod::Off));
    assert_eq!(ReflectionMethod::of_name("nothing"), None);
}

proptest! {
    /// Two points of a horizon that a camera sees give that camera's attitude back.
    #[test]
    fn the_horizon_tells_how_the_camera_was_held(
        azimuth in -3.0..3.0f64, pitch in -0.25..0.25f64, roll in -0.4..0.4f64, height in 0.5..40.0f64,
        left in -0.42..-0.1f64, right in 0.1..0.42f64, k1 in -0.05..0.05f64,
    ) {
        let mut lens = Lens::pinhole(1200, 900, 1.0);
        lens.distortion = bowwave_core::geometry::Distortion::radial_tangential(DVec2::X * k1, DVec2::ZERO);
        let held = look(azimuth, pitch, roll);
        let point = |off: f64| {
            let (a, d) = (azimuth + off, horizon_dip(height));
            let far = glam::DVec3::new(a.sin() * d.cos(), a.cos() * d.cos(), -d.sin());
            lens.project(held.inverse() * far).unwrap()
        };
        let points = [point(left), point(right)];
        let inside = |p: DVec2| p.cmpge(DVec2::ZERO).all() && p.x <= 1200.0 && p.y <= 900.0;
        prop_assume!(points.into_iter().all(inside));
        let mut camera = parse(PLAIN).unwrap().camera;
        camera.eye_height_m = height;
        camera.azimuth = azimuth;
        camera.attitude = StillAttitude::Horizon(points);
        let found = camera.pose(&lens).unwrap().world_from_camera;
        prop_assert!(found.angle_between(held) < 1e-6, "{}", found.angle_between(held));
    }

    /// A boat put on a pixel is seen on that pixel.
    #[test]
    fn a_boat_stands_on_its_pixel(x in 50.0..590.0f64, y in 250.0..470.0f64, height in 1.0..30.0f64) {
        let mut still = parse(PLAIN).unwrap();
        still.camera.eye_height_m = height;
        let (lens, camera) = still.sight((640, 480), None).unwrap();
        let eye = ViewFrustum { camera: &camera, lens: &lens, visibility_m: 1e4, wind: DVec2::ZERO, reflections: true, wakes: true };
        let pixel = DVec2::new(x, y);
        let Ok(place) = camera::on_the_sea(&eye, pixel) else { return Ok(()) };
        let foot = place.extend(-curvature_drop(place.length()));
        let seen = lens.project(camera.to_camera(foot)).unwrap();
        prop_assert!(seen.distance(pixel) < 1e-3, "{seen} {pixel}");
    }
}
