//! The light of flares and fires that air throws to the camera.

use anyhow::Result;
use bowwave_core::{
    frame::{
        lamplight::{Lamplight, LightGrid},
        lamps::LampView,
    },
    geometry::{CameraPose, Lens, look},
};
use glam::{DVec2, DVec3, Vec3};

use super::About;
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "lamps",
    what: "Adds to the air before the camera the light of virtual flares and fires.",
    truth: "the integral of single scattering along each line of sight in 300,000 even steps of the logarithm of the distance, with the true angles and \
            a phase function written once more; error is the worst of all nodes of the grid that lie more than a cell off the lamp, over the \
            brightest of them",
    rivals: "sixteen and forty-eight equal steps of the angle at the lamp at each node (Kulla and Fajardo 2012), and the integral without what the \
             air takes on the way, for which one table would serve all ranges",
    why: "a lamp that shines to all sides needs the integral by angle and end of the line only: 48 lines a frame in place of 3726 nodes",
};

const SIZE: (u32, u32) = (1280, 720);
/// Distance at which a line of sight above the horizon ends, metres.
const FAR_M: f64 = 1e5;

/// A rule for the light along a line of sight, which ends somewhere.
type Rule = fn(&Case, DVec3, (DVec3, f64)) -> f64;

/// A lamp of intensity 1 in some air.
#[derive(Clone, Copy)]
struct Case {
    at: DVec3,
    visibility_m: f64,
}

impl Case {
    fn extinction(&self) -> f64 {
        3.912 / self.visibility_m
    }
}

fn camera() -> CameraPose {
    CameraPose { world_from_camera: look(0.0, -0.02, 0.0), position: DVec3::Z * 8.0 }
}

fn lens() -> Lens {
    Lens::pinhole(SIZE.0, SIZE.1, 40f64.to_radians())
}

/// Henyey and Greenstein's functions, forward and back.
fn phase(cosine: f64) -> f64 {
    let of = |g: f64| (1.0 - g * g) / (1.0 + g * g - 2.0 * g * cosine).powf(1.5);
    (0.918 * of(0.8) + 0.082 * of(-0.5)) / (4.0 * std::f64::consts::PI)
}

/// Light that a metre of air sends to the camera from `s` metres along `ray`; `lamp` in the camera's axes.
fn scattered(case: &Case, lamp: DVec3, ray: DVec3, s: f64, takes: f64) -> f64 {
    let from_lamp = ray * s - lamp;
    let r = from_lamp.length();
    case.extinction() * phase(-from_lamp.dot(ray) / r) * (-takes * (s + r)).exp() / (r * r)
}

fn truth(case: &Case, lamp: DVec3, (ray, end_m): (DVec3, f64)) -> f64 {
    const STEPS: u32 = 300_000;
    let (low, high) = (1e-2f64.ln(), end_m.ln());
    let step = (high - low) / f64::from(STEPS);
    let of_step = |i: u32| {
        let s = (low + step * (f64::from(i) + 0.5)).exp();
        scattered(case, lamp, ray, s, case.extinction()) * s * step
    };
    (0..STEPS).map(of_step).sum()
}

/// Equal steps of the angle at the lamp.
fn by_angle<const STEPS: u32, const AIR: bool>(case: &Case, lamp: DVec3, (ray, end_m): (DVec3, f64)) -> f64 {
    let along = lamp.dot(ray);
    let off = (lamp - ray * along).length().max(1e-3);
    let (first, last) = ((-along / off).atan(), ((end_m - along) / off).atan());
    let step = (last - first) / f64::from(STEPS);
    let takes = if AIR { case.extinction() } else { 0.0 };
    let of_step = |i: u32| {
        let s = along + off * (first + step * (f64::from(i) + 0.5)).tan();
        // A step of the angle is so long a step of the line.
        scattered(case, lamp, ray, s, takes) * (off + (s - along) * (s - along) / off) * step
    };
    (0..STEPS).map(of_step).sum()
}

/// Lines of sight of the nodes, and where each ends.
fn lines(grid: &LightGrid) -> Vec<(DVec3, f64)> {
    let (camera, lens) = (camera(), lens());
    let columns = grid.columns();
    let line = |i: usize| {
        let px = DVec2::new((i % columns) as f64, (i / columns) as f64) * grid.cell_px();
        let ray = lens.unproject(px).normalize();
        let falls = -(camera.world_from_camera * ray).z;
        (ray, if falls > 0.0 { camera.position.z / falls } else { FAR_M })
    };
    (0..grid.nodes().len()).map(line).collect()
}

