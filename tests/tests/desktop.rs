//! `./demo` on a virtual desktop, played with the mouse by somebody who sees nothing but its window. Needs Xvfb, and BOWWAVE_DESKTOP set:
//! `./check desktop` runs it.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::{
    env, fs,
    process::Command,
    thread,
    time::{Duration, Instant},
};

use bowwave_tests::{
    bowwave,
    desktop::{BUTTON_PRESS, BUTTON_RELEASE, Ended, MOTION, Sitter, desktop},
    expect_code, root,
};
use serde_json::Value;

/// Size of the window.
const SIZE: (u16, u16) = (1280, 720);
/// How long the first sea may take to be made, and the program to be built.
const PATIENCE: Duration = Duration::from_secs(1200);
/// A boat must be hit so long after the window is there.
const LIMIT_S: f64 = 30.0;
fn fire(sailor: &Sitter) {
    sailor.send(BUTTON_PRESS, 1, (0, 0));
    thread::sleep(Duration::from_millis(250));
    sailor.send(BUTTON_RELEASE, 1, (0, 0));
}

/// Brightness of the window's pixels, where it can be seen.
fn look(sailor: &Sitter) -> Option<Vec<i32>> {
    let data = sailor.pixels(SIZE)?;
    let pixels = data.chunks_exact(4);
    Some(pixels.map(|p| i32::from(p[0]) + 2 * i32::from(p[1]) + i32::from(p[2])).collect())
}

/// Row of the horizon in some columns: where the picture darkens most downwards.
fn horizon(light: &[i32], columns: std::ops::Range<usize>) -> usize {
    let width = usize::from(SIZE.0);
    let row = |y: usize| -> i64 { columns.clone().map(|x| i64::from(light[y * width + x])).sum() };
    (150..600).max_by_key(|y| row(y - 2) + row(y - 1) - row(y + 1) - row(y + 2)).expect("rows")
}

/// The boat, pixels: what stands out most from the water around it, a little below the horizon.
fn boat(light: &[i32]) -> Option<(f64, f64)> {
    const CELL: usize = 8;
    // All of it, since the front sight hides its middle once the gun points at it: either half alone would be aimed beside.
    const LONG: usize = 48;
    let width = usize::from(SIZE.0);
    let (left, right) = (horizon(light, 330..430) as f64, horizon(light, 850..950) as f64);
    let mut best = (0, (0.0, 0.0));
    for x0 in (200..1080).step_by(CELL) {
        let level = left + (right - left) * (x0 as f64 - 380.0) / 520.0;
        for y0 in ((level as usize + 10)..(level as usize + 60).min(690)).step_by(4) {
            let (mut stands_out, mut sum, mut weight) = (0, (0.0, 0.0), 0.0);
            for y in y0..y0 + CELL {
                // The water to both sides.
                let beside = [x0 - 60, x0 - 45, x0 + LONG + 45, x0 + LONG + 60];
                let mut beside = beside.map(|x| light[y * width + x.min(width - 1)]);
                beside.sort_unstable();
                // One of them may be the front sight.
                let water = (beside[1] + beside[2]) / 2;
                // The front sight stands below the middle of the picture.
                for x in (x0..x0 + LONG).filter(|x| y < 358 || !(634..647).contains(x)) {
                    let off = (light[y * width + x] - water).abs();
                    if off > 70 {
                        stands_out += off;
                        sum = (sum.0 + x as f64 * f64::from(off), sum.1 + y as f64 * f64::from(off));
                        weight += f64::from(off);
                    }
                }
            }
            if stands_out > best.0 {
                best = (stands_out, (sum.0 / weight, sum.1 / weight));
            }
        }
    }
    (best.0 > 1500).then_some(best.1)
}

#[test]
fn a_boat_is_hit_within_half_a_minute_by_aiming_with_the_mouse() {
    if env::var_os("BOWWAVE_DESKTOP").is_none() {
        eprintln!("skipped: ./check desktop plays the demo");
        return;
    }
    let Some((_desktop, display)) = desktop() else { panic!("Xvfb is missing: ./check setup installs it") };
    let mut game = Ended(
        Command::new(root().join("demo"))
            .env("DISPLAY", &display)
            .current_dir(root())
            .spawn()
            .expect("./demo runs"),
    );
    let sailor = Sitter::before(&display, &mut game.0, PATIENCE);
    sailor.send(MOTION, 0, (700, 400));
    let begun = Instant::now();
    let mut last_fire = begun;
    while begun.elapsed().as_secs_f64() < LIMIT_S {
        thread::sleep(Duration::from_millis(70));
        let Some(light) = look(&sailor) else { break };
        let Some((x, y)) = boat(&light) else { continue };
        // A round falls by half a metre on its way: the barrel points two pixels above the boat.
        let off = (x - 640.0, y - 362.0);
        let step = |off: f64| (0.16 * off).clamp(-40.0, 40.0).round() as i16;
        sailor.send(MOTION, 1, (step(off.0), step(off.1)));
        let is_on = off.0.abs() < 6.0 && off.1.abs() < 2.5;
        if is_on && begun.elapsed().as_secs_f64() > 4.0 && last_fire.elapsed().as_secs_f64() > 0.8 {
            last_fire = Instant::now();
            fire(&sailor);
        }
    }
    assert!(game.0.wait().expect("it ends").success(), "the demo fails");
    let out = root().join("target/demo");
    let summary: Value =
        serde_json::from_slice(&fs::read(out.join("summary.json")).expect("a summary")).expect("JSON");
    let printed = bowwave(["score", out.to_str().expect("a plain path"), "--json"]);
    expect_code(&printed, 0);
    let score: Value = serde_json::from_slice(&printed.stdout).expect("JSON");
    println!(
        "missed deadlines {} of {}; registration {}",
        summary["missed_deadlines"], summary["frames"], summary["registration_px"]
    );
    println!("rounds {}", score["rounds"]);
    // Nothing is fired after the limit.
    assert!(score["rounds"]["hits"].as_u64() >= Some(1), "no hit: {}", score["rounds"]);
}
