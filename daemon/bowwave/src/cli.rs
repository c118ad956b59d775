//! The command line.

mod calibrate;
mod desk;
mod instructor;
mod mounting;
mod phantom;
mod review;
mod scenario;

use std::{ffi::OsString, path::PathBuf};

use bowwave_core::{gunner::Skill, time::secs_to_ns};
use clap::{Args, Parser, Subcommand, ValueEnum, builder::PossibleValuesParser};
use clap_complete::Shell;
use hw_sim::fault::{Fault, FaultKind};

pub use calibrate::{Calibrate, CalibrateBoard, CalibrateIntrinsics, CalibrateTask};
pub use desk::{DeskArgs, Play};
pub use instructor::{InstructorArgs, InstructorCommand, TokenCommand};
pub use mounting::{
    CalibrateBoresight, CalibrateCheck, CalibrateExtrinsics, CalibrateRestore, CalibrateTrigger,
    CalibrateWizard, CalibrationFiles, InputArgs, OutputArgs, WizardTask,
};
pub use phantom::{CalibratePhantom, TracedOutline};
pub use review::{ReviewArgs, ReviewFormat};
pub use scenario::{
    ScenarioArgs, ScenarioCheck, ScenarioCommand, ScenarioList, ScenarioNew, ScenarioPreview,
};

/// On-gun augmented-reality trainer for small-boat defence. It trains only: no output leads to a firing circuit.
#[derive(Debug, Parser)]
#[command(name = "bowwave", version, max_term_width = 100)]
pub struct CommandLine {
    /// Log more (-v: info, -vv: debug); RUST_LOG overrides it
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    pub verbose: u8,
    /// The command
    #[command(subcommand)]
    pub command: ProgramCommand,
}

/// Commands of the program.
#[derive(Debug, Subcommand)]
pub enum ProgramCommand {
    /// Run the trainer on this computer's camera, inertial unit, trigger and LCD
    Run(RunArgs),
    /// Run the trainer on a recording, as if its camera, inertial unit and trigger were there
    Simulate(Simulate),
    /// Play a scenario at this computer: a simulated gun on a simulated sea, aimed with the mouse, by a script or by a simulated gunner
    Play(Play),
    /// Step a session through the inputs of its own recording, and say whether the same records and scenes come out
    Replay(ReplayRecording),
    /// Make a recording from a folder of pictures or from a video (with bowwave-lab)
    #[command(disable_help_flag = true)]
    Import(LabArguments),
    /// Compose boats into a photograph (with bowwave-lab)
    #[command(disable_help_flag = true)]
    Compose(LabArguments),
    /// Make the user study of real and generated reflections, or score its answers (with bowwave-lab)
    #[command(disable_help_flag = true)]
    Study(LabArguments),
    /// Write, check and preview scenarios, and list those that are built in
    Scenario(ScenarioArgs),
    /// Print what a scenario needs: passes, shader variants, memory, and why the rest is left out
    Plan(PlanArgs),
    /// Check this computer: GPU, camera, serial lines, trigger lines, disk; each with what to do about it
    Doctor(Doctor),
    /// Print the virtual rounds of a journal
    Hits(Hits),
    /// Print the score of a run: threats, rounds, calls, rules, and why each round missed
    Score(ScoreArgs),
    /// Make a page on which a run is debriefed: chart, a view that is moved, events, score and rounds in step with one time line
    Review(ReviewArgs),
    /// Serve the instructor's page on the local network: live picture, chart, devices; start, pause, boats, calls, score and review
    Instructor(InstructorArgs),
    /// Measure lens, mounting and timing, or print the board for it
    Calibrate(Calibrate),
    /// Print what a shell needs to complete this command line
    Completions(CompletionsArgs),
    /// Print the licences of what this program holds of others
    Licences,
}

/// Where the configuration lies.
const CONFIG: &str = "/etc/bowwave/bowwave.toml";

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// Configuration file (TOML)
    #[arg(long, value_name = "FILE", default_value = CONFIG)]
    pub config: PathBuf,
    /// Folder for hits.sqlite, recordings and the last good settings; without it the configuration's, else the service's
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,
    /// Also keep the SHA-256 of the last frames' red, green and blue bytes, to find a picture of the LCD among them
    #[arg(long, value_name = "FILE")]
    pub frame_hashes: Option<PathBuf>,
    /// Print each committed round's number on standard output as soon as the journal says so
    #[arg(long)]
    pub print_commits: bool,
}

/// Arguments of `replay`.
#[derive(Debug, Args)]
pub struct ReplayRecording {
    /// Recording of a run (MCAP): made with files.record in the configuration, or by `simulate --record`
    pub recording: PathBuf,
    /// Say instead where this other run diverges from it: settings, inputs, scenes, rounds, events
    #[arg(long, value_name = "RECORDING", conflicts_with = "chart")]
    pub against: Option<PathBuf>,
    /// Also draw the run from above: the boats' tracks, their crews' states and where rounds struck (SVG)
    #[arg(long, value_name = "FILE")]
    pub chart: Option<PathBuf>,
    /// Print the result on standard output as JSON
    #[arg(long)]
    pub json: bool,
}

