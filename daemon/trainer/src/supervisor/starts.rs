//! Counts starts that did not end well, so that a crash loop is noticed from inside: the file outlives the process, not the
//! boot (systemd keeps the runtime folder over restarts only).

use std::{fs, io::Write, path::PathBuf};

use bowwave_core::time::{NS_PER_S, Time};

/// So many starts within [`WINDOW_NS`] before this one, none of which ended well, and this one is careful.
const STARTS_MAX: usize = 3;
const WINDOW_NS: i64 = 60 * NS_PER_S;
/// More lines than this are not read: the file is ours, but who knows.
const LINES_MAX: usize = 64;

/// How a start is to be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// The whole trainer.
    Training,
    /// Video and a message only: the trainer crashed again and again.
    Safe,
}

/// The file of starts.
#[derive(Debug)]
pub struct CrashLoopGuard {
    path: Option<PathBuf>,
    mode: Mode,
}

impl CrashLoopGuard {
    /// Notes a start at `now`. Without a folder (not under systemd) starts are not counted.
    pub fn begin(folder: Option<PathBuf>, now: Time) -> Self {
        let Some(path) = folder.map(|f| f.join("starts")) else {
            return Self { path: None, mode: Mode::Training };
        };
        let text = fs::read_to_string(&path).unwrap_or_default();
        let before = recent(&text, now);
        let mode = if before.len() >= STARTS_MAX { Mode::Safe } else { Mode::Training };
        let mut lines: Vec<String> = before.iter().map(|t| t.ns().to_string()).collect();
        lines.push(now.ns().to_string());
        if let Err(e) =
            fs::File::create(&path).and_then(|mut f| f.write_all((lines.join("\n") + "\n").as_bytes()))
        {
            log::warn!("cannot write {}: {e}; a crash loop would go unnoticed", path.display());
        }
        Self { path: Some(path), mode }
    }

    /// How this start is to be made.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// This start ended well: so did, by that, all before it.
    pub fn ended_well(&self) {
        if let Some(path) = &self.path
            && let Err(e) = fs::remove_file(path)
        {
            log::debug!("{}: {e}", path.display());
        }
    }
}

/// Times of starts in `text` that lie within the window before `now`.
fn recent(text: &str, now: Time) -> Vec<Time> {
    text.lines()
        .take(LINES_MAX)
        .filter_map(|line| line.trim().parse().ok())
        .map(Time::from_ns)
        .filter(|t| t.ns() >= 0 && (0..WINDOW_NS).contains(&now.ns_since(*t)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(s: i64) -> Time {
        Time::from_ns(s * NS_PER_S)
    }

    #[test]
    fn the_fourth_start_in_a_minute_is_careful() {
        let folder = std::env::temp_dir().join(format!("bowwave-starts-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let start = |s| CrashLoopGuard::begin(Some(folder.clone()), at(s)).mode();
        let modes: Vec<_> = [100, 110, 120, 130, 200, 210].into_iter().map(start).collect();
        use Mode::{Safe, Training};
        assert_eq!(modes, [Training, Training, Training, Safe, Training, Training]);
        CrashLoopGuard::begin(Some(folder.clone()), at(211)).ended_well();
        assert_eq!(start(212), Training, "an end that was well clears the count");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn rubbish_in_the_file_is_no_start() {
        assert_eq!(recent("x\n-5\n99999999999999999999\n\n1000000000\n", at(2)), [at(1)]);
        // A file from before a reboot has times from the future.
        assert_eq!(recent("9000000000000\n", at(2)), []);
    }

    #[test]
    fn without_a_folder_nothing_is_counted() {
        assert_eq!(CrashLoopGuard::begin(None, at(0)).mode(), Mode::Training);
    }
}
