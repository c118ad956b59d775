//! Log and exit code of a program.

use std::process::ExitCode;

use anyhow::Result;

use crate::outcome::Outcome;

/// Starts the log: on standard error, or in systemd's journal where standard error leads there. `verbose` counts the -v.
pub fn start_log(verbose: u8) {
    if log_to_journal(verbose) {
        return;
    }
    let level = match verbose {
        0 => "warn",
        1 => "info",
        _ => "debug",
    };
    env_logger::Builder::from_env(
        env_logger::Env::default().default_filter_or(format!("{level},mp4parse=error")),
    )
    .format_target(false)
    .init();
}

/// In systemd's journal, lines have their fields (fault code, state, duration).
fn log_to_journal(verbose: u8) -> bool {
    if !systemd_journal_logger::connected_to_journal() {
        return false;
    }
    let logger = systemd_journal_logger::JournalLog::new()
        .map(|log| log.with_syslog_identifier("bowwave".to_owned()))
        .and_then(|log| log.install().map_err(std::io::Error::other));
    // The info level is on without -v: the journal is what is left after a day at sea.
    log::set_max_level(if verbose > 0 { log::LevelFilter::Debug } else { log::LevelFilter::Info });
    logger.is_ok()
}

/// The exit code of a command's result. An error is written to standard error.
pub fn exit_code(result: Result<Outcome>) -> ExitCode {
    match result {
        Ok(outcome) => outcome.into(),
        Err(e) => {
            eprintln!("bowwave: {e:#}");
            ExitCode::FAILURE
        }
    }
}