/// Source of the orientation, on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum OrientationArg {
    /// The unit's own where it has one.
    Auto,
    /// Fused here.
    Fused,
}

/// Arguments of `simulate`.
#[derive(Debug, Args)]
pub struct Simulate {
    /// Recording to replay (MCAP); without it the built-in one is made on first use and kept
    pub recording: Option<PathBuf>,
    /// Scenario file (TOML); without it the recording's own, else the built-in one with three boats
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// Calibration file (TOML); without it the recording's own
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
    /// Replay at the recording's own speed, through a pseudo-terminal and bounded queues
    #[arg(long, conflicts_with = "fast")]
    pub realtime: bool,
    /// Replay as fast as it goes, repeatable to the byte (the default)
    #[arg(long)]
    pub fast: bool,
    /// Source of the orientation: the unit's own where it has one (auto), or its rates and specific force fused here and corrected
    /// by the horizon (fused); overrides the configuration's
    #[arg(long, value_name = "SOURCE")]
    pub orientation: Option<OrientationArg>,
    /// Former name of --orientation fused
    #[arg(long, hide = true, conflicts_with = "orientation")]
    pub fuse: bool,
    /// Have a simulated gunner play the scenario instead, without pictures and recording, and print the score
    #[arg(long, value_name = "SKILL", value_parser = PossibleValuesParser::new(Skill::NAMED.map(|(name, _)| name)),
        conflicts_with_all = ["recording", "out", "realtime", "window", "frames", "record", "video", "sheet", "stills", "fault", "fault_every"])]
    pub gunner: Option<String>,
    /// Play it so often, each time with the next seed, and print the spread of the scores
    #[arg(long, value_name = "N", requires = "gunner", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub runs: Option<u64>,
    /// Let the simulated hardware fail: imu-drop-out, imu-freeze, imu-nan, line-garbage, frame-drop-out,
    /// frame-other-size or frame-corrupt, from second S for L seconds
    #[arg(long, value_name = "KIND@S+L", value_parser = parse_fault)]
    pub fault: Vec<Fault>,
    /// Let a fault of a random kind come every S seconds as well, 5 at least; the summary says whether each was ridden out
    #[arg(long, value_name = "S", value_parser = parse_fault_period)]
    pub fault_every: Option<f64>,
    /// Outputs
    #[command(flatten)]
    pub desk: DeskArgs,
}

/// Arguments of a command of the laboratory, which its program `bowwave-lab` reads.
#[derive(Debug, Args)]
pub struct LabArguments {
    /// Handed on as they are; --help lists them
    #[arg(value_name = "ARGUMENTS", trailing_var_arg = true, allow_hyphen_values = true)]
    pub arguments: Vec<OsString>,
}

/// Arguments of `completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    pub shell: Shell,
}

/// Arguments of `plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Scenario file (TOML); without it the built-in one
    pub scenario: Option<PathBuf>,
    /// Screen size in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "1280x720")]
    pub size: (u32, u32),
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `doctor`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Doctor {
    /// One device more closely
    #[command(subcommand)]
    pub device: Option<DoctorDevice>,
    /// Check what this configuration names instead, each device for a moment; the trainer must not run meanwhile
    #[arg(long, value_name = "FILE", conflicts_with_all = ["camera", "imu", "trigger", "gpu"])]
    pub config: Option<PathBuf>,
    /// Camera that must be there, as /dev/video0 or a link in /dev/v4l/by-id
    #[arg(long, value_name = "PATH")]
    pub camera: Option<PathBuf>,
    /// Serial line of the inertial unit that must be there
    #[arg(long, value_name = "PATH")]
    pub imu: Option<PathBuf>,
    /// Trigger line that must be there, as CHIP:LINE
    #[arg(long, value_name = "CHIP:LINE")]
    pub trigger: Option<String>,
    /// Vulkan device that must be there: its number, or part of its name
    #[arg(long, value_name = "NAME")]
    pub gpu: Option<String>,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Devices that `doctor` looks at more closely.
#[derive(Debug, Subcommand)]
pub enum DoctorDevice {
    /// Listen to the inertial unit: its format, its rate, what it sends and lacks; the trainer must not run meanwhile
    Imu(DoctorImu),
    /// Test the inert interlock: the plug is pulled and fitted once, and each contact must follow; the trainer must not run meanwhile
    Interlock(DoctorInterlock),
}

/// Arguments of `doctor interlock`.
#[derive(Debug, Args)]
pub struct DoctorInterlock {
    /// Configuration that names the interlock
    #[arg(long, value_name = "FILE", default_value = "/etc/bowwave/bowwave.toml")]
    pub config: PathBuf,
    /// How long to wait for each step
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=600))]
    pub seconds: u32,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `doctor imu`.
