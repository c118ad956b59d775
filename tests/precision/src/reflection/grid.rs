//! Every method on every cell, and what the figures say by range and sea state.

use std::{collections::BTreeMap, fmt::Write as _, path::Path};

use anyhow::{Context, Result};
use bowwave_core::water::ReflectionMethod;

use super::{
    THESIS,
    cell::{CellErrors, TruthCell},
    draw::{Beliefs, DrawingStudio},
    index, mean, methods_table,
};
use crate::table::{self, TextTable};

/// Number of methods.
pub const METHODS: usize = ReflectionMethod::ALL.len();

/// A cell and what each method of [`ReflectionMethod::ALL`] makes of it.
#[derive(Clone, Debug)]
pub struct GridRow {
    /// The cell's name.
    pub name: String,
    /// Distance of the boat, whole metres.
    pub range_m: u32,
    /// Sea state of the thesis.
    pub state: u8,
    /// CellErrors by method.
    pub errors: [CellErrors; METHODS],
}

impl GridRow {
    fn flip(&self, method: ReflectionMethod) -> f64 {
        self.errors[index(method)].flip
    }
}

/// Draws a cell with every method. Pictures go to `pictures` as CELL-METHOD.png.
pub fn measure(studio: &mut DrawingStudio, cell: &TruthCell, pictures: Option<&Path>) -> Result<GridRow> {
    let beliefs = Beliefs::right(cell);
    let mut errors = Vec::with_capacity(METHODS);
    for method in ReflectionMethod::ALL {
        let drawn = studio.draw(cell, method, &beliefs)?;
        errors.push(cell.errors(&drawn)?);
        if let Some(folder) = pictures {
            let path = folder.join(format!("{}-{}.png", cell.name, method.name()));
            cell.with_hull(&drawn).save(&path).with_context(|| format!("cannot write {}", path.display()))?;
        }
    }
    let errors = errors.try_into().ok().context("a method is missing")?;
    Ok(GridRow {
        name: cell.name.clone(),
        range_m: cell.spec.range_m.round() as u32,
        state: cell.spec.state,
        errors,
    })
}

/// The rows as CSV: one line for each cell and method.
pub fn csv(rows: &[GridRow]) -> Result<Vec<u8>> {
    let cells = rows.iter().flat_map(|row| {
        ReflectionMethod::ALL.iter().zip(&row.errors).map(|(method, e)| {
            vec![
                row.name.clone(),
                row.range_m.to_string(),
                row.state.to_string(),
                method.name().to_owned(),
                format!("{:.5}", e.flip),
                format!("{:.4}", e.bias),
                format!("{:.4}", e.change),
            ]
        })
    });
    table::csv(&["cell", "range_m", "state", "method", "flip", "bias", "change"], cells)
}

/// Mean FLIP that a cell of that range and state may have at most, where one is set.
pub fn target(range_m: u32, state: u8) -> Option<f64> {
    match (range_m, state) {
        (_, 0) => Some(0.05),
        (60, 1) => Some(0.04),
        (60, 2..=4) => Some(0.08),
        (150, _) => Some(0.04),
        (400, _) => Some(0.015),
        _ => None,
    }
}

/// Signed bias of a method over the cells' change, and the mean size of the cells' biases over the same: both relative to the sum of
/// what the boat changes, so that cells in which it changes nothing weigh nothing.
pub fn relative_bias<'a>(rows: impl Iterator<Item = &'a GridRow>, method: ReflectionMethod) -> (f64, f64) {
    let (mut signed, mut size, mut change) = (0.0, 0.0, 0.0);
    for e in rows.map(|r| r.errors[index(method)]) {
        signed += e.bias * e.change.signum();
        size += e.bias.abs();
        change += e.change.abs();
    }
    (signed / change, size / change)
}

