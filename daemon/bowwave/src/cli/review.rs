//! Arguments of `review`.

use std::path::PathBuf;

use bowwave_core::ephemeris::Place;
use clap::{Args, ValueEnum};

/// Formats of `review`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ReviewFormat {
    /// A page that needs no other file
    Html,
    /// The same page on paper, printed by Chromium, Chrome or Edge
    Pdf,
    /// Everything that happened, and where everything was, a row each
    Csv,
    /// The same, a JSON object a line
    Jsonl,
    /// A flight recording of text (ACMI 2.2), which Tacview opens
    Acmi,
    /// Tracks and rounds on the Earth, for maps (RFC 7946)
    Geojson,
}

impl ReviewFormat {
    /// Name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Html => "html",
            Self::Pdf => "pdf",
            Self::Csv => "csv",
            Self::Jsonl => "jsonl",
            Self::Acmi => "acmi",
            Self::Geojson => "geojson",
        }
    }
}

/// Arguments of `review`.
#[derive(Debug, Args)]
pub struct ReviewArgs {
    /// Journals (SQLite) or folders that runs left; several are compared on one page
    #[arg(default_value = "bowwave-out")]
    pub run: Vec<PathBuf>,
    /// This run of the journal, or these, which are compared; without it the newest
    #[arg(long = "run", value_name = "N,N,...", value_delimiter = ',')]
    pub numbers: Vec<i64>,
    /// Compare all runs of the journals
    #[arg(long, conflicts_with = "numbers")]
    pub all_runs: bool,
    /// A page for the browser, or rows and tracks for other programs
    #[arg(long, value_enum, default_value_t = ReviewFormat::Html)]
    pub format: ReviewFormat,
    /// The file to write; without it review-N.FORMAT beside the journal, or review-compare.FORMAT beside the first
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Replace what is at --out
    #[arg(long, requires = "out")]
    pub force: bool,
    /// Show this video (MP4) with the page's time line; without it video.mp4 beside the journal, for the newest run
    #[arg(long, value_name = "FILE")]
    pub video: Option<PathBuf>,
    /// Time of the run at which the video begins, seconds; without it the one in summary.json beside the video
    #[arg(long, value_name = "S", allow_hyphen_values = true, value_parser = parse_offset)]
    pub video_at: Option<f64>,
    /// Largest video that is put into the page, megabytes; a larger one stays where it is, and the page plays it from there
    #[arg(long, value_name = "N", default_value_t = 200)]
    pub embed_mb: u64,
    /// Latitude and longitude of the gun, degrees; without it the scenario's
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true, value_parser = parse_place)]
    pub place: Option<Place>,
    /// Browser that prints (--format pdf); without it the first that is installed
    #[arg(long, value_name = "PROGRAM")]
    pub browser: Option<PathBuf>,
    /// Open the file on the desktop: the page in the browser
    #[arg(long)]
    pub open: bool,
}

/// `54.1,7.9`.
fn parse_place(text: &str) -> Result<Place, String> {
    let usage =
        || format!("'{text}' is no place: write LAT,LON in degrees, north and east positive, as 54.1,7.9");
    let (latitude, longitude) = text.split_once(',').ok_or_else(usage)?;
    let number = |s: &str| s.trim().parse::<f64>().map_err(|_| usage());
    Place::new(number(latitude)?, number(longitude)?).ok_or_else(usage)
}

/// `-2.5`.
fn parse_offset(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|s| s.abs() <= 1e6);
    seconds.ok_or_else(|| format!("'{text}' is no time of a run: write seconds, as 2.5"))
}
