//! A second initial file system, appended to the image's own: what the machine gets without a change to the image.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, ensure};

/// An archive in the kernel's "newc" format, uncompressed.
pub struct Archive {
    bytes: Vec<u8>,
    inode: u32,
}

impl Archive {
    /// Nothing in it.
    pub const fn new() -> Self {
        Self { bytes: Vec::new(), inode: 1 }
    }

    fn entry(&mut self, name: &str, mode: u32, content: &[u8]) {
        let number = |value: usize| format!("{value:08x}");
        let fields =
            [self.inode as usize, mode as usize, 0, 0, 1, 0, content.len(), 0, 0, 0, 0, name.len() + 1, 0];
        self.inode += 1;
        self.bytes.extend_from_slice(b"070701");
        fields.iter().for_each(|f| self.bytes.extend(number(*f).bytes()));
        self.bytes.extend_from_slice(name.as_bytes());
        self.bytes.push(0);
        self.pad();
        self.bytes.extend_from_slice(content);
        self.pad();
    }

    fn pad(&mut self) {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
    }

    /// A folder; those above it must be there.
    pub fn folder(&mut self, name: &str) {
        self.entry(name, 0o040_755, &[]);
    }

    /// A file.
    pub fn file(&mut self, name: &str, mode: u32, content: &[u8]) {
        self.entry(name, 0o100_000 | mode, content);
    }

    /// A symbolic link.
    pub fn link(&mut self, name: &str, target: &str) {
        self.entry(name, 0o120_777, target.as_bytes());
    }

    /// Writes `first`, the image's archive, and then this one.
    pub fn append_to(mut self, first: &Path, out: &Path) -> Result<()> {
        self.entry("TRAILER!!!", 0, &[]);
        let mut all = fs::read(first).with_context(|| first.display().to_string())?;
        all.resize(all.len().next_multiple_of(4), 0);
        all.extend(self.bytes);
        let mut file = fs::File::create(out).with_context(|| out.display().to_string())?;
        file.write_all(&all).with_context(|| out.display().to_string())
    }
}

/// A program without what only debuggers need.
pub fn stripped(program: &Path, folder: &Path) -> Result<Vec<u8>> {
    let out: PathBuf = folder.join("stripped");
    let done = Command::new("strip").arg("-o").arg(&out).arg(program).status().context("strip")?;
    ensure!(done.success(), "strip failed on {}", program.display());
    fs::read(&out).context("the stripped program")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_aligned_and_found() {
        let folder = tempfile::tempdir().unwrap();
        let first = folder.path().join("first");
        fs::write(&first, b"abcde").unwrap();
        let mut archive = Archive::new();
        archive.folder("hil");
        archive.file("hil/a", 0o755, b"content");
        archive.link("hil/b", "a");
        let out = folder.path().join("out");
        archive.append_to(&first, &out).unwrap();
        let bytes = fs::read(out).unwrap();
        assert_eq!(&bytes[..14], b"abcde\x00\x00\x00070701");
        assert_eq!(bytes.len() % 4, 0);
        let listed = std::process::Command::new("cpio").arg("--version").output();
        if listed.is_ok_and(|l| l.status.success()) {
            let path = folder.path().join("archive");
            fs::write(&path, &bytes[8..]).unwrap();
            let out =
                Command::new("cpio").arg("-itv").stdin(fs::File::open(&path).unwrap()).output().unwrap();
            let names = String::from_utf8(out.stdout).unwrap();
            assert!(names.contains("hil/b -> a") && names.contains("-rwxr-xr-x"), "{names}");
        }
    }
}
