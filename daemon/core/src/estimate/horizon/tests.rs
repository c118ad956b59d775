use std::sync::Arc;

use glam::{DVec2, DVec3};
use proptest::prelude::*;

use super::{fit::up_of, *};
use crate::{
    event::{Picture, PixelFormat},
    geometry::{Distortion, Lens, horizon_dip},
    own_ship::Mask,
};

/// Evenly spread numbers from -1 to 1, by place.
fn grain(i: usize, seed: u64) -> f64 {
    let mut z = (i as u64).wrapping_add(seed << 32).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

const SIZE: (u32, u32) = (640, 360);
const EYE_M: f64 = 6.0;

fn lens(k1: f64) -> Lens {
    Lens {
        distortion: Distortion::radial_tangential(DVec2::X * k1, DVec2::ZERO),
        ..Lens::pinhole(SIZE.0, SIZE.1, 1.1)
    }
}

fn view(lens: Lens, prior: Option<Prior>) -> HorizonView {
    HorizonView { lens, eye_height_m: EYE_M, prior }
}

/// Luma of what `paint` gives for the angle over the horizon, in pixels, and the pixel's index.
fn painted(lens: &Lens, up: DVec3, paint: impl Fn(f64, usize) -> f64) -> Vec<u8> {
    let sin_dip = horizon_dip(EYE_M).sin();
    let code = |i: usize| {
        let place = DVec2::new((i % SIZE.0 as usize) as f64, (i / SIZE.0 as usize) as f64) + 0.5;
        let over = (lens.unproject(place).dot(up) + sin_dip) * lens.focal.x;
        paint(over, i).round().clamp(0.0, 255.0) as u8
    };
    (0..(SIZE.0 * SIZE.1) as usize).map(code).collect()
}

/// A smooth sky over a rough sea, a pixel wide where they meet.
fn sea_and_sky(over: f64, i: usize) -> f64 {
    let sky = (over + 0.5).clamp(0.0, 1.0);
    sky * (170.0 + 2.0 * grain(i, 1)) + (1.0 - sky) * (80.0 + 12.0 * grain(i / 3, 2))
}

fn nv12(size: (u32, u32), mut luma: Vec<u8>) -> Picture {
    luma.resize(luma.len() * 3 / 2, 128);
    Picture::new(PixelFormat::Nv12, size.0, size.1, luma.into()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_drawn_horizon_is_found(roll in -1.05..1.05f64, share in -0.7..0.7f64, k1 in -0.25..0.1f64, seed in 0u64..99) {
        let lens = lens(k1);
        let elevation = (share * 180.0 / lens.focal.y).atan();
        let up = up_of(roll, elevation);
        let picture = nv12(SIZE, painted(&lens, up, |over, i| sea_and_sky(over, i + seed as usize)));
        let mut finder = HorizonFinder::new();
        let turned = up_of(roll + 0.01, elevation - 0.01);
        for prior in [None, Some(Prior { up: turned, sigma: 0.01 })] {
            let found = finder.find(&picture, &view(lens, prior)).unwrap();
            // A third of a pixel, or a fiftieth of a degree for a level line; a steep one crosses few columns.
            prop_assert!((found.elevation() - elevation).abs() * lens.focal.x < 0.35, "{found:?}");
            prop_assert!((found.roll() - roll).abs() < 0.0015, "{found:?}");
            let sigma = found.covariance.col(0).x.sqrt();
            prop_assert!(sigma > 1e-5 && sigma < 0.005, "{sigma}");
        }
    }

    #[test]
    fn no_picture_panics(
        width in 1u32..300, height in 1u32..300, seed in 0u64..1000, level in 0u8..255,
        sigma in prop_oneof![Just(0.0), Just(f64::NAN), 0.0..1.0f64],
        up in prop_oneof![Just(DVec3::ZERO), Just(DVec3::NAN), Just(DVec3::Z), Just(DVec3::NEG_Y)],
        focal in prop_oneof![Just(0.0), Just(f64::NAN), Just(1e-3), 10.0..1000.0f64],
    ) {
        let mut finder = HorizonFinder::new();
        finder.set_mask(Mask::new(3, 2, vec![false, true, false, true, false, false]));
        for format in [PixelFormat::Rgb, PixelFormat::Yuyv, PixelFormat::Nv12] {
            let bytes: Vec<u8> = (0..format.byte_len(width, height))
                .map(|i| level.wrapping_add((grain(i, seed) * 60.0) as i8 as u8))
                .collect();
            // Sizes that a format cannot have are refused before they come here.
            let Ok(picture) = Picture::new(format, width, height, bytes.into()) else { continue };
            let lens = Lens { focal: DVec2::splat(focal), ..Lens::pinhole(width, height, 1.0) };
            for prior in [None, Some(Prior { up, sigma })] {
                let _ = finder.find(&picture, &view(lens, prior));
            }
        }
    }

    #[test]
    fn noise_is_no_horizon(seed in 0u64..1000, size in 1.0..120.0f64, mean in 20.0..230.0f64) {
        let luma = (0..(SIZE.0 * SIZE.1) as usize).map(|i| (mean + size * grain(i, seed)).clamp(0.0, 255.0) as u8);
        let picture = nv12(SIZE, luma.collect());
        for prior in [None, Some(Prior { up: DVec3::NEG_Y, sigma: 0.01 })] {
            prop_assert!(HorizonFinder::new().find(&picture, &view(lens(0.0), prior)).is_err());
        }
    }
}

#[test]
fn a_blank_picture_has_none() {
    for code in [0, 16, 128, 255] {
        let picture = nv12(SIZE, vec![code; (SIZE.0 * SIZE.1) as usize]);
        let found = HorizonFinder::new().find(&picture, &view(lens(0.0), None));
        assert_eq!(found, Err(NoHorizon::Featureless));
    }
    let small = nv12((16, 16), vec![9; 256]);
    assert_eq!(HorizonFinder::new().find(&small, &view(lens(0.0), None)), Err(NoHorizon::TooSmall));
}

#[test]
fn all_formats_and_a_picture_of_twice_the_size_say_the_same() {
    let lens = lens(-0.1);
    let up = up_of(0.1, 0.05);
    let luma = painted(&lens, up, sea_and_sky);
    let yuyv: Arc<[u8]> = luma.iter().flat_map(|y| [*y, 128]).collect();
    let rgb: Arc<[u8]> = luma.iter().flat_map(|y| [*y; 3]).collect();
    let (w, h) = SIZE;
    let mut finder = HorizonFinder::new();
    let mut find = |picture: &Picture| finder.find(picture, &view(lens, None)).unwrap().up;
    let reference = find(&nv12(SIZE, luma.clone()));
    for (format, bytes) in [(PixelFormat::Yuyv, yuyv), (PixelFormat::Rgb, rgb)] {
        let found = find(&Picture::new(format, w, h, bytes).unwrap());
        assert!(found.angle_between(reference) < 1e-6, "{format:?}");
    }
    // Four times as large, it is reduced by two; the lens stays that of the small one.
    let (w, h) = (w as usize, h as usize);
    let large = (0..w * h * 16).map(|i| luma[i / (w * 4) / 4 * w + i % (w * 4) / 4]).collect();
    let found = find(&nv12((4 * w as u32, 4 * h as u32), large));
    assert!(found.angle_between(reference) < 2e-4, "{}", found.angle_between(reference));
}

#[test]
fn what_is_masked_is_not_looked_at() {
    let lens = lens(0.0);
    let up = up_of(-0.05, -0.02);
    // The upper edge of the own ship is a better line than the horizon.
    let deck = |over: f64, i: usize| {
        if i / SIZE.0 as usize > 250 { 10.0 } else { 0.4 * sea_and_sky(over, i) + 100.0 }
    };
    let picture = nv12(SIZE, painted(&lens, up, deck));
    let mut finder = HorizonFinder::new();
    let rows: Vec<bool> = (0..36).map(|row| row >= 24).collect();
    finder.set_mask(Mask::new(1, 36, rows));
    let found = finder.find(&picture, &view(lens, None)).unwrap();
    assert!(found.up.angle_between(up) < 1e-3, "{found:?}");
    assert!(Mask::new(2, 2, vec![true]).is_none() && Mask::new(0, 0, vec![]).is_none());
    finder.set_mask(Mask::new(1, 1, vec![true]));
    assert_eq!(finder.find(&picture, &view(lens, None)), Err(NoHorizon::Featureless));
}

#[test]
fn a_shore_a_blur_and_a_view_past_it_are_told_apart() {
    let lens = lens(0.0);
    let up = up_of(0.02, 0.0);
    let find = |paint: &dyn Fn(f64, usize) -> f64, prior: Option<Prior>| {
        HorizonFinder::new().find(&nv12(SIZE, painted(&lens, up, paint)), &view(lens, prior))
    };
    // Rocks and trees higher than the picture over bright water.
    let shore = |over: f64, i: usize| {
        if over > 0.0 { 60.0 + 40.0 * grain(i / 8 + i / 640 / 3 * 80, 5) } else { 150.0 + 6.0 * grain(i, 6) }
    };
    for prior in [None, Some(Prior { up, sigma: 0.01 })] {
        let found = find(&shore, prior);
        assert!(matches!(found, Err(NoHorizon::Textured(_) | NoHorizon::Unclear(_))), "{found:?}");
    }
    let smeared = |over: f64, i: usize| 125.0 + 45.0 * (over / 12.0).clamp(-1.0, 1.0) + 2.0 * grain(i, 7);
    let found = find(&smeared, None);
    assert!(matches!(found, Err(NoHorizon::Blurred(_) | NoHorizon::Unclear(_))), "{found:?}");
    let away = Prior { up: up_of(0.0, 0.9), sigma: 0.01 };
    assert_eq!(find(&sea_and_sky, Some(away)), Err(NoHorizon::OutOfView));
    // A prediction that is wrong by more than it says finds nothing.
    let wrong = Prior { up: up_of(0.02, 0.1), sigma: 0.005 };
    assert!(find(&sea_and_sky, Some(wrong)).is_err());
}

/// Column and row of a pixel.
fn at(i: usize) -> (usize, usize) {
    (i % SIZE.0 as usize, i / SIZE.0 as usize)
}

fn find_painted(up: DVec3, paint: &dyn Fn(f64, usize) -> f64) -> Result<Horizon, NoHorizon> {
    let lens = lens(0.0);
    HorizonFinder::new().find(&nv12(SIZE, painted(&lens, up, paint)), &view(lens, None))
}

#[test]
fn the_free_part_of_a_horizon_tells_it() {
    let up = up_of(0.03, 0.02);
    // A nearer coast, whose water line stands lower, hides all but a quarter of it.
    let coast = |over: f64, i: usize| {
        let (x, _) = at(i);
        let top = 28.0 + 8.0 * (x as f64 / 40.0).sin();
        let rough = 60.0 + 25.0 * grain(x / 3, 8);
        if x > 160 && (-5.0..top).contains(&over) { rough } else { sea_and_sky(over, i) }
    };
    let found = find_painted(up, &coast).unwrap();
    assert!((found.elevation() - 0.02).abs() * lens(0.0).focal.x < 0.7, "{found:?}");
    assert!((found.roll() - 0.03).abs() < 0.006, "{found:?}");
    // The shorter it is, the less it tells of roll.
    let all = find_painted(up, &sea_and_sky).unwrap();
    assert!(found.covariance.x_axis.x > 4.0 * all.covariance.x_axis.x, "{found:?}");
}

#[test]
fn a_water_line_below_land_is_no_horizon() {
    let up = up_of(0.02, 0.0);
    let hills = |x: usize| 18.0 + 5.0 * (x as f64 / 90.0).sin();
    // Smooth dark hills over water that mirrors the bright sky, and hazy ones over dark water.
    let land = |land: f64, water: f64| {
        move |over: f64, i: usize| {
            let (x, _) = at(i);
            match over {
                _ if over > hills(x) => 170.0 + 2.0 * grain(i, 1),
                _ if over > 0.0 => land + 2.0 * grain(i, 1),
                _ => water + 12.0 * grain(i / 3, 2),
            }
        }
    };
    for (name, found) in
        [("dark", find_painted(up, &land(12.0, 70.0))), ("hazy", find_painted(up, &land(140.0, 80.0)))]
    {
        assert!(found.is_err(), "{name}: {found:?}");
    }
}

#[test]
fn waves_of_more_contrast_do_not_hide_the_horizon() {
    let up = up_of(-0.02, 0.03);
    // Glitter: its steps are four times the horizon's.
    let glitter = |over: f64, i: usize| {
        let (x, y) = at(i);
        let wave = 60.0 * grain(x / 6 + y / 4 * 107, 3) * (-over / 20.0).clamp(0.0, 1.0);
        if over > 0.0 { 150.0 + 2.0 * grain(i, 1) } else { 128.0 + wave + 3.0 * grain(i, 2) }
    };
    let found = find_painted(up, &glitter).unwrap();
    assert!((found.elevation() - 0.03).abs() * lens(0.0).focal.x < 1.0, "{found:?}");
    assert!((found.roll() + 0.02).abs() < 0.003, "{found:?}");
}

#[test]
fn sharp_clouds_are_no_land() {
    let up = up_of(0.02, -0.04);
    for seed in 4..8 {
        // Streaks of cloud low in the sky: their edges are as sharp as land's and half as strong as the horizon, but do not last.
        let streaks = |over: f64, i: usize| {
            let (x, _) = at(i);
            let streak = grain(x / 64 + (over / 4.0).floor().max(0.0) as usize * 10, seed);
            let sky = 150.0 + 35.0 * (-over / 40.0).exp() * streak + grain(i, 1);
            if over > 0.0 { sky } else { 80.0 + 12.0 * grain(i / 3, 2) }
        };
        let found = find_painted(up, &streaks).unwrap();
        assert!((found.elevation() + 0.04).abs() * lens(0.0).focal.x < 0.7, "{seed}: {found:?}");
        assert!((found.roll() - 0.02).abs() < 0.003, "{seed}: {found:?}");
    }
}
