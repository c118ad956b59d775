//! Where the built-in recording is kept.

use std::{
    env,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use hw_sim::make::{self, Recipe};
use indicatif::{ProgressBar, ProgressStyle};
use sha2::{Digest, Sha256};

/// The folder for what can be made again: the service's, the user's, or what `BOWWAVE_CACHE` says.
fn folder() -> Result<PathBuf> {
    let set = |name: &str| env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    if let Some(path) = set("BOWWAVE_CACHE").or_else(|| set("CACHE_DIRECTORY")) {
        return Ok(path);
    }
    if let Some(path) = set("XDG_CACHE_HOME").or_else(|| set("HOME").map(|h| h.join(".cache"))) {
        return Ok(path.join("bowwave"));
    }
    bail!("no folder to keep the built-in recording in: set HOME or BOWWAVE_CACHE")
}

/// Where the built-in recording is, or will be. Its name holds a digest of its recipe and of the maker's revision, so that
/// neither meets an old file.
pub fn default_recording_path() -> Result<PathBuf> {
    let recipe = format!("{} {:?}", make::REVISION, Recipe::default());
    let digest = Sha256::digest(recipe.as_bytes());
    let short: String = digest.iter().take(6).map(|b| format!("{b:02x}")).collect();
    Ok(folder()?.join(format!("built-in-{short}.mcap")))
}

/// The built-in recording, made now where it is not there yet.
pub fn default_recording() -> Result<PathBuf> {
    let path = default_recording_path()?;
    if !path.exists() {
        make_recording(&path)?;
    }
    Ok(path)
}

fn make_recording(path: &Path) -> Result<()> {
    let parent = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(parent).with_context(|| {
        format!("cannot make {}; set BOWWAVE_CACHE to a folder that can be written", parent.display())
    })?;
    let recipe = Recipe::default();
    eprintln!("making the built-in recording (once, under a minute): {}", path.display());
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} frames, {eta} left") {
        bar.set_style(style);
    }
    // Another process may be making it too: each works on a file of its own, and the last rename wins with the same bytes.
    let part = path.with_extension(format!("{}.part", std::process::id()));
    let made = make::make(&recipe, &part, &mut |done, total| {
        bar.set_length(total);
        bar.set_position(done);
    });
    bar.finish_and_clear();
    if let Err(e) = made {
        if let Err(e) = std::fs::remove_file(&part).or_else(|e| match e.kind() {
            std::io::ErrorKind::NotFound => Ok(()),
            _ => Err(e),
        }) {
            log::warn!("cannot remove {}: {e}", part.display());
        }
        return Err(e).with_context(|| format!("cannot make the built-in recording {}", path.display()));
    }
    std::fs::rename(&part, path)
        .with_context(|| format!("cannot put the built-in recording at {}", path.display()))
}
