//! Scenarios: built-in ones, and those of the instructor's folder.

use std::{
    fs, io,
    io::Write as _,
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
};

use bowwave_core::{
    text::toml::{TEXT_BYTES_MAX, TomlError},
    world::{
        exercise::Goals,
        scenario::{BUILT_IN, Scenario, read::mistakes},
    },
};
use serde::Serialize;

/// Most scenarios of a folder that are listed.
const LISTED_MAX: usize = 500;
/// Most bytes of the name of a model's file.
const MODEL_BYTES_MAX: usize = 200;

/// Source of a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Origin {
    /// The program itself.
    BuiltIn,
    /// The instructor's folder.
    Own,
}

/// A scenario of a list.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Listed {
    origin: Origin,
    name: String,
    title: String,
    briefing: Option<String>,
    boats: usize,
    duration_s: Option<f64>,
    /// Why it cannot be started, in words.
    error: Option<String>,
}

/// A text that was looked at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Checked {
    /// Empty for a sound text.
    mistakes: Vec<Mistake>,
    warnings: Vec<String>,
    title: String,
    briefing: Option<String>,
    duration_s: Option<f64>,
    rules: Option<&'static str>,
    keep_off_m: f64,
    boats: Vec<BoatStart>,
}

/// A mistake at its place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Mistake {
    line: usize,
    column: usize,
    key: String,
    problem: String,
}

/// A boat as the scenario begins.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct BoatStart {
    name: String,
    side: &'static str,
    model: String,
    east_m: f64,
    north_m: f64,
    heading_deg: f64,
    speed_m_s: f64,
}

impl From<TomlError> for Mistake {
    fn from(error: TomlError) -> Self {
        let TomlError { line, column, key, problem, .. } = error;
        Self { line, column, key, problem }
    }
}

/// Something that the library cannot do.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LibraryError {
    #[error("{0:?} is no name of a scenario: give 1 to 64 of the characters a-z, 0-9 and -")]
    Name(String),
    #[error("there is no scenario {0:?}: load the list again")]
    Unknown(String),
    #[error(
        "there are {LISTED_MAX} scenarios, as many as can be listed: save under the name of one of them, or have some removed"
    )]
    Full,
    #[error("no folder for scenarios is configured: give one with --library")]
    NoFolder,
    #[error("the scenario has {0} bytes; {TEXT_BYTES_MAX} are the most")]
    TooLong(usize),
    #[error("{0}")]
    Unsound(TomlError),
    #[error("boat {boat}: {model:?} is no model that may be named here: give a built-in one ({}) or the plain name of a file without folders", known.join(", "))]
    Model { boat: String, model: String, known: Vec<&'static str> },
    #[error("{}: {error}; check the folder of scenarios and who may read and write there", path.display())]
    Io { path: PathBuf, error: io::Error },
}

/// Built-in scenarios, and those of a folder.
#[derive(Clone, Debug)]
pub(crate) struct Library {
    folder: Option<PathBuf>,
}

impl Library {
    pub(crate) fn new(folder: Option<PathBuf>) -> Self {
        Self { folder }
    }

    pub(crate) fn can_save(&self) -> bool {
        self.folder.is_some()
    }

    /// All scenarios: the folder's in their order, then the built-in ones.
    pub(crate) fn list(&self) -> Result<Vec<Listed>, LibraryError> {
        let mut all = Vec::new();
        for name in self.own_names()? {
            all.push(match self.text(Origin::Own, &name) {
                Ok(text) => listed(Origin::Own, name, &text),
                Err(error) => unreadable(name, error.to_string()),
            });
        }
        all.extend(BUILT_IN.map(|(name, text)| listed(Origin::BuiltIn, name.to_owned(), text)));
        Ok(all)
    }

    fn own_names(&self) -> Result<Vec<String>, LibraryError> {
        let Some(folder) = &self.folder else { return Ok(Vec::new()) };
        let failed = |error| LibraryError::Io { path: folder.clone(), error };
        let entries = match fs::read_dir(folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(failed(error)),
        };
        let mut names = Vec::new();
        for entry in entries.take(10 * LISTED_MAX) {
            let name = entry.map_err(failed)?.file_name();
            let name = name.to_str().and_then(|name| name.strip_suffix(".toml")).filter(|name| is_name(name));
            names.extend(name.map(str::to_owned));
        }
        names.sort();
        names.truncate(LISTED_MAX);
        Ok(names)
    }

