//! The lens as boats, wakes and reflections are drawn through it: straight edges between corners that are bent one by one.

use std::collections::BTreeSet;

use anyhow::{Context as _, Result};
use bowwave_core::{
    estimate::light::SeaTones,
    frame::{scene::Scene, view::NEAR_M, wake::Wake},
    geometry::{CameraPose, Distortion, Lens, Optics, RigidPose},
    model::Model,
    sea::BeaufortForce,
    water::ReflectionMethod,
    world::boats::{CourseState, Hull},
};
use bowwave_models::resolve;
use bowwave_render::SOFTWARE;
use glam::{DQuat, DVec2, DVec3};

use super::{
    About,
    warp::{Warped, edge_errors},
    worst,
};
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    reflection::{
        cost::process_ms,
        draw::{Painter, picture},
        scenes::{self, Afloats},
    },
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "drawn lens",
    what: "Draws boats and wakes where the lens puts them.",
    truth: "the curve that an edge of a mesh or of a wake's ribbon is through the lens, point by point in f64; the error is the largest \
            distance of that curve from the straight line between the edge's drawn ends, inside the picture",
    rivals: "no lens at all; corners bent and edges left as the model has them; a rectified picture of the virtual layers that is warped, \
             which leaves no such error by definition. Its time is the least that it can take: the boats drawn straight, and four \
             pixels fetched instead of one. Rows of black edges on white hold the pixels of both against the edges' own coverage",
    why: "each corner is bent by the vertex shader, and where the lens bends at all no level of detail has edges that are drawn longer \
          than 64 pixels. That costs what a few more corners cost and leaves half a pixel for a boat alongside through a fisheye, a \
          tenth and less beyond 25 m. With edges as they are, masts and spars of a dhow at 40 m err by up to two pixels. A wake's ribbon \
          is not split: nearer than 30 m its ribs err by one to three pixels through strong lenses, on foam and waves without an edge. To \
          warp a rectified picture takes longer, since that has to be larger than the screen, and blurs all edges",
};

const SIZE: (u32, u32) = (1280, 720);
/// Height of the eye, metres.
const EYE_M: f64 = 8.0;
/// The product's way.
const BENT: &str = "corners bent";
/// Edges longer than this are split, pixels.
const SPLIT_PX: f64 = 64.0;

fn mild() -> Lens {
    let distortion = Distortion::radial_tangential(DVec2::new(-0.12, 0.02), DVec2::new(5e-4, -5e-4));
    Lens { distortion, ..Lens::pinhole(SIZE.0, SIZE.1, 60f64.to_radians()) }
}

fn strong() -> Lens {
    let distortion = Distortion::radial_tangential(DVec2::new(-0.25, 0.06), DVec2::ZERO);
    Lens { distortion, ..Lens::pinhole(SIZE.0, SIZE.1, 90f64.to_radians()) }
}

fn fisheye() -> Lens {
    Lens::fisheye(SIZE.0, SIZE.1, 120f64.to_radians(), [-0.02, 0.004, -0.002, 0.0003])
}

/// Ends of each edge of a mesh, once.
fn edges(model: &Model) -> Vec<[DVec3; 2]> {
    let mut seen = BTreeSet::new();
    for triangle in model.indices.chunks_exact(3) {
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let (a, b) = (triangle[a], triangle[b]);
            seen.insert((a.min(b), a.max(b)));
        }
    }
    let at = |i: u32| model.vertices.get(i as usize).map(|v| v.position.as_dvec3());
    seen.into_iter().filter_map(|(a, b)| Some([at(a)?, at(b)?])).collect()
}

/// Where a boat lies: metres off, share of half the picture's width to the right, heading against the line of sight.
#[derive(Clone, Copy)]
struct DrawnPlace {
    range_m: f64,
    right: f64,
    heading_deg: f64,
}

fn afloat(lens: &Lens, place: DrawnPlace) -> Afloats {
    let ray =
        lens.unproject(DVec2::new(0.5 * (1.0 + place.right) * f64::from(SIZE.0), f64::from(SIZE.1) / 2.0));
    let bearing = ray.x.atan2(ray.z);
    Afloats {
        range_m: place.range_m * bearing.cos(),
        right_m: place.range_m * bearing.sin(),
        heading_deg: place.heading_deg,
        ..Afloats::at(place.range_m)
    }
}

