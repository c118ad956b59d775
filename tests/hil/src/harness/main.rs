//! `hil`: the gun computer's image in a virtual machine whose kernel emulates its hardware, and every fault of the field.

mod bench;
mod cpio;
mod cuts;
mod faults;
mod guest;
mod lcd;
mod machine;
mod measure;
mod qmp;
mod report;
mod run;
mod unit;

use std::{path::PathBuf, process::ExitCode, thread, time::Duration};

use anyhow::{Context, Result};
use bowwave_hil::protocol::AgentCommand;
use clap::{Args, Parser};

use crate::bench::{HilBench, Shop};

/// Hardware in the loop: see tests/hil/README.md.
#[derive(Parser)]
enum HilCli {
    /// Boots the image, plays a recording in, injects every fault, writes the table
    Run {
        /// What to test
        #[command(flatten)]
        what: BenchInputs,
        /// Only the rows of these numbers
        #[arg(long, value_delimiter = ',', value_name = "N,N,...")]
        only: Vec<String>,
    },
    /// Cuts the power at random moments of shooting, starts again, checks the journal of hits; goes on with the table there is
    Cuts {
        /// What to test
        #[command(flatten)]
        what: BenchInputs,
        /// How many cuts
        count: u32,
        /// Seed of the moments
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Boots the image and executes lines: shell, `! REQUEST` for the agent, `sleep S`, `lcd`, `journal`, `play`
    Boot {
        /// What to test
        #[command(flatten)]
        what: BenchInputs,
        /// Lines
        lines: Vec<String>,
    },
}

#[derive(Args)]
struct BenchInputs {
    /// Folder that systemd/image/build left
    #[arg(long, default_value = "target/image", value_name = "DIR")]
    image: PathBuf,
    /// Folder that tests/hil/modules/build left
    #[arg(long, default_value = "target/hil/modules", value_name = "DIR")]
    modules: PathBuf,
    /// Folder for what this leaves
    #[arg(long, default_value = "target/hil", value_name = "DIR")]
    out: PathBuf,
}

impl BenchInputs {
    fn shop(&self) -> Result<Shop> {
        Shop::open(&self.image, &self.modules, &self.out)
    }
}

fn main() -> ExitCode {
    let passed = match HilCli::parse() {
        HilCli::Run { what, only } => what.shop().and_then(|shop| run::run(&shop, &only)),
        HilCli::Cuts { what, count, seed } => {
            what.shop().and_then(|mut shop| cuts::run(&mut shop, count, seed))
        }
        HilCli::Boot { what, lines } => what.shop().and_then(|shop| boot(&shop, &lines)),
    };
    match passed {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(e) => {
            eprintln!("hil: {e:#}");
            ExitCode::from(2)
        }
    }
}

fn boot(shop: &Shop, lines: &[String]) -> Result<bool> {
    let data = shop.fresh_data("boot-data.img")?;
    let mut bench = HilBench::switch_on(shop, &data, "utc")?;
    println!("agent after {:.1} s", bench.machine.power_on.elapsed().as_secs_f64());
    for line in lines {
        println!("\n$ {line}");
        if let Err(e) = execute(&mut bench, line) {
            println!("{e:#}");
        }
    }
    println!(
        "clocks known to {:.1} ms; {} bytes of the unit lost; its line is at {} baud; {:?}",
        bench.machine.guest.clock_uncertainty_ms(),
        bench.machine.unit.lost(),
        bench.machine.unit.line_baud(),
        bench.machine.guest.failures()
    );
    bench.machine.guest.run(&["/bin/systemctl", "--no-block", "poweroff"])?;
    bench.machine.off(Duration::from_secs(60))?;
    Ok(true)
}

fn execute(bench: &mut HilBench, line: &str) -> Result<()> {
    let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
    match word {
        "sleep" => thread::sleep(Duration::from_secs_f64(rest.parse().context("seconds")?)),
        "play" => {
            bench.pull(1, true)?;
            bench.play()?;
        }
        "identical" => println!("{:?}", bench.identical(20)?),
        "lcd" => {
            println!(
                "{:.1} s {:?}",
                bench.machine.power_on.elapsed().as_secs_f64(),
                bench.machine.lcd.last()
            );
            bench.keep_picture(if rest.is_empty() { "boot" } else { rest });
        }
        "journal" => {
            for entry in bench.machine.guest.journal_since(0) {
                println!("{:9.3} {}", entry.at_ns as f64 * 1e-9, entry.text());
            }
        }
        "!" => {
            let command: AgentCommand = serde_json::from_str(rest)?;
            println!("{}", bench.machine.guest.call_within(command, Duration::from_secs(90))?);
        }
        _ => {
            let (code, out, err) =
                bench.machine.guest.run_any(&["/bin/sh", "-c", line], Duration::from_secs(90))?;
            println!("[{code}] {out}{err}");
        }
    }
    Ok(())
}
