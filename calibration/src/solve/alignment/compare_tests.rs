use bowwave_core::{calibration::Calibration, geometry::Lens, time::secs_to_ns};
use glam::DVec3;

use super::{
    tests::{TENTH, by_hand},
    *,
};
use crate::{
    simulated::{Motion, Recipe, Recording},
    solve::so3::exp,
};

/// Calibration of a recipe, off by a turn and by seconds.
pub(super) fn known(recipe: &Recipe, turn: DVec3, late_s: f64) -> Calibration {
    Calibration {
        camera_from_imu: exp(turn) * recipe.camera_from_imu,
        camera_from_imu_sigma: DVec3::splat(0.5e-3),
        time_offset_ns: secs_to_ns(recipe.offset_s + late_s),
        time_offset_sigma_ns: 100_000,
        gyro_bias: recipe.gyro_bias,
        gyro_bias_sigma: DVec3::splat(1e-4),
        ..Calibration::nominal(Lens::pinhole(1280, 720, 1.0))
    }
}

/// Holds a calibration against orientations or ups.
pub(super) fn held(recording: &Recording, seen: &[Observation], known: &Calibration) -> Comparison {
    let compared = Compared { readings: &recording.readings, observations: seen, sight: &[], lens: None };
    compare(&compared, known, &Options::default()).unwrap()
}

pub(super) fn of(told: &Comparison, parameter: Parameter) -> &Deviation {
    told.deviations.iter().find(|d| d.parameter == parameter).unwrap()
}

fn wrong(told: &Comparison) -> Vec<Parameter> {
    let all = told.deviations.iter().filter(|d| d.judgement == Judgement::Wrong);
    all.map(|d| d.parameter).collect()
}

#[test]
fn what_has_changed_is_named_with_its_size() {
    for seed in 0..3 {
        let recipe = by_hand(30 + seed);
        let recording = recipe.record();
        for all in [&recording.orientations, &recording.ups] {
            let same = held(&recording, all, &known(&recipe, DVec3::ZERO, 0.0));
            assert_eq!(wrong(&same), [], "{:?}", same.deviations);
            assert_eq!(same.residuals.len(), all.len() - same.left_out.without_gyro);
            for (parameter, turn, late_s, off, most) in [
                (Parameter::Elevation, DVec3::X * 8e-3, 0.0, -8e-3, 3e-3),
                (Parameter::Roll, DVec3::Z * -8e-3, 0.0, 8e-3, 3e-3),
                (Parameter::Offset, DVec3::ZERO, 3e-3, -3e-3, 1e-3),
            ] {
                let told = held(&recording, all, &known(&recipe, turn, late_s));
                assert_eq!(wrong(&told), [parameter], "{:?}", told.deviations);
                let found = of(&told, parameter);
                assert!((found.off - off).abs() < most, "{found:?}");
            }
        }
        // A unit that sits another way altogether.
        let told =
            held(&recording, &recording.orientations, &known(&recipe, DVec3::new(0.0, 0.3, -0.2), 0.0));
        assert!(wrong(&told).starts_with(&[Parameter::Traverse]), "{:?}", told.deviations);
    }
}

/// A bias that is wrong by a twentieth of a degree a second was taken for right (5.9 px with the orientation that is fused by it).
#[test]
fn a_wrong_gyro_bias_and_a_wrong_scale_are_told() {
    let recipe = by_hand(50);
    let mut recording = recipe.record();
    for axis in 0..3 {
        let mut off = known(&recipe, DVec3::ZERO, 0.0);
        off.gyro_bias[axis] += 0.05f64.to_radians();
        let told = held(&recording, &recording.orientations, &off);
        assert_eq!(wrong(&told), [Parameter::Bias(axis)], "{:?}", told.deviations);
    }
    recording.readings.iter_mut().for_each(|r| r.rate.z *= 1.01);
    let told = held(&recording, &recording.orientations, &known(&recipe, DVec3::ZERO, 0.0));
    assert_eq!(wrong(&told), [Parameter::Scale(2)], "{:?}", told.deviations);
    assert!((of(&told, Parameter::Scale(2)).off + 0.0099).abs() < 2e-3);
}

/// Stated deviations hold in recordings that tell little, roll included.
#[test]
fn deviations_hold_where_only_traverse_moves() {
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 0..24 {
        let recipe = Recipe { seconds: 40.0, ..Recipe::minute(Motion::TraverseOnly, TENTH, 1e-3, 60 + seed) };
        let recording = recipe.record();
        let told = held(&recording, &recording.orientations, &known(&recipe, DVec3::ZERO, 0.0));
        assert_eq!(wrong(&told), [], "{seed}: {:?}", told.deviations);
        let roll = of(&told, Parameter::Roll);
        squares += (roll.off / roll.sigma).powi(2);
        count += 1.0;
    }
    let mean = squares / count;
    // The mean of 24 squares has a deviation of 0.29.
    assert!((0.3..1.9).contains(&mean), "{mean}");
}

#[test]
fn what_a_recording_does_not_tell_is_said_to_be_unknown() {
    for (motion, blind, missing) in [
        (Motion::TraverseOnly, Parameter::Traverse, Movement::Elevation),
        (Motion::ElevationOnly, Parameter::Elevation, Movement::Traverse),
    ] {
        let recipe = Recipe::minute(motion, TENTH, 2e-3, 3);
        let recording = recipe.record();
        let all = &recording.orientations;
        let axis = if blind == Parameter::Traverse { DVec3::Y } else { DVec3::X };
        // Off about the blind axis: nobody can tell.
        let told = held(&recording, all, &known(&recipe, axis * 5e-3, 0.0));
        assert_eq!(of(&told, blind).judgement, Judgement::NotTold, "{motion:?}: {:?}", told.deviations);
        assert_eq!((wrong(&told), told.missing), (vec![], missing));
        // Off about another: told all the same.
        let told = held(&recording, all, &known(&recipe, DVec3::Z * 0.02, 0.0));
        assert_eq!(wrong(&told), [Parameter::Roll], "{motion:?}: {:?}", told.deviations);
    }
    let recipe = Recipe::minute(Motion::Rest, TENTH, 2e-3, 3);
    let recording = recipe.record();
    let told = held(&recording, &recording.orientations, &known(&recipe, DVec3::splat(0.01), 0.0));
    for parameter in [Parameter::Elevation, Parameter::Traverse, Parameter::Roll, Parameter::Offset] {
        assert_eq!(of(&told, parameter).judgement, Judgement::NotTold, "{:?}", told.deviations);
    }
}
