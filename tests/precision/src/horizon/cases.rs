//! Series of drawn pictures, with a horizon and without.

use super::synth::{DrawnLens, DrawnScene, Glare};

/// Pictures of a series that served to set the finder's constants: those with a smaller seed than this.
pub const SET_WITH: u64 = 1000;

/// A picture with a horizon: the `i`th of the series that begins at `seed`.
pub fn with_horizon(seed: u64, i: u64) -> DrawnScene {
    let mut shown = DrawnScene::fair(seed + i);
    let spread = |k: u64, low: f64, high: f64| DrawnScene::fair(seed + i).even(k).mul_add(high - low, low);
    shown.attitude = [spread(1, -0.2, 0.2), spread(2, -0.18, 0.18)];
    shown.eye_m = spread(3, 2.0, 20.0);
    shown.codes = [spread(4, 130.0, 220.0), spread(5, 90.0, 180.0), spread(6, 40.0, 100.0)];
    shown.contrast = [spread(7, 0.0, 14.0), spread(8, 3.0, 18.0)];
    shown.haze_m = spread(9, 12_000.0, 60_000.0);
    shown.ragged_px = spread(10, 0.0, 0.7);
    shown.noise = spread(11, 0.7, 4.0);
    match i % 8 {
        1 => {
            shown.kind = "lens bow";
            shown.lens = DrawnLens { focal: 836.8, radial: [-0.25, 0.071] };
        }
        2 => {
            shown.kind = "glitter";
            shown.glitter = Some(spread(12, -0.4, 0.4));
        }
        3 => {
            shown.kind = "ships, barrel";
            shown.ships = 5;
            shown.barrel = true;
        }
        4 => {
            shown.kind = "steep";
            shown.attitude[0] = spread(13, 0.5, 1.047) * spread(14, -1.0, 1.0).signum();
        }
        5 => {
            shown.kind = "edge";
            // Ten to forty pixels from the upper or lower edge at the middle, and almost level.
            let tangent = (360.0 - spread(15, 10.0, 40.0)) / shown.lens.focal;
            shown.attitude = [spread(16, -0.01, 0.01), tangent.atan() * spread(17, -1.0, 1.0).signum()];
        }
        6 => {
            shown.kind = "part";
            // It leaves the picture at a third or half of its width.
            let roll = spread(18, 0.25, 0.6) * spread(19, -1.0, 1.0).signum();
            let tangent =
                (360.0 * roll.cos() - spread(20, -200.0, 100.0) * roll.sin().abs()) / shown.lens.focal;
            shown.attitude = [roll, tangent.atan() * spread(21, -1.0, 1.0).signum()];
        }
        7 => {
            shown.kind = "haze";
            shown.haze_m = spread(22, 3_000.0, 9_000.0);
        }
        _ => {}
    }
    shown
}

/// A picture with the sun low over a horizon of which it washes out a sixth to two thirds, with lens flare: the `i`th of the series that
/// begins at `seed`.
pub fn with_glare(seed: u64, i: u64) -> DrawnScene {
    let mut shown = with_horizon(seed, 8 * i);
    let spread = |k: u64, low: f64, high: f64| DrawnScene::fair(seed + i).even(k).mul_add(high - low, low);
    shown.kind = "glare";
    shown.glitter = Some(spread(41, -0.35, 0.35));
    shown.glare = Some(Glare {
        sun: [spread(41, -0.35, 0.35), spread(42, 0.0, 0.12)],
        spread: [spread(43, 0.05, 0.2), spread(44, 0.03, 0.08)],
        codes: spread(45, 300.0, 900.0),
    });
    shown
}

/// A picture with a washed-out strip over all of its horizon: the `i`th of the series that begins at `seed`.
pub fn all_glare(seed: u64, i: u64) -> DrawnScene {
    let mut shown = with_glare(seed, i);
    let spread = |k: u64, low: f64, high: f64| DrawnScene::fair(seed + i).even(k).mul_add(high - low, low);
    shown.kind = "all glare";
    shown.attitude[0] = spread(46, -0.05, 0.05);
    shown.glare = Some(Glare {
        sun: [spread(47, -0.2, 0.2), spread(48, -0.01, 0.03)],
        spread: [2.0, spread(49, 0.04, 0.1)],
        codes: spread(50, 600.0, 1500.0),
    });
    shown
}

/// A picture without a horizon, or one that is not to be used: the `i`th of the series that begins at `seed`.
pub fn without_horizon(seed: u64, i: u64) -> DrawnScene {
    let mut shown = with_horizon(seed, 8 * i);
    let spread = |k: u64, low: f64, high: f64| DrawnScene::fair(seed + i).even(k).mul_add(high - low, low);
    match i % 7 {
        0 => {
            shown.kind = "sky only";
            shown.attitude[1] = spread(31, 0.6, 0.9);
        }
        1 => {
            shown.kind = "water only";
            shown.attitude[1] = -spread(32, 0.6, 0.9);
        }
        2 => {
            shown.kind = "fog";
            shown.haze_m = spread(33, 40.0, 250.0);
            shown.contrast[0] = spread(34, 0.0, 2.0);
        }
        3 => {
            shown.kind = "night";
            shown.codes = [6.0, 5.0, 4.0];
            shown.contrast = [0.5, 0.5];
            shown.noise = spread(35, 2.0, 8.0);
        }
        4 => {
            shown.kind = "noise";
            shown.codes = [100.0; 3];
            shown.contrast = [0.0, 0.0];
            shown.noise = spread(36, 5.0, 60.0);
        }
        5 => {
            shown.kind = "smeared";
            shown.smear = spread(37, 18.0, 50.0) as usize;
        }
        _ => {
            shown.kind = "blank";
            shown.codes = [spread(38, 0.0, 255.0); 3];
            shown.contrast = [0.0, 0.0];
            shown.noise = 0.0;
        }
    }
    shown
}
