use bowwave_core::{calibration::Calibration, geometry::Lens};
use glam::DVec3;

use super::*;
use crate::{
    CalibrationFile, Date, SIMULATED,
    alignment::{Compared, Comparison, Judgement, Options, compare, solve},
    capture::PictureSeen,
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
    // The example's is of its own unit.
    file.calibration.gyro_bias_sigma = DVec3::splat(1e-4);
    file
}

fn compared(recipe: &Recipe, c: &Calibration) -> Comparison {
    let recording = recipe.record();
    let seen = Compared {
        readings: &recording.readings,
        observations: &recording.orientations,
        sight: &[],
        lens: None,
    };
    compare(&seen, c, &Options::default()).unwrap()
}

fn checked(recipe: &Recipe, turn: DVec3, late_s: f64) -> CalibrationReport {
    let c = calibration(recipe, turn, late_s).calibration;
    CalibrationReport::of_check("a check", &capture(), &c, &Ok(compared(recipe, &c)))
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
    for (seed, motion, turn, late_s, verdict, name) in [
        (
            1,
            Motion::ByHand,
            DVec3::ZERO,
            0.0,
            CalibrationVerdict::CannotTell,
            "not told by this recording: read-out of the picture, focal length",
        ),
        (2, Motion::ByHand, DVec3::new(0.0, 8e-3, 0.0), 0.0, CalibrationVerdict::Stale, "traverse is not"),
        (3, Motion::ByHand, DVec3::ZERO, 4e-3, CalibrationVerdict::Stale, "time offset is not"),
        (4, Motion::TraverseOnly, DVec3::ZERO, 0.0, CalibrationVerdict::CannotTell, "traverse"),
        (5, Motion::TraverseOnly, DVec3::Z * 0.03, 0.0, CalibrationVerdict::Stale, "roll is not"),
        (6, Motion::Rest, DVec3::Z * 0.03, 0.0, CalibrationVerdict::CannotTell, "roll"),
    ] {
        let report = checked(&Recipe::minute(motion, NOISE, 1e-3, seed), turn, late_s);
        assert_eq!(report.verdict, verdict, "{motion:?} {turn} {late_s}\n{report}");
        assert!(report.says.contains(name), "{motion:?} {turn} {late_s}\n{report}");
    }
    // What is stale is said by its name, how much, what that does and what to do.
    let report = checked(&Recipe::minute(Motion::ByHand, NOISE, 1e-3, 7), DVec3::new(0.0, 8e-3, 0.0), 0.0);
    let line = &report.notes[0];
    for words in ["traverse is off by -", " mrad: ", " px, ", " m at 500 m; ", "calibrate extrinsics"] {
        assert!(line.contains(words), "'{words}' in {line}");
    }
    // Good only where everything is told.
    let recipe = Recipe::minute(Motion::ByHand, NOISE, 1e-3, 8);
    let c = calibration(&recipe, DVec3::ZERO, 0.0).calibration;
    let mut told = compared(&recipe, &c);
    let left = told.deviations.iter_mut().filter(|d| d.judgement == Judgement::NotTold);
    left.for_each(|d| (d.judgement, d.sigma) = (Judgement::Agrees, 1e-4));
    let report = CalibrationReport::of_check("a check", &capture(), &c, &Ok(told));
    assert_eq!(report.verdict, CalibrationVerdict::Good, "{report}");
}

/// A bias of half a degree a second more was GOOD, though the trainer then draws boats 107 px off.
#[test]
fn a_wrong_bias_is_stale_with_its_drift() {
    let recipe = Recipe::minute(Motion::ByHand, NOISE, 1e-3, 9);
    let mut c = calibration(&recipe, DVec3::ZERO, 0.0).calibration;
    c.gyro_bias.z += 0.05f64.to_radians();
    let report = CalibrationReport::of_check("a check", &capture(), &c, &Ok(compared(&recipe, &c)));
    assert_eq!(report.verdict, CalibrationVerdict::Stale, "{report}");
    assert!(report.says.starts_with("gyro bias about z is"), "{report}");
    assert!(report.notes[0].contains(" deg in a day"), "{report}");
}

#[test]
fn another_picture_size_is_said_to_be_one() {
    let mut capture = capture();
    let stamp = bowwave_core::time::Time::from_ns(5);
    capture.see(&PictureSeen { stamp, fits: false, horizon: None, is_blurred: false, board: None });
    let c = calibration(&Recipe::minute(Motion::Rest, NOISE, 0.0, 1), DVec3::ZERO, 0.0).calibration;
    let report = CalibrationReport::of_check("a check", &capture, &c, &capture.compare(&c));
    assert_eq!(report.verdict, CalibrationVerdict::Stale, "{report}");
    assert!(report.says.contains("picture's size is wrong"), "{report}");
}

#[test]
fn age_and_other_devices_are_warned_of() {
    let recipe = Recipe::minute(Motion::ByHand, NOISE, 1e-3, 1);
    let file = calibration(&recipe, DVec3::ZERO, 0.0);
    let mut report = checked(&recipe, DVec3::ZERO, 0.0);
    report.notes.clear();
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
    // What is simulated is exact, and stays so.
    report.warn_of_age(
        &CalibrationFile { source: SIMULATED.to_owned(), ..file.clone() },
        Date::new(2036, 1, 1).unwrap(),
    );
    assert!(report.notes.is_empty(), "{report}");
    let mut other = file.clone();
    other.camera_serial = "C-9999".to_owned();
    other.imu_serial.clear();
    report.warn_of_others(&file, &other);
    assert_eq!(report.notes.len(), 1);
    assert!(report.notes[0].contains("C-0117") && report.notes[0].contains("C-9999"), "{report}");
}
