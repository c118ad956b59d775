//! Log and exit code of a program.

use std::process::ExitCode;

use anyhow::Result;
use bowwave_core::text::one_line;
use log::{Log, Metadata, Record};

use crate::outcome::Outcome;

/// A log that writes one line a message: what a message quotes from a file or a device can neither begin another line nor steer a
/// terminal.
struct LineLog<L>(L);

impl<L: Log> Log for LineLog<L> {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        self.0.enabled(metadata)
    }

    fn log(&self, record: &Record<'_>) {
        let line = one_line(&record.args().to_string());
        self.0.log(&record.to_builder().args(format_args!("{line}")).build());
    }

    fn flush(&self) {
        self.0.flush();
    }
}

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
    let logger = env_logger::Builder::from_env(
        env_logger::Env::default().default_filter_or(format!("{level},mp4parse=error")),
    )
    .format_target(false)
    .build();
    let most = logger.filter();
    if log::set_boxed_logger(Box::new(LineLog(logger))).is_ok() {
        log::set_max_level(most);
    }
}

/// In systemd's journal, lines have their fields (fault code, state, duration).
fn log_to_journal(verbose: u8) -> bool {
    if !systemd_journal_logger::connected_to_journal() {
        return false;
    }
    let logger = systemd_journal_logger::JournalLog::new()
        .map(|log| log.with_syslog_identifier("bowwave".to_owned()))
        .and_then(|log| log::set_boxed_logger(Box::new(LineLog(log))).map_err(std::io::Error::other));
    // The info level is on without -v: the journal is what is left after a day at sea.
    log::set_max_level(if verbose > 0 { log::LevelFilter::Debug } else { log::LevelFilter::Info });
    logger.is_ok()
}

/// The exit code of a command's result. An error is written to standard error.
pub fn exit_code(result: Result<Outcome>) -> ExitCode {
    match result {
        Ok(outcome) => outcome.into(),
        Err(e) => {
            eprintln!("bowwave: {}", one_line(&format!("{e:#}")));
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    struct Kept(Mutex<Vec<String>>);

    impl Log for &Kept {
        fn enabled(&self, _: &Metadata<'_>) -> bool {
            true
        }

        fn log(&self, record: &Record<'_>) {
            self.0.lock().unwrap().push(record.args().to_string());
        }

        fn flush(&self) {}
    }

    #[test]
    fn what_a_message_quotes_cannot_forge_a_line_or_steer_a_terminal() {
        let kept = Kept(Mutex::default());
        let hostile = "topic /a\n[2026-01-01T00:00:00Z ERROR] NOT_INERT over\r\u{1b}[2J\u{9b}31m";
        LineLog(&kept).log(&Record::builder().args(format_args!("unknown {hostile}")).build());
        let lines = kept.0.into_inner().unwrap();
        assert_eq!(lines.len(), 1);
        assert!(!lines[0].contains(char::is_control), "{:?}", lines[0]);
        assert!(lines[0].contains("NOT_INERT over"));
    }
}
