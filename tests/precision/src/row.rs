//! The rows of the report, and which of them nothing else beats.

use std::{fmt::Write as _, path::Path};

use anyhow::{Context, Result};

/// One method with one setting on one scene.
#[derive(Clone, Debug)]
pub struct Row {
    /// The numerical part.
    pub part: &'static str,
    /// What it was tried on.
    pub scene: String,
    /// The method.
    pub method: String,
    /// Its setting.
    pub setting: String,
    /// Error against the truth.
    pub error: f64,
    /// The error's unit.
    pub error_unit: &'static str,
    /// Run time of one use, nanoseconds.
    pub time_ns: f64,
    /// Memory held, bytes.
    pub memory_bytes: usize,
    /// Whether the product uses this.
    pub default: bool,
    /// Whether it stands for a stiff or extreme case; such rows are listed, not ranked.
    pub extreme: bool,
    /// What else there is to say.
    pub note: String,
    /// Whether no other row of the part and scene is both faster and closer; see [`mark_pareto`].
    pub pareto: bool,
}

/// Times within this factor count as equal: the machines are shared, and two methods are not timed at the same moment.
pub const TIME_NOISE: f64 = 2.0;

/// Marks the rows that no other row of the same part and scene beats in error at the same or less time, or in time (by more
/// than the noise) at the same or less error.
pub fn mark_pareto(rows: &mut [Row]) {
    let beaten: Vec<bool> = rows
        .iter()
        .map(|r| {
            rows.iter().filter(|o| !o.extreme && o.part == r.part && o.scene == r.scene).any(|o| {
                let faster = o.time_ns * TIME_NOISE < r.time_ns;
                o.error < r.error && o.time_ns <= r.time_ns || o.error <= r.error && faster
            })
        })
        .collect();
    for (row, beaten) in rows.iter_mut().zip(beaten) {
        row.pareto = !row.extreme && !beaten;
    }
}

/// Defaults that are beaten by more than the noise: by something that is not slower and errs less, or that errs no more
/// and is faster.
pub fn beaten_defaults(rows: &[Row]) -> Vec<String> {
    rows.iter()
        .filter(|r| r.default && !r.extreme)
        .filter_map(|r| {
            let by = rows.iter().find(|o| {
                !o.extreme
                    && o.part == r.part
                    && o.scene == r.scene
                    && o.error <= r.error
                    && o.time_ns * TIME_NOISE < r.time_ns
            })?;
            Some(format!(
                "{} on {}: the default {} ({}) errs {:.3e} {} in {:.0} ns; {} ({}) errs {:.3e} in {:.0} ns",
                r.part,
                r.scene,
                r.method,
                r.setting,
                r.error,
                r.error_unit,
                r.time_ns,
                by.method,
                by.setting,
                by.error,
                by.time_ns
            ))
        })
        .collect()
}

/// Writes `precision.csv`.
pub fn write_csv(path: &Path, rows: &[Row]) -> Result<()> {
    let mut text =
        String::from("part,scene,method,setting,error,error_unit,time_ns,memory_bytes,default,pareto,note\n");
    for r in rows {
        let quoted = |s: &str| format!("\"{}\"", s.replace('"', "\"\""));
        writeln!(
            text,
            "{},{},{},{},{:.6e},{},{:.1},{},{},{},{}",
            r.part,
            quoted(&r.scene),
            quoted(&r.method),
            quoted(&r.setting),
            r.error,
            r.error_unit,
            r.time_ns,
            r.memory_bytes,
            r.default,
            r.pareto,
            quoted(&r.note)
        )?;
    }
    std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}
