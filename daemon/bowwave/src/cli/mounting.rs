//! Arguments of the tasks of `calibrate` that are about how camera, inertial unit and gun are mounted on each other.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use bowwave_calibration::target::Target;
use clap::{Args, FromArgMatches as _, ValueEnum};
use glam::DVec2;

use super::calibrate::{BOARD, parse_board};

/// Arguments that say how a result is shown.
#[derive(Clone, Debug, Args)]
pub struct OutputArgs {
    /// Also write the result as a page (HTML), with what is left over plotted
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments that name the calibration to begin with and the one to write.
#[derive(Clone, Debug, Args)]
pub struct CalibrationFiles {
    /// Calibration file (TOML); without it the recording's own
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
    /// Calibration file to write; without it the one of --calibration. What stands there is kept, see `restore`
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

impl CalibrationFiles {
    /// The calibration to begin with on live devices: the one that is named, else the one of the configuration `config`.
    pub fn named_or(&self, configured: Option<&Path>, config: &Path) -> Result<PathBuf> {
        let named = self.calibration.as_deref().or(configured);
        named.map(Path::to_owned).with_context(|| {
            format!("{} names no calibration: set files.calibration, or say --calibration", config.display())
        })
    }
}

/// Arguments that say how a recording is looked at, and how the result is shown.
#[derive(Clone, Debug, Args)]
pub struct InputArgs {
    /// The camera's height above the sea; without it what the recording or its scenario says
    #[arg(long, value_name = "M", value_parser = parse_height)]
    pub eye_height: Option<f64>,
    /// Also look for this board, which must stand still (see `calibrate board`): tags across and upwards, side in millimetres, gap by that; or
    /// Kalibr's file of it
    #[arg(long, value_name = BOARD, value_parser = parse_board)]
    pub target: Option<Target>,
    #[command(flatten)]
    pub output: OutputArgs,
}

/// Arguments of `calibrate extrinsics`.
#[derive(Debug, Args)]
pub struct CalibrateExtrinsics {
    /// Recording (MCAP) in which camera and unit are moved together, seeing the sea's horizon or the board
    pub recording: PathBuf,
    #[command(flatten)]
    pub input: InputArgs,
    #[command(flatten)]
    pub files: CalibrationFiles,
    /// Write the file although the result is poor
    #[arg(long)]
    pub accept_poor: bool,
}

/// Arguments of `calibrate check`.
#[derive(Debug, Args)]
pub struct CalibrateCheck {
    /// Any recording (MCAP) in which the horizon is seen
    pub recording: PathBuf,
    /// Calibration file (TOML); without it the recording's own
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
    #[command(flatten)]
    pub input: InputArgs,
}

/// Arguments of `calibrate restore`.
#[derive(Debug, Args)]
pub struct CalibrateRestore {
    /// Calibration file (TOML)
    pub calibration: PathBuf,
    /// Which copy to put back; without it the newest that differs from the file
    #[arg(long, value_name = "N", conflicts_with = "list")]
    pub number: Option<u32>,
    /// Only show what is kept
    #[arg(long)]
    pub list: bool,
}

/// Arguments of `calibrate trigger`.
#[derive(Debug, Args)]
pub struct CalibrateTrigger {
    /// Recording (MCAP) of dry shots: gun cocked and held still, a second of rest between presses, five times or more
    pub recording: PathBuf,
    #[command(flatten)]
    pub files: CalibrationFiles,
    #[command(flatten)]
    pub output: OutputArgs,
}

/// Arguments of `calibrate boresight`.
#[derive(Debug, Args)]
pub struct CalibrateBoresight {
    /// Recording (MCAP) in which the bore is aimed at the mark, by collimator or through the barrel, and the trigger pulled, three to five
    /// times, the aim taken anew for each
    pub recording: PathBuf,
    /// From the camera to the mark, metres: tells the parallax of camera and barrel
    #[arg(long, value_name = "M", value_parser = parse_range)]
    pub range: f64,
    /// The mark is the middle of a tag of this board (see `calibrate board`)
    #[arg(long, value_name = BOARD, value_parser = parse_board, conflicts_with = "mark")]
    pub target: Option<Target>,
    /// Which tag
    #[arg(long, value_name = "ID", default_value_t = 0, requires = "target")]
    pub tag: usize,
    /// The mark's place in the picture of a pull, pixels; once for each pull, in their order
    #[arg(long, value_name = "X,Y", value_parser = parse_mark, required_unless_present = "target")]
    pub mark: Vec<PixelMark>,
    #[command(flatten)]
    pub files: CalibrationFiles,
    #[command(flatten)]
    pub output: OutputArgs,
}

/// Task of the wizard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum WizardTask {
    /// The camera's lens, by the board (formerly `camera`)
    #[value(alias = "camera")]
    Intrinsics,
    /// Inertial unit to camera, by the horizon or the board (formerly `imu`)
    #[value(alias = "imu")]
    Extrinsics,
    /// Where the barrel points, by pulls at a tag of the board
    Boresight,
    /// When a round leaves, by dry shots
    Trigger,
}

/// Arguments of `calibrate wizard`.
#[derive(Debug, Args)]
pub struct CalibrateWizard {
    /// What to calibrate; without it the wizard asks
    pub task: Option<WizardTask>,
    /// Configuration file (TOML) that names the devices and the calibration
    #[arg(long, value_name = "FILE", default_value = super::CONFIG)]
    pub config: PathBuf,
    /// Go through it on a recording (MCAP) instead of the devices
    #[arg(long, value_name = "RECORDING")]
    pub replay: Option<PathBuf>,
    /// Play the recording as fast as it goes, to its end
    #[arg(long, requires = "replay")]
    pub fast: bool,
    /// The board (see `calibrate board`): tags across and upwards, side in millimetres, gap by that; or Kalibr's file of it
    #[arg(long, value_name = BOARD, value_parser = parse_board)]
    pub target: Option<Target>,
    /// The tag of the board at which the bore is aimed for the boresight
    #[arg(long, value_name = "ID", default_value_t = 0, requires = "target")]
    pub tag: usize,
    /// From the camera to that tag, metres
    #[arg(long, value_name = "M", value_parser = parse_range, requires = "target")]
    pub range: Option<f64>,
    /// The camera's height above the sea; without it what scenario or recording say
    #[arg(long, value_name = "M", value_parser = parse_height)]
    pub eye_height: Option<f64>,
    /// Folder for what is gathered, as recordings; without it the configuration's data folder, else the trainer's, else this one
    #[arg(long, value_name = "DIR", conflicts_with = "replay")]
    pub data: Option<PathBuf>,
    /// Show the pages in a window as well
    #[arg(long, conflicts_with = "fast")]
    pub window: bool,
    /// Also write the last result as a page (HTML)
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    #[command(flatten)]
    pub files: CalibrationFiles,
}

impl CalibrateWizard {
    /// As without any argument.
    ///
    /// # Errors
    /// Where an argument is required, which none is.
    pub fn unasked() -> Result<Self, clap::Error> {
        let command = Self::augment_args(clap::Command::new("wizard").no_binary_name(true));
        Self::from_arg_matches(&command.try_get_matches_from([""; 0])?)
    }
}

/// A place in a picture, pixels; the centre of the first pixel is (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelMark(pub DVec2);

pub(super) fn parse_mark(text: &str) -> Result<PixelMark, String> {
    let numbers =
        text.split_once(',').and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
    let mark = numbers.filter(|(x, y)| (0.0..=8192.0).contains(x) && (0.0..=8192.0).contains(y));
    mark.map(|(x, y)| PixelMark(DVec2::new(x, y)))
        .ok_or_else(|| format!("'{text}' is no place: write X,Y in pixels, as 641.5,358"))
}

fn parse_range(text: &str) -> Result<f64, String> {
    let range = text.parse::<f64>().ok().filter(|v| (1.0..=10_000.0).contains(v));
    range.ok_or_else(|| format!("'{text}' is no range: give metres, 1 to 10000"))
}

fn parse_height(text: &str) -> Result<f64, String> {
    let height = text.parse::<f64>().ok().filter(|v| (0.5..=100.0).contains(v));
    height.ok_or_else(|| format!("'{text}' is no height: give metres, 0.5 to 100"))
}
