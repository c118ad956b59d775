//! `bowwave licences`: the licences of what the program holds of others.

use std::{
    env, fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};

use crate::{outcome::Outcome, stdout};

/// Name of the file, which `systemd/parts` makes.
pub const FILE: &str = "third-party-licences.txt";

/// Prints the file that was installed or built with this program.
pub fn run() -> Result<Outcome> {
    let program = env::current_exe().context("cannot find this program's own place")?;
    let path = documents_of(&program).join(FILE);
    let text = fs::read(&path).with_context(|| {
        format!(
            "cannot read {}; the package installs it, and in the sources `cargo run --release -p bowwave-package` makes it",
            path.display()
        )
    })?;
    stdout::print(text)?;
    Ok(Outcome::Done)
}

/// The program's documents: /usr/share/doc/bowwave for /usr/bin/bowwave, target/share/doc/bowwave for target/release/bowwave.
fn documents_of(program: &Path) -> PathBuf {
    let prefix = program.parent().and_then(Path::parent).unwrap_or(Path::new("/"));
    prefix.join("share/doc/bowwave")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn documents_lie_beside_the_programs_folder() {
        for (program, documents) in [
            ("/usr/bin/bowwave", "/usr/share/doc/bowwave"),
            ("/src/target/release/bowwave", "/src/target/share/doc/bowwave"),
            ("bowwave", "/share/doc/bowwave"),
        ] {
            assert_eq!(documents_of(Path::new(program)), Path::new(documents));
        }
    }
}
