//! Acknowledgements of committed rounds on standard output, for tests that cut the power.

use std::io::Write;

use anyhow::{Context, Result};

/// Prints "committed N" for each number, whole lines.
pub fn print(numbers: impl Iterator<Item = u64>) -> Result<()> {
    let mut out = std::io::stdout().lock();
    for shot in numbers {
        writeln!(out, "committed {shot}").context("cannot write to standard output")?;
    }
    out.flush().context("cannot write to standard output")
}