/// The lowest of the means of some methods.
fn best(rows: &[&GridRow], of: &[ReflectionMethod]) -> f64 {
    of.iter().map(|m| mean(rows.iter().map(|r| r.flip(*m)))).fold(f64::INFINITY, f64::min)
}

fn groups<K: Ord>(rows: &[GridRow], key: impl Fn(&GridRow) -> K) -> BTreeMap<K, Vec<&GridRow>> {
    let mut out: BTreeMap<K, Vec<&GridRow>> = BTreeMap::new();
    rows.iter().for_each(|row| out.entry(key(row)).or_default().push(row));
    out
}

/// The figures by range and state, and how `ours` does among them.
pub fn summary(rows: &[GridRow], ours: ReflectionMethod) -> Result<String> {
    let mut table =
        methods_table("mean FLIP", 14, &[("/ corrected", 11), ("/ published", 11), ("/ better", 11)]);
    let mut line = |name: &str, rows: &[&GridRow]| {
        let flips = ReflectionMethod::ALL.map(|method| mean(rows.iter().map(|r| r.flip(method))));
        let own = mean(rows.iter().map(|r| r.flip(ours)));
        let ratios = [&THESIS[..2], &THESIS[2..], &THESIS[..]].map(|of| own / best(rows, of));
        let cells = flips.map(|f| format!("{f:.4}")).into_iter().chain(ratios.map(|r| format!("{r:.3}")));
        table.row([name.to_owned()].into_iter().chain(cells));
    };
    for ((range, state), rows) in groups(rows, |r| (r.range_m, r.state)) {
        line(&format!("{range} m, {state}"), &rows);
    }
    line("all", &rows.iter().collect::<Vec<_>>());
    let mut text = format!("{} cells\n{}", rows.len(), table.take());
    let per_cell = mean(
        rows.iter().map(|r| r.flip(ours) / THESIS.iter().map(|m| r.flip(*m)).fold(f64::INFINITY, f64::min)),
    );
    writeln!(
        text,
        "{} over the best thesis shader of each cell, mean of the ratios: {per_cell:.3}",
        ours.name()
    )?;
    worst(&mut text, rows, ours)?;
    shares(&mut text, rows, ours)?;
    biases(&mut text, rows)?;
    Ok(text)
}

/// Cells in which nothing at all is closer than `ours`.
fn worst(text: &mut String, rows: &[GridRow], ours: ReflectionMethod) -> Result<()> {
    let mut worse: Vec<(f64, &GridRow)> =
        rows.iter().map(|r| (r.flip(ours) - r.flip(ReflectionMethod::Off), r)).collect();
    worse.sort_by(|a, b| b.0.total_cmp(&a.0));
    let beyond = worse.iter().filter(|(by, _)| *by > 0.01).count();
    writeln!(
        text,
        "\n{} worse than no reflection by more than .01: {beyond} cells; the worst:",
        ours.name()
    )?;
    for (by, row) in worse.iter().take(5) {
        let (own, off) = (row.flip(ours), row.flip(ReflectionMethod::Off));
        writeln!(text, "  {:36}{own:8.4} against {off:.4} ({by:+.4})", row.name)?;
    }
    Ok(())
}

/// How many cells keep their target.
fn shares(text: &mut String, rows: &[GridRow], ours: ReflectionMethod) -> Result<()> {
    let name = |r: &GridRow| match (r.range_m, r.state) {
        (_, 0) => "state 0".to_owned(),
        (60, 1) => "60 m, state 1".to_owned(),
        (60, _) => "60 m, states 2-4".to_owned(),
        (range, _) => format!("{range} m, states 1-4"),
    };
    writeln!(text, "\ncells of {} within their target:", ours.name())?;
    for (name, rows) in groups(rows, name) {
        let Some(most) = target(rows[0].range_m, rows[0].state) else { continue };
        let within = rows.iter().filter(|r| r.flip(ours) <= most).count();
        let worst = rows.iter().map(|r| r.flip(ours)).fold(0.0, f64::max);
        let average = mean(rows.iter().map(|r| r.flip(ours)));
        writeln!(
            text,
            "  {name:20} <= {most:.3}: {within:3} of {:3} ({:3.0} %), mean {average:.4}, worst {worst:.4}",
            rows.len(),
            100.0 * within as f64 / rows.len() as f64
        )?;
    }
    Ok(())
}

