//! Arguments of `scenario`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::parse_duration;

/// Arguments of `scenario`.
#[derive(Debug, Args)]
pub struct ScenarioArgs {
    /// Task of the command
    #[command(subcommand)]
    pub command: ScenarioCommand,
}

/// Task of `scenario`.
#[derive(Debug, Subcommand)]
pub enum ScenarioCommand {
    /// List the built-in scenarios
    List(ScenarioList),
    /// Say what is wrong with scenarios, by line and column
    Check(ScenarioCheck),
    /// Draw where the boats go, and what their crews do when
    Preview(ScenarioPreview),
    /// Write a scenario to start from
    New(ScenarioNew),
    /// Print the JSON schema of scenarios, for editors that complete and check while one types
    Schema,
}

/// Arguments of `scenario list`.
#[derive(Debug, Args)]
pub struct ScenarioList {
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `scenario check`.
#[derive(Debug, Args)]
pub struct ScenarioCheck {
    /// Scenario files (TOML), or names of built-in scenarios
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
}

/// Arguments of `scenario preview`.
#[derive(Debug, Args)]
pub struct ScenarioPreview {
    /// Scenario file (TOML), or the name of a built-in one
    pub scenario: PathBuf,
    /// Picture to write (SVG); without it the scenario's name with .svg
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Seconds to draw; without it the scenario's duration, else 180
    #[arg(long, value_name = "S", value_parser = parse_duration)]
    pub seconds: Option<f64>,
    /// Replace a picture of that name
    #[arg(long)]
    pub force: bool,
}

/// Arguments of `scenario new`.
#[derive(Debug, Args)]
pub struct ScenarioNew {
    /// File to write (TOML)
    pub file: PathBuf,
    /// Begin with this scenario, a file or a built-in one, instead of an example of everything
    #[arg(long, value_name = "SCENARIO")]
    pub from: Option<PathBuf>,
    /// Replace a file of that name
    #[arg(long)]
    pub force: bool,
}
