//! Commands of the laboratory, handed on to its own program, which a gun computer does not have.

use std::{
    env,
    ffi::OsString,
    io::ErrorKind,
    os::unix::process::CommandExt,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Result, anyhow};

use crate::outcome::Outcome;

/// The laboratory's program.
const PROGRAM: &str = "bowwave-lab";

/// Becomes the laboratory's program, which runs `command`. Returns only where it cannot be started.
///
/// # Errors
/// Says how to get the program where it is missing.
pub fn run(command: &str, verbose: u8, arguments: &[OsString]) -> Result<Outcome> {
    let program = beside(env::current_exe().ok().as_deref()).unwrap_or_else(|| PathBuf::from(PROGRAM));
    let error = Command::new(&program)
        // Its usage lines then name the command that was typed.
        .arg0("bowwave")
        .args(vec!["--verbose"; usize::from(verbose)])
        .arg(command)
        .args(arguments)
        .exec();
    Err(match error.kind() {
        ErrorKind::NotFound => anyhow!(
            "this installation has no laboratory commands (compose, import, study), and {PROGRAM} is neither beside bowwave nor in \
             the search path; build both with: cargo build --release"
        ),
        _ => anyhow!(error).context(format!("cannot start {}", program.display())),
    })
}

/// The laboratory's program in the folder of this one.
fn beside(this: Option<&Path>) -> Option<PathBuf> {
    this.map(|path| path.with_file_name(PROGRAM)).filter(|path| path.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_beside_this_one_goes_first() {
        let folder = tempfile::tempdir().unwrap();
        let this = folder.path().join("bowwave");
        assert_eq!(beside(Some(&this)), None);
        let lab = folder.path().join(PROGRAM);
        std::fs::write(&lab, "").unwrap();
        assert_eq!(beside(Some(&this)), Some(lab));
        assert_eq!(beside(None), None);
    }
}
