//! The lens from pictures of the calibration target.

use anyhow::Result;
use bowwave_calibration::{
    lens::{BoardView, LensCalibration, LensModel, solve},
    simulated::Random,
    target::{Grey, Target, detect, varied, view},
};
use glam::DVec2;

use super::{About, rms, worst};
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    target::{
        draw::{BoardShot, TrueLens, draw, true_corners},
        shots::{board, exact, held},
    },
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "camera",
    what: "Finds focal length, centre and distortion from pictures of the board, which of two models the lens is, and how sure that is.",
    truth: "boards seen through lenses of formulas of their own; corners with noise of .1 px unless said otherwise, or found in drawn \
            pictures. Errors are the focal length's in pixels (of some 900, or 400 of the fisheye), the root mean square of several seeds; \
            the mean of both axes. What fits wrongly is told by what is left in pictures that took no part",
    rivals: "fewer and more pictures; always a pinhole, always a fisheye; all of a recording's pictures instead of those that differ",
    why: "forty pictures that differ from one another at most: more err hardly less and take longer. The model is the one with less left \
          over, in the fit and in pictures that took no part",
};

fn views(lens: &TrueLens, target: &Target, count: usize, tilt: f64, noise: f64, seed: u64) -> Vec<BoardView> {
    let seen = |(i, shot): (usize, &BoardShot)| {
        exact(target, &true_corners(target, lens, shot), noise, seed * 991 + i as u64)
    };
    held(lens, target, count, tilt, seed).iter().enumerate().map(seen).collect()
}

fn size(lens: &TrueLens) -> (u32, u32) {
    (lens.size.0 as u32, lens.size.1 as u32)
}

/// Error of the focal length, pixels; the whole of it where there is none.
fn focal_error(lens: &TrueLens, camera: Option<&LensCalibration>) -> f64 {
    let truth = 0.5 * (lens.numbers[0] + lens.numbers[1]);
    camera.map_or(truth, |c| (0.5 * (c.intrinsics[0] + c.intrinsics[1]) - truth).abs())
}

fn centre_error(lens: &TrueLens, camera: Option<&LensCalibration>) -> f64 {
    let truth = DVec2::new(lens.numbers[2], lens.numbers[3]);
    camera.map_or(truth.length(), |c| DVec2::new(c.intrinsics[2], c.intrinsics[3]).distance(truth))
}

const LENSES: [(&str, TrueLens); 2] = [("a pinhole", TrueLens::PINHOLE), ("a fisheye", TrueLens::FISHEYE)];

/// Error against the number of pictures.
fn pictures(bench: &mut PartBench, target: &Target, seeds: u64) {
    for (name, lens) in LENSES {
        let ways = [6, 12, 24, 40, 80].map(|count| {
            let all: Vec<Vec<BoardView>> =
                (0..seeds).map(|seed| views(&lens, target, count, 0.6, 0.1, seed)).collect();
            let found: Vec<Option<LensCalibration>> =
                all.iter().map(|v| solve(v, size(&lens)).ok()).collect();
            let error = rms(found.iter().map(|c| focal_error(&lens, c.as_ref())));
            let centre = rms(found.iter().map(|c| centre_error(&lens, c.as_ref())));
            let stated = rms(found.iter().flatten().map(LensCalibration::focal_sigma_px));
            let first = all.into_iter().next().unwrap_or_default();
            let work = move || solve(&first, size(&lens)).is_ok();
            let way = Way::new("bundle adjustment", &format!("{count} pictures"), error, 1, work)
                .note(format!("centre {centre:.3} px, stated sigma {stated:.3} px"));
            if count == 40 {
                way.default_although(
                    "as many as there are is what is used, forty at most; of few seeds chance ranks errors",
                )
            } else {
                way
            }
        });
        bench.scene(&format!("{name}, by the number of pictures"), "px of focal length", 0.0, ways.into());
    }
}

/// One corner in twenty anywhere within 30 pixels.
fn wild(views: &mut [BoardView]) {
    let mut random = Random::new(17);
    for corner in views.iter_mut().flat_map(|v| &mut v.corners).step_by(20) {
        corner.pixel += DVec2::new(random.unit() - 0.5, random.unit() - 0.5) * 60.0;
    }
}

