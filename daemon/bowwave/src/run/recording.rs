//! The recording of a run on devices.

use std::{collections::BTreeMap, path::Path, time::SystemTime};

use bowwave_core::time::Time;
use bowwave_devices::clock::now;
use bowwave_record::{CameraInfo, Properties};
use bowwave_trainer::{replay::session_properties, storage::RecorderOptions};

use super::settings::Settings;

/// Files of one second that are told apart.
const NAMES: u32 = 1000;

/// A recording in `folder` whose name begins with `name`; no file of that name is there yet.
pub fn recording_in(folder: &Path, name: &str, settings: &Settings) -> RecorderOptions {
    let lens = &settings.setup.calibration.lens;
    let exact_pixels = settings.config.files.record_exact;
    let mut extra: BTreeMap<String, String> =
        [("eye_height_m".to_owned(), settings.setup.scenario.eye_height_m.to_string())].into();
    extra.extend(session_properties(&settings.setup, &settings.models_base));
    let properties = Properties {
        calibration_toml: settings.calibration_toml.clone(),
        scenario_toml: Some(settings.scenario_toml.clone()),
        loop_ns: None,
        start: Time::from_ns(now().ns().max(0)),
        source: "live".to_owned(),
        picture: (lens.width, lens.height),
        camera_info: Some(CameraInfo::from_lens(lens)),
        extra,
    };
    // A name of its own for each run: nothing that was recorded is overwritten.
    let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs();
    let path = |n: u32| folder.join(format!("{name}-{wall}-{n}.mcap"));
    let free = (0..NAMES).map(path).find(|p| !p.exists());
    RecorderOptions { path: free.unwrap_or_else(|| path(NAMES)), properties, lossless: false, exact_pixels }
}
