use std::f64::consts::PI;

use super::*;
use crate::{frame::searchlight::SearchlightView, geometry::look, world::searchlight::SearchlightSpec};

fn camera() -> CameraPose {
    CameraPose { world_from_camera: look(0.0, -0.05, 0.0), position: DVec3::Z * 8.0 }
}

fn beam(strength: f64) -> SearchlightView {
    let spec = SearchlightSpec { candela: 1.0, beam: 8f64.to_radians(), is_on: true };
    SearchlightView { strength, ..SearchlightView::new(&spec, DVec3::Z, 1.0, 2e4) }
}

fn flare(at: DVec3) -> LampView {
    LampView { at, strength: Vec3::splat(160_000.0), extinction_per_m: 2e-4, is_high: true }
}

fn lit(lamps: &[LampView], camera: &CameraPose, lens: &Lens) -> LightGrid {
    let mut grid = LightGrid::new((1280, 720));
    grid.light(&Lamplight { searchlight: None, lamps, wind_m_s: 4.0 }, camera, lens);
    grid
}

#[test]
fn a_grid_covers_its_screen_and_keeps_what_does_not_change() {
    let (lens, camera) = (Lens::pinhole(1280, 720, 1.1), camera());
    for size in [(1280, 720), (1920, 1080), (3840, 2160), (16, 16)] {
        let grid = LightGrid::new(size);
        let rows = grid.nodes.len() / grid.columns;
        assert!(grid.nodes.len() <= NODES_MAX);
        assert!((grid.columns - 1) as f64 * grid.cell_px >= f64::from(size.0));
        assert!((rows - 1) as f64 * grid.cell_px >= f64::from(size.1));
    }
    let mut grid = LightGrid::new((1280, 720));
    let mut light = |strength: f64, camera: &CameraPose| {
        let view = beam(strength);
        grid.light(&Lamplight { searchlight: Some(&view), lamps: &[], wind_m_s: 0.0 }, camera, &lens);
        grid.clone()
    };
    let first = light(1.0, &camera);
    let brightest = first.nodes.iter().enumerate().max_by(|a, b| a.1.air.x.total_cmp(&b.1.air.x));
    let place = brightest.map(|(i, _)| (i % first.columns, i / first.columns));
    // The lamp is below and to the right: there its beam comes into the picture.
    assert!(place.is_some_and(|(x, y)| x >= 40 && y >= 22), "{place:?}");
    let raised = CameraPose { world_from_camera: look(0.0, 0.3, 0.0), ..camera };
    let second = light(5.0, &raised);
    assert!(
        second.nodes.iter().zip(&first.nodes).all(|(a, b)| (a.air.x - 5.0 * b.air.x).abs() <= 1e-6 * a.air.x)
    );
    assert!(second.nodes.iter().take(second.columns).all(|node| node.sea == Vec3::ZERO), "the sky above");
}

#[test]
fn a_flare_glitters_under_itself_and_glows_about_itself() {
    let (lens, camera) = (Lens::pinhole(1280, 720, 1.1), camera());
    // To the right of the middle, before the camera.
    let at = DVec3::new(100.0, 400.0, 90.0);
    let grid = lit(&[flare(at)], &camera, &lens);
    let node = |px: DVec2| {
        let (x, y) = ((px.x / 16.0).round() as usize, (px.y / 16.0).round() as usize);
        grid.nodes[y * grid.columns + x]
    };
    let lamp_px = lens.project(camera.to_camera(at)).expect("before the camera");
    let foot = lens.project(camera.to_camera(DVec3::new(12.0, 48.0, 0.0))).expect("before the camera");
    let aside = DVec2::new(1280.0 - foot.x, foot.y);
    assert!(node(lamp_px).air.x > 3.0 * node(aside).air.x, "{:?} {:?}", node(lamp_px), node(aside));
    assert!(node(foot).sea.x > 3.0 * node(aside).sea.x, "{:?} {:?}", node(foot), node(aside));
    // A low one leaves the sea to the mirror images of boats.
    let low = lit(&[LampView { is_high: false, ..flare(at) }], &camera, &lens);
    assert!(low.nodes.iter().all(|node| node.sea == Vec3::ZERO));
}

#[test]
fn glitter_of_all_directions_together_is_what_the_sea_mirrors() {
    // Rough enough that a rule of steps over the sky resolves it: from above the sea mirrors Fresnel's share of an even sky.
    let lamp_at = |towards: DVec3| Glitter {
        lamp: DVec3::Z * 1e4 + towards * 1e7,
        up: -DVec3::Z,
        eye_height_m: 1e4,
        extinction_per_m: 0.0,
        slope_variance: 0.02,
    };
    // The camera looks straight down along its axis; a ring of a sky at 1e7 m.
    let (mut sum, steps) = (0.0, 400);
    for i in 0..steps {
        let off = (f64::from(i) + 0.5) / f64::from(steps) * 1.5;
        let ring = 2.0 * PI * off.sin() * 1.5 / f64::from(steps);
        let towards = DVec3::new(off.sin(), 0.0, -off.cos());
        sum += lamp_at(towards).sea(DVec3::Z, 1.0).0 * 1e14 * ring;
    }
    let share = crate::sea::fresnel(1.0);
    assert!((sum / share - 1.0).abs() < 0.05, "{sum} {share}");
}

#[test]
fn extremes_are_finite_and_never_negative() {
    let lens = Lens::pinhole(320, 180, 1.1);
    for camera in [camera(), CameraPose { position: DVec3::Z * 0.5, ..camera() }] {
        for at in [camera.position, DVec3::Y * 1e5, DVec3::new(0.0, 2.0, 0.0), DVec3::NEG_Z, DVec3::Z * 1e4] {
            for (is_high, wind_m_s) in [(true, 0.0), (true, 30.0), (false, 5.0)] {
                let mut grid = LightGrid::new((320, 180));
                let lamp = LampView { is_high, ..flare(at) };
                grid.light(&Lamplight { searchlight: None, lamps: &[lamp], wind_m_s }, &camera, &lens);
                for node in &grid.nodes {
                    assert!(node.air.is_finite() && node.sea.is_finite(), "{at} {node:?}");
                    assert!(node.air.min_element() >= 0.0 && node.sea.min_element() >= 0.0, "{at} {node:?}");
                }
            }
        }
    }
}
