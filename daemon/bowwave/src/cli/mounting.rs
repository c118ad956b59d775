//! Arguments of the tasks of `calibrate` that are about how camera, inertial unit and gun are mounted on each other.

use std::path::PathBuf;

use bowwave_calibration::target::Target;
use clap::Args;

/// What all of them look at.
#[derive(Clone, Debug, Args)]
pub struct Material {
    /// Calibration file (TOML); without it the recording's own
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
    /// The camera's height above the sea; without it what the recording or its scenario says
    #[arg(long, value_name = "M", value_parser = parse_height)]
    pub eye_height: Option<f64>,
    /// Also look for this board, which must stand still (see `calibrate board`): tags across and upwards, side in millimetres, gap by that
    #[arg(long, value_name = "COLUMNSxROWS:MM[:GAP]")]
    pub target: Option<Target>,
    /// Also write the result as a page (HTML), with what is left over plotted
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `calibrate imu`.
#[derive(Debug, Args)]
pub struct CalibrateImu {
    /// Recording (MCAP) in which camera and unit are moved together, seeing the sea's horizon or the board
    pub recording: PathBuf,
    #[command(flatten)]
    pub material: Material,
    /// Calibration file to write; without it the one of --calibration. What stands there is kept, see `restore`
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Write the file although the result is poor
    #[arg(long)]
    pub accept_poor: bool,
}

/// Arguments of `calibrate check`.
#[derive(Debug, Args)]
pub struct CalibrateCheck {
    /// Any recording (MCAP) in which the horizon is seen
    pub recording: PathBuf,
    #[command(flatten)]
    pub material: Material,
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

fn parse_height(text: &str) -> Result<f64, String> {
    let height = text.parse::<f64>().ok().filter(|v| (0.5..=100.0).contains(v));
    height.ok_or_else(|| format!("'{text}' is no height: give metres, 0.5 to 100"))
}
