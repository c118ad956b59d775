//! The table for people and for programs.

use std::{fmt::Write, fs, path::Path};

use anyhow::{Context, Result};

use super::{
    faults::{FaultLine, FaultVerdict},
    measure::Figure,
};

/// Result of a run.
#[derive(Default)]
pub struct HilReport {
    /// Description of the machine, for the heading.
    pub machine: String,
    /// How many times slower it is.
    pub slow: f64,
    /// Figures.
    pub figures: Vec<Figure>,
    /// Faults.
    pub lines: Vec<FaultLine>,
}

impl HilReport {
    /// Whether nothing was missed.
    pub fn passed(&self) -> bool {
        self.missed() == 0
    }

    /// How much was missed.
    pub fn missed(&self) -> usize {
        self.lines.iter().filter(|l| l.verdict == FaultVerdict::Missed).count()
            + self.figures.iter().filter(|f| f.met == Some(false)).count()
    }

    /// Writes faults.md, faults.csv and figures.csv.
    pub fn write(&self, folder: &Path) -> Result<()> {
        for (name, text) in [
            ("faults.md", self.markdown()),
            ("faults.csv", self.fault_csv()),
            ("figures.csv", self.figure_csv()),
        ] {
            let path = folder.join(name);
            fs::write(&path, text).with_context(|| path.display().to_string())?;
        }
        Ok(())
    }

    /// For people.
    pub fn markdown(&self) -> String {
        let mut text = format!(
            "# Hardware in the loop\n\n{}. A core of the machine is {:.1} times slower than one of its host, measured in this run; \
             \"met, scaled\" means: met when the target's time is multiplied by that. Times are as measured in the machine.\n\n\
             | What | Measured | Target | Verdict |\n|---|---|---|---|\n",
            self.machine, self.slow
        );
        for f in &self.figures {
            let verdict = match f.met {
                None => "-",
                Some(true) => "met",
                Some(false) => "MISSED",
            };
            row(&mut text, &[f.what.as_str(), &f.value, &f.target, verdict]);
        }
        text.push_str(
            "\n| # | Fault | Injected | On the LCD | Code | To the LCD, s | Recovery, s | Target | Verdict | Note |\n\
             |---|---|---|---|---|---|---|---|---|---|\n",
        );
        self.lines.iter().for_each(|line| row(&mut text, &line.cells()));
        text
    }

    fn fault_csv(&self) -> String {
        let mut text = String::from("number,fault,injected,lcd,code,seen_s,back_s,target,verdict,note\n");
        self.lines.iter().for_each(|line| csv_row(&mut text, &line.cells()));
        text
    }

    fn figure_csv(&self) -> String {
        let mut text = String::from("what,value,target,met\n");
        for f in &self.figures {
            let met = f.met.map_or("", |m| if m { "yes" } else { "no" });
            csv_row(&mut text, &[f.what.as_str(), &f.value, &f.target, met]);
        }
        text
    }
}

fn row(text: &mut String, cells: &[impl AsRef<str>]) {
    let cells: Vec<String> = cells.iter().map(|c| c.as_ref().replace('|', "/").replace('\n', " ")).collect();
    // Writing to a String cannot fail.
    let _ = writeln!(text, "| {} |", cells.join(" | "));
}

fn csv_row(text: &mut String, cells: &[impl AsRef<str>]) {
    let cells: Vec<String> =
        cells.iter().map(|c| format!("\"{}\"", c.as_ref().replace('"', "\"\""))).collect();
    text.push_str(&cells.join(","));
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::CaseResult;

    #[test]
    fn a_missed_row_is_counted_and_cells_cannot_break_the_table() {
        let line = FaultLine {
            row: ["1", "a | b", "x\ny", "CAM_LOST"],
            seen: CaseResult { lcd: "\"NOT SCORED\"".into(), seen_s: Some(0.1234), ..CaseResult::default() },
            target: "seen 0.1 s".into(),
            verdict: FaultVerdict::Missed,
        };
        let report = HilReport { lines: vec![line], ..HilReport::default() };
        assert!(!report.passed());
        let last = report.markdown().lines().last().unwrap_or_default().to_owned();
        assert_eq!(last.matches('|').count(), 11);
        assert!(report.fault_csv().contains("\"\"\"NOT SCORED\"\"\"") && report.fault_csv().contains("0.12"));
    }
}
