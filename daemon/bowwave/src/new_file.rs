//! Files that a command makes for somebody: not over others, and with an error that says what to do.

use std::path::Path;

use anyhow::{Context, Result, bail};

/// Refuses a path at which something is, unless it may be replaced.
pub fn refuse_to_replace(path: &Path, force: bool) -> Result<()> {
    if path.exists() && !force {
        bail!("{} is there already; name another file, or add --force to replace it", path.display());
    }
    Ok(())
}

/// Writes a text to a path that was not refused.
pub fn write_new(path: &Path, text: &str) -> Result<()> {
    std::fs::write(path, text)
        .with_context(|| format!("cannot write {}; check the folder and its permissions", path.display()))
}
