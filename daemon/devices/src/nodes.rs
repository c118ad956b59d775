//! Names of device nodes.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// The nodes in `folder` whose names are `prefix` and a number, by number.
pub(crate) fn numbered(folder: &Path, prefix: &str) -> io::Result<Vec<PathBuf>> {
    let mut nodes = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let number = path
            .file_name()
            .and_then(|name| name.to_str())
            .and_then(|name| name.strip_prefix(prefix))
            .and_then(|number| number.parse::<u32>().ok());
        if let Some(number) = number {
            nodes.push((number, path));
        }
    }
    nodes.sort();
    Ok(nodes.into_iter().map(|(_, path)| path).collect())
}

/// The link in `links` (a folder such as `/dev/serial/by-id`) that leads to `node`: a name that survives replugging.
pub(crate) fn link_to(links: &Path, node: &Path) -> Option<PathBuf> {
    let node = fs::canonicalize(node).ok()?;
    let mut found: Vec<_> = fs::read_dir(links)
        .ok()?
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|link| fs::canonicalize(link).is_ok_and(|target| target == node))
        .collect();
    found.sort();
    found.into_iter().next()
}

/// Names for an error message: "`/dev/video0`, `/dev/video2`" or "none".
pub(crate) fn listed(names: impl IntoIterator<Item = String>) -> String {
    let names: Vec<_> = names.into_iter().collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn nodes_come_in_the_order_of_their_numbers() {
        let dev = tempfile::tempdir().expect("temporary folder");
        for name in ["video10", "video2", "videodev", "vbi0", "video"] {
            fs::write(dev.path().join(name), []).expect("file");
        }
        let nodes = numbered(dev.path(), "video").expect("readable");
        assert_eq!(nodes, [dev.path().join("video2"), dev.path().join("video10")]);
    }

    #[test]
    fn a_node_is_found_by_its_lasting_name() {
        let dev = tempfile::tempdir().expect("temporary folder");
        let (node, links) = (dev.path().join("video2"), dev.path().join("by-id"));
        fs::write(&node, []).expect("file");
        assert_eq!(link_to(&links, &node), None, "no such folder");
        fs::create_dir(&links).expect("folder");
        symlink("../video2", links.join("usb-Sea_Cam-index0")).expect("link");
        symlink("../video9", links.join("usb-Gone-index0")).expect("link");
        assert_eq!(link_to(&links, &node), Some(links.join("usb-Sea_Cam-index0")));
    }
}
