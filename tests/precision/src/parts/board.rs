//! Camera and inertial unit calibrated by a board that stands still while both are moved by hand.

use anyhow::Result;
use bowwave_calibration::{
    capture::{Capture, Watcher},
    target::BoardFinder,
};
use bowwave_core::{
    event::{CameraFrame, Event},
    geometry::rotation_vector,
};
use glam::DQuat;

use super::About;
use crate::{
    bench::{ExtremeResult, PartBench, thread_ns},
    target::{
        moved::{BoardFilm, MovedBoard},
        shots::board,
    },
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "board",
    what: "Calibrates camera and inertial unit from pictures of a board, taken while both are moved by hand.",
    truth: "boards drawn by following rays, each row of the picture by a camera that stands as a closed function of that row's time has it, \
            which also goes round the board and sways; readings of a middling gyro with noise and bias; 0.5 ms of stamp jitter",
    rivals: "the picture taken as if all rows were exposed at once; the read-out given; the read-out found from the boards' own shape",
    why: "a row's time by the gyro, the board's way past the camera by its places in the pictures before and after: what a read-out of 30 ms \
          costs otherwise is more than everything else together. Who does not know the read-out loses nothing by that, the board tells it",
};

/// How the read-out is taken into account.
const WAYS: [&str; 3] = ["ignored", "given", "found from the board"];

fn solve(moved: &MovedBoard, pictures: &[BoardFilm], way: &str) -> Option<(DQuat, f64, String)> {
    let mut watcher = Watcher::new(moved.lens(), 5.0).with_board(Box::new(BoardFinder::new(moved.target)));
    let plain = Capture::new(moved.lens(), 5.0);
    let mut capture = match way {
        "ignored" => plain.with_readout(0.0),
        "given" => plain.with_readout(moved.recipe.readout_s),
        _ => plain,
    };
    moved.samples().into_iter().for_each(|sample| capture.take(&Event::Imu(sample)));
    for taken in pictures {
        let (mid_exposure, picture) = (taken.stamp, taken.picture.clone());
        let arrival = mid_exposure.plus_secs(0.02);
        let frame = CameraFrame { arrival, mid_exposure, sequence: 0, picture, jpeg: None };
        capture.see(&watcher.look(&frame));
    }
    let start = thread_ns();
    let found = capture.solve().ok()?;
    let read = found
        .readout_s
        .map_or(String::new(), |(s, sigma)| format!(", read-out {:.2} +- {:.2} ms", s * 1e3, sigma * 1e3));
    let note = format!(
        "stated {:.3} mrad, {:.3} ms; {} of {} boards{read}; {:.1} s to solve",
        found.rotation_sigma().length() * 1e3,
        found.offset_sigma_s * 1e3,
        capture.counts().boards,
        pictures.len(),
        (thread_ns() - start) * 1e-9
    );
    Some((found.camera_from_imu, found.offset_s, note))
}

/// Measures the extreme cases; none is timed against another, since a maintainer waits for it once.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let (seconds, readouts_ms): (f64, &[f64]) =
        if bench.is_quick() { (4.4, &[30.0]) } else { (9.4, &[0.0, 10.0, 30.0]) };
    for readout_ms in readouts_ms {
        let mut moved = MovedBoard::by_hand(board(), seconds, 30.0, 21);
        moved.recipe.readout_s = readout_ms * 1e-3;
        let pictures = moved.pictures()?;
        let found: Vec<_> = WAYS.iter().map(|way| (*way, solve(&moved, &pictures, way))).collect();
        for (what, unit) in [("rotation", "mrad"), ("offset", "ms")] {
            let tried = found.iter().map(|(way, found)| {
                let error = found.as_ref().map_or(f64::NAN, |(q, offset_s, _)| {
                    let turn = rotation_vector(moved.recipe.camera_from_imu * q.inverse());
                    if unit == "mrad" {
                        turn.length() * 1e3
                    } else {
                        (offset_s - moved.recipe.offset_s).abs() * 1e3
                    }
                });
                let note = found.as_ref().map_or(String::new(), |f| f.2.clone());
                let tried =
                    ExtremeResult::rival("board moved by hand", &format!("read-out {way}"), error).note(note);
                ExtremeResult { default: *way != "ignored", ..tried }
            });
            bench.extreme(&format!("read-out of {readout_ms} ms, {what}"), unit, tried.collect());
        }
    }
    Ok(())
}
