//! The commands that render the truth.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::{Args, Subcommand};
use hw_sim::ocean::spectrum::LongWaves;

use super::{
    cell::{CellSpec, sea_of_state},
    files, grid, study,
    video::{self, VideoSpec},
};

/// Commands of the ray-traced sea with a boat on it.
#[derive(Debug, Subcommand)]
pub enum TruthStudy {
    /// Renders one cell
    Cell(CellArgs),
    /// Renders all cells of the grid that the folder does not yet hold
    Grid {
        /// Only 8 m eye height, two lights, one heading
        #[arg(long)]
        quick: bool,
        /// Times as many paths a pixel: 0.25 takes a quarter of the time and has twice the noise
        #[arg(long, default_value_t = 1.0)]
        paths: f64,
        /// Folder of the cells
        #[arg(long, value_name = "DIR", default_value = "target/truth")]
        out: PathBuf,
    },
    /// Renders one cell again with other paths and finer waves, and prints what that changes
    Study(CellArgs),
    /// Films a boat-free sea
    Video(FilmArgs),
}

/// Settings of one cell.
#[derive(Debug, Args)]
pub struct CellArgs {
    /// Distance to the boat, metres
    #[arg(long, default_value_t = 60.0)]
    range: f64,
    /// Beaufort force
    #[arg(long, default_value_t = 2)]
    state: u8,
    /// Height of the eye, metres
    #[arg(long, default_value_t = 8.0)]
    eye: f64,
    /// Name of the light
    #[arg(long, default_value = "overcast")]
    light: String,
    /// Heading of the bow, degrees clockwise from the direction of view
    #[arg(long, default_value_t = 80.0)]
    heading: f64,
    /// Time of the waves, seconds
    #[arg(long, default_value_t = 0.0)]
    time: f64,
    /// Which waves
    #[arg(long, default_value_t = 1)]
    waves: u64,
    /// Paths a pixel
    #[arg(long)]
    samples: Option<u32>,
    /// Boat: box8, one of the trainer's, or a glTF file
    #[arg(long)]
    boat: Option<String>,
    /// Folder to put the cell's own folder into
    #[arg(long, value_name = "DIR", default_value = "target/truth")]
    out: PathBuf,
}

/// Settings of a film.
#[derive(Debug, Args)]
pub struct FilmArgs {
    /// Beaufort force; gives wind and waves unless --hs and --tp do
    #[arg(long, default_value_t = 3)]
    state: u8,
    /// Significant wave height of a JONSWAP sea, metres
    #[arg(long, requires = "tp")]
    hs: Option<f64>,
    /// Peak period of a JONSWAP sea, seconds
    #[arg(long, requires = "hs")]
    tp: Option<f64>,
    /// Peak enhancement of a JONSWAP sea
    #[arg(long, default_value_t = 3.3)]
    gamma: f64,
    /// Where the wind comes from, degrees clockwise from the direction of view
    #[arg(long, default_value_t = 320.0)]
    direction: f64,
    /// Height of the eye, metres
    #[arg(long, default_value_t = 10.0)]
    height: f64,
    /// Length, seconds
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Pictures a second
    #[arg(long, default_value_t = 5.0)]
    fps: f64,
    /// Picture width, pixels
    #[arg(long, default_value_t = 320)]
    width: u32,
    /// Angle across, degrees
    #[arg(long, default_value_t = 45.0)]
    hfov: f64,
    /// Pitch of the camera, degrees above the horizon
    #[arg(long, default_value_t = -7.0, allow_hyphen_values = true)]
    pitch: f64,
    /// Paths a pixel
    #[arg(long, default_value_t = 4)]
    samples: u32,
    /// Which waves
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Name of the light
    #[arg(long, default_value = "overcast")]
    light: String,
    /// Folder of the frames
    #[arg(long, value_name = "DIR", default_value = "target/truth-video")]
    out: PathBuf,
}

fn film(a: &FilmArgs) -> Result<()> {
    let (wind_m_s, by_wind) =
        sea_of_state(a.state).with_context(|| format!("no sea state {}; there are 0 to 12", a.state))?;
    let long_waves = match (a.hs, a.tp) {
        (Some(height_m), Some(period_s)) => LongWaves::Jonswap { height_m, period_s, gamma: a.gamma },
        _ => by_wind,
    };
    let spec = VideoSpec {
        wind_m_s,
        wind_from_deg: a.direction,
        eye_m: a.height,
        seconds: a.seconds,
        fps: a.fps,
        width: a.width,
        hfov_deg: a.hfov,
        pitch_deg: a.pitch,
        samples: a.samples,
        wave_seed: a.seed,
        // What a pixel covers of the water nearest in the picture.
        shortest_m: (4.0 * a.height * a.hfov.to_radians() / f64::from(a.width.max(1))).max(0.1),
        lighting: a.light.clone(),
        sky: grid::lighting(&a.light).with_context(|| format!("no light '{}'", a.light))?,
        long_waves,
    };
    video::make(&spec, &a.out)
}

fn spec_of(a: &CellArgs) -> Result<CellSpec> {
    let mut spec = grid::cell(a.range, a.state, a.eye, &a.light, a.heading)
        .with_context(|| format!("no sea state {} or light '{}'", a.state, a.light))?;
    spec.time_s = a.time;
    spec.wave_seed = a.waves;
    spec.samples = a.samples.unwrap_or(spec.samples);
    spec.boat = a.boat.clone().unwrap_or(spec.boat);
    Ok(spec)
}

fn one(a: &CellArgs) -> Result<()> {
    let spec = spec_of(a)?;
    let folder = a.out.join(grid::name(&spec));
    files::make(&spec, &folder)?;
    println!("{}", folder.display());
    Ok(())
}

impl TruthStudy {
    /// Renders what is asked for.
    pub fn run(&self) -> Result<()> {
        match self {
            Self::Cell(cell) => one(cell),
            Self::Study(cell) => {
                let spec = spec_of(cell)?;
                println!("{}", study::table(&grid::name(&spec), &study::lines(&spec)?));
                Ok(())
            }
            Self::Video(video) => film(video),
            Self::Grid { quick, paths, out } => grid::make(&grid::cells(*quick), *paths, out),
        }
    }
}
