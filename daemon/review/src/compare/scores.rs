//! The scores of several runs, a column each.

use std::collections::BTreeSet;

use maud::{Markup, html};
use serde_json::Value;

use super::{ComparedRun, mark::mark};
use crate::cells::{Cells, POINTS, SUMMARY};

/// A row: name, meaning, digits after the point, and the place in each run's score.
pub struct Row {
    /// Name, as the page of one run has it.
    pub name: String,
    /// Meaning, empty where the name says it.
    pub meaning: String,
    /// Digits after the point.
    pub digits: usize,
    /// Place in each run's score; `None` where the run has no such item.
    pub pointers: Vec<Option<String>>,
}

/// The rows of the points: the total, then each item that any run asks for, in the order of the first run that has it.
pub fn points(scores: &[Value]) -> Vec<Row> {
    let mut rows = vec![Row {
        name: "Total points".to_owned(),
        meaning: "of 100".to_owned(),
        digits: 1,
        pointers: vec![Some("/points".to_owned()); scores.len()],
    }];
    for name in names(scores, "/items", "item") {
        let meaning = "points";
        rows.push(listed_row(
            scores,
            &format!("Points, {name}"),
            meaning,
            1,
            ("/items", "item", &name, "points"),
        ));
    }
    rows
}

/// The rows of the score's summary.
pub fn summary(scores: &[Value]) -> Vec<Row> {
    let plain = SUMMARY.map(|(name, pointer, digits, meaning)| Row {
        name: name.to_owned(),
        meaning: meaning.to_owned(),
        digits,
        pointers: vec![Some(pointer.to_owned()); scores.len()],
    });
    let parts: BTreeSet<&String> = scores
        .iter()
        .filter_map(|score| score.pointer("/rounds/by_part")?.as_object())
        .flat_map(|parts| parts.keys())
        .collect();
    let of_part = |part: &&String| {
        let pointer = format!("/rounds/by_part/{part}");
        let pointers = scores.iter().map(|score| score.pointer(&pointer).map(|_| pointer.clone()));
        Row {
            name: format!("Hits, {part}"),
            meaning: "on hostile boats".to_owned(),
            digits: 0,
            pointers: pointers.collect(),
        }
    };
    plain.into_iter().chain(parts.iter().map(of_part)).collect()
}

/// The rows of misses by their largest cause.
fn causes(scores: &[Value]) -> Vec<Row> {
    let row = |name: &String| {
        listed_row(
            scores,
            &format!("Misses, {name}"),
            "rounds with this as their largest cause",
            0,
            ("/misses", "cause", name, "rounds"),
        )
    };
    names(scores, "/misses", "cause").iter().map(row).collect()
}

/// A row of an item that a list of the score has under a name.
fn listed_row(
    scores: &[Value],
    name: &str,
    meaning: &str,
    digits: usize,
    (list, key, item, field): (&str, &str, &str, &str),
) -> Row {
    let at = |score: &Value| {
        let entries = score.pointer(list)?.as_array()?;
        let i = entries.iter().position(|entry| entry[key].as_str() == Some(item))?;
        Some(format!("{list}/{i}/{field}"))
    };
    Row {
        name: name.to_owned(),
        meaning: meaning.to_owned(),
        digits,
        pointers: scores.iter().map(at).collect(),
    }
}

/// Names in a list of the scores, in the order in which they come first.
fn names(scores: &[Value], list: &str, key: &str) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for entry in scores.iter().filter_map(|score| score.pointer(list)?.as_array()).flatten() {
        if let Some(name) = entry[key].as_str()
            && !names.iter().any(|known| known == name)
        {
            names.push(name.to_owned());
        }
    }
    names
}

/// The table.
pub fn table(runs: &[ComparedRun], scores: &[Value]) -> Markup {
    /// Runs beside which paper has no room for meanings.
    const MANY: usize = 7;
    let many = (runs.len() >= MANY).then_some("many");
    let [points, summary, causes] = [points(scores), summary(scores), causes(scores)];
    html! {
        section.panel {
            h2 { "Score" }
            p.muted { (POINTS) }
            p.muted { "A dash: the score has no such item, since the scenario does not ask for it, there was none, or it is not known. The numbers are those of " code { "bowwave score --json" } "." }
            div.scroll tabindex="0" role="region" aria-label="Score of each run" { table.scores style={ "--runs:" (runs.len()) } {
                thead { tr {
                    th scope="col" { "Item" }
                    @for (i, run) in runs.iter().enumerate() {
                        th.number scope="col" {
                            a href={ "#run-" (i + 1) } { (mark(i)) " Run " (i + 1) }
                            br; small { (run.began()) }
                            br; small { (run.stored.run.scenario) }
                        }
                    }
                    th scope="col" class=[many] { "Meaning" }
                } }
                @for (title, rows) in [("Points", &points), ("Exercise", &summary), ("Misses by their largest cause", &causes)] {
                    @if !rows.is_empty() {
                        tbody {
                            tr.group { th scope="rowgroup" colspan=(runs.len() + 2) { (title) } }
                            @for row in rows { (line(row, scores, many)) }
                        }
                    }
                }
            } }
        }
    }
}

fn line(row: &Row, scores: &[Value], many: Option<&str>) -> Markup {
    html! {
        tr {
            th scope="row" { (row.name) }
            @for (i, pointer) in row.pointers.iter().enumerate() {
                @match pointer {
                    Some(pointer) => (Cells::of_run(&scores[i], i).number(pointer, row.digits)),
                    None => td.number { "-" },
                }
            }
            td class=(format!("muted {}", many.unwrap_or_default())) { (row.meaning) }
        }
    }
}
