//! History of a calibration file: copies of those that were replaced, and how one is put back.
//!
//! Beside `calibration.toml` lies the folder `calibration.toml.kept` with a copy of every file that was replaced, numbered in the order in
//! which that happened, and with the day on which it had been made: `0007-2026-11-20.toml`. Copies are whole bytes, also of a file that
//! can no longer be read. A file is copied, synced and named before the new one takes its place, which is renamed over it: a power cut at
//! any moment leaves the old file or the new one, and the copy. Of copies beyond the newest [`KEPT_MOST`] the oldest goes, after the new
//! one is safe.

use std::{
    fs::{self, File},
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use bowwave_core::text::toml::TEXT_BYTES_MAX;

use crate::{CalibrationError, CalibrationFile, Date, parse};

/// So many copies are kept: a calibration every day for three months.
pub const KEPT_MOST: usize = 100;

/// A file that was replaced.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredCopy {
    /// Counts on from 1.
    pub number: u32,
    /// The copy.
    pub path: PathBuf,
    /// The day on which the file had been made; `None` where it could not be read.
    pub made: Option<Date>,
}

/// The folder beside `path` that copies are kept in.
pub fn folder(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".kept");
    PathBuf::from(name)
}

/// The copies kept of the file at `path`, oldest first; what else lies in the folder is none.
///
/// # Errors
/// Where there is such a folder and it cannot be read.
pub fn copies(path: &Path) -> Result<Vec<StoredCopy>, CalibrationError> {
    list(&folder(path)).map_err(|source| CalibrationError::Read { path: folder(path), source })
}

/// Puts a kept file back: that of the number, or without one the newest that differs from what stands there now. What stands there now is
/// kept first, so that restoring can be undone by restoring. `None` where there is nothing to put back.
///
/// # Errors
/// Where the copy is not there, is no calibration, or the file cannot be written.
pub fn restore(path: &Path, number: Option<u32>) -> Result<Option<StoredCopy>, CalibrationError> {
    let all = copies(path)?;
    let read = |kept: &StoredCopy| {
        bytes_of(&kept.path).map_err(|source| CalibrationError::Read { path: kept.path.clone(), source })
    };
    let (chosen, bytes) = match number {
        Some(number) => {
            let Some(kept) = all.into_iter().find(|k| k.number == number) else {
                return Err(CalibrationError::NotKept { path: path.to_owned(), number });
            };
            let bytes = read(&kept)?;
            (kept, bytes)
        }
        None => {
            let present = bytes_of(path).ok();
            let mut found = None;
            for kept in all.into_iter().rev() {
                let bytes = read(&kept)?;
                // What cannot be read any more is not put back unasked.
                if Some(&bytes) != present.as_ref() && is_calibration(&bytes, &kept.path).is_ok() {
                    found = Some((kept, bytes));
                    break;
                }
            }
            match found {
                Some(found) => found,
                None => return Ok(None),
            }
        }
    };
    is_calibration(&bytes, &chosen.path)?;
    replace(path, &bytes).map_err(|source| CalibrationError::Write { path: path.to_owned(), source })?;
    Ok(Some(chosen))
}

/// Bytes of a calibration file, good or not.
fn bytes_of(path: &Path) -> io::Result<Vec<u8>> {
    bowwave_files::plain_bytes(path, TEXT_BYTES_MAX)
}

fn is_calibration(bytes: &[u8], path: &Path) -> Result<CalibrationFile, CalibrationError> {
    parse(&String::from_utf8_lossy(bytes), &path.display().to_string())
}

/// Puts `bytes` in the place of the file at `path`, which is kept.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let beside = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    match bytes_of(path) {
        // The same once more is no change, and would push out what was.
        Ok(former) if former == bytes => return Ok(()),
        Ok(former) => store(path, beside, &former)?,
        Err(e) if e.kind() == io::ErrorKind::NotFound => {}
        Err(e) => return Err(e),
    }
    whole(beside, bytes)?.persist(path).map_err(|e| e.error)?;
    sync(beside)
}

/// Copies what stands at `path`.
fn store(path: &Path, beside: &Path, former: &[u8]) -> io::Result<()> {
    let into = folder(path);
    match fs::create_dir(&into) {
        Ok(()) => sync(beside)?,
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
        Err(e) => return Err(e),
    }
    let all = list(&into)?;
    // A power cut may have come between a copy and the file that was to follow it.
    if all.last().is_some_and(|k| bytes_of(&k.path).is_ok_and(|bytes| bytes == former)) {
        return Ok(());
    }
    let made = is_calibration(former, path).map_or_else(|_| UNREADABLE.to_owned(), |f| f.made.to_string());
    let mut number = all.last().map_or(1, |k| k.number.saturating_add(1));
    let mut copy = whole(&into, former)?;
    loop {
        match copy.persist_noclobber(into.join(format!("{number:04}-{made}.toml"))) {
            Ok(_) => break,
            // Somebody else calibrates at the same time.
            Err(e) if e.error.kind() == io::ErrorKind::AlreadyExists && number < u32::MAX => {
                copy = e.file;
                number += 1;
            }
            Err(e) => return Err(e.error),
        }
    }
    sync(&into)?;
    for old in all.iter().take((all.len() + 1).saturating_sub(KEPT_MOST)) {
        fs::remove_file(&old.path)?;
    }
    Ok(())
}