    /// The text of a scenario.
    pub(crate) fn text(&self, origin: Origin, name: &str) -> Result<String, LibraryError> {
        if !is_name(name) {
            return Err(LibraryError::Name(name.to_owned()));
        }
        if origin == Origin::BuiltIn {
            let found = BUILT_IN.into_iter().find(|(known, _)| *known == name);
            return found
                .map(|(_, text)| text.to_owned())
                .ok_or_else(|| LibraryError::Unknown(name.to_owned()));
        }
        let path = self.path(name)?;
        bowwave_files::plain_text(&path, TEXT_BYTES_MAX).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => LibraryError::Unknown(name.to_owned()),
            _ => LibraryError::Io { path, error },
        })
    }

    /// Puts a sound text into the folder, all of it at once.
    pub(crate) fn save(&self, name: &str, text: &str) -> Result<(), LibraryError> {
        if !is_name(name) {
            return Err(LibraryError::Name(name.to_owned()));
        }
        may_start(text, name)?;
        let path = self.path(name)?;
        if !path.exists() && self.own_names()?.len() >= LISTED_MAX {
            return Err(LibraryError::Full);
        }
        let folder = path.parent().unwrap_or(Path::new(".")).to_owned();
        let write = || -> io::Result<()> {
            fs::create_dir_all(&folder)?;
            let mut file = tempfile::NamedTempFile::new_in(&folder)?;
            file.write_all(text.as_bytes())?;
            file.as_file().set_permissions(fs::Permissions::from_mode(0o644))?;
            file.as_file().sync_all()?;
            file.persist(&path).map_err(|e| e.error)?;
            fs::File::open(&folder)?.sync_all()
        };
        write().map_err(|error| LibraryError::Io { path: path.clone(), error })
    }

    /// The file of a name that was checked.
    fn path(&self, name: &str) -> Result<PathBuf, LibraryError> {
        let folder = self.folder.as_ref().ok_or(LibraryError::NoFolder)?;
        Ok(folder.join(format!("{name}.toml")))
    }
}

/// Tests whether a scenario can have that name.
pub(crate) fn is_name(name: &str) -> bool {
    let is_plain = |c: u8| c.is_ascii_lowercase() || c.is_ascii_digit() || c == b'-';
    (1..=64).contains(&name.len()) && name.bytes().all(is_plain)
}

/// The scenario of a text that may be started from a browser: sound, and with models that name no folder.
pub(crate) fn may_start(text: &str, origin: &str) -> Result<Scenario, LibraryError> {
    if text.len() > TEXT_BYTES_MAX {
        return Err(LibraryError::TooLong(text.len()));
    }
    let scenario = Scenario::parse(text, origin).map_err(LibraryError::Unsound)?;
    let known = bowwave_models::built_in_names();
    for boat in &scenario.boats {
        let model = boat.model.as_str();
        if !known.contains(&model) && !is_plain_file(model) {
            return Err(LibraryError::Model { boat: boat.name.clone(), model: boat.model.clone(), known });
        }
    }
    Ok(scenario)
}

/// Tests whether a name leads nowhere but into the folder that it is looked for in.
fn is_plain_file(name: &str) -> bool {
    let is_plain = |c: char| !c.is_control() && !matches!(c, '/' | '\\' | ':');
    !name.is_empty() && name.len() <= MODEL_BYTES_MAX && !name.starts_with('.') && name.chars().all(is_plain)
}

/// Content of a text, or its mistakes.
pub(crate) fn check(text: &str) -> Checked {
    let scenario = match may_start(text, "scenario") {
        Ok(scenario) => scenario,
        Err(LibraryError::Unsound(first)) => {
            let mut all: Vec<Mistake> = mistakes(text, "scenario").into_iter().map(Mistake::from).collect();
            if all.is_empty() {
                all.push(first.into());
            }
            return wrong(all);
        }
        Err(other) => {
            let line = text.lines().position(|line| is_of(line, &other)).map_or(1, |at| at + 1);
            return wrong(vec![Mistake { line, column: 1, key: String::new(), problem: other.to_string() }]);
        }
    };
    let start = |boat: &bowwave_core::world::scenario::BoatSpec| {
        let state = boat.behaviour.begin();
        BoatStart {
            name: boat.name.clone(),
            side: boat.side.name(),
            model: boat.model.clone(),
            east_m: state.position.x,
            north_m: state.position.y,
            heading_deg: state.heading.to_degrees().rem_euclid(360.0),
            speed_m_s: state.speed_m_s,
        }
    };
    Checked {
        mistakes: Vec::new(),
        boats: scenario.boats.iter().map(start).collect(),
        warnings: scenario.warnings,
        title: scenario.name,
        briefing: scenario.exercise.briefing,
        duration_s: scenario.duration_s,
        rules: scenario.exercise.rules.map(|rules| rules.name()),
        keep_off_m: scenario.exercise.goals.keep_off_m,
    }
}

/// Tests whether a line names the model that is refused.
fn is_of(line: &str, error: &LibraryError) -> bool {
    matches!(error, LibraryError::Model { model, .. } if line.contains(model.as_str()))
}

fn wrong(mistakes: Vec<Mistake>) -> Checked {
    Checked {
        mistakes,
        warnings: Vec::new(),
        title: String::new(),
        briefing: None,
        duration_s: None,
        rules: None,
        keep_off_m: Goals::KEEP_OFF_M,
        boats: Vec::new(),
    }
}

