//! Notes on what makes runs hard to compare.

use std::collections::BTreeMap;

use super::{ComparedRun, numbers};

/// All notes.
pub fn notes(runs: &[ComparedRun]) -> Vec<String> {
    let mut notes = Vec::new();
    let scenarios = grouped(runs, |run| run.stored.run.scenario.clone());
    if scenarios.len() > 1 {
        let each: Vec<String> =
            scenarios.iter().map(|(name, of)| format!("\"{name}\" ({})", numbers(of))).collect();
        notes.push(format!(
            "The runs are of different scenarios: {}. They set different tasks, and their points do not say who did better.",
            each.join("; ")
        ));
    }
    for (name, of) in &scenarios {
        let variants = grouped_of(runs, of, task);
        if variants.len() > 1 {
            let each: Vec<String> = variants.values().map(|of| numbers(of)).collect();
            notes.push(format!(
                "\"{name}\" is not the same in all its runs: boats, weapon or ranges differ between {}.",
                each.join(" / ")
            ));
        }
        if grouped_of(runs, of, |run| run.stored.run.seed).len() > 1 {
            notes.push(format!("Seeds differ in {}: waves and chance were not the same.", numbers(of)));
        }
    }
    let versions = grouped(runs, |run| run.scored.sheet.version);
    if versions.len() > 1 {
        notes.push("The meaning of the points is of different versions.".to_owned());
    }
    notes.extend(of_some(runs, |run| run.scored.unknown > 0, "events of a newer version do not count"));
    notes.extend(of_some(
        runs,
        |run| !run.stored.finished,
        "the run still goes on, or did not end as it should",
    ));
    notes.extend(of_some(
        runs,
        |run| run.stored.run.started_wall_ns.is_none(),
        "the clock was not set at its beginning; the place in the journal stands for it",
    ));
    notes
}

/// A note on those runs of which something is true.
fn of_some(runs: &[ComparedRun], is: impl Fn(&ComparedRun) -> bool, what: &str) -> Option<String> {
    let of: Vec<usize> = (0..runs.len()).filter(|i| is(&runs[*i])).collect();
    (!of.is_empty()).then(|| format!("Of {}: {what}.", numbers(&of)))
}

/// The task that a run's scenario sets, to be compared.
fn task(run: &ComparedRun) -> String {
    let details = &run.details;
    let boats: Vec<_> = details.boats.iter().map(|boat| (&boat.name, &boat.side, &boat.model)).collect();
    format!("{boats:?} {:?} {} {}", details.weapon, details.keep_off_m, details.self_defence_m)
}

fn grouped<K: Ord>(runs: &[ComparedRun], key: impl Fn(&ComparedRun) -> K) -> BTreeMap<K, Vec<usize>> {
    let all: Vec<usize> = (0..runs.len()).collect();
    grouped_of(runs, &all, key)
}

fn grouped_of<K: Ord>(
    runs: &[ComparedRun],
    of: &[usize],
    key: impl Fn(&ComparedRun) -> K,
) -> BTreeMap<K, Vec<usize>> {
    let mut groups: BTreeMap<K, Vec<usize>> = BTreeMap::new();
    for i in of {
        groups.entry(key(&runs[*i])).or_default().push(*i);
    }
    groups
}
