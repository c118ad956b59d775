//! Details of a run for its debrief: what rounds, events and tracks do not say.

use std::path::Path;

use bowwave_core::session::Setup;
use serde::{Deserialize, Serialize};

/// Details of a run. Fields may be added; readers of this version ignore those that they do not know.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RunDetails {
    /// The scenario's text for the trainee.
    pub briefing: Option<String>,
    /// The scenario's boats in the order of the tracks.
    pub boats: Vec<BoatDetails>,
    /// Folder that models which are files are named from.
    pub models_base: String,
    /// The weapon's kind, as scenarios call it.
    pub weapon: Option<String>,
    /// Range that hostile boats are to be kept beyond, metres.
    pub keep_off_m: f64,
    /// Range within which a hostile boat may be fired at under any rules, metres; 0 for none.
    pub self_defence_m: f64,
    /// Height of the camera over the water, metres.
    pub eye_height_m: f64,
    /// Direction that the wind blows to, world (x east, y north), m/s.
    pub wind_m_s: [f64; 2],
    /// The camera.
    pub camera: CameraDetails,
    /// Latitude and longitude of the place that the scenario names, degrees.
    pub place_deg: Option<[f64; 2]>,
}

/// A boat of the scenario.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct BoatDetails {
    /// Its name.
    pub name: String,
    /// Whom it belongs to: `hostile` or `neutral`.
    pub side: String,
    /// Its model as the scenario names it: a built-in one, or a file.
    pub model: String,
    /// Box around the model, metres: x forward, y to port, z up.
    pub low_m: [f32; 3],
    /// The box's other corner.
    pub high_m: [f32; 3],
}

/// The camera, as far as a debrief shows it: lens distortion is left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CameraDetails {
    /// Size of its picture, pixels.
    pub size: [u32; 2],
    /// Focal length, pixels.
    pub focal: [f64; 2],
    /// Principal point, pixels.
    pub centre: [f64; 2],
    /// Direction of the barrel in the camera's space (x right, y down, z forward).
    pub bore: [f64; 3],
}

impl RunDetails {
    /// The details of a session whose boats' models lie in `models`, where they are files.
    pub fn of(setup: &Setup, models: &Path) -> Self {
        let Setup { scenario, calibration, .. } = setup;
        let boats = scenario.boats.iter().zip(&setup.boat_models).map(|(boat, model)| {
            let model = setup.models.get(usize::from(model.0));
            BoatDetails {
                name: boat.name.clone(),
                side: boat.side.name().to_owned(),
                model: boat.model.clone(),
                low_m: model.map_or([0.0; 3], |model| model.min.to_array()),
                high_m: model.map_or([0.0; 3], |model| model.max.to_array()),
            }
        });
        let lens = &calibration.lens;
        Self {
            briefing: scenario.exercise.briefing.clone(),
            boats: boats.collect(),
            models_base: models.canonicalize().unwrap_or_else(|_| models.to_owned()).display().to_string(),
            weapon: scenario.weapon.kind.clone(),
            keep_off_m: finite(scenario.exercise.goals.keep_off_m),
            self_defence_m: finite(scenario.exercise.self_defence_m),
            eye_height_m: finite(scenario.eye_height_m),
            wind_m_s: scenario.wind.truncate().to_array().map(finite),
            camera: CameraDetails {
                size: [lens.width, lens.height],
                focal: lens.focal.to_array(),
                centre: lens.centre.to_array(),
                bore: calibration.bore_in_camera().to_array(),
            },
            place_deg: scenario
                .daylight
                .moment
                .map(|moment| [moment.place.latitude_deg(), moment.place.longitude_deg()]),
        }
    }

    /// The details as a journal keeps them.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }

    /// The details that a journal keeps; `None` where they cannot be read.
    pub fn from_json(text: &str) -> Option<Self> {
        serde_json::from_str(text).ok()
    }
}

/// JSON has no numbers that are not finite.
fn finite(number: f64) -> f64 {
    if number.is_finite() { number } else { 0.0 }
}
