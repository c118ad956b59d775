//! Folders of files that must outlive a power cut.

use std::{fs::File, io, path::Path};

/// The folder of `path`; the present one for a bare name.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Puts the names in the folder of `path` onto the disk: a synced file without a name is lost with the power.
///
/// # Errors
/// Those of opening and of syncing the folder.
pub fn sync_folder(path: &Path) -> io::Result<()> {
    File::open(folder_of(path))?.sync_all()
}