/// In place of the day in the name of a copy that is no calibration.
const UNREADABLE: &str = "unreadable";

fn list(folder: &Path) -> io::Result<Vec<StoredCopy>> {
    let entries = match fs::read_dir(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut all = Vec::new();
    for entry in entries {
        let path = entry?.path();
        all.extend(named(&path).map(|(number, made)| StoredCopy { number, path, made }));
    }
    all.sort_by_key(|k| k.number);
    Ok(all)
}

/// Number and day of a copy by its name.
fn named(path: &Path) -> Option<(u32, Option<Date>)> {
    let (number, made) = path.file_name()?.to_str()?.strip_suffix(".toml")?.split_once('-')?;
    let number = number.parse().ok()?;
    if made == UNREADABLE {
        return Some((number, None));
    }
    let mut parts = made.split('-');
    let (year, month, day) = (parts.next()?, parts.next()?, parts.next()?);
    let date = Date::new(year.parse().ok()?, month.parse().ok()?, day.parse().ok()?)?;
    parts.next().is_none().then_some((number, Some(date)))
}

/// A synced file in `folder` that has no name yet.
fn whole(folder: &Path, bytes: &[u8]) -> io::Result<tempfile::NamedTempFile> {
    let mut temporary =
        tempfile::Builder::new().prefix(".calibration-").suffix(".tmp").tempfile_in(folder)?;
    temporary.write_all(bytes)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // Temporary files are private to their maker; the daemon's user must be able to read the result.
        temporary.as_file().set_permissions(fs::Permissions::from_mode(0o644))?;
    }
    temporary.as_file().sync_all()?;
    Ok(temporary)
}

/// A name lies in its folder, which has its own place in the disk's cache.
fn sync(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const EXAMPLE: &str = include_str!("../../examples/mount.toml");

    /// The example with another offset.
    fn text(offset: u32) -> String {
        EXAMPLE.replacen("offset_ms = -3.2", &format!("offset_ms = {offset}.0"), 1)
    }

    fn put(path: &Path, offset: u32) {
        replace(path, text(offset).as_bytes()).unwrap();
    }

    #[test]
    fn every_replaced_file_is_kept_whole_and_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("calibration.toml");
        assert_eq!(restore(&path, None).unwrap(), None);
        (0..4).for_each(|i| put(&path, i));
        put(&path, 3);
        let all = copies(&path).unwrap();
        assert_eq!(all.iter().map(|k| k.number).collect::<Vec<_>>(), [1, 2, 3]);
        for (kept, offset) in all.iter().zip(0..) {
            assert_eq!(fs::read_to_string(&kept.path).unwrap(), text(offset));
            assert_eq!(kept.made, Date::new(2026, 11, 20));
        }
        // The newest, and back again.
        assert_eq!(restore(&path, None).unwrap().unwrap().number, 3);
        assert_eq!(fs::read_to_string(&path).unwrap(), text(2));
        assert_eq!(restore(&path, None).unwrap().unwrap().number, 4);
        assert_eq!(fs::read_to_string(&path).unwrap(), text(3));
        assert_eq!(restore(&path, Some(1)).unwrap().unwrap().number, 1);
        assert_eq!(fs::read_to_string(&path).unwrap(), text(0));
        let refused = restore(&path, Some(77)).unwrap_err().to_string();
        assert!(refused.contains("77"), "{refused}");
        let left: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
        assert_eq!(left.len(), 2, "temporary files stay behind");
    }

    #[test]
    fn what_is_no_calibration_is_kept_but_not_put_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("calibration.toml");
        put(&path, 1);
        fs::write(&path, b"half a fi\xff").unwrap();
        put(&path, 2);
        let all = copies(&path).unwrap();
        assert_eq!((all.len(), all[0].made), (1, None));
        assert_eq!(fs::read(&all[0].path).unwrap(), b"half a fi\xff");
        assert_eq!(restore(&path, None).unwrap(), None);
        assert!(restore(&path, Some(1)).is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), text(2));
    }

    #[test]
    fn of_too_many_the_oldest_go() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("calibration.toml");
        let all = KEPT_MOST as u32 + 5;
        (0..all).for_each(|i| put(&path, i));
        let left = copies(&path).unwrap();
        assert_eq!(left.len(), KEPT_MOST);
        assert_eq!(left.last().unwrap().number, all - 1);
        assert_eq!(fs::read_to_string(&left.last().unwrap().path).unwrap(), text(all - 2));
    }

    proptest! {
        #[test]
        fn a_name_says_what_it_was_made_of(number: u32, days in 0i64..1_000_000, other in "\\PC{0,24}") {
            let date = Date::from_unix_seconds(days * 86_400).unwrap();
            let name = format!("{number:04}-{date}.toml");
            prop_assert_eq!(named(Path::new(&name)), Some((number, Some(date))));
            prop_assert_eq!(named(Path::new(&format!("{name}{other}x"))), None);
        }
    }
}
