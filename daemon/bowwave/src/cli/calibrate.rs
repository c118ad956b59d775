//! Arguments of `calibrate`.

use std::path::{Path, PathBuf};

use bowwave_calibration::target::{Target, TargetError};
use bowwave_core::text::{one_line, toml::TEXT_BYTES_MAX};
use clap::{Args, Subcommand};

use super::{
    mounting::{
        CalibrateBoresight, CalibrateCheck, CalibrateExtrinsics, CalibrateRestore, CalibrateTrigger,
        CalibrateWizard,
    },
    phantom::CalibratePhantom,
};

/// Arguments of `calibrate`.
#[derive(Debug, Args)]
pub struct Calibrate {
    /// What to measure or make; without it the wizard asks
    #[command(subcommand)]
    pub task: Option<CalibrateTask>,
}

/// Task of `calibrate`.
#[derive(Debug, Subcommand)]
pub enum CalibrateTask {
    /// Be guided through all of it, on this computer's devices or on a recording
    Wizard(CalibrateWizard),
    /// Make the board whose pictures tell the lens, ready to print
    Board(CalibrateBoard),
    /// Measure the lens from pictures of the board: focal length, centre, distortion
    #[command(visible_alias = "camera")]
    Intrinsics(CalibrateIntrinsics),
    /// Measure how the inertial unit is turned against the camera, how far their clocks are apart, and the gyro's bias
    #[command(visible_alias = "imu")]
    Extrinsics(CalibrateExtrinsics),
    /// Measure where the barrel points, by trigger pulls with the bore aimed at a mark
    Boresight(CalibrateBoresight),
    /// Measure how long after the trigger's edge a round leaves, by dry shots
    Trigger(CalibrateTrigger),
    /// Trace what the camera sees of the gun itself, so that it hides boats behind it
    Phantom(CalibratePhantom),
    /// Check on any recording whether a calibration still holds: exit code 0 it does, 1 it does not, 3 the recording does not tell
    Check(CalibrateCheck),
    /// Put a calibration back that was replaced
    Restore(CalibrateRestore),
}

/// Arguments of `calibrate board`.
#[derive(Debug, Args)]
pub struct CalibrateBoard {
    /// Drawing to write (SVG), in true size
    #[arg(short, long, value_name = "FILE", default_value = "board.svg")]
    pub out: PathBuf,
    /// Tags across and upwards, side of a tag in millimetres, gap between tags by that side; 6x6:22 fills A4, 6x6:34 fills A3. Or Kalibr's
    /// file of a board (YAML: target_type 'aprilgrid', tagCols, tagRows, tagSize in metres, tagSpacing)
    #[arg(long, value_name = BOARD, value_parser = parse_board, default_value_t = Target::A4)]
    pub target: Target,
    /// Also write the board as Kalibr's file (YAML), which --target of every task takes
    #[arg(long, value_name = "FILE")]
    pub kalibr: Option<PathBuf>,
    /// Replace files of these names
    #[arg(long)]
    pub force: bool,
}

/// Arguments of `calibrate intrinsics`.
#[derive(Debug, Args)]
pub struct CalibrateIntrinsics {
    /// Folder of JPEG or PNG pictures of the board, or a recording (MCAP) in which it is shown
    pub pictures: PathBuf,
    /// The board, as `calibrate board` prints below it, or Kalibr's file of it. Its size does not matter to the lens, its layout does
    #[arg(long, value_name = BOARD, value_parser = parse_board, default_value_t = Target::A4)]
    pub target: Target,
    /// Calibration file (TOML) whose lens is replaced; where there is none, one is begun
    #[arg(short, long, value_name = "FILE", default_value = "calibration.toml")]
    pub out: PathBuf,
    /// Write a lens that is graded poor, too
    #[arg(long)]
    pub accept_poor: bool,
    /// Only say what the lens is, and write nothing
    #[arg(long, conflicts_with = "accept_poor")]
    pub dry_run: bool,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// How a board is named.
pub(super) const BOARD: &str = "COLUMNSxROWS:MM[:GAP]|FILE.yaml";

/// A board by its numbers, or by Kalibr's file of it.
pub(super) fn parse_board(text: &str) -> Result<Target, String> {
    let path = Path::new(text);
    let is_file =
        path.extension().is_some_and(|e| e.eq_ignore_ascii_case("yaml") || e.eq_ignore_ascii_case("yml"));
    if !is_file {
        return text
            .parse()
            .map_err(|e: TargetError| format!("{e}; or name Kalibr's file of it, as april_6x6.yaml"));
    }
    let yaml = bowwave_files::plain_text(path, TEXT_BYTES_MAX).map_err(|e| {
        format!("cannot read {text}: {e}; `bowwave calibrate board --kalibr {text}` writes one")
    })?;
    // The parser of arguments prints this as it is, and the file may hold anything.
    Target::of_kalibr(&yaml).map_err(|e| one_line(&format!("{text}: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_file_of_a_board_says_is_quoted_without_its_controls() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("board.yaml");
        let text =
            "target_type: 'apri\u{202e}txt.exe'\ntagCols: 6\ntagRows: 6\ntagSize: 0.022\ntagSpacing: 0.3\n";
        std::fs::write(&file, text).expect("written");
        let error = parse_board(&file.to_string_lossy()).expect_err("no known board");
        assert!(error.contains("'apri\\u{202e}txt.exe'"), "{error}");
        assert!(!error.contains('\u{202e}'), "{error}");
    }
}
