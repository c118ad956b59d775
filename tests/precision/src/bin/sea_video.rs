//! Sea state from simulated video: errors by class of clip, and what a picture costs.

use std::process::ExitCode;

use clap::Parser;
use precision::sea_video::{clips, score};

/// Shows simulated video to the estimator of the sea's state and lists its errors.
#[derive(Debug, Parser)]
struct Arguments {
    /// First clip of the main series; 0 to 39 served to set the estimator's constants
    #[arg(long, default_value_t = 40)]
    first: u64,
    /// Clips of the main series
    #[arg(long, default_value_t = 40)]
    clips: u64,
    /// Clips of the hard cases
    #[arg(long, default_value_t = 12)]
    hard: u64,
    /// Seconds of each clip
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Only the run time
    #[arg(long)]
    cost: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if !arguments.cost {
        let tell = |_: usize, outcome: &score::Outcome| println!("{}", score::line(outcome));
        let main = (arguments.first..arguments.first + arguments.clips).map(clips::main_clip).collect();
        let main = score::run_all(main, arguments.seconds, tell);
        let hard =
            score::run_all((0..arguments.hard).map(clips::hard_clip).collect(), arguments.seconds, tell);
        println!("\n{}\n{}", score::table(&main), score::table(&hard));
    }
    let cost = score::cost();
    println!(
        "a picture costs {:.0} ns in the mean, {:.0} ns at the 99th percentile, {:.0} ns at worst; {} bytes",
        cost.mean_ns, cost.p99_ns, cost.worst_ns, cost.memory_bytes
    );
    ExitCode::SUCCESS
}