#[derive(Debug, Args)]
pub struct DoctorImu {
    /// Serial line; without it the configuration's, else the first USB adapter on which a unit answers
    #[arg(value_name = "PATH")]
    pub device: Option<PathBuf>,
    /// Take line, rate and format from this configuration
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// How long to listen; all usual rates are tried within 4 s
    #[arg(long, value_name = "SECONDS", default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..=600))]
    pub seconds: u32,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// How rounds are printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum HitsFormat {
    /// Columns for people
    Table,
    /// Comma-separated, a header line first
    Csv,
    /// One JSON array
    Json,
}

/// Arguments of `hits`.
#[derive(Debug, Args)]
pub struct Hits {
    /// Journal (SQLite) or the folder that a run left
    #[arg(default_value = "bowwave-out")]
    pub journal: PathBuf,
    /// How to print
    #[arg(long, value_enum, default_value_t = HitsFormat::Table)]
    pub format: HitsFormat,
    /// Same as --format json
    #[arg(long, conflicts_with = "format")]
    pub json: bool,
    /// Only this run's rounds; without it the newest run's
    #[arg(long, value_name = "N", conflicts_with = "all_runs")]
    pub run: Option<i64>,
    /// Rounds of all runs
    #[arg(long)]
    pub all_runs: bool,
    /// Only rounds that struck
    #[arg(long)]
    pub hits_only: bool,
}

/// Arguments of `score`.
#[derive(Debug, Args)]
pub struct ScoreArgs {
    /// Journal (SQLite) or the folder that a run left
    #[arg(default_value = "bowwave-out")]
    pub run: PathBuf,
    /// This run of the journal; without it the newest
    #[arg(long = "run", value_name = "N")]
    pub number: Option<i64>,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// `imu-freeze@2.5+0.5`.
fn parse_fault(text: &str) -> Result<Fault, String> {
    let kinds = [
        ("imu-drop-out", FaultKind::ImuDropOut),
        ("imu-freeze", FaultKind::ImuFreeze),
        ("imu-nan", FaultKind::ImuNan),
        ("line-garbage", FaultKind::LineGarbage),
        ("frame-drop-out", FaultKind::FrameDropOut),
        ("frame-other-size", FaultKind::FrameOtherSize),
        ("frame-corrupt", FaultKind::FrameCorrupt),
    ];
    let names = || kinds.map(|(name, _)| name).join(", ");
    let usage =
        || format!("'{text}' is no fault: write KIND@S+L, as imu-freeze@2.5+0.5; kinds are {}", names());
    let (kind, span) = text.split_once('@').ok_or_else(usage)?;
    let (from, length) = span.split_once('+').ok_or_else(usage)?;
    let kind = kinds.into_iter().find(|(name, _)| *name == kind).map(|(_, kind)| kind).ok_or_else(usage)?;
    let ns =
        |s: &str| s.parse::<f64>().ok().filter(|v| (0.0..=1e6).contains(v)).map(secs_to_ns).ok_or_else(usage);
    Ok(Fault { kind, from_ns: ns(from)?, for_ns: ns(length)? })
}

/// `1280x720`.
pub fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let usage = || format!("'{text}' is no size: write WIDTHxHEIGHT, each 64 to 4096, as 1280x720");
    let (w, h) = text.split_once(['x', 'X']).ok_or_else(usage)?;
    let number = |s: &str| s.trim().parse::<u32>().ok().filter(|v| (64..=4096).contains(v));
    match (number(w), number(h)) {
        (Some(w), Some(h)) => Ok((w, h)),
        _ => Err(usage()),
    }
}

pub(super) fn parse_duration(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s| *s > 0.0 && *s <= 30.0 * 86_400.0);
    seconds.ok_or_else(|| format!("'{text}' is no duration: write seconds above 0, at most 2592000"))
}

/// Faults need time to come, to be told and to be ridden out.
fn parse_fault_period(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s| (5.0..=86_400.0).contains(s));
    seconds.ok_or_else(|| format!("'{text}' is no pause between faults: write seconds, 5 to 86400"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        CommandLine::command().debug_assert();
    }

    #[test]
    fn faults() {
        let fault = Fault { kind: FaultKind::ImuFreeze, from_ns: 2_500_000_000, for_ns: 500_000_000 };
        assert_eq!(parse_fault("imu-freeze@2.5+0.5"), Ok(fault));
        for bad in
            ["", "imu-freeze", "imu-freeze@1", "nothing@1+1", "imu-nan@-1+1", "imu-nan@1+x", "imu-nan@NaN+1"]
        {
            assert!(parse_fault(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn sizes() {
        assert_eq!(parse_size("1280x720"), Ok((1280, 720)));
        for bad in ["", "1280", "0x0", "-1x5", "1280x", "99999x720", "axb"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }
}
