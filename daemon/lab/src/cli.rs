//! The command line of the laboratory.

use std::path::PathBuf;

use bowwave_core::water::ReflectionMethod;
use bowwave_import::Level;
use clap::{Args, Parser, Subcommand};

/// Bowwave's laboratory: recordings from pictures and videos, boats in photographs, and the user study.
#[derive(Debug, Parser)]
#[command(name = "bowwave-lab", version, max_term_width = 100)]
pub struct LabCli {
    /// Log more (-v: info, -vv: debug); RUST_LOG overrides it
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    pub verbose: u8,
    /// The command
    #[command(subcommand)]
    pub command: LabCommand,
}

/// Commands of the laboratory.
#[derive(Debug, Subcommand)]
pub enum LabCommand {
    /// Make a recording from a folder of pictures or from a video
    Import(ImportArgs),
    /// Compose boats into a photograph
    Compose(ComposeArgs),
    /// Make the user study of real and generated reflections, or score its answers
    Study(StudyArgs),
}

/// Arguments of `import`.
#[derive(Debug, Args)]
pub struct ImportArgs {
    /// Folder of JPEG or PNG pictures, or a video file
    pub source: PathBuf,
    /// Recording to write (MCAP)
    #[arg(short, long, value_name = "FILE")]
    pub out: PathBuf,
    /// Calibration file (TOML): lens, camera-from-IMU rotation, time offset
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
    /// Scenario file (TOML) to keep in the recording
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// Pictures a second of a folder of pictures
    #[arg(long, value_name = "HZ", default_value_t = 30.0)]
    pub rate: f64,
    /// Take the gyro's bias from the first S seconds, during which the camera must not turn
    #[arg(long, value_name = "S")]
    pub bias_from: Option<f64>,
    /// How the camera was held at the first picture: degrees above the horizontal, and degrees rolled clockwise.
    /// Without it the unit is levelled by its accelerometer, which a moving camera misleads
    #[arg(long, value_name = "UP,ROLL", value_parser = parse_level, allow_hyphen_values = true)]
    pub level: Option<Level>,
    /// Replace a recording of that name
    #[arg(long)]
    pub force: bool,
    /// Print what was imported as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `compose`.
#[derive(Debug, Args)]
pub struct ComposeArgs {
    /// Scene file (TOML): picture, camera, boats, sea and light
    #[arg(required_unless_present = "example")]
    pub scene: Option<PathBuf>,
    /// Print a commented scene to begin with
    #[arg(long, conflicts_with_all = ["scene", "method", "out"])]
    pub example: bool,
    /// Folder for the pictures, which keep their names
    #[arg(long, value_name = "DIR", default_value = "bowwave-out")]
    pub out: PathBuf,
    /// How the sea mirrors, instead of the scene's own method; several, with commas between, or "all" make a picture each
    #[arg(long, value_name = "METHOD", value_parser = parse_methods)]
    pub method: Option<Methods>,
    /// Vulkan device: its number, or part of its name
    #[arg(long, value_name = "NAME")]
    pub gpu: Option<String>,
    /// Run with Vulkan's validation layer; anything it reports makes the run fail
    #[arg(long)]
    pub validation: bool,
}

/// Arguments of `study`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct StudyArgs {
    /// Task other than making a study
    #[command(subcommand)]
    pub task: Option<StudyTask>,
    /// Folder for the page, the pictures and the key
    #[arg(long, value_name = "DIR", default_value = "bowwave-study")]
    pub out: PathBuf,
    /// Folder with photographs of real reflections, cut so that neither boat nor horizon is seen; the thesis had 18
    #[arg(long, value_name = "DIR")]
    pub real: Option<PathBuf>,
    /// Scene file as of `bowwave compose` whose picture, or pictures, are a background; twice. Without it two simulated seas
    #[arg(long, value_name = "FILE")]
    pub background: Vec<PathBuf>,
    /// The two ways to mirror that are compared
    #[arg(long, value_name = "METHOD,METHOD", value_parser = parse_methods)]
    pub methods: Option<Methods>,
    /// How many participants get an order of their own
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = parse_participants)]
    pub participants: usize,
    /// Seed of orders, names and places
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Replace a study that is in the folder
    #[arg(long)]
    pub force: bool,
    /// Vulkan device: its number, or part of its name
    #[arg(long, value_name = "NAME")]
    pub gpu: Option<String>,
}

