//! Scenarios and models from names and files.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use bowwave_core::{
    model::{Model, ModelId},
    world::scenario::{self, Scenario},
};

/// Text of the scenario that `path` names, a file or a built-in one, and the folder that its models' paths start from.
pub fn read_scenario(path: &Path) -> Result<(String, PathBuf)> {
    let built_in = || scenario::BUILT_IN.iter().find(|(name, _)| path.as_os_str() == *name);
    match std::fs::read_to_string(path) {
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

/// Models, each once, and which of them each boat has.
#[derive(Clone, Debug, Default)]
pub struct Models {
    /// The models, in the order in which [`ModelId`] counts them.
    pub list: Vec<Model>,
    /// The model of each boat.
    pub of_boats: Vec<ModelId>,
}

/// Loads the models of `boats`, pairs of a boat's name and its model's. Paths count from `base`.
pub fn load_models<'a>(boats: impl IntoIterator<Item = (&'a str, &'a str)>, base: &Path) -> Result<Models> {
    let mut names: Vec<&str> = Vec::new();
    let mut models = Models::default();
    for (boat, model) in boats {
        let place = match names.iter().position(|n| *n == model) {
            Some(place) => place,
            None => {
                let loaded = bowwave_models::resolve(model, base)
                    .with_context(|| format!("cannot load the model of {boat}"))?;
                names.push(model);
                models.list.push(loaded);
                models.list.len() - 1
            }
        };
        models.of_boats.push(ModelId(u16::try_from(place).context("more than 65536 models")?));
    }
    Ok(models)
}

/// The models of a scenario's boats.
pub fn scenario_models(scenario: &Scenario, base: &Path) -> Result<(Vec<Model>, Vec<ModelId>)> {
    let boats = scenario.boats.iter().map(|b| (b.name.as_str(), b.model.as_str()));
    load_models(boats, base).map(|models| (models.list, models.of_boats))
}