fn lit(grid: &mut LightGrid, case: &Case) {
    let lamp =
        LampView { at: case.at, strength: Vec3::ONE, extinction_per_m: case.extinction(), is_high: false };
    grid.light(&Lamplight { searchlight: None, lamps: &[lamp], wind_m_s: 5.0 }, &camera(), &lens());
}

/// Errors of the product and of rules, over nodes that stand for all.
fn errors(case: &Case, rules: &[Rule]) -> Vec<f64> {
    const EVERY: usize = 29;
    let mut grid = LightGrid::new(SIZE);
    lit(&mut grid, case);
    let lamp = camera().to_camera(case.at);
    let near = 1.5 * grid.cell_px() / lens().focal.x;
    let (mut worst, mut brightest) = (vec![0.0f64; rules.len() + 1], 0.0f64);
    for (line, node) in lines(&grid).into_iter().zip(grid.nodes()).step_by(EVERY) {
        if line.0.angle_between(lamp) < near {
            continue;
        }
        let truth = truth(case, lamp, line);
        brightest = brightest.max(truth);
        let found =
            std::iter::once(f64::from(node.air.x)).chain(rules.iter().map(|rule| rule(case, lamp, line)));
        for (worst, found) in worst.iter_mut().zip(found) {
            let error = (found - truth).abs();
            *worst = if error.is_nan() { f64::NAN } else { worst.max(error) };
        }
    }
    worst.into_iter().map(|error| error / brightest).collect()
}

const RULES: [(&str, &str, Rule); 3] = [
    ("steps of the angle at each node", "16", by_angle::<16, true>),
    ("steps of the angle at each node", "48", by_angle::<48, true>),
    ("without the air on the way", "48 steps", by_angle::<48, false>),
];
const PRODUCT: (&str, &str) = ("looked up", "48 angles, 32 ends");

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let rules = RULES.map(|(.., rule)| rule);
    for (name, at, visibility_m) in [
        ("a flare at 450 m, visibility 20 km", DVec3::new(60.0, 350.0, 280.0), 20_000.0),
        ("a fire at 120 m, visibility 10 km", DVec3::new(-15.0, 120.0, 2.0), 10_000.0),
        ("a fire at 260 m, visibility 1 km", DVec3::new(30.0, 258.0, 2.0), 1_000.0),
    ] {
        let case = Case { at, visibility_m };
        let errors = errors(&case, &rules);
        let mut grid = LightGrid::new(SIZE);
        let all = lines(&grid);
        let lamp = camera().to_camera(at);
        let mut ways = vec![
            Way::new(PRODUCT.0, PRODUCT.1, errors[0], 1, || {
                lit(&mut grid, &case);
                grid.nodes().len()
            })
            .default_if(true),
        ];
        for ((method, setting, rule), error) in RULES.into_iter().zip(&errors[1..]) {
            let all = &all;
            ways.push(Way::new(method, setting, *error, 1, move || {
                all.iter().map(|line| rule(&case, lamp, *line)).sum::<f64>()
            }));
        }
        bench.scene(name, "of the brightest", 0.001, ways);
    }
    for (name, at, visibility_m) in [
        ("a lamp 5 m before the camera, fog of 50 m", DVec3::new(0.0, 5.0, 8.0), 50.0),
        ("a lamp behind the camera", DVec3::new(20.0, -200.0, 60.0), 5_000.0),
        ("a lamp 20 km off, visibility 100 km", DVec3::new(0.0, 2e4, 300.0), 1e5),
        ("a lamp on the horizon in the line of sight", DVec3::new(0.0, 2_000.0, 8.0), 20_000.0),
    ] {
        let errors = errors(&Case { at, visibility_m }, &rules[..1]);
        bench.extreme(
            name,
            "of the brightest",
            vec![
                ExtremeResult::product(PRODUCT.0, PRODUCT.1, errors[0]),
                ExtremeResult::rival(RULES[0].0, RULES[0].1, errors[1]),
            ],
        );
    }
    Ok(())
}
