//! The configuration: any text.

use std::path::Path;

use bowwave::config::parse;

const ORIGIN: &str = "bowwave.toml";

/// A configuration is refused with its place, or its sizes are some.
pub fn run(input: &[u8]) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    match super::memory::within(memory_bytes(text.len()), || parse(text, ORIGIN, Path::new("/etc/bowwave"))) {
        Err(error) => super::place::check(&error.to_string(), ORIGIN, text),
        Ok(config) => {
            if let Some((width, height)) = config.size {
                assert!((1..=8192).contains(&width) && (1..=8192).contains(&height), "{width}x{height}");
            }
        }
    }
}

/// The document as a tree of values with their places.
const fn memory_bytes(text_bytes: usize) -> usize {
    (256 << 10) + 512 * text_bytes
}