fn listed(origin: Origin, name: String, text: &str) -> Listed {
    match may_start(text, &name) {
        Ok(scenario) => Listed {
            origin,
            name,
            title: scenario.name,
            briefing: scenario.exercise.briefing,
            boats: scenario.boats.len(),
            duration_s: scenario.duration_s,
            error: None,
        },
        Err(error) => Listed { origin, ..unreadable(name, error.to_string()) },
    }
}

fn unreadable(name: String, error: String) -> Listed {
    let title = name.clone();
    Listed {
        origin: Origin::Own,
        name,
        title,
        briefing: None,
        boats: 0,
        duration_s: None,
        error: Some(error),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const BOAT: &str = "name = \"One\"\n[[boat]]\nname = \"a\"\nmodel = \"skiff\"\ncourse = \"straight\"\nrange_m = 500\nbearing_deg = 90\nheading_deg = 270\nspeed_kn = 10\n";

    #[test]
    fn scenarios_are_saved_listed_and_read() {
        let folder = tempfile::tempdir().unwrap();
        let library = Library::new(Some(folder.path().join("own")));
        assert_eq!(library.list().unwrap().len(), BUILT_IN.len());
        library.save("my-1", BOAT).unwrap();
        fs::write(folder.path().join("own/Bad Name.toml"), BOAT).unwrap();
        fs::write(folder.path().join("own/broken.toml"), "boat = 3").unwrap();
        let list = library.list().unwrap();
        assert_eq!(list.len(), BUILT_IN.len() + 2);
        assert!(list[0].name == "broken" && list[0].error.is_some());
        assert_eq!((list[1].name.as_str(), list[1].boats), ("my-1", 1));
        assert_eq!(library.text(Origin::Own, "my-1").unwrap(), BOAT);
        assert_eq!(library.text(Origin::BuiltIn, "swarm").unwrap(), BUILT_IN[1].1);
        assert!(matches!(library.text(Origin::BuiltIn, "my-1"), Err(LibraryError::Unknown(_))));
        assert!(matches!(library.save("my-1", "boat = 3"), Err(LibraryError::Unsound(_))));
        assert_eq!(library.text(Origin::Own, "my-1").unwrap(), BOAT, "the one before stays");
        assert!(matches!(Library::new(None).save("a", BOAT), Err(LibraryError::NoFolder)));
    }

    #[test]
    fn names_lead_nowhere_else() {
        let folder = tempfile::tempdir().unwrap();
        let library = Library::new(Some(folder.path().to_owned()));
        for name in ["", "..", "../a", "a/b", "%2e%2e", "A", "a.toml", "a\0", &"a".repeat(65)] {
            assert!(matches!(library.text(Origin::Own, name), Err(LibraryError::Name(_))), "{name:?}");
            assert!(matches!(library.save(name, BOAT), Err(LibraryError::Name(_))), "{name:?}");
        }
        for model in ["../skiff.glb", "/etc/passwd", "a\\b.glb", ".hidden.glb", "a/b.png", "c:x.glb"] {
            let text = BOAT.replace("skiff", &model.replace('\\', "\\\\"));
            let error = may_start(&text, "x").unwrap_err();
            assert!(matches!(error, LibraryError::Model { .. }), "{model}: {error}");
            assert_eq!(check(&text).mistakes.len(), 1);
        }
        assert!(may_start(&BOAT.replace("skiff", "own boat.glb"), "x").is_ok());
    }

    #[test]
    fn a_text_is_checked_with_places() {
        let checked = check(BOAT);
        assert!(checked.mistakes.is_empty() && checked.title == "One");
        let boat = &checked.boats[0];
        assert!((boat.east_m - 500.0).abs() < 1e-6 && (boat.heading_deg - 270.0).abs() < 1e-6, "{boat:?}");
        let checked = check(&BOAT.replace("speed_kn = 10", "speed_kn = \"fast\""));
        assert_eq!(checked.mistakes[0].line, 9);
        assert_eq!(check(&" ".repeat(TEXT_BYTES_MAX + 1)).mistakes.len(), 1);
    }

    #[test]
    fn all_built_in_scenarios_may_be_started() {
        for (name, text) in BUILT_IN {
            assert!(may_start(text, name).is_ok(), "{name}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_checked(text in ".{0,200}") {
            let _ = check(&text);
        }

        #[test]
        fn a_name_that_is_let_through_stays_in_its_folder(name in "[a-zA-Z0-9./%\\\\-]{0,70}") {
            if is_name(&name) {
                let path = Library::new(Some("/folder".into())).path(&name).unwrap();
                prop_assert_eq!(path.parent(), Some(Path::new("/folder")));
                prop_assert_eq!(path.components().count(), 3);
            }
        }
    }
}
