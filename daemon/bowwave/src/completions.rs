//! `bowwave completions`: what a shell completes of the command line.

use anyhow::Result;
use clap_complete::Shell;

use crate::{command_line, outcome::Outcome, stdout};

/// Prints the completion script of a shell.
pub fn run(shell: Shell) -> Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command_line(), "bowwave", &mut script);
    stdout::print(script)?;
    Ok(Outcome::Done)
}
