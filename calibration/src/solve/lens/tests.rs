use bowwave_core::geometry::Bend;
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;

use super::*;
use crate::simulated::Random;

const SIZE: (u32, u32) = (1280, 720);
const PINHOLE: [f64; 8] = [905.0, 902.0, 652.0, 349.0, -0.21, 0.06, 8e-4, -1.1e-3];
const FISHEYE: [f64; 8] = [405.0, 403.0, 645.0, 355.0, -0.03, 0.008, -0.004, 0.0008];

/// A board of 6 x 6 tags, their 144 corners: seen from `count` sides with corners found to `noise` pixels.
fn views(
    model: LensModel,
    numbers: [f64; 8],
    count: usize,
    tilt: f64,
    noise: f64,
    seed: u64,
) -> Vec<BoardView> {
    let mut random = Random::new(seed);
    let lens = model.lens(numbers, SIZE);
    let mut out = Vec::new();
    while out.len() < count {
        let near = 0.35 + 0.5 * random.unit();
        let reach = 0.45 * 1280.0 / numbers[0] * near;
        let place = DVec3::new((random.unit() - 0.5) * 2.0 * reach, (random.unit() - 0.5) * reach, near);
        let turn = DQuat::from_scaled_axis(DVec3::new(random.gauss(), random.gauss(), 0.0) * tilt)
            * DQuat::from_rotation_z(random.gauss() * 0.5);
        let mut view = BoardView::default();
        for i in 0..144 {
            let board = DVec2::new(f64::from(i % 12), f64::from(i / 12)) * 0.03 - DVec2::splat(0.165);
            let point = turn * board.extend(0.0) + place;
            if let Some(pixel) = lens.project(point) {
                let pixel = DVec2::new(pixel.x, pixel.y) + DVec2::new(random.gauss(), random.gauss()) * noise;
                if (0.0..1280.0).contains(&pixel.x) && (0.0..720.0).contains(&pixel.y) && point.z > 0.05 {
                    view.corners.push(Corner { board, pixel });
                }
            }
        }
        if view.corners.len() >= 40 {
            out.push(view);
        }
    }
    out
}

#[test]
fn both_lenses_are_found_and_told_apart() {
    for (model, truth) in [(LensModel::RadialTangential, PINHOLE), (LensModel::Fisheye, FISHEYE)] {
        let mut outside = 0;
        for seed in 0..5 {
            let camera = solve(&views(model, truth, 25, 0.4, 0.2, seed), SIZE).unwrap();
            assert_eq!(camera.model, model, "{:?}", camera.evidence);
            assert!((camera.sigma_px - 0.2).abs() < 0.02, "{}", camera.sigma_px);
            let error = |i: usize| (camera.intrinsics[i] - truth[i]).abs();
            assert!(
                error(0) < 2.0 && error(1) < 2.0 && error(2) < 2.0 && error(3) < 2.0,
                "{:?}",
                camera.intrinsics
            );
            outside += (0..8).filter(|i| error(*i) > 3.0 * camera.sigma[*i]).count();
            assert!(camera.coverage.share > 0.6 && camera.coverage.tilt[1] > 0.4, "{:?}", camera.coverage);
            assert!(camera.evidence.iter().all(|e| e.held_out_px < 3.0 || e.model != model));
            assert_eq!(camera.lens().optics().bend == Bend::Fisheye, model == LensModel::Fisheye);
            assert_eq!(camera.poses.len(), 25);
        }
        // Of forty numbers three standard deviations hold all but one.
        assert!(outside <= 1, "{model:?}: {outside} of 40 beyond three sigmas");
    }
}

#[test]
fn the_stated_angles_hold() {
    let middle = DVec2::new(640.0, 360.0);
    let edge = [(0.0, 0.0), (1280.0, 0.0), (640.0, 720.0), (0.0, 360.0)];
    // No board reaches a fisheye's corners.
    let inner = [(250.0, 100.0), (1000.0, 600.0), (640.0, 650.0), (150.0, 360.0)];
    for (model, truth, pixels) in
        [(LensModel::RadialTangential, PINHOLE, edge), (LensModel::Fisheye, FISHEYE, inner)]
    {
        let angle = |numbers: [f64; 8], pixel: DVec2| {
            let to = |p: DVec2| model::direction(&model.lens(numbers, SIZE), p).unwrap();
            to(pixel).angle_between(to(middle))
        };
        let (mut outside, mut all) = (0, 0);
        for seed in 20..32 {
            let camera = solve(&views(model, truth, 14, 0.4, 0.3, seed), SIZE).unwrap();
            for pixel in pixels.map(DVec2::from) {
                let sigma = camera.angle_sigma(pixel);
                assert!((1e-5..3e-2).contains(&sigma) && sigma <= camera.edge_sigma(), "{model:?} {sigma}");
                all += 1;
                outside +=
                    usize::from((angle(camera.intrinsics, pixel) - angle(truth, pixel)).abs() > 3.0 * sigma);
            }
        }
        assert!(outside <= 1, "{model:?} {outside} of {all}");
    }
}

