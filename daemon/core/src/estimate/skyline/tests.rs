use proptest::prelude::*;

use super::*;
use crate::{
    event::PixelFormat,
    geometry::{Distortion, look},
};

const SIZE: (u32, u32) = (640, 360);
const EYE_M: f64 = 6.0;
/// As clouds at the horizon drift, rad/s.
const DRIFT: f64 = 1e-4;

pub(super) fn lens() -> Lens {
    Lens {
        distortion: Distortion::radial_tangential(DVec2::new(-0.15, 0.02), DVec2::ZERO),
        ..Lens::pinhole(SIZE.0, SIZE.1, 1.1)
    }
}

/// Evenly spread numbers from 0 to 1, by place.
pub(super) fn grain(x: i64, y: i64, seed: u64) -> f64 {
    let mut z = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64).wrapping_add(seed << 32);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Smooth noise on a lattice of ones.
fn cloud(x: f64, y: f64) -> f64 {
    let (ix, iy) = (x.floor(), y.floor());
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (u, v) = (smooth(x - ix), smooth(y - iy));
    let at = |dx: i64, dy: i64| grain(ix as i64 + dx, iy as i64 + dy, 3);
    let (top, bottom) = (at(0, 0) + (at(1, 0) - at(0, 0)) * u, at(0, 1) + (at(1, 1) - at(0, 1)) * u);
    top + (bottom - top) * v
}

/// Clouds that stand in the world.
pub(super) fn clouds(azimuth: f64, elevation: f64) -> f64 {
    120.0 + 60.0 * cloud(azimuth * 20.0, elevation * 25.0) + 30.0 * cloud(azimuth * 57.0, elevation * 60.0)
}

/// What `sky` gives for azimuth and elevation over a rough sea, with noise that differs by `seed`.
pub(super) fn painted(world_from_camera: DQuat, seed: u64, sky: impl Fn(f64, f64) -> f64) -> Picture {
    painted_by(&lens(), world_from_camera, seed, sky)
}

/// The same through another lens.
fn painted_by(lens: &Lens, world_from_camera: DQuat, seed: u64, sky: impl Fn(f64, f64) -> f64) -> Picture {
    let code = |i: u32| {
        let (x, y) = (i % SIZE.0, i / SIZE.0);
        let d = world_from_camera * lens.unproject(DVec2::new(f64::from(x), f64::from(y)) + 0.5);
        let light = if d.z > 0.0 {
            sky(d.x.atan2(d.y), d.z.asin())
        } else {
            60.0 + 40.0 * grain(i64::from(i), 1, seed)
        };
        (light + 3.0 * (grain(i64::from(i), 2, seed) - 0.5)).round().clamp(0.0, 255.0) as u8
    };
    let mut luma: Vec<u8> = (0..SIZE.0 * SIZE.1).map(code).collect();
    luma.resize(luma.len() * 3 / 2, 128);
    Picture::new(PixelFormat::Nv12, SIZE.0, SIZE.1, luma.into()).unwrap()
}

fn view(world_from_camera: DQuat) -> SkyView {
    SkyView { lens: lens(), eye_height_m: EYE_M, world_from_camera, sigma: 0.005, drift: DRIFT }
}

fn at(tenths: i64) -> Time {
    Time::from_ns(tenths * 100_000_000)
}

/// Shows eight pictures of a camera that pans by `pan` radians a picture, believed to turn by `drift` more; the last answer.
fn shown(
    skyline: &mut Skyline,
    pan: f64,
    drift: f64,
    sky: impl Fn(i64, f64, f64) -> f64,
) -> Result<YawSeen, NoYaw> {
    let mut last = Err(NoYaw::NoSky);
    for i in 0..8 {
        let azimuth = 0.3 + pan * i as f64;
        let (elevation, roll) = (0.1 + 0.02 * (i as f64).sin(), 0.05 * (i as f64 * 0.7).sin());
        let picture = painted(look(azimuth, elevation, roll), i as u64, |a, e| sky(i, a, e));
        last = skyline.look(at(i), &picture, &view(look(azimuth + drift * i as f64, elevation, roll)));
    }
    last
}

