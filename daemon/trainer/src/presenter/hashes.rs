//! Which pictures were shown, as hashes: a picture taken of the LCD from outside can be found among them.

use std::{
    fs::File,
    io::{Seek, Write},
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};
use sha2::{Digest, Sha256};

/// Lines kept: a ring of ten seconds.
const LINES: u64 = 300;
/// Bytes of a line: frame number, space, hash, new line.
const LINE: u64 = 12 + 1 + 64 + 1;

/// The file.
#[derive(Debug)]
pub struct HashLog {
    path: PathBuf,
    file: File,
    written: u64,
    rgb: Vec<u8>,
}

impl HashLog {
    /// Begins the file anew.
    pub fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).with_context(|| {
            format!("cannot write the frames' hashes to {}; is its folder there?", path.display())
        })?;
        Ok(Self { path: path.into(), file, written: 0, rgb: Vec::new() })
    }

    /// Takes in a frame of RGBA bytes.
    pub fn frame(&mut self, number: u64, rgba: &[u8]) -> Result<()> {
        self.rgb.clear();
        self.rgb.extend(rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]));
        let hash = Sha256::digest(&self.rgb);
        let mut line = format!("{number:>12} ");
        hash.iter().for_each(|b| line.push_str(&format!("{b:02x}")));
        line.push('\n');
        let at = self.written % LINES * LINE;
        self.written += 1;
        self.file
            .seek(std::io::SeekFrom::Start(at))
            .and_then(|_| self.file.write_all(line.as_bytes()))
            .with_context(|| format!("cannot write to {}; check the disk", self.path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_frames_are_kept_in_a_ring() {
        let path = std::env::temp_dir().join(format!("bowwave-hashes-{}", std::process::id()));
        let mut log = HashLog::create(&path).unwrap();
        for n in 0..LINES + 2 {
            log.frame(n, &[n as u8, 1, 2, 255]).unwrap();
        }
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        let numbers: Vec<u64> =
            text.lines().map(|l| l.split_whitespace().next().unwrap().parse().unwrap()).collect();
        assert_eq!((numbers.len(), numbers[0], numbers[1], numbers[2]), (300, 300, 301, 2));
        let hash: String = Sha256::digest([2, 1, 2]).iter().map(|b| format!("{b:02x}")).collect();
        assert_eq!(text.lines().nth(2).unwrap().split_whitespace().nth(1), Some(hash.as_str()));
    }
}
