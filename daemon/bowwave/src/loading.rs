//! Scenarios and models from names and files.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use bowwave_core::{
    model::{Model, ModelId},
    scenario::{self, Scenario},
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

/// Each model once, and which of them each boat has.
pub fn load_models(scenario: &Scenario, base: &Path) -> Result<(Vec<Model>, Vec<ModelId>)> {
    let mut names: Vec<&str> = Vec::new();
    let mut models = Vec::new();
    let mut of_boats = Vec::new();
    for boat in &scenario.boats {
        let place = match names.iter().position(|n| *n == boat.model) {
            Some(place) => place,
            None => {
                let model = bowwave_models::resolve(&boat.model, base)
                    .with_context(|| format!("cannot load the model of {}", boat.name))?;
                names.push(&boat.model);
                models.push(model);
                models.len() - 1
            }
        };
        of_boats.push(ModelId(u16::try_from(place).context("more than 65536 models")?));
    }
    Ok((models, of_boats))
}
