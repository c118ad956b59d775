//! The fit alone, on sights that need no pictures: clouds on a plane that wind takes along.

use super::{
    fit::{SkyTrack, SkylineFit, SkylinePrior, fit},
    tests::grain,
    wind::Wind,
    *,
};
use crate::geometry::look;

const PIXEL: f64 = 1.0 / 600.0;
const AGE_S: f64 = 20.0;
/// As clouds at the horizon drift, rad/s, and a layer that does so, heights a second.
const DRIFT: f64 = 1e-4;
const LAYER: f64 = 0.01;

/// Numbers of about the normal distribution, by place.
fn normal(i: i64, seed: u64) -> f64 {
    (0..12).map(|k| grain(i, k, seed)).sum::<f64>() - 6.0
}

/// What goes how: towards where it was seen at first, after so many seconds.
type Goes<'a> = &'a dyn Fn(DVec3, f64) -> DVec3;

/// Clouds that wind carries by so many of their heights a second, over a flat sea.
fn blown(wind: DVec2) -> impl Fn(DVec3, f64) -> DVec3 {
    move |d, age_s| (d / d.z + (wind * age_s).extend(0.0)).normalize()
}

/// Sights of `count` points between these elevations (degrees), seen in a world that is believed turned by `turn`.
fn sights(count: i64, between: (f64, f64), turn: DQuat, seed: u64, goes: Goes) -> Vec<SkyTrack> {
    let sight = |i: i64| {
        let elevation = between.0 + (between.1 - between.0) * grain(i, 20, seed);
        let held = look(1.1 * grain(i, 21, seed) - 0.55, elevation.to_radians(), 0.0) * DVec3::Z;
        let off =
            0.2 * PIXEL * DVec3::new(normal(3 * i, seed), normal(3 * i + 1, seed), normal(3 * i + 2, seed));
        let seen = turn.inverse() * (goes(held, AGE_S) + off).normalize();
        SkyTrack { seen, held, age_s: AGE_S, trust: 1.0, likeness: 1.0, unit: 1.0, ..SkyTrack::default() }
    };
    (0..count).map(sight).collect()
}

/// Those of them that lie straight ahead.
fn ahead(mut sights: Vec<SkyTrack>) -> Vec<SkyTrack> {
    sights.retain(|s| s.held.x.abs() < 0.04);
    sights
}

fn fitted(sights: Vec<SkyTrack>, wind: Wind) -> Option<SkylineFit> {
    fitted_where(sights, wind, DRIFT)
}

/// The same where what lies at the sky line may go by at `drift` rad/s.
fn fitted_where(mut sights: Vec<SkyTrack>, wind: Wind, drift: f64) -> Option<SkylineFit> {
    let turn = DQuat::IDENTITY;
    let expected = SkylinePrior { turn, tilt_sigma: 2e-3, pixel: PIXEL, wind, rate_sigma: drift };
    fit(&mut sights, &expected, 7, &mut Vec::new())
}

fn calm() -> Wind {
    Wind::calm(LAYER)
}

/// By how much a fit's heading is wrong, and the square of that over its variance.
fn wrong(fit: &SkylineFit, turn: DQuat) -> (f64, f64) {
    let off = rotation_vector(fit.turn * turn.inverse()).z;
    (off, off * off / fit.covariance.z_axis.z)
}

#[test]
fn wind_is_told_from_a_turn() {
    let turn = DQuat::from_rotation_z(1e-3);
    for wind in [DVec2::ZERO, DVec2::X * 0.008, DVec2::Y * -0.008, DVec2::new(0.006, -0.01)] {
        let squares = (0..40).map(|seed| {
            // The wind was learnt from the pictures before, to some extent.
            let before = Wind { information: DMat2::IDENTITY * 1e6, pull: wind * 1e6 };
            let fit = fitted(sights(50, (3.0, 18.0), turn, seed, &blown(wind)), calm().and(&before)).unwrap();
            let (off, square) = wrong(&fit, turn);
            let far = fit.wind.mean().distance(wind);
            assert!(off.abs() < 1e-3 && far < 6e-4, "{off} {far} {fit:?}");
            // What is left is by how much the clouds may be nearer than they are taken for.
            assert!(fit.rate_sigma < 0.4 * DRIFT + 0.012 * wind.length(), "{fit:?}");
            square
        });
        let mean = squares.sum::<f64>() / 40.0;
        assert!(mean < 1.3, "squares over variances {mean} in {wind}");
    }
}

