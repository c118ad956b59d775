//! The models of a scene's boats.

use std::path::Path;

use bowwave_core::model::{Model, ModelId};

use crate::{ModelError, resolve};

/// Models, each once, with the assignment of boats to them.
#[derive(Clone, Debug, Default)]
pub struct BoatModels {
    /// The models, in the order in which [`ModelId`] counts them.
    pub list: Vec<Model>,
    /// The model of each boat.
    pub of_boats: Vec<ModelId>,
}

impl BoatModels {
    /// Loads the models of `boats`, pairs of a boat's name and its model's name. Paths are relative to `base`.
    ///
    /// # Errors
    /// Names the boat whose model cannot be used.
    pub fn load<'a>(
        boats: impl IntoIterator<Item = (&'a str, &'a str)>,
        base: &Path,
    ) -> Result<Self, ModelError> {
        let mut names: Vec<&str> = Vec::new();
        let mut models = Self::default();
        for (boat, model) in boats {
            let index = match names.iter().position(|n| *n == model) {
                Some(index) => index,
                None => {
                    let loaded = resolve(model, base).map_err(|source| ModelError::OfBoat {
                        boat: boat.to_owned(),
                        source: Box::new(source),
                    })?;
                    names.push(model);
                    models.list.push(loaded);
                    models.list.len() - 1
                }
            };
            let id = u16::try_from(index).map_err(|_| ModelError::TooMany { limit: u16::MAX })?;
            models.of_boats.push(ModelId(id));
        }
        Ok(models)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_of_two_boats_is_loaded_once() {
        let boats = [("a", "skiff"), ("b", "rhib"), ("c", "skiff")];
        let models = BoatModels::load(boats, Path::new("")).unwrap();
        assert_eq!(models.list.len(), 2);
        assert_eq!(models.of_boats, [ModelId(0), ModelId(1), ModelId(0)]);
    }

    #[test]
    fn an_error_names_the_boat() {
        let error = BoatModels::load([("lookout", "raft")], Path::new("")).unwrap_err();
        assert_eq!(error.to_string(), "cannot load the model of lookout");
        let cause = std::error::Error::source(&error).map(ToString::to_string);
        assert!(cause.is_some_and(|text| text.contains("there is no model \"raft\"")));
    }
}
