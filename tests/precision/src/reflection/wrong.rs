//! CellErrors of a method under wrong estimates of sea, sky and eye height.

use std::{collections::BTreeMap, f64::consts::FRAC_PI_4};

use anyhow::Result;
use bowwave_core::{sea::BeaufortForce, water::ReflectionMethod};

use super::{
    THESIS,
    cell::TruthCell,
    draw::{Beliefs, DrawingStudio, EyeHeight},
    mean,
};
use crate::table::{self, TextTable};

/// A wrong estimate: what it is called, and what it makes of what is right; `None` where there is no such thing.
type Wrong = (&'static str, fn(&Beliefs) -> Option<Beliefs>);

/// All of them.
pub const WRONG: [Wrong; 15] = [
    ("right", |b| Some(*b)),
    ("state up", |b| class(b, 1)),
    ("state down", |b| class(b, -1)),
    ("wind +20 %", |b| Some(wind(b, 1.2))),
    ("wind -20 %", |b| Some(wind(b, 0.8))),
    ("wind +45 deg", |b| Some(Beliefs { wind_from: b.wind_from + FRAC_PI_4, ..*b })),
    ("wind -45 deg", |b| Some(Beliefs { wind_from: b.wind_from - FRAC_PI_4, ..*b })),
    ("sky +20 %", |b| Some(Beliefs { sky: 1.2, skylight: 1.2, ..*b })),
    ("sky -20 %", |b| Some(Beliefs { sky: 0.8, skylight: 0.8, ..*b })),
    ("mirrored sky +20 %", |b| Some(Beliefs { sky: 1.2, ..*b })),
    ("mirrored sky -20 %", |b| Some(Beliefs { sky: 0.8, ..*b })),
    ("eye +10 %, lengths too", |b| Some(Beliefs { eye: EyeHeight::High, ..*b })),
    ("eye -10 %, lengths too", |b| Some(Beliefs { eye: EyeHeight::Low, ..*b })),
    ("eye +10 %, same range", |b| Some(Beliefs { eye: EyeHeight::High, range_kept: true, ..*b })),
    ("eye -10 %, same range", |b| Some(Beliefs { eye: EyeHeight::Low, range_kept: true, ..*b })),
];

/// The sea of a neighbouring class with the wind that stands for it.
fn class(right: &Beliefs, by: i8) -> Option<Beliefs> {
    let force = BeaufortForce::new(right.force.get().checked_add_signed(by)?)?;
    Some(Beliefs { force, wind_m_s: force.wind_mean_m_s(), ..*right })
}

fn wind(right: &Beliefs, factor: f64) -> Beliefs {
    let wind_m_s = right.wind_m_s * factor;
    Beliefs { wind_m_s, force: BeaufortForce::of_wind(wind_m_s), ..*right }
}

/// FLIP of one cell.
#[derive(Clone, Debug)]
pub struct WrongRow {
    /// The cell's name.
    pub name: String,
    /// Distance of the boat, whole metres.
    pub range_m: u32,
    /// Sea state of the thesis.
    pub state: u8,
    /// The thesis's shaders under right conditions, as in [`THESIS`].
    pub thesis: [f64; THESIS.len()],
    /// The method under each of [`WRONG`].
    pub ours: [Option<f64>; WRONG.len()],
}

/// Draws a cell with the thesis's shaders under right conditions and with `ours` under wrong ones.
pub fn measure(studio: &mut DrawingStudio, cell: &TruthCell, ours: ReflectionMethod) -> Result<WrongRow> {
    let right = Beliefs::right(cell);
    let mut flip = |method, beliefs: &Beliefs| -> Result<f64> {
        Ok(cell.errors(&studio.draw(cell, method, beliefs)?)?.flip)
    };
    let mut out = WrongRow {
        name: cell.name.clone(),
        range_m: cell.spec.range_m.round() as u32,
        state: cell.spec.state,
        thesis: [0.0; THESIS.len()],
        ours: [None; WRONG.len()],
    };
    for (slot, method) in out.thesis.iter_mut().zip(THESIS) {
        *slot = flip(method, &right)?;
    }
    for (slot, (_, wrong)) in out.ours.iter_mut().zip(WRONG) {
        *slot = wrong(&right).map(|beliefs| flip(ours, &beliefs)).transpose()?;
    }
    Ok(out)
}

/// The rows as CSV: one line for each cell and condition.
pub fn csv(rows: &[WrongRow]) -> Result<Vec<u8>> {
    let titles = ["cell", "range_m", "state", "condition", "flip", "better_thesis_flip"];
    let cells = rows.iter().flat_map(|row| {
        let better = row.thesis.iter().copied().fold(f64::INFINITY, f64::min);
        WRONG.iter().zip(row.ours).filter_map(move |((name, _), flip)| {
            Some(vec![
                row.name.clone(),
                row.range_m.to_string(),
                row.state.to_string(),
                (*name).to_owned(),
                format!("{:.5}", flip?),
                format!("{better:.5}"),
            ])
        })
    });
    table::csv(&titles, cells)
}

/// The mean of the cells for which there is such a condition, against the thesis's better shader in the same cells, by range and state
/// and in all.
pub fn summary(rows: &[WrongRow], ours: ReflectionMethod) -> String {
    let mut groups: BTreeMap<(u32, u8), Vec<&WrongRow>> = BTreeMap::new();
    rows.iter().for_each(|r| groups.entry((r.range_m, r.state)).or_default().push(r));
    let mut columns: Vec<(String, Vec<&WrongRow>)> = vec![("all".to_owned(), rows.iter().collect())];
    columns.extend(groups.into_iter().map(|((range, state), rows)| (format!("{range} m, {state}"), rows)));
    let titles = [("", 24)].into_iter().chain(columns.iter().map(|(name, _)| (name.as_str(), 14)));
    let mut table = TextTable::new(1, titles.chain([("cells beyond thesis", 21)]));
    for (i, (name, _)) in WRONG.iter().enumerate() {
        let beyond =
            rows.iter().filter(|r| r.ours[i].is_some_and(|f| r.thesis.iter().any(|t| f > *t))).count();
        let ratios = columns.iter().map(|(_, rows)| ratio(rows, i));
        table.row([(*name).to_owned()].into_iter().chain(ratios).chain([beyond.to_string()]));
    }
    format!(
        "{} cells; mean FLIP of {} under wrong conditions (over that of the better thesis shader, right)\n{}",
        rows.len(),
        ours.name(),
        table.take()
    )
}

fn ratio(rows: &[&WrongRow], condition: usize) -> String {
    let there: Vec<&&WrongRow> = rows.iter().filter(|r| r.ours[condition].is_some()).collect();
    if there.is_empty() {
        return "-".to_owned();
    }
    let own = mean(there.iter().filter_map(|r| r.ours[condition]));
    let thesis = (0..THESIS.len()).map(|m| mean(there.iter().map(|r| r.thesis[m])));
    format!("{own:.4} ({:.2})", own / thesis.fold(f64::INFINITY, f64::min))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beliefs(force: u8) -> Beliefs {
        let force = BeaufortForce::new(force).unwrap();
        let wind_m_s = force.wind_mean_m_s();
        Beliefs {
            wind_m_s,
            wind_from: 1.0,
            force,
            sky: 1.0,
            skylight: 1.0,
            eye: EyeHeight::Right,
            range_kept: false,
        }
    }

    #[test]
    fn classes_end_at_calm_and_twenty_percent_of_wind_move_it() {
        assert!(class(&beliefs(0), -1).is_none());
        let up = class(&beliefs(2), 1).unwrap();
        assert_eq!((up.force.get(), up.wind_m_s), (3, up.force.wind_mean_m_s()));
        assert!((wind(&beliefs(3), 1.2).wind_m_s / beliefs(3).wind_m_s - 1.2).abs() < 1e-12);
    }

    #[test]
    fn every_wrong_estimate_but_the_right_one_changes_something() {
        let right = beliefs(3);
        for (name, wrong) in WRONG {
            assert_eq!(wrong(&right).unwrap() == right, name == "right", "{name}");
        }
    }

    #[test]
    fn a_missing_condition_is_left_out_of_both_means() {
        let row = |ours: Option<f64>, thesis: f64| WrongRow {
            name: String::new(),
            range_m: 60,
            state: 0,
            thesis: [thesis; 4],
            ours: [ours; WRONG.len()],
        };
        let (a, b) = (row(Some(0.1), 0.2), row(None, 0.9));
        assert_eq!(ratio(&[&a, &b], 1), "0.1000 (0.50)");
        assert_eq!(ratio(&[&b], 1), "-");
    }
}
