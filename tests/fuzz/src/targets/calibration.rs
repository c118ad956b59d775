//! The calibration file: any text.

use bowwave_calibration::{CalibrationFile, parse, to_toml};
use bowwave_core::calibration::Calibration;

const ORIGIN: &str = "calibration.toml";

/// A calibration is refused with its place or has only numbers that can be used; written again it is the same.
pub fn run(input: &[u8]) {
    // What is no text never reaches the parser: reading the file refuses it.
    let Ok(text) = std::str::from_utf8(input) else { return };
    match super::memory::within(memory_bytes(text.len()), || parse(text, ORIGIN)) {
        Err(error) => super::place::check(&error.to_string(), ORIGIN, text),
        Ok(file) => {
            check_numbers(&file.calibration);
            check_written(&file);
        }
    }
}

/// The document as a tree of values with their places.
const fn memory_bytes(text_bytes: usize) -> usize {
    (256 << 10) + 512 * text_bytes
}

fn check_numbers(calibration: &Calibration) {
    let lens = &calibration.lens;
    assert!((1..=8192).contains(&lens.width) && (1..=8192).contains(&lens.height), "{lens:?}");
    assert!(lens.focal.is_finite() && lens.focal.min_element() > 0.0, "{lens:?}");
    assert!(lens.centre.is_finite() && lens.distortion.is_finite(), "{lens:?}");
    let ray = lens.unproject(lens.centre);
    assert!(ray.is_finite(), "the centre has no direction: {lens:?}");
    assert!((calibration.camera_from_imu.length() - 1.0).abs() < 1e-12, "{:?}", calibration.camera_from_imu);
    assert!((calibration.bore_in_camera().length() - 1.0).abs() < 1e-12, "{:?}", calibration.boresight);
    assert!(calibration.muzzle_in_camera.is_finite() && calibration.gyro_bias.is_finite());
    assert!(calibration.time_offset_ns.abs() <= 10_000_000_000 && calibration.time_offset_sigma_ns > 0);
    let sigmas = [calibration.focal_sigma_px, calibration.boresight_sigma]
        .into_iter()
        .chain(calibration.camera_from_imu_sigma.to_array())
        .chain(calibration.gyro_bias_sigma.to_array());
    for sigma in sigmas {
        assert!(sigma.is_finite() && sigma > 0.0, "nothing is known exactly: {calibration:?}");
    }
}

fn check_written(file: &CalibrationFile) {
    let written = to_toml(file);
    match parse(&written, ORIGIN) {
        Ok(again) => assert_eq!(again, *file, "written as\n{written}"),
        Err(error) => panic!("what was written is refused: {error}\n{written}"),
    }
}
