//! The end of a command that is asked for from outside: ctrl-C, SIGTERM, or the terminal that goes away.

use std::{
    process,
    sync::{
        OnceLock,
        atomic::{AtomicBool, Ordering},
    },
};

use anyhow::{Result, anyhow};

/// Exit code of a command that was asked twice, as shells give it to an interrupted one.
const INTERRUPTED: i32 = 130;

/// Catches what asks for the end from now on, and gives the flag that tells it. The second time ends the process at once. To be called
/// once by the command that runs; further calls give the same flag.
///
/// # Errors
/// Where the system lets no handler be set.
pub fn watch() -> Result<&'static AtomicBool> {
    static ASKED: AtomicBool = AtomicBool::new(false);
    static SET: OnceLock<Result<(), String>> = OnceLock::new();
    let set = SET.get_or_init(|| {
        ctrlc::set_handler(|| {
            if ASKED.swap(true, Ordering::Relaxed) {
                process::exit(INTERRUPTED);
            }
        })
        .map_err(|e| e.to_string())
    });
    match set {
        Ok(()) => Ok(&ASKED),
        Err(e) => Err(anyhow!("cannot catch interrupts: {e}")),
    }
}
