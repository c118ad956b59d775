//! Arguments of runs on a desk: `simulate` and `play`.

use std::path::PathBuf;

use clap::Args;

use super::{parse_duration, parse_size};

/// Outputs of a run on a desk.
#[derive(Debug, Args)]
pub struct DeskArgs {
    /// Configuration file (TOML); what is given on the command line overrides it
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Screen size in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
    /// Draw off screen only
    #[arg(long, conflicts_with = "window")]
    pub headless: bool,
    /// Show a window as well: space or the left mouse button fires, escape ends
    #[arg(long)]
    pub window: bool,
    /// End after so many frames
    #[arg(long, value_name = "N", conflicts_with = "duration", value_parser = clap::value_parser!(u64).range(1..))]
    pub frames: Option<u64>,
    /// End after so many seconds; without it with the recording or the scenario
    #[arg(long, value_name = "S", value_parser = parse_duration)]
    pub duration: Option<f64>,
    /// Seed of all chance; overrides the scenario's
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Folder for summary.json, hits.sqlite and what else is asked for
    #[arg(long, value_name = "DIR", default_value = "bowwave-out")]
    pub out: PathBuf,
    /// Also keep what went in as DIR/recording.mcap
    #[arg(long)]
    pub record: bool,
    /// Also make a video of what was shown, DIR/video.mp4 (needs ffmpeg)
    #[arg(long)]
    pub video: bool,
    /// Also make a contact sheet of what was shown, DIR/contact-sheet.png
    #[arg(long)]
    pub sheet: bool,
    /// Also keep these frames as DIR/frame-NNNNN.png
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', value_parser = frame_number)]
    pub stills: Vec<u64>,
    /// Vulkan device: its number, or part of its name
    #[arg(long, value_name = "NAME")]
    pub gpu: Option<String>,
    /// Run with Vulkan's validation layer; anything it reports makes the run fail
    #[arg(long)]
    pub validation: bool,
    /// Print each committed round's number on standard output as soon as the journal says so
    #[arg(long)]
    pub print_commits: bool,
    /// Print the summary on standard output as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `play`.
#[derive(Debug, Args)]
pub struct Play {
    /// Scenario: a file (TOML) or the name of a built-in one; `bowwave scenario list` lists these
    #[arg(default_value = "first-target")]
    pub scenario: PathBuf,
    /// Who aims: mouse, a simulated gunner (novice, trained, expert), or a script (TOML)
    #[arg(long, value_name = "HANDS", default_value = "mouse")]
    pub aim: String,
    /// Size of the simulated camera's pictures; smaller ones are for slow computers
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "1280x720")]
    pub camera: (u32, u32),
    /// Play without a clock, as fast as it goes, repeatable to the byte; for scripts and simulated gunners
    #[arg(long)]
    pub fast: bool,
    /// Let an instructor join through this socket (see `bowwave instructor`): the exercise waits for a start, and others can follow it
    #[arg(long, value_name = "SOCKET", conflicts_with_all = ["fast", "record", "video", "sheet", "stills"])]
    pub instructor: Option<PathBuf>,
    /// Outputs
    #[command(flatten)]
    pub desk: DeskArgs,
}

fn frame_number(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| "give numbers of frames, counted from 0, such as 0,30,60".to_owned())
}