/// Tasks of an existing study.
#[derive(Debug, Subcommand)]
pub enum StudyTask {
    /// Compute rates by factor, standard errors and d' from answers
    Score(StudyScoreArgs),
}

/// Arguments of `study score`.
#[derive(Debug, Args)]
pub struct StudyScoreArgs {
    /// Files that the page saved, or filled-in answer sheets
    #[arg(required = true)]
    pub answers: Vec<PathBuf>,
    /// The study's key
    #[arg(long, value_name = "FILE", default_value = "bowwave-study/key.csv")]
    pub key: PathBuf,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Ways to mirror, at least one, each once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Methods {
    /// The methods.
    pub list: Vec<ReflectionMethod>,
    /// Former names that were used, each with the new one.
    pub warnings: Vec<String>,
}

/// `-2.5,0.4`.
fn parse_level(text: &str) -> Result<Level, String> {
    let usage = || format!("'{text}' is no attitude: write UP,ROLL in degrees, each -89 to 89, as -2.5,0.4");
    let (up, roll) = text.split_once(',').ok_or_else(usage)?;
    let radians = |s: &str| {
        s.trim()
            .parse::<f64>()
            .ok()
            .filter(|v| (-89.0..=89.0).contains(v))
            .map(f64::to_radians)
            .ok_or_else(usage)
    };
    Ok(Level { elevation: radians(up)?, roll: radians(roll)? })
}

/// `full`, `mirror,full` or `all`.
fn parse_methods(text: &str) -> Result<Methods, String> {
    if text == "all" {
        return Ok(Methods { list: ReflectionMethod::ALL.to_vec(), warnings: Vec::new() });
    }
    let mut methods = Methods::default();
    for name in text.split(',') {
        let method = ReflectionMethod::of_name(name.trim()).ok_or_else(|| {
            let names = ReflectionMethod::ALL.map(ReflectionMethod::name).join(", ");
            format!("'{name}' is no way to mirror; there are {names}, and all")
        })?;
        methods.warnings.extend(ReflectionMethod::warning(name.trim()));
        if !methods.list.contains(&method) {
            methods.list.push(method);
        }
    }
    Ok(methods)
}

fn parse_participants(text: &str) -> Result<usize, String> {
    let number = text.parse::<usize>().ok().filter(|n| (1..=1000).contains(n));
    number.ok_or_else(|| format!("'{text}' is no number of participants: write 1 to 1000"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_laboratory_command_line_is_consistent() {
        LabCli::command().debug_assert();
    }

    #[test]
    fn methods() {
        use ReflectionMethod::{Full, Mirror, Off};
        let list = |text| parse_methods(text).map(|methods| (methods.list, methods.warnings.len()));
        assert_eq!(list("mirror"), Ok((vec![Mirror], 0)));
        assert_eq!(list("none, full,off"), Ok((vec![Off, Full], 0)));
        assert_eq!(list("all"), Ok((ReflectionMethod::ALL.to_vec(), 0)));
        let former = parse_methods("full,waves").unwrap();
        assert_eq!(former.list, [Full, ReflectionMethod::Baked]);
        assert!(
            former.warnings.len() == 1 && former.warnings[0].contains("\"baked\""),
            "{:?}",
            former.warnings
        );
        for bad in ["", "magic", "full,", "all,full"] {
            assert!(parse_methods(bad).is_err(), "{bad}");
        }
    }
}
