//! The trainer with an instructor's process joined.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use anyhow::Result;
use bowwave_core::world::scenario::Scenario;
use bowwave_trainer::instructor::{AskedScenario, InstructorOptions, InstructorPort};

use crate::{
    config::Config,
    loading::{LoadedScenario, parse_scenario},
};

/// Folder of the models that the instructor's scenarios name: the configured one, else `scenarios` in the data folder.
pub fn scenarios(config: &Config, data: &Path) -> PathBuf {
    config.instructor.scenarios.clone().unwrap_or_else(|| data.join("scenarios"))
}

/// Listens on `socket`. Models that the instructor's scenarios name lie in `scenarios`. `prepare` makes what a scenario needs besides its models,
/// while the run before it goes on.
pub fn listen(
    socket: &Path,
    scenarios: PathBuf,
    prepare: impl Fn(&Scenario) -> Result<()> + Send + Sync + 'static,
) -> Result<InstructorPort> {
    let ready = move |asked: &AskedScenario| match load(asked, &scenarios)? {
        _ if asked.is_stand_by => Ok(()),
        loaded => prepare(&loaded.scenario),
    };
    let check = move |asked: &AskedScenario| ready(asked).map_err(|e| format!("{e:#}"));
    InstructorPort::listen(InstructorOptions { socket: socket.to_owned(), check: Some(Arc::new(check)) })
}

/// A scenario that the instructor asked for, with the models that its boats need: built-in ones, or files beside the instructor's scenarios. No
/// other file of the computer is opened for somebody at a browser.
pub fn load(asked: &AskedScenario, scenarios: &Path) -> Result<LoadedScenario> {
    let scenario = Scenario::parse(&asked.text, &asked.origin)?;
    if let Some(boat) = scenario.boats.iter().find(|boat| !is_plain(&boat.model)) {
        let problem = format!(
            "{:?} is a path: name a built-in model, or a file in {} on the trainer's computer by its name alone",
            boat.model,
            scenarios.display()
        );
        return Err(boat.error(problem).into());
    }
    parse_scenario(&asked.text, &asked.origin, scenarios)
}

/// Tests whether a model is named without a way to another folder.
fn is_plain(model: &str) -> bool {
    let mut parts = Path::new(model).components();
    matches!(parts.next(), Some(std::path::Component::Normal(_)))
        && parts.next().is_none()
        && !model.ends_with('/')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenarios_of_the_instructor_name_no_file_elsewhere() {
        let asked = |model: &str| AskedScenario {
            origin: "browser".to_owned(),
            text: format!(
                "name = \"x\"\n[[boat]]\nname = \"a\"\nmodel = {model:?}\ncourse = \"still\"\nrange_m = 300\nbearing_deg = 0\nheading_deg = 0\n"
            ),
            is_stand_by: false,
        };
        let folder = tempfile::tempdir().unwrap();
        let why = |model: &str| load(&asked(model), folder.path()).map(drop).map_err(|e| format!("{e:#}"));
        assert_eq!(why("skiff"), Ok(()));
        for model in ["/etc/passwd", "../secret.glb", "a/b.glb", "./x.glb", "..", "x/"] {
            let refused = why(model).unwrap_err();
            assert!(refused.contains("is a path") && refused.contains("browser"), "{model}: {refused}");
        }
        assert!(why("there-is-none.glb").unwrap_err().contains("there-is-none.glb"));
    }
}
