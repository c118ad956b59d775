//! Addresses by which a page finds files near it.

use std::path::{Component, Path};

/// Address of the file at `to`, as seen from a page at `from`; `None` where a path cannot be followed.
pub fn address(from: &Path, to: &Path) -> Option<String> {
    let folder = match from.parent() {
        Some(parent) if parent != Path::new("") => parent.canonicalize().ok()?,
        _ => Path::new(".").canonicalize().ok()?,
    };
    let to = to.canonicalize().ok()?;
    let common = folder.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(common).map(|_| "..".to_owned());
    let down = to.components().skip(common).map(|part| match part {
        Component::Normal(name) => Some(escaped(name.to_str()?)),
        _ => None,
    });
    let parts: Option<Vec<String>> = up.map(Some).chain(down).collect();
    Some(parts?.join("/"))
}

/// Address of a file on this computer.
pub fn file_url(path: &Path) -> Option<String> {
    let parts: Option<Vec<String>> = path
        .components()
        .filter(|part| *part != Component::RootDir)
        .map(|part| part.as_os_str().to_str().map(escaped))
        .collect();
    Some(format!("file:///{}", parts?.join("/")))
}

/// Tests whether two paths lead to one file.
pub fn same_file(one: &Path, other: &Path) -> bool {
    one == other || matches!((one.canonicalize(), other.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// A name as part of an address: bytes that mean something there, or that are no ASCII, as %XX.
fn escaped(name: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
    name.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_finds_files_beside_it_and_elsewhere() {
        let folder = tempfile::tempdir().expect("a folder");
        let [one, two] = ["one", "a #2"].map(|name| folder.path().join(name));
        for run in [&one, &two] {
            std::fs::create_dir(run).expect("made");
            std::fs::write(run.join("video.mp4"), "x").expect("written");
        }
        let page = one.join("review-1.html");
        assert_eq!(address(&page, &one.join("video.mp4")).as_deref(), Some("video.mp4"));
        assert_eq!(address(&page, &two.join("video.mp4")).as_deref(), Some("../a%20%232/video.mp4"));
        assert_eq!(address(&page, &two.join("none.mp4")), None);
        assert_eq!(file_url(Path::new("/a #2/b.html")).as_deref(), Some("file:///a%20%232/b.html"));
    }
}