/// Largest distance of the edges' curves from what is drawn of them, pixels: `split` of a length in pixels tells in how many pieces.
fn off_px(
    lens: &Lens,
    drawn: &Lens,
    camera: &CameraPose,
    edges: &[[DVec3; 2]],
    split: &dyn Fn(f64) -> usize,
) -> f64 {
    worst(edges.iter().map(|ends| {
        let [a, b] = ends.map(|p| camera.to_camera(p));
        if a.z < NEAR_M || b.z < NEAR_M {
            return 0.0;
        }
        let (Some(from), Some(to)) = (drawn.project(a), drawn.project(b)) else { return 0.0 };
        let pieces = split(from.distance(to)).max(1);
        worst((0..pieces).map(|piece| {
            let ends = [piece, piece + 1].map(|i| a.lerp(b, i as f64 / pieces as f64));
            let (Some(from), Some(to)) = (drawn.project(ends[0]), drawn.project(ends[1])) else { return 0.0 };
            worst((0..=8).map(|i| {
                let exact = lens.project(ends[0].lerp(ends[1], f64::from(i) / 8.0));
                exact.filter(|p| inside(*p)).map_or(0.0, |p| distance(p, from, to))
            }))
        }))
    }))
}

fn distance(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = b - a;
    let share = ((p - a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
    p.distance(a + along * share)
}

fn pieces(length_px: f64) -> usize {
    (length_px / SPLIT_PX).ceil().clamp(1.0, 64.0) as usize
}

/// The product's lens and rivals: method, setting and error of these edges.
fn errors(lens: &Lens, camera: &CameraPose, edges: &[[DVec3; 2]]) -> [(&'static str, &'static str, f64); 4] {
    let straight = Lens { distortion: Distortion::None, ..*lens };
    [
        ("no lens", "same focal length", off_px(lens, &straight, camera, edges, &|_| 1)),
        (BENT, "", off_px(lens, lens, camera, edges, &|_| 1)),
        (BENT, "long edges split", off_px(lens, lens, camera, edges, &pieces)),
        // Each pixel is asked where it comes from.
        ("rectified and warped", "by pixel", 0.0),
    ]
}

fn boat_edges(model: &Model, pose: &RigidPose) -> Vec<[DVec3; 2]> {
    let above = |p: DVec3| pose.to_world(p);
    edges(model).into_iter().map(|ends| ends.map(above)).collect()
}

/// How far aside of where a boat's reflection is drawn its ends are mirrored, pixels: all of it lies straight below the hull, in the one
/// direction in which gravity pulls at its middle.
fn aside_px(lens: &Lens, camera: &CameraPose, model: &Model, pose: &RigidPose) -> f64 {
    let seen = |p: DVec3| lens.project(camera.to_camera(p));
    let up = DVec3::Z * model.height_m();
    let (Some(foot), Some(top)) = (seen(pose.position), seen(pose.position + up)) else { return 0.0 };
    let across = (foot - top).normalize_or_zero().perp();
    let half = DVec3::X * (model.length_m() / 2.0);
    worst([-half, half].map(|end| {
        let end = pose.to_world(end).with_z(pose.position.z);
        let (Some(foot), Some(mirrored)) = (seen(end), seen(end - up)) else { return 0.0 };
        if inside(foot) && inside(mirrored) { (mirrored - foot).dot(across).abs() } else { 0.0 }
    }))
}

fn inside(p: DVec2) -> bool {
    p.cmpge(DVec2::ZERO).all() && p.x <= f64::from(SIZE.0) && p.y <= f64::from(SIZE.1)
}

/// The ribbon of a boat that crosses before the eye at 7 m/s: along the track at its sides and middle, and across it.
fn wake_edges(range_m: f64) -> Result<Vec<[DVec3; 2]>> {
    let state = |t: f64| CourseState {
        position: DVec2::new(7.0 * (t - 60.0) + 0.3 * range_m, range_m),
        heading: std::f64::consts::FRAC_PI_2,
        speed_m_s: 7.0,
        sway_m_s: 0.0,
        turn_rate: 0.0,
    };
    let wake = Wake::of(Hull { length_m: 8.0, beam_m: 2.4 }, 0.5, 60.0, state, |_| 0.0)
        .context("a boat under way")?;
    let corners = wake.strips().flat_map(|c| {
        // A ribbon has eight columns.
        let across = (0..8).map(move |i| [i, i + 1].map(|n| c[0].lerp(c[1], f64::from(n) / 8.0)));
        [[c[0], c[4]], [c[1], c[5]], [c[0].midpoint(c[1]), c[4].midpoint(c[5])]].into_iter().chain(across)
    });
    Ok(corners.collect())
}

/// The boats of the timed scene.
fn view(lens: &Lens, camera: CameraPose, model: &Model, boats: &[Afloats]) -> Result<Scene> {
    let force = BeaufortForce::new(2).context("no such force")?;
    Ok(scenes::scene((camera, *lens), SeaTones::default(), model, boats, (ReflectionMethod::Baked, force)))
}

fn timed(bench: &mut PartBench, lens: &Lens) -> Result<()> {
    let model = resolve("dhow", std::path::Path::new(""))?;
    let boats: Vec<Afloats> = [(30.0, -0.6), (60.0, 0.1), (90.0, 0.5), (40.0, 0.8)]
        .map(|(range_m, right)| afloat(lens, DrawnPlace { range_m, right, heading_deg: 70.0 }))
        .into();
    let camera = scenes::camera(EYE_M, 40.0);
    let straight = Lens { distortion: Distortion::None, ..*lens };
    let sea = picture(&scenes::sea(&straight, &camera, 150.0, 15.0))?;
    let edges: Vec<_> = boats.iter().flat_map(|b| boat_edges(&model, &b.pose())).collect();
    let [none, _, pieces, warped_way] = errors(lens, &camera, &edges);
    let cases = [(none, &straight, Optics::default()), (pieces, lens, lens.optics())];
    let models = std::slice::from_ref(&model);
    let mut ways = Vec::new();
    for ((method, setting, error), through, optics) in cases {
        let mut painter = Painter::through(
            optics,
            SIZE,
            models,
            &[ReflectionMethod::Baked],
            (boats.len(), Some(SOFTWARE)),
        )?;
        let scene = view(through, camera, &model, &boats)?;
        painter.frame(&scene, &sea)?;
        let sea = &sea;
        let work = move || {
            let before = process_ms();
            // A frame that fails has drawn nothing: it is counted as endless.
            let drawn = painter.frame(&scene, sea).is_ok();
            if drawn { (process_ms() - before) * 1e6 } else { f64::INFINITY }
        };
        ways.push(Way::telling(method, setting, error, 1, work).default_if(method == BENT));
    }
    let mut warped =
        Warped::new(lens, models, boats.len(), |straight| view(straight, camera, &model, &boats))?;
    let (method, setting, error) = warped_way;
    ways.push(Way::telling(method, setting, error, 1, move || warped.frame_ns().unwrap_or(f64::INFINITY)));
    bench.scene("four dhows at 30 to 90 m, strong barrel", "px", 0.1, ways);
    Ok(())
}

/// Measures a scene, and near and far boats and wakes through each lens.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    timed(bench, &strong())?;
    let lenses =
        [("60 deg, k1 -0.12", mild()), ("90 deg, k1 -0.25", strong()), ("fisheye of 120 deg", fisheye())];
    for (name, lens) in &lenses {
        let scales = [1.0, 2.0];
        let (chords, warped) = edge_errors(lens, SPLIT_PX, scales);
        let mut tried = vec![ExtremeResult::product(BENT, "long edges split", chords)];
        tried.extend(scales.iter().zip(warped).map(|(scale, error)| {
            ExtremeResult::rival("rectified and warped", &format!("{scale} px for one of the middle"), error)
        }));
        bench.extreme(&format!("pixels on a black edge, {name}"), "codes", tried);
        for (boat, range_m) in [
            ("skiff", 12.0),
            ("skiff", 25.0),
            ("skiff", 100.0),
            ("dhow", 40.0),
            ("frigate", 150.0),
            ("frigate", 500.0),
        ] {
            let model = resolve(boat, std::path::Path::new(""))?;
            let camera = scenes::camera(EYE_M, range_m);
            let edges: Vec<_> = [(0.0, 80.0), (0.75, 80.0), (0.75, 20.0), (-0.9, 130.0)]
                .into_iter()
                .flat_map(|(right, heading_deg)| {
                    boat_edges(&model, &afloat(lens, DrawnPlace { range_m, right, heading_deg }).pose())
                })
                .collect();
            push(bench, &format!("{boat} at {range_m} m, {name}"), true, errors(lens, &camera, &edges));
            let pose = afloat(lens, DrawnPlace { range_m, right: 0.7, heading_deg: 80.0 }).pose();
            let straight = Lens { distortion: Distortion::None, ..*lens };
            let tried = vec![
                ExtremeResult::product("straight down", "by boat", aside_px(lens, &camera, &model, &pose)),
                ExtremeResult::rival(
                    "straight down",
                    "without the lens",
                    aside_px(&straight, &camera, &model, &pose),
                ),
            ];
            bench.extreme(&format!("reflection of a {boat} at {range_m} m, {name}"), "px", tried);
        }
        for range_m in [20.0, 60.0] {
            let camera = CameraPose {
                world_from_camera: scenes::camera(EYE_M, range_m).world_from_camera
                    * DQuat::from_rotation_z(0.1),
                position: DVec3::new(0.0, 0.0, EYE_M),
            };
            let edges = wake_edges(range_m)?;
            push(bench, &format!("wake at {range_m} m, {name}"), false, errors(lens, &camera, &edges));
        }
    }
    Ok(())
}

/// Lists a case whose edges the product does or does not split.
fn push(bench: &mut PartBench, case: &str, split: bool, errors: [(&'static str, &'static str, f64); 4]) {
    let tried = errors.map(|(method, setting, error)| ExtremeResult {
        default: method == BENT && split != setting.is_empty(),
        ..ExtremeResult::rival(method, setting, error)
    });
    bench.extreme(case, "px", tried.into());
}
