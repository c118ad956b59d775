//! The horizon finder on drawn pictures that set none of its constants, and on real frames where they are there.

#![allow(clippy::unwrap_used, reason = "a step that fails fails the test")]

use bowwave_core::estimate::horizon::{HorizonFinder, Prior};
use glam::DVec3;
use precision::{
    front::quantile,
    horizon::{
        cases::{SET_WITH, with_horizon, without_horizon},
        frames,
        score::{DrawnHorizon, find, miss, predicted},
        stills::{self, HorizonKind},
    },
};

#[test]
fn drawn_horizons_are_found_and_their_covariance_is_right() {
    let mut finder = HorizonFinder::new();
    let (mut px, mut squares, mut count) = (Vec::new(), Vec::new(), 0.0);
    for i in 0..40 {
        let drawn = DrawnHorizon::new(with_horizon(SET_WITH + 5000, i)).unwrap();
        let up = DVec3::from(drawn.shown.up());
        for prior in [None, Some(predicted(up, i))] {
            count += 1.0;
            if let Ok(found) = drawn.find(&mut finder, prior) {
                px.push(drawn.miss(found.up).px);
                squares.push(drawn.normalised(&found));
            }
        }
    }
    assert!(px.len() as f64 >= 0.95 * count, "{} of {count}", px.len());
    let (median, p95, worst) = (quantile(&px, 0.5), quantile(&px, 0.95), quantile(&px, 1.0));
    assert!(median < 0.5 && p95 < 2.0 && worst < 10.0, "{median} {p95} {worst}");
    // Two degrees of freedom: 2 in the mean. More would be overconfident, far less would waste the measurement.
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!((0.4..3.0).contains(&mean), "{mean}");
}

/// A span of half a degree is less than three bins of the line search there: no prediction was ever answered.
#[test]
fn a_coarse_camera_sees_predicted_horizons() {
    let mut finder = HorizonFinder::new();
    for by in [4, 8] {
        let (mut px, mut squares) = (Vec::new(), Vec::new());
        for i in 0..16 {
            let drawn = DrawnHorizon::coarse(with_horizon(SET_WITH + 6000, i), by).unwrap();
            let prior = predicted(DVec3::from(drawn.shown.up()), i);
            // A unit in use foretells the vertical better than this study's.
            let sure = Prior { up: DVec3::from(drawn.shown.up()), sigma: 0.1_f64.to_radians() };
            for prior in [prior, sure] {
                if let Ok(found) = drawn.find(&mut finder, Some(prior)) {
                    px.push(drawn.miss(found.up).px);
                    squares.push(drawn.normalised(&found));
                }
            }
        }
        assert!(px.len() >= 20, "{} of 32 by {by}", px.len());
        assert!(quantile(&px, 1.0) < 2.0 * by as f64, "{} by {by}", quantile(&px, 1.0));
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        assert!((0.2..4.0).contains(&mean), "{mean} by {by}");
    }
}

#[test]
fn nothing_drawn_without_a_horizon_is_taken_for_one() {
    let mut finder = HorizonFinder::new();
    let mut taken = Vec::new();
    for i in 0..42 {
        let drawn = DrawnHorizon::new(without_horizon(SET_WITH + 5000, i)).unwrap();
        let up = DVec3::from(drawn.shown.up());
        for prior in [None, Some(predicted(up, i))] {
            if let Ok(found) = drawn.find(&mut finder, prior) {
                taken.push((drawn.shown.kind, found.quality));
            }
        }
    }
    assert!(taken.len() <= 1, "{taken:?}");
}

#[test]
fn marked_frames_are_found_and_shores_are_not() {
    let mut finder = HorizonFinder::new();
    let (mut found, mut count) = (0, 0);
    for (i, frame) in frames::marked().unwrap().iter().enumerate() {
        let up = frame.marked_up().unwrap();
        for prior in [None, Some(predicted(up, i as u64))] {
            count += 1;
            let Ok(horizon) = find(&mut finder, frame, prior).unwrap() else { continue };
            found += 1;
            let off = miss(frame, horizon.up).unwrap();
            assert!(off.px < 2.0 && off.deg < 0.2, "{}: {off:?}", frame.name);
        }
    }
    assert!(10 * found >= 9 * count, "{found} of {count}");
    for frame in frames::without_horizon().unwrap() {
        let found = find(&mut finder, &frame, None).unwrap();
        assert!(found.is_err(), "{}: {found:?}", frame.name);
    }
}

#[test]
fn strangers_horizons_are_found_and_their_shores_are_not() {
    let stills = stills::listed().unwrap();
    let mut finder = HorizonFinder::new();
    // Of those that are free, free over part of the width, and shores: how many, and how many are found.
    let (mut all, mut found, mut px) = ([0; 3], [0; 3], Vec::new());
    for still in &stills {
        let kind = still.kind as usize;
        all[kind] += 1;
        let Ok(horizon) = find(&mut finder, &still.frame, None).unwrap() else { continue };
        found[kind] += 1;
        let Some(off) = miss(&still.frame, horizon.up) else { continue };
        assert!(off.px < 5.0 + still.uncertainty_px, "{}: {off:?}", still.frame.name);
        px.push(off.px);
    }
    let [free, partial, shores] =
        [HorizonKind::Free, HorizonKind::Partial, HorizonKind::Shore].map(|k| k as usize);
    assert!(100 * found[free] >= 85 * all[free], "{} of {} free", found[free], all[free]);
    assert!(5 * found[partial] >= 2 * all[partial], "{} of {} in part", found[partial], all[partial]);
    assert!(100 * found[shores] <= 4 * all[shores], "{} of {} shores", found[shores], all[shores]);
    assert!(px.is_empty() || quantile(&px, 0.5) < 0.5, "{}", quantile(&px, 0.5));
}