/// An extreme case: pictures, tilt, noise, and what is done to the corners.
type LensCase = (&'static str, usize, f64, f64, fn(&mut [BoardView]));

const CASES: [LensCase; 8] = [
    ("noise of .02 px", 24, 0.6, 0.02, |_| ()),
    ("noise of .5 px", 24, 0.6, 0.5, |_| ()),
    ("noise of 1 px", 24, 0.6, 1.0, |_| ()),
    ("five pictures", 5, 0.6, 0.1, |_| ()),
    ("tilted by 15 deg at most", 24, 0.26, 0.1, |_| ()),
    ("one corner in twenty wild", 24, 0.6, 0.1, wild),
    ("the left half of the picture only", 24, 0.6, 0.1, |v| {
        v.iter_mut().for_each(|v| v.corners.retain(|c| c.pixel.x < 640.0));
    }),
    ("twelve corners a picture", 24, 0.6, 0.1, |v| v.iter_mut().for_each(|v| v.corners.truncate(12))),
];

fn extremes(bench: &mut PartBench, target: &Target, seeds: u64) {
    for (name, lens) in LENSES {
        for (case, count, tilt, noise, spoil) in CASES {
            let found: Vec<Option<LensCalibration>> = (0..seeds)
                .map(|seed| {
                    let mut views = views(&lens, target, count, tilt, noise, 100 + seed);
                    spoil(&mut views);
                    solve(&views, size(&lens)).ok()
                })
                .collect();
            let solved: Vec<&LensCalibration> = found.iter().flatten().collect();
            let error = worst(solved.iter().map(|c| focal_error(&lens, Some(c))));
            let beyond = worst(solved.iter().map(|c| focal_error(&lens, Some(c)) / c.focal_sigma_px()));
            let note = format!("{} of {seeds} solved; at most {beyond:.1} stated sigmas off", solved.len());
            let tried =
                vec![ExtremeResult::product("bundle adjustment", "chosen by evidence", error).note(note)];
            bench.extreme(&format!("{name}: {case}"), "px of focal length", tried);
        }
    }
}

/// How often the wrong model is chosen, and what it leaves where it took no part.
fn models(bench: &mut PartBench, target: &Target, seeds: u64) {
    let mild = TrueLens { numbers: [905.0, 902.0, 652.0, 349.0, -0.05, 0.0, 0.0, 0.0], ..TrueLens::PINHOLE };
    for (name, lens) in [LENSES[0], LENSES[1], ("a pinhole with little distortion", mild)] {
        let truth = if lens.fisheye { LensModel::Fisheye } else { LensModel::RadialTangential };
        let found: Vec<LensCalibration> = (0..seeds)
            .filter_map(|seed| solve(&views(&lens, target, 16, 0.6, 0.1, 300 + seed), size(&lens)).ok())
            .collect();
        let wrong = found.iter().filter(|c| c.model != truth).count();
        let share = if found.is_empty() { 100.0 } else { 100.0 * wrong as f64 / found.len() as f64 };
        let always = |model: LensModel| if model == truth { 0.0 } else { 100.0 };
        bench.extreme(
            &format!("{name}: taken for the other"),
            "%",
            vec![
                ExtremeResult::product("two models", "chosen by evidence", share),
                ExtremeResult::rival("one model", "pinhole", always(LensModel::RadialTangential)),
                ExtremeResult::rival("one model", "fisheye", always(LensModel::Fisheye)),
            ],
        );
        let left = |model: LensModel| {
            rms(found.iter().flat_map(|c| &c.evidence).filter(|e| e.model == model).map(|e| e.held_out_px))
        };
        let chosen = found.iter().filter_map(|c| c.evidence.iter().find(|e| e.model == c.model));
        bench.extreme(
            &format!("{name}: left over where it took no part"),
            "px",
            vec![
                ExtremeResult::product(
                    "two models",
                    "chosen by evidence",
                    rms(chosen.map(|e| e.held_out_px)),
                ),
                ExtremeResult::rival("one model", "pinhole", left(LensModel::RadialTangential)),
                ExtremeResult::rival("one model", "fisheye", left(LensModel::Fisheye)),
            ],
        );
    }
}

/// From drawn pictures to the lens.
fn whole_way(bench: &mut PartBench, target: &Target, count: usize) {
    for (name, lens) in LENSES {
        let directions = lens.directions();
        for (case, blur_px, noise) in [("sharp", 0.7, 2.0), ("dim and blurred", 1.8, 12.0)] {
            let found: Vec<BoardView> = held(&lens, target, count, 0.7, 40)
                .into_iter()
                .map(|shot| draw(target, &lens, &directions, &BoardShot { blur_px, noise, ..shot }))
                .filter_map(|p| Some(view(target, &detect(target, &Grey::new(p.size.0, p.size.1, &p.grey)?))))
                .filter(|v| !v.corners.is_empty())
                .collect();
            let some: Vec<BoardView> = varied(&found, 40).into_iter().map(|i| found[i].clone()).collect();
            let camera = solve(&some, size(&lens)).ok();
            let note = camera.as_ref().map_or_else(
                || "no lens".to_owned(),
                |c| {
                    let (sigma, edge) = (c.focal_sigma_px(), c.edge_sigma() * 1e3);
                    format!(
                        "{} pictures, stated sigma {sigma:.3} px, {edge:.3} mrad at the edge",
                        c.poses.len()
                    )
                },
            );
            let error = focal_error(&lens, camera.as_ref());
            let tried = vec![
                ExtremeResult::product("detection and adjustment", &format!("{count} pictures"), error)
                    .note(note),
            ];
            bench.extreme(&format!("{name}: from drawn pictures, {case}"), "px of focal length", tried);
        }
    }
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let target = board();
    let seeds = if bench.is_quick() { 3 } else { 12 };
    pictures(bench, &target, seeds);
    extremes(bench, &target, seeds);
    models(bench, &target, seeds);
    whole_way(bench, &target, if bench.is_quick() { 9 } else { 27 });
    Ok(())
}