#[test]
fn what_is_missing_is_named() {
    let whole = solve(&views(LensModel::RadialTangential, PINHOLE, 40, 0.4, 0.2, 11), SIZE).unwrap();
    assert_eq!(whole.missing(), [], "{:?}", whole.coverage);
    assert_eq!(whole.grade(), crate::alignment::Grade::Good);
    // Corners of the left half only, eight pictures, much noise.
    let mut some = views(LensModel::RadialTangential, PINHOLE, 8, 0.4, 0.6, 12);
    some.iter_mut().for_each(|v| v.corners.retain(|c| c.pixel.x < 700.0));
    some.retain(|v| v.corners.len() > 20);
    let camera = solve(&some, SIZE).unwrap();
    let missing = camera.missing();
    for wanted in [
        Missing::Pictures(camera.poses.len()),
        Missing::Fit(camera.sigma_px),
        Missing::Part("upper right corner"),
    ] {
        assert!(missing.contains(&wanted), "{wanted:?} in {missing:?}");
    }
    assert!(camera.grade() < crate::alignment::Grade::Good);
    assert!(camera.edge_sigma() > whole.edge_sigma());
}

#[test]
fn one_corner_in_twenty_wild() {
    let mut seen = views(LensModel::RadialTangential, PINHOLE, 25, 0.4, 0.2, 8);
    let mut random = Random::new(2);
    for corner in seen.iter_mut().flat_map(|v| &mut v.corners).step_by(20) {
        corner.pixel = (corner.pixel + DVec2::new(random.gauss(), random.gauss()) * 30.0)
            .clamp(DVec2::ZERO, DVec2::new(1280.0, 720.0));
    }
    let camera = solve(&seen, SIZE).unwrap();
    assert!((camera.intrinsics[0] - PINHOLE[0]).abs() < 3.0, "{:?}", camera.intrinsics);
    assert!(camera.sigma_px < 0.25);
}

#[test]
fn degenerate_views_are_refused() {
    let frontal = views(LensModel::RadialTangential, PINHOLE, 20, 0.0, 0.2, 4);
    let error = solve(&frontal, SIZE).unwrap_err();
    assert!(matches!(error, LensError::NoTilt { .. } | LensError::Uncertain { .. }), "{error}");
    let few = views(LensModel::RadialTangential, PINHOLE, 3, 0.4, 0.2, 5);
    assert_eq!(solve(&few, SIZE), Err(LensError::TooFew { count: 3, least: 4, corners: 8 }));
    // Corners of one line do not span the board.
    let line: Vec<BoardView> = views(LensModel::RadialTangential, PINHOLE, 10, 0.4, 0.2, 6)
        .into_iter()
        .map(|v| BoardView {
            corners: v.corners.into_iter().filter(|c| c.board.y.abs() < 0.02 && c.board.y > 0.0).collect(),
        })
        .collect();
    assert!(solve(&line, SIZE).is_err());
    // A board of the wrong layout fits nothing.
    let mut wrong = views(LensModel::RadialTangential, PINHOLE, 12, 0.4, 0.2, 7);
    let mut random = Random::new(3);
    wrong
        .iter_mut()
        .flat_map(|v| &mut v.corners)
        .for_each(|c| c.board += DVec2::new(random.gauss(), random.gauss()) * 0.03);
    assert!(matches!(
        solve(&wrong, SIZE),
        Err(LensError::NoFit { .. } | LensError::Uncertain { .. } | LensError::NoTilt { .. })
    ));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn nothing_from_outside_panics(seed in 0u64..100_000, wild in 0.0..1.0f64, size in (0u32..3000, 0u32..3000)) {
        let mut random = Random::new(seed);
        let odd = |random: &mut Random, v: f64| match (random.unit() / wild.max(1e-9) * 8.0) as u32 {
            0 => f64::NAN,
            1 => 1e300,
            2 => 0.0,
            _ => v,
        };
        let mut seen = views(LensModel::RadialTangential, PINHOLE, 5, 0.3, 5.0, seed);
        for c in seen.iter_mut().flat_map(|v| &mut v.corners) {
            c.pixel.x = odd(&mut random, c.pixel.x);
            c.board.y = odd(&mut random, c.board.y);
        }
        if let Ok(camera) = solve(&seen, size) {
            prop_assert!(camera.intrinsics.iter().chain(&camera.sigma).all(|v| v.is_finite()));
        }
    }
}
