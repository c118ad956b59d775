//! Camera and inertial unit on one mount, moved by hand before a board that stands still: pictures and readings with known truth.

use std::{f64::consts::TAU, sync::Arc};

use bowwave_calibration::{
    simulated::{Motion, Random, Recipe},
    target::Target,
};
use bowwave_core::{
    event::{ImuSample, Picture, PictureError, PixelFormat},
    geometry::{Distortion, Lens},
    time::Time,
};
use glam::{DMat3, DQuat, DVec2, DVec3};
use rayon::prelude::*;

use super::draw::{BoardShot, TrueLens, draw_by_rows};

/// From the camera to the board where both look at each other, metres.
const AWAY_M: f64 = 0.62;

/// Object that is moved, and for how long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovedBoard {
    /// Movement, inertial unit, offset and read-out; the camera's noise comes from its pictures.
    pub recipe: Recipe,
    /// The camera.
    pub lens: TrueLens,
    /// The board.
    pub target: Target,
}

/// One picture.
#[derive(Clone, Debug)]
pub struct BoardFilm {
    /// Mid-exposure of the middle row by the camera's stamp.
    pub stamp: Time,
    /// Pictures that were seen.
    pub picture: Picture,
}

impl MovedBoard {
    /// By hand before the usual board: `hz` pictures a second of a small camera, 0.5 ms of stamp jitter.
    pub fn by_hand(target: Target, seconds: f64, hz: f64, seed: u64) -> Self {
        let recipe = Recipe { seconds, camera_hz: hz, ..Recipe::minute(Motion::ByHand, 1e-3, 5e-4, seed) };
        let lens = TrueLens {
            size: (640, 360),
            numbers: [450.0, 452.0, 327.0, 176.0, -0.19, 0.05, 6e-4, -9e-4],
            fisheye: false,
        };
        Self { recipe, lens, target }
    }

    /// The camera's lens as the product has it.
    pub fn lens(&self) -> Lens {
        let [fx, fy, cx, cy, k1, k2, p1, p2] = self.lens.numbers;
        let plain = Lens::pinhole(self.lens.size.0 as u32, self.lens.size.1 as u32, 1.0);
        Lens {
            focal: DVec2::new(fx, fy),
            centre: DVec2::new(cx, cy),
            distortion: Distortion::radial_tangential(DVec2::new(k1, k2), DVec2::new(p1, p2)),
            ..plain
        }
    }

    /// Readings of the inertial unit, on a clock of its own that does not drift.
    pub fn samples(&self) -> Vec<ImuSample> {
        let sample = |r: &bowwave_calibration::alignment::ImuReading| ImuSample {
            arrival: r.time,
            device_time_ns: r.time.ns_since(Recipe::EPOCH),
            rate: r.rate,
            accel: r.specific_force.unwrap_or(DVec3::ZERO),
            world_from_imu: None,
        };
        self.recipe.record().readings.iter().map(sample).collect()
    }

    /// The board's attitude and middle in the camera's space while each row is read, for a middle row at `seconds`.
    fn rows(&self, seconds: f64) -> Vec<(DQuat, DVec3)> {
        /// Share of the camera's turn that the hand makes up for by going round the board, so that it stays in the picture.
        const ROUND: f64 = 0.65;
        let height = self.lens.size.1;
        let at = |row: usize| seconds + ((row as f64 + 0.5) / height as f64 - 0.5) * self.recipe.readout_s;
        let times: Vec<f64> = (0..height).map(at).collect();
        // The board's x is east, its y up, and it looks south.
        let world_from_board = DQuat::from_mat3(&DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y));
        let board = DVec3::Y * AWAY_M;
        let seen = |(t, (world_from_camera, _)): (&f64, &(DQuat, DVec3))| {
            let ahead = *world_from_camera * DVec3::Z;
            let sway =
                DVec3::new((TAU * 0.31 * t).sin(), 2.0 * (TAU * 0.17 * t).sin(), (TAU * 0.43 * t).sin());
            let camera = (board - ahead * AWAY_M) * ROUND + sway * 0.02;
            let camera_from_world = world_from_camera.inverse();
            (camera_from_world * world_from_board, camera_from_world * (board - camera))
        };
        times.iter().zip(&self.recipe.poses(&times)).map(seen).collect()
    }

    /// The pictures, in order.
    ///
    /// # Errors
    /// None, as long as a drawn picture has as many codes as pixels.
    pub fn pictures(&self) -> Result<Vec<BoardFilm>, PictureError> {
        let Recipe { seconds, camera_hz, offset_s, jitter_s, seed, .. } = self.recipe;
        let directions = self.lens.directions();
        let count = ((seconds - 1.4) * camera_hz) as usize;
        let mut random = Random::new(seed ^ 0x00c0_ffee);
        let late: Vec<f64> = (0..count).map(|_| jitter_s * random.gauss()).collect();
        let one = |(i, late): (usize, &f64)| {
            let at = 0.7 + i as f64 / camera_hz;
            let shot = BoardShot {
                seed: seed.wrapping_mul(100_000).wrapping_add(i as u64),
                ..BoardShot::frontal(AWAY_M)
            };
            let drawn = draw_by_rows(&self.target, &self.lens, &directions, &shot, &self.rows(at));
            let rgb: Vec<u8> = drawn.grey.iter().flat_map(|v| [*v; 3]).collect();
            let (w, h) = (drawn.size.0 as u32, drawn.size.1 as u32);
            let picture = Picture::new(PixelFormat::Rgb, w, h, Arc::from(rgb))?;
            Ok(BoardFilm { stamp: Recipe::EPOCH.plus_secs(at - offset_s + late), picture })
        };
        late.par_iter().enumerate().map(one).collect()
    }
}