fn biases(text: &mut String, rows: &[GridRow]) -> Result<()> {
    writeln!(text, "\nbias over the change that the boat makes: signed, and (mean size over the cells)")?;
    let mut table = methods_table("state", 14, &[]);
    for (state, rows) in groups(rows, |r| r.state) {
        let cells = ReflectionMethod::ALL.map(|method| {
            let (signed, size) = relative_bias(rows.iter().copied(), method);
            format!("{signed:+.3} ({size:.3})")
        });
        table.row([state.to_string()].into_iter().chain(cells));
    }
    *text += &table.take();
    Ok(())
}

/// Mean FLIP of the truth's own noise by range and state; rows are range in metres, state and FLIP.
pub fn noise_summary(rows: &[(u32, u8, f64)]) -> String {
    let mut found: BTreeMap<(u32, u8), Vec<f64>> = BTreeMap::new();
    rows.iter().for_each(|(range, state, flip)| found.entry((*range, *state)).or_default().push(*flip));
    let mut table = TextTable::new(1, [("the truth's own noise", 22), ("mean FLIP", 9)]);
    for ((range, state), flips) in found {
        table.row([format!("{range} m, {state}"), format!("{:.4}", mean(flips))]);
    }
    table.row(["all".to_owned(), format!("{:.4}", mean(rows.iter().map(|r| r.2)))]);
    format!("{} cells\n{}", rows.len(), table.take())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(range_m: u32, state: u8, flips: [f64; METHODS], bias: f64, change: f64) -> GridRow {
        let errors = flips.map(|flip| CellErrors { flip, bias, change });
        GridRow { name: format!("r{range_m:03}-s{state}"), range_m, state, errors }
    }

    #[test]
    fn the_better_thesis_shader_is_that_of_the_group_and_targets_are_counted() {
        // off, mirror, full, full as printed, physics, physics as printed, waves
        let rows = [
            row(60, 1, [0.2, 0.3, 0.10, 0.2, 0.30, 0.4, 0.03], 1.0, 10.0),
            row(60, 1, [0.2, 0.3, 0.30, 0.2, 0.20, 0.4, 0.05], -1.0, 10.0),
            row(400, 3, [0.01, 0.3, 0.30, 0.2, 0.20, 0.4, 0.03], -1.0, 0.0),
        ];
        let text = summary(&rows, ReflectionMethod::Baked).unwrap();
        let line = |name: &str| text.lines().find(|l| l.starts_with(name)).unwrap().to_owned();
        let last = |name: &str, n: usize| {
            line(name).split_whitespace().rev().nth(n).unwrap().parse::<f64>().unwrap()
        };
        // .04 over .2 of Full and Full as printed.
        assert_eq!([last("60 m, 1", 2), last("60 m, 1", 1), last("60 m, 1", 0)], [0.2, 0.2, 0.2]);
        assert!(line("  60 m, state 1").contains("1 of   2 ( 50 %)"), "{text}");
        assert!(line("  400 m, states 1-4").contains("0 of   1"), "{text}");
        assert!(text.contains("by more than .01: 1 cells"), "{text}");
        let (signed, size) = relative_bias(rows.iter(), ReflectionMethod::Off);
        assert!(signed.abs() < 0.051 && (size - 0.15).abs() < 1e-12, "{signed} {size}");
    }

    #[test]
    fn every_cell_of_the_grid_has_a_target() {
        for range in crate::truth::grid::RANGES_M {
            assert!((0..=4).all(|state| target(range as u32, state).is_some()));
        }
        assert_eq!(target(60, 2), Some(0.08));
    }
}
