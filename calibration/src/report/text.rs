//! The report as text, for the terminal.

use std::fmt;

use super::CalibrationReport;

impl fmt::Display for CalibrationReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {}", self.verdict, self.says)?;
        let width = self.rows.iter().map(|(what, _)| what.chars().count()).max().unwrap_or(0);
        for (what, value) in &self.rows {
            writeln!(f, "  {what:width$}  {value}")?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "* {note}"))
    }
}
