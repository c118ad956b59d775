//! A rolling shutter: where a point falls when each row of the picture is read at a time of its own.

use anyhow::Result;
use bowwave_core::geometry::Lens;
use glam::{DQuat, DVec2, DVec3};

use super::{About, worst};
use crate::bench::{PartBench, PartMethod};

/// Description of this part.
pub const ABOUT: About = About {
    part: "shutter",
    what: "Puts a point onto the row of the picture that is read just when the turning camera sees it there.",
    truth: "the camera's attitude as a closed function of time: pixels all over a picture of 1920 over 60 deg lead to directions by their \
            own row's attitude, and back by a method that shares nothing with that; the error is the worst, in pixels",
    rivals: "no shutter at all, one rate with one fixed-point round (cheaper), attitudes at nine rows with interpolation between them, \
             the exact attitude of each row tried (dearer)",
    why: "one rate for the whole picture: the inertial unit's two attitudes half a readout before and after its middle. Below it a \
          picture that is swung is off by tens of pixels at its edges; nine attitudes gain what a recoil's shake changes within a \
          picture, for which a unit of 200 Hz would have to be believed sample by sample. Shaders take a Newton step and one more \
          round, core goes on until nothing moves",
};

const SIZE: (u32, u32) = (1920, 1080);
const READOUT_S: f64 = 0.03;
/// Attitudes of the dearer rival.
const NODES: usize = 9;

/// Why core does more than shaders.
const EXACT: &str = "what core finds in a picture must lead back to where it was seen; a frame asks for hundreds of points only";

/// How the camera is turned so many seconds after the middle row was read.
type TurnedBy = fn(f64) -> DQuat;

/// 60 deg/s about an axis that is mostly the vertical.
fn swing(t: f64) -> DQuat {
    DQuat::from_scaled_axis(DVec3::new(0.35, 0.9, 0.25).normalize() * (60f64.to_radians() * t))
}

/// 60 deg/s up, which stretches the picture.
fn lift(t: f64) -> DQuat {
    DQuat::from_rotation_x(60f64.to_radians() * t)
}

/// The same the other way, which squeezes it.
fn drop(t: f64) -> DQuat {
    lift(-t)
}

/// A recoil 5 ms before the middle row, on a gun that is swung: it shakes by 0.15 deg at 30 Hz and dies away in 30 ms.
fn recoil(t: f64) -> DQuat {
    let since = (t + 0.005).max(0.0);
    let shake = 0.15f64.to_radians() * (-since / 0.03).exp() * (std::f64::consts::TAU * 30.0 * since).sin();
    swing(t) * DQuat::from_rotation_x(shake)
}

struct ShutterScene {
    /// The lens as the product has it: with the turn over the whole readout.
    lens: Lens,
    global: Lens,
    attitude: TurnedBy,
    nodes: [DQuat; NODES],
    points: Vec<(DVec3, DVec2)>,
}

/// Seconds after the middle row at which `row` is read.
fn read_at(row: f64) -> f64 {
    (row / f64::from(SIZE.1) - 0.5) * READOUT_S
}

impl ShutterScene {
    fn new(attitude: TurnedBy) -> Self {
        let global = Lens::pinhole(SIZE.0, SIZE.1, 60f64.to_radians());
        let [from, to] = [-0.5, 0.5].map(|share| attitude(share * READOUT_S));
        let lens = global.read_while((from.inverse() * to).to_scaled_axis());
        let size = DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
        let points = (0..17 * 11)
            .map(|i| {
                let pixel = DVec2::new(f64::from(i % 17) / 16.0, f64::from(i / 17) / 10.0) * size;
                (attitude(read_at(pixel.y)) * global.unproject(pixel), pixel)
            })
            .collect();
        let nodes = std::array::from_fn(|i| attitude((i as f64 / (NODES - 1) as f64 - 0.5) * READOUT_S));
        Self { lens, global, attitude, nodes, points }
    }

    /// The pixel of a point seen by rows turned by `turned` (from their camera to the middle row's), by fixed-point rounds.
    fn rounds(&self, p: DVec3, count: usize, turned: impl Fn(f64) -> DQuat) -> DVec2 {
        let seen = |row: f64| self.global.project(turned(row).inverse() * p).unwrap_or(DVec2::NAN);
        (0..count).fold(seen(f64::from(SIZE.1) / 2.0), |pixel, _| seen(pixel.y))
    }

    fn one_rate(&self, row: f64) -> DQuat {
        self.lens.turned_at(row)
    }

    fn interpolated(&self, row: f64) -> DQuat {
        let place = (row / f64::from(SIZE.1)).clamp(0.0, 1.0) * (NODES - 1) as f64;
        let node = (place as usize).min(NODES - 2);
        self.nodes[node].slerp(self.nodes[node + 1], place - node as f64)
    }

    /// As `lens.glsl` has it.
    fn newton(&self, p: DVec3) -> DVec2 {
        let middle = f64::from(SIZE.1) / 2.0;
        let drift = -self.lens.row_turn.cross(p);
        let slope = self.global.focal.y * (drift.y * p.z - p.y * drift.z) / (p.z * p.z);
        let seen = |rows: f64| {
            let turn = self.lens.row_turn * -rows;
            let across = turn.cross(p);
            self.global.project(p + across + 0.5 * turn.cross(across)).unwrap_or(DVec2::NAN)
        };
        let rows = (seen(0.0).y - middle) / (1.0 - slope);
        seen(seen(rows).y - middle)
    }

    fn worst_px(&self, way: PointFinder) -> f64 {
        worst(self.points.iter().map(|(p, pixel)| way(self, *p).distance(*pixel)))
    }
}

type PointFinder = fn(&ShutterScene, DVec3) -> DVec2;

const METHODS: [PartMethod<PointFinder>; 7] = [
    PartMethod::rival("the middle row's attitude", "", |s, p| s.global.project(p).unwrap_or(DVec2::NAN)),
    PartMethod::rival("one rate", "1 round", |s, p| s.rounds(p, 1, |row| s.one_rate(row))),
    PartMethod::rival("one rate", "2 rounds", |s, p| s.rounds(p, 2, |row| s.one_rate(row))),
    PartMethod::product("one rate", "Newton and a round, as shaders", ShutterScene::newton),
    PartMethod::product("one rate", "until still, as core", |s, p| s.lens.project(p).unwrap_or(DVec2::NAN)),
    PartMethod::rival("nine attitudes", "3 rounds", |s, p| s.rounds(p, 3, |row| s.interpolated(row))),
    PartMethod::rival("each row's attitude", "4 rounds", |s, p| {
        s.rounds(p, 4, |row| (s.attitude)(read_at(row)))
    }),
];

/// Measures the swing and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let scene = ShutterScene::new(swing);
    let scene = &scene;
    let ways = METHODS.map(|m| {
        let way = m.way(scene.worst_px(m.run), scene.points.len(), move || {
            scene.points.iter().map(|(p, _)| (m.run)(scene, *p)).sum::<DVec2>()
        });
        match m.setting {
            "until still, as core" => way.default_although(EXACT),
            _ => way,
        }
    });
    bench.scene("30 ms, 60 deg/s", "px", 0.01, ways.into());
    let cases: [(&str, TurnedBy); 3] =
        [("60 deg/s up", lift), ("60 deg/s down", drop), ("recoil while swung at 60 deg/s", recoil)];
    for (case, attitude) in cases {
        let scene = ShutterScene::new(attitude);
        bench.extreme(case, "px", METHODS.map(|m| m.tried(scene.worst_px(m.run))).into());
    }
    Ok(())
}