#[test]
fn what_is_equally_high_does_not_tell_them_apart() {
    let level = sights(600, (9.0, 9.3), DQuat::IDENTITY, 3, &blown(DVec2::ZERO));
    let fit = fitted(ahead(level), calm()).unwrap();
    let spread = sights(600, (3.0, 18.0), DQuat::IDENTITY, 3, &blown(DVec2::ZERO));
    let told = fitted(ahead(spread), calm()).unwrap();
    let (off, square) = wrong(&fit, DQuat::IDENTITY);
    assert!(fit.rate_sigma > 8.0 * told.rate_sigma && square < 9.0, "{off}: {fit:?} {told:?}");
    // Nor do a few points.
    let few = fitted(sights(8, (5.0, 9.0), DQuat::IDENTITY, 3, &blown(DVec2::ZERO)), calm()).unwrap();
    let many = fitted(sights(60, (5.0, 9.0), DQuat::IDENTITY, 3, &blown(DVec2::ZERO)), calm()).unwrap();
    assert!(few.rate_sigma > 1.5 * many.rate_sigma, "{few:?} {many:?}");
}

#[test]
fn coast_holds_below_clouds_that_drift() {
    let wind = DVec2::new(0.009, 0.003);
    let before = calm().and(&Wind { information: DMat2::IDENTITY * 1e6, pull: wind * 1e6 });
    let clouds = sights(30, (4.0, 18.0), DQuat::IDENTITY, 5, &blown(wind));
    let mut all = sights(15, (0.3, 1.2), DQuat::IDENTITY, 6, &|d, _| d);
    all.extend(&clouds);
    let clouds = fitted(clouds, before).unwrap();
    for drift in [DRIFT, 0.1 * DRIFT] {
        let fit = fitted_where(all.clone(), before, drift).unwrap();
        let (off, square) = wrong(&fit, DQuat::IDENTITY);
        assert!(off.abs() < 6e-4 && square < 9.0 && fit.inliers > 40, "{off} {fit:?}");
        // Only coast that stands tells more than clouds.
        let ratio = fit.covariance.z_axis.z / clouds.covariance.z_axis.z;
        assert!(if drift < DRIFT { ratio < 0.3 } else { ratio < 1.3 }, "{ratio} {fit:?} {clouds:?}");
    }
}

#[test]
fn a_ship_that_passes_is_left_out() {
    let mut all = sights(30, (2.0, 18.0), DQuat::IDENTITY, 7, &blown(DVec2::ZERO));
    let passing = DQuat::from_rotation_z(-0.02);
    all.extend(sights(14, (0.3, 1.5), DQuat::IDENTITY, 8, &|d, _| passing * d));
    let fit = fitted(all, calm()).unwrap();
    let (off, _) = wrong(&fit, DQuat::IDENTITY);
    assert!(off.abs() < 4e-4 && fit.inliers <= 32, "{off} {fit:?}");
}

#[test]
fn what_was_learnt_of_the_wind_fades() {
    let told = Wind { information: DMat2::IDENTITY * 1e6, pull: DVec2::X * 1e4 };
    let mut wind = Wind::UNKNOWN;
    (0..600).for_each(|_| wind.learn(&told, 0.1));
    assert!(wind.mean().distance(DVec2::X * 0.01) < 1e-9, "{wind:?}");
    // No more than ten times what a picture says, however many there were.
    let sigma = wind.sigma();
    assert!(sigma < 0.6e-3 && sigma > 0.3e-3, "{sigma}");
    (0..1200).for_each(|_| wind.learn(&Wind::UNKNOWN, 0.1));
    assert!(wind.sigma() > 1.5 * sigma && wind.mean().distance(DVec2::X * 0.01) < 1e-9);
    let turned = wind.turned(DQuat::from_rotation_z(0.3));
    assert!((turned.mean() - DVec2::from_angle(0.3) * 0.01).length() < 1e-9, "{turned:?}");
}
