//! What a command answers, on standard output.

use std::io::{ErrorKind, Write as _};

use anyhow::{Context, Result};
use serde::Serialize;

/// Prints `text` as it is.
pub fn print(text: impl AsRef<[u8]>) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_ref()).and_then(|()| out.flush()) {
        // A pager that was closed has seen enough.
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(e).context("cannot write to standard output"),
        _ => Ok(()),
    }
}

/// Prints a value as JSON.
pub fn print_json(value: &(impl Serialize + ?Sized)) -> Result<()> {
    let text = serde_json::to_string_pretty(value).context("cannot put the answer into JSON")?;
    print(text + "\n")
}
