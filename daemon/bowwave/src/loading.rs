//! Scenarios and models from names and files.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use bowwave_core::{
    model::{Model, ModelId},
    text::toml::TEXT_BYTES_MAX,
    world::scenario::{self, Scenario},
};
use bowwave_files::plain_text;
use bowwave_models::{BoatModels, ModelError};

/// Text of the scenario that `path` names, a file or a built-in one, and the folder that its models' paths start from.
pub fn read_scenario(path: &Path) -> Result<(String, PathBuf)> {
    let built_in = || scenario::BUILT_IN.iter().find(|(name, _)| path.as_os_str() == *name);
    match plain_text(path, TEXT_BYTES_MAX) {
        Ok(text) => Ok((text, path.parent().unwrap_or(Path::new("")).to_path_buf())),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound && built_in().is_some() => {
            Ok((built_in().map_or_else(String::new, |(_, text)| (*text).to_owned()), PathBuf::new()))
        }
        Err(e) => {
            let names: Vec<&str> = scenario::BUILT_IN.iter().map(|(name, _)| *name).collect();
            Err(e).with_context(|| {
                format!(
                    "cannot read the scenario {}; name a file, or one of {}",
                    path.display(),
                    names.join(", ")
                )
            })
        }
    }
}

/// Logs the former names that a text uses.
pub fn warn_of_former_names(warnings: &[String]) {
    for warning in warnings {
        log::warn!("{warning}");
    }
}

/// A scenario with all that its boats need.
#[derive(Debug)]
pub struct LoadedScenario {
    /// The scenario.
    pub scenario: Scenario,
    /// The models of its boats, each once.
    pub models: Vec<Model>,
    /// The model of each boat.
    pub of_boats: Vec<ModelId>,
}

/// A scenario from a file or a built-in one, checked with its models.
pub fn load_scenario(path: &Path) -> Result<LoadedScenario> {
    let (text, base) = read_scenario(path)?;
    parse_scenario(&text, &path.display().to_string(), &base)
}

/// A scenario's text, checked with its models, whose paths start from `base`.
pub fn parse_scenario(text: &str, origin: &str, base: &Path) -> Result<LoadedScenario> {
    let scenario = Scenario::parse(text, origin)?;
    warn_of_former_names(&scenario.warnings);
    let (models, of_boats) = scenario_models(&scenario, base)?;
    Ok(LoadedScenario { scenario, models, of_boats })
}

/// A model's error where the text places the boat that has it.
fn placed(error: ModelError, scenario: &Scenario) -> anyhow::Error {
    if let ModelError::OfBoat { boat, source } = &error
        && let Some(spec) = scenario.boats.iter().find(|spec| spec.name == *boat)
    {
        let causes: Vec<String> = anyhow::Chain::new(source.as_ref()).map(ToString::to_string).collect();
        return spec.error(format!("{error}: {}", causes.join(": "))).into();
    }
    error.into()
}

/// The models of a scenario's boats, all of which keep clear of the camera.
pub fn scenario_models(scenario: &Scenario, base: &Path) -> Result<(Vec<Model>, Vec<ModelId>)> {
    let boats = scenario.boats.iter().map(|b| (b.name.as_str(), b.model.as_str()));
    let models = BoatModels::load(boats, base).map_err(|error| placed(error, scenario))?;
    let radius = |id: &ModelId| models.list.get(usize::from(id.0)).map_or(0.0, Model::radius_m);
    scenario.check_clearance(&models.of_boats.iter().map(radius).collect::<Vec<_>>())?;
    Ok((models.list, models.of_boats))
}