#[test]
fn a_drifting_heading_is_told_in_a_pan() {
    for (pan, drift) in [(0.0, 0.001), (0.1, -0.0004), (-0.06, 0.0)] {
        let mut skyline = Skyline::new();
        let seen = shown(&mut skyline, pan, drift, |_, a, e| clouds(a, e)).unwrap();
        // Azimuth is clockwise, `off` the other way and what the belief is to be turned by.
        let off = seen.off - drift * 7.0;
        assert!(off.abs() < 4e-4 && off.abs() < 4.0 * seen.sigma, "{off} of {seen:?}");
        assert!(seen.anchor == at(0) && !seen.is_anchor() && seen.points.0 >= 20, "{seen:?}");
    }
}

#[test]
fn rows_are_seen_one_after_another() {
    // 30 ms at 40 deg/s, to and fro, of a lens that is given for twice the picture's size.
    let mut skyline = Skyline::new();
    for i in 0..8 {
        let turn = DVec3::new(0.004, 0.021, -0.003) * (0.9 * i as f64).cos();
        let rolling = lens().read_while(turn);
        let pose = look(0.3 + 0.03 * (0.9 * i as f64).sin(), -0.05, 0.02 * i as f64);
        let picture = painted_by(&rolling, pose, i, clouds);
        let seen = |lens: Lens, skyline: &mut Skyline| {
            skyline.look(at(i as i64), &picture, &SkyView { lens, ..view(pose) })
        };
        // Nobody knows of the rows.
        let unknown = seen(lens(), &mut skyline.clone());
        let known = seen(rolling.covering(2 * SIZE.0, 2 * SIZE.1), &mut skyline).unwrap();
        assert!(known.off.abs() < 3e-4, "{known:?}");
        assert!(i != 4 || unknown.map_or(1.0, |u| u.off.abs()) > 1.5e-3, "{unknown:?}");
    }
}

#[test]
fn clouds_that_wind_carries_turn_nothing() {
    let wind = DVec2::new(0.008, -0.003);
    let mut skyline = Skyline::new();
    let mut last = Err(NoYaw::NoSky);
    for i in 0..9 {
        let pose = look(0.3 + 0.02 * i as f64, 0.12, 0.03 * (i as f64).sin());
        // Where a cloud over a flat sea was before, in its heights.
        let before = |a: f64, e: f64| {
            let along = e.max(0.01).tan().recip();
            let at = DVec2::new(a.sin(), a.cos()) * along - wind * i as f64;
            clouds(at.x.atan2(at.y), at.length().recip().atan())
        };
        last = skyline.look(at(10 * i), &painted(pose, i as u64, before), &view(pose));
    }
    let seen = last.unwrap();
    assert!(seen.off.abs() < 6e-4 && seen.off.abs() < 3.0 * seen.sigma, "{seen:?}");
    assert!((seen.wind.0 - wind).length() < 1.5e-3, "{seen:?}");
}

#[test]
fn exposure_and_what_passes_do_not_matter() {
    let ship = |i: i64, a: f64, e: f64| {
        let bow = 0.02 * i as f64;
        let light = clouds(a, e) * (1.0 + 0.04 * i as f64) - 40.0;
        if (bow..bow + 0.3).contains(&a) && e < 0.08 {
            200.0 * cloud((a - bow) * 90.0, e * 90.0)
        } else {
            light
        }
    };
    let seen = shown(&mut Skyline::new(), 0.02, 0.001, ship).unwrap();
    assert!((seen.off - 0.007).abs() < 4e-4, "{seen:?}");
}

