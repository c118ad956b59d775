use bowwave_core::geometry::Lens;
use glam::DVec3;

use super::*;
use crate::{
    CalibrationFile, Date,
    alignment::{Compared, Options, compare, solve},
    parse,
    simulated::{Motion, Recipe},
    solve::so3::exp,
};

const NOISE: f64 = 2e-3;

fn capture() -> Capture {
    Capture::new(Lens::pinhole(1280, 720, 1.0), 10.0)
}

fn calibration(recipe: &Recipe, turn: DVec3, late_s: f64) -> CalibrationFile {
    let mut file = parse(include_str!("../../examples/mount.toml"), "mount.toml").unwrap();
    file.calibration.camera_from_imu = exp(turn) * recipe.camera_from_imu;
    file.calibration.time_offset_ns = bowwave_core::time::secs_to_ns(recipe.offset_s + late_s);
    file.calibration.gyro_bias = recipe.gyro_bias;
    file
}

fn checked(recipe: &Recipe, turn: DVec3, late_s: f64) -> CalibrationReport {
    let recording = recipe.record();
    let c = calibration(recipe, turn, late_s).calibration;
    let seen = Compared {
        readings: &recording.readings,
        observations: &recording.orientations,
        sight: &[],
        lens: None,
    };
    let told = compare(&seen, &c, &Options::default());
    CalibrationReport::of_check("a check", &capture(), &c, &told)
}

#[test]
fn a_new_alignment_passes_in_mrad_and_metres_or_says_what_is_missing() {
    let of = |motion| {
        let recording = Recipe::minute(motion, NOISE, 1e-3, 1).record();
        let found = solve(&recording.readings, &recording.orientations, &Options::default());
        (CalibrationReport::of_alignment("an alignment", &capture(), &found), found)
    };
    let (good, found) = of(Motion::ByHand);
    assert_eq!(good.verdict, CalibrationVerdict::Pass);
    let text = good.to_string();
    assert!(text.starts_with("PASS: good; boats lie within 0.") && text.contains("m at 500 m"), "{text}");
    let found = found.unwrap();
    assert_eq!(good.residuals.len(), found.residuals.len());
    // What is written into the file is what was found.
    let mut file = calibration(&Recipe::minute(Motion::ByHand, NOISE, 1e-3, 2), DVec3::X, 0.1);
    let (lens, day) = (file.lens.clone(), Date::new(2026, 11, 23).unwrap());
    file.set_alignment(&found, day, "by hand");
    assert_eq!((file.calibration.camera_from_imu, &file.lens), (found.camera_from_imu, &lens));
    assert_eq!((file.made, file.time_offset.measured), (day, day));
    assert_eq!(parse(&crate::to_toml(&file), "again").unwrap().gyro_bias.how, "by hand");
    let (poor, _) = of(Motion::SlowMount);
    assert_eq!(poor.verdict, CalibrationVerdict::Fail);
    assert!(poor.to_string().contains("more "), "{poor}");
    let (refused, _) = of(Motion::TraverseOnly);
    assert_eq!(refused.verdict, CalibrationVerdict::Fail);
    assert!(refused.to_string().contains("missing: elevation (up and down)"), "{refused}");
}

#[test]
fn a_check_says_good_stale_or_that_it_cannot_tell() {
    for (seed, motion, turn, late_s, verdict) in [
        (1, Motion::ByHand, DVec3::ZERO, 0.0, CalibrationVerdict::Good),
        (2, Motion::ByHand, DVec3::new(0.0, 8e-3, 0.0), 0.0, CalibrationVerdict::Stale),
        (3, Motion::ByHand, DVec3::ZERO, 4e-3, CalibrationVerdict::Stale),
        (4, Motion::TraverseOnly, DVec3::ZERO, 0.0, CalibrationVerdict::CannotTell),
        (5, Motion::TraverseOnly, DVec3::Z * 0.03, 0.0, CalibrationVerdict::Stale),
        (6, Motion::Rest, DVec3::Z * 0.03, 0.0, CalibrationVerdict::CannotTell),
    ] {
        let report = checked(&Recipe::minute(motion, NOISE, 1e-3, seed), turn, late_s);
        assert_eq!(report.verdict, verdict, "{motion:?} {turn} {late_s}\n{report}");
    }
    // What is stale is said by how much.
    let report = checked(&Recipe::minute(Motion::ByHand, NOISE, 1e-3, 7), DVec3::new(0.0, 8e-3, 0.0), 0.0);
    assert!(report.says.contains("mrad (4.") || report.says.contains("mrad (3."), "{report}");
}

#[test]
fn age_and_other_devices_are_warned_of() {
    let recipe = Recipe::minute(Motion::ByHand, NOISE, 1e-3, 1);
    let file = calibration(&recipe, DVec3::ZERO, 0.0);
    let mut report = checked(&recipe, DVec3::ZERO, 0.0);
    report.warn_of_age(&file, Date::new(2026, 11, 25).unwrap());
    report.warn_of_others(&file, &file);
    assert!(report.notes.is_empty(), "{report}");
    report.warn_of_age(&file, Date::new(2027, 6, 1).unwrap());
    assert!(report.notes.len() == 1 && report.notes[0].contains("long ago"), "{report}");
    assert_eq!(report.notes[0].matches(" on 2026-11-").count(), 4, "{report}");
    report.notes.clear();
    report.warn_of_age(&file, Date::new(2026, 11, 19).unwrap());
    assert!(report.notes.len() == 1 && report.notes[0].contains("yet to come"), "{report}");
    assert!(!report.notes[0].contains("the lens"), "{report}");
    report.notes.clear();
    let mut other = file.clone();
    other.camera_serial = "C-9999".to_owned();
    other.imu_serial.clear();
    report.warn_of_others(&file, &other);
    assert_eq!(report.notes.len(), 1);
    assert!(report.notes[0].contains("C-0117") && report.notes[0].contains("C-9999"), "{report}");
}
