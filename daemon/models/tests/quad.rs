//! Boats that are pictures.

#![allow(clippy::expect_used, reason = "a test helper, too, stops at the first thing that is wrong")]

use std::{fs, path::Path};

use bowwave_core::{
    model::{Model, ModelKind, Zone},
    text::toml::TomlError,
};
use bowwave_models::{Bow, FRIGATE_QUAD, ModelError, QuadSpec, Rect, load_quad, quad, resolve};
use image::{Rgba, RgbaImage};

/// A see-through picture of 200 x 100 with a grey boat in columns 20 to 179 and rows 30 to 89, its bow white.
fn picture() -> RgbaImage {
    RgbaImage::from_fn(200, 100, |x, y| {
        let boat = (20..180).contains(&x) && (30..90).contains(&y);
        let shade = if x >= 170 { 255 } else { 90 };
        if boat { Rgba([shade, shade, shade, 255]) } else { Rgba([0; 4]) }
    })
}

fn spec() -> QuadSpec {
    QuadSpec { length_m: 16.0, waterline_row: 80.0, bow: Bow::Right, engine: None, helm: None }
}

fn area(m: &Model, zone: Option<Zone>) -> f32 {
    let parts = m.parts.iter().filter(|p| zone.is_none_or(|z| z == p.zone));
    let ranges = parts.map(|p| &m.indices[p.indices.start as usize..p.indices.end as usize]);
    let corner = |i: u32| m.vertices[i as usize].position;
    ranges
        .flat_map(|r| r.chunks_exact(3))
        .map(|t| {
            let [a, b, c] = [corner(t[0]), corner(t[1]), corner(t[2])];
            // The front is seen from starboard.
            -(b - a).cross(c - a).y / 2.0
        })
        .sum()
}

#[test]
fn a_picture_has_the_size_and_waterline_that_it_is_given() {
    let m = quad("p.png", "p", picture(), &spec()).expect("a model");
    assert_eq!(m.kind, ModelKind::Quad);
    // 160 columns are 16 m: 0.1 m a pixel; 50 rows above the water, 10 below.
    assert!(
        (m.length_m() - 16.0).abs() < 1e-5
            && (m.height_m() - 5.0).abs() < 1e-5
            && (m.min.z + 1.0).abs() < 1e-5
    );
    let t = m.texture.as_ref().expect("texture");
    assert_eq!((t.width, t.height), (160, 60));
    assert!((area(&m, None) - 16.0 * 6.0).abs() < 1e-3);
    assert!(m.vertices.iter().all(|v| v.normal == glam::Vec3::NEG_Y && v.position.y == 0.0));
    let along: Vec<f64> = m.waterline.iter().map(|p| p.x).collect();
    assert_eq!(along, [-8.0, 8.0, 8.0, -8.0]);
    // The bow is forward and to the right, uv (0, 0) is the upper left.
    let bow = m.vertices.iter().find(|v| v.uv == glam::Vec2::new(1.0, 0.0)).expect("a corner");
    assert!(bow.position.x > 7.99 && bow.position.z > 4.99);
}

#[test]
fn a_picture_with_its_bow_to_the_left_is_mirrored() {
    let mirrored = image::imageops::flip_horizontal(&picture());
    let left = QuadSpec {
        bow: Bow::Left,
        helm: Some(Rect { left: 100.0, top: 30.0, right: 140.0, bottom: 50.0 }),
        ..spec()
    };
    let right = QuadSpec { helm: Some(Rect { left: 60.0, top: 30.0, right: 100.0, bottom: 50.0 }), ..spec() };
    assert_eq!(
        quad("p", "p", mirrored, &left).expect("a model"),
        quad("p", "p", picture(), &right).expect("a model")
    );
}