#[test]
fn nothing_to_hold_on_to_is_said() {
    let mut skyline = Skyline::new();
    let even = shown(&mut skyline, 0.02, 0.0, |_, _, _| 150.0);
    assert!(matches!(even, Err(NoYaw::Featureless { .. })), "{even:?}");
    let glare = shown(&mut skyline, 0.02, 0.0, |_, _, _| 400.0);
    assert!(matches!(glare, Err(NoYaw::Featureless { .. })), "{glare:?}");
    let down = look(0.3, -1.0, 0.0);
    let water = skyline.look(at(9), &painted(down, 1, clouds), &view(down));
    assert_eq!(water, Err(NoYaw::NoSky));
    let hidden = Mask::new(1, 1, vec![true]);
    skyline.set_mask(hidden);
    assert_eq!(shown(&mut skyline, 0.0, 0.0, |_, a, e| clouds(a, e)), Err(NoYaw::NoSky));
}

#[test]
fn a_pattern_that_repeats_leads_no_farther_than_the_prediction_allows() {
    let rows = |_: i64, a: f64, e: f64| 128.0 + 60.0 * ((a * 200.0).sin() + (e * 200.0).sin());
    if let Ok(seen) = shown(&mut Skyline::new(), 0.01, 0.0, rows) {
        assert!(seen.off.abs() < 3.0 * 0.005, "{seen:?}");
    }
}

#[test]
fn another_scene_is_another_anchor() {
    let mut skyline = Skyline::new();
    shown(&mut skyline, 0.0, 0.0, |_, a, e| clouds(a, e)).unwrap();
    let pose = look(0.3, 0.1, 0.0);
    let mut answers = Vec::new();
    for i in 8..30 {
        let picture = painted(pose, i, |a, e| clouds(a + 1.3, e + 0.4));
        answers.push(skyline.look(at(i as i64), &picture, &view(pose)));
    }
    assert!(answers[0].is_err(), "{answers:?}");
    let fresh: Vec<Time> = answers.iter().flatten().filter(|s| s.is_anchor()).map(|s| s.time).collect();
    assert!(matches!(fresh[..], [t] if t.ns_since(at(7)) > LOST_NS), "{fresh:?}");
    assert!(answers.last().unwrap().is_ok());
    assert!(skyline.points.len() <= (KEPT + 1) * Skyline::POINTS);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn no_picture_panics(
        width in 1u32..400, height in 1u32..300, seed in 0u64..1000,
        sigma in prop_oneof![Just(0.0), Just(f64::NAN), Just(1e300), 0.0..1.0f64],
        focal in prop_oneof![Just(0.0), Just(f64::NAN), Just(1e-3), 10.0..1000.0f64],
        k1 in prop_oneof![Just(0.0), Just(f64::INFINITY), -5.0..5.0f64],
        turns in proptest::collection::vec((-3.0..3.0f64, -1.5..1.5f64, -3.0..3.0f64), 3),
        broken in any::<bool>(),
    ) {
        let mut skyline = Skyline::new();
        skyline.set_mask(Mask::new(3, 2, vec![false, true, false, false, false, false]));
        let lens = Lens {
            distortion: Distortion::radial_tangential(DVec2::new(k1, 0.0), DVec2::ZERO),
            focal: DVec2::splat(focal),
            ..Lens::pinhole(width, height, 1.0)
        };
        for (i, (azimuth, elevation, roll)) in turns.into_iter().enumerate() {
            for format in [PixelFormat::Rgb, PixelFormat::Yuyv, PixelFormat::Nv12] {
                let bytes: Vec<u8> = (0..format.byte_len(width, height))
                    .map(|b| (200.0 * grain(b as i64 / 5, 0, seed)) as u8)
                    .collect();
                let Ok(picture) = Picture::new(format, width, height, bytes.into()) else { continue };
                let q = if broken && i == 1 { DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0) } else { look(azimuth, elevation, roll) };
                let view = SkyView { lens, eye_height_m: 5.0, world_from_camera: q, sigma, drift: sigma };
                if let Ok(seen) = skyline.look(at(i as i64), &picture, &view) {
                    prop_assert!(seen.off.is_finite() && seen.sigma.is_finite() && seen.turn.is_finite());
                }
            }
        }
    }
}
