//! Leftovers of an earlier run in an output folder, so that the files of two runs are not mixed.

use std::path::Path;

use anyhow::{Context, Result};

/// A run's recording.
pub const RECORDING: &str = "recording.mcap";

/// Removes pictures, video and summary of an earlier run from `folder`. Nothing recorded goes: the journal goes on with a run of its own, and
/// a recording stays, which is told where this run does not write one of its own.
///
/// # Errors
/// A file that cannot be removed: the runs would be mixed.
pub fn clear(folder: &Path, records: bool) -> Result<()> {
    let what = || format!("cannot look for what an earlier run left in {}", folder.display());
    let mut removed = 0;
    for entry in folder.read_dir().with_context(what)? {
        let entry = entry.with_context(what)?;
        let is_file = entry.file_type().with_context(what)?.is_file();
        if is_file && entry.file_name().to_str().is_some_and(is_shown) {
            let path = entry.path();
            std::fs::remove_file(&path).with_context(|| {
                format!("cannot remove {} of an earlier run; name another folder with --out", path.display())
            })?;
            removed += 1;
        }
    }
    if removed > 0 {
        log::info!("{removed} files of an earlier run are removed from {}", folder.display());
    }
    if !records && folder.join(RECORDING).exists() {
        log::warn!(
            "{} is of an earlier run: this one keeps no recording (--record)",
            folder.join(RECORDING).display()
        );
    }
    Ok(())
}

/// Names of the files that every run makes anew: stills, contact sheet, video, summary.
fn is_shown(name: &str) -> bool {
    let still = name.strip_prefix("frame-").and_then(|rest| rest.strip_suffix(".png"));
    let is_still = still.is_some_and(|n| n.len() >= 5 && n.bytes().all(|b| b.is_ascii_digit()));
    is_still || ["contact-sheet.png", "video.mp4", "summary.json"].contains(&name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_shows_a_run_goes() {
        let folder = tempfile::tempdir().expect("a folder");
        let mine = ["frame-00012.png", "frame-123456.png", "contact-sheet.png", "video.mp4", "summary.json"];
        let kept =
            ["hits.sqlite", RECORDING, "frame-1.png", "frame-00012.png.bak", "frame-0001x.png", "notes.txt"];
        for name in mine.iter().chain(&kept) {
            std::fs::write(folder.path().join(name), "x").expect("written");
        }
        std::fs::create_dir(folder.path().join("frame-00099.png")).expect("a folder");
        clear(folder.path(), true).expect("cleared");
        let mut left: Vec<String> = folder
            .path()
            .read_dir()
            .expect("read")
            .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
            .collect();
        left.sort();
        let mut wanted: Vec<String> = kept.iter().map(|name| (*name).to_owned()).collect();
        wanted.push("frame-00099.png".to_owned());
        wanted.sort();
        assert_eq!(left, wanted);
    }
}
