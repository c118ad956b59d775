//! Arguments of `calibrate`.

use std::path::PathBuf;

use bowwave_calibration::target::Target;
use clap::{Args, Subcommand};

/// Arguments of `calibrate`.
#[derive(Debug, Args)]
pub struct Calibrate {
    /// What to measure or make
    #[command(subcommand)]
    pub task: CalibrateTask,
}

/// What to measure or make.
#[derive(Debug, Subcommand)]
pub enum CalibrateTask {
    /// Make the board whose pictures tell the lens, ready to print
    Board(CalibrateBoard),
}

/// Arguments of `calibrate board`.
#[derive(Debug, Args)]
pub struct CalibrateBoard {
    /// Drawing to write (SVG), in true size
    #[arg(short, long, value_name = "FILE", default_value = "board.svg")]
    pub out: PathBuf,
    /// Tags across and upwards, side of a tag in millimetres, gap between tags by that side; 6x6:22 fills A4, 6x6:34 fills A3
    #[arg(long, value_name = "COLUMNSxROWS:MM[:GAP]", default_value_t = Target::A4)]
    pub target: Target,
    /// Replace a file of that name
    #[arg(long)]
    pub force: bool,
}
