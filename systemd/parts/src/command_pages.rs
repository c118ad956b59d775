//! Manual pages and shell completions, from the definition of the command line.

use std::{fs, path::Path};

use anyhow::{Context, Result};
use bowwave::command_line;
use clap_complete::Shell;

/// Shells with the place of their completions below `/usr/share`.
const COMPLETIONS: [(Shell, &str); 3] = [
    (Shell::Bash, "bash-completion/completions/bowwave"),
    (Shell::Zsh, "zsh/vendor-completions/_bowwave"),
    (Shell::Fish, "fish/vendor_completions.d/bowwave.fish"),
];

/// Writes a page for each command, and the completions of each shell, below `out`.
pub fn write(out: &Path) -> Result<()> {
    let pages = out.join("man/man1");
    fs::create_dir_all(&pages).with_context(|| format!("cannot make the folder {}", pages.display()))?;
    clap_mangen::generate_to(command_line(), &pages)
        .with_context(|| format!("cannot write manual pages to {}", pages.display()))?;
    for (shell, path) in COMPLETIONS {
        let mut script = Vec::new();
        clap_complete::generate(shell, &mut command_line(), "bowwave", &mut script);
        crate::write(&out.join(path), script)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_has_a_page_and_every_shell_names_it() {
        let out = tempfile::tempdir().unwrap();
        write(out.path()).unwrap();
        for command in command_line().get_subcommands() {
            let name = command.get_name();
            let page = out.path().join(format!("man/man1/bowwave-{name}.1"));
            let text = fs::read_to_string(&page).unwrap_or_else(|e| panic!("{}: {e}", page.display()));
            assert!(text.contains(".SH SYNOPSIS"), "{name}: {text}");
            for (shell, path) in COMPLETIONS {
                let script = fs::read_to_string(out.path().join(path)).unwrap();
                assert!(script.contains(name), "{shell} does not know {name}");
            }
        }
    }
}
