//! The rows of the report.

use std::path::Path;

use anyhow::{Context, Result};

use crate::front;

/// One way with one setting on one scene.
#[derive(Clone, Debug)]
pub struct ReportRow {
    /// The numerical part.
    pub part: &'static str,
    /// Scene that it was tried on.
    pub scene: String,
    /// The method.
    pub method: String,
    /// Its setting.
    pub setting: String,
    /// Error against the truth; infinite where it diverged.
    pub error: f64,
    /// The error's unit.
    pub error_unit: &'static str,
    /// Uncertainty of the truth itself, in the same unit.
    pub truth_error: f64,
    /// Ranked by error and time, or only listed.
    pub kind: RowKind,
    /// Bytes that it holds and takes of the heap.
    pub memory_bytes: usize,
    /// Whether the product uses this.
    pub default: bool,
    /// Why the product uses this though something beats it here; empty otherwise.
    pub excuse: String,
    /// Anything else to say.
    pub note: String,
    /// Whether no other row of the scene beats it; see [`front::mark`].
    pub on_front: bool,
}

/// Purpose of a row.
#[derive(Clone, Debug)]
pub enum RowKind {
    /// Competes in its scene.
    Ranked(Timing),
    /// Stands for a stiff or extreme case: listed, not timed.
    Extreme,
}

/// Run times of a row.
#[derive(Clone, Debug)]
pub struct Timing {
    /// Nanoseconds of the processor for one use, turn by turn with the other rows of the scene.
    pub samples: Vec<f64>,
    /// Factor beyond which a way of this scene counts as faster.
    pub noise: f64,
}

impl ReportRow {
    /// Median run time of one use, nanoseconds; `None` where nothing was timed.
    pub fn time_ns(&self) -> Option<f64> {
        match &self.kind {
            RowKind::Ranked(timing) => Some(front::median(&mut timing.samples.clone())),
            RowKind::Extreme => None,
        }
    }

    /// Whether this is a stiff or extreme case.
    pub fn is_extreme(&self) -> bool {
        matches!(self.kind, RowKind::Extreme)
    }
}

const HEADINGS: [&str; 16] = [
    "part",
    "scene",
    "kind",
    "method",
    "setting",
    "error",
    "error_unit",
    "truth_error",
    "time_ns",
    "time_ratio",
    "noise",
    "memory_bytes",
    "default",
    "front",
    "excuse",
    "note",
];

/// The table as CSV (RFC 4180). `time_ratio` is the time over that of the scene's default, taken turn by turn.
pub fn csv(rows: &[ReportRow]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(HEADINGS)?;
    for r in rows {
        let default =
            rows.iter().find(|d| d.default && !d.is_extreme() && d.part == r.part && d.scene == r.scene);
        let (mut time, mut ratio, mut noise) = (String::new(), String::new(), String::new());
        if let RowKind::Ranked(timing) = &r.kind {
            time = r.time_ns().map(|t| format!("{t:.2}")).unwrap_or_default();
            ratio = default.map(|d| format!("{:.4}", front::ratio(r, d).log.exp())).unwrap_or_default();
            noise = format!("{:.3}", timing.noise);
        }
        writer.write_record([
            r.part,
            &r.scene,
            if r.is_extreme() { "extreme" } else { "ranked" },
            &r.method,
            &r.setting,
            &format!("{:.6e}", r.error),
            r.error_unit,
            &format!("{:.1e}", r.truth_error),
            &time,
            &ratio,
            &noise,
            &r.memory_bytes.to_string(),
            &r.default.to_string(),
            &r.on_front.to_string(),
            &r.excuse,
            &r.note,
        ])?;
    }
    writer.into_inner().context("cannot finish the table")
}

/// Writes the table of [`csv()`] to a file.
pub fn write_csv(path: &Path, rows: &[ReportRow]) -> Result<()> {
    std::fs::write(path, csv(rows)?).with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;

    /// A row of part "part" and scene "scene".
    pub fn row(method: &str, error: f64) -> ReportRow {
        ReportRow {
            part: "part",
            scene: "scene".into(),
            method: method.into(),
            setting: String::new(),
            error,
            error_unit: "m",
            truth_error: 0.0,
            kind: RowKind::Extreme,
            memory_bytes: 0,
            default: false,
            excuse: String::new(),
            note: String::new(),
            on_front: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_with_commas_quotes_and_line_ends_come_back() {
        let note = "worst at \"2 km\", then\nnone; a,b";
        let timing = Timing { samples: vec![30.0, 10.0, 20.0], noise: 1.25 };
        let rows = vec![
            ReportRow {
                note: note.into(),
                kind: RowKind::Ranked(timing),
                default: true,
                ..testing::row("a, b", 0.5)
            },
            ReportRow { scene: "\"".into(), ..testing::row("c", f64::INFINITY) },
        ];
        let text = csv(&rows).unwrap();
        let mut reader = csv::Reader::from_reader(text.as_slice());
        assert_eq!(reader.headers().unwrap(), HEADINGS.as_slice());
        let read: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(read.len(), 2);
        let first: Vec<&str> = read[0].iter().collect();
        assert_eq!(first[3..6], ["a, b", "", "5.000000e-1"]);
        assert_eq!(first[8..], ["20.00", "1.0000", "1.250", "0", "true", "false", "", note]);
        assert_eq!((&read[1][1], &read[1][5], &read[1][8]), ("\"", "inf", ""));
    }
}
