//! Scenarios and models from names and files.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use bowwave_core::{
    model::{Model, ModelId},
    text::toml::TEXT_BYTES_MAX,
    world::scenario::{self, Scenario},
};
use bowwave_files::plain_text;
use bowwave_models::BoatModels;

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

/// The models of a scenario's boats.
pub fn scenario_models(scenario: &Scenario, base: &Path) -> Result<(Vec<Model>, Vec<ModelId>)> {
    let boats = scenario.boats.iter().map(|b| (b.name.as_str(), b.model.as_str()));
    let models = BoatModels::load(boats, base)?;
    Ok((models.list, models.of_boats))
}