#[test]
fn regions_become_parts() {
    let engine = Some(Rect { left: 40.0, top: 60.0, right: 80.0, bottom: 90.0 });
    let helm = Some(Rect { left: 100.0, top: 35.0, right: 120.0, bottom: 45.0 });
    let m = quad("p", "p", picture(), &QuadSpec { engine, helm, ..spec() }).expect("a model");
    assert!((area(&m, Some(Zone::Engine)) - 4.0 * 3.0).abs() < 1e-3);
    assert!((area(&m, Some(Zone::Helm)) - 2.0).abs() < 1e-3);
    assert!((area(&m, Some(Zone::Hull)) - (96.0 - 14.0)).abs() < 1e-3);
    // By default: shares of length and height.
    let m = quad("p", "p", picture(), &spec()).expect("a model");
    assert!((area(&m, Some(Zone::Engine)) - 16.0 * 0.2 * (1.0 + 5.0 * 0.25)).abs() < 1e-2);
    assert!((area(&m, Some(Zone::Helm)) - 16.0 * 0.17 * 5.0 * 0.3).abs() < 1e-2);
}

#[test]
fn pictures_that_cannot_be_used_say_why() {
    let line =
        |p: RgbaImage, s: QuadSpec| quad("p.png", "p", p, &s).expect_err("must be refused").to_string();
    let opaque = line(RgbaImage::from_pixel(10, 10, Rgba([1, 1, 1, 255])), spec());
    assert!(opaque.contains("alpha"), "{opaque}");
    let empty = line(RgbaImage::new(10, 10), spec());
    assert!(empty.contains("opaque"), "{empty}");
    let dry = line(picture(), QuadSpec { waterline_row: 95.0, ..spec() });
    assert!(dry.starts_with("p.png: ") && dry.contains("waterline_row"), "{dry}");
}

#[test]
fn a_png_needs_its_sidecar_and_takes_its_values() {
    let dir = tempfile::tempdir().expect("folder");
    let png = dir.path().join("ship.png");
    picture().save(&png).expect("written");
    let line = load_quad(&png).expect_err("no sidecar").to_string();
    assert!(
        line.contains("ship.toml") && line.contains("length_m = ") && line.contains("waterline_row = 90"),
        "{line}"
    );
    fs::write(dir.path().join("ship.toml"), "length_m = 16\nwaterline_row = 80.0\nbow = \"right\"\n")
        .expect("written");
    let m = resolve("ship.png", dir.path()).expect("loads");
    assert_eq!(m, quad("ship.png", "ship", picture(), &spec()).expect("a model"));
    fs::write(dir.path().join("ship.toml"), "length_m = 16\nwaterline = 80.0\n").expect("written");
    let error = load_quad(&png).expect_err("unknown key");
    assert!(matches!(error, ModelError::Sidecar(TomlError { line: 2, column: 1, .. })), "{error}");
    fs::write(&png, b"GIF89a").expect("written");
    let line = load_quad(&png).expect_err("no PNG").to_string();
    assert!(line.contains("ship.png") && line.contains("PNG"), "{line}");
}

#[test]
fn the_built_in_picture_shows_the_frigate() {
    let m = resolve(FRIGATE_QUAD, Path::new("")).expect("built in");
    let ship = resolve("frigate", Path::new("")).expect("built in");
    assert_eq!(m, resolve(FRIGATE_QUAD, Path::new("")).expect("the same every time"));
    assert!((m.length_m() - ship.length_m()).abs() < 0.3, "{} {}", m.length_m(), ship.length_m());
    assert!((m.height_m() - ship.height_m()).abs() < 0.3);
    let t = m.texture.as_ref().expect("texture");
    assert_eq!(t.rgba.len(), t.width as usize * t.height as usize * 4);
    let opaque = t.rgba.chunks_exact(4).filter(|p| p[3] > 200).count() as f64;
    let share = opaque / f64::from(t.width * t.height);
    assert!((0.2..0.5).contains(&share), "{share} of the picture is ship");
    // The water's length is the hull's.
    let along = |m: &Model| m.waterline.iter().map(|p| p.x).fold(f64::MIN, f64::max);
    assert!((along(&m) - along(&ship)).abs() < 0.5, "{} {}", along(&m), along(&ship));
    for zone in Zone::ALL {
        assert!(area(&m, Some(zone)) > 10.0, "{zone:?}");
    }
}
