//! The cache of what can be made again: the built-in recording, and panoramas of the sea for scenarios that are played.

use std::{
    env,
    fs::File,
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
};

use anyhow::{Context, Result, bail};
use hw_sim::{
    make::{self, Recipe},
    panorama::{self, PanoramaRecipe},
};
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
    bail!("no folder to keep the built-in recording and seas in: set HOME or BOWWAVE_CACHE")
}

/// Panoramas that are kept: the ones that were used last. Each has some hundred megabytes.
const PANORAMAS: usize = 6;

/// A part that nobody has written to for so long is of a process that is gone.
const CUT_OFF: Duration = Duration::from_secs(3600);

/// Where the built-in recording is, or will be. Its name holds a digest of its recipe and of the maker's revision, so that
/// neither meets an old file.
pub fn default_recording_path() -> Result<PathBuf> {
    Ok(folder()?.join(format!("built-in-{}.mcap", digest(make::REVISION, &Recipe::default()))))
}

/// The built-in recording, made now where it is not there yet.
pub fn default_recording() -> Result<PathBuf> {
    let path = default_recording_path()?;
    if !path.exists() {
        let note = "making the built-in recording (once, under a minute)";
        made(&path, note, |part, progress| Ok(make::make(&Recipe::default(), part, progress).map(|_| ())?))?;
    }
    Ok(path)
}

/// The panorama of a recipe, made now where it is not there yet.
pub fn panorama(recipe: &PanoramaRecipe) -> Result<PathBuf> {
    let path = folder()?.join(format!("sea-{}.panorama", digest(panorama::REVISION, recipe)));
    if path.exists() {
        // Its time says when it was used last; where it cannot be set, it is made again some day.
        let touched =
            File::options().append(true).open(&path).and_then(|file| file.set_modified(SystemTime::now()));
        if let Err(e) = touched {
            log::debug!("{}: its time cannot be set: {e}", path.display());
        }
    } else {
        let note = "making the sea of this scenario (once, one to two minutes on two processors)";
        made(&path, note, |part, progress| Ok(panorama::make(recipe, part, progress)?))?;
        forget_old_panoramas(&path);
    }
    Ok(path)
}

/// The name of what a recipe makes, with the revision of its maker.
fn digest(revision: u32, recipe: &impl std::fmt::Debug) -> String {
    let digest = Sha256::digest(format!("{revision} {recipe:?}"));
    digest.iter().take(6).map(|b| format!("{b:02x}")).collect()
}

/// Removes panoramas but the ones that were used last, and what was left of ones whose making was cut off.
fn forget_old_panoramas(newest: &Path) {
    let Some(entries) = newest.parent().and_then(|folder| folder.read_dir().ok()) else { return };
    let entries: Vec<std::fs::DirEntry> = entries.flatten().collect();
    let is_left = |path: &Path| {
        let age = path.metadata().ok().and_then(|m| m.modified().ok()).and_then(|time| time.elapsed().ok());
        path.extension().is_some_and(|e| e == "part") && age.is_some_and(|age| age > CUT_OFF)
    };
    for path in entries.iter().map(std::fs::DirEntry::path).filter(|path| is_left(path)) {
        remove(&path, "its making was cut off");
    }
    let mut old: Vec<(SystemTime, PathBuf)> = entries
        .iter()
        .map(std::fs::DirEntry::path)
        .filter(|path| path.extension().is_some_and(|e| e == "panorama") && path != newest)
        .filter_map(|path| Some((path.metadata().ok()?.modified().ok()?, path)))
        .collect();
    old.sort();
    old.reverse();
    for (_, path) in old.iter().skip(PANORAMAS - 1) {
        remove(path, "it was not used for long");
    }
}

fn remove(path: &Path, why: &str) {
    match std::fs::remove_file(path) {
        Ok(()) => log::info!("{} is removed: {why}", path.display()),
        Err(e) => log::warn!("cannot remove {}: {e}", path.display()),
    }
}

/// Makes a file at `path`, with its progress shown.
fn made(
    path: &Path,
    note: &str,
    make: impl FnOnce(&Path, &mut dyn FnMut(u64, u64)) -> Result<()>,
) -> Result<()> {
    let parent = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(parent).with_context(|| {
        format!("cannot make {}; set BOWWAVE_CACHE to a folder that can be written", parent.display())
    })?;
    eprintln!("{note}: {}", path.display());
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} frames, {eta} left") {
        bar.set_style(style);
    }
    // Another process may be making it too: each works on a file of its own, and the last rename wins with the same bytes.
    let part = path.with_extension(format!("{}.part", std::process::id()));
    let result = make(&part, &mut |done, total| {
        bar.set_length(total);
        bar.set_position(done);
    });
    bar.finish_and_clear();
    if let Err(e) = result {
        if let Err(e) = std::fs::remove_file(&part).or_else(|e| match e.kind() {
            std::io::ErrorKind::NotFound => Ok(()),
            _ => Err(e),
        }) {
            log::warn!("cannot remove {}: {e}", part.display());
        }
        return Err(e).with_context(|| format!("cannot make {}", path.display()));
    }
    std::fs::rename(&part, path).with_context(|| format!("cannot put {} in its place", path.display()))
}
