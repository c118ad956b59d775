//! Boards held before a camera as somebody who calibrates it holds them.

use bowwave_calibration::{
    lens::{BoardView, Corner},
    simulated::Random,
    target::Target,
};
use glam::{DQuat, DVec2, DVec3};

use super::draw::{BoardShot, DrawnBoard, TrueLens};

/// The usual board, in A3: 6 x 6 tags of 34 mm.
pub fn board() -> Target {
    "6x6:34".parse().unwrap_or(Target::A4)
}

/// `count` ways to hold the board: the nine parts of the picture in turn, near and far, tilted by up to `tilt` radians to all sides.
pub fn held(lens: &TrueLens, target: &Target, count: usize, tilt: f64, seed: u64) -> Vec<BoardShot> {
    let mut random = Random::new(seed ^ 0x6b8b_4567);
    let size = DVec2::new(lens.size.0 as f64, lens.size.1 as f64);
    (0..count)
        .map(|i| {
            let part = DVec2::new((i % 3) as f64, (i / 3 % 3) as f64) / 2.0;
            let share = 0.22 + part * 0.56 + DVec2::new(random.unit() - 0.5, random.unit() - 0.5) * 0.1;
            // So far that the board fills a third to the whole of the picture's height.
            let fills = 0.45 + 0.5 * random.unit();
            let distance = target.size_m().y * lens.numbers[1] / (size.y * fills);
            let around =
                DVec2::from_angle(std::f64::consts::TAU * random.unit()) * tilt * random.unit().sqrt();
            let turn = DQuat::from_rotation_z(0.3 * random.gauss());
            BoardShot {
                middle: lens.direction(share * size) * distance,
                seed: seed.wrapping_mul(1000).wrapping_add(i as u64),
                ..BoardShot::frontal(distance)
            }
            .turned(turn)
            .turned(DQuat::from_scaled_axis(DVec3::new(around.x, around.y, 0.0)))
            // People hold it towards the camera.
            .turned(DQuat::from_rotation_arc(DVec3::Z, lens.direction(share * size)))
        })
        .collect()
}

/// The true corners of a picture, each off by `noise` pixels: what a detector of that precision would give.
pub fn exact(target: &Target, drawn: &[(usize, usize, DVec2)], noise: f64, seed: u64) -> BoardView {
    let mut random = Random::new(seed);
    let corners = drawn.iter().map(|(id, corner, pixel)| Corner {
        board: target.corners(*id)[*corner],
        pixel: *pixel + DVec2::new(random.gauss(), random.gauss()) * noise,
    });
    BoardView { corners: corners.collect() }
}

/// Distances of found corners to the true ones, pixels.
pub fn misses(drawn: &DrawnBoard, found: &[(usize, [DVec2; 4])]) -> Vec<f64> {
    let miss = |id: usize, corner: usize, at: DVec2| {
        let truth = drawn.corners.iter().find(|c| (c.0, c.1) == (id, corner));
        // A corner where none can be is as wrong as the picture is wide.
        truth.map_or(drawn.size.0 as f64, |c| c.2.distance(at))
    };
    found
        .iter()
        .flat_map(|(id, corners)| corners.iter().enumerate().map(move |(i, at)| (*id, i, *at)))
        .map(|(id, corner, at)| miss(id, corner, at))
        .collect()
}
