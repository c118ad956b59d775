//! Makes what the package holds beside the program and its settings, from the program's own command line and from cargo's metadata:
//! manual pages, shell completions, third-party licences, and the bill of materials (CycloneDX).
//!
//! `bowwave-package [OUT]` writes below OUT as below `/usr/share`; without OUT below `target/share`, where a built program finds its
//! licences as an installed one does.

#![forbid(unsafe_code)]

mod bill;
mod command_pages;
mod crate_graph;
mod notices;

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};

fn main() -> Result<()> {
    let out = std::env::args_os().nth(1).map_or_else(|| workspace().join("target/share"), PathBuf::from);
    let parts = crate_graph::of_program(&workspace())?;
    let documents = out.join("doc/bowwave");
    write(&documents.join(bowwave::licences::FILE), notices::text(&parts)?)?;
    write(&documents.join("bowwave.cdx.json"), bill::json(&parts)?)?;
    command_pages::write(&out)?;
    println!("{}", out.display());
    Ok(())
}

/// The root of the sources.
fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap_or(Path::new(".")).to_path_buf()
}

/// Writes a file, with the folders that it needs.
fn write(path: &Path, contents: impl AsRef<[u8]>) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(path, contents))
        .with_context(|| format!("cannot write {}", path.display()))
}
